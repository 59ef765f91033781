//! Convex polytopes: the cells of a BSP tree.

use glam::DVec3;

use super::Aabb;

/// More vertices than this and a polytope is no longer cut: its children keep its shape, which
/// bounds them.
const MAX_VERTICES: usize = 192;

/// A convex polytope with its faces as loops of vertices, counter-clockwise from outside.
///
/// Only the heuristic looks at it: an inexact polytope makes a worse tree, never a wrong one.
#[derive(Clone, Debug, Default)]
pub(crate) struct Polytope {
    vertices: Vec<DVec3>,
    /// The loops of all faces, one after another, as indices of vertices.
    loops: Vec<u16>,
    /// Where each face's loop ends.
    ends: Vec<u16>,
    areas: Vec<f64>,
}

impl Polytope {
    pub(crate) fn from_box(aabb: &Aabb) -> Self {
        let pick = |corner: usize, axis: usize| {
            f64::from(if corner >> axis & 1 == 1 {
                aabb.max[axis]
            } else {
                aabb.min[axis]
            })
        };
        let vertices = (0..8)
            .map(|c| DVec3::new(pick(c, 0), pick(c, 1), pick(c, 2)))
            .collect();
        let faces: [[u16; 4]; 6] = [
            [0, 4, 6, 2],
            [1, 3, 7, 5],
            [0, 1, 5, 4],
            [2, 6, 7, 3],
            [0, 2, 3, 1],
            [4, 5, 7, 6],
        ];
        let mut polytope = Polytope {
            vertices,
            ..Polytope::default()
        };
        for face in faces {
            polytope.push_face(&face);
        }
        polytope
    }

    fn push_face(&mut self, indices: &[u16]) {
        self.loops.extend_from_slice(indices);
        self.ends.push(self.loops.len() as u16);
        let points = indices.iter().map(|&i| self.vertices[usize::from(i)]);
        self.areas.push(polygon_area(points));
    }

    fn faces(&self) -> impl Iterator<Item = &[u16]> {
        let starts = std::iter::once(0).chain(self.ends.iter().copied());
        starts
            .zip(&self.ends)
            .map(|(start, &end)| &self.loops[usize::from(start)..usize::from(end)])
    }

    pub(crate) fn surface_area(&self) -> f64 {
        self.areas.iter().sum()
    }

    pub(crate) fn vertices(&self) -> &[DVec3] {
        &self.vertices
    }

    pub(crate) fn volume(&self) -> f64 {
        let Some(&apex) = self.vertices.first() else {
            return 0.0;
        };
        let six_fold: f64 = self
            .faces()
            .flat_map(|face| {
                let v = |i: usize| self.vertices[usize::from(face[i])] - apex;
                (1..face.len() - 1).map(move |i| v(0).dot(v(i).cross(v(i + 1))))
            })
            .sum();
        six_fold / 6.0
    }

    /// Cuts the polytope by `normal · x = offset` into the part below and the part above.
    ///
    /// `None` where the plane misses it, or where rounding has made a polytope so thin that its
    /// cap does not close.
    pub(crate) fn cut(&self, normal: DVec3, offset: f64) -> Option<(Polytope, Polytope)> {
        if self.vertices.len() > MAX_VERTICES {
            return None;
        }
        let heights: Vec<f64> = self
            .vertices
            .iter()
            .map(|v| normal.dot(*v) - offset)
            .collect();
        let mut cut = Cut {
            source: self,
            heights: &heights,
            below: Part::new(self.vertices.len()),
            above: Part::new(self.vertices.len()),
            crossings: Vec::new(),
            segments: Vec::new(),
        };
        for face in self.faces() {
            cut.face(face)?;
        }
        cut.close()
    }

    /// Prepares the areas of both parts under planes `direction · x = t` that move along
    /// `direction`.
    pub(crate) fn slicer(&self, direction: DVec3) -> Slicer<'_> {
        let heights: Vec<f64> = self.vertices.iter().map(|v| direction.dot(*v)).collect();
        let (low, high) = min_max(heights.iter().copied());
        // A face across the direction has no part below a plane that passes through it; it
        // belongs to the end of the polytope that it closes.
        let flat = 1e-9 * (high - low) + 64.0 * f64::EPSILON * low.abs().max(high.abs());
        let ranges = self
            .faces()
            .map(|face| {
                let (lo, hi) = min_max(face.iter().map(|&i| heights[usize::from(i)]));
                match hi - lo <= flat {
                    false => (lo, hi),
                    true if lo - low < high - hi => (f64::NEG_INFINITY, f64::NEG_INFINITY),
                    true => (f64::INFINITY, f64::INFINITY),
                }
            })
            .collect();
        Slicer {
            polytope: self,
            heights,
            ranges,
            low,
            high,
            flat,
        }
    }
}

fn min_max(values: impl Iterator<Item = f64>) -> (f64, f64) {
    values.fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), v| {
        (lo.min(v), hi.max(v))
    })
}

/// The area of a planar polygon: half the length of its vector area.
fn polygon_area(mut points: impl Iterator<Item = DVec3>) -> f64 {
    let (Some(first), Some(mut previous)) = (points.next(), points.next()) else {
        return 0.0;
    };
    let mut vector = DVec3::ZERO;
    for point in points {
        vector += (previous - first).cross(point - first);
        previous = point;
    }
    0.5 * vector.length()
}

/// One side of a polytope that is being cut.
struct Part {
    polytope: Polytope,
    /// The index here of each vertex of the source.
    kept: Vec<u16>,
    /// The index here of each crossing.
    crossed: Vec<u16>,
    face: Vec<u16>,
}

const ABSENT: u16 = u16::MAX;

impl Part {
    fn new(vertices: usize) -> Self {
        Part {
            polytope: Polytope::default(),
            kept: vec![ABSENT; vertices],
            crossed: Vec::new(),
            face: Vec::new(),
        }
    }

    fn keep(&mut self, source: &Polytope, vertex: u16) {
        let slot = &mut self.kept[usize::from(vertex)];
        if *slot == ABSENT {
            *slot = self.polytope.vertices.len() as u16;
            self.polytope
                .vertices
                .push(source.vertices[usize::from(vertex)]);
        }
        let index = *slot;
        self.extend(index);
    }

    fn cross(&mut self, source: &Polytope, crossing: u16, at: Crossing) {
        if let Crossing::Vertex(vertex) = at {
            return self.keep(source, vertex);
        }
        if self.crossed.len() <= usize::from(crossing) {
            self.crossed.resize(usize::from(crossing) + 1, ABSENT);
        }
        let slot = &mut self.crossed[usize::from(crossing)];
        if *slot == ABSENT {
            *slot = self.polytope.vertices.len() as u16;
            let Crossing::Edge { point, .. } = at else {
                unreachable!("a vertex returned above")
            };
            self.polytope.vertices.push(point);
        }
        let index = *slot;
        self.extend(index);
    }

    fn extend(&mut self, index: u16) {
        if self.face.last() != Some(&index) {
            self.face.push(index);
        }
    }

    fn end_face(&mut self) {
        while self.face.len() > 1 && self.face.first() == self.face.last() {
            self.face.pop();
        }
        if self.face.len() >= 3 {
            self.polytope.push_face(&self.face);
        }
        self.face.clear();
    }
}

/// Where the plane meets an edge.
#[derive(Clone, Copy, Debug)]
enum Crossing {
    /// In a vertex that lies in the plane.
    Vertex(u16),
    /// Between two vertices.
    Edge { from: u16, to: u16, point: DVec3 },
}

struct Cut<'a> {
    source: &'a Polytope,
    heights: &'a [f64],
    below: Part,
    above: Part,
    crossings: Vec<Crossing>,
    /// Edges of the cap, from crossing to crossing, as the faces of the lower part run.
    segments: Vec<(u16, u16)>,
}

impl Cut<'_> {
    /// Whether a vertex counts as below. The vertices in the plane do: one consistent choice is
    /// what makes the two parts close.
    fn is_below(&self, vertex: u16) -> bool {
        self.heights[usize::from(vertex)] <= 0.0
    }

    fn crossing(&mut self, i: u16, j: u16) -> u16 {
        let (below, above) = if self.is_below(i) { (i, j) } else { (j, i) };
        let (h_below, h_above) = (
            self.heights[usize::from(below)],
            self.heights[usize::from(above)],
        );
        let found = self.crossings.iter().position(|crossing| match *crossing {
            Crossing::Vertex(vertex) => h_below == 0.0 && vertex == below,
            Crossing::Edge { from, to, .. } => (from, to) == (below, above),
        });
        if let Some(index) = found {
            return index as u16;
        }
        self.crossings.push(if h_below == 0.0 {
            Crossing::Vertex(below)
        } else {
            let (p, q) = (
                self.source.vertices[usize::from(below)],
                self.source.vertices[usize::from(above)],
            );
            let point = p + (q - p) * (h_below / (h_below - h_above));
            Crossing::Edge {
                from: below,
                to: above,
                point,
            }
        });
        (self.crossings.len() - 1) as u16
    }

    fn face(&mut self, face: &[u16]) -> Option<()> {
        let (mut leaves, mut enters) = (None, None);
        for (k, &i) in face.iter().enumerate() {
            let j = face[(k + 1) % face.len()];
            let part = if self.is_below(i) {
                &mut self.below
            } else {
                &mut self.above
            };
            part.keep(self.source, i);
            if self.is_below(i) != self.is_below(j) {
                let crossing = self.crossing(i, j);
                let end = if self.is_below(i) {
                    &mut leaves
                } else {
                    &mut enters
                };
                if end.replace(crossing).is_some() {
                    return None;
                }
                let at = self.crossings[usize::from(crossing)];
                self.below.cross(self.source, crossing, at);
                self.above.cross(self.source, crossing, at);
            }
        }
        self.below.end_face();
        self.above.end_face();
        if let (Some(leaves), Some(enters)) = (leaves, enters)
            && leaves != enters
        {
            self.segments.push((leaves, enters));
        }
        Some(())
    }

    /// Chains the segments into the cap and closes both parts with it.
    fn close(mut self) -> Option<(Polytope, Polytope)> {
        let &(start, mut at) = self.segments.first()?;
        // A face of the lower part runs along its segment from `leaves` to `enters`; the cap runs
        // the other way.
        let mut cap = vec![start];
        while at != start {
            cap.push(at);
            if cap.len() > self.segments.len() {
                return None;
            }
            at = self.segments.iter().find(|segment| segment.0 == at)?.1;
        }
        if cap.len() != self.segments.len() || cap.len() < 3 {
            return None;
        }
        for &crossing in &cap {
            self.above
                .cross(self.source, crossing, self.crossings[usize::from(crossing)]);
        }
        self.above.end_face();
        for &crossing in cap.iter().rev() {
            self.below
                .cross(self.source, crossing, self.crossings[usize::from(crossing)]);
        }
        self.below.end_face();
        Some((self.below.polytope, self.above.polytope))
    }
}

/// The areas of the two parts of a polytope under a plane that moves along one direction.
pub(crate) struct Slicer<'a> {
    polytope: &'a Polytope,
    heights: Vec<f64>,
    /// Per face, its extent along the direction.
    ranges: Vec<(f64, f64)>,
    low: f64,
    high: f64,
    /// What is not longer than this along the direction is flat.
    flat: f64,
}

impl Slicer<'_> {
    /// The polytope's extent along the direction.
    #[cfg(test)]
    pub(crate) fn extent(&self) -> (f64, f64) {
        (self.low, self.high)
    }

    /// The offsets of planes that pass through the inside of the polytope: between these two. A
    /// plane that a face lies in is not among them, whatever rounding has done to the face.
    pub(crate) fn inside(&self) -> (f64, f64) {
        (self.low + self.flat, self.high - self.flat)
    }

    /// The offsets of the vertices, ascending. Between two of them the areas are quadratic in
    /// the offset [Budge2008].
    pub(crate) fn knots(&self) -> Vec<f64> {
        let mut knots = self.heights.clone();
        knots.sort_unstable_by(f64::total_cmp);
        knots.dedup();
        knots
    }

    /// The area of the polytope's surface below the plane at `t`, and that of its cross-section.
    pub(crate) fn areas_at(&self, t: f64) -> (f64, f64) {
        let vertices = &self.polytope.vertices;
        let (mut below, mut cap) = (0.0, DVec3::ZERO);
        let mut cap_origin = None;
        for ((face, &(lo, hi)), &area) in self
            .polytope
            .faces()
            .zip(&self.ranges)
            .zip(&self.polytope.areas)
        {
            if hi <= t {
                below += area;
                continue;
            }
            if lo > t {
                continue;
            }
            let (mut first, mut previous): (Option<DVec3>, DVec3) = (None, DVec3::ZERO);
            let mut vector = DVec3::ZERO;
            let mut add = |point: DVec3| {
                match first {
                    None => first = Some(point),
                    Some(first) => vector += (previous - first).cross(point - first),
                }
                previous = point;
            };
            let (mut leaves, mut enters) = (None, None);
            let mut i = usize::from(face[face.len() - 1]);
            for &j in face {
                let j = usize::from(j);
                let (h_i, h_j) = (self.heights[i], self.heights[j]);
                if (h_i <= t) != (h_j <= t) {
                    // From below to above whichever way the edge runs, so that both faces of the
                    // edge get the same point.
                    let (b, a) = if h_i <= t { (i, j) } else { (j, i) };
                    let step = (t - self.heights[b]) / (self.heights[a] - self.heights[b]);
                    let point = vertices[b] + (vertices[a] - vertices[b]) * step;
                    *(if h_i <= t { &mut leaves } else { &mut enters }) = Some(point);
                    add(point);
                }
                if h_j <= t {
                    add(vertices[j]);
                }
                i = j;
            }
            below += 0.5 * vector.length();
            if let (Some(leaves), Some(enters)) = (leaves, enters) {
                let origin = *cap_origin.get_or_insert(leaves);
                cap += (leaves - origin).cross(enters - origin);
            }
        }
        (below, 0.5 * cap.length())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// What rounding may move a vertex of the cells below, whose coordinates are up to 3.
    const ROUNDING: f64 = 1e-13;

    /// The diagonal of the box around a cell; `None` where rounding is all there is of it.
    fn size(cell: &Polytope) -> Option<f64> {
        let size = DVec3::AXES.map(|axis| {
            let (low, high) = cell.slicer(axis).extent();
            high - low
        });
        Some(DVec3::from(size).length()).filter(|&size| size > 1e8 * ROUNDING)
    }

    fn unit(v: [f64; 3]) -> Option<DVec3> {
        DVec3::from(v).try_normalize()
    }

    /// A box cut by a few planes through its inside, as cells are.
    fn carve(planes: &[([f64; 3], f64, bool)]) -> Polytope {
        let start = Aabb {
            min: [-1.0, -2.0, -0.5],
            max: [1.0, 1.5, 3.0],
        };
        let mut cell = Polytope::from_box(&start);
        for &(normal, at, keep_above) in planes {
            let Some(normal) = unit(normal) else { continue };
            let (low, high) = cell.slicer(normal).extent();
            if let Some((below, above)) = cell.cut(normal, low + at * (high - low)) {
                cell = if keep_above { above } else { below };
            }
        }
        cell
    }

    /// Directions of every kind: general, along axes and face diagonals (so that planes pass
    /// through vertices and along edges), and nearly along axes.
    fn direction() -> impl Strategy<Value = [f64; 3]> {
        prop_oneof![
            [-1.0..1.0f64, -1.0..1.0, -1.0..1.0],
            [-1i8..=1, -1i8..=1, -1i8..=1].prop_map(|v| v.map(f64::from)),
            [-1e-6..1e-6f64, -1e-6..1e-6, 0.9..1.0f64],
        ]
    }

    fn plane() -> impl Strategy<Value = ([f64; 3], f64, bool)> {
        let at = prop_oneof![0.0..1.0f64, Just(0.5), Just(1e-7), Just(1.0 - 1e-7)];
        (direction(), at, any::<bool>())
    }

    #[test]
    fn a_box_has_its_area_and_volume() {
        let cell = carve(&[]);
        assert!((cell.volume() - 2.0 * 3.5 * 3.5).abs() < 1e-12);
        assert!((cell.surface_area() - 2.0 * (7.0 + 7.0 + 12.25)).abs() < 1e-12);
    }

    #[test]
    fn a_plane_through_vertices_and_edges_cuts_cleanly() {
        let cell = Polytope::from_box(&Aabb {
            min: [0.0; 3],
            max: [1.0; 3],
        });
        let (below, above) = cell.cut(DVec3::new(1.0, 1.0, 0.0), 1.0).unwrap();
        for part in [&below, &above] {
            assert_eq!(part.vertices.len(), 6);
            assert_eq!(part.ends.len(), 5);
            assert!((part.volume() - 0.5).abs() < 1e-15);
        }
        let (below, above) = cell.cut(DVec3::ONE, 1.0).unwrap();
        assert_eq!((below.vertices.len(), above.vertices.len()), (4, 7));
    }

    proptest! {
        #![proptest_config(crate::testing::cases(25_000))]

        /// 25,000 random cells, each cut once at random: with the cuts that make the cells, over
        /// 10^5 cuts, slivers included.
        #[test]
        fn the_parts_of_a_cut_add_up(
            planes in prop::collection::vec(plane(), 0..8),
            normal in direction(),
            at in 0.0..1.0f64,
        ) {
            let cell = carve(&planes);
            let (Some(normal), Some(size)) = (unit(normal), size(&cell)) else { return Ok(()) };
            let slicer = cell.slicer(normal);
            let (low, high) = slicer.extent();
            let t = low + at * (high - low);
            if let Some((below, above)) = cell.cut(normal, t) {
                let (surface, cap) = slicer.areas_at(t);
                let tolerance = (1e-9 * size + ROUNDING) * size;
                prop_assert!((below.volume() + above.volume() - cell.volume()).abs() < tolerance * size);
                prop_assert!((below.surface_area() - (surface + cap)).abs() < tolerance);
                prop_assert!((above.surface_area() - (cell.surface_area() - surface + cap)).abs() < tolerance);
                prop_assert!(below.volume() > -1e-12 && above.volume() > -1e-12);
            } else {
                // Only what is thinner than rounding may refuse to be cut.
                prop_assert!(cell.volume() < 1e-9 || !(1e-9..=1.0 - 1e-9).contains(&at), "{planes:?} {normal} {t}");
            }
        }

        #[test]
        fn between_knots_the_areas_are_quadratic(
            planes in prop::collection::vec(plane(), 0..6),
            normal in direction(),
            at in 0.0..1.0f64,
        ) {
            let cell = carve(&planes);
            let (Some(normal), Some(size)) = (unit(normal), size(&cell)) else { return Ok(()) };
            let slicer = cell.slicer(normal);
            for pair in slicer.knots().windows(2).filter(|pair| pair[1] - pair[0] > 1e-6 * size + 1e5 * ROUNDING) {
                let point = |s: f64| slicer.areas_at(pair[0] + s * (pair[1] - pair[0]));
                let (start, middle, end, there) = (point(1e-6), point(0.5), point(1.0 - 1e-6), point(at));
                let quadratic = |a: f64, b: f64, c: f64| {
                    a * (1.0 - at) * (1.0 - 2.0 * at) + 4.0 * b * at * (1.0 - at) + c * at * (2.0 * at - 1.0)
                };
                    let tolerance = (1e-5 * size + ROUNDING) * size;
                prop_assert!((quadratic(start.1, middle.1, end.1) - there.1).abs() < tolerance);
                prop_assert!((quadratic(start.0, middle.0, end.0) - there.0).abs() < tolerance);
            }
        }
    }
}
