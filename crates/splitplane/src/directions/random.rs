//! Random directions, drawn afresh in every node [Hoobergs2019].

use super::{NodeView, canonical};

/// `count` directions, uniform on the sphere.
pub(super) fn generate(count: usize, mut node: NodeView, directions: &mut Vec<[f32; 3]>) {
    directions.extend((0..count).map(|_| {
        let z = 2.0 * node.random.unit() - 1.0;
        let azimuth = std::f64::consts::TAU * node.random.unit();
        let radius = (1.0 - z * z).sqrt();
        canonical([radius * azimuth.cos(), radius * azimuth.sin(), z].map(|c| c as f32))
    }));
}
