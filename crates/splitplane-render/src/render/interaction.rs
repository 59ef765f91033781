//! Where a ray meets a surface: geometry with error bounds, and frames to scatter in
//! [PBRT3, 3.6, 3.9].

use glam::{Vec2, Vec3};
use splitplane::{Hit, InstanceHit, Mesh, Ray};

use super::camera::Beside;
use super::part::{InPlace, Part};
use super::sampling::frame_around;
use super::texture::{Footprint, Spot};
use crate::scene::{Shape, Surface};

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

    /// The same, and so much further off.
    fn with_error(self, error: Vec3) -> Self {
        Place {
            error: self.error + error,
            ..self
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
    /// The vertices' colours, between them.
    pub(super) color: Vec3,
    pub(super) footprint: Footprint,
    /// Along growing u and v.
    pub(super) dpdu: Vec3,
    pub(super) dpdv: Vec3,
    /// Frame to scatter in: `shading_normal` and two unit tangents.
    pub(super) shading_normal: Vec3,
    pub(super) tangents: [Vec3; 2],
    /// Along growing u and v, as bump maps see it. Where a mesh has shading normals pbrt-v3 has
    /// unit vectors here.
    shading_dpduv: [Vec3; 2],
    /// How the shading normal changes with u and v.
    pub(super) dnduv: [Vec3; 2],
    /// 0: the scene's own mesh; else 1 + the index of the instance.
    pub(super) instance: u32,
    pub(super) triangle: u32,
}

impl Interaction {
    /// `shape` is the one of the part that the triangle belongs to.
    pub(super) fn new(at: InPlace<'_>, shape: &Shape, ray: &Ray, found: &InstanceHit) -> Self {
        let InstanceHit { hit, instance } = found;
        let part = at.part;
        let indices = part.mesh.triangles()[hit.triangle as usize].map(|i| i as usize);
        let (p, error) = at.corners(hit.triangle);
        let weights = [1.0 - hit.u - hit.v, hit.u, hit.v];
        let uvs = corner_uvs(part, shape, indices);
        let (dp02, dp12) = (p[0] - p[2], p[1] - p[2]);
        let (dpdu, dpdv) = along_uv(dp02, dp12, uvs)
            .filter(|(dpdu, dpdv)| dpdu.cross(*dpdv).length_squared() != 0.0)
            .unwrap_or_else(|| frame_around((p[2] - p[0]).cross(p[1] - p[0]).normalize_or_zero()));

        let mut normal = dp02.cross(dp12).normalize_or_zero();
        let mut dnduv = [Vec3::ZERO; 2];
        let shading = if shape.has_normals {
            let n = indices.map(|i| at.normal(i));
            if let Some((dndu, dndv)) = along_uv(n[0] - n[2], n[1] - n[2], uvs) {
                dnduv = [dndu, dndv];
            }
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
        } else if at.flips(shape) {
            normal = -normal;
        }
        let shading_normal = shading.unwrap_or(normal);
        let mut s = dpdu.normalize_or_zero();
        let mut shading_dpduv = [dpdu, dpdv];
        if shading.is_some() {
            if shape.surface == Surface::Flat {
                // pbrt-v3 turns the tangent around wherever there are shading normals.
                s = match s.cross(shading_normal).try_normalize() {
                    Some(t) => t.cross(shading_normal),
                    None => frame_around(shading_normal).0,
                };
                shading_dpduv = [s, shading_normal.cross(s)];
            } else {
                let level = |v: Vec3| v - v.dot(shading_normal) * shading_normal;
                shading_dpduv = shading_dpduv.map(level);
                s = shading_dpduv[0]
                    .try_normalize()
                    .unwrap_or_else(|| frame_around(shading_normal).0);
            }
        }
        Interaction {
            place: Place::on(weights, p, normal).with_error(gamma(7) * error),
            wo: -Vec3::from(ray.direction),
            uv: weights[0] * uvs[0] + weights[1] * uvs[1] + weights[2] * uvs[2],
            color: if part.colors.is_empty() {
                Vec3::ONE
            } else {
                mix(weights, indices.map(|i| Vec3::from(part.colors[i])))
            },
            footprint: Footprint::default(),
            dpdu,
            dpdv,
            shading_normal,
            tangents: [s, shading_normal.cross(s)],
            shading_dpduv,
            dnduv,
            instance: *instance,
            triangle: hit.triangle,
        }
    }

    /// As textures see the place.
    pub(super) fn spot(&self) -> Spot {
        Spot {
            p: self.place.p,
            uv: self.uv,
            color: self.color,
            footprint: self.footprint,
        }
    }

    /// How far the place moves to that of the rays beside [PBRT3, 10.1.1].
    pub(super) fn set_footprint(&mut self, beside: &[Beside; 2]) {
        let n = self.place.normal;
        let d = n.dot(self.place.p);
        let meet = |b: &Beside| {
            let t = (d - n.dot(b.origin)) / n.dot(b.direction);
            t.is_finite()
                .then(|| b.origin + t * b.direction - self.place.p)
        };
        let (Some(dpdx), Some(dpdy)) = (meet(&beside[0]), meet(&beside[1])) else {
            return;
        };
        // Two equations of three: those of the axes along which the surface lies most.
        let abs = n.abs();
        let axes = if abs.x > abs.y && abs.x > abs.z {
            [1, 2]
        } else if abs.y > abs.z {
            [0, 2]
        } else {
            [0, 1]
        };
        let [u, v] = [self.dpdu, self.dpdv].map(|d| Vec2::new(d[axes[0]], d[axes[1]]));
        let determinant = u.perp_dot(v);
        let solve = |dp: Vec3| {
            let dp = Vec2::new(dp[axes[0]], dp[axes[1]]);
            let duv = Vec2::new(dp.perp_dot(v), u.perp_dot(dp)) / determinant;
            if determinant.abs() < 1e-10 || !duv.is_finite() {
                Vec2::ZERO
            } else {
                duv
            }
        };
        self.footprint = Footprint {
            dpdx,
            dpdy,
            duvdx: solve(dpdx),
            duvdy: solve(dpdy),
        };
    }

    /// Turns the frame as if the surface were raised by `height` [PBRT3, 9.3].
    pub(super) fn bump(&mut self, height: impl Fn(&Spot) -> f32) {
        /// Where there is no footprint.
        const STEP: f32 = 0.0005;
        let here = self.spot();
        let level = height(&here);
        let n = self.shading_normal;
        let raised = |axis: usize| {
            let step = 0.5 * (here.footprint.duvdx[axis].abs() + here.footprint.duvdy[axis].abs());
            let step = if step == 0.0 { STEP } else { step };
            let mut there = here;
            there.p += step * self.shading_dpduv[axis];
            there.uv[axis] += step;
            let slope = (height(&there) - level) / step;
            self.shading_dpduv[axis] + slope * n + level * self.dnduv[axis]
        };
        let [dpdu, dpdv] = [raised(0), raised(1)];
        let Some(mut normal) = dpdu.cross(dpdv).try_normalize() else {
            return;
        };
        if normal.dot(self.place.normal) < 0.0 {
            normal = -normal;
        }
        self.shading_normal = normal;
        self.shading_dpduv = [dpdu, dpdv];
        let s = dpdu.normalize_or_zero();
        self.tangents = [s, normal.cross(s)];
    }
}

/// A place on a triangle, for textures that decide whether there is anything.
pub(super) fn spot_of(at: InPlace<'_>, shape: &Shape, hit: &Hit) -> Spot {
    let indices = at.part.mesh.triangles()[hit.triangle as usize].map(|i| i as usize);
    let (p, _) = at.corners(hit.triangle);
    let weights = [1.0 - hit.u - hit.v, hit.u, hit.v];
    let uvs = corner_uvs(at.part, shape, indices);
    let uv = weights[0] * uvs[0] + weights[1] * uvs[1] + weights[2] * uvs[2];
    Spot::point(mix(weights, p), uv)
}

fn corner_uvs(part: &Part<'_>, shape: &Shape, indices: [usize; 3]) -> [Vec2; 3] {
    if shape.has_uvs {
        indices.map(|i| Vec2::from(part.uvs[i]))
    } else {
        [Vec2::ZERO, Vec2::X, Vec2::ONE]
    }
}

fn mix(weights: [f32; 3], v: [Vec3; 3]) -> Vec3 {
    weights[0] * v[0] + weights[1] * v[1] + weights[2] * v[2]
}

/// What the error of [`mix`] is bounded by, up to a factor.
pub(super) fn absolute_sum(weights: [f32; 3], v: [Vec3; 3]) -> Vec3 {
    (weights[0] * v[0]).abs() + (weights[1] * v[1]).abs() + (weights[2] * v[2]).abs()
}

/// The derivatives by u and v of what has the differences `d02` and `d12` along a triangle's edges;
/// `None` where the texture coordinates leave them undefined.
fn along_uv(d02: Vec3, d12: Vec3, uvs: [Vec2; 3]) -> Option<(Vec3, Vec3)> {
    let (uv02, uv12) = (uvs[0] - uvs[2], uvs[1] - uvs[2]);
    let determinant = uv02.x * uv12.y - uv02.y * uv12.x;
    if determinant.abs() < 1e-8 {
        return None;
    }
    let inverse = 1.0 / determinant;
    let du = (uv12.y * d02 - uv02.y * d12) * inverse;
    let dv = (uv02.x * d12 - uv12.x * d02) * inverse;
    Some((du, dv))
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
        let derivatives = along_uv(p0 - p2, p1 - p2, uvs);
        assert_eq!(derivatives, Some((2.0 * Vec3::X, 3.0 * Vec3::Y)));
        assert_eq!(along_uv(p0 - p2, p1 - p2, [Vec2::ONE; 3]), None);
    }
}
