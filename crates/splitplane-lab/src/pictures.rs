//! What rays cost, as pictures.

use splitplane_render::render::{PixelCounts, Rendered};

/// A quantity that is counted per pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// Triangle tests.
    TriangleTests,
    /// Visits of interior nodes.
    NodeVisits,
}

impl Quantity {
    /// All quantities.
    pub const ALL: [Quantity; 2] = [Quantity::TriangleTests, Quantity::NodeVisits];

    /// Its name, for people.
    pub fn label(self) -> &'static str {
        match self {
            Quantity::TriangleTests => "triangle tests",
            Quantity::NodeVisits => "interior node visits",
        }
    }

    /// Its name, in names of files.
    pub fn file_label(self) -> &'static str {
        match self {
            Quantity::TriangleTests => "triangle-tests",
            Quantity::NodeVisits => "node-visits",
        }
    }

    fn of(self, counts: &PixelCounts) -> f64 {
        match self {
            Quantity::TriangleTests => f64::from(counts.triangle_tests),
            Quantity::NodeVisits => f64::from(counts.kd_visits) + f64::from(counts.oblique_visits),
        }
    }

    /// What all rays of a pixel did, per sample, row by row from the top; empty where nothing was
    /// counted.
    pub fn per_sample(self, rendered: &Rendered) -> Vec<f32> {
        let Some(pixels) = &rendered.pixel_counts else {
            return Vec::new();
        };
        let samples = f64::from(rendered.samples_per_pixel.max(1));
        (pixels.closest.iter().zip(&pixels.shadow))
            .map(|(closest, shadow)| ((self.of(closest) + self.of(shadow)) / samples) as f32)
            .collect()
    }
}
