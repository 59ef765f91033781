//! Where triangles start and end along the directions of the whole tree: sorted once, then divided
//! among children in order [WaldHavran2006].

use super::sweep::{Lists, Timed};
use super::ties::is_flat;

/// In a node of more triangles than this, lists are kept; fewer are compared each with each.
pub(super) const LISTS_FROM: usize = 17;

/// The most directions whose lists are kept sorted; more are sorted node by node, which takes less
/// memory.
pub(super) const MAX_LISTED: usize = 16;

/// Lists of at least so many events are divided by two threads.
const SHARED_FROM: usize = 1 << 15;

/// Where a triangle starts or ends.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Event {
    t: f32,
    triangle: u32,
}

impl Timed for Event {
    #[inline(always)]
    fn t(self) -> f32 {
        self.t
    }
}

/// The sorted lists of a node: for each direction the starts, the ends, and where those that are
/// flat start and end, one after another.
#[derive(Clone, Debug)]
pub(super) struct SortedLists {
    events: Vec<Event>,
    /// Where each list ends.
    ends: [u32; 4 * MAX_LISTED],
    directions: usize,
}

impl SortedLists {
    fn empty(directions: usize) -> Self {
        SortedLists {
            events: Vec::new(),
            ends: [0; 4 * MAX_LISTED],
            directions,
        }
    }

    /// The lists of a root: `extent` gives that of a triangle along a direction.
    pub(super) fn sort(
        triangles: &[u32],
        directions: usize,
        tolerance: Option<f32>,
        extent: impl Fn(usize, u32) -> (f32, f32) + Sync,
    ) -> Self {
        use rayon::prelude::*;
        let sorted: Vec<[Vec<Event>; 4]> = (0..directions)
            .into_par_iter()
            .map(|direction| {
                let mut lists: [Vec<Event>; 4] = Default::default();
                let [starts, ends, flat_starts, flat_ends] = &mut lists;
                for &triangle in triangles {
                    let (min, max) = extent(direction, triangle);
                    let [start, end] = [min, max].map(|t| Event { t, triangle });
                    ends.push(end);
                    if tolerance.is_some_and(|tolerance| is_flat((min, max), tolerance)) {
                        flat_starts.push(start);
                        flat_ends.push(end);
                    } else {
                        starts.push(start);
                    }
                }
                lists.iter_mut().for_each(|list| {
                    list.par_sort_unstable_by(|a, b| {
                        a.t.total_cmp(&b.t).then(a.triangle.cmp(&b.triangle))
                    });
                });
                lists
            })
            .collect();
        let mut all = SortedLists::empty(directions);
        for (end, list) in all.ends.iter_mut().zip(sorted.iter().flatten()) {
            all.events.extend_from_slice(list);
            *end = all.events.len() as u32;
        }
        all
    }

    /// The lists of one direction.
    pub(super) fn of(&self, direction: usize) -> Lists<'_, Event> {
        let list = |i: usize| {
            let at = 4 * direction + i;
            let start = if at == 0 { 0 } else { self.ends[at - 1] };
            &self.events[start as usize..self.ends[at] as usize]
        };
        Lists::all([list(0), list(1), list(2), list(3)])
    }

    /// The lists of both children, where they are wanted. `sides[triangle]` is 1 for those below,
    /// 2 for those above, 3 for both.
    pub(super) fn divide(&self, sides: &[u8], wanted: [bool; 2]) -> [Option<Box<SortedLists>>; 2] {
        match wanted {
            [false, false] => [None, None],
            [true, false] => [Some(Box::new(self.pick(sides, 1))), None],
            [false, true] => [None, Some(Box::new(self.pick(sides, 2)))],
            [true, true]
                if self.events.len() >= SHARED_FROM && rayon::current_num_threads() > 1 =>
            {
                let (below, above) = rayon::join(|| self.pick(sides, 1), || self.pick(sides, 2));
                [below, above].map(|lists| Some(Box::new(lists)))
            }
            [true, true] => self.both(sides).map(|lists| Some(Box::new(lists))),
        }
    }

    fn pick(&self, sides: &[u8], side: u8) -> SortedLists {
        let mut part = SortedLists::empty(self.directions);
        part.events = vec![Event::default(); self.events.len()];
        let (mut start, mut count) = (0, 0);
        for list in 0..4 * self.directions {
            let end = self.ends[list] as usize;
            for &event in &self.events[start..end] {
                // Written whether it is kept or not: what is not is overwritten.
                part.events[count] = event;
                count += usize::from(sides[event.triangle as usize] & side != 0);
            }
            part.ends[list] = count as u32;
            start = end;
        }
        part.events.truncate(count);
        part.events.shrink_to_fit();
        part
    }

    fn both(&self, sides: &[u8]) -> [SortedLists; 2] {
        let mut below = SortedLists::empty(self.directions);
        let mut above = SortedLists::empty(self.directions);
        let all = self.events.len();
        below.events = vec![Event::default(); all + 1];
        above.events = vec![Event::default(); all + 1];
        let (mut start, mut i, mut j) = (0, 0, 0);
        for list in 0..4 * self.directions {
            let end = self.ends[list] as usize;
            for &event in &self.events[start..end] {
                let side = sides[event.triangle as usize];
                below.events[i] = event;
                above.events[j] = event;
                i += usize::from(side & 1);
                j += usize::from(side >> 1);
            }
            below.ends[list] = i as u32;
            above.ends[list] = j as u32;
            start = end;
        }
        for (part, count) in [(&mut below, i), (&mut above, j)] {
            part.events.truncate(count);
            part.events.shrink_to_fit();
        }
        [below, above]
    }
}
