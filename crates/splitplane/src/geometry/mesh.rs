use std::sync::Arc;

use super::Aabb;

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

/// The largest coordinate that a usable triangle may have: products of three such numbers stay
/// finite in f64, products of two in f32.
const MAX_COORDINATE: f32 = 1e18;

impl Mesh {
    /// The most triangles, and the most vertices, that a mesh may have.
    pub const MAX_COUNT: usize = (u32::MAX - 1) as usize;

    /// A mesh of `triangles`, each three indices into `positions` (in scene units).
    ///
    /// Triangles that are not finite or have no area stay in the list but are never hit; see
    /// [`Mesh::skipped`].
    ///
    /// # Errors
    /// An index out of range, or more than [`Mesh::MAX_COUNT`] triangles or vertices.
    pub fn new(positions: Vec<[f32; 3]>, triangles: Vec<[u32; 3]>) -> Result<Self, MeshError> {
        for (what, count) in [
            ("triangles", triangles.len()),
            ("vertices", positions.len()),
        ] {
            if count > Self::MAX_COUNT {
                return Err(MeshError::TooMany { what, count });
            }
        }
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
            let usable_coordinate = |c: &f32| c.abs() <= MAX_COORDINATE;
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
        })))
    }

    /// The vertices, in scene units.
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
