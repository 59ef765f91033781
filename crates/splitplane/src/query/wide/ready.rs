//! Eight rays made ready for boxes at a time, and held against those of the root and of a child.

use std::hint::select_unpredictable;

use bytemuck::Zeroable;
use glam::Vec3A;

use super::line::{self, BoxTest, Course, FrameRay, Line, ROWS};
use super::{along, node, root, splats};
use crate::geometry::{Frame, Ray};
use crate::query::simd::{Eight, Lanes};
use crate::tree::wide::{WIDTH, Wide};

/// A number for each ray.
type Numbers = [f32; WIDTH];

/// What their [`Line`]s say, and their [`FrameRay`]s at the root.
pub(super) struct Ready {
    origin: [Numbers; 3],
    direction: [Numbers; 3],
    margin: Numbers,
    scale: Numbers,
    reach: Numbers,
    inverse: [Numbers; 3],
    offsets: [[Numbers; 3]; 2],
    t_min: Numbers,
    /// Not below the rays' `t_max`, in t of the traversal.
    limit: Numbers,
    /// A bit for each ray that may hit something.
    present: u32,
}

/// What each of eight rays meets of a node.
pub(super) struct Met {
    /// A bit for each ray that meets anything.
    pub(super) rays: u32,
    /// Per ray, a bit for each child that it meets.
    children: [u32; WIDTH],
    /// Per ray, where it enters the children's boxes.
    near: [Numbers; WIDTH],
}

impl Met {
    /// A bit for each child that one of the rays meets, and where their boxes are entered.
    #[inline(always)]
    pub(super) fn of<L: Eight>(&self, i: usize) -> (u32, L) {
        (self.children[i % WIDTH], L::load(&self.near[i % WIDTH]))
    }
}

impl Ready {
    /// Of up to eight rays.
    #[inline(always)]
    pub(super) fn new<L: Eight>(wide: &Wide, rays: &[Ray]) -> Self {
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
    fn of_eight<L: Eight>(wide: &Wide, rays: &[Ray; WIDTH]) -> Self {
        let [ox, oy, oz, dx, dy, dz, t_min, t_max] = L::columns(bytemuck::cast_ref(rays));
        let [cx, cy, cz] = splats::<L>(wide.center);
        let (origin, direction) = ([ox.sub(cx), oy.sub(cy), oz.sub(cz)], [dx, dy, dz]);
        let [x, y, z] = origin;
        let reach = (x.abs().max(y.abs()).max(z.abs())).add(L::splat(wide.half_extent));
        let margin = line::margins(reach, wide);
        let (from, to) = match root(wide).frame {
            Frame::WORLD => (origin, direction),
            frame => {
                let frame = &wide.frames[frame as usize];
                (turned(origin, frame), turned(direction, frame))
            }
        };
        let (inverse_x, entry_x, exit_x) = line::slabs(from[0], to[0], margin);
        let (inverse_y, entry_y, exit_y) = line::slabs(from[1], to[1], margin);
        let (inverse_z, entry_z, exit_z) = line::slabs(from[2], to[2], margin);
        let ordinary =
            line::are_ordinary(origin, direction) & line::are_near(reach) & t_min.lt(t_max);
        let tiny = L::splat(f32::MIN_POSITIVE);
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
            t_min: t_min.sub(tiny).to_array(),
            limit: t_max.add(tiny).to_array(),
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
            } = line.at_root(wide);
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
            self.t_min[i] = line.t_min;
            self.limit[i] = line.t_above(ray.t_max);
            self.present |= 1 << i;
        }
    }

    /// What the rays meet of the root.
    #[inline(always)]
    pub(super) fn meet_root<L: Eight>(&self, wide: &Wide) -> Met {
        self.meet::<L>(wide, [0; WIDTH])
    }

    /// The child of the root that a ray in no order of nearness visits first, and what it meets of
    /// that; where the child is a leaf or in another frame, the root, of which nobody asks.
    #[inline(always)]
    pub(super) fn meet_first<L: Eight>(&self, wide: &Wide, at_root: &Met) -> ([usize; WIDTH], Met) {
        let root = root(wide);
        let nodes = std::array::from_fn(|i| {
            let first = at_root.children[i].trailing_zeros() as usize;
            let index = root.children[first % WIDTH].node_or_root();
            let same = node(wide, index).frame == root.frame;
            select_unpredictable(same, index, 0)
        });
        (nodes, self.meet::<L>(wide, nodes))
    }

    /// What each ray meets of a node in the frame of the root. Nothing has to be foreseen for that,
    /// and no ray waits for another.
    #[inline(always)]
    fn meet<L: Eight>(&self, wide: &Wide, nodes: [usize; WIDTH]) -> Met {
        let mut all = Met {
            rays: 0,
            children: [0; WIDTH],
            near: [[0.0; WIDTH]; WIDTH],
        };
        for (i, &index) in nodes.iter().enumerate() {
            let (t_min, limit) = (L::splat(self.t_min[i]), L::splat(self.limit[i]));
            let test = BoxTest::<L>::new(&self.get(i).at_root(wide));
            let (met, near) = test.meet(node(wide, index), t_min, limit);
            all.children[i] = met;
            all.near[i] = near.to_array();
            all.rays |= u32::from(met != 0) << i;
        }
        all.rays &= self.present;
        all
    }

    #[inline(always)]
    pub(super) fn get(&self, i: usize) -> Nth<'_> {
        Nth {
            ready: self,
            i: i % WIDTH,
        }
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
            t_min: self.ready.t_min[self.i],
        }
    }

    #[inline(always)]
    fn at_root(&self, _: &Wide) -> FrameRay {
        let [entry, exit] = &self.ready.offsets;
        let inverse = Vec3A::from(self.of(&self.ready.inverse));
        FrameRay {
            inverse,
            offsets: [self.of(entry).into(), self.of(exit).into()],
            rows: &ROWS[inverse.is_negative_bitmask() as usize & 7],
        }
    }
}

/// A point or a direction for each lane, in a frame.
#[inline(always)]
fn turned<L: Lanes>(v: [L; 3], frame: &Frame) -> [L; 3] {
    let [x, y, z] = frame.rows;
    [
        along(splats(x), v),
        along(splats(y), v),
        along(splats(z), v),
    ]
}
