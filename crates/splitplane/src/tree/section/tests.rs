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
