//! How thick a part is, for printing and moulding: from the middle of each triangle inwards to the
//! other side; and the largest ball that touches the surface there and stays inside.
//!
//! `cargo run --release --example thickness`

mod shapes;

use rayon::prelude::*;
use splitplane::{Ray, Tree};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // A ring whose tube is 0.3 in radius: 0.6 thick.
    let mesh = shapes::torus([0.0; 3], 1.0, 0.3, 64)?;
    assert!(mesh.is_closed(), "thickness needs an inside");
    let tree = Tree::new(&mesh)?;

    let count = mesh.triangles().len() as u32;
    let measured: Vec<(f32, f32)> = (0..count)
        .into_par_iter()
        .map(|triangle| {
            let [a, b, c] = mesh.corners(triangle);
            let middle: [f32; 3] = std::array::from_fn(|i| (a[i] + b[i] + c[i]) / 3.0);
            let inwards = mesh.normal(triangle).map(|c| -c);
            // Not the triangle that the ray starts from, however the start is rounded.
            let ray = Ray::new(middle, inwards);
            let other = tree.closest_hit_where(&ray, |hit| hit.triangle != triangle, &mut ());
            let across = other.map_or(f32::INFINITY, |hit| hit.t);
            // A ball of radius r at middle + r * inwards stays inside if its centre is no nearer
            // to the surface than r.
            let (mut fits, mut too_large) = (0.0, 0.5 * across);
            for _ in 0..20 {
                let radius = 0.5 * (fits + too_large);
                let center = shapes::add(middle, inwards, radius);
                let near = tree.closest_point(center, radius * 0.999, &mut ());
                *(if near.is_none() {
                    &mut fits
                } else {
                    &mut too_large
                }) = radius;
            }
            (across, 2.0 * fits)
        })
        .collect();

    let range = |pick: fn(&(f32, f32)) -> f32| {
        let values = || measured.iter().map(pick);
        (
            values().fold(f32::MAX, f32::min),
            values().fold(0.0, f32::max),
        )
    };
    let (rays, balls) = (range(|m| m.0), range(|m| m.1));
    println!("through the part: {:.3} to {:.3}", rays.0, rays.1);
    println!("balls inside:     {:.3} to {:.3}", balls.0, balls.1);
    assert!(rays.0 > 0.55 && balls.1 < 0.61);
    let distance = tree
        .signed_distance([1.0, 0.0, 0.0], &mut ())
        .unwrap_or(0.0);
    println!("the middle of the tube is {:.3} deep", -distance);
    assert!((distance + 0.3).abs() < 0.01);
    Ok(())
}
