//! From polygons to triangles.

use super::Note;

/// What became of a mesh's faces that are not triangles.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Faces {
    /// Faces of more than three vertices that are not convex.
    concave: usize,
    /// Faces of fewer than three vertices.
    short: usize,
}

impl Faces {
    /// Adds a face's triangles.
    pub(crate) fn add(
        &mut self,
        positions: &[[f32; 3]],
        polygon: &[u32],
        triangles: &mut Vec<[u32; 3]>,
    ) {
        self.short += usize::from(polygon.len() < 3);
        self.concave += usize::from(triangulate(positions, polygon, triangles));
    }

    /// Counts a face of fewer than three vertices without looking at them.
    pub(crate) fn leave_out(&mut self) {
        self.short += 1;
    }

    /// What is to be said of them.
    pub(crate) fn notes(&self, place: &str) -> impl Iterator<Item = Note> {
        let note = |count: usize, one: &str, many: &str, warning: bool| {
            let text = match count {
                0 => return None,
                1 => format!("1 face {one}"),
                count => format!("{count} faces {many}"),
            };
            let place = place.to_owned();
            Some(Note {
                place,
                text,
                warning,
            })
        };
        let concave = note(
            self.concave,
            "is not convex; triangulated by its ears",
            "are not convex; triangulated by their ears",
            false,
        );
        let short = note(
            self.short,
            "has fewer than three vertices; left out",
            "have fewer than three vertices; left out",
            true,
        );
        concave.into_iter().chain(short)
    }
}

/// Adds the `n - 2` triangles of a polygon of `n` vertices: a fan from its first vertex where it
/// is convex, else by cutting off ears [Meisters1975]. Gives whether it was not convex.
fn triangulate(positions: &[[f32; 3]], polygon: &[u32], triangles: &mut Vec<[u32; 3]>) -> bool {
    /// Cutting off ears takes time with the square of the vertices, or worse.
    const LARGEST_FOR_EARS: usize = 512;
    let count = polygon.len();
    if count < 3 {
        return false;
    }
    let fan = |triangles: &mut Vec<[u32; 3]>| {
        triangles.extend((1..count - 1).map(|i| [polygon[0], polygon[i], polygon[i + 1]]));
    };
    if count == 3 {
        fan(triangles);
        return false;
    }
    let points = flattened(positions, polygon);
    let convex = (0..count)
        .all(|i| turn(points[i], points[(i + 1) % count], points[(i + 2) % count]) >= 0.0);
    if convex || count > LARGEST_FOR_EARS {
        fan(triangles);
        return !convex;
    }
    let mut left: Vec<usize> = (0..count).collect();
    while left.len() > 3 {
        let ring = left.len();
        // Where the polygon crosses itself there may be no ear; then the first corner goes.
        let ear = (0..ring).find(|&i| is_ear(&points, &left, i)).unwrap_or(0);
        let [a, b, c] = corner(&left, ear);
        triangles.push([a, b, c].map(|i| polygon[i]));
        left.remove(ear);
    }
    triangles.push([left[0], left[1], left[2]].map(|i| polygon[i]));
    true
}

/// A corner of the ring with its neighbours.
fn corner(ring: &[usize], i: usize) -> [usize; 3] {
    let count = ring.len();
    [
        ring[(i + count - 1) % count],
        ring[i],
        ring[(i + 1) % count],
    ]
}

fn is_ear(points: &[[f64; 2]], ring: &[usize], i: usize) -> bool {
    let [a, b, c] = corner(ring, i);
    if turn(points[a], points[b], points[c]) <= 0.0 {
        return false;
    }
    ring.iter()
        .filter(|&&j| j != a && j != b && j != c)
        .all(|&j| {
            let p = points[j];
            let same = p == points[a] || p == points[b] || p == points[c];
            same || [(a, b), (b, c), (c, a)]
                .iter()
                .any(|&(s, t)| turn(points[s], points[t], p) < 0.0)
        })
}

/// Positive where the way from `a` over `b` to `c` turns to the left.
fn turn(a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

/// The polygon seen along its normal's largest coordinate, counter-clockwise.
fn flattened(positions: &[[f32; 3]], polygon: &[u32]) -> Vec<[f64; 2]> {
    let point = |i: usize| positions[polygon[i % polygon.len()] as usize].map(f64::from);
    // Newell's normal: it takes all vertices into account.
    let mut normal = [0.0; 3];
    for i in 0..polygon.len() {
        let (p, q) = (point(i), point(i + 1));
        for (axis, sum) in normal.iter_mut().enumerate() {
            let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
            *sum += (p[u] - q[u]) * (p[v] + q[v]);
        }
    }
    // (axis + 1, axis + 2) keeps the order of hands: positive area for a positive normal. The sign
    // of Newell's sum is that of the right-hand normal.
    let axis = (0..3).fold(0, |best, axis| {
        if normal[axis].abs() > normal[best].abs() {
            axis
        } else {
            best
        }
    });
    let (mut u, mut v) = ((axis + 1) % 3, (axis + 2) % 3);
    if normal[axis] < 0.0 {
        std::mem::swap(&mut u, &mut v);
    }
    (0..polygon.len())
        .map(|i| [point(i)[u], point(i)[v]])
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn area(positions: &[[f32; 3]], triangles: &[[u32; 3]]) -> f64 {
        triangles
            .iter()
            .map(|t| {
                let [a, b, c] = t.map(|i| positions[i as usize].map(f64::from));
                turn([a[0], a[1]], [b[0], b[1]], [c[0], c[1]]) / 2.0
            })
            .sum()
    }

    #[test]
    fn a_concave_polygon_is_covered_exactly_once() {
        // An arrow head, the notch at vertex 3; every triangle turns left.
        let positions = [[0., 0., 0.], [2., -1., 0.], [0., 2., 0.], [-2., -1., 0.]];
        let order = [1, 2, 3, 0];
        let mut triangles = Vec::new();
        assert!(triangulate(&positions, &order, &mut triangles));
        assert_eq!(triangles.len(), 2);
        assert_eq!(area(&positions, &triangles), 4.0);
        for t in &triangles {
            assert!(area(&positions, &[*t]) > 0.0);
        }
    }

    #[test]
    fn a_convex_polygon_is_a_fan_seen_from_either_side() {
        let positions = [[0., 0., 0.], [1., 0., 0.], [1., 1., 0.], [0., 1., 0.]];
        let mut triangles = Vec::new();
        assert!(!triangulate(&positions, &[0, 1, 2, 3], &mut triangles));
        assert!(!triangulate(&positions, &[3, 2, 1, 0], &mut triangles));
        assert_eq!(triangles, [[0, 1, 2], [0, 2, 3], [3, 2, 1], [3, 1, 0]]);
    }
}
