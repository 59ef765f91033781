//! What of a triangle lies in a cell, and the box around it.

use glam::DVec3;

use crate::geometry::Aabb;
use crate::geometry::frame::round_outward;
use crate::geometry::polygon::Polygon;

/// A half-space: the points with `normal · x <= offset`.
#[derive(Clone, Copy, Debug)]
pub(super) struct HalfSpace {
    pub(super) normal: DVec3,
    pub(super) offset: f64,
}

/// The box around the part of a triangle that lies in all `half_spaces`, widened by `reach` times
/// the rounding of f64; empty if there is none.
pub(super) fn clipped_box(corners: &[[f32; 3]; 3], half_spaces: &[HalfSpace], reach: f64) -> Aabb {
    let points = corners.map(|p| glam::Vec3::from(p).as_dvec3());
    let mut polygon = Polygon::new(&points);
    for half_space in half_spaces {
        polygon.cut(|p| half_space.normal.dot(p) - half_space.offset);
    }
    let own = Aabb::of_points(*corners);
    if polygon.corners() == points {
        return own;
    }
    let Some((min, max)) = polygon.bounds() else {
        return Aabb::EMPTY;
    };
    // Rounding must not widen what was whole.
    round_outward(min, max, reach).intersection(&own)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::point;
    use proptest::prelude::*;

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
