//! Scenes by name.

use std::path::PathBuf;

use splitplane_render::scene::library::{Resolved, list, resolve};
use splitplane_render::scene::{LoadOptions, Scene, load};

fn read(name: &str) -> Scene {
    load(name, &LoadOptions::default()).unwrap_or_else(|error| panic!("{error}"))
}

/// Whether a point of the world lies in the picture.
fn in_picture(scene: &Scene, point: [f32; 3]) -> bool {
    let [x, y, z] = scene.camera.camera_to_world.inverse().point(point);
    let tan = (scene.camera.fov.to_radians() / 2.0).tan();
    let aspect = scene.film.width as f32 / scene.film.height as f32;
    z > 0.0 && x.abs() <= z * tan * aspect && y.abs() <= z * tan
}

#[test]
fn the_truck_is_built_in_and_wholly_in_the_picture() {
    let scene = read("TRUCK");
    assert_eq!(
        (scene.name.as_str(), scene.mesh.triangles().len()),
        ("truck", 116_501)
    );
    assert!(
        scene
            .mesh
            .positions()
            .iter()
            .all(|&p| in_picture(&scene, p))
    );
    assert!(scene.materials.len() > 5 && !scene.lights.is_empty());
}

#[test]
fn generated_scenes_have_about_the_triangles_that_are_asked_for() {
    for (name, size) in [
        ("arcade", 100_000),
        ("grove", 100_000),
        ("arcade:40000", 40_000),
        ("grove:40000", 40_000),
        ("arcade:500000", 500_000),
        ("grove:500000", 500_000),
    ] {
        let scene = read(name);
        let found = scene.mesh.triangles().len();
        assert!(
            found.abs_diff(size) * 20 <= size,
            "{name} has {found} triangles"
        );
        assert_eq!(scene.mesh.skipped().total(), 0, "{name}");
        assert_eq!(scene.name, name);
    }
}

#[test]
fn generated_scenes_are_the_same_every_time() {
    for name in ["arcade", "grove"] {
        let (a, b) = (read(name), read(name));
        assert_eq!(a.mesh.positions(), b.mesh.positions());
        assert_eq!(a.mesh.triangles(), b.mesh.triangles());
    }
}

#[test]
fn generated_scenes_are_mostly_oblique() {
    for (name, share) in [("arcade", 0.6), ("grove", 0.99)] {
        let scene = read(name);
        let count = scene.mesh.triangles().len() as u32;
        let oblique = (0..count)
            .filter(|&t| scene.mesh.normal(t).iter().all(|c| c.abs() < 0.999))
            .count();
        assert!(
            oblique as f32 > share * count as f32,
            "{name}: {oblique} of {count}"
        );
    }
}

#[test]
fn a_wrong_size_names_the_sizes_there_are() {
    for (name, part) in [
        ("arcade:7", "from 40000 to 100000000"),
        ("grove:many", "from 40000 to 100000000"),
        ("truck:5", "takes no number of triangles"),
    ] {
        let error = resolve(name, &[]).unwrap_err().to_string();
        assert!(error.contains(part), "{error}");
    }
}

#[test]
fn scenes_on_the_search_path_have_names() {
    let folder = tempfile::tempdir().unwrap();
    let world = "# a little world\nWorldBegin\nShape \"sphere\"\nWorldEnd\n";
    for (file, text) in [
        ("kitchen/scene.pbrt", world),
        ("killeroo/killeroo.pbrt", world),
        ("killeroo/killeroo-legs.pbrt", world),
        ("killeroo/geometry.pbrt", "Shape \"sphere\"\n"),
        ("sponza/one.pbrt", world),
        ("truck/scene.pbrt", world),
        ("empty/notes.txt", "nothing"),
    ] {
        let path = folder.path().join(file);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, text).unwrap();
    }
    let search = vec![folder.path().to_owned(), PathBuf::from("/nowhere")];
    let entries = list(&search);
    let found: Vec<&str> = entries
        .iter()
        .filter(|e| e.file.is_some())
        .map(|e| e.name.as_str())
        .collect();
    // The truck that is built in comes first.
    assert_eq!(found, ["killeroo", "killeroo-legs", "kitchen", "sponza"]);
    assert!(
        entries
            .iter()
            .skip(3)
            .all(|entry| entry.description == "a little world")
    );

    let options = LoadOptions {
        search: search.clone(),
        ..LoadOptions::default()
    };
    assert_eq!(
        load("Killeroo-Legs", &options).unwrap().name,
        "killeroo-legs"
    );
    let path = folder.path().join("kitchen/scene.pbrt");
    let by_path = resolve(&path.to_string_lossy(), &search).unwrap();
    assert_eq!(
        by_path,
        Resolved::File {
            path,
            name: "kitchen".to_owned()
        }
    );
    let error = load("kilaroo", &options).unwrap_err().to_string();
    assert!(
        error.contains("truck, arcade, grove, killeroo, killeroo-legs, kitchen, sponza"),
        "{error}"
    );
}

#[test]
fn a_template_takes_the_values_that_are_defined() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("template.pbrt");
    let text = "Film \"image\" \"integer xresolution\" [$width] \"integer yresolution\" 20\n\
                Sampler \"$sampler\" \"integer pixelsamples\" $spp\n$lookat\nCamera \"perspective\"\nWorldBegin WorldEnd\n";
    std::fs::write(&path, text).unwrap();
    let mut options = LoadOptions::default();
    for (name, value) in [
        ("width", "40"),
        ("sampler", "random"),
        ("spp", "[3]"),
        ("lookat", "LookAt 0 0 5 0 0 0 0 1 0"),
    ] {
        options.defines.insert(name.to_owned(), value.to_owned());
    }
    let scene = load(&path.to_string_lossy(), &options).unwrap();
    assert_eq!((scene.film.width, scene.film.height), (40, 20));
    assert_eq!(scene.sampler.samples_per_pixel, 3);
    assert_eq!(
        scene.camera.camera_to_world.point([0.0; 3]),
        [0.0, 0.0, 5.0]
    );
    options.defines.remove("lookat");
    let error = load(&path.to_string_lossy(), &options).unwrap_err();
    assert_eq!((error.line, error.column), (3, 1));
    assert!(error.message.contains("--define lookat=VALUE"), "{error}");
}
