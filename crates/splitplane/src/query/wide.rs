//! The traversal of a wide tree: eight boxes or eight triangles at a time.
//!
//! Boxes are widened by all that rounding can do, here and in the triangle test, so that a ray
//! visits every leaf in which the test would find a hit; triangles are only sorted out by a part of
//! the test that gives the same bits as the test itself. So hits are those of testing every
//! triangle. See "Why no hit is lost" in ARCHITECTURE.md.
//!
//! No closures where lanes are handled: a closure is a function without the machine's
//! instructions, into which they cannot be inlined.
#![allow(unsafe_code)]

use std::mem::MaybeUninit;

use glam::Vec3A;

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
/// coordinates are up to √3 · R; the origin is rounded three times, a difference to a box once, its
/// product with the inverse direction once, and the inverse and the direction once each:
/// 7 · √3 < 13. The rest is for R and the margin being rounded themselves.
const BOX_ERROR: f32 = 30.0;

/// Components of the direction that are smaller, in units of the largest, are taken for this
/// large: they move the ray by less than any rounding. With it no product overflows.
const SMALLEST: f32 = 1e-18;

/// With a margin as large as this, beyond 10^18 between a ray's origin and a scene, all boxes are
/// visited.
const FAR_MARGIN: f32 = 1e12;

/// Biased exponents of a direction's largest component that need no care.
const LOW_EXPONENT: u32 = 32;
const HIGH_EXPONENT: u32 = 222;

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
    origin: Vec3A,
    direction: Vec3A,
    margin: f32,
    /// t of the traversal over t of the ray.
    scale: f64,
}

impl Line {
    #[inline(always)]
    fn new(wide: &Wide, ray: &Ray) -> Self {
        let origin = Vec3A::from(ray.origin) - Vec3A::from(wide.center);
        let direction = Vec3A::from(ray.direction);
        let exponent = direction.abs().max_element().to_bits() >> 23;
        let reach = origin.abs().max_element() + wide.half_extent;
        let (direction, scale) = if (LOW_EXPONENT..HIGH_EXPONENT).contains(&exponent) {
            let per_scale = f32::from_bits((2 * 127 - exponent) << 23);
            let scale = f64::from_bits(u64::from(exponent + 1023 - 127) << 52);
            (direction * per_scale, scale)
        } else {
            extreme(ray.direction)
        };
        Line {
            origin,
            direction,
            // Numbers too small to be normal are rounded by as much, whatever their size.
            margin: BOX_ERROR * (0.5 * f32::EPSILON * reach + f32::from_bits(1)),
            scale,
        }
    }

    #[inline(always)]
    fn in_frame(&self, frame: u32, frames: &[Frame]) -> FrameRay {
        let (origin, direction) = match frame {
            Frame::WORLD => (self.origin, self.direction),
            _ => {
                let frame = &frames[frame as usize];
                let map = |v: Vec3A| {
                    let [x, y, z] = frame.map(v.as_dvec3().to_array());
                    Vec3A::new(x as f32, y as f32, z as f32)
                };
                (map(self.origin), map(self.direction))
            }
        };
        // An origin that far may overflow to what is not a number.
        if self.margin >= FAR_MARGIN || self.margin.is_nan() {
            return FrameRay {
                inverse: [1e30; 3],
                entry: [1e30; 3],
                exit: [-1e30; 3],
                entry_rows: [0, 1, 2],
            };
        }
        let size = direction.abs().max(Vec3A::splat(SMALLEST));
        let margin = Vec3A::splat(self.margin).copysign(direction);
        let row = |axis: usize, d: f32| axis + if d.is_sign_negative() { 3 } else { 0 };
        FrameRay {
            inverse: (Vec3A::ONE / size.copysign(direction)).to_array(),
            entry: (origin + margin).to_array(),
            exit: (origin - margin).to_array(),
            entry_rows: [
                row(0, direction.x),
                row(1, direction.y),
                row(2, direction.z),
            ],
        }
    }
}

/// A direction with components that are so large or small that their power of two or its inverse
/// is no normal f32: over its power of two, and that power.
#[cold]
fn extreme(direction: [f32; 3]) -> (Vec3A, f64) {
    let direction = glam::Vec3::from(direction).as_dvec3();
    // An f32 is a normal f64.
    let exponent = direction.abs().max_element().to_bits() >> 52;
    let per_scale = f64::from_bits((2 * 1023 - exponent) << 52);
    (
        (direction * per_scale).as_vec3a(),
        f64::from_bits(exponent << 52),
    )
}

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

#[inline(always)]
fn splats<L: Lanes>([x, y, z]: [f32; 3]) -> [L; 3] {
    [L::splat(x), L::splat(y), L::splat(z)]
}

/// Every visit takes a child off and puts up to eight on.
const STACK: usize = (WIDTH - 1) * MAX_DEPTH + 1;

/// What a cursor writes to before it reads it. It lies apart, since moving it would take longer than
/// a ray does.
struct Space {
    stack: [MaybeUninit<Entry>; STACK],
    /// The ray in the frames that it has met.
    frames: [MaybeUninit<FrameRay>; MAX_FRAMES],
}

impl Space {
    const NEW: Space = Space {
        stack: [MaybeUninit::uninit(); STACK],
        frames: [MaybeUninit::uninit(); MAX_FRAMES],
    };
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
    fn new(shear: Option<&Shear>) -> Self {
        let Some(shear) = shear else {
            return Edges {
                axes: [0; 3],
                origin: [L::splat(0.0); 3],
                shear: [L::splat(0.0); 2],
            };
        };
        Edges {
            axes: shear.axes,
            origin: [
                L::splat(shear.origin[shear.axes[0]]),
                L::splat(shear.origin[shear.axes[1]]),
                L::splat(shear.origin[shear.axes[2]]),
            ],
            shear: [L::splat(shear.shear[0]), L::splat(shear.shear[1])],
        }
    }

    /// Corners of eight triangles, sheared.
    #[inline(always)]
    fn corner(&self, rows: &[f32], count: usize) -> (L, L) {
        let [kx, ky, kz] = self.axes;
        let z = L::load(&rows[kz * count..]).sub(self.origin[2]);
        let x = L::load(&rows[kx * count..]).sub(self.origin[0]);
        let y = L::load(&rows[ky * count..]).sub(self.origin[1]);
        (x.sub(self.shear[0].mul(z)), y.sub(self.shear[1].mul(z)))
    }

    /// A bit for each triangle that the ray may hit; `rows` as in [`Wide::corners`].
    #[inline(always)]
    fn candidates(&self, rows: &[f32], count: usize) -> u32 {
        let (ax, ay) = self.corner(&rows[..3 * count + WIDTH], count);
        let (bx, by) = self.corner(&rows[3 * count..6 * count + WIDTH], count);
        let (cx, cy) = self.corner(&rows[6 * count..9 * count + WIDTH], count);
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
    Instructions::best().run(Walk {
        wide,
        ray,
        search,
        counters,
    });
}

/// Many rays, each with a search of its own.
struct Batch<'a, T, N, F> {
    wide: &'a Wide,
    rays: &'a [Ray],
    hits: &'a mut [T],
    search: &'a N,
    found: &'a F,
}

impl<S: Search, T, N: Fn(&Ray) -> S, F: Fn(&S) -> T> Task for Batch<'_, T, N, F> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self) {
        let mut space = Space::NEW;
        for (ray, hit) in self.rays.iter().zip(self.hits) {
            let mut search = (self.search)(ray);
            if ray.is_valid() {
                let mut cursor = Cursor::<L>::new(self.wide, ray, &search, &mut space);
                while cursor.step(self.wide, &mut search, &mut ()) {}
            }
            *hit = (self.found)(&search);
        }
    }
}

/// Takes all rays through the tree, and says what was `found` by the `search` of each.
pub(super) fn traverse_all<S: Search, T>(
    wide: &Wide,
    rays: &[Ray],
    hits: &mut [T],
    search: &impl Fn(&Ray) -> S,
    found: &impl Fn(&S) -> T,
) {
    Instructions::best().run(Batch {
        wide,
        rays,
        hits,
        search,
        found,
    });
}

/// Where a ray is on its way through a tree.
struct Cursor<'s, L> {
    line: Line,
    space: &'s mut Space,
    /// A bit for each frame that has been met.
    met: u64,
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
    /// How many entries the stack has.
    depth: usize,
}

impl<'s, L: Lanes> Cursor<'s, L> {
    #[inline(always)]
    fn new(wide: &Wide, ray: &Ray, search: &impl Search, space: &'s mut Space) -> Self {
        let line = Line::new(wide, ray);
        let t_min = round_down(f64::from(ray.t_min) * line.scale);
        let zero = [L::splat(0.0); 3];
        let mut cursor = Cursor {
            space,
            met: 0,
            frame: Frame::WORLD,
            inverse: zero,
            entry: zero,
            exit: zero,
            entry_rows: [0; 3],
            t_min: L::splat(t_min),
            limit: round_up(search.limit() * line.scale),
            edges: Edges::new(search.shear()),
            next: Link::ROOT,
            depth: 0,
            line,
        };
        cursor.enter(Frame::WORLD, wide);
        cursor
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
        self.entry = splats(ray.entry);
        self.exit = splats(ray.exit);
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
                let mut candidates = match search.shear() {
                    Some(_) => self.edges.candidates(rows, count),
                    None => (1 << count) - 1,
                };
                if candidates != 0 {
                    while candidates != 0 {
                        let i = candidates.trailing_zeros() as usize;
                        candidates &= candidates - 1;
                        let mut corners = [[0.0; 3]; 3];
                        for (row, value) in corners.as_flattened_mut().iter_mut().enumerate() {
                            *value = rows[row * count + i];
                        }
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

    /// Where the ray enters and leaves the boxes of a node along an axis.
    #[inline(always)]
    fn slab(&self, node: &WideNode, axis: usize) -> (L, L) {
        let row = self.entry_rows[axis];
        let entry = L::load(&node.bounds[row]).sub(self.entry[axis]);
        let exit = L::load(&node.bounds[2 * axis + 3 - row]).sub(self.exit[axis]);
        (entry.mul(self.inverse[axis]), exit.mul(self.inverse[axis]))
    }

    #[inline(always)]
    fn visit<S: Search>(&mut self, node: &WideNode, _: &S) -> bool {
        let (near_x, far_x) = self.slab(node, 0);
        let (near_y, far_y) = self.slab(node, 1);
        let (near_z, far_z) = self.slab(node, 2);
        let near = near_x.max(near_y).max(near_z.max(self.t_min));
        let far = far_x.min(far_y).min(far_z.min(L::splat(self.limit)));
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
        if S::NEAREST_FIRST {
            let (mut best, bottom) = (Entry::new(&near, node, first), self.depth);
            while met != 0 {
                let i = met.trailing_zeros() as usize;
                met &= met - 1;
                let mut other = Entry::new(&near, node, i);
                if other.near < best.near {
                    std::mem::swap(&mut other, &mut best);
                }
                // Nearer ones on top.
                let mut at = self.depth;
                while at > bottom && self.get(at - 1).near < other.near {
                    self.space.stack[at] = self.space.stack[at - 1];
                    at -= 1;
                }
                self.space.stack[at] = MaybeUninit::new(other);
                self.depth += 1;
            }
            self.next = best.link;
        } else {
            while met != 0 {
                let i = (31 - met.leading_zeros()) as usize;
                met ^= 1 << i;
                self.space.stack[self.depth] = MaybeUninit::new(Entry::new(&near, node, i));
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
        unsafe { self.space.stack[at].assume_init() }
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
