//! Normals of triangles of the node, picked at random [Hoobergs2019].

use super::{NodeView, canonical};

/// The normals of `count` distinct triangles, in the triangles' order; of all of them where there
/// are not more. Two triangles of one plane give its normal twice, as in the thesis.
pub(super) fn generate(count: usize, mut node: NodeView, directions: &mut Vec<[f32; 3]>) {
    let picked = node.random.distinct_below(node.triangles.len(), count);
    directions.extend(
        picked
            .into_iter()
            .map(|i| canonical(node.normals[node.triangles[i] as usize])),
    );
}
