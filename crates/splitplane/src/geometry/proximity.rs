//! Distances and overlaps of a triangle, in f64.

use super::triangle::{cross, difference, dot};

/// The point of a triangle that is nearest to another point.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Nearest {
    /// The square of the distance.
    pub(crate) squared: f64,
    pub(crate) point: [f64; 3],
    /// The weights of the second and the third vertex.
    pub(crate) weights: [f64; 2],
}

/// The point of a triangle nearest to `p`: its foot on the plane where that is inside, else the
/// nearest point of an edge, the first of equals. A thin triangle's foot may be badly placed by
/// rounding, but it is then a point of an edge as well, up to the same rounding.
pub(crate) fn nearest_on_triangle(p: [f64; 3], corners: &[[f32; 3]; 3]) -> Nearest {
    let [a, b, c] = corners.map(|corner| corner.map(f64::from));
    let (ab, ac, ap) = (difference(b, a), difference(c, a), difference(p, a));
    let at = |u: f64, v: f64| {
        let point = std::array::from_fn(|i| a[i] + u * ab[i] + v * ac[i]);
        let offset = difference(p, point);
        Nearest {
            squared: dot(offset, offset),
            point,
            weights: [u, v],
        }
    };
    let normal = cross(ab, ac);
    let length = dot(normal, normal);
    let u = dot(cross(ap, ac), normal);
    let v = dot(cross(ab, ap), normal);
    if u >= 0.0 && v >= 0.0 && u + v <= length && length > 0.0 {
        return at(u / length, v / length);
    }
    let along = |start: [f64; 3], edge: [f64; 3]| {
        let share = dot(difference(p, start), edge) / dot(edge, edge);
        // Not a number where the edge has no length.
        if share > 0.0 { share.min(1.0) } else { 0.0 }
    };
    let (s, t, r) = (along(a, ab), along(a, ac), along(b, difference(c, b)));
    [at(s, 0.0), at(0.0, t), at(1.0 - r, r)]
        .into_iter()
        .reduce(|best, other| {
            if other.squared < best.squared {
                other
            } else {
                best
            }
        })
        .expect("a triangle has three edges")
}

/// Whether a triangle and a box have a point in common, their surfaces included: no axis
/// separates them [AkenineMoeller2001]. The box is given by its centre and half its extent.
pub(crate) fn overlaps_box(corners: &[[f32; 3]; 3], center: [f64; 3], half: [f64; 3]) -> bool {
    let [a, b, c] = corners.map(|p| difference(p.map(f64::from), center));
    let edges = [difference(b, a), difference(c, b), difference(a, c)];
    let separates = |axis: [f64; 3]| {
        let [p, q, r] = [a, b, c].map(|corner| dot(axis, corner));
        let radius: f64 = (0..3).map(|i| half[i] * axis[i].abs()).sum();
        p.min(q).min(r) > radius || p.max(q).max(r) < -radius
    };
    let unit = |i: usize| std::array::from_fn(|j| f64::from(u8::from(i == j)));
    !(0..3).any(|i| separates(unit(i)))
        && !separates(cross(edges[0], edges[1]))
        && !(edges.iter()).any(|&edge| (0..3).any(|i| separates(cross(unit(i), edge))))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn coordinate() -> impl Strategy<Value = f32> {
        prop_oneof![-1.0f32..1.0, (-2i8..=2).prop_map(|c| f32::from(c) / 2.0)]
    }

    fn corners() -> impl Strategy<Value = [[f32; 3]; 3]> {
        prop::array::uniform3(prop::array::uniform3(coordinate()))
    }

    proptest! {
        #![proptest_config(crate::testing::cases(2_000))]

        #[test]
        fn no_point_of_the_triangle_is_nearer(
            corners in corners(),
            p in prop::array::uniform3(-2.0f64..2.0),
        ) {
            let near = nearest_on_triangle(p, &corners);
            let [u, v] = near.weights;
            prop_assert!(u >= 0.0 && v >= 0.0 && u + v <= 1.0 + 1e-12);
            for i in 0..=20 {
                for j in 0..=20 - i {
                    let (u, v) = (f64::from(i) / 20.0, f64::from(j) / 20.0);
                    let other: [f64; 3] = std::array::from_fn(|k| {
                        let [a, b, c] = corners.map(|p| f64::from(p[k]));
                        a + u * (b - a) + v * (c - a)
                    });
                    let offset = difference(p, other);
                    prop_assert!(near.squared <= dot(offset, offset) + 1e-12);
                }
            }
        }

        /// A box overlaps a triangle just where some point of the triangle is in it; the nearest
        /// point by the largest coordinate is found by shrinking.
        #[test]
        fn a_box_overlaps_what_has_points_in_it(
            corners in corners(),
            center in prop::array::uniform3(-1.0f64..1.0),
            half in prop::array::uniform3(0.0f64..0.8),
        ) {
            let mut inside = false;
            let mut closest = f64::INFINITY;
            for i in 0..=60 {
                for j in 0..=60 - i {
                    let (u, v) = (f64::from(i) / 60.0, f64::from(j) / 60.0);
                    let excess = (0..3).map(|k| {
                        let [a, b, c] = corners.map(|p| f64::from(p[k]));
                        (a + u * (b - a) + v * (c - a) - center[k]).abs() - half[k]
                    }).fold(f64::NEG_INFINITY, f64::max);
                    inside |= excess <= 0.0;
                    closest = closest.min(excess);
                }
            }
            let overlaps = overlaps_box(&corners, center, half);
            prop_assert!(overlaps || !inside);
            // The samples are this dense.
            prop_assert!(!overlaps || closest < 0.1);
        }
    }

    #[test]
    fn a_triangle_that_touches_a_box_overlaps_it() {
        let corners = [[1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [1.0, 1.0, 0.0]];
        assert!(overlaps_box(&corners, [0.0; 3], [1.0; 3]));
        assert!(!overlaps_box(&corners, [0.0; 3], [0.999_999; 3]));
    }
}
