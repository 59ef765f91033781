//! Ize's candidates: per triangle of a node its own plane, and through each edge the plane
//! perpendicular to it, counted with an auxiliary BVH of the node's triangles [Ize2008].

use glam::{DVec3, Vec3};

use super::params::Ties;
use super::sweep::Best;
use super::ties::{Boundary, Side, Touching};
use crate::directions::canonical;
use crate::geometry::Aabb;
use crate::geometry::polytope::Polytope;

/// Triangles in a leaf of the auxiliary BVH.
const LEAF_SIZE: usize = 8;

/// A candidate plane of a triangle: its unit normal, and a point in it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Candidate {
    pub(crate) normal: [f32; 3],
    pub(crate) through: [f32; 3],
    /// Perpendicular to the triangle, through an edge.
    pub(crate) is_edge: bool,
}

/// A triangle's own plane, then those through its edges.
pub(crate) fn candidates(corners: &[[f32; 3]; 3]) -> impl Iterator<Item = Candidate> {
    let points = corners.map(|p| Vec3::from(p).as_dvec3());
    let normal = (points[1] - points[0]).cross(points[2] - points[0]);
    let own = (normal, corners[0], false);
    let edges = [0, 1, 2].map(|i| {
        let edge = points[(i + 1) % 3] - points[i];
        (normal.cross(edge), corners[i], true)
    });
    std::iter::once(own)
        .chain(edges)
        .filter_map(|(normal, through, is_edge)| {
            let normal = normal.try_normalize()?.as_vec3();
            Some(Candidate {
                normal: canonical(normal.into()),
                through,
                is_edge,
            })
        })
}

/// Counts how many of a node's triangles are on either side of a plane.
pub(crate) struct Counter {
    ties: Ties,
    overhang: f64,
    /// The triangles, in the order of the BVH's leaves.
    corners: Vec<[[f32; 3]; 3]>,
    nodes: Vec<BvhNode>,
}

/// A node of the auxiliary BVH; the first child follows it.
struct BvhNode {
    bounds: Aabb,
    triangles: std::ops::Range<usize>,
    /// The second child; 0 in a leaf.
    second: usize,
}

impl Counter {
    /// `overhang` is that of the ties, or more.
    pub(crate) fn new(mut corners: Vec<[[f32; 3]; 3]>, ties: Ties, overhang: f64) -> Self {
        let mut nodes = Vec::new();
        split(&mut corners, 0, &mut nodes);
        Counter {
            ties,
            overhang,
            corners,
            nodes,
        }
    }

    /// Where the plane of a candidate is along its normal.
    pub(crate) fn offset(&self, candidate: &Candidate) -> f32 {
        self.ties.project(candidate.normal, candidate.through)
    }

    /// How many triangles are below the plane and how many above, exactly as [`Boundary::sides`]
    /// has it, and how many of them it [holds](Boundary::holds).
    pub(crate) fn count(&self, normal: [f32; 3], boundary: Boundary) -> (usize, usize, usize) {
        let t = f64::from(boundary.offset);
        let n = Vec3::from(normal).as_dvec3();
        // What is further from the plane than this is on its side only, however it is rounded.
        let slack = 2.0 * self.overhang;
        // What is nearer than this lies in the plane, however it is rounded.
        let (within, flat) = match boundary.touching {
            Touching::Tolerated { tolerance, flat } => {
                (2.0 * f64::from(tolerance) - self.overhang, flat)
            }
            _ => (f64::NEG_INFINITY, Side::Below),
        };
        let (mut below, mut above, mut held) = (0, 0, 0);
        let mut pending = vec![0];
        while let Some(at) = pending.pop() {
            let node = &self.nodes[at];
            let [low, high] = [node.bounds.min, node.bounds.max].map(|p| Vec3::from(p).as_dvec3());
            let center = n.dot(0.5 * (low + high));
            let radius = n.abs().dot(0.5 * (high - low));
            let count = node.triangles.len();
            if center + radius + slack < t {
                below += count;
            } else if center - radius - slack > t {
                above += count;
            } else if (center - t).abs() + radius <= within {
                held += count;
                *(match flat {
                    Side::Below => &mut below,
                    Side::Above => &mut above,
                }) += count;
            } else if node.second == 0 {
                for corners in &self.corners[node.triangles.clone()] {
                    let extent = self.ties.extent(normal, corners);
                    let sides = boundary.sides(extent);
                    held += usize::from(boundary.holds(extent));
                    below += usize::from(sides.0);
                    above += usize::from(sides.1);
                }
            } else {
                pending.extend([node.second, at + 1]);
            }
        }
        (below, above, held)
    }
}

/// Appends the BVH of these triangles, the first of which has the index `start`.
fn split(corners: &mut [[[f32; 3]; 3]], start: usize, nodes: &mut Vec<BvhNode>) {
    let bounds = Aabb::of_points(corners.iter().flatten().copied());
    let at = nodes.len();
    nodes.push(BvhNode {
        bounds,
        triangles: start..start + corners.len(),
        second: 0,
    });
    if corners.len() > LEAF_SIZE {
        let extent = bounds.extent();
        let axis = if extent[0] >= extent[1] && extent[0] >= extent[2] {
            0
        } else if extent[1] >= extent[2] {
            1
        } else {
            2
        };
        let middle = corners.len() / 2;
        let center = |c: &[[f32; 3]; 3]| c[0][axis] + c[1][axis] + c[2][axis];
        corners.select_nth_unstable_by(middle, |a, b| center(a).total_cmp(&center(b)));
        let (first, second) = corners.split_at_mut(middle);
        split(first, start, nodes);
        nodes[at].second = nodes.len();
        split(second, start + middle, nodes);
    }
}

/// Prices one candidate in a cell; `None` where it does not pass through the cell.
pub(crate) fn price(
    candidate: &Candidate,
    counter: &Counter,
    cell: &Polytope,
    cell_area: f64,
    tolerance: Option<f32>,
    empty_bonus: f64,
    heights: &mut Vec<f64>,
) -> Option<Best> {
    let boundary = Boundary {
        offset: counter.offset(candidate),
        touching: tolerance.map_or(Touching::Both, |tolerance| touching(tolerance, Side::Below)),
    };
    let direction: DVec3 = Vec3::from(candidate.normal).as_dvec3();
    let (surface, cap) = cell.areas_at(direction, f64::from(boundary.offset), heights)?;
    let (below, above, held) = counter.count(candidate.normal, boundary);
    let surface = surface.clamp(0.0, cell_area);
    let areas = (
        (surface + cap) / cell_area,
        (cell_area - surface + cap) / cell_area,
    );
    let best = Best::price(boundary, areas, below, above, empty_bonus);
    let Some(tolerance) = tolerance.filter(|_| held > 0) else {
        return Some(best);
    };
    let boundary = Boundary {
        touching: touching(tolerance, Side::Above),
        ..boundary
    };
    let other = Best::price(boundary, areas, below - held, above + held, empty_bonus);
    Some(match other.expected_tests < best.expected_tests {
        true => other,
        false => best,
    })
}

fn touching(tolerance: f32, flat: Side) -> Touching {
    Touching::Tolerated { tolerance, flat }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(crate::testing::cases(300))]

        #[test]
        fn the_bvh_counts_as_the_predicate_does(
            mut corners in prop::collection::vec(prop::array::uniform3(prop::array::uniform3(-1.0f32..1.0)), 1..100),
            of in 0usize..100,
            tolerant in any::<bool>(),
            in_a_plane in any::<bool>(),
        ) {
            if in_a_plane {
                corners.iter_mut().flatten().for_each(|p| p[2] = 0.25);
            }
            let ties = if tolerant { Ties::Tolerant } else { Ties::AsPublished };
            let touching = if tolerant { touching(1e-3, Side::Below) } else { Touching::Both };
            let counter = Counter::new(corners.clone(), ties, 1.001e-3);
            for candidate in candidates(&corners[of % corners.len()]) {
                let boundary = Boundary { offset: ties.project(candidate.normal, candidate.through), touching };
                let sides: Vec<_> = corners
                    .iter()
                    .map(|corners| boundary.sides(ties.extent(candidate.normal, corners)))
                    .collect();
                let below = sides.iter().filter(|s| s.0).count();
                let above = sides.iter().filter(|s| s.1).count();
                let held = corners
                    .iter()
                    .filter(|corners| boundary.holds(ties.extent(candidate.normal, corners)))
                    .count();
                prop_assert_eq!(counter.count(candidate.normal, boundary), (below, above, held));
            }
        }
    }

    #[test]
    fn a_triangle_has_its_own_plane_and_one_through_each_edge() {
        let corners = [[0.0, 0.0, 2.0], [1.0, 0.0, 2.0], [0.0, 1.0, 2.0]];
        let normals: Vec<_> = candidates(&corners)
            .map(|c| (c.normal, c.is_edge))
            .collect();
        let s = 0.5f32.sqrt();
        assert_eq!(
            normals,
            [
                ([0.0, 0.0, 1.0], false),
                ([0.0, 1.0, 0.0], true),
                ([s, s, 0.0], true),
                ([1.0, 0.0, 0.0], true),
            ]
        );
    }
}
