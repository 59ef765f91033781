//! The watertight ray-triangle test [Woop2013].

use super::Ray;
use crate::query::Hit;

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
        let magnitude = [d[0].abs(), d[1].abs(), d[2].abs()];
        let kz = if magnitude[0] > magnitude[1] && magnitude[0] > magnitude[2] {
            0
        } else if magnitude[1] > magnitude[2] {
            1
        } else {
            2
        };
        let (kx, ky) = ((kz + 1) % 3, (kz + 2) % 3);
        Shear {
            axes: [kx, ky, kz],
            to_origin: [-ray.origin[kx], -ray.origin[ky], -ray.origin[kz]],
            shear: [d[kx] / d[kz], d[ky] / d[kz], 1.0 / d[kz]],
            along: d[kz],
        }
    }

    /// A point as the ray sees it: beside the ray along x and y, and z along it.
    #[inline(always)]
    pub(crate) fn apply(&self, p: [f32; 3]) -> [f32; 3] {
        let [kx, ky, kz] = self.axes;
        let [sx, sy, _] = self.shear;
        let [ox, oy, oz] = self.to_origin;
        let z = p[kz] + oz;
        [(p[kx] + ox) - sx * z, (p[ky] + oy) - sy * z, z]
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
        let [[ax, ay, _], [bx, by, _], [cx, cy, _]] = corners.map(|p| self.apply(p));
        let (u, v, w) = (cx * by - cy * bx, ax * cy - ay * cx, bx * ay - by * ax);
        if (u < 0.0 || v < 0.0 || w < 0.0) && (u > 0.0 || v > 0.0 || w > 0.0) {
            return None;
        }
        self.meet_exactly(corners, triangle)
    }

    /// The same, for a triangle that the f32 edge functions do not refuse.
    #[inline(always)]
    pub(crate) fn meet_exactly(&self, corners: &[[f32; 3]; 3], triangle: u32) -> Option<Hit> {
        let [a, b, c] = *corners;
        let [ax, ay, az] = self.apply(a);
        let [bx, by, bz] = self.apply(b);
        let [cx, cy, cz] = self.apply(c);
        let wide = |x: f32| f64::from(x);
        let (ax, ay, bx, by, cx, cy) = (wide(ax), wide(ay), wide(bx), wide(by), wide(cx), wide(cy));
        let u = cx * by - cy * bx;
        let v = ax * cy - ay * cx;
        let w = bx * ay - by * ax;
        // Both looked at together: which one it is is hard to foresee.
        let lower = |a: f64, b: f64| if a < b { a } else { b };
        let higher = |a: f64, b: f64| if a > b { a } else { b };
        if (lower(lower(u, v), w) < 0.0) & (higher(higher(u, v), w) > 0.0) {
            return None;
        }
        let determinant = u + v + w;
        if determinant == 0.0 || determinant.is_nan() {
            return None;
        }
        let depth = u * wide(az) + v * wide(bz) + w * wide(cz);
        Some(Hit {
            t: (depth * wide(self.shear[2]) / determinant) as f32,
            u: (v / determinant) as f32,
            v: (w / determinant) as f32,
            triangle,
        })
    }
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
