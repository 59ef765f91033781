//! A spinning lidar in a scene: 32 beams, a turn in steps of a fifth of a degree, each return with
//! its distance, its object and the angle at which the surface was met. Far from the origin of the
//! coordinates, as survey data is.
//!
//! `cargo run --example lidar [points.xyz]`

mod shapes;

use rayon::prelude::*;
use splitplane::{Mesh, Tree};

/// Where a map would have the scene: metres east and north.
const SITE: [f64; 3] = [458_300.0, 5_427_900.0, 112.0];

/// The first of the objects.
const GROUND: usize = 0;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut parts = vec![shapes::floor(0.0, 60.0)?];
    for i in 0..8 {
        let (y, x) = (std::f32::consts::TAU * i as f32 / 8.0).sin_cos();
        parts.push(shapes::torus([12.0 * x, 12.0 * y, 1.5], 1.2, 0.5, 24)?);
    }
    let (near, objects) = Mesh::join(&parts)?;
    let positions: Vec<[f64; 3]> = (near.positions().iter())
        .map(|p| std::array::from_fn(|i| SITE[i] + f64::from(p[i])))
        .collect();
    let mesh = Mesh::from_f64(&positions, near.triangles().to_vec())?;
    let tree = Tree::new(&mesh)?;

    let (beams, steps, range) = (32, 1800, 50.0);
    let sensor = [SITE[0], SITE[1], SITE[2] + 1.8];
    let returns: Vec<_> = (0..beams * steps)
        .into_par_iter()
        .filter_map(|i| {
            let turn = f64::from(i % steps) / f64::from(steps) * std::f64::consts::TAU;
            let tilt = (-20.0 + 30.0 * f64::from(i / steps) / f64::from(beams - 1)).to_radians();
            let direction = [tilt.cos() * turn.cos(), tilt.cos() * turn.sin(), tilt.sin()];
            let mut ray = mesh.ray(sensor, direction);
            ray.t_max = range;
            let hit = tree.closest_hit(&ray, &mut ())?;
            let cosine = shapes::dot(mesh.normal(hit.triangle), ray.direction).abs();
            let point: [f64; 3] =
                std::array::from_fn(|k| sensor[k] + f64::from(hit.t) * direction[k]);
            Some((point, hit.t, objects.locate(hit.triangle).0, cosine))
        })
        .collect();

    let of_objects = returns.iter().filter(|r| r.2 != GROUND).count();
    let furthest = returns.iter().map(|r| r.1).fold(0.0, f32::max);
    println!(
        "{} beams cast, {} returns, {of_objects} of them from objects; the furthest at {furthest:.2} m",
        beams * steps,
        returns.len(),
    );
    // The ground is flat, so the height of its returns says how exact they are.
    let off = (returns.iter().filter(|r| r.2 == GROUND))
        .map(|r| (r.0[2] - SITE[2]).abs())
        .fold(0.0, f64::max);
    println!(
        "points on the ground are off by at most {:.4} mm",
        1e3 * off
    );
    assert!(of_objects > 1000 && off < 1e-4);
    if let Some(path) = std::env::args().nth(1) {
        let lines = returns.iter().map(|([x, y, z], _, object, cosine)| {
            format!("{x:.4} {y:.4} {z:.4} {object} {cosine:.3}\n")
        });
        std::fs::write(path, lines.collect::<String>())?;
    }
    Ok(())
}
