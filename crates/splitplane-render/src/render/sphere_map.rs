//! From directions to places on a picture of all directions, and back.

use std::f32::consts::{FRAC_PI_2, PI};

use glam::{Vec2, Vec3};

use super::texture::azimuth;
use crate::scene::light::SphereMap;

impl SphereMap {
    /// Where the unit vector `w` lies on the picture: from 0 to 1, from the left and from the top.
    pub(super) fn place(self, w: Vec3) -> Vec2 {
        match self {
            SphereMap::LongitudeLatitude => Vec2::new(
                azimuth(w.x, w.y) / (2.0 * PI),
                w.z.clamp(-1.0, 1.0).acos() / PI,
            ),
            SphereMap::EqualArea => {
                // The distance from the centre of the square, in the sum norm: the upper hemisphere
                // fills the diamond, each band of equal height the same area.
                let r = (1.0 - w.z.abs()).max(0.0).sqrt();
                let (a, b) = (w.x.abs(), w.y.abs());
                let y = r * if a == 0.0 && b == 0.0 {
                    0.0
                } else {
                    b.atan2(a) / FRAC_PI_2
                };
                let mut p = Vec2::new(r - y, y);
                if w.z < 0.0 {
                    p = Vec2::ONE - Vec2::new(p.y, p.x);
                }
                let p = Vec2::new(p.x.copysign(w.x), p.y.copysign(w.y));
                (0.5 * p + Vec2::splat(0.5)).clamp(Vec2::ZERO, Vec2::ONE)
            }
        }
    }

    /// The unit vector of a place, and the solid angle of a small part of the picture there over
    /// the part's share of it.
    pub(super) fn direction(self, place: Vec2) -> (Vec3, f32) {
        match self {
            SphereMap::LongitudeLatitude => {
                let (theta, phi) = (PI * place.y, 2.0 * PI * place.x);
                let (sin, cos) = theta.sin_cos();
                let w = Vec3::new(sin * phi.cos(), sin * phi.sin(), cos);
                (w, 2.0 * PI * PI * sin)
            }
            SphereMap::EqualArea => {
                let p = 2.0 * place - Vec2::ONE;
                let (a, b) = (p.x.abs(), p.y.abs());
                // Beyond the diamond is the lower hemisphere, folded outwards.
                let lower = a + b > 1.0;
                let (a, b) = if lower { (1.0 - b, 1.0 - a) } else { (a, b) };
                let r = a + b;
                let phi = if r > 0.0 { FRAC_PI_2 * b / r } else { 0.0 };
                let z = 1.0 - r * r;
                let across = r * (2.0 - r * r).max(0.0).sqrt();
                let w = Vec3::new(
                    (across * phi.cos()).copysign(p.x),
                    (across * phi.sin()).copysign(p.y),
                    if lower { -z } else { z },
                );
                (w, 4.0 * PI)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MAPS: [SphereMap; 2] = [SphereMap::LongitudeLatitude, SphereMap::EqualArea];

    #[test]
    fn places_and_directions_undo_each_other() {
        let n = 40;
        for map in MAPS {
            for i in 0..n * n {
                let place = Vec2::new((i % n) as f32 + 0.4, (i / n) as f32 + 0.3) / n as f32;
                let (w, _) = map.direction(place);
                assert!((w.length() - 1.0).abs() < 1e-5, "{w}");
                assert!(
                    (map.place(w) - place).length() < 1e-3,
                    "{map:?} {place} {w}"
                );
            }
        }
    }

    #[test]
    fn parts_of_a_picture_have_the_solid_angle_that_is_said() {
        let n = 64;
        let corner = |map: SphereMap, x: usize, y: usize| {
            map.direction(Vec2::new(x as f32, y as f32) / n as f32).0
        };
        for map in MAPS {
            for i in 0..n * n {
                let (x, y) = (i % n, i / n);
                let [a, b, c, d] = [(x, y), (x + 1, y), (x + 1, y + 1), (x, y + 1)]
                    .map(|(x, y)| corner(map, x, y));
                let area = 0.5 * (c - a).cross(d - b).length();
                let centre = Vec2::new(x as f32 + 0.5, y as f32 + 0.5) / n as f32;
                let said = map.direction(centre).1 / (n * n) as f32;
                assert!(
                    (area / said - 1.0).abs() < 0.05,
                    "{map:?} {x} {y}: {area} {said}"
                );
            }
        }
    }

    #[test]
    fn the_equal_area_map_has_up_in_its_middle_and_down_in_its_corners() {
        let place = |w: [f32; 3]| SphereMap::EqualArea.place(Vec3::from(w));
        let near =
            |w, x: f32, y: f32| assert!((place(w) - Vec2::new(x, y)).length() < 1e-6, "{w:?}");
        near([0.0, 0.0, 1.0], 0.5, 0.5);
        near([1.0, 0.0, 0.0], 1.0, 0.5);
        near([-1.0, 0.0, 0.0], 0.0, 0.5);
        near([0.0, 1.0, 0.0], 0.5, 1.0);
        near([0.0, -1.0, 0.0], 0.5, 0.0);
        near([0.0, 0.0, -1.0], 1.0, 1.0);
        // Half of the upper hemisphere is above z = 1/2; half of the diamond, within r² = 1/2.
        let w = Vec3::new(0.75f32.sqrt(), 0.0, 0.5);
        near(w.into(), 0.5 + 0.5 * 0.5f32.sqrt(), 0.5);
    }
}
