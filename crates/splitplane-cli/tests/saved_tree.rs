//! `splitplane build -o tree.spt`, and `--tree tree.spt` where trees are taken.

mod common;

use common::{folder, hills_scene, outcome, splitplane};

#[test]
fn a_saved_tree_answers_as_the_one_that_was_built() {
    let folder = folder();
    let scene = hills_scene(folder.path(), "");
    let scene = scene.to_str().unwrap();
    let run = |arguments: &[&str]| outcome(splitplane(&folder).args(arguments));
    let read = |name: &str| std::fs::read(folder.path().join(name)).unwrap();
    for layout in ["binary", "wide"] {
        let save = ["--tree", "wn+kd:6", "--layout", layout, "-o", "hills.spt"];
        let (code, card, err) = run(&[&["build", scene], &save[..]].concat());
        assert_eq!(code, 0, "{err}");
        assert!(card.contains("wn+kd:6"), "{card}");
        for (tree, out) in [("wn+kd:6", "built"), ("hills.spt", "loaded")] {
            let (code, said, err) = run(&["render", scene, "--tree", tree, "--out", out]);
            assert_eq!(code, 0, "{err}");
            assert!(said.contains(&format!("{out} in")), "{said}");
        }
        assert_eq!(read("built/hills.png"), read("loaded/hills.png"));
    }
    // What is in the file is of the wide layout now: nothing leads back.
    let as_binary = ["--tree", "hills.spt", "--layout", "binary"];
    for command in [&["render", "--out", "loaded"][..], &["build"]] {
        let (code, out, err) = run(&[command, &[scene], &as_binary].concat());
        assert_eq!((code, &*out), (2, ""));
        assert!(err.contains("hills.spt is in the wide layout"), "{err}");
    }
    // Nor are there planes to draw.
    let draw = ["slice", scene, "--tree", "hills.spt", "-o", "slice.svg"];
    let (code, _, err) = run(&draw);
    assert_eq!(code, 2);
    assert!(err.contains("--layout binary"), "{err}");
    assert_eq!(
        run(&["build", scene, "--tree", "kd", "-o", "hills.spt"]).0,
        0
    );
    assert_eq!(run(&draw).0, 0);
    // A binary one is brought into the wide layout, as one that is built.
    let as_wide = ["render", scene, "--tree", "hills.spt", "--layout", "wide"];
    let (code, said, err) = run(&[&as_wide[..], &["--out", "loaded"]].concat());
    assert_eq!(code, 0, "{err}");
    assert!(said.contains("in the wide layout"), "{said}");
    // Nothing but what was asked for is left.
    let mut names: Vec<_> = std::fs::read_dir(folder.path())
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    assert_eq!(
        names,
        ["built", "hills.pbrt", "hills.spt", "loaded", "slice.svg"]
    );
}

#[test]
fn the_card_and_the_table_say_that_a_tree_was_loaded() {
    let folder = folder();
    let scene = hills_scene(folder.path(), "");
    let scene = scene.to_str().unwrap();
    let build = |arguments: &[&str]| {
        let (code, out, err) = outcome(
            splitplane(&folder)
                .args(["build", scene, "--tree"])
                .args(arguments),
        );
        assert_eq!(code, 0, "{err}");
        out
    };
    let save = ["--preset", "thesis", "--layout", "wide", "-o", "hills.spt"];
    let card = build(&[&["kd"], &save[..]].concat());
    assert!(
        card.contains("build time") && !card.contains("load"),
        "{card}"
    );
    let card = build(&["hills.spt"]);
    assert!(
        card.contains("loading time") && card.contains("loaded by 1 thread"),
        "{card}"
    );
    assert!(!card.contains("build time"), "{card}");
    let table = build(&["hills.spt,kd", "--threads", "2"]);
    let row = |name: &str| {
        table
            .lines()
            .find(|line| line.trim().starts_with(name))
            .unwrap()
    };
    assert!(row("hills.spt").contains("(loaded)"), "{table}");
    assert!(!row("kd").contains("(loaded)"), "{table}");
    // The saved tree's parameters are not those of the one that is built after it.
    assert!(
        table.contains("default parameters") && table.contains("2 threads"),
        "{table}"
    );
    assert!(table.contains("loaded by 1 thread"), "{table}");
    let cards: Vec<serde_json::Value> =
        serde_json::from_str(&build(&["hills.spt,kd", "--json"])).unwrap();
    assert_eq!(
        (&cards[0]["preset"], &cards[1]["preset"]),
        (&"thesis".into(), &"default".into())
    );
    assert!(
        cards[0]["wide"].is_object() && cards[1]["wide"].is_null(),
        "{cards:?}"
    );
}

#[test]
fn what_is_not_the_tree_of_the_scene_is_refused_with_a_reason() {
    let folder = folder();
    let scene = hills_scene(folder.path(), "");
    let scene = scene.to_str().unwrap();
    let run = |arguments: &[&str]| outcome(splitplane(&folder).args(arguments));
    assert_eq!(
        run(&["build", scene, "--tree", "kd", "-o", "hills.spt"]).0,
        0
    );
    let path = folder.path().join("hills.spt");
    let whole = std::fs::read(&path).unwrap();
    let refused = |arguments: &[&str], reason: &str| {
        let (code, _, err) = run(arguments);
        assert_eq!(code, 2, "{err}");
        let text = err.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(text.contains(reason), "{text}");
    };
    let load = ["build", scene, "--tree", "hills.spt"];
    refused(
        &["build", "truck", "--tree", "hills.spt"],
        "tree of another mesh",
    );
    refused(
        &[&load[..], &["--preset", "thesis"]].concat(),
        "leave out --preset",
    );
    refused(&["build", scene, "--tree", "none.spt"], "none.spt");
    refused(
        &["build", scene, "--tree", "kd,wn+kd", "-o", "two.spt"],
        "--out takes one tree",
    );
    std::fs::write(&path, &whole[..whole.len() - 1]).unwrap();
    refused(&load, "damaged");
    std::fs::write(&path, "a letter").unwrap();
    refused(&load, "not a saved tree");
}

#[test]
fn nothing_that_is_read_is_written_over() {
    let folder = folder();
    let scene = hills_scene(folder.path(), "");
    let content = std::fs::read(&scene).unwrap();
    let path = scene.to_str().unwrap();
    let refused = |arguments: &[&str], reason: &str| {
        let (code, _, err) = outcome(splitplane(&folder).args(arguments));
        assert_eq!(code, 2, "{arguments:?}");
        assert!(err.contains(reason), "{err}");
    };
    let read = "it is what is read; name another file";
    refused(&["build", path, "--tree", "kd", "-o", path], read);
    refused(&["build", path, "--tree", "kd", "-o", "./hills.pbrt"], read);
    refused(&["slice", path, "--tree", "kd", "-o", path], read);
    refused(&["compare", path, "--trees", "kd", "--json", path], read);
    refused(
        &["build", path, "--tree", "kd", "-o", "."],
        "it is a folder",
    );
    assert_eq!(std::fs::read(&scene).unwrap(), content);

    // Whatever a saved tree is called, it is found.
    let run = |arguments: &[&str]| outcome(splitplane(&folder).args(arguments)).0;
    assert_eq!(run(&["build", path, "--tree", "kd", "-o", "saved"]), 0);
    assert_eq!(
        run(&["slice", path, "--tree", "saved", "-o", "slice.svg"]),
        0
    );
    refused(&["slice", path, "--tree", "saved", "-o", "saved"], read);
}
