//! Many rays in one call.

use rayon::prelude::*;

use super::traverse::Search;
use super::{Any, Closest, Hit, run, wide};
use crate::geometry::Ray;
use crate::tree::Tree;

/// Rays that one thread takes at a time.
const CHUNK: usize = 1024;

pub(crate) fn closest_hits(tree: &Tree, rays: &[Ray], hits: &mut [Option<Hit>]) {
    let search = |ray: &Ray| Closest::new(ray, accept_all as fn(&Hit) -> bool);
    each(tree, rays, hits, search, |search| search.found());
}

pub(crate) fn any_hits(tree: &Tree, rays: &[Ray], hits: &mut [bool]) {
    let search = |ray: &Ray| Any::new(ray, accept_all as fn(&Hit) -> bool);
    each(tree, rays, hits, search, |search| search.found);
}

fn accept_all(_: &Hit) -> bool {
    true
}

/// A search for each ray, and what it found.
fn each<S: Search, T: Send>(
    tree: &Tree,
    rays: &[Ray],
    hits: &mut [T],
    search: impl Fn(&Ray) -> S + Sync,
    found: impl Fn(&S) -> T + Sync,
) {
    assert_eq!(rays.len(), hits.len(), "as many hits as rays");
    let chunk = |rays: &[Ray], hits: &mut [T]| match tree.wide() {
        Some(wide) => wide::traverse_all(wide, rays, hits, &search, &found),
        None => {
            for (ray, hit) in rays.iter().zip(hits) {
                let mut search = search(ray);
                run(tree, ray, &mut search, &mut ());
                *hit = found(&search);
            }
        }
    };
    if rays.len() <= CHUNK {
        return chunk(rays, hits);
    }
    (rays.par_chunks(CHUNK))
        .zip(hits.par_chunks_mut(CHUNK))
        .for_each(|(rays, hits)| chunk(rays, hits));
}
