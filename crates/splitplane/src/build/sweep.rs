//! Finding the best plane along one direction: sort the events, sweep, count [WaldHavran2006].

use super::ties::{Boundary, Side, Touching, is_flat};
use crate::geometry::polytope::Profile;

/// The best plane of a sweep.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Best {
    pub(crate) boundary: Boundary,
    /// Expected tests after the split: the children's triangles, weighted by the areas of their
    /// cells over that of the cell.
    pub(crate) expected_tests: f64,
}

impl Best {
    /// A plane with its children's triangles and the areas of their cells, as fractions of the
    /// cell's.
    #[inline]
    pub(crate) fn price(
        boundary: Boundary,
        areas: (f64, f64),
        below: usize,
        above: usize,
        empty_bonus: f64,
    ) -> Self {
        let mut expected_tests = areas.0 * below as f64 + areas.1 * above as f64;
        if below == 0 || above == 0 {
            expected_tests *= 1.0 - empty_bonus;
        }
        Best {
            boundary,
            expected_tests,
        }
    }
}

/// The extents of a node's triangles along a direction, sorted.
#[derive(Debug, Default)]
pub(crate) struct Events {
    /// Where triangles start.
    starts: Vec<f32>,
    /// Where they end.
    ends: Vec<f32>,
    /// Where the flat ones start; these are not among `starts`. Empty unless ties are tolerated.
    flat_starts: Vec<f32>,
    /// Where the flat ones end.
    flat_ends: Vec<f32>,
}

impl Events {
    /// Takes the extents of all triangles of a node.
    pub(crate) fn fill(
        &mut self,
        extents: impl Iterator<Item = (f32, f32)>,
        tolerance: Option<f32>,
    ) {
        self.starts.clear();
        self.ends.clear();
        self.flat_starts.clear();
        self.flat_ends.clear();
        for (min, max) in extents {
            match tolerance {
                Some(tolerance) if is_flat((min, max), tolerance) => {
                    self.flat_starts.push(min);
                    self.flat_ends.push(max);
                }
                _ => self.starts.push(min),
            }
            self.ends.push(max);
        }
        for list in [
            &mut self.starts,
            &mut self.ends,
            &mut self.flat_starts,
            &mut self.flat_ends,
        ] {
            list.sort_unstable_by(f32::total_cmp);
        }
    }

    /// Whether a plane through an event passes through the inside of the cell.
    pub(crate) fn any_inside(&self, profile: &Profile) -> bool {
        // Of each sorted list, the first event that is high enough is the only one to look at.
        [&self.starts, &self.ends].into_iter().any(|events| {
            let first = events.partition_point(|&t| profile.is_at_or_below_inside(f64::from(t)));
            events
                .get(first)
                .is_some_and(|&t| profile.has_inside(f64::from(t)))
        })
    }

    /// The plane of fewest expected tests, `None` where no event lies strictly inside the cell;
    /// and the number of events that do. Of equally good planes the first.
    pub(crate) fn sweep(
        &self,
        tolerance: Option<f32>,
        profile: &mut Profile,
        empty_bonus: f64,
    ) -> (Option<Best>, u64) {
        let mut search = Search {
            best: None,
            profile,
            empty_bonus,
        };
        let candidates = match tolerance {
            None => self.sweep_published(&mut search),
            Some(tolerance) => self.sweep_tolerant(tolerance, &mut search),
        };
        (search.best, candidates)
    }

    /// At each offset two planes differ: the triangles that start there are above, and those that
    /// end there too; or both are below.
    fn sweep_published(&self, search: &mut Search) -> u64 {
        let n = self.ends.len();
        let (mut started, mut ended, mut candidates) = (0, 0, 0);
        while ended < n {
            let t = match self.starts.get(started) {
                Some(&start) if start <= self.ends[ended] => start,
                _ => self.ends[ended],
            };
            let starting = run_length(&self.starts[started..], t);
            let ending = run_length(&self.ends[ended..], t);
            if search.is_inside(t) {
                candidates += (starting + ending) as u64;
                if starting > 0 {
                    search.consider(t, Touching::Above, started, n - ended);
                }
                if ending > 0 {
                    search.consider(t, Touching::Below, started + starting, n - ended - ending);
                }
            }
            started += starting;
            ended += ending;
        }
        candidates
    }

    /// At each offset two planes differ where triangles lie in it: they are all below or all above.
    fn sweep_tolerant(&self, tolerance: f32, search: &mut Search) -> u64 {
        let n = self.ends.len();
        // Two positions in each list: the next candidate, and the first that is not yet passed.
        let (mut next_start, mut next_end) = (0, 0);
        let (mut started, mut ended, mut flat_started, mut flat_ended) = (0, 0, 0, 0);
        let mut candidates = 0;
        loop {
            let t = match (self.starts.get(next_start), self.ends.get(next_end)) {
                (Some(&start), Some(&end)) => start.min(end),
                (None, Some(&end)) => end,
                _ => return candidates,
            };
            let starting = run_length(&self.starts[next_start..], t);
            let ending = run_length(&self.ends[next_end..], t);
            next_start += starting;
            next_end += ending;
            if !search.is_inside(t) {
                continue;
            }
            candidates += (starting + ending) as u64;
            let is_below = |min: f32| min + tolerance < t;
            let is_not_above = |max: f32| max - tolerance <= t;
            pass(&self.starts, &mut started, is_below);
            pass(&self.ends, &mut ended, is_not_above);
            pass(&self.flat_starts, &mut flat_started, is_below);
            pass(&self.flat_ends, &mut flat_ended, is_not_above);
            let touching = |flat| Touching::Tolerated { tolerance, flat };
            let (below, above) = (started + flat_ended, n - ended);
            search.consider(t, touching(Side::Below), below, above);
            let held = flat_ended - flat_started;
            if held > 0 {
                search.consider(t, touching(Side::Above), below - held, above + held);
            }
        }
    }
}

/// Moves a position in a list past the values that are `passed`.
fn pass(values: &[f32], position: &mut usize, passed: impl Fn(f32) -> bool) {
    while values.get(*position).is_some_and(|&value| passed(value)) {
        *position += 1;
    }
}

/// How many of the first values are `t`.
fn run_length(values: &[f32], t: f32) -> usize {
    values.iter().take_while(|&&value| value == t).count()
}

struct Search<'a> {
    best: Option<Best>,
    profile: &'a mut Profile,
    empty_bonus: f64,
}

impl Search<'_> {
    fn is_inside(&self, t: f32) -> bool {
        self.profile.has_inside(f64::from(t))
    }

    fn consider(&mut self, t: f32, touching: Touching, below: usize, above: usize) {
        let boundary = Boundary {
            offset: t,
            touching,
        };
        let areas = self.profile.areas(f64::from(t));
        let found = Best::price(boundary, areas, below, above, self.empty_bonus);
        if self
            .best
            .is_none_or(|best| found.expected_tests < best.expected_tests)
        {
            self.best = Some(found);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Aabb;
    use proptest::prelude::*;

    fn extents() -> impl Strategy<Value = Vec<(f32, f32)>> {
        let on_grid =
            (0i8..=10, 0i8..4).prop_map(|(min, length)| (f32::from(min), f32::from(min + length)));
        let anywhere = (0.0f32..10.0, 0.0f32..3.0).prop_map(|(min, length)| (min, min + length));
        let near_grid =
            (0i8..=10, -2e-6f32..2e-6, 0i8..2, -2e-6f32..2e-6).prop_map(|(min, a, length, b)| {
                let (min, max) = (f32::from(min) + a, f32::from(min + length) + b);
                (min.min(max), min.max(max))
            });
        prop::collection::vec(prop_oneof![on_grid, anywhere, near_grid], 1..40)
    }

    proptest! {
        #![proptest_config(crate::testing::cases(2_000))]

        /// The counts of the sweep are those of the partition, at the best plane: so its cost is
        /// what the predicate gives, and no plane through an event is better.
        #[test]
        fn the_sweep_finds_the_best_plane_by_the_predicate(extents in extents(), tolerant in any::<bool>()) {
            let tolerance = tolerant.then_some(1e-5f32);
            let cell = Aabb { min: [-1.0, 0.0, 0.0], max: [12.0, 2.0, 3.0] };
            let mut profile = Profile::default();
            profile.fill_box(&cell, 0);
            let mut events = Events::default();
            events.fill(extents.iter().copied(), tolerance);
            let (best, candidates) = events.sweep(tolerance, &mut profile, 0.0);
            let mut expected: Option<f64> = None;
            let mut inside = 0;
            // A flat triangle has one event, its end.
            let events = extents.iter().flat_map(|&(min, max)| match tolerance {
                Some(tolerance) if is_flat((min, max), tolerance) => vec![max],
                _ => vec![min, max],
            });
            for t in events {
                if !(-1.0 < t && t < 12.0) {
                    continue;
                }
                inside += 1;
                let rules = match tolerance {
                    Some(tolerance) => [Side::Below, Side::Above].map(|flat| Touching::Tolerated { tolerance, flat }).to_vec(),
                    None => vec![Touching::Above, Touching::Below],
                };
                for touching in rules {
                    let boundary = Boundary { offset: t, touching };
                    let sides: Vec<_> = extents.iter().map(|&extent| boundary.sides(extent)).collect();
                    let below = sides.iter().filter(|s| s.0).count() as f64;
                    let above = sides.iter().filter(|s| s.1).count() as f64;
                    profile.fill_box(&cell, 0);
                    let (area_below, area_above) = profile.areas(f64::from(t));
                    let tests = area_below * below + area_above * above;
                    expected = Some(expected.map_or(tests, |e: f64| e.min(tests)));
                }
            }
            prop_assert_eq!(best.map(|b| b.expected_tests), expected);
            prop_assert_eq!(candidates, inside);
        }
    }
}
