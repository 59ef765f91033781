//! Meshes that rays are lost on.

use rand::RngExt;
use rand_pcg::Pcg32;
use splitplane::Mesh;

/// Positions and triangles, to be put together.
#[derive(Default)]
pub(super) struct Parts {
    positions: Vec<[f32; 3]>,
    triangles: Vec<[u32; 3]>,
}

impl Parts {
    fn add(mut self, other: Parts) -> Parts {
        let base = self.positions.len() as u32;
        self.positions.extend(other.positions);
        let shifted = other.triangles.iter().map(|t| t.map(|i| base + i));
        self.triangles.extend(shifted);
        self
    }

    /// All positions, moved by a function.
    pub(super) fn moved(mut self, by: impl Fn([f32; 3]) -> [f32; 3]) -> Parts {
        self.positions.iter_mut().for_each(|p| *p = by(*p));
        self
    }

    /// The mesh; an empty one should there be too many triangles, which there are not.
    pub(super) fn mesh(self) -> Mesh {
        Mesh::new(self.positions, self.triangles)
            .or_else(|_| Mesh::new(Vec::new(), Vec::new()))
            .unwrap_or_else(|_| unreachable!("a mesh without triangles has no wrong index"))
    }
}

/// A closed sphere of unit radius, of rings and twice as many segments.
pub(super) fn sphere(rings: u32) -> Parts {
    let segments = 2 * rings;
    let mut positions = vec![[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]];
    for ring in 1..rings {
        let polar = std::f32::consts::PI * ring as f32 / rings as f32;
        for segment in 0..segments {
            let azimuth = std::f32::consts::TAU * segment as f32 / segments as f32;
            let (x, y) = (polar.sin() * azimuth.cos(), polar.sin() * azimuth.sin());
            positions.push([x, y, polar.cos()]);
        }
    }
    let at = |ring: u32, segment: u32| 2 + (ring - 1) * segments + segment % segments;
    let mut triangles = Vec::new();
    for segment in 0..segments {
        triangles.push([0, at(1, segment), at(1, segment + 1)]);
        triangles.push([1, at(rings - 1, segment + 1), at(rings - 1, segment)]);
        for ring in 1..rings - 1 {
            let (a, b) = (at(ring, segment), at(ring, segment + 1));
            let (c, d) = (at(ring + 1, segment), at(ring + 1, segment + 1));
            triangles.extend([[a, c, d], [a, d, b]]);
        }
    }
    Parts {
        positions,
        triangles,
    }
}

/// A closed surface that can be seen whole from the origin: a sphere with dents and bumps, turned.
pub(super) fn stone() -> Parts {
    sphere(12).moved(|[x, y, z]| {
        let radius = 1.0 + 0.3 * (7.0 * x + 3.0 * y).sin() * (5.0 * z + 1.0).cos();
        turned([radius * x, radius * y, radius * z])
    })
}

/// A sheet of squares in the plane z = 0, from -1 to 1.
pub(super) fn sheet(side: u32) -> Parts {
    let place = |i: u32| 2.0 * i as f32 / side as f32 - 1.0;
    let positions = (0..=side)
        .flat_map(|y| (0..=side).map(move |x| [place(x), place(y), 0.0]))
        .collect();
    let at = |x: u32, y: u32| y * (side + 1) + x;
    let triangles = (0..side)
        .flat_map(|y| (0..side).map(move |x| (x, y)))
        .flat_map(|(x, y)| {
            let (a, b, c, d) = (at(x, y), at(x + 1, y), at(x, y + 1), at(x + 1, y + 1));
            [[a, b, d], [a, d, c]]
        })
        .collect();
    Parts {
        positions,
        triangles,
    }
}

/// By an angle about a skew axis.
fn turned([x, y, z]: [f32; 3]) -> [f32; 3] {
    let (sin, cos) = 0.6f32.sin_cos();
    let (x, y) = (cos * x - sin * y, sin * x + cos * y);
    [x, cos * y - sin * z, sin * y + cos * z]
}

/// Triangles that touch, cross and cover each other: a soup of large and thin ones, sheets along
/// the axes and turned, the same triangles twice.
pub(super) fn jumble() -> Parts {
    let mut random = Pcg32::new(5, 0);
    let mut soup = Parts::default();
    for i in 0..120 {
        let center: [f32; 3] = std::array::from_fn(|_| 2.0 * random.random::<f32>() - 1.0);
        let size = if i % 3 == 0 { 0.02 } else { 0.6 };
        for corner in 0..3 {
            let size = if corner == 2 { 0.6 } else { size };
            soup.positions
                .push(center.map(|c| c + size * (random.random::<f32>() - 0.5)));
        }
        soup.triangles.push([3 * i, 3 * i + 1, 3 * i + 2]);
    }
    let twice = Parts {
        positions: soup.positions[..60].to_vec(),
        triangles: soup.triangles[..20].to_vec(),
    };
    soup.add(twice)
        .add(sheet(6).moved(|[x, y, _]| [x, y, -0.25]))
        .add(sheet(5).moved(|[x, y, z]| [z + 0.5, x, y]))
        .add(sheet(6).moved(turned))
        .add(sphere(5).moved(|p| turned(p).map(|c| 0.4 * c)))
}
