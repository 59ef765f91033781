//! Ize's candidates: per triangle of a node its own plane, and through each edge the plane
//! perpendicular to it, counted with an auxiliary BVH of the node's triangles [Ize2008].

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::extents::{Corners, LANES};
use super::outlines::Outlines;
use super::params::Ties;
use super::search::{Best, Bounds, Shape, touching};
use super::ties::{Boundary, Touching};
use crate::directions::canonical;
use crate::geometry::Aabb;
use crate::geometry::polytope::Aim;

/// A node of so many triangles is searched by several threads.
const PARALLEL_FROM: usize = 2048;

/// Candidates that are searched before the best so far is shared, at first and at most.
const BLOCK: std::ops::RangeInclusive<usize> = 128..=1 << 15;

/// Candidates that a thread takes at a time.
const CHUNK: usize = 64;

/// Up to so many triangles are counted before the areas are measured, and not the other way round.
const FEW: usize = 16;

/// A candidate plane: its unit normal, and where it is along it; not a number for an edge of no
/// length.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct TrianglePlane {
    pub(crate) normal: [f32; 3],
    pub(crate) offset: f32,
}

/// A triangle's own plane, then those through its edges.
pub(crate) fn planes(corners: &[[f32; 3]; 3], ties: Ties) -> [TrianglePlane; 4] {
    let points = corners.map(|p| Vec3::from(p).as_dvec3());
    let own = (points[1] - points[0]).cross(points[2] - points[0]);
    let edge = |i: usize| own.cross(points[(i + 1) % 3] - points[i]);
    let plane = |normal: DVec3, through: [f32; 3]| match normal.try_normalize() {
        Some(normal) => {
            let normal = canonical(normal.as_vec3().into());
            TrianglePlane {
                normal,
                offset: ties.project(normal, through),
            }
        }
        None => TrianglePlane {
            normal: [0.0; 3],
            offset: f32::NAN,
        },
    };
    [
        plane(own, corners[0]),
        plane(edge(0), corners[0]),
        plane(edge(1), corners[1]),
        plane(edge(2), corners[2]),
    ]
}

/// How many of a node's triangles are on either side of a plane, as [`Boundary::sides`] has it for
/// the first of the rules of [`touching`], and how many of them it [holds](Boundary::holds).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Sides {
    below: usize,
    above: usize,
    held: usize,
}

/// Counts how many of a node's triangles are on either side of a plane.
pub(crate) struct Counter {
    ties: Ties,
    tolerance: Option<f32>,
    overhang: f64,
    /// The triangles, in the order of the BVH's leaves.
    corners: Corners,
    nodes: Vec<BvhNode>,
}

/// A node of the auxiliary BVH; the first child follows it. Leaves have up to [`LANES`] triangles
/// and begin at multiples of it.
struct BvhNode {
    center: DVec3,
    half: DVec3,
    start: usize,
    count: usize,
    /// The second child; 0 in a leaf.
    second: usize,
}

impl Counter {
    /// Of `count` triangles, of which `whole` gives the corners, but for those that are cut to
    /// `outlines`. `overhang` is that of the build, or more.
    pub(super) fn new(
        count: usize,
        whole: impl Fn(usize) -> [[f32; 3]; 3] + Sync,
        outlines: &Outlines,
        (ties, tolerance, overhang): (Ties, Option<f32>, f64),
    ) -> Self {
        let mut items: Vec<_> = (0..count as u32)
            .map(|index| Item {
                bounds: Aabb::of_points(whole(index as usize)),
                index,
            })
            .collect();
        for (i, corners) in outlines.cut() {
            items[i].bounds = Aabb::of_points(corners.iter().map(|p| p.as_vec3().into()));
        }
        let mut nodes = Vec::with_capacity(count.div_ceil(LANES) * 2);
        split(&mut items, 0, &mut nodes);
        let mut corners = Corners::default();
        corners.gather(count, |i| whole(items[i].index as usize));
        for (i, item) in items.iter().enumerate() {
            corners.replace(i, outlines.of(item.index as usize));
        }
        Counter {
            ties,
            tolerance,
            overhang,
            corners,
            nodes,
        }
    }

    /// Counts; `None` once `goes_on` does not. It is told what is certain and how many triangles
    /// are not.
    fn count(
        &self,
        plane: &TrianglePlane,
        queue: &mut Vec<u32>,
        mut goes_on: impl FnMut(&Sides, usize) -> bool,
    ) -> Option<Sides> {
        let t = f64::from(plane.offset);
        let normal = Vec3::from(plane.normal).as_dvec3();
        let absolute = normal.abs();
        // What is further from the plane than this is on its side only, however it is rounded.
        let slack = 2.0 * self.overhang;
        // What is nearer than this lies in the plane, however it is rounded.
        let within = match self.tolerance {
            Some(tolerance) => 2.0 * f64::from(tolerance) - self.overhang,
            None => f64::NEG_INFINITY,
        };
        let mut sides = Sides::default();
        let mut uncertain = self.nodes[0].count;
        // Level by level: the largest nodes make the most certain.
        queue.clear();
        queue.push(0);
        let mut next = 0;
        while let Some(&at) = queue.get(next) {
            next += 1;
            let at = at as usize;
            let node = &self.nodes[at];
            let height = normal.dot(node.center) - t;
            let radius = absolute.dot(node.half);
            if height + radius + slack < 0.0 {
                sides.below += node.count;
            } else if height - radius - slack > 0.0 {
                sides.above += node.count;
            } else if height.abs() + radius <= within {
                sides.held += node.count;
                sides.below += node.count;
            } else if node.second == 0 {
                self.count_leaf(node, plane, &mut sides);
            } else {
                queue.extend([at as u32 + 1, node.second as u32]);
                continue;
            }
            uncertain -= node.count;
            if !goes_on(&sides, uncertain) {
                return None;
            }
        }
        Some(sides)
    }

    fn count_leaf(&self, node: &BvhNode, plane: &TrianglePlane, sides: &mut Sides) {
        let (mins, maxs) = self.corners.extents_at(node.start, self.ties, plane.normal);
        let t = plane.offset;
        let (mut below, mut above, mut held) = ([false; LANES], [false; LANES], [false; LANES]);
        let boundary = Boundary {
            offset: t,
            touching: self.touching(0),
        };
        for i in 0..LANES {
            let extent = (mins[i], maxs[i]);
            (below[i], above[i]) = boundary.sides(extent);
            held[i] = boundary.holds(extent);
        }
        let count = |lanes: &[bool; LANES]| {
            lanes[..node.count.min(LANES)]
                .iter()
                .map(|&lane| usize::from(lane))
                .sum::<usize>()
        };
        sides.below += count(&below);
        sides.above += count(&above);
        sides.held += count(&held);
    }

    /// As [`touching`], but that what touches the plane is on both sides where ties are as
    /// published.
    fn touching(&self, rule: u8) -> Touching {
        match self.tolerance {
            None => Touching::Both,
            tolerance => touching(tolerance, rule),
        }
    }
}

/// The box around a triangle, to be put into the BVH.
#[derive(Clone, Copy)]
struct Item {
    bounds: Aabb,
    index: u32,
}

/// Appends the BVH of these triangles, the first of which has the index `start`.
fn split(items: &mut [Item], start: usize, nodes: &mut Vec<BvhNode>) {
    let bounds = (items.iter()).fold(Aabb::EMPTY, |all, item| all.union(&item.bounds));
    let at = nodes.len();
    let [low, high] = [bounds.min, bounds.max].map(|p| Vec3::from(p).as_dvec3());
    nodes.push(BvhNode {
        center: 0.5 * (low + high),
        half: 0.5 * (high - low),
        start,
        count: items.len(),
        second: 0,
    });
    if items.len() > LANES {
        let extent = bounds.extent();
        let axis = if extent[0] >= extent[1] && extent[0] >= extent[2] {
            0
        } else if extent[1] >= extent[2] {
            1
        } else {
            2
        };
        let middle = (items.len() / 2).next_multiple_of(LANES);
        let center = |item: &Item| item.bounds.min[axis] + item.bounds.max[axis];
        items.select_nth_unstable_by(middle, |a, b| center(a).total_cmp(&center(b)));
        let (first, second) = items.split_at_mut(middle);
        split(first, start, nodes);
        nodes[at].second = nodes.len();
        split(second, start + middle, nodes);
    }
}

/// The planes of a node's triangles, and what it takes to weigh them.
pub(crate) struct PlaneSearch<'a> {
    shape: Shape<'a>,
    counter: Counter,
    triangles: &'a [u32],
    planes: &'a [[TrianglePlane; 4]],
    /// Only a plane of fewer expected tests than this matters.
    bar: f64,
    empty_factor: f64,
}

/// A plane that was weighed.
#[derive(Clone, Copy, Debug)]
struct Found {
    expected_tests: f64,
    /// Of equally good planes that with the lowest one counts.
    index: usize,
    rule: u8,
    areas: (f64, f64),
}

/// What a search found so far.
#[derive(Clone, Copy, Debug, Default)]
struct Finds {
    best: Option<Found>,
    /// How many planes pass through the cell.
    inside: u64,
}

/// Buffers of one thread.
#[derive(Default)]
struct Scratch {
    aim: Aim,
    queue: Vec<u32>,
}

impl Finds {
    fn enter(&mut self, found: Found) {
        let wins = self.best.is_none_or(|best| {
            (found.expected_tests, found.index) < (best.expected_tests, best.index)
        });
        if wins {
            self.best = Some(found);
        }
    }
}

impl<'a> PlaneSearch<'a> {
    /// `planes` are those of all triangles of the mesh; only planes of fewer expected tests than
    /// `bar` matter.
    pub(crate) fn new(
        shape: Shape<'a>,
        (triangles, counter): (&'a [u32], Counter),
        planes: &'a [[TrianglePlane; 4]],
        (bar, empty_bonus): (f64, f64),
    ) -> Self {
        PlaneSearch {
            counter,
            bar,
            empty_factor: 1.0 - empty_bonus,
            shape,
            triangles,
            planes,
        }
    }

    /// The best plane if it matters, with whether it is that of an edge; and how many planes pass
    /// through the cell. What is found depends on neither threads nor the order of the search.
    pub(crate) fn run(&self) -> (Option<(TrianglePlane, bool, Best)>, u64) {
        let count = 4 * self.triangles.len();
        let mut finds = Finds::default();
        if self.triangles.len() < PARALLEL_FROM {
            let scratch = &mut Scratch::default();
            (0..count).for_each(|index| self.weigh(index, &mut finds, scratch));
        } else {
            self.run_in_blocks(count, &mut finds);
        }
        let best = finds.best.map(|found| {
            let plane = self.plane(found.index);
            let best = Best {
                boundary: Boundary {
                    offset: plane.offset,
                    touching: self.counter.touching(found.rule),
                },
                expected_tests: found.expected_tests,
                areas: found.areas,
            };
            (plane, found.index % 4 > 0, best)
        });
        (best, finds.inside)
    }

    /// In blocks that grow, so that a good plane is known soon; scattered, since triangles that
    /// follow each other are alike.
    fn run_in_blocks(&self, count: usize, finds: &mut Finds) {
        let stride = coprime_stride(count);
        let (mut done, mut block) = (0, *BLOCK.start());
        while done < count {
            let end = count.min(done + block);
            let known = finds.best;
            let parts: Vec<Finds> = (done..end)
                .into_par_iter()
                .chunks(CHUNK)
                .map_init(Scratch::default, |scratch, chunk| {
                    let mut finds = Finds {
                        best: known,
                        inside: 0,
                    };
                    for i in chunk {
                        let index = (i as u128 * stride as u128 % count as u128) as usize;
                        self.weigh(index, &mut finds, scratch);
                    }
                    finds
                })
                .collect();
            for part in parts {
                finds.inside += part.inside;
                part.best.into_iter().for_each(|found| finds.enter(found));
            }
            done = end;
            block = (2 * block).min(*BLOCK.end());
        }
    }

    fn plane(&self, index: usize) -> TrianglePlane {
        self.planes[self.triangles[index / 4] as usize][index % 4]
    }

    fn weigh(&self, index: usize, finds: &mut Finds, scratch: &mut Scratch) {
        let plane = self.plane(index);
        if plane.offset.is_nan() {
            return;
        }
        let Scratch { aim, queue } = scratch;
        let Shape { polytope, area, .. } = self.shape;
        aim.at(polytope, Vec3::from(plane.normal).as_dvec3());
        let (low, high) = aim.inside();
        let t = f64::from(plane.offset);
        if !(low < t && t < high) {
            return;
        }
        finds.inside += 1;
        let bar = match finds.best {
            // Triangles of one plane, and neighbours, give the same plane again and again.
            Some(best) if self.plane(best.index) == plane => {
                return finds.enter(Found { index, ..best });
            }
            Some(best) => best.expected_tests,
            None => self.bar,
        };
        let (sides, areas) = if self.triangles.len() <= FEW {
            let Some(sides) = self.counter.count(&plane, queue, |_, _| true) else {
                return;
            };
            let bounds = Bounds::new(aim.ends(), aim.end_faces(polytope), &self.shape);
            let held = sides.held as f64;
            let (below, above) = (sides.below as f64 - held, sides.above as f64);
            let mut bound = bounds.expected_tests(t, t, below, above);
            if sides.below == sides.held || sides.above == 0 {
                bound *= self.empty_factor;
            }
            if bound >= bar {
                return;
            }
            (sides, aim.areas(polytope, area, t))
        } else {
            let areas = aim.areas(polytope, area, t);
            let least = areas.0.min(areas.1);
            let counted = self.counter.count(&plane, queue, |sides, uncertain| {
                let below = (sides.below - sides.held) as f64;
                let above = sides.above as f64;
                let either = (uncertain + sides.held) as f64;
                let mut bound = areas.0 * below + areas.1 * above + least * either;
                if below == 0.0 || above == 0.0 {
                    bound *= self.empty_factor;
                }
                bound * (1.0 - 1e-12) < bar
            });
            let Some(sides) = counted else { return };
            (sides, areas)
        };
        let Sides { below, above, held } = sides;
        for (rule, moved) in [(0, 0), (1, held)] {
            if rule == 1 && held == 0 {
                break;
            }
            let (below, above) = (below - moved, above + moved);
            let mut expected_tests = areas.0 * below as f64 + areas.1 * above as f64;
            if below == 0 || above == 0 {
                expected_tests *= self.empty_factor;
            }
            if expected_tests < self.bar {
                finds.enter(Found {
                    expected_tests,
                    index,
                    rule,
                    areas,
                });
            }
        }
    }
}

/// A stride that visits each of `count` places once, far from the last.
fn coprime_stride(count: usize) -> usize {
    let divides = |mut a: usize, mut b: usize| {
        while b > 0 {
            (a, b) = (b, a % b);
        }
        a > 1
    };
    // The golden ratio leaves no two visits in a row near each other.
    let mut stride = (count as f64 * 0.618_033_988_749_894_9) as usize | 1;
    while divides(stride, count) {
        stride += 2;
    }
    stride
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    type Triangle = [[f32; 3]; 3];

    fn counter(corners: &[Triangle], (ties, tolerance): (Ties, Option<f32>)) -> Counter {
        let whole = |i: usize| corners[i];
        let none = Outlines::default();
        Counter::new(corners.len(), whole, &none, (ties, tolerance, 1.001e-3))
    }

    fn soup() -> impl Strategy<Value = Vec<Triangle>> {
        let point = || prop::array::uniform3(prop_oneof![-1.0f32..1.0, Just(0.25f32)]);
        prop::collection::vec(prop::array::uniform3(point()), 2..100)
    }

    proptest! {
        #![proptest_config(crate::testing::cases(300))]

        #[test]
        fn the_bvh_counts_as_the_predicate_does(
            mut corners in soup(),
            of in 0usize..100,
            tolerant in any::<bool>(),
            in_a_plane in any::<bool>(),
        ) {
            if in_a_plane {
                corners.iter_mut().flatten().for_each(|p| p[2] = 0.25);
            }
            let (ties, tolerance) = match tolerant {
                true => (Ties::Tolerant, Some(1e-3)),
                false => (Ties::AsPublished, None),
            };
            let counter = counter(&corners, (ties, tolerance));
            for plane in planes(&corners[of % corners.len()], ties) {
                if plane.offset.is_nan() {
                    continue;
                }
                let boundary = Boundary { offset: plane.offset, touching: counter.touching(0) };
                let extents = || corners.iter().map(|corners| ties.extent(plane.normal, corners));
                let expected = Sides {
                    below: extents().filter(|&extent| boundary.sides(extent).0).count(),
                    above: extents().filter(|&extent| boundary.sides(extent).1).count(),
                    held: extents().filter(|&extent| boundary.holds(extent)).count(),
                };
                let counted = counter.count(&plane, &mut Vec::new(), |_, _| true);
                prop_assert_eq!(counted, Some(expected));
            }
        }

        /// Bounds leave out only what cannot win: the best plane is that of counting every
        /// triangle for every plane, one after another or in blocks.
        #[test]
        fn bounds_do_not_change_the_best_plane(corners in soup(), tolerant in any::<bool>(), bonus in 0..2) {
            let (ties, tolerance) = match tolerant {
                true => (Ties::Tolerant, Some(1e-3)),
                false => (Ties::AsPublished, None),
            };
            let bounds = Aabb::of_points(corners.iter().flatten().copied());
            let cell = crate::geometry::polytope::Polytope::from_box(&bounds);
            prop_assume!(cell.volume() > 1e-3);
            let shape = Shape::of(&cell);
            let all: Vec<_> = corners.iter().map(|corners| planes(corners, ties)).collect();
            let triangles: Vec<u32> = (0..corners.len() as u32).collect();
            let empty_bonus = 0.5 * f64::from(bonus);
            let search = PlaneSearch::new(
                shape,
                (&triangles, counter(&corners, (ties, tolerance))),
                &all,
                (f64::INFINITY, empty_bonus),
            );
            let mut expected: Option<(f64, usize)> = None;
            let mut inside = 0;
            for (index, plane) in all.iter().flatten().enumerate().filter(|(_, p)| !p.offset.is_nan()) {
                let mut aim = Aim::default();
                aim.at(&cell, Vec3::from(plane.normal).as_dvec3());
                let (low, high) = aim.inside();
                let t = f64::from(plane.offset);
                if !(low < t && t < high) {
                    continue;
                }
                inside += 1;
                let areas = aim.areas(&cell, shape.area, t);
                for rule in [0, 1] {
                    let boundary = Boundary { offset: plane.offset, touching: search.counter.touching(rule) };
                    let sides = || corners.iter().map(|c| boundary.sides(ties.extent(plane.normal, c)));
                    let below = sides().filter(|s| s.0).count();
                    let above = sides().filter(|s| s.1).count();
                    let mut weight = areas.0 * below as f64 + areas.1 * above as f64;
                    if below == 0 || above == 0 {
                        weight *= 1.0 - empty_bonus;
                    }
                    if expected.is_none_or(|(least, _)| weight < least) {
                        expected = Some((weight, index));
                    }
                }
            }
            let (found, found_inside) = search.run();
            prop_assert_eq!(found_inside, inside);
            let mut in_blocks = Finds::default();
            search.run_in_blocks(4 * corners.len(), &mut in_blocks);
            prop_assert_eq!(in_blocks.inside, inside);
            match expected {
                Some((weight, index)) => {
                    let (plane, is_edge, best) = found.unwrap();
                    prop_assert_eq!(best.expected_tests, weight);
                    prop_assert_eq!((plane, is_edge), (search.plane(index), index % 4 > 0));
                    prop_assert_eq!(in_blocks.best.unwrap().index, index);
                }
                None => prop_assert!(found.is_none() && in_blocks.best.is_none()),
            }
        }
    }

    #[test]
    fn a_triangle_has_its_own_plane_and_one_through_each_edge() {
        let corners = [[0.0, 0.0, 2.0], [1.0, 0.0, 2.0], [0.0, 1.0, 2.0]];
        let s = 0.5f32.sqrt();
        let expected = [
            ([0.0, 0.0, 1.0], 2.0),
            ([0.0, 1.0, 0.0], 0.0),
            ([s, s, 0.0], s),
            ([1.0, 0.0, 0.0], 0.0),
        ];
        let found = planes(&corners, Ties::Tolerant);
        assert_eq!(found.map(|plane| (plane.normal, plane.offset)), expected);
    }

    #[test]
    fn strides_visit_every_candidate() {
        for count in [4, 8, 12, 400, 4 * 2048, 4 * 33_264] {
            let mut seen = vec![false; count];
            let stride = coprime_stride(count);
            (0..count)
                .for_each(|i| seen[(i as u128 * stride as u128 % count as u128) as usize] = true);
            assert!(seen.into_iter().all(|seen| seen), "{count}");
        }
    }
}
