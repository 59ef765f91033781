//! What of a triangle lies in a cell, and the box around it.

use glam::DVec3;

use crate::geometry::Aabb;
use crate::geometry::frame::round_outward;

/// A half-space: the points with `normal · x <= offset`.
#[derive(Clone, Copy, Debug)]
pub(super) struct HalfSpace {
    pub(super) normal: DVec3,
    pub(super) offset: f64,
}

/// The most corners of a polygon that is cut; beyond, the rest of the cuts are left out, which
/// gives a larger box.
const MAX_CORNERS: usize = 24;

/// A convex polygon: a triangle, cut.
#[derive(Clone, Copy)]
struct Polygon {
    corners: [DVec3; MAX_CORNERS],
    count: usize,
}

impl Polygon {
    fn cut(&self, half_space: &HalfSpace) -> Polygon {
        let mut part = Polygon {
            corners: [DVec3::ZERO; MAX_CORNERS],
            count: 0,
        };
        let mut add = |p: DVec3| {
            part.corners[part.count] = p;
            part.count += 1;
        };
        let corners = &self.corners[..self.count];
        let height = |p: DVec3| half_space.normal.dot(p) - half_space.offset;
        let mut p = corners[corners.len() - 1];
        let mut h = height(p);
        for &q in corners {
            let k = height(q);
            if (h <= 0.0) != (k <= 0.0) {
                add(p + (q - p) * (h / (h - k)));
            }
            if k <= 0.0 {
                add(q);
            }
            (p, h) = (q, k);
        }
        part
    }
}

/// The box around the part of a triangle that lies in all `half_spaces`, widened by `reach` times
/// the rounding of f64; empty if there is none.
pub(super) fn clipped_box(corners: &[[f32; 3]; 3], half_spaces: &[HalfSpace], reach: f64) -> Aabb {
    let points = corners.map(|p| glam::Vec3::from(p).as_dvec3());
    let mut polygon = Polygon {
        corners: [DVec3::ZERO; MAX_CORNERS],
        count: 3,
    };
    polygon.corners[..3].copy_from_slice(&points);
    let mut is_cut = false;
    for half_space in half_spaces {
        let outside = |p: &DVec3| half_space.normal.dot(*p) > half_space.offset;
        if !points.iter().any(outside) || polygon.count + 1 > MAX_CORNERS {
            continue;
        }
        is_cut = true;
        polygon = polygon.cut(half_space);
        if polygon.count == 0 {
            return Aabb::EMPTY;
        }
    }
    if !is_cut {
        return Aabb::of_points(*corners);
    }
    let corners = &polygon.corners[..polygon.count];
    let min = corners.iter().copied().reduce(DVec3::min);
    let max = corners.iter().copied().reduce(DVec3::max);
    match (min, max) {
        (Some(min), Some(max)) => {
            let cut = round_outward(min, max, reach);
            let own = Aabb::of_points(points.map(|p| p.as_vec3().into()));
            // Rounding must not widen what was whole.
            Aabb {
                min: std::array::from_fn(|i| cut.min[i].max(own.min[i])),
                max: std::array::from_fn(|i| cut.max[i].min(own.max[i])),
            }
        }
        _ => Aabb::EMPTY,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn point() -> impl Strategy<Value = [f32; 3]> {
        prop::array::uniform3(prop_oneof![-1.0f32..1.0, (-2i8..=2).prop_map(f32::from)])
    }

    proptest! {
        #![proptest_config(crate::testing::cases(2_000))]

        /// Points of the triangle that are in the cell are in the box, and the box is no larger
        /// than the triangle's.
        #[test]
        fn a_box_holds_what_is_in_the_cell(
            corners in prop::array::uniform3(point()),
            planes in prop::collection::vec((point(), -1.0f64..1.0), 0..30),
            weights in prop::collection::vec((0.0f64..1.0, 0.0f64..1.0), 50),
        ) {
            let half_spaces: Vec<HalfSpace> = planes
                .iter()
                .map(|(n, offset)| HalfSpace { normal: glam::Vec3::from(*n).as_dvec3(), offset: *offset })
                .collect();
            let found = clipped_box(&corners, &half_spaces, 4.0);
            let own = Aabb::of_points(corners);
            if !found.is_empty() {
                prop_assert_eq!(own.union(&found), own);
            }
            let [a, b, c] = corners.map(|p| glam::Vec3::from(p).as_dvec3());
            for (u, v) in weights {
                let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
                let p = a + (b - a) * u + (c - a) * v;
                if half_spaces.iter().all(|h| h.normal.dot(p) <= h.offset - 1e-12) {
                    for i in 0..3 {
                        let (low, high) = (f64::from(found.min[i]), f64::from(found.max[i]));
                        prop_assert!(low - 1e-14 <= p[i] && p[i] <= high + 1e-14, "{p} {found:?}");
                    }
                }
            }
        }
    }
}
