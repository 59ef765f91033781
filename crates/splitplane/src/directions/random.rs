//! Random directions, drawn afresh in every node [Hoobergs2019].

use super::{NodeView, canonical};

/// `count` directions, uniform on the sphere [Marsaglia1972]: by square roots alone, which are the
/// same on every machine, as sines are not.
pub(super) fn generate(count: usize, mut node: NodeView, directions: &mut Vec<[f32; 3]>) {
    directions.extend((0..count).map(|_| {
        loop {
            let [x, y] = [(); 2].map(|()| 2.0 * node.random.unit() - 1.0);
            let square = x * x + y * y;
            if square < 1.0 {
                let radius = 2.0 * (1.0 - square).sqrt();
                return canonical([x * radius, y * radius, 1.0 - 2.0 * square].map(|c| c as f32));
            }
        }
    }));
}
