//! Architecture whose walls run along no axis: a courtyard with arcades on two storeys, turned by
//! 30°, 45° and 60°, around a round temple on steps.

use std::f64::consts::PI;

use glam::{DAffine3, DMat3, DVec3};

use super::build::{Builder, detail_for};
use crate::scene::Scene;
use crate::scene::view::{self, matte};

const STONE: usize = 0;
const WALL: usize = 1;
const TILE: usize = 2;
const DARK_TILE: usize = 3;
const WOOD: usize = 4;
const MATERIALS: usize = 5;

/// The courtyard's sides in order: the direction in which each runs, in degrees, and its bays.
/// Opposite sides are parallel and of the same length, so that the hexagon closes.
const SIDES: [(f64, f64); 6] = [
    (30.0, 5.0),
    (60.0, 4.0),
    (135.0, 5.0),
    (210.0, 5.0),
    (240.0, 4.0),
    (315.0, 5.0),
];

/// Lengths in metres; the galleries' floor is at height 0, the court's lies lower.
const FLOOR: f64 = -0.6;
const BAY: f64 = 4.0;
const THICKNESS: f64 = 0.7;
const GALLERY: f64 = 4.2;
/// How far galleries reach past their corners, to meet where sides turn most.
const OVERLAP: f64 = 4.4;
const STOREYS: [(f64, f64); 2] = [(0.0, 5.4), (5.4, 4.4)];

pub(crate) fn scene(name: &str, triangles: usize) -> Result<Scene, String> {
    let count = |detail: f64| {
        let mut builder = Builder::new(MATERIALS, true);
        courtyard(&mut builder, detail);
        builder.triangles()
    };
    let mut builder = Builder::new(MATERIALS, false);
    courtyard(&mut builder, detail_for(triangles, count));
    let materials = vec![
        matte([0.66, 0.60, 0.50]),
        matte([0.72, 0.62, 0.48]),
        matte([0.55, 0.50, 0.44]),
        matte([0.30, 0.24, 0.21]),
        matte([0.28, 0.17, 0.09]),
    ];
    let view = |_: &splitplane::Mesh| {
        // From the shade of a gallery through its arches to the temple.
        let frame = frame(0);
        let eye = frame.transform_point3(DVec3::new(0.22 * BAY * SIDES[0].1, 1.75, GALLERY));
        let camera = view::look(eye, DVec3::new(0.0, 2.7, 0.0), DVec3::Y, 62.0);
        (camera, view::daylight(DVec3::new(-0.35, 0.75, 0.5)))
    };
    view::scene(name, builder.pieces(), materials, view, Vec::new())
}

/// The unit vector along a direction in the plane of the floor.
fn along(degrees: f64) -> DVec3 {
    let (sin, cos) = degrees.to_radians().sin_cos();
    DVec3::new(cos, 0.0, sin)
}

/// The corners of the courtyard, around the origin.
fn corners() -> Vec<DVec3> {
    let mut at = DVec3::ZERO;
    let mut corners = Vec::new();
    for (degrees, bays) in SIDES {
        corners.push(at);
        at += BAY * bays * along(degrees);
    }
    let center = corners.iter().sum::<DVec3>() / corners.len() as f64;
    corners.into_iter().map(|corner| corner - center).collect()
}

/// The place of a side: x runs along it, y up, z away from the court.
fn frame(side: usize) -> DAffine3 {
    let x = along(SIDES[side].0);
    let outwards = DVec3::new(x.z, 0.0, -x.x);
    DAffine3 {
        matrix3: DMat3::from_cols(x, DVec3::Y, outwards),
        translation: corners()[side],
    }
}

/// How finely round things are made, and how many stones there are.
#[derive(Clone, Copy, Debug)]
struct Detail {
    /// Segments of a column's circumference.
    round: usize,
    /// Stones of an arch.
    stones: usize,
    /// Segments of each stone's curve.
    curve: usize,
    /// Beams over a bay.
    beams: usize,
    /// Tiles along a bay.
    tiles: usize,
}

fn courtyard(b: &mut Builder, detail: f64) {
    let scaled = |base: f64, power: f64, least: usize| -> usize {
        ((base * detail.powf(power)).round() as usize).max(least)
    };
    let detail = Detail {
        round: scaled(16.0, 0.5, 5),
        stones: scaled(13.0, 0.35, 5) | 1,
        curve: scaled(1.0, 0.3, 1),
        beams: scaled(4.0, 0.4, 1),
        tiles: scaled(5.0, 0.5, 1),
    };
    for (i, (_, bays)) in SIDES.into_iter().enumerate() {
        side(b, &frame(i), bays as usize, detail);
    }
    floor(b, detail);
    temple(b, detail);
}

fn side(b: &mut Builder, frame: &DAffine3, bays: usize, detail: Detail) {
    let length = BAY * bays as f64;
    b.block(
        STONE,
        frame,
        DVec3::new(-OVERLAP, FLOOR, -0.2),
        DVec3::new(length + OVERLAP, 0.0, THICKNESS + GALLERY),
    );
    for (storey, (base, height)) in STOREYS.into_iter().enumerate() {
        // The gallery upstairs has two narrower arches over each one below.
        let arches = if storey == 0 { bays } else { 2 * bays };
        let width = length / arches as f64;
        for i in 0..=arches {
            let x = i as f64 * width;
            column(
                b,
                frame,
                DVec3::new(x, base, THICKNESS / 2.0),
                width,
                height,
                detail,
            );
        }
        for i in 0..arches {
            arch(
                b,
                frame,
                DVec3::new(i as f64 * width, base, 0.0),
                width,
                height,
                detail,
            );
        }
        // Cornice, gallery floor and back wall with its thickness.
        let top = base + height;
        for (out, low) in [(0.32, top - 0.16), (0.2, top - 0.3), (0.1, top - 0.42)] {
            let low = DVec3::new(-0.2, low, -out);
            b.block(
                STONE,
                frame,
                low,
                DVec3::new(length + 0.2, low.y + 0.16, 0.0),
            );
        }
        b.block(
            WALL,
            frame,
            DVec3::new(-OVERLAP, top - 0.12, THICKNESS),
            DVec3::new(length + OVERLAP, top + 0.02, THICKNESS + GALLERY),
        );
        b.block(
            WALL,
            frame,
            DVec3::new(-OVERLAP, base, THICKNESS + GALLERY),
            DVec3::new(length + OVERLAP, top, 2.0 * THICKNESS + GALLERY),
        );
        let beams = bays * detail.beams;
        for i in 0..beams {
            let x = (i as f64 + 0.5) * length / beams as f64;
            b.block(
                WOOD,
                frame,
                DVec3::new(x - 0.09, top - 0.4, THICKNESS * 0.9),
                DVec3::new(x + 0.09, top - 0.12, THICKNESS + GALLERY + 0.1),
            );
        }
    }
    stairs(b, frame, length);
    roof(b, frame, length, detail);
}

/// A column with base and capital under the springing of an arch.
fn column(b: &mut Builder, frame: &DAffine3, foot: DVec3, width: f64, height: f64, detail: Detail) {
    let springing = springing(width, height);
    let r = 0.26 * (width / BAY).sqrt();
    let at = *frame * DAffine3::from_translation(foot);
    let half = THICKNESS / 2.0;
    b.block(
        STONE,
        &at,
        DVec3::new(-half, 0.0, -half),
        DVec3::new(half, 0.18, half),
    );
    b.block(
        STONE,
        &at,
        DVec3::new(-half, springing - 0.16, -half),
        DVec3::new(half, springing, half),
    );
    let shaft = springing - 0.16;
    let mut profile = vec![(r * 1.35, 0.18)];
    // Two rings of the base, a shaft that tapers, and the capital's bell.
    for (center, radius) in [(0.24, 1.34), (0.36, 1.2)] {
        for step in 0..5 {
            let angle = PI * (f64::from(step) / 4.0 - 0.5);
            profile.push((
                r * (radius - 0.1 + 0.12 * angle.cos()),
                center + 0.055 * angle.sin(),
            ));
        }
    }
    for step in 0..=4 {
        let t = f64::from(step) / 4.0;
        profile.push((r * (1.0 - 0.14 * t * t), 0.44 + t * (shaft - 0.9)));
    }
    for step in 1..=5 {
        let t = f64::from(step) / 5.0;
        profile.push((r * (0.86 + 0.5 * t * t), shaft - 0.46 + 0.46 * t));
    }
    b.turned(STONE, &at, &profile, detail.round);
}

/// The height at which arches of a width begin under a storey of a height.
fn springing(width: f64, height: f64) -> f64 {
    height - 0.75 - (width - THICKNESS) / 2.0
}

/// A round arch of wedge-shaped stones, and the wall above it.
fn arch(b: &mut Builder, frame: &DAffine3, corner: DVec3, width: f64, height: f64, detail: Detail) {
    let at = *frame * DAffine3::from_translation(corner);
    let springing = springing(width, height);
    let inner = (width - THICKNESS) / 2.0;
    let outer = inner + 0.3;
    let on = |radius: f64, angle: f64, z: f64| {
        let x = width / 2.0 - radius * angle.cos();
        at.transform_point3(DVec3::new(x, springing + radius * angle.sin(), z))
    };
    for stone in 0..detail.stones {
        let share = |s: f64| PI * (stone as f64 + s) / detail.stones as f64;
        // A joint between stones, and the stones stand a little out of the wall.
        let (from, to) = (share(0.03), share(0.97));
        let (front, back) = (-0.05, THICKNESS + 0.05);
        for step in 0..detail.curve {
            let angle = |step: usize| from + (to - from) * step as f64 / detail.curve as f64;
            let (p, q) = (angle(step), angle(step + 1));
            let ring = |r: f64, z: f64| (on(r, p, z), on(r, q, z));
            let ((a, d), (e, h)) = (ring(inner, front), ring(inner, back));
            let ((c, f), (g, i)) = (ring(outer, front), ring(outer, back));
            b.quad(STONE, [a, c, f, d]);
            b.quad(STONE, [e, h, i, g]);
            b.quad(STONE, [a, d, h, e]);
            b.quad(STONE, [c, g, i, f]);
        }
        for angle in [from, to] {
            let corners = [(inner, front), (outer, front), (outer, back), (inner, back)];
            b.quad(STONE, corners.map(|(r, z)| on(r, angle, z)));
        }
    }
    // The wall above: between the arch's curve and a straight top, front and back.
    let steps = 2 * detail.stones * detail.curve;
    let middle = (inner + outer) / 2.0;
    for z in [0.0, THICKNESS] {
        for step in 0..steps {
            let point = |step: usize| {
                let angle = PI * step as f64 / steps as f64;
                let x = width / 2.0 - middle * angle.cos();
                (
                    on(middle, angle, z),
                    at.transform_point3(DVec3::new(x, height, z)),
                )
            };
            let ((a, d), (p, q)) = (point(step), point(step + 1));
            b.quad(WALL, [a, p, q, d]);
        }
        for (x0, x1) in [(0.0, width / 2.0 - middle), (width / 2.0 + middle, width)] {
            let corners = [(x0, springing), (x1, springing), (x1, height), (x0, height)];
            b.quad(
                WALL,
                corners.map(|(x, y)| at.transform_point3(DVec3::new(x, y, z))),
            );
        }
    }
}

/// Steps that lead up to the gallery floor from the middle of a side.
fn stairs(b: &mut Builder, frame: &DAffine3, length: f64) {
    for step in 0..4 {
        let (rise, depth) = (0.15, 0.34);
        let out = (4 - step) as f64 * depth;
        let low = DVec3::new(
            length / 2.0 - 2.4 - out,
            step as f64 * rise + FLOOR,
            -out - 0.2,
        );
        let high = DVec3::new(length / 2.0 + 2.4 + out, low.y + rise, 0.1);
        b.block(STONE, frame, low, high);
    }
}

/// Rafters and rows of half-round tiles over the gallery, falling towards the court.
fn roof(b: &mut Builder, frame: &DAffine3, length: f64, detail: Detail) {
    let eaves = STOREYS[1].0 + STOREYS[1].1 + 0.02;
    let depth = 2.0 * THICKNESS + GALLERY + 0.5;
    let rise = 1.7;
    let rows = ((length + 2.0 * OVERLAP) / 0.36).round() as usize;
    let pitch = (length + 2.0 * OVERLAP) / rows as f64;
    let segments = (detail.round / 4).max(2);
    let courses = detail.tiles.max(1);
    for row in 0..rows {
        let x = -OVERLAP + (row as f64 + 0.5) * pitch;
        for course in 0..courses {
            let point = |step: usize, end: usize| {
                let t = (course + end) as f64 / courses as f64;
                let angle = PI * step as f64 / segments as f64;
                let radius = pitch / 2.0 * if end == 0 { 1.04 } else { 0.92 };
                frame.transform_point3(DVec3::new(
                    x - radius * angle.cos(),
                    eaves + t * rise + radius * angle.sin(),
                    -0.5 + t * depth,
                ))
            };
            for step in 0..segments {
                let corners = [
                    point(step, 0),
                    point(step + 1, 0),
                    point(step + 1, 1),
                    point(step, 1),
                ];
                b.quad(DARK_TILE, corners);
            }
        }
    }
    let edge = |x: f64, t: f64| {
        frame.transform_point3(DVec3::new(x, eaves + t * rise - 0.03, -0.5 + t * depth))
    };
    let ends = [-OVERLAP, length + OVERLAP];
    b.quad(
        WOOD,
        [
            edge(ends[0], 0.0),
            edge(ends[1], 0.0),
            edge(ends[1], 1.0),
            edge(ends[0], 1.0),
        ],
    );
}

/// Tiles in a grid turned by 45°, a border around each.
fn floor(b: &mut Builder, detail: Detail) {
    const HALF: f64 = 26.0;
    let count = (2.0 * HALF / BAY) as usize * detail.tiles;
    let size = 2.0 * HALF / count as f64;
    let (x, z) = (along(45.0), along(135.0));
    for i in 0..count {
        for j in 0..count {
            let at = |s: f64, t: f64| {
                (i as f64 * size + s * size - HALF) * x + (j as f64 * size + t * size - HALF) * z
            };
            let material = if (i + j) % 2 == 0 { TILE } else { DARK_TILE };
            let corners = [at(0.0, 0.0), at(0.0, 1.0), at(1.0, 1.0), at(1.0, 0.0)];
            b.quad(material, corners.map(|p| p + FLOOR * DVec3::Y));
        }
    }
}

/// Eight columns and a dome on round steps in the middle.
fn temple(b: &mut Builder, detail: Detail) {
    let round = 2 * detail.round;
    let frame = DAffine3::from_translation(FLOOR * DVec3::Y);
    let mut steps = Vec::new();
    for step in 0..4 {
        let radius = 4.1 - 0.42 * f64::from(step);
        steps.extend([
            (radius, 0.2 * f64::from(step)),
            (radius, 0.2 * f64::from(step + 1)),
        ]);
    }
    steps.push((0.0, 0.8));
    b.turned(STONE, &frame, &steps, round);
    let base = DAffine3::from_translation(0.2 * DVec3::Y);
    let (width, height) = (2.2, 4.6);
    for i in 0..8 {
        let turned = base * DAffine3::from_rotation_y(PI / 4.0 * f64::from(i) + PI / 6.0);
        column(b, &turned, DVec3::new(2.3, 0.0, 0.0), width, height, detail);
    }
    let ring = springing(width, height);
    let mut dome = vec![
        (1.9, ring),
        (2.7, ring),
        (2.7, ring + 0.3),
        (2.9, ring + 0.42),
    ];
    dome.extend([(2.9, ring + 0.56), (2.45, ring + 0.62)]);
    let rings = detail.round.max(6);
    for step in 0..=rings {
        let angle = PI / 2.0 * step as f64 / rings as f64;
        let radius = if step == rings {
            0.0
        } else {
            2.4 * angle.cos()
        };
        dome.push((radius, ring + 0.7 + 2.1 * angle.sin()));
    }
    b.turned(WALL, &base, &dome, round);
    let mut inside: Vec<(f64, f64)> = Vec::new();
    for step in 0..=rings {
        let angle = PI / 2.0 * step as f64 / rings as f64;
        let radius = if step == rings {
            0.0
        } else {
            1.9 * angle.cos()
        };
        inside.push((radius, ring + 1.9 * angle.sin()));
    }
    b.turned(WALL, &base, &inside, round);
}
