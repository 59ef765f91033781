//! What of a node's triangles lies in its cell, where that is kept: perfect splits
//! [WaldHavran2006, Soupikov2008].
//!
//! A triangle that a plane passes through is cut in two, each part a little longer than it is: a
//! triangle may lie on one side of a plane and reach beyond it by the overhang, so what a node does
//! not know of a triangle is at least that far outside of its cell.

use glam::DVec3;

use crate::geometry::polygon::{self, MAX_CORNERS};

/// The outlines of a node's references, in their order.
#[derive(Clone, Debug, Default)]
pub(super) struct Outlines {
    /// Where the corners of each reference end; a triangle that is whole has none. Empty where all
    /// are whole.
    ends: Vec<u32>,
    corners: Vec<DVec3>,
}

/// A plane that triangles are cut by.
#[derive(Clone, Copy, Debug)]
pub(super) struct Knife {
    pub(super) normal: DVec3,
    pub(super) offset: f64,
    /// How far beyond the plane what is cut off begins.
    pub(super) outset: f64,
}

impl Outlines {
    /// The corners of what is left of the reference with the index `i`; none where it is whole.
    pub(super) fn of(&self, i: usize) -> &[DVec3] {
        let Some(&end) = self.ends.get(i) else {
            return &[];
        };
        let start = if i == 0 { 0 } else { self.ends[i - 1] };
        &self.corners[start as usize..end as usize]
    }

    /// The references that are not whole, with their corners, in order.
    pub(super) fn cut(&self) -> impl Iterator<Item = (usize, &[DVec3])> {
        (0..self.ends.len())
            .map(|i| (i, self.of(i)))
            .filter(|(_, corners)| !corners.is_empty())
    }

    /// Nothing of nothing, with its memory.
    fn clear(&mut self) {
        self.ends.clear();
        self.corners.clear();
    }

    /// Ends the next reference's corners.
    fn end(&mut self) {
        self.ends.push(self.corners.len() as u32);
    }

    /// As much memory as they take, none if all are whole.
    fn copied(&self) -> Outlines {
        match self.corners.is_empty() {
            true => Outlines::default(),
            false => self.clone(),
        }
    }

    /// Those of a node's children: `sides` of its references are 1 below the plane, 2 above it, 3
    /// both; `whole` gives the corners of a triangle. Empty for a child that is not `wanted`.
    pub(super) fn divide(
        &self,
        knife: &Knife,
        sides: &[u8],
        wanted: [bool; 2],
        whole: impl Fn(usize) -> [[f32; 3]; 3],
        buffers: &mut [Outlines; 2],
    ) -> [Outlines; 2] {
        buffers.iter_mut().for_each(Outlines::clear);
        for (i, &side) in sides.iter().enumerate() {
            let own = self.of(i);
            let of_triangle;
            let corners = match own {
                [] if side == 3 => {
                    of_triangle = whole(i).map(|p| glam::Vec3::from(p).as_dvec3());
                    &of_triangle
                }
                own => own,
            };
            for (child, sign) in [(0, 1.0), (1, -1.0)] {
                if !wanted[child] || side & 1 << child == 0 {
                    continue;
                }
                let part = &mut buffers[child];
                let height = |p| sign * (knife.normal.dot(p) - knife.offset) - knife.outset;
                let is_cut = side == 3
                    && corners.len() < MAX_CORNERS
                    && corners.iter().any(|&p| height(p) > 0.0);
                match is_cut {
                    true => polygon::part(corners, height, |p| part.corners.push(p)),
                    false => part.corners.extend_from_slice(own),
                }
                part.end();
            }
        }
        buffers.each_ref().map(Outlines::copied)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::point;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(crate::testing::cases(1_000))]

        /// A point of a triangle is in the outline of each cell that it is in, or beyond by the
        /// outset.
        #[test]
        fn what_is_in_a_cell_is_in_the_outline(
            corners in prop::array::uniform3(point()),
            planes in prop::collection::vec((point(), -1.0f64..1.0), 1..30),
            (u, v) in (0.0f64..1.0, 0.0f64..1.0),
            direction in point(),
        ) {
            const OUTSET: f64 = 1e-3;
            let whole = |_| corners;
            let dot = |n: [f32; 3], p: DVec3| glam::Vec3::from(n).as_dvec3().dot(p);
            let [a, b, c] = corners.map(|p| glam::Vec3::from(p).as_dvec3());
            let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
            let p = a + (b - a) * u + (c - a) * v;
            let mut outlines = Outlines::default();
            for (i, (normal, offset)) in planes.into_iter().enumerate() {
                let knife = Knife {
                    normal: glam::Vec3::from(normal).as_dvec3(),
                    offset,
                    outset: OUTSET,
                };
                let height = dot(normal, p) - offset;
                // Where it is near the plane it may be taken for either side.
                let above = height > 0.5 * OUTSET || (height > -0.5 * OUTSET && i % 2 == 0);
                let parts = outlines.divide(&knife, &[3], [!above, above], whole, &mut Default::default());
                outlines = parts.into_iter().nth(usize::from(above)).unwrap();
                let left = match outlines.of(0) {
                    [] => vec![a, b, c],
                    cut => cut.to_vec(),
                };
                let along = || left.iter().map(|&q| dot(direction, q));
                let (low, high) = (along().fold(f64::MAX, f64::min), along().fold(f64::MIN, f64::max));
                let at = dot(direction, p);
                prop_assert!(low - 1e-9 <= at && at <= high + 1e-9, "{low} {at} {high}");
            }
        }
    }

    #[test]
    fn each_child_has_its_part_and_what_is_whole_has_no_corners() {
        let triangles = [
            [[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 2.0, 0.0]],
            [[0.0, 0.0, 0.0], [0.5, 0.0, 0.0], [0.0, 0.5, 0.0]],
        ];
        let knife = Knife {
            normal: DVec3::X,
            offset: 1.0,
            outset: 0.25,
        };
        let [below, above] = Outlines::default().divide(
            &knife,
            &[3, 1],
            [true, true],
            |i| triangles[i],
            &mut Default::default(),
        );
        assert_eq!(below.of(0).len(), 4);
        assert_eq!(below.of(0).iter().map(|p| p.x).fold(0.0, f64::max), 1.25);
        assert!(below.of(1).is_empty());
        assert_eq!(below.cut().count(), 1);
        assert_eq!(above.of(0).iter().map(|p| p.x).fold(9.0, f64::min), 0.75);
        assert!(above.of(1).is_empty() && above.cut().count() == 1);
    }
}
