//! The traversal of a wide tree: eight boxes or eight triangles at a time.
//!
//! Boxes are widened by all that rounding can do, here and in the triangle test, so that a ray
//! visits every leaf in which the test would find a hit; triangles are only sorted out by a part of
//! the test that gives the same bits as the test itself, or where t is out of range by more than
//! rounding. So hits are those of testing every triangle. See "Why no hit is lost" in
//! ARCHITECTURE.md.
//!
//! No closures where lanes are handled: a closure is a function without the machine's
//! instructions, into which they cannot be inlined.
#![allow(unsafe_code)]

mod leaf;
mod line;

use std::mem::MaybeUninit;
use std::ops::ControlFlow;

use super::Counters;
use super::batch::Question;
use super::simd::{Instructions, Lanes, Task};
use super::traverse::Search;
use crate::geometry::{Frame, Ray};
use crate::tree::wide::{Child, Link, MAX_DEPTH, MAX_FRAMES, WIDTH, Wide, WideNode};
use line::{FrameRay, Line, Rows};

/// A child that is still to be visited, and where the ray enters its box.
#[derive(Clone, Copy)]
struct Entry {
    near: f32,
    link: Link,
}

impl Entry {
    #[inline(always)]
    fn new(near: &[f32; WIDTH], node: &WideNode, slot: usize) -> Self {
        Entry {
            near: near[slot],
            link: node.children[slot],
        }
    }
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
union Pending {
    entry: Entry,
    rest: Rest,
}

#[inline(always)]
fn splats<L: Lanes>([x, y, z]: [f32; 3]) -> [L; 3] {
    [L::splat(x), L::splat(y), L::splat(z)]
}

/// Every visit takes a child off and puts up to eight on.
const STACK: usize = (WIDTH - 1) * MAX_DEPTH + 1;

/// What a cursor writes to before it reads it. It lies apart, since moving it would take longer than
/// a ray does.
struct Space {
    stack: [MaybeUninit<Pending>; STACK],
    /// The ray in the frames that it has met.
    frames: [MaybeUninit<FrameRay>; MAX_FRAMES],
}

impl Space {
    const NEW: Space = Space {
        stack: [MaybeUninit::uninit(); STACK],
        frames: [MaybeUninit::uninit(); MAX_FRAMES],
    };
}

struct Walk<'a, S, C> {
    wide: &'a Wide,
    ray: &'a Ray,
    search: &'a mut S,
    counters: &'a mut C,
}

impl<S: Search, C: Counters> Task for Walk<'_, S, C> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self) {
        let Walk {
            wide,
            ray,
            search,
            counters,
        } = self;
        let mut space = Space::NEW;
        let mut cursor = Cursor::<L>::new(wide, ray, search, &mut space);
        while cursor.step(wide, search, counters) {}
    }
}

/// Visits what the ray meets, until the search has its answer.
#[inline]
pub(super) fn traverse<S: Search, C: Counters>(
    wide: &Wide,
    ray: &Ray,
    search: &mut S,
    counters: &mut C,
) {
    traverse_with(Instructions::best(), wide, ray, search, counters);
}

#[inline]
fn traverse_with<S: Search, C: Counters>(
    instructions: Instructions,
    wide: &Wide,
    ray: &Ray,
    search: &mut S,
    counters: &mut C,
) {
    instructions.run(Walk {
        wide,
        ray,
        search,
        counters,
    });
}

/// Many rays, each with a search of its own.
struct Batch<'a, Q: Question> {
    wide: &'a Wide,
    rays: &'a [Ray],
    answers: &'a mut [Q::Answer],
}

impl<Q: Question> Task for Batch<'_, Q> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self) {
        let Batch {
            wide,
            rays,
            answers,
        } = self;
        let mut space = Space::NEW;
        for (ray, answer) in rays.iter().zip(answers) {
            let mut search = Q::search(ray);
            if ray.is_valid() {
                let mut cursor = Cursor::<L>::new(wide, ray, &search, &mut space);
                while cursor.step(wide, &mut search, &mut ()) {}
            }
            *answer = Q::answer(&search);
        }
    }
}

/// Takes all rays through the tree.
pub(super) fn traverse_all<Q: Question>(wide: &Wide, rays: &[Ray], answers: &mut [Q::Answer]) {
    Instructions::best().run(Batch::<Q> {
        wide,
        rays,
        answers,
    });
}

/// Where a ray is on its way through a tree.
struct Cursor<'s, L> {
    line: Line,
    space: &'s mut Space,
    /// A bit for each frame that has been met and is in `space`.
    met: u64,
    frame: u32,
    inverse: [L; 3],
    entry: [L; 3],
    exit: [L; 3],
    rows: &'static Rows,
    t_min: L,
    ray_t_min: f32,
    /// Beyond this nothing is wanted any more.
    limit: f32,
    next: Link,
    /// How many entries the stack has.
    depth: usize,
}

impl<'s, L: Lanes> Cursor<'s, L> {
    #[inline(always)]
    fn new(wide: &Wide, ray: &Ray, search: &impl Search, space: &'s mut Space) -> Self {
        let line = Line::new(wide, ray);
        let (t_min, limit) = (line.t_below(ray.t_min), line.t_above(search.limit_above()));
        let FrameRay {
            inverse,
            offsets: [entry, exit],
            rows,
        } = line.in_world();
        Cursor {
            space,
            met: 0,
            frame: Frame::WORLD,
            inverse: splats(inverse),
            entry: splats(entry),
            exit: splats(exit),
            rows,
            t_min: L::splat(t_min),
            ray_t_min: ray.t_min,
            limit,
            next: Link::ROOT,
            depth: 0,
            line,
        }
    }

    #[inline(always)]
    fn enter(&mut self, frame: u32, wide: &Wide) {
        let slot = &mut self.space.frames[frame as usize];
        if self.met >> frame & 1 == 0 {
            self.met |= 1 << frame;
            slot.write(self.line.in_frame(frame, &wide.frames));
        }
        // SAFETY: the bit says that it has been written.
        let ray = unsafe { slot.assume_init() };
        self.frame = frame;
        self.inverse = splats(ray.inverse);
        self.entry = splats(ray.offsets[0]);
        self.exit = splats(ray.offsets[1]);
        self.rows = ray.rows;
    }

    /// Visits a node or a leaf; false when the search is over.
    #[inline(always)]
    fn step<S: Search>(
        &mut self,
        wide: &Wide,
        search: &mut S,
        counters: &mut impl Counters,
    ) -> bool {
        match self.next.child() {
            Child::Node(index) => {
                counters.wide_visit();
                debug_assert!(index < wide.nodes.len());
                // SAFETY: the links of a tree name nodes that are there: `store` writes them so,
                // and `check_wide` refuses a tree from a file that is otherwise.
                let node = unsafe { wide.nodes.get_unchecked(index) };
                if node.frame != self.frame {
                    self.enter(node.frame, wide);
                }
                self.visit::<S>(wide, (index, node))
            }
            Child::Leaf { start, count } => {
                counters.leaf_visit(count as u32);
                counters.triangle_tests(count as u32);
                let from = (self.ray_t_min, self.line.reach);
                match leaf::visit::<L, S>(wide, (start, count), from, search) {
                    ControlFlow::Break(()) => return false,
                    ControlFlow::Continue(false) => {}
                    ControlFlow::Continue(true) => {
                        self.limit = self.line.t_above(search.limit_above());
                    }
                }
                self.pop::<S>(wide)
            }
        }
    }

    /// Where the ray enters and leaves the boxes of a node along an axis.
    #[inline(always)]
    fn slab(&self, node: &WideNode, axis: usize) -> (L, L) {
        let [entry, exit] = self.rows[axis];
        let inverse = self.inverse[axis];
        (
            L::load(entry.of(node)).mul_add(inverse, self.entry[axis]),
            L::load(exit.of(node)).mul_add(inverse, self.exit[axis]),
        )
    }

    #[inline(always)]
    fn visit<S: Search>(&mut self, wide: &Wide, (index, node): (usize, &WideNode)) -> bool {
        let (near_x, far_x) = self.slab(node, 0);
        let (near_y, far_y) = self.slab(node, 1);
        let (near_z, far_z) = self.slab(node, 2);
        let near = near_x.max(near_y).max(near_z.max(self.t_min));
        let far = far_x.min(far_y).min(far_z.min(L::splat(self.limit)));
        let met = near.le(far);
        if met == 0 {
            return self.pop::<S>(wide);
        }
        let first = met.trailing_zeros() as usize;
        let mut others = met & (met - 1);
        if others == 0 {
            self.next = node.children[first];
            return true;
        }
        if S::NEAREST_FIRST {
            let near = near.to_array();
            let mut best = Entry::new(&near, node, first);
            let mut other = Entry::new(&near, node, others.trailing_zeros() as usize);
            others &= others - 1;
            if other.near < best.near {
                std::mem::swap(&mut other, &mut best);
            }
            let bottom = self.depth;
            self.push(wide, other);
            while others != 0 {
                let mut other = Entry::new(&near, node, others.trailing_zeros() as usize);
                others &= others - 1;
                if other.near < best.near {
                    std::mem::swap(&mut other, &mut best);
                }
                self.push(wide, other);
                // Nearer ones on top.
                let mut at = self.depth - 1;
                while at > bottom && self.entry(at - 1).near < other.near {
                    self.set(at, self.get(at - 1));
                    at -= 1;
                }
                self.set(at, Pending { entry: other });
            }
            self.next = best.link;
        } else {
            L::prefetch(wide.address(node.children[others.trailing_zeros() as usize]));
            let rest = Rest {
                node: index as u32,
                children: others,
            };
            self.set(self.depth, Pending { rest });
            self.depth += 1;
            self.next = node.children[first];
        }
        true
    }

    /// Puts a child on the stack and asks for its memory.
    #[inline(always)]
    fn push(&mut self, wide: &Wide, entry: Entry) {
        L::prefetch(wide.address(entry.link));
        self.set(self.depth, Pending { entry });
        self.depth += 1;
    }

    #[inline(always)]
    fn set(&mut self, at: usize, pending: Pending) {
        debug_assert!(at < STACK);
        // SAFETY: no tree is deeper than MAX_DEPTH, by `collapse` and by `check_wide`.
        *unsafe { self.space.stack.get_unchecked_mut(at) } = MaybeUninit::new(pending);
    }

    #[inline(always)]
    fn entry(&self, at: usize) -> Entry {
        // SAFETY: both kinds are two numbers, of which any bits will do.
        unsafe { self.get(at).entry }
    }

    /// What is on the stack below its depth.
    #[inline(always)]
    fn get(&self, at: usize) -> Pending {
        debug_assert!(at < self.depth);
        // SAFETY: all that is below the depth has been written, and callers look at nothing else.
        unsafe { self.space.stack.get_unchecked(at).assume_init() }
    }

    /// Takes the next child that the search has not passed off the stack; false if there is none.
    #[inline(always)]
    fn pop<S: Search>(&mut self, wide: &Wide) -> bool {
        if !S::NEAREST_FIRST {
            return self.pop_rest(wide);
        }
        while self.depth > 0 {
            let entry = self.entry(self.depth - 1);
            self.depth -= 1;
            if entry.near <= self.limit {
                self.next = entry.link;
                return true;
            }
        }
        false
    }

    /// Takes the next of the children on top of the stack. The limit has not changed, so all of
    /// them are still wanted.
    #[inline(always)]
    fn pop_rest(&mut self, wide: &Wide) -> bool {
        let Some(top) = self.depth.checked_sub(1) else {
            return false;
        };
        // SAFETY: both kinds are two numbers, of which any bits will do.
        let Rest { node, children } = unsafe { self.get(top).rest };
        debug_assert!((node as usize) < wide.nodes.len() && children != 0);
        // SAFETY: only nodes that have been visited are put on the stack.
        let node = unsafe { wide.nodes.get_unchecked(node as usize) };
        self.next = node.children[children.trailing_zeros() as usize % WIDTH];
        let children = children & (children - 1);
        if children == 0 {
            self.depth = top;
        } else {
            // SAFETY: as in `set`; what is there is a `Rest`.
            unsafe {
                let rest = self.space.stack.get_unchecked_mut(top).assume_init_mut();
                rest.rest.children = children;
            }
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::query::{Any, Closest, Everything};
    use crate::{Hit, Mesh, Tree, TreeChoice};
    use proptest::prelude::*;

    fn point(scale: f32) -> impl Strategy<Value = [f32; 3]> {
        [-scale..scale, -scale..scale, -scale..scale]
    }

    /// Thin boxes, each turned by some angle about some axis.
    fn turned_boxes(turns: &[([f32; 3], f32)]) -> Mesh {
        let (mut positions, mut triangles) = (Vec::new(), Vec::new());
        for (i, &(axis, angle)) in turns.iter().enumerate() {
            let axis = glam::Vec3::from(axis)
                .try_normalize()
                .unwrap_or(glam::Vec3::Z);
            let turn = glam::Quat::from_axis_angle(axis, angle);
            let first = positions.len() as u32;
            for corner in 0..8 {
                let at = |bit: u32, size: f32| if corner >> bit & 1 == 1 { size } else { -size };
                let p = glam::Vec3::new(at(0, 1.0), at(1, 0.2), at(2, 0.05));
                positions.push((turn * p + glam::Vec3::splat(0.3 * i as f32)).to_array());
            }
            for [a, b, c, d] in [
                [0, 1, 3, 2],
                [4, 5, 7, 6],
                [0, 1, 5, 4],
                [2, 3, 7, 6],
                [0, 2, 6, 4],
                [1, 3, 7, 5],
            ] {
                let at = |corner: u32| first + corner;
                triangles.extend([[at(a), at(b), at(c)], [at(a), at(c), at(d)]]);
            }
        }
        Mesh::new(positions, triangles).unwrap()
    }

    proptest! {
        #![proptest_config(crate::testing::cases(100))]

        /// Hits do not depend on the machine.
        #[test]
        fn all_instructions_give_the_same_hits(
            turns in prop::collection::vec((point(1.0), 0.0f32..3.0), 1..30),
            rays in prop::collection::vec((point(12.0), point(9.0)), 50),
        ) {
            let mesh = turned_boxes(&turns);
            for name in ["framed", "bvh", "wn+kd:6"] {
                let choice: TreeChoice = name.parse().unwrap();
                let tree = Tree::build(&mesh, choice, &Default::default()).unwrap();
                let tree = tree.with_layout(crate::Layout::Wide).unwrap();
                let wide = tree.wide().unwrap();
                for &(origin, target) in &rays {
                    let ray = Ray::new(origin, std::array::from_fn(|i| target[i] - origin[i]));
                    let ask = |instructions| {
                        let mut closest = Closest::new(&ray, |_: &Hit| true);
                        traverse_with(instructions, wide, &ray, &mut closest, &mut ());
                        let mut any = Any::new(&ray, Everything);
                        traverse_with(instructions, wide, &ray, &mut any, &mut ());
                        (closest.found(), any.found)
                    };
                    prop_assert_eq!(ask(Instructions::Portable), ask(Instructions::best()));
                    let hit = ask(Instructions::Portable).0;
                    prop_assert_eq!(hit, crate::brute_force(&mesh, &ray));
                }
            }
        }
    }

    #[test]
    fn turned_boxes_are_in_frames_of_their_own() {
        let turns: Vec<_> = (0..200).map(|_| ([1.0, 2.0, 0.5], 0.7)).collect();
        let tree = Tree::build(
            &turned_boxes(&turns),
            "framed".parse().unwrap(),
            &Default::default(),
        )
        .unwrap();
        let card = tree.with_layout(crate::Layout::Wide).unwrap().card();
        let frames = card.wide.unwrap().frames;
        assert_eq!(frames.len(), 2, "{frames:?}");
        assert!(frames[1] > 9 * frames[0], "{frames:?}");
    }
}
