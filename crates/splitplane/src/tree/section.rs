//! A tree and its mesh, cut by a plane across an axis: what a picture of the splitting shows.

use super::nodes::{Layout, View};
use super::wide::{Child, Wide, WideNode};
use super::{Tree, with_nodes};
use crate::geometry::{Aabb, Frame};

/// An axis of the scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Axis {
    /// The first coordinate.
    X,
    /// The second coordinate.
    Y,
    /// The third coordinate.
    Z,
}

/// A cut through a tree and its mesh by a plane across an axis; see [`Tree::section`].
///
/// Points are `[u, v]` in scene units: the coordinates along the other two axes, in the order of
/// the axes (across x: y and z; across y: x and z; across z: x and y).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Section {
    /// The smallest and the largest corner of the scene's box in the plane of the section.
    pub bounds: [[f64; 2]; 2],
    /// Where the plane of the section meets split planes, each in its node's cell; in a bounding
    /// volume hierarchy the four sides of each box. Parents come before their children.
    pub segments: Vec<SectionSegment>,
    /// The cells that the plane of the section meets. They fill the scene's box in that plane; the
    /// boxes of a bounding volume hierarchy may overlap and leave gaps.
    pub cells: Vec<SectionCell>,
    /// Where the plane of the section meets triangles, from point to point, in the order of the
    /// mesh. Of triangles that touch it with an edge, those that reach below it count.
    pub triangles: Vec<[[f64; 2]; 2]>,
}

/// Where a split plane, or a side of a box, meets the plane of a section.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SectionSegment {
    /// One end.
    pub from: [f64; 2],
    /// The other end.
    pub to: [f64; 2],
    /// Depth of the node; the root's is 0.
    pub depth: u32,
    /// The plane is not across an axis, or is so only by chance; of boxes, they are in a frame of
    /// their own.
    pub oblique: bool,
}

/// Where a cell meets the plane of a section.
#[derive(Clone, Debug, PartialEq)]
pub struct SectionCell {
    /// The corners of a convex polygon, in order.
    pub polygon: Vec<[f64; 2]>,
    /// Depth of the node; the root's is 0.
    pub depth: u32,
    /// Triangles in the leaf; where the section ends above the leaves, different triangles in
    /// all leaves of the node.
    pub triangles: u32,
}

impl Axis {
    /// All axes.
    pub const ALL: [Axis; 3] = [Axis::X, Axis::Y, Axis::Z];

    /// 0, 1 or 2.
    pub fn index(self) -> usize {
        self as usize
    }

    /// The other two axes, in their order: those of a section's points.
    pub fn others(self) -> [Axis; 2] {
        match self {
            Axis::X => [Axis::Y, Axis::Z],
            Axis::Y => [Axis::X, Axis::Z],
            Axis::Z => [Axis::X, Axis::Y],
        }
    }
}

impl Section {
    /// Adds the sides of a box.
    fn add_sides(&mut self, polygon: &[[f64; 2]], depth: u32, oblique: bool) {
        let next = polygon.iter().cycle().skip(1);
        let sides = polygon.iter().zip(next);
        (self.segments).extend(sides.map(|(&from, &to)| SectionSegment {
            from,
            to,
            depth,
            oblique,
        }));
    }

    /// Triangle tests of a random line in the plane of the section, on average, if it tests the
    /// triangles of every cell on its way: what the SAH is in space, with the cells' perimeters in
    /// place of their areas. 0 where the section has no extent.
    pub fn expected_tests(&self) -> f64 {
        let [min, max] = self.bounds;
        let whole = 2.0 * ((max[0] - min[0]) + (max[1] - min[1]));
        let tests: f64 = (self.cells.iter())
            .map(|cell| perimeter(&cell.polygon) * f64::from(cell.triangles))
            .sum();
        if whole > 0.0 { tests / whole } else { 0.0 }
    }
}

fn perimeter(polygon: &[[f64; 2]]) -> f64 {
    let next = polygon.iter().cycle().skip(1);
    polygon
        .iter()
        .zip(next)
        .map(|(p, q)| (q[0] - p[0]).hypot(q[1] - p[1]))
        .sum()
}

impl Tree {
    /// The tree and its mesh, cut by the plane across `axis` at the coordinate `offset` (in scene
    /// units), down to cells at depth `max_depth`; `u32::MAX`: to the leaves. Empty where the
    /// plane does not meet the scene's box. Of a tree in the wide layout, whose planes are gone,
    /// there are the boxes.
    pub fn section(&self, axis: Axis, offset: f64, max_depth: u32) -> Section {
        let plane = Plane { axis, offset };
        let Some(bounds) = plane.meet_box(&self.bounds()) else {
            return Section::default();
        };
        let mut section = Section {
            bounds,
            ..Section::default()
        };
        if let Some(wide) = self.wide() {
            section_of_wide(wide, &plane, max_depth, &mut section);
        } else {
            with_nodes!(self, nodes => if self.choice.spec.objects {
                self.section_of_boxes(nodes, &plane, max_depth, &mut section);
            } else {
                self.section_of_cells(nodes, &plane, max_depth, &mut section);
            });
        }
        section.triangles = (self.mesh.usable_triangles().iter())
            .filter_map(|&triangle| plane.meet_triangle(&self.mesh.corners(triangle)))
            .collect();
        section
    }

    fn section_of_cells<N: Layout>(
        &self,
        nodes: &[N],
        plane: &Plane,
        max_depth: u32,
        section: &mut Section,
    ) {
        // Stored offsets are f32: what differs by less than this is the same place.
        let epsilon = 1e-10 * f64::from(self.bounds().diagonal());
        let mut pending = vec![(0, 0, rectangle(section.bounds))];
        while let Some((at, depth, polygon)) = pending.pop() {
            let view = nodes[at].view(&self.shared);
            let (normal, offset, above, oblique) = match view {
                _ if depth >= max_depth => {
                    section.cells.push(self.cell(nodes, at, depth, polygon));
                    continue;
                }
                View::Leaf(_) | View::Objects { .. } => {
                    section.cells.push(self.cell(nodes, at, depth, polygon));
                    continue;
                }
                View::Axis {
                    axis,
                    offset,
                    above,
                } => {
                    let mut normal = [0.0; 3];
                    normal[axis] = 1.0;
                    (normal, offset, above, false)
                }
                View::Oblique {
                    normal,
                    offset,
                    above,
                    is_axis,
                } => (normal, offset, above, !is_axis),
            };
            let (line, line_offset) = plane.meet_plane(normal, f64::from(offset));
            let parts = split(&polygon, line, line_offset, epsilon);
            if let Some([from, to]) = parts.chord {
                section.segments.push(SectionSegment {
                    from,
                    to,
                    depth,
                    oblique,
                });
            }
            let children = [(above, parts.above), (at + 1, parts.below)];
            for (child, part) in children {
                if !part.is_empty() {
                    pending.push((child, depth + 1, part));
                }
            }
        }
    }

    fn section_of_boxes<N: Layout>(
        &self,
        nodes: &[N],
        plane: &Plane,
        max_depth: u32,
        section: &mut Section,
    ) {
        let mut pending = vec![(0, 0, Frame::WORLD)];
        while let Some((at, depth, frame)) = pending.pop() {
            let bounds = nodes[at].bounds();
            let polygon = match frame {
                Frame::WORLD => plane.meet_box(&bounds).map_or_else(Vec::new, rectangle),
                _ => plane.meet_turned_box(
                    &bounds,
                    self.shared.frame(frame),
                    [0.0; 3],
                    section.bounds,
                ),
            };
            if polygon.is_empty() {
                continue;
            }
            section.add_sides(&polygon, depth, frame != Frame::WORLD);
            match nodes[at].view(&self.shared) {
                View::Objects { above, frame } if depth < max_depth => {
                    pending.extend([(above, depth + 1, frame), (at + 1, depth + 1, frame)]);
                }
                _ => section.cells.push(self.cell(nodes, at, depth, polygon)),
            }
        }
    }

    /// The cell of a node, with the triangles of all leaves below it.
    fn cell<N: Layout>(
        &self,
        nodes: &[N],
        at: usize,
        depth: u32,
        polygon: Vec<[f64; 2]>,
    ) -> SectionCell {
        let mut triangles = Vec::new();
        let mut pending = vec![at];
        while let Some(at) = pending.pop() {
            match nodes[at].view(&self.shared) {
                View::Leaf(leaf) => triangles.extend_from_slice(leaf.triangles(&self.references)),
                View::Axis { above, .. }
                | View::Oblique { above, .. }
                | View::Objects { above, .. } => pending.extend([above, at + 1]),
            }
        }
        triangles.sort_unstable();
        triangles.dedup();
        SectionCell {
            polygon,
            depth,
            triangles: triangles.len() as u32,
        }
    }
}

/// The boxes of a wide tree, each in its node's frame.
fn section_of_wide(wide: &Wide, plane: &Plane, max_depth: u32, section: &mut Section) {
    let center = wide.center.map(f64::from);
    let mut pending = vec![(0, 1)];
    while let Some((at, depth)) = pending.pop() {
        let node: &WideNode = &wide.nodes[at];
        let frame = &wide.frames[node.frame as usize];
        for (slot, child) in node.present() {
            let bounds = node.child_bounds(slot);
            let polygon = plane.meet_turned_box(&bounds, frame, center, section.bounds);
            if polygon.is_empty() {
                continue;
            }
            section.add_sides(&polygon, depth, node.frame != Frame::WORLD);
            match child {
                Child::Node(child) if depth < max_depth => pending.push((child, depth + 1)),
                _ => {
                    let triangles = wide.triangles_below(child).len() as u32;
                    section.cells.push(SectionCell {
                        polygon,
                        depth,
                        triangles,
                    });
                }
            }
        }
    }
}

/// The plane of a section.
struct Plane {
    axis: Axis,
    offset: f64,
}

impl Plane {
    fn flat(&self, point: [f64; 3]) -> [f64; 2] {
        self.axis.others().map(|axis| point[axis.index()])
    }

    /// The smallest and the largest corner of the box in the plane.
    fn meet_box(&self, bounds: &Aabb) -> Option<[[f64; 2]; 2]> {
        let [min, max] = [bounds.min, bounds.max].map(|corner| corner.map(f64::from));
        let across = self.axis.index();
        (min[across] <= self.offset && self.offset <= max[across])
            .then(|| [self.flat(min), self.flat(max)])
    }

    /// The part of a box of a frame that is in the plane, within a rectangle of it. The box is
    /// relative to `center`, which is a point of the world.
    fn meet_turned_box(
        &self,
        bounds: &Aabb,
        frame: &Frame,
        center: [f64; 3],
        within: [[f64; 2]; 2],
    ) -> Vec<[f64; 2]> {
        let mut polygon = rectangle(within);
        let center = frame.map(center);
        for (axis, row) in frame.rows.into_iter().enumerate() {
            let [min, max] = [bounds.min[axis], bounds.max[axis]].map(f64::from);
            for (normal, offset) in [
                (row, max + center[axis]),
                (row.map(|c| -c), -(min + center[axis])),
            ] {
                if polygon.is_empty() {
                    return polygon;
                }
                let (line, offset) = self.meet_plane(normal, offset);
                polygon = split(&polygon, line, offset, 0.0).below;
            }
        }
        polygon
    }

    /// Another plane's line in this one: `line · [u, v] = offset`.
    fn meet_plane(&self, normal: [f32; 3], offset: f64) -> ([f64; 2], f64) {
        let normal = normal.map(f64::from);
        let own = normal[self.axis.index()] * self.offset;
        (self.flat(normal), offset - own)
    }

    fn meet_triangle(&self, corners: &[[f32; 3]; 3]) -> Option<[[f64; 2]; 2]> {
        let corners = corners.map(|p| p.map(f64::from));
        let heights = corners.map(|p| p[self.axis.index()] - self.offset);
        let crossing = |i: usize| {
            let j = (i + 1) % 3;
            ((heights[i] < 0.0) != (heights[j] < 0.0)).then(|| {
                let [p, q] = [corners[i], corners[j]].map(|p| self.flat(p));
                between(p, q, heights[i] / (heights[i] - heights[j]))
            })
        };
        let mut ends = (0..3).filter_map(crossing);
        let segment = [ends.next()?, ends.next()?];
        (segment[0] != segment[1]).then_some(segment)
    }
}

fn between(p: [f64; 2], q: [f64; 2], share: f64) -> [f64; 2] {
    std::array::from_fn(|i| p[i] + (q[i] - p[i]) * share)
}

/// The corners of a rectangle, in order.
fn rectangle([min, max]: [[f64; 2]; 2]) -> Vec<[f64; 2]> {
    vec![min, [max[0], min[1]], max, [min[0], max[1]]]
}

/// A convex polygon on both sides of a line; empty where it does not reach to a side.
struct Parts {
    below: Vec<[f64; 2]>,
    above: Vec<[f64; 2]>,
    /// The line's part in the polygon, where it divides it.
    chord: Option<[[f64; 2]; 2]>,
}

/// Divides a convex polygon by the line `line · p = offset`. Corners within `epsilon` of the line
/// (in scene units, for a line of unit length) lie on it.
fn split(polygon: &[[f64; 2]], line: [f64; 2], offset: f64, epsilon: f64) -> Parts {
    let height = |p: [f64; 2]| {
        let height = line[0] * p[0] + line[1] * p[1] - offset;
        if height.abs() <= epsilon { 0.0 } else { height }
    };
    let heights: Vec<f64> = polygon.iter().map(|&p| height(p)).collect();
    let whole = || polygon.to_vec();
    if heights.iter().all(|&h| h >= 0.0) {
        return Parts {
            below: Vec::new(),
            above: whole(),
            chord: None,
        };
    }
    if heights.iter().all(|&h| h <= 0.0) {
        return Parts {
            below: whole(),
            above: Vec::new(),
            chord: None,
        };
    }
    let (mut below, mut above, mut on_line) = (Vec::new(), Vec::new(), Vec::new());
    for (i, (&p, &h)) in polygon.iter().zip(&heights).enumerate() {
        let next = (i + 1) % polygon.len();
        let k = heights[next];
        if h <= 0.0 {
            below.push(p);
        }
        if h >= 0.0 {
            above.push(p);
        }
        if h == 0.0 {
            on_line.push(p);
        }
        if h * k < 0.0 {
            let crossing = between(p, polygon[next], h / (h - k));
            below.push(crossing);
            above.push(crossing);
            on_line.push(crossing);
        }
    }
    // Of corners that rounding put on the line the outermost ones count.
    let along = |p: &[f64; 2]| line[0] * p[1] - line[1] * p[0];
    let first = on_line.iter().min_by(|p, q| along(p).total_cmp(&along(q)));
    let last = on_line.iter().max_by(|p, q| along(p).total_cmp(&along(q)));
    let chord = first.zip(last).map(|(&first, &last)| [first, last]);
    Parts {
        below,
        above,
        chord,
    }
}

#[cfg(test)]
mod tests;
