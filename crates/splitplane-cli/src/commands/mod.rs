//! One file per command.

pub mod build;
pub mod cast;
pub mod check;
pub mod compare;
pub mod experiment;
pub mod render;
pub mod reproduce;
pub mod scenes;
pub mod slice;
pub mod tree_page;
pub mod trees;
pub mod verify;
