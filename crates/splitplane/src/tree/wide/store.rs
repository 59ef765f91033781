//! Writes wide nodes and leaves.

use super::collapse::{Item, Items};
use super::{LEAF_ROWS, Link, WIDTH, Wide, WideNode};
use crate::build::BuildError;
use crate::geometry::frame::{round_down, round_up};
use crate::geometry::{Aabb, Frame};
use crate::tree::Tree;

struct Writer<'a> {
    tree: &'a Tree,
    items: &'a Items,
    nodes: Vec<WideNode>,
    leaves: Vec<u32>,
    frames: &'a [Frame],
    center: [f32; 3],
    /// Per item, how likely a ray that meets its box is stopped in it, and at what cost.
    odds: Vec<Odds>,
}

#[derive(Clone, Copy)]
struct Odds {
    stopped: f64,
    cost: f64,
}

pub(super) fn store(tree: &Tree, items: &Items) -> Result<Wide, BuildError> {
    for (what, count, limit) in [
        ("nodes", items.items.len(), Link::MAX_NODE),
        ("references", items.triangles.len(), Link::MAX_START),
    ] {
        if count > limit {
            return Err(BuildError::TooLarge { what, count, limit });
        }
    }
    let shared = &tree.shared().frames;
    let (center, half_extent) = Wide::scale(&tree.bounds());
    let frames = match shared.is_empty() {
        true => vec![Frame::IDENTITY],
        false => shared.clone(),
    };
    let mut writer = Writer {
        tree,
        items,
        nodes: Vec::new(),
        leaves: Vec::new(),
        frames: &frames,
        center,
        odds: Vec::with_capacity(items.items.len()),
    };
    writer.find_odds();
    match items.root {
        Some(root) => match &items.items[root].interior {
            Some(_) => writer.node(root),
            None => writer.node_of(&[root], Frame::WORLD),
        },
        None => writer.node_of(&[], Frame::WORLD),
    };
    // Eight numbers are read from the start of every row.
    writer.leaves.extend([0; WIDTH]);
    let (mut nodes, mut leaves) = (writer.nodes, writer.leaves);
    nodes.shrink_to_fit();
    leaves.shrink_to_fit();
    Ok(Wide {
        nodes: nodes.into(),
        leaves: leaves.into(),
        frames,
        center,
        half_extent,
    })
}

impl Writer<'_> {
    /// What any-hit queries go by: a ray that meets a box meets a triangle in it about as often as
    /// their areas say.
    fn find_odds(&mut self) {
        let mesh = self.tree.mesh();
        for item in &self.items.items {
            let area = item.bounds.surface_area();
            let odds = match (&item.leaf, &item.interior) {
                (Some(leaf), _) => {
                    let triangles = &self.items.triangles[leaf.start..][..leaf.count];
                    let own: f64 = triangles.iter().map(|&i| mesh.area(i)).sum();
                    Odds {
                        stopped: (2.0 * own / area).min(0.9),
                        cost: 1.0,
                    }
                }
                (None, Some(interior)) => {
                    let (mut passed, mut cost) = (1.0, 1.0);
                    for child in interior.children {
                        let meets = self.items.items[child].bounds.surface_area() / area;
                        let child = self.odds[child];
                        cost += passed * meets.min(1.0) * child.cost;
                        passed *= 1.0 - meets.min(1.0) * child.stopped;
                    }
                    Odds {
                        stopped: 1.0 - passed,
                        cost,
                    }
                }
                (None, None) => unreachable!("an item is a leaf or has children"),
            };
            self.odds.push(odds);
        }
    }

    /// The items that fill `places` places of a wide node with what is below `item`.
    fn fill(&self, at: usize, places: usize, filled: &mut Vec<usize>) {
        let item: &Item = &self.items.items[at];
        let first = match &item.interior {
            Some(interior) if places > 1 => match usize::from(interior.places[places - 1]) {
                0 => return self.fill(at, places - 1, filled),
                first => first,
            },
            _ => return filled.push(at),
        };
        let [a, b] = item.interior.as_ref().map_or([at; 2], |i| i.children);
        self.fill(a, first, filled);
        self.fill(b, places - first, filled);
    }

    /// Writes an interior item as a wide node, with all below it; gives its index.
    fn node(&mut self, at: usize) -> usize {
        let Some(interior) = &self.items.items[at].interior else {
            unreachable!("a leaf is no node");
        };
        let first = usize::from(interior.places[WIDTH - 1]);
        let mut filled = Vec::with_capacity(WIDTH);
        self.fill(interior.children[0], first, &mut filled);
        self.fill(interior.children[1], WIDTH - first, &mut filled);
        self.node_of(&filled, interior.frame)
    }

    /// Writes a wide node with these items as children.
    fn node_of(&mut self, children: &[usize], frame: u32) -> usize {
        let index = self.nodes.len();
        self.nodes.push(WideNode {
            bounds: std::array::from_fn(|row| match row < 3 {
                true => [f32::INFINITY; WIDTH],
                false => [f32::NEG_INFINITY; WIDTH],
            }),
            children: [Link::node(0); WIDTH],
            frame,
            unused: [0; 7],
        });
        let center = self.frames[frame as usize].map(self.center.map(f64::from));
        let mut children = children.to_vec();
        // Any-hit queries take children in the order in which they are stored.
        let worth = |&child: &usize| self.odds[child].stopped / self.odds[child].cost;
        children.sort_by(|a, b| worth(b).total_cmp(&worth(a)));
        for (slot, &child) in children.iter().enumerate() {
            let relative = relative(&self.items.items[child].bounds, center);
            for axis in 0..3 {
                self.nodes[index].bounds[axis][slot] = relative.min[axis];
                self.nodes[index].bounds[axis + 3][slot] = relative.max[axis];
            }
        }
        for (slot, &child) in children.iter().enumerate() {
            let item = &self.items.items[child];
            let link = match item.leaf {
                Some(leaf) => self.leaf(leaf.start, leaf.count),
                None => Link::node(self.node(child)),
            };
            self.nodes[index].children[slot] = link;
        }
        index
    }

    fn leaf(&mut self, start: usize, count: usize) -> Link {
        let triangles = &self.items.triangles[start..][..count];
        let corners: Vec<_> = triangles
            .iter()
            .map(|&triangle| self.tree.mesh().corners(triangle))
            .collect();
        let start = self.leaves.len() / LEAF_ROWS;
        for row in 0..9 {
            let row = corners.iter().map(|corners| corners[row / 3][row % 3]);
            self.leaves.extend(row.map(f32::to_bits));
        }
        self.leaves.extend_from_slice(triangles);
        Link::leaf(start, count)
    }
}

/// A box relative to a point, rounded outward.
fn relative(bounds: &Aabb, center: [f64; 3]) -> Aabb {
    Aabb {
        min: std::array::from_fn(|i| round_down(f64::from(bounds.min[i]) - center[i])),
        max: std::array::from_fn(|i| round_up(f64::from(bounds.max[i]) - center[i])),
    }
}
