//! Rays that go much the same way, taken through the tree together.
//!
//! A node is visited once for all of a packet's rays, and its boxes are held against all of them at
//! once, by bounds of what the rays have [Boulos2006]; a leaf's box is held against a [`Part`] of
//! the rays at a time, and so is each of its triangles. Boxes only decide what is looked at: hits are
//! those of single rays, bit for bit.

use std::ops::ControlFlow;

use glam::Vec3A;

use super::beam::{self, BOX_ERROR, Beam, Slab, lowest};
use super::leaf::{self, Sight};
use super::line;
use super::stack::{Place, Space};
use super::{node, splats};
use crate::geometry::Ray;
use crate::geometry::triangle::Shear;
use crate::query::batch::{Coherence, Question};
use crate::query::simd::{Eight, LARGEST_PART, PREFETCH, Part};
use crate::query::{Hit, NONE};
use crate::tree::wide::{Child, Link, Wide, WideNode};

pub(super) use crate::query::simd::RAYS;

/// Rays of a packet where more do not go together.
pub(super) const BLOCK: usize = 16;

/// How far apart the directions of rays that go together may be, as tangents of the angles between
/// them, and their origins, over the half extent of the scene.
const MAX_ANGLE: f32 = 0.2;
const MAX_DISTANCE: f32 = 0.05;

/// A leaf's triangles are tested one by one, each with all rays that meet the leaf, where that takes
/// no more tests of a triangle and a part of the rays than this times the rays; otherwise the rays
/// one by one.
const TOGETHER: u32 = 2;

/// How many nodes and leaves a packet visits before it gives up: so many for each ray, and so many
/// more for each that meets a leaf.
///
/// Alone, a ray visits some six nodes for each leaf that it meets (killeroo, truck, coffee, sponza,
/// arcade, kitchen: 4 to 7). A visit together takes longer than one alone.
const PATIENCE: u32 = 1;
const PATIENCE_PER_LEAF: u32 = 5;

/// For how many packets after one that gave up none is tried again.
pub(super) const AVOIDED: usize = 16;

/// A child, and where its box is.
#[derive(Clone, Copy)]
pub(super) struct Spot {
    link: Link,
    node: u32,
    slot: u32,
}

impl Place for Spot {
    const RANKED: bool = true;

    #[inline(always)]
    fn new(index: usize, node: &WideNode, slot: usize) -> Self {
        Spot {
            link: node.children[slot],
            node: index as u32,
            slot: slot as u32,
        }
    }

    #[inline(always)]
    fn link(&self) -> Link {
        self.link
    }
}

impl Spot {
    const ROOT: Spot = Spot {
        link: Link::ROOT,
        node: 0,
        slot: 0,
    };
}

/// The memory of a packet's traversal. It knows rays in few frames at a time: in all of them they
/// take so much of it that asking for the memory takes long.
pub(super) type Room<L> = Space<Spot, Beam<L>, 8>;

/// What is known of the rays of a packet.
pub(super) type Parts<L> = <<L as Eight>::Part as Part>::Parts<Members<<L as Eight>::Part>>;

/// What is known of the rays of a part.
#[derive(Clone, Copy)]
pub(super) struct Members<P> {
    /// Relative to the centre of the scene.
    pub(super) origin: [P; 3],
    pub(super) direction: [P; 3],
    pub(super) sight: Sight<P>,
    pub(super) t_min: P,
    /// Beyond this nothing is wanted any more: the t of the best hit so far; negative infinity where
    /// a search is over.
    pub(super) limit: P,
    /// u and v of the best hit so far.
    weights: [P; 2],
    /// The bits of its triangle, or those of [`NONE`].
    triangle: P,
}

impl<P: Part> Members<P> {
    /// Of no rays, yet.
    #[inline(always)]
    pub(super) fn none() -> Self {
        let zero = P::splat(0.0);
        Members {
            origin: [zero; 3],
            direction: [zero; 3],
            sight: Sight {
                to_origin: [zero; 3],
                shear: [zero; 2],
                along: zero,
            },
            t_min: zero,
            limit: zero,
            weights: [zero; 2],
            triangle: zero,
        }
    }

    /// These rays have a hit, whatever it is, and want no other.
    #[inline(always)]
    pub(super) fn stop(&mut self, rays: u32) {
        self.limit = self.limit.select(rays, P::splat(f32::NEG_INFINITY));
        self.triangle = self.triangle.select(rays, P::splat(0.0));
    }

    /// A bit for each ray to which a hit is nearer than the best so far, or as near, in a triangle
    /// that comes first.
    #[inline(always)]
    pub(super) fn prefer(&self, t: P, triangle: P) -> u32 {
        t.lt(self.limit) | t.le(self.limit) & triangle.lt_bits(self.triangle)
    }

    /// These rays have a better hit.
    #[inline(always)]
    pub(super) fn take(&mut self, rays: u32, [t, u, v]: [P; 3], triangle: P) {
        self.limit = self.limit.select(rays, t);
        self.weights[0] = self.weights[0].select(rays, u);
        self.weights[1] = self.weights[1].select(rays, v);
        self.triangle = self.triangle.select(rays, triangle);
    }

    #[inline(always)]
    fn hits(&self) -> Hits {
        let mut hits = Hits::default();
        self.limit.store_to(&mut hits.t);
        self.weights[0].store_to(&mut hits.u);
        self.weights[1].store_to(&mut hits.v);
        self.triangle.store_to(&mut hits.triangle);
        hits
    }

    /// The answers for as many of the rays as there are.
    #[inline(always)]
    fn answer<Q: Question>(&self, answers: &mut [Q::Answer]) {
        let hits = self.hits();
        let mut found = self.triangle.lt_bits(P::splat(f32::from_bits(NONE)));
        if found == P::ALL {
            for (lane, answer) in answers.iter_mut().enumerate() {
                *answer = Q::answer(hits.get(lane));
            }
            return;
        }
        // Which ones have a hit is hard to foresee.
        answers.fill(Q::answer(None));
        while found != 0 {
            let lane = found.trailing_zeros() as usize;
            found &= found - 1;
            answers[lane] = Q::answer(hits.get(lane));
        }
    }

    #[inline(always)]
    fn set_hits(&mut self, hits: &Hits) {
        self.limit = P::load_from(&hits.t);
        self.weights = [P::load_from(&hits.u), P::load_from(&hits.v)];
        self.triangle = P::load_from(&hits.triangle);
    }
}

/// The best hits so far of the rays of a part.
#[derive(Default)]
struct Hits {
    t: [f32; LARGEST_PART],
    u: [f32; LARGEST_PART],
    v: [f32; LARGEST_PART],
    triangle: [f32; LARGEST_PART],
}

impl Hits {
    #[inline(always)]
    fn set(&mut self, lane: usize, hit: Hit) {
        self.t[lane] = hit.t;
        self.u[lane] = hit.u;
        self.v[lane] = hit.v;
        self.triangle[lane] = f32::from_bits(hit.triangle);
    }

    #[inline(always)]
    fn get(&self, lane: usize) -> Option<Hit> {
        let triangle = self.triangle[lane].to_bits();
        (triangle != NONE).then_some(Hit {
            t: self.t[lane],
            u: self.u[lane],
            v: self.v[lane],
            triangle,
        })
    }
}

/// A packet on its way through a tree.
struct Packet<'a, P: Part> {
    wide: &'a Wide,
    rays: &'a [Ray],
    /// As many as there are rays for.
    parts: &'a mut [Members<P>],
    /// The axes of the triangle test, where all rays go furthest along the last one.
    axes: Option<[usize; 3]>,
    margin: f32,
    /// No point of the scene is further from any of the origins along an axis.
    reach: f32,
}

impl<'a, P: Part> Packet<'a, P> {
    /// And whether the rays are close to each other; `None` where one of them needs care.
    #[inline(always)]
    fn gather(
        wide: &'a Wide,
        rays: &'a [Ray],
        parts: &'a mut [Members<P>],
    ) -> Option<(Self, bool)> {
        let (first, last) = (rays.first()?, rays.last()?);
        let [kx, ky, kz] = Shear::of(first).axes;
        let mut same_axes = true;
        let (mut forward, mut backward) = (0, 0);
        // Of the origins, and of the shears.
        let mut low = [P::splat(f32::INFINITY); 5];
        let mut high = [P::splat(f32::NEG_INFINITY); 5];
        for (members, rays) in parts.iter_mut().zip(rays.chunks(P::COUNT)) {
            let mut filled;
            let (rays, present) = match rays.len() == P::COUNT {
                true => (rays, P::ALL),
                false => {
                    filled = [*last; LARGEST_PART];
                    filled[..rays.len()].copy_from_slice(rays);
                    (&filled[..P::COUNT], (1 << rays.len()) - 1)
                }
            };
            let [ox, oy, oz, dx, dy, dz, t_min, t_max] = P::columns_of(bytemuck::cast_slice(rays));
            let ordinary = line::are_ordinary([ox, oy, oz], [dx, dy, dz]);
            // A number is equal to itself.
            if ordinary & P::splat(0.0).le(t_min) & t_max.le(t_max) != P::ALL {
                return None;
            }
            let [cx, cy, cz] = splats::<P>(wide.center);
            let (origin, direction) = ([ox, oy, oz], [dx, dy, dz]);
            let along = direction[kz];
            let shear = [direction[kx].div(along), direction[ky].div(along)];
            let minus = P::splat(-1.0);
            *members = Members {
                origin: [ox.sub(cx), oy.sub(cy), oz.sub(cz)],
                direction,
                sight: Sight {
                    to_origin: [
                        origin[kx].times_sign(minus),
                        origin[ky].times_sign(minus),
                        origin[kz].times_sign(minus),
                    ],
                    shear,
                    along,
                },
                t_min,
                limit: P::splat(f32::NEG_INFINITY).select(present, t_max),
                weights: [P::splat(0.0); 2],
                triangle: P::splat(f32::from_bits(NONE)),
            };
            same_axes &= all_go_along::<P>(kz, direction);
            forward |= !along.negative() & P::ALL;
            backward |= along.negative();
            let ([x, y, z], [sx, sy]) = (members.origin, shear);
            for (i, numbers) in [x, y, z, sx, sy].into_iter().enumerate() {
                low[i] = low[i].min(numbers);
                high[i] = high[i].max(numbers);
            }
        }
        let mut close = same_axes && (forward == 0 || backward == 0);
        let mut reach = 0.0;
        for (low, high) in low.into_iter().zip(high).take(3) {
            let (low, high) = (lowest(low), high.highest());
            close &= high - low <= MAX_DISTANCE * wide.half_extent;
            reach = f32::max(reach, f32::max(-low, high));
        }
        for (low, high) in low.into_iter().zip(high).skip(3) {
            close &= high.highest() - lowest(low) <= MAX_ANGLE;
        }
        reach += wide.half_extent;
        if !line::is_near(reach) {
            return None;
        }
        let packet = Packet {
            wide,
            rays,
            parts,
            axes: same_axes.then_some([kx, ky, kz]),
            margin: line::margin_of(BOX_ERROR, reach),
            reach,
        };
        Some((packet, close))
    }

    /// The limit of the search that wants most.
    #[inline(always)]
    fn limit(&self) -> f32 {
        let mut most = P::splat(f32::NEG_INFINITY);
        for members in &*self.parts {
            most = most.max(members.limit);
        }
        most.highest()
    }

    /// The t_min of the search that begins first.
    #[inline(always)]
    fn t_min(&self) -> f32 {
        let mut first = P::splat(f32::INFINITY);
        for members in &*self.parts {
            first = first.min(members.t_min);
        }
        lowest(first)
    }

    /// Visits what the rays meet, until all searches have their answers; false where it gives up,
    /// which it may do if it is to judge.
    #[inline(always)]
    fn run<L: Eight<Part = P>, Q: Question>(&mut self, room: &mut Room<L>, judge: bool) -> bool {
        let wide = self.wide;
        let (mut stack, mut frames) = room.emptied();
        let mut limit = self.limit() + f32::MIN_POSITIVE;
        let t_min = self.t_min() - f32::MIN_POSITIVE;
        let mut next = Spot::ROOT;
        let mut left = match judge {
            true => PATIENCE * self.rays.len() as u32,
            false => u32::MAX,
        };
        loop {
            if left == 0 {
                return false;
            }
            left -= 1;
            let child = next.link.child();
            // The node whose boxes are looked at: all of them, or that of a leaf.
            let index = match child {
                Child::Node(index) => index,
                Child::Leaf { .. } => next.node as usize,
            };
            let node = node(wide, index);
            let beam = match frames.get(node.frame) {
                Some(beam) => beam,
                None => {
                    // In its place: it is too large to be moved there.
                    let beam = frames.meet(node.frame, [Slab::none(); 3]);
                    for (axis, slab) in beam.iter_mut().enumerate() {
                        let frame = &wide.frames[node.frame as usize];
                        slab.set(frame, axis, self.parts, self.margin);
                    }
                    &*beam
                }
            };
            match child {
                Child::Node(_) => {
                    let [x, y, z] = beam;
                    let (near_x, far_x) = x.of_all(node);
                    let (near_y, far_y) = y.of_all(node);
                    let (near_z, far_z) = z.of_all(node);
                    let near = near_x.max(near_y).max(near_z.max(L::splat(t_min)));
                    let far = far_x.min(far_y).min(far_z.min(L::splat(limit)));
                    let met = near.le(far);
                    if met != 0 {
                        next = stack.choose::<L, Q::Search<'_>>(wide, (index, node), met, near);
                        continue;
                    }
                }
                Child::Leaf { start, count } => {
                    let mut active = P::parts(0);
                    let mut all = 0;
                    let parts = self.parts.iter().enumerate();
                    for (members, active) in parts.zip(active.as_mut()) {
                        *active = beam::meet(beam, node, next.slot as usize, members, t_min);
                        all |= *active;
                    }
                    if all != 0 {
                        let met = self.visit::<L, Q>((start, count), active);
                        left = left.saturating_add(PATIENCE_PER_LEAF * met);
                        limit = self.limit() + f32::MIN_POSITIVE;
                        if limit == f32::NEG_INFINITY {
                            return true;
                        }
                    }
                }
            }
            if !stack.pop::<Q::Search<'_>>(wide, limit, &mut next) {
                return true;
            }
        }
    }

    /// Tests the triangles of a leaf with these rays, a bit for each; how many there are.
    #[inline(always)]
    fn visit<L: Eight, Q: Question>(
        &mut self,
        leaf: (usize, usize),
        mut active: P::Parts<u32>,
    ) -> u32 {
        let (wide, rays, reach) = (self.wide, self.rays, self.reach);
        let active = &mut active.as_mut()[..self.parts.len()];
        let (mut wanting, mut parts) = (0, 0);
        for active in &*active {
            wanting += active.count_ones();
            parts += u32::from(*active != 0);
        }
        let group = &mut *self.parts;
        if let Some(axes) = self.axes
            && leaf.1 as u32 * parts <= TOGETHER * wanting
        {
            let group = (group, reach);
            leaf::visit_together::<P, Q::Search<'_>>(wide, leaf, axes, group, rays, active);
            return wanting;
        }
        for (part, (members, active)) in group.iter_mut().zip(active).enumerate() {
            if *active == 0 {
                continue;
            }
            let mut hits = members.hits();
            while *active != 0 {
                let lane = active.trailing_zeros() as usize;
                *active &= *active - 1;
                let ray = &rays[P::COUNT * part + lane];
                let mut search = Q::search(ray, hits.get(lane));
                let tested = leaf::visit::<L, _>(wide, leaf, (ray.t_min, reach), &mut search);
                if tested != ControlFlow::Continue(false)
                    && let Some(hit) = Q::found(&search)
                {
                    hits.set(lane, hit);
                }
            }
            members.set_hits(&hits);
        }
        wanting
    }
}

/// Whether two directions are within some 10° of each other. Most rays that go anywhere are told by
/// this, before anything is made ready for a packet.
#[inline(always)]
fn are_alike(a: &Ray, b: &Ray) -> bool {
    let (a, b) = (Vec3A::from(a.direction), Vec3A::from(b.direction));
    let dot = a.dot(b);
    dot > 0.0 && dot * dot > 0.97 * a.length_squared() * b.length_squared()
}

/// What has become of rays that were to go together.
pub(super) enum Outcome {
    /// They have their answers.
    Answered,
    /// They do not go much the same way, or one of them needs care.
    Apart,
    /// They have more to visit together than is worth it.
    TooFar,
}

/// Takes rays through the tree together, at most [`RAYS`].
#[inline(always)]
pub(super) fn traverse<L: Eight, Q: Question>(
    wide: &Wide,
    rays: &[Ray],
    answers: &mut [Q::Answer],
    (room, parts): (&mut Room<L>, &mut Parts<L>),
    coherence: Coherence,
) -> Outcome {
    let judge = coherence == Coherence::Unknown;
    let [first, .., last] = rays else {
        return Outcome::Apart;
    };
    // Those nearby first: it takes time to get at the others.
    if judge
        && !(are_alike(first, &rays[rays.len() / 4])
            && are_alike(first, &rays[rays.len() / 2])
            && are_alike(first, last))
    {
        return Outcome::Apart;
    }
    let parts = &mut parts.as_mut()[..rays.len().div_ceil(L::Part::COUNT)];
    let Some((mut packet, close)) = Packet::<L::Part>::gather(wide, rays, parts) else {
        return Outcome::Apart;
    };
    if judge && !close {
        return Outcome::Apart;
    }
    ask_for::<L, _>(rays.as_ptr_range().end, rays.len());
    ask_for::<L, _>(answers.as_ptr(), answers.len());
    if !packet.run::<L, Q>(room, judge) {
        return Outcome::TooFar;
    }
    for (answers, members) in answers.chunks_mut(L::Part::COUNT).zip(&*packet.parts) {
        members.answer::<Q>(answers);
    }
    Outcome::Answered
}

/// Asks for memory that is needed after the packet: the next rays, and where its answers go.
#[inline(always)]
fn ask_for<L: Eight, T>(first: *const T, count: usize) {
    for at in (0..count * size_of::<T>()).step_by(PREFETCH) {
        L::prefetch(first.cast::<u8>().wrapping_add(at));
    }
}

/// Whether all rays go furthest along an axis, as [`Shear::of`] says for one.
#[inline(always)]
fn all_go_along<P: Part>(axis: usize, [x, y, z]: [P; 3]) -> bool {
    let (x, y, z) = (x.abs(), y.abs(), z.abs());
    let along_x = y.lt(x) & z.lt(x);
    let along_y = !along_x & z.lt(y);
    match axis {
        0 => along_x == P::ALL,
        1 => along_y & P::ALL == P::ALL,
        _ => (along_x | along_y) & P::ALL == 0,
    }
}
