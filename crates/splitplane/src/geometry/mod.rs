//! Rays, boxes, triangles, polytopes and the mesh.

mod aabb;
pub(crate) mod frame;
mod mesh;
mod parts;
pub(crate) mod polygon;
pub(crate) mod polytope;
pub(crate) mod proximity;
mod ray;
pub(crate) mod triangle;

pub use aabb::Aabb;
pub(crate) use frame::Frame;
pub use mesh::{Mesh, MeshError, Skipped};
pub use parts::Parts;
pub use ray::Ray;
