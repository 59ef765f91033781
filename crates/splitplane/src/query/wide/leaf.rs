//! The triangles of a leaf, eight at a time.

use std::ops::ControlFlow;

use super::packet::Members;
use super::splats;
use crate::geometry::Ray;
use crate::geometry::triangle::{self, Shear, plane_is_beyond};
use crate::query::Hit;
use crate::query::simd::{Double, Eight, Lanes, Part};
use crate::query::traverse::{Search, Triangle};
use crate::tree::wide::{LEAF_ROWS, WIDTH, Wide};

/// What rounding may do to t in [`Depths`], in units of ε/2 times a bound of all
/// products.
///
/// With products of x and y up to P and z up to Z, an edge function is off by 4 P, the determinant
/// by 24 P and t times the determinant by 28 P Z, 30 after the comparison. The triangle test itself
/// rounds 1/z of the direction and t: a hit at a wanted t has t times the determinant within
/// 60 P · t of what is computed here.
const T_ERROR: f32 = 80.0 * 0.5 * f32::EPSILON;

/// What rounding, of the shear too, may do to t or the determinant at most, in units of ε/2 times
/// the scene's furthest point from the ray's origin, R, times the furthest coordinate across the
/// ray, M ≤ 2 R, and Z times that for t times the determinant.
///
/// Sheared coordinates are off by 6 R. So the edge functions are off by 24 R M and the determinant
/// by 72 R M, besides what `T_ERROR` says of P ≤ M² ≤ 2 R M; t times the determinant by
/// (72 + 60 + 12) R M Z, and the comparison with a t by (120 + 60) R M times that t. What
/// [`plane_is_beyond`](crate::geometry::triangle::plane_is_beyond) rounds in f64 is nothing beside.
const SURE_ERROR: f32 = 320.0 * 0.5 * f32::EPSILON;

/// No hit of a packet beyond this t is known before it is computed: products with an infinite one
/// are not numbers.
const FURTHEST: f32 = 1e15;

/// The triangles of a leaf, as in [`Wide::leaves`].
#[derive(Clone, Copy)]
struct Rows<'a> {
    /// Ten rows of `count`, and eight numbers more.
    values: &'a [u32],
    count: usize,
}

impl<'a> Rows<'a> {
    #[inline(always)]
    fn new(wide: &'a Wide, start: usize, count: usize) -> Self {
        let rows = LEAF_ROWS * start..LEAF_ROWS * (start + count) + WIDTH;
        debug_assert!(rows.end <= wide.leaves.len());
        Rows {
            // SAFETY: the links of a tree name triangles that are there, of each of which there are
            // ten numbers, and eight more at the end: `store` writes them so, and `check_wide`
            // refuses a tree from a file that is otherwise.
            values: unsafe { wide.leaves.get_unchecked(rows) },
            count,
        }
    }

    /// The coordinates of the corners along these axes, for all triangles: rows of an axis, one for
    /// each corner.
    #[inline(always)]
    fn along<L: Eight>(&self, [kx, ky, kz]: [usize; 3]) -> [[L; 3]; 3] {
        [self.row(kx), self.row(ky), self.row(kz)]
    }

    #[inline(always)]
    fn row<L: Eight>(&self, axis: usize) -> [L; 3] {
        let at = axis * self.count;
        debug_assert!(axis < 3 && at + 6 * self.count + WIDTH <= self.values.len());
        // SAFETY: corners and axes are below 3, and behind each of ten rows there are eight
        // numbers; all bits are some f32.
        unsafe {
            let first = self.values.as_ptr().add(at);
            [
                L::load(&*first.cast()),
                L::load(&*first.add(3 * self.count).cast()),
                L::load(&*first.add(6 * self.count).cast()),
            ]
        }
    }

    /// The same for one triangle.
    #[inline(always)]
    fn along_of(&self, [kx, ky, kz]: [usize; 3], slot: usize) -> [[f32; 3]; 3] {
        let corner = 3 * self.count;
        let [x, y, z] = [
            kx * self.count + slot,
            ky * self.count + slot,
            kz * self.count + slot,
        ];
        [
            self.three(x, corner),
            self.three(y, corner),
            self.three(z, corner),
        ]
    }

    #[inline(always)]
    fn corners(&self, slot: usize) -> [[f32; 3]; 3] {
        let axis = self.count;
        [
            self.three(slot, axis),
            self.three(slot + 3 * axis, axis),
            self.three(slot + 6 * axis, axis),
        ]
    }

    /// Three coordinates, from the first on by this step.
    #[inline(always)]
    fn three(&self, first: usize, step: usize) -> [f32; 3] {
        [
            f32::from_bits(self.value(first)),
            f32::from_bits(self.value(first + step)),
            f32::from_bits(self.value(first + 2 * step)),
        ]
    }

    /// The index in the mesh.
    #[inline(always)]
    fn triangle(&self, slot: usize) -> u32 {
        self.value((LEAF_ROWS - 1) * self.count + slot)
    }

    #[inline(always)]
    fn value(&self, at: usize) -> u32 {
        debug_assert!(at < LEAF_ROWS * self.count);
        // SAFETY: there are ten rows of `count`; axes are below 3 and slots below `count`.
        unsafe { *self.values.get_unchecked(at) }
    }
}

/// The rays' part of the triangle test, a ray for each lane.
#[derive(Clone, Copy)]
pub(super) struct Sight<L> {
    /// As in [`Shear`].
    pub(super) to_origin: [L; 3],
    pub(super) shear: [L; 2],
    pub(super) along: L,
}

impl<L: Lanes> Sight<L> {
    /// One ray for all lanes.
    #[inline(always)]
    fn splat(shear: &Shear) -> Self {
        let [sx, sy, _] = shear.shear;
        Sight {
            to_origin: splats(shear.to_origin),
            shear: [L::splat(sx), L::splat(sy)],
            along: L::splat(shear.along),
        }
    }
}

/// A ray and a triangle for each lane: the triangle, sheared.
struct Block<L> {
    /// Per corner.
    x: [L; 3],
    y: [L; 3],
    z: [L; 3],
    /// The edge functions, opposite to the corners.
    edges: [L; 3],
}

impl<L: Lanes> Block<L> {
    /// As [`Shear::apply`] and [`Shear::meet`] do, of the corners' coordinates along the axes of
    /// the shear.
    #[inline(always)]
    fn new(sight: &Sight<L>, [x, y, z]: [[L; 3]; 3]) -> Self {
        let [ox, oy, oz] = sight.to_origin;
        let [sx, sy] = sight.shear;
        let z = [z[0].add(oz), z[1].add(oz), z[2].add(oz)];
        let x = [
            x[0].add(ox).sub(sx.mul(z[0])),
            x[1].add(ox).sub(sx.mul(z[1])),
            x[2].add(ox).sub(sx.mul(z[2])),
        ];
        let y = [
            y[0].add(oy).sub(sy.mul(z[0])),
            y[1].add(oy).sub(sy.mul(z[1])),
            y[2].add(oy).sub(sy.mul(z[2])),
        ];
        let edges = [
            x[2].mul(y[1]).sub(y[2].mul(x[1])),
            x[0].mul(y[2]).sub(y[0].mul(x[2])),
            x[1].mul(y[0]).sub(y[1].mul(x[0])),
        ];
        Block { x, y, z, edges }
    }

    /// A bit for each triangle that [`Shear::meet`] does not refuse by the signs of the f32 edge
    /// functions.
    #[inline(always)]
    fn met(&self) -> u32 {
        let [u, v, w] = self.edges;
        let zero = L::splat(0.0);
        !(u.min(v).min(w).lt(zero) & zero.lt(u.max(v).max(w)))
    }

    /// A bit for each triangle of which the f32 edge functions are all positive or all negative.
    /// Those in f64 are so too.
    #[inline(always)]
    fn inside(&self) -> u32 {
        let [u, v, w] = self.edges;
        let zero = L::splat(0.0);
        zero.lt(u.min(v).min(w)) | u.max(v).max(w).lt(zero)
    }

    /// As [`Shear::meet_exactly`] does: a bit for each triangle that is met, and t, u and v there.
    #[inline(always)]
    fn exactly(&self, along: L) -> (u32, [L; 3]) {
        let inverse = L::splat(1.0).div(along).halves();
        let (met, [t, u, v]) = self.half_exactly(0, inverse);
        let (also_met, [more_t, more_u, more_v]) = self.half_exactly(1, inverse);
        (
            met | also_met << L::Double::COUNT,
            [
                L::of_halves([t, more_t]),
                L::of_halves([u, more_u]),
                L::of_halves([v, more_v]),
            ],
        )
    }

    #[inline(always)]
    fn half_exactly(&self, half: usize, inverse: [L::Double; 2]) -> (u32, [L::Double; 3]) {
        let (x, y, z) = (
            half_of(self.x, half),
            half_of(self.y, half),
            half_of(self.z, half),
        );
        let edges @ [u, v, w] = triangle::edges(x, y);
        let negative = u.negative() | v.negative() | w.negative();
        let positive = u.positive() | v.positive() | w.positive();
        let determinant = triangle::determinant(edges);
        let sure = determinant.negative() | determinant.positive();
        (
            sure & !(negative & positive),
            triangle::place(edges, determinant, z, inverse[half]),
        )
    }

    /// Where the ray meets the planes of the triangles.
    #[inline(always)]
    fn depths(&self, along: L) -> Depths<L> {
        let [u, v, w] = self.edges;
        let [az, bz, cz] = self.z;
        let determinant = u.add(v).add(w);
        let depth = w.mul_add(cz, v.mul_add(bz, u.mul(az)));
        let [x0, x1, x2] = self.x;
        let [y0, y1, y2] = self.y;
        let x = x0.abs().max(x1.abs()).max(x2.abs());
        let y = y0.abs().max(y1.abs()).max(y2.abs());
        Depths {
            depth: depth.times_sign(determinant).times_sign(along),
            size: determinant.abs(),
            // Numbers too small to be normal are off by as much, whatever their size.
            product: x.mul_add(y, L::splat(f32::MIN_POSITIVE)),
            across: x.max(y),
        }
    }
}

#[inline(always)]
fn half_of<L: Lanes>([a, b, c]: [L; 3], half: usize) -> [L::Double; 3] {
    [a.halves()[half], b.halves()[half], c.halves()[half]]
}

/// Where the ray meets the planes of the triangles of a leaf: at a t of `depth` over `size`, in
/// multiples of the direction's largest component.
struct Depths<L> {
    depth: L,
    size: L,
    /// A bound of the products that edge functions are made of.
    product: L,
    /// The largest coordinate across the ray.
    across: L,
}

impl<L: Lanes> Depths<L> {
    /// A bit for each triangle that is met, if at all, before the lowest t that is wanted, by more
    /// than rounding.
    #[inline(always)]
    fn before(&self, low: Limit<L>) -> u32 {
        let off = self.product.mul_add(low.error, L::splat(f32::MIN_POSITIVE));
        let depth = self.size.mul_add(low.minus_t, self.depth);
        self.sure() & depth.add(off).lt(L::splat(0.0))
    }

    /// A bit for each triangle that is met, if at all, beyond the highest t that is wanted, by more
    /// than rounding.
    #[inline(always)]
    fn beyond(&self, high: Limit<L>) -> u32 {
        let off = self
            .product
            .mul_add(high.error, L::splat(f32::MIN_POSITIVE));
        let depth = self.size.mul_add(high.minus_t, self.depth);
        self.sure() & off.lt(depth)
    }

    /// A bit for each triangle that is met beyond the lowest t that is wanted, whatever rounding
    /// does, if it is met inside.
    #[inline(always)]
    fn surely_after(&self, low: Limit<L>, reach: f32) -> u32 {
        let tiny = L::splat(f32::MIN_POSITIVE);
        let unit = self.across.mul(L::splat(SURE_ERROR * reach));
        let off = unit.mul_add(L::splat(reach).add(low.minus_t.abs()), tiny);
        unit.add(tiny).lt(self.size) & off.lt(self.size.mul_add(low.minus_t, self.depth))
    }

    /// A bit for each triangle of which the sign of the determinant is known that is met before the
    /// highest t that is wanted, a finite one, whatever rounding does, if it is met inside.
    #[inline(always)]
    fn surely_before(&self, high: Limit<L>, reach: f32) -> u32 {
        let tiny = L::splat(f32::MIN_POSITIVE);
        let unit = self.across.mul(L::splat(SURE_ERROR * reach));
        let off = unit.mul_add(L::splat(reach).add(high.minus_t.abs()), tiny);
        let depth = self.size.mul_add(high.minus_t, self.depth);
        depth.add(off).lt(L::splat(0.0))
    }

    /// Whether the sign of the determinant is known.
    #[inline(always)]
    fn sure(&self) -> u32 {
        self.product.mul(L::splat(T_ERROR)).lt(self.size)
    }
}

impl<L: Eight> Depths<L> {
    /// Of these triangles, the one that is probably met first.
    #[inline(always)]
    fn first(&self, mut candidates: u32) -> usize {
        let (depths, sizes) = (self.depth.to_array(), self.size.to_array());
        let mut first = candidates.trailing_zeros() as usize;
        candidates &= candidates - 1;
        while candidates != 0 {
            let other = candidates.trailing_zeros() as usize;
            candidates &= candidates - 1;
            if depths[other] * sizes[first] < depths[first] * sizes[other] {
                first = other;
            }
        }
        first
    }
}

/// A limit of t in multiples of the direction's largest component, and what rounding may do to it
/// over the bound of a triangle's products.
#[derive(Clone, Copy)]
struct Limit<L> {
    minus_t: L,
    error: L,
}

impl<L: Lanes> Limit<L> {
    /// The same for all lanes; in one number each, which takes fewer instructions than eight.
    #[inline(always)]
    fn splat(t: f32, shear: &Shear, reach: f32) -> Self {
        let t = t * shear.along.abs();
        Limit {
            minus_t: L::splat(-t),
            error: L::splat(T_ERROR * (reach + t.abs() + f32::MIN_POSITIVE)),
        }
    }

    #[inline(always)]
    fn new(t: L, along: L, reach: f32) -> Self {
        let minus_t = t.mul(L::splat(0.0).sub(along.abs()));
        let reach = L::splat(reach + f32::MIN_POSITIVE);
        Limit {
            minus_t,
            error: reach.add(minus_t.abs()).mul(L::splat(T_ERROR)),
        }
    }
}

/// A triangle of a leaf, by its place there, that the f32 edge functions do not refuse.
struct InLeaf<'a> {
    slot: usize,
    rows: Rows<'a>,
    is_surely_beyond: bool,
}

impl Triangle for InLeaf<'_> {
    #[inline(always)]
    fn index(&self) -> u32 {
        self.rows.triangle(self.slot)
    }

    #[inline(always)]
    fn corners(&self) -> [[f32; 3]; 3] {
        self.rows.corners(self.slot)
    }

    #[inline(always)]
    fn meet(&self, shear: &Shear) -> Option<Hit> {
        shear.meet_exactly(self.rows.along_of(shear.axes, self.slot), self.index())
    }

    #[inline(always)]
    fn is_surely_beyond(&self) -> bool {
        self.is_surely_beyond
    }
}

/// Asks a search about the triangles of a leaf that the ray may hit beyond `t_min`; `reach` as in
/// [`super::line::Line`]. True where the search has been asked about any.
#[inline(always)]
pub(super) fn visit<L: Eight, S: Search>(
    wide: &Wide,
    (start, count): (usize, usize),
    (t_min, reach): (f32, f32),
    search: &mut S,
) -> ControlFlow<(), bool> {
    let rows = Rows::new(wide, start, count);
    let in_leaf = |slot: usize, beyond: u32| InLeaf {
        slot,
        rows,
        is_surely_beyond: beyond >> slot & 1 == 1,
    };
    let t_max = search.limit_above();
    let Some(shear) = search.shear() else {
        for slot in 0..count {
            search.test(&in_leaf(slot, 0))?;
        }
        return ControlFlow::Continue(true);
    };
    let sight = Sight::<L>::splat(shear);
    let block = Block::new(&sight, rows.along(shear.axes));
    let mut candidates = block.met() & ((1 << count) - 1);
    if candidates == 0 {
        return ControlFlow::Continue(false);
    }
    let depths = block.depths(sight.along);
    let (low, high) = (
        Limit::splat(t_min, shear, reach),
        Limit::splat(t_max, shear, reach),
    );
    if S::NEEDS_NO_HIT {
        let mut found = candidates & block.inside() & depths.surely_after(low, reach);
        if t_max != f32::INFINITY {
            found &= depths.surely_before(high, reach);
        }
        if found != 0 {
            search.found_without_hit();
            return ControlFlow::Break(());
        }
    }
    candidates &= !(depths.before(low) | depths.beyond(high));
    if candidates == 0 {
        return ControlFlow::Continue(false);
    }
    let after = depths.surely_after(low, reach);
    loop {
        let slot = match S::NEAREST_FIRST {
            true => depths.first(candidates),
            false => candidates.trailing_zeros() as usize,
        };
        search.test(&in_leaf(slot, after))?;
        candidates &= !(1 << slot);
        if candidates == 0 {
            return ControlFlow::Continue(true);
        }
        let t_max = search.limit_above();
        if let Some(shear) = search.shear() {
            candidates &= !depths.beyond(Limit::splat(t_max, shear, reach));
        }
        if candidates == 0 {
            return ControlFlow::Continue(true);
        }
    }
}

/// Tests the triangles of a leaf that rays of a packet may hit: those of a bit in `active`, for each
/// part, which all go furthest along the same axis.
#[inline(always)]
pub(super) fn visit_together<P: Part, S: Search>(
    wide: &Wide,
    (start, count): (usize, usize),
    axes: [usize; 3],
    (group, reach): (&mut [Members<P>], f32),
    rays: &[Ray],
    active: &mut [u32],
) {
    let rows = Rows::new(wide, start, count);
    for slot in 0..count {
        let [x, y, z] = rows.along_of(axes, slot);
        let corners = [splats(x), splats(y), splats(z)];
        for (part, (members, active)) in group.iter_mut().zip(&mut *active).enumerate() {
            if *active == 0 {
                continue;
            }
            let block = Block::new(&members.sight, corners);
            let mut candidates = block.met() & *active;
            if candidates == 0 {
                continue;
            }
            let along = members.sight.along;
            let depths = block.depths(along);
            let low = Limit::new(members.t_min, along, reach);
            let high = Limit::new(members.limit, along, reach);
            if S::NEEDS_NO_HIT {
                let near = Limit::new(members.limit.min(P::splat(FURTHEST)), along, reach);
                let found = candidates
                    & block.inside()
                    & depths.surely_after(low, reach)
                    & depths.surely_before(near, reach);
                members.stop(found);
                candidates &= !found;
                *active &= !found;
            }
            candidates &= !(depths.before(low) | depths.beyond(high));
            if candidates == 0 {
                continue;
            }
            let (met, [t, u, v]) = block.exactly(along);
            let triangle = P::splat(f32::from_bits(rows.triangle(slot)));
            let mut hit = candidates & met & members.t_min.lt(t);
            hit &= match S::NEAREST_FIRST {
                true => members.prefer(t, triangle),
                false => t.le(members.limit),
            };
            let mut open = hit & !depths.surely_after(low, reach);
            while open != 0 {
                let lane = open.trailing_zeros();
                open &= open - 1;
                let ray = &rays[P::COUNT * part + lane as usize];
                if !plane_is_beyond(ray, &rows.corners(slot)) {
                    hit &= !(1 << lane);
                }
            }
            if S::NEAREST_FIRST {
                members.take(hit, [t, u, v], triangle);
            } else {
                members.stop(hit);
                *active &= !hit;
            }
        }
    }
}
