//! Eight rays made ready for boxes at a time.

use bytemuck::Zeroable;
use glam::Vec3A;

use super::line::{self, Course, FrameRay, Line, ROWS};
use super::splats;
use crate::geometry::Ray;
use crate::query::simd::Lanes;
use crate::tree::wide::{WIDTH, Wide};

/// A number for each ray.
type Numbers = [f32; WIDTH];

/// What their [`Line`]s say, and their [`FrameRay`]s in the world.
pub(super) struct Ready {
    origin: [Numbers; 3],
    direction: [Numbers; 3],
    margin: Numbers,
    scale: Numbers,
    reach: Numbers,
    inverse: [Numbers; 3],
    offsets: [[Numbers; 3]; 2],
    /// A bit for each ray that may hit something.
    present: u32,
}

impl Ready {
    /// Of up to eight rays.
    #[inline(always)]
    pub(super) fn new<L: Lanes>(wide: &Wide, rays: &[Ray]) -> Self {
        match rays.try_into() {
            Ok(rays) => Ready::of_eight::<L>(wide, rays),
            Err(_) => {
                // These go nowhere.
                let mut eight = [Ray::zeroed(); WIDTH];
                eight[..rays.len()].copy_from_slice(rays);
                Ready::of_eight::<L>(wide, &eight)
            }
        }
    }

    #[inline(always)]
    fn of_eight<L: Lanes>(wide: &Wide, rays: &[Ray; WIDTH]) -> Self {
        let [ox, oy, oz, dx, dy, dz, t_min, t_max] = L::columns(bytemuck::cast_ref(rays));
        let [cx, cy, cz] = splats::<L>(wide.center);
        let (origin, direction) = ([ox.sub(cx), oy.sub(cy), oz.sub(cz)], [dx, dy, dz]);
        let [x, y, z] = origin;
        let reach = (x.abs().max(y.abs()).max(z.abs())).add(L::splat(wide.half_extent));
        let margin = line::margins(reach, wide);
        let (inverse_x, entry_x, exit_x) = line::slabs(x, dx, margin);
        let (inverse_y, entry_y, exit_y) = line::slabs(y, dy, margin);
        let (inverse_z, entry_z, exit_z) = line::slabs(z, dz, margin);
        let ordinary =
            line::are_ordinary(origin, direction) & line::are_near(reach) & t_min.lt(t_max);
        let mut ready = Ready {
            origin: [x.to_array(), y.to_array(), z.to_array()],
            direction: [dx.to_array(), dy.to_array(), dz.to_array()],
            margin: margin.to_array(),
            scale: [1.0; WIDTH],
            reach: reach.to_array(),
            inverse: [
                inverse_x.to_array(),
                inverse_y.to_array(),
                inverse_z.to_array(),
            ],
            offsets: [
                [entry_x.to_array(), entry_y.to_array(), entry_z.to_array()],
                [exit_x.to_array(), exit_y.to_array(), exit_z.to_array()],
            ],
            present: ordinary,
        };
        if ordinary != u32::MAX >> (32 - WIDTH) {
            ready.take_care(wide, rays);
        }
        ready
    }

    /// The other rays one by one.
    #[cold]
    fn take_care(&mut self, wide: &Wide, rays: &[Ray; WIDTH]) {
        for (i, ray) in rays.iter().enumerate() {
            if self.present >> i & 1 == 1 {
                continue;
            }
            let Some(line) = Line::new(wide, ray) else {
                continue;
            };
            let FrameRay {
                inverse, offsets, ..
            } = line.in_world();
            for axis in 0..3 {
                self.origin[axis][i] = line.origin[axis];
                self.direction[axis][i] = line.direction[axis];
                self.inverse[axis][i] = inverse[axis];
                self.offsets[0][axis][i] = offsets[0][axis];
                self.offsets[1][axis][i] = offsets[1][axis];
            }
            self.margin[i] = line.margin;
            self.scale[i] = line.scale;
            self.reach[i] = line.reach;
            self.present |= 1 << i;
        }
    }

    /// One of the rays; `None` if it hits nothing, whatever there is.
    #[inline(always)]
    pub(super) fn get(&self, i: usize) -> Option<Nth<'_>> {
        let nth = Nth {
            ready: self,
            i: i % WIDTH,
        };
        (self.present >> nth.i & 1 == 1).then_some(nth)
    }
}

/// One of eight rays.
#[derive(Clone, Copy)]
pub(super) struct Nth<'r> {
    ready: &'r Ready,
    i: usize,
}

impl Nth<'_> {
    #[inline(always)]
    fn of(self, [x, y, z]: &[Numbers; 3]) -> [f32; 3] {
        [x[self.i], y[self.i], z[self.i]]
    }
}

impl Course for Nth<'_> {
    #[inline(always)]
    fn line(&self) -> Line {
        Line {
            origin: self.of(&self.ready.origin).into(),
            direction: self.of(&self.ready.direction).into(),
            margin: self.ready.margin[self.i],
            scale: self.ready.scale[self.i],
            reach: self.ready.reach[self.i],
        }
    }

    #[inline(always)]
    fn in_world(&self) -> FrameRay {
        let [entry, exit] = &self.ready.offsets;
        let direction = Vec3A::from(self.of(&self.ready.direction));
        FrameRay {
            inverse: self.of(&self.ready.inverse),
            offsets: [self.of(entry), self.of(exit)],
            rows: &ROWS[direction.is_negative_bitmask() as usize & 7],
        }
    }
}
