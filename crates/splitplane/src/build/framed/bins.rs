//! A node's references in bins, and what a division within a bin costs at least.
//!
//! Sides only grow as a division moves towards them. So no division in a bin costs less than one
//! that has all below the bin on the one side and all above it on the other, and where that is no
//! less than a cost that has been found, its references need not be sorted.

use super::Bounds;
use super::split::{Search, Side, Way};
use crate::geometry::frame::{round_down, round_up};

/// Nodes of so many references are searched by bins.
pub(super) const BINNED_FROM: usize = 512;

pub(super) const BINS: usize = 64;

/// Which bin a value is in: one that does not fall as values grow.
#[derive(Clone, Copy, Debug)]
pub(super) struct Scale {
    low: f32,
    /// Bins a unit; infinite where there is no room for several.
    density: f32,
}

impl Scale {
    fn new(low: f32, high: f32) -> Self {
        Scale {
            low,
            density: BINS as f32 / (high - low),
        }
    }

    #[inline(always)]
    pub(super) fn bin(&self, value: f32) -> usize {
        // What is not a number becomes 0.
        (((value - self.low) * self.density) as usize).min(BINS - 1)
    }

    /// No value of the bin lies outside of these two.
    fn range(&self, bin: usize) -> (f32, f32) {
        // Beyond what the difference and the product are rounded by.
        let at = |bin: usize, off: f64| {
            f64::from(self.low) + bin as f64 / f64::from(self.density) * (1.0 + off)
        };
        let high = match bin == BINS - 1 {
            true => f32::INFINITY,
            false => round_up(at(bin + 1, 1e-6)),
        };
        (round_down(at(bin, -1e-6)), high)
    }
}

/// The bins of a way to divide.
pub(super) struct Row {
    pub(super) way: Way,
    pub(super) scale: Scale,
    /// What a division in each bin costs at least; infinite where there is none.
    pub(super) at_least: [f32; BINS],
    /// What lies below and above each bin.
    pub(super) around: [[Side; 2]; BINS],
}

#[derive(Default)]
pub(super) struct Bins {
    pub(super) rows: Vec<Row>,
}

impl Bins {
    /// Puts the references of a node with these bounds into bins.
    pub(super) fn fill(&mut self, search: &Search, bounds: &Bounds) {
        self.rows.clear();
        self.rows.extend(search.ways().map(|way| {
            let (low, high) = (bounds.min[way.axis], bounds.max[way.axis]);
            match way.is_plane {
                true => Row::new(search, way, Scale::new(low, high)),
                false => Row::new(search, way, Scale::new(2.0 * low, 2.0 * high)),
            }
        }));
    }
}

impl Row {
    fn new(search: &Search, way: Way, scale: Scale) -> Self {
        let Way { axis, is_plane } = way;
        // What starts in a bin is below all that follow; what ends there is above all before.
        let mut starts = [Side::EMPTY; BINS];
        let mut ends = [Side::EMPTY; BINS];
        match is_plane {
            true => {
                for r in search.references {
                    starts[scale.bin(r.min[axis])].add(r);
                    ends[scale.bin(r.max[axis])].add(r);
                }
            }
            false => {
                for r in search.references {
                    starts[scale.bin(r.center()[axis])].add(r);
                }
                ends = starts;
            }
        }
        let mut around = [[Side::EMPTY; 2]; BINS];
        let (mut below, mut above) = (Side::EMPTY, Side::EMPTY);
        for bin in 0..BINS {
            around[bin][0] = below;
            below = below.union(&starts[bin]);
        }
        for bin in (0..BINS).rev() {
            around[bin][1] = above;
            above = above.union(&ends[bin]);
        }
        let at_least = std::array::from_fn(|bin| {
            if starts[bin].count + ends[bin].count == 0 {
                return f32::INFINITY;
            }
            let [mut below, mut above] = around[bin];
            if is_plane {
                let (low, high) = scale.range(bin);
                below.bounds.max[axis] = below.bounds.max[axis].min(low);
                above.bounds.min[axis] = above.bounds.min[axis].max(high);
            }
            search.price(&below, &above)
        });
        Row {
            way,
            scale,
            at_least,
            around,
        }
    }
}
