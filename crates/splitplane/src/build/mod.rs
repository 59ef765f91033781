//! From a mesh to a tree: one top-down loop, cell by cell.

mod built;
mod cell;
mod cost;
mod extents;
mod framed;
mod grow;
mod lists;
mod objects;
mod outlines;
mod params;
mod search;
mod sweep;
mod ties;
mod triangle_planes;
mod watch;

pub(crate) use built::{Built, BuiltNode, Expected, Origin, Piece, SplitPlane};
pub(crate) use grow::grow;
pub use params::{BuildError, BuildParams, BuildStats, DepthLimit, ObliquePricing, Ties, Wins};
pub use watch::{BuildPart, Progress};
