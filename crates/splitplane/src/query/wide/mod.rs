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

mod beam;
mod leaf;
mod line;
mod packet;
mod ready;
mod stack;

use std::ops::ControlFlow;

use super::Counters;
use super::batch::{Coherence, Question};
use super::simd::{Eight, Instructions, Lanes, Part, Task};
use super::traverse::Search;
use crate::geometry::Ray;
use crate::tree::wide::{Child, Link, MAX_FRAMES, WIDTH, Wide, WideNode};
use line::{BoxTest, Course, FrameRay, Line};
use packet::Outcome;
use ready::Ready;
use stack::{Frames, Space, Stack};

#[inline(always)]
fn splats<L: Lanes>([x, y, z]: [f32; 3]) -> [L; 3] {
    [L::splat(x), L::splat(y), L::splat(z)]
}

#[inline(always)]
fn root(wide: &Wide) -> &WideNode {
    node(wide, 0)
}

/// The node of that index, which a link of the tree names, or the root.
#[inline(always)]
fn node(wide: &Wide, index: usize) -> &WideNode {
    debug_assert!(index < wide.nodes.len());
    // SAFETY: a tree has a root, and its links name nodes that are there: `store` writes it so, and
    // `check_wide` refuses a tree from a file that is otherwise.
    unsafe { wide.nodes.get_unchecked(index) }
}

/// The coordinate of points along a row of a frame.
#[inline(always)]
fn along<L: Lanes>([a, b, c]: [L; 3], [x, y, z]: [L; 3]) -> L {
    a.mul(x).add(b.mul(y)).add(c.mul(z))
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
    fn run<L: Eight>(self) {
        let Walk {
            wide,
            ray,
            search,
            counters,
        } = self;
        let mut space = Space::NEW;
        if let Some(line) = Line::new(wide, ray) {
            let mut cursor = Cursor::<L, _>::new(wide, line, ray, search, &mut space);
            while cursor.step(wide, search, counters) {}
        }
    }
}

/// Visits what the ray meets, until the search has its answer.
#[inline(always)]
pub(super) fn traverse<S: Search, C: Counters>(
    wide: &Wide,
    ray: &Ray,
    search: &mut S,
    counters: &mut C,
) {
    traverse_with(Instructions::best(), wide, ray, search, counters);
}

#[inline(always)]
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
    coherence: Coherence,
}

impl<Q: Question> Task for Batch<'_, Q> {
    type Output = ();

    #[inline(always)]
    fn run<L: Eight>(self) {
        let Batch {
            wide,
            rays,
            answers,
            coherence,
        } = self;
        let mut space = Space::NEW;
        let mut room = Space::NEW;
        let mut parts = L::Part::parts(packet::Members::none());
        // Up to where rays go no more than a quarter of them together, and up to where each goes alone.
        let (mut apart, mut alone) = (0, 0);
        let mut at = 0;
        while at < rays.len() {
            let size = match at < apart {
                true => packet::BLOCK,
                false => packet::RAYS,
            };
            let end = rays.len().min(at + size);
            let (rays, answers) = (&rays[at..end], &mut answers[at..end]);
            if coherence != Coherence::Incoherent && rays.len() >= WIDTH && at >= alone {
                let memory = (&mut room, &mut parts);
                match packet::traverse::<L, Q>(wide, rays, answers, memory, coherence) {
                    Outcome::Answered => {
                        at = end;
                        continue;
                    }
                    Outcome::Apart if rays.len() > packet::BLOCK => {
                        apart = end;
                        continue;
                    }
                    Outcome::Apart => {}
                    // Those that follow are probably no better.
                    Outcome::TooFar if rays.len() > packet::BLOCK => {
                        apart = at + packet::AVOIDED * packet::RAYS;
                        continue;
                    }
                    Outcome::TooFar => alone = at + packet::AVOIDED * packet::BLOCK,
                }
            }
            let answers = answers.chunks_mut(WIDTH);
            for (rays, answers) in rays.chunks(WIDTH).zip(answers) {
                each_alone::<L, Q>(wide, rays, answers, &mut space);
            }
            at = end;
        }
    }
}

/// Takes up to eight rays through the tree, one after the other but for the root and, where any hit
/// will do, what each visits first.
#[inline(always)]
fn each_alone<L: Eight, Q: Question>(
    wide: &Wide,
    rays: &[Ray],
    answers: &mut [Q::Answer],
    space: &mut Space<Link, FrameRay, MAX_FRAMES>,
) {
    // The next ones: what comes in between is too much for the machine to foresee it.
    L::prefetch(rays.as_ptr_range().end.cast());
    let ready = Ready::new::<L>(wide, rays);
    let at_root = ready.meet_root::<L>(wide);
    let first = match <Q::Search<'_> as Search>::NEAREST_FIRST {
        true => None,
        false => Some(ready.meet_first::<L>(wide, &at_root)),
    };
    // Which ones meet anything is hard to foresee; so they are not asked one by one.
    let (mut meeting, mut missing) = (at_root.rays, !at_root.rays & ((1 << rays.len()) - 1));
    while missing != 0 {
        let i = missing.trailing_zeros() as usize;
        missing &= missing - 1;
        answers[i] = Q::answer(None);
    }
    while meeting != 0 {
        let i = meeting.trailing_zeros() as usize;
        meeting &= meeting - 1;
        let mut search = Q::search(&rays[i], None);
        let mut cursor = Cursor::<L, _>::new(wide, ready.get(i), &rays[i], &search, space);
        cursor.go_on::<Q::Search<'_>>(wide, (0, root(wide)), at_root.of(i));
        let mut goes_on = true;
        if let Some((nodes, met)) = &first {
            let index = nodes[i % WIDTH];
            if index != 0 {
                let visited = (index, node(wide, index));
                goes_on = cursor.visited::<Q::Search<'_>>(wide, visited, met.of(i));
            }
        }
        while goes_on && cursor.step(wide, &mut search, &mut ()) {}
        answers[i] = Q::answer(Q::found(&search));
    }
}

/// Takes all rays through the tree.
pub(super) fn traverse_all<Q: Question>(
    wide: &Wide,
    rays: &[Ray],
    answers: &mut [Q::Answer],
    coherence: Coherence,
) {
    traverse_all_with::<Q>(Instructions::best(), wide, rays, answers, coherence);
}

fn traverse_all_with<Q: Question>(
    instructions: Instructions,
    wide: &Wide,
    rays: &[Ray],
    answers: &mut [Q::Answer],
    coherence: Coherence,
) {
    instructions.run(Batch::<Q> {
        wide,
        rays,
        answers,
        coherence,
    });
}

/// Where a ray is on its way through a tree.
struct Cursor<'s, L, C> {
    course: C,
    stack: Stack<'s, Link>,
    frames: Frames<'s, FrameRay, MAX_FRAMES>,
    frame: u32,
    boxes: BoxTest<L>,
    t_min: L,
    ray_t_min: f32,
    /// Beyond this nothing is wanted any more.
    limit: f32,
    next: Link,
}

impl<'s, L: Eight, C: Course> Cursor<'s, L, C> {
    #[inline(always)]
    fn new(
        wide: &Wide,
        course: C,
        ray: &Ray,
        search: &impl Search,
        space: &'s mut Space<Link, FrameRay, MAX_FRAMES>,
    ) -> Self {
        let line = course.line();
        let (t_min, limit) = (line.t_min, line.t_above(search.limit_above()));
        let boxes = BoxTest::new(&course.at_root(wide));
        let (stack, frames) = space.emptied();
        Cursor {
            stack,
            frames,
            frame: root(wide).frame,
            boxes,
            t_min: L::splat(t_min),
            ray_t_min: ray.t_min,
            limit,
            next: Link::ROOT,
            course,
        }
    }

    #[inline(always)]
    fn enter(&mut self, frame: u32, wide: &Wide) {
        let ray = match self.frames.get(frame) {
            Some(ray) => ray,
            None => (self.frames).meet(frame, self.course.line().in_frame(frame, &wide.frames)),
        };
        self.boxes = BoxTest::new(ray);
        self.frame = frame;
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
                let node = node(wide, index);
                if node.frame != self.frame {
                    self.enter(node.frame, wide);
                }
                self.visit::<S>(wide, (index, node))
            }
            Child::Leaf { start, count } => {
                counters.leaf_visit(count as u32);
                counters.triangle_tests(count as u32);
                let from = (self.ray_t_min, self.course.line().reach);
                match leaf::visit::<L, S>(wide, (start, count), from, search) {
                    ControlFlow::Break(()) => return false,
                    ControlFlow::Continue(false) => {}
                    ControlFlow::Continue(true) => {
                        self.limit = self.course.line().t_above(search.limit_above());
                    }
                }
                self.pop::<S>(wide)
            }
        }
    }

    #[inline(always)]
    fn visit<S: Search>(&mut self, wide: &Wide, node: (usize, &WideNode)) -> bool {
        let met = (self.boxes).meet(node.1, self.t_min, L::splat(self.limit));
        self.visited::<S>(wide, node, met)
    }

    /// Goes on after a node of which so many children are met; false when the search is over.
    #[inline(always)]
    fn visited<S: Search>(
        &mut self,
        wide: &Wide,
        node: (usize, &WideNode),
        (met, near): (u32, L),
    ) -> bool {
        if met == 0 {
            return self.pop::<S>(wide);
        }
        self.go_on::<S>(wide, node, (met, near));
        true
    }

    /// Goes on with those children of a node that are met, at least one.
    #[inline(always)]
    fn go_on<S: Search>(&mut self, wide: &Wide, node: (usize, &WideNode), (met, near): (u32, L)) {
        self.next = self.stack.choose::<L, S>(wide, node, met, near);
    }

    /// Goes on with what is next on the stack; false if there is nothing.
    #[inline(always)]
    fn pop<S: Search>(&mut self, wide: &Wide) -> bool {
        self.stack.pop::<S>(wide, self.limit, &mut self.next)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::query::batch::{AnyHit, ClosestHit};
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
            rays in prop::collection::vec((point(12.0), point(9.0)), 1..150),
            camera in (point(12.0), point(9.0)),
            spread in prop_oneof![Just(0.0f32), 0.0f32..1.0],
        ) {
            let mesh = turned_boxes(&turns);
            for name in ["framed", "bvh", "wn+kd:6"] {
                let choice: TreeChoice = name.parse().unwrap();
                let tree = Tree::build(&mesh, choice, &Default::default()).unwrap();
                let tree = tree.with_layout(crate::Layout::Wide).unwrap();
                let wide = tree.wide().unwrap();
                let rays = |spread: f32| -> Vec<Ray> {
                    let (from, to) = camera;
                    let near = |p: [f32; 3], q: [f32; 3]| -> [f32; 3] {
                        std::array::from_fn(|i| p[i] * (1.0 - spread) + q[i] * spread)
                    };
                    let ray = |&(origin, target)| {
                        let (origin, target) = (near(from, origin), near(to, target));
                        Ray::new(origin, std::array::from_fn(|i| target[i] - origin[i]))
                    };
                    rays.iter().map(ray).collect()
                };
                for spread in [0.02 * spread, spread] {
                    let rays = rays(spread);
                    let mut together = vec![None; rays.len()];
                    let mut found = vec![false; rays.len()];
                    for instructions in Instructions::available() {
                        for coherence in [Coherence::Coherent, Coherence::Unknown, Coherence::Incoherent] {
                            traverse_all_with::<ClosestHit>(
                                instructions, wide, &rays, &mut together, coherence,
                            );
                            traverse_all_with::<AnyHit>(
                                instructions, wide, &rays, &mut found, coherence,
                            );
                            for ((ray, hit), found) in rays.iter().zip(&together).zip(&found) {
                                prop_assert_eq!(*hit, crate::brute_force(&mesh, ray));
                                prop_assert_eq!(*found, hit.is_some());
                            }
                        }
                    }
                }
                for ray in rays(1.0) {
                    let ask = |instructions| {
                        let mut closest = Closest::new(&ray, |_: &Hit| true);
                        traverse_with(instructions, wide, &ray, &mut closest, &mut ());
                        let mut any = Any::new(&ray, Everything);
                        traverse_with(instructions, wide, &ray, &mut any, &mut ());
                        (closest.found(), any.found)
                    };
                    let hit = crate::brute_force(&mesh, &ray);
                    for instructions in Instructions::available() {
                        prop_assert_eq!(ask(instructions), (hit, hit.is_some()));
                    }
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
