//! Scenes whose radiance is known.

mod render_common;

use std::f64::consts::PI;

use render_common::{Part, grey, matte, mean, path, rendered, scene};
use splitplane_render::render::RenderSettings;
use splitplane_render::scene::light::{Light, SphereMap};
use splitplane_render::scene::material::Material;
use splitplane_render::scene::settings::{Integrator, LightStrategy, SamplerKind};
use splitplane_render::transform::Transform;

const SKY: Light = Light::Infinite {
    radiance: [3.0; 3],
    map: None,
    sphere: SphereMap::LongitudeLatitude,
    to_world: Transform::IDENTITY,
};

fn samples(count: u32) -> RenderSettings {
    RenderSettings {
        samples_per_pixel: Some(count),
        ..Default::default()
    }
}

#[track_caller]
fn assert_near(value: f64, expected: f64, tolerance: f64) {
    assert!(
        (value - expected).abs() <= tolerance * expected.abs(),
        "{value} is not within {} % of {expected}",
        100.0 * tolerance
    );
}

/// The part of the cosine-weighted hemisphere above a point that a square of half edge `half`
/// covers, at `distance` above the point, parallel and centred.
fn square_above(half: f64, distance: f64) -> f64 {
    let a = half / distance;
    let root = (1.0 + a * a).sqrt();
    // Four times the textbook's factor for a corner of the square.
    4.0 / (2.0 * PI) * 2.0 * (a / root) * (a / root).atan()
}

#[test]
fn a_white_convex_body_vanishes_in_a_white_sky() {
    for material in [
        matte(1.0),
        Material::Matte {
            kd: grey(1.0),
            sigma: grey(0.0),
        },
        Material::Mirror { kr: grey(1.0) },
        smooth_glass(),
    ] {
        let scene = scene(vec![Part::cube(1.0, 4.0, material)], vec![SKY], 40.0);
        let picture = rendered(
            &scene,
            &RenderSettings {
                max_depth: Some(100),
                ..samples(256)
            },
        );
        assert_near(mean(&picture), 3.0, 0.01);
    }
}

#[test]
fn a_grey_convex_body_is_its_albedo_times_the_sky() {
    let scene = scene(vec![Part::square(50.0, 1.0, matte(0.4))], vec![SKY], 40.0);
    assert_near(mean(&rendered(&scene, &samples(256))), 1.2, 0.01);
}

#[test]
fn a_shining_closed_box_is_a_geometric_series_of_its_albedo() {
    let room = Part::cube(1.0, 0.0, matte(0.5)).shining(1.0, true);
    for strategy in [
        LightStrategy::Uniform,
        LightStrategy::Power,
        LightStrategy::Spatial,
    ] {
        let room = Part {
            positions: room.positions.clone(),
            triangles: room.triangles.clone(),
            material: matte(0.5),
            area_light: room.area_light.clone(),
            flip_normals: true,
        };
        let mut scene = scene(vec![room], vec![], 90.0);
        scene.integrator = Integrator::Path {
            max_depth: 3,
            rr_threshold: 1.0,
            light_strategy: strategy,
        };
        let picture = rendered(&scene, &samples(512));
        assert_near(mean(&picture), 1.0 + 0.5 + 0.25 + 0.125, 0.01);
    }
}

#[test]
fn russian_roulette_changes_no_mean() {
    let room = Part::cube(1.0, 0.0, matte(0.7)).shining(1.0, true);
    let scene = scene(vec![room], vec![], 90.0);
    let picture = rendered(
        &scene,
        &RenderSettings {
            max_depth: Some(60),
            ..samples(512)
        },
    );
    assert_near(mean(&picture), 1.0 / 0.3, 0.01);
}

#[test]
fn a_point_light_falls_off_with_the_square_of_its_distance_and_the_cosine() {
    let light = Light::Point {
        position: [0.5, -0.25, 1.0],
        intensity: [2.0; 3],
    };
    let mut scene = scene(vec![Part::square(10.0, 2.0, matte(0.5))], vec![light], 60.0);
    scene.sampler.kind = SamplerKind::Halton {
        sample_at_center: true,
    };
    let picture = rendered(&scene, &samples(1));
    let tangent = 30f64.to_radians().tan();
    for (i, pixel) in picture.radiance.iter().enumerate() {
        let x = 2.0 * tangent * (2.0 * ((i % 8) as f64 + 0.5) / 8.0 - 1.0);
        let y = 2.0 * tangent * (1.0 - 2.0 * ((i / 8) as f64 + 0.5) / 8.0);
        let square = (x - 0.5).powi(2) + (y + 0.25).powi(2) + 1.0;
        let expected = 0.5 / PI * 2.0 / square / square.sqrt();
        assert_near(f64::from(pixel[0]), expected, 1e-4);
        assert_near(
            f64::from(picture.depth[i]),
            (x * x + y * y + 4.0).sqrt(),
            1e-5,
        );
    }
    assert_eq!((picture.rays.camera, picture.rays.shadow), (64, 64));
}

#[test]
fn a_distant_light_gives_albedo_over_pi_times_the_cosine() {
    let light = Light::Distant {
        towards: [0.6, 0.0, -0.8],
        radiance: [5.0; 3],
    };
    let scene = scene(vec![Part::square(10.0, 2.0, matte(0.5))], vec![light], 60.0);
    assert_near(
        mean(&rendered(&scene, &samples(1))),
        5.0 * 0.8 * 0.5 / PI,
        1e-5,
    );
}

#[test]
fn a_square_light_gives_its_form_factor_with_every_integrator() {
    let floor = Part::square(50.0, 2.0, matte(0.5));
    let lamp = Part::square(1.5, -0.5, matte(0.0)).shining(4.0, false);
    let mut scene = scene(vec![floor, lamp], vec![], 0.5);
    let expected = 0.5 * 4.0 * square_above(1.5, 2.5);
    for integrator in [
        path(1),
        Integrator::Direct {
            max_depth: 1,
            all_lights: true,
        },
        Integrator::Direct {
            max_depth: 5,
            all_lights: false,
        },
    ] {
        scene.integrator = integrator;
        for kind in [
            SamplerKind::Random,
            SamplerKind::Halton {
                sample_at_center: false,
            },
        ] {
            scene.sampler.kind = kind;
            assert_near(mean(&rendered(&scene, &samples(1024))), expected, 0.01);
        }
    }
}

#[test]
fn a_light_shines_only_to_the_side_of_its_normal_unless_two_sided() {
    // The square's normal points to +z, away from the camera.
    let seen = |flip: bool, two_sided: bool| {
        let mut lamp = Part::square(10.0, 2.0, matte(0.0)).shining(7.0, flip);
        lamp.area_light.as_mut().unwrap().two_sided = two_sided;
        mean(&rendered(&scene(vec![lamp], vec![], 40.0), &samples(4)))
    };
    assert_eq!(seen(false, false), 0.0);
    assert_eq!(seen(true, false), 7.0);
    assert_eq!(seen(false, true), 7.0);
}

#[test]
fn a_mirror_shows_what_is_behind_the_camera() {
    let mirror = Part::square(10.0, 1.0, Material::Mirror { kr: grey(0.5) });
    let lamp = Part::square(10.0, -2.0, matte(0.0)).shining(4.0, false);
    let mut scene = scene(vec![mirror, lamp], vec![], 40.0);
    for integrator in [
        path(2),
        Integrator::Direct {
            max_depth: 2,
            all_lights: true,
        },
    ] {
        scene.integrator = integrator;
        assert_near(mean(&rendered(&scene, &samples(4))), 2.0, 1e-5);
    }
}

#[test]
fn smooth_glass_loses_nothing_when_both_its_rays_are_followed() {
    let mut scene = scene(vec![Part::cube(1.0, 4.0, smooth_glass())], vec![SKY], 40.0);
    scene.integrator = Integrator::Direct {
        max_depth: 9,
        all_lights: true,
    };
    let radiance = mean(&rendered(&scene, &samples(4)));
    assert!(
        radiance > 0.97 * 3.0 && radiance < 1.0001 * 3.0,
        "{radiance}"
    );
}

#[test]
fn rough_glass_and_plastic_and_uber_never_give_more_than_they_get() {
    let glass = |roughness: f32| Material::Glass {
        kr: grey(1.0),
        kt: grey(1.0),
        eta: grey(1.5),
        roughness: [grey(roughness), grey(roughness)],
        remap_roughness: false,
    };
    // A layered material may not have kd and ks of 1 at once.
    let plastic = Material::Plastic {
        kd: grey(0.5),
        ks: grey(0.5),
        roughness: grey(0.3),
        remap_roughness: true,
    };
    for (material, least) in [(glass(0.1), 0.9), (glass(0.5), 0.6), (plastic, 0.5)] {
        let scene = scene(vec![Part::cube(1.0, 4.0, material)], vec![SKY], 20.0);
        let settings = RenderSettings {
            max_depth: Some(50),
            ..samples(256)
        };
        let radiance = mean(&rendered(&scene, &settings)) / 3.0;
        assert!(radiance > least && radiance < 1.01, "{radiance}");
    }
}

#[test]
fn an_uber_body_of_any_opacity_that_absorbs_nothing_vanishes_too() {
    for opacity in [0.0, 0.3, 1.0] {
        let uber = Material::Uber {
            kd: grey(1.0),
            ks: grey(0.0),
            kr: grey(0.0),
            kt: grey(0.0),
            roughness: [grey(0.1), grey(0.1)],
            opacity: grey(opacity),
            eta: grey(1.5),
            remap_roughness: true,
        };
        let scene = scene(vec![Part::cube(1.0, 4.0, uber)], vec![SKY], 20.0);
        let settings = RenderSettings {
            max_depth: Some(100),
            ..samples(512)
        };
        assert_near(mean(&rendered(&scene, &settings)), 3.0, 0.015);
    }
}

#[test]
fn interfaces_are_not_there() {
    let floor = || Part::square(50.0, 2.0, matte(0.5));
    let around = Part::cube(1.0, 0.0, Material::Interface);
    for integrator in [
        path(3),
        Integrator::Direct {
            max_depth: 1,
            all_lights: true,
        },
    ] {
        let mut scene = scene(
            vec![
                floor(),
                Part {
                    ..around_clone(&around)
                },
            ],
            vec![SKY],
            40.0,
        );
        scene.integrator = integrator;
        // Shadow rays do end at interfaces, but none reaches below the cube from most of the floor.
        scene.lights = vec![Light::Distant {
            towards: [0.995, 0.0, -0.0998],
            radiance: [5.0; 3],
        }];
        let with = mean(&rendered(&scene, &samples(4)));
        assert_near(with, 5.0 * 0.5 * 0.0998 / PI, 1e-3);
    }
}

fn around_clone(part: &Part) -> Part {
    Part {
        positions: part.positions.clone(),
        triangles: part.triangles.clone(),
        material: part.material.clone(),
        area_light: None,
        flip_normals: false,
    }
}

#[test]
fn ambient_occlusion_is_pi_times_the_open_part() {
    let floor = || Part::square(50.0, 2.0, matte(0.5));
    let cover = || Part::square(1.5, -0.5, matte(0.5));
    let open = |parts, cosine| {
        let mut scene = scene(parts, vec![], 0.5);
        scene.integrator = Integrator::AmbientOcclusion {
            cosine,
            samples: 16,
        };
        mean(&rendered(&scene, &samples(64)))
    };
    for cosine in [true, false] {
        assert_near(open(vec![floor()], cosine), PI, 0.01);
        let expected = PI * (1.0 - square_above(1.5, 2.5));
        assert_near(open(vec![floor(), cover()], cosine), expected, 0.01);
        assert_eq!(open(vec![Part::cube(1.0, 0.0, matte(0.5))], cosine), 0.0);
    }
}

fn smooth_glass() -> Material {
    Material::Glass {
        kr: grey(1.0),
        kt: grey(1.0),
        eta: grey(1.5),
        roughness: [grey(0.0), grey(0.0)],
        remap_roughness: true,
    }
}
