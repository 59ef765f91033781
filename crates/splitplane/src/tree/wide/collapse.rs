//! Which nodes of a binary tree become one wide node: dynamic programming over the tree
//! [Wald2008, Ylitie2017].
//!
//! A node of the binary tree can fill up to eight places of the wide node above it. What its
//! subtree costs in 1, 2, ... 8 places follows from the costs of its children; in one place it is
//! a leaf or a wide node of its own.

use super::boxes::{HalfSpace, clipped_box};
use super::{WIDTH, leaf_cost};
use crate::geometry::{Aabb, Frame};
use crate::tree::nodes::{Layout, View};
use crate::tree::{Tree, with_nodes};

/// Cost of a visit of a wide node, of a ray that meets its box, in units of that of a full leaf.
const NODE_COST: f64 = 1.0;

/// A part of the binary tree that can become a child of a wide node.
#[derive(Clone, Debug)]
pub(super) struct Item {
    /// In the frame of the item that it is a child of.
    pub(super) bounds: Aabb,
    pub(super) leaf: Option<Leaf>,
    pub(super) interior: Option<Interior>,
}

/// Triangles that are tested together, at most eight: a range of [`Items::triangles`].
#[derive(Clone, Copy, Debug)]
pub(super) struct Leaf {
    pub(super) start: usize,
    pub(super) count: usize,
}

#[derive(Clone, Debug)]
pub(super) struct Interior {
    /// The indices of both children among the items.
    pub(super) children: [usize; 2],
    /// The frame of the children's boxes.
    pub(super) frame: u32,
    /// Of `m + 1` places in the wide node above, those that the first child gets; 0 where one place
    /// fewer is as good. The last entry is for a wide node of its own.
    pub(super) places: [u8; WIDTH],
}

/// What may become a wide tree.
#[derive(Debug, Default)]
pub(super) struct Items {
    pub(super) items: Vec<Item>,
    pub(super) triangles: Vec<u32>,
    /// `None` where there is no triangle.
    pub(super) root: Option<usize>,
}

/// Up to eight different triangles, sorted.
#[derive(Clone, Copy)]
struct Few {
    count: usize,
    triangles: [u32; WIDTH],
}

impl Few {
    fn of(triangles: &[u32]) -> Few {
        let mut few = Few {
            count: triangles.len(),
            triangles: [0; WIDTH],
        };
        few.triangles[..few.count].copy_from_slice(triangles);
        few
    }

    fn as_slice(&self) -> &[u32] {
        &self.triangles[..self.count]
    }

    /// What a leaf of them costs, of rays that meet its box.
    fn cost(&self, bounds: &Aabb) -> f64 {
        f64::from(leaf_cost(self.count)) * half_area(bounds)
    }

    /// All of both, unless they are too many.
    fn union(&self, other: &Few) -> Option<Few> {
        let mut all = Few::of(&[]);
        let (mut a, mut b) = (self.as_slice(), other.as_slice());
        while let Some(&next) = a.first().into_iter().chain(b.first()).min() {
            *all.triangles.get_mut(all.count)? = next;
            all.count += 1;
            a = &a[usize::from(a.first() == Some(&next))..];
            b = &b[usize::from(b.first() == Some(&next))..];
        }
        Some(all)
    }
}

/// What the parent of an item wants to know.
struct Solved {
    index: usize,
    /// How many items and triangles there were before those of the subtree.
    before: (usize, usize),
    bounds: Aabb,
    /// Cost in 1, 2, ... 8 places: that of visits, each by the area of the box (half its surface).
    costs: [f64; WIDTH],
    /// The triangles of the subtree, if they fit a leaf.
    few: Option<Few>,
}

struct Solver<'a, N> {
    tree: &'a Tree,
    nodes: &'a [N],
    items: Items,
    /// The cell of the node that is looked at, widened by how far triangles may reach beyond it.
    path: Vec<HalfSpace>,
    slack: f64,
    reach: f64,
}

pub(super) fn collapse(tree: &Tree) -> Items {
    with_nodes!(tree, nodes => {
        let reach = f64::from(tree.bounds().reach());
        let mut solver = Solver {
            tree,
            nodes,
            items: Items::default(),
            path: Vec::new(),
            slack: tree.place().overhang + 1e-14 * reach,
            reach,
        };
        let root = solver.solve(0, Frame::WORLD);
        solver.items.root = root.map(|root| root.index);
        solver.items
    })
}

fn half_area(bounds: &Aabb) -> f64 {
    0.5 * bounds.surface_area()
}

impl<N: Layout> Solver<'_, N> {
    /// The item of a node; `None` where nothing lies in its cell. `outer` is the frame of its box.
    fn solve(&mut self, at: usize, outer: u32) -> Option<Solved> {
        let (normal, offset, above) = match self.nodes[at].view(self.tree.shared()) {
            View::Leaf(leaf) => {
                return self.solve_leaf(at, leaf.triangles(self.tree.references()), outer);
            }
            View::Objects { above, frame } => {
                let children = [self.solve(at + 1, frame), self.solve(above, frame)];
                return self.join(children, outer, frame, Some(self.nodes[at].bounds()));
            }
            View::Axis {
                axis,
                offset,
                above,
            } => (glam::DVec3::AXES[axis], f64::from(offset), above),
            View::Oblique {
                normal,
                offset,
                above,
                ..
            } => {
                let normal = glam::Vec3::from(normal).as_dvec3();
                (normal, f64::from(offset), above)
            }
        };
        let children = [(at + 1, 1.0), (above, -1.0)].map(|(child, sign)| {
            self.path.push(HalfSpace {
                normal: sign * normal,
                offset: sign * offset + self.slack,
            });
            let solved = self.solve(child, outer);
            self.path.pop();
            solved
        });
        self.join(children, outer, outer, None)
    }

    fn solve_leaf(&mut self, at: usize, triangles: &[u32], outer: u32) -> Option<Solved> {
        if self.tree.choice().spec.objects {
            return self.leaves(triangles, self.nodes[at].bounds(), outer);
        }
        let mesh = self.tree.mesh();
        let mut bounds = Aabb::EMPTY;
        let mut inside = Vec::with_capacity(triangles.len());
        for &triangle in triangles {
            let own = clipped_box(&mesh.corners(triangle), &self.path, self.reach);
            if !own.is_empty() {
                bounds = bounds.union(&own);
                inside.push(triangle);
            }
        }
        self.leaves(&inside, bounds, outer)
    }

    /// As many leaves of one box as the triangles need.
    fn leaves(&mut self, triangles: &[u32], bounds: Aabb, frame: u32) -> Option<Solved> {
        if triangles.is_empty() {
            return None;
        }
        if triangles.len() > WIDTH {
            let leaves = triangles.len().div_ceil(WIDTH);
            let (first, second) = triangles.split_at(leaves / 2 * WIDTH);
            let children = [first, second].map(|part| self.leaves(part, bounds, frame));
            return self.join(children, frame, frame, None);
        }
        let before = (self.items.items.len(), self.items.triangles.len());
        Some(self.add_leaf(before, Few::of(triangles), bounds))
    }

    fn add_leaf(&mut self, before: (usize, usize), few: Few, bounds: Aabb) -> Solved {
        let leaf = self.keep(&few);
        let index = self.add(bounds, Some(leaf), None);
        Solved {
            index,
            before,
            bounds,
            costs: [few.cost(&bounds); WIDTH],
            few: Some(few),
        }
    }

    fn keep(&mut self, few: &Few) -> Leaf {
        let start = self.items.triangles.len();
        self.items.triangles.extend_from_slice(few.as_slice());
        Leaf {
            start,
            count: few.count,
        }
    }

    fn add(&mut self, bounds: Aabb, leaf: Option<Leaf>, interior: Option<Interior>) -> usize {
        self.items.items.push(Item {
            bounds,
            leaf,
            interior,
        });
        self.items.items.len() - 1
    }

    /// `bounds` are given where they are not the union of the children's.
    fn join(
        &mut self,
        children: [Option<Solved>; 2],
        outer: u32,
        frame: u32,
        bounds: Option<Aabb>,
    ) -> Option<Solved> {
        let [first, second] = match children {
            [Some(first), Some(second)] => [first, second],
            [one, other] => return one.or(other),
        };
        let before = first.before;
        let bounds = bounds.unwrap_or_else(|| first.bounds.union(&second.bounds));
        let few = match (&first.few, &second.few) {
            (Some(first), Some(second)) => first.union(second),
            _ => None,
        };
        let mut open = [f64::INFINITY; WIDTH];
        let mut places = [0; WIDTH];
        for m in 1..WIDTH {
            for k in 1..=m {
                let cost = first.costs[k - 1] + second.costs[m - k];
                if cost < open[m] {
                    (open[m], places[m]) = (cost, k as u8);
                }
            }
        }
        let as_node = NODE_COST * half_area(&bounds) + open[WIDTH - 1];
        let as_leaf = few.filter(|few| few.cost(&bounds) <= as_node);
        let mut costs = [as_leaf.map_or(as_node, |few| few.cost(&bounds)); WIDTH];
        // Only boxes of its own frame fit the wide node above; eight places are those of a node.
        for m in 1..WIDTH - 1 {
            costs[m] = costs[m - 1];
            if frame == outer && open[m] < costs[m] {
                costs[m] = open[m];
            } else {
                places[m] = 0;
            }
        }
        costs[WIDTH - 1] = costs[WIDTH - 2];
        if let Some(few) = as_leaf
            && costs[WIDTH - 1] == costs[0]
        {
            // Best as a leaf wherever it is: what is below is not needed.
            self.items.items.truncate(before.0);
            self.items.triangles.truncate(before.1);
            return Some(self.add_leaf(before, few, bounds));
        }
        let leaf = as_leaf.map(|few| self.keep(&few));
        let interior = Interior {
            children: [first.index, second.index],
            frame,
            places,
        };
        Some(Solved {
            index: self.add(bounds, leaf, Some(interior)),
            before,
            bounds,
            costs,
            few,
        })
    }
}
