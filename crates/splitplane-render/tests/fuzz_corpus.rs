//! What the fuzzer has found so far, as ordinary tests.

use std::path::Path;

#[path = "../../../fuzz/src/lib.rs"]
#[allow(unreachable_pub, reason = "the library of another workspace")]
mod targets;

/// A format of another version needs other files: with SPLITPLANE_WRITE_CORPUS they are written.
#[test]
fn the_saved_trees_of_the_corpus_are_of_this_version() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fuzz/corpus/saved_tree");
    let write = std::env::var_os("SPLITPLANE_WRITE_CORPUS").is_some();
    for (name, bytes) in targets::saved_trees() {
        let path = folder.join(&name);
        if write {
            std::fs::create_dir_all(&folder).unwrap();
            std::fs::write(&path, &bytes).unwrap();
        }
        let bytes = std::fs::read(&path).unwrap_or_default();
        assert!(targets::is_saved_tree(&bytes), "{name}");
    }
}

#[test]
fn every_file_of_the_corpus_is_read_or_refused() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fuzz");
    for (name, target) in targets::TARGETS {
        let files = targets::corpus(&folder, name);
        assert!(!files.is_empty(), "{name} has no corpus");
        for (file, bytes) in files {
            println!("{name}/{file}");
            target(&bytes);
        }
    }
}
