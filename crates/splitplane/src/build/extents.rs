//! How far a node's triangles reach along a direction, several at a time.

use glam::DVec3;
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
    /// Further corners of those that have more than three, in the order of the triangles.
    further: Vec<(u32, [f32; 3])>,
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
        self.further.clear();
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

    /// Puts the corners of what is left of a triangle in its place; in the order of the triangles.
    pub(super) fn replace(&mut self, i: usize, corners: &[DVec3]) {
        let mut corners = corners.iter().map(|p| p.as_vec3().to_array()).peekable();
        let Some(&(mut corner)) = corners.peek() else {
            return;
        };
        let (rows, _) = self.blocks[i / LANES].0.as_chunks_mut::<3>();
        for rows in rows {
            // One of them again where there are fewer than three.
            corner = corners.next().unwrap_or(corner);
            for (row, c) in rows.iter_mut().zip(corner) {
                row[i % LANES] = c;
            }
        }
        self.further
            .extend(corners.map(|corner| (i as u32, corner)));
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
        let project = |corner: [f32; 3]| match axis {
            Some(axis) => corner[axis],
            None => ties.project(direction, corner),
        };
        widen(0, &self.further, project, mins, maxs);
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
        let (mut mins, mut maxs) = self.blocks[start / LANES].extents(ties, direction, None);
        let before = |end: usize| (self.further).partition_point(|&(i, _)| (i as usize) < end);
        let further = &self.further[before(start)..before(start + LANES)];
        let project = |corner| ties.project(direction, corner);
        widen(start, further, project, &mut mins, &mut maxs);
        (mins, maxs)
    }
}

/// Widens extents, the first of which is that of the triangle with the index `start`, by further
/// corners.
#[inline(always)]
fn widen(
    start: usize,
    further: &[(u32, [f32; 3])],
    project: impl Fn([f32; 3]) -> f32,
    mins: &mut [f32],
    maxs: &mut [f32],
) {
    for &(i, corner) in further {
        let (i, t) = (i as usize - start, project(corner));
        (mins[i], maxs[i]) = (mins[i].min(t), maxs[i].max(t));
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
