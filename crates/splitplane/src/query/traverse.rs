//! The traversal of a binary tree.

use std::ops::ControlFlow;

use super::{Counters, Hit, Traversal};
use crate::build::BuildParams;
use crate::geometry::frame::round_up;
use crate::geometry::triangle::Shear;
use crate::geometry::{Aabb, Frame, Mesh, Ray};
use crate::tree::Tree;
use crate::tree::nodes::{Layout, View};

/// What a traversal looks for.
pub(crate) trait Search {
    /// Beyond this t nothing is wanted any more.
    fn limit(&self) -> f64;
    /// The same as an f32, rounded up.
    #[inline(always)]
    fn limit_above(&self) -> f32 {
        round_up(self.limit())
    }
    /// Whether hits are best found in their order along the ray; otherwise where they are likely,
    /// and the limit never changes.
    const NEAREST_FIRST: bool;
    /// The ray's part of the ray-triangle test, where triangles that it misses need not be tested;
    /// `None` where all of a leaf are to be.
    #[inline(always)]
    fn shear(&mut self) -> Option<&Shear> {
        None
    }
    /// Whether the search is over once it is known that there is a hit, whatever it is.
    const NEEDS_NO_HIT: bool = false;
    /// There is a hit. Only where [`Search::NEEDS_NO_HIT`].
    #[inline(always)]
    fn found_without_hit(&mut self) {}
    /// Tests a triangle; breaks when the answer is known.
    fn test(&mut self, triangle: &impl Triangle) -> ControlFlow<()>;
}

/// A triangle that is to be tested.
pub(crate) trait Triangle {
    /// Its index in the mesh.
    fn index(&self) -> u32;
    fn corners(&self) -> [[f32; 3]; 3];
    /// Where the ray's line meets it.
    fn meet(&self, shear: &Shear) -> Option<Hit>;
    /// Whether [`plane_is_beyond`](crate::geometry::triangle::plane_is_beyond) is known to be so.
    #[inline(always)]
    fn is_surely_beyond(&self) -> bool {
        false
    }
}

/// A triangle as the mesh has it.
pub(super) struct OfMesh<'a> {
    pub(super) mesh: &'a Mesh,
    pub(super) index: u32,
}

impl Triangle for OfMesh<'_> {
    #[inline(always)]
    fn index(&self) -> u32 {
        self.index
    }

    #[inline(always)]
    fn corners(&self) -> [[f32; 3]; 3] {
        self.mesh.corners(self.index)
    }

    #[inline(always)]
    fn meet(&self, shear: &Shear) -> Option<Hit> {
        shear.meet(&self.corners(), self.index)
    }
}

/// What of a tree decides where a ray may meet a triangle.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Place {
    /// The box around all triangles.
    pub(crate) bounds: Aabb,
    /// The longest edge of a box around a single triangle.
    pub(crate) largest: f32,
    /// How far a triangle may reach beyond a plane on a side where it is not referenced.
    pub(crate) overhang: f64,
    pub(crate) traversal: Traversal,
}

/// A ray as the traversal sees it, in f64: so the only errors that count are those of the
/// triangle test and of the build, and both are lengths.
#[derive(Clone, Copy, Default)]
struct Line {
    origin: [f64; 3],
    direction: [f64; 3],
    /// Per axis, one over the direction, finite.
    inverse: [f64; 3],
    /// A triangle that is hit at t lies within `base + slope · |t|` of the ray's point there.
    base: f64,
    slope: f64,
    /// The largest such distance on this ray.
    largest: f64,
    /// The largest component of the direction, in the world's axes.
    longest: f64,
    /// Per axis, the same in multiples of the direction; see [`Line::margin`].
    axis_margin: [(f64, f64); 3],
}

/// How far a triangle that is hit may lie off the ray's point, in units of ε/2 times the distance
/// of its furthest vertex from the ray's origin, along any axis.
///
/// The test sees the vertices with errors: of one rounding when the origin is subtracted, three in
/// the shear, one in the result, so 5 a coordinate, and up to √3 · 5 along a plane's normal; t is
/// rounded once at the end, which moves the point by as much as √3. Together below 11. The rest is
/// reserve; a twelfth of it is spent in [`Line::margin`].
const TEST_ERROR: f64 = 16.0;

/// Where a plane is met so obliquely that the distance off the ray grows this fast, the largest
/// distance on the ray is taken.
const GRAZING: f64 = 1.0 / 32.0;

impl Line {
    fn new(ray: &Ray, place: &Place) -> Self {
        let max = |v: &[f32; 3]| f64::from(v.iter().fold(0.0, |m: f32, c| m.max(c.abs())));
        let longest = max(&ray.direction);
        let unit = 0.5 * f64::from(f32::EPSILON) * TEST_ERROR;
        let scale = match place.traversal {
            Traversal::Exact => 1.0,
            Traversal::AsPublished => 0.0,
        };
        let base = scale * (unit * f64::from(place.largest) + 1.1 * place.overhang);
        let slope = scale * unit * longest;
        // No vertex is further from the origin than this.
        let reach = max(&ray.origin) + f64::from(place.bounds.reach());
        let largest = scale * (unit * reach + 1.1 * place.overhang);
        Line {
            base,
            slope,
            largest,
            longest,
            ..Line::default()
        }
        .along(ray.origin.map(f64::from), ray.direction.map(f64::from))
    }

    /// The same ray in a frame. Lengths are about the same in all frames, so the distances are.
    fn in_frame(&self, ray: &Ray, frame: &Frame) -> Self {
        self.along(
            frame.map(ray.origin.map(f64::from)),
            frame.map(ray.direction.map(f64::from)),
        )
    }

    fn along(&self, origin: [f64; 3], direction: [f64; 3]) -> Self {
        let Line {
            base,
            slope,
            largest,
            longest,
            ..
        } = *self;
        // A component this small moves the ray by less than any rounding, and its inverse is
        // finite, so that a ray along a plane needs no case of its own.
        let inverse = direction.map(|c| 1.0 / c.abs().max(longest * 1e-30).copysign(c));
        let axis_margin = inverse.map(|inverse| match slope * inverse.abs() > GRAZING {
            true => (largest * inverse.abs(), 0.0),
            false => (base * inverse.abs(), slope * inverse.abs()),
        });
        Line {
            origin,
            direction,
            inverse,
            axis_margin,
            ..*self
        }
    }

    /// How far from `t` the ray may meet triangles that touch a plane which it meets there, as a
    /// difference in t; `inverse` is one over how fast the ray nears the plane.
    ///
    /// Such a triangle, hit at t', lies within `base + slope · |t'|` of the plane, so with
    /// k = slope · |inverse| < 1/32 and b = base · |inverse|,
    /// |t' - t| ≤ (b + k · |t|) / (1 - k) < 1.04 · (b + k · |t|).
    #[inline(always)]
    fn margin(&self, t: f64, inverse: f64) -> f64 {
        let inverse = inverse.abs();
        if self.slope * inverse > GRAZING {
            self.largest * inverse
        } else {
            (self.base + self.slope * t.abs()) * inverse
        }
    }

    #[inline(always)]
    fn meet_axis(&self, axis: usize, offset: f32) -> (f64, f64) {
        let t = (f64::from(offset) - self.origin[axis]) * self.inverse[axis];
        let (base, slope) = self.axis_margin[axis];
        (t, base + slope * t.abs())
    }

    /// The part of an interval of the ray that is in the box.
    #[inline(always)]
    fn clip(&self, (mut near, mut far): (f64, f64), bounds: &Aabb) -> Option<(f64, f64)> {
        for axis in 0..3 {
            let (low, high) = (bounds.min[axis], bounds.max[axis]);
            let (entry, exit) = match self.inverse[axis] > 0.0 {
                true => (low, high),
                false => (high, low),
            };
            let (t, margin) = self.meet_axis(axis, entry);
            near = near.max(t - margin);
            let (t, margin) = self.meet_axis(axis, exit);
            far = far.min(t + margin);
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
    tree: &Tree,
    place: &Place,
    ray: &Ray,
    search: &mut impl Search,
    counters: &mut impl Counters,
) {
    let (shared, references, mesh) = (tree.shared(), tree.references(), tree.mesh());
    let world = Line::new(ray, place);
    let (mut line, mut current) = (world, Frame::WORLD);
    let interval = (f64::from(ray.t_min), f64::from(ray.t_max));
    let Some((mut near, mut far)) = line.clip(interval, &place.bounds) else {
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
                let (t, margin) = line.meet_axis(axis, offset);
                (t, margin, line.inverse[axis] > 0.0, above)
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
                (t, line.margin(t, inverse), inverse > 0.0, above)
            }
            View::Objects { above, frame } => {
                counters.kd_visit();
                if frame != current {
                    current = frame;
                    line = match frame {
                        Frame::WORLD => world,
                        _ => world.in_frame(ray, shared.frame(frame)),
                    };
                }
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
                for &index in leaf.triangles(references) {
                    counters.triangle_tests(1);
                    if search.test(&OfMesh { mesh, index }).is_break() {
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
