//! A comparison on a scene made by hand, from tree to record.

use std::sync::{Arc, Mutex};

use splitplane::{Mesh, TREES, TreeChoice};
use splitplane_lab::{
    Preset, Quantity, Record, Settings, Step, Task, Watch, compare, rows, write_records,
};
use splitplane_render::render::Progress;
use splitplane_render::scene::camera::{Camera, Projection};
use splitplane_render::scene::light::Light;
use splitplane_render::scene::material::Material;
use splitplane_render::scene::settings::{
    Film, Filter, Integrator, LightStrategy, Sampler, SamplerKind,
};
use splitplane_render::scene::texture::Texture;
use splitplane_render::scene::{Contents, Scene, Shape, Surface};
use splitplane_render::transform::Transform;

/// A field of hills in front of the camera, and a light beside it.
fn hills() -> Scene {
    let side = 10_u32;
    let at = |i: u32| 4.0 * i as f32 / side as f32 - 2.0;
    let mut positions = Vec::new();
    let mut triangles = Vec::new();
    for row in 0..=side {
        for column in 0..=side {
            let (x, y) = (at(column), at(row));
            positions.push([
                x,
                y,
                4.0 + 0.3 * (3.0 * x).sin() * (2.0 * y).cos() + 0.2 * x,
            ]);
        }
    }
    for row in 0..side {
        for column in 0..side {
            let a = row * (side + 1) + column;
            let (b, c, d) = (a + 1, a + side + 1, a + side + 2);
            triangles.extend([[a, b, c], [b, d, c]]);
        }
    }
    let count = triangles.len() as u32;
    let grey = |value: f32| Arc::new(Texture::Constant([value; 3]));
    Scene {
        name: "hills".into(),
        mesh: Mesh::new(positions, triangles).unwrap(),
        normals: vec![],
        uvs: vec![],
        colors: vec![],
        shapes: vec![Shape {
            triangles: 0..count,
            material: 0,
            area_light: None,
            has_normals: false,
            has_uvs: false,
            flip_normals: false,
            surface: Surface::Flat,
            alpha: None,
            shadow_alpha: None,
        }],
        objects: vec![],
        instances: vec![],
        materials: vec![Material::Matte {
            kd: grey(0.7),
            sigma: grey(0.0),
        }],
        lights: vec![Light::Point {
            position: [3.0, 2.0, 1.0],
            intensity: [20.0; 3],
        }],
        camera: Camera {
            camera_to_world: Transform::IDENTITY,
            projection: Projection::Perspective,
            fov: 50.0,
            screen_window: None,
            frame_aspect_ratio: None,
            lens_radius: 0.0,
            focal_distance: 1e6,
        },
        film: Film {
            width: 32,
            height: 24,
            crop: [0.0, 1.0, 0.0, 1.0],
            scale: 1.0,
            max_sample_luminance: f32::INFINITY,
        },
        filter: Filter::Box { radius: [0.5, 0.5] },
        sampler: Sampler {
            kind: SamplerKind::Halton {
                sample_at_center: false,
            },
            samples_per_pixel: 2,
        },
        integrator: Integrator::Path {
            max_depth: 3,
            rr_threshold: 1.0,
            light_strategy: LightStrategy::Power,
        },
        accelerator: None,
        contents: Contents::default(),
        notes: vec![],
    }
}

fn all_trees() -> Vec<TreeChoice> {
    TREES
        .iter()
        .map(|spec| TreeChoice::new(spec.name, None).unwrap())
        .collect()
}

fn settings(threads: usize) -> Settings {
    let mut settings = Settings::of_preset(Preset::Thesis);
    settings.render.threads = threads;
    settings
}

#[test]
fn all_trees_give_one_picture_and_their_counters_do_not_depend_on_the_threads() {
    let (scene, trees) = (hills(), all_trees());
    let one = compare(&scene, &trees, &settings(1), 1, &()).unwrap();
    let two = compare(&scene, &trees, &settings(2), 2, &()).unwrap();
    assert_eq!(one.differences, []);
    assert_eq!(two.differences, []);
    assert_eq!(one.records.len(), trees.len());
    assert_eq!(two.records.len(), 2 * trees.len());
    for (i, record) in two.records.iter().enumerate() {
        let of_one = &one.records[i % trees.len()];
        assert!(record.counts_like(of_one), "{}", record.tree_with_k());
        assert_eq!(record.tree_with_k(), trees[i % trees.len()].to_string());
        assert_eq!(record.repetition as usize, i / trees.len());
        assert_eq!((of_one.threads, record.threads), (1, 2));
        assert_eq!((record.width, record.height, record.spp), (32, 24, 2));
        assert_eq!(record.rays.camera, 32 * 24 * 2);
        assert!(record.rays.shadow > 0 && record.rays.bounce > 0);
        assert!(record.triangle_tests.camera > 0 && record.leaf_visits.shadow > 0);
        assert_eq!(record.max_depth, Some(3));
    }
    for (a, b) in one.trees.iter().zip(&two.trees) {
        let (tree, a, b) = (a.choice, &a.rendered, &b.rendered);
        assert_eq!(a.radiance, b.radiance, "{tree}");
        assert_eq!(a.pixel_counts, b.pixel_counts, "{tree}");
    }
}

#[test]
fn counters_per_pixel_add_up_to_the_totals() {
    let scene = hills();
    let found = compare(&scene, &all_trees(), &settings(1), 1, &()).unwrap();
    for (record, tree) in found.records.iter().zip(&found.trees) {
        let (tree, picture) = (tree.choice, &tree.rendered);
        for quantity in Quantity::ALL {
            let total = match quantity {
                Quantity::TriangleTests => record.triangle_tests.total(),
                Quantity::NodeVisits => record.kd_visits.total() + record.oblique_visits.total(),
            };
            let per_sample: f64 = (quantity.per_sample(picture).iter())
                .map(|&value| f64::from(value))
                .sum();
            assert_eq!(per_sample * f64::from(record.spp), total as f64, "{tree}");
        }
    }
}

#[test]
fn repetitions_are_interleaved_and_each_tree_is_counted_once() {
    struct Steps(Mutex<Vec<(usize, Task, u32)>>);
    impl splitplane::Progress for Steps {}
    impl Progress for Steps {}
    impl Watch for Steps {
        fn step(&self, step: Step) {
            let tree = TREES.iter().position(|spec| *spec == *step.tree.spec);
            let mut steps = self.0.lock().unwrap();
            steps.push((tree.unwrap(), step.task, step.repetition));
        }
    }
    let steps = Steps(Mutex::new(vec![]));
    let trees = &all_trees()[..2];
    compare(&hills(), trees, &settings(1), 2, &steps).unwrap();
    let expected = [
        (0, Task::Build, 0),
        (0, Task::Time, 0),
        (0, Task::Count, 0),
        (1, Task::Build, 0),
        (1, Task::Time, 0),
        (1, Task::Count, 0),
        (0, Task::Build, 1),
        (0, Task::Time, 1),
        (1, Task::Build, 1),
        (1, Task::Time, 1),
    ];
    assert_eq!(*steps.0.lock().unwrap(), expected);
}

#[test]
fn a_watcher_can_stop_a_comparison() {
    struct Stop;
    impl Progress for Stop {}
    impl splitplane::Progress for Stop {
        fn cancelled(&self) -> bool {
            true
        }
    }
    impl Watch for Stop {}
    let error = compare(&hills(), &all_trees(), &settings(1), 1, &Stop).unwrap_err();
    assert!(error.to_string().contains("cancelled"), "{error}");
}

#[test]
fn the_table_holds_medians_and_shares_of_the_first_tree() {
    let found = compare(&hills(), &all_trees()[..2], &settings(1), 1, &()).unwrap();
    let mut records = Vec::new();
    for (repetition, times) in [[1.0, 5.0], [9.0, 4.0], [2.0, 90.0]]
        .into_iter()
        .enumerate()
    {
        for (record, time) in found.records.iter().zip(times) {
            records.push(Record {
                repetition: repetition as u32,
                render_s: time,
                ..record.clone()
            });
        }
    }
    let (trees, rows) = rows(&records);
    assert_eq!(trees.len(), 2);
    let time = &rows[0];
    assert_eq!((time.label, &time.values), ("render time", &vec![2.0, 5.0]));
    assert_eq!(time.percent(0), Some(100.0));
    assert_eq!(time.percent(1), Some(250.0));
    let oblique = rows.iter().find(|row| row.label == "oblique").unwrap();
    assert_eq!(oblique.values[0], 0.0);
    assert_eq!(oblique.percent(1), None);
}

#[test]
fn a_record_survives_its_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("records.json");
    let found = compare(&hills(), &all_trees()[..1], &settings(1), 1, &()).unwrap();
    write_records(&path, &found.records).unwrap();
    let read: Vec<Record> = serde_json::from_str(&std::fs::read_to_string(&path).unwrap()).unwrap();
    assert_eq!(read, found.records);
}
