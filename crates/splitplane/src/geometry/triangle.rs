//! The watertight ray-triangle test [Woop2013].

use std::ops::{Add, Div, Mul, Sub};

use super::Ray;
use crate::query::Hit;

/// The axes that become x, y and z, by the one that becomes z.
const AXES: [[usize; 3]; 3] = [[1, 2, 0], [2, 0, 1], [0, 1, 2]];

/// What of the test depends on the ray alone: a shear that turns the ray into the z axis.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Shear {
    /// The axes that become x, y and z: z is the one along which the ray goes furthest.
    pub(crate) axes: [usize; 3],
    /// What takes points to where the origin is 0, along these axes.
    pub(crate) to_origin: [f32; 3],
    pub(crate) shear: [f32; 3],
    /// The direction's largest component.
    pub(crate) along: f32,
}

impl Shear {
    #[inline(always)]
    pub(crate) fn of(ray: &Ray) -> Self {
        let d = ray.direction;
        let [x, y, z] = d.map(f32::abs);
        // Without branches: rays go anywhere, so which one would be taken is hard to foresee.
        let beyond_x = 2 - usize::from(y > z);
        let kz = beyond_x * usize::from(!((x > y) & (x > z)));
        let axes @ [kx, ky, kz] = AXES[kz];
        Shear {
            axes,
            to_origin: [-ray.origin[kx], -ray.origin[ky], -ray.origin[kz]],
            shear: [d[kx] / d[kz], d[ky] / d[kz], 1.0 / d[kz]],
            along: d[kz],
        }
    }

    /// Points as the ray sees them, beside the ray along x and y, and z along it, of their
    /// coordinates along its axes. Rows of an axis, for each of three points.
    #[inline(always)]
    fn apply(&self, [x, y, z]: [[f32; 3]; 3]) -> [[f32; 3]; 3] {
        let [sx, sy, _] = self.shear;
        let [ox, oy, oz] = self.to_origin;
        let z = [z[0] + oz, z[1] + oz, z[2] + oz];
        [beside(x, ox, sx, z), beside(y, oy, sy, z), z]
    }

    /// Where the ray's line meets the triangle of these corners, whatever the ray's interval;
    /// `triangle` is only passed on.
    ///
    /// The signs of the edge functions are exact for the sheared f32 vertices: a rounded product
    /// never changes the order of two products, and where two rounded products are equal, f64
    /// decides, in which they are exact. So no ray slips between two triangles that share an edge.
    ///
    /// **Differs from the paper:** t, u and v are computed in f64 from the sheared vertices. In
    /// f32 the t of a triangle that is seen edge-on can be off by much more than the rounding of
    /// its vertices, and a traversal that relies on t would then end too early.
    #[inline(always)]
    pub(crate) fn meet(&self, corners: &[[f32; 3]; 3], triangle: u32) -> Option<Hit> {
        let along = self.axes.map(|axis| corners.map(|p| p[axis]));
        let [x, y, _] = self.apply(along);
        let [u, v, w] = edges(x, y);
        if (u < 0.0 || v < 0.0 || w < 0.0) && (u > 0.0 || v > 0.0 || w > 0.0) {
            return None;
        }
        self.meet_exactly(along, triangle)
    }

    /// The same, for a triangle that the f32 edge functions do not refuse; of its corners the
    /// coordinates along the axes of the shear, rows of an axis.
    #[inline(always)]
    pub(crate) fn meet_exactly(&self, along: [[f32; 3]; 3], triangle: u32) -> Option<Hit> {
        let [x, y, z] = self.apply(along);
        let edges @ [u, v, w] = edges(wide(x), wide(y));
        // Both looked at together: which one it is is hard to foresee.
        let lower = |a: f64, b: f64| if a < b { a } else { b };
        let higher = |a: f64, b: f64| if a > b { a } else { b };
        if (lower(lower(u, v), w) < 0.0) & (higher(higher(u, v), w) > 0.0) {
            return None;
        }
        let determinant = determinant(edges);
        if determinant == 0.0 || determinant.is_nan() {
            return None;
        }
        let [t, u, v] = place(edges, determinant, wide(z), f64::from(self.shear[2]));
        Some(Hit {
            t: t as f32,
            u: u as f32,
            v: v as f32,
            triangle,
        })
    }
}

/// The edge functions of sheared corners, opposite to them; exact in f64. Of one triangle or of many
/// side by side.
#[inline(always)]
pub(crate) fn edges<N: Copy + Mul<Output = N> + Sub<Output = N>>(
    [ax, bx, cx]: [N; 3],
    [ay, by, cy]: [N; 3],
) -> [N; 3] {
    [cx * by - cy * bx, ax * cy - ay * cx, bx * ay - by * ax]
}

#[inline(always)]
pub(crate) fn determinant<N: Add<Output = N>>([u, v, w]: [N; 3]) -> N {
    u + v + w
}

/// t, u and v of a hit; `inverse` is one over the direction's largest component.
#[inline(always)]
pub(crate) fn place<N: Copy + Add<Output = N> + Mul<Output = N> + Div<Output = N>>(
    [u, v, w]: [N; 3],
    determinant: N,
    [az, bz, cz]: [N; 3],
    inverse: N,
) -> [N; 3] {
    let depth = u * az + v * bz + w * cz;
    [
        depth * inverse / determinant,
        v / determinant,
        w / determinant,
    ]
}

/// Where points are beside the ray along an axis, from where they are along the ray.
#[inline(always)]
fn beside(along: [f32; 3], to_origin: f32, shear: f32, z: [f32; 3]) -> [f32; 3] {
    [
        (along[0] + to_origin) - shear * z[0],
        (along[1] + to_origin) - shear * z[1],
        (along[2] + to_origin) - shear * z[2],
    ]
}

#[inline(always)]
fn wide([a, b, c]: [f32; 3]) -> [f64; 3] {
    [f64::from(a), f64::from(b), f64::from(c)]
}

/// Whether the plane of the triangle of these corners is met beyond the ray's `t_min`.
///
/// The shear rounds by more than the distance that a ray's origin may have from a surface that it
/// leaves. At a small angle to a large triangle, [`Shear::meet`] then finds the surface again, at a
/// small positive t. In f64, from the unsheared vertices, the side of the plane that the origin is
/// on is right. This only ever refuses hits, so it does not widen where a traversal must look.
#[inline]
pub(crate) fn plane_is_beyond(ray: &Ray, corners: &[[f32; 3]; 3]) -> bool {
    let o = ray.origin.map(f64::from);
    let [a, b, c] = corners.map(|p| difference(p.map(f64::from), o));
    let normal = cross(difference(b, a), difference(c, a));
    dot(normal, a) / dot(normal, ray.direction.map(f64::from)) > f64::from(ray.t_min)
}

#[inline(always)]
pub(crate) fn difference(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

#[inline(always)]
pub(crate) fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline(always)]
pub(crate) fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    const CORNERS: [[f32; 3]; 3] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];

    #[test]
    fn the_weights_belong_to_the_second_and_third_vertex() {
        let ray = Ray::new([0.5, 0.125, 2.0], [0.0, 0.0, -2.0]);
        let hit = Shear::of(&ray).meet(&CORNERS, 7).unwrap();
        assert_eq!(
            hit,
            Hit {
                t: 1.0,
                u: 0.5,
                v: 0.125,
                triangle: 7
            }
        );
    }

    #[test]
    fn a_ray_does_not_hit_the_large_triangle_that_it_leaves() {
        // The origin is four units in the last place above the triangle, as a renderer puts it.
        let corners = [[-50.0, -50.0, 1.0], [50.0, -50.0, 1.0], [50.0, 50.0, 1.0]];
        let origin = [1.3, -2.7, 1.0 + 4.0 * f32::EPSILON];
        let mut found_by_the_shear_alone = 0;
        for i in 0..1000u16 {
            let angle = f32::from(i) * 0.01;
            let ray = Ray::new(origin, [angle.cos(), angle.sin(), 0.2 + 1e-3 * angle]);
            let shear = Shear::of(&ray);
            let hit = shear.meet(&corners, 0).filter(|hit| hit.t > 0.0);
            found_by_the_shear_alone += u32::from(hit.is_some());
            assert!(!plane_is_beyond(&ray, &corners));
        }
        assert!(found_by_the_shear_alone > 0);
        let back = Ray::new(origin, [0.5, 0.1, -0.2]);
        assert!(plane_is_beyond(&back, &corners));
    }

    #[test]
    fn both_sides_and_every_major_axis_hit() {
        for axis in 0..3 {
            for sign in [1.0, -1.0] {
                let turn = |p: [f32; 3]| {
                    let mut q = [0.0; 3];
                    for i in 0..3 {
                        q[(i + axis) % 3] = p[i];
                    }
                    q
                };
                let ray = Ray::new(turn([0.2, 0.3, -sign]), turn([0.0, 0.0, sign]));
                let hit = Shear::of(&ray).meet(&CORNERS.map(turn), 0).unwrap();
                assert_eq!((hit.t, hit.u, hit.v), (1.0, 0.2, 0.3));
            }
        }
    }

    #[test]
    fn an_edge_and_a_vertex_belong_to_the_triangle() {
        for (x, y) in [
            (0.5, 0.0),
            (0.0, 0.5),
            (0.5, 0.5),
            (0.0, 0.0),
            (1.0, 0.0),
            (0.0, 1.0),
        ] {
            let ray = Ray::new([x, y, 1.0], [0.0, 0.0, -1.0]);
            assert!(Shear::of(&ray).meet(&CORNERS, 0).is_some(), "({x}, {y})");
        }
    }

    #[test]
    fn a_triangle_seen_edge_on_is_missed() {
        let ray = Ray::new([-1.0, 0.25, 0.0], [1.0, 0.0, 0.0]);
        assert_eq!(Shear::of(&ray).meet(&CORNERS, 0), None);
    }
}
