//! What of a tree is still to be visited.

use std::mem::MaybeUninit;

use super::node;
use crate::query::simd::Eight;
use crate::query::traverse::Search;
use crate::tree::wide::{Link, MAX_DEPTH, MAX_FRAMES, WIDTH, Wide, WideNode};

/// A child of a node, as a traversal keeps it until its visit.
pub(super) trait Place: Copy {
    /// Whether children are put in order without a branch that depends on it, which takes longer
    /// where the order is easy to foresee, or little else depends on it.
    const RANKED: bool;
    fn new(index: usize, node: &WideNode, slot: usize) -> Self;
    fn link(&self) -> Link;
}

impl Place for Link {
    const RANKED: bool = false;

    #[inline(always)]
    fn new(_: usize, node: &WideNode, slot: usize) -> Self {
        node.children[slot]
    }

    #[inline(always)]
    fn link(&self) -> Link {
        *self
    }
}

/// A child that is still to be visited, and where its box is entered.
#[derive(Clone, Copy)]
struct Entry<P> {
    near: f32,
    place: P,
}

/// Children of a node that are still to be visited, in their order, a bit for each.
#[derive(Clone, Copy)]
struct Rest {
    node: u32,
    children: u32,
}

/// What is still to be visited: as an [`Entry`] where hits are best found in their order along the
/// ray, otherwise as a [`Rest`].
#[derive(Clone, Copy)]
union Pending<P: Copy> {
    entry: Entry<P>,
    rest: Rest,
}

/// Every visit takes a child off and puts up to eight on.
const STACK: usize = (WIDTH - 1) * MAX_DEPTH + 1;

/// The memory of a [`Stack`] and of [`Frames`]. It lies apart, since moving it would take longer than
/// a ray does.
pub(super) struct Space<P: Copy, F, const FRAMES: usize> {
    stack: [MaybeUninit<Pending<P>>; STACK],
    frames: [MaybeUninit<F>; FRAMES],
}

impl<P: Copy, F, const FRAMES: usize> Space<P, F, FRAMES> {
    pub(super) const NEW: Self = Space {
        stack: [MaybeUninit::uninit(); STACK],
        frames: [const { MaybeUninit::uninit() }; FRAMES],
    };

    /// With nothing in it.
    #[inline(always)]
    pub(super) fn emptied(&mut self) -> (Stack<'_, P>, Frames<'_, F, FRAMES>) {
        (
            Stack {
                slots: &mut self.stack,
                depth: 0,
            },
            Frames {
                known: &mut self.frames,
                met: 0,
            },
        )
    }
}

/// What is known in the frames that have been met last.
pub(super) struct Frames<'s, F, const FRAMES: usize> {
    /// Each frame has a place, which it may share with others.
    known: &'s mut [MaybeUninit<F>; FRAMES],
    /// A bit for each frame that is written.
    met: u64,
}

impl<F, const FRAMES: usize> Frames<'_, F, FRAMES> {
    /// A bit for each frame that has the first place.
    const FIRST: u64 = {
        assert!(MAX_FRAMES <= 64 && MAX_FRAMES.is_multiple_of(FRAMES));
        let (mut frames, mut frame) = (0, 0);
        while frame < MAX_FRAMES {
            frames |= 1 << frame;
            frame += FRAMES;
        }
        frames
    };

    /// `None` if the frame has not been met, or another has taken its place.
    #[inline(always)]
    pub(super) fn get(&self, frame: u32) -> Option<&F> {
        if self.met >> frame & 1 == 0 {
            return None;
        }
        // SAFETY: the bit says that it has been written.
        Some(unsafe { self.known[frame as usize % FRAMES].assume_init_ref() })
    }

    #[inline(always)]
    pub(super) fn meet(&mut self, frame: u32, known: F) -> &mut F {
        let place = frame as usize % FRAMES;
        self.met = self.met & !(Self::FIRST << place) | 1 << frame;
        self.known[place].write(known)
    }
}

pub(super) struct Stack<'s, P: Copy> {
    slots: &'s mut [MaybeUninit<Pending<P>>; STACK],
    /// How many of them are filled.
    depth: usize,
}

impl<P: Place> Stack<'_, P> {
    /// Of the children of a node that are met, a bit for each of at least one, the one to be visited
    /// first; the others are kept for later. `near` is where their boxes are entered.
    #[inline(always)]
    pub(super) fn choose<L: Eight, S: Search>(
        &mut self,
        wide: &Wide,
        (index, node): (usize, &WideNode),
        met: u32,
        near: L,
    ) -> P {
        let first = met.trailing_zeros() as usize;
        let mut others = met & (met - 1);
        if others == 0 {
            return P::new(index, node, first);
        }
        if S::NEAREST_FIRST && P::RANKED {
            self.rank::<L>(wide, (index, node), met, near)
        } else if S::NEAREST_FIRST {
            let near = near.to_array();
            let best = Entry::new(&near, (index, node), first);
            let other = Entry::new(&near, (index, node), others.trailing_zeros() as usize);
            others &= others - 1;
            let (mut best, other) = Entry::in_order(best, other);
            let bottom = self.depth;
            self.push::<L>(wide, other);
            while others != 0 {
                let mut other = Entry::new(&near, (index, node), others.trailing_zeros() as usize);
                others &= others - 1;
                if other.near < best.near {
                    std::mem::swap(&mut other, &mut best);
                }
                self.push::<L>(wide, other);
                // Nearer ones on top.
                let mut at = self.depth - 1;
                while at > bottom && self.entry(at - 1).near < other.near {
                    self.set(at, self.get(at - 1));
                    at -= 1;
                }
                self.set(at, Pending { entry: other });
            }
            best.place
        } else {
            L::prefetch(wide.address(node.children[others.trailing_zeros() as usize]));
            let rest = Rest {
                node: index as u32,
                children: others,
            };
            self.set(self.depth, Pending { rest });
            self.depth += 1;
            P::new(index, node, first)
        }
    }

    /// Puts each child where it belongs, by how many are nearer, and takes the nearest one off.
    #[inline(always)]
    fn rank<L: Eight>(&mut self, wide: &Wide, node: (usize, &WideNode), met: u32, nears: L) -> P {
        let near = nears.to_array();
        let top = self.depth + met.count_ones() as usize - 1;
        let mut rest = met;
        while rest != 0 {
            let entry: Entry<P> = Entry::new(&near, node, rest.trailing_zeros() as usize);
            let this = L::splat(entry.near);
            let earlier = (rest & rest.wrapping_neg()) - 1;
            rest &= rest - 1;
            let nearer = met & (nears.lt(this) | nears.le(this) & earlier);
            L::prefetch(wide.address(entry.place.link()));
            self.set(top - nearer.count_ones() as usize, Pending { entry });
        }
        self.depth = top + 1;
        let nearest = self.entry(top).place;
        self.depth = top;
        nearest
    }

    /// Takes the next child that is entered within the limit off the stack; false if there is none.
    #[inline(always)]
    pub(super) fn pop<S: Search>(&mut self, wide: &Wide, limit: f32, next: &mut P) -> bool {
        if !S::NEAREST_FIRST {
            return self.pop_rest(wide, next);
        }
        while self.depth > 0 {
            let entry = self.entry(self.depth - 1);
            self.depth -= 1;
            if entry.near <= limit {
                *next = entry.place;
                return true;
            }
        }
        false
    }

    /// Takes the next of the children on top of the stack. The limit has not changed, so all of
    /// them are still wanted.
    #[inline(always)]
    fn pop_rest(&mut self, wide: &Wide, next: &mut P) -> bool {
        let Some(top) = self.depth.checked_sub(1) else {
            return false;
        };
        // SAFETY: a stack of a search that takes hits in any order holds nothing else.
        let Rest {
            node: index,
            children,
        } = unsafe { self.get(top).rest };
        debug_assert!(children != 0);
        let node = node(wide, index as usize);
        let slot = children.trailing_zeros() as usize % WIDTH;
        *next = P::new(index as usize, node, slot);
        let children = children & (children - 1);
        if children == 0 {
            self.depth = top;
        } else {
            // SAFETY: as in `set`; what is there is a `Rest`.
            unsafe {
                let rest = self.slots.get_unchecked_mut(top).assume_init_mut();
                rest.rest.children = children;
            }
        }
        true
    }

    /// Puts a child on the stack and asks for its memory.
    #[inline(always)]
    fn push<L: Eight>(&mut self, wide: &Wide, entry: Entry<P>) {
        L::prefetch(wide.address(entry.place.link()));
        self.set(self.depth, Pending { entry });
        self.depth += 1;
    }

    #[inline(always)]
    fn set(&mut self, at: usize, pending: Pending<P>) {
        debug_assert!(at < STACK);
        // SAFETY: no tree is deeper than MAX_DEPTH, by `collapse` and by `check_wide`.
        *unsafe { self.slots.get_unchecked_mut(at) } = MaybeUninit::new(pending);
    }

    #[inline(always)]
    fn entry(&self, at: usize) -> Entry<P> {
        // SAFETY: a stack of a search for nearest hits holds nothing else.
        unsafe { self.get(at).entry }
    }

    /// What is on the stack below its depth.
    #[inline(always)]
    fn get(&self, at: usize) -> Pending<P> {
        debug_assert!(at < self.depth);
        // SAFETY: all that is below the depth has been written, and callers look at nothing else.
        unsafe { self.slots.get_unchecked(at).assume_init() }
    }
}

impl<P: Place> Entry<P> {
    /// The nearer one first. Without a branch: which one that is is hard to foresee.
    #[inline(always)]
    fn in_order(a: Self, b: Self) -> (Self, Self) {
        let swap = b.near < a.near;
        (
            std::hint::select_unpredictable(swap, b, a),
            std::hint::select_unpredictable(swap, a, b),
        )
    }

    #[inline(always)]
    fn new(near: &[f32; WIDTH], (index, node): (usize, &WideNode), slot: usize) -> Self {
        Entry {
            near: near[slot],
            place: P::new(index, node, slot),
        }
    }
}
