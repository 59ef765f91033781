//! The top-down loop.

use super::cell::{Cell, Profile};
use super::cost::{Choice, Contest};
use super::params::{BuildParams, BuildStats, Ties};
use super::sweep::Events;
use super::ties::Boundary;
use crate::catalog::TreeChoice;
use crate::directions::{self, NodeView, Random};
use crate::geometry::Mesh;

/// Subtrees with at least this many triangles are built in parallel.
const PARALLEL_FROM: usize = 4096;

/// A path ends after this many bad refines [PBRT3, 4.4].
const MAX_BAD_REFINES: u8 = 3;

const AXES: [[f32; 3]; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// A plane that splits a node.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct SplitPlane {
    /// The axis, where the plane comes from one.
    pub(crate) axis: Option<usize>,
    pub(crate) normal: [f32; 3],
    pub(crate) boundary: Boundary,
}

/// A node in depth-first order; the child below follows its parent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum BuiltNode {
    Interior {
        plane: SplitPlane,
        /// How many nodes after this one the child above comes.
        above: usize,
    },
    /// The next `count` of the references.
    Leaf { count: usize },
}

/// What the loop gives: nodes, references and sums over them.
#[derive(Debug, Default)]
pub(crate) struct Built {
    pub(crate) nodes: Vec<BuiltNode>,
    pub(crate) references: Vec<u32>,
    pub(crate) sums: Sums,
}

/// Sums over a subtree. They are added up in the shape of the tree, so that they do not depend on
/// who built what.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Sums {
    /// Areas of the cells of axis-aligned interior nodes.
    pub(crate) axis_area: f64,
    /// Areas of the cells of the other interior nodes.
    pub(crate) oblique_area: f64,
    /// Areas of the cells of leaves, times their triangles.
    pub(crate) leaf_area: f64,
    pub(crate) stats: BuildStats,
}

impl std::ops::AddAssign for Sums {
    fn add_assign(&mut self, other: Sums) {
        self.axis_area += other.axis_area;
        self.oblique_area += other.oblique_area;
        self.leaf_area += other.leaf_area;
        self.stats += other.stats;
    }
}

/// A node to be built.
struct Node {
    triangles: Vec<u32>,
    cell: Cell,
    depth: u32,
    bad_refines: u8,
    /// Names the node's place in the tree, for its random numbers.
    path: u64,
}

/// Buffers of one thread.
#[derive(Default)]
struct Scratch {
    events: Events,
    directions: Vec<[f32; 3]>,
}

struct Builder<'a> {
    mesh: &'a Mesh,
    normals: Vec<[f32; 3]>,
    choice: TreeChoice,
    params: &'a BuildParams,
    max_depth: u32,
    /// The tolerance of ties; `None` as published.
    tolerance: Option<f32>,
}

/// Builds the tree, on the threads of the current rayon pool.
pub(crate) fn grow(mesh: &Mesh, choice: TreeChoice, params: &BuildParams) -> Built {
    let triangles = mesh.usable_triangles().to_vec();
    let bounds = mesh.bounds();
    let builder = Builder {
        mesh,
        normals: (0..mesh.triangles().len() as u32)
            .map(|i| mesh.normal(i))
            .collect(),
        choice,
        params,
        max_depth: params.max_depth.for_triangles(triangles.len()),
        tolerance: match params.ties {
            Ties::AsPublished => None,
            Ties::Tolerant => Some(params.ties.tolerance(&bounds)),
        },
    };
    let mut built = Built::default();
    if triangles.is_empty() {
        built.nodes.push(BuiltNode::Leaf { count: 0 });
        return built;
    }
    let root = Node {
        triangles,
        cell: Cell::Box(bounds),
        depth: 0,
        bad_refines: 0,
        path: Random::new(params.seed).next(),
    };
    built.sums = builder.grow(
        root,
        &mut built.nodes,
        &mut built.references,
        &mut Scratch::default(),
    );
    built
}

impl Builder<'_> {
    /// Appends the subtree of `node` and gives its sums.
    fn grow(
        &self,
        node: Node,
        nodes: &mut Vec<BuiltNode>,
        references: &mut Vec<u32>,
        scratch: &mut Scratch,
    ) -> Sums {
        let area = node.cell.surface_area();
        let mut sums = Sums::default();
        let Some(choice) = self.split(&node, scratch, &mut sums.stats) else {
            sums.leaf_area = area * node.triangles.len() as f64;
            nodes.push(BuiltNode::Leaf {
                count: node.triangles.len(),
            });
            references.extend_from_slice(&node.triangles);
            return sums;
        };
        let plane = choice.plane;
        *(if plane.axis.is_some() {
            &mut sums.axis_area
        } else {
            &mut sums.oblique_area
        }) = area;
        sums.stats.bad_refines = u64::from(choice.bad_refine);
        let (below, above, uncut) = self.children(node, &choice);
        sums.stats.uncut_cells = u64::from(uncut);

        let at = nodes.len();
        nodes.push(BuiltNode::Interior { plane, above: 0 });
        let (sums_below, sums_above);
        if below.triangles.len().min(above.triangles.len()) < PARALLEL_FROM {
            sums_below = self.grow(below, nodes, references, scratch);
            nodes[at] = BuiltNode::Interior {
                plane,
                above: nodes.len() - at,
            };
            sums_above = self.grow(above, nodes, references, scratch);
        } else {
            let mut other = Built::default();
            (sums_below, sums_above) = rayon::join(
                || self.grow(below, nodes, references, scratch),
                || {
                    self.grow(
                        above,
                        &mut other.nodes,
                        &mut other.references,
                        &mut Scratch::default(),
                    )
                },
            );
            nodes[at] = BuiltNode::Interior {
                plane,
                above: nodes.len() - at,
            };
            nodes.append(&mut other.nodes);
            references.append(&mut other.references);
        }
        sums += sums_below;
        sums += sums_above;
        sums
    }

    /// The split of a node; `None` where it is to be a leaf.
    fn split(
        &self,
        node: &Node,
        scratch: &mut Scratch,
        stats: &mut BuildStats,
    ) -> Option<Choice<SplitPlane>> {
        let n = node.triangles.len();
        if n <= self.params.max_prims as usize || node.depth >= self.max_depth {
            return None;
        }
        let (contest, candidates) = self.contest(node, scratch);
        stats.candidates += candidates;
        let choice = contest.decide(self.choice.spec, self.params, n)?;
        let bad_refines = node.bad_refines + u8::from(choice.bad_refine);
        (!choice.hopeless && bad_refines < MAX_BAD_REFINES).then_some(choice)
    }

    /// All candidates of a node.
    fn contest(&self, node: &Node, scratch: &mut Scratch) -> (Contest<SplitPlane>, u64) {
        let mut contest = Contest::new();
        let mut candidates = 0;
        let mut polytope = None;
        let mut sweep = |axis: Option<usize>, normal: [f32; 3]| {
            let mut profile = match axis.and_then(|axis| node.cell.box_profile(axis)) {
                Some(profile) => profile,
                None => {
                    let polytope = &**polytope.get_or_insert_with(|| node.cell.to_polytope());
                    let direction = glam::Vec3::from(normal).as_dvec3();
                    // The borrow ends with the sweep; only the first direction makes the polytope.
                    Profile::of_polytope(polytope, direction, 2 * node.triangles.len())
                }
            };
            let extents = node.triangles.iter().map(|&i| self.extent(axis, normal, i));
            scratch.events.fill(extents, self.tolerance);
            let (best, inside) =
                scratch
                    .events
                    .sweep(self.tolerance, &mut profile, self.params.empty_bonus);
            candidates += inside;
            if let Some(best) = best {
                let plane = SplitPlane {
                    axis,
                    normal,
                    boundary: best.boundary,
                };
                contest.enter(plane, axis.is_some(), best);
            }
        };
        if self.choice.spec.axes {
            for (axis, &normal) in AXES.iter().enumerate() {
                sweep(Some(axis), normal);
            }
        }
        scratch.directions.clear();
        let view = NodeView {
            normals: &self.normals,
            triangles: &node.triangles,
            random: Random::new(node.path),
        };
        directions::generate(self.choice, view, &mut scratch.directions);
        for &direction in &scratch.directions {
            sweep(None, direction);
        }
        (contest, candidates)
    }

    /// The extent of a triangle along a direction.
    #[inline(always)]
    fn extent(&self, axis: Option<usize>, normal: [f32; 3], triangle: u32) -> (f32, f32) {
        let corners = self.mesh.corners(triangle);
        let [a, b, c] = match axis {
            Some(axis) => corners.map(|p| p[axis]),
            None => corners.map(|p| self.params.ties.project(normal, p)),
        };
        (a.min(b).min(c), a.max(b).max(c))
    }

    /// The two children of a node, and whether its cell could not be cut.
    fn children(&self, node: Node, choice: &Choice<SplitPlane>) -> (Node, Node, bool) {
        let plane = choice.plane;
        let mut sides = [Vec::new(), Vec::new()];
        for &triangle in &node.triangles {
            let extent = self.extent(plane.axis, plane.normal, triangle);
            let (below, above) = plane.boundary.sides(extent);
            if below {
                sides[0].push(triangle);
            }
            if above {
                sides[1].push(triangle);
            }
        }
        let cut = node.cell.cut(&plane);
        let uncut = cut.is_none();
        let cells = cut.unwrap_or_else(|| (node.cell.clone(), node.cell.clone()));
        let [below, above] = sides;
        let mut paths = Random::new(node.path ^ u64::from(node.depth) << 48);
        let mut child = |triangles: Vec<u32>, cell: Cell| Node {
            triangles,
            cell,
            depth: node.depth + 1,
            bad_refines: node.bad_refines + u8::from(choice.bad_refine),
            path: paths.next(),
        };
        (child(below, cells.0), child(above, cells.1), uncut)
    }
}
