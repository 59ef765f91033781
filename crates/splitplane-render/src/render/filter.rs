//! Filters, tabulated as pbrt-v3 does [PBRT3, 7.8 and 7.9].

use glam::Vec2;

use crate::scene::settings::Filter;

const TABLE: usize = 16;

/// A filter's weights at 16 x 16 places of its positive quadrant.
pub(super) struct FilterTable {
    pub(super) radius: Vec2,
    weights: [f32; TABLE * TABLE],
}

impl FilterTable {
    pub(super) fn new(filter: &Filter) -> Self {
        let radius = Vec2::from(radius(filter));
        let weights = std::array::from_fn(|i| {
            let cell = Vec2::new((i % TABLE) as f32 + 0.5, (i / TABLE) as f32 + 0.5);
            evaluate(filter, cell * radius / TABLE as f32)
        });
        FilterTable { radius, weights }
    }

    /// Which column or row of the table holds the weight at this distance along `axis`.
    #[inline]
    pub(super) fn cell(&self, distance: f32, axis: usize) -> usize {
        let place = (distance * (1.0 / self.radius[axis]) * TABLE as f32).abs();
        (place as usize).min(TABLE - 1)
    }

    #[inline]
    pub(super) fn weight(&self, column: usize, row: usize) -> f32 {
        self.weights[row * TABLE + column]
    }
}

/// Half the width in x and y, in pixels.
pub(super) fn radius(filter: &Filter) -> [f32; 2] {
    match *filter {
        Filter::Box { radius }
        | Filter::Triangle { radius }
        | Filter::Gaussian { radius, .. }
        | Filter::Mitchell { radius, .. }
        | Filter::Sinc { radius, .. } => radius,
    }
}

fn evaluate(filter: &Filter, p: Vec2) -> f32 {
    match *filter {
        Filter::Box { .. } => 1.0,
        Filter::Triangle { radius } => {
            (radius[0] - p.x.abs()).max(0.0) * (radius[1] - p.y.abs()).max(0.0)
        }
        Filter::Gaussian { radius, alpha } => {
            let lowered =
                |d: f32, r: f32| ((-alpha * d * d).exp() - (-alpha * r * r).exp()).max(0.0);
            lowered(p.x, radius[0]) * lowered(p.y, radius[1])
        }
        Filter::Mitchell { radius, b, c } => {
            mitchell(p.x / radius[0], b, c) * mitchell(p.y / radius[1], b, c)
        }
        Filter::Sinc { radius, tau } => {
            let windowed = |x: f32, r: f32| match x.abs() {
                x if x > r => 0.0,
                x => sinc(x) * sinc(x / tau),
            };
            windowed(p.x, radius[0]) * windowed(p.y, radius[1])
        }
    }
}

/// sin πx / πx.
fn sinc(x: f32) -> f32 {
    let x = std::f32::consts::PI * x.abs();
    if x < 1e-5 { 1.0 } else { x.sin() / x }
}

/// The cubic of [Mitchell1988], which ends at x = 1.
fn mitchell(x: f32, b: f32, c: f32) -> f32 {
    let x = (2.0 * x).abs();
    if x > 1.0 {
        ((-b - 6.0 * c) * x * x * x
            + (6.0 * b + 30.0 * c) * x * x
            + (-12.0 * b - 48.0 * c) * x
            + (8.0 * b + 24.0 * c))
            / 6.0
    } else {
        ((12.0 - 9.0 * b - 6.0 * c) * x * x * x
            + (-18.0 + 12.0 * b + 6.0 * c) * x * x
            + (6.0 - 2.0 * b))
            / 6.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn filters_have_their_known_values() {
        let radius = [2.0, 1.0];
        let at = |filter, x, y| evaluate(&filter, Vec2::new(x, y));
        assert_eq!(at(Filter::Box { radius }, 1.9, 0.1), 1.0);
        assert_eq!(at(Filter::Triangle { radius }, 0.5, 0.25), 1.5 * 0.75);
        let gaussian = Filter::Gaussian { radius, alpha: 2.0 };
        assert_eq!(at(gaussian, 2.0, 0.0), 0.0);
        let expected = (1.0 - (-8.0f32).exp()) * (1.0 - (-2.0f32).exp());
        assert!((at(gaussian, 0.0, 0.0) - expected).abs() < 1e-6);
        // With B = C = 1/3: 8/9 in the middle, 1/18 at half the radius, 0 at its end.
        let third = 1.0 / 3.0;
        assert!((mitchell(0.0, third, third) - 8.0 / 9.0).abs() < 1e-6);
        assert!((mitchell(0.5, third, third) - 1.0 / 18.0).abs() < 1e-6);
        assert!(mitchell(1.0, third, third).abs() < 1e-6);
    }

    #[test]
    fn the_table_holds_the_filter_at_the_middles_of_its_cells() {
        let filter = Filter::Triangle { radius: [2.0, 2.0] };
        let table = FilterTable::new(&filter);
        assert_eq!(table.weight(0, 0), 1.9375 * 1.9375);
        assert_eq!(table.weight(15, 0), 0.0625 * 1.9375);
        assert_eq!((table.cell(-0.3, 0), table.cell(2.0, 1)), (2, 15));
    }
}
