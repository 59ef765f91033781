//! Scenes, cameras, materials, lights and integrators: from a scene file to a picture, with
//! splitplane's trees for the rays.
//!
//! [`scene::load`] reads a scene, [`render::render`] renders it with any tree, [`output`] writes
//! the picture.

#![forbid(unsafe_code)]

pub mod error;
pub mod output;
pub mod render;
pub mod scene;
pub mod transform;

pub use error::SceneError;
