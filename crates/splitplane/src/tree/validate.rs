use glam::DVec3;

use super::nodes::{Layout, View};
use super::{Tree, with_nodes};
use crate::geometry::polytope::{CutScratch, Polytope};

/// The promise that [`Tree::validate`] finds broken.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ValidateError {
    /// A node names a child or a reference that does not exist, or is named twice or never.
    #[error("node {node}: {what}")]
    Structure {
        /// The node's index.
        node: usize,
        /// What is wrong with it.
        what: &'static str,
    },
    /// A triangle reaches into a leaf that does not list it.
    #[error("triangle {triangle} reaches into leaf {node}, which does not list it")]
    MissingReference {
        /// The leaf's index.
        node: usize,
        /// The triangle's index.
        triangle: u32,
    },
    /// The leaves' cells do not fill the root's.
    #[error("the leaves' cells have a volume of {leaves}, the root's has {root}")]
    Volume {
        /// Sum over the leaves, in cubic scene units.
        leaves: f64,
        /// The root's, in cubic scene units.
        root: f64,
    },
}

impl Tree {
    /// Checks that the tree keeps its promises: that it is a tree, that the cells of its leaves
    /// fill the scene's box without overlap, and that every triangle is in every leaf that it
    /// touches, up to the tolerance that queries allow for. Slow: for tests.
    ///
    /// # Errors
    /// The first promise that is broken, and where.
    pub fn validate(&self) -> Result<(), ValidateError> {
        with_nodes!(self, nodes => {
            self.validate_structure(nodes)?;
            if self.choice.spec.objects {
                return self.validate_boxes(nodes);
            }
            self.validate_volume(nodes)?;
            self.validate_references(nodes)
        })
    }

    fn validate_structure<N: Layout>(&self, nodes: &[N]) -> Result<(), ValidateError> {
        let broken = |node, what| Err(ValidateError::Structure { node, what });
        let mut seen = vec![false; nodes.len()];
        let mut pending = vec![0];
        while let Some(at) = pending.pop() {
            if at >= nodes.len() {
                return broken(at, "does not exist");
            }
            if std::mem::replace(&mut seen[at], true) {
                return broken(at, "has two parents");
            }
            match nodes[at].view(&self.shared) {
                View::Axis { above, .. }
                | View::Oblique { above, .. }
                | View::Objects { above, .. } => pending.extend([above, at + 1]),
                View::Leaf(leaf) => {
                    let Some(triangles) = leaf.try_triangles(&self.references) else {
                        return broken(at, "has references that do not exist");
                    };
                    if triangles.windows(2).any(|pair| pair[0] >= pair[1]) {
                        return broken(at, "lists a triangle twice or out of order");
                    }
                    let usable = self.mesh.usable_triangles();
                    if triangles
                        .iter()
                        .any(|triangle| usable.binary_search(triangle).is_err())
                    {
                        return broken(at, "lists a triangle that cannot be hit");
                    }
                }
            }
        }
        match seen.iter().position(|&seen| !seen) {
            Some(at) => broken(at, "has no parent"),
            None => Ok(()),
        }
    }

    /// Every triangle is in one leaf, and the boxes above it hold it.
    fn validate_boxes<N: Layout>(&self, nodes: &[N]) -> Result<(), ValidateError> {
        let mut listed = Vec::new();
        let mut pending = vec![(0, self.bounds())];
        while let Some((at, outer)) = pending.pop() {
            let bounds = nodes[at].bounds();
            if bounds.union(&outer) != outer {
                return Err(ValidateError::Structure {
                    node: at,
                    what: "has a box larger than its parent's",
                });
            }
            match nodes[at].view(&self.shared) {
                View::Leaf(leaf) => {
                    for &triangle in leaf.triangles(&self.references) {
                        let own = crate::Aabb::of_points(self.mesh.corners(triangle));
                        if own.union(&bounds) != bounds {
                            return Err(ValidateError::MissingReference { node: at, triangle });
                        }
                        listed.push(triangle);
                    }
                }
                View::Objects { above, .. } => pending.extend([(above, bounds), (at + 1, bounds)]),
                View::Axis { .. } | View::Oblique { .. } => {
                    return Err(ValidateError::Structure {
                        node: at,
                        what: "has a plane",
                    });
                }
            }
        }
        listed.sort_unstable();
        if listed != self.mesh.usable_triangles() {
            return Err(ValidateError::Structure {
                node: 0,
                what: "does not list every triangle once",
            });
        }
        Ok(())
    }

    fn validate_volume<N: Layout>(&self, nodes: &[N]) -> Result<(), ValidateError> {
        if self.bounds().is_empty() {
            return Ok(());
        }
        let cell = Polytope::from_box(&self.bounds());
        let root = cell.volume();
        let mut leaves = 0.0;
        let mut pending = vec![(0, cell)];
        while let Some((at, cell)) = pending.pop() {
            match split_plane(&nodes[at].view(&self.shared)) {
                None => leaves += cell.volume(),
                Some((normal, offset, above)) => {
                    match cell.cut(normal, offset, &mut CutScratch::default()) {
                        Some((below, rest)) => pending.extend([(above, rest), (at + 1, below)]),
                        // Too thin to be cut: one child has it all.
                        None => pending.extend([(above, Polytope::default()), (at + 1, cell)]),
                    }
                }
            }
        }
        if (leaves - root).abs() > 1e-6 * root {
            return Err(ValidateError::Volume { leaves, root });
        }
        Ok(())
    }

    fn validate_references<N: Layout>(&self, nodes: &[N]) -> Result<(), ValidateError> {
        for &triangle in self.mesh.usable_triangles() {
            let corners = self
                .mesh
                .corners(triangle)
                .map(|p| glam::Vec3::from(p).as_dvec3());
            let mut pending = vec![(0, corners.to_vec())];
            while let Some((at, polygon)) = pending.pop() {
                if polygon.is_empty() {
                    continue;
                }
                let view = nodes[at].view(&self.shared);
                if let Some((normal, offset, above)) = split_plane(&view) {
                    let part = |sign: f64| {
                        clip(&polygon, sign * normal, sign * offset - self.place.overhang)
                    };
                    pending.extend([(above, part(-1.0)), (at + 1, part(1.0))]);
                } else if let View::Leaf(leaf) = view
                    && !leaf.triangles(&self.references).contains(&triangle)
                {
                    return Err(ValidateError::MissingReference { node: at, triangle });
                }
            }
        }
        Ok(())
    }
}

/// The plane of an interior node and the child above it.
fn split_plane(view: &View) -> Option<(DVec3, f64, usize)> {
    match *view {
        View::Axis {
            axis,
            offset,
            above,
        } => Some((DVec3::AXES[axis], f64::from(offset), above)),
        View::Oblique {
            normal,
            offset,
            above,
            ..
        } => Some((
            glam::Vec3::from(normal).as_dvec3(),
            f64::from(offset),
            above,
        )),
        View::Leaf(_) | View::Objects { .. } => None,
    }
}

/// The part of a polygon with `normal · x < offset`.
fn clip(polygon: &[DVec3], normal: DVec3, offset: f64) -> Vec<DVec3> {
    let mut part = Vec::with_capacity(polygon.len() + 1);
    for (i, &p) in polygon.iter().enumerate() {
        let q = polygon[(i + 1) % polygon.len()];
        let (h, k) = (normal.dot(p) - offset, normal.dot(q) - offset);
        if h < 0.0 {
            part.push(p);
        }
        if (h < 0.0) != (k < 0.0) && h != k {
            part.push(p + (q - p) * (h / (h - k)));
        }
    }
    if part.iter().all(|p| normal.dot(*p) - offset >= 0.0) {
        part.clear();
    }
    part
}
