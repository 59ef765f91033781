use glam::DVec3;

use super::nodes::{Layout, View};
use super::wide::{Child, LEAF_ROWS, MAX_DEPTH, MAX_FRAMES, WIDTH, Wide};
use super::{Tree, with_nodes};
use crate::build::BuildParams;
use crate::geometry::Frame;
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
        self.check_structure()?;
        if let Some(wide) = self.wide() {
            return self.validate_wide(wide);
        }
        with_nodes!(self, nodes => {
            if self.choice.spec.objects {
                return self.validate_boxes(nodes);
            }
            self.validate_volume(nodes)?;
            self.validate_references(nodes)
        })
    }

    /// Checks what queries rely on for their indices and their ends: that the nodes are a tree of
    /// no more than the greatest depth, and that all that they name is there.
    pub(super) fn check_structure(&self) -> Result<(), ValidateError> {
        match self.wide() {
            Some(wide) => self.check_wide(wide),
            None => with_nodes!(self, nodes => self.check_binary(nodes)),
        }
    }

    /// Per triangle, whether it can be hit.
    fn hittable(&self) -> Vec<bool> {
        let mut hittable = vec![false; self.mesh.triangles().len()];
        for &triangle in self.mesh.usable_triangles() {
            hittable[triangle as usize] = true;
        }
        hittable
    }

    fn check_binary<N: Layout>(&self, nodes: &[N]) -> Result<(), ValidateError> {
        let broken = |node, what| Err(ValidateError::Structure { node, what });
        let hittable = self.hittable();
        let mut seen = vec![false; nodes.len()];
        let mut pending = vec![(0, 0)];
        while let Some((at, depth)) = pending.pop() {
            if at >= nodes.len() {
                return broken(at, "does not exist");
            }
            if std::mem::replace(&mut seen[at], true) {
                return broken(at, "has two parents");
            }
            if depth > BuildParams::MAX_DEPTH {
                return broken(at, "is too deep");
            }
            if !nodes[at].is_sound(&self.shared) {
                return broken(at, "is none of its kind");
            }
            match nodes[at].view(&self.shared) {
                View::Axis { above, .. }
                | View::Oblique { above, .. }
                | View::Objects { above, .. } => {
                    pending.extend([(above, depth + 1), (at + 1, depth + 1)]);
                }
                View::Leaf(leaf) => {
                    let Some(triangles) = leaf.try_triangles(&self.references) else {
                        return broken(at, "has references that do not exist");
                    };
                    if triangles.windows(2).any(|pair| pair[0] >= pair[1]) {
                        return broken(at, "lists a triangle twice or out of order");
                    }
                    if !triangles
                        .iter()
                        .all(|&i| hittable.get(i as usize) == Some(&true))
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

    fn check_wide(&self, wide: &Wide) -> Result<(), ValidateError> {
        let broken = |node, what| Err(ValidateError::Structure { node, what });
        let hittable = self.hittable();
        let rows = wide.leaves.len().checked_sub(WIDTH);
        if !rows.is_some_and(|rows| rows.is_multiple_of(LEAF_ROWS)) {
            return broken(0, "has leaves that are cut short");
        }
        if wide.frames.is_empty() || wide.frames.len() > MAX_FRAMES {
            return broken(0, "has no frame, or too many");
        }
        // With others, where a ray meets a box may be no number, and an absent child be met.
        if !wide.frames.iter().all(Frame::is_sound) {
            return broken(0, "has a frame whose axes are not of unit length");
        }
        if (wide.center, wide.half_extent) != Wide::scale(&self.bounds()) {
            return broken(0, "is not where the scene is");
        }
        let mut seen = vec![false; wide.nodes.len()];
        let mut pending = vec![(0, 1)];
        while let Some((at, depth)) = pending.pop() {
            let Some(node) = wide.nodes.get(at) else {
                return broken(at, "does not exist");
            };
            if std::mem::replace(&mut seen[at], true) {
                return broken(at, "has two parents");
            }
            if depth > MAX_DEPTH {
                return broken(at, "is too deep");
            }
            if node.frame as usize >= wide.frames.len() {
                return broken(at, "has a frame that does not exist");
            }
            for slot in 0..WIDTH {
                let side = |row: usize| [0, 1, 2].map(|axis| node.bounds[row + axis][slot]);
                let (low, high) = (side(0), side(3));
                // A child that is nearly absent would be met: see `present`.
                if low == [f32::INFINITY; 3] && high == [f32::NEG_INFINITY; 3] {
                    continue;
                }
                if !low.iter().zip(&high).all(|(low, high)| low <= high) {
                    return broken(at, "has a box that is not one");
                }
                match node.children[slot].child() {
                    Child::Node(child) => pending.push((child, depth + 1)),
                    Child::Leaf { start, count } => {
                        if start + count > wide.references() {
                            return broken(at, "has references that do not exist");
                        }
                        let mut triangles = wide.triangles(start, count).iter();
                        if !triangles.all(|&i| hittable.get(i as usize) == Some(&true)) {
                            return broken(at, "lists a triangle that cannot be hit");
                        }
                    }
                }
            }
        }
        match seen.iter().position(|&seen| !seen) {
            Some(at) => broken(at, "has no parent"),
            None => Ok(()),
        }
    }

    /// Every point of a triangle is in a leaf that lists the triangle, and in all boxes above it;
    /// checked for a few points of each triangle.
    fn validate_boxes<N: Layout>(&self, nodes: &[N]) -> Result<(), ValidateError> {
        let mut cover = Cover::new(self);
        let mut path = Vec::new();
        let mut pending = vec![(0, 0, Frame::WORLD)];
        while let Some((at, depth, frame)) = pending.pop() {
            path.truncate(depth);
            path.push((nodes[at].bounds(), frame));
            match nodes[at].view(&self.shared) {
                View::Leaf(leaf) => {
                    cover.leaf(leaf.triangles(&self.references), |p| {
                        path.iter().all(|(bounds, frame)| {
                            let p = self.shared.frame(*frame).map(p);
                            (0..3).all(|i| {
                                f64::from(bounds.min[i]) <= p[i] && p[i] <= f64::from(bounds.max[i])
                            })
                        })
                    });
                }
                View::Objects { above, frame } => {
                    pending.extend([(above, depth + 1, frame), (at + 1, depth + 1, frame)]);
                }
                View::Axis { .. } | View::Oblique { .. } => {
                    return Err(ValidateError::Structure {
                        node: at,
                        what: "has a plane",
                    });
                }
            }
        }
        cover.finish()
    }

    /// The same for the boxes of wide nodes.
    fn validate_wide(&self, wide: &Wide) -> Result<(), ValidateError> {
        let mut cover = Cover::new(self);
        let mut path: Vec<(usize, usize)> = Vec::new();
        let mut pending = vec![(0, 0usize, None)];
        while let Some((at, depth, slot)) = pending.pop() {
            path.truncate(depth.saturating_sub(1));
            path.extend(slot);
            let node = &wide.nodes[at];
            for (slot, child) in node.present() {
                match child {
                    Child::Node(child) => pending.push((child, depth + 1, Some((at, slot)))),
                    Child::Leaf { start, count } => {
                        let boxes = || path.iter().copied().chain([(at, slot)]);
                        cover.leaf(wide.triangles(start, count), |p| {
                            boxes().all(|(node, slot)| wide.nodes[node].holds(slot, p, wide))
                        });
                    }
                }
            }
        }
        cover.finish()
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
                    let scratch = &mut CutScratch::default();
                    match cell.cut(normal, offset, [true, true], scratch) {
                        Some(parts) => {
                            let parts = [at + 1, above].into_iter().zip(parts);
                            pending.extend(parts.filter_map(|(at, part)| Some((at, part?))));
                        }
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

/// Which points of the triangles have been found in a leaf that lists their triangle.
struct Cover<'a> {
    tree: &'a Tree,
    /// Per triangle, a bit for each point.
    found: Vec<u16>,
}

impl Cover<'_> {
    /// The weights of the points, out of 4: corners, points of edges, points inside.
    const POINTS: [[u8; 3]; 15] = {
        let mut points = [[0; 3]; 15];
        let (mut a, mut next) = (0, 0);
        while a <= 4 {
            let mut b = 0;
            while a + b <= 4 {
                points[next] = [a, b, 4 - a - b];
                next += 1;
                b += 1;
            }
            a += 1;
        }
        points
    };

    fn new(tree: &Tree) -> Cover<'_> {
        Cover {
            tree,
            found: vec![0; tree.mesh.triangles().len()],
        }
    }

    fn leaf(&mut self, triangles: &[u32], holds: impl Fn([f64; 3]) -> bool) {
        for &triangle in triangles {
            let corners = self.tree.mesh.corners(triangle).map(|p| p.map(f64::from));
            for (i, weights) in Cover::POINTS.iter().enumerate() {
                let coordinate = |axis: usize| {
                    let weighted = (0..3).map(|k| f64::from(weights[k]) * corners[k][axis]);
                    weighted.sum::<f64>() / 4.0
                };
                if holds([0, 1, 2].map(coordinate)) {
                    self.found[triangle as usize] |= 1 << i;
                }
            }
        }
    }

    fn finish(&self) -> Result<(), ValidateError> {
        let all = (1 << Cover::POINTS.len()) - 1;
        let usable = self.tree.mesh.usable_triangles();
        match usable.iter().find(|&&i| self.found[i as usize] != all) {
            Some(&triangle) => Err(ValidateError::MissingReference { node: 0, triangle }),
            None => Ok(()),
        }
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
