//! Counting the triangles on either side of all planes along one direction: sort the events and
//! sweep [WaldHavran2006], or, where they are few, compare each with each.

use super::extents::Extents;
use super::search::Search;
use super::ties::is_flat;

/// Up to so many triangles are compared each with each.
pub(super) const FEW: usize = 16;

/// Bins along a direction, for bounds.
const BINS: usize = 32;

/// If planes may matter in more bins than this, the most promising one is looked at first.
const WORTH_A_LOOK: usize = 4;

/// Whether a plane passes through the inside of a cell, of which this is the extent.
#[inline(always)]
fn is_inside((low, high): (f64, f64), t: f32) -> bool {
    let t = f64::from(t);
    low < t && t < high
}

/// What is somewhere along a direction.
pub(super) trait Timed: Copy {
    fn t(self) -> f32;
}

impl Timed for f32 {
    #[inline(always)]
    fn t(self) -> f32 {
        self
    }
}

/// Where a node's triangles start and end along a direction, sorted.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lists<'a, E> {
    /// Where triangles start.
    pub(super) starts: &'a [E],
    /// Where they end.
    pub(super) ends: &'a [E],
    /// Where the flat ones start; these are not among `starts`. Empty unless ties are tolerated.
    pub(super) flat_starts: &'a [E],
    /// Where the flat ones end.
    pub(super) flat_ends: &'a [E],
    /// How many of each list come before those that are there, and how many triangles there are.
    pub(super) before: [usize; 4],
    pub(super) triangles: usize,
    /// Between which offsets, both included, planes are candidates.
    pub(super) candidates: (f32, f32),
}

impl<'a, E> Lists<'a, E> {
    /// Lists that are all there.
    pub(super) fn all([starts, ends, flat_starts, flat_ends]: [&'a [E]; 4]) -> Self {
        Lists {
            starts,
            ends,
            flat_starts,
            flat_ends,
            before: [0; 4],
            triangles: ends.len(),
            candidates: (f32::NEG_INFINITY, f32::INFINITY),
        }
    }
}

/// Buffers for sorting.
#[derive(Debug, Default)]
pub(super) struct Events([Vec<f32>; 4]);

/// Considers all planes through events, and says how many of the events lie inside the cell.
pub(super) fn search_extents(
    extents: &mut Extents,
    tolerance: Option<f32>,
    events: &mut Events,
    search: &mut Search,
) -> u64 {
    match extents.mins.len() {
        0..=2 => return compare::<2>(extents, tolerance, search),
        3..=4 => return compare::<4>(extents, tolerance, search),
        5..=8 => return compare::<8>(extents, tolerance, search),
        9..=FEW => return compare::<FEW>(extents, tolerance, search),
        _ => {}
    }
    search_bins(extents, tolerance, events, search);
    count_inside(extents, tolerance, search)
}

/// Considers all planes through events that may matter.
fn search_bins(
    extents: &Extents,
    tolerance: Option<f32>,
    events: &mut Events,
    search: &mut Search,
) {
    let Some(histogram) = Histogram::of(extents, tolerance, search) else {
        return;
    };
    let mut look = |bins: Bins, search: &mut Search| {
        let lists = events.sort_between(extents, tolerance, &bins);
        sweep(&lists, tolerance, search);
    };
    let Some((mut bins, promising)) = histogram.that_matter(search) else {
        return;
    };
    if search.learns_at_once() && bins.last - bins.first > WORTH_A_LOOK {
        // The most promising bin alone may leave little of the others.
        look(bins.only(promising), search);
        search.probe();
        match histogram.that_matter(search) {
            Some((left, _)) => bins = left,
            None => return,
        }
    }
    look(bins, search);
}

/// Whether an event lies inside the cell that is a candidate; where ties are tolerated, the start
/// of a flat triangle is none.
fn count_inside(extents: &Extents, tolerance: Option<f32>, search: &Search) -> u64 {
    let inside = |t: f32| u64::from(is_inside(search.inside(), t));
    let pairs = extents.mins.iter().zip(&extents.maxs);
    match tolerance {
        None => pairs.map(|(&min, &max)| inside(min) + inside(max)).sum(),
        Some(tolerance) => pairs
            .map(|(&min, &max)| {
                let starts = u64::from(!is_flat((min, max), tolerance));
                starts * inside(min) + inside(max)
            })
            .sum(),
    }
}

/// Equal parts of a cell's extent, and those of them that planes may matter in.
#[derive(Clone, Copy, Debug)]
struct Bins {
    low: f64,
    per_width: f64,
    first: usize,
    last: usize,
}

/// How many triangles start and end in each bin.
struct Histogram {
    /// All bins.
    bins: Bins,
    width: f64,
    starts: [u32; BINS],
    ends: [u32; BINS],
    count: usize,
}

impl Histogram {
    /// `None` where no plane passes through the inside.
    fn of(extents: &Extents, tolerance: Option<f32>, search: &mut Search) -> Option<Self> {
        let (low, high) = search.inside();
        if low.partial_cmp(&high) != Some(std::cmp::Ordering::Less) {
            return None;
        }
        search.find_end_faces();
        let width = (high - low) / BINS as f64;
        let bins = Bins {
            low,
            per_width: 1.0 / width,
            first: 0,
            last: BINS - 1,
        };
        let tolerance = tolerance.unwrap_or(0.0);
        let (mut starts, mut ends) = ([0u32; BINS], [0u32; BINS]);
        for (&min, &max) in extents.mins.iter().zip(&extents.maxs) {
            // A triangle is below where it starts before a plane by more than the tolerance, and
            // above where it ends after it by more.
            starts[bins.of(min + tolerance)] += 1;
            ends[bins.of(max - tolerance)] += 1;
        }
        Some(Histogram {
            bins,
            width,
            starts,
            ends,
            count: extents.mins.len(),
        })
    }

    /// From the first to the last bin that a plane may matter in, by bounds, and the bin with the
    /// least; `None` if there is none. In a bin, at least those triangles are below that end before
    /// it starts, and those above that begin after it ends.
    fn that_matter(&self, search: &Search) -> Option<(Bins, usize)> {
        let (mut first, mut last, mut promising) = (BINS, 0, 0);
        let mut least = f64::INFINITY;
        let (mut below, mut above) = (0, self.count);
        for i in 0..BINS {
            above -= self.ends[i] as usize;
            // What rounds into a neighbouring bin is in its bounds too.
            let from = self.bins.low + (i as f64 - 1e-6) * self.width;
            let to = from + (1.0 + 2e-6) * self.width;
            let bound = search.bound_between(from, to, below, above);
            if bound < search.bar() {
                first = first.min(i);
                last = i;
            }
            if bound < least {
                (promising, least) = (i, bound);
            }
            below += self.starts[i] as usize;
        }
        let bins = Bins {
            first,
            last,
            ..self.bins
        };
        (first < BINS).then_some((bins, promising))
    }
}

impl Bins {
    fn only(self, bin: usize) -> Bins {
        Bins {
            first: bin,
            last: bin,
            ..self
        }
    }

    /// The bin of an offset; those out of the cell are in the first or in the last one.
    #[inline(always)]
    fn of(&self, t: f32) -> usize {
        ((f64::from(t) - self.low) * self.per_width).clamp(0.0, (BINS - 1) as f64) as usize
    }

    fn matters(&self, t: f32) -> bool {
        (self.first..=self.last).contains(&self.of(t))
    }
}

impl Events {
    #[cfg(test)]
    pub(super) fn sort(&mut self, extents: &Extents, tolerance: Option<f32>) -> Lists<'_, f32> {
        let Events(lists) = self;
        lists.iter_mut().for_each(Vec::clear);
        let [starts, ends, flat_starts, flat_ends] = lists;
        ends.extend_from_slice(&extents.maxs);
        match tolerance {
            None => starts.extend_from_slice(&extents.mins),
            Some(tolerance) => {
                for (&min, &max) in extents.mins.iter().zip(&extents.maxs) {
                    if is_flat((min, max), tolerance) {
                        flat_starts.push(min);
                        flat_ends.push(max);
                    } else {
                        starts.push(min);
                    }
                }
            }
        }
        Events::sorted(lists)
    }

    fn sorted(lists: &mut [Vec<f32>; 4]) -> Lists<'_, f32> {
        for list in &mut *lists {
            list.sort_unstable_by(f32::total_cmp);
        }
        Lists::all(lists.each_ref().map(Vec::as_slice))
    }

    /// Sorts what is near the planes in those bins, which are the only candidates; the rest is only
    /// counted.
    ///
    /// A triangle passes a plane where it starts or ends, the tolerance added or taken away. What
    /// does so in an earlier bin than the plane's has passed it, and what does so in a later one has
    /// not, since bins are monotonic.
    fn sort_between(
        &mut self,
        extents: &Extents,
        tolerance: Option<f32>,
        bins: &Bins,
    ) -> Lists<'_, f32> {
        let Events(lists) = self;
        lists.iter_mut().for_each(Vec::clear);
        let mut before = [0; 4];
        let mut candidates = (f32::INFINITY, f32::NEG_INFINITY);
        let mut enter = |list: usize, t: f32, passes: f32, is_candidate: bool| {
            let is_candidate = is_candidate && bins.matters(t);
            if is_candidate {
                candidates = (candidates.0.min(t), candidates.1.max(t));
            }
            if is_candidate || bins.matters(passes) {
                lists[list].push(t);
            } else if bins.of(passes) < bins.first {
                before[list] += 1;
            }
        };
        for (&min, &max) in extents.mins.iter().zip(&extents.maxs) {
            let reach = tolerance.unwrap_or(0.0);
            enter(1, max, max - reach, true);
            if tolerance.is_some_and(|tolerance| is_flat((min, max), tolerance)) {
                enter(2, min, min + reach, false);
                enter(3, max, max - reach, false);
            } else {
                enter(0, min, min + reach, true);
            }
        }
        Lists {
            before,
            triangles: extents.mins.len(),
            candidates,
            ..Events::sorted(lists)
        }
    }
}

/// As [`sweep`], for up to `N` triangles, by comparing each with each.
fn compare<const N: usize>(extents: &Extents, tolerance: Option<f32>, search: &mut Search) -> u64 {
    let n = extents.mins.len();
    let padded = |values: &[f32]| {
        let mut all = [f32::INFINITY; N];
        all[..n].copy_from_slice(values);
        all
    };
    let (mins, maxs) = (padded(&extents.mins), padded(&extents.maxs));
    // For all planes at a time: how many of the values are before them, or not after them.
    let before = |values: &[f32; N], planes: &[f32; N]| {
        let mut counts = [0u32; N];
        for &value in &values[..n] {
            for (count, &t) in counts.iter_mut().zip(planes) {
                *count += u32::from(value < t);
            }
        }
        counts
    };
    let up_to = |values: &[f32; N], planes: &[f32; N]| {
        let mut counts = [0u32; N];
        for &value in &values[..n] {
            for (count, &t) in counts.iter_mut().zip(planes) {
                *count += u32::from(value <= t);
            }
        }
        counts
    };
    let mut candidates = 0;
    let Some(tolerance) = tolerance else {
        let started = (before(&mins, &mins), up_to(&mins, &maxs));
        let ended = (before(&maxs, &mins), up_to(&maxs, &maxs));
        for i in 0..n {
            if is_inside(search.inside(), mins[i]) {
                candidates += 1;
                search.consider(mins[i], 0, started.0[i] as usize, n - ended.0[i] as usize);
            }
            if is_inside(search.inside(), maxs[i]) {
                candidates += 1;
                search.consider(maxs[i], 1, started.1[i] as usize, n - ended.1[i] as usize);
            }
        }
        return candidates;
    };
    let begin = mins.map(|min| min + tolerance);
    let end = maxs.map(|max| max - tolerance);
    let (mut flat_begin, mut flat_end) = ([f32::INFINITY; N], [f32::INFINITY; N]);
    let mut flat = [false; N];
    for i in 0..n {
        flat[i] = begin[i] >= end[i];
        if flat[i] {
            (flat_begin[i], flat_end[i]) = (begin[i], end[i]);
        }
    }
    let any_flat = flat.contains(&true);
    // The start of a flat triangle is no candidate.
    let mut starts = mins;
    for i in 0..n {
        if flat[i] {
            starts[i] = f32::INFINITY;
        }
    }
    for planes in [&starts, &maxs] {
        let (started, ended) = (before(&begin, planes), up_to(&end, planes));
        // Those that are flat are below where they end before the plane.
        let held = match any_flat {
            true => {
                let (begun, over) = (before(&flat_begin, planes), up_to(&flat_end, planes));
                std::array::from_fn(|i| over[i] - begun[i])
            }
            false => [0; N],
        };
        for i in 0..n {
            if !is_inside(search.inside(), planes[i]) {
                continue;
            }
            candidates += 1;
            // Neighbours share corners: what was considered once is known.
            if planes[..i].contains(&planes[i]) {
                continue;
            }
            let [started, ended, held] = [started[i], ended[i], held[i]].map(|n| n as usize);
            let (below, above) = (started + held, n - ended);
            search.consider(planes[i], 0, below, above);
            if held > 0 {
                search.consider(planes[i], 1, below - held, above + held);
            }
        }
    }
    candidates
}

/// Considers all planes through events, in order, and says how many of the events lie inside the
/// cell.
pub(super) fn sweep<E: Timed>(
    lists: &Lists<E>,
    tolerance: Option<f32>,
    search: &mut Search,
) -> u64 {
    match tolerance {
        None => sweep_published(lists, search),
        Some(tolerance) => sweep_tolerant(lists, tolerance, search),
    }
}

/// At each offset two planes differ: the triangles that start there are above, and those that end
/// there too; or both are below.
fn sweep_published<E: Timed>(lists: &Lists<E>, search: &mut Search) -> u64 {
    let Lists { starts, ends, .. } = *lists;
    let n = lists.triangles;
    let [starts_before, ends_before, ..] = lists.before;
    let (mut next_start, mut next_end, mut candidates) = (0, 0, 0);
    while let Some(t) = earlier(starts.get(next_start), ends.get(next_end)) {
        let starting = run_length(&starts[next_start..], t);
        let ending = run_length(&ends[next_end..], t);
        if is_candidate(lists, search, t) {
            candidates += (starting + ending) as u64;
            let (started, ended) = (starts_before + next_start, ends_before + next_end);
            if starting > 0 {
                search.consider(t, 0, started, n - ended);
            }
            if ending > 0 {
                search.consider(t, 1, started + starting, n - ended - ending);
            }
        }
        next_start += starting;
        next_end += ending;
    }
    candidates
}

/// At each offset two planes differ where triangles lie in it: they are all below or all above.
fn sweep_tolerant<E: Timed>(lists: &Lists<E>, tolerance: f32, search: &mut Search) -> u64 {
    let Lists {
        starts,
        ends,
        flat_starts,
        flat_ends,
        ..
    } = *lists;
    let n = lists.triangles;
    let before = lists.before;
    // Two positions in each list: the next candidate, and the first that is not yet passed.
    let (mut next_start, mut next_end) = (0, 0);
    let (mut started, mut ended, mut flat_started, mut flat_ended) = (0, 0, 0, 0);
    let mut candidates = 0;
    while let Some(t) = earlier(starts.get(next_start), ends.get(next_end)) {
        let starting = run_length(&starts[next_start..], t);
        let ending = run_length(&ends[next_end..], t);
        next_start += starting;
        next_end += ending;
        if !is_candidate(lists, search, t) {
            continue;
        }
        candidates += (starting + ending) as u64;
        let is_below = |min: f32| min + tolerance < t;
        let is_not_above = |max: f32| max - tolerance <= t;
        pass(starts, &mut started, is_below);
        pass(ends, &mut ended, is_not_above);
        pass(flat_starts, &mut flat_started, is_below);
        pass(flat_ends, &mut flat_ended, is_not_above);
        let over = before[3] + flat_ended;
        let (below, above) = (before[0] + started + over, n - before[1] - ended);
        search.consider(t, 0, below, above);
        let held = over - before[2] - flat_started;
        if held > 0 {
            search.consider(t, 1, below - held, above + held);
        }
    }
    candidates
}

/// The offset of the earlier one of two events.
#[inline(always)]
fn earlier<E: Timed>(start: Option<&E>, end: Option<&E>) -> Option<f32> {
    match (start, end) {
        (Some(start), Some(end)) => {
            let (start, end) = (start.t(), end.t());
            Some(if start < end { start } else { end })
        }
        (event, None) | (None, event) => event.map(|event| event.t()),
    }
}

#[inline(always)]
fn is_candidate<E>(lists: &Lists<E>, search: &Search, t: f32) -> bool {
    let (first, last) = lists.candidates;
    first <= t && t <= last && is_inside(search.inside(), t)
}

/// Moves a position in a list past the values that are `passed`.
#[inline(always)]
fn pass<E: Timed>(values: &[E], position: &mut usize, passed: impl Fn(f32) -> bool) {
    while values.get(*position).is_some_and(|value| passed(value.t())) {
        *position += 1;
    }
}

/// How many of the first values are `t`.
#[inline(always)]
fn run_length<E: Timed>(values: &[E], t: f32) -> usize {
    values.iter().take_while(|value| value.t() == t).count()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::build::search::{Best, SearchScratch, touching};
    use crate::build::ties::Boundary;
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

        /// Each way to count gives what the predicate gives: so the best plane's cost is right, and
        /// no plane through an event is better.
        #[test]
        fn the_best_plane_is_that_of_the_predicate(extents in extents(), tolerant in any::<bool>()) {
            let tolerance = tolerant.then_some(1e-5f32);
            let cell = Aabb { min: [-1.0, 0.0, 0.0], max: [12.0, 2.0, 3.0] };
            let mut scratch = SearchScratch::default();
            let mut found: Vec<(Option<Best>, u64)> = Vec::new();
            let (mins, maxs) = extents.iter().copied().unzip();
            let mut all = Extents { mins, maxs };
            let mut events = Events::default();
            for way in 0..2 {
                if way == 1 && extents.len() > FEW {
                    continue;
                }
                let limits = (f64::INFINITY, 0.0);
                let mut search = Search::new(cell.surface_area(), None, limits, &mut scratch);
                search.turn_in_box(&cell, 0);
                let candidates = match way {
                    0 => sweep(&events.sort(&all, tolerance), tolerance, &mut search),
                    _ => search_extents(&mut all, tolerance, &mut events, &mut search),
                };
                found.push((search.finish(tolerance).0.map(|(_, best)| best), candidates));
            }
            if let [swept, compared] = found[..] {
                prop_assert_eq!(swept, compared);
            }
            let (best, candidates) = found[0];
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
                for rule in [0, 1] {
                    let boundary = Boundary { offset: t, touching: touching(tolerance, rule) };
                    let sides: Vec<_> = extents.iter().map(|&extent| boundary.sides(extent)).collect();
                    let below = sides.iter().filter(|s| s.0).count() as f64;
                    let above = sides.iter().filter(|s| s.1).count() as f64;
                    let part = |length: f64| 12.0 + 10.0 * length;
                    let weight = part(f64::from(t) + 1.0) * below + part(12.0 - f64::from(t)) * above;
                    let tests = weight / part(13.0);
                    expected = Some(expected.map_or(tests, |e: f64| e.min(tests)));
                }
            }
            match (best, expected) {
                (Some(best), Some(expected)) => {
                    let found = best.expected_tests;
                    prop_assert!((found - expected).abs() <= 1e-12 * expected, "{found} {expected}");
                }
                (best, expected) => prop_assert!(best.is_none() && expected.is_none()),
            }
            prop_assert_eq!(candidates, inside);
        }
    }
}
