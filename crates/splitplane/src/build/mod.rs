//! From a mesh to a tree: one top-down loop, cell by cell.

mod cell;
mod cost;
mod framed;
mod grow;
mod objects;
mod params;
mod sweep;
mod ties;
mod triangle_planes;

pub(crate) use grow::{Built, BuiltNode, Origin, SplitPlane, grow};
pub use params::{BuildError, BuildParams, BuildStats, DepthLimit, ObliquePricing, Ties, Wins};
