//! Rays that go much the same way, taken through the tree together.
//!
//! A node is visited once for all of a packet's rays, and its boxes are held against all of them at
//! once, by intervals of what the rays have [Boulos2006]; a leaf's box is held against eight rays at
//! a time, and so is each of its triangles. Boxes only decide what is looked at: hits are those of
//! single rays, bit for bit.

use std::ops::ControlFlow;

use glam::Vec3A;

use super::leaf::{self, Sight};
use super::line::{self, ROWS, Rows};
use super::splats;
use super::stack::{Place, Space};
use crate::geometry::triangle::Shear;
use crate::geometry::{Frame, Ray};
use crate::query::batch::{Coherence, Question};
use crate::query::simd::Lanes;
use crate::query::traverse::{Search, Triangle};
use crate::tree::wide::{Child, Link, WIDTH, Wide, WideNode};

/// Rays of a packet.
pub(super) const RAYS: usize = WIDTH * PARTS;

/// Parts of a packet, with a ray for each lane.
const PARTS: usize = 2;

/// A number for each ray.
type Numbers = [[f32; WIDTH]; PARTS];

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
pub(super) struct Group<L, S> {
    pub(super) searches: [S; RAYS],
    pub(super) t_min: [L; PARTS],
    /// Beyond this nothing is wanted any more; negative infinity where a search is over.
    pub(super) limits: Numbers,
    /// No point of the scene is further from any of the origins along an axis.
    pub(super) reach: f32,
}

impl<L: Lanes, S: Search> Group<L, S> {
    #[inline(always)]
    pub(super) fn test(&mut self, ray: usize, triangle: &impl Triangle) -> ControlFlow<()> {
        let search = &mut self.searches[ray];
        if search.test(triangle).is_break() {
            self.stop(ray);
            return ControlFlow::Break(());
        }
        self.limits.as_flattened_mut()[ray] = search.limit_above();
        ControlFlow::Continue(())
    }

    /// Asks a search no more.
    #[inline(always)]
    pub(super) fn stop(&mut self, ray: usize) {
        self.limits.as_flattened_mut()[ray] = f32::NEG_INFINITY;
    }

    /// The limit of the search that wants most.
    #[inline(always)]
    fn limit(&self) -> f32 {
        let mut most = L::load(&self.limits[0]);
        for limits in &self.limits[1..] {
            most = most.max(L::load(limits));
        }
        highest(most)
    }
}

/// The rays' parts of the triangle test, where all go furthest along the same axis.
pub(super) struct Sights<L> {
    /// As in `Shear`.
    pub(super) axes: [usize; 3],
    pub(super) parts: [Sight<L>; PARTS],
}

impl<L: Lanes> Sights<L> {
    /// `None` where the rays go furthest along different axes.
    #[inline(always)]
    fn new(origins: &[Numbers; 3], directions: &[Numbers; 3]) -> Option<Self> {
        let first = Shear::of(&Ray::new([0.0; 3], directions.map(|along| along[0][0])));
        let axes = first.axes;
        let mut same = true;
        for part in 0..PARTS {
            let [x, y, z] = load::<L>(directions, part);
            let (x, y, z) = (x.abs(), y.abs(), z.abs());
            let along_x = y.lt(x) & z.lt(x);
            let along_y = !along_x & z.lt(y);
            same &= match axes[2] {
                0 => along_x == 0xff,
                1 => along_y & 0xff == 0xff,
                _ => (along_x | along_y) & 0xff == 0,
            };
        }
        let mut parts = [Sight::new(axes, origins, directions, 0); PARTS];
        for (part, sight) in parts.iter_mut().enumerate().skip(1) {
            *sight = Sight::new(axes, origins, directions, part);
        }
        same.then_some(Sights { axes, parts })
    }

    /// Whether all directions are within [`MAX_ANGLE`] of each other.
    #[inline(always)]
    fn are_close(&self) -> bool {
        let mut close = true;
        for axis in 0..2 {
            let (mut low, mut high) = (self.parts[0].shear[axis], self.parts[0].shear[axis]);
            for sight in &self.parts[1..] {
                low = low.min(sight.shear[axis]);
                high = high.max(sight.shear[axis]);
            }
            close &= highest(high) - lowest(low) <= MAX_ANGLE;
        }
        let mut signs = 0;
        for (part, sight) in self.parts.iter().enumerate() {
            signs |= sight.along.lt(L::splat(0.0)) << (WIDTH * part);
        }
        close && (signs == 0 || signs == u32::MAX >> (32 - RAYS))
    }
}

impl<L: Lanes> Sight<L> {
    #[inline(always)]
    fn new(
        [kx, ky, kz]: [usize; 3],
        origins: &[Numbers; 3],
        directions: &[Numbers; 3],
        part: usize,
    ) -> Self {
        let (o, d) = (load::<L>(origins, part), load::<L>(directions, part));
        let minus = L::splat(-1.0);
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

/// The rays of a packet as boxes of one frame see them.
///
/// A ray is at a coordinate c at t = c · inverse + offset, as in
/// [`FrameRay`](line::FrameRay), or from a point p at t = (c - p) · inverse + (p · inverse + offset). Where p is
/// near all origins the last term is small, and its range over the rays, with that of the inverse,
/// bounds the t of all of them closely.
#[derive(Clone, Copy)]
pub(super) struct Beam<L> {
    /// Of each ray.
    inverse: [[L; PARTS]; 3],
    entry: [[L; PARTS]; 3],
    exit: [[L; PARTS]; 3],
    /// Of all rays.
    point: [L; 3],
    lowest: [L; 3],
    highest: [L; 3],
    first_entry: [L; 3],
    last_exit: [L; 3],
    rows: Rows,
}

impl<L: Lanes> Beam<L> {
    #[inline(always)]
    fn new(frame: &Frame, origins: &[Numbers; 3], directions: &[Numbers; 3], margin: f32) -> Self {
        let zero = L::splat(0.0);
        let mut beam = Beam {
            inverse: [[zero; PARTS]; 3],
            entry: [[zero; PARTS]; 3],
            exit: [[zero; PARTS]; 3],
            point: [zero; 3],
            lowest: [zero; 3],
            highest: [zero; 3],
            first_entry: [zero; 3],
            last_exit: [zero; 3],
            rows: ROWS[0],
        };
        for (axis, &row) in frame.rows.iter().enumerate() {
            let row: [L; 3] = splats(row);
            let (mut low, mut high) = (L::splat(f32::INFINITY), L::splat(f32::NEG_INFINITY));
            let (mut first, mut last) = (low, high);
            let mut point = zero;
            for part in 0..PARTS {
                let origin = along(row, load(origins, part));
                let direction = along(row, load(directions, part));
                let size = direction.abs().max(L::splat(line::SMALLEST));
                let inverse = L::splat(1.0).div(size).times_sign(direction);
                let at = origin.mul(inverse).times_sign(L::splat(-1.0));
                let off = inverse.abs().mul(L::splat(margin));
                let (entry, exit) = (at.sub(off), at.add(off));
                if part == 0 {
                    point = L::splat(origin.to_array()[0]);
                }
                beam.inverse[axis][part] = inverse;
                beam.entry[axis][part] = entry;
                beam.exit[axis][part] = exit;
                low = low.min(inverse);
                high = high.max(inverse);
                first = first.min(point.mul_add(inverse, entry));
                last = last.max(point.mul_add(inverse, exit));
            }
            let (mut low, mut high) = (lowest(low), highest(high));
            let (mut first, mut last) = (lowest(first), highest(last));
            if low < 0.0 && high > 0.0 {
                // Some go one way along the axis, some the other: any box may be met, but absent
                // ones, whose sides are infinite.
                (low, high) = (1e-3, 1e-3);
                (first, last) = (f32::MIN, f32::MAX);
            }
            beam.rows[axis] = ROWS[if high < 0.0 { 7 } else { 0 }][axis];
            beam.point[axis] = point;
            beam.lowest[axis] = L::splat(low);
            beam.highest[axis] = L::splat(high);
            beam.first_entry[axis] = L::splat(first);
            beam.last_exit[axis] = L::splat(last);
        }
        beam
    }

    /// No more than where any ray enters the boxes of a node along an axis, and no less than where
    /// any leaves them.
    #[inline(always)]
    fn slab(&self, node: &WideNode, axis: usize) -> (L, L) {
        let [entry, exit] = self.rows[axis];
        let entry = L::load(entry.of(node)).sub(self.point[axis]);
        let exit = L::load(exit.of(node)).sub(self.point[axis]);
        let (low, high) = (self.lowest[axis], self.highest[axis]);
        let (first, last) = (self.first_entry[axis], self.last_exit[axis]);
        (
            entry.mul_add(low, first).min(entry.mul_add(high, first)),
            exit.mul_add(low, last).max(exit.mul_add(high, last)),
        )
    }

    /// A bit for each ray that meets the box of a child within its range of t.
    #[inline(always)]
    fn meet<S>(&self, node: &WideNode, slot: usize, group: &Group<L, S>) -> u32 {
        let mut met = 0;
        for part in 0..PARTS {
            let tiny = L::splat(f32::MIN_POSITIVE);
            let mut near = group.t_min[part].sub(tiny);
            let mut far = L::load(&group.limits[part]).add(tiny);
            for axis in 0..3 {
                let low = L::splat(node.bounds[axis][slot]);
                let high = L::splat(node.bounds[axis + 3][slot]);
                let inverse = self.inverse[axis][part];
                let (entry, exit) = (self.entry[axis][part], self.exit[axis][part]);
                let first = low
                    .mul_add(inverse, entry)
                    .min(high.mul_add(inverse, entry));
                let last = low.mul_add(inverse, exit).max(high.mul_add(inverse, exit));
                near = near.max(first);
                far = far.min(last);
            }
            met |= near.le(far) << (WIDTH * part);
        }
        met
    }
}

/// A packet on its way through a tree.
struct Packet<'a, L, S> {
    wide: &'a Wide,
    /// Relative to the centre of the scene.
    origins: [Numbers; 3],
    directions: [Numbers; 3],
    margin: f32,
    sights: Option<Sights<L>>,
    group: Group<L, S>,
}

impl<L: Lanes, S: Search> Packet<'_, L, S> {
    #[inline(always)]
    fn beam(&self, frame: u32) -> Beam<L> {
        let frame = &self.wide.frames[frame as usize];
        Beam::new(frame, &self.origins, &self.directions, self.margin)
    }

    /// Visits what the rays meet, until all searches have their answers.
    #[inline(always)]
    fn run(&mut self, space: &mut Space<Spot, Beam<L>>) {
        let wide = self.wide;
        let (mut stack, mut frames) = space.emptied();
        let mut limit = self.group.limit() + f32::MIN_POSITIVE;
        let mut t_min = self.group.t_min[0];
        for &other in &self.group.t_min[1..] {
            t_min = t_min.min(other);
        }
        let t_min = L::splat(lowest(t_min) - f32::MIN_POSITIVE);
        let mut next = Spot::ROOT;
        loop {
            match next.link.child() {
                Child::Node(index) => {
                    debug_assert!(index < wide.nodes.len());
                    // SAFETY: the links of a tree name nodes that are there: `store` writes them
                    // so, and `check_wide` refuses a tree from a file that is otherwise.
                    let node = unsafe { wide.nodes.get_unchecked(index) };
                    let beam = match frames.get(node.frame) {
                        Some(beam) => beam,
                        None => frames.meet(node.frame, self.beam(node.frame)),
                    };
                    let (near_x, far_x) = beam.slab(node, 0);
                    let (near_y, far_y) = beam.slab(node, 1);
                    let (near_z, far_z) = beam.slab(node, 2);
                    let near = near_x.max(near_y).max(near_z.max(t_min));
                    let far = far_x.min(far_y).min(far_z.min(L::splat(limit)));
                    let met = near.le(far);
                    if met != 0 {
                        next = stack.choose::<L, S>(wide, (index, node), met, near);
                        continue;
                    }
                }
                Child::Leaf { start, count } => {
                    // SAFETY: a leaf is a child of a node that has been visited.
                    let node = unsafe { wide.nodes.get_unchecked(next.node as usize) };
                    let beam = match frames.get(node.frame) {
                        Some(beam) => beam,
                        None => frames.meet(node.frame, self.beam(node.frame)),
                    };
                    let active = beam.meet(node, next.slot as usize, &self.group);
                    if active != 0 {
                        self.visit((start, count), active);
                        limit = self.group.limit() + f32::MIN_POSITIVE;
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
            let t_min = self.group.t_min[ray / WIDTH].to_array()[ray % WIDTH];
            let from = (t_min, self.group.reach);
            let search = &mut self.group.searches[ray];
            match leaf::visit::<L, S>(self.wide, leaf, from, search) {
                ControlFlow::Break(()) => self.group.stop(ray),
                ControlFlow::Continue(false) => {}
                ControlFlow::Continue(true) => {
                    self.group.limits.as_flattened_mut()[ray] = search.limit_above();
                }
            }
        }
    }
}

/// Whether two directions are within some 10° of each other.
#[inline(always)]
fn are_alike(a: &Ray, b: &Ray) -> bool {
    let (a, b) = (Vec3A::from(a.direction), Vec3A::from(b.direction));
    let dot = a.dot(b);
    dot > 0.0 && dot * dot > 0.97 * a.length_squared() * b.length_squared()
}

/// Takes rays through the tree together; false where they do not go together, or not well enough.
#[inline(always)]
pub(super) fn traverse<L: Lanes, Q: Question>(
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
    let (mut origins, mut directions) = ([[[0.0; WIDTH]; PARTS]; 3], [[[0.0; WIDTH]; PARTS]; 3]);
    let (mut t_min, mut limits) = ([[0.0; WIDTH]; PARTS], [[0.0; WIDTH]; PARTS]);
    for (i, ray) in rays.iter().enumerate() {
        if !(ray.is_valid() && line::is_ordinary(ray)) {
            return false;
        }
        let (part, lane) = (i / WIDTH, i % WIDTH);
        for axis in 0..3 {
            origins[axis][part][lane] = ray.origin[axis];
            directions[axis][part][lane] = ray.direction[axis];
        }
        t_min[part][lane] = ray.t_min;
        limits[part][lane] = ray.t_max;
    }
    let sights = Sights::<L>::new(&origins, &directions);
    let close = match &sights {
        Some(sights) => sights.are_close(),
        None => false,
    };
    if judge && !close {
        return false;
    }
    let mut reach = 0.0;
    for (origins, &center) in origins.iter_mut().zip(&wide.center) {
        let (mut low, mut high) = (L::splat(f32::INFINITY), L::splat(f32::NEG_INFINITY));
        for part in origins {
            let origin = L::load(part).sub(L::splat(center));
            *part = origin.to_array();
            low = low.min(origin);
            high = high.max(origin);
        }
        let (low, high) = (lowest(low), highest(high));
        if judge && high - low > MAX_DISTANCE * wide.half_extent {
            return false;
        }
        reach = f32::max(reach, f32::max(-low, high));
    }
    reach += wide.half_extent;
    if !line::is_near(reach) {
        return false;
    }
    let mut after = [L::splat(0.0); PARTS];
    for (after, t_min) in after.iter_mut().zip(&t_min) {
        *after = L::load(t_min);
    }
    let mut packet = Packet {
        wide,
        origins,
        directions,
        margin: line::margin_of(BOX_ERROR, reach),
        sights,
        group: Group {
            searches: std::array::from_fn(|i| Q::search(&rays[i])),
            t_min: after,
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
fn load<L: Lanes>(from: &[Numbers; 3], part: usize) -> [L; 3] {
    let [x, y, z] = from;
    [L::load(&x[part]), L::load(&y[part]), L::load(&z[part])]
}

/// The coordinate of points along a row of a frame.
#[inline(always)]
fn along<L: Lanes>([a, b, c]: [L; 3], [x, y, z]: [L; 3]) -> L {
    a.mul(x).add(b.mul(y)).add(c.mul(z))
}

#[inline(always)]
fn lowest<L: Lanes>(numbers: L) -> f32 {
    -highest(numbers.times_sign(L::splat(-1.0)))
}

/// In halves, for which there are instructions.
#[inline(always)]
fn highest<L: Lanes>(numbers: L) -> f32 {
    let mut numbers = numbers.to_array();
    for half in [4, 2, 1] {
        for i in 0..half {
            if numbers[half + i] > numbers[i] {
                numbers[i] = numbers[half + i];
            }
        }
    }
    numbers[0]
}
