//! A ray as boxes see it.

use glam::Vec3A;

use super::{root, splats};
use crate::geometry::{Frame, Ray};
use crate::query::simd::{Eight, Lanes};
use crate::tree::wide::{WIDTH, Wide, WideNode};

/// How far a box is widened on every side, in units of ε/2 times the distance of the scene's
/// furthest point from the ray's origin along an axis, R.
///
/// 16 for the triangle test (`TEST_ERROR` in `traverse`), along any direction. In a frame,
/// coordinates are up to √3 · R. The origin is rounded when the centre is taken off and three times
/// on its way into the frame; the direction three times; the origin's product with the inverse
/// direction, that with the margin, a box's distance times the inverse, and the inverse once each:
/// 11 · √3 < 20; without fused multiply-add the box's product is one more. The rest is for R and the
/// margin being rounded themselves.
const BOX_ERROR: f32 = 40.0;

/// Components of the direction are taken for at least this large: where the largest one is not below
/// 2^-20, that moves the ray by less than any rounding. With it no product overflows.
pub(super) const SMALLEST: f32 = 1e-18;

/// With a larger margin, beyond 10^17 between a ray's origin and a scene, all boxes are visited.
const LARGEST_MARGIN: f32 = 1e12;

/// What a ray that is far away is taken for, in every frame: one that is within a box for longer
/// than any t, wherever the box is, unless it is absent and its sides are infinite.
const FAR_DIRECTION: Vec3A = Vec3A::splat(1e3);
const FAR_MARGIN: f32 = 3e38;

/// t of such a ray is multiplied by this.
const FAR_SCALE: f32 = f32::from_bits((127 - 20) << 23);

/// Within this many half extents of a scene all rays have the same margin.
const NEAR: f32 = 4.0;

/// From this distance on, products of lengths may overflow.
const FAR_REACH: f32 = 1e9;

/// Whether a ray's numbers are finite and its direction needs no care.
#[inline(always)]
fn is_ordinary(origin: Vec3A, direction: Vec3A) -> bool {
    // A number times 0 is 0 if it is finite, otherwise not a number, and then the sum is none.
    let size = (direction.abs() + origin * 0.0).element_sum();
    ORDINARY.contains(&(size.to_bits() >> 23))
}

/// Whether a reach is such that no product overflows.
#[inline(always)]
pub(super) fn is_near(reach: f32) -> bool {
    reach < FAR_REACH
}

/// Biased exponents of the sum of a direction's components that need no care: their largest one is
/// between 2^-20 and 2^20, being at least a third of the sum.
const ORDINARY: std::ops::Range<u32> = 127 - 18..127 + 20;

/// A row of a node's boxes, by where it begins in the node, in bytes.
#[derive(Clone, Copy)]
pub(super) struct Row(usize);

impl Row {
    #[inline(always)]
    pub(super) fn of(self, node: &WideNode) -> &[f32; WIDTH] {
        // SAFETY: a node begins with six rows, and the only `Row`s are those of `ROWS`.
        unsafe { &*std::ptr::from_ref(node).byte_add(self.0).cast() }
    }
}

/// Per axis, the rows where a ray enters boxes and where it leaves them.
pub(super) type Rows = [[Row; 2]; 3];

/// By the axes along which the direction is negative, a bit for each. A table, since compilers try
/// too hard otherwise.
pub(super) static ROWS: [Rows; 8] = {
    let mut table = [[[Row(0); 2]; 3]; 8];
    let mut signs = 0;
    while signs < 8 {
        let mut axis = 0;
        while axis < 3 {
            let row = size_of::<[f32; WIDTH]>();
            let (low, high) = (Row(axis * row), Row((axis + 3) * row));
            table[signs][axis] = match signs >> axis & 1 {
                0 => [low, high],
                _ => [high, low],
            };
            axis += 1;
        }
        signs += 1;
    }
    table
};

/// A ray as boxes of one frame see it: it is at a coordinate c at t = c · inverse + offset.
#[derive(Clone, Copy)]
pub(super) struct FrameRay {
    pub(super) inverse: Vec3A,
    /// For the side of a box where the ray enters, and for that where it leaves: moved so that
    /// boxes seem larger by the margin.
    pub(super) offsets: [Vec3A; 2],
    pub(super) rows: &'static Rows,
}

/// A [`FrameRay`] that all boxes of a node are held against, a box for each lane.
pub(super) struct BoxTest<L> {
    inverse: [L; 3],
    entry: [L; 3],
    exit: [L; 3],
    rows: &'static Rows,
}

impl<L: Eight> BoxTest<L> {
    #[inline(always)]
    pub(super) fn new(ray: &FrameRay) -> Self {
        let [entry, exit] = ray.offsets;
        BoxTest {
            inverse: splats(ray.inverse.to_array()),
            entry: splats(entry.to_array()),
            exit: splats(exit.to_array()),
            rows: ray.rows,
        }
    }

    /// Where the ray enters and leaves boxes along an axis.
    #[inline(always)]
    fn slab(&self, node: &WideNode, axis: usize) -> (L, L) {
        let [entry, exit] = self.rows[axis];
        let inverse = self.inverse[axis];
        (
            L::load(entry.of(node)).mul_add(inverse, self.entry[axis]),
            L::load(exit.of(node)).mul_add(inverse, self.exit[axis]),
        )
    }

    /// A bit for each child whose box is met within a range of t, and where that is.
    #[inline(always)]
    pub(super) fn meet(&self, node: &WideNode, t_min: L, limit: L) -> (u32, L) {
        let (near_x, far_x) = self.slab(node, 0);
        let (near_y, far_y) = self.slab(node, 1);
        let (near_z, far_z) = self.slab(node, 2);
        let near = near_x.max(near_y).max(near_z.max(t_min));
        let far = far_x.min(far_y).min(far_z.min(limit));
        (near.le(far), near)
    }
}

/// Where a [`Line`] is found.
pub(super) trait Course: Copy {
    fn line(&self) -> Line;
    /// The line as the boxes of the root see it.
    fn at_root(&self, wide: &Wide) -> FrameRay;
}

/// A ray as the traversal sees it: relative to the centre of the scene.
#[derive(Clone, Copy)]
pub(super) struct Line {
    pub(super) origin: Vec3A,
    pub(super) direction: Vec3A,
    pub(super) margin: f32,
    /// t of the traversal over t of the ray: a power of two.
    pub(super) scale: f32,
    /// No point of the scene is further from the origin along an axis; infinite where products
    /// with it may overflow.
    pub(super) reach: f32,
    /// Not above the ray's, in t of the traversal.
    pub(super) t_min: f32,
}

impl Line {
    /// `None` for a ray that hits nothing, whatever there is.
    #[inline(always)]
    pub(super) fn new(wide: &Wide, ray: &Ray) -> Option<Self> {
        // Nor is it so where one of them is not a number.
        let has_interval = ray.t_min < ray.t_max;
        if !has_interval {
            return None;
        }
        let origin = Vec3A::from(ray.origin) - Vec3A::from(wide.center);
        let direction = Vec3A::from(ray.direction);
        let reach = origin.abs().max_element() + wide.half_extent;
        if !(is_ordinary(origin, direction) && is_near(reach)) {
            // As numbers: a line that a function may have written stays in memory even where it
            // has not.
            let [ox, oy, oz, dx, dy, dz, margin, scale, reach, t_min] =
                Line::with_care(ray, origin, reach)?;
            return Some(Line {
                origin: Vec3A::new(ox, oy, oz),
                direction: Vec3A::new(dx, dy, dz),
                margin,
                scale,
                reach,
                t_min,
            });
        }
        // Most rays begin in the scene or near it; theirs is known before their origin is.
        let margin = match reach < NEAR * wide.half_extent {
            true => margin(NEAR * wide.half_extent),
            false => margin_apart(reach),
        };
        Some(Line {
            origin,
            direction,
            margin,
            scale: 1.0,
            reach,
            t_min: ray.t_min - f32::MIN_POSITIVE,
        })
    }

    /// What a ray that is far away or has an extreme direction is taken for: origin, direction, and
    /// the line's numbers. The direction is divided by a power of two.
    #[cold]
    fn with_care(ray: &Ray, origin: Vec3A, reach: f32) -> Option<[f32; 10]> {
        if !ray.is_valid() {
            return None;
        }
        let direction = glam::Vec3::from(ray.direction).as_dvec3();
        // Every f32 is a normal f64.
        let exponent = direction.abs().max_element().to_bits() >> 52;
        let per_scale = f64::from_bits((2 * 1023 - exponent) << 52);
        let scale = f64::from_bits(exponent << 52) as f32;
        let numbers = |origin: Vec3A, direction: Vec3A, margin: f32, scale: f32| {
            // Not 0, by which an infinite t would become none: only far away may this be more than
            // it should, and there all boxes are met at any t.
            let scale = scale.max(f32::from_bits(1));
            let reach = if is_near(reach) { reach } else { f32::INFINITY };
            let t_min = ray.t_min * scale - f32::MIN_POSITIVE;
            let ([ox, oy, oz], [dx, dy, dz]) = (origin.to_array(), direction.to_array());
            [ox, oy, oz, dx, dy, dz, margin, scale, reach, t_min]
        };
        let margin = margin(reach);
        Some(match is_far(margin) {
            // The origin may have overflown to what is not a number.
            true => numbers(Vec3A::ZERO, FAR_DIRECTION, FAR_MARGIN, scale * FAR_SCALE),
            false => numbers(origin, (direction * per_scale).as_vec3a(), margin, scale),
        })
    }

    /// No less than a t of the ray. It is multiplied exactly, unless it gets too small to be normal.
    #[inline(always)]
    pub(super) fn t_above(&self, t: f32) -> f32 {
        t * self.scale + f32::MIN_POSITIVE
    }

    #[inline(always)]
    pub(super) fn in_frame(&self, frame: u32, frames: &[Frame]) -> FrameRay {
        turned(
            self.origin,
            self.direction,
            self.margin,
            &frames[frame as usize],
        )
    }
}

impl Course for Line {
    #[inline(always)]
    fn line(&self) -> Line {
        *self
    }

    #[inline(always)]
    fn at_root(&self, wide: &Wide) -> FrameRay {
        match root(wide).frame {
            Frame::WORLD => along(self.origin, self.direction, self.margin),
            frame => turned_here(
                self.origin,
                self.direction,
                self.margin,
                &wide.frames[frame as usize],
            ),
        }
    }
}

/// Apart and from values, so that what is always there stays in registers.
#[inline(never)]
fn turned(origin: Vec3A, direction: Vec3A, margin: f32, frame: &Frame) -> FrameRay {
    turned_here(origin, direction, margin, frame)
}

#[inline(always)]
fn turned_here(origin: Vec3A, direction: Vec3A, margin: f32, frame: &Frame) -> FrameRay {
    if is_far(margin) {
        return along(origin, direction, margin);
    }
    let [a, b, c] = frame.rows;
    let x = Vec3A::new(a[0], b[0], c[0]);
    let y = Vec3A::new(a[1], b[1], c[1]);
    let z = Vec3A::new(a[2], b[2], c[2]);
    let (o, d) = (origin, direction);
    along(
        x * o.x + y * o.y + z * o.z,
        x * d.x + y * d.y + z * d.z,
        margin,
    )
}

#[inline(always)]
fn along(origin: Vec3A, direction: Vec3A, margin: f32) -> FrameRay {
    let inverse = Vec3A::ONE / (direction + Vec3A::splat(SMALLEST).copysign(direction));
    let offset = -origin * inverse;
    let margin = margin * inverse.abs();
    FrameRay {
        inverse,
        offsets: [offset - margin, offset + margin],
        rows: &ROWS[direction.is_negative_bitmask() as usize & 7],
    }
}

/// As [`along`], along an axis, of a ray for each lane.
#[inline(always)]
pub(super) fn slabs<L: Lanes>(origin: L, direction: L, margin: L) -> (L, L, L) {
    let smallest = L::splat(SMALLEST).times_sign(direction);
    let inverse = L::splat(1.0).div(direction.add(smallest));
    let offset = origin.times_sign(L::splat(-1.0)).mul(inverse);
    let margin = margin.mul(inverse.abs());
    (inverse, offset.sub(margin), offset.add(margin))
}

/// A bit for each lane whose ray needs no care, as [`is_ordinary`] says.
#[inline(always)]
pub(super) fn are_ordinary<L: Lanes>([ox, oy, oz]: [L; 3], [dx, dy, dz]: [L; 3]) -> u32 {
    let zero = L::splat(0.0);
    let sum = (dx.abs().add(ox.mul(zero)))
        .add(dy.abs().add(oy.mul(zero)))
        .add(dz.abs().add(oz.mul(zero)));
    let low = f32::from_bits(ORDINARY.start << 23);
    let high = f32::from_bits(ORDINARY.end << 23);
    L::splat(low).le(sum) & sum.lt(L::splat(high))
}

/// A bit for each lane that [`is_near`].
#[inline(always)]
pub(super) fn are_near<L: Lanes>(reach: L) -> u32 {
    reach.lt(L::splat(FAR_REACH))
}

/// The margin of a ray for each lane.
#[inline(always)]
pub(super) fn margins<L: Lanes>(reach: L, wide: &Wide) -> L {
    let reach = reach.max(L::splat(NEAR * wide.half_extent));
    let unit = reach.mul(L::splat(0.5 * f32::EPSILON));
    unit.add(L::splat(f32::from_bits(1)))
        .mul(L::splat(BOX_ERROR))
}

#[inline(always)]
fn margin(reach: f32) -> f32 {
    margin_of(BOX_ERROR, reach)
}

/// So many units of ε/2 times a reach.
#[inline(always)]
pub(super) fn margin_of(units: f32, reach: f32) -> f32 {
    // Numbers too small to be normal are rounded by as much, whatever their size.
    units * (0.5 * f32::EPSILON * reach + f32::from_bits(1))
}

/// Apart, so that it is not taken for part of the other case.
#[inline(never)]
fn margin_apart(reach: f32) -> f32 {
    margin(reach)
}

#[inline(always)]
fn is_far(margin: f32) -> bool {
    margin > LARGEST_MARGIN || margin.is_nan()
}
