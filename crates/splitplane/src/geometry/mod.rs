//! Rays, boxes, triangles, polytopes and the mesh.

mod aabb;
pub(crate) mod frame;
mod mesh;
pub(crate) mod polygon;
pub(crate) mod polytope;
pub(crate) mod proximity;
mod ray;
pub(crate) mod triangle;

pub use aabb::Aabb;
pub(crate) use frame::Frame;
pub use mesh::{Mesh, MeshError, Skipped};
pub use ray::Ray;
