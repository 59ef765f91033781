//! glTF, OBJ with materials, PLY with colours: what of them becomes a scene.

use std::path::Path;

use splitplane::{BuildParams, Tree};
use splitplane_render::render::{RenderSettings, render};
use splitplane_render::scene::light::Light;
use splitplane_render::scene::material::Material;
use splitplane_render::scene::{LoadOptions, Scene, load};

fn read(path: &Path) -> Scene {
    load(&path.to_string_lossy(), &LoadOptions::default()).unwrap()
}

/// The picture's mean.
fn mean(scene: &Scene) -> [f32; 3] {
    let tree = Tree::build(&scene.mesh, "kd".parse().unwrap(), &BuildParams::default()).unwrap();
    let settings = RenderSettings {
        resolution: Some((16, 16)),
        ..Default::default()
    };
    let picture = render(scene, &tree, &settings, &()).unwrap();
    let count = picture.radiance.len() as f32;
    let sum = |c: usize| picture.radiance.iter().map(|p| p[c]).sum::<f32>() / count;
    [sum(0), sum(1), sum(2)]
}

/// A square of two triangles as positions and 16-bit indices, in base 64.
fn square() -> (String, usize) {
    let mut bytes = Vec::new();
    for p in [
        [-1f32, -1.0, 0.0],
        [1.0, -1.0, 0.0],
        [1.0, 1.0, 0.0],
        [-1.0, 1.0, 0.0],
    ] {
        p.iter().for_each(|c| bytes.extend(c.to_le_bytes()));
    }
    for i in [0u16, 1, 2, 0, 2, 3] {
        bytes.extend(i.to_le_bytes());
    }
    let letters = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let coded = bytes.chunks(3).flat_map(|c| {
        let word = c.iter().fold(0u32, |w, &b| w << 8 | u32::from(b)) << (8 * (3 - c.len()));
        (0..4).map(move |i| match i <= c.len() {
            true => char::from(letters[(word >> (18 - 6 * i) & 63) as usize]),
            false => '=',
        })
    });
    (coded.collect(), bytes.len())
}

fn gltf(nodes: &str, material: &str) -> String {
    let (data, length) = square();
    format!(
        r#"{{"asset":{{"version":"2.0"}},"scene":0,
        "extensionsUsed":["KHR_lights_punctual"],
        "extensions":{{"KHR_lights_punctual":{{"lights":[
            {{"type":"directional","color":[1,1,1],"intensity":2}}]}}}},
        "scenes":[{{"nodes":[0]}}],
        "nodes":{nodes},
        "cameras":[{{"type":"perspective","perspective":{{"yfov":0.5,"aspectRatio":2.0,"znear":0.1}}}}],
        "materials":[{material}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"indices":1,"material":0}}]}}],
        "accessors":[
            {{"bufferView":0,"componentType":5126,"count":4,"type":"VEC3","min":[-1,-1,0],"max":[1,1,0]}},
            {{"bufferView":1,"componentType":5123,"count":6,"type":"SCALAR"}}],
        "bufferViews":[{{"buffer":0,"byteOffset":0,"byteLength":48}},
            {{"buffer":0,"byteOffset":48,"byteLength":12}}],
        "buffers":[{{"byteLength":{length},
            "uri":"data:application/octet-stream;base64,{data}"}}]}}"#
    )
}

#[test]
fn gltf_has_meshes_cameras_lights_and_materials_at_their_nodes() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("square.gltf");
    let nodes = r#"[{"children":[1,2,3,4]},{"mesh":0,"translation":[0,0,-4]},
        {"mesh":0,"scale":[9,9,9],"translation":[0,0,-6]},
        {"camera":0},{"extensions":{"KHR_lights_punctual":{"light":0}}}]"#;
    let material = r#"{"pbrMetallicRoughness":{"baseColorFactor":[0.8,0.4,0.2,1],
        "metallicFactor":0,"roughnessFactor":1}}"#;
    std::fs::write(&path, gltf(nodes, material)).unwrap();
    let scene = read(&path);
    assert_eq!(scene.mesh.triangles().len(), 4);
    assert_eq!(scene.mesh.bounds().min, [-9.0, -9.0, -6.0]);
    assert_eq!((scene.film.width, scene.film.height), (1440, 720));
    assert!((scene.camera.fov - 0.5f32.to_degrees()).abs() < 1e-3);
    assert!(
        matches!(scene.lights[..], [Light::Distant { towards, .. }] if towards == [0.0, 0.0, 1.0])
    );
    assert!(matches!(scene.materials[0], Material::Substrate { .. }));
    assert!(
        scene.notes.iter().all(|note| !note.warning),
        "{:?}",
        scene.notes
    );
    // The light falls along the view: reflectance times irradiance over pi, roughly.
    let [r, g, b] = mean(&scene);
    assert!(r > 1.5 * g && g > 1.5 * b && r > 0.3, "{r} {g} {b}");
}

#[test]
fn gltf_emits_and_is_cut_out() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("lamp.gltf");
    let nodes = r#"[{"children":[1,2]},{"mesh":0,"translation":[0,0,-1]},{"camera":0}]"#;
    let lamp = r#"{"emissiveFactor":[1,0.5,0.25]}"#;
    std::fs::write(&path, gltf(nodes, lamp)).unwrap();
    let [r, g, b] = mean(&read(&path));
    assert!((r - 1.0).abs() < 0.01 && (g - 0.5).abs() < 0.01 && (b - 0.25).abs() < 0.01);
    let hole = r#"{"emissiveFactor":[1,1,1],"alphaMode":"MASK",
        "pbrMetallicRoughness":{"baseColorFactor":[1,1,1,0.3]}}"#;
    std::fs::write(&path, gltf(nodes, hole)).unwrap();
    assert_eq!(mean(&read(&path)), [0.0; 3]);
}

#[test]
fn a_gltf_that_lies_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("bad.gltf");
    let nodes = r#"[{"mesh":0}]"#;
    let good = gltf(nodes, "{}");
    for bad in [
        String::new(),
        good[..good.len() / 2].to_owned(),
        good.replace("\"count\":4", "\"count\":4000000000"),
        good.replace(
            "\"byteOffset\":48,\"byteLength\":12",
            "\"byteOffset\":48,\"byteLength\":99",
        ),
        good.replace("base64,", "base64,!"),
        good.replace("data:application/octet-stream;base64,", "gone.bin?"),
    ] {
        std::fs::write(&path, bad).unwrap();
        let error = load(&path.to_string_lossy(), &LoadOptions::default()).unwrap_err();
        assert!(error.file.ends_with("bad.gltf"), "{error}");
    }
}

#[test]
fn obj_takes_the_materials_of_its_library() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("box.obj");
    std::fs::write(
        &path,
        "mtllib box.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\n\
         usemtl shiny\nf 1 2 3\nusemtl lamp\nf 1 3 4\nusemtl shiny\nf 1 2 5\nusemtl gone\nf 2 3 5\n",
    )
    .unwrap();
    std::fs::write(
        folder.path().join("box.mtl"),
        "newmtl shiny\nKd .2 .4 .6\nKs .5 .5 .5\nNs 50\nillum 2\n\nnewmtl lamp\nKd 0 0 0\nKe 3 2 1\n",
    )
    .unwrap();
    let scene = read(&path);
    assert_eq!(scene.shapes.len(), 4);
    let material = |shape: usize| &scene.materials[scene.shapes[shape].material as usize];
    assert!(matches!(material(0), Material::Substrate { .. }));
    assert!(matches!(material(2), Material::Substrate { .. }));
    assert!(matches!(material(3), Material::Matte { .. }));
    let light = scene.shapes[1].area_light.as_ref().unwrap();
    assert_eq!(light.radiance, [3.0, 2.0, 1.0]);
    assert!(scene.lights.is_empty(), "the file has a light of its own");
    // A colour of one number is grey; of two, or none, the library cannot be read.
    let library = folder.path().join("box.mtl");
    std::fs::write(&library, "newmtl shiny\nKd .2\nnewmtl lamp\nKe 3\n").unwrap();
    let scene = read(&path);
    let light = scene.shapes[1].area_light.as_ref().unwrap();
    assert_eq!(light.radiance, [3.0; 3]);
    for colors in ["Kd", "Ka 1 2"] {
        std::fs::write(&library, format!("newmtl shiny\n{colors}\n")).unwrap();
        let notes = read(&path).notes;
        assert!(
            notes
                .iter()
                .any(|note| note.warning && note.text.contains("line 2"))
        );
    }
    // Without the library it is grey, and says so.
    std::fs::remove_file(&library).unwrap();
    let scene = read(&path);
    assert_eq!(scene.notes.iter().filter(|note| note.warning).count(), 1);
    assert!(!scene.lights.is_empty());
}

#[test]
fn colours_of_a_plys_vertices_are_seen() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("red.ply");
    std::fs::write(
        &path,
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n\
         property float z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n\
         element face 1\nproperty list uchar int vertex_indices\nend_header\n\
         0 0 0 255 0 0\n1 0 0 255 0 0\n0 1 0 255 0 0\n3 0 1 2\n",
    )
    .unwrap();
    let scene = read(&path);
    assert_eq!(scene.colors, [[1.0, 0.0, 0.0]; 3]);
    let mut dark = scene.clone();
    dark.colors = vec![[0.0; 3]; 3];
    let (with, without) = (mean(&scene), mean(&dark));
    assert!(with[0] > without[0] + 0.01 && with[1] == without[1]);
}
