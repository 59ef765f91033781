//! What a build gives.

mod card;
pub(crate) mod nodes;
mod section;
mod validate;

pub use card::{NodeCounts, TreeCard};
pub use section::{Axis, Section, SectionCell, SectionSegment};
pub use validate::ValidateError;

use crate::build::{BuildError, BuildParams, BuildStats, Built, Progress, grow};
use crate::catalog::{Directions, TreeChoice, TreeSpec};
use crate::geometry::{Aabb, Mesh, Ray};
use crate::query::{self, Counters, Hit, Place, Traversal};
use card::Expected;
use nodes::{BoxNode, IndexedNode, KdNode, ObliqueNode, Shared};

/// A tree over a mesh, ready for queries. Cloning copies the nodes, not the mesh.
///
/// Two trees are equal if they have the same name, parameters and nodes; meshes are not compared.
#[derive(Clone, Debug)]
pub struct Tree {
    mesh: Mesh,
    choice: TreeChoice,
    params: BuildParams,
    nodes: Nodes,
    references: Vec<u32>,
    shared: Shared,
    expected: Expected,
    stats: BuildStats,
    place: Place,
}

/// The nodes, in the layout that the tree's planes need.
#[derive(Clone, Debug)]
pub(crate) enum Nodes {
    Kd(Vec<KdNode>),
    Indexed(Vec<IndexedNode>),
    Boxes(Vec<BoxNode>),
    Oblique(Vec<ObliqueNode>),
}

/// A layout of nodes, by name.
enum Kind {
    Kd,
    Indexed,
    Boxes,
    Oblique,
}

impl Kind {
    /// The layout that the tree's planes need.
    fn of(spec: &TreeSpec) -> Kind {
        if spec.objects {
            Kind::Boxes
        } else if spec.directions == Directions::Fixed {
            Kind::Indexed
        } else if spec.axis_nodes && spec.only_axes() {
            Kind::Kd
        } else {
            Kind::Oblique
        }
    }
}

impl TreeSpec {
    /// Bytes of a node, be it interior or a leaf; references of leaves with several triangles come
    /// on top.
    pub fn node_bytes(&self) -> usize {
        match Kind::of(self) {
            Kind::Kd => size_of::<KdNode>(),
            Kind::Indexed => size_of::<IndexedNode>(),
            Kind::Boxes => size_of::<BoxNode>(),
            Kind::Oblique => size_of::<ObliqueNode>(),
        }
    }
}

/// Runs `$body` with `$nodes` bound to the slice of nodes, once for each layout.
macro_rules! with_nodes {
    ($tree:expr, $nodes:ident => $body:expr) => {
        match $tree.nodes() {
            $crate::tree::Nodes::Kd($nodes) => {
                let $nodes = $nodes.as_slice();
                $body
            }
            $crate::tree::Nodes::Indexed($nodes) => {
                let $nodes = $nodes.as_slice();
                $body
            }
            $crate::tree::Nodes::Boxes($nodes) => {
                let $nodes = $nodes.as_slice();
                $body
            }
            $crate::tree::Nodes::Oblique($nodes) => {
                let $nodes = $nodes.as_slice();
                $body
            }
        }
    };
}
pub(crate) use with_nodes;

impl Tree {
    /// Builds the tree that `choice` names over `mesh`, on the threads of the current rayon pool.
    /// The tree is the same, byte by byte, for any number of them.
    ///
    /// # Errors
    /// Parameters out of range, or a tree too large for its nodes.
    pub fn build(
        mesh: &Mesh,
        choice: TreeChoice,
        params: &BuildParams,
    ) -> Result<Tree, BuildError> {
        Tree::build_watched(mesh, choice, params, &())
    }

    /// As [`Tree::build`], with `progress` told how many of the mesh's triangles are in their
    /// leaves, and asked whether to stop.
    ///
    /// # Errors
    /// As [`Tree::build`], or cancelled by `progress`.
    pub fn build_watched(
        mesh: &Mesh,
        choice: TreeChoice,
        params: &BuildParams,
        progress: &dyn Progress,
    ) -> Result<Tree, BuildError> {
        params.check()?;
        let built = grow(mesh, choice, params, progress).ok_or(BuildError::Cancelled)?;
        Tree::store(mesh, choice, params, &built)
    }

    fn store(
        mesh: &Mesh,
        choice: TreeChoice,
        params: &BuildParams,
        built: &Built,
    ) -> Result<Tree, BuildError> {
        let spec = choice.spec;
        let shared = Shared::new(built.fixed.clone(), spec.axis_nodes);
        let (nodes, references) = match Kind::of(spec) {
            Kind::Boxes => {
                let (mut nodes, references) = nodes::store(built, &shared)?;
                nodes::fit_boxes(&mut nodes, &references, mesh, &shared);
                (Nodes::Boxes(nodes), references)
            }
            Kind::Indexed => {
                let (nodes, references) = nodes::store(built, &shared)?;
                (Nodes::Indexed(nodes), references)
            }
            Kind::Kd => {
                let (nodes, references) = nodes::store(built, &shared)?;
                (Nodes::Kd(nodes), references)
            }
            Kind::Oblique => {
                let (nodes, references) = nodes::store(built, &shared)?;
                (Nodes::Oblique(nodes), references)
            }
        };
        let bounds = mesh.bounds();
        Ok(Tree {
            mesh: mesh.clone(),
            choice,
            params: params.clone(),
            nodes,
            shared,
            references,
            expected: Expected::of(built, bounds.surface_area()),
            stats: built.stats,
            place: Place {
                bounds,
                largest: mesh.largest_triangle(),
                overhang: params.ties.overhang(&bounds),
                traversal: Traversal::default(),
            },
        })
    }

    /// The mesh that the tree was built over.
    pub fn mesh(&self) -> &Mesh {
        &self.mesh
    }

    /// The tree's name and number of directions.
    pub fn choice(&self) -> TreeChoice {
        self.choice
    }

    /// The parameters that the tree was built with.
    pub fn params(&self) -> &BuildParams {
        &self.params
    }

    /// The same tree, with queries that decide in this way which cells a ray passes.
    #[must_use]
    pub fn with_traversal(mut self, traversal: Traversal) -> Self {
        self.place.traversal = traversal;
        self
    }

    /// The box that all triangles lie in.
    pub fn bounds(&self) -> Aabb {
        self.mesh.bounds()
    }

    /// The nearest hit with `t_min < t <= t_max`; of hits at the same `t`, that with the lowest
    /// index.
    ///
    /// The answer is that of testing every triangle, bit for bit. What is done on the way is
    /// reported to `counters`; `&mut ()` counts nothing.
    pub fn closest_hit(&self, ray: &Ray, counters: &mut impl Counters) -> Option<Hit> {
        query::closest_hit(self, ray, counters)
    }

    /// Whether anything is hit with `t_min < t <= t_max`. See [`Tree::closest_hit`].
    pub fn any_hit(&self, ray: &Ray, counters: &mut impl Counters) -> bool {
        query::any_hit(self, ray, counters)
    }

    pub(crate) fn nodes(&self) -> &Nodes {
        &self.nodes
    }

    pub(crate) fn shared(&self) -> &Shared {
        &self.shared
    }

    pub(crate) fn references(&self) -> &[u32] {
        &self.references
    }

    pub(crate) fn place(&self) -> &Place {
        &self.place
    }
}

impl PartialEq for Tree {
    fn eq(&self, other: &Tree) -> bool {
        let bytes =
            |tree: &Tree| with_nodes!(tree, nodes => bytemuck::cast_slice::<_, u8>(nodes).to_vec());
        self.choice == other.choice
            && self.params == other.params
            && self.references == other.references
            && self.expected == other.expected
            && self.stats == other.stats
            && self.shared == other.shared
            && bytes(self) == bytes(other)
    }
}
