//! From a mesh to a tree.

/// How splits are priced, how ties are treated and when to stop.
#[derive(Clone, Debug, PartialEq)]
pub struct BuildParams {
    /// Cost of a ray-triangle test.
    pub intersection_cost: f64,
    /// Cost of a visit of an axis-aligned node.
    pub kd_traversal_cost: f64,
    /// Cost of a visit of a node with an oblique plane.
    pub oblique_traversal_cost: f64,
    /// How oblique nodes are priced in trees with kd nodes.
    pub oblique_pricing: ObliquePricing,
    /// Fraction of the cost taken off where a child is empty, in `[0, 1]`.
    pub empty_bonus: f64,
    /// A node of at most this many triangles is a leaf.
    pub max_prims: u32,
    /// The deepest leaf's depth.
    pub max_depth: DepthLimit,
    /// How triangles that touch a plane are treated.
    pub ties: Ties,
    /// Seed of every random draw.
    pub seed: u64,
}

/// The largest depth of a leaf, the root's being 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum DepthLimit {
    /// `round(base + per_level · floor(log2 n))` for n triangles.
    Log2 {
        /// Constant part.
        base: f64,
        /// Per doubling of the triangles.
        per_level: f64,
    },
    /// The same for any number of triangles.
    Fixed(u32),
}

/// What happens to triangles that touch a split plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Ties {
    /// As in the thesis: closed intervals; a triangle that touches a plane from below can end on
    /// both sides, as the order of events decides.
    AsPublished,
    /// A triangle belongs to a side only where it reaches more than a tolerance into it.
    Tolerant,
}

/// How oblique splits compete with axis splits in trees with kd nodes [Ize2008].
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ObliquePricing {
    /// As the thesis's text: a cost linear in the number of triangles first, then the constant.
    Published {
        /// Ize's α.
        alpha: f64,
    },
    /// As the thesis's code, which never takes a split by the constant cost.
    Fork {
        /// Ize's α.
        alpha: f64,
    },
}

impl BuildParams {
    /// The parameters of the thesis.
    pub const THESIS: BuildParams = BuildParams {
        intersection_cost: 80.0,
        kd_traversal_cost: 1.0,
        oblique_traversal_cost: 5.0,
        oblique_pricing: ObliquePricing::Published { alpha: 0.1 },
        empty_bonus: 0.0,
        max_prims: 1,
        max_depth: DepthLimit::Log2 {
            base: 2.0,
            per_level: 1.6,
        },
        ties: Ties::AsPublished,
        seed: 0,
    };
}

impl Default for BuildParams {
    fn default() -> Self {
        BuildParams {
            ties: Ties::Tolerant,
            ..BuildParams::THESIS
        }
    }
}

/// Why a tree could not be built.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum BuildError {}

/// What a build found.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BuildStats {
    /// Times a node was split although no split beat the leaf.
    pub bad_refines: u64,
    /// Split candidates whose cost was computed.
    pub candidates: u64,
}
