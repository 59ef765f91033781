use crate::geometry::Aabb;

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
    /// Perfect splits: what counts of a triangle in a node is what of it lies in the node's cell,
    /// not all of it \[WaldHavran2006, Soupikov2008\].
    pub clip: bool,
    /// In nodes of more triangles than this only axes are tried, in trees that try axes: there
    /// oblique planes gain least and take the longest.
    pub oblique_up_to: u32,
    /// The most references that a tree may have, per triangle: where splits would give more, there
    /// are leaves. A subtree has its share.
    pub max_references: f64,
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
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ties {
    /// As in the thesis: closed intervals. Of the triangles that touch the plane, those on one of
    /// its sides go to both children; at each offset both sides are tried.
    AsPublished,
    /// A triangle belongs to a side only where it reaches more than a tolerance (10⁻⁶ of the
    /// scene's diagonal) into it; those that lie in the plane go to the one side where they cost
    /// less.
    Tolerant,
}

/// How oblique splits compete with axis splits in trees with kd nodes \[Ize2008\].
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ObliquePricing {
    /// As the thesis's text has it: with a cost linear in the number of triangles,
    /// `alpha · C_i · (n − 1) + C_t,kd`, oblique splits compete with the axes; where the best of
    /// all does not beat a leaf, the best oblique one at the constant cost may.
    Published {
        /// Ize's α.
        alpha: f64,
    },
    /// As the thesis's code has it: the split by the constant cost is never taken, it only keeps
    /// the node from counting as a bad refine.
    Fork {
        /// Ize's α.
        alpha: f64,
    },
}

impl BuildParams {
    /// The parameters of the thesis \[Hoobergs2019\].
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
        clip: false,
        oblique_up_to: u32::MAX,
        max_references: 64.0,
        seed: 0,
    };

    /// The parameters of pbrt-v3's kd-tree [PBRT3, 4.4], with the thesis's for oblique nodes.
    ///
    /// **Differs from pbrt:** which planes are tried is the tree's affair. pbrt sweeps the longest
    /// axis of a node's box, and the others only where that one has no candidate.
    pub const PBRT3: BuildParams = BuildParams {
        empty_bonus: 0.5,
        max_depth: DepthLimit::Log2 {
            base: 8.0,
            per_level: 1.3,
        },
        ..BuildParams::THESIS
    };

    /// The parameters of pbrt-v4's kd-tree \[PBRT4\]: [`BuildParams::PBRT3`] with an intersection
    /// cost of 5.
    pub const PBRT4: BuildParams = BuildParams {
        intersection_cost: 5.0,
        ..BuildParams::PBRT3
    };

    /// For trees that are built soon: tolerant ties, clipped, leaves of up to eight triangles, as
    /// many as the wide layout tests at a time, and oblique planes in small nodes only.
    pub const FAST: BuildParams = BuildParams {
        max_prims: 8,
        ties: Ties::Tolerant,
        clip: true,
        oblique_up_to: 512,
        ..BuildParams::THESIS
    };

    /// The deepest leaf that a tree may have, whatever the parameters: a query's stack has one
    /// entry a level.
    pub const MAX_DEPTH: u32 = 120;

    /// Whether a tree can be built with these, as [`crate::Tree::build`] asks first.
    ///
    /// # Errors
    /// A number out of range.
    pub fn check(&self) -> Result<(), BuildError> {
        let alpha = match self.oblique_pricing {
            ObliquePricing::Published { alpha } | ObliquePricing::Fork { alpha } => alpha,
        };
        let (base, per_level) = match self.max_depth {
            DepthLimit::Log2 { base, per_level } => (base, per_level),
            DepthLimit::Fixed(_) => (0.0, 0.0),
        };
        for (name, value, limit) in [
            ("intersection_cost", self.intersection_cost, f64::MAX),
            ("kd_traversal_cost", self.kd_traversal_cost, f64::MAX),
            (
                "oblique_traversal_cost",
                self.oblique_traversal_cost,
                f64::MAX,
            ),
            ("oblique_pricing.alpha", alpha, f64::MAX),
            ("empty_bonus", self.empty_bonus, 1.0),
            ("max_depth.base", base, f64::MAX),
            ("max_depth.per_level", per_level, f64::MAX),
            ("max_references", self.max_references, f64::MAX),
        ] {
            if !(0.0..=limit).contains(&value) {
                return Err(BuildError::Parameter { name, value, limit });
            }
        }
        Ok(())
    }

    /// How far a triangle may reach beyond a plane on a side where it does not count, in a scene of
    /// these bounds: the tolerance, and what rounding adds [Higham2002, 3.1].
    ///
    /// Coordinates along a unit direction are at most √3 · reach. As published they are off by
    /// three roundings; otherwise by one, and adding the tolerance rounds once more. Corners that
    /// triangles were cut to are rounded once themselves.
    pub(crate) fn overhang(&self, bounds: &Aabb) -> f64 {
        let unit = f64::from(f32::EPSILON) / 2.0;
        let roundings = match self.ties {
            Ties::AsPublished => 3.01,
            Ties::Tolerant => 2.01,
        };
        let roundings = roundings + f64::from(u8::from(self.clip));
        let tolerance = f64::from(self.ties.tolerance(bounds));
        // Numbers too small to be normal are rounded by as much, whatever their size.
        let least = f64::from(f32::from_bits(1));
        let size = 3f64.sqrt() * f64::from(bounds.reach()) + tolerance;
        tolerance + roundings * (unit * size + least)
            // Nor is the rounding of the triangle test in proportion to the triangle then.
            + 16.0 * least
    }
}

impl Default for BuildParams {
    /// The thesis's costs and depths, with tolerant ties, clipped, and oblique planes in nodes of
    /// up to 512 triangles: where they were tried in larger ones, trees were no better.
    fn default() -> Self {
        BuildParams {
            ties: Ties::Tolerant,
            clip: true,
            oblique_up_to: 512,
            ..BuildParams::THESIS
        }
    }
}

impl DepthLimit {
    /// The limit for that many triangles; never more than [`BuildParams::MAX_DEPTH`].
    pub fn for_triangles(self, triangles: usize) -> u32 {
        let depth = match self {
            DepthLimit::Log2 { base, per_level } => {
                let log2 = triangles.max(1).ilog2();
                (base + per_level * f64::from(log2)).round() as u32
            }
            DepthLimit::Fixed(depth) => depth,
        };
        depth.min(BuildParams::MAX_DEPTH)
    }
}

impl Ties {
    /// How far a triangle must reach beyond a plane to count as there, in scene units.
    pub(crate) fn tolerance(self, bounds: &Aabb) -> f32 {
        match self {
            Ties::AsPublished => 0.0,
            // Projections of coordinates as large as `reach` are rounded to multiples of up to
            // ε · reach; what differs by less is the same place.
            Ties::Tolerant => (1e-6 * bounds.diagonal()).max(2.0 * f32::EPSILON * bounds.reach()),
        }
    }

    /// The offset of a point along a direction.
    ///
    /// `AsPublished` projects with plain f32 multiplications and additions, as the thesis's code
    /// was compiled: which triangles touch a plane depends on that rounding. Otherwise the offset
    /// is computed in f64 and rounded once.
    #[inline(always)]
    pub(crate) fn project(self, direction: [f32; 3], p: [f32; 3]) -> f32 {
        match self {
            Ties::AsPublished => (direction[0] * p[0] + direction[1] * p[1]) + direction[2] * p[2],
            Ties::Tolerant => {
                let term = |i: usize| f64::from(direction[i]) * f64::from(p[i]);
                ((term(0) + term(1)) + term(2)) as f32
            }
        }
    }

    /// The extent of a triangle along a direction.
    #[inline(always)]
    pub(crate) fn extent(self, direction: [f32; 3], corners: &[[f32; 3]; 3]) -> (f32, f32) {
        let [a, b, c] = corners.map(|p| self.project(direction, p));
        (a.min(b).min(c), a.max(b).max(c))
    }
}

/// Why a tree could not be built.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum BuildError {
    /// A parameter out of range.
    #[error("{name} is {value}; it must be {}", range(*limit))]
    Parameter {
        /// The parameter.
        name: &'static str,
        /// Its value.
        value: f64,
        /// The largest value it may have.
        limit: f64,
    },
    /// A wide tree that is to be stored as a binary one.
    #[error("a tree in the wide layout has no binary nodes any more; build it again")]
    BinaryNodesGone,
    /// [`Progress::cancelled`](crate::Progress::cancelled) said so.
    #[error("the build was cancelled")]
    Cancelled,
    /// More nodes or references than a node has bits for.
    #[error("the tree has {count} {what}; its nodes can address {limit}")]
    TooLarge {
        /// "nodes" or "references".
        what: &'static str,
        /// How many there are.
        count: usize,
        /// How many there may be.
        limit: usize,
    },
}

fn range(limit: f64) -> String {
    if limit == f64::MAX {
        "finite and not negative".to_owned()
    } else {
        format!("between 0 and {limit}")
    }
}

/// What a build found, beyond the tree itself.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct BuildStats {
    /// Nodes that were split although no split beat a leaf.
    pub bad_refines: u64,
    /// Split candidates: events strictly inside their cell.
    pub candidates: u64,
    /// Interior nodes by what their plane came from.
    pub wins: Wins,
    /// Splits whose cells kept the shape of their parent's because it was too thin to be cut.
    pub uncut_cells: u64,
    /// Leaves that are leaves because of [`BuildParams::max_references`].
    pub limited_leaves: u64,
}

impl std::ops::AddAssign for BuildStats {
    fn add_assign(&mut self, other: BuildStats) {
        self.bad_refines += other.bad_refines;
        self.candidates += other.candidates;
        self.uncut_cells += other.uncut_cells;
        self.limited_leaves += other.limited_leaves;
        self.wins.axis += other.wins.axis;
        self.wins.direction += other.wins.direction;
        self.wins.triangle += other.wins.triangle;
        self.wins.edge += other.wins.edge;
    }
}

/// How often each kind of plane was the one to split a node.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Wins {
    /// Planes across an axis.
    pub axis: u64,
    /// Planes across another direction: fixed, random, a normal, a cluster's centre.
    pub direction: u64,
    /// Planes of triangles.
    pub triangle: u64,
    /// Planes through a triangle's edge, perpendicular to it.
    pub edge: u64,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_thesis_stops_at_its_depths() {
        let limit = BuildParams::THESIS.max_depth;
        assert_eq!(
            [33_264, 8_316, 143_163].map(|n| limit.for_triangles(n)),
            [26, 23, 29]
        );
        assert_eq!(limit.for_triangles(0), 2);
        assert_eq!(
            DepthLimit::Fixed(9999).for_triangles(8),
            BuildParams::MAX_DEPTH
        );
    }

    #[test]
    fn pbrts_kd_trees_have_pbrts_costs_and_depths() {
        for (params, intersection_cost) in [(BuildParams::PBRT3, 80.0), (BuildParams::PBRT4, 5.0)] {
            assert_eq!(params.intersection_cost, intersection_cost);
            assert_eq!((params.kd_traversal_cost, params.empty_bonus), (1.0, 0.5));
            assert_eq!((params.max_prims, params.ties), (1, Ties::AsPublished));
            // 8 + 1.3 · 15 = 27.5, and half a level is rounded up.
            let depths = [1, 8_316, 33_264].map(|n| params.max_depth.for_triangles(n));
            assert_eq!(depths, [8, 25, 28]);
            assert!(params.check().is_ok());
        }
    }

    #[test]
    fn parameters_out_of_range_are_named() {
        let params = BuildParams {
            empty_bonus: 1.5,
            ..BuildParams::THESIS
        };
        let error = params.check().unwrap_err().to_string();
        assert_eq!(error, "empty_bonus is 1.5; it must be between 0 and 1");
        let params = BuildParams {
            intersection_cost: f64::NAN,
            ..BuildParams::THESIS
        };
        assert!(params.check().is_err());
    }
}
