//! The traversal of a binary tree.

use std::ops::ControlFlow;

use super::Counters;
use crate::build::BuildParams;
use crate::geometry::{Aabb, Ray};
use crate::tree::nodes::{Layout, Shared, View};

/// What a traversal looks for.
pub(super) trait Search {
    /// Beyond this t nothing is wanted any more.
    fn limit(&self) -> f64;
    /// Tests a triangle; breaks when the answer is known.
    fn test(&mut self, triangle: u32) -> ControlFlow<()>;
}

/// A ray as the traversal sees it, in f64: so the only errors that count are those of the
/// triangle test and of the build, and both are lengths.
struct Line {
    origin: [f64; 3],
    direction: [f64; 3],
    /// Per axis, one over the direction, finite.
    inverse: [f64; 3],
    /// Planes within this distance of a point may have it on either side.
    margin: f64,
    /// Per axis, the margin in multiples of the direction.
    axis_margin: [f64; 3],
}

/// How far a triangle that is hit may lie off the ray, in units of ε/2 times the largest
/// coordinate of what takes part.
///
/// The test sees the triangle's vertices with errors: of one rounding when the origin is
/// subtracted, three in the shear, one in the result, so 5 a coordinate, and up to √3 · 5 along a
/// plane's normal; of t, the result is rounded once, which moves the point by as much as √3.
/// Together below 11; the rest is reserve.
const TEST_ERROR: f64 = 16.0;

impl Line {
    fn new(ray: &Ray, bounds: &Aabb, tolerance: f64) -> Self {
        let reach = ray
            .origin
            .iter()
            .fold(bounds.reach(), |r, c| r.max(c.abs()));
        let margin =
            TEST_ERROR * 0.5 * f64::from(f32::EPSILON) * 2.0 * f64::from(reach) + tolerance;
        let direction = ray.direction.map(f64::from);
        let longest = direction.iter().fold(0.0, |l: f64, c| l.max(c.abs()));
        // A component this small moves the ray by less than any rounding, and its inverse is
        // finite, so that a ray along a plane needs no case of its own.
        let inverse = direction.map(|c| 1.0 / c.abs().max(longest * 1e-30).copysign(c));
        Line {
            origin: ray.origin.map(f64::from),
            direction,
            inverse,
            margin,
            axis_margin: inverse.map(|i| margin * i.abs()),
        }
    }

    /// The part of an interval of the ray that is in the box.
    #[inline(always)]
    fn clip(&self, (mut near, mut far): (f64, f64), bounds: &Aabb) -> Option<(f64, f64)> {
        for axis in 0..3 {
            let at = |offset: f32| (f64::from(offset) - self.origin[axis]) * self.inverse[axis];
            let (a, b) = (at(bounds.min[axis]), at(bounds.max[axis]));
            near = near.max(a.min(b) - self.axis_margin[axis]);
            far = far.min(a.max(b) + self.axis_margin[axis]);
        }
        (near <= far).then_some((near, far))
    }
}

/// Nodes that are still to be visited, each with its interval.
type Stack = [(u32, f64, f64); BuildParams::MAX_DEPTH as usize];

/// The next node that has not been passed by the search.
#[inline(always)]
fn pop(stack: &Stack, depth: &mut usize, limit: f64) -> Option<(usize, f64, f64)> {
    while *depth > 0 {
        *depth -= 1;
        let (node, near, far) = stack[*depth];
        if near <= limit {
            return Some((node as usize, near, far));
        }
    }
    None
}

/// Visits the leaves that the ray passes, near ones first, until the search has its answer.
///
/// Where the ray meets a plane is known up to the margin; both children get what lies within it.
/// So a triangle that the test would hit is in a leaf that is visited before anything behind it
/// ends the search.
#[inline]
pub(super) fn traverse<N: Layout>(
    nodes: &[N],
    shared: &Shared,
    references: &[u32],
    (bounds, tolerance): (&Aabb, f64),
    ray: &Ray,
    search: &mut impl Search,
    counters: &mut impl Counters,
) {
    let line = Line::new(ray, bounds, tolerance);
    let Some((mut near, mut far)) = line.clip((f64::from(ray.t_min), f64::from(ray.t_max)), bounds)
    else {
        return;
    };
    let mut stack: Stack = [(0, 0.0, 0.0); BuildParams::MAX_DEPTH as usize];
    let mut depth = 0;
    let mut at = 0;
    loop {
        let (t, margin, rising, above) = match nodes[at].view(shared) {
            View::Axis {
                axis,
                offset,
                above,
            } => {
                counters.kd_visit();
                let inverse = line.inverse[axis];
                let t = (f64::from(offset) - line.origin[axis]) * inverse;
                (t, line.axis_margin[axis], inverse > 0.0, above)
            }
            View::Oblique {
                normal,
                offset,
                above,
                ..
            } => {
                counters.oblique_visit();
                let n = normal.map(f64::from);
                let (o, d) = (&line.origin, &line.direction);
                let inverse = 1.0 / (n[0] * d[0] + n[1] * d[1] + n[2] * d[2]);
                let t = (f64::from(offset) - (n[0] * o[0] + n[1] * o[1] + n[2] * o[2])) * inverse;
                (t, line.margin * inverse.abs(), inverse > 0.0, above)
            }
            View::Objects { above } => {
                counters.kd_visit();
                let clip = |node: usize| line.clip((near, far), &nodes[node].bounds());
                let children = [(at + 1, clip(at + 1)), (above, clip(above))];
                let [first, second] =
                    children.map(|(node, interval)| interval.map(|(near, far)| (node, near, far)));
                let next = match (first, second) {
                    (Some(first), Some(second)) => {
                        let (first, second) = if second.1 < first.1 {
                            (second, first)
                        } else {
                            (first, second)
                        };
                        stack[depth] = (second.0 as u32, second.1, second.2);
                        depth += 1;
                        Some(first)
                    }
                    (first, second) => first.or(second),
                };
                let next = next.or_else(|| pop(&stack, &mut depth, search.limit()));
                let Some(next) = next else { return };
                (at, near, far) = next;
                continue;
            }
            View::Leaf(leaf) => {
                counters.leaf_visit(leaf.count);
                for &triangle in leaf.triangles(references) {
                    counters.triangle_test();
                    if search.test(triangle).is_break() {
                        return;
                    }
                }
                let Some(next) = pop(&stack, &mut depth, search.limit()) else {
                    return;
                };
                (at, near, far) = next;
                continue;
            }
        };
        let (first, second) = if rising {
            (at + 1, above)
        } else {
            (above, at + 1)
        };
        // Written so that a ray along the plane, for which t is not a number, visits both.
        let only_second = t + margin < near;
        let only_first = t - margin > far;
        if only_first {
            at = first;
        } else if only_second {
            at = second;
        } else {
            stack[depth] = (second as u32, near.max(t - margin), far);
            depth += 1;
            at = first;
            far = far.min(t + margin);
        }
    }
}
