//! What the fuzzer has found so far, as ordinary tests.

use std::path::Path;

#[path = "../../../fuzz/src/lib.rs"]
#[allow(unreachable_pub, reason = "the library of another workspace")]
mod targets;

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
