//! Parts for scenes that are generated.

use glam::{DAffine3, DVec3};
use std::f64::consts::TAU;

use crate::scene::geometry::{Geometry, Placed};

/// Collects triangles by material, y up; or only counts them.
#[derive(Debug)]
pub(crate) struct Builder {
    only_counts: bool,
    triangles: usize,
    by_material: Vec<Geometry>,
}

impl Builder {
    pub(crate) fn new(materials: usize, only_counts: bool) -> Self {
        Builder {
            only_counts,
            triangles: 0,
            by_material: vec![Geometry::default(); materials],
        }
    }

    /// How many triangles there are so far.
    pub(crate) fn triangles(&self) -> usize {
        self.triangles
    }

    pub(crate) fn pieces(self) -> Vec<Placed> {
        let placed = self
            .by_material
            .into_iter()
            .enumerate()
            .map(|(material, geometry)| Placed::plain(geometry, material as u32));
        placed.collect()
    }

    pub(crate) fn triangle(&mut self, material: usize, corners: [DVec3; 3]) {
        self.triangles += 1;
        if self.only_counts {
            return;
        }
        let g = &mut self.by_material[material];
        let base = g.positions.len() as u32;
        g.positions
            .extend(corners.map(|p| <[f32; 3]>::from(p.as_vec3())));
        g.triangles.push([base, base + 1, base + 2]);
    }

    /// Two triangles, corners in order around.
    pub(crate) fn quad(&mut self, material: usize, [a, b, c, d]: [DVec3; 4]) {
        self.triangle(material, [a, b, c]);
        self.triangle(material, [a, c, d]);
    }

    /// A box between two corners of `frame`: 12 triangles.
    pub(crate) fn block(&mut self, material: usize, frame: &DAffine3, low: DVec3, high: DVec3) {
        let corner = |i: usize| {
            let pick = |bit: usize, a: f64, b: f64| if i & bit == 0 { a } else { b };
            frame.transform_point3(DVec3::new(
                pick(1, low.x, high.x),
                pick(2, low.y, high.y),
                pick(4, low.z, high.z),
            ))
        };
        for [a, b, c, d] in [
            [0, 4, 6, 2],
            [1, 3, 7, 5],
            [0, 1, 5, 4],
            [2, 6, 7, 3],
            [0, 2, 3, 1],
            [4, 5, 7, 6],
        ] {
            self.quad(material, [corner(a), corner(b), corner(c), corner(d)]);
        }
    }

    /// What a profile of (radius, height) sweeps around the y axis of `frame`, in `segments`.
    pub(crate) fn turned(
        &mut self,
        material: usize,
        frame: &DAffine3,
        profile: &[(f64, f64)],
        segments: usize,
    ) {
        let point = |(radius, height): (f64, f64), i: usize| {
            let (sin, cos) = (TAU * (i % segments) as f64 / segments as f64).sin_cos();
            frame.transform_point3(DVec3::new(radius * cos, height, radius * sin))
        };
        for pair in profile.windows(2) {
            for i in 0..segments {
                let (a, b) = (point(pair[0], i), point(pair[1], i));
                let (c, d) = (point(pair[1], i + 1), point(pair[0], i + 1));
                if pair[0].0 > 0.0 {
                    self.triangle(material, [a, c, d]);
                }
                if pair[1].0 > 0.0 {
                    self.triangle(material, [a, b, c]);
                }
            }
        }
    }
}

/// The detail from which `make` gives about `triangles` triangles; `make` counts them for a detail
/// and does not give fewer for more.
pub(crate) fn detail_for(triangles: usize, make: impl Fn(f64) -> usize) -> f64 {
    let (mut low, mut high) = (0.02_f64, 400.0_f64);
    for _ in 0..24 {
        let middle = (low * high).sqrt();
        if make(middle) < triangles {
            low = middle
        } else {
            high = middle
        }
    }
    // The nearer of the two sides of the step.
    let far = |detail: f64| make(detail).abs_diff(triangles);
    if far(low) <= far(high) { low } else { high }
}
