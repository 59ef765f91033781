//! Bad input: one clear error with its place, never a panic.

use std::path::{Path, PathBuf};

use proptest::prelude::*;
use splitplane_render::SceneError;
use splitplane_render::scene::{LoadOptions, Scene, load};

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/bad_scenes")
}

fn read(path: &Path) -> Result<Scene, SceneError> {
    load(&path.to_string_lossy(), &LoadOptions::default())
}

/// The first line of each file says what is wrong with it: `# LINE:COLUMN: part of the message`,
/// or `# PART file LINE:COLUMN: …` where another file is at fault.
#[test]
fn every_bad_scene_gives_its_error_at_its_place() {
    let mut failures = Vec::new();
    let mut count = 0;
    for entry in std::fs::read_dir(folder()).unwrap() {
        let path = entry.unwrap().path();
        let text = std::fs::read_to_string(&path).unwrap_or_default();
        let Some(expected) = text.lines().next().and_then(|line| line.strip_prefix("# ")) else {
            continue;
        };
        count += 1;
        let (place, message) = expected.split_once(": ").unwrap();
        let (file, place) = match place.strip_prefix("PART ") {
            Some(part) => part.split_once(' ').unwrap(),
            None => (path.file_name().unwrap().to_str().unwrap(), place),
        };
        let error = match read(&path) {
            Ok(_) => {
                failures.push(format!("{}: no error", path.display()));
                continue;
            }
            Err(error) => error,
        };
        let found = match (error.line, error.column) {
            (line, 0) => line.to_string(),
            (line, column) => format!("{line}:{column}"),
        };
        if !error.file.ends_with(file) || found != place || !error.message.contains(message) {
            failures.push(format!("expected {file}:{expected}\n   found {error}"));
        }
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
    assert!(count > 40, "{count} bad scenes");
}

#[test]
fn an_error_names_file_line_and_column() {
    let path = folder().join("unknown_directive.pbrt");
    let error = read(&path).unwrap_err();
    assert_eq!(
        error.to_string(),
        format!(
            "{}:3:1: `Shpae` is not a directive of pbrt-v3",
            path.display()
        )
    );
}

#[test]
fn an_empty_file_is_no_scene() {
    let error = read(&folder().join("empty.pbrt")).unwrap_err();
    assert!(error.message.contains("there is no WorldBegin"), "{error}");
}

#[test]
fn ten_megabytes_of_garbage_give_one_short_error() {
    let folder = tempfile::tempdir().unwrap();
    let mut state = 1_u64;
    let garbage: Vec<u8> = std::iter::repeat_with(|| {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 56) as u8
    })
    .take(10_000_000)
    .collect();
    let cases: [Vec<u8>; 4] = [
        garbage,
        vec![b'['; 10_000_000],
        vec![b'"'; 10_000_000],
        vec![b'x'; 10_000_000],
    ];
    for (i, bytes) in cases.iter().enumerate() {
        for ending in ["pbrt", "ply", "obj", "stl", "ply.gz"] {
            let path = folder.path().join(format!("{i}.{ending}"));
            std::fs::write(&path, bytes).unwrap();
            let error = read(&path).unwrap_err().to_string();
            assert!(error.len() < 600, "{} characters: {error}", error.len());
        }
    }
}

#[test]
fn files_that_include_others_twice_do_not_grow_without_end() {
    let folder = tempfile::tempdir().unwrap();
    for i in 0..40 {
        let text = format!("Include \"{0}.pbrt\"\nInclude \"{0}.pbrt\"\n", i + 1);
        std::fs::write(folder.path().join(format!("{i}.pbrt")), text).unwrap();
    }
    std::fs::write(folder.path().join("40.pbrt"), "Translate 1 0 0\n").unwrap();
    let error = read(&folder.path().join("0.pbrt")).unwrap_err();
    assert!(error.message.contains("includes"), "{error}");
}

#[test]
fn an_obj_that_names_what_is_not_there_is_refused_with_the_line() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("bad.obj");
    let vertices = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvn 0 0 1\n";
    for (face, message) in [
        (
            "f 1/-3 2/1 3/1",
            ":6: texture coordinate -3, but only 1 come before it",
        ),
        (
            "f 1//-9223372036854775808 2 3",
            ":6: normal -9223372036854775808, but only",
        ),
        (
            "f 1//9223372036854775807 2 3",
            ":6: normal 9223372036854775807 of 1",
        ),
        ("f 1 2 -4", ":6: vertex -4, but only 3 come before it"),
        ("f 1 2 0", ":6: vertex 0: they are counted from 1"),
        ("f 1 2 4", ":6: vertex 4 of 3"),
        ("f 1 2/one 3", ":6: texture coordinate \"one\""),
        ("v 0 0,5 0", ":6: a vertex has 3 numbers; \"0,5\" is none"),
        ("vt 1", ":6: a texture coordinate has 2 numbers"),
        (
            "v 0 nan 0",
            ":6: the numbers of a vertex must be finite; here is NaN",
        ),
        ("v 1e39 0 0", ":6: the numbers of a vertex must be finite"),
        ("v 1 1 1 0", ":6: the numbers of a vertex must be finite"),
        (
            "v 1 1 1 x",
            ":6: the weight of a vertex is a number; \"x\" is none",
        ),
        ("v 0 \\\n0 0\nf 1 2 \\\n5", ":8: vertex 5 of 4"),
    ] {
        std::fs::write(&path, format!("{vertices}{face}\n")).unwrap();
        let error = read(&path).unwrap_err().to_string();
        assert!(error.contains(message), "{face}: {error}");
    }
    // Indices from the start may come before what they name; those of texture coordinates and
    // normals may be 0, for none, and say nothing where there are none; and what is no face is not
    // looked at.
    for text in [
        format!("f 1/1/1 2 3\n{vertices}"),
        format!("{vertices}f 1/0/1 2/0/0 3//1\nl 1 99\n"),
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nf -3/-3/-3 -2/7/7 -1\n".to_owned(),
    ] {
        std::fs::write(&path, &text).unwrap();
        assert_eq!(read(&path).unwrap().mesh.triangles().len(), 1, "{text}");
    }
}

#[test]
fn what_is_wrong_with_an_stl_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("bad.stl");
    let mut cut = vec![0; 84 + 120];
    cut[80] = 5;
    let ascii = "solid x\nfacet normal 0 0 1\nouter loop\nvertex 0 0 ";
    for (bytes, message) in [
        (
            vec![],
            "bad.stl: not an STL file that can be read: it has 0 bytes",
        ),
        (cut, "cut short: 2 triangles of the 5 that it announces"),
        (format!("{ascii}zero\n").into_bytes(), "bad.stl:4: "),
        (
            format!("{ascii}\n").into_bytes(),
            "three numbers are missing",
        ),
    ] {
        std::fs::write(&path, &bytes).unwrap();
        let error = read(&path).unwrap_err().to_string();
        assert!(error.contains(message), "{error}");
    }
}

#[test]
fn a_folder_is_no_scene() {
    let folder = tempfile::tempdir().unwrap();
    let error = read(folder.path()).unwrap_err().to_string();
    assert!(error.contains("give a file in it"), "{error}");
}

#[test]
fn a_file_of_another_kind_is_not_taken_for_a_scene_of_pbrt() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["model.xyz", "tree.spt", "tri.obj.gz", "picture.png", "pbrt"] {
        let path = folder.path().join(name);
        std::fs::write(&path, "v 0 0 0\n").unwrap();
        let error = read(&path).unwrap_err();
        assert!(error.file.ends_with(name) && error.line == 0, "{error}");
        let endings = ".pbrt, .pbrt.gz, .gltf, .glb, .ply, .ply.gz, .obj, .stl";
        assert!(error.message.contains(endings), "{error}");
    }
    for name in ["A.PBRT", "b.pbrt.GZ"] {
        let path = folder.path().join(name);
        std::fs::write(&path, "WorldBegin\nWorldEnd\n").unwrap();
        assert!(read(&path).is_ok(), "{name}");
    }
}

#[test]
fn definitions_and_subdivision_are_refused_where_there_is_nothing_to_define() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("one.obj");
    std::fs::write(&path, "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    let define = LoadOptions {
        defines: [("A".to_owned(), "1".to_owned())].into(),
        ..LoadOptions::default()
    };
    let subdivide = LoadOptions {
        subdivision_levels: Some(3),
        ..LoadOptions::default()
    };
    for name in [path.to_str().unwrap(), "grove:40000"] {
        for options in [&define, &subdivide] {
            let error = load(name, options).unwrap_err();
            assert!(error.file == name, "{error}");
            assert!(error.message.contains("no .pbrt file"), "{error}");
        }
    }
}

#[test]
fn what_a_terminal_would_obey_is_escaped() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("damaged.pbrt.gz");
    std::fs::write(&path, b"\x01Foo\x1b[31m").unwrap();
    let error = read(&path).unwrap_err().to_string();
    assert!(error.contains(r"`\u{1}Foo\u{1b}`"), "{error}");
    assert!(!error.contains(char::is_control), "{error:?}");
}

#[test]
fn an_unknown_name_lists_what_there_is() {
    let error = load("lorry", &LoadOptions::default())
        .unwrap_err()
        .to_string();
    for name in ["truck", "arcade", "grove", ".obj"] {
        assert!(error.contains(name), "{error}");
    }
}

/// A scene with nearly all kinds of directives and parameters.
const SMALL: &str = r#"# all kinds
LookAt 4 3 2  0 0 0  0 0 1
Camera "perspective" "float fov" [39] "float screenwindow" [-1 1 -1 1]
Film "image" "integer xresolution" 20 "integer yresolution" [10]
Sampler "stratified" "integer xsamples" 2 "integer ysamples" 2
PixelFilter "mitchell" "float B" .3
Integrator "path" "integer maxdepth" [3] "string lightsamplestrategy" "power"
Accelerator "bsparbitraryfastkd" "integer nbDirections" [6]
WorldBegin
LightSource "distant" "blackbody L" [3000 1.5] "point from" [1 1 1]
LightSource "infinite" "spectrum L" [400 .1 700 .9]
Texture "t" "color" "scale" "rgb tex1" [.1 .2 .3] "xyz tex2" [.1 .2 .3]
MakeNamedMaterial "m" "string type" "uber" "texture Kd" "t" "bool remaproughness" "false"
ObjectBegin "o"
Shape "loopsubdiv" "integer levels" 1 "integer indices" [0 1 2 0 3 1 0 2 3 1 3 2]
  "point P" [1 1 1 1 -1 -1 -1 1 -1 -1 -1 1]
ObjectEnd
AttributeBegin
NamedMaterial "m"
Rotate 30 0 0 1  Scale -1 1 1  ReverseOrientation
ConcatTransform [1 0 0 0 0 1 0 0 0 0 1 0 1 2 3 1]
ObjectInstance "o"
AreaLightSource "diffuse" "rgb L" [1 2 3]
Shape "trianglemesh" "integer indices" [0 1 2] "point P" [0 0 0 1 0 0 0 1 0]
  "normal N" [0 0 1 0 0 1 0 0 1] "float uv" [0 0 1 0 0 1] "rgb Kd" [.2 .2 .2]
Shape "disk" "float radius" 2
AttributeEnd
WorldEnd
"#;

#[test]
fn the_small_scene_is_read() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("small.pbrt");
    std::fs::write(&path, SMALL).unwrap();
    let scene = read(&path).unwrap();
    assert_eq!(scene.shapes.len(), 3);
    assert_eq!(scene.accelerator.as_deref(), Some("wn+kd:6"));
    // The instance is mirrored; the others are mirrored and reversed, which changes nothing.
    let flipped: Vec<bool> = scene
        .shapes
        .iter()
        .map(|shape| shape.flip_normals)
        .collect();
    assert_eq!(flipped, [true, false, false]);
}

const PLY: &[u8] = b"ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty float x\n\
property float y\nproperty float z\nelement face 1\nproperty list uchar int vertex_indices\n\
end_header\n\0\0\0\0\0\0\0\0\0\0\0\0\0\0\x80\x3f\0\0\0\0\0\0\0\0\0\0\0\0\0\0\x80\x3f\0\0\0\0\
\x03\0\0\0\0\x01\0\0\0\x02\0\0\0";
const ASCII_PLY: &[u8] = b"ply\nformat ascii 1.0\nelement vertex 4\nproperty double x\n\
property float y\nproperty float z\nproperty uchar red\nelement face 1\n\
property list int uint vertex_index\nend_header\n0 0 0 9\n1 0 0 9\n1 1 0 9\n0 1 0 9\n4 0 1 2 3\n";
const OBJ: &[u8] = b"o x\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvn 0 0 1\nvt 0 0\nusemtl a\n\
f 1/1/1 2/1/1 3/1/1 4/1/1\nf -1 -2 -3\n";
const STL: &[u8] = b"solid x\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\n\
vertex 0 1 0\nendloop\nendfacet\nendsolid x\n";

#[test]
fn meshes_are_scenes() {
    let folder = tempfile::tempdir().unwrap();
    for (name, bytes, triangles) in [
        ("a.ply", PLY, 1),
        ("b.ply", ASCII_PLY, 2),
        ("c.obj", OBJ, 3),
        ("d.stl", STL, 1),
    ] {
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        let scene = read(&path).unwrap();
        assert_eq!(scene.mesh.triangles().len(), triangles, "{name}");
        assert_eq!(scene.name, name[..1]);
    }
}

#[test]
fn what_a_text_file_of_ply_cannot_hold_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.ply");
    let text = std::str::from_utf8(ASCII_PLY).unwrap();
    std::fs::write(&path, text.replace("1 0 0 9", "nan 0 0 9")).unwrap();
    let error = read(&path).unwrap_err();
    let shown = error.to_string();
    assert_eq!(error.line, 12, "{shown}");
    assert!(
        shown.contains("\"nan 0 0 9\" (numbers must be finite"),
        "{shown}"
    );

    let faces = text.replace("face 1", "face 3") + "2 0 1\n1 3\n";
    std::fs::write(&path, faces).unwrap();
    let scene = read(&path).unwrap();
    assert_eq!(scene.mesh.triangles().len(), 2);
    let told = "2 faces have fewer than three vertices; left out";
    let told = |note: &splitplane_render::scene::Note| note.warning && note.text == told;
    assert!(scene.notes.iter().any(told), "{:?}", scene.notes);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1500))]

    #[test]
    fn damaged_files_never_panic(
        which in 0..5_usize,
        cut in 0.0..1.3_f64,
        flips in prop::collection::vec((0.0..1.0_f64, any::<u8>()), 0..4),
    ) {
        let (ending, bytes) = [
            ("pbrt", SMALL.as_bytes()),
            ("ply", PLY),
            ("ply", ASCII_PLY),
            ("obj", OBJ),
            ("stl", STL),
        ][which];
        let mut bytes = bytes.to_vec();
        bytes.truncate((cut * bytes.len() as f64) as usize);
        for (at, value) in flips {
            let length = bytes.len();
            if let Some(byte) = bytes.get_mut((at * length as f64) as usize) {
                *byte = value;
            }
        }
        let file = tempfile::Builder::new().suffix(&format!(".{ending}")).tempfile().unwrap();
        std::fs::write(file.path(), &bytes).unwrap();
        let _ = read(file.path());
    }
}
