//! Frames: axes of their own for the boxes of a subtree.

use bytemuck::{Pod, Zeroable};
use glam::DVec3;

use super::Aabb;

/// Three axes, nearly orthogonal and of unit length, as rows. What is in a frame has the
/// coordinates `rows · p` of a point `p` of the world.
///
/// The rows are what they are: no query relies on their being orthogonal.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(transparent)]
pub(crate) struct Frame {
    pub(crate) rows: [[f32; 3]; 3],
}

impl Frame {
    /// The index of the world's own axes in every list of frames.
    pub(crate) const WORLD: u32 = 0;

    pub(crate) const IDENTITY: Frame = Frame {
        rows: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
    };

    /// Whether the axes are of unit length, but for rounding.
    pub(crate) fn is_sound(&self) -> bool {
        let length = |row: &[f32; 3]| row.iter().map(|c| c * c).sum::<f32>().sqrt();
        self.rows.iter().all(|row| (length(row) - 1.0).abs() < 1e-3)
    }

    /// A point or direction of the world, in the frame. Exact but for f64 rounding.
    #[inline(always)]
    pub(crate) fn map(&self, p: [f64; 3]) -> [f64; 3] {
        let along = |row: usize| {
            let [x, y, z] = self.rows[row];
            f64::from(x) * p[0] + f64::from(y) * p[1] + f64::from(z) * p[2]
        };
        [along(0), along(1), along(2)]
    }
}

/// The smallest box in f32 that holds a box in f64, and a little more: the f64 coordinates may be
/// off by roundings of numbers as large as `reach`.
pub(crate) fn round_outward(min: DVec3, max: DVec3, reach: f64) -> Aabb {
    let slack = 8.0 * f64::EPSILON * reach;
    Aabb {
        min: std::array::from_fn(|axis| round_down(min[axis] - slack)),
        max: std::array::from_fn(|axis| round_up(max[axis] + slack)),
    }
}

/// The largest f32 that is not above `x`.
#[inline(always)]
pub(crate) fn round_down(x: f64) -> f32 {
    let rounded = x as f32;
    match f64::from(rounded) > x {
        true => rounded.next_down(),
        false => rounded,
    }
}

/// The smallest f32 that is not below `x`.
#[inline(always)]
pub(crate) fn round_up(x: f64) -> f32 {
    -round_down(-x)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rounding_never_loses_a_point() {
        for x in [
            0.0,
            0.1,
            -0.1,
            1e-50,
            -1e-50,
            1.0 + 1e-9,
            -3.0 - 1e-9,
            16_777_217.0,
        ] {
            assert!(
                f64::from(round_down(x)) <= x && x <= f64::from(round_up(x)),
                "{x}"
            );
            assert!(round_up(x) <= round_down(x).next_up(), "{x}");
        }
    }
}
