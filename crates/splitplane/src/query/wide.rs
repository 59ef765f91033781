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
use std::ops::ControlFlow;

use glam::Vec3A;

use super::Counters;
use super::batch::Question;
use super::simd::{Instructions, Lanes, Task};
use super::traverse::{Search, Triangle};
use crate::geometry::frame::round_up;
use crate::geometry::triangle::Shear;
use crate::geometry::{Frame, Ray};
use crate::tree::wide::{Child, Link, MAX_DEPTH, MAX_FRAMES, WIDTH, Wide, WideNode};

/// How far a box is widened on every side, in units of ε/2 times the distance of the scene's
/// furthest point from the ray's origin along an axis, R.
///
/// 16 for the triangle test (`TEST_ERROR` in `traverse`), along any direction. In a frame,
/// coordinates are up to √3 · R. The origin is rounded when the centre is taken off, three times on
/// its way into the frame and once with the margin; the direction three times; a difference to a
/// box, its product with the inverse direction, and the inverse once each: 11 · √3 < 20. The rest is
/// for R and the margin being rounded themselves.
const BOX_ERROR: f32 = 40.0;

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
    /// The rows of a node's boxes where the ray enters, and those where it leaves.
    entry_rows: [Row; 3],
    exit_rows: [Row; 3],
}

/// A row of a node's boxes: 0 to 5.
#[derive(Clone, Copy)]
struct Row(usize);

impl Row {
    #[inline(always)]
    const fn low(axis: usize) -> Row {
        assert!(axis < 3);
        Row(axis)
    }

    #[inline(always)]
    const fn high(axis: usize) -> Row {
        assert!(axis < 3);
        Row(axis + 3)
    }

    /// Where a ray enters boxes along an axis, and where it leaves them.
    #[inline(always)]
    fn pair<const AXIS: usize>(backwards: bool) -> (Row, Row) {
        let (low, high) = const { (Row::low(AXIS), Row::high(AXIS)) };
        match backwards {
            false => (low, high),
            true => (high, low),
        }
    }

    #[inline(always)]
    fn of(self, node: &WideNode) -> &[f32; WIDTH] {
        // SAFETY: a node has six rows, and a `Row` is made only by `low` and `high`.
        unsafe { node.bounds.get_unchecked(self.0) }
    }
}

/// A ray as the traversal sees it: relative to the centre of the scene, and with t in multiples of
/// a power of two, so that the direction's largest component is between 1 and 2.
struct Line {
    origin: Vec3A,
    direction: Vec3A,
    margin: f32,
    /// t of the traversal over t of the ray.
    scale: f32,
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
            (direction * per_scale, f32::from_bits(exponent << 23))
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

    /// No less than a t of the ray. It is multiplied exactly, unless it gets too small to be normal.
    #[inline(always)]
    fn t_above(&self, t: f64) -> f32 {
        round_up(t) * self.scale + f32::MIN_POSITIVE
    }

    /// No more than a t of the ray.
    #[inline(always)]
    fn t_below(&self, t: f32) -> f32 {
        t * self.scale - f32::MIN_POSITIVE
    }

    #[inline(always)]
    fn in_frame(&self, frame: u32, frames: &[Frame]) -> FrameRay {
        let (origin, direction) = match frame {
            Frame::WORLD => (self.origin, self.direction),
            _ => {
                let [a, b, c] = frames[frame as usize].rows;
                let x = Vec3A::new(a[0], b[0], c[0]);
                let y = Vec3A::new(a[1], b[1], c[1]);
                let z = Vec3A::new(a[2], b[2], c[2]);
                let (o, d) = (self.origin, self.direction);
                (x * o.x + y * o.y + z * o.z, x * d.x + y * d.y + z * d.z)
            }
        };
        // An origin that far may overflow to what is not a number.
        if self.margin >= FAR_MARGIN || self.margin.is_nan() {
            return FrameRay {
                inverse: [1e30; 3],
                entry: [1e30; 3],
                exit: [-1e30; 3],
                entry_rows: [Row::low(0), Row::low(1), Row::low(2)],
                exit_rows: [Row::high(0), Row::high(1), Row::high(2)],
            };
        }
        let size = direction.abs().max(Vec3A::splat(SMALLEST));
        let margin = Vec3A::splat(self.margin).copysign(direction);
        let (entry_x, exit_x) = Row::pair::<0>(direction.x.is_sign_negative());
        let (entry_y, exit_y) = Row::pair::<1>(direction.y.is_sign_negative());
        let (entry_z, exit_z) = Row::pair::<2>(direction.z.is_sign_negative());
        FrameRay {
            inverse: (Vec3A::ONE / size.copysign(direction)).to_array(),
            entry: (origin + margin).to_array(),
            exit: (origin - margin).to_array(),
            entry_rows: [entry_x, entry_y, entry_z],
            exit_rows: [exit_x, exit_y, exit_z],
        }
    }
}

/// A direction with components that are so large or small that their power of two or its inverse
/// is no normal f32: over its power of two, and that power.
#[cold]
fn extreme(direction: [f32; 3]) -> (Vec3A, f32) {
    let direction = glam::Vec3::from(direction).as_dvec3();
    // An f32 is a normal f64.
    let exponent = direction.abs().max_element().to_bits() >> 52;
    let per_scale = f64::from_bits((2 * 1023 - exponent) << 52);
    (
        (direction * per_scale).as_vec3a(),
        f64::from_bits(exponent << 52) as f32,
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

/// What rounding may do to t in [`Block::candidates`], in units of ε/2 times a bound of all
/// products. With products of x and y up to P, z in multiples of the direction up to Z, an edge
/// function is off by 4 P, the determinant by 24 P and t times the determinant by 42 P Z; so much
/// again for what is computed from them, and for t being rounded at last.
const T_ERROR: f32 = 80.0 * 0.5 * f32::EPSILON;

/// More than the determinant and t times the determinant are, in units of the bounds: where they
/// overflow, this times the bounds does, and nothing is refused.
const T_RANGE: f32 = 8.0;

/// The corners of the triangles of a leaf, as in [`Wide::corners`].
#[derive(Clone, Copy)]
struct Rows<'a> {
    /// Nine rows of `count`, and eight numbers more.
    values: &'a [f32],
    count: usize,
}

impl<'a> Rows<'a> {
    #[inline(always)]
    fn new(wide: &'a Wide, start: usize, count: usize) -> Self {
        Rows {
            values: &wide.corners[9 * start..9 * (start + count) + WIDTH],
            count,
        }
    }

    /// A row, by a corner and an axis, and what follows it.
    #[inline(always)]
    fn eight(&self, corner: usize, axis: usize) -> &[f32; WIDTH] {
        let at = (3 * corner + axis) * self.count;
        debug_assert!(corner < 3 && axis < 3 && at + WIDTH <= self.values.len());
        // SAFETY: corners and axes are below 3, and behind each of nine rows there are eight
        // numbers.
        unsafe { &*self.values.as_ptr().add(at).cast() }
    }

    #[inline(always)]
    fn corners(&self, slot: usize) -> [[f32; 3]; 3] {
        let mut corners = [[0.0; 3]; 3];
        for (row, value) in corners.as_flattened_mut().iter_mut().enumerate() {
            *value = self.values[row * self.count + slot];
        }
        corners
    }
}

/// Up to eight triangles of a leaf, their corners sheared.
struct Block<L> {
    corners: [[L; 3]; 3],
}

impl<L: Lanes> Block<L> {
    #[inline(always)]
    fn new(shear: &Shear, rows: Rows) -> Self {
        Block {
            corners: [
                Self::corner(shear, rows, 0),
                Self::corner(shear, rows, 1),
                Self::corner(shear, rows, 2),
            ],
        }
    }

    /// As [`Shear::apply`].
    #[inline(always)]
    fn corner(shear: &Shear, rows: Rows, corner: usize) -> [L; 3] {
        let [kx, ky, kz] = shear.axes;
        let [ox, oy, oz] = shear.turned_origin;
        let z = L::load(rows.eight(corner, kz)).sub(L::splat(oz));
        let x = L::load(rows.eight(corner, kx)).sub(L::splat(ox));
        let y = L::load(rows.eight(corner, ky)).sub(L::splat(oy));
        [
            x.sub(L::splat(shear.shear[0]).mul(z)),
            y.sub(L::splat(shear.shear[1]).mul(z)),
            z,
        ]
    }

    /// A bit for each triangle that the ray may hit between `t_min` and `t_max`: those that
    /// [`Shear::meet`] cannot refuse by the signs of the f32 edge functions, nor by a t that is
    /// off by more than rounding.
    #[inline(always)]
    fn candidates(&self, shear: &Shear, (t_min, t_max): (f32, f32)) -> u32 {
        let [[ax, ay, az], [bx, by, bz], [cx, cy, cz]] = self.corners;
        let u = cx.mul(by).sub(cy.mul(bx));
        let v = ax.mul(cy).sub(ay.mul(cx));
        let w = bx.mul(ay).sub(by.mul(ax));
        let zero = L::splat(0.0);
        let negative = u.min(v).min(w).lt(zero);
        let positive = zero.lt(u.max(v).max(w));
        let met = !(negative & positive);
        if met & 0xff == 0 {
            return 0;
        }
        let along = L::splat(shear.shear[2]);
        let determinant = u.add(v).add(w);
        let (az, bz, cz) = (az.mul(along), bz.mul(along), cz.mul(along));
        let t = u
            .mul(az)
            .add(v.mul(bz))
            .add(w.mul(cz))
            .times_sign(determinant);
        let determinant = determinant.abs();
        // Products that are too small to be normal are off by as much, whatever their size.
        let tiny = L::splat(f32::MIN_POSITIVE);
        let x = ax.abs().max(bx.abs()).max(cx.abs());
        let y = ay.abs().max(by.abs()).max(cy.abs());
        let z = az.abs().max(bz.abs()).max(cz.abs()).add(tiny);
        let product = x.mul(y).mul(L::splat(T_RANGE)).add(tiny);
        let error = L::splat(T_ERROR / T_RANGE);
        let t_slack = product.mul(z).add(tiny).mul(error);
        let slack = product.mul(error);
        let (first, last) = (L::splat(t_min), L::splat(t_max));
        let lowest = first.mul(determinant).sub(first.abs().mul(slack));
        let highest = last.mul(determinant).add(last.abs().mul(slack));
        let before = t.add(t_slack).lt(lowest);
        let behind = highest.lt(t.sub(t_slack));
        let sure = slack.lt(determinant);
        met & !(sure & (before | behind))
    }

    #[inline(always)]
    fn to_arrays(&self) -> [[[f32; WIDTH]; 3]; 3] {
        let [a, b, c] = self.corners;
        [
            [a[0].to_array(), a[1].to_array(), a[2].to_array()],
            [b[0].to_array(), b[1].to_array(), b[2].to_array()],
            [c[0].to_array(), c[1].to_array(), c[2].to_array()],
        ]
    }
}

/// A triangle of a leaf.
struct InLeaf<'a> {
    index: u32,
    /// Its place in the leaf.
    slot: usize,
    rows: Rows<'a>,
    sheared: &'a [[[f32; WIDTH]; 3]; 3],
}

impl Triangle for InLeaf<'_> {
    #[inline(always)]
    fn index(&self) -> u32 {
        self.index
    }

    #[inline(always)]
    fn corners(&self) -> [[f32; 3]; 3] {
        self.rows.corners(self.slot)
    }

    #[inline(always)]
    fn sheared(&self, _: &Shear) -> [[f32; 3]; 3] {
        let mut corners = [[0.0; 3]; 3];
        for (corner, own) in corners.iter_mut().zip(self.sheared) {
            for (value, row) in corner.iter_mut().zip(own) {
                *value = row[self.slot];
            }
        }
        corners
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
    /// A bit for each frame that has been met.
    met: u64,
    frame: u32,
    inverse: [L; 3],
    entry: [L; 3],
    exit: [L; 3],
    entry_rows: [Row; 3],
    exit_rows: [Row; 3],
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
        let (t_min, limit) = (line.t_below(ray.t_min), line.t_above(search.limit()));
        let zero = [L::splat(0.0); 3];
        let mut cursor = Cursor {
            space,
            met: 0,
            frame: Frame::WORLD,
            inverse: zero,
            entry: zero,
            exit: zero,
            entry_rows: [Row::low(0); 3],
            exit_rows: [Row::low(0); 3],
            t_min: L::splat(t_min),
            ray_t_min: ray.t_min,
            limit,
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
        self.exit_rows = ray.exit_rows;
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
                self.visit::<S>(wide, node)
            }
            Child::Leaf { start, count } => {
                counters.leaf_visit(count as u32);
                counters.triangle_tests(count as u32);
                match self.leaf(wide, (start, count), search) {
                    ControlFlow::Break(()) => false,
                    ControlFlow::Continue(()) => self.pop(),
                }
            }
        }
    }

    #[inline(always)]
    fn leaf<S: Search>(
        &mut self,
        wide: &Wide,
        (start, count): (usize, usize),
        search: &mut S,
    ) -> ControlFlow<()> {
        let rows = Rows::new(wide, start, count);
        let limits = (self.ray_t_min, round_up(search.limit()));
        let all = (1 << count) - 1;
        let (mut candidates, sheared) = match search.shear() {
            Some(shear) => {
                let block = Block::<L>::new(shear, rows);
                let candidates = block.candidates(shear, limits) & all;
                if candidates == 0 {
                    return ControlFlow::Continue(());
                }
                (candidates, block.to_arrays())
            }
            None => (all, [[[0.0; WIDTH]; 3]; 3]),
        };
        while candidates != 0 {
            let slot = candidates.trailing_zeros() as usize;
            candidates &= candidates - 1;
            search.test(&InLeaf {
                index: wide.triangles[start + slot],
                slot,
                rows,
                sheared: &sheared,
            })?;
        }
        self.limit = self.line.t_above(search.limit());
        ControlFlow::Continue(())
    }

    /// Where the ray enters and leaves the boxes of a node along an axis.
    #[inline(always)]
    fn slab(&self, node: &WideNode, axis: usize) -> (L, L) {
        let entry = L::load(self.entry_rows[axis].of(node)).sub(self.entry[axis]);
        let exit = L::load(self.exit_rows[axis].of(node)).sub(self.exit[axis]);
        (entry.mul(self.inverse[axis]), exit.mul(self.inverse[axis]))
    }

    #[inline(always)]
    fn visit<S: Search>(&mut self, wide: &Wide, node: &WideNode) -> bool {
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
                self.prefetch(wide, other.link);
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
                self.prefetch(wide, node.children[i]);
                self.space.stack[self.depth] = MaybeUninit::new(Entry::new(&near, node, i));
                self.depth += 1;
            }
            self.next = node.children[first];
        }
        true
    }

    /// Asks for the memory of a child that will be visited soon.
    #[inline(always)]
    fn prefetch(&self, wide: &Wide, link: Link) {
        match link.child() {
            Child::Node(index) => L::prefetch(&wide.nodes[index]),
            Child::Leaf { start, .. } => {
                if let Some(corners) = wide.corners[9 * start..].first_chunk::<64>() {
                    L::prefetch(corners);
                }
            }
        }
    }

    /// An entry of the stack below its depth.
    #[inline(always)]
    fn get(&self, at: usize) -> Entry {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::query::{Any, Closest};
    use crate::{Counts, Hit, Mesh, Tree, TreeChoice};
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

        /// Hits, and what it takes to find them, do not depend on the machine.
        #[test]
        fn all_instructions_do_the_same(
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
                        let mut counts = Counts::default();
                        let mut closest = Closest::new(&ray, |_: &Hit| true);
                        traverse_with(instructions, wide, &ray, &mut closest, &mut counts);
                        let mut any = Any::new(&ray, |_: &Hit| true);
                        traverse_with(instructions, wide, &ray, &mut any, &mut counts);
                        (closest.found(), any.found, counts)
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
