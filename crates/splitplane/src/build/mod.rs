//! From a mesh to a tree: one top-down loop, cell by cell.

mod cell;
mod cost;
mod grow;
mod params;
mod sweep;
mod ties;

pub(crate) use grow::{Built, BuiltNode, SplitPlane, Sums, grow};
pub use params::{BuildError, BuildParams, BuildStats, DepthLimit, ObliquePricing, Ties};
