//! A small renderer: rings over a floor as instances of one tree, a sun with shadows and
//! a sky with occlusion.
//!
//! `cargo run --release --example render [out.pgm]`: with a name, the picture is written to that
//! file.

mod shapes;

use std::sync::Arc;

use rayon::prelude::*;
use shapes::{add, dot, hemisphere, unit};
use splitplane::{Instances, Ray, Transform, Tree};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let ring = Arc::new(Tree::new(&shapes::torus([0.0; 3], 1.0, 0.3, 64)?)?);
    let ground = Arc::new(Tree::new(&shapes::floor(0.0, 30.0)?)?);
    let mut placed = vec![(ground, Transform::IDENTITY)];
    for i in 0..25 {
        let (x, y) = (f64::from(i % 5) * 3.0 - 6.0, f64::from(i / 5) * 3.0 - 6.0);
        // Each leans more than the one before.
        let (sin, cos) = (f64::from(i) * 0.065).sin_cos();
        let rows = [
            [1.0, 0.0, 0.0, x],
            [0.0, cos, -sin, y],
            [0.0, sin, cos, 0.3 + sin],
        ];
        placed.push((ring.clone(), Transform::from_rows(rows)?));
    }
    let scene = Instances::new(placed)?;

    let (width, height) = (480usize, 320usize);
    let eye = [9.0, -13.0, 9.0];
    let forward = unit(add([0.0, 0.0, 0.5], eye, -1.0));
    let right = unit([forward[1], -forward[0], 0.0]);
    let up = [
        right[1] * forward[2] - right[2] * forward[1],
        right[2] * forward[0] - right[0] * forward[2],
        right[0] * forward[1] - right[1] * forward[0],
    ];
    let sun = unit([0.5, -0.3, 0.8]);
    let shade = |ray: &Ray| {
        let Some(found) = scene.closest_hit(ray, &mut ()) else {
            return 0.9 + 0.1 * unit(ray.direction)[2];
        };
        let mut normal = scene.normal(&found);
        if dot(normal, ray.direction) > 0.0 {
            normal = normal.map(|c| -c);
        }
        let origin = add(ray.at(found.hit.t), normal, 1e-3);
        let sunlit = !scene.any_hit(&Ray::new(origin, sun), &mut ());
        let open = (0..64).filter(|&i| {
            let mut ray = Ray::new(origin, hemisphere(normal, i, 64));
            ray.t_max = 5.0;
            !scene.any_hit(&ray, &mut ())
        });
        let sky = open.count() as f32 / 64.0;
        let grey = if found.instance == 0 { 0.6 } else { 0.9 };
        grey * (0.4 * sky
            + if sunlit {
                0.7 * dot(normal, sun).max(0.0)
            } else {
                0.0
            })
    };
    let picture: Vec<f32> = (0..width * height)
        .into_par_iter()
        .map(|pixel| {
            let x = ((pixel % width) as f32 + 0.5 - 0.5 * width as f32) / height as f32;
            let y = (0.5 * height as f32 - (pixel / width) as f32 - 0.5) / height as f32;
            shade(&Ray::new(eye, add(add(forward, right, x), up, y))).powf(1.0 / 2.2)
        })
        .collect();
    let mean = picture.iter().sum::<f32>() / picture.len() as f32;
    println!("{width} x {height} pixels, {mean:.3} bright on average");
    if let Some(path) = std::env::args().nth(1) {
        shapes::write_pgm(&path, width, &picture)?;
    }
    Ok(())
}
