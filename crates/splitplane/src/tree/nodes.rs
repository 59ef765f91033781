//! How nodes are stored: 8 bytes in kd-trees, 20 bytes where planes are oblique.
//!
//! Nodes lie in depth-first order: the child below follows its parent, that above is named by its
//! index. Where a leaf has one triangle, the node holds its index; otherwise the node says where
//! the leaf's references start.

use bytemuck::{Pod, Zeroable};

use crate::build::{BuildError, BuiltNode, Origin, Piece, SplitPlane};
use crate::geometry::{Aabb, Frame};

/// Bits 0 to 2 of a node's `meta`: an axis, or one of these. The other bits are the index of the
/// child above, or a leaf's number of triangles.
const LEAF: u32 = 3;
const OBLIQUE: u32 = 4;
/// A plane across an axis, in a tree whose nodes are all oblique.
const OBLIQUE_AXIS: u32 = 5;
const KIND_BITS: u32 = 3;
const KIND_MASK: u32 = (1 << KIND_BITS) - 1;

/// A node of a kd-tree: 8 bytes.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct KdNode {
    /// A split's offset (the bits of an f32), or where a leaf's references are.
    payload: u32,
    meta: u32,
}

/// A node of a tree with a fixed set of directions: 8 bytes. The low bits of `meta`, as many as
/// the number of directions needs, are the index of a direction, or all ones in a leaf.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct IndexedNode {
    payload: u32,
    meta: u32,
}

/// A node of a tree with oblique planes: 20 bytes.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct ObliqueNode {
    normal: [f32; 3],
    kd: KdNode,
}

/// A node with a box: 32 bytes. The box is in the frame that the parent names; the payload of an
/// interior node names the frame of its children's boxes.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct BoxNode {
    min: [f32; 3],
    max: [f32; 3],
    kd: KdNode,
}

const _: () = assert!(size_of::<BoxNode>() == 32);
const _: () = assert!(
    size_of::<KdNode>() == 8 && size_of::<IndexedNode>() == 8 && size_of::<ObliqueNode>() == 20
);

/// What a node says, whatever its layout.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum View {
    Axis {
        axis: usize,
        offset: f32,
        above: usize,
    },
    Oblique {
        normal: [f32; 3],
        offset: f32,
        above: usize,
        /// The plane is across an axis that was a candidate as such.
        is_axis: bool,
    },
    /// The children have boxes of their own, which may overlap.
    Objects {
        above: usize,
        /// The frame of the children's boxes.
        frame: u32,
    },
    Leaf(Leaf),
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Leaf {
    pub(crate) count: u32,
    payload: u32,
}

impl Leaf {
    /// The leaf's triangles; `None` where its references do not exist.
    pub(crate) fn try_triangles<'a>(&'a self, references: &'a [u32]) -> Option<&'a [u32]> {
        let start = self.payload as usize;
        match self.count {
            0 | 1 => Some(self.triangles(references)),
            count => references.get(start..)?.get(..count as usize),
        }
    }

    /// The leaf's triangles.
    #[inline(always)]
    pub(crate) fn triangles<'a>(&'a self, references: &'a [u32]) -> &'a [u32] {
        match self.count {
            0 => &[],
            1 => std::slice::from_ref(&self.payload),
            count => &references[self.payload as usize..][..count as usize],
        }
    }
}

/// What all nodes of a tree share.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Shared {
    /// The directions that indexed nodes name.
    pub(crate) directions: Vec<[f32; 3]>,
    /// How many bits name a direction.
    direction_bits: u32,
    /// Planes across an axis make kd nodes.
    axis_nodes: bool,
    /// The frames that boxes are in, the world's first.
    pub(crate) frames: Vec<Frame>,
}

impl Shared {
    pub(crate) fn new(directions: Vec<[f32; 3]>, frames: Vec<Frame>, axis_nodes: bool) -> Self {
        let direction_bits = (directions.len() as u32)
            .checked_ilog2()
            .map_or(0, |log2| log2 + 1);
        Shared {
            directions,
            direction_bits,
            axis_nodes,
            frames,
        }
    }
}

impl Shared {
    /// A frame by its index.
    pub(crate) fn frame(&self, index: u32) -> &Frame {
        self.frames.get(index as usize).unwrap_or(&Frame::IDENTITY)
    }
}

/// A layout of nodes.
pub(crate) trait Layout: Pod + Send + Sync {
    /// The largest index of a child, and the largest leaf.
    fn limit(shared: &Shared) -> usize;
    /// Whether the node says what a node of this layout can say, so that it can be viewed.
    fn is_sound(&self, shared: &Shared) -> bool;
    fn view(&self, shared: &Shared) -> View;
    fn leaf(payload: u32, count: u32, shared: &Shared) -> Self;
    fn interior(plane: &SplitPlane, above: u32, shared: &Shared) -> Self;

    /// A node whose children have boxes, in the frame named. Only one layout has such.
    fn objects(_above: u32, _frame: u32) -> Self {
        unreachable!("nodes with planes have no boxes")
    }

    /// The node's box.
    #[inline(always)]
    fn bounds(&self) -> Aabb {
        unreachable!("nodes with planes have no boxes")
    }

    /// Gives the node its box.
    fn set_bounds(&mut self, _bounds: Aabb) {
        unreachable!("nodes with planes have no boxes")
    }
}

impl Layout for KdNode {
    fn limit(_: &Shared) -> usize {
        (u32::MAX >> KIND_BITS) as usize
    }

    fn is_sound(&self, _: &Shared) -> bool {
        match self.meta & KIND_MASK {
            LEAF => true,
            kind => kind < LEAF && f32::from_bits(self.payload).is_finite(),
        }
    }

    #[inline(always)]
    fn view(&self, _: &Shared) -> View {
        let above = self.meta >> KIND_BITS;
        match self.meta & KIND_MASK {
            LEAF => View::Leaf(Leaf {
                count: above,
                payload: self.payload,
            }),
            axis => View::Axis {
                axis: axis as usize,
                offset: f32::from_bits(self.payload),
                above: above as usize,
            },
        }
    }

    fn leaf(payload: u32, count: u32, _: &Shared) -> Self {
        KdNode {
            payload,
            meta: count << KIND_BITS | LEAF,
        }
    }

    fn interior(plane: &SplitPlane, above: u32, _: &Shared) -> Self {
        let axis = plane.axis().expect("a kd-tree splits along axes only") as u32;
        KdNode {
            payload: plane.offset.to_bits(),
            meta: above << KIND_BITS | axis,
        }
    }
}

impl Layout for IndexedNode {
    fn limit(shared: &Shared) -> usize {
        (u32::MAX >> shared.direction_bits) as usize
    }

    fn is_sound(&self, shared: &Shared) -> bool {
        let leaf = (1 << shared.direction_bits) - 1;
        match self.meta & leaf {
            index if index == leaf => true,
            index => {
                let direction = shared.directions.get(index as usize);
                direction.is_some_and(|d| d.iter().all(|c| c.is_finite()))
                    && f32::from_bits(self.payload).is_finite()
            }
        }
    }

    #[inline(always)]
    fn view(&self, shared: &Shared) -> View {
        let leaf = (1 << shared.direction_bits) - 1;
        let index = self.meta & leaf;
        let above = self.meta >> shared.direction_bits;
        if index == leaf {
            return View::Leaf(Leaf {
                count: above,
                payload: self.payload,
            });
        }
        let (offset, above, index) = (f32::from_bits(self.payload), above as usize, index as usize);
        // Where axes are nodes of their own, they are the first of the directions.
        if shared.axis_nodes && index < 3 {
            return View::Axis {
                axis: index,
                offset,
                above,
            };
        }
        let normal = shared.directions[index];
        let is_axis = normal.iter().filter(|&&c| c != 0.0).count() == 1;
        View::Oblique {
            normal,
            offset,
            above,
            is_axis,
        }
    }

    fn leaf(payload: u32, count: u32, shared: &Shared) -> Self {
        let leaf = (1 << shared.direction_bits) - 1;
        IndexedNode {
            payload,
            meta: count << shared.direction_bits | leaf,
        }
    }

    fn interior(plane: &SplitPlane, above: u32, shared: &Shared) -> Self {
        let index = match plane.origin {
            Origin::Fixed(index) => u32::from(index),
            _ => plane
                .axis()
                .expect("a plane across a fixed direction or an axis") as u32,
        };
        IndexedNode {
            payload: plane.offset.to_bits(),
            meta: above << shared.direction_bits | index,
        }
    }
}

impl Layout for ObliqueNode {
    fn limit(shared: &Shared) -> usize {
        KdNode::limit(shared)
    }

    fn is_sound(&self, shared: &Shared) -> bool {
        match self.kd.meta & KIND_MASK {
            OBLIQUE | OBLIQUE_AXIS => {
                self.normal.iter().all(|c| c.is_finite())
                    && f32::from_bits(self.kd.payload).is_finite()
            }
            _ => self.kd.is_sound(shared),
        }
    }

    #[inline(always)]
    fn view(&self, shared: &Shared) -> View {
        let kind = self.kd.meta & KIND_MASK;
        if kind < OBLIQUE {
            return self.kd.view(shared);
        }
        View::Oblique {
            normal: self.normal,
            offset: f32::from_bits(self.kd.payload),
            above: (self.kd.meta >> KIND_BITS) as usize,
            is_axis: kind == OBLIQUE_AXIS,
        }
    }

    fn leaf(payload: u32, count: u32, shared: &Shared) -> Self {
        ObliqueNode {
            normal: [0.0; 3],
            kd: KdNode::leaf(payload, count, shared),
        }
    }

    fn interior(plane: &SplitPlane, above: u32, shared: &Shared) -> Self {
        let kind = match plane.axis() {
            Some(axis) if plane.origin == Origin::Axis => match shared.axis_nodes {
                true => axis as u32,
                false => OBLIQUE_AXIS,
            },
            _ => OBLIQUE,
        };
        let kd = KdNode {
            payload: plane.offset.to_bits(),
            meta: above << KIND_BITS | kind,
        };
        ObliqueNode {
            normal: plane.normal,
            kd,
        }
    }
}

impl Layout for BoxNode {
    fn limit(shared: &Shared) -> usize {
        KdNode::limit(shared)
    }

    fn is_sound(&self, shared: &Shared) -> bool {
        !self.min.iter().chain(&self.max).any(|c| c.is_nan())
            && match self.kd.meta & KIND_MASK {
                LEAF => true,
                kind => kind == 0 && (self.kd.payload as usize) < shared.frames.len().max(1),
            }
    }

    #[inline(always)]
    fn view(&self, shared: &Shared) -> View {
        match self.kd.view(shared) {
            View::Axis { above, .. } => View::Objects {
                above,
                frame: self.kd.payload,
            },
            view => view,
        }
    }

    fn leaf(payload: u32, count: u32, shared: &Shared) -> Self {
        let Aabb { min, max } = Aabb::EMPTY;
        BoxNode {
            min,
            max,
            kd: KdNode::leaf(payload, count, shared),
        }
    }

    fn interior(_: &SplitPlane, _: u32, _: &Shared) -> Self {
        unreachable!("nodes with boxes have no planes")
    }

    fn objects(above: u32, frame: u32) -> Self {
        let Aabb { min, max } = Aabb::EMPTY;
        BoxNode {
            min,
            max,
            kd: KdNode {
                payload: frame,
                meta: above << KIND_BITS,
            },
        }
    }

    #[inline(always)]
    fn bounds(&self) -> Aabb {
        Aabb {
            min: self.min,
            max: self.max,
        }
    }

    fn set_bounds(&mut self, Aabb { min, max }: Aabb) {
        (self.min, self.max) = (min, max);
    }
}

/// Stores built nodes, and the references of the leaves that have more than one triangle. Each piece
/// is freed when it is stored.
pub(crate) fn store<N: Layout>(
    pieces: Vec<Piece>,
    shared: &Shared,
) -> Result<(Vec<N>, Vec<u32>), BuildError> {
    let limit = N::limit(shared);
    let node_count = pieces.iter().map(|piece| piece.nodes.len()).sum();
    let references = pieces.iter().map(|piece| piece.references.len()).sum();
    for (what, count) in [("nodes", node_count), ("references", references)] {
        if count > limit {
            return Err(BuildError::TooLarge { what, count, limit });
        }
    }
    let mut nodes: Vec<N> = Vec::with_capacity(node_count);
    let mut kept = Vec::new();
    for piece in pieces {
        let first = nodes.len();
        let mut rest = piece.references.as_slice();
        for node in &piece.nodes {
            let at = nodes.len() as u32;
            nodes.push(match *node {
                BuiltNode::Interior { plane, above } => N::interior(&plane, at + above, shared),
                BuiltNode::Objects { above, frame } => N::objects(at + above, frame),
                BuiltNode::Leaf { count } => {
                    let (own, others) = rest.split_at(count as usize);
                    rest = others;
                    let payload = if let [triangle] = own {
                        *triangle
                    } else {
                        kept.len() as u32
                    };
                    if count > 1 {
                        kept.extend_from_slice(own);
                    }
                    N::leaf(payload, count, shared)
                }
            });
        }
        for (node, &bounds) in nodes[first..].iter_mut().zip(&piece.boxes) {
            node.set_bounds(bounds);
        }
    }
    kept.shrink_to_fit();
    Ok((nodes, kept))
}
