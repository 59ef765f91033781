//! Many rays in one call.

use rayon::prelude::*;

use super::traverse::Search;
use super::{Any, Closest, Everything, Hit, run, wide};
use crate::geometry::Ray;
use crate::tree::Tree;

/// Rays that one thread takes at a time.
const CHUNK: usize = 1024;

/// Whether rays that follow each other in a batch go much the same way, as those of a camera do when
/// they are taken tile by tile. It never changes an answer, only the time that it takes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Coherence {
    /// The library looks at the rays: those that follow each other go through the tree together
    /// where they are close to each other, as long as that is worth it.
    #[default]
    Unknown,
    /// They go together, however far apart they are: rays that have nothing in common may visit all
    /// of the tree, which takes very long.
    Coherent,
    /// Each goes alone.
    Incoherent,
}

/// What many rays are asked.
pub(super) trait Question {
    type Search<'r>: Search;
    type Answer: Copy + Send;
    /// A search that has found this so far.
    fn search(ray: &Ray, found: Option<Hit>) -> Self::Search<'_>;
    /// What a search has found so far. It wants nothing beyond.
    fn found(search: &Self::Search<'_>) -> Option<Hit>;
    fn answer(found: Option<Hit>) -> Self::Answer;
}

pub(super) struct ClosestHit;

impl Question for ClosestHit {
    type Search<'r> = Closest<'r, Everything>;
    type Answer = Option<Hit>;

    #[inline(always)]
    fn search(ray: &Ray, found: Option<Hit>) -> Self::Search<'_> {
        Closest::after(ray, found, Everything)
    }

    #[inline(always)]
    fn found(search: &Self::Search<'_>) -> Option<Hit> {
        search.found()
    }

    #[inline(always)]
    fn answer(found: Option<Hit>) -> Option<Hit> {
        found
    }
}

pub(super) struct AnyHit;

impl Question for AnyHit {
    type Search<'r> = Any<'r, Everything>;
    type Answer = bool;

    #[inline(always)]
    fn search(ray: &Ray, _: Option<Hit>) -> Self::Search<'_> {
        Any::new(ray, Everything)
    }

    #[inline(always)]
    fn found(search: &Self::Search<'_>) -> Option<Hit> {
        search.found.then_some(SOME_HIT)
    }

    #[inline(always)]
    fn answer(found: Option<Hit>) -> bool {
        found.is_some()
    }
}

/// A hit, whatever it is: nothing is nearer.
const SOME_HIT: Hit = Hit {
    t: f32::NEG_INFINITY,
    u: 0.0,
    v: 0.0,
    triangle: 0,
};

pub(crate) fn closest_hits(
    tree: &Tree,
    rays: &[Ray],
    hits: &mut [Option<Hit>],
    coherence: Coherence,
) {
    each::<ClosestHit>(tree, rays, hits, coherence);
}

pub(crate) fn any_hits(tree: &Tree, rays: &[Ray], hits: &mut [bool], coherence: Coherence) {
    each::<AnyHit>(tree, rays, hits, coherence);
}

fn each<Q: Question>(tree: &Tree, rays: &[Ray], answers: &mut [Q::Answer], coherence: Coherence) {
    assert_eq!(rays.len(), answers.len(), "as many hits as rays");
    if rays.len() <= CHUNK {
        return chunk::<Q>(tree, rays, answers, coherence);
    }
    (rays.par_chunks(CHUNK))
        .zip(answers.par_chunks_mut(CHUNK))
        .for_each(|(rays, answers)| chunk::<Q>(tree, rays, answers, coherence));
}

fn chunk<Q: Question>(tree: &Tree, rays: &[Ray], answers: &mut [Q::Answer], coherence: Coherence) {
    if let Some(wide) = tree.wide() {
        return wide::traverse_all::<Q>(wide, rays, answers, coherence);
    }
    for (ray, answer) in rays.iter().zip(answers) {
        let mut search = Q::search(ray, None);
        run(tree, ray, &mut search, &mut ());
        *answer = Q::answer(Q::found(&search));
    }
}
