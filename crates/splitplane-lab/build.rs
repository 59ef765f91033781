//! Hands the commit to the crate, as `SPLITPLANE_COMMIT`; "unknown" outside a checkout.

use std::path::{Path, PathBuf};
use std::process::Command;

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rustc-env=SPLITPLANE_COMMIT={}", commit());
}

/// The commit that is checked out, if the crate lies in its own repository: of a copy inside
/// another project's repository, that project's commit says nothing.
fn commit() -> String {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let same = |a: &Path, b: &Path| match (a.canonicalize(), b.canonicalize()) {
        (Ok(a), Ok(b)) => a == b,
        _ => false,
    };
    let commit = git(&root, &["rev-parse", "--show-toplevel"])
        .filter(|top| same(Path::new(top), &root))
        .and_then(|_| git(&root, &["rev-parse", "--short=12", "HEAD"]));
    let Some(commit) = commit else {
        return "unknown".to_owned();
    };
    for name in ["HEAD", "logs/HEAD"] {
        if let Some(path) = git(&root, &["rev-parse", "--git-path", name]) {
            let path: PathBuf = root.join(path);
            if path.exists() {
                println!("cargo::rerun-if-changed={}", path.display());
            }
        }
    }
    commit
}

fn git(directory: &Path, arguments: &[&str]) -> Option<String> {
    let output = Command::new("git")
        .arg("-C")
        .arg(directory)
        .args(arguments)
        .output()
        .ok()?;
    let text = String::from_utf8(output.stdout).ok()?;
    (output.status.success() && !text.trim().is_empty()).then(|| text.trim().to_owned())
}
