//! Light from all directions, sampled by how bright it is [PBRT3, 12.6 and 14.2.4].

use glam::{Mat3, Vec2, Vec3};

use super::sampling::luminance;
use crate::scene::light::SphereMap;
use crate::scene::texture::Image;

/// An infinite light.
pub(super) struct Environment<'s> {
    radiance: Vec3,
    map: Option<&'s Image>,
    sphere: SphereMap,
    to_world: Mat3,
    to_light: Mat3,
    distribution: Plane,
}

impl<'s> Environment<'s> {
    pub(super) fn new(
        radiance: Vec3,
        map: Option<&'s Image>,
        sphere: SphereMap,
        to_world: Mat3,
        to_light: Mat3,
    ) -> Self {
        let [width, height] = map.map_or([1, 1], |map| map.pyramid().finest());
        let (width, height) = (2 * width as usize, 2 * height as usize);
        let blur = 0.5 / width.min(height) as f32;
        let mut environment = Environment {
            radiance,
            map,
            sphere,
            to_world,
            to_light,
            distribution: Plane::default(),
        };
        let mut weights = Vec::with_capacity(width * height);
        for y in 0..height {
            let v = (y as f32 + 0.5) / height as f32;
            for x in 0..width {
                let place = Vec2::new((x as f32 + 0.5) / width as f32, v);
                let (_, solid_angle) = sphere.direction(place);
                weights.push(luminance(environment.texel(place, blur)) * solid_angle);
            }
        }
        environment.distribution = Plane::new(&weights, width);
        environment
    }

    /// `uv`: from the left and from the top, from 0 to 1.
    fn texel(&self, uv: Vec2, width: f32) -> Vec3 {
        self.map.map_or(self.radiance, |map| {
            self.radiance * map.pyramid().lookup(Vec2::new(uv.x, 1.0 - uv.y), width)
        })
    }

    fn place(&self, w: Vec3) -> Vec2 {
        self.sphere.place((self.to_light * w).normalize_or_zero())
    }

    /// What comes from the direction `w`.
    pub(super) fn radiance(&self, w: Vec3) -> Vec3 {
        if self.map.is_none() {
            return self.radiance;
        }
        self.texel(self.place(w), 0.0)
    }

    /// The mean over the map.
    pub(super) fn mean(&self) -> Vec3 {
        self.texel(Vec2::splat(0.5), 0.5)
    }

    /// A direction, what comes from it, and its density in solid angle.
    pub(super) fn sample(&self, u: Vec2) -> Option<(Vec3, Vec3, f32)> {
        let (uv, density) = self.distribution.sample(u);
        let (wi, solid_angle) = self.sphere.direction(uv);
        (density > 0.0 && solid_angle > 0.0).then(|| {
            (
                self.to_world * wi,
                self.texel(uv, 0.0),
                density / solid_angle,
            )
        })
    }

    /// The density with which [`Environment::sample`] draws `w`.
    pub(super) fn pdf(&self, w: Vec3) -> f32 {
        let place = self.place(w);
        let (_, solid_angle) = self.sphere.direction(place);
        if solid_angle == 0.0 {
            return 0.0;
        }
        self.distribution.density(place) / solid_angle
    }
}

/// A density over the unit interval that is constant in each of equal parts.
#[derive(Clone, Debug, Default)]
struct Line {
    /// `cumulative[i]`: probability of all before i; one more than parts.
    cumulative: Vec<f32>,
    density: Vec<f32>,
    mean: f32,
}

impl Line {
    fn new(weights: &[f32]) -> Self {
        let n = weights.len() as f32;
        let mut cumulative = vec![0.0];
        let mut sum = 0.0;
        for weight in weights {
            sum += weight / n;
            cumulative.push(sum);
        }
        if sum > 0.0 && sum.is_finite() {
            cumulative.iter_mut().for_each(|c| *c /= sum);
        } else {
            for (i, c) in cumulative.iter_mut().enumerate() {
                *c = i as f32 / n;
            }
        }
        let density = weights
            .iter()
            .map(|weight| if sum > 0.0 { weight / sum } else { 0.0 })
            .collect();
        Line {
            cumulative,
            density,
            mean: sum,
        }
    }

    /// A place, its density, and which part it lies in.
    fn sample(&self, u: f32) -> (f32, f32, usize) {
        let count = self.density.len();
        let i = self.cumulative.partition_point(|&c| c <= u);
        let i = i.saturating_sub(1).min(count - 1);
        let (low, high) = (self.cumulative[i], self.cumulative[i + 1]);
        let part = if high > low {
            (u - low) / (high - low)
        } else {
            u - low
        };
        ((i as f32 + part) / count as f32, self.density[i], i)
    }
}

/// A density over the unit square: of rows, and within each.
#[derive(Clone, Debug, Default)]
struct Plane {
    rows: Vec<Line>,
    of_rows: Line,
}

impl Plane {
    fn new(weights: &[f32], width: usize) -> Self {
        let usable: Vec<f32> = weights
            .iter()
            .map(|&w| if w.is_finite() { w.max(0.0) } else { 0.0 })
            .collect();
        let rows: Vec<Line> = usable.chunks(width.max(1)).map(Line::new).collect();
        let of_rows = Line::new(&rows.iter().map(|row| row.mean).collect::<Vec<_>>());
        Plane { rows, of_rows }
    }

    fn sample(&self, u: Vec2) -> (Vec2, f32) {
        let (y, row_density, row) = self.of_rows.sample(u.y);
        let (x, density, _) = self.rows[row].sample(u.x);
        (Vec2::new(x, y), row_density * density)
    }

    fn density(&self, p: Vec2) -> f32 {
        let part = |x: f32, count: usize| ((x * count as f32) as usize).min(count - 1);
        let row = part(p.y, self.rows.len());
        let line = &self.rows[row];
        self.of_rows.density[row] * line.density[part(p.x, line.density.len())]
    }
}

#[cfg(test)]
mod tests {
    use std::f32::consts::PI;

    use super::*;
    use crate::scene::texture::Wrap;

    fn pixels(count: u32) -> Vec<[f32; 3]> {
        (0..count)
            .map(|i| [if i == 200 { 50.0 } else { (i % 7) as f32 }; 3])
            .collect()
    }

    fn map() -> Image {
        Image::new(32, 16, pixels(32 * 16), Wrap::Repeat)
    }

    fn turned() -> Mat3 {
        Mat3::from_rotation_x(1.0) * Mat3::from_rotation_z(0.3)
    }

    #[test]
    fn densities_integrate_to_one_and_are_those_of_samples() {
        let image = map();
        let square = Image::new(16, 16, pixels(16 * 16), Wrap::Clamp);
        for (map, sphere) in [
            (None, SphereMap::LongitudeLatitude),
            (Some(&image), SphereMap::LongitudeLatitude),
            (Some(&square), SphereMap::EqualArea),
        ] {
            let light = Environment::new(Vec3::ONE, map, sphere, turned(), turned().transpose());
            let (n, mut sum) = (1000, 0.0);
            for i in 0..n {
                let theta = PI * (i as f32 + 0.5) / n as f32;
                for j in 0..n {
                    let phi = 2.0 * PI * (j as f32 + 0.5) / n as f32;
                    let (sin, cos) = theta.sin_cos();
                    let w = turned() * Vec3::new(sin * phi.cos(), sin * phi.sin(), cos);
                    sum += f64::from(light.pdf(w) * sin);
                }
            }
            sum *= f64::from(2.0 * PI * PI) / f64::from(n * n);
            assert!((sum - 1.0).abs() < 2e-3, "{sum}");
            for i in 0..100 {
                let u = Vec2::new(
                    (i as f32 + 0.31) / 100.0,
                    (i * 37 % 100) as f32 / 100.0 + 3e-3,
                );
                if let Some((w, radiance, pdf)) = light.sample(u) {
                    assert!((light.pdf(w) / pdf - 1.0).abs() < 2e-2, "{u}: {pdf}");
                    assert!((light.radiance(w) - radiance).abs().max_element() < 0.05);
                }
            }
        }
    }

    #[test]
    fn bright_places_are_sampled_in_proportion() {
        let image = map();
        let sphere = SphereMap::LongitudeLatitude;
        let light = Environment::new(
            Vec3::ONE,
            Some(&image),
            sphere,
            Mat3::IDENTITY,
            Mat3::IDENTITY,
        );
        // Radiance over density is nearly the same everywhere, but for the blur.
        let (mut estimate, n) = (0.0, 64);
        for i in 0..n * n {
            let u = Vec2::new((i % n) as f32 + 0.5, (i / n) as f32 + 0.5) / n as f32;
            if let Some((_, radiance, pdf)) = light.sample(u) {
                estimate += f64::from(radiance.x / pdf) / f64::from(n * n);
            }
        }
        let mut exact = 0.0;
        for y in 0..256 {
            let theta = PI * (y as f32 + 0.5) / 256.0;
            for x in 0..512 {
                let uv = Vec2::new((x as f32 + 0.5) / 512.0, theta / PI);
                exact += f64::from(light.texel(uv, 0.0).x * theta.sin());
            }
        }
        exact *= f64::from(2.0 * PI * PI) / (512.0 * 256.0);
        assert!((estimate / exact - 1.0).abs() < 0.02, "{estimate} {exact}");
    }
}
