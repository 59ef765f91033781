//! A bounding volume hierarchy by SAH sweeps: triangles are divided instead of space, so that each
//! is in one leaf, and children's boxes may overlap [GoldsmithSalmon1987, MacDonaldBooth1990].

use super::grow::{Built, BuiltNode, PARALLEL_FROM};
use super::params::BuildParams;
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

/// Builds the hierarchy, on the threads of the current rayon pool.
pub(super) fn grow(mesh: &Mesh, params: &BuildParams) -> Built {
    let mut items: Vec<Item> = mesh
        .usable_triangles()
        .iter()
        .map(|&triangle| Item {
            bounds: Aabb::of_points(mesh.corners(triangle)),
            triangle,
        })
        .collect();
    let mut built = Built::default();
    divide(&mut items, 0, params, &mut built);
    built
}

fn divide(items: &mut [Item], depth: u32, params: &BuildParams, built: &mut Built) {
    let bounds = items
        .iter()
        .fold(Aabb::EMPTY, |all, item| all.union(&item.bounds));
    let area = bounds.surface_area();
    let leaf_cost = params.intersection_cost * items.len() as f64;
    let division = match items.len() > params.max_prims as usize && depth < BuildParams::MAX_DEPTH {
        true => best_division(items, area, params, built),
        false => None,
    };
    let Some(Division { axis, below, .. }) = division.filter(|division| division.cost < leaf_cost)
    else {
        built.boxes.push(bounds);
        // In the mesh's order, as in every tree.
        items.sort_unstable_by_key(|item| item.triangle);
        built.nodes.push(BuiltNode::Leaf {
            count: items.len(),
            area,
        });
        built
            .references
            .extend(items.iter().map(|item| item.triangle));
        return;
    };
    built.boxes.push(bounds);
    sort_along(items, axis);
    let (below, above) = items.split_at_mut(below);
    built.join(
        |above| BuiltNode::Objects {
            above,
            area,
            frame: Frame::WORLD,
        },
        below.len().min(above.len()) >= PARALLEL_FROM,
        &mut (),
        |built, ()| divide(below, depth + 1, params, built),
        |built, ()| divide(above, depth + 1, params, built),
    );
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
