//! Scene files of pbrt-v3 [PBRT3, appendix B].
//!
//! [`lexer`] makes tokens of text, [`directive`] directives of tokens, [`world`] a scene of
//! directives. Every message carries its place in the files.

mod color;
mod directive;
mod lexer;
mod lights;
mod materials;
mod params;
mod settings;
mod shapes;
mod source;
mod textures;
mod v4;
mod world;

pub(crate) use lexer::{shortened, shortened_to};
pub(crate) use world::load;

/// The endings of the files that can be read, in lower case.
pub(crate) const ENDINGS: &[&str] = &[".pbrt", ".pbrt.gz"];
