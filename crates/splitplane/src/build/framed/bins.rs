//! A node's references in bins, and what a division within a bin costs at least.
//!
//! As a division moves up, what lies below it only grows and what lies above only shrinks. So no
//! division in a bin costs less than one that has what lies below the bin on the one side and what
//! lies above it on the other; where that is no less than a cost that has been found, the bin's
//! references need not be sorted.

use super::Bounds;
use super::split::{Search, Side, Way, ways};
use crate::geometry::frame::{round_down, round_up};

/// Nodes of so many references are searched by bins.
pub(super) const BINNED_FROM: usize = 48;

/// Bins along an axis, at most.
pub(super) const BINS: usize = 64;

/// How many bins pay for so many references.
fn bins_for(references: usize) -> usize {
    (references / 4).clamp(8, BINS)
}

/// Which bin a value is in: one that does not fall as values grow.
#[derive(Clone, Copy, Debug)]
pub(super) struct Scale {
    low: f32,
    /// Bins a unit; infinite where there is no room for several.
    density: f32,
    /// How many bins there are.
    bins: usize,
}

impl Scale {
    fn new(low: f32, high: f32, bins: usize) -> Self {
        Scale {
            low,
            density: bins as f32 / (high - low),
            bins,
        }
    }

    #[inline(always)]
    pub(super) fn bin(&self, value: f32) -> usize {
        // What is not a number becomes 0.
        (((value - self.low) * self.density) as usize).min(self.bins - 1)
    }

    /// No value of the bin lies outside of these two.
    fn range(&self, bin: usize) -> (f32, f32) {
        // Beyond what the difference and the product are rounded by.
        let at = |bin: usize, off: f64| {
            f64::from(self.low) + bin as f64 / f64::from(self.density) * (1.0 + off)
        };
        let high = match bin == self.bins - 1 {
            true => f32::INFINITY,
            false => round_up(at(bin + 1, 1e-6)),
        };
        (round_down(at(bin, -1e-6)), high)
    }
}

/// The bins of a way to divide.
#[derive(Clone)]
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
    rows: Vec<Row>,
}

impl Bins {
    /// Puts the references of a node with these bounds into bins, for planes or for centres: a row
    /// for each axis.
    pub(super) fn fill(&mut self, search: &Search, bounds: &Bounds, planes: bool) -> &[Row] {
        let bins = bins_for(search.references.len());
        self.rows.resize(3, Row::EMPTY);
        for (row, way) in self.rows.iter_mut().zip(ways(planes)) {
            let (low, high) = (bounds.min[way.axis], bounds.max[way.axis]);
            row.way = way;
            row.scale = match way.is_plane {
                true => Scale::new(low, high, bins),
                false => Scale::new(2.0 * low, 2.0 * high, bins),
            };
            row.fill(search);
        }
        &self.rows
    }
}

impl Row {
    const EMPTY: Row = Row {
        way: Way {
            axis: 0,
            is_plane: false,
        },
        scale: Scale {
            low: 0.0,
            density: 0.0,
            bins: BINS,
        },
        at_least: [0.0; BINS],
        around: [[Side::EMPTY; 2]; BINS],
    };

    fn fill(&mut self, search: &Search) {
        let (Way { axis, is_plane }, scale) = (self.way, self.scale);
        // What starts in a bin is below all that follow; what ends there is above all before.
        let bins = scale.bins;
        self.around[..bins].fill([Side::EMPTY; 2]);
        for r in search.references {
            let (start, end) = match is_plane {
                true => (scale.bin(r.min[axis]), scale.bin(r.max[axis])),
                false => [scale.bin(r.center()[axis]); 2].into(),
            };
            self.around[start][0].add(r);
            self.around[end][1].add(r);
        }
        let is_empty: [bool; BINS] = std::array::from_fn(|bin| {
            bin >= bins || self.around[bin].iter().all(|side| side.count == 0)
        });
        let (mut below, mut above) = (Side::EMPTY, Side::EMPTY);
        for [starts, _] in &mut self.around[..bins] {
            (*starts, below) = (below, below.union(starts));
        }
        for [_, ends] in self.around[..bins].iter_mut().rev() {
            (*ends, above) = (above, above.union(ends));
        }
        self.at_least = std::array::from_fn(|bin| {
            if is_empty[bin] {
                return f32::INFINITY;
            }
            let [mut below, mut above] = self.around[bin];
            if is_plane {
                let (low, high) = scale.range(bin);
                below.bounds.max[axis] = below.bounds.max[axis].min(low);
                above.bounds.min[axis] = above.bounds.min[axis].max(high);
            }
            search.price(&below, &above, 0.0)
        });
    }
}
