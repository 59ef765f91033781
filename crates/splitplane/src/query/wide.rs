//! The traversal of a wide tree: eight boxes or eight triangles at a time.
//!
//! Boxes are widened by all that rounding can do, here and in the triangle test, so that a ray
//! visits every leaf in which the test would find a hit; triangles are only sorted out by a part of
//! the test that gives the same bits as the test itself. So hits are those of testing every
//! triangle. See "Why no hit is lost" in ARCHITECTURE.md.
#![allow(unsafe_code)]

use std::mem::MaybeUninit;

use super::Counters;
use super::simd::{Instructions, Lanes, Task};
use super::traverse::Search;
use crate::geometry::frame::{round_down, round_up};
use crate::geometry::triangle::Shear;
use crate::geometry::{Frame, Ray};
use crate::tree::wide::{Child, Link, MAX_DEPTH, MAX_FRAMES, WIDTH, Wide, WideNode};

/// How far a box is widened on every side, in units of ε/2 times the distance of the scene's
/// furthest point from the ray's origin along an axis, R.
///
/// 16 for the triangle test (`TEST_ERROR` in `traverse`), along any direction. In a frame,
/// coordinates are up to √3 · R; the origin is rounded once, a difference to a box once, its
/// product with the inverse direction once, and the inverse and the direction once each: 5 · √3.
const BOX_ERROR: f64 = 26.0;

/// Components of the direction that are smaller, in units of the largest, are taken for this
/// large: they move the ray by less than any rounding. With it no product overflows.
const SMALLEST: f64 = 1e-18;

/// Beyond this distance between a ray's origin and a scene all boxes are visited.
const FAR: f64 = 1e18;

/// A ray as boxes of one frame see it.
#[derive(Clone, Copy)]
struct FrameRay {
    /// One over the direction.
    inverse: [f32; 3],
    /// The origin, moved forward or back so that boxes seem larger: for the side of a box where
    /// the ray enters, and for that where it leaves.
    entry: [f32; 3],
    exit: [f32; 3],
    /// The rows of a node's boxes where the ray enters; it leaves in the others.
    entry_rows: [usize; 3],
}

/// A ray as the traversal sees it: relative to the centre of the scene, and with t in multiples of
/// a power of two, so that the direction's largest component is between 1 and 2.
struct Line {
    origin: [f64; 3],
    direction: [f64; 3],
    margin: f64,
    /// t of the traversal over t of the ray.
    scale: f64,
    /// So far from the scene that boxes say nothing.
    is_far: bool,
}

impl Line {
    #[inline(always)]
    fn new(wide: &Wide, ray: &Ray) -> Self {
        let origin: [f64; 3] = std::array::from_fn(|i| f64::from(ray.origin[i]) - wide.center[i]);
        let max = |v: [f64; 3]| v[0].abs().max(v[1].abs()).max(v[2].abs());
        let direction = ray.direction.map(f64::from);
        // The power of two that is not above the largest component. An f32 is a normal f64.
        let exponent = max(direction).to_bits() >> 52;
        let scale = f64::from_bits(exponent << 52);
        let per_scale = f64::from_bits((2 * 1023 - exponent) << 52);
        let reach = max(origin) + f64::from(wide.half_extent);
        Line {
            origin,
            direction: direction.map(|c| c * per_scale),
            margin: 0.5 * f64::from(f32::EPSILON) * BOX_ERROR * reach,
            scale,
            is_far: reach > FAR,
        }
    }

    #[inline(always)]
    fn in_frame(&self, frame: u32, frames: &[Frame]) -> FrameRay {
        let (origin, direction) = match frame {
            Frame::WORLD => (self.origin, self.direction),
            _ => {
                let frame = &frames[frame as usize];
                (frame.map(self.origin), frame.map(self.direction))
            }
        };
        if self.is_far {
            return FrameRay {
                inverse: [1e30; 3],
                entry: [1e30; 3],
                exit: [-1e30; 3],
                entry_rows: [0, 1, 2],
            };
        }
        let mut ray = FrameRay {
            inverse: [0.0; 3],
            entry: [0.0; 3],
            exit: [0.0; 3],
            entry_rows: [0, 1, 2],
        };
        for axis in 0..3 {
            let d = direction[axis]
                .abs()
                .max(SMALLEST)
                .copysign(direction[axis]);
            let margin = self.margin.copysign(d);
            ray.inverse[axis] = (1.0 / d) as f32;
            ray.entry[axis] = (origin[axis] + margin) as f32;
            ray.exit[axis] = (origin[axis] - margin) as f32;
            ray.entry_rows[axis] = if d < 0.0 { axis + 3 } else { axis };
        }
        ray
    }
}

/// A child that is still to be visited, and where the ray enters its box.
#[derive(Clone, Copy)]
struct Entry {
    near: f32,
    link: Link,
}

/// Every visit takes a child off and puts up to eight on.
const STACK: usize = (WIDTH - 1) * MAX_DEPTH + 1;

/// The ray in the frames that it has met.
struct Frames {
    rays: [MaybeUninit<FrameRay>; MAX_FRAMES],
    /// A bit for each frame that has been met.
    met: u64,
}

impl Frames {
    #[inline(always)]
    fn get(&mut self, frame: u32, line: &Line, frames: &[Frame]) -> FrameRay {
        let slot = &mut self.rays[frame as usize];
        if self.met >> frame & 1 == 0 {
            self.met |= 1 << frame;
            slot.write(line.in_frame(frame, frames));
        }
        // SAFETY: the bit says that it has been written.
        unsafe { slot.assume_init() }
    }
}

/// The first part of the triangle test, on eight triangles: [`Shear::intersect`] up to the signs of
/// the edge functions.
struct Edges<L> {
    axes: [usize; 3],
    origin: [L; 3],
    shear: [L; 2],
}

impl<L: Lanes> Edges<L> {
    #[inline(always)]
    fn new(shear: &Shear) -> Self {
        Edges {
            axes: shear.axes,
            origin: shear.axes.map(|axis| L::splat(shear.origin[axis])),
            shear: [L::splat(shear.shear[0]), L::splat(shear.shear[1])],
        }
    }

    /// A bit for each triangle that the ray may hit; `rows` as in [`Wide::corners`].
    #[inline(always)]
    fn candidates(&self, rows: &[f32], count: usize) -> u32 {
        let [kx, ky, kz] = self.axes;
        let corner = |corner: usize| {
            let row = |axis: usize| L::load(&rows[(3 * corner + axis) * count..]);
            let z = row(kz).sub(self.origin[2]);
            let x = row(kx).sub(self.origin[0]).sub(self.shear[0].mul(z));
            let y = row(ky).sub(self.origin[1]).sub(self.shear[1].mul(z));
            (x, y)
        };
        let ((ax, ay), (bx, by), (cx, cy)) = (corner(0), corner(1), corner(2));
        let u = cx.mul(by).sub(cy.mul(bx));
        let v = ax.mul(cy).sub(ay.mul(cx));
        let w = bx.mul(ay).sub(by.mul(ax));
        let zero = L::splat(0.0);
        let negative = u.min(v).min(w).lt(zero);
        let positive = zero.lt(u.max(v).max(w));
        !(negative & positive) & ((1 << count) - 1)
    }
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
        let mut cursor = Cursor::<L>::new(wide, ray, search);
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
    Instructions::best().run(Walk {
        wide,
        ray,
        search,
        counters,
    });
}

/// Where a ray is on its way through a tree.
struct Cursor<L> {
    line: Line,
    frames: Frames,
    frame: u32,
    inverse: [L; 3],
    entry: [L; 3],
    exit: [L; 3],
    entry_rows: [usize; 3],
    t_min: L,
    /// Beyond this nothing is wanted any more.
    limit: f32,
    edges: Edges<L>,
    next: Link,
    stack: [MaybeUninit<Entry>; STACK],
    depth: usize,
}

impl<L: Lanes> Cursor<L> {
    #[inline(always)]
    fn new(wide: &Wide, ray: &Ray, search: &impl Search) -> Self {
        let line = Line::new(wide, ray);
        let t_min = round_down(f64::from(ray.t_min) * line.scale);
        let zero = [L::splat(0.0); 3];
        let mut cursor = Cursor {
            frames: Frames {
                rays: [MaybeUninit::uninit(); MAX_FRAMES],
                met: 0,
            },
            frame: Frame::WORLD,
            inverse: zero,
            entry: zero,
            exit: zero,
            entry_rows: [0; 3],
            t_min: L::splat(t_min),
            limit: round_up(search.limit() * line.scale),
            edges: Edges::new(&Shear::of(ray)),
            next: Link::ROOT,
            stack: [MaybeUninit::uninit(); STACK],
            depth: 0,
            line,
        };
        cursor.enter(Frame::WORLD, wide);
        cursor
    }

    #[inline(always)]
    fn enter(&mut self, frame: u32, wide: &Wide) {
        let ray = self.frames.get(frame, &self.line, &wide.frames);
        self.frame = frame;
        self.inverse = ray.inverse.map(L::splat);
        self.entry = ray.entry.map(L::splat);
        self.exit = ray.exit.map(L::splat);
        self.entry_rows = ray.entry_rows;
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
                let node = &wide.nodes[index];
                if node.frame != self.frame {
                    self.enter(node.frame, wide);
                }
                self.visit(node, search)
            }
            Child::Leaf { start, count } => {
                counters.leaf_visit(count as u32);
                counters.triangle_tests(count as u32);
                let rows = &wide.corners[9 * start..][..9 * count + WIDTH];
                let mut candidates = match S::HITS_ONLY {
                    true => self.edges.candidates(rows, count),
                    false => (1 << count) - 1,
                };
                if candidates != 0 {
                    while candidates != 0 {
                        let i = candidates.trailing_zeros() as usize;
                        candidates &= candidates - 1;
                        let corners = std::array::from_fn(|corner| {
                            std::array::from_fn(|axis| rows[(3 * corner + axis) * count + i])
                        });
                        if search.test(wide.triangles[start + i], &corners).is_break() {
                            return false;
                        }
                    }
                    self.limit = round_up(search.limit() * self.line.scale);
                }
                self.pop()
            }
        }
    }

    #[inline(always)]
    fn visit<S: Search>(&mut self, node: &WideNode, _: &S) -> bool {
        let entry = |axis: usize| {
            let row = L::load(&node.bounds[self.entry_rows[axis]]);
            row.sub(self.entry[axis]).mul(self.inverse[axis])
        };
        let exit = |axis: usize| {
            let row = L::load(&node.bounds[2 * axis + 3 - self.entry_rows[axis]]);
            row.sub(self.exit[axis]).mul(self.inverse[axis])
        };
        let near = entry(0).max(entry(1)).max(entry(2).max(self.t_min));
        let far = exit(0).min(exit(1)).min(exit(2).min(L::splat(self.limit)));
        let mut met = near.le(far);
        if met == 0 {
            return self.pop();
        }
        let first = met.trailing_zeros() as usize;
        met &= met - 1;
        if met == 0 {
            self.next = node.children[first];
            return true;
        }
        let near = near.to_array();
        let entry = |i: usize| Entry {
            near: near[i],
            link: node.children[i],
        };
        if S::NEAREST_FIRST {
            let (mut best, bottom) = (entry(first), self.depth);
            while met != 0 {
                let i = met.trailing_zeros() as usize;
                met &= met - 1;
                let mut other = entry(i);
                if other.near < best.near {
                    std::mem::swap(&mut other, &mut best);
                }
                // Nearer ones on top.
                let mut at = self.depth;
                while at > bottom && self.get(at - 1).near < other.near {
                    self.stack[at] = self.stack[at - 1];
                    at -= 1;
                }
                self.stack[at] = MaybeUninit::new(other);
                self.depth += 1;
            }
            self.next = best.link;
        } else {
            while met != 0 {
                let i = (31 - met.leading_zeros()) as usize;
                met ^= 1 << i;
                self.stack[self.depth] = MaybeUninit::new(entry(i));
                self.depth += 1;
            }
            self.next = node.children[first];
        }
        true
    }

    /// An entry of the stack below its depth.
    #[inline(always)]
    fn get(&self, at: usize) -> Entry {
        debug_assert!(at < self.depth || at < STACK);
        // SAFETY: all entries below the depth have been written, and callers look at no others.
        unsafe { self.stack[at].assume_init() }
    }

    /// Takes the next child that the search has not passed off the stack; false if there is none.
    #[inline(always)]
    fn pop(&mut self) -> bool {
        while self.depth > 0 {
            self.depth -= 1;
            let entry = self.get(self.depth);
            if entry.near <= self.limit {
                self.next = entry.link;
                return true;
            }
        }
        false
    }
}
