//! `splitplane compare` and `splitplane render`, from a scene file to pictures and records.

mod common;

use std::fs;
use std::path::Path;

use common::{COUNTS, folder, hills_scene, outcome, splitplane};
use serde_json::Value;
use splitplane::TREES;

fn records(path: &Path) -> Vec<Value> {
    let text = std::fs::read_to_string(path).unwrap();
    serde_json::from_str(&text).unwrap()
}

fn all_trees() -> String {
    let names: Vec<&str> = TREES.iter().map(|spec| spec.name).collect();
    names.join(",")
}

#[test]
fn a_comparison_of_all_trees_writes_pictures_and_records_and_says_where() {
    let folder = folder();
    hills_scene(folder.path(), "");
    let (code, out, err) = outcome(splitplane(&folder).args([
        "compare",
        "hills.pbrt",
        "--repeat",
        "2",
        "--trees",
        &all_trees(),
    ]));
    assert_eq!(code, 0, "{err}");
    assert!(out.contains("identical, bit by bit"), "{out}");
    for row in [
        "render time",
        "build time",
        "oblique",
        "empty leaves",
        "SAH cost",
        "triangle tests",
        "interior node visits",
        "camera rays",
        "bounce rays",
        "shadow rays",
        "100.0 %",
        "medians of 2",
        "published",
        "Peak memory",
    ] {
        assert!(out.contains(row), "no {row} in\n{out}");
    }
    let records = records(&folder.path().join("out/hills.json"));
    assert_eq!(records.len(), 2 * TREES.len());
    for (i, record) in records.iter().enumerate() {
        let spec = &TREES[i % TREES.len()];
        assert_eq!(record["tree"], spec.name);
        assert_eq!(record["k"].is_null(), !spec.takes_direction_count());
        assert_eq!(record["repetition"], (i / TREES.len()) as u64);
        assert_eq!(record["scene"], "hills");
        for (field, value) in [
            ("triangles", 288),
            ("seed", 0),
            ("spp", 2),
            ("width", 24),
            ("height", 16),
            ("max_depth", 3),
        ] {
            assert_eq!(record[field], value, "{field}");
        }
        for field in ["build_s", "render_s", "sah_cost"] {
            assert!(record[field].as_f64().unwrap() > 0.0, "{field}");
        }
        for field in ["threads", "references", "depth", "tree_bytes"] {
            assert!(record[field].as_u64().unwrap() > 0, "{field}");
        }
        assert!(record["bad_refines"].is_u64());
        for kind in ["kd", "oblique", "leaf", "empty_leaf"] {
            assert!(record["nodes"][kind].is_u64(), "nodes.{kind}");
        }
        for field in [
            "rays",
            "triangle_tests",
            "kd_visits",
            "oblique_visits",
            "leaf_visits",
        ] {
            for kind in ["camera", "bounce", "shadow"] {
                assert!(record[field][kind].is_u64(), "{field}.{kind}");
            }
        }
        assert_eq!(record["rays"]["camera"], 24 * 16 * 2);
        for field in ["cpu", "os"] {
            assert!(!record["machine"][field].as_str().unwrap().is_empty());
        }
        assert!(record["machine"]["cores"].as_u64().unwrap() > 0);
        assert!(record["machine"].get("load_1m").is_some());
        assert_eq!(record["version"], env!("CARGO_PKG_VERSION"));
        assert!(!record["commit"].as_str().unwrap().is_empty());
    }
    // All that was said to be written is there, and nothing else.
    let mut said: Vec<&str> = out
        .lines()
        .filter_map(|line| line.split_once(": out/").map(|(_, name)| name))
        .collect();
    let mut there: Vec<String> = std::fs::read_dir(folder.path().join("out"))
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    said.sort_unstable();
    there.sort_unstable();
    assert_eq!(said, there);
    // One picture, one table of records; per tree one EXR and two pictures in false colour.
    assert_eq!(there.len(), 2 + 3 * TREES.len());
}

#[test]
fn counters_and_pictures_do_not_depend_on_the_number_of_threads() {
    let folder = folder();
    hills_scene(folder.path(), "");
    for threads in ["1", "2"] {
        let (code, _, err) = outcome(splitplane(&folder).args([
            "compare",
            "hills.pbrt",
            "--trees",
            &all_trees(),
            "--threads",
            threads,
            "--out",
            threads,
        ]));
        assert_eq!(code, 0, "{err}");
    }
    let of = |threads: &str| records(&folder.path().join(threads).join("hills.json"));
    for (one, two) in of("1").iter().zip(&of("2")) {
        assert_eq!((&one["threads"], &two["threads"]), (&1.into(), &2.into()));
        for field in COUNTS {
            assert_eq!(one[field], two[field], "{field} of {}", one["tree"]);
        }
    }
    let png = |threads| std::fs::read(folder.path().join(threads).join("hills.png")).unwrap();
    assert!(png("1") == png("2"));
    // Of the EXR file all but its header, which has the time of the rendering.
    let exr = |threads| {
        let path = folder.path().join(threads).join("hills-kd.exr");
        exr::prelude::read_first_flat_layer_from_file(path)
            .unwrap()
            .layer_data
            .channel_data
    };
    assert!(exr("1") == exr("2"));
}

#[test]
fn options_stand_in_for_what_the_scene_says() {
    let folder = folder();
    hills_scene(folder.path(), "");
    let (code, out, err) = outcome(splitplane(&folder).args([
        "compare",
        "hills.pbrt",
        "--trees",
        "kd",
        "--spp",
        "1",
        "--resolution",
        "48",
        "--crop",
        "0,0.5,0,1",
        "--max-depth",
        "0",
        "--seed",
        "7",
        "--ties",
        "tolerant",
        "--pricing",
        "fork",
        "--json",
        "record.json",
        "--out",
        "pictures/of/hills",
        "--quiet",
    ]));
    assert_eq!(code, 0, "{err}");
    assert_eq!(err, "");
    assert!(out.contains("record.json"), "{out}");
    let records = records(&folder.path().join("record.json"));
    let record = &records[0];
    for (field, value) in [
        ("spp", 1),
        ("width", 48),
        ("height", 32),
        ("pixels", 24 * 32),
        ("max_depth", 0),
        ("seed", 7),
    ] {
        assert_eq!(record[field], value, "{field}");
    }
    assert_eq!(record["rays"]["bounce"], 0);
    assert_eq!(record["preset"], "thesis");
    assert_eq!(record["build_params"]["ties"], "tolerant");
    assert_eq!(record["build_params"]["oblique_pricing"], "fork");
    assert!(folder.path().join("pictures/of/hills/hills.png").is_file());
    assert!(!folder.path().join("pictures/of/hills/hills.json").exists());
}

#[test]
fn a_rendering_takes_the_tree_that_the_scene_names() {
    for spec in TREES {
        let folder = folder();
        let accelerator = if spec.pbrt_name.is_empty() {
            spec.name
        } else {
            spec.pbrt_name
        };
        hills_scene(folder.path(), &format!("Accelerator \"{accelerator}\""));
        let (code, _, err) =
            outcome(splitplane(&folder).args(["render", "hills.pbrt", "--json", "record.json"]));
        assert_eq!(code, 0, "{err}");
        let records = records(&folder.path().join("record.json"));
        assert_eq!(records.len(), 1);
        assert_eq!(records[0]["tree"], spec.name);
        assert_eq!(records[0]["counted_while_timed"], true);
        assert!(folder.path().join("out/hills.png").is_file());
        assert!(folder.path().join("out/hills.exr").is_file());
    }
}

#[test]
fn values_are_put_in_place_of_names_in_a_template() {
    let folder = folder();
    hills_scene(folder.path(), "Accelerator \"$tree\"");
    let render = ["render", "hills.pbrt", "--json", "record.json"];
    let (code, _, err) = outcome(
        splitplane(&folder)
            .args(render)
            .args(["--define", "tree=wn+kd"]),
    );
    assert_eq!(code, 0, "{err}");
    assert_eq!(
        records(&folder.path().join("record.json"))[0]["tree"],
        "wn+kd"
    );
}

#[test]
fn a_record_says_in_which_layout_it_was_timed_and_counted() {
    let folder = folder();
    hills_scene(folder.path(), "");
    let with = |more: &[&str]| {
        let mut arguments = vec!["compare", "hills.pbrt", "--trees", "kd,wn+kd:6"];
        arguments.extend(more);
        let (code, out, err) = outcome(splitplane(&folder).args(arguments));
        assert_eq!(code, 0, "{err}");
        (records(&folder.path().join("out/hills.json")), out)
    };
    let (usual, text) = with(&[]);
    assert!(
        text.contains("timed in the wide layout, counted in the binary one"),
        "{text}"
    );
    let (binary, _) = with(&["--layout", "binary"]);
    let (wide, _) = with(&["--layout", "wide"]);
    let (published, _) = with(&["--traversal", "published"]);
    for (records, timed, counted) in [
        (&usual, "wide", "binary"),
        (&binary, "binary", "binary"),
        (&wide, "wide", "wide"),
        (&published, "binary", "binary"),
    ] {
        for record in records {
            assert_eq!(record["layout"], timed);
            assert_eq!(record["counts_layout"], counted);
            assert_eq!(record["layout_s"].is_null(), timed == "binary");
            assert_eq!(record["wide_bytes"].is_null(), timed == "binary");
            let visits = |kind: &str| record[kind]["camera"].as_u64().unwrap();
            let binary = visits("kd_visits") + visits("oblique_visits");
            assert_eq!(binary > 0, counted == "binary");
            assert_eq!(visits("wide_visits") > 0, counted == "wide");
        }
    }
    for (usual, binary) in usual.iter().zip(&binary) {
        for field in [
            "triangle_tests",
            "kd_visits",
            "oblique_visits",
            "tree_bytes",
        ] {
            assert_eq!(usual[field], binary[field], "{field}");
        }
    }
    let (code, _, err) = outcome(splitplane(&folder).args([
        "render",
        "hills.pbrt",
        "--layout",
        "wide",
        "--traversal",
        "published",
    ]));
    assert_eq!(code, 2);
    assert!(err.contains("the exact traversal only"), "{err}");
    let (code, _, err) = outcome(splitplane(&folder).args([
        "build",
        "hills.pbrt",
        "--tree",
        "kd",
        "--layout",
        "flat",
    ]));
    assert_eq!(code, 2);
    assert!(err.contains("binary and wide"), "{err}");
}

#[test]
fn instances_are_kept_unless_they_are_to_be_flattened() {
    let folder = folder();
    let scene = "Film \"image\" \"integer xresolution\" 24 \"integer yresolution\" 16\n\
        LookAt 0 1 -9  0 0 0  0 1 0\nCamera \"perspective\" \"float fov\" 40\n\
        Sampler \"halton\" \"integer pixelsamples\" 2\nWorldBegin\n\
        LightSource \"infinite\" \"rgb L\" [.3 .4 .5]\n\
        ObjectBegin \"ball\"\nShape \"sphere\"\nObjectEnd\n\
        AttributeBegin\nTranslate -2 0 0\nScale 1 -.6 1\nObjectInstance \"ball\"\nAttributeEnd\n\
        AttributeBegin\nTranslate 2 0 1\nObjectInstance \"ball\"\nAttributeEnd\nWorldEnd\n";
    fs::write(folder.path().join("balls.pbrt"), scene).unwrap();
    let compare = |more: &[&str]| {
        let trees = [
            "compare",
            "balls.pbrt",
            "--trees",
            "kd,wn+kd:6,framed",
            "--out",
            "o",
        ];
        let (code, _, err) = outcome(splitplane(&folder).args(trees).args(more));
        assert_eq!(code, 0, "all pictures are the same: {err}");
        let text = fs::read_to_string(folder.path().join("o/balls.json")).unwrap();
        let records: serde_json::Value = serde_json::from_str(&text).unwrap();
        (records[0].clone(), err)
    };
    let (kept, note) = compare(&[]);
    assert!(note.contains("2 object instances kept"), "{note}");
    let (flat, note) = compare(&["--flatten"]);
    assert!(note.contains("2 object instances copied"), "{note}");
    assert_eq!(
        (&kept["instances_kept"], &flat["instances_kept"]),
        (&true.into(), &false.into())
    );
    for field in ["triangles", "instances", "unique_triangles"] {
        assert_eq!(kept[field], flat[field], "{field}");
    }
    let of = |record: &serde_json::Value, field: &str| record[field].as_u64().unwrap();
    assert_eq!(of(&kept, "triangles"), 2 * of(&kept, "unique_triangles"));
    // The object's tree is there once.
    assert!(3 * of(&kept, "tree_bytes") < 2 * of(&flat, "tree_bytes"));
    assert!(kept["triangle_tests"]["camera"].as_u64().unwrap() > 0);
    let grid = "title = \"Balls\"\ntrees = [\"kd\"]\nscenes = [\"balls.pbrt\", \
                { name = \"balls.pbrt\", label = \"flat\", flatten = true }]\n";
    fs::write(folder.path().join("balls.toml"), grid).unwrap();
    let run = ["experiment", "balls.toml", "--out", "e"];
    let (code, out, err) = outcome(splitplane(&folder).args(run));
    assert_eq!(code, 0, "{err}");
    assert!(out.contains("2 of 2 runs done"), "{out}");
    let csv = fs::read_to_string(folder.path().join("e/results.csv")).unwrap();
    assert!(
        csv.contains("instances_kept"),
        "{}",
        csv.lines().next().unwrap()
    );
}
