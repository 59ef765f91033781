//! Centres of clusters of the node's normals [Hoobergs2019].

use glam::DVec3;

use super::{NodeView, canonical};

/// The most rounds of k-means.
const MAX_ROUNDS: usize = 500;
/// The clustering has settled when no centre moves further than this.
const SETTLED: f64 = 1e-3;

/// The centres of a k-means clustering, by angle, of the canonical normals of the node's
/// triangles; all normals where there are no more than `count`.
///
/// Every triangle has one vote, whatever its area. Opposite normals are one direction, but the
/// canonical choice between them tears apart those near x = 0: so does the thesis.
pub(super) fn generate(count: usize, mut node: NodeView, directions: &mut Vec<[f32; 3]>) {
    let normals: Vec<DVec3> = node
        .triangles
        .iter()
        .map(|&triangle| glam::Vec3::from(canonical(node.normals[triangle as usize])).as_dvec3())
        .collect();
    let centers = if normals.len() <= count {
        normals
    } else {
        cluster(&normals, count, |bound, count| {
            node.random.distinct_below(bound, count)
        })
    };
    directions.extend(centers.into_iter().map(|c| canonical(c.as_vec3().into())));
}

/// k-means on the unit sphere, from `count` distinct points. If a cluster runs empty, all centres
/// are drawn again.
fn cluster(
    points: &[DVec3],
    count: usize,
    mut draw: impl FnMut(usize, usize) -> Vec<usize>,
) -> Vec<DVec3> {
    let mut pick = || -> Vec<DVec3> {
        draw(points.len(), count)
            .into_iter()
            .map(|i| points[i])
            .collect()
    };
    let mut centers = pick();
    for _ in 0..MAX_ROUNDS {
        let mut sums = vec![(DVec3::ZERO, 0usize); count];
        for &point in points {
            // The smallest angle is the largest cosine; of equals the first.
            let mut nearest = (0, f64::NEG_INFINITY);
            for (i, center) in centers.iter().enumerate() {
                let cosine = point.dot(*center);
                if cosine > nearest.1 {
                    nearest = (i, cosine);
                }
            }
            let sum = &mut sums[nearest.0];
            *sum = (sum.0 + point, sum.1 + 1);
        }
        if sums.iter().any(|sum| sum.1 == 0) {
            centers = pick();
            continue;
        }
        let mut moved: f64 = 0.0;
        for (center, (sum, _)) in centers.iter_mut().zip(sums) {
            let new = sum.try_normalize().unwrap_or(*center);
            moved = moved.max(new.distance_squared(*center));
            *center = new;
        }
        if moved <= SETTLED * SETTLED {
            break;
        }
    }
    centers
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::directions::Random;

    #[test]
    fn well_separated_clusters_are_found() {
        let mut random = Random::new(3);
        let axes = [DVec3::X, DVec3::Y, DVec3::Z];
        let points: Vec<DVec3> = (0..300)
            .map(|i| {
                let noise = DVec3::new(random.unit(), random.unit(), random.unit());
                (axes[i % 3] + 0.05 * noise).normalize()
            })
            .collect();
        // k-means may end in a poor local optimum; from points of all three clusters it does not.
        let centers = cluster(&points, 3, |_, _| vec![0, 1, 2]);
        for axis in axes {
            assert!(centers.iter().any(|c| c.dot(axis) > 0.99), "{centers:?}");
        }
    }

    #[test]
    fn an_empty_cluster_draws_all_centres_again() {
        let points = [DVec3::X, DVec3::X, DVec3::Y, DVec3::Y];
        let mut draws = vec![vec![2, 0], vec![0, 1]];
        let centers = cluster(&points, 2, |_, _| draws.pop().expect("one more draw"));
        assert_eq!(centers, [DVec3::Y, DVec3::X]);
        assert!(draws.is_empty());
    }
}
