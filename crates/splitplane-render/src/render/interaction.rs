//! Where a ray meets a surface: geometry with error bounds, and frames to scatter in
//! [PBRT3, 3.6, 3.9].

use glam::{Vec2, Vec3};
use splitplane::{Hit, Mesh, Ray};

use super::sampling::frame_around;
use crate::scene::{Scene, Shape};

/// Shadow rays end this part of their length before the light.
const SHADOW_EPSILON: f32 = 0.0001;

/// A point that rays begin or end at: on a surface, or (with zero normal) anywhere.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    pub(super) p: Vec3,
    /// How far `p` may be off the surface in each coordinate, by rounding.
    pub(super) error: Vec3,
    /// Geometric normal, on the shading normal's side.
    pub(super) normal: Vec3,
}

impl Place {
    /// Not on a surface.
    pub(super) fn free(p: Vec3) -> Self {
        Place {
            p,
            error: Vec3::ZERO,
            normal: Vec3::ZERO,
        }
    }

    /// On the triangle of these vertices, at their weighted mean.
    fn on(weights: [f32; 3], vertices: [Vec3; 3], normal: Vec3) -> Self {
        Place {
            p: mix(weights, vertices),
            error: gamma(7) * absolute_sum(weights, vertices),
            normal,
        }
    }

    /// The ray that leaves along `direction`.
    pub(super) fn ray(&self, direction: Vec3) -> Ray {
        Ray::new(self.leave(direction).into(), direction.into())
    }

    /// The ray that reaches `target` at t = 1, and ends a little before it.
    pub(super) fn ray_to(&self, target: &Place) -> Ray {
        let origin = self.leave(target.p - self.p);
        let end = target.leave(origin - target.p);
        Ray {
            t_max: 1.0 - SHADOW_EPSILON,
            ..Ray::new(origin.into(), (end - origin).into())
        }
    }

    /// A point beside `p` that is surely on the side of the surface that `direction` goes to
    /// [PBRT3, 3.9.5].
    fn leave(&self, direction: Vec3) -> Vec3 {
        let distance = self.normal.abs().dot(self.error);
        let offset = if direction.dot(self.normal) < 0.0 {
            -distance * self.normal
        } else {
            distance * self.normal
        };
        let away = |c: f32, offset: f32| {
            if offset > 0.0 {
                c.next_up()
            } else if offset < 0.0 {
                c.next_down()
            } else {
                c
            }
        };
        let p = self.p + offset;
        Vec3::new(
            away(p.x, offset.x),
            away(p.y, offset.y),
            away(p.z, offset.z),
        )
    }
}

/// The ray that leaves the surface along `direction` from where another ray hit it, as all rays of
/// the renderer do: it begins so far off the surface that it does not meet its own triangle again
/// \[PBRT3, 3.9.5\].
pub fn leave(mesh: &Mesh, hit: &Hit, direction: [f32; 3]) -> Ray {
    let weights = [1.0 - hit.u - hit.v, hit.u, hit.v];
    let vertices = mesh.corners(hit.triangle).map(Vec3::from);
    let normal = mesh.normal(hit.triangle).into();
    Place::on(weights, vertices, normal).ray(direction.into())
}

/// A bound on the relative error of `n` roundings [Higham2002].
pub(super) const fn gamma(n: u32) -> f32 {
    let half_ulp = f32::EPSILON / 2.0;
    n as f32 * half_ulp / (1.0 - n as f32 * half_ulp)
}

/// All that is known of a hit.
#[derive(Clone, Copy, Debug)]
pub(super) struct Interaction {
    pub(super) place: Place,
    /// Towards where the ray came from; as long as the ray's direction.
    pub(super) wo: Vec3,
    pub(super) uv: Vec2,
    /// Along growing u.
    pub(super) dpdu: Vec3,
    /// Frame to scatter in: `shading_normal` and two unit tangents.
    pub(super) shading_normal: Vec3,
    pub(super) tangents: [Vec3; 2],
    pub(super) triangle: u32,
}

impl Interaction {
    /// `shape` is the one that `hit.triangle` belongs to.
    pub(super) fn new(scene: &Scene, shape: &Shape, ray: &Ray, hit: &Hit) -> Self {
        let indices = scene.mesh.triangles()[hit.triangle as usize].map(|i| i as usize);
        let p = scene.mesh.corners(hit.triangle).map(Vec3::from);
        let weights = [1.0 - hit.u - hit.v, hit.u, hit.v];
        let uvs = if shape.has_uvs {
            indices.map(|i| Vec2::from(scene.uvs[i]))
        } else {
            [Vec2::ZERO, Vec2::X, Vec2::ONE]
        };
        let (dp02, dp12) = (p[0] - p[2], p[1] - p[2]);
        let dpdu = along_u(dp02, dp12, uvs).unwrap_or_else(|| {
            frame_around((p[2] - p[0]).cross(p[1] - p[0]).normalize_or_zero()).0
        });

        let mut normal = dp02.cross(dp12).normalize_or_zero();
        let shading = if shape.has_normals {
            let n = indices.map(|i| Vec3::from(scene.normals[i]));
            mix(weights, n).try_normalize()
        } else {
            None
        };
        if let Some(shading) = shading {
            normal = if normal.dot(shading) < 0.0 {
                -normal
            } else {
                normal
            };
        } else if shape.flip_normals {
            normal = -normal;
        }
        let shading_normal = shading.unwrap_or(normal);
        let mut s = dpdu.normalize_or_zero();
        if shading.is_some() {
            // pbrt-v3 turns the tangent around wherever there are shading normals.
            s = match s.cross(shading_normal).try_normalize() {
                Some(t) => t.cross(shading_normal),
                None => frame_around(shading_normal).0,
            };
        }
        Interaction {
            place: Place::on(weights, p, normal),
            wo: -Vec3::from(ray.direction),
            uv: weights[0] * uvs[0] + weights[1] * uvs[1] + weights[2] * uvs[2],
            dpdu,
            shading_normal,
            tangents: [s, shading_normal.cross(s)],
            triangle: hit.triangle,
        }
    }
}

fn mix(weights: [f32; 3], v: [Vec3; 3]) -> Vec3 {
    weights[0] * v[0] + weights[1] * v[1] + weights[2] * v[2]
}

/// What the error of [`mix`] is bounded by, up to a factor.
pub(super) fn absolute_sum(weights: [f32; 3], v: [Vec3; 3]) -> Vec3 {
    (weights[0] * v[0]).abs() + (weights[1] * v[1]).abs() + (weights[2] * v[2]).abs()
}

/// The derivative of a triangle's points by u; `None` where the texture coordinates leave it
/// undefined.
fn along_u(dp02: Vec3, dp12: Vec3, uvs: [Vec2; 3]) -> Option<Vec3> {
    let (d02, d12) = (uvs[0] - uvs[2], uvs[1] - uvs[2]);
    let determinant = d02.x * d12.y - d02.y * d12.x;
    if determinant.abs() < 1e-8 {
        return None;
    }
    let inverse = 1.0 / determinant;
    let dpdu = (d12.y * dp02 - d02.y * dp12) * inverse;
    let dpdv = (d02.x * dp12 - d12.x * dp02) * inverse;
    (dpdu.cross(dpdv).length_squared() != 0.0).then_some(dpdu)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rays_leave_to_the_side_that_they_go_to() {
        let place = Place {
            p: Vec3::new(1e3, 2.0, -5.0),
            error: Vec3::splat(1e-3),
            normal: Vec3::new(0.6, 0.0, 0.8),
        };
        for direction in [Vec3::Z, -Vec3::Z, Vec3::X, Vec3::new(-1.0, 5.0, 0.1)] {
            let start = Vec3::from(place.ray(direction).origin);
            let side = (start - place.p).dot(place.normal);
            assert!(side * direction.dot(place.normal) > 0.0);
            assert!(side.abs() < 3e-3);
        }
    }

    #[test]
    fn rays_between_places_end_before_the_second_surface() {
        let at = |z: f32, normal| Place {
            p: Vec3::new(0.0, 0.0, z),
            error: Vec3::splat(1e-6),
            normal,
        };
        let ray = at(0.0, Vec3::Z).ray_to(&at(2.0, Vec3::Z));
        assert!(ray.origin[2] > 0.0 && ray.at(ray.t_max)[2] < 2.0 && ray.at(1.0)[2] > 1.999);
        let free = at(0.0, Vec3::Z).ray_to(&Place::free(Vec3::Y));
        assert_eq!(free.at(1.0)[1], 1.0);
    }

    #[test]
    fn default_coordinates_grow_along_the_first_edge() {
        let (p0, p1, p2) = (Vec3::ZERO, 2.0 * Vec3::X, Vec3::new(2.0, 3.0, 0.0));
        let uvs = [Vec2::ZERO, Vec2::X, Vec2::ONE];
        assert_eq!(along_u(p0 - p2, p1 - p2, uvs), Some(2.0 * Vec3::X));
        assert_eq!(along_u(p0 - p2, p1 - p2, [Vec2::ONE; 3]), None);
    }
}
