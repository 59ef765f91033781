//! How far a node's triangles reach along a direction, several at a time.

use rayon::prelude::*;

use super::grow::PARALLEL_FROM;
use super::params::Ties;

/// Triangles that are projected together.
pub(super) const LANES: usize = 4;

/// The corners of [`LANES`] triangles: x, y, z of the first, the second, the third.
#[derive(Clone, Copy, Debug)]
struct Block([[f32; LANES]; 9]);

/// The corners of a node's triangles, side by side: they are gone through once a direction.
#[derive(Clone, Debug, Default)]
pub(super) struct Corners {
    blocks: Vec<Block>,
    count: usize,
}

/// The extents of a node's triangles along one direction.
#[derive(Debug, Default)]
pub(super) struct Extents {
    pub(super) mins: Vec<f32>,
    pub(super) maxs: Vec<f32>,
}

impl Corners {
    /// Takes `count` triangles, of which the one with the index i has the corners `of(i)`.
    pub(super) fn gather(&mut self, count: usize, of: impl Fn(usize) -> [[f32; 3]; 3] + Sync) {
        self.count = count;
        self.blocks
            .resize(count.div_ceil(LANES), Block([[0.0; LANES]; 9]));
        let fill = |(at, block): (usize, &mut Block)| {
            let start = at * LANES;
            for i in start..count.min(start + LANES) {
                for (row, &c) in block.0.iter_mut().zip(of(i).as_flattened()) {
                    row[i - start] = c;
                }
            }
        };
        if count < PARALLEL_FROM {
            self.blocks.iter_mut().enumerate().for_each(fill);
        } else {
            self.blocks.par_iter_mut().enumerate().for_each(fill);
        }
    }

    /// The extents of all triangles along a direction; `axis` where it is one.
    pub(super) fn extents(
        &self,
        ties: Ties,
        direction: [f32; 3],
        axis: Option<usize>,
        extents: &mut Extents,
    ) {
        let Extents { mins, maxs } = extents;
        let padded = self.blocks.len() * LANES;
        mins.resize(padded, 0.0);
        maxs.resize(padded, 0.0);
        let lanes = mins
            .as_chunks_mut::<LANES>()
            .0
            .iter_mut()
            .zip(maxs.as_chunks_mut::<LANES>().0);
        for (block, (mins, maxs)) in self.blocks.iter().zip(lanes) {
            (*mins, *maxs) = block.extents(ties, direction, axis);
        }
        mins.truncate(self.count);
        maxs.truncate(self.count);
    }

    /// The extents of a run of at most [`LANES`] triangles that begins with the one of the index
    /// `start`, a multiple of [`LANES`].
    #[inline(always)]
    pub(super) fn extents_at(
        &self,
        start: usize,
        ties: Ties,
        direction: [f32; 3],
    ) -> ([f32; LANES], [f32; LANES]) {
        self.blocks[start / LANES].extents(ties, direction, None)
    }
}

impl Block {
    /// As [`Ties::extent`] has it.
    #[inline(always)]
    fn extents(
        &self,
        ties: Ties,
        d: [f32; 3],
        axis: Option<usize>,
    ) -> ([f32; LANES], [f32; LANES]) {
        let mut projected = [[0.0; LANES]; 3];
        if let Some(axis) = axis {
            projected = [0, 3, 6].map(|corner| self.0[corner + axis]);
        } else {
            for (out, [x, y, z]) in projected.iter_mut().zip(self.0.as_chunks::<3>().0) {
                for i in 0..LANES {
                    out[i] = ties.project(d, [x[i], y[i], z[i]]);
                }
            }
        }
        let [a, b, c] = &projected;
        let (mut mins, mut maxs) = ([0.0; LANES], [0.0; LANES]);
        for i in 0..LANES {
            // Corners are never NaN; a comparison is one instruction, f32::min is not.
            let (low, high) = if a[i] < b[i] {
                (a[i], b[i])
            } else {
                (b[i], a[i])
            };
            mins[i] = if c[i] < low { c[i] } else { low };
            maxs[i] = if c[i] > high { c[i] } else { high };
        }
        (mins, maxs)
    }
}
