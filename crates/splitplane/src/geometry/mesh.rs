use std::collections::HashMap;
use std::sync::Arc;

use super::{Aabb, Ray};

/// Triangles in space. Cloning is cheap: clones share the same memory.
///
/// Triangles keep their index for good, whether or not they can be hit: an index in a
/// [`Hit`](crate::Hit) is an index into the `triangles` that were given.
#[derive(Clone, Debug)]
pub struct Mesh(Arc<Data>);

#[derive(Debug)]
struct Data {
    positions: Vec<[f32; 3]>,
    triangles: Vec<[u32; 3]>,
    /// The triangles that can be hit, in order.
    usable: Vec<u32>,
    bounds: Aabb,
    largest_triangle: f32,
    skipped: Skipped,
    /// Where (0, 0, 0) of the positions is in space.
    origin: [f64; 3],
}

/// How many triangles can never be hit and are left out of every tree, and why.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Skipped {
    /// Triangles with a vertex that is NaN or infinite, or so large (beyond ±1e18) that products
    /// of coordinates overflow.
    pub not_finite: usize,
    /// Triangles whose three vertices lie on one line or in one point (zero area).
    pub degenerate: usize,
}

impl Skipped {
    /// All skipped triangles.
    pub fn total(&self) -> usize {
        self.not_finite + self.degenerate
    }
}

/// Why a mesh could not be made.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum MeshError {
    /// A triangle names a vertex that does not exist.
    #[error(
        "triangle {triangle} names vertex {index}, but there are {positions} vertices (0 to {})",
        positions.saturating_sub(1)
    )]
    IndexOutOfRange {
        /// The triangle's index.
        triangle: usize,
        /// The vertex that it names.
        index: u32,
        /// How many vertices there are.
        positions: usize,
    },
    /// More triangles or vertices than 32-bit indices can name.
    #[error("{count} {what}; at most {limit} can be indexed", limit = Mesh::MAX_COUNT)]
    TooMany {
        /// "triangles" or "vertices".
        what: &'static str,
        /// How many were given.
        count: usize,
    },
}

impl Mesh {
    /// The most triangles, and the most vertices, that a mesh may have.
    pub const MAX_COUNT: usize = (u32::MAX - 1) as usize;

    /// The largest coordinate that a usable triangle may have: products of three such numbers stay
    /// finite in f64, products of two in f32.
    pub(crate) const MAX_COORDINATE: f32 = 1e18;

    /// A mesh of `triangles`, each three indices into `positions` (in scene units).
    ///
    /// Triangles that are not finite or have no area stay in the list but are never hit; see
    /// [`Mesh::skipped`].
    ///
    /// # Errors
    /// An index out of range, or more than [`Mesh::MAX_COUNT`] triangles or vertices.
    pub fn new(positions: Vec<[f32; 3]>, triangles: Vec<[u32; 3]>) -> Result<Self, MeshError> {
        Mesh::at([0.0; 3], positions, triangles)
    }

    /// A mesh of f64 positions (in scene units), kept as f32 from the [`Mesh::origin`] that is
    /// chosen for it: (0, 0, 0) where every coordinate is an f32 anyway, so that nothing is
    /// rounded, and else the centre of the box around the positions.
    ///
    /// Then each coordinate is off by at most 2⁻²⁵ of the box's longest edge (0.03 mm over 1 km),
    /// however far from (0, 0, 0) the mesh lies; f64 rounds it by 2⁻⁵³ of itself before that.
    /// Queries take and give positions from the mesh's origin: make rays with [`Mesh::ray`].
    ///
    /// ```
    /// # use splitplane::{Mesh, Tree};
    /// let (x, y) = (458_317.25, 5_427_901.125);
    /// let positions = [[x, y, 0.1], [x + 1.0, y, 0.1], [x, y + 1.0, 0.1]];
    /// let mesh = Mesh::from_f64(&positions, vec![[0, 1, 2]])?;
    /// let ray = mesh.ray([x + 0.25, y + 0.25, 7.1], [0.0, 0.0, -1.0]);
    /// let hit = Tree::new(&mesh)?.closest_hit(&ray, &mut ()).expect("the ray meets it");
    /// assert!((hit.t - 7.0).abs() < 1e-6);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// Those of [`Mesh::new`].
    pub fn from_f64(positions: &[[f64; 3]], triangles: Vec<[u32; 3]>) -> Result<Self, MeshError> {
        let is_f32 = |c: &f64| f64::from(*c as f32) == *c || !c.is_finite();
        let mut origin = [0.0; 3];
        if !positions.iter().flatten().all(is_f32) {
            origin = std::array::from_fn(|axis| {
                let finite = || positions.iter().map(|p| p[axis]).filter(|c| c.is_finite());
                let (min, max) = (finite().reduce(f64::min), finite().reduce(f64::max));
                0.5 * min.unwrap_or(0.0) + 0.5 * max.unwrap_or(0.0)
            });
        }
        let near = |p: &[f64; 3]| std::array::from_fn(|i| (p[i] - origin[i]) as f32);
        Mesh::at(origin, positions.iter().map(near).collect(), triangles)
    }

    pub(super) fn check_count(what: &'static str, count: usize) -> Result<(), MeshError> {
        if count > Self::MAX_COUNT {
            return Err(MeshError::TooMany { what, count });
        }
        Ok(())
    }

    pub(super) fn at(
        origin: [f64; 3],
        positions: Vec<[f32; 3]>,
        triangles: Vec<[u32; 3]>,
    ) -> Result<Self, MeshError> {
        Mesh::check_count("triangles", triangles.len())?;
        Mesh::check_count("vertices", positions.len())?;
        let mut skipped = Skipped::default();
        let mut usable = Vec::with_capacity(triangles.len());
        let (mut bounds, mut largest_triangle) = (Aabb::EMPTY, 0.0f32);
        for (triangle, indices) in triangles.iter().enumerate() {
            let mut corners = [[0.0; 3]; 3];
            for (corner, &index) in corners.iter_mut().zip(indices) {
                *corner = *positions
                    .get(index as usize)
                    .ok_or(MeshError::IndexOutOfRange {
                        triangle,
                        index,
                        positions: positions.len(),
                    })?;
            }
            let usable_coordinate = |c: &f32| c.abs() <= Self::MAX_COORDINATE;
            if !corners.iter().flatten().all(usable_coordinate) {
                skipped.not_finite += 1;
            } else if normal_f64(&corners) == [0.0; 3] {
                skipped.degenerate += 1;
            } else {
                usable.push(triangle as u32);
                let own = Aabb::of_points(corners);
                bounds = bounds.union(&own);
                largest_triangle = own.extent().into_iter().fold(largest_triangle, f32::max);
            }
        }
        Ok(Mesh(Arc::new(Data {
            positions,
            triangles,
            usable,
            bounds,
            largest_triangle,
            skipped,
            origin,
        })))
    }

    /// Where the (0, 0, 0) of the mesh's positions is, in scene units: (0, 0, 0) unless
    /// [`Mesh::from_f64`] chose another.
    pub fn origin(&self) -> [f64; 3] {
        self.0.origin
    }

    /// The ray from an f64 position, for queries of a mesh of f64 positions: the mesh's origin is
    /// taken off in f64, then it is rounded to f32.
    pub fn ray(&self, origin: [f64; 3], direction: [f64; 3]) -> Ray {
        Ray::new(
            std::array::from_fn(|i| (origin[i] - self.0.origin[i]) as f32),
            direction.map(|c| c as f32),
        )
    }

    /// The vertices, in scene units, from the mesh's origin.
    pub fn positions(&self) -> &[[f32; 3]] {
        &self.0.positions
    }

    /// The triangles, each three indices into [`Mesh::positions`].
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.0.triangles
    }

    /// The box around all triangles that can be hit.
    pub fn bounds(&self) -> Aabb {
        self.0.bounds
    }

    /// The longest edge of a box around a single triangle that can be hit.
    pub(crate) fn largest_triangle(&self) -> f32 {
        self.0.largest_triangle
    }

    /// How many triangles can never be hit, and why.
    pub fn skipped(&self) -> Skipped {
        self.0.skipped
    }

    /// The indices of the triangles that can be hit, in order.
    pub fn usable_triangles(&self) -> &[u32] {
        &self.0.usable
    }

    /// The three vertices of a triangle, in scene units.
    #[inline]
    pub fn corners(&self, triangle: u32) -> [[f32; 3]; 3] {
        self.0.triangles[triangle as usize].map(|index| self.0.positions[index as usize])
    }

    /// Whether the triangles close a volume: each edge, from position to position, belongs to an
    /// even number of them. How they are turned does not matter, nor whether vertices at the same
    /// position are one. A mesh with a triangle that is not finite is not closed.
    pub fn is_closed(&self) -> bool {
        let mut places = HashMap::new();
        // Adding 0 makes -0 and 0 the same.
        let place_of: Vec<u32> = (self.positions().iter().enumerate())
            .map(|(i, p)| {
                *places
                    .entry(p.map(|c| (c + 0.0).to_bits()))
                    .or_insert(i as u32)
            })
            .collect();
        let mut edges: Vec<(u32, u32)> = (self.triangles().iter())
            .map(|triangle| triangle.map(|i| place_of[i as usize]))
            .flat_map(|[a, b, c]| [(a, b), (b, c), (c, a)])
            .map(|(a, b)| (a.min(b), a.max(b)))
            .filter(|(a, b)| a != b)
            .collect();
        edges.sort_unstable();
        let mut runs = edges.chunk_by(|a, b| a == b);
        self.skipped().not_finite == 0 && runs.all(|run| run.len() % 2 == 0)
    }

    /// The area of a triangle, in square scene units.
    pub(crate) fn area(&self, triangle: u32) -> f64 {
        let n = normal_f64(&self.corners(triangle));
        0.5 * (n[0] * n[0] + n[1] * n[1] + n[2] * n[2]).sqrt()
    }

    /// The unit normal of a triangle, by the right-hand rule; zero for a triangle without area.
    pub fn normal(&self, triangle: u32) -> [f32; 3] {
        let n = normal_f64(&self.corners(triangle));
        let length = (n[0] * n[0] + n[1] * n[1] + n[2] * n[2]).sqrt();
        if length > 0.0 {
            n.map(|c| (c / length) as f32)
        } else {
            [0.0; 3]
        }
    }
}

/// The normal of a triangle, as long as twice its area. In f64 the differences of f32 coordinates
/// of like size are exact, so zero means no area rather than rounding.
fn normal_f64(corners: &[[f32; 3]; 3]) -> [f64; 3] {
    let [a, b, c] = corners.map(|p| p.map(f64::from));
    let e: [f64; 3] = std::array::from_fn(|i| b[i] - a[i]);
    let f: [f64; 3] = std::array::from_fn(|i| c[i] - a[i]);
    [
        e[1] * f[2] - e[2] * f[1],
        e[2] * f[0] - e[0] * f[2],
        e[0] * f[1] - e[1] * f[0],
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(crate::testing::cases(300))]

        #[test]
        fn positions_in_f64_are_off_by_no_more_than_is_said(
            near in prop::collection::vec(prop::array::uniform3(-1.0f64..1.0), 3..20),
            size in prop_oneof![Just(1.0), Just(1e-3), Just(5e4)],
            far in prop_oneof![Just(0.0), Just(5.4e6), Just(-1e9)],
        ) {
            let given: Vec<[f64; 3]> = near.iter().map(|p| p.map(|c| c * size + far)).collect();
            let mesh = Mesh::from_f64(&given, vec![[0, 1, 2]]).unwrap();
            let all = || given.iter().map(|p| p.iter().copied());
            let extent = (0..3).map(|i| {
                let axis = || all().map(|mut p| p.nth(i).unwrap());
                axis().fold(f64::MIN, f64::max) - axis().fold(f64::MAX, f64::min)
            }).fold(0.0, f64::max);
            for (p, kept) in given.iter().zip(mesh.positions()) {
                for i in 0..3 {
                    let back = mesh.origin()[i] + f64::from(kept[i]);
                    let limit = extent * 2f64.powi(-25) * 1.000_001 + 3.0 * p[i].abs() * 2f64.powi(-53);
                    prop_assert!((back - p[i]).abs() <= limit, "{} {}", back, p[i]);
                }
            }
        }
    }

    #[test]
    fn positions_that_are_f32_stay_where_they_are() {
        let given = [
            [0.5, -3.0, 1e6],
            [f64::from(0.1f32), 7.0, 0.0],
            [1e-3f32.into(), 0.0, 2.0],
        ];
        let mesh = Mesh::from_f64(&given, vec![[0, 1, 2]]).unwrap();
        assert_eq!(mesh.origin(), [0.0; 3]);
        assert_eq!(mesh.positions(), given.map(|p| p.map(|c| c as f32)));
        let broken = [[f64::NAN, 0.1, 0.0], [1e300, 7.0, 0.0], [0.3, 0.0, 2.0]];
        let mesh = Mesh::from_f64(&broken, vec![[0, 1, 2]]).unwrap();
        assert_eq!(mesh.skipped().not_finite, 1);
    }
}
