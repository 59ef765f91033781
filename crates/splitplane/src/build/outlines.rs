//! What of a node's triangles lies in its cell, where that is kept: perfect splits
//! [WaldHavran2006, Soupikov2008].
//!
//! A triangle that a plane passes through is cut in two, each part a little longer than it is: a
//! triangle may lie on one side of a plane and reach beyond it by the overhang, so what a node does
//! not know of a triangle is at least that far outside of its cell.

use glam::DVec3;

use crate::geometry::polygon::Polygon;

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

    /// Appends the next reference's, rounded nowhere.
    fn push(&mut self, corners: &[DVec3]) {
        self.corners.extend_from_slice(corners);
        self.ends.push(self.corners.len() as u32);
    }

    /// Those of a node's children: `sides` of its references are 1 below the plane, 2 above it, 3
    /// both; `whole` gives the corners of a triangle. Empty for a child that is not `wanted`.
    pub(super) fn divide(
        &self,
        knife: &Knife,
        sides: &[u8],
        wanted: [bool; 2],
        whole: impl Fn(usize) -> [[f32; 3]; 3],
    ) -> [Outlines; 2] {
        let mut parts = [Outlines::default(), Outlines::default()];
        for (i, &side) in sides.iter().enumerate() {
            let own = self.of(i);
            if side != 3 {
                let part = usize::from(side == 2);
                if wanted[part] {
                    parts[part].push(own);
                }
                continue;
            }
            let polygon = match own {
                [] => Polygon::new(&whole(i).map(|p| glam::Vec3::from(p).as_dvec3())),
                own => Polygon::new(own),
            };
            for (part, sign) in [(0, 1.0), (1, -1.0)] {
                if !wanted[part] {
                    continue;
                }
                let mut rest = polygon;
                rest.cut(|p| sign * (knife.normal.dot(p) - knife.offset) - knife.outset);
                match rest.corners() == polygon.corners() {
                    true => parts[part].push(own),
                    false => parts[part].push(rest.corners()),
                }
            }
        }
        parts.map(|mut part| {
            if part.corners.is_empty() {
                return Outlines::default();
            }
            part.ends.shrink_to_fit();
            part.corners.shrink_to_fit();
            part
        })
    }
}
