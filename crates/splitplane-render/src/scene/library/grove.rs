//! Trees of thin slanted triangles: needles on whorls of branches, leaves on crooked ones.

use std::f64::consts::TAU;

use glam::{DAffine3, DVec3};
use rand::RngExt;
use rand_pcg::Pcg32;

use super::build::{Builder, detail_for};
use crate::scene::Scene;
use crate::scene::view::{self, matte};

const GROUND: usize = 0;
const BARK: usize = 1;
const NEEDLE: usize = 2;
const LEAF: usize = 3;
const YOUNG_LEAF: usize = 4;
const MATERIALS: usize = 5;

/// Half the width of the ground, in metres.
const HALF: f64 = 40.0;

pub(crate) fn scene(name: &str, triangles: usize) -> Result<Scene, String> {
    let count = |detail: f64| {
        let mut builder = Builder::new(MATERIALS, true);
        grove(&mut builder, detail);
        builder.triangles()
    };
    let mut builder = Builder::new(MATERIALS, false);
    grove(&mut builder, detail_for(triangles, count));
    let materials = vec![
        matte([0.26, 0.25, 0.12]),
        matte([0.22, 0.15, 0.10]),
        matte([0.07, 0.19, 0.08]),
        matte([0.19, 0.33, 0.06]),
        matte([0.42, 0.38, 0.06]),
    ];
    let view = |_: &splitplane::Mesh| {
        let eye = DVec3::new(2.0, ground(2.0, 21.0) + 1.8, 21.0);
        let camera = view::look(eye, DVec3::new(0.0, 4.9, 0.0), DVec3::Y, 46.0);
        (camera, view::daylight(DVec3::new(-0.8, 0.7, 0.45)))
    };
    view::scene(name, builder.pieces(), materials, view, Vec::new())
}

/// The height of the ground.
fn ground(x: f64, z: f64) -> f64 {
    0.8 * (0.11 * x + 0.4).sin() * (0.13 * z).cos()
        + 0.25 * (0.37 * x).sin() * (0.31 * z + 1.0).sin()
}

/// Numbers from a seed that is part of the scene.
struct Random(Pcg32);

impl Random {
    fn new(stream: u64) -> Self {
        Random(Pcg32::new(0x5eed, stream))
    }

    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.0.random::<f64>()
    }
}

fn grove(b: &mut Builder, detail: f64) {
    let cells = ((40.0 * detail.powf(0.4)).round() as usize).max(6);
    let at = |i: usize, j: usize| {
        let [x, z] = [i, j].map(|k| HALF * (2.0 * k as f64 / cells as f64 - 1.0));
        DVec3::new(x, ground(x, z), z)
    };
    for i in 0..cells {
        for j in 0..cells {
            b.quad(
                GROUND,
                [at(i, j), at(i, j + 1), at(i + 1, j + 1), at(i + 1, j)],
            );
        }
    }
    // More trees with more triangles, and more on each tree.
    let trees = ((34.0 * detail.powf(0.4)).round() as usize).max(6);
    let fullness = detail.powf(0.6);
    let mut feet: Vec<DVec3> = Vec::new();
    let mut random = Random::new(0);
    // The view stays open; the distance between trees shrinks until all have found a place.
    let mut apart = 3.6;
    while feet.len() < trees {
        // Most stand where the camera sees them: wider apart the further away.
        let z = random.between(-28.0, 13.0);
        let x = random.between(-1.0, 1.0) * (4.0 + 0.42 * (21.0 - z));
        let foot = DVec3::new(x, ground(x, z), z);
        let in_view = z > -4.0 && (x - 0.5).abs() < 3.0 + 0.1 * z;
        if !in_view && feet.iter().all(|other| other.distance(foot) > apart) {
            feet.push(foot);
        }
        apart *= 0.9995;
    }
    for (i, foot) in feet.into_iter().enumerate() {
        let mut random = Random::new(1 + i as u64);
        let frame = DAffine3::from_translation(foot - 0.1 * DVec3::Y)
            * DAffine3::from_rotation_y(random.between(0.0, TAU));
        if i % 2 == 0 {
            conifer(b, &frame, fullness, &mut random);
        } else {
            broadleaf(b, &frame, fullness, &mut random);
        }
    }
}

/// A tapering tube along points.
fn limb(b: &mut Builder, points: &[(DVec3, f64)], sides: usize) {
    for pair in points.windows(2) {
        let ((p, r), (q, s)) = (pair[0], pair[1]);
        let (u, v) = (q - p).normalize_or(DVec3::Y).any_orthonormal_pair();
        let around = |i: usize| {
            let (sin, cos) = (TAU * i as f64 / sides as f64).sin_cos();
            cos * u + sin * v
        };
        for i in 0..sides {
            let (m, n) = (around(i), around(i + 1));
            b.quad(BARK, [p + r * m, p + r * n, q + s * n, q + s * m]);
        }
    }
}

/// A trunk with whorls of drooping branches, each with twigs full of needles.
fn conifer(b: &mut Builder, frame: &DAffine3, fullness: f64, random: &mut Random) {
    let height = random.between(9.0, 14.0);
    let lean = DVec3::new(random.between(-0.4, 0.4), height, random.between(-0.4, 0.4));
    let on_trunk = |t: f64| frame.transform_point3(t * lean);
    let girth = 0.021 * height;
    let trunk: Vec<_> = (0..=6)
        .map(|i| f64::from(i) / 6.0)
        .map(|t| (on_trunk(t), girth * (1.02 - t)))
        .collect();
    limb(b, &trunk, 8);
    let whorls = (1.9 * height).round() as usize;
    for whorl in 0..whorls {
        let t = 0.12 + 0.86 * whorl as f64 / whorls as f64;
        let reach = (0.3 * height) * (1.0 - t).powf(0.8) * random.between(0.85, 1.1) + 0.15;
        let branches = 6;
        let turn = random.between(0.0, TAU);
        for branch in 0..branches {
            let angle = turn + TAU * f64::from(branch) / f64::from(branches);
            let out = frame.transform_vector3(DVec3::new(angle.cos(), 0.0, angle.sin()));
            let across = out.cross(DVec3::Y);
            let droop = random.between(0.25, 0.5);
            let base = on_trunk(t);
            let at = |s: f64| base + reach * (s * out - droop * s * s * DVec3::Y);
            let thick = 0.1 * girth;
            limb(
                b,
                &[
                    (at(0.0), thick),
                    (at(0.5), 0.6 * thick),
                    (at(1.0), 0.1 * thick),
                ],
                3,
            );
            let needles = (20.0 * fullness * reach).round().max(4.0) as usize;
            for needle in 0..needles {
                let s = (needle as f64 + random.between(0.0, 1.0)) / needles as f64;
                let side = if needle % 2 == 0 { 1.0 } else { -1.0 };
                // A spray: longest in the middle of the branch, pointing on and a little down.
                let length = reach * (0.16 + 0.3 * (1.0 - s) * (0.3 + s));
                let to = (0.7 * out + side * random.between(0.5, 1.0) * across
                    - random.between(0.15, 0.55) * DVec3::Y)
                    .normalize_or(out);
                let width = (0.05 + 0.05 * length) * (1.0 / fullness.max(0.2)).powf(0.25);
                let flat = to
                    .cross(random.between(-0.6, 0.6) * across + DVec3::Y)
                    .normalize_or(out);
                let p = at(s);
                b.triangle(
                    NEEDLE,
                    [p - width * flat, p + width * flat, p + length * to],
                );
            }
        }
    }
}

/// A trunk that forks, and leaves of two triangles around the ends.
fn broadleaf(b: &mut Builder, frame: &DAffine3, fullness: f64, random: &mut Random) {
    let young = random.between(0.0, 1.0) < 0.3;
    let height = random.between(2.2, 3.2);
    let foot = frame.transform_point3(DVec3::ZERO);
    let up = DVec3::new(
        random.between(-0.12, 0.12),
        1.0,
        random.between(-0.12, 0.12),
    );
    let leaves = (26.0 * fullness).round().max(2.0) as usize;
    let material = if young { YOUNG_LEAF } else { LEAF };
    branch(
        b,
        foot,
        up.normalize_or(DVec3::Y),
        height,
        0.22,
        4,
        leaves,
        material,
        random,
    );
}

#[expect(
    clippy::too_many_arguments,
    reason = "a recursion whose every argument changes or is drawn from"
)]
fn branch(
    b: &mut Builder,
    from: DVec3,
    direction: DVec3,
    length: f64,
    girth: f64,
    forks: u32,
    leaves: usize,
    material: usize,
    random: &mut Random,
) {
    let bend = DVec3::new(random.between(-1.0, 1.0), 0.5, random.between(-1.0, 1.0));
    let middle = from + 0.5 * length * direction;
    let to = from + length * (direction + 0.16 * bend).normalize_or(direction);
    limb(
        b,
        &[(from, girth), (middle, 0.85 * girth), (to, 0.68 * girth)],
        3 + forks as usize,
    );
    if forks <= 1 {
        for _ in 0..leaves {
            let s = random.between(0.2, 1.15);
            let spread = DVec3::new(
                random.between(-1.0, 1.0),
                random.between(-0.7, 0.9),
                random.between(-1.0, 1.0),
            );
            let p = from + s * (to - from) + 0.5 * spread;
            leaf(
                b,
                p,
                (spread + 0.3 * direction).normalize_or(direction),
                material,
                random,
            );
        }
    }
    if forks == 0 {
        return;
    }
    let count = if forks == 4 { 4 } else { 3 };
    let (u, v) = direction.any_orthonormal_pair();
    let turn = random.between(0.0, TAU);
    for i in 0..count {
        let (sin, cos) =
            (turn + TAU * f64::from(i) / f64::from(count) + random.between(-0.3, 0.3)).sin_cos();
        let slant = random.between(0.45, 0.85);
        let next =
            (direction + slant * (cos * u + sin * v) + 0.12 * DVec3::Y).normalize_or(direction);
        let length = length * random.between(0.62, 0.8);
        branch(
            b,
            to,
            next,
            length,
            0.62 * girth,
            forks - 1,
            leaves,
            material,
            random,
        );
    }
}

/// A leaf folded along its middle: two thin triangles.
fn leaf(b: &mut Builder, at: DVec3, along: DVec3, material: usize, random: &mut Random) {
    let length = random.between(0.24, 0.4);
    let along = (along - 0.35 * DVec3::Y).normalize_or(along);
    let (u, v) = along.any_orthonormal_pair();
    let (sin, cos) = random.between(0.0, TAU).sin_cos();
    let (side, normal) = (cos * u + sin * v, cos * v - sin * u);
    let middle = at + 0.45 * length * along + 0.08 * length * normal;
    let tip = at + length * along;
    let width = 0.2 * length;
    b.triangle(material, [at, middle + width * side, tip]);
    b.triangle(material, [at, tip, middle - width * side]);
}
