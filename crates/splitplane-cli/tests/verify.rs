//! `splitplane verify`.

mod common;

use common::{folder, hills_scene, outcome, splitplane};
use splitplane::{Layout, TREES};

#[test]
fn every_tree_is_asked_and_none_is_wrong() {
    let folder = folder();
    let (code, out, err) = outcome(splitplane(&folder).args(["verify", "--rays", "300"]));
    assert_eq!((code, err.as_str()), (0, ""), "{out}");
    for spec in TREES {
        for layout in Layout::ALL {
            let line = out.lines().find(|line| {
                let mut words = line.split_whitespace();
                let name = words.next().unwrap_or_default().trim_end_matches(',');
                name.split(':').next() == Some(spec.name) && words.next() == Some(layout.name())
            });
            let line = line.unwrap_or_else(|| panic!("{}, {layout}:\n{out}", spec.name));
            assert!(
                line.split_whitespace().skip(2).all(|cell| cell == "0"),
                "{line}"
            );
        }
    }
}

#[test]
fn a_wrong_answer_is_exit_code_1() {
    let folder = folder();
    let (code, out, err) = outcome(splitplane(&folder).args([
        "verify",
        "--rays",
        "3000",
        "--trees",
        "wn+kd:6",
        "--preset",
        "thesis",
        "--traversal",
        "published",
        "--markdown",
    ]));
    assert_eq!(code, 1, "{out}");
    assert!(out.contains("| brute force | 0 | 0 |"), "{out}");
    assert!(out.contains("missed"), "{out}");
    assert!(err.contains("wrong"), "{err}");
}

#[test]
fn a_scene_of_ones_own_is_asked() {
    let folder = folder();
    hills_scene(folder.path(), "");
    let (code, out, err) = outcome(splitplane(&folder).args([
        "verify",
        "hills.pbrt",
        "--rays",
        "500",
        "--trees",
        "kd,bvh",
        "--quiet",
    ]));
    assert_eq!((code, err.as_str()), (0, ""), "{out}");
    assert!(out.contains("spawned"), "{out}");
}

#[test]
fn a_number_of_rays_that_is_none_is_refused() {
    let folder = folder();
    let (code, _, err) = outcome(splitplane(&folder).args(["verify", "--rays", "lots"]));
    assert_eq!(code, 2);
    assert!(err.contains("such as 100000 or 1e5"), "{err}");
}
