//! What the directives of pbrt-v3 mean.

use std::path::Path;

use splitplane_render::scene::light::Light;
use splitplane_render::scene::material::Material;
use splitplane_render::scene::settings::{Filter, Integrator, SamplerKind};
use splitplane_render::scene::texture::{Mapping, Texture};
use splitplane_render::scene::{LoadOptions, Scene, load};

/// Reads a scene of `before` and `world`, in a folder of `files`.
fn scene_in(folder: &Path, before: &str, world: &str) -> Scene {
    let path = folder.join("test.pbrt");
    std::fs::write(&path, format!("{before}\nWorldBegin\n{world}\nWorldEnd\n")).unwrap();
    load(&path.to_string_lossy(), &LoadOptions::default()).unwrap_or_else(|e| panic!("{e}"))
}

fn scene(before: &str, world: &str) -> Scene {
    scene_in(tempfile::tempdir().unwrap().path(), before, world)
}

fn close(a: [f32; 3], b: [f32; 3]) {
    assert!(
        a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-5),
        "{a:?} is not {b:?}"
    );
}

const TRIANGLE: &str =
    "Shape \"trianglemesh\" \"integer indices\" [0 1 2] \"point P\" [0 0 0 1 0 0 0 1 0]\n";

#[test]
fn the_camera_looks_along_z_with_x_to_the_right_in_a_left_handed_world() {
    let scene = scene(
        "LookAt 1 2 3  1 2 8  0 1 0\nCamera \"perspective\" \"float halffov\" 20",
        "",
    );
    let camera = &scene.camera;
    assert_eq!(camera.fov, 40.0);
    close(
        camera.camera_to_world.point([0.0, 0.0, 0.0]),
        [1.0, 2.0, 3.0],
    );
    close(
        camera.camera_to_world.vector([0.0, 0.0, 1.0]),
        [0.0, 0.0, 1.0],
    );
    close(
        camera.camera_to_world.vector([1.0, 0.0, 0.0]),
        [1.0, 0.0, 0.0],
    );
}

#[test]
fn transforms_apply_from_the_last_to_the_first() {
    let world = format!(
        "Translate 1 0 0  Rotate 90 0 0 1  Scale 2 2 2\n{TRIANGLE}\
         Transform [1 0 0 0  0 1 0 0  0 0 1 0  5 6 7 1]\n{TRIANGLE}"
    );
    let scene = scene("", &world);
    close(scene.mesh.corners(0)[1], [1.0, 2.0, 0.0]);
    close(scene.mesh.corners(1)[1], [6.0, 6.0, 7.0]);
}

#[test]
fn blocks_bring_back_what_was_before_them() {
    let world = format!(
        "CoordinateSystem \"origin\"\nTransformBegin\nTranslate 9 9 9\nReverseOrientation\n\
         TransformEnd\n{TRIANGLE}AttributeBegin\nReverseOrientation\nTranslate 1 1 1\n\
         Material \"mirror\"\nAttributeEnd\n{TRIANGLE}Translate 3 3 3\n\
         CoordSysTransform \"origin\"\n{TRIANGLE}"
    );
    let scene = scene("", &world);
    for triangle in 0..3 {
        close(scene.mesh.corners(triangle)[0], [0.0; 3]);
    }
    // TransformBegin keeps transforms alone; AttributeBegin all.
    assert!(
        scene
            .shapes
            .iter()
            .all(|shape| shape.flip_normals && shape.material == 0)
    );
}

#[test]
fn settings_have_the_defaults_of_pbrt() {
    let scene = scene("", "");
    assert_eq!((scene.film.width, scene.film.height), (640, 480));
    assert_eq!(scene.filter, Filter::Box { radius: [0.5; 2] });
    assert_eq!(scene.sampler.samples_per_pixel, 16);
    assert!(matches!(
        scene.sampler.kind,
        SamplerKind::Halton {
            sample_at_center: false
        }
    ));
    assert!(matches!(
        scene.integrator,
        Integrator::Path { max_depth: 5, .. }
    ));
    assert_eq!(scene.camera.fov, 90.0);
    assert_eq!(scene.accelerator, None);
}

#[test]
fn accelerators_go_by_all_their_names() {
    for (text, expected) in [
        ("\"kdtree\"", Some("kd")),
        (
            "\"bsparbitraryfastkd\" \"integer nbDirections\" [9]",
            Some("wn+kd:9"),
        ),
        ("\"wn+kd\"", Some("wn+kd:6")),
        ("\"grid\"", None),
    ] {
        let scene = scene(&format!("Accelerator {text}"), "");
        assert_eq!(scene.accelerator.as_deref(), expected, "{text}");
        assert_eq!(scene.notes.len(), usize::from(expected.is_none()));
    }
}

#[test]
fn lights_are_scaled_and_placed() {
    let scene = scene(
        "",
        "Translate 1 0 0\nLightSource \"point\" \"rgb I\" [1 2 3] \"rgb scale\" [2 2 2] \
         \"point from\" [0 5 0]\nLightSource \"distant\" \"point from\" [0 0 4] \
         \"point to\" [0 0 0]\nLightSource \"infinite\" \"color L\" [.1 .2 .3]",
    );
    let [
        Light::Point {
            position,
            intensity,
        },
        Light::Distant { towards, .. },
        Light::Infinite { radiance, .. },
    ] = scene.lights[..]
    else {
        panic!("{:?}", scene.lights);
    };
    close(position, [1.0, 5.0, 0.0]);
    close(intensity, [2.0, 4.0, 6.0]);
    close(towards, [0.0, 0.0, 1.0]);
    close(radiance, [0.1, 0.2, 0.3]);
}

#[test]
fn a_shape_may_override_its_material() {
    let with_color = TRIANGLE.trim_end().to_owned() + " \"rgb Kd\" [.1 .2 .3]\n";
    let scene = scene("", &format!("Material \"plastic\"\n{TRIANGLE}{with_color}"));
    let kd = |shape: usize| match &scene.materials[scene.shapes[shape].material as usize] {
        Material::Plastic { kd, .. } => match **kd {
            Texture::Constant(kd) => kd,
            _ => panic!("not constant"),
        },
        other => panic!("{other:?}"),
    };
    close(kd(0), [0.25; 3]);
    close(kd(1), [0.1, 0.2, 0.3]);
}

#[test]
fn instances_are_copied_to_their_places() {
    let world = format!(
        "Translate 0 0 1\nObjectBegin \"o\"\nTranslate 1 0 0\n{TRIANGLE}ObjectEnd\n\
         ObjectInstance \"o\"\nTranslate 0 5 0\nObjectInstance \"o\"\n"
    );
    let scene = scene("", &world);
    close(scene.mesh.corners(0)[0], [1.0, 0.0, 2.0]);
    close(scene.mesh.corners(1)[0], [1.0, 5.0, 2.0]);
    assert_eq!(scene.notes.len(), 1);
    assert!(!scene.notes[0].warning && scene.notes[0].text.contains("2 triangles"));
}

#[test]
fn images_are_made_linear_and_their_rows_start_at_the_top() {
    let folder = tempfile::tempdir().unwrap();
    let mut image = image::RgbImage::new(1, 2);
    image.put_pixel(0, 0, image::Rgb([255, 0, 0]));
    image.put_pixel(0, 1, image::Rgb([188, 188, 188]));
    image.save(folder.path().join("two.png")).unwrap();
    let scene = scene_in(
        folder.path(),
        "",
        "Texture \"t\" \"spectrum\" \"imagemap\" \"string filename\" \"two.png\" \
         \"float uscale\" 3 \"float vdelta\" .5\nMaterial \"matte\" \"texture Kd\" \"t\"",
    );
    let Some(Material::Matte { kd, .. }) = scene.materials.last() else {
        panic!()
    };
    let Texture::Image { image, mapping, .. } = &**kd else {
        panic!()
    };
    assert_eq!(image.size(), (1, 2));
    close(image.pixel(0, 0), [1.0, 0.0, 0.0]);
    assert!(
        (image.pixel(0, 1)[0] - 0.503).abs() < 1e-3,
        "sRGB 188 is about one half"
    );
    let uv = Mapping::Uv {
        scale: [3.0, 1.0],
        shift: [0.0, 0.5],
    };
    assert_eq!(*mapping, uv);
    assert!(scene.notes.is_empty());
}

#[test]
fn what_is_not_supported_warns_once_with_its_place() {
    let scene = scene(
        "Camera \"telescope\"",
        "Shape \"blob\"\nShape \"blob\"\nShape \"plymesh\" \"string filename\" \"gone.ply\"\n\
         Texture \"t\" \"color\" \"imagemap\" \"string filename\" \"gone.png\"\n\
         Material \"matte\" \"rgb Kdd\" [1 1 1]\nMaterial \"hair\"\nMakeNamedMedium \"fog\"\n\
         Include \"gone.pbrt\"\nInclude \"gone.pbrt\"\n",
    );
    let notes: Vec<String> = scene
        .notes
        .iter()
        .map(|note| {
            assert!(note.warning);
            let place = note.place.split_once("test.pbrt").unwrap().1;
            format!("{place} {}", note.text)
        })
        .collect();
    let expected = [
        (":1:1", "the camera \"telescope\""),
        (":3:1", "the shape \"blob\""),
        (":5:17", "there is no mesh \"gone.ply\""),
        (":6:1", "there is no image \"gone.png\""),
        (":7:18", "does not use \"rgb Kdd\""),
        (":8:1", "the material \"hair\""),
        (":9:1", "participating media"),
        (":10:9", "there is no file \"gone.pbrt\""),
    ];
    assert_eq!(notes.len(), expected.len(), "{notes:#?}");
    for (note, (place, text)) in notes.iter().zip(expected) {
        assert!(note.starts_with(place) && note.contains(text), "{note}");
    }
}

#[test]
fn a_tessellated_shape_says_so_and_is_no_warning() {
    let scene = scene("", "Shape \"sphere\" \"float radius\" 2\nShape \"sphere\"");
    let [note] = &scene.notes[..] else {
        panic!("{:?}", scene.notes)
    };
    assert!(!note.warning);
    assert!(
        note.text.contains("2 × \"sphere\"") && note.text.contains("128 × 64"),
        "{}",
        note.text
    );
    let far = scene
        .mesh
        .positions()
        .iter()
        .map(|p| p.iter().map(|c| c * c).sum::<f32>().sqrt());
    assert!((far.fold(0.0, f32::max) - 2.0).abs() < 1e-6);
}

#[test]
fn reversed_shapes_have_reversed_shading_normals() {
    let with_normals = TRIANGLE.trim_end().to_owned() + " \"normal N\" [0 0 1 0 0 1 0 0 1]\n";
    let scene = scene(
        "",
        &format!("{with_normals}ReverseOrientation\nScale 1 1 -1\n{with_normals}"),
    );
    close(scene.normals[0], [0.0, 0.0, 1.0]);
    // Turned over by the mirror, and back by ReverseOrientation.
    close(scene.normals[3], [0.0, 0.0, 1.0]);
    assert!(!scene.shapes[0].flip_normals && !scene.shapes[1].flip_normals);
}

#[test]
fn levels_of_subdivision_that_are_asked_for_go_before_the_files() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("ball.pbrt");
    let world = "Shape \"loopsubdiv\" \"integer levels\" 2 \"integer indices\" [0 1 2 0 3 1 0 2 3 1 3 2] \
                 \"point P\" [1 1 1 1 -1 -1 -1 1 -1 -1 -1 1]";
    std::fs::write(&path, format!("WorldBegin\n{world}\nWorldEnd\n")).unwrap();
    let read = |subdivision_levels| {
        let options = LoadOptions {
            subdivision_levels,
            ..LoadOptions::default()
        };
        load(&path.to_string_lossy(), &options).unwrap()
    };
    for (levels, triangles, warnings) in [
        (None, 64, 0),
        (Some(2), 64, 0),
        (Some(0), 4, 1),
        (Some(3), 256, 1),
    ] {
        let scene = read(levels);
        assert_eq!(scene.mesh.triangles().len(), triangles);
        let warned = scene.notes.iter().filter(|note| note.warning).count();
        assert_eq!(warned, warnings, "{:?}", scene.notes);
    }
    // The control mesh has its limit positions: those of the tetrahedron's corners, of which each
    // has three neighbours, lie at 1 - 3 · 1/5 · (1 + 1/3) = 1/5 of theirs [PBRT3, 3.8].
    let scene = read(Some(0));
    for p in scene.mesh.positions() {
        assert!(p.iter().all(|c| (c.abs() - 0.2).abs() < 1e-6), "{p:?}");
    }
}
