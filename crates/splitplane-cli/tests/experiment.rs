//! `splitplane experiment` and what belongs to it: nothing is lost, nothing counted twice.

mod common;

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant, SystemTime};

use common::{COUNTS, folder, hills_scene, outcome, splitplane};
use serde_json::Value;
use tempfile::TempDir;

/// An experiment on the hills, in a file; returns its name.
fn experiment(folder: &TempDir, more: &str, grid: &str) -> &'static str {
    hills_scene(folder.path(), "");
    let text = format!(
        "title = \"Hills\"\nscenes = [\"hills.pbrt\"]\n\
         trees = [\"kd\", \"wn+kd:6\", \"cn+kd:6\", \"random+kd\"]\n{more}\n[grid]\n{grid}\n"
    );
    fs::write(folder.path().join("hills.toml"), text).unwrap();
    "hills.toml"
}

fn json(path: &Path) -> Value {
    let text = fs::read_to_string(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    serde_json::from_str(&text).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

/// The counts of all cells, by scene, tree, conditions and repetition: all that does not depend on
/// the machine.
fn counts(folder: &Path) -> BTreeMap<String, Value> {
    let results = json(&folder.join("results.json"));
    let mut counts = BTreeMap::new();
    for result in results.as_array().unwrap() {
        let cell = &result["cell"];
        let key = format!(
            "{} {} {} {} {}",
            cell["scene"], cell["tree"], cell["k"], cell["conditions"], cell["repetition"]
        );
        let run = &result["outcome"]["done"];
        let mut kept = serde_json::Map::new();
        for field in COUNTS {
            assert!(!run["record"][field].is_null(), "{field} of {key}");
            kept.insert(field.to_owned(), run["record"][field].clone());
        }
        kept.insert("picture".to_owned(), run["picture"].clone());
        kept.insert("leaves".to_owned(), run["tests_by_leaf_size"].clone());
        let before = counts.insert(key.clone(), Value::Object(kept));
        assert!(before.is_none(), "{key} is there twice");
    }
    counts
}

#[test]
fn a_grid_gives_every_combination_once_with_a_report_beside() {
    let folder = folder();
    let file = experiment(
        &folder,
        "timed = true\nrepetitions = 2",
        "k = [4, 6]\nties = [\"published\", \"tolerant\"]",
    );
    let (code, out, err) = outcome(splitplane(&folder).args(["experiment", file, "--out", "e"]));
    assert_eq!(code, 0, "{err}\n{out}");
    // kd, wn+kd:6, cn+kd:6, and random+kd with both numbers of directions; twice each way of ties.
    assert!(out.contains("20 of 20 runs done"), "{out}");
    let e = folder.path().join("e");
    let counts = counts(&e);
    assert_eq!(counts.len(), 20);
    let results = json(&e.join("results.json"));
    for result in results.as_array().unwrap() {
        let record = &result["outcome"]["done"]["record"];
        assert_eq!(record["threads"], 1, "timed runs have one thread");
        assert_eq!(record["counted_while_timed"], false);
        assert_eq!(record["preset"], "thesis");
        let ties = &result["cell"]["conditions"]["ties"];
        assert_eq!(&record["build_params"]["ties"], ties);
        let pixels = e.join(format!(
            "cells/{}.exr",
            result["cell"]["id"].as_str().unwrap()
        ));
        assert_eq!(pixels.exists(), result["cell"]["repetition"] == 0);
    }
    // In turn: all trees of a repetition before any of the next.
    let plan = json(&e.join("plan.json"));
    let cells = plan["cells"].as_array().unwrap();
    let repetitions: Vec<&Value> = cells.iter().map(|cell| &cell["repetition"]).collect();
    assert!(
        repetitions
            .windows(2)
            .all(|w| w[0].as_u64() <= w[1].as_u64())
    );
    assert_ne!(cells[0]["tree"], cells[1]["tree"]);
    let csv = fs::read_to_string(e.join("results.csv")).unwrap();
    assert_eq!(csv.lines().count(), 21);
    assert!(
        csv.lines()
            .next()
            .unwrap()
            .contains("triangle_tests.shadow")
    );
    for name in [
        "report.html",
        "plots/hills-ties-published-render-time.svg",
        "plots/hills-ties-tolerant-tests-by-leaf-size.svg",
        "tables/hills-ties-published.csv",
        "pictures/hills-ties-published-wn+kd-6-triangle-tests-own-scale.png",
    ] {
        assert!(e.join(name).is_file(), "{name}");
    }
    let page = fs::read_to_string(e.join("report.html")).unwrap();
    for part in [
        "hills, ties tolerant",
        "Tree cards",
        "Medians of 2 runs in turn",
        "random+kd:4",
    ] {
        assert!(page.contains(part), "{part}");
    }
}

#[test]
fn a_scene_in_three_sizes_has_its_build_time_plotted_over_them() {
    let folder = folder();
    let text = "title = \"Growth\"\ntimed = true\npictures = false\n\
                scenes = [\"arcade:50000\", \"arcade:40000\", \"arcade:45000\"]\n\
                trees = [\"bvh\", \"framed\"]\n[grid]\nresolution = 16\nspp = 1\n";
    fs::write(folder.path().join("growth.toml"), text).unwrap();
    let (code, out, err) =
        outcome(splitplane(&folder).args(["experiment", "growth.toml", "--out", "e"]));
    assert_eq!(code, 0, "{err}\n{out}");
    let e = folder.path().join("e");
    let svg = fs::read_to_string(e.join("plots/arcade-build-time-over-size.svg")).unwrap();
    assert!(svg.contains("arcade: build time over n log"), "{svg}");
    // A point for each tree and size.
    assert_eq!(svg.matches("<circle").count(), 6, "{svg}");
    let page = fs::read_to_string(e.join("report.html")).unwrap();
    assert!(page.contains("Over the size"));
}

#[test]
fn a_folder_with_an_experiment_is_not_overwritten_and_resuming_runs_nothing_again() {
    let folder = folder();
    let file = experiment(&folder, "", "spp = 1");
    let run = |more: &[&str]| {
        let mut command = splitplane(&folder);
        command.args(["experiment", file, "--out", "e"]).args(more);
        outcome(&mut command)
    };
    assert_eq!(run(&[]).0, 0);
    let (code, _, err) = run(&[]);
    assert_eq!(code, 2);
    assert!(err.contains("--resume"), "{err}");
    let before = times(folder.path().join("e/cells"));
    let (code, out, err) = run(&["--resume"]);
    assert_eq!(code, 0, "{err}");
    assert!(err.contains("4 of 4 runs are done already"), "{err}{out}");
    assert_eq!(times(folder.path().join("e/cells")), before);
    // A tree more is a run more, and the others are kept.
    let text = fs::read_to_string(folder.path().join(file)).unwrap();
    let text = text.replace("\"random+kd\"]", "\"random+kd\", \"ize\"]");
    fs::write(folder.path().join(file), text).unwrap();
    let (code, out, _) = run(&["--resume"]);
    assert_eq!(code, 0);
    assert!(out.contains("5 of 5 runs done"), "{out}");
    let after = times(folder.path().join("e/cells"));
    assert!(
        before
            .iter()
            .all(|(path, time)| after.get(path) == Some(time))
    );
}

/// When each result of a folder was written.
fn times(cells: PathBuf) -> BTreeMap<PathBuf, SystemTime> {
    let entries = fs::read_dir(cells).into_iter().flatten().flatten();
    // A file that is still being written has a hidden name, and may be gone the next moment.
    entries
        .map(|entry| entry.path())
        .filter(|path| path.extension().is_some_and(|e| e == "json"))
        .filter(|path| !path.file_name().unwrap().to_string_lossy().starts_with('.'))
        .map(|path| {
            let written = fs::metadata(&path).unwrap().modified().unwrap();
            (path, written)
        })
        .collect()
}

fn start(folder: &TempDir, arguments: &[&str]) -> Child {
    Command::new(env!("CARGO_BIN_EXE_splitplane"))
        .current_dir(folder.path())
        .env_remove("SPLITPLANE_SCENES")
        .args(arguments)
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap()
}

#[test]
fn an_experiment_that_is_killed_ten_times_loses_nothing_and_counts_nothing_twice() {
    let folder = folder();
    let file = experiment(
        &folder,
        "timed = true\nrepetitions = 4",
        "seed = [0, 1, 2]\nspp = 1",
    );
    let total = 4 * 4 * 3;
    let arguments = ["experiment", file, "--out", "killed", "--resume", "--quiet"];
    let cells = || times(folder.path().join("killed/cells"));
    let mut before: BTreeMap<std::path::PathBuf, _> = BTreeMap::new();
    let mut wait = 1_u64;
    for kill in 0..10 {
        let mut running = start(&folder, &arguments);
        // At least one run further each time, and then at any moment.
        let deadline = Instant::now() + Duration::from_secs(120);
        while cells().len() <= before.len() {
            assert!(
                Instant::now() < deadline,
                "nothing was done after kill {kill}"
            );
            std::thread::sleep(Duration::from_millis(2));
        }
        wait = wait.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(7);
        std::thread::sleep(Duration::from_millis((wait >> 33) % 40));
        running.kill().unwrap();
        running.wait().unwrap();
        let after = cells();
        // What was done is there, as it was written.
        for (path, time) in &before {
            assert_eq!(after.get(path), Some(time), "{}", path.display());
        }
        for path in after.keys() {
            assert!(
                json(path)["outcome"]["done"].is_object(),
                "{}",
                path.display()
            );
        }
        assert!(
            after.len() < total,
            "all was done before it was killed {} times",
            kill + 1
        );
        before = after;
    }
    let (code, out, err) = outcome(splitplane(&folder).args(arguments));
    assert_eq!(code, 0, "{err}");
    assert!(out.contains("48 of 48 runs done"), "{out}");
    let after = cells();
    assert_eq!(after.len(), total);
    assert!(
        before
            .iter()
            .all(|(path, time)| after.get(path) == Some(time))
    );
    let hidden = fs::read_dir(folder.path().join("killed/cells"))
        .unwrap()
        .flatten();
    let hidden = hidden.filter(|e| e.file_name().to_string_lossy().starts_with('.'));
    assert_eq!(hidden.count(), 0, "something unfinished was left");
    let (code, _, err) =
        outcome(splitplane(&folder).args(["experiment", file, "--out", "whole", "--quiet"]));
    assert_eq!(code, 0, "{err}");
    let whole = counts(&folder.path().join("whole"));
    assert_eq!(whole.len(), total);
    assert_eq!(counts(&folder.path().join("killed")), whole);
}

#[test]
#[cfg(unix)]
fn a_worker_ends_when_the_process_is_killed_that_started_it() {
    let folder = folder();
    // Large enough to be at work for a while.
    let text = "title = \"Long\"\nscenes = [\"arcade:40000\"]\ntrees = [\"cn+kd:6\"]\n";
    fs::write(folder.path().join("long.toml"), text).unwrap();
    let mut running = start(&folder, &["experiment", "long.toml", "--out", "e"]);
    let cell = || {
        let plan = fs::read_to_string(folder.path().join("e/plan.json")).ok()?;
        let plan: Value = serde_json::from_str(&plan).ok()?;
        Some(plan["cells"][0]["id"].as_str()?.to_owned())
    };
    let workers = || {
        let Some(id) = cell() else { return 0 };
        let processes = fs::read_dir("/proc").into_iter().flatten().flatten();
        let lines = processes.filter_map(|p| fs::read(p.path().join("cmdline")).ok());
        lines
            .filter(|line| String::from_utf8_lossy(line).contains(&id))
            .count()
    };
    if !Path::new("/proc/self/cmdline").exists() {
        eprintln!("skipped: this system has no /proc to see processes in");
        running.kill().unwrap();
        running.wait().unwrap();
        return;
    }
    let until = |wanted: usize| {
        let deadline = Instant::now() + Duration::from_secs(60);
        while workers() != wanted {
            assert!(
                Instant::now() < deadline,
                "{} workers, not {wanted}",
                workers()
            );
            std::thread::sleep(Duration::from_millis(5));
        }
    };
    until(1);
    running.kill().unwrap();
    running.wait().unwrap();
    until(0);
    assert_eq!(times(folder.path().join("e/cells")).len(), 0);
}

#[test]
fn a_run_past_its_limit_is_a_line_with_its_reason_and_the_others_go_on() {
    let folder = folder();
    hills_scene(folder.path(), "");
    let text = "title = \"Limits\"\ntime_limit_s = 2\ntrees = [\"kd\"]\n\
                scenes = [\"hills.pbrt\", { name = \"hills.pbrt\", label = \"endless\", \
                spp = 1000000, resolution = 2000 }]\n";
    fs::write(folder.path().join("limits.toml"), text).unwrap();
    let (code, out, err) =
        outcome(splitplane(&folder).args(["experiment", "limits.toml", "--out", "e"]));
    assert_eq!(code, 0, "{err}");
    assert!(out.contains("1 of 2 runs done, 1 failed"), "{out}");
    let reason = "it ran past its limit of 2 s";
    assert!(out.contains(reason) && err.contains(reason), "{out}{err}");
    let e = folder.path().join("e");
    let page = fs::read_to_string(e.join("report.html")).unwrap();
    assert!(page.contains(reason));
    let csv = fs::read_to_string(e.join("results.csv")).unwrap();
    assert!(csv.contains(reason), "{csv}");
    // Resuming leaves it at that, unless it is asked for.
    let again = ["experiment", "limits.toml", "--out", "e", "--resume"];
    let before = times(e.join("cells"));
    assert_eq!(outcome(splitplane(&folder).args(again)).0, 0);
    assert_eq!(times(e.join("cells")), before);
    let retried = outcome(splitplane(&folder).args(again).arg("--retry-failed"));
    assert_eq!(retried.0, 0, "{}", retried.2);
    let after = times(e.join("cells"));
    assert_eq!(after.len(), 2);
    assert_ne!(after, before);
}

#[test]
#[cfg(unix)]
fn a_run_that_crashes_is_a_line_with_its_signal() {
    let folder = folder();
    let text = "title = \"Crash\"\nscenes = [\"arcade:40000\"]\ntrees = [\"cn+kd:6\"]\n";
    fs::write(folder.path().join("crash.toml"), text).unwrap();
    let plan = ["plan", "crash.toml", "--out", "e"];
    assert_eq!(outcome(splitplane(&folder).args(plan)).0, 0);
    let plan = json(&folder.path().join("e/plan.json"));
    let id = plan["cells"][0]["id"].as_str().unwrap().to_owned();
    if !Path::new("/proc/self/cmdline").exists() {
        eprintln!("skipped: this system has no /proc to see processes in");
        return;
    }
    let mut running = start(&folder, &["run-cell", "e", "0"]);
    let deadline = Instant::now() + Duration::from_secs(60);
    let worker = loop {
        assert!(Instant::now() < deadline, "no worker");
        let found = fs::read_dir("/proc").unwrap().flatten().find(|process| {
            let line = fs::read(process.path().join("cmdline")).unwrap_or_default();
            let line = String::from_utf8_lossy(&line).into_owned();
            line.contains(&id) && line.contains("--worker")
        });
        match found {
            Some(process) => break process.file_name().into_string().unwrap(),
            None => std::thread::sleep(Duration::from_millis(5)),
        }
    };
    let killed = Command::new("kill")
        .args(["-ABRT", &worker])
        .status()
        .unwrap();
    assert!(killed.success());
    assert_eq!(running.wait().unwrap().code(), Some(0));
    let result = json(&folder.path().join(format!("e/cells/{id}.json")));
    let reason = result["outcome"]["failed"]["reason"].as_str().unwrap();
    assert!(reason.contains("it crashed (signal 6)"), "{reason}");
}

#[test]
fn cells_run_one_by_one_in_any_order_and_gathered_from_two_folders_give_the_same() {
    let folder = folder();
    let file = experiment(&folder, "", "spp = 1");
    for out in ["a", "b"] {
        let plan = ["plan", file, "--out", out, "--adapter", "slurm"];
        let (code, printed, err) = outcome(splitplane(&folder).args(plan));
        assert_eq!(code, 0, "{err}");
        assert!(printed.contains("4 runs that only count"), "{printed}");
    }
    let script = fs::read_to_string(folder.path().join("a/slurm-cells.sh")).unwrap();
    assert!(script.contains("#SBATCH --array=0-3\n"), "{script}");
    assert!(
        script.contains("#SBATCH --cpus-per-task=1\n") && !script.contains('@'),
        "{script}"
    );
    // As an engine would: any order, some twice, on two machines.
    for (out, cell) in [("a", "3"), ("b", "0"), ("a", "2"), ("a", "3"), ("b", "1")] {
        let (code, _, err) = outcome(splitplane(&folder).args(["run-cell", out, cell]));
        assert_eq!(code, 0, "{err}");
    }
    let (code, out, _) = outcome(splitplane(&folder).args(["merge", "a"]));
    assert_eq!(code, 0);
    assert!(out.contains("2 of 4 runs done, 2 still to be run"), "{out}");
    let (code, out, err) = outcome(splitplane(&folder).args(["merge", "a", "--from", "b"]));
    assert_eq!(code, 0, "{err}");
    assert!(
        out.contains("2 results from b") && out.contains("4 of 4 runs done"),
        "{out}"
    );
    // What is there already is no result of another plan.
    let (code, out, err) = outcome(splitplane(&folder).args(["merge", "a", "--from", "b"]));
    assert_eq!((code, &*err), (0, ""));
    assert!(out.contains("0 results from b"), "{out}");
    fs::create_dir(folder.path().join("other")).unwrap();
    let (code, out, err) = outcome(splitplane(&folder).args(["merge", "a", "--from", "other"]));
    assert_eq!(code, 0, "{err}");
    assert!(
        err.contains("warning: other holds no result of this plan"),
        "{err}"
    );
    assert!(!out.contains("from other"), "{out}");
    let (code, _, err) = outcome(splitplane(&folder).args(["merge", "a", "--from", "nosuch"]));
    assert_eq!(code, 2);
    assert!(
        err.contains("nosuch") && err.contains("no such folder"),
        "{err}"
    );
    let whole = ["experiment", file, "--out", "whole"];
    assert_eq!(outcome(splitplane(&folder).args(whole)).0, 0);
    let here = |name: &str| counts(&folder.path().join(name));
    assert_eq!(here("a"), here("whole"));
}

#[test]
fn a_result_of_another_scene_or_a_damaged_one_is_told_of() {
    let folder = folder();
    let file = experiment(&folder, "", "spp = 1");
    assert_eq!(
        outcome(splitplane(&folder).args(["plan", file, "--out", "e"])).0,
        0
    );
    let text = fs::read_to_string(folder.path().join("hills.pbrt")).unwrap();
    let moved = text.replace("LookAt 0 0 0", "LookAt 0 0 -1");
    fs::write(folder.path().join("hills.pbrt"), moved).unwrap();
    let (code, _, err) = outcome(splitplane(&folder).args(["run-cell", "e", "0"]));
    assert_eq!(code, 2);
    assert!(err.contains("not the one that was planned"), "{err}");
    let cells = || times(folder.path().join("e/cells")).len();
    assert_eq!(cells(), 0, "it is not the cell that failed");
    let plan = json(&folder.path().join("e/plan.json"));
    let id = plan["cells"][1]["id"].as_str().unwrap();
    fs::write(folder.path().join(format!("e/cells/{id}.json")), "{").unwrap();
    let (code, _, err) = outcome(splitplane(&folder).args(["merge", "e"]));
    assert_eq!(code, 2);
    assert!(err.contains(id) && err.contains("damaged"), "{err}");
    let (code, _, err) = outcome(splitplane(&folder).args(["run-cell", "e", "99"]));
    assert_eq!(code, 2);
    assert!(
        err.contains("no cell 99") && err.contains("0 to 3"),
        "{err}"
    );
    let (code, _, err) = outcome(splitplane(&folder).args(["merge", "nowhere"]));
    assert_eq!(code, 2);
    assert!(err.contains("nowhere holds no experiment"), "{err}");
}

#[test]
fn cells_are_run_from_any_folder() {
    let folder = folder();
    hills_scene(folder.path(), "");
    let scenes = folder.path().join("scenes/knolls");
    fs::create_dir_all(&scenes).unwrap();
    fs::copy(folder.path().join("hills.pbrt"), scenes.join("knolls.pbrt")).unwrap();
    let text = "title = \"Far\"\nscenes = [\"hills.pbrt\", \"knolls\"]\ntrees = [\"kd\"]\n";
    fs::write(folder.path().join("far.toml"), text).unwrap();
    let plan = ["plan", "far.toml", "--out", "e", "--scenes", "scenes"];
    let (code, _, err) = outcome(splitplane(&folder).args(plan));
    assert_eq!(code, 0, "{err}");
    let inside = folder.path().join("e");
    for cell in ["0", "1"] {
        let run = ["run-cell", ".", cell];
        let (code, _, err) = outcome(splitplane(&folder).current_dir(&inside).args(run));
        assert_eq!(code, 0, "{err}");
    }
    let (_, out, _) = outcome(splitplane(&folder).args(["merge", "e"]));
    assert!(out.contains("2 of 2 runs done"), "{out}");
    // A scene that is gone is no fault of the cell: there is no result, and it can be run later.
    let gone = ["plan", "far.toml", "--out", "gone", "--scenes", "scenes"];
    assert_eq!(outcome(splitplane(&folder).args(gone)).0, 0);
    fs::remove_file(folder.path().join("hills.pbrt")).unwrap();
    let (code, _, err) = outcome(splitplane(&folder).args(["run-cell", "gone", "0"]));
    assert_eq!(code, 2);
    assert!(err.contains("hills.pbrt"), "{err}");
    assert!(times(folder.path().join("gone/cells")).is_empty());
}

#[test]
fn an_experiment_that_cannot_be_read_or_kept_leaves_nothing_behind() {
    let folder = folder();
    let file = experiment(&folder, "", "spp = \"one\"");
    let (code, _, err) = outcome(splitplane(&folder).args(["experiment", file, "--out", "e"]));
    assert_eq!(code, 2);
    assert!(
        err.contains("spp") && err.contains("a whole number"),
        "{err}"
    );
    assert!(!folder.path().join("e").exists());
    let file = experiment(&folder, "", "spp = 1");
    fs::write(folder.path().join("e"), "a file").unwrap();
    let (code, _, err) = outcome(splitplane(&folder).args(["experiment", file, "--out", "e"]));
    assert_eq!(code, 2);
    assert!(err.contains("cannot be written"), "{err}");
    let text = fs::read_to_string(folder.path().join(file)).unwrap();
    let twice = text.replace(
        "[\"hills.pbrt\"]",
        "[\"hills.pbrt\", { name = \"hills.pbrt\", spp = 2 }]",
    );
    fs::write(folder.path().join(file), twice).unwrap();
    let (code, _, err) = outcome(splitplane(&folder).args(["plan", file, "--out", "p"]));
    assert_eq!(code, 2);
    assert!(
        err.contains("hills.toml:2:25") && err.contains("another label"),
        "{err}"
    );
}

#[test]
fn what_is_wrong_with_an_experiment_is_shown_in_its_file() {
    let folder = folder();
    let file = experiment(&folder, "", "tys = \"tolerant\"");
    let (code, _, err) = outcome(splitplane(&folder).args(["experiment", file, "--out", "e"]));
    assert_eq!(code, 2);
    assert!(
        err.contains("hills.toml:6:7") && err.contains("tys"),
        "{err}"
    );
    assert!(
        err.contains("tys = \"tolerant\""),
        "the line is shown: {err}"
    );
    let (code, _, err) = outcome(splitplane(&folder).args(["experiment", "none.toml"]));
    assert_eq!(code, 2);
    assert!(err.contains("none.toml"), "{err}");
}

#[test]
fn every_experiment_that_ships_can_be_planned() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let mut planned = 0;
    for entry in fs::read_dir(root.join("experiments")).unwrap().flatten() {
        let path = entry.path();
        if path.extension().is_none_or(|extension| extension != "toml") {
            continue;
        }
        for quick in [true, false] {
            let experiment = splitplane_lab::experiment::Experiment::read(&path, quick);
            let experiment = experiment.unwrap_or_else(|e| panic!("{e}"));
            assert!(!experiment.description.is_empty(), "{}", path.display());
            planned += 1;
        }
    }
    assert!(planned >= 6, "{planned}");
}

#[test]
fn a_comparison_writes_the_same_report() {
    let folder = folder();
    hills_scene(folder.path(), "");
    let compare = ["compare", "hills.pbrt", "--trees", "kd,wn+kd:6", "--report"];
    let (code, out, err) = outcome(splitplane(&folder).args(compare).args(["--repeat", "3"]));
    assert_eq!(code, 0, "{err}");
    assert!(out.contains("report: out/report.html"), "{out}");
    let page = fs::read_to_string(folder.path().join("out/report.html")).unwrap();
    for part in [
        "Trees on hills",
        "Medians of 3 runs in turn",
        "splitplane compare hills.pbrt --trees kd,wn+kd:6 --report --repeat 3",
        "data-gallery",
    ] {
        assert!(page.contains(part), "{part}");
    }
    assert!(
        folder
            .path()
            .join("out/plots/hills-render-time.svg")
            .is_file()
    );
}
