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

    /// The counters that it is the sum of, by their names in EXR files.
    pub(crate) fn counters(self) -> &'static [&'static str] {
        match self {
            Quantity::TriangleTests => &["triangle_tests"],
            Quantity::NodeVisits => &["kd_visits", "oblique_visits", "wide_visits"],
        }
    }

    fn of(self, counts: &PixelCounts) -> f64 {
        match self {
            Quantity::TriangleTests => f64::from(counts.triangle_tests),
            Quantity::NodeVisits => [counts.kd_visits, counts.oblique_visits, counts.wide_visits]
                .into_iter()
                .map(f64::from)
                .sum(),
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

/// An end for the scale of pictures that are to be compared, of all their pixels' values: the next
/// of 1, 2, 5, 10, … that 999 of 1000 pixels do not exceed. The few pixels beyond would make all
/// others look alike.
pub fn shared_scale(pictures: &[Vec<f32>]) -> f32 {
    let mut values: Vec<f32> = pictures.iter().flatten().copied().collect();
    let at = values.len() * 999 / 1000;
    if at >= values.len() {
        return 1.0;
    }
    let (_, most, _) = values.select_nth_unstable_by(at, f32::total_cmp);
    let most = most.max(1.0);
    let power = 10_f32.powf(most.log10().floor());
    let steps = [1.0, 2.0, 5.0, 10.0].map(|step| step * power);
    steps.into_iter().find(|&end| end >= most).unwrap_or(most)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scale_ends_at_a_round_number_that_few_pixels_exceed() {
        assert_eq!(shared_scale(&[vec![3.0; 5000], vec![700.0; 5]]), 5.0);
        assert_eq!(shared_scale(&[vec![3.0; 500], vec![130.0; 500]]), 200.0);
        assert_eq!(shared_scale(&[vec![100.0; 10]]), 100.0);
        assert_eq!(shared_scale(&[vec![0.0; 10]]), 1.0);
        assert_eq!(shared_scale(&[]), 1.0);
    }
}
