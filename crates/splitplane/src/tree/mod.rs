//! What a build gives.

use crate::build::{BuildError, BuildParams, BuildStats};
use crate::catalog::TreeChoice;
use crate::geometry::{Mesh, Ray, triangle::Shear};
use crate::query::{Counters, Hit};

/// A tree over a mesh, ready for queries.
#[derive(Clone, Debug)]
pub struct Tree {
    mesh: Mesh,
    choice: TreeChoice,
}

/// Why [`Tree::validate`] refuses a tree.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ValidateError {}

/// The nodes of a tree, by kind.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct NodeCounts {
    /// Axis-aligned interior nodes.
    pub kd: u64,
    /// Interior nodes with an oblique plane.
    pub oblique: u64,
    /// Leaves, the empty ones included.
    pub leaf: u64,
    /// Leaves without a triangle.
    pub empty_leaf: u64,
}

/// What is known of a tree: its size, shape and expected cost.
#[derive(Clone, Debug, PartialEq)]
pub struct TreeCard {
    /// The tree and its number of directions.
    pub choice: TreeChoice,
    /// Triangles in the mesh that can be hit.
    pub triangles: u64,
    /// Nodes by kind.
    pub nodes: NodeCounts,
    /// Triangle references in all leaves.
    pub references: u64,
    /// Depth of the deepest leaf; the root's is 0.
    pub depth: u32,
    /// Triangles in the largest leaf.
    pub largest_leaf: u64,
    /// Leaves by their number of triangles: `[(triangles, leaves)]`, ascending.
    pub leaf_sizes: Vec<(u32, u64)>,
    /// Expected interior node visits of a random line through the scene's box.
    pub expected_visits: f64,
    /// Expected triangle tests of such a line, all leaves on it tested.
    pub expected_tests: f64,
    /// SAH cost, normalised by the root's area, with the traversal and intersection costs of the
    /// build.
    pub sah_cost: f64,
    /// Bytes of nodes and references.
    pub bytes: u64,
    /// What the build found.
    pub build: BuildStats,
}

impl Tree {
    /// Builds the tree that `choice` names over `mesh`.
    ///
    /// # Errors
    /// Parameters out of range, or a tree too large for its nodes.
    pub fn build(
        mesh: &Mesh,
        choice: TreeChoice,
        _params: &BuildParams,
    ) -> Result<Tree, BuildError> {
        Ok(Tree {
            mesh: mesh.clone(),
            choice,
        })
    }

    /// The mesh that the tree was built over.
    pub fn mesh(&self) -> &Mesh {
        &self.mesh
    }

    /// What is known of the tree.
    pub fn card(&self) -> TreeCard {
        TreeCard {
            choice: self.choice,
            triangles: 0,
            nodes: NodeCounts::default(),
            references: 0,
            depth: 0,
            largest_leaf: 0,
            leaf_sizes: vec![],
            expected_visits: 0.0,
            expected_tests: 0.0,
            sah_cost: 0.0,
            bytes: 0,
            build: BuildStats::default(),
        }
    }

    /// Checks that the tree is what it promises to be.
    ///
    /// # Errors
    /// The first promise that is broken, and where.
    pub fn validate(&self) -> Result<(), ValidateError> {
        Ok(())
    }

    /// The nearest hit with `t_min < t <= t_max`; of hits at the same t the lowest index.
    pub fn closest_hit(&self, ray: &Ray, counters: &mut impl Counters) -> Option<Hit> {
        let shear = Shear::of(ray);
        let mut best: Option<Hit> = None;
        for &i in self.mesh.usable_triangles() {
            counters.triangle_test();
            if let Some(hit) = shear.intersect(&self.mesh.corners(i), i) {
                let limit = best.map_or(ray.t_max, |b| b.t);
                if hit.t > ray.t_min && (hit.t < limit || best.is_none() && hit.t == limit) {
                    best = Some(hit);
                }
            }
        }
        best
    }

    /// Whether anything is hit with `t_min < t <= t_max`.
    pub fn any_hit(&self, ray: &Ray, counters: &mut impl Counters) -> bool {
        self.closest_hit(ray, counters).is_some()
    }
}
