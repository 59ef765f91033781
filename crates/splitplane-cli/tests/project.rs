//! What the project's pages say holds.

mod common;

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use common::{folder, outcome, splitplane};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn page(name: &str) -> String {
    fs::read_to_string(root().join(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
}

/// The lines of the page's shell blocks, without comments.
fn commands(page: &str) -> Vec<String> {
    let mut lines = Vec::new();
    let mut in_shell = false;
    for line in page.lines() {
        if let Some(language) = line.strip_prefix("```") {
            in_shell = !in_shell && matches!(language, "sh" | "bash" | "console");
        } else if in_shell {
            let command = line.split(" #").next().unwrap_or_default().trim();
            if !command.is_empty() && !command.starts_with('#') {
                lines.push(command.to_owned());
            }
        }
    }
    lines
}

#[test]
fn every_command_of_the_readme_is_one_that_the_command_line_takes() {
    let commands = commands(&page("README.md"));
    let mut checked = 0;
    for command in &commands {
        let words: Vec<&str> = command.split_whitespace().collect();
        let arguments = match words.as_slice() {
            ["cargo", "run", "--release", "--", rest @ ..] => rest,
            ["splitplane", rest @ ..] => rest,
            _ => continue,
        };
        // With --help behind, everything is parsed that comes before it, and nothing is done.
        let (code, out, err) = outcome(splitplane(&folder()).args(arguments).arg("--help"));
        assert_eq!(code, 0, "{command}: {err}");
        assert!(
            out.contains(&format!("splitplane {}", arguments[0])),
            "{command}"
        );
        checked += 1;
    }
    assert!(checked >= 2, "{commands:?}");
    let first = commands.iter().find(|command| command.contains("compare"));
    assert_eq!(
        first.map(String::as_str),
        Some("cargo run --release -- compare truck --trees kd,wn+kd:6")
    );
}

#[test]
fn ci_runs_the_very_line_that_the_readme_gives_for_the_tests() {
    let line = "cargo test --workspace";
    assert!(commands(&page("README.md")).contains(&line.to_owned()));
    let steps = page(".ci/run");
    assert!(
        steps.lines().any(|step| step == format!("step {line}")),
        "{steps}"
    );
}

#[test]
fn every_source_that_a_comment_cites_is_in_the_references() {
    let references = page("crates/splitplane/REFERENCES.md");
    let listed: BTreeSet<String> = references
        .lines()
        .filter_map(|line| Some(line.strip_prefix("**[")?.split(']').next()?.to_owned()))
        .collect();
    let mut cited = BTreeSet::new();
    for path in files_in(&root().join("crates")) {
        if path.extension().is_some_and(|extension| extension == "rs") {
            let text = fs::read_to_string(&path).unwrap();
            for part in text.split('[').skip(1) {
                let inside = part.split([']', '\n']).next().unwrap_or_default();
                for key in inside.split(", ").filter(|key| is_key(key)) {
                    cited.insert((key.to_owned(), path.clone()));
                }
            }
        }
    }
    assert!(!cited.is_empty());
    cited.retain(|(key, _)| !listed.contains(key));
    assert_eq!(cited, BTreeSet::new());
}

/// A name and a year, or the book with its edition.
fn is_key(text: &str) -> bool {
    let year = text.trim_start_matches(|c: char| c.is_ascii_alphabetic());
    let name = &text[..text.len() - year.len()];
    let is_year = year.len() == 4 && year.bytes().all(|c| c.is_ascii_digit());
    let is_name = name.len() > 2 && name.starts_with(|c: char| c.is_ascii_uppercase());
    (is_year && is_name) || text == "PBRT3"
}

/// The files in a folder and those inside it, but for what is built or not ours.
fn files_in(folder: &Path) -> Vec<PathBuf> {
    let mut files = Vec::new();
    let mut pending = vec![folder.to_owned()];
    while let Some(path) = pending.pop() {
        if path.is_dir() {
            for entry in fs::read_dir(&path).unwrap() {
                let inner = entry.unwrap().path();
                let name = inner.file_name().unwrap().to_string_lossy().into_owned();
                if !name.starts_with('.') && !["target", "out"].contains(&name.as_str()) {
                    pending.push(inner);
                }
            }
        } else {
            files.push(path);
        }
    }
    files
}

/// A page without its blocks of code.
fn prose(page: &str) -> String {
    let mut in_code = false;
    let lines = page.lines().filter(|line| {
        let fence = line.trim_start().starts_with("```");
        in_code ^= fence;
        !in_code && !fence
    });
    lines.collect::<Vec<_>>().join("\n")
}

/// The anchors of a page's headings, as GitHub makes them.
fn anchors(page: &str) -> BTreeSet<String> {
    let mut anchors = BTreeSet::new();
    let prose = prose(page);
    for line in prose.lines().filter(|line| line.starts_with('#')) {
        let heading = line.trim_start_matches('#').trim().to_lowercase();
        let kept = |c: &char| c.is_alphanumeric() || matches!(c, ' ' | '-' | '_');
        let anchor = heading.chars().filter(kept).collect::<String>();
        let anchor = anchor.replace(' ', "-");
        // The second of the same name has a number.
        let numbered = (1..).map(|i| format!("{anchor}-{i}"));
        let mut names = std::iter::once(anchor.clone()).chain(numbered);
        let free = names.find(|name| !anchors.contains(name));
        anchors.extend(free);
    }
    anchors
}

#[test]
fn every_link_of_a_page_leads_somewhere() {
    let mut checked = 0;
    let mut broken = Vec::new();
    for path in files_in(&root()) {
        // The texts of licences are not ours.
        let text = match path.extension().is_some_and(|ending| ending == "md") {
            true if !path.ends_with("THIRD-PARTY.md") && !path.ends_with("docs/licences.md") => {
                prose(&fs::read_to_string(&path).unwrap())
            }
            _ => continue,
        };
        for link in text.split("](").skip(1) {
            let link = link.split([')', ' ']).next().unwrap_or_default();
            if link.contains("://") {
                continue;
            }
            let (file, anchor) = link.split_once('#').unwrap_or((link, ""));
            let target = match file {
                "" => path.clone(),
                file => path.parent().unwrap().join(file),
            };
            let is_there = target.exists()
                && (anchor.is_empty()
                    || anchors(&fs::read_to_string(&target).unwrap()).contains(anchor));
            if !is_there {
                broken.push(format!("{}: {link}", path.display()));
            }
            checked += 1;
        }
    }
    assert!(broken.is_empty(), "{}", broken.join("\n"));
    assert!(checked > 50, "{checked} links");
}

/// What a crate embeds must lie in the crate, or its package does not have it.
#[test]
fn every_file_that_a_crate_embeds_lies_in_the_crate() {
    let mut embedded = 0;
    for entry in fs::read_dir(root().join("crates")).unwrap() {
        let package = entry.unwrap().path();
        for path in files_in(&package.join("src")) {
            let text = fs::read_to_string(&path).unwrap_or_default();
            for macro_name in ["include_str!(\"", "include_bytes!(\""] {
                for rest in text.split(macro_name).skip(1) {
                    let file = rest.split('"').next().unwrap_or_default();
                    let file = path.parent().unwrap().join(file).canonicalize();
                    let file = file.unwrap_or_else(|error| panic!("{}: {error}", path.display()));
                    let own = package.canonicalize().unwrap();
                    assert!(file.starts_with(&own), "{} is outside", file.display());
                    embedded += 1;
                }
            }
        }
    }
    assert!(embedded >= 3);
}

/// Examples are compiled with the tests, and CI runs each.
#[test]
fn every_rust_snippet_of_the_pages_is_part_of_an_example() {
    // Line breaks, and the commas that go with them, are the formatter's.
    let bare = |text: &str| -> String {
        let bare = |c: &char| !c.is_whitespace() && *c != ',';
        text.chars().filter(bare).collect()
    };
    let mut examples = String::new();
    let steps = page(".ci/run");
    for entry in fs::read_dir(root().join("crates/splitplane/examples")).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|extension| extension == "rs") {
            examples += &bare(&fs::read_to_string(&path).unwrap());
            let name = path.file_stem().unwrap().to_str().unwrap().to_owned();
            assert!(steps.contains(&name), "CI does not run the example {name}");
        }
    }
    let mut checked = 0;
    for name in ["README.md", "docs/rust.md", "docs/exactness.md"] {
        for snippet in page(name).split("```rust\n").skip(1) {
            let snippet = snippet.split("```").next().unwrap_or_default();
            assert!(examples.contains(&bare(snippet)), "{name}: {snippet}");
            checked += 1;
        }
    }
    assert!(checked >= 8);
}

/// The page goes into the wheel.
#[test]
fn the_licences_of_all_that_is_linked_in_are_on_their_page() {
    let list = Command::new(env!("CARGO"))
        .args([
            "tree",
            "--locked",
            "-p",
            "splitplane-cli",
            "-p",
            "splitplane-py",
        ])
        .args([
            "-e",
            "normal,no-proc-macro",
            "--prefix",
            "none",
            "--format",
            "{p}",
        ])
        .current_dir(root())
        .output()
        .unwrap();
    let list = String::from_utf8(list.stdout).unwrap();
    let linked: BTreeSet<String> = (list.lines())
        .filter(|line| !line.contains("(proc-macro)") && !line.starts_with("splitplane"))
        .filter_map(|line| line.split_once(" v"))
        .map(|(name, rest)| {
            let version = rest.split_whitespace().next().unwrap_or_default();
            format!("{name} {version}")
        })
        .collect();
    assert!(linked.len() > 100, "{list}");
    let page = page("docs/licences.md");
    let (table, texts) = page.split_once("\n## ").unwrap();
    for crate_name in linked {
        let told = table.contains(&format!("| {crate_name} |")) && texts.contains(&crate_name);
        assert!(told, "{crate_name}: `just licences` writes the page anew");
    }
}
