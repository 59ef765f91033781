//! Scenes in pbrt's words whose radiance is known.

use std::sync::Arc;

use splitplane::{BuildParams, Layout, Tree};
use splitplane_render::render::{RenderError, RenderSettings, Rendered, place, render};
use splitplane_render::scene::{Instancing, LoadOptions, Scene, load};

/// A scene of 8 x 8 pixels that looks from the origin along +z, nearly at a single point.
fn scene(integrator: &str, world: &str) -> Scene {
    whole(&format!(
        "Film \"image\" \"integer xresolution\" 8 \"integer yresolution\" 8\n\
         Camera \"perspective\" \"float fov\" 0.2\n\
         Integrator \"{integrator}\" \"integer maxdepth\" 4\n\
         WorldBegin\n{world}\nWorldEnd\n"
    ))
}

fn whole(text: &str) -> Scene {
    with(text, &LoadOptions::default())
}

fn with(text: &str, options: &LoadOptions) -> Scene {
    let folder = tempfile::tempdir().unwrap();
    let white = image::RgbImage::from_pixel(8, 4, image::Rgb([255; 3]));
    white.save(folder.path().join("white.png")).unwrap();
    // All directions of a light with -z in the corners, z in the middle: red where x > 0, green
    // where y > 0, blue where z > 0.
    let square = image::RgbImage::from_fn(32, 32, |column, row| {
        let (x, y) = (f64::from(column) - 15.5, f64::from(row) - 15.5);
        let lit = |yes: bool| if yes { 255 } else { 0 };
        image::Rgb([lit(x > 0.0), lit(y > 0.0), lit(x.abs() + y.abs() < 16.0)])
    });
    square.save(folder.path().join("square.png")).unwrap();
    let path = folder.path().join("test.pbrt");
    std::fs::write(&path, text).unwrap();
    load(&path.to_string_lossy(), options).unwrap()
}

fn picture(scene: &Scene, samples: u32) -> Rendered {
    let tree = Tree::build(&scene.mesh, "kd".parse().unwrap(), &BuildParams::default()).unwrap();
    let settings = RenderSettings {
        samples_per_pixel: Some(samples),
        ..Default::default()
    };
    render(scene, &tree, &settings, &()).unwrap()
}

fn mean(scene: &Scene, samples: u32) -> f64 {
    let picture = picture(scene, samples);
    let sum: f64 = picture.radiance.iter().map(|p| f64::from(p[1])).sum();
    sum / picture.radiance.len() as f64
}

const INTEGRATORS: [&str; 3] = ["path", "directlighting", "whitted"];

/// A wall of reflectance one half across the view, two units away.
const WALL: &str = "Material \"matte\" \"rgb Kd\" [.5 .5 .5]\n\
    Shape \"trianglemesh\" \"integer indices\" [0 2 1 0 3 2] \
    \"point P\" [-50 -50 2 50 -50 2 50 50 2 -50 50 2]\n";

#[track_caller]
fn expect(world: &str, expected: f64) {
    for integrator in INTEGRATORS {
        let value = mean(&scene(integrator, world), 64);
        assert!(
            (value / expected - 1.0).abs() < 0.015,
            "{integrator}: {value}, expected {expected}"
        );
    }
}

#[test]
fn a_sphere_shines_as_its_form_factor_says() {
    // (radius / distance)² over the wall.
    let light = "AttributeBegin\nTranslate 0 0 -3\nScale 2 2 2\n\
        AreaLightSource \"diffuse\" \"rgb L\" [10 10 10]\nShape \"sphere\" \"float radius\" .5\n\
        AttributeEnd\n";
    expect(&format!("{WALL}{light}"), 0.5 * 10.0 / 25.0);
    assert_eq!(scene("path", light).shapes.len(), 1);
}

#[test]
fn a_disk_shines_as_its_form_factor_says() {
    // radius² / (radius² + distance²); a disk shines along +z.
    let light = "AttributeBegin\nTranslate 0 0 -3\nAreaLightSource \"diffuse\" \"rgb L\" [10 10 10]\n\
        Shape \"disk\" \"float radius\" 2\nAttributeEnd\n";
    expect(&format!("{WALL}{light}"), 0.5 * 10.0 * 4.0 / 29.0);
}

#[test]
fn from_within_a_sphere_all_its_light_arrives() {
    let light = "AttributeBegin\nReverseOrientation\nMaterial \"matte\" \"rgb Kd\" [0 0 0]\n\
        AreaLightSource \"diffuse\" \"rgb L\" [3 3 3]\nShape \"sphere\" \"float radius\" 500\n\
        AttributeEnd\n";
    expect(&format!("{WALL}{light}"), 1.5);
}

#[test]
fn lights_at_a_point_fall_off_with_the_square_of_the_distance() {
    let expected = 0.5 / std::f64::consts::PI * 8.0 / 4.0;
    for light in [
        "\"point\" \"rgb I\" [8 8 8]",
        "\"goniometric\" \"rgb I\" [8 8 8]",
        "\"goniometric\" \"rgb I\" [8 8 8] \"string mapname\" \"white.png\"",
        "\"projection\" \"rgb I\" [8 8 8]",
        "\"projection\" \"rgb I\" [8 8 8] \"string mapname\" \"white.png\"",
        "\"spot\" \"rgb I\" [8 8 8]",
    ] {
        expect(&format!("{WALL}LightSource {light}\n"), expected);
    }
}

#[test]
fn a_spot_falls_off_by_the_fourth_power_between_its_cones() {
    // 25 degrees off the axis, half way between the cosines of 20 and about 29.25 degrees.
    let inner = 20f64.to_radians().cos();
    let here = 25f64.to_radians().cos();
    let outer = here - (inner - here);
    let cone = outer.acos().to_degrees();
    let light = format!(
        "Rotate 25 0 1 0\nLightSource \"spot\" \"rgb I\" [8 8 8] \"float coneangle\" {cone} \
         \"float conedelta\" {}\n",
        cone - 20.0
    );
    let expected = 0.5 / std::f64::consts::PI * 8.0 / 4.0 / 16.0;
    expect(&format!("{WALL}{light}"), expected);
}

#[test]
fn a_sky_with_a_white_map_is_the_sky_without() {
    for map in [
        "",
        "\"string mapname\" \"white.png\"",
        "\"string mapname\" \"gone.png\"",
    ] {
        let sky = format!("Rotate 40 1 2 3\nLightSource \"infinite\" \"rgb L\" [4 4 4] {map}\n");
        expect(&format!("{WALL}{sky}"), 2.0);
    }
}

#[test]
fn materials_reflect_what_their_parts_add_up_to() {
    let wall = WALL.lines().nth(1).unwrap();
    for (material, expected) in [
        ("\"matte\" \"rgb Kd\" [.8 .8 .8]", 0.8),
        (
            "\"translucent\" \"rgb Kd\" [1 1 1] \"rgb Ks\" [0 0 0] \"rgb reflect\" [.3 .3 .3] \
             \"rgb transmit\" [.4 .4 .4]",
            0.7,
        ),
        (
            "\"mix\" \"string namedmaterial1\" \"a\" \"string namedmaterial2\" \"b\" \
          \"rgb amount\" [.25 .25 .25]",
            0.25 * 0.2 + 0.75 * 0.8,
        ),
        // Nothing is bumped where the height is the same everywhere.
        ("\"matte\" \"rgb Kd\" [.8 .8 .8] \"float bumpmap\" 3", 0.8),
        // Squares much smaller than the wall that is seen.
        ("\"matte\" \"texture Kd\" \"small\"", 0.5),
    ] {
        let world = format!(
            "LightSource \"infinite\" \"rgb L\" [1 1 1]\n\
             Texture \"small\" \"color\" \"checkerboard\" \"float uscale\" 1e6 \"float vscale\" 1e6\n\
             MakeNamedMaterial \"a\" \"string type\" \"matte\" \"rgb Kd\" [.2 .2 .2]\n\
             MakeNamedMaterial \"b\" \"string type\" \"matte\" \"rgb Kd\" [.8 .8 .8]\n\
             Material {material}\n{wall}\n"
        );
        expect(&world, expected);
    }
}

#[test]
fn a_metal_mirrors_what_its_formula_says_at_normal_incidence() {
    let wall = WALL.lines().nth(1).unwrap();
    let metal = "Material \"metal\" \"rgb eta\" [.2 .9 1.1] \"rgb k\" [3.9 2.4 2.1] \
        \"float roughness\" .02 \"bool remaproughness\" \"false\"\n";
    let sky = "LightSource \"infinite\" \"rgb L\" [1 1 1]\n";
    let (n, k): (f64, f64) = (0.9, 2.4);
    let expected = ((n - 1.0).powi(2) + k * k) / ((n + 1.0).powi(2) + k * k);
    let value = mean(&scene("path", &format!("{sky}{metal}{wall}\n")), 64);
    assert!((value / expected - 1.0).abs() < 0.01, "{value} {expected}");
}

#[test]
fn a_slab_of_glass_lets_through_what_its_two_sides_do() {
    // Both sides reflect r; with all echoes between them (1 - r) / (1 + r) gets through.
    let slab = "AttributeBegin\nMaterial \"glass\" \"float eta\" 1.5\n\
        Shape \"trianglemesh\" \"integer indices\" [0 2 1 0 3 2] \
        \"point P\" [-9 -9 1 9 -9 1 9 9 1 -9 9 1]\n\
        Shape \"trianglemesh\" \"integer indices\" [0 1 2 0 2 3] \
        \"point P\" [-9 -9 1.5 9 -9 1.5 9 9 1.5 -9 9 1.5]\nAttributeEnd\n";
    let lamp = "Material \"matte\" \"rgb Kd\" [0 0 0]\n\
        AreaLightSource \"diffuse\" \"rgb L\" [10 10 10]\n\
        Shape \"trianglemesh\" \"integer indices\" [0 2 1 0 3 2] \
        \"point P\" [-50 -50 2 50 -50 2 50 50 2 -50 50 2]\n";
    let r = 0.04;
    let expected = 10.0 * (1.0 - r) / (1.0 + r);
    for integrator in INTEGRATORS {
        let value = mean(&scene(integrator, &format!("{slab}{lamp}")), 256);
        assert!(
            (value / expected - 1.0).abs() < 0.01,
            "{integrator}: {value} {expected}"
        );
    }
}

#[test]
fn where_alpha_is_zero_there_is_nothing() {
    let light = "LightSource \"point\" \"rgb I\" [8 8 8]\n";
    let expected = 0.5 / std::f64::consts::PI * 8.0 / 4.0;
    let screen = |alpha: &str| {
        format!(
            "Texture \"half\" \"float\" \"checkerboard\" \"float uscale\" 2 \"float vscale\" 2\n\
             Shape \"trianglemesh\" \"integer indices\" [0 1 2 0 2 3] \
             \"point P\" [-9 -9 1 9 -9 1 9 9 1 -9 9 1] \"float uv\" [.5 .0 1 0 1 .5 .5 .5] {alpha}\n"
        )
    };
    // (0.75, 0.25) lies in an odd square, where the texture is 0.
    for alpha in ["\"float alpha\" 0", "\"texture alpha\" \"half\""] {
        expect(&format!("{WALL}{light}{}", screen(alpha)), expected);
    }
    // The wall behind is dark, the screen itself is seen.
    let whole = mean(&scene("path", &format!("{WALL}{light}{}", screen(""))), 4);
    assert!((whole / (4.0 * expected) - 1.0).abs() < 0.01, "{whole}");
    // Seen, but without a shadow: from the light's far side.
    let behind = "AttributeBegin\nTranslate 0 0 -1\nLightSource \"point\" \"rgb I\" [18 18 18]\n\
        AttributeEnd\n";
    let mut shadowless = screen("\"float shadowalpha\" 0");
    shadowless = shadowless
        .replace("9 1 ", "9 -.5 ")
        .replace("9 1]", "9 -.5]");
    // Black: it would light the wall otherwise.
    let black = "Material \"matte\" \"rgb Kd\" [0 0 0]\n";
    expect(
        &format!("{WALL}{behind}{black}{shadowless}"),
        0.5 / std::f64::consts::PI * 2.0,
    );
}

#[test]
fn both_spellings_of_a_scene_are_the_same_picture() {
    let v3 = whole(
        "Film \"image\" \"integer xresolution\" 16 \"integer yresolution\" 16\n\
         PixelFilter \"box\"\nSampler \"halton\" \"integer pixelsamples\" 4\nCamera \"perspective\"\n\
         WorldBegin\nLightSource \"infinite\" \"rgb L\" [2 2 2]\n\
         MakeNamedMaterial \"m\" \"string type\" \"matte\" \"rgb Kd\" [.2 .4 .6]\n\
         NamedMaterial \"m\"\nTranslate 0 0 4\nShape \"sphere\"\n\
         Material \"metal\" \"rgb eta\" [.2 .9 1.1] \"rgb k\" [3.9 2.4 2.1] \
         \"float roughness\" .3 \"bool remaproughness\" \"false\"\nTranslate 1 0 0\n\
         Shape \"sphere\" \"float radius\" .5\nWorldEnd\n",
    );
    let v4 = whole(
        "Option \"bool disablepixeljitter\" false\n\
         Film \"rgb\" \"integer xresolution\" 16 \"integer yresolution\" 16\n\
         PixelFilter \"box\"\nSampler \"halton\" \"integer pixelsamples\" 4\nCamera \"perspective\"\n\
         WorldBegin\nLightSource \"infinite\" \"rgb L\" [1 1 1] \"float scale\" 2\n\
         MakeNamedMaterial \"m\" \"string type\" \"diffuse\" \"rgb reflectance\" [.2 .4 .6]\n\
         NamedMaterial \"m\"\nTranslate 0 0 4\nShape \"sphere\"\n\
         Material \"conductor\" \"rgb eta\" [.2 .9 1.1] \"rgb k\" [3.9 2.4 2.1] \
         \"float roughness\" .3 \"bool remaproughness\" false\nTranslate 1 0 0\n\
         Attribute \"shape\" \"float radius\" .5\nShape \"sphere\"\n",
    );
    assert_eq!(
        (v3.contents.format.as_str(), v4.contents.format.as_str()),
        ("pbrt-v3", "pbrt-v4")
    );
    assert!(v4.notes.iter().all(|note| !note.warning), "{:?}", v4.notes);
    assert_eq!(picture(&v3, 4).radiance, picture(&v4, 4).radiance);
}

#[test]
fn square_maps_of_the_fourth_version_cover_all_directions() {
    let seen = |map: &str, [x, y, z]: [f64; 3]| {
        let scene = whole(&format!(
            "Option \"bool disablepixeljitter\" false\n\
             LookAt 0 0 0 {x} {y} {z} 0.1 0.2 0.97\nCamera \"perspective\" \"float fov\" 0.2\n\
             Film \"rgb\" \"integer xresolution\" 2 \"integer yresolution\" 2\n\
             WorldBegin\nLightSource \"infinite\" \"string filename\" \"{map}\"\n"
        ));
        let warnings = scene.notes.iter().filter(|note| note.warning).count();
        (picture(&scene, 1).radiance[0], warnings)
    };
    for signs in 0..8_u32 {
        let sign = |axis: u32| if signs >> axis & 1 == 1 { 1.0 } else { -1.0 };
        let w = [0.6 * sign(0), 0.4 * sign(1), 0.7 * sign(2)];
        let (radiance, warnings) = seen("square.png", w);
        assert_eq!(warnings, 0);
        for (axis, (c, w)) in radiance.into_iter().zip(w).enumerate() {
            let expected = if w > 0.0 { 1.0 } else { 0.0 };
            assert!(
                (c - expected).abs() < 1e-3,
                "axis {axis} of {w:?}: {radiance:?}"
            );
        }
    }
    // An older scene's map, in the new words.
    let (radiance, warnings) = seen("white.png", [0.6, 0.4, 0.7]);
    assert_eq!((radiance, warnings), ([1.0; 3], 1));
}

/// Three objects' copies: turned, mirrored, stretched, far from where they are defined, cut out by
/// alpha; beside a mesh that shines.
const COPIES: &str = "Film \"image\" \"integer xresolution\" 40 \"integer yresolution\" 30\n\
    LookAt 0 1 -9  0 0 0  0 1 0\nCamera \"perspective\" \"float fov\" 40\n\
    Sampler \"halton\" \"integer pixelsamples\" 16\nIntegrator \"path\" \"integer maxdepth\" 4\n\
    WorldBegin\nLightSource \"infinite\" \"rgb L\" [.3 .4 .5]\n\
    AttributeBegin\nAreaLightSource \"diffuse\" \"rgb L\" [9 8 7]\nReverseOrientation\n\
    Shape \"trianglemesh\" \"integer indices\" [0 1 2 0 2 3] \
    \"point P\" [-2 4 -2 2 4 -2 2 4 2 -2 4 2]\nAttributeEnd\n\
    Texture \"dots\" \"float\" \"checkerboard\" \"float uscale\" 8 \"float vscale\" 8 \
    \"float tex1\" 1 \"float tex2\" 0\n\
    ObjectBegin \"ball\"\nMaterial \"plastic\" \"rgb Kd\" [.7 .2 .1]\nShape \"sphere\"\n\
    ObjectEnd\n\
    ObjectBegin \"far\"\nTranslate 500 0 0\nMaterial \"matte\" \"rgb Kd\" [.1 .6 .2]\n\
    Shape \"cylinder\" \"texture alpha\" \"dots\"\n\
    Shape \"trianglemesh\" \"integer indices\" [0 1 2] \"point P\" [0 0 0 1 0 0 0 1.5 .3]\n\
    ObjectEnd\n\
    ObjectBegin \"unused\"\nShape \"sphere\"\nObjectEnd\n\
    Material \"matte\"\nShape \"trianglemesh\" \"integer indices\" [0 2 1 0 3 2] \
    \"point P\" [-9 -1.5 -9 9 -1.5 -9 9 -1.5 9 -9 -1.5 9]\n\
    AttributeBegin\nTranslate -2 0 0\nScale 1 -.6 1\nObjectInstance \"ball\"\nAttributeEnd\n\
    AttributeBegin\nTranslate 2 0 1\nRotate 30 1 1 0\nScale .5 1 2\nObjectInstance \"ball\"\n\
    AttributeEnd\n\
    AttributeBegin\nRotate 70 1 0 0\nTranslate -500 0 0\nObjectInstance \"far\"\nAttributeEnd\n\
    WorldEnd\n";

#[test]
fn instances_that_are_kept_give_the_picture_of_their_copies() {
    let flat = whole(COPIES);
    let kept = with(
        COPIES,
        &LoadOptions {
            instances: Instancing::Kept,
            ..Default::default()
        },
    );
    assert!(flat.instances.is_empty());
    assert_eq!((kept.objects.len(), kept.instances.len()), (2, 3));
    assert_eq!(kept.triangles(), flat.triangles());
    // Each was read from a file of its own.
    let kinds = |scene: &Scene| (scene.contents.kinds.clone(), scene.contents.instances);
    assert_eq!(kinds(&kept), kinds(&flat));
    assert_eq!(
        (kept.contents.files.len(), flat.contents.files.len()),
        (1, 1)
    );
    assert_eq!(
        kept.contents.unique_triangles,
        kept.meshes()
            .map(|m| m.triangles().len() as u64)
            .sum::<u64>()
    );
    for layout in Layout::ALL {
        let build = |mesh| {
            let tree = Tree::build(mesh, "wn+kd:6".parse().unwrap(), &BuildParams::default());
            Arc::new(tree.unwrap().with_layout(layout).unwrap())
        };
        let trees: Vec<_> = kept
            .objects
            .iter()
            .map(|object| build(&object.mesh))
            .collect();
        let placed = place(&kept, build(&kept.mesh), &trees).unwrap();
        let settings = RenderSettings::default();
        let two_levels = render(&kept, &placed, &settings, &()).unwrap();
        let one = render(&flat, &*build(&flat.mesh), &settings, &()).unwrap();
        // Roundings differ, and here and there the side of an edge, so single pixels may.
        let differs = |(a, b): (&[f32; 3], &[f32; 3])| {
            (0..3).any(|c| (a[c] - b[c]).abs() > 0.02 * (0.1 + b[c].abs()))
        };
        let pixels = two_levels.radiance.iter().zip(&one.radiance);
        let differing = pixels.filter(|&(a, b)| differs((a, b))).count();
        assert!(differing <= 24, "{differing} of 1200 pixels");
        let mean = |r: &Rendered| {
            r.radiance
                .iter()
                .flatten()
                .map(|&c| f64::from(c))
                .sum::<f64>()
        };
        let ratio = mean(&two_levels) / mean(&one);
        assert!((ratio - 1.0).abs() < 2e-3, "{ratio}");
        assert_eq!(two_levels.rays.camera, one.rays.camera);
        // Neither alone nor with other trees.
        let alone = render(&kept, &*build(&kept.mesh), &settings, &()).unwrap_err();
        assert!(
            matches!(alone, RenderError::OtherInstances { instances: 3 }),
            "{alone}"
        );
        let swapped: Vec<_> = trees.iter().rev().cloned().collect();
        let placed = place(&kept, build(&kept.mesh), &swapped).unwrap();
        let other = render(&kept, &placed, &settings, &()).unwrap_err();
        assert!(matches!(other, RenderError::OtherMesh { .. }), "{other}");
    }
}

#[test]
fn a_part_of_a_scene_gets_a_camera_and_a_light() {
    let part = whole("Shape \"sphere\"\n");
    let picture = picture(&part, 1);
    assert!(picture.radiance.iter().any(|p| p[1] > 0.1));
    assert!(part.notes.iter().all(|note| !note.warning));
}
