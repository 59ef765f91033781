//! Rays that go much the same way, taken through the tree together.
//!
//! A node is visited once for all of a packet's rays, and its boxes are held against all of them at
//! once, by intervals of what the rays have [Boulos2006]; a leaf's box is held against a [`Part`] of
//! the rays at a time, and so is each of its triangles. Boxes only decide what is looked at: hits are
//! those of single rays, bit for bit.

use std::ops::ControlFlow;

use glam::Vec3A;

use super::leaf::{self, Sight};
use super::line::{self, ROWS, Row};
use super::stack::{Place, Space};
use super::{along, splats};
use crate::geometry::triangle::Shear;
use crate::geometry::{Frame, Ray};
use crate::query::batch::{Coherence, Question};
use crate::query::simd::{Eight, Lanes, Part, SIXTEEN};
use crate::query::traverse::{Search, Triangle};
use crate::tree::wide::{Child, Link, WIDTH, Wide, WideNode};

/// Rays of a packet.
pub(super) const RAYS: usize = SIXTEEN;

/// A number for each ray.
type Numbers = [f32; RAYS];

/// How far boxes are widened, as `BOX_ERROR` in `line` says for one ray, which comes to 36: a box is
/// also held against a point of its own, by which it is off by √3, the offset from there by 3 · √3.
const BOX_ERROR: f32 = 48.0;

/// How far apart the directions of rays that go together may be, as tangents of the angles between
/// them, and their origins, over the half extent of the scene.
const MAX_ANGLE: f32 = 0.1;
const MAX_DISTANCE: f32 = 0.05;

/// A leaf's triangles are tested one by one, each with all rays that meet the leaf, where there are
/// no more triangles than this times the rays; otherwise the rays one by one.
const TOGETHER: u32 = 2;

/// A child, and where its box is.
#[derive(Clone, Copy)]
pub(super) struct Spot {
    link: Link,
    node: u32,
    slot: u32,
}

impl Place for Spot {
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

/// The searches of a packet's rays, and which t they want.
pub(super) struct Group<S> {
    pub(super) searches: [S; RAYS],
    pub(super) t_min: Numbers,
    /// Beyond this nothing is wanted any more; negative infinity where a search is over.
    pub(super) limits: Numbers,
    /// No point of the scene is further from any of the origins along an axis.
    pub(super) reach: f32,
}

impl<S: Search> Group<S> {
    #[inline(always)]
    pub(super) fn test(&mut self, ray: usize, triangle: &impl Triangle) -> ControlFlow<()> {
        let search = &mut self.searches[ray];
        if search.test(triangle).is_break() {
            self.stop(ray);
            return ControlFlow::Break(());
        }
        self.limits[ray] = search.limit_above();
        ControlFlow::Continue(())
    }

    /// Asks a search no more.
    #[inline(always)]
    pub(super) fn stop(&mut self, ray: usize) {
        self.limits[ray] = f32::NEG_INFINITY;
    }

    /// The limit of the search that wants most.
    #[inline(always)]
    fn limit<P: Part>(&self) -> f32 {
        let mut most = P::load_part(&self.limits, 0);
        for part in 1..P::PARTS {
            most = most.max(P::load_part(&self.limits, part));
        }
        most.highest()
    }

    /// The t_min of the search that begins first.
    #[inline(always)]
    fn first<P: Part>(&self) -> f32 {
        let mut first = P::load_part(&self.t_min, 0);
        for part in 1..P::PARTS {
            first = first.min(P::load_part(&self.t_min, part));
        }
        lowest(first)
    }
}

/// The rays' parts of the triangle test, where all go furthest along the same axis.
pub(super) struct Sights<P: Part> {
    /// As in `Shear`.
    pub(super) axes: [usize; 3],
    pub(super) parts: P::Parts<Sight<P>>,
}

impl<P: Part> Sights<P> {
    /// `None` where the rays go furthest along different axes.
    #[inline(always)]
    fn new(origins: &[Numbers; 3], directions: &[Numbers; 3]) -> Option<Self> {
        let first = Shear::of(&Ray::new([0.0; 3], directions.map(|along| along[0])));
        let axes = first.axes;
        let mut same = true;
        let mut parts = P::parts(Sight::new(axes, origins, directions, 0));
        for (part, sight) in parts.as_mut().iter_mut().enumerate() {
            *sight = Sight::new(axes, origins, directions, part);
            let [x, y, z] = load::<P>(directions, part);
            let (x, y, z) = (x.abs(), y.abs(), z.abs());
            let along_x = y.lt(x) & z.lt(x);
            let along_y = !along_x & z.lt(y);
            same &= match axes[2] {
                0 => along_x == P::ALL,
                1 => along_y & P::ALL == P::ALL,
                _ => (along_x | along_y) & P::ALL == 0,
            };
        }
        same.then_some(Sights { axes, parts })
    }

    /// Whether all directions are within [`MAX_ANGLE`] of each other.
    #[inline(always)]
    fn are_close(&self) -> bool {
        let mut close = true;
        for axis in 0..2 {
            let (mut low, mut high) = (P::splat(f32::INFINITY), P::splat(f32::NEG_INFINITY));
            for sight in self.parts.as_ref() {
                low = low.min(sight.shear[axis]);
                high = high.max(sight.shear[axis]);
            }
            close &= high.highest() - lowest(low) <= MAX_ANGLE;
        }
        let mut signs = 0;
        for (part, sight) in self.parts.as_ref().iter().enumerate() {
            signs |= sight.along.lt(P::splat(0.0)) << (P::COUNT * part);
        }
        close && (signs == 0 || signs == u32::MAX >> (32 - RAYS))
    }
}

impl<P: Part> Sight<P> {
    #[inline(always)]
    fn new(
        [kx, ky, kz]: [usize; 3],
        origins: &[Numbers; 3],
        directions: &[Numbers; 3],
        part: usize,
    ) -> Self {
        let (o, d) = (load::<P>(origins, part), load::<P>(directions, part));
        let minus = P::splat(-1.0);
        Sight {
            to_origin: [
                o[kx].times_sign(minus),
                o[ky].times_sign(minus),
                o[kz].times_sign(minus),
            ],
            shear: [d[kx].div(d[kz]), d[ky].div(d[kz])],
            along: d[kz],
        }
    }
}

/// The rays of a packet as boxes of one frame see them, along its axes.
pub(super) type Beam<L> = [Slab<L>; 3];

/// The rays of a packet along an axis of a frame.
///
/// A ray is at a coordinate c at t = c · inverse + offset, as in [`FrameRay`](line::FrameRay), or
/// from a point p at t = (c - p) · inverse + (p · inverse + offset). Where p is near all origins the
/// last term is small, and its range over the rays, with that of the inverse, bounds the t of all of
/// them closely.
#[derive(Clone, Copy)]
pub(super) struct Slab<L: Eight> {
    /// Of each ray.
    each: <L::Part as Part>::Parts<Each<L::Part>>,
    /// Of all rays.
    point: L,
    lowest: L,
    highest: L,
    first_entry: L,
    last_exit: L,
    /// Where boxes are entered, and where they are left.
    rows: [Row; 2],
}

/// Of each ray of a part.
#[derive(Clone, Copy)]
struct Each<P> {
    inverse: P,
    entry: P,
    exit: P,
}

impl<L: Eight> Slab<L> {
    #[inline(always)]
    fn new(
        frame: &Frame,
        axis: usize,
        origins: &[Numbers; 3],
        directions: &[Numbers; 3],
        margin: f32,
    ) -> Self {
        let splat = <L::Part as Lanes>::splat;
        let row: [L::Part; 3] = splats(frame.rows[axis]);
        let zero = splat(0.0);
        let mut each = L::Part::parts(Each {
            inverse: zero,
            entry: zero,
            exit: zero,
        });
        let (mut low, mut high) = (splat(f32::INFINITY), splat(f32::NEG_INFINITY));
        let (mut first, mut last) = (low, high);
        let [x, y, z] = frame.rows[axis];
        let point = x * origins[0][0] + y * origins[1][0] + z * origins[2][0];
        for (part, each) in each.as_mut().iter_mut().enumerate() {
            let origin = along(row, load(origins, part));
            let direction = along(row, load(directions, part));
            let size = direction.abs().max(splat(line::SMALLEST));
            let inverse = splat(1.0).div(size).times_sign(direction);
            let at = origin.mul(inverse).times_sign(splat(-1.0));
            let off = inverse.abs().mul(splat(margin));
            let (entry, exit) = (at.sub(off), at.add(off));
            low = low.min(inverse);
            high = high.max(inverse);
            first = first.min(splat(point).mul_add(inverse, entry));
            last = last.max(splat(point).mul_add(inverse, exit));
            *each = Each {
                inverse,
                entry,
                exit,
            };
        }
        let (mut low, mut high) = (lowest(low), high.highest());
        let (mut first, mut last) = (lowest(first), last.highest());
        if low < 0.0 && high > 0.0 {
            // Some go one way along the axis, some the other: any box may be met, but absent ones,
            // whose sides are infinite.
            (low, high) = (1e-3, 1e-3);
            (first, last) = (f32::MIN, f32::MAX);
        }
        Slab {
            each,
            point: L::splat(point),
            lowest: L::splat(low),
            highest: L::splat(high),
            first_entry: L::splat(first),
            last_exit: L::splat(last),
            rows: ROWS[if high < 0.0 { 7 } else { 0 }][axis],
        }
    }

    /// No more than where any ray enters the boxes of a node, and no less than where any leaves
    /// them.
    #[inline(always)]
    fn of_all(&self, node: &WideNode) -> (L, L) {
        let [entry, exit] = self.rows;
        let entry = L::load(entry.of(node)).sub(self.point);
        let exit = L::load(exit.of(node)).sub(self.point);
        let (first, last) = (self.first_entry, self.last_exit);
        (
            (entry.mul_add(self.lowest, first)).min(entry.mul_add(self.highest, first)),
            (exit.mul_add(self.lowest, last)).max(exit.mul_add(self.highest, last)),
        )
    }
}

impl<P: Part> Each<P> {
    /// Where each ray enters and leaves what lies between two coordinates.
    #[inline(always)]
    fn meet(&self, low: f32, high: f32) -> (P, P) {
        let (low, high) = (P::splat(low), P::splat(high));
        let (inverse, entry, exit) = (self.inverse, self.entry, self.exit);
        (
            (low.mul_add(inverse, entry)).min(high.mul_add(inverse, entry)),
            (low.mul_add(inverse, exit)).max(high.mul_add(inverse, exit)),
        )
    }
}

/// A bit for each ray that meets the box of a child within its range of t.
#[inline(always)]
fn meet<L: Eight, S>(beam: &Beam<L>, node: &WideNode, slot: usize, group: &Group<S>) -> u32 {
    let mut met = 0;
    for part in 0..L::Part::PARTS {
        let tiny = <L::Part as Lanes>::splat(f32::MIN_POSITIVE);
        let mut near = L::Part::load_part(&group.t_min, part).sub(tiny);
        let mut far = L::Part::load_part(&group.limits, part).add(tiny);
        for (axis, slab) in beam.iter().enumerate() {
            let (low, high) = (node.bounds[axis][slot], node.bounds[axis + 3][slot]);
            let (first, last) = slab.each.as_ref()[part].meet(low, high);
            near = near.max(first);
            far = far.min(last);
        }
        met |= near.le(far) << (L::Part::COUNT * part);
    }
    met
}

/// A packet on its way through a tree.
struct Packet<'a, L: Eight, S> {
    wide: &'a Wide,
    /// Relative to the centre of the scene.
    origins: [Numbers; 3],
    directions: [Numbers; 3],
    margin: f32,
    sights: Option<Sights<L::Part>>,
    group: Group<S>,
}

impl<L: Eight, S: Search> Packet<'_, L, S> {
    #[inline(always)]
    fn beam(&self, frame: u32) -> Beam<L> {
        let frame = &self.wide.frames[frame as usize];
        let (origins, directions) = (&self.origins, &self.directions);
        [
            Slab::new(frame, 0, origins, directions, self.margin),
            Slab::new(frame, 1, origins, directions, self.margin),
            Slab::new(frame, 2, origins, directions, self.margin),
        ]
    }

    /// Visits what the rays meet, until all searches have their answers.
    #[inline(always)]
    fn run(&mut self, space: &mut Space<Spot, Beam<L>>) {
        let wide = self.wide;
        let (mut stack, mut frames) = space.emptied();
        let mut limit = self.group.limit::<L::Part>() + f32::MIN_POSITIVE;
        let t_min = L::splat(self.group.first::<L::Part>() - f32::MIN_POSITIVE);
        let mut next = Spot::ROOT;
        loop {
            let child = next.link.child();
            // The node whose boxes are looked at: all of them, or that of a leaf.
            let index = match child {
                Child::Node(index) => index,
                Child::Leaf { .. } => next.node as usize,
            };
            debug_assert!(index < wide.nodes.len());
            // SAFETY: the links of a tree name nodes that are there: `store` writes them so, and
            // `check_wide` refuses a tree from a file that is otherwise. A leaf is a child of a node
            // that has been visited.
            let node = unsafe { wide.nodes.get_unchecked(index) };
            let beam = match frames.get(node.frame) {
                Some(beam) => beam,
                None => frames.meet(node.frame, self.beam(node.frame)),
            };
            match child {
                Child::Node(_) => {
                    let [x, y, z] = beam;
                    let (near_x, far_x) = x.of_all(node);
                    let (near_y, far_y) = y.of_all(node);
                    let (near_z, far_z) = z.of_all(node);
                    let near = near_x.max(near_y).max(near_z.max(t_min));
                    let far = far_x.min(far_y).min(far_z.min(L::splat(limit)));
                    let met = near.le(far);
                    if met != 0 {
                        next = stack.choose::<L, S>(wide, (index, node), met, near);
                        continue;
                    }
                }
                Child::Leaf { start, count } => {
                    let active = meet(beam, node, next.slot as usize, &self.group);
                    if active != 0 {
                        self.visit((start, count), active);
                        limit = self.group.limit::<L::Part>() + f32::MIN_POSITIVE;
                        if limit == f32::NEG_INFINITY {
                            return;
                        }
                    }
                }
            }
            if !stack.pop::<S>(wide, limit, &mut next) {
                return;
            }
        }
    }

    /// Asks the searches of these rays about the triangles of a leaf.
    #[inline(always)]
    fn visit(&mut self, leaf: (usize, usize), active: u32) {
        if let Some(sights) = &self.sights
            && leaf.1 as u32 <= TOGETHER * active.count_ones()
        {
            return leaf::visit_group(self.wide, leaf, sights, &mut self.group, active);
        }
        let mut rest = active;
        while rest != 0 {
            let ray = rest.trailing_zeros() as usize;
            rest &= rest - 1;
            let from = (self.group.t_min[ray], self.group.reach);
            let search = &mut self.group.searches[ray];
            match leaf::visit::<L, S>(self.wide, leaf, from, search) {
                ControlFlow::Break(()) => self.group.stop(ray),
                ControlFlow::Continue(false) => {}
                ControlFlow::Continue(true) => {
                    self.group.limits[ray] = search.limit_above();
                }
            }
        }
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

/// Takes rays through the tree together; false where they do not go together, or not well enough.
#[inline(always)]
pub(super) fn traverse<L: Eight, Q: Question>(
    wide: &Wide,
    rays: &[Ray; RAYS],
    answers: &mut [Q::Answer; RAYS],
    space: &mut Space<Spot, Beam<L>>,
    coherence: Coherence,
) -> bool {
    let judge = coherence == Coherence::Unknown;
    if judge && !(are_alike(&rays[0], &rays[RAYS - 1]) && are_alike(&rays[0], &rays[RAYS / 2])) {
        return false;
    }
    let (mut origins, mut directions) = ([[0.0; RAYS]; 3], [[0.0; RAYS]; 3]);
    let (mut t_min, mut limits) = ([0.0; RAYS], [0.0; RAYS]);
    for (half, rays) in rays.as_chunks::<WIDTH>().0.iter().enumerate() {
        let [ox, oy, oz, dx, dy, dz, low, high] = L::columns(bytemuck::cast_ref(rays));
        let ordinary = line::are_ordinary([ox, oy, oz], [dx, dy, dz]);
        // A number is equal to itself.
        if ordinary & low.le(low) & high.le(high) != u32::MAX >> (32 - WIDTH) {
            return false;
        }
        let [x, y, z] = &mut origins;
        put(x, half, ox);
        put(y, half, oy);
        put(z, half, oz);
        let [x, y, z] = &mut directions;
        put(x, half, dx);
        put(y, half, dy);
        put(z, half, dz);
        put(&mut t_min, half, low);
        put(&mut limits, half, high);
    }
    let sights = Sights::<L::Part>::new(&origins, &directions);
    // Not by a closure: see the head of `wide`.
    let close = match &sights {
        Some(sights) => sights.are_close(),
        None => false,
    };
    if judge && !close {
        return false;
    }
    let mut reach = 0.0;
    for (origins, &center) in origins.iter_mut().zip(&wide.center) {
        let splat = <L::Part as Lanes>::splat;
        let (mut low, mut high) = (splat(f32::INFINITY), splat(f32::NEG_INFINITY));
        for part in 0..L::Part::PARTS {
            let origin = L::Part::load_part(origins, part).sub(splat(center));
            origin.store_part(origins, part);
            low = low.min(origin);
            high = high.max(origin);
        }
        let (low, high) = (lowest(low), high.highest());
        if judge && high - low > MAX_DISTANCE * wide.half_extent {
            return false;
        }
        reach = f32::max(reach, f32::max(-low, high));
    }
    reach += wide.half_extent;
    if !line::is_near(reach) {
        return false;
    }
    let mut packet = Packet {
        wide,
        origins,
        directions,
        margin: line::margin_of(BOX_ERROR, reach),
        sights,
        group: Group {
            searches: std::array::from_fn(|i| Q::search(&rays[i])),
            t_min,
            limits,
            reach,
        },
    };
    packet.run(space);
    for (answer, search) in answers.iter_mut().zip(&packet.group.searches) {
        *answer = Q::answer(search);
    }
    true
}

#[inline(always)]
fn load<P: Part>(from: &[Numbers; 3], part: usize) -> [P; 3] {
    let [x, y, z] = from;
    [
        P::load_part(x, part),
        P::load_part(y, part),
        P::load_part(z, part),
    ]
}

/// Writes the numbers of the first or the second eight rays.
#[inline(always)]
fn put<L: Eight>(to: &mut Numbers, half: usize, numbers: L) {
    to.as_chunks_mut().0[half] = numbers.to_array();
}

#[inline(always)]
fn lowest<P: Part>(numbers: P) -> f32 {
    -numbers.times_sign(P::splat(-1.0)).highest()
}
