//! What a build gives, before it is stored as nodes of a layout.

use std::collections::BTreeMap;

use super::params::BuildStats;
use crate::geometry::{Aabb, Frame};

pub(super) const AXES: [[f32; 3]; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// A plane that splits a node.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct SplitPlane {
    pub(crate) normal: [f32; 3],
    pub(crate) offset: f32,
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

/// A node in depth-first order; the child below follows its parent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum BuiltNode {
    Interior {
        plane: SplitPlane,
        /// How many nodes after this one the child above comes.
        above: u32,
    },
    /// The children have boxes of their own, in a frame.
    Objects {
        above: u32,
        /// The frame of the children's boxes.
        frame: u32,
    },
    /// The next `count` of the references.
    Leaf { count: u32 },
}

// All of them are there at once.
const _: () = assert!(size_of::<BuiltNode>() == 24);

/// Nodes that follow each other, with what belongs to them.
#[derive(Debug, Default, PartialEq)]
pub(crate) struct Piece {
    pub(crate) nodes: Vec<BuiltNode>,
    pub(crate) references: Vec<u32>,
    /// The nodes' boxes, each in the frame that its parent names; empty where nodes have planes.
    pub(crate) boxes: Vec<Aabb>,
}

/// What a build gives.
#[derive(Debug, Default)]
pub(crate) struct Built {
    /// All nodes in order: subtrees of other threads are not copied to where they belong.
    pub(crate) pieces: Vec<Piece>,
    node_count: usize,
    /// The frames of the boxes, where there are others than the world's.
    pub(crate) frames: Vec<Frame>,
    pub(crate) stats: BuildStats,
    pub(crate) work: Work,
    /// In areas.
    pub(crate) expected: Expected,
    /// The directions of the whole tree, where it has such.
    pub(crate) fixed: Vec<[f32; 3]>,
}

/// How much a build has done: exact, so that a build which does more than the last one is seen,
/// whatever the machine. Candidates are in [`BuildStats`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Work {
    /// Directions along which the triangles of a node were swept.
    pub(crate) sweeps: u64,
    /// Events that were swept: those of the triangles, along each direction.
    pub(crate) events: u64,
    /// Planes across oblique directions, or in oblique cells, whose areas were computed.
    pub(crate) areas: u64,
    /// References that were handed to children.
    pub(crate) moved: u64,
}

impl std::ops::AddAssign for Work {
    fn add_assign(&mut self, other: Work) {
        self.sweeps += other.sweeps;
        self.events += other.events;
        self.areas += other.areas;
        self.moved += other.moved;
    }
}

/// What a random line through the scene's box meets on average: areas of cells, or those over that
/// of the box.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Expected {
    pub(crate) axis_visits: f64,
    pub(crate) oblique_visits: f64,
    /// Triangle tests by the size of the leaf.
    pub(crate) tests: BTreeMap<u32, f64>,
}

impl Expected {
    fn interior(&mut self, node: &BuiltNode, area: f64) {
        *(match node {
            BuiltNode::Interior { plane, .. } if !plane.is_axis() => &mut self.oblique_visits,
            _ => &mut self.axis_visits,
        }) += area;
    }

    fn leaf(&mut self, count: usize, area: f64) {
        if count > 0 {
            *self.tests.entry(count as u32).or_default() += count as f64 * area;
        }
    }

    /// Where these are areas, and this is that of the scene's box: 0 where nothing is in it.
    pub(crate) fn over(mut self, area: f64) -> Self {
        if area == 0.0 {
            return Expected::default();
        }
        self.axis_visits /= area;
        self.oblique_visits /= area;
        self.tests.values_mut().for_each(|tests| *tests /= area);
        self
    }
}

impl std::ops::AddAssign for Expected {
    fn add_assign(&mut self, other: Expected) {
        self.axis_visits += other.axis_visits;
        self.oblique_visits += other.oblique_visits;
        for (size, tests) in other.tests {
            *self.tests.entry(size).or_default() += tests;
        }
    }
}

impl Built {
    fn last(&mut self) -> &mut Piece {
        if self.pieces.is_empty() {
            self.pieces.push(Piece::default());
        }
        let last = self.pieces.len() - 1;
        &mut self.pieces[last]
    }

    /// The box of the node that comes next.
    pub(super) fn bounds(&mut self, bounds: Aabb) {
        self.last().boxes.push(bounds);
    }

    /// Appends a leaf of this area.
    pub(super) fn leaf(&mut self, triangles: impl ExactSizeIterator<Item = u32>, area: f64) {
        let last = self.last();
        let count = triangles.len();
        last.nodes.push(BuiltNode::Leaf {
            count: count as u32,
        });
        last.references.extend(triangles);
        self.node_count += 1;
        self.expected.leaf(count, area);
    }

    /// Appends an interior node of this area and its subtrees, in parallel if that is worth it.
    /// `node` is told how many nodes after it the child above comes; `scratch` are buffers of one
    /// thread.
    pub(super) fn join<S: Default + Send>(
        &mut self,
        (node, area): (impl Fn(u32) -> BuiltNode, f64),
        parallel: bool,
        scratch: &mut S,
        below: impl FnOnce(&mut Built, &mut S) + Send,
        above: impl FnOnce(&mut Built, &mut S) + Send,
    ) {
        self.expected.interior(&node(0), area);
        let first = self.node_count;
        let nodes = &mut self.last().nodes;
        let at = nodes.len();
        nodes.push(node(0));
        let piece = self.pieces.len() - 1;
        self.node_count += 1;
        let set_above = |built: &mut Built| {
            // Too many for any layout where it is more.
            let distance = u32::try_from(built.node_count - first).unwrap_or(u32::MAX);
            built.pieces[piece].nodes[at] = node(distance);
        };
        if !parallel {
            below(self, scratch);
            set_above(self);
            return above(self, scratch);
        }
        let mut other = Built::default();
        rayon::join(
            || below(self, scratch),
            || above(&mut other, &mut S::default()),
        );
        set_above(self);
        self.append(other);
    }

    fn append(&mut self, mut other: Built) {
        // Nothing is added to it any more.
        self.last().shrink_to_fit();
        self.pieces.append(&mut other.pieces);
        self.node_count += other.node_count;
        self.stats += other.stats;
        self.work += other.work;
        self.expected += other.expected;
    }
}

impl Piece {
    fn shrink_to_fit(&mut self) {
        self.nodes.shrink_to_fit();
        self.references.shrink_to_fit();
        self.boxes.shrink_to_fit();
    }
}
