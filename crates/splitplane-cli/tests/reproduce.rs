//! `splitplane reproduce`, and the options that it shares with other commands.

mod common;

use common::{folder, hills_scene, outcome, splitplane};
use serde_json::Value;
use splitplane::TREES;

#[test]
fn every_tree_of_the_thesis_has_its_line_in_every_table_and_the_file_is_what_was_printed() {
    let folder = folder();
    hills_scene(folder.path(), "");
    let (code, out, err) = outcome(splitplane(&folder).args([
        "reproduce",
        "hills.pbrt",
        "--spp",
        "1",
        "--resolution",
        "24",
        "--markdown",
        "--quiet",
        "--out",
        "figures.md",
    ]));
    assert_eq!((code, err.as_str()), (0, ""));
    let written = std::fs::read_to_string(folder.path().join("figures.md")).unwrap();
    let (printed, said) = out.trim_end().rsplit_once('\n').unwrap();
    assert_eq!(said, "wrote figures.md");
    assert_eq!(printed.trim_end(), written.trim_end());
    let tables: Vec<&str> = written.split("### ").skip(1).collect();
    let titles: Vec<&str> = tables.iter().map(|t| t.lines().next().unwrap()).collect();
    assert_eq!(
        titles,
        [
            "Ties as published, published traversal: ours",
            "Ties as published, exact traversal: ours",
            "Tolerant ties, published traversal: ours",
            "Tolerant ties, exact traversal: ours",
        ]
    );
    for table in &tables {
        let lines: Vec<Vec<&str>> = table
            .lines()
            .filter(|line| line.starts_with('|'))
            .map(|line| line.trim_matches('|').split('|').map(str::trim).collect())
            .collect();
        assert!(lines.iter().all(|line| line.len() == lines[0].len()));
        let trees: Vec<&str> = lines[3..]
            .iter()
            .map(|line| line[0].split(':').next().unwrap())
            .collect();
        let mut expected: Vec<&str> = TREES
            .iter()
            .filter(|spec| !spec.thesis_name.is_empty() || spec.objects)
            .map(|spec| spec.name)
            .collect();
        expected.sort_by_key(|name| TREES.iter().any(|s| s.name == *name && s.objects));
        assert_eq!(trees, expected);
    }
    // The measure is its own measure.
    let first = tables[0]
        .lines()
        .find(|line| line.contains("| 100.0"))
        .unwrap();
    assert!(
        first.starts_with(&format!("| {} | 100.0 | 100.0", TREES[0].name)),
        "{first}"
    );
}

#[test]
fn the_tables_can_be_read_on_a_terminal_too() {
    let folder = folder();
    hills_scene(folder.path(), "");
    let trees = format!("{},{}", TREES[0].name, TREES[1].name);
    let (code, out, err) = outcome(splitplane(&folder).args([
        "reproduce",
        "hills.pbrt",
        "--trees",
        &trees,
        "--spp",
        "1",
        "--resolution",
        "24x16",
        "--seed",
        "3",
        "--quiet",
    ]));
    assert_eq!(code, 0, "{err}");
    assert!(out.contains("288 triangles"), "{out}");
    assert!(out.contains("seed 3"), "{out}");
    assert_eq!(out.matches("tests, closest").count(), 4, "{out}");
    assert!(!out.contains('|'), "{out}");
}

#[test]
fn the_published_traversal_is_recorded_and_may_give_each_tree_its_own_picture() {
    let folder = folder();
    hills_scene(folder.path(), "");
    let names: Vec<&str> = TREES.iter().map(|spec| spec.name).collect();
    for traversal in ["exact", "published"] {
        let (code, out, err) = outcome(splitplane(&folder).args([
            "compare",
            "hills.pbrt",
            "--trees",
            &names.join(","),
            "--traversal",
            traversal,
            "--repeat",
            "2",
            "--json",
            "records.json",
        ]));
        assert_eq!(code, 0, "{err}");
        assert!(out.contains(&format!("traversal {traversal}")), "{out}");
        let identical = out.contains("identical, bit by bit");
        assert_eq!(identical, traversal == "exact", "{out}");
        let text = std::fs::read_to_string(folder.path().join("records.json")).unwrap();
        let records: Vec<Value> = serde_json::from_str(&text).unwrap();
        assert!(
            records
                .iter()
                .all(|record| record["traversal"] == traversal)
        );
    }
}

#[test]
fn every_preset_is_explained_and_recorded() {
    let folder = folder();
    hills_scene(folder.path(), "");
    let (_, help, _) = outcome(splitplane(&folder).args(["build", "--help"]));
    for preset in splitplane_lab::Preset::ALL {
        let (name, summary) = (preset.name(), preset.summary());
        let words = |text: &str| text.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(
            words(&help).contains(&words(&format!("{name}: {summary}"))),
            "{name} in\n{help}"
        );
        let (code, out, err) = outcome(splitplane(&folder).args([
            "build",
            "hills.pbrt",
            "--tree",
            TREES[0].name,
            "--preset",
            &name.to_uppercase(),
            "--json",
        ]));
        assert_eq!(code, 0, "{err}");
        let card: Value = serde_json::from_str(&out).unwrap();
        assert_eq!(card["preset"], name);
        let cost = preset.params().intersection_cost;
        assert_eq!(card["build_params"]["intersection_cost"], cost);
    }
}
