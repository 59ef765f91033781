//! The cell of a node: a box while only axes have split it, then a convex polytope.

use super::grow::SplitPlane;
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

    /// The cell as a polytope.
    pub(crate) fn to_polytope(&self) -> std::borrow::Cow<'_, Polytope> {
        match self {
            Cell::Box(aabb) => std::borrow::Cow::Owned(Polytope::from_box(aabb)),
            Cell::Polytope(polytope) => std::borrow::Cow::Borrowed(polytope),
        }
    }

    /// Both parts of the cell; `None` where it is too thin to be cut.
    pub(crate) fn cut(&self, plane: &SplitPlane, scratch: &mut CutScratch) -> Option<(Cell, Cell)> {
        match (self, plane.axis()) {
            (Cell::Box(aabb), Some(axis)) => {
                let (mut below, mut above) = (*aabb, *aabb);
                below.max[axis] = plane.boundary.offset;
                above.min[axis] = plane.boundary.offset;
                Some((Cell::Box(below), Cell::Box(above)))
            }
            _ => {
                let normal = glam::Vec3::from(plane.normal).as_dvec3();
                let (below, above) =
                    self.to_polytope()
                        .cut(normal, f64::from(plane.boundary.offset), scratch)?;
                Some((Cell::Polytope(below), Cell::Polytope(above)))
            }
        }
    }
}
