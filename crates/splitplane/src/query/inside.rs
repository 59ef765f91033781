//! Whether a point is inside: the exact parity of the triangles above it.

use std::ops::ControlFlow;

use robust::{Coord, Coord3D, orient2d, orient3d};

use super::traverse::{Search, Triangle};
use super::{Counters, Traversal, run_in};
use crate::geometry::Ray;
use crate::query::Place;
use crate::tree::Tree;

struct Crossings {
    point: [f32; 3],
    above: Vec<u32>,
}

impl Search for Crossings {
    const NEAREST_FIRST: bool = false;

    #[inline(always)]
    fn limit(&self) -> f64 {
        f64::INFINITY
    }

    #[inline(always)]
    fn test(&mut self, triangle: &impl Triangle) -> ControlFlow<()> {
        if is_above(&triangle.corners(), self.point) {
            self.above.push(triangle.index());
        }
        ControlFlow::Continue(())
    }
}

/// Whether a triangle is met by the ray upwards, along z, from a point that is moved by an
/// infinitely small step along x and a step infinitely smaller than that along y
/// [EdelsbrunnerMuecke1990]. So a ray never runs through an edge or a vertex, and of the triangles
/// of a closed mesh that share one, it meets an even or an odd number as a ray beside it does. All
/// signs are exact [Shewchuk1997].
fn is_above(corners: &[[f32; 3]; 3], point: [f32; 3]) -> bool {
    let [a, b, c] = corners.map(|p| p.map(f64::from));
    let p = point.map(f64::from);
    let flat = |p: [f64; 3]| Coord { x: p[0], y: p[1] };
    // Whether the point, moved, is on the left of an edge as one sees it from above; `None` for an
    // upright edge.
    let left = |a: [f64; 3], b: [f64; 3]| {
        let area = orient2d(flat(a), flat(b), flat(p));
        [area, a[1] - b[1], b[0] - a[0]]
            .into_iter()
            .find(|&term| term != 0.0)
            .map(|term| term > 0.0)
    };
    let Some(turn) = left(a, b) else { return false };
    if left(b, c) != Some(turn) || left(c, a) != Some(turn) {
        return false;
    }
    let solid = |p: [f64; 3]| Coord3D {
        x: p[0],
        y: p[1],
        z: p[2],
    };
    // Positive where the point is below a triangle that turns left.
    let volume = orient3d(solid(a), solid(b), solid(c), solid(p));
    if turn { volume > 0.0 } else { volume < 0.0 }
}

pub(crate) fn contains(tree: &Tree, point: [f32; 3], counters: &mut impl Counters) -> bool {
    let mut search = Crossings {
        point,
        above: Vec::new(),
    };
    let place = Place {
        traversal: Traversal::Exact,
        ..*tree.place()
    };
    let up = Ray::new(point, [0.0, 0.0, 1.0]);
    run_in(tree, &place, &up, &mut search, counters);
    search.above.sort_unstable();
    search.above.dedup();
    search.above.len() % 2 == 1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn above_an_edge_one_of_two_triangles_is_met_and_above_a_vertex_one_of_many() {
        // A fan around the origin at height 1, in both senses of rotation.
        let rim: Vec<[f32; 3]> = [
            (1, 0),
            (1, 1),
            (0, 1),
            (-1, 1),
            (-1, 0),
            (-1, -1),
            (0, -1),
            (1, -1),
        ]
        .map(|(x, y)| [x as f32, y as f32, 1.0])
        .to_vec();
        for (x, y) in [
            (0.0, 0.0),
            (0.5, 0.0),
            (0.5, 0.5),
            (0.0, -0.25),
            (-0.5, 0.25),
            (0.3, 0.1),
        ] {
            for flip in [false, true] {
                let met = (0..rim.len()).filter(|&i| {
                    let (b, c) = (rim[i], rim[(i + 1) % rim.len()]);
                    let corners = if flip {
                        [[0.0, 0.0, 1.0], c, b]
                    } else {
                        [[0.0, 0.0, 1.0], b, c]
                    };
                    assert!(!is_above(&corners, [x, y, 1.0]) && !is_above(&corners, [x, y, 2.0]));
                    is_above(&corners, [x, y, 0.5])
                });
                assert_eq!(met.count(), 1, "({x}, {y})");
            }
        }
        assert!(!is_above(
            &[[0.0, 0.0, 1.0], [0.0, 0.0, 2.0], [1.0, 0.0, 1.0]],
            [0.0; 3]
        ));
    }
}
