//! The cells of an experiment through HyperQueue.

mod common;

use std::fs;
use std::process::Command;

use common::{folder, hills_scene, outcome, splitplane};
use serde_json::Value;

/// A Python that has HyperQueue's package.
fn python() -> Option<&'static str> {
    ["python3", "python"].into_iter().find(|python| {
        let import = Command::new(python)
            .args(["-c", "import hyperqueue"])
            .output();
        import.is_ok_and(|output| output.status.success())
    })
}

#[test]
fn the_same_grid_through_hyperqueue_with_two_workers_gives_the_same_counters() {
    let Some(python) = python() else {
        eprintln!("skipped: HyperQueue is not here; `pip install hyperqueue` brings it");
        return;
    };
    let folder = folder();
    hills_scene(folder.path(), "");
    let text = "title = \"Hills\"\nscenes = [\"hills.pbrt\"]\nrepetitions = 2\n\
                trees = [\"kd\", \"wn+kd:6\", \"cn+kd:6\", \"ize\"]\n\
                [grid]\nties = [\"published\", \"tolerant\"]\n";
    fs::write(folder.path().join("hills.toml"), text).unwrap();
    let plan = [
        "plan",
        "hills.toml",
        "--out",
        "queue",
        "--adapter",
        "hyperqueue",
    ];
    let (code, out, err) = outcome(splitplane(&folder).args(plan));
    assert_eq!(code, 0, "{err}");
    assert!(out.contains("queue/hyperqueue-cells.py"), "{out}");
    let ran = Command::new(python)
        .current_dir(folder.path())
        .arg("queue/hyperqueue-cells.py")
        .args(["--local-workers", "2", "--splitplane"])
        .arg(env!("CARGO_BIN_EXE_splitplane"))
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&ran.stderr).into_owned();
    assert!(ran.status.success(), "{said}");
    let (code, out, err) = outcome(splitplane(&folder).args(["merge", "queue"]));
    assert_eq!(code, 0, "{err}\n{said}");
    assert!(out.contains("16 of 16 runs done"), "{out}\n{said}");
    let here = ["experiment", "hills.toml", "--out", "here"];
    let (code, _, err) = outcome(splitplane(&folder).args(here));
    assert_eq!(code, 0, "{err}");
    let results = |name: &str| -> Vec<Value> {
        let path = folder.path().join(name).join("results.json");
        serde_json::from_str(&fs::read_to_string(path).unwrap()).unwrap()
    };
    let (queue, here) = (results("queue"), results("here"));
    assert_eq!(queue.len(), here.len());
    for (queue, here) in queue.iter().zip(&here) {
        assert_eq!(queue["cell"]["id"], here["cell"]["id"]);
        let (queue, here) = (&queue["outcome"]["done"], &here["outcome"]["done"]);
        assert_eq!(queue["picture"], here["picture"]);
        assert_eq!(queue["tests_by_leaf_size"], here["tests_by_leaf_size"]);
        for field in [
            "nodes",
            "references",
            "rays",
            "triangle_tests",
            "kd_visits",
            "oblique_visits",
            "leaf_visits",
            "sah_cost",
        ] {
            assert!(!queue["record"][field].is_null(), "{field}");
            assert_eq!(queue["record"][field], here["record"][field], "{field}");
        }
    }
}
