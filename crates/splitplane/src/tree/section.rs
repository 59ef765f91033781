//! A tree and its mesh, cut by a plane across an axis: what a picture of the splitting shows.

use super::nodes::{Layout, View};
use super::{Tree, with_nodes};
use crate::geometry::Aabb;

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
    /// The plane is not across an axis, or is so only by chance.
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
    /// plane does not meet the scene's box.
    pub fn section(&self, axis: Axis, offset: f64, max_depth: u32) -> Section {
        let plane = Plane { axis, offset };
        let Some(bounds) = plane.meet_box(&self.bounds()) else {
            return Section::default();
        };
        let mut section = Section {
            bounds,
            ..Section::default()
        };
        with_nodes!(self, nodes => if self.choice.spec.objects {
            self.section_of_boxes(nodes, &plane, max_depth, &mut section);
        } else {
            self.section_of_cells(nodes, &plane, max_depth, &mut section);
        });
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
            let (line, line_offset) = plane.meet_plane(normal, offset);
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
        let mut pending = vec![(0, 0)];
        while let Some((at, depth)) = pending.pop() {
            let Some(bounds) = plane.meet_box(&nodes[at].bounds()) else {
                continue;
            };
            let polygon = rectangle(bounds);
            for (i, &from) in polygon.iter().enumerate() {
                section.segments.push(SectionSegment {
                    from,
                    to: polygon[(i + 1) % polygon.len()],
                    depth,
                    oblique: false,
                });
            }
            match nodes[at].view(&self.shared) {
                View::Objects { above } if depth < max_depth => {
                    pending.extend([(above, depth + 1), (at + 1, depth + 1)]);
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
                | View::Objects { above } => pending.extend([above, at + 1]),
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

    /// Another plane's line in this one: `line · [u, v] = offset`.
    fn meet_plane(&self, normal: [f32; 3], offset: f32) -> ([f64; 2], f64) {
        let normal = normal.map(f64::from);
        let own = normal[self.axis.index()] * self.offset;
        (self.flat(normal), f64::from(offset) - own)
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
mod tests {
    use super::*;
    use crate::{BuildParams, Mesh, TREES, TreeChoice};
    use proptest::prelude::*;

    /// A bent sheet: slanted triangles in all directions.
    fn sheet() -> Mesh {
        let side = 12;
        let at = |i: u32| f64::from(i) / f64::from(side) * 4.0 - 2.0;
        let mut positions = Vec::new();
        let mut triangles = Vec::new();
        for row in 0..=side {
            for column in 0..=side {
                let (x, y) = (at(column), at(row));
                let z = (1.7 * x).sin() * (1.3 * y).cos() + 0.3 * x;
                positions.push([x, y, z].map(|c| c as f32));
            }
        }
        for row in 0..side {
            for column in 0..side {
                let a = row * (side + 1) + column;
                let (b, c, d) = (a + 1, a + side + 1, a + side + 2);
                triangles.extend([[a, b, c], [b, d, c]]);
            }
        }
        Mesh::new(positions, triangles).unwrap()
    }

    fn trees() -> impl Iterator<Item = Tree> {
        let mesh = sheet();
        TREES.iter().map(move |spec| {
            let choice = TreeChoice::new(spec.name, None).unwrap();
            Tree::build(&mesh, choice, &BuildParams::default()).unwrap()
        })
    }

    fn solid(axis: Axis, offset: f64, point: [f64; 2]) -> [f64; 3] {
        let mut solid = [offset; 3];
        for (axis, c) in axis.others().into_iter().zip(point) {
            solid[axis.index()] = c;
        }
        solid
    }

    fn dot(normal: [f32; 3], point: [f64; 3]) -> f64 {
        (0..3).map(|i| f64::from(normal[i]) * point[i]).sum()
    }

    /// Normal, offset and child above of an interior node of a BSP tree; or a leaf's triangles.
    enum Node {
        Split([f32; 3], f64, usize),
        Leaf(u32),
    }

    fn node(tree: &Tree, at: usize) -> Node {
        let view = with_nodes!(tree, nodes => nodes[at].view(&tree.shared));
        match view {
            View::Axis {
                axis,
                offset,
                above,
            } => {
                let mut normal = [0.0; 3];
                normal[axis] = 1.0;
                Node::Split(normal, offset.into(), above)
            }
            View::Oblique {
                normal,
                offset,
                above,
                ..
            } => Node::Split(normal, offset.into(), above),
            View::Leaf(leaf) => Node::Leaf(leaf.count),
            View::Objects { .. } => unreachable!("not a BSP tree"),
        }
    }

    fn area(polygon: &[[f64; 2]]) -> f64 {
        let next = polygon.iter().cycle().skip(1);
        let twice: f64 = (polygon.iter().zip(next))
            .map(|(p, q)| p[0] * q[1] - p[1] * q[0])
            .sum();
        0.5 * twice
    }

    #[test]
    fn segments_lie_in_the_rectangle_and_on_a_plane_of_their_depth() {
        for tree in trees().filter(|tree| !tree.choice.spec.objects) {
            let (axis, offset) = (Axis::Y, 0.321);
            let section = tree.section(axis, offset, u32::MAX);
            let mut planes: Vec<Vec<([f32; 3], f64)>> = Vec::new();
            let mut pending = vec![(0, 0)];
            while let Some((at, depth)) = pending.pop() {
                if let Node::Split(normal, offset, above) = node(&tree, at) {
                    planes.resize(planes.len().max(depth + 1), Vec::new());
                    planes[depth].push((normal, offset));
                    pending.extend([(at + 1, depth + 1), (above, depth + 1)]);
                }
            }
            assert!(!section.segments.is_empty());
            let [min, max] = section.bounds;
            for segment in &section.segments {
                let ends = [segment.from, segment.to];
                for end in ends {
                    for i in 0..2 {
                        assert!(
                            min[i] - 1e-9 <= end[i] && end[i] <= max[i] + 1e-9,
                            "{end:?}"
                        );
                    }
                }
                let on_both = planes[segment.depth as usize].iter().any(|&(normal, at)| {
                    ends.iter()
                        .all(|&end| (dot(normal, solid(axis, offset, end)) - at).abs() < 1e-8)
                });
                assert!(on_both, "{}: {segment:?}", tree.choice);
            }
        }
    }

    #[test]
    fn every_segment_makes_one_cell_two_and_the_cells_fill_the_rectangle() {
        for tree in trees().filter(|tree| !tree.choice.spec.objects) {
            for depth in [0, 1, 2, 5, u32::MAX] {
                for axis in Axis::ALL {
                    let section = tree.section(axis, 0.1234, depth);
                    assert_eq!(section.cells.len(), section.segments.len() + 1);
                    let all: f64 = section.cells.iter().map(|cell| area(&cell.polygon)).sum();
                    let [min, max] = section.bounds;
                    let whole = (max[0] - min[0]) * (max[1] - min[1]);
                    assert!((all - whole).abs() < 1e-6 * whole, "{all} of {whole}");
                    assert!(section.cells.iter().all(|cell| cell.depth <= depth));
                    assert!(section.segments.iter().all(|segment| segment.depth < depth));
                }
            }
        }
    }

    #[test]
    fn at_depth_0_the_only_cell_has_all_triangles() {
        for tree in trees() {
            let section = tree.section(Axis::Z, 0.0, 0);
            let [cell] = section.cells.as_slice() else {
                panic!("{} cells", section.cells.len())
            };
            assert_eq!(cell.triangles, 288, "{}", tree.choice);
            assert!((section.expected_tests() - 288.0).abs() < 1e-9);
        }
    }

    proptest! {
        #![proptest_config(crate::testing::cases(300))]

        #[test]
        fn the_cell_around_a_point_is_the_leaf_that_the_planes_lead_to(
            u in -2.0..2.0, v in -1.0..1.0, offset in -2.0..2.0,
        ) {
            for tree in trees_once().iter().filter(|tree| !tree.choice.spec.objects) {
                let section = tree.section(Axis::Y, offset, u32::MAX);
                let point = solid(Axis::Y, offset, [u, v]);
                let mut at = 0;
                let mut nearest = f64::INFINITY;
                let count = loop {
                    match node(tree, at) {
                        Node::Leaf(count) => break count,
                        Node::Split(normal, plane, above) => {
                            let height = dot(normal, point) - plane;
                            nearest = nearest.min(height.abs());
                            at = if height < 0.0 { at + 1 } else { above };
                        }
                    }
                };
                let around = section.cells.iter().find(|cell| {
                    let next = cell.polygon.iter().cycle().skip(1);
                    cell.polygon.iter().zip(next).all(|(p, q)| {
                        (q[0] - p[0]) * (v - p[1]) - (q[1] - p[1]) * (u - p[0]) >= 0.0
                    })
                });
                if nearest > 1e-6 {
                    prop_assert_eq!(around.map(|cell| cell.triangles), Some(count));
                }
            }
        }
    }

    fn trees_once() -> &'static [Tree] {
        static BUILT: std::sync::OnceLock<Vec<Tree>> = std::sync::OnceLock::new();
        BUILT.get_or_init(|| trees().collect())
    }

    #[test]
    fn segments_of_triangles_lie_on_triangles_that_the_plane_meets() {
        let mesh = sheet();
        let tree = &trees_once()[0];
        for axis in Axis::ALL {
            let offset = 0.4321;
            let section = tree.section(axis, offset, 0);
            let met: Vec<[[f32; 3]; 3]> = (mesh.usable_triangles().iter())
                .map(|&triangle| mesh.corners(triangle))
                .filter(|corners| {
                    let below = |p: &[f32; 3]| f64::from(p[axis.index()]) < offset;
                    corners.iter().any(below) && !corners.iter().all(below)
                })
                .collect();
            assert_eq!(section.triangles.len(), met.len());
            for (segment, corners) in section.triangles.iter().zip(&met) {
                let [a, b, c] = corners.map(|p| glam::Vec3::from(p).as_dvec3());
                for &end in segment {
                    let p = glam::DVec3::from(solid(axis, offset, end));
                    let whole = (b - a).cross(c - a).length();
                    let parts = (a - p).cross(b - p).length()
                        + (b - p).cross(c - p).length()
                        + (c - p).cross(a - p).length();
                    assert!((parts - whole).abs() < 1e-6 * whole, "{parts} of {whole}");
                }
            }
        }
    }

    #[test]
    fn boxes_of_a_hierarchy_have_four_sides_and_no_oblique_one() {
        for tree in trees().filter(|tree| tree.choice.spec.objects) {
            let section = tree.section(Axis::Y, 0.3, u32::MAX);
            assert!(section.segments.len() > 4 && section.segments.len().is_multiple_of(4));
            assert!(section.segments.iter().all(|segment| !segment.oblique));
            assert!(section.cells.iter().all(|cell| cell.triangles > 0));
        }
    }

    #[test]
    fn a_plane_beside_the_box_and_a_mesh_of_nothing_give_an_empty_section() {
        for tree in trees_once() {
            for offset in [3.0, -3.0, f64::NAN, f64::INFINITY] {
                assert_eq!(tree.section(Axis::X, offset, 9), Section::default());
            }
        }
        let nothing = Mesh::new(Vec::new(), Vec::new()).unwrap();
        for spec in TREES {
            let choice = TreeChoice::new(spec.name, None).unwrap();
            let tree = Tree::build(&nothing, choice, &BuildParams::default()).unwrap();
            assert_eq!(tree.section(Axis::X, 0.0, 9), Section::default());
        }
    }
}
