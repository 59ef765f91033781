//! Convex polytopes: the cells of a BSP tree.

mod cut;
mod profile;

use glam::DVec3;

use super::Aabb;
pub(crate) use cut::CutScratch;
pub(crate) use profile::Profile;

/// A convex polytope with its faces as loops of vertices, counter-clockwise from outside.
///
/// Only the heuristic looks at it: an inexact polytope makes a worse tree, never a wrong one.
#[derive(Clone, Debug, Default)]
pub(crate) struct Polytope {
    vertices: Vec<DVec3>,
    faces: Vec<Face>,
    /// The loops of all faces, one after another, as indices of vertices.
    loops: Vec<u16>,
}

#[derive(Clone, Copy, Debug)]
struct Face {
    /// Outward unit normal.
    normal: DVec3,
    area: f64,
    /// Where the loop is.
    start: u16,
    end: u16,
}

impl Polytope {
    pub(crate) fn from_box(aabb: &Aabb) -> Self {
        let mut polytope = Polytope::default();
        polytope.set_box(aabb);
        polytope
    }

    /// Makes it a box, in the memory that it has.
    pub(crate) fn set_box(&mut self, aabb: &Aabb) {
        let pick = |corner: usize, axis: usize| {
            f64::from(if corner >> axis & 1 == 1 {
                aabb.max[axis]
            } else {
                aabb.min[axis]
            })
        };
        self.clear();
        self.vertices
            .extend((0..8).map(|c| DVec3::new(pick(c, 0), pick(c, 1), pick(c, 2))));
        for (normal, indices) in [
            (DVec3::NEG_X, [0, 4, 6, 2]),
            (DVec3::X, [1, 3, 7, 5]),
            (DVec3::NEG_Y, [0, 1, 5, 4]),
            (DVec3::Y, [2, 6, 7, 3]),
            (DVec3::NEG_Z, [0, 2, 3, 1]),
            (DVec3::Z, [4, 5, 7, 6]),
        ] {
            self.push_face(normal, &indices);
        }
    }

    fn clear(&mut self) {
        self.vertices.clear();
        self.faces.clear();
        self.loops.clear();
    }

    fn push_face(&mut self, normal: DVec3, indices: &[u16]) {
        let start = self.loops.len() as u16;
        self.loops.extend_from_slice(indices);
        let points = indices.iter().map(|&i| self.vertices[usize::from(i)]);
        let area = polygon_area(points);
        self.faces.push(Face {
            normal,
            area,
            start,
            end: self.loops.len() as u16,
        });
    }

    fn indices(&self, face: &Face) -> &[u16] {
        &self.loops[usize::from(face.start)..usize::from(face.end)]
    }

    pub(crate) fn surface_area(&self) -> f64 {
        self.faces.iter().map(|face| face.area).sum()
    }

    pub(crate) fn volume(&self) -> f64 {
        let Some(&apex) = self.vertices.first() else {
            return 0.0;
        };
        let six_fold: f64 = self
            .faces
            .iter()
            .map(|face| {
                let indices = self.indices(face);
                let v = |i: usize| self.vertices[usize::from(indices[i])] - apex;
                (1..indices.len() - 1)
                    .map(|i| v(0).dot(v(i).cross(v(i + 1))))
                    .sum::<f64>()
            })
            .sum();
        six_fold / 6.0
    }

    /// How far the polytope reaches along a direction, and the offsets of the planes across it that
    /// pass through the inside. A plane that a face lies in does not, whatever rounding has done
    /// to the face.
    fn extent(heights: impl Iterator<Item = f64>) -> Extent {
        let (low, high) = heights.fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), v| {
            (lo.min(v), hi.max(v))
        });
        let flat = 1e-9 * (high - low) + 64.0 * f64::EPSILON * low.abs().max(high.abs());
        Extent { low, high, flat }
    }
}

/// The cosine between the normal of a face and a direction that the face may lie across.
const ACROSS: f64 = 0.99;

/// A polytope seen along a unit direction: how high its vertices are.
#[derive(Debug, Default)]
pub(crate) struct Aim {
    direction: DVec3,
    heights: Vec<f64>,
    extent: Extent,
}

impl Aim {
    /// Takes aim; the heights are those of this polytope until the next time.
    pub(crate) fn at(&mut self, polytope: &Polytope, direction: DVec3) {
        self.direction = direction;
        self.heights.clear();
        self.heights
            .extend(polytope.vertices.iter().map(|v| direction.dot(*v)));
        self.extent = Polytope::extent(self.heights.iter().copied());
    }

    /// The lowest and the highest offset of the polytope.
    pub(crate) fn ends(&self) -> (f64, f64) {
        (self.extent.low, self.extent.high)
    }

    /// Between which offsets planes pass through the inside, both excluded.
    pub(crate) fn inside(&self) -> (f64, f64) {
        let Extent { low, high, flat } = self.extent;
        (low + flat, high - flat)
    }

    /// The areas of the faces at the lowest and at the highest plane, up to rounding not more.
    pub(crate) fn end_faces(&self, polytope: &Polytope) -> (f64, f64) {
        let Extent { low, high, flat } = self.extent;
        let mut ends = (0.0, 0.0);
        for face in &polytope.faces {
            let first = self.heights[usize::from(polytope.loops[usize::from(face.start)])];
            let (is_low, is_high) = (first <= low + flat, first >= high - flat);
            if !(is_low || is_high) {
                continue;
            }
            let heights = polytope.indices(face).iter();
            let mut heights = heights.map(|&i| self.heights[usize::from(i)]);
            if is_low && heights.clone().all(|h| h <= low + flat) {
                ends.0 += face.area;
            } else if is_high && heights.all(|h| h >= high - flat) {
                ends.1 += face.area;
            }
        }
        ends
    }

    /// The areas of the polytope's parts below and above the plane at `t`, which passes through the
    /// inside, as fractions of `area`, that of the whole.
    pub(crate) fn areas(&self, polytope: &Polytope, area: f64, t: f64) -> (f64, f64) {
        let (surface, cap) = self.surface_and_cap(polytope, t);
        let surface = surface.clamp(0.0, area);
        ((surface + cap) / area, (area - surface + cap) / area)
    }

    /// The area of the surface below the plane at `t`, which passes through the inside, and that of
    /// the cross-section.
    fn surface_and_cap(&self, polytope: &Polytope, t: f64) -> (f64, f64) {
        let Aim {
            direction,
            heights,
            extent,
        } = self;
        let height = |i: u16| heights[usize::from(i)];
        let (mut below, mut cap) = (0.0, DVec3::ZERO);
        let mut cap_origin = None;
        for face in &polytope.faces {
            let indices = polytope.indices(face);
            let count = indices.len();
            let next = |k: usize| if k + 1 == count { 0 } else { k + 1 };
            let is_in = |k: usize| height(indices[k]) <= t;
            // Most faces are on one side.
            let starts_in = is_in(0);
            let Some(change) = (1..count).find(|&k| is_in(k) != starts_in) else {
                if starts_in {
                    below += face.area;
                }
                continue;
            };
            if face.normal.dot(*direction).abs() > ACROSS {
                let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
                for &i in indices {
                    let h = height(i);
                    low = if h < low { h } else { low };
                    high = if h > high { h } else { high };
                }
                if high - low <= extent.flat {
                    // A face across the direction has no part below a plane that passes through
                    // it: it belongs to the end of the polytope that it closes.
                    if low - extent.low < extent.high - high {
                        below += face.area;
                    }
                    continue;
                }
            }
            // Seen from where the loop leaves the part below, what lies there is a fan.
            let crossing = |i: u16, j: u16| crossing(&polytope.vertices, heights, t, (i, j));
            let mut k = match starts_in {
                false => change - 1,
                true => (change..count - 1)
                    .find(|&k| is_in(k + 1))
                    .unwrap_or(count - 1),
            };
            let enters = crossing(indices[k], indices[next(k)]);
            k = next(k);
            let mut vector = DVec3::ZERO;
            let mut previous = polytope.vertices[usize::from(indices[k])] - enters;
            // As many steps as there are vertices, whatever rounding has done to the face.
            for _ in 0..count {
                if !is_in(next(k)) {
                    break;
                }
                k = next(k);
                let point = polytope.vertices[usize::from(indices[k])] - enters;
                vector += previous.cross(point);
                previous = point;
            }
            let leaves = crossing(indices[k], indices[next(k)]);
            vector += previous.cross(leaves - enters);
            below += 0.5 * face.normal.dot(vector).abs();
            let origin = *cap_origin.get_or_insert(leaves);
            cap += (leaves - origin).cross(enters - origin);
        }
        (below, 0.5 * cap.length())
    }
}

/// Where an edge passes the height `t`: from below to above whichever way the edge runs, so that both
/// faces of the edge get the same point.
#[inline(always)]
fn crossing(vertices: &[DVec3], heights: &[f64], t: f64, (i, j): (u16, u16)) -> DVec3 {
    let [i, j] = [i, j].map(usize::from);
    let (b, a) = if heights[i] <= t { (i, j) } else { (j, i) };
    let step = (t - heights[b]) / (heights[a] - heights[b]);
    vertices[b] + (vertices[a] - vertices[b]) * step
}

/// How far a polytope reaches along a direction.
#[derive(Clone, Copy, Debug, Default)]
struct Extent {
    low: f64,
    high: f64,
    /// What is not longer than this is flat.
    flat: f64,
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

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// What rounding may move a vertex of the cells below, whose coordinates are up to 3.
    const ROUNDING: f64 = 1e-13;

    fn extent(cell: &Polytope, direction: DVec3) -> Extent {
        Polytope::extent(cell.vertices.iter().map(|v| direction.dot(*v)))
    }

    fn cut(cell: &Polytope, normal: DVec3, offset: f64) -> Option<(Polytope, Polytope)> {
        let scratch = &mut CutScratch::default();
        let [below, above] = cell.cut(normal, offset, [true, true], scratch)?;
        below.zip(above)
    }

    /// The area of the surface below a plane, and that of the cross-section; `None` where the plane
    /// does not pass through the inside.
    fn areas_at(cell: &Polytope, direction: DVec3, t: f64) -> Option<(f64, f64)> {
        let mut aim = Aim::default();
        aim.at(cell, direction);
        let (low, high) = aim.inside();
        (low < t && t < high).then(|| aim.surface_and_cap(cell, t))
    }

    /// The diagonal of the box around a cell; `None` where rounding is all there is of it.
    fn size(cell: &Polytope) -> Option<f64> {
        let size = DVec3::AXES.map(|axis| {
            let extent = extent(cell, axis);
            extent.high - extent.low
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
            let Extent { low, high, .. } = extent(&cell, normal);
            if let Some((below, above)) = cut(&cell, normal, low + at * (high - low)) {
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
        let (below, above) = cut(&cell, DVec3::new(1.0, 1.0, 0.0), 1.0).unwrap();
        for part in [&below, &above] {
            assert_eq!(part.vertices.len(), 6);
            assert_eq!(part.faces.len(), 5);
            assert!((part.volume() - 0.5).abs() < 1e-15);
        }
        let (below, above) = cut(&cell, DVec3::ONE, 1.0).unwrap();
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
            let Extent { low, high, .. } = extent(&cell, normal);
            let t = low + at * (high - low);
            if let Some((below, above)) = cut(&cell, normal, t)
                && let Some((surface, cap)) = areas_at(&cell, normal, t)
            {
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
        fn the_quadratics_give_the_areas_of_a_cut(
            planes in prop::collection::vec(plane(), 0..8),
            normal in direction(),
            mut steps in prop::collection::vec(0.001..0.999f64, 1..6),
        ) {
            let cell = carve(&planes);
            let (Some(normal), Some(size)) = (unit(normal), size(&cell)) else { return Ok(()) };
            prop_assume!(size > 1e10 * ROUNDING);
            let Extent { low, high, .. } = extent(&cell, normal);
            let mut profile = Profile::default();
            let mut aim = Aim::default();
            aim.at(&cell, normal);
            profile.fill_polytope(&cell, normal, &aim);
            steps.sort_by(f64::total_cmp);
            for t in steps.into_iter().map(|step| low + step * (high - low)) {
                let Some((surface, cap)) = areas_at(&cell, normal, t) else { continue };
                let area = cell.surface_area();
                let (below, above) = profile.areas(t);
                // Of a cell that is thin for its size, rounding leaves less.
                let thinness = size * area / cell.volume();
                let tolerance = 1e-6 + 1e-13 * thinness.powi(2);
                prop_assert!((below - (surface + cap) / area).abs() < tolerance);
                prop_assert!((above - (area - surface + cap) / area).abs() < tolerance);
            }
        }
    }
}
