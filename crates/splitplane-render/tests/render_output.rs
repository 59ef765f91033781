//! Pictures as files, read back.

mod render_common;

use std::path::Path;

use exr::prelude::{FlatSamples, read_all_flat_layers_from_file};
use render_common::{Part, matte, rendered, scene};
use splitplane_render::output::{OutputError, write_exr, write_false_colour, write_png};
use splitplane_render::render::{RenderSettings, Rendered};
use splitplane_render::scene::light::Light;

fn picture() -> Rendered {
    let floor = Part::square(1.0, 2.0, matte(0.5));
    let light = Light::Point {
        position: [0.5, 0.0, 0.0],
        intensity: [9.0, 5.0, 1.0],
    };
    rendered(
        &scene(vec![floor], vec![light], 60.0),
        &RenderSettings::default(),
    )
}

fn channel(path: &Path, name: &str) -> FlatSamples {
    let image = read_all_flat_layers_from_file(path).unwrap();
    let mut channels = image
        .layer_data
        .iter()
        .flat_map(|layer| &layer.channel_data.list);
    channels
        .find(|c| c.name.eq(name))
        .unwrap()
        .sample_data
        .clone()
}

#[test]
fn an_exr_file_gives_back_every_value_exactly() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("new/folder/picture.exr");
    let picture = picture();
    write_exr(&path, &picture).unwrap();
    write_exr(&path, &picture).unwrap();
    for (axis, name) in ["R", "G", "B"].into_iter().enumerate() {
        let FlatSamples::F32(values) = channel(&path, name) else {
            panic!("not f32")
        };
        assert!(values.iter().eq(picture.radiance.iter().map(|p| &p[axis])));
    }
    let FlatSamples::F32(depth) = channel(&path, "depth.Z") else {
        panic!("not f32")
    };
    assert_eq!(depth, picture.depth);
    let FlatSamples::F32(normal) = channel(&path, "normal.Z") else {
        panic!("not f32")
    };
    assert!(normal.iter().eq(picture.normal.iter().map(|n| &n[2])));
    let counters = picture.pixel_counts.unwrap();
    let FlatSamples::U32(tests) = channel(&path, "counters.triangle_tests.closest") else {
        panic!("not u32")
    };
    assert!(
        tests
            .iter()
            .eq(counters.closest.iter().map(|c| &c.triangle_tests))
    );
    let FlatSamples::U32(leaves) = channel(&path, "counters.leaf_visits.shadow") else {
        panic!("not u32")
    };
    assert!(
        leaves
            .iter()
            .eq(counters.shadow.iter().map(|c| &c.leaf_visits))
    );
    assert_eq!(
        std::fs::read_dir(path.parent().unwrap()).unwrap().count(),
        1
    );
}

#[test]
fn a_png_file_holds_the_picture_in_srgb() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("picture.png");
    let mut picture = picture();
    picture.radiance[0] = [0.0, 0.215_861, 50.0];
    write_png(&path, &picture).unwrap();
    let read = image::open(&path).unwrap().to_rgb8();
    assert_eq!(read.dimensions(), (8, 8));
    assert_eq!(read.get_pixel(0, 0).0, [0, 128, 255]);
}

#[test]
fn false_colours_run_from_zero_to_the_given_or_largest_value() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("colours.png");
    let mut values: Vec<f32> = (0..400 * 100).map(|i| (i % 400) as f32).collect();
    values[0] = f32::INFINITY;
    let write = |max, label| write_false_colour(&path, &values, (400, 100), max, label).unwrap();
    assert_eq!(write(None, "triangle tests, closest (kd)"), 399.0);
    let read = image::open(&path).unwrap().to_rgb8();
    assert_eq!(read.width(), 400);
    let brightness = |x: u32| {
        read.get_pixel(x, 50)
            .0
            .iter()
            .map(|&c| u32::from(c))
            .sum::<u32>()
    };
    assert!(brightness(0) < brightness(200) && brightness(200) < brightness(399));
    assert_eq!(read.get_pixel(0, 0).0, [96; 3]);
    assert_eq!(write(Some(100.0), "leaf visits"), 100.0);
    let read = image::open(&path).unwrap().to_rgb8();
    assert_eq!(read.get_pixel(101, 50), read.get_pixel(399, 50));
}

#[test]
fn tiny_and_constant_pictures_get_a_bar_too() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("colours.png");
    let end = write_false_colour(&path, &[0.0], (1, 1), None, "nothing at all").unwrap();
    assert_eq!(end, 0.0);
    assert!(image::open(&path).unwrap().width() > 100);
}

#[test]
fn values_that_do_not_fit_and_folders_that_cannot_be_are_errors() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("colours.png");
    let error = write_false_colour(&path, &[0.0; 5], (2, 3), None, "x").unwrap_err();
    assert!(matches!(error, OutputError::Size { given: 5, .. }));
    write_png(&path, &picture()).unwrap();
    let below = path.join("picture.png");
    let message = write_png(&below, &picture()).unwrap_err().to_string();
    assert!(message.contains("colours.png"), "{message}");
}
