//! What every tree must answer.

use super::Hit;
use crate::geometry::triangle::{Shear, plane_is_beyond};
use crate::geometry::{Mesh, Ray};

/// The nearest hit with `t_min < t <= t_max`, found by testing every triangle; of hits at the same
/// `t`, that with the lowest index. Every tree's [`closest_hit`](crate::Tree::closest_hit) is this,
/// bit for bit, and its [`any_hit`](crate::Tree::any_hit) says whether there is one.
pub fn brute_force(mesh: &Mesh, ray: &Ray) -> Option<Hit> {
    if !ray.is_valid() {
        return None;
    }
    let shear = Shear::of(ray);
    let mut best: Option<Hit> = None;
    for &triangle in mesh.usable_triangles() {
        let corners = mesh.corners(triangle);
        if let Some(hit) = shear.meet(&corners, triangle)
            && hit.t > ray.t_min
            && hit.t <= ray.t_max
            && best.is_none_or(|best| hit.t < best.t)
            && plane_is_beyond(ray, &corners)
        {
            best = Some(hit);
        }
    }
    best
}
