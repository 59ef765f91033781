//! Textures, looked up [PBRT3, chapter 10].

mod noise;

use std::f32::consts::{FRAC_1_PI, PI};

use glam::{Vec2, Vec3};

use crate::scene::texture::{Mapping, Pattern, Texture};
use crate::transform::Transform;
use noise::{fbm, noise, turbulence};

/// A place on a surface, as textures see it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Spot {
    /// In world space.
    pub(super) p: Vec3,
    pub(super) uv: Vec2,
    /// The vertices', between them; white where they have none.
    pub(super) color: Vec3,
    pub(super) footprint: Footprint,
}

/// How a place moves from one pixel of the picture to the next, to the right and downwards; zero
/// where that is not known.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Footprint {
    pub(super) dpdx: Vec3,
    pub(super) dpdy: Vec3,
    pub(super) duvdx: Vec2,
    pub(super) duvdy: Vec2,
}

impl Spot {
    /// Without a footprint.
    pub(super) fn point(p: Vec3, uv: Vec2) -> Self {
        Spot {
            p,
            uv,
            color: Vec3::ONE,
            footprint: Footprint::default(),
        }
    }
}

/// The texture's colour at a place.
pub(super) fn evaluate(texture: &Texture, at: &Spot) -> Vec3 {
    match texture {
        Texture::Constant(value) => Vec3::from(*value),
        Texture::Scale(a, b) => evaluate(a, at) * evaluate(b, at),
        Texture::Mix { from, to, amount } => {
            let amount = evaluate(amount, at);
            (Vec3::ONE - amount) * evaluate(from, at) + amount * evaluate(to, at)
        }
        Texture::AtLeast { texture, threshold } => {
            let reached = evaluate(texture, at).x >= *threshold;
            Vec3::splat(if reached { 1.0 } else { 0.0 })
        }
        Texture::VertexColor => at.color,
        Texture::Image {
            image,
            mapping,
            filter,
            scale,
        } => {
            let m = Mapped::new(mapping, at);
            *scale * image.pyramid().filtered(*filter, m.st, m.dx, m.dy)
        }
        Texture::Bilerp { corners, mapping } => {
            let st = Mapped::new(mapping, at).st;
            let [v00, v01, v10, v11] = corners.map(Vec3::from);
            let (s, t) = (st.x, st.y);
            (1.0 - s) * (1.0 - t) * v00 + (1.0 - s) * t * v01 + s * (1.0 - t) * v10 + s * t * v11
        }
        Texture::Uv { mapping } => {
            let st = Mapped::new(mapping, at).st;
            (st - st.floor()).extend(0.0)
        }
        Texture::Checkerboard {
            even,
            odd,
            mapping,
            filtered,
        } => {
            let odd_part = odd_part(&Mapped::new(mapping, at), *filtered);
            if odd_part == 0.0 {
                evaluate(even, at)
            } else if odd_part == 1.0 {
                evaluate(odd, at)
            } else {
                (1.0 - odd_part) * evaluate(even, at) + odd_part * evaluate(odd, at)
            }
        }
        Texture::Checkerboard3 {
            even,
            odd,
            to_texture,
        } => {
            let p = Vec3::from(to_texture.point(at.p.into())).floor();
            let sum = p.x as i64 + p.y as i64 + p.z as i64;
            evaluate(if sum % 2 == 0 { even } else { odd }, at)
        }
        Texture::Dots {
            inside,
            outside,
            mapping,
        } => {
            let st = Mapped::new(mapping, at).st;
            evaluate(if in_dot(st) { inside } else { outside }, at)
        }
        Texture::Noise {
            pattern,
            to_texture,
        } => patterned(pattern, to_texture, at),
    }
}

/// A place in a texture's two coordinates, and how it moves from pixel to pixel.
struct Mapped {
    st: Vec2,
    dx: Vec2,
    dy: Vec2,
}

impl Mapped {
    fn new(mapping: &Mapping, at: &Spot) -> Self {
        let Footprint {
            dpdx,
            dpdy,
            duvdx,
            duvdy,
        } = at.footprint;
        // Where the coordinates jump from 1 to 0 between two pixels, they do not move that much.
        let nearest = |d: f32| match d {
            d if d > 0.5 => 1.0 - d,
            d if d < -0.5 => -(d + 1.0),
            d => d,
        };
        match mapping {
            Mapping::Uv { scale, shift } => {
                let (scale, shift) = (Vec2::from(*scale), Vec2::from(*shift));
                Mapped {
                    st: scale * at.uv + shift,
                    dx: scale * duvdx,
                    dy: scale * duvdy,
                }
            }
            Mapping::Spherical { to_texture } => {
                const DELTA: f32 = 0.1;
                let angles = |p: Vec3| {
                    let w = Vec3::from(to_texture.point(p.into())).normalize_or_zero();
                    let theta = w.z.clamp(-1.0, 1.0).acos();
                    Vec2::new(theta * FRAC_1_PI, azimuth(w.x, w.y) / (2.0 * PI))
                };
                let st = angles(at.p);
                let moved = |d: Vec3| {
                    let d = (angles(at.p + DELTA * d) - st) / DELTA;
                    Vec2::new(d.x, nearest(d.y))
                };
                Mapped {
                    st,
                    dx: moved(dpdx),
                    dy: moved(dpdy),
                }
            }
            Mapping::Cylindrical { to_texture } => {
                const DELTA: f32 = 0.01;
                let angle = |p: Vec3| {
                    let w = Vec3::from(to_texture.point(p.into())).normalize_or_zero();
                    Vec2::new((PI + w.y.atan2(w.x)) / (2.0 * PI), w.z)
                };
                let st = angle(at.p);
                let moved = |d: Vec3| {
                    let d = (angle(at.p + DELTA * d) - st) / DELTA;
                    Vec2::new(d.x, nearest(d.y))
                };
                Mapped {
                    st,
                    dx: moved(dpdx),
                    dy: moved(dpdy),
                }
            }
            Mapping::Planar { axes, shift } => {
                let [s, t] = axes.map(Vec3::from);
                let along = |v: Vec3| Vec2::new(v.dot(s), v.dot(t));
                Mapped {
                    st: along(at.p) + Vec2::from(*shift),
                    dx: along(dpdx),
                    dy: along(dpdy),
                }
            }
        }
    }
}

/// The angle of a point of the plane around the origin, from 0 to 2π.
pub(super) fn azimuth(x: f32, y: f32) -> f32 {
    let phi = y.atan2(x);
    if phi < 0.0 { phi + 2.0 * PI } else { phi }
}

/// The part of a pixel's footprint that lies in odd squares; 0 or 1 for a point.
fn odd_part(m: &Mapped, filtered: bool) -> f32 {
    let point = || {
        let cell = m.st.floor();
        ((cell.x as i64 + cell.y as i64) % 2 != 0) as u8 as f32
    };
    if !filtered {
        return point();
    }
    let d = m.dx.abs().max(m.dy.abs());
    let (low, high) = (m.st - d, m.st + d);
    if low.floor() == high.floor() {
        return point();
    }
    if d.max_element() > 1.0 {
        return 0.5;
    }
    // The integral from 0 to x of whether x lies in an odd unit.
    let integral = |x: f32| {
        let half = x / 2.0;
        half.floor() + 2.0 * (half - half.floor() - 0.5).max(0.0)
    };
    let share = |low: f32, high: f32, d: f32| (integral(high) - integral(low)) / (2.0 * d);
    let (s, t) = (share(low.x, high.x, d.x), share(low.y, high.y, d.y));
    let area = s + t - 2.0 * s * t;
    // An extent of zero gives no share.
    if area.is_nan() { point() } else { area }
}

/// Whether a place lies in the dot of its square, if that has one.
fn in_dot(st: Vec2) -> bool {
    const RADIUS: f32 = 0.35;
    let noise = |x, y| noise(Vec3::new(x, y, 0.5));
    let cell = (st + Vec2::splat(0.5)).floor();
    if noise(cell.x + 0.5, cell.y + 0.5) <= 0.0 {
        return false;
    }
    let shift = Vec2::new(
        noise(cell.x + 1.5, cell.y + 2.8),
        noise(cell.x + 4.5, cell.y + 9.8),
    );
    let center = cell + (0.5 - RADIUS) * shift;
    (st - center).length_squared() < RADIUS * RADIUS
}

fn patterned(pattern: &Pattern, to_texture: &Transform, at: &Spot) -> Vec3 {
    let vector = |v: Vec3| Vec3::from(to_texture.vector(v.into()));
    let p = Vec3::from(to_texture.point(at.p.into()));
    let d = [vector(at.footprint.dpdx), vector(at.footprint.dpdy)];
    Vec3::splat(match *pattern {
        Pattern::Fbm { octaves, roughness } => fbm(p, d, roughness, octaves),
        Pattern::Wrinkled { octaves, roughness } => turbulence(p, d, roughness, octaves),
        Pattern::Windy => {
            let strength = fbm(0.1 * p, d.map(|d| 0.1 * d), 0.5, 3);
            strength.abs() * fbm(p, d, 0.5, 6)
        }
        Pattern::Marble {
            octaves,
            roughness,
            scale,
            variation,
        } => {
            let p = scale * p;
            let shift = variation * fbm(p, d.map(|d| scale * d), roughness, octaves);
            return marble(0.5 + 0.5 * (p.y + shift).sin());
        }
    })
}

/// The colour of marble at t from 0 to 1: a spline through nine colours.
///
/// pbrt-v3 takes the segment of `min(1, 6 t)`, so that most of its marble is extrapolated from the
/// second one; this is so here too, for the sake of the same pictures.
fn marble(t: f32) -> Vec3 {
    let light = Vec3::new(0.58, 0.58, 0.6);
    let colors = [
        light,
        light,
        light,
        Vec3::splat(0.5),
        Vec3::new(0.6, 0.59, 0.58),
    ];
    const SEGMENTS: f32 = 6.0;
    let first = if t * SEGMENTS < 1.0 { 0 } else { 1 };
    let t = t * SEGMENTS - first as f32;
    let mut points: [Vec3; 4] = std::array::from_fn(|i| colors[first + i]);
    for count in (1..4).rev() {
        for i in 0..count {
            points[i] = (1.0 - t) * points[i] + t * points[i + 1];
        }
    }
    1.5 * points[0]
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Arc;

    use crate::scene::texture::TextureRef;

    fn constant(value: f32) -> TextureRef {
        Arc::new(Texture::Constant([value; 3]))
    }

    fn at(u: f32, v: f32) -> Spot {
        Spot::point(Vec3::ZERO, Vec2::new(u, v))
    }

    #[test]
    fn products_and_mixes_do_arithmetic() {
        let product = Texture::Scale(constant(0.5), constant(4.0));
        assert_eq!(evaluate(&product, &at(0.5, 0.5)).x, 2.0);
        let mix = Texture::Mix {
            from: constant(1.0),
            to: constant(3.0),
            amount: constant(0.25),
        };
        assert_eq!(evaluate(&mix, &at(0.0, 0.0)).x, 1.5);
    }

    #[test]
    fn squares_alternate_and_blur_to_the_part_that_is_covered() {
        let board = |filtered| Texture::Checkerboard {
            even: constant(1.0),
            odd: constant(0.0),
            mapping: Mapping::Uv {
                scale: [2.0, 2.0],
                shift: [0.0; 2],
            },
            filtered,
        };
        let value = |filtered, spot: &Spot| evaluate(&board(filtered), spot).x;
        for (u, v, expected) in [(0.1, 0.1, 1.0), (0.6, 0.1, 0.0), (0.6, 0.6, 1.0)] {
            assert_eq!(value(false, &at(u, v)), expected);
            assert_eq!(value(true, &at(u, v)), expected);
        }
        // A footprint of half a square over an edge, a quarter of it beyond.
        let mut spot = at(0.5 - 0.0625, 0.25);
        spot.footprint.duvdx = Vec2::new(0.125, 0.0);
        spot.footprint.duvdy = Vec2::new(0.0, 0.01);
        assert!((value(true, &spot) - 0.75).abs() < 1e-5);
        spot.footprint.duvdx = Vec2::new(2.0, 0.0);
        assert_eq!(value(true, &spot), 0.5);
    }

    #[test]
    fn bilerp_has_its_values_at_its_corners() {
        let texture = Texture::Bilerp {
            corners: [[1.0; 3], [2.0; 3], [3.0; 3], [4.0; 3]],
            mapping: Mapping::IDENTITY,
        };
        let value = |u, v| evaluate(&texture, &at(u, v)).x;
        assert_eq!(
            [value(0.0, 0.0), value(0.0, 1.0), value(1.0, 0.0)],
            [1.0, 2.0, 3.0]
        );
        assert_eq!(value(0.5, 0.5), 2.5);
    }

    #[test]
    fn planes_spheres_and_cylinders_map_by_their_coordinates() {
        let to_texture = Transform::IDENTITY;
        let st = |mapping: &Mapping, p: Vec3| Mapped::new(mapping, &Spot::point(p, Vec2::ZERO)).st;
        let planar = Mapping::Planar {
            axes: [[2.0, 0.0, 0.0], [0.0, 0.0, 1.0]],
            shift: [0.5, 0.0],
        };
        assert_eq!(st(&planar, Vec3::new(1.0, 9.0, 3.0)), Vec2::new(2.5, 3.0));
        let sphere = Mapping::Spherical { to_texture };
        assert!((st(&sphere, 3.0 * Vec3::Y) - Vec2::new(0.5, 0.25)).length() < 1e-6);
        let cylinder = Mapping::Cylindrical { to_texture };
        assert!((st(&cylinder, Vec3::Y) - Vec2::new(0.75, 0.0)).length() < 1e-6);
    }
}
