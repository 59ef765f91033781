use std::collections::BTreeMap;

use super::nodes::{Layout, View};
use super::{Tree, with_nodes};
use crate::build::{BuildStats, Expected};
use crate::catalog::TreeChoice;

/// The nodes of a tree, by kind.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct NodeCounts {
    /// Interior nodes whose plane or box is axis-aligned, however they are stored.
    pub kd: u64,
    /// Interior nodes with an oblique plane.
    pub oblique: u64,
    /// Leaves, the empty ones included.
    pub leaf: u64,
    /// Leaves without a triangle.
    pub empty_leaf: u64,
}

impl NodeCounts {
    /// All nodes.
    pub fn total(&self) -> u64 {
        self.kd + self.oblique + self.leaf
    }
}

/// What is known of a tree: its size, shape and expected cost.
#[derive(Clone, Debug, PartialEq)]
pub struct TreeCard {
    /// The tree and its number of directions.
    pub choice: TreeChoice,
    /// Triangles of the mesh that can be hit.
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
    /// Interior nodes by depth: `[(kd, oblique)]`, from the root's.
    pub depths: Vec<(u64, u64)>,
    /// Interior nodes that a random line through the scene's box visits on average.
    pub expected_visits: f64,
    /// Triangle tests of such a line, if it tests all leaves on its way.
    pub expected_tests: f64,
    /// Shares of the expected tests by the size of the leaf: `[(triangles, share)]`, ascending.
    pub tests_by_leaf_size: Vec<(u32, f64)>,
    /// SAH cost: the expected visits and tests by the costs of the build, without the linear cost
    /// of oblique nodes.
    pub sah_cost: f64,
    /// Bytes of nodes and references.
    pub bytes: u64,
    /// What the build found.
    pub build: BuildStats,
    /// The wide nodes, where the tree is stored in the wide layout; all else but the bytes is of the
    /// tree as it was built.
    pub wide: Option<WideCard>,
}

/// The size of a tree in the wide layout.
#[derive(Clone, Debug, PartialEq)]
pub struct WideCard {
    /// Nodes with up to eight children.
    pub nodes: u64,
    /// Leaves, each of up to eight triangles.
    pub leaves: u64,
    /// Triangles in all leaves.
    pub references: u64,
    /// Depth of the deepest node; the root's is 0.
    pub depth: u32,
    /// Wide nodes by the frame of their boxes, the world's axes first.
    pub frames: Vec<u64>,
}

impl Tree {
    /// What is known of the tree. Walks all nodes.
    pub fn card(&self) -> TreeCard {
        match &self.wide {
            Some((_, card)) => card.clone(),
            None => with_nodes!(self, nodes => self.card_of(nodes)),
        }
    }

    fn card_of<N: Layout>(&self, nodes: &[N]) -> TreeCard {
        let mut counts = NodeCounts::default();
        let mut depths: Vec<(u64, u64)> = Vec::new();
        let mut leaf_sizes = BTreeMap::new();
        let (mut references, mut deepest) = (0, 0);
        let mut pending = vec![(0, 0)];
        while let Some((at, depth)) = pending.pop() {
            let (is_axis, above) = match nodes[at].view(self.shared()) {
                View::Leaf(leaf) => {
                    counts.leaf += 1;
                    counts.empty_leaf += u64::from(leaf.count == 0);
                    references += u64::from(leaf.count);
                    *leaf_sizes.entry(leaf.count).or_default() += 1;
                    deepest = deepest.max(depth);
                    continue;
                }
                View::Axis { above, .. } => (true, above),
                View::Objects { above, .. } => (true, above),
                View::Oblique { above, is_axis, .. } => (is_axis, above),
            };
            pending.extend([(above, depth + 1), (at + 1, depth + 1)]);
            depths.resize(depths.len().max(depth as usize + 1), (0, 0));
            let at_depth = &mut depths[depth as usize];
            *(if is_axis {
                &mut counts.kd
            } else {
                &mut counts.oblique
            }) += 1;
            *(if is_axis {
                &mut at_depth.0
            } else {
                &mut at_depth.1
            }) += 1;
        }
        let Expected {
            axis_visits,
            oblique_visits,
            tests,
        } = &self.expected;
        let expected_tests: f64 = tests.values().sum();
        let axis_cost = if self.choice.spec.axis_nodes {
            self.params.kd_traversal_cost
        } else {
            self.params.oblique_traversal_cost
        };
        TreeCard {
            choice: self.choice,
            triangles: self.mesh.usable_triangles().len() as u64,
            nodes: counts,
            references,
            depth: deepest,
            largest_leaf: leaf_sizes.keys().last().map_or(0, |&size| u64::from(size)),
            leaf_sizes: leaf_sizes.into_iter().collect(),
            depths,
            expected_visits: axis_visits + oblique_visits,
            expected_tests,
            tests_by_leaf_size: tests
                .iter()
                .map(|(&size, &tests)| (size, tests / expected_tests))
                .collect(),
            sah_cost: axis_cost * axis_visits
                + self.params.oblique_traversal_cost * oblique_visits
                + self.params.intersection_cost * expected_tests,
            bytes: (size_of_val(nodes) + size_of_val(self.references())) as u64,
            build: self.stats,
            wide: None,
        }
    }
}
