//! Where samples become pixels [PBRT3, 7.9].

use glam::{Vec2, Vec3};

use super::RenderError;
use super::filter::{self, FilterTable};
use super::sampling::luminance;
use crate::scene::settings::{Film, Filter};

/// Pixels `min <= p < max` of the full picture; those that are sampled may lie outside of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Window {
    pub(super) min: [i32; 2],
    pub(super) max: [i32; 2],
}

impl Window {
    pub(super) fn width(&self) -> usize {
        (self.max[0] - self.min[0]).max(0) as usize
    }

    pub(super) fn height(&self) -> usize {
        (self.max[1] - self.min[1]).max(0) as usize
    }

    pub(super) fn pixels(&self) -> usize {
        self.width() * self.height()
    }

    pub(super) fn intersection(&self, other: &Window) -> Window {
        Window {
            min: std::array::from_fn(|i| self.min[i].max(other.min[i])),
            max: std::array::from_fn(|i| self.max[i].min(other.max[i])),
        }
    }

    /// The place of a pixel, row by row; `None` outside.
    pub(super) fn index(&self, x: i32, y: i32) -> Option<usize> {
        let inside = |c: i32, axis: usize| self.min[axis] <= c && c < self.max[axis];
        (inside(x, 0) && inside(y, 1))
            .then(|| (y - self.min[1]) as usize * self.width() + (x - self.min[0]) as usize)
    }

    /// Square parts with this edge, row by row; those at the end may be smaller.
    pub(super) fn tiles(&self, edge: i32) -> Vec<Window> {
        let starts = |axis: usize| (self.min[axis]..self.max[axis]).step_by(edge as usize);
        starts(1)
            .flat_map(|y| starts(0).map(move |x| [x, y]))
            .map(|min| {
                Window {
                    min,
                    max: min.map(|c| c + edge),
                }
                .intersection(self)
            })
            .collect()
    }
}

/// The size of a picture, what of it is rendered, and how samples are weighted.
pub(super) struct FilmPlan {
    pub(super) crop: Window,
    pub(super) filter: FilterTable,
    scale: f32,
    max_sample_luminance: f32,
}

/// Pixels count in i32 with room for filters around them.
const MAX_EDGE: u32 = 1 << 20;
const MAX_PIXELS: usize = 1 << 28;

impl FilmPlan {
    pub(super) fn new(film: &Film, filter: &Filter) -> Result<Self, RenderError> {
        let full = [film.width, film.height];
        if full.iter().any(|&edge| !(1..=MAX_EDGE).contains(&edge)) {
            return Err(RenderError::OutOfRange {
                what: "the resolution",
                value: format!("{} x {}", full[0], full[1]),
                accepted: "1 to 1048576 pixels a side are accepted",
            });
        }
        let [x0, x1, y0, y1] = film.crop;
        let fractions = 0.0..=1.0;
        if !film.crop.iter().all(|c| fractions.contains(c)) || x0 >= x1 || y0 >= y1 {
            return Err(RenderError::OutOfRange {
                what: "the crop window",
                value: format!("{x0} {x1} {y0} {y1}"),
                accepted: "x_min < x_max and y_min < y_max, all from 0 to 1, are accepted",
            });
        }
        let pixel = |fraction: f32, axis: usize| (full[axis] as f32 * fraction).ceil() as i32;
        let crop = Window {
            min: [pixel(x0, 0), pixel(y0, 1)],
            max: [pixel(x1, 0), pixel(y1, 1)],
        };
        if !(1..=MAX_PIXELS).contains(&crop.pixels()) {
            return Err(RenderError::OutOfRange {
                what: "the part to render",
                value: format!("{} x {} pixels", crop.width(), crop.height()),
                accepted: "1 to 268435456 pixels in all are accepted",
            });
        }
        let radius = filter::radius(filter);
        if !radius.iter().all(|r| *r > 0.0 && *r <= Filter::MAX_RADIUS) {
            return Err(RenderError::OutOfRange {
                what: "the filter's radius",
                value: format!("{} {}", radius[0], radius[1]),
                accepted: "numbers above 0 and at most 64 pixels are accepted",
            });
        }
        Ok(FilmPlan {
            crop,
            filter: FilterTable::new(filter),
            scale: film.scale,
            max_sample_luminance: film.max_sample_luminance,
        })
    }

    /// The pixels to sample: all whose samples count in a pixel of the picture.
    pub(super) fn samples(&self) -> Window {
        let r = self.filter.radius;
        Window {
            min: std::array::from_fn(|i| (self.crop.min[i] as f32 + 0.5 - r[i]).floor() as i32),
            max: std::array::from_fn(|i| (self.crop.max[i] as f32 - 0.5 + r[i]).ceil() as i32),
        }
    }

    /// The pixels that samples within `tile` may reach.
    pub(super) fn reach(&self, tile: &Window) -> Window {
        let r = self.filter.radius;
        Window {
            min: std::array::from_fn(|i| (tile.min[i] as f32 - 0.5 - r[i]).ceil() as i32),
            max: std::array::from_fn(|i| (tile.max[i] as f32 - 0.5 + r[i]).floor() as i32 + 1),
        }
        .intersection(&self.crop)
    }
}

/// The weighted samples of some pixels.
pub(super) struct FilmTile {
    pub(super) window: Window,
    /// Sum of weight times radiance, and sum of weights.
    sums: Vec<(Vec3, f32)>,
}

impl FilmTile {
    pub(super) fn new(window: Window) -> Self {
        FilmTile {
            window,
            sums: vec![(Vec3::ZERO, 0.0); window.pixels()],
        }
    }

    /// The sums of all pixels: of weight times radiance, and of weights.
    pub(super) fn sums(&self) -> &[(Vec3, f32)] {
        &self.sums
    }

    /// Goes on from sums of as many pixels; other sums are ignored.
    pub(super) fn set_sums(&mut self, sums: Vec<(Vec3, f32)>) {
        if sums.len() == self.sums.len() {
            self.sums = sums;
        }
    }

    /// Adds a sample at `place` (in pixels) to all pixels within the filter's radius.
    pub(super) fn add(&mut self, plan: &FilmPlan, place: Vec2, mut radiance: Vec3) {
        let y = luminance(radiance);
        if y > plan.max_sample_luminance {
            radiance *= plan.max_sample_luminance / y;
        }
        // Pixel centres are at integers here.
        let place = place - Vec2::splat(0.5);
        let radius = plan.filter.radius;
        let low = (place - radius)
            .ceil()
            .as_ivec2()
            .max(self.window.min.into());
        let high = (place + radius).floor().as_ivec2() + glam::IVec2::ONE;
        let high = high.min(self.window.max.into());
        for y in low.y..high.y {
            let row = plan.filter.cell(y as f32 - place.y, 1);
            let start = (y - self.window.min[1]) as usize * self.window.width();
            for x in low.x..high.x {
                let weight = plan
                    .filter
                    .weight(plan.filter.cell(x as f32 - place.x, 0), row);
                let sum = &mut self.sums[start + (x - self.window.min[0]) as usize];
                sum.0 += radiance * weight;
                sum.1 += weight;
            }
        }
    }

    /// Adds another tile's sums; pixels outside of this tile are not expected.
    pub(super) fn merge(&mut self, tile: &FilmTile) {
        let width = tile.window.width();
        for (y, row) in (tile.window.min[1]..).zip(tile.sums.chunks(width.max(1))) {
            if let Some(start) = self.window.index(tile.window.min[0], y) {
                for (sum, added) in self.sums[start..start + width].iter_mut().zip(row) {
                    sum.0 += added.0;
                    sum.1 += added.1;
                }
            }
        }
    }

    /// The picture: weighted means, never negative.
    pub(super) fn develop(&self, plan: &FilmPlan) -> Vec<[f32; 3]> {
        let pixel = |&(sum, weight): &(Vec3, f32)| {
            let mean = if weight == 0.0 {
                sum
            } else {
                (sum / weight).max(Vec3::ZERO)
            };
            (mean * plan.scale).into()
        };
        self.sums.iter().map(pixel).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn film(width: u32, height: u32, crop: [f32; 4]) -> Film {
        Film {
            width,
            height,
            crop,
            scale: 1.0,
            max_sample_luminance: f32::INFINITY,
        }
    }

    const ALL: [f32; 4] = [0.0, 1.0, 0.0, 1.0];
    const BOX: Filter = Filter::Box { radius: [0.5, 0.5] };

    #[test]
    fn a_box_of_one_pixel_samples_just_the_crop() {
        let plan = FilmPlan::new(&film(1000, 1000, [0.3, 0.5, 0.4, 0.8]), &BOX).unwrap();
        assert_eq!(
            plan.crop,
            Window {
                min: [300, 400],
                max: [500, 800]
            }
        );
        assert_eq!(plan.samples(), plan.crop);
    }

    #[test]
    fn a_wide_filter_samples_around_the_crop() {
        let filter = Filter::Gaussian {
            radius: [2.0, 1.5],
            alpha: 2.0,
        };
        let plan = FilmPlan::new(&film(10, 10, ALL), &filter).unwrap();
        assert_eq!(
            plan.samples(),
            Window {
                min: [-2, -1],
                max: [12, 11]
            }
        );
        let tile = Window {
            min: [4, 4],
            max: [6, 6],
        };
        assert_eq!(
            plan.reach(&tile),
            Window {
                min: [2, 2],
                max: [8, 8]
            }
        );
    }

    #[test]
    fn tiles_cover_a_window_once() {
        let window = Window {
            min: [-2, 3],
            max: [37, 50],
        };
        let mut seen = vec![0; window.pixels()];
        for tile in window.tiles(16) {
            for y in tile.min[1]..tile.max[1] {
                for x in tile.min[0]..tile.max[0] {
                    seen[window.index(x, y).unwrap()] += 1;
                }
            }
        }
        assert!(seen.iter().all(|&n| n == 1));
    }

    #[test]
    fn pixels_are_means_by_weight() {
        let filter = Filter::Triangle { radius: [2.0, 2.0] };
        let plan = FilmPlan::new(&film(8, 8, ALL), &filter).unwrap();
        let mut tile = FilmTile::new(plan.crop);
        tile.add(&plan, Vec2::new(3.5, 3.5), Vec3::ONE);
        tile.add(&plan, Vec2::new(4.5, 3.5), Vec3::ZERO);
        let picture = tile.develop(&plan);
        let at = |x: usize, y: usize| picture[y * 8 + x][0];
        // Over pixel 3: weights of distance 0 and 1 pixel, from the table's cells 0 and 8.
        let (near, far) = (2.0 - 1.0 / 16.0, 2.0 - 17.0 / 16.0);
        assert!((at(3, 3) - near / (near + far)).abs() < 1e-6);
        assert!((at(4, 3) - far / (near + far)).abs() < 1e-6);
        assert_eq!((at(0, 0), at(7, 7)), (0.0, 0.0));
    }

    #[test]
    fn tiles_merge_to_what_one_film_gives() {
        let filter = Filter::Gaussian {
            radius: [1.5, 2.0],
            alpha: 1.0,
        };
        let plan = FilmPlan::new(&film(40, 20, ALL), &filter).unwrap();
        let mut whole = FilmTile::new(plan.crop);
        let mut merged = FilmTile::new(plan.crop);
        for tile in plan.samples().tiles(16) {
            let mut part = FilmTile::new(plan.reach(&tile));
            for y in tile.min[1]..tile.max[1] {
                for x in tile.min[0]..tile.max[0] {
                    let place = Vec2::new(x as f32 + 0.25, y as f32 + 0.75);
                    let value = Vec3::splat((x * 7 + y) as f32);
                    part.add(&plan, place, value);
                    whole.add(&plan, place, value);
                }
            }
            merged.merge(&part);
        }
        for (a, b) in whole.develop(&plan).iter().zip(merged.develop(&plan)) {
            assert!((a[0] - b[0]).abs() <= 1e-4 * b[0].abs().max(1.0));
        }
    }

    #[test]
    fn bright_samples_are_scaled_down_to_the_limit() {
        let limited = Film {
            max_sample_luminance: 2.0,
            scale: 3.0,
            ..film(1, 1, ALL)
        };
        let plan = FilmPlan::new(&limited, &BOX).unwrap();
        let mut tile = FilmTile::new(plan.crop);
        tile.add(&plan, Vec2::new(0.5, 0.5), Vec3::splat(10.0));
        assert!((tile.develop(&plan)[0][1] - 6.0).abs() < 1e-4);
    }

    #[test]
    fn films_without_pixels_are_refused() {
        let refused = |f: &Film, filter: &Filter| FilmPlan::new(f, filter).is_err();
        assert!(refused(&film(0, 5, ALL), &BOX));
        assert!(refused(&film(5, 5, [0.5, 0.5, 0.0, 1.0]), &BOX));
        assert!(refused(&film(5, 5, [0.0, f32::NAN, 0.0, 1.0]), &BOX));
        assert!(refused(&film(5, 5, [0.81, 0.82, 0.0, 1.0]), &BOX));
        assert!(refused(&film(1 << 20, 1 << 20, ALL), &BOX));
        assert!(refused(
            &film(5, 5, ALL),
            &Filter::Box { radius: [0.0, 1.0] }
        ));
    }
}
