//! What a build gives.

mod card;
pub(crate) mod nodes;
mod saved;
mod section;
mod stored;
mod validate;
pub(crate) mod wide;

pub use card::{NodeCounts, TreeCard, WideCard};
pub use saved::LoadError;
pub use section::{Axis, Section, SectionCell, SectionSegment};
pub use validate::ValidateError;

use crate::build::{BuildError, BuildParams, BuildStats, Built, Expected, Progress, grow};
use crate::catalog::{Directions, TreeChoice, TreeSpec};
use crate::geometry::{Aabb, Mesh, Ray};
use crate::query::{self, ClosestPoint, Coherence, Counters, Hit, Place, Traversal};
use nodes::{BoxNode, IndexedNode, KdNode, ObliqueNode, Shared};
use stored::Stored;
use wide::Wide;

/// A tree over a mesh, ready for queries. Cloning copies neither the nodes nor the mesh.
///
/// Two trees are equal if they have the same name, parameters and nodes; meshes are not compared.
#[derive(Clone, Debug)]
pub struct Tree {
    mesh: Mesh,
    choice: TreeChoice,
    params: BuildParams,
    nodes: Nodes,
    references: Stored<u32>,
    shared: Shared,
    expected: Expected,
    stats: BuildStats,
    place: Place,
    /// The nodes in the wide layout; then there are no others, and the card is kept.
    wide: Option<(Wide, TreeCard)>,
}

/// How the nodes of a tree are stored. Hits are the same in all layouts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Layout {
    /// As built: one plane or two boxes a node, with counters that can be compared with those of
    /// papers.
    #[default]
    Binary,
    /// Nodes of eight boxes around what lies in the cells, leaves of up to eight triangles, both
    /// tested with SIMD instructions: several times as fast.
    Wide,
}

impl Layout {
    /// All layouts.
    pub const ALL: [Layout; 2] = [Layout::Binary, Layout::Wide];

    /// The layout's name: "binary", "wide".
    pub fn name(self) -> &'static str {
        match self {
            Layout::Binary => "binary",
            Layout::Wide => "wide",
        }
    }
}

impl std::fmt::Display for Layout {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}

impl std::str::FromStr for Layout {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        let named = |layout: &Layout| layout.name() == name.trim().to_lowercase();
        Layout::ALL
            .into_iter()
            .find(named)
            .ok_or_else(|| format!("no layout is called \"{name}\"; there are binary and wide"))
    }
}

/// The nodes, in the layout that the tree's planes need.
#[derive(Clone, Debug)]
pub(crate) enum Nodes {
    Kd(Stored<KdNode>),
    Indexed(Stored<IndexedNode>),
    Boxes(Stored<BoxNode>),
    Oblique(Stored<ObliqueNode>),
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
                let $nodes = &**$nodes;
                $body
            }
            $crate::tree::Nodes::Indexed($nodes) => {
                let $nodes = &**$nodes;
                $body
            }
            $crate::tree::Nodes::Boxes($nodes) => {
                let $nodes = &**$nodes;
                $body
            }
            $crate::tree::Nodes::Oblique($nodes) => {
                let $nodes = &**$nodes;
                $body
            }
        }
    };
}
pub(crate) use with_nodes;

impl Tree {
    /// Builds a tree with all defaults over `mesh`: [`TreeChoice::default`] with
    /// [`BuildParams::default`], in the wide layout. See [`Tree::build`].
    ///
    /// # Errors
    /// A tree too large for its nodes.
    pub fn new(mesh: &Mesh) -> Result<Tree, BuildError> {
        Tree::build(mesh, TreeChoice::default(), &BuildParams::default())?.with_layout(Layout::Wide)
    }

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
        Tree::store(mesh, choice, params, built)
    }

    fn store(
        mesh: &Mesh,
        choice: TreeChoice,
        params: &BuildParams,
        built: Built,
    ) -> Result<Tree, BuildError> {
        let spec = choice.spec;
        let shared = Shared::new(built.fixed, built.frames, spec.axis_nodes);
        let (nodes, references) = match Kind::of(spec) {
            Kind::Boxes => {
                let (nodes, references) = nodes::store(built.pieces, &shared)?;
                (Nodes::Boxes(nodes.into()), references)
            }
            Kind::Indexed => {
                let (nodes, references) = nodes::store(built.pieces, &shared)?;
                (Nodes::Indexed(nodes.into()), references)
            }
            Kind::Kd => {
                let (nodes, references) = nodes::store(built.pieces, &shared)?;
                (Nodes::Kd(nodes.into()), references)
            }
            Kind::Oblique => {
                let (nodes, references) = nodes::store(built.pieces, &shared)?;
                (Nodes::Oblique(nodes.into()), references)
            }
        };
        Ok(Tree {
            mesh: mesh.clone(),
            choice,
            params: params.clone(),
            nodes,
            shared,
            references: references.into(),
            expected: built.expected.over(mesh.bounds().surface_area()),
            stats: built.stats,
            place: Tree::place_over(mesh, params),
            wide: None,
        })
    }

    fn place_over(mesh: &Mesh, params: &BuildParams) -> Place {
        let bounds = mesh.bounds();
        Place {
            bounds,
            largest: mesh.largest_triangle(),
            overhang: params.overhang(&bounds),
            traversal: Traversal::default(),
        }
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

    /// The same tree, stored in this layout.
    ///
    /// # Errors
    /// A tree too large for the layout's indices, or one that is wide already and is to be binary:
    /// its binary nodes are gone, it must be built again.
    pub fn with_layout(mut self, layout: Layout) -> Result<Self, BuildError> {
        if layout == self.layout() {
            return Ok(self);
        }
        if layout == Layout::Binary {
            return Err(BuildError::BinaryNodesGone);
        }
        let mut card = self.card();
        let wide = Wide::of(&self)?;
        card.bytes = wide.bytes() as u64;
        card.wide = Some(wide.card());
        self.nodes = Nodes::Kd(Vec::new().into());
        self.references = Vec::new().into();
        self.shared = Shared::default();
        self.wide = Some((wide, card));
        Ok(self)
    }

    /// How the nodes are stored.
    pub fn layout(&self) -> Layout {
        match self.wide {
            Some(_) => Layout::Wide,
            None => Layout::Binary,
        }
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
        query::closest_hit(self, ray, |_| true, counters)
    }

    /// The nearest hit that `accept` takes: for masks, and for surfaces with holes in their
    /// texture. See [`Tree::closest_hit`].
    ///
    /// `accept` is asked in no particular order, of some hits more than once and of some never; so
    /// its answer must depend on the hit alone.
    ///
    /// ```
    /// # use splitplane::{Mesh, Ray, Tree};
    /// # let positions = vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    /// # let tree = Tree::new(&Mesh::new(positions, vec![[0, 1, 2]])?)?;
    /// // Stripes: every other tenth of the triangle is not there.
    /// let striped = |hit: &splitplane::Hit| (10.0 * hit.u) as u32 % 2 == 0;
    /// let at = |x| Ray::new([x, 0.25, 1.0], [0.0, 0.0, -1.0]);
    /// assert!(tree.closest_hit_where(&at(0.25), striped, &mut ()).is_some());
    /// assert!(tree.closest_hit_where(&at(0.35), striped, &mut ()).is_none());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn closest_hit_where(
        &self,
        ray: &Ray,
        accept: impl Fn(&Hit) -> bool,
        counters: &mut impl Counters,
    ) -> Option<Hit> {
        query::closest_hit(self, ray, accept, counters)
    }

    /// Whether anything is hit with `t_min < t <= t_max`. See [`Tree::closest_hit`].
    pub fn any_hit(&self, ray: &Ray, counters: &mut impl Counters) -> bool {
        query::any_hit(self, ray, query::Everything, counters)
    }

    /// Whether anything is hit that `accept` takes. See [`Tree::closest_hit_where`].
    pub fn any_hit_where(
        &self,
        ray: &Ray,
        accept: impl Fn(&Hit) -> bool,
        counters: &mut impl Counters,
    ) -> bool {
        query::any_hit(self, ray, accept, counters)
    }

    /// All hits with `t_min < t <= t_max`, by `t`, then by index, each triangle once. `hits` is
    /// emptied first; it is not returned, so that its memory serves many rays.
    ///
    /// The answer is that of testing every triangle, bit for bit, in one traversal: no hit is lost
    /// where surfaces lie close to each other or in the same place.
    ///
    /// An edge and a vertex belong to every triangle that has them. A ray through a shared edge
    /// hits each of the triangles that share it, at `t` that agree up to rounding, and never none
    /// of them; so the number of hits is not a parity: whether
    /// a point is inside a closed mesh is what [`Tree::contains`] says.
    pub fn all_hits(&self, ray: &Ray, hits: &mut Vec<Hit>, counters: &mut impl Counters) {
        query::all_hits(self, ray, |_| true, hits, counters);
    }

    /// All hits that `accept` takes. See [`Tree::all_hits`] and [`Tree::closest_hit_where`].
    pub fn all_hits_where(
        &self,
        ray: &Ray,
        accept: impl Fn(&Hit) -> bool,
        hits: &mut Vec<Hit>,
        counters: &mut impl Counters,
    ) {
        query::all_hits(self, ray, accept, hits, counters);
    }

    /// The nearest hits of many rays, as [`Tree::closest_hit`] gives them, on the threads of the
    /// current rayon pool.
    ///
    /// # Panics
    /// If there are not as many `hits` as `rays`.
    pub fn closest_hits(&self, rays: &[Ray], hits: &mut [Option<Hit>]) {
        self.closest_hits_as(Coherence::Unknown, rays, hits);
    }

    /// The same, where the caller knows whether rays that follow each other go much the same way.
    ///
    /// # Panics
    /// If there are not as many `hits` as `rays`.
    pub fn closest_hits_as(&self, coherence: Coherence, rays: &[Ray], hits: &mut [Option<Hit>]) {
        query::closest_hits(self, rays, hits, coherence);
    }

    /// Whether anything is hit, of many rays, as [`Tree::any_hit`] says it, on the threads of the
    /// current rayon pool.
    ///
    /// # Panics
    /// If there are not as many `hits` as `rays`.
    pub fn any_hits(&self, rays: &[Ray], hits: &mut [bool]) {
        self.any_hits_as(Coherence::Unknown, rays, hits);
    }

    /// The same, where the caller knows whether rays that follow each other go much the same way.
    ///
    /// # Panics
    /// If there are not as many `hits` as `rays`.
    pub fn any_hits_as(&self, coherence: Coherence, rays: &[Ray], hits: &mut [bool]) {
        query::any_hits(self, rays, hits, coherence);
    }

    /// The point of the mesh nearest to `point`, no further than `max_distance` (in scene units;
    /// infinite for any); of equals, that of the triangle with the lowest index. `None` where there
    /// is none, or where `point` is not finite.
    ///
    /// Distances are compared in f64, and the answer is that of looking at every triangle, bit for
    /// bit. A visit counts as of a ray, and so does a look at a triangle.
    pub fn closest_point(
        &self,
        point: [f32; 3],
        max_distance: f32,
        counters: &mut impl Counters,
    ) -> Option<ClosestPoint> {
        query::closest_point(self, point, max_distance, counters)
    }

    /// The distance from `point` to the mesh, in scene units, negative inside; `None` for a mesh of
    /// no triangles, or a point that is not finite. The mesh should be closed: see
    /// [`Mesh::is_closed`] and [`Tree::contains`].
    pub fn signed_distance(&self, point: [f32; 3], counters: &mut impl Counters) -> Option<f32> {
        let closest = self.closest_point(point, f32::INFINITY, counters)?;
        let inside = self.contains(point, counters);
        Some(if inside {
            -closest.distance
        } else {
            closest.distance
        })
    }

    /// Whether an odd number of surfaces lies above `point` (towards larger z): whether it is
    /// inside a closed mesh, whichever way its triangles are turned.
    ///
    /// The count is exact: no triangle is missed or counted twice where an edge or a vertex lies
    /// right above the point. Only of a point that lies on the surface itself the answer may be
    /// either, but it is the same for every tree.
    ///
    /// ```
    /// # use splitplane::{Mesh, Tree};
    /// let positions = vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    /// let mesh = Mesh::new(positions, vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])?;
    /// let tree = Tree::new(&mesh)?;
    /// assert!(mesh.is_closed());
    /// assert!(tree.contains([0.2, 0.2, 0.2], &mut ()));
    /// assert_eq!(tree.signed_distance([0.25, 0.25, 0.125], &mut ()), Some(-0.125));
    /// assert_eq!(tree.signed_distance([0.0, 0.0, -2.0], &mut ()), Some(2.0));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn contains(&self, point: [f32; 3], counters: &mut impl Counters) -> bool {
        query::contains(self, point, counters)
    }

    /// The triangles that have a point in common with a box, in order; to touch it is enough.
    /// None for a box that is empty or not finite.
    pub fn triangles_in_box(&self, region: &Aabb, counters: &mut impl Counters) -> Vec<u32> {
        query::overlaps_region(self, region, counters)
    }

    /// The triangles that have a point no further than `radius` from `center` (both in scene
    /// units), in order. None where a number is NaN, the radius negative or the centre not finite.
    pub fn triangles_in_sphere(
        &self,
        center: [f32; 3],
        radius: f32,
        counters: &mut impl Counters,
    ) -> Vec<u32> {
        query::overlaps_sphere(self, center, radius, counters)
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

    pub(crate) fn wide(&self) -> Option<&Wide> {
        self.wide.as_ref().map(|(wide, _)| wide)
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
            && self.wide == other.wide
            && bytes(self) == bytes(other)
    }
}
