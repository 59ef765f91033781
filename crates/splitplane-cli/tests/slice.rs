//! Pictures of splitting, pages on trees, and the tree card.

mod common;

use std::fs;
use std::path::Path;

use common::{folder, hills_scene, outcome, splitplane};
use splitplane::{Directions, TREES};

#[test]
fn a_slice_shows_planes_triangles_and_a_legend_for_every_tree() {
    let folder = folder();
    hills_scene(folder.path(), "");
    for spec in TREES {
        let (code, out, err) = outcome(splitplane(&folder).args([
            "slice",
            "hills.pbrt",
            "--tree",
            spec.name,
            "--axis",
            "y",
            "-o",
            "slice.svg",
        ]));
        assert_eq!(code, 0, "{err}");
        assert!(out.contains("wrote slice.svg"), "{out}");
        let svg = fs::read_to_string(folder.path().join("slice.svg")).unwrap();
        assert!(
            svg.starts_with("<svg ") && svg.ends_with("</svg>\n"),
            "{svg}"
        );
        assert!(svg.contains(&format!("<title>hills, {}", spec.name)));
        assert!(svg.contains("cut across y at 0.5") && svg.contains("down to the leaves"));
        assert!(svg.contains("ties tolerant, clipped, seed 0"));
        let only_axes = spec.directions == Directions::None && !spec.triangle_planes;
        assert_eq!(
            svg.contains("oblique planes (0)"),
            only_axes && !spec.objects
        );
        assert_eq!(svg.contains("sides of boxes"), spec.objects);
        // The hills have 24 triangles across.
        let triangles = svg.split("triangles (").nth(1).unwrap();
        let triangles: u32 = triangles.split(')').next().unwrap().parse().unwrap();
        assert!((12..=24).contains(&triangles), "{triangles}");
        let left = fs::read_dir(folder.path()).unwrap().count();
        assert_eq!(left, 2, "nothing unfinished stays");
    }
}

#[test]
fn the_same_slice_is_the_same_file_and_depth_zoom_and_width_change_it() {
    let folder = folder();
    hills_scene(folder.path(), "");
    let draw = |more: &[&str]| {
        let slice = [
            "slice",
            "hills.pbrt",
            "--tree",
            "wn+kd:6",
            "-o",
            "slice.svg",
        ];
        let (code, _, err) = outcome(splitplane(&folder).args(slice).args(more));
        assert_eq!(code, 0, "{err}");
        fs::read_to_string(folder.path().join("slice.svg")).unwrap()
    };
    let whole = draw(&[]);
    assert_eq!(whole, draw(&["--threads", "1"]));
    assert!(whole.len() < 300_000);
    let planes = |svg: &str| svg.matches("stroke-opacity").count();
    let top = draw(&["--depth", "2"]);
    assert!(top.contains("down to depth 2"));
    assert!(planes(&top) < planes(&whole));
    let nothing = draw(&["--depth", "0"]);
    assert!(nothing.contains("kd planes (0)") && nothing.contains("oblique planes (0)"));
    let detail = draw(&["--zoom", "0.4,0.6,0.4,0.6", "--width", "300"]);
    assert!(detail.contains("width=\"332\""), "{detail}");
    assert_ne!(draw(&["--at", "0.4"]), whole);
    assert_ne!(draw(&["--seed", "1"]), whole);
    assert!(draw(&["--ties", "published"]).contains("ties published"));
    assert!(draw(&["--clip", "off"]).contains("ties tolerant, seed 0"));
}

#[test]
fn a_slice_of_bad_input_ends_with_exit_code_2_and_leaves_no_file() {
    let folder = folder();
    hills_scene(folder.path(), "");
    for (arguments, word) in [
        (["--axis", "w", "-o", "a.svg"], "x, y, z"),
        (["--at", "1.5", "-o", "a.svg"], "from 0 to 1"),
        (["--at", "nan", "-o", "a.svg"], "from 0 to 1"),
        (["--zoom", "1,0,0,1", "-o", "a.svg"], "x0 < x1"),
        (["--width", "0", "-o", "a.svg"], "100..=65536"),
        (["--depth", "-1", "-o", "a.svg"], "0..=10000"),
        (["--axis", "x", "-o", "no/such/a.svg"], "no folder no/such"),
    ] {
        let slice = ["slice", "hills.pbrt", "--tree", "kd"];
        let (code, out, err) = outcome(splitplane(&folder).args(slice).args(arguments));
        assert_eq!((code, out.as_str()), (2, ""), "{arguments:?}");
        assert!(err.contains(word), "{arguments:?}: {err}");
    }
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
}

#[test]
fn every_tree_has_a_page_with_its_names_node_paper_and_commands_that_are_taken() {
    let folder = folder();
    for spec in TREES {
        let (code, page, err) = outcome(splitplane(&folder).args(["trees", spec.name]));
        assert_eq!(code, 0, "{err}");
        for part in [spec.thesis_name, spec.pbrt_name] {
            assert!(page.contains(part), "{part} in\n{page}");
        }
        assert!(
            page.contains(&format!("{} bytes", spec.node_bytes())),
            "{page}"
        );
        if let Some((min, max)) = spec.direction_counts() {
            assert!(page.contains(&format!("{min} to {max}")), "{page}");
        }
        assert!(
            page.lines().all(|line| line.chars().count() <= 100),
            "{page}"
        );
        let commands: Vec<&str> = (page.lines())
            .filter_map(|line| line.strip_prefix("  splitplane "))
            .collect();
        assert!(commands.len() >= 4);
        for command in commands {
            let words = command.split_whitespace();
            let (code, _, err) = outcome(splitplane(&folder).args(words).arg("--help"));
            assert_eq!(code, 0, "{command}: {err}");
        }
    }
    let (code, page, _) = outcome(splitplane(&folder).args(["trees", "BSP_wn+^Kd"]));
    assert_eq!(code, 0);
    assert!(page.contains("wn+kd:k"));
    let (code, _, err) = outcome(splitplane(&folder).args(["trees", "oak"]));
    assert_eq!(code, 2);
    assert!(err.contains("wn+kd:k"), "{err}");
}

#[test]
fn a_pbrt_file_with_the_accelerator_of_a_page_gets_that_tree() {
    let folder = folder();
    for spec in TREES {
        let (_, page, _) = outcome(splitplane(&folder).args(["trees", spec.name]));
        let accelerator = page.split("In a .pbrt file: ").nth(1).unwrap();
        hills_scene(folder.path(), accelerator);
        let render = ["render", "hills.pbrt", "--spp", "1", "--json", "run.json"];
        let (code, _, err) = outcome(splitplane(&folder).args(render));
        assert_eq!(code, 0, "{err}");
        let run = fs::read_to_string(folder.path().join("run.json")).unwrap();
        let run: serde_json::Value = serde_json::from_str(&run).unwrap();
        assert_eq!(run[0]["tree"], spec.name);
    }
}

#[test]
fn the_card_shows_what_won_where_nodes_are_and_where_the_tests_are() {
    let folder = folder();
    hills_scene(folder.path(), "");
    for spec in TREES {
        let (code, card, err) =
            outcome(splitplane(&folder).args(["build", "hills.pbrt", "--tree", spec.name]));
        assert_eq!(code, 0, "{err}");
        for part in [
            "split candidates",
            "by axes",
            "by planes of triangles",
            "interior nodes at depth",
            "of expected tests",
        ] {
            assert!(card.contains(part), "{part} in\n{card}");
        }
        let table = card.split("interior nodes at depth").nth(1).unwrap();
        let first = table.lines().nth(2).unwrap();
        assert!(first.trim_start().starts_with('0'), "{card}");
    }
}

#[test]
fn the_page_on_slices_shows_pictures_that_are_there_and_small() {
    let docs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs");
    let page = fs::read_to_string(docs.join("slices.md")).unwrap();
    let mut pictures = 0;
    for part in page.split("](").skip(1) {
        let picture = docs.join(part.split(')').next().unwrap());
        let size = fs::metadata(&picture).unwrap().len();
        assert!(size < 300_000, "{}", picture.display());
        pictures += 1;
    }
    let commands: Vec<&str> = (page.lines())
        .filter_map(|line| line.strip_prefix("splitplane "))
        .collect();
    assert_eq!(commands.len(), pictures);
    for command in commands {
        let words = command.split_whitespace();
        let (code, _, err) = outcome(splitplane(&folder()).args(words).arg("--help"));
        assert_eq!(code, 0, "{command}: {err}");
    }
}
