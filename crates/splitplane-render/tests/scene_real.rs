//! Real scenes, where they are found: beside the workspace in `../shared/scenes`, or in the
//! folder that `SPLITPLANE_SCENES` names.

use std::path::{Path, PathBuf};

use splitplane_render::scene::{LoadOptions, Scene, load};

/// The folder of the scenes; `None`, with a word about it, where there is none.
fn scenes() -> Option<PathBuf> {
    let named = std::env::var_os("SPLITPLANE_SCENES").map(PathBuf::from);
    let beside = Path::new(env!("CARGO_MANIFEST_DIR"))
        .ancestors()
        .map(|a| a.join("shared/scenes"));
    let found = named
        .into_iter()
        .chain(beside)
        .find(|folder| folder.join("killeroo").is_dir());
    if found.is_none() {
        eprintln!("skipped: the scenes are not here; SPLITPLANE_SCENES=FOLDER names their folder");
    }
    found
}

fn read(file: &str) -> Option<Scene> {
    let path = scenes()?.join(file);
    let scene = load(&path.to_string_lossy(), &LoadOptions::default());
    let scene = scene.unwrap_or_else(|error| panic!("{error}"));
    for note in &scene.notes {
        eprintln!(
            "{}: {}{}",
            note.place,
            if note.warning { "warning: " } else { "" },
            note.text
        );
    }
    consistent(&scene);
    Some(scene)
}

/// What every scene promises.
fn consistent(scene: &Scene) {
    let mut next = 0;
    for shape in &scene.shapes {
        assert_eq!(
            shape.triangles.start, next,
            "shapes cover the mesh in order"
        );
        assert!((shape.material as usize) < scene.materials.len());
        assert!(!shape.has_normals || scene.normals.len() == scene.mesh.positions().len());
        assert!(!shape.has_uvs || scene.uvs.len() == scene.mesh.positions().len());
        next = shape.triangles.end;
    }
    assert_eq!(next as usize, scene.mesh.triangles().len());
}

fn has_triangles(file: &str, triangles: usize) {
    if let Some(scene) = read(file) {
        assert_eq!(scene.mesh.triangles().len(), triangles, "{file}");
    }
}

#[test]
fn killeroo_is_subdivided_once() {
    has_triangles("killeroo/killeroo.pbrt", 33_264);
    has_triangles("killeroo/killeroo-legs.pbrt", 33_264);
}

#[test]
fn sponza_has_its_triangles() {
    has_triangles("sponza/sponza.pbrt", 262_205);
}

#[test]
fn coffee_has_its_triangles() {
    has_triangles("coffee/scene.pbrt", 235_271);
}

#[test]
fn kitchen_has_its_triangles() {
    has_triangles("kitchen/scene.pbrt", 1_443_517);
}

#[test]
fn living_room_has_its_triangles() {
    let Some(folder) = scenes() else { return };
    let text = std::fs::read_to_string(folder.join("living-room/scene.pbrt")).unwrap();
    if !text.contains("WorldEnd") {
        eprintln!(
            "skipped: living-room/scene.pbrt is cut off after {} bytes",
            text.len()
        );
        return;
    }
    has_triangles("living-room/scene.pbrt", 143_163);
}

#[test]
fn the_meshes_of_living_room_have_its_triangles() {
    let Some(folder) = scenes() else { return };
    let mut text = "WorldBegin\n".to_owned();
    for number in 0..65 {
        let file = folder.join(format!("living-room/models/Mesh{number:03}.ply"));
        text += &format!(
            "Shape \"plymesh\" \"string filename\" \"{}\"\n",
            file.display()
        );
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("all.pbrt");
    std::fs::write(&path, text + "WorldEnd\n").unwrap();
    has_triangles(&path.to_string_lossy(), 143_163);
}

#[test]
fn every_conformance_scene_loads_or_names_the_file_that_is_not_there() {
    let Some(folder) = scenes() else { return };
    let mut files = Vec::new();
    for kind in std::fs::read_dir(folder.join("conformance")).unwrap() {
        for file in std::fs::read_dir(kind.unwrap().path()).unwrap() {
            let path = file.unwrap().path();
            if path.extension().is_some_and(|e| e == "pbrt") {
                files.push(path);
            }
        }
    }
    files.sort();
    assert!(files.len() >= 55, "{} files", files.len());
    let mut loaded = 0;
    for file in &files {
        match load(&file.to_string_lossy(), &LoadOptions::default()) {
            Ok(scene) => {
                consistent(&scene);
                loaded += 1;
            }
            // A part that others include is no scene.
            Err(error) if file.ends_with("geometry/cube.pbrt") => {
                assert!(error.message.contains("WorldBegin"), "{error}");
            }
            Err(error) => assert!(error.message.contains("there is no file"), "{error}"),
        }
    }
    assert!(
        loaded >= files.len() - 2,
        "{loaded} of {} loaded",
        files.len()
    );
}
