//! Trowbridge and Reitz's distribution of microfacets (GGX) [PBRT3, 8.4; Trowbridge1975].
//!
//! Directions are in the frame where the normal is z.

use std::f32::consts::PI;

use glam::{Vec2, Vec3};

/// Widths of the distribution of slopes along x and y.
#[derive(Clone, Copy, Debug)]
pub(super) struct TrowbridgeReitz {
    alpha: Vec2,
}

/// From a roughness in `[0, 1]` to the width of the distribution, by pbrt-v3's polynomial.
pub(super) fn width_of_roughness(roughness: f32) -> f32 {
    let x = roughness.max(1e-3).ln();
    1.621_42 + x * (0.819_955 + x * (0.173_4 + x * (0.017_120_1 + x * 0.000_640_711)))
}

impl TrowbridgeReitz {
    pub(super) fn new(alpha_x: f32, alpha_y: f32) -> Self {
        TrowbridgeReitz {
            alpha: Vec2::new(alpha_x.max(0.001), alpha_y.max(0.001)),
        }
    }

    /// Area of the facets with normal `wh`, per area of the surface and per solid angle.
    pub(super) fn density(&self, wh: Vec3) -> f32 {
        let cos2 = wh.z * wh.z;
        let tan2 = (wh.x * wh.x + wh.y * wh.y) / cos2;
        if cos2 == 0.0 || tan2.is_infinite() {
            return 0.0;
        }
        let (cos_phi, sin_phi) = azimuth(wh);
        let e = tan2 * (squared(cos_phi / self.alpha.x) + squared(sin_phi / self.alpha.y));
        1.0 / (PI * self.alpha.x * self.alpha.y * cos2 * cos2 * squared(1.0 + e))
    }

    /// Area of the hidden facets over that of the visible ones, seen from `w` [Smith1967].
    fn hidden(&self, w: Vec3) -> f32 {
        let tan2 = (w.x * w.x + w.y * w.y) / (w.z * w.z);
        if w.z == 0.0 || tan2.is_infinite() {
            return 0.0;
        }
        let (cos_phi, sin_phi) = azimuth(w);
        let alpha2 = squared(cos_phi * self.alpha.x) + squared(sin_phi * self.alpha.y);
        (-1.0 + (1.0 + alpha2 * tan2).sqrt()) / 2.0
    }

    /// The part of the facets that is visible from `w`.
    fn visible(&self, w: Vec3) -> f32 {
        1.0 / (1.0 + self.hidden(w))
    }

    /// The part of the facets that is visible from both directions.
    pub(super) fn visible_from_both(&self, wo: Vec3, wi: Vec3) -> f32 {
        1.0 / (1.0 + self.hidden(wo) + self.hidden(wi))
    }

    /// Draws the normal of a facet from those that `wo` sees [Heitz2014].
    pub(super) fn sample(&self, wo: Vec3, u: Vec2) -> Vec3 {
        let side = if wo.z < 0.0 { -1.0 } else { 1.0 };
        let stretched = (side * wo * self.alpha.extend(1.0)).normalize();
        let slope = sample_slope(stretched.z, u);
        let (cos_phi, sin_phi) = azimuth(stretched);
        let turned = Vec2::new(
            cos_phi * slope.x - sin_phi * slope.y,
            sin_phi * slope.x + cos_phi * slope.y,
        );
        side * (-turned * self.alpha).extend(1.0).normalize()
    }

    /// The density of [`Self::sample`] in solid angle around `wh`.
    pub(super) fn pdf(&self, wo: Vec3, wh: Vec3) -> f32 {
        self.density(wh) * self.visible(wo) * wo.dot(wh).abs() / wo.z.abs()
    }
}

/// Slopes of the facets of width 1 that are seen from the direction in the xz plane with this
/// cosine: x by inverting the distribution, y by Heitz and d'Eon's rational fit to its inverse.
fn sample_slope(cos_theta: f32, u: Vec2) -> Vec2 {
    if cos_theta > 0.9999 {
        let r = (u.x / (1.0 - u.x)).sqrt();
        let phi = 2.0 * PI * u.y;
        return r * Vec2::new(phi.cos(), phi.sin());
    }
    let sin_theta = (1.0 - cos_theta * cos_theta).max(0.0).sqrt();
    let tan = sin_theta / cos_theta;
    let cot = 1.0 / tan;
    let visible = 2.0 / (1.0 + (1.0 + 1.0 / (cot * cot)).sqrt());
    let a = 2.0 * u.x / visible - 1.0;
    let k = (1.0 / (a * a - 1.0)).min(1e10);
    let root = (tan * tan * k * k - (a * a - tan * tan) * k)
        .max(0.0)
        .sqrt();
    let (first, second) = (tan * k - root, tan * k + root);
    let x = if a < 0.0 || second > cot {
        first
    } else {
        second
    };
    let (sign, v) = if u.y > 0.5 {
        (1.0, 2.0 * (u.y - 0.5))
    } else {
        (-1.0, 2.0 * (0.5 - u.y))
    };
    let z = (v * (v * (v * 0.273_85 - 0.733_69) + 0.463_41))
        / (v * (v * (v * 0.093_073 + 0.309_42) - 1.0) + 0.597_999);
    Vec2::new(x, sign * z * (1.0 + x * x).sqrt())
}

/// Cosine and sine of the angle around z.
pub(super) fn azimuth(w: Vec3) -> (f32, f32) {
    let sin_theta = (1.0 - w.z * w.z).max(0.0).sqrt();
    if sin_theta == 0.0 {
        (1.0, 0.0)
    } else {
        (
            (w.x / sin_theta).clamp(-1.0, 1.0),
            (w.y / sin_theta).clamp(-1.0, 1.0),
        )
    }
}

fn squared(x: f32) -> f32 {
    x * x
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn facets_project_to_the_area_of_the_surface() {
        for (ax, ay) in [(0.1, 0.1), (0.5, 0.2), (1.0, 0.7)] {
            let d = TrowbridgeReitz::new(ax, ay);
            let (n, mut sum) = (1000, 0.0);
            for i in 0..n {
                for j in 0..n / 5 {
                    let cos = (i as f32 + 0.5) / n as f32;
                    let sin = (1.0 - cos * cos).sqrt();
                    let phi = 2.0 * PI * (j as f32 + 0.5) / (n / 5) as f32;
                    let wh = Vec3::new(sin * phi.cos(), sin * phi.sin(), cos);
                    sum += f64::from(d.density(wh) * cos);
                }
            }
            let integral = sum * f64::from(2.0 * PI) / f64::from(n * n / 5);
            assert!((integral - 1.0).abs() < 0.02, "{ax} {ay}: {integral}");
        }
    }

    #[test]
    fn rough_is_wide() {
        assert!(
            (width_of_roughness(0.15) - 0.597).abs() < 0.05,
            "{}",
            width_of_roughness(0.15)
        );
        assert!(width_of_roughness(0.0) < 0.1 && width_of_roughness(1.0) > 1.6);
    }
}
