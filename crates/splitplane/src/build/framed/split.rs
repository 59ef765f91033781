//! The best way to divide a node of the tree `framed`.

use glam::Vec3A;

use super::{Bounds, LEAF_COST, NODE_COST, Reference, blocks};
use crate::tree::wide::WIDTH;

/// Boxes of children may overlap by this share of their parent's area.
const MAX_OVERLAP: f32 = 0.5;

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
    starts: Vec<u64>,
    ends: Vec<u64>,
    suffix: Vec<Bounds>,
    /// How many ways were priced.
    pub(super) candidates: u64,
}

/// A number as one that is ordered like it, then a bit, then an index.
fn key(value: f32, bit: bool, index: usize) -> u64 {
    // Adding 0 makes -0 and 0 the same.
    let bits = (value + 0.0).to_bits();
    let ordered = bits ^ if bits >> 31 == 1 { !0 } else { 1 << 31 };
    u64::from(ordered) << 32 | u64::from(bit) << 31 | index as u64
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
    let n = references.len();
    let area = bounds.half_area();
    let mut search = Search {
        area,
        best: None,
        cost: match n <= WIDTH {
            true => LEAF_COST * area,
            false => f32::INFINITY,
        },
        candidates: 0,
    };
    if n > 1 {
        for axis in 0..3 {
            search.centers(references, axis, scratch);
            if cuts > 0 {
                search.planes(references, axis, cuts, scratch);
            }
        }
    }
    scratch.candidates += search.candidates;
    let is_leaf = n <= WIDTH;
    search.best.or((!is_leaf).then_some(Split::Even))
}

struct Search {
    area: f32,
    best: Option<Split>,
    cost: f32,
    candidates: u64,
}

impl Search {
    #[inline(always)]
    fn enter(&mut self, split: Split, below: (f32, usize), above: (f32, usize)) {
        let cost = NODE_COST * self.area
            + LEAF_COST * (below.0 * blocks(below.1) + above.0 * blocks(above.1));
        self.candidates += 1;
        if cost < self.cost {
            (self.cost, self.best) = (cost, Some(split));
        }
    }

    fn centers(&mut self, references: &[Reference], axis: usize, scratch: &mut Scratch) {
        let Scratch { starts, suffix, .. } = scratch;
        let n = references.len();
        starts.clear();
        starts
            .extend((references.iter().enumerate()).map(|(i, r)| key(r.center()[axis], false, i)));
        starts.sort_unstable();
        suffixes(references, starts, suffix);
        let mut below = Bounds::EMPTY;
        for i in 1..n {
            let last = &references[index(starts[i - 1])];
            below = below.union(last.min, last.max);
            if starts[i] >> 32 == starts[i - 1] >> 32 {
                continue;
            }
            let above = suffix[i];
            let overlap = Bounds {
                min: below.min.max(above.min),
                max: below.max.min(above.max),
            };
            let overlaps = overlap.min.cmple(overlap.max).all();
            if overlaps && overlap.half_area() > MAX_OVERLAP * self.area {
                continue;
            }
            let at = references[index(starts[i])].center()[axis];
            self.enter(
                Split::Centers { axis, at },
                (below.half_area(), i),
                (above.half_area(), n - i),
            );
        }
    }

    /// Planes through the ends and starts of references: those that lie in a plane are below it in
    /// the one case, above it in the other.
    fn planes(
        &mut self,
        references: &[Reference],
        axis: usize,
        cuts: usize,
        scratch: &mut Scratch,
    ) {
        let Scratch {
            starts,
            ends,
            suffix,
            ..
        } = scratch;
        let n = references.len();
        starts.clear();
        ends.clear();
        for (i, r) in references.iter().enumerate() {
            let (min, max) = (r.min[axis], r.max[axis]);
            let is_flat = min == max;
            // What lies in a plane is the first to start there and the last to end there.
            starts.push(key(min, !is_flat, i));
            ends.push(key(max, is_flat, i));
        }
        starts.sort_unstable();
        ends.sort_unstable();
        suffixes(references, ends, suffix);
        let is_flat = |i: usize| references[i].min[axis] == references[i].max[axis];
        let (mut started, mut ended) = (0, 0);
        let mut below = Bounds::EMPTY;
        // At each offset in turn, first with what lies there above, then below.
        while started < n || ended < n {
            let next = |keys: &[u64], at: usize| keys.get(at).map(|key| key >> 32);
            let (start, end) = (next(starts, started), next(ends, ended));
            let Some(height) = start.into_iter().chain(end).min() else {
                return;
            };
            let at = match start == Some(height) {
                true => references[index(starts[started])].min[axis],
                false => references[index(ends[ended])].max[axis],
            };
            let mut price = |started: usize, ended: usize, below: &Bounds, flat_below: bool| {
                let (nb, na) = (started, n - ended);
                if nb == 0 || na == 0 || nb == n || na == n || nb + na - n > cuts {
                    return;
                }
                let (mut below, mut above) = (*below, suffix[ended]);
                below.max[axis] = below.max[axis].min(at);
                above.min[axis] = above.min[axis].max(at);
                let split = Split::Plane {
                    axis,
                    at,
                    flat_below,
                };
                self.enter(split, (below.half_area(), nb), (above.half_area(), na));
            };
            // What ends here without lying here is not above.
            while next(ends, ended) == Some(height) && !is_flat(index(ends[ended])) {
                ended += 1;
            }
            price(started, ended, &below, false);
            let flat_from = started;
            while next(starts, started) == Some(height) && is_flat(index(starts[started])) {
                let flat = &references[index(starts[started])];
                below = below.union(flat.min, flat.max);
                started += 1;
            }
            ended += started - flat_from;
            if started > flat_from {
                price(started, ended, &below, true);
            }
            while next(starts, started) == Some(height) {
                let starting = &references[index(starts[started])];
                below = below.union(starting.min, starting.max);
                started += 1;
            }
        }
    }
}

/// For each place in an order, the box of all references from there on.
fn suffixes(references: &[Reference], order: &[u64], suffix: &mut Vec<Bounds>) {
    suffix.clear();
    suffix.resize(order.len() + 1, Bounds::EMPTY);
    let mut all = Bounds {
        min: Vec3A::INFINITY,
        max: Vec3A::NEG_INFINITY,
    };
    for (i, &key) in order.iter().enumerate().rev() {
        let reference = &references[index(key)];
        all = all.union(reference.min, reference.max);
        suffix[i] = all;
    }
}
