//! What a smooth boundary between two media reflects and how it refracts [PBRT3, 8.2].

use glam::Vec3;

/// How much a boundary reflects, by the angle.
#[derive(Clone, Copy, Debug)]
pub(super) enum Fresnel {
    /// Everything.
    Full,
    /// As between dielectrics; `outside` is the index on the normal's side.
    Dielectric { outside: f32, inside: f32 },
    /// As [`Fresnel::Dielectric`], but always seen from its outside.
    Coat { outside: f32, inside: f32 },
    /// As a conductor with this index of refraction and absorption, by colour.
    Conductor { eta: Vec3, k: Vec3 },
}

impl Fresnel {
    pub(super) fn evaluate(self, cos_i: f32) -> Vec3 {
        match self {
            Fresnel::Full => Vec3::ONE,
            Fresnel::Dielectric { outside, inside } => {
                Vec3::splat(dielectric(cos_i, outside, inside))
            }
            Fresnel::Coat { outside, inside } => {
                Vec3::splat(dielectric(cos_i.abs(), outside, inside))
            }
            Fresnel::Conductor { eta, k } => conductor(cos_i.abs(), eta, k),
        }
    }
}

/// The part of unpolarised light in air that a conductor reflects.
fn conductor(cos: f32, eta: Vec3, k: Vec3) -> Vec3 {
    let cos2 = cos.min(1.0) * cos.min(1.0);
    let sin2 = 1.0 - cos2;
    let (eta2, k2) = (eta * eta, k * k);
    let t0 = eta2 - k2 - Vec3::splat(sin2);
    let a2_plus_b2 = (t0 * t0 + 4.0 * eta2 * k2).max(Vec3::ZERO).map(f32::sqrt);
    let t1 = a2_plus_b2 + Vec3::splat(cos2);
    let a = (0.5 * (a2_plus_b2 + t0)).max(Vec3::ZERO).map(f32::sqrt);
    let t2 = 2.0 * cos * a;
    let perpendicular = (t1 - t2) / (t1 + t2);
    let t3 = cos2 * a2_plus_b2 + Vec3::splat(sin2 * sin2);
    let t4 = t2 * sin2;
    let parallel = perpendicular * (t3 - t4) / (t3 + t4);
    0.5 * (parallel + perpendicular)
}

/// The part of unpolarised light that is reflected where light comes in at an angle with this
/// cosine; negative: from inside.
pub(super) fn dielectric(cos_i: f32, outside: f32, inside: f32) -> f32 {
    let cos_i = cos_i.clamp(-1.0, 1.0);
    let (eta_i, eta_t) = if cos_i > 0.0 {
        (outside, inside)
    } else {
        (inside, outside)
    };
    let cos_i = cos_i.abs();
    let sin_t = eta_i / eta_t * (1.0 - cos_i * cos_i).max(0.0).sqrt();
    if sin_t >= 1.0 {
        return 1.0;
    }
    let cos_t = (1.0 - sin_t * sin_t).max(0.0).sqrt();
    let parallel = (eta_t * cos_i - eta_i * cos_t) / (eta_t * cos_i + eta_i * cos_t);
    let perpendicular = (eta_i * cos_i - eta_t * cos_t) / (eta_i * cos_i + eta_t * cos_t);
    (parallel * parallel + perpendicular * perpendicular) / 2.0
}

/// The direction into which `w` (away from the surface, on `normal`'s side) is refracted; `eta` is
/// the index on its own side over that beyond. `None`: total reflection.
pub(super) fn refract(w: Vec3, normal: Vec3, eta: f32) -> Option<Vec3> {
    let cos_i = normal.dot(w);
    let sin2_t = eta * eta * (1.0 - cos_i * cos_i).max(0.0);
    (sin2_t < 1.0).then(|| {
        let cos_t = (1.0 - sin2_t).sqrt();
        -eta * w + (eta * cos_i - cos_t) * normal
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn glass_reflects_what_textbooks_say() {
        assert!((dielectric(1.0, 1.0, 1.5) - 0.04).abs() < 1e-6);
        assert!((dielectric(-1.0, 1.0, 1.5) - 0.04).abs() < 1e-6);
        assert!((dielectric(0.0, 1.0, 1.5) - 1.0).abs() < 1e-6);
        // Beyond the critical angle, 41.8 degrees, from inside.
        assert_eq!(dielectric(-(45f32.to_radians().cos()), 1.0, 1.5), 1.0);
        // At Brewster's angle only the perpendicular part is left: half of 14.8 %.
        let cos = 1.5f32.atan().cos();
        assert!((dielectric(cos, 1.0, 1.5) - 0.0740).abs() < 1e-4);
    }

    #[test]
    fn refraction_obeys_snell() {
        let w = Vec3::new(0.6, 0.0, 0.8);
        let t = refract(w, Vec3::Z, 1.0 / 1.5).unwrap();
        assert!((t.length() - 1.0).abs() < 1e-6 && t.z < 0.0);
        assert!((t.x + 0.4).abs() < 1e-6);
        assert!(refract(w, Vec3::Z, 2.0).is_none());
    }

    #[test]
    fn conductors_reflect_what_their_formula_says_at_normal_incidence() {
        let (eta, k) = (Vec3::new(0.2, 0.92, 1.1), Vec3::new(3.91, 2.45, 2.14));
        let expected = ((eta - 1.0) * (eta - 1.0) + k * k) / ((eta + 1.0) * (eta + 1.0) + k * k);
        assert!((conductor(1.0, eta, k) - expected).abs().max_element() < 1e-5);
        assert!((conductor(0.0, eta, k) - Vec3::ONE).abs().max_element() < 1e-5);
        // Without absorption it is a dielectric.
        let glass = conductor(0.5, Vec3::splat(1.5), Vec3::ZERO).x;
        assert!((glass - dielectric(0.5, 1.0, 1.5)).abs() < 1e-5);
    }
}
