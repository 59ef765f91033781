//! What the command line takes and refuses, and what it says.

mod common;

use common::{folder, hills_scene, outcome, splitplane};

const COMMANDS: [&str; 9] = [
    "render",
    "build",
    "compare",
    "reproduce",
    "cast",
    "slice",
    "verify",
    "trees",
    "scenes",
];

#[test]
fn every_help_text_shows_an_example() {
    let folder = folder();
    let (code, out, _) = outcome(splitplane(&folder).arg("--help"));
    assert_eq!(code, 0);
    for command in COMMANDS {
        assert!(
            out.contains(&format!("  {command} ")),
            "{command} in\n{out}"
        );
    }
    assert!(out.contains("splitplane compare truck --trees kd,wn+kd:6"));
    for command in COMMANDS {
        let (code, out, _) = outcome(splitplane(&folder).args([command, "--help"]));
        assert_eq!(code, 0);
        assert!(out.contains("Example"), "{command}:\n{out}");
        assert!(
            out.contains(&format!("  splitplane {command}")),
            "{command}:\n{out}"
        );
    }
}

#[test]
fn every_tree_is_listed_with_all_its_names() {
    let (code, out, _) = outcome(splitplane(&folder()).arg("trees"));
    assert_eq!(code, 0);
    for spec in splitplane::TREES {
        let line = out
            .lines()
            .find(|line| {
                line.split_whitespace()
                    .next()
                    .and_then(|w| w.split(':').next())
                    == Some(spec.name)
            })
            .unwrap_or_else(|| panic!("{} in\n{out}", spec.name));
        for part in [spec.thesis_name, spec.pbrt_name, spec.summary] {
            assert!(line.contains(part), "{part} in {line}");
        }
    }
}

#[test]
fn bad_input_ends_with_exit_code_2_and_says_what_would_be_accepted() {
    let folder = folder();
    hills_scene(folder.path(), "");
    let all_trees = splitplane::TREES.iter().map(|spec| spec.name);
    let all_trees: Vec<&str> = all_trees.collect();
    let render = ["render", "hills.pbrt"].as_slice();
    let compare = ["compare", "hills.pbrt"].as_slice();
    let cases: &[(&[&str], &[&str], &[&str])] = &[
        (&[], &["paint"], &["paint"]),
        (render, &["--tree", "oak"], &all_trees),
        (render, &["--tree", "wn+kd:2"], &["from 3 to 64"]),
        (render, &["--tree", "wn+kd:x"], &["from 3 to 64"]),
        (render, &["--tree", "kd:4"], &["takes no number"]),
        (render, &["--spp", "0"], &["1..=1000000"]),
        (render, &["--spp", "many"], &["many"]),
        (render, &["--threads", "0"], &["1..=1024"]),
        (render, &["--resolution", "0x10"], &["from 1 to 65536"]),
        (render, &["--resolution", "big"], &["800x600"]),
        (render, &["--crop", "0,1"], &["x0,x1,y0,y1"]),
        (render, &["--crop", "0.7,0.3,0,1"], &["x0 < x1"]),
        (render, &["--crop=-1,1,0,1"], &["from 0 to 1"]),
        (render, &["--preset", "slow"], &["thesis", "default"]),
        (render, &["--preset", "slow"], &["pbrt3", "pbrt4"]),
        (render, &["--traversal", "loose"], &["exact", "published"]),
        (render, &["--subdivide", "17"], &["0..=16"]),
        (render, &["--ties", "fuzzy"], &["published", "tolerant"]),
        (render, &["--clip", "maybe"], &["maybe", "--clip"]),
        (render, &["--pricing", "free"], &["published", "fork"]),
        (render, &["--seed", "-1"], &["--seed"]),
        (render, &["--max-depth", "-1"], &["0..=10000"]),
        (render, &["--define", "x"], &["NAME=VALUE"]),
        (
            render,
            &["--json", "no/such/place.json"],
            &["no folder no/such"],
        ),
        (
            &["check", "truck"],
            &["--define", "A=1"],
            &["no .pbrt file", "--define"],
        ),
        (
            &["check", "truck"],
            &["--subdivide", "3"],
            &["no .pbrt file"],
        ),
        (compare, &[], &["--trees"]),
        (compare, &["--trees", "kd,oak"], &all_trees),
        (compare, &["--trees", "kd,"], &all_trees),
        (compare, &["--trees", "kd,KD"], &["twice"]),
        (compare, &["--trees", "kd", "--repeat", "0"], &["1..=1000"]),
        (&["build", "hills.pbrt"], &[], &["--tree"]),
        (
            &["build", "missing.pbrt"],
            &["--tree", "kd"],
            &["missing.pbrt"],
        ),
    ];
    for (command, arguments, words) in cases {
        let (code, out, err) = outcome(splitplane(&folder).args(*command).args(*arguments));
        assert_eq!(code, 2, "{arguments:?}: {err}");
        assert_eq!(out, "", "{arguments:?}");
        for word in *words {
            assert!(err.contains(word), "{arguments:?}: no {word} in\n{err}");
        }
    }
}

#[test]
fn an_error_in_a_scene_names_its_file_line_and_column_and_shows_them() {
    let folder = folder();
    let path = folder.path().join("broken.pbrt");
    std::fs::write(
        &path,
        "# a comment\nWorldBegin\n  Shape \"sphere\" \"float radius\" [\"one\"]\nWorldEnd\n",
    )
    .unwrap();
    let (code, _, err) =
        outcome(splitplane(&folder).args(["build", "broken.pbrt", "--tree", "kd"]));
    assert_eq!(code, 2);
    assert!(err.starts_with("error: "), "{err}");
    assert!(err.contains("broken.pbrt:3:"), "{err}");
    assert!(err.contains("Shape \"sphere\""), "{err}");
}

#[test]
fn a_terminal_is_not_shown_what_it_would_obey() {
    let folder = folder();
    std::fs::write(folder.path().join("damaged.pbrt.gz"), b"\x01Foo\x1b[31m\n").unwrap();
    let (code, _, err) = outcome(splitplane(&folder).args(["check", "damaged.pbrt.gz"]));
    assert_eq!(code, 2);
    let of_lines = |c: char| c.is_control() && c != '\n';
    assert!(
        err.contains("damaged.pbrt.gz:1:1") && !err.contains(of_lines),
        "{err:?}"
    );
}

#[test]
fn an_unfinished_picture_of_other_settings_is_named() {
    let folder = folder();
    hills_scene(folder.path(), "");
    // One of no pixels, with nothing done.
    let picture = [b"splitplane picture 2\n", &[0; 28 * 8][..]].concat();
    std::fs::write(folder.path().join("hills.unfinished"), picture).unwrap();
    let resume = ["render", "hills.pbrt", "--resume", "--out", "."];
    let (code, _, err) = outcome(splitplane(&folder).args(resume));
    assert_eq!(code, 2);
    assert!(
        err.contains("hills.unfinished: the unfinished picture is of another"),
        "{err}"
    );
}

#[test]
fn names_of_trees_are_taken_in_any_case_and_spelling() {
    let folder = folder();
    hills_scene(folder.path(), "");
    for spec in splitplane::TREES {
        for name in [spec.name, spec.thesis_name, spec.pbrt_name] {
            if name.is_empty() {
                continue;
            }
            let name = name.to_uppercase();
            let (code, out, err) = outcome(splitplane(&folder).args([
                "build",
                "hills.pbrt",
                "--json",
                "--tree",
                &name,
            ]));
            assert_eq!(code, 0, "{err}");
            let card: serde_json::Value = serde_json::from_str(&out).unwrap();
            assert_eq!(card["tree"], spec.name);
        }
    }
}

#[test]
fn a_tree_card_says_what_the_json_says() {
    let folder = folder();
    hills_scene(folder.path(), "");
    let build = ["build", "hills.pbrt", "--preset", "thesis", "--seed", "3"];
    for spec in splitplane::TREES {
        let command = || {
            let mut command = splitplane(&folder);
            command.args(build).args(["--tree", spec.name]);
            command
        };
        let (code, text, err) = outcome(&mut command());
        assert_eq!(code, 0, "{err}");
        let (code, json, _) = outcome(command().arg("--json"));
        assert_eq!(code, 0);
        let card: serde_json::Value = serde_json::from_str(&json).unwrap();
        assert_eq!(card["triangles"], 288);
        assert_eq!(card["seed"], 3);
        assert_eq!(card["build_params"]["ties"], "published");
        let leaves = card["leaf_sizes"].as_array().unwrap().iter();
        let leaves: u64 = leaves.map(|bin| bin[1].as_u64().unwrap()).sum();
        assert_eq!(card["nodes"]["leaf"], leaves);
        for (line, field) in [
            ("references", "references"),
            ("bad refines", "bad_refines"),
            ("depth", "depth"),
        ] {
            let number = card[field].as_u64().unwrap();
            let shown = text
                .lines()
                .find(|l| l.trim_start().starts_with(line))
                .unwrap();
            assert!(
                shown.replace(',', "").contains(&number.to_string()),
                "{shown}: {number}"
            );
        }
        for line in [
            "expected visits per ray",
            "expected tests per ray",
            "SAH cost",
            "size",
            "empty leaves",
            "largest leaf",
            "skipped triangles",
            "triangles in a leaf",
        ] {
            assert!(text.contains(line), "{line} in\n{text}");
        }
    }
}

#[test]
fn a_reader_that_goes_away_is_no_error() {
    use std::process::{Command, Stdio};
    let folder = folder();
    hills_scene(folder.path(), "");
    let mut child = Command::new(env!("CARGO_BIN_EXE_splitplane"))
        .args(["build", "hills.pbrt", "--tree", "kd", "--json"])
        .current_dir(folder.path())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    drop(child.stdout.take());
    let output = child.wait_with_output().unwrap();
    assert_eq!(String::from_utf8_lossy(&output.stderr), "");
    assert_eq!(output.status.code(), Some(0));
}

#[test]
#[cfg(unix)]
fn an_interrupt_ends_the_command_with_exit_code_130() {
    use std::io::{BufRead, BufReader};
    use std::process::{Command, Stdio};
    let folder = folder();
    // A warning tells that the command is at work.
    hills_scene(folder.path(), "Accelerator \"oak\"");
    let mut child = Command::new(env!("CARGO_BIN_EXE_splitplane"))
        .args(["render", "hills.pbrt", "--spp", "1000000"])
        .current_dir(folder.path())
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut first = String::new();
    let mut stderr = BufReader::new(child.stderr.take().unwrap());
    stderr.read_line(&mut first).unwrap();
    assert!(first.contains("oak"), "{first}");
    let killed = Command::new("kill")
        .args(["-INT", &child.id().to_string()])
        .status()
        .unwrap();
    assert!(killed.success());
    assert_eq!(child.wait().unwrap().code(), Some(130));
}

#[test]
fn scenes_are_listed_with_triangles_and_place_and_found_by_name_in_any_case() {
    let folder = folder();
    let scenes = folder.path().join("of mine");
    std::fs::create_dir(&scenes).unwrap();
    hills_scene(&scenes, "");
    let listed = |command: &mut assert_cmd::Command| {
        let (code, out, err) = outcome(command);
        assert_eq!(code, 0, "{err}");
        let line = |name: &str| {
            let found = out.lines().find(|line| line.trim_start().starts_with(name));
            found
                .unwrap_or_else(|| panic!("{name} in\n{out}"))
                .to_owned()
        };
        assert!(line("truck").contains("116,501") && line("truck").contains("built in"));
        assert!(line("arcade").contains("100,000") && line("grove").contains("100,000"));
        let hills = line("hills");
        assert!(
            hills.contains("288") && hills.contains("hills.pbrt"),
            "{hills}"
        );
    };
    listed(splitplane(&folder).args(["scenes", "--scenes", "of mine"]));
    listed(
        splitplane(&folder)
            .arg("scenes")
            .env("SPLITPLANE_SCENES", "of mine"),
    );
    // One that cannot be read is in the list, with the reason below.
    let broken = "WorldBegin\nShape \"sphere\" \"float radius\" [\"one\"]\n";
    std::fs::write(scenes.join("broken.pbrt"), broken).unwrap();
    let with_broken = ["scenes", "--scenes", "of mine"];
    listed(splitplane(&folder).args(with_broken));
    let (_, out, _) = outcome(splitplane(&folder).args(with_broken));
    let told = out
        .lines()
        .filter(|line| line.trim_start().starts_with("broken"));
    let told: Vec<&str> = told.collect();
    assert_eq!(told.len(), 2, "{out}");
    assert!(told[0].contains("unreadable"), "{out}");
    assert!(
        told[1].starts_with("broken: ") && told[1].contains("broken.pbrt:2:"),
        "{out}"
    );
    let build = ["build", "HILLS", "--tree", "kd", "--scenes", "of mine"];
    let (code, _, err) = outcome(splitplane(&folder).args(build));
    assert_eq!(code, 0, "{err}");
    let elsewhere = ["scenes", "--scenes", "of nobody"];
    let (code, _, err) = outcome(splitplane(&folder).args(elsewhere));
    assert!(code == 2 && err.contains("no such folder"), "{err}");
    let (code, _, err) = outcome(splitplane(&folder).args(["build", "valley", "--tree", "kd"]));
    assert_eq!(code, 2);
    for name in ["valley", "truck", "arcade", "grove"] {
        assert!(err.contains(name), "{name} in\n{err}");
    }
}

#[test]
fn nothing_is_written_over_what_a_scene_names() {
    let folder = tempfile::tempdir().unwrap();
    let triangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\n";
    let obj = format!("mtllib m.mtl\n{triangle}usemtl a\nf 1/1 2/1 3/1\n");
    std::fs::write(folder.path().join("m.obj"), obj).unwrap();
    std::fs::write(folder.path().join("m.mtl"), "newmtl a\nmap_Kd m.png\n").unwrap();
    std::fs::write(folder.path().join("m.png"), "an image").unwrap();
    std::fs::write(folder.path().join("s.pbrt"), "Include \"rest.pbrt\"\n").unwrap();
    let rest = "WorldBegin\nShape \"sphere\"\nWorldEnd\n";
    std::fs::write(folder.path().join("rest.pbrt"), rest).unwrap();
    let small = ["--spp", "1", "--resolution", "8"];
    let render: &[&str] = &["render", "m.obj", "--out", "."];
    let compare: &[&str] = &["compare", "m.obj", "--trees", "kd", "--out", "."];
    let reproduce: &[&str] = &["reproduce", "m.obj", "--trees", "kd", "--out", "m.obj"];
    let build: &[&str] = &["build", "m.obj", "--tree", "kd"];
    let slice: &[&str] = &["slice", "s.pbrt", "--tree", "kd", "-o", "rest.pbrt"];
    for (words, file) in [
        ([render, &small].concat(), "m.png"),
        ([compare, &small].concat(), "m.png"),
        ([reproduce, &small].concat(), "m.obj"),
        ([build, &["-o", "m.mtl"]].concat(), "m.mtl"),
        ([build, &["--timeline", "m.obj"]].concat(), "m.obj"),
        (slice.to_vec(), "rest.pbrt"),
    ] {
        let before = std::fs::read(folder.path().join(file)).unwrap();
        let (code, _, err) = outcome(splitplane(&folder).args(&words));
        assert_eq!(code, 2, "{words:?}: {err}");
        assert!(
            err.contains(file) && err.contains("is what is read"),
            "{err}"
        );
        assert_eq!(std::fs::read(folder.path().join(file)).unwrap(), before);
    }
}
