//! The frames of a mesh, found from its triangles' normals.

use std::collections::HashMap;

use glam::DVec3;

use crate::directions::canonical;
use crate::geometry::{Frame, Mesh};

/// Normals are gathered in cells of a cube around the origin, this many along an edge: a cell is
/// a good degree wide.
const CELLS: f64 = 96.0;
/// Directions of which cosine of the angle is larger are one: 1.5°.
const ALIKE: f64 = 0.99966;
/// Directions of which the cosine of the angle is smaller are at a right angle, nearly: 2°.
const ACROSS: f64 = 0.035;
/// A frame is kept if its axes are the normals of this share of the mesh's area.
const WORTH: f64 = 0.004;

/// Normals of less than this share of the mesh's area are not looked at.
const LEAST: f64 = 0.0005;

/// Normals that are nearly alike, with opposite ones taken as one.
#[derive(Clone, Copy)]
struct Bin {
    direction: DVec3,
    area: f64,
    /// A frame has been found that has this direction.
    is_explained: bool,
}

/// The world's axes, and up to `most - 1` frames whose axes are frequent normals, each counted by
/// the area of its triangles.
///
/// The heaviest normal that no frame has yet is the first axis of the next; the second axis is the
/// heaviest normal across it.
pub(super) fn find(mesh: &Mesh, most: usize) -> Vec<Frame> {
    let mut bins = bins(mesh);
    let total: f64 = bins.iter().map(|bin| bin.area).sum();
    let mut frames = vec![Frame::IDENTITY];
    explain(&mut bins, [DVec3::X, DVec3::Y, DVec3::Z]);
    while frames.len() < most {
        let first = bins.iter().find(|bin| !bin.is_explained);
        let Some(first) = first.filter(|bin| bin.area > LEAST * total).copied() else {
            break;
        };
        let across = |bin: &&Bin| bin.direction.dot(first.direction).abs() < ACROSS;
        // Any normal will do, those of other frames too: walls that are turned share their floor.
        let second = bins.iter().find(across).map_or_else(
            || first.direction.any_orthonormal_vector(),
            |bin| bin.direction,
        );
        let second = second - first.direction * second.dot(first.direction);
        let Some(second) = second.try_normalize() else {
            break;
        };
        let axes = [first.direction, second, first.direction.cross(second)];
        if explain(&mut bins, axes) < WORTH * total {
            continue;
        }
        frames.push(Frame {
            rows: axes.map(|axis| axis.as_vec3().into()),
        });
    }
    frames
}

/// The bins, heaviest first.
fn bins(mesh: &Mesh) -> Vec<Bin> {
    let mut sums: HashMap<[i16; 3], DVec3> = HashMap::new();
    for &triangle in mesh.usable_triangles() {
        let normal = canonical(mesh.normal(triangle));
        let normal = glam::Vec3::from(normal).as_dvec3();
        let on_cube = normal / normal.abs().max_element();
        let mut cell = (on_cube * (0.5 * CELLS)).round().as_i16vec3().to_array();
        // On the faces where opposite directions meet, one of the two.
        if cell.into_iter().find(|&c| c != 0).is_some_and(|c| c < 0) {
            cell = cell.map(|c| -c);
        }
        let sum = sums.entry(cell).or_default();
        let sign = if sum.dot(normal) < 0.0 { -1.0 } else { 1.0 };
        *sum += normal * (sign * mesh.area(triangle));
    }
    let mut sums: Vec<_> = sums.into_iter().collect();
    // Of equals in the order of the cells, which does not depend on the hash.
    sums.sort_by(|(a, x), (b, y)| y.length().total_cmp(&x.length()).then(a.cmp(b)));
    sums.into_iter()
        .filter_map(|(_, sum)| {
            Some(Bin {
                direction: sum.try_normalize()?,
                area: sum.length(),
                is_explained: false,
            })
        })
        .collect()
}

/// Marks the bins along these axes; gives the area of those that were not marked before.
fn explain(bins: &mut [Bin], axes: [DVec3; 3]) -> f64 {
    let mut area = 0.0;
    for bin in bins {
        let is_alike = |axis: DVec3| bin.direction.dot(axis).abs() > ALIKE;
        if !bin.is_explained && axes.into_iter().any(is_alike) {
            bin.is_explained = true;
            area += bin.area;
        }
    }
    area
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Mesh;

    /// Boxes, each turned by a rotation.
    fn boxes(rotations: &[glam::DQuat]) -> Mesh {
        let (mut positions, mut triangles) = (Vec::new(), Vec::new());
        for (i, rotation) in rotations.iter().enumerate() {
            for corner in 0..8 {
                let p = DVec3::new(
                    f64::from(corner & 1),
                    f64::from(corner >> 1 & 1) * 2.0,
                    f64::from(corner >> 2 & 1) * 3.0,
                );
                let p = *rotation * p + DVec3::new(5.0 * i as f64, 0.0, 0.0);
                positions.push(p.as_vec3().into());
            }
            let quads = [
                [0, 1, 3, 2],
                [4, 5, 7, 6],
                [0, 1, 5, 4],
                [2, 3, 7, 6],
                [0, 2, 6, 4],
                [1, 3, 7, 5],
            ];
            for [a, b, c, d] in quads {
                let at = |k: u32| k + 8 * i as u32;
                triangles.extend([[at(a), at(b), at(c)], [at(a), at(c), at(d)]]);
            }
        }
        Mesh::new(positions, triangles).unwrap()
    }

    #[test]
    fn turned_boxes_have_a_frame_each() {
        let rotations = [
            glam::DQuat::IDENTITY,
            glam::DQuat::from_euler(glam::EulerRot::XYZ, 0.5, 0.8, 1.0),
            glam::DQuat::from_rotation_z(0.4),
        ];
        let frames = find(&boxes(&rotations), 64);
        assert_eq!(frames.len(), 3, "{frames:?}");
        for (rotation, axis) in rotations
            .iter()
            .flat_map(|r| [(r, DVec3::X), (r, DVec3::Y), (r, DVec3::Z)])
        {
            let axis = *rotation * axis;
            let is_along =
                |row: &[f32; 3]| glam::Vec3::from(*row).as_dvec3().dot(axis).abs() > 1.0 - 1e-6;
            assert!(
                frames.iter().any(|frame| frame.rows.iter().any(is_along)),
                "{axis}"
            );
        }
    }

    #[test]
    fn where_all_is_along_the_axes_there_is_only_the_world() {
        assert_eq!(
            find(&boxes(&[glam::DQuat::IDENTITY]), 64),
            [Frame::IDENTITY]
        );
        assert_eq!(
            find(&Mesh::new(vec![], vec![]).unwrap(), 64),
            [Frame::IDENTITY]
        );
    }
}
