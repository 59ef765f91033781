//! Textures, looked up.

use glam::{Vec2, Vec3};

use crate::scene::texture::{Image, Texture, Wrap};

/// The texture's colour at the surface's `(u, v)`.
pub(super) fn evaluate(texture: &Texture, uv: Vec2) -> Vec3 {
    match texture {
        Texture::Constant(value) => Vec3::from(*value),
        Texture::Scale(a, b) => evaluate(a, uv) * evaluate(b, uv),
        Texture::Image {
            image,
            mapping: [su, sv, du, dv],
            wrap,
        } => bilinear(image, *wrap, Vec2::new(su * uv.x + du, sv * uv.y + dv)),
    }
}

/// Between the four nearest pixels; v = 0 is the picture's lower edge, as pbrt has it.
fn bilinear(image: &Image, wrap: Wrap, uv: Vec2) -> Vec3 {
    let place = uv * Vec2::new(image.width as f32, image.height as f32) - Vec2::splat(0.5);
    let corner = place.floor();
    let part = place - corner;
    let (x, y) = (corner.x as i64, corner.y as i64);
    let row = |y| pixel(image, wrap, x, y).lerp(pixel(image, wrap, x + 1, y), part.x);
    row(y).lerp(row(y + 1), part.y)
}

/// Pixels count from the lower left.
fn pixel(image: &Image, wrap: Wrap, x: i64, y: i64) -> Vec3 {
    let (width, height) = (i64::from(image.width), i64::from(image.height));
    if width == 0 || height == 0 {
        return Vec3::ZERO;
    }
    let (x, y) = match wrap {
        Wrap::Repeat => (x.rem_euclid(width), y.rem_euclid(height)),
        Wrap::Clamp => (x.clamp(0, width - 1), y.clamp(0, height - 1)),
        Wrap::Black if (0..width).contains(&x) && (0..height).contains(&y) => (x, y),
        Wrap::Black => return Vec3::ZERO,
    };
    let index = (height - 1 - y) * width + x;
    image
        .pixels
        .get(index as usize)
        .map_or(Vec3::ZERO, |&p| p.into())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Arc;

    /// Two columns, two rows; in the red channel 1 2 above 3 4.
    fn texture(wrap: Wrap, mapping: [f32; 4]) -> Texture {
        let pixels = [1.0, 2.0, 3.0, 4.0].map(|r| [r, 0.0, 0.0]).to_vec();
        let image = Arc::new(Image {
            width: 2,
            height: 2,
            pixels,
        });
        Texture::Image {
            image,
            mapping,
            wrap,
        }
    }

    fn red(texture: &Texture, u: f32, v: f32) -> f32 {
        evaluate(texture, Vec2::new(u, v)).x
    }

    #[test]
    fn v_0_is_the_lower_edge_of_the_picture() {
        let t = texture(Wrap::Clamp, [1.0, 1.0, 0.0, 0.0]);
        assert_eq!(red(&t, 0.25, 0.25), 3.0);
        assert_eq!(red(&t, 0.75, 0.25), 4.0);
        assert_eq!(red(&t, 0.25, 0.75), 1.0);
        assert_eq!(red(&t, 0.5, 0.5), 2.5);
    }

    #[test]
    fn each_wrap_has_its_own_outside() {
        let at = |wrap, u, v| red(&texture(wrap, [1.0, 1.0, 0.0, 0.0]), u, v);
        assert_eq!(at(Wrap::Repeat, 1.25, -0.75), 3.0);
        assert_eq!(at(Wrap::Clamp, 5.0, -5.0), 4.0);
        assert_eq!(at(Wrap::Black, 5.0, 0.25), 0.0);
        assert_eq!(at(Wrap::Black, 0.0, 0.25), 1.5);
    }

    #[test]
    fn mappings_scale_and_shift_and_products_multiply() {
        let t = texture(Wrap::Clamp, [0.5, 0.5, 0.5, 0.0]);
        assert_eq!(red(&t, 0.5, 0.5), 4.0);
        let half = Arc::new(Texture::Constant([0.5; 3]));
        assert_eq!(red(&Texture::Scale(half, Arc::new(t)), 0.5, 0.5), 2.0);
    }
}
