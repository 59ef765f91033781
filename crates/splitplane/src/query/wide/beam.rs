//! The rays of a packet as boxes see them.

use super::line::{self, ROWS, Row};
use super::packet::Members;
use super::{along, splats};
use crate::geometry::Frame;
use crate::query::simd::{Eight, Lanes, Part};
use crate::tree::wide::WideNode;

/// How far boxes are widened, as `BOX_ERROR` in `line` says for one ray, which comes to 36; here the
/// margin is added to a coordinate, which is rounded once more, by up to √3.
pub(super) const BOX_ERROR: f32 = 40.0;

/// The rays of a packet as boxes of one frame see them, along its axes.
pub(super) type Beam<L> = [Slab<L>; 3];

/// The rays of a packet along an axis of a frame.
///
/// What the fastest of them reaches from where the foremost begins is reached by none of them
/// earlier, and what the slowest leaves from where the hindmost begins is left by none later; no t is
/// negative. So two products say of a box as much about all rays as about one.
#[derive(Clone, Copy)]
pub(super) struct Slab<L: Eight> {
    /// Of each ray.
    each: <L::Part as Part>::Parts<Each<L::Part>>,
    /// Of all rays: not below which t they enter boxes, and not above which they leave them.
    entry: Bound<L>,
    exit: Bound<L>,
    /// Where some go one way along the axis and some the other, the entry of the latter.
    other_entry: Option<Bound<L>>,
    /// Where boxes are entered, and where they are left.
    rows: [Row; 2],
    /// From there to where they may be, for all that rounding does.
    outward: [f32; 2],
}

/// A bound of the t at which rays reach a coordinate c: c · inverse + offset.
#[derive(Clone, Copy)]
struct Bound<L> {
    inverse: L,
    offset: L,
}

impl<L: Lanes> Bound<L> {
    /// From this point on.
    #[inline(always)]
    fn new(inverse: f32, from: f32) -> Self {
        Bound {
            inverse: L::splat(inverse),
            offset: L::splat(-from * inverse),
        }
    }

    #[inline(always)]
    fn at(&self, coordinates: L) -> L {
        coordinates.mul_add(self.inverse, self.offset)
    }
}

/// Each ray of a part: it is at a coordinate c at t = c · inverse + offset.
#[derive(Clone, Copy)]
struct Each<P> {
    inverse: P,
    offset: P,
}

impl<L: Eight> Slab<L> {
    /// Of no rays, yet.
    #[inline(always)]
    pub(super) fn none() -> Self {
        let zero = <L::Part as Lanes>::splat(0.0);
        Slab {
            each: L::Part::parts(Each {
                inverse: zero,
                offset: zero,
            }),
            entry: Bound::new(0.0, 0.0),
            exit: Bound::new(0.0, 0.0),
            other_entry: None,
            rows: ROWS[0][0],
            outward: [0.0; 2],
        }
    }

    #[inline(always)]
    pub(super) fn set(
        &mut self,
        frame: &Frame,
        axis: usize,
        members: &[Members<L::Part>],
        margin: f32,
    ) {
        let splat = <L::Part as Lanes>::splat;
        let row: [L::Part; 3] = splats(frame.rows[axis]);
        let infinite = splat(f32::INFINITY);
        let (mut hindmost, mut foremost) = (infinite, splat(f32::NEG_INFINITY));
        // By their inverse directions; those that go forward, and those that go backward.
        let (mut fastest, mut slowest) = ([infinite; 2], splat(0.0));
        let (mut forward, mut backward) = (0, 0);
        for (members, each) in members.iter().zip(self.each.as_mut()) {
            let origin = along(row, members.origin);
            let direction = along(row, members.direction);
            let inverse = splat(1.0).div(direction.abs().max(splat(line::SMALLEST)));
            let back = direction.negative();
            forward |= !back & L::Part::ALL;
            backward |= back;
            hindmost = hindmost.min(origin);
            foremost = foremost.max(origin);
            fastest[0] = fastest[0].min(inverse.select(back, infinite));
            fastest[1] = fastest[1].min(infinite.select(back, inverse));
            slowest = slowest.max(inverse);
            let inverse = inverse.times_sign(direction);
            *each = Each {
                inverse,
                offset: origin.times_sign(splat(-1.0)).mul(inverse),
            };
        }
        let (low, high) = (lowest(hindmost) - margin, foremost.highest() + margin);
        let slowest = slowest.highest();
        let forward_entry = Bound::new(lowest(fastest[0]), high);
        let backward_entry = Bound::new(-lowest(fastest[1]), low);
        (self.entry, self.exit, self.other_entry) = match (forward != 0, backward != 0) {
            (true, false) => (forward_entry, Bound::new(slowest, low), None),
            (false, _) => (backward_entry, Bound::new(-slowest, high), None),
            (true, true) => {
                // Some may never leave a box, but absent ones, whose sides are infinite.
                let never = Bound::new(1e-3, f32::MIN);
                (forward_entry, never, Some(backward_entry))
            }
        };
        (self.rows, self.outward) = match forward {
            0 => (ROWS[7][axis], [margin, -margin]),
            _ => (ROWS[0][axis], [-margin, margin]),
        };
    }

    /// No more than where any ray enters the boxes of a node, and no less than where any leaves
    /// them.
    #[inline(always)]
    pub(super) fn of_all(&self, node: &WideNode) -> (L, L) {
        let [entry, exit] = self.rows;
        let (entry, exit) = (L::load(entry.of(node)), L::load(exit.of(node)));
        let (mut near, far) = (self.entry.at(entry), self.exit.at(exit));
        if let Some(other) = &self.other_entry {
            near = near.max(other.at(exit));
        }
        (near, far)
    }

    /// Where each ray of a part enters and leaves the box of a child.
    #[inline(always)]
    fn of_part(&self, part: usize, node: &WideNode, slot: usize) -> (L::Part, L::Part) {
        let splat = <L::Part as Lanes>::splat;
        let [first, last] = self.rows;
        let first = splat(first.of(node)[slot] + self.outward[0]);
        let last = splat(last.of(node)[slot] + self.outward[1]);
        let Each { inverse, offset } = self.each.as_ref()[part];
        let (near, far) = (
            first.mul_add(inverse, offset),
            last.mul_add(inverse, offset),
        );
        match self.other_entry {
            None => (near, far),
            Some(_) => (near.min(far), near.max(far)),
        }
    }
}

/// A bit for each ray of a part that meets the box of a child within its range of t.
#[inline(always)]
pub(super) fn meet<L: Eight>(
    beam: &Beam<L>,
    node: &WideNode,
    slot: usize,
    (part, members): (usize, &Members<L::Part>),
    t_min: f32,
) -> u32 {
    let splat = <L::Part as Lanes>::splat;
    let mut near = splat(t_min);
    let mut far = members.limit.add(splat(f32::MIN_POSITIVE));
    for slab in beam {
        let (entry, exit) = slab.of_part(part, node, slot);
        near = near.max(entry);
        far = far.min(exit);
    }
    near.le(far)
}

/// The smallest one; there are no NaNs.
#[inline(always)]
pub(super) fn lowest<P: Part>(numbers: P) -> f32 {
    -numbers.times_sign(P::splat(-1.0)).highest()
}
