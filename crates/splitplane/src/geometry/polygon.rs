//! Convex polygons that are cut again and again: what of a triangle lies in a cell.

use glam::DVec3;

/// The most corners; beyond, cuts are left out, which leaves a larger polygon.
pub(crate) const MAX_CORNERS: usize = 24;

/// A convex polygon of a few corners.
#[derive(Clone, Copy)]
pub(crate) struct Polygon {
    corners: [DVec3; MAX_CORNERS],
    count: usize,
}

impl Polygon {
    pub(crate) fn new(corners: &[DVec3]) -> Self {
        let mut polygon = Polygon {
            corners: [DVec3::ZERO; MAX_CORNERS],
            count: corners.len(),
        };
        polygon.corners[..corners.len()].copy_from_slice(corners);
        polygon
    }

    pub(crate) fn corners(&self) -> &[DVec3] {
        &self.corners[..self.count]
    }

    pub(crate) fn map(&self, map: impl Fn(DVec3) -> DVec3) -> Self {
        let mut mapped = *self;
        for corner in &mut mapped.corners[..self.count] {
            *corner = map(*corner);
        }
        mapped
    }

    /// Keeps the part where `height`, which must be affine, is not positive.
    #[inline]
    pub(crate) fn cut(&mut self, height: impl Fn(DVec3) -> f64) {
        let outside = self.corners().iter().any(|&p| height(p) > 0.0);
        if !outside || self.count + 1 > MAX_CORNERS {
            return;
        }
        let whole = *self;
        self.count = 0;
        part(whole.corners(), height, |p| {
            self.corners[self.count] = p;
            self.count += 1;
        });
    }

    /// The smallest and the largest coordinates; `None` where nothing is left.
    pub(crate) fn bounds(&self) -> Option<(DVec3, DVec3)> {
        let min = self.corners().iter().copied().reduce(DVec3::min)?;
        let max = self.corners().iter().copied().reduce(DVec3::max)?;
        Some((min, max))
    }
}

/// Gives `add` the corners of the part of a convex polygon where `height`, which must be affine, is
/// not positive.
#[inline(always)]
pub(crate) fn part(corners: &[DVec3], height: impl Fn(DVec3) -> f64, mut add: impl FnMut(DVec3)) {
    let Some(&last) = corners.last() else { return };
    let (mut p, mut h) = (last, height(last));
    for &q in corners {
        let k = height(q);
        if (h <= 0.0) != (k <= 0.0) {
            add(p + (q - p) * (h / (h - k)));
        }
        if k <= 0.0 {
            add(q);
        }
        (p, h) = (q, k);
    }
}
