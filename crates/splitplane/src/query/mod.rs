//! Rays against a tree.

mod all_hits;
mod batch;
mod brute_force;
mod inside;
mod nearby;
mod simd;
mod traverse;
mod wide;

use std::ops::ControlFlow;

use crate::geometry::Ray;
use crate::geometry::triangle::{Shear, plane_is_beyond};
use crate::tree::{Tree, with_nodes};
pub(crate) use all_hits::all_hits;
pub use batch::Coherence;
pub(crate) use batch::{any_hits, closest_hits};
pub use brute_force::brute_force;
pub(crate) use inside::contains;
pub use nearby::ClosestPoint;
pub(crate) use nearby::{closest_point, overlaps_region, overlaps_sphere};
use traverse::traverse;
pub(crate) use traverse::{Place, Search, Triangle};

/// Where a ray meets the mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Hit {
    /// Distance from the ray's origin, in multiples of its direction's length.
    pub t: f32,
    /// Barycentric weight of the triangle's second vertex, in `[0, 1]`.
    pub u: f32,
    /// Barycentric weight of the triangle's third vertex, in `[0, 1]`.
    pub v: f32,
    /// Index of the triangle in the mesh.
    pub triangle: u32,
}

/// How a query decides which cells a ray passes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Traversal {
    /// With margins for all rounding, so that the hits are those of brute force, bit for bit. Where
    /// a hit lies in a split plane, both sides of the plane are looked at.
    #[default]
    Exact,
    /// Without margins, as in the thesis: its counts are those of the thesis, but a hit in or near
    /// a split plane may be missed. For comparison with published figures only.
    AsPublished,
}

/// What a query reports while it runs. Counting never changes a result; `()` counts nothing and
/// costs nothing.
pub trait Counters {
    /// So many triangles were tested.
    #[inline(always)]
    fn triangle_tests(&mut self, _triangles: u32) {}
    /// A node with eight boxes was visited.
    #[inline(always)]
    fn wide_visit(&mut self) {}
    /// An axis-aligned interior node was visited.
    #[inline(always)]
    fn kd_visit(&mut self) {}
    /// An interior node with an oblique plane was visited.
    #[inline(always)]
    fn oblique_visit(&mut self) {}
    /// A leaf of this many triangles was visited.
    #[inline(always)]
    fn leaf_visit(&mut self, _triangles: u32) {}
}

impl Counters for () {}

/// Sums of what queries did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Counts {
    /// Triangles tested.
    pub triangle_tests: u64,
    /// Axis-aligned interior nodes visited.
    pub kd_visits: u64,
    /// Interior nodes with an oblique plane visited.
    pub oblique_visits: u64,
    /// Nodes with eight boxes visited.
    pub wide_visits: u64,
    /// Leaves visited.
    pub leaf_visits: u64,
}

impl Counters for Counts {
    #[inline(always)]
    fn triangle_tests(&mut self, triangles: u32) {
        self.triangle_tests += u64::from(triangles);
    }
    #[inline(always)]
    fn wide_visit(&mut self) {
        self.wide_visits += 1;
    }
    #[inline(always)]
    fn kd_visit(&mut self) {
        self.kd_visits += 1;
    }
    #[inline(always)]
    fn oblique_visit(&mut self) {
        self.oblique_visits += 1;
    }
    #[inline(always)]
    fn leaf_visit(&mut self, _triangles: u32) {
        self.leaf_visits += 1;
    }
}

impl std::ops::AddAssign for Counts {
    fn add_assign(&mut self, other: Counts) {
        self.triangle_tests += other.triangle_tests;
        self.kd_visits += other.kd_visits;
        self.oblique_visits += other.oblique_visits;
        self.wide_visits += other.wide_visits;
        self.leaf_visits += other.leaf_visits;
    }
}

impl std::ops::Sub for Counts {
    type Output = Counts;
    fn sub(self, other: Counts) -> Counts {
        Counts {
            triangle_tests: self.triangle_tests - other.triangle_tests,
            kd_visits: self.kd_visits - other.kd_visits,
            oblique_visits: self.oblique_visits - other.oblique_visits,
            wide_visits: self.wide_visits - other.wide_visits,
            leaf_visits: self.leaf_visits - other.leaf_visits,
        }
    }
}

/// A ray, and its part of the ray-triangle test once that is asked for: many rays never meet a
/// leaf.
struct Aim<'r> {
    ray: &'r Ray,
    shear: Option<Shear>,
}

impl<'r> Aim<'r> {
    #[inline(always)]
    fn new(ray: &'r Ray) -> Self {
        Aim { ray, shear: None }
    }

    #[inline(always)]
    fn shear(&mut self) -> &Shear {
        self.shear.get_or_insert_with(|| Shear::of(self.ray))
    }

    /// Where the ray meets a triangle beyond its `t_min`, if `wanted` there.
    #[inline(always)]
    fn meet(&mut self, triangle: &impl Triangle, wanted: impl FnOnce(f32) -> bool) -> Option<Hit> {
        let hit = triangle.meet(self.shear())?;
        let is_met = hit.t > self.ray.t_min
            && wanted(hit.t)
            && (triangle.is_surely_beyond() || plane_is_beyond(self.ray, &triangle.corners()));
        is_met.then_some(hit)
    }
}

/// The nearest of the hits that `accept` takes.
struct Closest<'r, A> {
    aim: Aim<'r>,
    best: Hit,
    accept: A,
}

impl<'r, A: Accept> Closest<'r, A> {
    #[inline(always)]
    fn new(ray: &'r Ray, accept: A) -> Self {
        Closest::after(ray, None, accept)
    }

    /// Once this has been found.
    #[inline(always)]
    fn after(ray: &'r Ray, found: Option<Hit>, accept: A) -> Self {
        let nothing = Hit {
            t: ray.t_max,
            u: 0.0,
            v: 0.0,
            triangle: NONE,
        };
        Closest {
            aim: Aim::new(ray),
            best: found.unwrap_or(nothing),
            accept,
        }
    }

    #[inline(always)]
    fn found(&self) -> Option<Hit> {
        (self.best.triangle != NONE).then_some(self.best)
    }
}

impl<A: Accept> Search for Closest<'_, A> {
    const NEAREST_FIRST: bool = true;

    #[inline(always)]
    fn shear(&mut self) -> Option<&Shear> {
        Some(self.aim.shear())
    }

    #[inline(always)]
    fn limit(&self) -> f64 {
        f64::from(self.best.t)
    }

    #[inline(always)]
    fn limit_above(&self) -> f32 {
        self.best.t
    }

    #[inline(always)]
    fn test(&mut self, triangle: &impl Triangle) -> ControlFlow<()> {
        let best = &self.best;
        let wanted = |t: f32| t < best.t || t == best.t && triangle.index() < best.triangle;
        if let Some(hit) = self.aim.meet(triangle, wanted)
            && self.accept.accepts(&hit)
        {
            self.best = hit;
        }
        ControlFlow::Continue(())
    }
}

/// Which hits a query takes.
pub(crate) trait Accept {
    /// Whether it takes every hit, so that none need be computed.
    const ALL: bool = false;
    fn accepts(&self, hit: &Hit) -> bool;
}

impl<F: Fn(&Hit) -> bool> Accept for F {
    #[inline(always)]
    fn accepts(&self, hit: &Hit) -> bool {
        self(hit)
    }
}

/// Takes every hit.
pub(crate) struct Everything;

impl Accept for Everything {
    const ALL: bool = true;
    #[inline(always)]
    fn accepts(&self, _: &Hit) -> bool {
        true
    }
}

/// Whether there is a hit that `accept` takes.
struct Any<'r, A> {
    aim: Aim<'r>,
    found: bool,
    accept: A,
}

impl<'r, A: Accept> Any<'r, A> {
    #[inline(always)]
    fn new(ray: &'r Ray, accept: A) -> Self {
        Any {
            aim: Aim::new(ray),
            found: false,
            accept,
        }
    }
}

impl<A: Accept> Search for Any<'_, A> {
    const NEAREST_FIRST: bool = false;
    const NEEDS_NO_HIT: bool = A::ALL;

    #[inline(always)]
    fn found_without_hit(&mut self) {
        self.found = true;
    }

    #[inline(always)]
    fn shear(&mut self) -> Option<&Shear> {
        Some(self.aim.shear())
    }

    #[inline(always)]
    fn limit(&self) -> f64 {
        f64::from(self.aim.ray.t_max)
    }

    #[inline(always)]
    fn limit_above(&self) -> f32 {
        self.aim.ray.t_max
    }

    #[inline(always)]
    fn test(&mut self, triangle: &impl Triangle) -> ControlFlow<()> {
        let t_max = self.aim.ray.t_max;
        if let Some(hit) = self.aim.meet(triangle, |t| t <= t_max)
            && self.accept.accepts(&hit)
        {
            self.found = true;
            return ControlFlow::Break(());
        }
        ControlFlow::Continue(())
    }
}

/// No triangle has this index: see [`Mesh::MAX_COUNT`].
pub(crate) const NONE: u32 = u32::MAX;

#[inline(always)]
pub(crate) fn closest_hit(
    tree: &Tree,
    ray: &Ray,
    accept: impl Fn(&Hit) -> bool,
    counters: &mut impl Counters,
) -> Option<Hit> {
    let mut search = Closest::new(ray, accept);
    run(tree, ray, &mut search, counters);
    search.found()
}

#[inline(always)]
pub(crate) fn any_hit(
    tree: &Tree,
    ray: &Ray,
    accept: impl Accept,
    counters: &mut impl Counters,
) -> bool {
    let mut search = Any::new(ray, accept);
    run(tree, ray, &mut search, counters);
    search.found
}

#[inline(always)]
fn run(tree: &Tree, ray: &Ray, search: &mut impl Search, counters: &mut impl Counters) {
    run_in(tree, tree.place(), ray, search, counters);
}

/// The same, with other margins than the tree's own.
#[inline(always)]
pub(crate) fn run_in(
    tree: &Tree,
    place: &Place,
    ray: &Ray,
    search: &mut impl Search,
    counters: &mut impl Counters,
) {
    match tree.wide() {
        Some(wide) => wide::traverse(wide, ray, search, counters),
        None => run_binary(tree, place, ray, search, counters),
    }
}

/// Apart, so that the memory it needs is not asked for where the tree is wide.
#[inline(never)]
fn run_binary(
    tree: &Tree,
    place: &Place,
    ray: &Ray,
    search: &mut impl Search,
    counters: &mut impl Counters,
) {
    if ray.is_valid() && !place.bounds.is_empty() {
        with_nodes!(tree, nodes => traverse(nodes, tree, place, ray, search, counters));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{BuildParams, Mesh, TREES, TreeChoice};
    use proptest::prelude::*;

    fn coordinate() -> impl Strategy<Value = f32> {
        prop_oneof![
            -1.0f32..1.0,
            (-2i8..=2).prop_map(|c| f32::from(c) / 2.0),
            Just(-0.0),
            Just(1e-40)
        ]
    }

    fn point() -> impl Strategy<Value = [f32; 3]> {
        prop::array::uniform3(coordinate())
    }

    proptest! {
        #![proptest_config(crate::testing::cases(300))]

        /// On a grid of few coordinates, triangles share planes, edges and vertices, and rays run
        /// along planes and through vertices; `far` makes coordinates coarse.
        #[test]
        fn every_tree_finds_what_testing_all_triangles_finds(
            corners in prop::collection::vec(prop::array::uniform3(point()), 1..24),
            rays in prop::collection::vec((point(), point()), 20),
            far in prop_oneof![Just(0.0f32), Just(1e3), Just(-2.5e5)],
            origin_scale in prop_oneof![Just(1.0f32), Just(3.0), Just(1e6)],
            tolerant in any::<bool>(),
        ) {
            let move_away = |p: [f32; 3]| [p[0] + far, p[1], p[2] - far];
            let positions: Vec<_> = corners.iter().flatten().copied().map(move_away).collect();
            let triangles = (0..corners.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
            let mesh = Mesh::new(positions, triangles).unwrap();
            let ties = if tolerant { crate::Ties::Tolerant } else { crate::Ties::AsPublished };
            let params = BuildParams { ties, ..BuildParams::THESIS };
            let mut hits = Vec::new();
            for spec in TREES {
                let choice = TreeChoice::new(spec.name, None).unwrap();
                let binary = Tree::build(&mesh, choice, &params).unwrap();
                let wide = binary.clone().with_layout(crate::Layout::Wide).unwrap();
                let rays: Vec<Ray> = rays
                    .iter()
                    .map(|&(origin, target)| {
                        let origin = move_away(origin.map(|c| c * origin_scale));
                        let target = move_away(target);
                        Ray::new(origin, std::array::from_fn(|i| target[i] - origin[i]))
                    })
                    .collect();
                let nearest: Vec<_> = rays.iter().map(|ray| brute_force(&mesh, ray)).collect();
                let (mut together, mut any) = (vec![None; rays.len()], vec![false; rays.len()]);
                // Together, though they go anywhere; and each alone.
                for coherence in [Coherence::Coherent, Coherence::Incoherent] {
                    wide.closest_hits_as(coherence, &rays, &mut together);
                    prop_assert_eq!(&together, &nearest, "{} {:?}", choice, rays);
                    wide.any_hits_as(coherence, &rays, &mut any);
                    prop_assert!(any.iter().zip(&nearest).all(|(&any, hit)| any == hit.is_some()));
                }
                for (ray, nearest) in rays.into_iter().zip(nearest) {
                    let all = all_hits::test_all(&mesh, &ray);
                    // The second of all hits is the nearest without the first.
                    let others = |hit: &Hit| Some(hit.triangle) != all.first().map(|hit| hit.triangle);
                    for tree in [&binary, &wide] {
                        let found = tree.closest_hit(&ray, &mut ());
                        prop_assert_eq!(found, nearest, "{} {} {:?}", choice, tree.layout(), ray);
                        prop_assert_eq!(tree.any_hit(&ray, &mut ()), nearest.is_some());
                        tree.all_hits(&ray, &mut hits, &mut ());
                        prop_assert_eq!(&hits, &all, "{} {} {:?}", choice, tree.layout(), ray);
                        let second = tree.closest_hit_where(&ray, others, &mut ());
                        prop_assert_eq!(second, all.get(1).copied(), "{} {:?}", choice, ray);
                        prop_assert_eq!(tree.any_hit_where(&ray, others, &mut ()), second.is_some());
                    }
                }
            }
        }
    }
}
