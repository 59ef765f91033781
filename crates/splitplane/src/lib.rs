//! Ray queries on triangle meshes with BSP trees whose split planes come from the geometry.
//!
//! ```
//! use splitplane::{Mesh, Ray, Tree};
//!
//! let positions = vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
//! let mesh = Mesh::new(positions, vec![[0, 1, 2]])?; // triangles: three indices each
//! let tree = Tree::new(&mesh)?;
//! let ray = Ray::new([0.25, 0.25, 1.0], [0.0, 0.0, -1.0]); // origin, direction
//! let hit = tree.closest_hit(&ray, &mut ()).expect("the ray meets the triangle");
//! assert_eq!((hit.t, hit.triangle, hit.u, hit.v), (1.0, 0, 0.25, 0.25));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Queries
//!
//! | of a [`Tree`] | |
//! |---|---|
//! | [`closest_hit`](Tree::closest_hit), [`any_hit`](Tree::any_hit), [`all_hits`](Tree::all_hits) | rays; with `_where` only the hits that a closure takes, for masks and surfaces with holes |
//! | [`closest_point`](Tree::closest_point), [`signed_distance`](Tree::signed_distance), [`contains`](Tree::contains) | points |
//! | [`triangles_in_box`](Tree::triangles_in_box), [`triangles_in_sphere`](Tree::triangles_in_sphere) | overlaps |
//! | [`card`](Tree::card), [`section`](Tree::section), [`validate`](Tree::validate) | the tree itself |
//! | [`save`](Tree::save), [`load`](Tree::load) | files |
//!
//! Several meshes are one by [`Mesh::join`], which tells them apart again. [`Instances`] are trees
//! that are placed in space, each as often as need be, and answer the same rays. A tree is shared between threads: cast many rays with rayon's `par_iter`, or any other.
//!
//! Every tree gives the answers of looking at every triangle, bit for bit: same triangle, same `t`,
//! `u` and `v`; of equals the lowest index. Triangles are two-sided, edges and vertices belong to
//! every triangle that has them, and no ray slips through between two. Triangles that are not
//! finite or have no area are never hit; [`Mesh::skipped`] counts them. No input panics, unless it
//! names what does not exist, as an index into a slice does.
//!
//! # Trees
//!
//! ```
//! # use splitplane::{BuildParams, Counts, Mesh, Ray, Tree};
//! # let mesh = Mesh::new(vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], vec![[0, 1, 2]])?;
//! let tree = Tree::build(&mesh, "wn+kd:6".parse()?, &BuildParams::default())?;
//! let mut counts = Counts::default();
//! tree.closest_hit(&Ray::new([0.25, 0.25, 1.0], [0.0, 0.0, -1.0]), &mut counts);
//! assert_eq!(counts.triangle_tests, 1);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Which planes a tree tries is a row of [`TREES`]; how they are priced, how ties are treated and
//! when to stop is [`BuildParams`]. What a query does on its way it reports to a [`Counters`];
//! `&mut ()` counts nothing and costs nothing. A tree is for a mesh that stays as it is.
//!
//! # Numbers
//!
//! Positions are f32, in scene units; meshes in f64, with large coordinates, are kept from an
//! origin of their own: [`Mesh::from_f64`]. `t` is in multiples of the ray direction's length.
//! Papers are cited by their key in [`references`].
//!
//! # Features
//!
//! * `serde`: `Serialize` and `Deserialize` for rays, boxes, answers, transforms and names of trees;
//! * `glam`, `mint`: [`Transform`]s from the matrices of these libraries.
//!
//! None is on by default, and no type of another library is in a signature otherwise. Positions are
//! `[f32; 3]`, which the vectors of glam, nalgebra and mint turn into. Rust 1.95 or newer; a newer
//! Rust may be asked for in a minor version, and within a minor version nothing that compiles
//! breaks.

#![deny(unsafe_code)]

mod build;
mod catalog;
mod directions;
mod geometry;
mod instances;
mod query;
mod tree;
mod whole;

#[doc = include_str!("../REFERENCES.md")]
#[allow(
    rustdoc::broken_intra_doc_links,
    reason = "keys of papers are in brackets, as they are where papers are cited"
)]
pub mod references {
    /// The page as text: a paragraph for each paper, `**[Key]** …`.
    pub const TEXT: &str = include_str!("../REFERENCES.md");
}

pub use build::{
    BuildError, BuildParams, BuildPart, BuildStats, DepthLimit, ObliquePricing, Progress, Ties,
    Wins,
};
pub use catalog::{Directions, ParseTreeError, TREES, TreeChoice, TreeSpec};
pub use geometry::{Aabb, Mesh, MeshError, Parts, Ray, Skipped};
pub use instances::{InstanceHit, Instances, InstancesError, Transform, TransformError};
pub use query::{ClosestPoint, Coherence, Counters, Counts, Hit, Traversal, brute_force};
pub use tree::{
    Axis, Layout, LoadError, NodeCounts, Section, SectionCell, SectionSegment, Tree, TreeCard,
    ValidateError, WideCard,
};
#[doc(hidden)]
pub use whole::write_whole;

#[cfg(test)]
mod testing {
    use proptest::prelude::*;
    use proptest::test_runner::{Config, RngSeed};

    /// A point somewhere, or on a grid: so that corners and planes often coincide.
    pub(crate) fn point() -> impl Strategy<Value = [f32; 3]> {
        prop::array::uniform3(prop_oneof![-1.0f32..1.0, (-2i8..=2).prop_map(f32::from)])
    }

    /// That many cases, the same in every run: a failure in CI is one that everybody sees. With
    /// `SPLITPLANE_SOAK=N` so many times as many, and others in every run.
    pub(crate) fn cases(cases: u32) -> Config {
        let soak = std::env::var("SPLITPLANE_SOAK").ok();
        let soak = soak.and_then(|times| times.parse::<u32>().ok());
        Config {
            cases: cases.saturating_mul(soak.unwrap_or(1)),
            rng_seed: match soak {
                Some(_) => RngSeed::Random,
                None => RngSeed::Fixed(2019),
            },
            failure_persistence: None,
            ..Config::default()
        }
    }
}
