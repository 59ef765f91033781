//! A bounding volume hierarchy by SAH sweeps: triangles are divided instead of space, so that each
//! is in one leaf, and children's boxes may overlap [GoldsmithSalmon1987, MacDonaldBooth1990].

use super::built::{Built, BuiltNode};
use super::grow::{ASKED_FROM, PARALLEL_FROM};
use super::params::BuildParams;
use super::watch::{self, BuildPart, WHOLE, Watched};
use crate::geometry::{Aabb, Frame, Mesh};

/// A triangle while the hierarchy is built.
#[derive(Clone, Copy)]
struct Item {
    bounds: Aabb,
    triangle: u32,
}

/// Where to divide triangles that are sorted along an axis.
struct Division {
    axis: usize,
    below: usize,
    cost: f64,
}

/// Builds the hierarchy, on the threads of the current rayon pool; `None` if it was cancelled.
pub(super) fn grow(mesh: &Mesh, params: &BuildParams, watched: &Watched) -> Option<Built> {
    let mut items: Vec<Item> = mesh
        .usable_triangles()
        .iter()
        .map(|&triangle| Item {
            bounds: Aabb::of_points(mesh.corners(triangle)),
            triangle,
        })
        .collect();
    let mut built = Built::default();
    let job = Job { params, watched };
    job.divide(&mut items, (0, WHOLE), &mut built);
    (!watched.is_stopped()).then_some(built)
}

struct Job<'a> {
    params: &'a BuildParams,
    watched: &'a Watched<'a>,
}

impl Job<'_> {
    fn divide(&self, items: &mut [Item], (depth, share): (u32, u64), built: &mut Built) {
        let params = self.params;
        let _part = self.watched.part(BuildPart::Subtree, items.len());
        let bounds = items
            .iter()
            .fold(Aabb::EMPTY, |all, item| all.union(&item.bounds));
        let area = bounds.surface_area();
        built.bounds(bounds);
        let leaf_cost = params.intersection_cost * items.len() as f64;
        let stopped = items.len() >= ASKED_FROM && self.watched.ask();
        let splits = !stopped && items.len() > params.max_prims as usize;
        let part = self.watched.part(BuildPart::Search, items.len());
        let division = match splits && depth < BuildParams::MAX_DEPTH {
            true => best_division(items, area, params, built),
            false => None,
        };
        drop(part);
        let Some(Division { axis, below, .. }) =
            division.filter(|division| division.cost < leaf_cost)
        else {
            // In the mesh's order, as in every tree.
            items.sort_unstable_by_key(|item| item.triangle);
            built.leaf(items.iter().map(|item| item.triangle), area);
            self.watched.finished(share, items.len());
            return;
        };
        sort_along(items, axis);
        let (below, above) = items.split_at_mut(below);
        let shares = watch::divide(share, below.len(), above.len());
        built.join(
            (
                |above| BuiltNode::Objects {
                    above,
                    frame: Frame::WORLD,
                },
                area,
            ),
            below.len().min(above.len()) >= PARALLEL_FROM,
            &mut (),
            |built, ()| self.divide(below, (depth + 1, shares.0), built),
            |built, ()| self.divide(above, (depth + 1, shares.1), built),
        );
    }
}

/// Along one axis, by the centres of the triangles' boxes; of equals the lower index first.
fn sort_along(items: &mut [Item], axis: usize) {
    let center = |item: &Item| item.bounds.min[axis] + item.bounds.max[axis];
    items.sort_unstable_by(|a, b| {
        center(a)
            .total_cmp(&center(b))
            .then(a.triangle.cmp(&b.triangle))
    });
}

/// The division of least cost; of equals the first. Leaves the triangles sorted along an axis.
fn best_division(
    items: &mut [Item],
    area: f64,
    params: &BuildParams,
    built: &mut Built,
) -> Option<Division> {
    let mut best: Option<Division> = None;
    let mut areas_above = vec![0.0; items.len()];
    for axis in 0..3 {
        sort_along(items, axis);
        let mut above = Aabb::EMPTY;
        for (i, item) in items.iter().enumerate().rev() {
            above = above.union(&item.bounds);
            areas_above[i] = above.surface_area();
        }
        let mut below = Aabb::EMPTY;
        for (i, pair) in items.windows(2).enumerate() {
            below = below.union(&pair[0].bounds);
            let n_below = i + 1;
            let n_above = items.len() - n_below;
            let tests = (below.surface_area() * n_below as f64
                + areas_above[n_below] * n_above as f64)
                / area;
            let cost = params.kd_traversal_cost + params.intersection_cost * tests;
            if best.as_ref().is_none_or(|best| cost < best.cost) {
                best = Some(Division {
                    axis,
                    below: n_below,
                    cost,
                });
            }
        }
        built.stats.candidates += items.len().saturating_sub(1) as u64;
    }
    best
}
