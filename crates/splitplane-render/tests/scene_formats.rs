//! glTF, OBJ with materials, PLY with colours: what of them becomes a scene.

use std::path::Path;

use splitplane::{BuildParams, Tree};
use splitplane_render::render::{RenderSettings, render};
use splitplane_render::scene::light::Light;
use splitplane_render::scene::material::Material;
use splitplane_render::scene::texture::{Mapping, Texture};
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
fn what_of_a_gltf_is_not_used_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.gltf");
    let nodes = r#"[{"children":[1,2,3]},{"mesh":0},{"camera":0},
        {"extensions":{"KHR_lights_punctual":{"light":0}}}]"#;
    let good = gltf(nodes, "{}");
    let camera =
        r#"{"type":"perspective","perspective":{"yfov":0.5,"aspectRatio":2.0,"znear":0.1}}"#;
    assert!(good.contains(camera));
    let ends = |x: f32, y: f32, near: f32, far: f32| {
        let orthographic = format!(r#"{{"xmag":{x},"ymag":{y},"znear":{near},"zfar":{far}}}"#);
        good.replace(
            camera,
            &format!(r#"{{"type":"orthographic","orthographic":{orthographic}}}"#),
        )
    };
    let unusable = "a camera cannot be used (its field of view or extent is none, or zfar lies \
                    before znear); one was chosen to suit the scene";
    for (text, told) in [
        (good.clone(), None),
        (ends(2.0, 1.0, 0.0, 9.0), None),
        (ends(2.0, 0.0, 0.0, 9.0), Some(unusable)),
        (ends(2.0, 1.0, 9.0, 1.0), Some(unusable)),
        (good.replace("\"yfov\":0.5", "\"yfov\":0"), Some(unusable)),
        (
            good.replace(
                "[\"KHR_lights_punctual\"]",
                "[\"KHR_lights_punctual\",\"EXT_mesh_gpu_instancing\"]",
            ),
            Some("the extension EXT_mesh_gpu_instancing is not supported; rendered without"),
        ),
        (
            good.replace("\"scene\":0,", "")
                .replace("[{\"nodes\":[0]}]", "[{\"nodes\":[0]},{\"nodes\":[]}]"),
            Some("of 2 scenes none is the default; the first is taken"),
        ),
    ] {
        std::fs::write(&path, &text).unwrap();
        let scene = read(&path);
        let notes: Vec<&str> = scene.notes.iter().map(|note| note.text.as_str()).collect();
        assert_eq!(notes, Vec::from_iter(told), "{text}");
    }
}

#[test]
fn a_scene_without_anything_to_see_says_so() {
    let told = "there is nothing to see: all triangles are without area or not finite";
    let flat = obj("v 0 0 0\nv 1 0 0\nf 1 2 2\n", "");
    assert_eq!(warnings(&flat), [format!("a.obj: {told}")]);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.pbrt");
    let shape = "Shape \"trianglemesh\" \"integer indices\" [0 1 0] \"point P\" [0 0 0 1 0 0]";
    for (object, instance) in [
        ("", ""),
        ("ObjectBegin \"o\"", "ObjectEnd ObjectInstance \"o\""),
    ] {
        let text = format!("WorldBegin {object} {shape} {instance} WorldEnd");
        std::fs::write(&path, text).unwrap();
        assert!(warnings(&read(&path)).contains(&format!("a.pbrt: {told}")));
    }
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
        // A vertex is not a number.
        good.replace("base64,AACAvwAAgL8", "base64,AADA/wAAgL8"),
    ] {
        assert_ne!(bad, good);
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

/// The scene of an OBJ file with a library `m.mtl` beside it.
fn obj(text: &str, library: &str) -> Scene {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.obj");
    std::fs::write(&path, text).unwrap();
    std::fs::write(folder.path().join("m.mtl"), library).unwrap();
    read(&path)
}

/// The warnings, with the names of files but without their folders.
fn warnings(scene: &Scene) -> Vec<String> {
    let warnings = scene.notes.iter().filter(|note| note.warning);
    warnings
        .map(|note| {
            let place = note.place.rsplit('/').next().unwrap();
            format!("{place}: {}", note.text)
        })
        .collect()
}

/// The diffuse colour of a shape that is matte.
fn kd(scene: &Scene, shape: usize) -> Texture {
    match &scene.materials[scene.shapes[shape].material as usize] {
        Material::Matte { kd, .. } => Texture::clone(kd),
        other => panic!("{other:?}"),
    }
}

fn color(scene: &Scene, shape: usize) -> [f32; 3] {
    match kd(scene, shape) {
        Texture::Constant(color) => color,
        other => panic!("{other:?}"),
    }
}

const SQUARE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvn 0 0 1\n";

#[test]
fn faces_of_an_obj_before_any_material_are_grey() {
    let faces = "mtllib m.mtl\nf 1 2 3\nusemtl red\nf 1 3 4\nusemtl\nf 2 3 4\n";
    let scene = obj(&format!("{SQUARE}{faces}"), "newmtl red\nKd 1 0 0\n");
    let colors = [0, 1, 2].map(|shape| color(&scene, shape));
    assert_eq!(colors, [[0.6; 3], [1.0, 0.0, 0.0], [0.6; 3]]);
    assert_eq!(warnings(&scene), [""; 0]);
}

#[test]
fn faces_of_an_obj_keep_the_normals_and_coordinates_that_they_have() {
    let faces = "f 1/1/1 2/2/1 3/3/1\nf 1//1 3//1 4//1\nf 1 2 4\ng next\nf 4/1 2/2 3/3\nf 1/1 2 3/3\n\
                 f 4/3 3/2 2/1\n";
    let scene = obj(&format!("{SQUARE}{faces}"), "");
    let has: Vec<(bool, bool)> = scene
        .shapes
        .iter()
        .map(|shape| (shape.has_normals, shape.has_uvs))
        .collect();
    let expected = [
        (true, true),
        (true, false),
        (false, false),
        (false, true),
        (false, false),
        (false, true),
    ];
    assert_eq!(has, expected);
    // Triangles are in the order of the file, and each vertex has what its face says.
    let corner = |triangle: usize, corner: usize| {
        let vertex = scene.mesh.triangles()[triangle][corner] as usize;
        (scene.mesh.positions()[vertex], scene.uvs[vertex])
    };
    assert_eq!(corner(0, 2), ([1.0, 1.0, 0.0], [1.0, 1.0]));
    assert_eq!(corner(3, 0), ([0.0, 1.0, 0.0], [0.0, 0.0]));
    assert_eq!(corner(5, 0), ([0.0, 1.0, 0.0], [1.0, 1.0]));
    assert_eq!(
        scene.normals[scene.mesh.triangles()[1][2] as usize],
        [0.0, 0.0, 1.0]
    );
    let told = "a.obj: faces that have normals or texture coordinates at some of their vertices \
                alone are rendered without: 1";
    assert_eq!(warnings(&scene), [told]);
}

#[test]
fn maps_of_an_mtl_have_options_and_then_a_name() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.obj");
    let image = folder.path().join("my tex 2.png");
    image::RgbImage::from_pixel(2, 2, image::Rgb([255; 3]))
        .save(&image)
        .unwrap();
    let faces = "mtllib m.mtl\nusemtl a\nf 1/1 2/2 3/3\n";
    std::fs::write(&path, format!("{SQUARE}{faces}")).unwrap();
    for (map, scale, shift, told) in [
        ("map_Kd my tex 2.png", [1.0; 2], [0.0; 2], None),
        (
            "map_Kd\t-bm 0.5 -clamp off my tex 2.png  ",
            [1.0; 2],
            [0.0; 2],
            None,
        ),
        (
            "map_Kd -s 2 3 1 -o .5 my tex 2.png",
            [2.0, 3.0],
            [0.5, 0.0],
            None,
        ),
        (
            "map_Kd -clamp on -mm 0 1 my tex 2.png",
            [1.0; 2],
            [0.0; 2],
            Some(
                "m.mtl:3: \"map_Kd -clamp on\" of the material \"a\" is not supported; rendered without",
            ),
        ),
    ] {
        let library = format!("newmtl a\nKd 1 1 1\n{map}\n");
        std::fs::write(folder.path().join("m.mtl"), library).unwrap();
        let scene = read(&path);
        assert_eq!(scene.contents.images, std::slice::from_ref(&image), "{map}");
        assert_eq!(warnings(&scene), Vec::from_iter(told), "{map}");
        let Texture::Scale(_, texture) = kd(&scene, 0) else {
            panic!("{map}")
        };
        let Texture::Image { mapping, .. } = *texture else {
            panic!("{map}")
        };
        assert_eq!(mapping, Mapping::Uv { scale, shift }, "{map}");
    }
}

#[test]
fn what_of_an_obj_and_its_library_is_left_out_is_told() {
    let faces = "usemtl b\nf 1 2 3\nusemtl c\nf 1 3 4\nf 1 2\nf 1\nl 1 2 3 4\np 1\n";
    let scene = obj(&format!("{SQUARE}{faces}"), "");
    assert_eq!(scene.mesh.triangles().len(), 2);
    let short = "a.obj: 2 faces have fewer than three vertices; left out";
    let others = "a.obj: points, lines, curves and surfaces are not supported; left out: 2";
    let absent = "a.obj:9: no library (mtllib) has the material \"b\" and 1 more; rendered grey";
    assert_eq!(warnings(&scene), [others, absent, short]);

    // What changes nothing, and materials that are not used, are not worth a word.
    let library = "newmtl b\nKa 1 1 1\nmap_Ka x.png\nTf 1 1 1\nPm 0\nd 1\nTr 0.5\nbump -bm 2 x.png\nbump x.png\n\
                   newmtl unused\nnorm x.png\nnewmtl d\nPr 0\n\nbump y.png\n";
    let faces = faces
        .replace("usemtl c", "usemtl d")
        .replace("f 1 2\nf 1\nl 1 2 3 4\np 1\n", "");
    let scene = obj(&format!("mtllib m.mtl\n{SQUARE}{faces}"), library);
    let bump =
        "m.mtl:8: \"bump\" of the material \"b\" and 1 more is not supported; rendered without";
    let rough = "m.mtl:13: \"Pr\" of the material \"d\" is not supported; rendered without";
    assert_eq!(warnings(&scene), [rough, bump]);
    let scene = obj(&format!("v 0 0 0 1 0 0\n{SQUARE}f 1 3 4\n"), "");
    let colors = "a.obj: colours of vertices are not supported in OBJ; rendered without";
    assert_eq!(warnings(&scene), [colors]);
}

#[test]
fn all_that_an_obj_may_say_is_understood() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.obj");
    for (file, name, color) in [("m.mtl", "red", "1 0 0"), ("n o.mtl", "deep blue", "0 0 1")] {
        let library = format!("newmtl\t{name}\r\nKd \\\r\n {color} # a comment\r\n");
        std::fs::write(folder.path().join(file), library).unwrap();
    }
    std::fs::write(folder.path().join("o.mtl"), "newmtl green\nKd 0 1 0\n").unwrap();
    let text = "# C:\\scenes\\\nmtllib\tm.mtl o.mtl\nmtllib n o.mtl\nv 0 0 \\\n0\nv 1 0 0 # here\n\
                v 2 2 0 2\nusemtl\tred\nf 1 \\\n  2 \\\n3 # and here\nusemtl deep blue\nf 1 2 3\n\
                usemtl green\nf 1 2 3\n# \u{e9}\n";
    // A comment need not be UTF-8.
    let bytes: Vec<u8> = text.chars().map(|c| c as u8).collect();
    std::fs::write(&path, bytes).unwrap();
    let scene = read(&path);
    assert_eq!(warnings(&scene), [""; 0]);
    assert_eq!(scene.mesh.bounds().max, [1.0, 1.0, 0.0]);
    let colors = [0, 1, 2].map(|shape| color(&scene, shape));
    let expected = [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]];
    assert_eq!(colors, expected);
}

#[test]
fn what_is_wrong_with_an_mtl_is_told_with_its_line() {
    let text = format!("mtllib m.mtl\n{SQUARE}usemtl a\nf 1 2 3\n");
    for (wrong, message) in [
        (
            "Kd 1 x 1",
            "line 4: Kd takes one or three numbers; \"x\" is none",
        ),
        ("Ks .1 .2", "line 4: Ks takes one or three numbers"),
        ("Ns", "line 4: Ns takes a number"),
        ("newmtl", "line 4: newmtl gives no name"),
        ("map_Kd -s 1 1 1", "line 4: map_Kd names no image"),
        (
            "map_d -s x a.png",
            "line 4: -s takes a number; \"x\" is none",
        ),
    ] {
        let scene = obj(&text, &format!("newmtl a\nd \\\n1\n{wrong}\n"));
        let told =
            format!("a.obj: the materials of \"m.mtl\" cannot be read ({message}); rendered grey");
        assert_eq!(warnings(&scene), [told]);
    }
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
