//! A report, opened in a headless Chromium: no error, all plots drawn, the wipe works.

mod common;

use std::fs;
use std::process::Command;

use common::{folder, hills_scene, outcome, splitplane};

fn chromium() -> Option<&'static str> {
    ["chromium", "chromium-browser", "google-chrome"]
        .into_iter()
        .find(|name| Command::new(name).arg("--version").output().is_ok())
}

/// Runs once the page is done: uses it as a reader would, and writes what it saw into the page.
const PROBE: &str = r#"
<pre id="probe">waiting</pre>
<script>
const errors = [];
addEventListener("error", (event) => errors.push(event.message));
addEventListener("unhandledrejection", (event) => errors.push(String(event.reason)));
const seen = () => {
  const find = (selector) => document.querySelector(selector);
  const over = find('[data-role="over"]'), under = find('[data-role="under"]');
  const slider = find('[data-role="wipe"]');
  const sum = (canvas) => {
    const copy = document.createElement("canvas");
    [copy.width, copy.height] = [canvas.width, canvas.height];
    const context = copy.getContext("2d", { willReadFrequently: true });
    context.drawImage(canvas, 0, 0);
    return context.getImageData(0, 0, copy.width, copy.height).data.reduce((a, b) => a + b, 0);
  };
  const choose = (role, value) => {
    const select = find(`[data-role="${role}"]`);
    select.value = value;
    select.dispatchEvent(new Event("change"));
  };
  const report = { errors, plots: 0, empty: [] };
  for (const place of document.querySelectorAll("[data-plot]")) {
    const marks = place.querySelectorAll("svg .mark-rect path, svg .mark-line path, svg .mark-symbol path");
    if (marks.length > 0) report.plots += 1; else report.empty.push(place.dataset.plot);
  }
  report.clips = [20, 80].map((at) => {
    slider.value = at;
    slider.dispatchEvent(new Event("input"));
    return getComputedStyle(over).clipPath;
  });
  const box = find(".wipe").getBoundingClientRect();
  find(".wipe").dispatchEvent(new PointerEvent("pointermove", {
    clientX: box.left + 0.25 * box.width, clientY: box.top + 5, buttons: 1, bubbles: true,
  }));
  report.dragged = getComputedStyle(over).clipPath;
  const [left, right] = [sum(under), sum(over)];
  report.differ = left !== right;
  choose("right", "0");
  report.same = sum(over) === sum(under);
  choose("scale", "own");
  report.own = find('[data-role="bar-high"]').textContent.startsWith("left");
  choose("quantity", "1");
  report.other = find('[data-role="bar-middle"]').textContent;
  report.width = [document.documentElement.scrollWidth, innerWidth];
  const colour = () => getComputedStyle(document.body).backgroundColor;
  const before = colour();
  document.getElementById("theme").click();
  report.theme = before !== colour();
  document.getElementById("probe").textContent = "PROBE" + JSON.stringify(report) + "END";
};
const look = () => {
  const done = document.documentElement.dataset;
  if (errors.length || (done.plots && done.galleries)) seen(); else setTimeout(look, 50);
};
look();
</script>
"#;

#[test]
fn a_report_opens_without_an_error_draws_every_plot_and_wipes() {
    let Some(chromium) = chromium() else {
        eprintln!("skipped: Chromium is not here");
        return;
    };
    let folder = folder();
    hills_scene(folder.path(), "");
    let text = "title = \"Hills & <hills>\"\nscenes = [\"hills.pbrt\"]\ntimed = true\n\
                repetitions = 3\ntrees = [\"kd\", \"wn+kd:6\", \"cn\"]\n[grid]\nk = [3, 4, 6]\n";
    fs::write(folder.path().join("hills.toml"), text).unwrap();
    let run = ["experiment", "hills.toml", "--out", "e"];
    let (code, _, err) = outcome(splitplane(&folder).args(run));
    assert_eq!(code, 0, "{err}");
    let page = fs::read_to_string(folder.path().join("e/report.html")).unwrap();
    assert!(
        !page.contains("src=\"http") && !page.contains("href=\"http"),
        "no network"
    );
    let plots = page.matches("data-plot=").count();
    assert!(plots > 10, "{plots} plots");
    // The probe comes before the page's own scripts, so that it sees their errors.
    let probed = page.replacen(
        "<script type=\"application/json\"",
        &format!("{PROBE}<script type=\"application/json\""),
        1,
    );
    let path = folder.path().join("probed.html");
    fs::write(&path, probed).unwrap();
    // The narrowest window that there is without a screen.
    for width in [1280, 500] {
        let output = Command::new(chromium)
            .args([
                "--headless",
                "--no-sandbox",
                "--disable-gpu",
                "--disable-quic",
            ])
            .args([
                "--no-first-run",
                "--disable-background-networking",
                "--disable-sync",
            ])
            .args(["--disable-component-update", "--enable-logging=stderr"])
            .args(["--virtual-time-budget=60000", "--dump-dom"])
            .arg(format!("--window-size={width},900"))
            .arg(format!(
                "--user-data-dir={}",
                folder.path().join("user").display()
            ))
            .arg(format!("file://{}", path.display()))
            .output()
            .unwrap();
        let page = String::from_utf8_lossy(&output.stdout).into_owned();
        let log = String::from_utf8_lossy(&output.stderr).into_owned();
        let said: Vec<&str> = log
            .lines()
            .filter(|line| line.contains("CONSOLE"))
            .collect();
        assert!(said.is_empty(), "{said:?}");
        let probe = page
            .split("PROBE{")
            .nth(1)
            .and_then(|rest| rest.split("}END").next());
        let probe = probe.unwrap_or_else(|| panic!("the page was not done: {log}"));
        let probe = format!(
            "{{{}}}",
            probe
                .replace("&lt;", "<")
                .replace("&gt;", ">")
                .replace("&amp;", "&")
        );
        let probe: serde_json::Value = serde_json::from_str(&probe).unwrap();
        assert_eq!(probe["errors"], serde_json::json!([]));
        assert_eq!(probe["plots"], plots as u64, "{}", probe["empty"]);
        let clip = |at: &str| format!("inset(0px 0px 0px {at}%)");
        assert_eq!(probe["clips"], serde_json::json!([clip("20"), clip("80")]));
        assert_eq!(probe["dragged"], clip("25"));
        for check in ["differ", "same", "own", "theme"] {
            assert_eq!(probe[check], true, "{check}: {probe}");
        }
        assert!(
            probe["other"]
                .as_str()
                .unwrap()
                .contains("interior node visits"),
            "{probe}"
        );
        assert!(
            probe["width"][0].as_f64() <= probe["width"][1].as_f64(),
            "wider than the screen: {probe}"
        );
    }
}
