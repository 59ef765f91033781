//! One file per command.

pub mod build;
pub mod cast;
pub mod compare;
pub mod render;
pub mod scenes;
pub mod trees;
