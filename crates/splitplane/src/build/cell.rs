//! The cell of a node: a box while only axes have split it, then a convex polytope.

use glam::DVec3;

use super::grow::SplitPlane;
use crate::geometry::Aabb;
use crate::geometry::polytope::{Polytope, Slicer};

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

    /// The areas under planes along an axis, where the cell is a box.
    pub(crate) fn box_profile(&self, axis: usize) -> Option<Profile<'static>> {
        let Cell::Box(aabb) = self else { return None };
        let extent = aabb.extent().map(f64::from);
        let (p, q) = (extent[(axis + 1) % 3], extent[(axis + 2) % 3]);
        let (low, high) = (f64::from(aabb.min[axis]), f64::from(aabb.max[axis]));
        let length = high - low;
        Some(Profile {
            area: aabb.surface_area(),
            low,
            high,
            pieces: Pieces::One(Piece {
                start: low,
                end: high,
                below: [p * q, 2.0 * (p + q) * length, 0.0],
                cap: [p * q, 0.0, 0.0],
            }),
        })
    }

    /// Both parts of the cell; `None` where it is too thin to be cut.
    pub(crate) fn cut(&self, plane: &SplitPlane) -> Option<(Cell, Cell)> {
        match (self, plane.axis()) {
            (Cell::Box(aabb), Some(axis)) => {
                let (mut below, mut above) = (*aabb, *aabb);
                below.max[axis] = plane.boundary.offset;
                above.min[axis] = plane.boundary.offset;
                Some((Cell::Box(below), Cell::Box(above)))
            }
            _ => {
                let normal = glam::Vec3::from(plane.normal).as_dvec3();
                let (below, above) = self
                    .to_polytope()
                    .cut(normal, f64::from(plane.boundary.offset))?;
                Some((Cell::Polytope(below), Cell::Polytope(above)))
            }
        }
    }

    #[cfg(test)]
    pub(crate) fn axis_profile(&self, axis: usize) -> Profile<'static> {
        self.box_profile(axis).expect("a box")
    }
}

/// The areas of a cell's two parts as functions of the plane's offset along one direction, for
/// offsets that ascend.
pub(crate) struct Profile<'a> {
    area: f64,
    low: f64,
    high: f64,
    pieces: Pieces<'a>,
}

enum Pieces<'a> {
    /// The whole extent is one piece.
    One(Piece),
    /// A piece from vertex to vertex, each made when an offset comes to lie in it.
    Many {
        slicer: Slicer<'a>,
        knots: Vec<f64>,
        current: Option<Piece>,
    },
    /// Each offset by itself: cheaper for few.
    Direct(Slicer<'a>),
}

/// Two quadratics in `(t - start) / (end - start)`, by their coefficients: the area of the
/// surface below, and that of the cross-section.
#[derive(Clone, Copy, Debug)]
struct Piece {
    start: f64,
    end: f64,
    below: [f64; 3],
    cap: [f64; 3],
}

impl Piece {
    fn of(slicer: &Slicer, start: f64, end: f64) -> Self {
        let [s, m, e] = [start, 0.5 * (start + end), end].map(|t| slicer.areas_at(t));
        let through = |s: f64, m: f64, e: f64| [s, 4.0 * m - 3.0 * s - e, 2.0 * (s + e - 2.0 * m)];
        Piece {
            start,
            end,
            below: through(s.0, m.0, e.0),
            cap: through(s.1, m.1, e.1),
        }
    }

    #[inline]
    fn at(&self, t: f64) -> (f64, f64) {
        let s = (t - self.start) / (self.end - self.start);
        let value = |c: [f64; 3]| c[0] + s * (c[1] + s * c[2]);
        (value(self.below), value(self.cap))
    }
}

impl<'a> Profile<'a> {
    /// The areas of `polytope` under planes along `direction`, for about `queries` offsets.
    pub(crate) fn of_polytope(polytope: &'a Polytope, direction: DVec3, queries: usize) -> Self {
        let slicer = polytope.slicer(direction);
        let (low, high) = slicer.inside();
        let vertices = polytope.vertices().len();
        // A piece costs three queries, and there are hardly fewer pieces than vertices.
        let pieces = if queries <= 2 * vertices {
            Pieces::Direct(slicer)
        } else {
            Pieces::Many {
                knots: slicer.knots(),
                slicer,
                current: None,
            }
        };
        Profile {
            area: polytope.surface_area(),
            low,
            high,
            pieces,
        }
    }

    /// The offsets of planes that pass through the inside of the cell: between these two.
    pub(crate) fn inside(&self) -> (f64, f64) {
        (self.low, self.high)
    }

    /// The areas of the cells below and above the plane at `t`, as fractions of the cell's area.
    /// Offsets must ascend from call to call, strictly inside the extent.
    #[inline]
    pub(crate) fn areas(&mut self, t: f64) -> (f64, f64) {
        let (below, cap) = match &mut self.pieces {
            Pieces::One(piece) => piece.at(t),
            Pieces::Direct(slicer) => slicer.areas_at(t),
            Pieces::Many {
                slicer,
                knots,
                current,
            } => {
                let piece = match current {
                    Some(piece) if t <= piece.end => piece,
                    _ => {
                        let end = knots
                            .partition_point(|&knot| knot < t)
                            .clamp(1, knots.len() - 1);
                        current.insert(Piece::of(slicer, knots[end - 1], knots[end]))
                    }
                };
                piece.at(t)
            }
        };
        let below = below.clamp(0.0, self.area);
        let cap = cap.max(0.0);
        (
            (below + cap) / self.area,
            (self.area - below + cap) / self.area,
        )
    }
}
