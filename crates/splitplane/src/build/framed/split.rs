//! The best way to divide a node of the tree `framed`.

use super::bins::{BINNED_FROM, BINS, Bins, Row};
use super::{Bounds, LEAF_COST, NODE_COST, Reference, cost_of};
use crate::tree::wide::WIDTH;

/// Boxes of children may overlap by this share of their parent's area.
const MAX_OVERLAP: f32 = 0.5;

/// What the area that boxes of children share costs, on top of what it costs as part of both: rays
/// that pass it visit both children. A small one prefers, of two divisions that are much the same,
/// the one that keeps them apart; a larger one cuts many triangles for it.
const OVERLAP_COST: f32 = 0.02;

/// Nodes of so many references are large.
const LARGE_FROM: usize = 256;

/// Planes are looked for in large nodes only where the children of the best centres overlap along
/// their axis by more than this, in units of the edge of a square as large as half the node's area:
/// where triangles are small beside their node, cutting them gains nothing.
const PLANES_FROM: f32 = 0.02;

/// How to divide a node.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Split {
    /// By a plane across an axis. References that lie in it go where `flat_below` says.
    Plane {
        axis: usize,
        at: f32,
        flat_below: bool,
    },
    /// By the centres of the references (twice the centre is compared with `at`).
    Centers { axis: usize, at: f32 },
    /// In two halves.
    Even,
}

/// Buffers of one thread.
#[derive(Default)]
pub(super) struct Scratch {
    events: Events,
    suffix: Vec<Bounds>,
    bins: Bins,
    /// How many ways were priced.
    pub(super) candidates: u64,
}

/// Where references start and end along an axis, or only their centres, as starts.
#[derive(Default)]
struct Events {
    starts: Vec<u64>,
    ends: Vec<u64>,
}

/// A number as one that is ordered like it, then a bit, then an index.
fn key(value: f32, bit: bool, index: usize) -> u64 {
    // Adding 0 makes -0 and 0 the same.
    let bits = (value + 0.0).to_bits();
    let ordered = bits ^ if bits >> 31 == 1 { !0 } else { 1 << 31 };
    u64::from(ordered) << 32 | u64::from(bit) << 31 | index as u64
}

fn value(key: u64) -> f32 {
    let ordered = (key >> 32) as u32;
    f32::from_bits(ordered ^ if ordered >> 31 == 1 { 1 << 31 } else { !0 })
}

fn index(key: u64) -> usize {
    (key & 0x7fff_ffff) as usize
}

/// The best division of a node; `None` where it is to be a leaf. `cuts` references may be cut.
pub(super) fn find(
    references: &[Reference],
    bounds: &Bounds,
    cuts: usize,
    scratch: &mut Scratch,
) -> Option<Split> {
    let mut search = Search::new(references, bounds.half_area(), cuts);
    match references.len() {
        0..2 => {}
        2..BINNED_FROM => search.all(scratch),
        BINNED_FROM..LARGE_FROM => search.by_bins(bounds, None, scratch),
        _ => search.by_bins(bounds, Some(PLANES_FROM), scratch),
    }
    scratch.candidates += search.candidates;
    let is_leaf = references.len() <= WIDTH;
    search.best.or((!is_leaf).then_some(Split::Even))
}

/// What is priced: each way to divide by, across an axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Way {
    pub(super) axis: usize,
    pub(super) is_plane: bool,
}

/// Those across each axis.
pub(super) fn ways(is_plane: bool) -> impl Iterator<Item = Way> {
    (0..3).map(move |axis| Way { axis, is_plane })
}

/// What lies on a side of a division.
#[derive(Clone, Copy, Debug)]
pub(super) struct Side {
    pub(super) bounds: Bounds,
    pub(super) count: usize,
}

impl Side {
    pub(super) const EMPTY: Side = Side {
        bounds: Bounds::EMPTY,
        count: 0,
    };

    #[inline(always)]
    pub(super) fn add(&mut self, reference: &Reference) {
        self.bounds = self.bounds.union(reference.min, reference.max);
        self.count += 1;
    }

    #[inline(always)]
    pub(super) fn union(&self, other: &Side) -> Side {
        Side {
            bounds: self.bounds.union(other.bounds.min, other.bounds.max),
            count: self.count + other.count,
        }
    }
}

pub(super) struct Search<'a> {
    pub(super) references: &'a [Reference],
    /// Half the surface area of the node.
    area: f32,
    /// How many references may be cut.
    cuts: usize,
    best: Option<Split>,
    /// By how much the boxes of the best centres' children overlap along the axis.
    overlap: f32,
    cost: f32,
    candidates: u64,
}

impl<'a> Search<'a> {
    fn new(references: &'a [Reference], area: f32, cuts: usize) -> Self {
        Search {
            references,
            area,
            cuts,
            best: None,
            overlap: f32::INFINITY,
            cost: match references.len() <= WIDTH {
                true => LEAF_COST * cost_of(references.len()) * area,
                false => f32::INFINITY,
            },
            candidates: 0,
        }
    }

    fn ways(&self) -> impl Iterator<Item = Way> + use<> {
        let kinds = if self.cuts > 0 { 2 } else { 1 };
        [false, true].into_iter().take(kinds).flat_map(ways)
    }

    /// What a division costs that has no less than this on either side, and shares so much of half
    /// the area of both boxes.
    #[inline(always)]
    pub(super) fn price(&self, below: &Side, above: &Side, shared: f32) -> f32 {
        let extra = OVERLAP_COST * shared;
        let side = |side: &Side| (side.bounds.half_area() + extra) * cost_of(side.count);
        NODE_COST * self.area + LEAF_COST * (side(below) + side(above))
    }

    /// Prices every division.
    fn all(&mut self, scratch: &mut Scratch) {
        for way in self.ways() {
            self.collect(way, |_| true, &mut scratch.events);
            let Events { starts, ends } = &scratch.events;
            self.sweep(way, (starts, ends), &[Side::EMPTY; 2], &mut scratch.suffix);
        }
    }

    /// Finds the same by pricing only the divisions of bins that may hold the best one; but planes
    /// only where children would overlap by so much without them, if anything is said.
    fn by_bins(&mut self, bounds: &Bounds, planes_from: Option<f32>, scratch: &mut Scratch) {
        let mut bins = std::mem::take(&mut scratch.bins);
        let rows = bins.fill(self, bounds, false);
        // The most promising bin rules most of the others out.
        let promising = (rows.iter().enumerate())
            .flat_map(|(at, row)| (0..BINS).map(move |bin| (at, bin, row.at_least[bin])))
            .min_by(|a, b| a.2.total_cmp(&b.2));
        if let Some((first, best, _)) = promising {
            self.refine(&rows[first], |bin| bin == best, scratch);
            for (at, row) in rows.iter().enumerate() {
                let cost = self.cost;
                let wanted = |bin| row.at_least[bin] < cost && (at, bin) != (first, best);
                self.refine(row, wanted, scratch);
            }
        }
        let overlaps = |from| self.overlap > from * self.area.sqrt();
        if self.cuts > 0 && planes_from.is_none_or(overlaps) {
            for row in bins.fill(self, bounds, true) {
                let cost = self.cost;
                self.refine(row, |bin| row.at_least[bin] < cost, scratch);
            }
        }
        scratch.bins = bins;
    }

    /// Prices the divisions of these bins.
    fn refine(&mut self, row: &Row, wanted: impl Fn(usize) -> bool, scratch: &mut Scratch) {
        let wanted: [bool; BINS] = std::array::from_fn(wanted);
        if !wanted.contains(&true) {
            return;
        }
        let bin = |value| row.scale.bin(value);
        self.collect(row.way, |value| wanted[bin(value)], &mut scratch.events);
        let Events { starts, ends } = &scratch.events;
        let (mut starts, mut ends) = (&starts[..], &ends[..]);
        for at in (0..BINS).filter(|&at| wanted[at]) {
            let split = |keys: &[u64]| keys.partition_point(|&key| bin(value(key)) <= at);
            let (s, e) = (split(starts), split(ends));
            let here = (&starts[..s], &ends[..e]);
            self.sweep(row.way, here, &row.around[at], &mut scratch.suffix);
            (starts, ends) = (&starts[s..], &ends[e..]);
        }
    }

    /// Where references start and end, in order, of those values that are wanted.
    fn collect(&self, way: Way, wanted: impl Fn(f32) -> bool, events: &mut Events) {
        let Events { starts, ends } = events;
        starts.clear();
        ends.clear();
        let axis = way.axis;
        for (i, r) in self.references.iter().enumerate() {
            if !way.is_plane {
                let center = r.center()[axis];
                if wanted(center) {
                    starts.push(key(center, false, i));
                }
                continue;
            }
            let (min, max) = (r.min[axis], r.max[axis]);
            let is_flat = min == max;
            // What lies in a plane is the first to start there and the last to end there.
            if wanted(min) {
                starts.push(key(min, !is_flat, i));
            }
            if wanted(max) {
                ends.push(key(max, is_flat, i));
            }
        }
        starts.sort_unstable();
        ends.sort_unstable();
    }

    /// Prices the divisions at these starts and ends; beside them lies what is `around`, below and
    /// above.
    fn sweep(
        &mut self,
        way: Way,
        (starts, ends): (&[u64], &[u64]),
        around: &[Side; 2],
        suffix: &mut Vec<Bounds>,
    ) {
        match way.is_plane {
            true => self.planes(way.axis, (starts, ends), around, suffix),
            false => self.centers(way.axis, starts, around, suffix),
        }
    }

    /// True where it is the best so far.
    #[inline(always)]
    fn enter(&mut self, split: Split, below: &Side, above: &Side, shared: f32) -> bool {
        let cost = self.price(below, above, shared);
        self.candidates += 1;
        let is_best = cost < self.cost;
        if is_best {
            (self.cost, self.best) = (cost, Some(split));
        }
        is_best
    }

    fn centers(
        &mut self,
        axis: usize,
        centers: &[u64],
        [below, above]: &[Side; 2],
        suffix: &mut Vec<Bounds>,
    ) {
        self.suffixes(centers, above, suffix);
        let mut below = *below;
        let n = self.references.len();
        let mut last = None;
        for (i, &center) in centers.iter().enumerate() {
            // What has the same centre stays together.
            if last != Some(center >> 32) && below.count > 0 {
                let above = Side {
                    bounds: suffix[i],
                    count: n - below.count,
                };
                let overlap = Bounds {
                    min: below.bounds.min.max(above.bounds.min),
                    max: below.bounds.max.min(above.bounds.max),
                };
                let shared = match overlap.min.cmple(overlap.max).all() {
                    true => overlap.half_area(),
                    false => 0.0,
                };
                if shared <= MAX_OVERLAP * self.area {
                    let at = value(center);
                    if self.enter(Split::Centers { axis, at }, &below, &above, shared) {
                        self.overlap = overlap.max[axis] - overlap.min[axis];
                    }
                }
            }
            last = Some(center >> 32);
            below.add(&self.references[index(center)]);
        }
    }

    /// Planes through the ends and starts of references: those that lie in a plane are below it in
    /// the one case, above it in the other.
    fn planes(
        &mut self,
        axis: usize,
        (starts, ends): (&[u64], &[u64]),
        [below, above]: &[Side; 2],
        suffix: &mut Vec<Bounds>,
    ) {
        self.suffixes(ends, above, suffix);
        let references = self.references;
        let n = references.len();
        let is_flat = |i: usize| references[i].min[axis] == references[i].max[axis];
        let (mut started, mut ended) = (0, 0);
        let mut below = *below;
        // At each offset in turn, first with what lies there above, then below.
        loop {
            let next = |keys: &[u64], at: usize| keys.get(at).map(|key| key >> 32);
            let (start, end) = (next(starts, started), next(ends, ended));
            let Some(height) = start.into_iter().chain(end).min() else {
                return;
            };
            let at = value(height << 32);
            let mut price = |below: &Side, ended: usize, flat_below: bool| {
                let (nb, na) = (below.count, above.count + ends.len() - ended);
                if nb == 0 || na == 0 || nb == n || na == n || nb + na - n > self.cuts {
                    return;
                }
                let mut below = *below;
                let mut above = Side {
                    bounds: suffix[ended],
                    count: na,
                };
                below.bounds.max[axis] = below.bounds.max[axis].min(at);
                above.bounds.min[axis] = above.bounds.min[axis].max(at);
                let split = Split::Plane {
                    axis,
                    at,
                    flat_below,
                };
                self.enter(split, &below, &above, 0.0);
            };
            // What ends here without lying here is not above.
            while next(ends, ended) == Some(height) && !is_flat(index(ends[ended])) {
                ended += 1;
            }
            price(&below, ended, false);
            let flat_from = started;
            while next(starts, started) == Some(height) && is_flat(index(starts[started])) {
                below.add(&references[index(starts[started])]);
                started += 1;
            }
            ended += started - flat_from;
            if started > flat_from {
                price(&below, ended, true);
            }
            while next(starts, started) == Some(height) {
                below.add(&references[index(starts[started])]);
                started += 1;
            }
        }
    }

    /// For each place in an order, the box of all references from there on, and what lies above.
    fn suffixes(&self, order: &[u64], above: &Side, suffix: &mut Vec<Bounds>) {
        suffix.clear();
        suffix.resize(order.len() + 1, above.bounds);
        let mut all = above.bounds;
        for (i, &key) in order.iter().enumerate().rev() {
            let reference = &self.references[index(key)];
            all = all.union(reference.min, reference.max);
            suffix[i] = all;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3A;
    use proptest::prelude::*;

    fn reference() -> impl Strategy<Value = Reference> {
        // Few coordinates, so that many are the same, or any.
        let number = prop_oneof![(-8i8..8).prop_map(f32::from), -9.0f32..9.0];
        let size = prop_oneof![Just(0.0f32), Just(1.0), 0.0f32..4.0];
        (prop::array::uniform3(number), prop::array::uniform3(size)).prop_map(|(min, size)| {
            let min = Vec3A::from(min);
            Reference {
                min,
                max: min + Vec3A::from(size),
                triangle: 0,
                piece: super::super::NONE,
            }
        })
    }

    proptest! {
        #![proptest_config(crate::testing::cases(300))]

        /// The bins rule out no division that is better than the one that is found.
        #[test]
        fn bins_find_what_all_divisions_have(
            references in prop::collection::vec(reference(), 2..300),
            cuts in prop_oneof![Just(0usize), 0usize..20, Just(1000)],
        ) {
            let mut scratch = Scratch::default();
            // As many as there are, and then a part of them, with fewer bins.
            for references in [&references[..], &references[references.len() / 2..]] {
                let bounds = Bounds::of(references);
                let mut found = |by_bins: bool| {
                    let mut search = Search::new(references, bounds.half_area(), cuts);
                    match by_bins {
                        true => search.by_bins(&bounds, None, &mut scratch),
                        false => search.all(&mut scratch),
                    }
                    (search.cost, search.best.is_some())
                };
                prop_assert_eq!(found(true), found(false));
            }
        }
    }

    #[test]
    fn bins_price_a_small_part_of_all_divisions() {
        let references: Vec<Reference> = (0..20_000u32)
            .map(|i| {
                let at = |k: u32| (i.wrapping_mul(k) >> 12) as f32;
                let min = Vec3A::new(at(2_654_435_761), at(40_503), at(2_246_822_519));
                Reference {
                    min,
                    max: min + Vec3A::splat(1000.0),
                    triangle: i,
                    piece: super::super::NONE,
                }
            })
            .collect();
        let bounds = Bounds::of(&references);
        let priced = |by_bins: bool| {
            let mut search = Search::new(&references, bounds.half_area(), usize::MAX);
            match by_bins {
                true => search.by_bins(&bounds, None, &mut Scratch::default()),
                false => search.all(&mut Scratch::default()),
            }
            (search.candidates, search.best)
        };
        let ((some, found), (all, best)) = (priced(true), priced(false));
        assert_eq!(found, best);
        assert!(some * 4 < all, "{some} of {all}");
    }
}
