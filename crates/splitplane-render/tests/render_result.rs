//! What a rendering promises besides its radiance: the same for any number of threads, counters
//! that add up, settings that are obeyed, errors instead of panics.

mod render_common;

use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

use render_common::{Part, grey, matte, mean, rendered, scene, tree_of};
use splitplane::{Counts, Mesh, Tree};
use splitplane_render::render::{
    Checkpoint, Partial, PixelCounts, Progress, RenderError, RenderSettings, Rendered, render,
    render_from,
};
use splitplane_render::scene::Scene;
use splitplane_render::scene::light::Light;
use splitplane_render::scene::material::Material;
use splitplane_render::scene::settings::{Filter, SamplerKind};

/// A bit of everything: a room with a lamp, a point light, plastic and glass.
fn room() -> Scene {
    let plastic = Material::Plastic {
        kd: grey(0.3),
        ks: grey(0.4),
        roughness: grey(0.1),
        remap_roughness: true,
    };
    let glass = Material::Glass {
        kr: grey(0.9),
        kt: grey(0.9),
        eta: grey(1.5),
        roughness: [grey(0.0), grey(0.0)],
        remap_roughness: true,
    };
    let mut scene = scene(
        vec![
            Part::cube(3.0, 0.0, matte(0.6)),
            Part::square(1.0, -2.9, matte(0.1)).shining(5.0, false),
            Part::cube(0.4, 2.0, plastic),
            Part::square(0.3, 1.0, glass),
        ],
        vec![Light::Point {
            position: [2.0, 2.0, 0.0],
            intensity: [3.0, 2.0, 1.0],
        }],
        70.0,
    );
    (scene.film.width, scene.film.height) = (70, 41);
    scene.sampler.samples_per_pixel = 3;
    scene
}

fn without_time(mut picture: Rendered) -> Rendered {
    picture.seconds = 0.0;
    picture
}

#[test]
fn pictures_and_counters_are_the_same_with_any_number_of_threads() {
    let mut scene = room();
    for filter in [
        Filter::Box { radius: [0.5, 0.5] },
        Filter::Mitchell {
            radius: [2.0, 2.0],
            b: 1.0 / 3.0,
            c: 1.0 / 3.0,
        },
    ] {
        scene.filter = filter;
        for kind in [
            SamplerKind::Random,
            SamplerKind::Halton {
                sample_at_center: false,
            },
        ] {
            scene.sampler.kind = kind;
            let with = |threads| {
                let settings = RenderSettings {
                    threads,
                    ..Default::default()
                };
                without_time(rendered(&scene, &settings))
            };
            let one = with(1);
            assert_eq!(one, with(2));
            assert_eq!(one, with(5));
            assert_eq!(one.rays.camera % 3, 0);
        }
    }
}

#[test]
fn not_counting_changes_the_counters_only() {
    let scene = room();
    let counted = without_time(rendered(&scene, &RenderSettings::default()));
    let settings = RenderSettings {
        count: false,
        ..Default::default()
    };
    let mut plain = without_time(rendered(&scene, &settings));
    assert_eq!(plain.pixel_counts, None);
    assert_eq!(plain.counts.camera, Counts::default());
    assert!(counted.counts.camera.triangle_tests > 0);
    plain.counts = counted.counts;
    plain.tests_by_leaf_size = counted.tests_by_leaf_size.clone();
    plain.pixel_counts = counted.pixel_counts.clone();
    assert_eq!(plain, counted);
}

#[test]
fn counters_of_pixels_add_up_to_those_of_rays() {
    let picture = rendered(&room(), &RenderSettings::default());
    let counters = picture.pixel_counts.unwrap();
    let sum = |counts: &[PixelCounts]| {
        counts.iter().fold(Counts::default(), |sum, c| Counts {
            triangle_tests: sum.triangle_tests + u64::from(c.triangle_tests),
            kd_visits: sum.kd_visits + u64::from(c.kd_visits),
            oblique_visits: sum.oblique_visits + u64::from(c.oblique_visits),
            leaf_visits: sum.leaf_visits + u64::from(c.leaf_visits),
            ..sum
        })
    };
    let mut closest = picture.counts.camera;
    closest += picture.counts.bounce;
    assert_eq!(sum(&counters.closest), closest);
    assert_eq!(sum(&counters.shadow), picture.counts.shadow);
    let sizes = &picture.tests_by_leaf_size;
    for (sizes, counts) in [
        (&sizes.camera, &picture.counts.camera),
        (&sizes.bounce, &picture.counts.bounce),
        (&sizes.shadow, &picture.counts.shadow),
    ] {
        assert_eq!(sizes.0.iter().sum::<u64>(), counts.triangle_tests);
        assert_eq!(
            sizes.0.first(),
            Some(&0),
            "no test in a leaf without triangles"
        );
    }
    assert_eq!(picture.rays.camera, 70 * 41 * 3);
    assert!(picture.rays.bounce > 0 && picture.rays.shadow > 0);
}

#[test]
fn seeds_change_the_noise_and_not_the_mean() {
    for kind in [
        SamplerKind::Random,
        SamplerKind::Halton {
            sample_at_center: false,
        },
        SamplerKind::Sobol,
        SamplerKind::ZeroTwo { dimensions: 4 },
        SamplerKind::Stratified {
            columns: 6,
            jitter: true,
            dimensions: 4,
        },
    ] {
        let mut scene = room();
        scene.sampler.kind = kind;
        let with = |seed| {
            let settings = RenderSettings {
                seed,
                samples_per_pixel: Some(24),
                ..Default::default()
            };
            without_time(rendered(&scene, &settings))
        };
        let (a, b) = (with(0), with(1));
        assert_ne!(a.radiance, b.radiance);
        assert_eq!(b, with(1));
        assert!(
            (mean(&a) / mean(&b) - 1.0).abs() < 0.03,
            "{} {}",
            mean(&a),
            mean(&b)
        );
    }
}

#[test]
fn a_crop_is_a_part_of_the_whole() {
    let mut scene = room();
    scene.sampler.kind = SamplerKind::Random;
    let whole = rendered(
        &scene,
        &RenderSettings {
            seed: 1,
            ..Default::default()
        },
    );
    let crop = Some([0.31, 0.77, 0.2, 0.95]);
    let part = rendered(
        &scene,
        &RenderSettings {
            crop,
            seed: 1,
            ..Default::default()
        },
    );
    assert_eq!(
        (part.origin, part.width, part.height),
        ((22, 9), 54 - 22, 39 - 9)
    );
    for y in 0..part.height {
        for x in 0..part.width {
            let here = (y * part.width + x) as usize;
            let there = ((y + 9) * 70 + x + 22) as usize;
            assert_eq!(part.radiance[here], whole.radiance[there]);
            assert_eq!(part.depth[here], whole.depth[there]);
            let counts = |p: &Rendered, i: usize| p.pixel_counts.as_ref().unwrap().closest[i];
            assert_eq!(counts(&part, here), counts(&whole, there));
        }
    }
}

#[test]
fn settings_take_the_place_of_the_scenes() {
    let settings = RenderSettings {
        resolution: Some((20, 10)),
        samples_per_pixel: Some(7),
        max_depth: Some(0),
        ..Default::default()
    };
    let picture = rendered(&room(), &settings);
    assert_eq!((picture.width, picture.height), (20, 10));
    assert_eq!(picture.samples_per_pixel, 7);
    assert_eq!(
        (
            picture.rays.camera,
            picture.rays.bounce,
            picture.rays.shadow
        ),
        (1400, 0, 0)
    );
}

#[test]
fn depth_and_normal_are_those_of_the_first_hit() {
    let mut scene = scene(vec![Part::square(0.5, 2.0, matte(0.5))], vec![], 60.0);
    scene.sampler.kind = SamplerKind::Halton {
        sample_at_center: true,
    };
    let picture = rendered(&scene, &RenderSettings::default());
    assert_eq!(
        (picture.depth[0], picture.normal[0]),
        (f32::INFINITY, [0.0; 3])
    );
    let middle = 4 * 8 + 4;
    assert!((picture.depth[middle] - 2.0).abs() < 0.05);
    assert_eq!(picture.normal[middle], [0.0, 0.0, 1.0]);
}

#[test]
fn a_scene_without_triangles_or_lights_is_black_but_for_its_sky() {
    let settings = RenderSettings::default();
    assert_eq!(
        mean(&rendered(&scene(vec![], vec![], 60.0), &settings)),
        0.0
    );
    let sky = Light::sky([2.0; 3]);
    assert_eq!(
        mean(&rendered(&scene(vec![], vec![sky], 60.0), &settings)),
        2.0
    );
    let dark = scene(vec![Part::square(9.0, 1.0, matte(0.5))], vec![], 60.0);
    assert_eq!(mean(&rendered(&dark, &settings)), 0.0);
}

struct StopAfter {
    rays: u64,
    seen: AtomicU64,
}

impl Progress for StopAfter {}

impl splitplane::Progress for StopAfter {
    fn advanced(&self, done: u64, total: u64) {
        assert!(done <= total && total == 70 * 41 * 3);
        self.seen.fetch_max(done, Ordering::Relaxed);
    }
    fn cancelled(&self) -> bool {
        self.seen.load(Ordering::Relaxed) >= self.rays
    }
}

#[test]
fn progress_reaches_the_end_or_stops_the_rendering() {
    let scene = room();
    let watch = |rays| {
        let progress = StopAfter {
            rays,
            seen: AtomicU64::new(0),
        };
        let result = render(
            &scene,
            &tree_of(&scene),
            &RenderSettings::default(),
            &progress,
        );
        (result.err(), progress.seen.into_inner())
    };
    assert_eq!(watch(u64::MAX), (None, 70 * 41 * 3));
    let (error, seen) = watch(1000);
    assert_eq!(error, Some(RenderError::Cancelled));
    assert!(seen < 70 * 41 * 3);
}

#[test]
fn what_cannot_be_rendered_is_refused_with_a_reason() {
    let refused = |change: &dyn Fn(&mut Scene, &mut RenderSettings)| {
        let (mut scene, mut settings) = (room(), RenderSettings::default());
        let tree = tree_of(&scene);
        change(&mut scene, &mut settings);
        render(&scene, &tree, &settings, &())
            .unwrap_err()
            .to_string()
    };
    let message = refused(&|_, settings| settings.samples_per_pixel = Some(0));
    assert!(message.contains("samples per pixel is 0"), "{message}");
    let message = refused(&|_, settings| settings.resolution = Some((0, 3)));
    assert!(message.contains("0 x 3"), "{message}");
    let message = refused(&|_, settings| settings.crop = Some([0.5, 0.4, 0.0, 1.0]));
    assert!(message.contains("x_min < x_max"), "{message}");
    // The reader's limit is that of rendering.
    let wide = |scene: &mut Scene, x: f32| scene.filter = Filter::Box { radius: [x, 1.0] };
    let message = refused(&|scene, _| wide(scene, Filter::MAX_RADIUS.next_up()));
    assert!(message.contains("at most 64 pixels"), "{message}");
    let mut widest = room();
    wide(&mut widest, Filter::MAX_RADIUS);
    assert!(render(&widest, &tree_of(&widest), &RenderSettings::default(), &()).is_ok());
    let message = refused(&|scene, _| scene.shapes[1].material = 99);
    assert!(message.contains("material 99"), "{message}");
    let message = refused(&|scene, _| scene.shapes[2].has_normals = true);
    assert!(message.contains("normals"), "{message}");
    let message = refused(&|scene, _| scene.shapes[1].triangles.end += 1);
    assert!(message.contains("shape 2 begins"), "{message}");
    let message = refused(&|scene, _| scene.shapes.truncate(3));
    assert!(message.contains("the mesh has"), "{message}");
    let message = refused(&|scene, _| scene.mesh = Mesh::new(vec![], vec![]).unwrap());
    assert!(
        message.contains("another mesh") || message.contains("triangles"),
        "{message}"
    );
}

/// Stops after the first partial picture, and keeps it.
#[derive(Default)]
struct Interrupting {
    kept: Mutex<Option<Checkpoint>>,
}

impl splitplane::Progress for Interrupting {
    fn cancelled(&self) -> bool {
        self.kept.lock().unwrap().is_some()
    }
}

impl Progress for Interrupting {
    fn wants_partial(&self) -> bool {
        self.kept.lock().unwrap().is_none()
    }
    fn partial(&self, partial: &Partial) {
        assert!(partial.picture.radiance.iter().any(|p| p[1] > 0.0));
        *self.kept.lock().unwrap() = Some(partial.checkpoint.clone());
    }
}

/// Renders until there is a partial picture, and gives what it takes to go on.
fn interrupted(scene: &Scene, tree: &Tree, settings: &RenderSettings) -> Checkpoint {
    let interrupting = Interrupting::default();
    let stopped = render(scene, tree, settings, &interrupting);
    assert_eq!(stopped, Err(RenderError::Cancelled));
    let kept = interrupting.kept.into_inner().unwrap();
    kept.expect("there was a partial picture")
}

#[test]
fn an_interrupted_rendering_goes_on_to_the_same_picture() {
    let mut scene = room();
    scene.filter = Filter::Triangle { radius: [2.0; 2] };
    let tree = tree_of(&scene);
    // Large enough for more than one batch of tiles.
    let settings = RenderSettings {
        resolution: Some((300, 200)),
        samples_per_pixel: Some(1),
        threads: 1,
        ..Default::default()
    };
    let whole = render(&scene, &tree, &settings, &()).unwrap();
    let kept = interrupted(&scene, &tree, &settings);
    let bytes = kept.to_bytes();
    let again = Checkpoint::from_bytes(&bytes).unwrap();
    assert_eq!(again, kept);
    assert!(Checkpoint::from_bytes(&bytes[..bytes.len() - 1]).is_none());
    let other = RenderSettings {
        seed: 5,
        ..settings.clone()
    };
    assert_eq!(
        render_from(&scene, &tree, &other, Some(again.clone()), &()),
        Err(RenderError::OtherCheckpoint)
    );
    let resumed = render_from(&scene, &tree, &settings, Some(again), &()).unwrap();
    assert_eq!(without_time(resumed), without_time(whole));
}

/// Counts how often it is asked whether to go on, and what was done when the picture was first
/// offered.
#[derive(Default)]
struct Asked {
    times: AtomicU64,
    done: AtomicU64,
    first_offered: AtomicU64,
}

impl splitplane::Progress for Asked {
    fn advanced(&self, done: u64, _: u64) {
        self.done.store(done, Ordering::Relaxed);
    }
    fn cancelled(&self) -> bool {
        self.times.fetch_add(1, Ordering::Relaxed);
        false
    }
}

impl Progress for Asked {
    fn wants_partial(&self) -> bool {
        let done = self.done.load(Ordering::Relaxed);
        self.first_offered.fetch_min(done, Ordering::Relaxed);
        false
    }
}

#[test]
fn with_many_samples_a_rendering_can_be_stopped_within_a_pixel_and_is_kept_after_each_tile() {
    let scene = room();
    let tree = tree_of(&scene);
    let asked = |samples| {
        let settings = RenderSettings {
            samples_per_pixel: Some(samples),
            resolution: Some((20, 12)),
            threads: 1,
            ..Default::default()
        };
        let asked = Asked {
            first_offered: AtomicU64::new(u64::MAX),
            ..Asked::default()
        };
        render(&scene, &tree, &settings, &asked).unwrap();
        (asked.times.into_inner(), asked.first_offered.into_inner())
    };
    let (few, many) = (asked(64), asked(200));
    assert_eq!(many.0, 4 * few.0);
    assert!(many.1 <= 200 * 16 * 16, "{}", many.1);
}

#[test]
fn what_was_begun_with_a_limit_of_time_gets_all_its_samples_without() {
    let mut scene = room();
    scene.sampler.samples_per_pixel = 3;
    let tree = tree_of(&scene);
    let limited = RenderSettings {
        resolution: Some((300, 200)),
        time: Some(0.0),
        threads: 1,
        ..Default::default()
    };
    let kept = interrupted(&scene, &tree, &limited);
    let settings = RenderSettings {
        time: None,
        ..limited
    };
    let resumed = render_from(&scene, &tree, &settings, Some(kept), &()).unwrap();
    assert_eq!(resumed.samples_per_pixel, 3);
    assert_eq!(resumed.rays.camera, 300 * 200 * 3);
}

/// Stops once so many camera rays were cast, and keeps the picture.
struct Enough {
    camera_rays: u64,
    picture: Mutex<Option<Rendered>>,
}

impl splitplane::Progress for Enough {
    fn cancelled(&self) -> bool {
        self.picture.lock().unwrap().is_some()
    }
}

impl Progress for Enough {
    fn wants_partial(&self) -> bool {
        true
    }
    fn partial(&self, partial: &Partial) {
        if partial.picture.rays.camera >= self.camera_rays {
            *self.picture.lock().unwrap() = Some(partial.picture.clone());
        }
    }
}

#[test]
fn with_a_limit_of_time_samples_are_added_until_it_is_over() {
    let scene = room();
    let tree = tree_of(&scene);
    let settings = |time| RenderSettings {
        samples_per_pixel: Some(2),
        time,
        ..Default::default()
    };
    let short = render(&scene, &tree, &settings(None), &()).unwrap();
    assert_eq!(short.samples_per_pixel, 2);
    // A limit that is over at once: the samples that were asked for, and no more; one if none were.
    let over = render(&scene, &tree, &settings(Some(0.0)), &()).unwrap();
    assert_eq!(without_time(over), without_time(short.clone()));
    let unasked = RenderSettings {
        samples_per_pixel: None,
        ..settings(Some(0.0))
    };
    let one = render(&scene, &tree, &unasked, &()).unwrap();
    assert_eq!(one.samples_per_pixel, 1);
    // One that is never over: more and more, until it is stopped.
    let enough = Enough {
        camera_rays: 70 * 41 * 32,
        picture: Mutex::default(),
    };
    let stopped = render(&scene, &tree, &settings(Some(1e9)), &enough);
    assert_eq!(stopped, Err(RenderError::Cancelled));
    let long = enough.picture.into_inner().unwrap().unwrap();
    // Each pass doubles the samples.
    assert_eq!(long.samples_per_pixel, 32);
    assert_eq!(long.rays.camera, 70 * 41 * 32);
    assert!((mean(&long) / mean(&short) - 1.0).abs() < 0.1);
}
