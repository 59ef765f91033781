//! The cell of a node: a box while only axes have split it, then a convex polytope.

use super::built::SplitPlane;
use crate::geometry::Aabb;
use crate::geometry::polytope::{CutScratch, Polytope};

#[derive(Clone, Debug)]
pub(crate) enum Cell {
    Box(Aabb),
    Polytope(Polytope),
}

impl Cell {
    pub(crate) fn surface_area(&self) -> f64 {
        match self {
            Cell::Box(aabb) => aabb.surface_area(),
            Cell::Polytope(polytope) => polytope.surface_area(),
        }
    }

    /// Those of the parts below and above that are wanted; `None` where the cell is too thin to be
    /// cut.
    pub(crate) fn cut(
        &self,
        plane: &SplitPlane,
        wanted: [bool; 2],
        scratch: &mut CutScratch,
    ) -> Option<[Option<Cell>; 2]> {
        match (self, plane.axis()) {
            (Cell::Box(aabb), Some(axis)) => {
                let (mut below, mut above) = (*aabb, *aabb);
                below.max[axis] = plane.offset;
                above.min[axis] = plane.offset;
                Some([below, above].map(|part| Some(Cell::Box(part))))
            }
            (cell, _) => {
                let normal = glam::Vec3::from(plane.normal).as_dvec3();
                let offset = f64::from(plane.offset);
                let parts = match cell {
                    Cell::Polytope(polytope) => polytope.cut(normal, offset, wanted, scratch)?,
                    Cell::Box(aabb) => {
                        Polytope::from_box(aabb).cut(normal, offset, wanted, scratch)?
                    }
                };
                Some(parts.map(|part| part.map(Cell::Polytope)))
            }
        }
    }
}
