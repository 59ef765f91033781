//! What the tests of the command share: the command, and a small scene as a file.

#![allow(dead_code, reason = "each test file uses a part")]

use std::path::{Path, PathBuf};

use assert_cmd::Command;
use tempfile::TempDir;

/// The fields of a record that depend neither on the machine nor on the number of threads.
pub(crate) const COUNTS: [&str; 11] = [
    "nodes",
    "references",
    "depth",
    "bad_refines",
    "sah_cost",
    "tree_bytes",
    "rays",
    "triangle_tests",
    "kd_visits",
    "oblique_visits",
    "leaf_visits",
];

/// The command, in an empty folder of its own, without the scenes of the machine.
pub(crate) fn splitplane(folder: &TempDir) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_splitplane"));
    command
        .current_dir(folder.path())
        .env_remove("SPLITPLANE_SCENES")
        .env_remove("NO_COLOR");
    command
}

pub(crate) fn folder() -> TempDir {
    tempfile::tempdir().unwrap()
}

/// What came of a command: exit code, standard output, standard error. Never a panic.
pub(crate) fn outcome(command: &mut Command) -> (i32, String, String) {
    let output = command.output().unwrap();
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    let (out, err) = (text(&output.stdout), text(&output.stderr));
    assert!(!err.contains("panicked"), "{err}");
    let code = output.status.code();
    (
        code.unwrap_or_else(|| panic!("ended by a signal; {err}")),
        out,
        err,
    )
}

/// Vertices and triangles of a field of hills, `2 * side * side` triangles.
pub(crate) fn hills(side: u32) -> (Vec<[f32; 3]>, Vec<[u32; 3]>) {
    let at = |i: u32| 4.0 * i as f32 / side as f32 - 2.0;
    let mut positions = Vec::new();
    let mut triangles = Vec::new();
    for row in 0..=side {
        for column in 0..=side {
            let (x, y) = (at(column), at(row));
            positions.push([
                x,
                y,
                4.0 + 0.3 * (3.0 * x).sin() * (2.0 * y).cos() + 0.2 * x,
            ]);
        }
    }
    for row in 0..side {
        for column in 0..side {
            let a = row * (side + 1) + column;
            let (b, c, d) = (a + 1, a + side + 1, a + side + 2);
            triangles.extend([[a, b, c], [b, d, c]]);
        }
    }
    (positions, triangles)
}

/// The hills as a scene of 24 x 16 pixels, in a file; `more` goes before its world.
pub(crate) fn hills_scene(folder: &Path, more: &str) -> PathBuf {
    let (positions, triangles) = hills(12);
    let join = |items: Vec<String>| items.join(" ");
    let text = format!(
        "LookAt 0 0 0  0 0 1  0 1 0\n\
         Camera \"perspective\" \"float fov\" 50\n\
         Film \"image\" \"integer xresolution\" 24 \"integer yresolution\" 16\n\
         Sampler \"halton\" \"integer pixelsamples\" 2\n\
         Integrator \"path\" \"integer maxdepth\" 3\n\
         {more}\n\
         WorldBegin\n\
         LightSource \"point\" \"point from\" [3 2 1] \"rgb I\" [20 20 20]\n\
         Material \"matte\" \"rgb Kd\" [0.7 0.6 0.5]\n\
         Shape \"trianglemesh\" \"point P\" [{}] \"integer indices\" [{}]\n\
         WorldEnd\n",
        join(positions.iter().flatten().map(f32::to_string).collect()),
        join(triangles.iter().flatten().map(u32::to_string).collect()),
    );
    let path = folder.join("hills.pbrt");
    std::fs::write(&path, text).unwrap();
    path
}
