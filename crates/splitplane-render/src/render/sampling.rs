//! From the unit square to the shapes that are sampled [PBRT3, 13.6].

use std::f32::consts::{FRAC_1_PI, FRAC_PI_2, FRAC_PI_4, PI};

use glam::{Vec2, Vec3};

/// The largest f32 below 1.
pub(super) const ONE_MINUS_EPSILON: f32 = 1.0 - f32::EPSILON / 2.0;

/// A point of the unit disk, by the map that keeps areas and neighbours [Shirley1997].
pub(super) fn concentric_disk(u: Vec2) -> Vec2 {
    let p = 2.0 * u - Vec2::ONE;
    if p == Vec2::ZERO {
        return Vec2::ZERO;
    }
    let (radius, angle) = if p.x.abs() > p.y.abs() {
        (p.x, FRAC_PI_4 * (p.y / p.x))
    } else {
        (p.y, FRAC_PI_2 - FRAC_PI_4 * (p.x / p.y))
    };
    radius * Vec2::new(angle.cos(), angle.sin())
}

/// A direction of the upper hemisphere (z ≥ 0), with density cos θ / π.
pub(super) fn cosine_hemisphere(u: Vec2) -> Vec3 {
    let d = concentric_disk(u);
    d.extend((1.0 - d.length_squared()).max(0.0).sqrt())
}

/// The density of [`cosine_hemisphere`].
pub(super) fn cosine_hemisphere_pdf(cos_theta: f32) -> f32 {
    cos_theta * FRAC_1_PI
}

/// A direction of the upper hemisphere, all alike: density [`UNIFORM_HEMISPHERE_PDF`].
pub(super) fn uniform_hemisphere(u: Vec2) -> Vec3 {
    let z = u.x;
    let r = (1.0 - z * z).max(0.0).sqrt();
    let phi = 2.0 * PI * u.y;
    Vec3::new(r * phi.cos(), r * phi.sin(), z)
}

/// The density of [`uniform_hemisphere`].
pub(super) const UNIFORM_HEMISPHERE_PDF: f32 = 1.0 / (2.0 * PI);

/// Barycentric weights of the first two vertices of a triangle, uniform over its area.
pub(super) fn uniform_triangle(u: Vec2) -> (f32, f32) {
    let root = u.x.sqrt();
    (1.0 - root, u.y * root)
}

/// The weight of one sample from density `pdf`, where one from `other` could have found the same
/// [Veach1995]: the power heuristic with exponent 2.
pub(super) fn power_heuristic(pdf: f32, other: f32) -> f32 {
    let (a, b) = (pdf * pdf, other * other);
    if a.is_infinite() { 1.0 } else { a / (a + b) }
}

/// Two unit vectors that make a frame with the unit vector `v`.
pub(super) fn frame_around(v: Vec3) -> (Vec3, Vec3) {
    let a = if v.x.abs() > v.y.abs() {
        Vec3::new(-v.z, 0.0, v.x) / (v.x * v.x + v.z * v.z).sqrt()
    } else {
        Vec3::new(0.0, v.z, -v.y) / (v.y * v.y + v.z * v.z).sqrt()
    };
    (a, v.cross(a))
}

/// Relative luminance of linear RGB with sRGB primaries, with pbrt-v3's coefficients.
pub(super) fn luminance(c: Vec3) -> f32 {
    c.dot(Vec3::new(0.212_671, 0.715_16, 0.072_169))
}

/// A choice among numbered things with given weights [PBRT3, 13.3.1].
#[derive(Clone, Debug)]
pub(super) struct Distribution {
    /// `cumulative[i]`: probability of all before i; one more than things.
    cumulative: Vec<f32>,
    probability: Vec<f32>,
}

impl Distribution {
    /// Weights that are negative or not finite count as 0.
    pub(super) fn new(weights: &[f32]) -> Self {
        let usable = |w: f32| {
            if w.is_finite() {
                f64::from(w.max(0.0))
            } else {
                0.0
            }
        };
        let total: f64 = weights.iter().map(|&w| usable(w)).sum();
        let scale = if total > 0.0 { 1.0 / total } else { 0.0 };
        let mut sum = 0.0;
        let mut cumulative = vec![0.0];
        cumulative.extend(weights.iter().map(|&w| {
            sum += usable(w) * scale;
            sum as f32
        }));
        Distribution {
            cumulative,
            probability: weights
                .iter()
                .map(|&w| (usable(w) * scale) as f32)
                .collect(),
        }
    }

    /// The choice that `u` in `[0, 1)` makes, and its probability; `None` where all weights are 0.
    pub(super) fn pick(&self, u: f32) -> Option<(usize, f32)> {
        let i = self
            .cumulative
            .partition_point(|&c| c <= u)
            .saturating_sub(1);
        let i = i.min(self.probability.len().checked_sub(1)?);
        let probability = self.probability[i];
        (probability > 0.0).then_some((i, probability))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn things_of_weight_zero_are_never_picked_and_the_others_in_proportion() {
        let d = Distribution::new(&[0.0, 1.0, 0.0, 3.0, f32::NAN, 0.0]);
        let mut picked = [0; 6];
        for i in 0..4000 {
            let (which, p) = d.pick(i as f32 / 4000.0).unwrap();
            assert_eq!(p, [0.0, 0.25, 0.0, 0.75, 0.0, 0.0][which]);
            picked[which] += 1;
        }
        assert_eq!(picked, [0, 1000, 0, 3000, 0, 0]);
        assert!(Distribution::new(&[0.0, 0.0]).pick(0.5).is_none());
        assert!(Distribution::new(&[]).pick(0.5).is_none());
    }

    #[test]
    fn frames_are_orthonormal_and_right_handed() {
        for v in [
            Vec3::X,
            Vec3::Y,
            Vec3::Z,
            Vec3::new(1.0, -2.0, 3.0).normalize(),
        ] {
            let (a, b) = frame_around(v);
            assert!(a.dot(v).abs() < 1e-6 && b.dot(v).abs() < 1e-6 && a.dot(b).abs() < 1e-6);
            assert!((a.cross(b) - v).length() < 1e-6 || (b.cross(a) + v).length() < 1e-6);
        }
    }
}
