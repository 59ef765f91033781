//! Rays and pictures against pbrt-v3's, where the scenes and its pictures are found: beside the
//! workspace in `../shared`, or around the folder of scenes that `SPLITPLANE_SCENES` names.

use std::path::{Path, PathBuf};

use splitplane::{BuildParams, Tree};
use splitplane_render::output::write_png;
use splitplane_render::render::{RayKinds, RenderSettings, Rendered, render};
use splitplane_render::scene::{LoadOptions, load};

/// The folder that holds `scenes` and `reference`; `None`, with a word about it, where there is
/// none.
fn shared() -> Option<PathBuf> {
    let named =
        std::env::var_os("SPLITPLANE_SCENES").map(|scenes| PathBuf::from(scenes).join(".."));
    let beside = Path::new(env!("CARGO_MANIFEST_DIR"))
        .ancestors()
        .map(|a| a.join("shared"));
    let found = named.into_iter().chain(beside).find(|folder| {
        folder.join("scenes/killeroo").is_dir() && folder.join("reference").is_dir()
    });
    if found.is_none() {
        eprintln!("skipped: the scenes are not here; SPLITPLANE_SCENES=FOLDER names their folder");
    }
    found
}

fn picture(shared: &Path, scene: &str, edge: u32, samples: u32) -> Rendered {
    let path = shared.join("scenes").join(scene);
    let scene = load(&path.to_string_lossy(), &LoadOptions::default()).unwrap();
    let tree = Tree::build(&scene.mesh, "kd".parse().unwrap(), &BuildParams::default()).unwrap();
    let settings = RenderSettings {
        resolution: Some((edge, edge)),
        samples_per_pixel: Some(samples),
        count: false,
        ..Default::default()
    };
    render(&scene, &tree, &settings, &()).unwrap()
}

/// Red, green and blue of pbrt's picture, and its width.
fn reference(shared: &Path, name: &str) -> (Vec<[f32; 3]>, usize) {
    use exr::prelude::*;
    let path = shared.join("reference/pictures").join(name);
    let image = read_first_rgba_layer_from_file(
        path,
        |size, _| (vec![[0.0; 3]; size.area()], size.width()),
        |(pixels, width): &mut (Vec<[f32; 3]>, usize), at, (r, g, b, _): (f32, f32, f32, f32)| {
            pixels[at.y() * *width + at.x()] = [r, g, b];
        },
    );
    image.unwrap().layer_data.channel_data.pixels
}

/// Means of both pictures, and the root of the mean square of their difference over the mean,
/// after averaging blocks of 4 x 4 pixels.
fn compare(ours: &Rendered, (theirs, width): &(Vec<[f32; 3]>, usize)) -> (f64, f64, f64) {
    assert_eq!(
        (ours.width as usize, ours.radiance.len()),
        (*width, theirs.len())
    );
    let mean = |pixels: &[[f32; 3]]| {
        pixels.iter().flatten().map(|&c| f64::from(c)).sum::<f64>() / (3.0 * pixels.len() as f64)
    };
    let (a, b) = (mean(&ours.radiance), mean(theirs));
    let height = theirs.len() / width;
    let (mut squares, mut blocks) = (0.0, 0.0);
    for y in (0..height - 3).step_by(4) {
        for x in (0..width - 3).step_by(4) {
            let difference: f64 = (0..16)
                .map(|i| (y + i / 4) * width + x + i % 4)
                .map(|i| f64::from(ours.radiance[i][1]) - f64::from(theirs[i][1]))
                .sum();
            squares += (difference / 16.0).powi(2);
            blocks += 1.0;
        }
    }
    (a, b, (squares / blocks).sqrt() / b)
}

#[test]
fn killeroo_legs_casts_as_many_rays_as_pbrt() {
    let Some(shared) = shared() else { return };
    let picture = picture(&shared, "killeroo/killeroo-legs.pbrt", 1000, 8);
    let RayKinds {
        camera,
        bounce,
        shadow,
    } = picture.rays;
    eprintln!(
        "{camera} camera, {bounce} bounce, {shadow} shadow rays; {} s",
        picture.seconds
    );
    assert_eq!(camera, 640_000);
    let near = |ours: u64, theirs: f64| (ours as f64 / theirs - 1.0).abs() < 0.003;
    assert!(near(bounce, 221_562.0), "{bounce} bounce rays");
    assert!(near(shadow, 234_469.0), "{shadow} shadow rays");
}

fn looks_like_pbrts(scene: &str, edge: u32, samples: u32, rms: f64, name: &str) {
    let Some(shared) = shared() else { return };
    let ours = picture(&shared, scene, edge, samples);
    let theirs = reference(&shared, name);
    if let Some(folder) = std::env::var_os("SPLITPLANE_TEST_PICTURES") {
        let folder = PathBuf::from(folder);
        write_png(&folder.join(name).with_extension("ours.png"), &ours).unwrap();
        let pbrts = Rendered {
            radiance: theirs.0.clone(),
            ..ours.clone()
        };
        write_png(&folder.join(name).with_extension("pbrt.png"), &pbrts).unwrap();
    }
    let (a, b, difference) = compare(&ours, &theirs);
    eprintln!(
        "mean {a}, pbrt's {b}; rms difference of 4 x 4 blocks {difference}; {:?} rays; {} s",
        ours.rays, ours.seconds
    );
    assert!((a / b - 1.0).abs() < 0.01, "mean {a}, pbrt's {b}");
    assert!(difference < rms, "rms difference {difference}");
}

#[test]
fn killeroo_legs_looks_like_pbrts() {
    let scene = "killeroo/killeroo-legs.pbrt";
    looks_like_pbrts(scene, 1000, 64, 0.001, "killeroo-legs-1000-64spp.exr");
}

/// With a quarter of pbrt's samples, for the time's sake: most of the difference is noise.
#[test]
fn sponza_looks_like_pbrts() {
    looks_like_pbrts("sponza/sponza.pbrt", 256, 16, 0.1, "sponza-256-64spp.exr");
}

#[test]
#[ignore = "takes a minute"]
fn sponza_looks_like_pbrts_to_the_last_sample() {
    looks_like_pbrts("sponza/sponza.pbrt", 256, 64, 0.003, "sponza-256-64spp.exr");
}
