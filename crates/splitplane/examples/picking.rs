//! What is under the mouse: the first triangle of the ray through a pixel, the corner of it that
//! is nearest, and what lies behind it.
//!
//! `cargo run --example picking`

mod shapes;

use splitplane::{Hit, Mesh, Ray, Tree};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // Two tori, one behind the other.
    let (mesh, objects) = Mesh::join(&[
        shapes::torus([0.0, 0.0, 0.0], 1.0, 0.4, 48)?,
        shapes::torus([0.0, 0.0, -3.0], 1.0, 0.4, 48)?,
    ])?;
    let tree = Tree::new(&mesh)?;
    let object = |hit: &Hit| objects.locate(hit.triangle).0;

    // A camera at z = 5 that looks along -z, 640 x 480 pixels, 45 degrees high.
    let (width, height) = (640.0f32, 480.0f32);
    let ray_of = |x: f32, y: f32| {
        let scale = 2.0 * 22.5f32.to_radians().tan() / height;
        let direction = [(x - 0.5 * width) * scale, (0.5 * height - y) * scale, -1.0];
        Ray::new([0.0, 0.0, 5.0], direction)
    };

    let mut all = Vec::new();
    for (x, y) in [(320.5, 240.5), (430.5, 240.5), (320.5, 120.5), (10.5, 10.5)] {
        let ray = ray_of(x, y);
        let Some(hit) = tree.closest_hit(&ray, &mut ()) else {
            println!("pixel ({x}, {y}): nothing");
            continue;
        };
        let weights = [1.0 - hit.u - hit.v, hit.u, hit.v];
        let nearest = (0..3).max_by(|&i, &j| weights[i].total_cmp(&weights[j]));
        let vertex = mesh.triangles()[hit.triangle as usize][nearest.unwrap_or(0)];
        tree.all_hits(&ray, &mut all, &mut ());
        // Only the other object, as where the first is hidden by the user.
        let other = tree.closest_hit_where(&ray, |h| object(h) != object(&hit), &mut ());
        println!(
            "pixel ({x}, {y}): object {}, triangle {}, near vertex {vertex}, at {:.3?}; {} surfaces; \
             other object: {}",
            object(&hit),
            hit.triangle,
            ray.at(hit.t),
            all.len(),
            other.map_or("none".to_owned(), |h| format!("at t = {:.3}", h.t)),
        );
    }
    Ok(())
}
