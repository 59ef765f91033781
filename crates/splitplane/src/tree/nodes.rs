//! How nodes are stored: 8 bytes in kd-trees, 20 bytes where planes are oblique.
//!
//! Nodes lie in depth-first order: the child below follows its parent, that above is named by its
//! index. Where a leaf has one triangle, the node holds its index; otherwise the node says where
//! the leaf's references start.

use bytemuck::{Pod, Zeroable};

use crate::build::{BuildError, BuiltNode, SplitPlane};

/// Bits 0 to 2 of a node's `meta`: an axis, or one of these. The other bits are the index of the
/// child above, or a leaf's number of triangles.
const LEAF: u32 = 3;
const OBLIQUE: u32 = 4;
const KIND_BITS: u32 = 3;
const KIND_MASK: u32 = (1 << KIND_BITS) - 1;
/// The largest index of a child, and the largest leaf.
pub(crate) const LIMIT: usize = (u32::MAX >> KIND_BITS) as usize;

/// A node of a kd-tree: 8 bytes.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct KdNode {
    /// A split's offset (the bits of an f32), or where a leaf's references are.
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

const _: () = assert!(size_of::<KdNode>() == 8 && size_of::<ObliqueNode>() == 20);

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
            count => references.get(start..start + count as usize),
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

/// A layout of nodes.
pub(crate) trait Layout: Pod + Send + Sync {
    fn view(&self) -> View;
    fn leaf(payload: u32, count: u32) -> Self;
    fn interior(plane: &SplitPlane, above: u32) -> Self;
}

impl Layout for KdNode {
    #[inline(always)]
    fn view(&self) -> View {
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

    fn leaf(payload: u32, count: u32) -> Self {
        KdNode {
            payload,
            meta: count << KIND_BITS | LEAF,
        }
    }

    fn interior(plane: &SplitPlane, above: u32) -> Self {
        let axis = plane.axis.expect("a kd-tree splits along axes only") as u32;
        KdNode {
            payload: plane.boundary.offset.to_bits(),
            meta: above << KIND_BITS | axis,
        }
    }
}

impl Layout for ObliqueNode {
    #[inline(always)]
    fn view(&self) -> View {
        if self.kd.meta & KIND_MASK == OBLIQUE {
            View::Oblique {
                normal: self.normal,
                offset: f32::from_bits(self.kd.payload),
                above: (self.kd.meta >> KIND_BITS) as usize,
            }
        } else {
            self.kd.view()
        }
    }

    fn leaf(payload: u32, count: u32) -> Self {
        ObliqueNode {
            normal: [0.0; 3],
            kd: KdNode::leaf(payload, count),
        }
    }

    fn interior(plane: &SplitPlane, above: u32) -> Self {
        let kind = plane.axis.map_or(OBLIQUE, |axis| axis as u32);
        ObliqueNode {
            normal: plane.normal,
            kd: KdNode {
                payload: plane.boundary.offset.to_bits(),
                meta: above << KIND_BITS | kind,
            },
        }
    }
}

/// Stores built nodes, and the references of the leaves that have more than one triangle.
pub(crate) fn store<N: Layout>(
    built: &[BuiltNode],
    references: &[u32],
    axis_nodes: bool,
) -> Result<(Vec<N>, Vec<u32>), BuildError> {
    for (what, count) in [("nodes", built.len()), ("references", references.len())] {
        if count > LIMIT {
            return Err(BuildError::TooLarge {
                what,
                count,
                limit: LIMIT,
            });
        }
    }
    let mut nodes = Vec::with_capacity(built.len());
    let mut kept = Vec::new();
    let mut rest = references;
    for (at, node) in built.iter().enumerate() {
        nodes.push(match *node {
            BuiltNode::Interior { mut plane, above } => {
                if !axis_nodes {
                    plane.axis = None;
                }
                N::interior(&plane, (at + above) as u32)
            }
            BuiltNode::Leaf { count } => {
                let (own, others) = rest.split_at(count);
                rest = others;
                let payload = if let [triangle] = own {
                    *triangle
                } else {
                    kept.len() as u32
                };
                if count > 1 {
                    kept.extend_from_slice(own);
                }
                N::leaf(payload, count as u32)
            }
        });
    }
    Ok((nodes, kept))
}
