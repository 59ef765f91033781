//! Where the split directions of a node come from: one file per source.

mod clustered;
pub(crate) mod fixed;
mod random;
mod sampled;

use crate::catalog::{Directions, TreeChoice};

/// What a source of directions may look at: a node's triangles, and random numbers of its own.
pub(crate) struct NodeView<'a> {
    /// The unit normals of the mesh's triangles, by index.
    pub(crate) normals: &'a [[f32; 3]],
    /// The triangles of the node.
    pub(crate) triangles: &'a [u32],
    /// Random numbers that depend on the seed and the node's place in the tree alone.
    pub(crate) random: Random,
}

/// Appends a node's own directions, those of the whole tree apart: canonical unit vectors.
pub(crate) fn generate(choice: TreeChoice, node: NodeView, directions: &mut Vec<[f32; 3]>) {
    let axes = if choice.spec.axes { 3 } else { 0 };
    let count = choice.direction_count.unwrap_or(0).saturating_sub(axes) as usize;
    match choice.spec.directions {
        _ if count == 0 => {}
        Directions::None | Directions::Fixed => {}
        Directions::Random => random::generate(count, node, directions),
        Directions::SampledNormals => sampled::generate(count, node, directions),
        Directions::ClusteredNormals => clustered::generate(count, node, directions),
    }
}

/// A direction or its opposite: the one whose first non-zero component is positive.
pub(crate) fn canonical(direction: [f32; 3]) -> [f32; 3] {
    let first = direction.into_iter().find(|&c| c != 0.0).unwrap_or(1.0);
    // Adding zero turns -0 into 0.
    direction.map(|c| if first < 0.0 { -c } else { c } + 0.0)
}

/// SplitMix64 [Steele2014]: a random number generator of one word, as good as any for a few draws
/// in each of millions of nodes.
#[derive(Clone, Debug)]
pub(crate) struct Random(u64);

impl Random {
    pub(crate) fn new(seed: u64) -> Self {
        Random(seed)
    }

    pub(crate) fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ z >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ z >> 31
    }

    /// A number in `[0, 1)`.
    pub(crate) fn unit(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1u64 << 53) as f64
    }

    /// A number below `bound`, all alike but for a bias below 2⁻³².
    pub(crate) fn below(&mut self, bound: usize) -> usize {
        ((u128::from(self.next()) * bound as u128) >> 64) as usize
    }

    /// `count` distinct numbers below `bound`, ascending; all of them where `bound` is not larger
    /// (Floyd's method [BentleyFloyd1987]).
    pub(crate) fn distinct_below(&mut self, bound: usize, count: usize) -> Vec<usize> {
        let mut drawn: Vec<usize> = Vec::with_capacity(count.min(bound));
        for top in bound.saturating_sub(count)..bound {
            let candidate = self.below(top + 1);
            let value = if drawn.contains(&candidate) {
                top
            } else {
                candidate
            };
            drawn.push(value);
        }
        drawn.sort_unstable();
        drawn
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_direction_and_its_opposite_are_one() {
        assert_eq!(canonical([0.0, -0.6, 0.8]), [0.0, 0.6, -0.8]);
        assert_eq!(canonical([0.0, 0.6, -0.8]), [0.0, 0.6, -0.8]);
        assert_eq!(
            canonical([-0.0, 0.0, -1.0]).map(f32::to_bits),
            [0.0f32, 0.0, 1.0].map(f32::to_bits)
        );
    }

    #[test]
    fn distinct_draws_are_distinct_and_all_alike() {
        let mut random = Random::new(1);
        let mut counts = [0; 10];
        for _ in 0..20_000 {
            let drawn = random.distinct_below(10, 3);
            assert!(drawn.windows(2).all(|pair| pair[0] < pair[1]) && drawn.len() == 3);
            drawn.into_iter().for_each(|i| counts[i] += 1);
        }
        // 6,000 each; four standard deviations of a binomial are 260.
        assert!(
            counts
                .iter()
                .all(|&count: &i32| (count - 6_000).abs() < 260),
            "{counts:?}"
        );
        assert_eq!(random.distinct_below(3, 8), [0, 1, 2]);
    }
}
