//! The top-down loop.

use std::collections::HashMap;

use super::cell::Cell;
use super::cost::{Choice, Contest};
use super::objects;
use super::params::{BuildParams, BuildStats, Ties};
use super::sweep::Events;
use super::ties::{Boundary, Touching};
use super::triangle_planes::{self, Counter};
use crate::catalog::{Directions, TreeChoice};
use crate::directions::{self, NodeView, Random, fixed};
use crate::geometry::polytope::{CutScratch, Polytope, Profile};
use crate::geometry::{Aabb, Frame, Mesh};

/// Subtrees with at least this many triangles are built in parallel.
pub(super) const PARALLEL_FROM: usize = 4096;

/// In a node of at least this many triangles, equal planes of triangles are priced once.
const REMEMBER_FROM: usize = 32;

/// A path ends after this many bad refines [PBRT3, 4.4].
const MAX_BAD_REFINES: u8 = 3;

const AXES: [[f32; 3]; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// A plane that splits a node.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct SplitPlane {
    pub(crate) normal: [f32; 3],
    pub(crate) boundary: Boundary,
    pub(crate) origin: Origin,
}

/// What a plane came from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Origin {
    Axis,
    /// The tree's fixed direction of this index.
    Fixed(u8),
    /// A direction of the node.
    Direction,
    Triangle,
    Edge,
}

impl SplitPlane {
    /// The plane is across an axis that was a candidate as such.
    pub(crate) fn is_axis(&self) -> bool {
        match self.origin {
            Origin::Axis => true,
            Origin::Fixed(_) => self.axis().is_some(),
            _ => false,
        }
    }

    /// The axis that the plane is across, wherever it came from.
    pub(crate) fn axis(&self) -> Option<usize> {
        AXES.iter().position(|&axis| axis == self.normal)
    }
}

/// A node in depth-first order; the child below follows its parent. `area` is that of its cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum BuiltNode {
    Interior {
        plane: SplitPlane,
        /// How many nodes after this one the child above comes.
        above: usize,
        area: f64,
    },
    /// The children have boxes of their own, in a frame.
    Objects {
        above: usize,
        area: f64,
        /// The frame of the children's boxes.
        frame: u32,
    },
    /// The next `count` of the references.
    Leaf { count: usize, area: f64 },
}

/// What the loop gives.
#[derive(Debug, Default)]
pub(crate) struct Built {
    pub(crate) nodes: Vec<BuiltNode>,
    pub(crate) references: Vec<u32>,
    /// The nodes' boxes, each in the frame that its parent names; empty where nodes have planes.
    pub(crate) boxes: Vec<Aabb>,
    /// The frames of the boxes, where there are others than the world's.
    pub(crate) frames: Vec<Frame>,
    pub(crate) stats: BuildStats,
    /// The directions of the whole tree, where it has such.
    pub(crate) fixed: Vec<[f32; 3]>,
}

impl Built {
    /// Appends an interior node and its subtrees, in parallel if that is worth it. `node` is told
    /// how many nodes after it the child above comes; `scratch` are buffers of one thread.
    pub(super) fn join<S: Default + Send>(
        &mut self,
        node: impl Fn(usize) -> BuiltNode,
        parallel: bool,
        scratch: &mut S,
        below: impl FnOnce(&mut Built, &mut S) + Send,
        above: impl FnOnce(&mut Built, &mut S) + Send,
    ) {
        let at = self.nodes.len();
        self.nodes.push(node(0));
        if !parallel {
            below(self, scratch);
            self.nodes[at] = node(self.nodes.len() - at);
            return above(self, scratch);
        }
        let mut other = Built::default();
        rayon::join(
            || below(self, scratch),
            || above(&mut other, &mut S::default()),
        );
        self.nodes[at] = node(self.nodes.len() - at);
        self.nodes.append(&mut other.nodes);
        self.references.append(&mut other.references);
        self.boxes.append(&mut other.boxes);
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
    /// The corners of the node's triangles, side by side: they are gone through once a direction.
    corners: Vec<[[f32; 3]; 3]>,
    events: Events,
    directions: Vec<[f32; 3]>,
    profile: Profile,
    heights: Vec<f64>,
    cut: CutScratch,
}

struct Builder<'a> {
    mesh: &'a Mesh,
    normals: Vec<[f32; 3]>,
    /// The directions of the whole tree, where it has such.
    fixed: Vec<[f32; 3]>,
    choice: TreeChoice,
    params: &'a BuildParams,
    max_depth: u32,
    /// The tolerance of ties; `None` as published.
    tolerance: Option<f32>,
}

/// Builds the tree, on the threads of the current rayon pool.
pub(crate) fn grow(mesh: &Mesh, choice: TreeChoice, params: &BuildParams) -> Built {
    if choice.spec.objects {
        return objects::grow(mesh, params);
    }
    let triangles = mesh.usable_triangles().to_vec();
    let bounds = mesh.bounds();
    let builder = Builder {
        mesh,
        normals: (0..mesh.triangles().len() as u32)
            .map(|i| mesh.normal(i))
            .collect(),
        fixed: match choice.spec.directions {
            Directions::Fixed => fixed::directions(
                choice.direction_count.unwrap_or_default() as usize,
                choice.spec.axes,
            ),
            _ => Vec::new(),
        },
        choice,
        params,
        max_depth: params.max_depth.for_triangles(triangles.len()),
        tolerance: match params.ties {
            Ties::AsPublished => None,
            Ties::Tolerant => Some(params.ties.tolerance(&bounds)),
        },
    };
    let mut built = Built::default();
    let root = Node {
        triangles,
        cell: Cell::Box(bounds),
        depth: 0,
        bad_refines: 0,
        path: Random::new(params.seed).next(),
    };
    builder.grow(root, &mut built, &mut Scratch::default());
    built.fixed = builder.fixed;
    built
}

impl BuildStats {
    fn count_win(&mut self, plane: &SplitPlane) {
        let wins = &mut self.wins;
        *match plane.origin {
            _ if plane.is_axis() => &mut wins.axis,
            Origin::Axis | Origin::Fixed(_) | Origin::Direction => &mut wins.direction,
            Origin::Triangle => &mut wins.triangle,
            Origin::Edge => &mut wins.edge,
        } += 1;
    }
}

impl Builder<'_> {
    /// Appends the subtree of `node`.
    fn grow(&self, node: Node, built: &mut Built, scratch: &mut Scratch) {
        let area = if node.triangles.is_empty() {
            0.0
        } else {
            node.cell.surface_area()
        };
        let Some(choice) = self.split(&node, scratch, &mut built.stats) else {
            built.nodes.push(BuiltNode::Leaf {
                count: node.triangles.len(),
                area,
            });
            built.references.extend_from_slice(&node.triangles);
            return;
        };
        let plane = choice.plane;
        built.stats.count_win(&plane);
        let (below, above) = self.children(node, &choice, &mut built.stats, scratch);
        built.join(
            |above| BuiltNode::Interior { plane, above, area },
            below.triangles.len().min(above.triangles.len()) >= PARALLEL_FROM,
            scratch,
            |built, scratch| self.grow(below, built, scratch),
            |built, scratch| self.grow(above, built, scratch),
        );
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
        scratch.corners.clear();
        scratch
            .corners
            .extend(node.triangles.iter().map(|&i| self.mesh.corners(i)));
        let (contest, candidates) = self.contest(node, scratch);
        stats.candidates += candidates;
        let choice = contest.decide(self.choice.spec, self.params, n)?;
        let bad_refines = node.bad_refines + u8::from(choice.bad_refine);
        (!choice.hopeless && bad_refines < MAX_BAD_REFINES).then_some(choice)
    }

    /// All candidates of a node.
    fn contest(&self, node: &Node, scratch: &mut Scratch) -> (Contest<SplitPlane>, u64) {
        let spec = self.choice.spec;
        let mut contest = Contest::new();
        let mut candidates = 0;
        let polytope = if spec.only_axes() {
            None
        } else {
            Some(node.cell.to_polytope())
        };
        let Scratch {
            corners,
            events,
            directions,
            profile,
            heights,
            ..
        } = scratch;
        let mut sweep = |normal: [f32; 3], origin: Origin| {
            let mut plane = SplitPlane {
                normal,
                boundary: Boundary {
                    offset: 0.0,
                    touching: Touching::Both,
                },
                origin,
            };
            let axis = plane.axis();
            let extents = corners
                .iter()
                .map(|corners| self.extent(axis, normal, corners));
            events.fill(extents, self.tolerance);
            match (&node.cell, axis, &polytope) {
                (Cell::Box(aabb), Some(axis), _) => profile.fill_box(aabb, axis),
                (_, _, Some(polytope)) => {
                    let direction = glam::Vec3::from(normal).as_dvec3();
                    profile.aim(polytope, direction);
                    if events.any_inside(profile) {
                        profile.fill_polytope(polytope, direction);
                    }
                }
                (Cell::Polytope(_), _, None) | (_, None, None) => {
                    unreachable!("only where all candidates are across axes there is no polytope")
                }
            }
            let (best, inside) = events.sweep(self.tolerance, profile, self.params.empty_bonus);
            candidates += inside;
            if let Some(best) = best {
                plane.boundary = best.boundary;
                contest.enter(plane, origin == Origin::Axis, best);
            }
        };
        if spec.axes {
            AXES.into_iter().for_each(|axis| sweep(axis, Origin::Axis));
        }
        directions.clear();
        let view = NodeView {
            normals: &self.normals,
            triangles: &node.triangles,
            fixed: &self.fixed,
            random: Random::new(node.path),
        };
        directions::generate(self.choice, view, directions);
        for (i, &direction) in directions.iter().enumerate() {
            let origin = match spec.directions {
                Directions::Fixed => Origin::Fixed((i + if spec.axes { 3 } else { 0 }) as u8),
                _ => Origin::Direction,
            };
            sweep(direction, origin);
        }
        if let (true, Some(polytope)) = (spec.triangle_planes, &polytope) {
            candidates += self.triangle_planes(corners, polytope, &mut contest, heights);
        }
        (contest, candidates)
    }

    /// Enters the planes of the node's triangles and says how many there were.
    fn triangle_planes(
        &self,
        corners: &[[[f32; 3]; 3]],
        cell: &Polytope,
        contest: &mut Contest<SplitPlane>,
        heights: &mut Vec<f64>,
    ) -> u64 {
        let ties = self.params.ties;
        let counter = Counter::new(corners.to_vec(), ties, ties.overhang(&self.mesh.bounds()));
        let area = cell.surface_area();
        let mut entered = 0;
        // Triangles of one plane, and neighbours, give the same candidates again and again: whether
        // each passed through the cell.
        let mut known = HashMap::new();
        for candidate in corners.iter().flat_map(triangle_planes::candidates) {
            let key = (
                candidate.normal.map(f32::to_bits),
                counter.offset(&candidate).to_bits(),
            );
            if corners.len() >= REMEMBER_FROM
                && known.get(&key).is_some_and(|&inside| {
                    entered += u64::from(inside);
                    true
                })
            {
                continue;
            }
            let bonus = self.params.empty_bonus;
            let priced = triangle_planes::price(
                &candidate,
                &counter,
                cell,
                area,
                self.tolerance,
                bonus,
                heights,
            );
            if corners.len() >= REMEMBER_FROM {
                known.insert(key, priced.is_some());
            }
            if let Some(best) = priced {
                entered += 1;
                let origin = if candidate.is_edge {
                    Origin::Edge
                } else {
                    Origin::Triangle
                };
                let plane = SplitPlane {
                    normal: candidate.normal,
                    boundary: best.boundary,
                    origin,
                };
                contest.enter(plane, false, best);
            }
        }
        entered
    }

    /// The extent of a triangle along a direction, which may be an axis.
    #[inline(always)]
    fn extent(&self, axis: Option<usize>, normal: [f32; 3], corners: &[[f32; 3]; 3]) -> (f32, f32) {
        let Some(axis) = axis else {
            return self.params.ties.extent(normal, corners);
        };
        let [a, b, c] = corners.map(|p| p[axis]);
        (a.min(b).min(c), a.max(b).max(c))
    }

    /// The two children of the node that was last split.
    fn children(
        &self,
        node: Node,
        choice: &Choice<SplitPlane>,
        stats: &mut BuildStats,
        scratch: &mut Scratch,
    ) -> (Node, Node) {
        let plane = choice.plane;
        let axis = plane.axis();
        let mut sides = [Vec::new(), Vec::new()];
        for (&triangle, corners) in node.triangles.iter().zip(&scratch.corners) {
            let (below, above) = plane
                .boundary
                .sides(self.extent(axis, plane.normal, corners));
            if below {
                sides[0].push(triangle);
            }
            if above {
                sides[1].push(triangle);
            }
        }
        let cut = node.cell.cut(&plane, &mut scratch.cut);
        stats.bad_refines += u64::from(choice.bad_refine);
        stats.uncut_cells += u64::from(cut.is_none());
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
        (child(below, cells.0), child(above, cells.1))
    }
}
