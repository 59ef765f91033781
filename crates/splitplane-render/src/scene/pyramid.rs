//! An image at all its resolutions, and looking it up [PBRT3, 10.4].

use std::sync::OnceLock;

use glam::{Vec2, Vec3};

use super::texture::{ImageFilter, Wrap};

/// One resolution; rows from the top.
#[derive(Clone, Debug, PartialEq)]
struct Level {
    width: u32,
    height: u32,
    texels: Texels,
}

/// Images of 8 bits stay so: a quarter of the size, and the same values.
#[derive(Clone, Debug, PartialEq)]
enum Texels {
    Floats(Vec<[f32; 3]>),
    Bytes(Vec<[u8; 3]>, Box<[f32; 256]>),
}

/// An image and its halved copies, down to a single pixel.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Pyramid {
    /// Width and height of the image as it was read.
    original: [u32; 2],
    wrap: Wrap,
    levels: Vec<Level>,
}

/// What the pixels of an image are.
pub(crate) enum Pixels {
    Floats(Vec<[f32; 3]>),
    /// Bytes, and what they mean.
    Bytes(Vec<[u8; 3]>, Box<[f32; 256]>),
}

impl Level {
    #[inline]
    fn texel(&self, index: usize) -> Vec3 {
        let texel = match &self.texels {
            Texels::Floats(pixels) => pixels.get(index).copied(),
            Texels::Bytes(pixels, table) => pixels
                .get(index)
                .map(|p| p.map(|byte| table[usize::from(byte)])),
        };
        texel.map_or(Vec3::ZERO, Vec3::from)
    }

    /// Pixels count from the lower left.
    #[inline]
    fn at(&self, wrap: Wrap, x: i64, y: i64) -> Vec3 {
        let (width, height) = (i64::from(self.width), i64::from(self.height));
        let (x, y) = match wrap {
            Wrap::Repeat => (x.rem_euclid(width), y.rem_euclid(height)),
            Wrap::Clamp => (x.clamp(0, width - 1), y.clamp(0, height - 1)),
            Wrap::Black if (0..width).contains(&x) && (0..height).contains(&y) => (x, y),
            Wrap::Black => return Vec3::ZERO,
        };
        self.texel(((height - 1 - y) * width + x) as usize)
    }

    /// Between the four nearest pixels.
    fn bilinear(&self, wrap: Wrap, st: Vec2) -> Vec3 {
        let place = st * Vec2::new(self.width as f32, self.height as f32) - Vec2::splat(0.5);
        let corner = place.floor();
        let part = place - corner;
        let (x, y) = (corner.x as i64, corner.y as i64);
        let row = |y| {
            self.at(wrap, x, y)
                .lerp(self.at(wrap, x.saturating_add(1), y), part.x)
        };
        row(y).lerp(row(y.saturating_add(1)), part.y)
    }
}

impl Pyramid {
    pub(crate) fn new(width: u32, height: u32, pixels: Vec<[f32; 3]>, wrap: Wrap) -> Self {
        Self::of(width, height, Pixels::Floats(pixels), wrap)
    }

    pub(crate) fn of(width: u32, height: u32, pixels: Pixels, wrap: Wrap) -> Self {
        let original = [width, height];
        if width == 0 || height == 0 {
            return Self::new(1, 1, vec![[0.0; 3]], wrap);
        }
        let (w, h) = (width.next_power_of_two(), height.next_power_of_two());
        let texels = match pixels {
            Pixels::Floats(pixels) => Texels::Floats(pixels),
            Pixels::Bytes(pixels, table) => Texels::Bytes(pixels, table),
        };
        let mut base = Level {
            width,
            height,
            texels,
        };
        if (w, h) != (width, height) {
            base = resampled(&base, w, h, wrap);
        }
        let mut levels = vec![base];
        while let Some(last) = levels.last()
            && (last.width > 1 || last.height > 1)
        {
            let (width, height) = ((last.width / 2).max(1), (last.height / 2).max(1));
            let mut smaller = Vec::with_capacity(width as usize * height as usize);
            for y in 0..height {
                for x in 0..width {
                    // Where one side is a single pixel already, what lies beyond it is the wrap's.
                    let at = |dx: u32, dy: u32| {
                        let (x, y) = (i64::from(2 * x + dx), i64::from(2 * y + dy));
                        last.at(wrap, x, i64::from(last.height) - 1 - y)
                    };
                    let sum = at(0, 0) + at(1, 0) + at(0, 1) + at(1, 1);
                    smaller.push((0.25 * sum).into());
                }
            }
            levels.push(Level {
                width,
                height,
                texels: Texels::Floats(smaller),
            });
        }
        Pyramid {
            original,
            wrap,
            levels,
        }
    }

    /// One white pixel.
    pub(crate) fn white() -> Self {
        Self::new(1, 1, vec![[1.0; 3]], Wrap::Repeat)
    }

    pub(crate) fn width(&self) -> u32 {
        self.original[0]
    }

    pub(crate) fn height(&self) -> u32 {
        self.original[1]
    }

    /// Width and height of the finest level.
    pub(crate) fn finest(&self) -> [u32; 2] {
        [self.levels[0].width, self.levels[0].height]
    }

    /// Of the finest level, rows from the top.
    pub(crate) fn pixel(&self, column: u32, row: u32) -> [f32; 3] {
        let level = &self.levels[0];
        level
            .at(
                Wrap::Clamp,
                column.into(),
                i64::from(level.height) - 1 - i64::from(row),
            )
            .into()
    }

    fn last(&self) -> usize {
        self.levels.len() - 1
    }

    /// The value at `st` over a square of edge `width`, both in multiples of the image; t = 0 is
    /// the lower edge.
    pub(crate) fn lookup(&self, st: Vec2, width: f32) -> Vec3 {
        let level = self.last() as f32 + width.max(1e-8).log2();
        // Not a number: where a derivative overflows.
        if level < 0.0 || level.is_nan() {
            self.levels[0].bilinear(self.wrap, st)
        } else if level >= self.last() as f32 {
            self.levels[self.last()].at(self.wrap, 0, 0)
        } else {
            let below = level.floor();
            let finer = self.levels[below as usize].bilinear(self.wrap, st);
            let coarser = self.levels[below as usize + 1].bilinear(self.wrap, st);
            finer.lerp(coarser, level - below)
        }
    }

    /// The value at `st` over the ellipse with half axes `d0` and `d1`, or its square.
    pub(crate) fn filtered(&self, filter: ImageFilter, st: Vec2, d0: Vec2, d1: Vec2) -> Vec3 {
        let max_anisotropy = match filter {
            ImageFilter::Trilinear => {
                let width = d0.abs().max_element().max(d1.abs().max_element());
                return self.lookup(st, width);
            }
            ImageFilter::Elliptic { max_anisotropy } => max_anisotropy,
        };
        let (major, mut minor) = if d0.length_squared() < d1.length_squared() {
            (d1, d0)
        } else {
            (d0, d1)
        };
        let (long, mut short) = (major.length(), minor.length());
        if short * max_anisotropy < long && short > 0.0 {
            let wider = long / (short * max_anisotropy);
            minor *= wider;
            short *= wider;
        }
        if short == 0.0 || !long.is_finite() {
            return self.levels[0].bilinear(self.wrap, st);
        }
        let level = (self.last() as f32 + short.log2()).max(0.0);
        let below = level.floor();
        let finer = self.ellipse(below as usize, st, major, minor);
        let coarser = self.ellipse(below as usize + 1, st, major, minor);
        finer.lerp(coarser, level - below)
    }

    /// The mean by a Gaussian over an ellipse [Heckbert1989, 3.5.9].
    fn ellipse(&self, level: usize, st: Vec2, d0: Vec2, d1: Vec2) -> Vec3 {
        let Some(level) = self.levels.get(level) else {
            return self.levels[self.last()].at(self.wrap, 0, 0);
        };
        let size = Vec2::new(level.width as f32, level.height as f32);
        let place = st * size - Vec2::splat(0.5);
        let (d0, d1) = (d0 * size, d1 * size);
        // A x² + B x y + C y² < 1 inside, at least a pixel wide.
        let a = d0.y * d0.y + d1.y * d1.y + 1.0;
        let b = -2.0 * (d0.x * d0.y + d1.x * d1.y);
        let c = d0.x * d0.x + d1.x * d1.x + 1.0;
        let inverse = 1.0 / (a * c - b * b * 0.25);
        let (a, b, c) = (a * inverse, b * inverse, c * inverse);
        let determinant = -b * b + 4.0 * a * c;
        let reach = 2.0 / determinant
            * Vec2::new(
                (determinant * c).max(0.0).sqrt(),
                (a * determinant).max(0.0).sqrt(),
            );
        if !reach.is_finite() || !place.is_finite() {
            return level.bilinear(self.wrap, st);
        }
        let weights = gaussian();
        let (low, high) = ((place - reach).ceil(), (place + reach).floor());
        let (mut sum, mut total) = (Vec3::ZERO, 0.0);
        for y in low.y as i64..=high.y as i64 {
            let dy = y as f32 - place.y;
            for x in low.x as i64..=high.x as i64 {
                let dx = x as f32 - place.x;
                let r2 = a * dx * dx + b * dx * dy + c * dy * dy;
                if r2 < 1.0 {
                    let weight = weights[((r2 * WEIGHTS as f32) as usize).min(WEIGHTS - 1)];
                    sum += level.at(self.wrap, x, y) * weight;
                    total += weight;
                }
            }
        }
        if total > 0.0 {
            sum / total
        } else {
            level.bilinear(self.wrap, st)
        }
    }
}

const WEIGHTS: usize = 128;

/// A Gaussian by the square of the distance, lowered to end at zero.
fn gaussian() -> &'static [f32; WEIGHTS] {
    static TABLE: OnceLock<[f32; WEIGHTS]> = OnceLock::new();
    TABLE.get_or_init(|| {
        const ALPHA: f32 = 2.0;
        std::array::from_fn(|i| {
            let r2 = i as f32 / (WEIGHTS - 1) as f32;
            (-ALPHA * r2).exp() - (-ALPHA).exp()
        })
    })
}

/// The level at another size, by a windowed sinc of four pixels a side.
fn resampled(level: &Level, width: u32, height: u32, wrap: Wrap) -> Level {
    let columns = resampling(level.width, width);
    let rows = resampling(level.height, height);
    let source = |wrap_size: u32, i: i64| -> Option<usize> {
        let size = i64::from(wrap_size);
        match wrap {
            Wrap::Repeat => Some(i.rem_euclid(size) as usize),
            Wrap::Clamp => Some(i.clamp(0, size - 1) as usize),
            Wrap::Black => (0..size).contains(&i).then_some(i as usize),
        }
    };
    let mut wide = Vec::with_capacity(width as usize * level.height as usize);
    for y in 0..level.height as usize {
        let row = y * level.width as usize;
        for (first, weights) in &columns {
            let mut sum = Vec3::ZERO;
            for (i, weight) in (*first..).zip(weights) {
                if let Some(x) = source(level.width, i) {
                    sum += level.texel(row + x) * *weight;
                }
            }
            wide.push(sum);
        }
    }
    let mut pixels = vec![[0.0; 3]; width as usize * height as usize];
    for (y, (first, weights)) in rows.iter().enumerate() {
        for x in 0..width as usize {
            let mut sum = Vec3::ZERO;
            for (i, weight) in (*first..).zip(weights) {
                if let Some(row) = source(level.height, i) {
                    sum += wide[row * width as usize + x] * *weight;
                }
            }
            pixels[y * width as usize + x] = sum.max(Vec3::ZERO).into();
        }
    }
    Level {
        width,
        height,
        texels: Texels::Floats(pixels),
    }
}

/// For each of `to` pixels the first of `from` pixels that it is made of, and the weights.
fn resampling(from: u32, to: u32) -> Vec<(i64, [f32; 4])> {
    const WIDTH: f32 = 2.0;
    (0..to)
        .map(|i| {
            let center = (i as f32 + 0.5) * from as f32 / to as f32;
            let first = ((center - WIDTH) + 0.5).floor();
            let mut weights: [f32; 4] =
                std::array::from_fn(|j| lanczos((first + j as f32 + 0.5 - center) / WIDTH));
            let sum: f32 = weights.iter().sum();
            weights = weights.map(|w| w / sum);
            (first as i64, weights)
        })
        .collect()
}

/// The sinc of two lobes, windowed by its first.
fn lanczos(x: f32) -> f32 {
    const TAU: f32 = 2.0;
    let x = x.abs();
    if x < 1e-5 {
        return 1.0;
    }
    if x > 1.0 {
        return 0.0;
    }
    let x = x * std::f32::consts::PI;
    let (s, window) = ((x * TAU).sin() / (x * TAU), x.sin() / x);
    s * window
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two columns, two rows; in the red channel 1 2 above 3 4.
    fn small(wrap: Wrap) -> Pyramid {
        let pixels = [1.0, 2.0, 3.0, 4.0].map(|r| [r, 0.0, 0.0]).to_vec();
        Pyramid::new(2, 2, pixels, wrap)
    }

    #[test]
    fn v_0_is_the_lower_edge_of_the_picture() {
        let at = |s, t| small(Wrap::Clamp).lookup(Vec2::new(s, t), 0.0).x;
        assert_eq!(at(0.25, 0.25), 3.0);
        assert_eq!(at(0.75, 0.25), 4.0);
        assert_eq!(at(0.25, 0.75), 1.0);
        assert_eq!(at(0.5, 0.5), 2.5);
    }

    #[test]
    fn each_wrap_has_its_own_outside() {
        let at = |wrap, s, t| small(wrap).lookup(Vec2::new(s, t), 0.0).x;
        assert_eq!(at(Wrap::Repeat, 1.25, -0.75), 3.0);
        assert_eq!(at(Wrap::Clamp, 5.0, -5.0), 4.0);
        assert_eq!(at(Wrap::Black, 5.0, 0.25), 0.0);
        assert_eq!(at(Wrap::Black, 0.0, 0.25), 1.5);
    }

    #[test]
    fn a_wide_lookup_is_the_mean_by_either_filter() {
        let pixels = (0..64 * 32).map(|i| [(i * 7 % 13) as f32; 3]).collect();
        let pyramid = Pyramid::new(64, 32, pixels, Wrap::Repeat);
        let mean = (0..64 * 32).map(|i| (i * 7 % 13) as f32).sum::<f32>() / (64.0 * 32.0);
        let wide = pyramid.lookup(Vec2::splat(0.3), 1.0).x;
        assert!((wide - mean).abs() < 1e-3, "{wide} {mean}");
        let (d0, d1) = (Vec2::new(1.5, 0.0), Vec2::new(0.0, 1.0));
        let elliptic = pyramid.filtered(ImageFilter::DEFAULT, Vec2::splat(0.3), d0, d1);
        assert!((elliptic.x - mean).abs() < 1e-3, "{elliptic} {mean}");
    }

    #[test]
    fn an_ellipse_averages_along_its_long_axis_only() {
        // Stripes that change with y: long in x, a footprint keeps them.
        let pixels = (0..64 * 64).map(|i| [(i / 64 % 2) as f32; 3]).collect();
        let pyramid = Pyramid::new(64, 64, pixels, Wrap::Repeat);
        let st = Vec2::new(0.5, 1.0 - 0.5 / 64.0);
        let along = Vec2::new(6.0 / 64.0, 0.0);
        let narrow = Vec2::new(0.0, 1e-3);
        let elliptic = pyramid.filtered(ImageFilter::DEFAULT, st, along, narrow).x;
        let square = pyramid
            .filtered(ImageFilter::Trilinear, st, along, narrow)
            .x;
        assert!(elliptic < 0.4, "{elliptic}");
        assert!((square - 0.5).abs() < 0.1, "{square}");
    }

    #[test]
    fn resampling_to_a_power_of_two_keeps_a_constant_and_a_slope() {
        let pixels = (0..100 * 3).map(|i| [(i % 100) as f32, 7.0, 0.0]).collect();
        let pyramid = Pyramid::new(100, 3, pixels, Wrap::Clamp);
        assert_eq!((pyramid.width(), pyramid.finest()), (100, [128, 4]));
        let at = |s: f32| pyramid.lookup(Vec2::new(s, 0.5), 0.0);
        assert!((at(0.5).y - 7.0).abs() < 1e-4);
        assert!((at(0.5).x - 49.5).abs() < 0.1, "{}", at(0.5));
    }
}
