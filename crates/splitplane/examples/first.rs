//! The first lines of a program: those of the README.

use splitplane::{Mesh, Ray, Tree};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let positions = vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let mesh = Mesh::new(positions, vec![[0, 1, 2]])?; // three indices a triangle
    let tree = Tree::new(&mesh)?;
    let ray = Ray::new([0.25, 0.25, 1.0], [0.0, 0.0, -1.0]); // origin, direction
    if let Some(hit) = tree.closest_hit(&ray, &mut ()) {
        println!("triangle {} at t = {}", hit.triangle, hit.t);
    }
    Ok(())
}
