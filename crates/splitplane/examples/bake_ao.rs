//! Ambient occlusion, baked into vertices: of the directions above each vertex, the part that sees
//! the sky. Any-hit queries with a short reach, in parallel over vertices.
//!
//! `cargo run --release --example bake_ao [out.ply]`: the mesh is made here; with a name, it is
//! written to that file, with what its vertices see as their colours.

mod shapes;

use rayon::prelude::*;
use splitplane::{Mesh, MeshError, Ray, Tree};

const DIRECTIONS: u32 = 256;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let (mesh, _) = Mesh::join(&[
        shapes::torus([0.0, 0.0, 0.4], 1.0, 0.4, 96)?,
        shapes::torus([0.0, 0.0, 1.2], 0.7, 0.3, 96)?,
        grid(0.0, 2.0, 80)?,
    ])?;
    let tree = Tree::new(&mesh)?;

    // The normal of a vertex: those of its triangles, by their area.
    let mut normals = vec![[0.0; 3]; mesh.positions().len()];
    for (i, corners) in mesh.triangles().iter().enumerate() {
        for &vertex in corners {
            let sum = &mut normals[vertex as usize];
            *sum = shapes::add(*sum, mesh.normal(i as u32), 1.0);
        }
    }
    let reach = 0.5 * mesh.bounds().diagonal();
    let sky: Vec<f32> = (mesh.positions().par_iter().zip(&normals))
        .map(|(&vertex, &normal)| {
            let normal = shapes::unit(normal);
            // Off the surface, by little in proportion to the scene.
            let origin = shapes::add(vertex, normal, 1e-4 * reach);
            let seen = (0..DIRECTIONS).filter(|&i| {
                let mut ray = Ray::new(origin, shapes::hemisphere(normal, i, DIRECTIONS));
                ray.t_max = reach;
                !tree.any_hit(&ray, &mut ())
            });
            seen.count() as f32 / DIRECTIONS as f32
        })
        .collect();

    let mean = sky.iter().sum::<f32>() / sky.len() as f32;
    let (least, most) = sky
        .iter()
        .fold((1f32, 0f32), |(a, b), &s| (a.min(s), b.max(s)));
    println!(
        "{} vertices see from {least:.2} to {most:.2} of the sky, {mean:.2} on average",
        sky.len()
    );
    assert!(least < 0.3 && most > 0.95);
    if let Some(path) = std::env::args().nth(1) {
        write_ply(&path, &mesh, &sky)?;
    }
    Ok(())
}

fn grid(height: f32, half: f32, side: u32) -> Result<Mesh, MeshError> {
    let along = |i: u32| half * (2.0 * i as f32 / side as f32 - 1.0);
    let positions = (0..=side)
        .flat_map(|y| (0..=side).map(move |x| [along(x), along(y), height]))
        .collect();
    let at = |x: u32, y: u32| y * (side + 1) + x;
    let triangles = (0..side * side)
        .map(|i| (i % side, i / side))
        .flat_map(|(x, y)| {
            let (a, b, c, d) = (at(x, y), at(x + 1, y), at(x + 1, y + 1), at(x, y + 1));
            [[a, b, c], [a, c, d]]
        })
        .collect();
    Mesh::new(positions, triangles)
}

/// An ASCII PLY with grey vertices, for any viewer.
fn write_ply(path: &str, mesh: &Mesh, grey: &[f32]) -> Result<(), String> {
    let mut text = format!(
        "ply\nformat ascii 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n\
         property uchar red\nproperty uchar green\nproperty uchar blue\nelement face {}\n\
         property list uchar int vertex_indices\nend_header\n",
        grey.len(),
        mesh.triangles().len()
    );
    for ([x, y, z], g) in mesh.positions().iter().zip(grey) {
        let g = (g * 255.0) as u8;
        text += &format!("{x} {y} {z} {g} {g} {g}\n");
    }
    for [a, b, c] in mesh.triangles() {
        text += &format!("3 {a} {b} {c}\n");
    }
    shapes::write(path, text.as_bytes())
}
