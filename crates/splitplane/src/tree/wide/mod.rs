//! The wide layout: nodes of eight boxes, leaves of up to eight triangles, both side by side for
//! SIMD. Any tree can be stored in it.
//!
//! What of a mesh lies in a cell is cut out and boxed (`boxes`), binary nodes are merged into wide
//! ones where that is cheapest (`collapse`), and the result is written in the order in which
//! queries read it (`store`).

mod boxes;
mod collapse;
mod store;

use bytemuck::{Pod, Zeroable};

use super::stored::Stored;
use super::{Tree, WideCard};
use crate::build::{BuildError, BuildParams};
use crate::geometry::{Aabb, Frame};

/// Children of a node, triangles of a leaf: as many as an AVX register has lanes.
pub(crate) const WIDTH: usize = 8;

/// What a visit of a leaf of so many triangles costs, in units of a full one. They are tested side by
/// side, but each is memory to be read, and may be met elsewhere than in the leaf.
#[inline(always)]
pub(crate) fn leaf_cost(triangles: usize) -> f32 {
    0.5 + 0.5 / WIDTH as f32 * triangles as f32
}

/// How deep a wide tree may be: that of the deepest binary tree, and what large leaves add.
pub(crate) const MAX_DEPTH: usize = BuildParams::MAX_DEPTH as usize + 30;

/// How many frames a tree may have.
pub(crate) const MAX_FRAMES: usize = 64;

/// Boxes of up to eight children: 256 bytes.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C, align(64))]
pub(crate) struct WideNode {
    /// Low x, y, z, then high x, y, z of the children, in the node's frame, relative to the centre
    /// of the scene. An absent child has its low above its high.
    pub(crate) bounds: [[f32; WIDTH]; 6],
    pub(crate) children: [Link; WIDTH],
    /// The frame that the boxes are in.
    pub(crate) frame: u32,
    unused: [u32; 7],
}

const _: () = assert!(size_of::<WideNode>() == 256);

/// Rows of a leaf: the coordinates of three corners, and an index.
pub(crate) const LEAF_ROWS: usize = 10;

/// A child: a node by its index, or a leaf's triangles by where they are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(transparent)]
pub(crate) struct Link(u32);

/// What a [`Link`] names.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Child {
    Node(usize),
    /// Triangles in a row: 1 to 8 of them.
    Leaf {
        start: usize,
        count: usize,
    },
}

impl Link {
    pub(crate) const ROOT: Link = Link(0);
    const LEAF: u32 = 1 << 31;
    const START_BITS: u32 = 28;
    /// Where a leaf's triangles may start, and what number a node may have, at most.
    const MAX_START: usize = (1 << Link::START_BITS) - 1;
    const MAX_NODE: usize = (1 << 31) - 1;

    fn node(index: usize) -> Link {
        debug_assert!(index <= Link::MAX_NODE);
        Link(index as u32)
    }

    fn leaf(start: usize, count: usize) -> Link {
        debug_assert!(start <= Link::MAX_START && (1..=WIDTH).contains(&count));
        Link(Link::LEAF | (count as u32 - 1) << Link::START_BITS | start as u32)
    }

    /// The index of the node, or of the root where it is a leaf. Without a branch: which one it is
    /// is hard to foresee.
    #[inline(always)]
    pub(crate) fn node_or_root(self) -> usize {
        std::hint::select_unpredictable(self.0 & Link::LEAF == 0, self.0 as usize, 0)
    }

    #[inline(always)]
    pub(crate) fn child(self) -> Child {
        if self.0 & Link::LEAF == 0 {
            return Child::Node(self.0 as usize);
        }
        Child::Leaf {
            start: (self.0 as usize) & Link::MAX_START,
            count: (self.0 >> Link::START_BITS & 7) as usize + 1,
        }
    }
}

/// A tree in the wide layout.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Wide {
    pub(crate) nodes: Stored<WideNode>,
    /// Ten rows a leaf, as long as the leaf has triangles: the bits of x, y and z of their three
    /// corners, then their indices. Padded so that eight numbers can be read from the start of
    /// every row.
    pub(crate) leaves: Stored<u32>,
    /// The frames of the nodes, the world's first.
    pub(crate) frames: Vec<Frame>,
    /// The centre of the scene, which boxes are relative to.
    pub(crate) center: [f32; 3],
    /// How far the scene reaches from there along an axis, at most.
    pub(crate) half_extent: f32,
}

impl PartialEq for WideNode {
    fn eq(&self, other: &WideNode) -> bool {
        bytemuck::bytes_of(self) == bytemuck::bytes_of(other)
    }
}

impl WideNode {
    /// The children that there are, with their places.
    pub(crate) fn present(&self) -> impl Iterator<Item = (usize, Child)> {
        (0..WIDTH)
            .filter(|&i| self.bounds[0][i] <= self.bounds[3][i])
            .map(|i| (i, self.children[i].child()))
    }

    /// The box of a child, in the node's frame, relative to the centre of the scene.
    pub(crate) fn child_bounds(&self, slot: usize) -> Aabb {
        let corner = |high: usize| std::array::from_fn(|axis| self.bounds[high + axis][slot]);
        Aabb {
            min: corner(0),
            max: corner(3),
        }
    }

    /// Whether a point of the world is in the box of a child.
    pub(crate) fn holds(&self, slot: usize, p: [f64; 3], wide: &Wide) -> bool {
        let relative = std::array::from_fn(|i| p[i] - f64::from(wide.center[i]));
        let p = wide.frames[self.frame as usize].map(relative);
        (0..3).all(|axis| {
            let (low, high) = (self.bounds[axis][slot], self.bounds[axis + 3][slot]);
            f64::from(low) <= p[axis] && p[axis] <= f64::from(high)
        })
    }
}

impl Wide {
    pub(crate) fn of(tree: &Tree) -> Result<Wide, BuildError> {
        store::store(tree, &collapse::collapse(tree))
    }

    /// The centre of a scene in that box, and how far the scene reaches from there.
    pub(crate) fn scale(bounds: &Aabb) -> ([f32; 3], f32) {
        let center = match bounds.is_empty() {
            true => [0.0; 3],
            false => bounds.center(),
        };
        // More than half the longest edge: the centre is rounded.
        let half_extent =
            bounds.extent().into_iter().fold(0.0, f32::max) * 0.5 + f32::EPSILON * bounds.reach();
        (center, half_extent)
    }

    pub(crate) fn card(&self) -> WideCard {
        let mut frames = vec![0; self.frames.len()];
        let (mut leaves, mut deepest) = (0, 0);
        let mut pending = vec![(0, 0)];
        while let Some((at, depth)) = pending.pop() {
            let node: &WideNode = &self.nodes[at];
            frames[node.frame as usize] += 1;
            deepest = deepest.max(depth);
            for (_, child) in node.present() {
                match child {
                    Child::Node(child) => pending.push((child, depth + 1)),
                    Child::Leaf { .. } => leaves += 1,
                }
            }
        }
        WideCard {
            nodes: self.nodes.len() as u64,
            leaves,
            references: self.references() as u64,
            depth: deepest,
            frames,
        }
    }

    /// Where a node or a leaf begins in memory.
    #[inline(always)]
    pub(crate) fn address(&self, link: Link) -> *const u8 {
        let node = (self.nodes.as_ptr().cast::<u8>())
            .wrapping_byte_add(link.0 as usize * size_of::<WideNode>());
        let start = link.0 as usize & Link::MAX_START;
        let leaf = (self.leaves.as_ptr().cast::<u8>())
            .wrapping_byte_add(start * LEAF_ROWS * size_of::<u32>());
        // Not a branch: what is next is hard to foresee.
        std::hint::select_unpredictable(link.0 & Link::LEAF == 0, node, leaf)
    }

    /// How many triangles the leaves have, together.
    pub(crate) fn references(&self) -> usize {
        (self.leaves.len() - WIDTH) / LEAF_ROWS
    }

    /// The triangles of a leaf.
    #[inline(always)]
    pub(crate) fn triangles(&self, start: usize, count: usize) -> &[u32] {
        &self.leaves[LEAF_ROWS * start..][(LEAF_ROWS - 1) * count..][..count]
    }

    /// The different triangles of a child and all below it, in order.
    pub(crate) fn triangles_below(&self, child: Child) -> Vec<u32> {
        let mut triangles = Vec::new();
        let mut pending = vec![child];
        while let Some(child) = pending.pop() {
            match child {
                Child::Node(at) => {
                    pending.extend(self.nodes[at].present().map(|(_, child)| child));
                }
                Child::Leaf { start, count } => {
                    triangles.extend_from_slice(self.triangles(start, count));
                }
            }
        }
        triangles.sort_unstable();
        triangles.dedup();
        triangles
    }

    pub(crate) fn bytes(&self) -> usize {
        size_of_val(&*self.nodes) + size_of_val(&*self.leaves)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_link_says_what_it_was_told() {
        assert_eq!(Link::node(77).child(), Child::Node(77));
        for (start, count) in [(0, 1), (5, 8), (Link::MAX_START, 3)] {
            assert_eq!(
                Link::leaf(start, count).child(),
                Child::Leaf { start, count }
            );
        }
    }
}
