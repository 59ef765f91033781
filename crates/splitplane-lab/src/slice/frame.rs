//! Which part of a section is seen, and where on the picture.

use splitplane::{Axis, Section};

use super::SliceSettings;

/// Names of the axes.
pub(super) const NAMES: [&str; 3] = ["x", "y", "z"];

/// The narrowest a picture may be, height by width or width by height: a section of no height is
/// still seen.
const NARROWEST: f64 = 0.25;

/// From the plane of a section to pixels.
pub(super) struct Frame {
    /// Width in pixels.
    pub(super) width: f64,
    /// Height in pixels.
    pub(super) height: f64,
    /// Per axis of the picture (right, down): which coordinate of the section's points, and
    /// whether it runs backwards.
    axes: [(usize, bool); 2],
    /// The top left corner that is seen, in scene units along the picture's axes.
    corner: [f64; 2],
    /// Pixels per scene unit.
    scale: f64,
}

impl Frame {
    /// The frame of a section. What is up in the scene (the direction `up`, its largest component)
    /// is up in the picture; if that is the axis across the section, one looks from above.
    pub(super) fn new(section: &Section, slice: &SliceSettings, up: [f32; 3]) -> Frame {
        let axes = orientation(slice.axis, up);
        let [min, max] = section.bounds;
        let extent = axes.map(|(i, backwards)| match backwards {
            true => (-max[i], -min[i]),
            false => (min[i], max[i]),
        });
        let [x0, x1, y0, y1] = slice.zoom.map(f64::from);
        let seen = [(extent[0], x0, x1), (extent[1], y0, y1)]
            .map(|((low, high), from, to)| (low + (high - low) * from, low + (high - low) * to));
        let largest = seen
            .iter()
            .map(|(low, high)| high - low)
            .fold(0.0, f64::max);
        let least = if largest > 0.0 {
            NARROWEST * largest
        } else {
            1.0
        };
        let widened = seen.map(|(low, high)| {
            let missing = (least - (high - low)).max(0.0);
            (low - 0.5 * missing, high + 0.5 * missing)
        });
        let [width, height] = widened.map(|(low, high)| high - low);
        let scale = f64::from(slice.width) / width;
        Frame {
            width: slice.width.into(),
            height: (height * scale).round(),
            axes,
            corner: widened.map(|(low, _)| low),
            scale,
        }
    }

    fn pixel(&self, point: [f64; 2]) -> [f64; 2] {
        std::array::from_fn(|axis| {
            let (i, backwards) = self.axes[axis];
            let along = if backwards { -point[i] } else { point[i] };
            (along - self.corner[axis]) * self.scale
        })
    }

    /// The part of a segment that is seen, in pixels.
    pub(super) fn segment(&self, ends: [[f64; 2]; 2]) -> Option<[[f64; 2]; 2]> {
        let [from, to] = ends.map(|end| self.pixel(end));
        let (mut first, mut last) = (0.0_f64, 1.0_f64);
        for (axis, size) in [self.width, self.height].into_iter().enumerate() {
            let length = to[axis] - from[axis];
            if length == 0.0 {
                if !(0.0..=size).contains(&from[axis]) {
                    return None;
                }
                continue;
            }
            let (a, b) = (-from[axis] / length, (size - from[axis]) / length);
            first = first.max(a.min(b));
            last = last.min(a.max(b));
        }
        let at = |t: f64| std::array::from_fn(|axis| from[axis] + (to[axis] - from[axis]) * t);
        (first <= last).then(|| [at(first), at(last)])
    }

    /// The part of a convex polygon that is seen, in pixels.
    pub(super) fn polygon(&self, polygon: &[[f64; 2]]) -> Vec<[f64; 2]> {
        let mut points: Vec<[f64; 2]> = polygon.iter().map(|&p| self.pixel(p)).collect();
        for (axis, size) in [self.width, self.height].into_iter().enumerate() {
            for (sign, limit) in [(-1.0, 0.0), (1.0, size)] {
                points = inside(&points, |p| limit - sign * p[axis]);
            }
        }
        points
    }
}

/// The part of a convex polygon where `height` is not negative.
fn inside(polygon: &[[f64; 2]], height: impl Fn([f64; 2]) -> f64) -> Vec<[f64; 2]> {
    let mut part = Vec::with_capacity(polygon.len() + 1);
    for (i, &p) in polygon.iter().enumerate() {
        let q = polygon[(i + 1) % polygon.len()];
        let (h, k) = (height(p), height(q));
        if h >= 0.0 {
            part.push(p);
        }
        if (h < 0.0) != (k < 0.0) {
            let share = h / (h - k);
            part.push(std::array::from_fn(|i| p[i] + (q[i] - p[i]) * share));
        }
    }
    part
}

/// Which of a section's coordinates run to the right and down, and whether backwards.
fn orientation(across: Axis, up: [f32; 3]) -> [(usize, bool); 2] {
    let size = |axis: &Axis| up[axis.index()].abs();
    let vertical = Axis::ALL
        .into_iter()
        .max_by(|a, b| size(a).total_cmp(&size(b)))
        .unwrap_or(Axis::Y);
    let upwards = up[vertical.index()] >= 0.0;
    match across.others().iter().position(|&axis| axis == vertical) {
        // Down is against up.
        Some(i) => [(1 - i, false), (i, upwards)],
        // Right × (up the page) = up in the scene; the two axes in their order are right-handed
        // except across y.
        None => [(0, false), (1, (across != Axis::Y) == upwards)],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(axis: Axis, zoom: [f32; 4], up: [f32; 3]) -> Frame {
        let section = Section {
            bounds: [[0.0, 0.0], [4.0, 2.0]],
            ..Section::default()
        };
        let slice = SliceSettings {
            axis,
            at: 0.5,
            max_depth: None,
            zoom,
            width: 400,
        };
        Frame::new(&section, &slice, up)
    }

    const WHOLE: [f32; 4] = [0.0, 1.0, 0.0, 1.0];

    #[test]
    fn up_in_the_scene_is_up_in_the_picture_and_plans_are_seen_from_above() {
        let up_y = [0.0, 1.0, 0.1];
        // Across z: x to the right, y up.
        assert_eq!(frame(Axis::Z, WHOLE, up_y).pixel([1.0, 2.0]), [100.0, 0.0]);
        // Across x with y up: z to the right, y up; the section's points are (y, z).
        assert_eq!(orientation(Axis::X, up_y), [(1, false), (0, true)]);
        // From above with y up: x to the right, z down the page.
        assert_eq!(orientation(Axis::Y, up_y), [(0, false), (1, false)]);
        // From above with z up: x to the right, y up the page.
        assert_eq!(
            orientation(Axis::Z, [0.0, 0.0, 1.0]),
            [(0, false), (1, true)]
        );
        assert_eq!(
            orientation(Axis::Z, [0.0, -1.0, 0.0]),
            [(0, false), (1, false)]
        );
    }

    #[test]
    fn what_is_outside_the_part_that_is_seen_is_cut_off() {
        let frame = frame(Axis::Z, [0.5, 1.0, 0.0, 1.0], [0.0, 1.0, 0.0]);
        assert_eq!((frame.width, frame.height), (400.0, 400.0));
        let seen = frame.segment([[0.0, 1.0], [4.0, 1.0]]).unwrap();
        assert_eq!(seen, [[0.0, 200.0], [400.0, 200.0]]);
        assert_eq!(frame.segment([[0.0, 0.0], [1.9, 2.0]]), None);
        assert_eq!(frame.segment([[1.0, 0.0], [1.0, 2.0]]), None);
        let polygon = frame.polygon(&[[1.0, 0.0], [3.0, 0.0], [3.0, 2.0], [1.0, 2.0]]);
        for p in &polygon {
            assert!((0.0..=200.0).contains(&p[0]), "{p:?}");
        }
        assert_eq!(polygon.len(), 4);
        assert!(
            frame
                .polygon(&[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]])
                .is_empty()
        );
    }

    #[test]
    fn a_section_without_height_still_has_a_picture() {
        let section = Section {
            bounds: [[0.0, 1.0], [4.0, 1.0]],
            ..Section::default()
        };
        let slice = SliceSettings {
            axis: Axis::Z,
            at: 0.5,
            max_depth: None,
            zoom: WHOLE,
            width: 400,
        };
        let frame = Frame::new(&section, &slice, [0.0, 1.0, 0.0]);
        assert_eq!(frame.height, 100.0);
        let frame = Frame::new(&Section::default(), &slice, [0.0, 1.0, 0.0]);
        assert_eq!((frame.width, frame.height), (400.0, 400.0));
    }
}
