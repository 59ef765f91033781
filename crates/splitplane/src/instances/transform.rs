use crate::geometry::{Aabb, Ray};

/// A place in space: an affine transform from an instance's space, with its inverse, in f64.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(try_from = "Rows", into = "Rows")
)]
pub struct Transform {
    rows: Rows,
    inverse: Rows,
}

/// The upper three rows of a 4×4 matrix for column vectors; the last column is the translation.
type Rows = [[f64; 4]; 3];

/// Why a matrix is no [`Transform`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum TransformError {
    /// A number that is NaN or infinite.
    #[error("the transform has a number that is not finite")]
    NotFinite,
    /// The matrix takes space to a plane, a line or a point, or nearly so.
    #[error("the transform cannot be inverted: its determinant is zero or too small")]
    Singular,
}

impl Transform {
    /// The transform that leaves everything where it is.
    pub const IDENTITY: Transform = Transform::translation([0.0; 3]);

    /// The transform of the upper three rows of a 4×4 matrix for column vectors: a point p comes
    /// to `rows · (p, 1)`, so the last column is the translation, in scene units.
    ///
    /// # Errors
    /// A number that is not finite, or a matrix without an inverse.
    pub fn from_rows(rows: [[f64; 4]; 3]) -> Result<Self, TransformError> {
        if !rows.iter().flatten().all(|c| c.is_finite()) {
            return Err(TransformError::NotFinite);
        }
        let minor = |i: usize, j: usize| {
            let (r, s) = ((i + 1) % 3, (i + 2) % 3);
            let (c, d) = ((j + 1) % 3, (j + 2) % 3);
            rows[r][c] * rows[s][d] - rows[r][d] * rows[s][c]
        };
        let determinant: f64 = (0..3).map(|j| rows[0][j] * minor(0, j)).sum();
        let linear: [[f64; 3]; 3] =
            std::array::from_fn(|i| std::array::from_fn(|j| minor(j, i) / determinant));
        let inverse: Rows = linear.map(|[x, y, z]| {
            let offset = x * rows[0][3] + y * rows[1][3] + z * rows[2][3];
            [x, y, z, -offset]
        });
        if !inverse.iter().flatten().all(|c| c.is_finite()) {
            return Err(TransformError::Singular);
        }
        Ok(Transform { rows, inverse })
    }

    /// A move by `offset`, in scene units.
    pub const fn translation([x, y, z]: [f64; 3]) -> Self {
        Transform {
            rows: moved(x, y, z),
            inverse: moved(-x, -y, -z),
        }
    }

    /// The upper three rows of the matrix; see [`Transform::from_rows`].
    pub fn rows(&self) -> [[f64; 4]; 3] {
        self.rows
    }

    /// The point in space of an instance's point.
    pub fn point(&self, p: [f64; 3]) -> [f64; 3] {
        self.rows
            .map(|[x, y, z, w]| x * p[0] + y * p[1] + z * p[2] + w)
    }

    /// The ray that an instance sees: transformed in f64, rounded once to f32, with the same `t`.
    pub fn local_ray(&self, ray: &Ray) -> Ray {
        let (o, d) = (ray.origin.map(f64::from), ray.direction.map(f64::from));
        Ray {
            origin: (self.inverse).map(|[x, y, z, w]| (x * o[0] + y * o[1] + z * o[2] + w) as f32),
            direction: (self.inverse).map(|[x, y, z, _]| (x * d[0] + y * d[1] + z * d[2]) as f32),
            ..*ray
        }
    }

    /// The unit normal in space of an instance's normal; turned where the transform mirrors, as
    /// the vertices are.
    pub(super) fn normal(&self, normal: [f32; 3]) -> [f32; 3] {
        let n = normal.map(f64::from);
        let [a, b, c] = self.inverse;
        let mirrors = {
            let [p, q, r] = self.rows;
            let minor = |i: usize, j: usize| q[i] * r[j] - q[j] * r[i];
            p[0] * minor(1, 2) + p[1] * minor(2, 0) + p[2] * minor(0, 1) < 0.0
        };
        let turned: [f64; 3] = std::array::from_fn(|i| a[i] * n[0] + b[i] * n[1] + c[i] * n[2]);
        let length = turned.iter().map(|c| c * c).sum::<f64>().sqrt();
        let scale = if mirrors { -1.0 } else { 1.0 } / length;
        if length > 0.0 {
            turned.map(|c| (c * scale) as f32)
        } else {
            [0.0; 3]
        }
    }

    /// A box in space around an instance's box, with an extent along every axis.
    pub(super) fn bounds(&self, own: &Aabb) -> Aabb {
        let ends = [own.min, own.max];
        let corners = (0..8usize).map(|corner| {
            self.point(std::array::from_fn(|axis| {
                f64::from(ends[corner >> axis & 1][axis])
            }))
        });
        corners.fold(Aabb::EMPTY, |bounds, p| {
            let away = |up: bool| {
                p.map(|c| match up {
                    true => (c as f32).next_up(),
                    false => (c as f32).next_down(),
                })
            };
            bounds.with_point(away(false)).with_point(away(true))
        })
    }

    /// How much longer a vector may become, by its largest coordinate.
    pub(super) fn stretch(&self) -> f64 {
        stretch(&self.rows)
    }

    /// How much longer a vector may become on its way into the instance's space.
    pub(super) fn inverse_stretch(&self) -> f64 {
        stretch(&self.inverse)
    }

    /// The largest coordinate of the translation.
    pub(super) fn offset(&self) -> f64 {
        self.rows.iter().fold(0.0, |far, row| far.max(row[3].abs()))
    }
}

const fn moved(x: f64, y: f64, z: f64) -> Rows {
    [[1.0, 0.0, 0.0, x], [0.0, 1.0, 0.0, y], [0.0, 0.0, 1.0, z]]
}

fn stretch(rows: &Rows) -> f64 {
    let sums = rows.map(|[x, y, z, _]| x.abs() + y.abs() + z.abs());
    sums.into_iter().fold(0.0, f64::max)
}

impl Default for Transform {
    fn default() -> Self {
        Transform::IDENTITY
    }
}

impl TryFrom<Rows> for Transform {
    type Error = TransformError;
    fn try_from(rows: Rows) -> Result<Self, TransformError> {
        Transform::from_rows(rows)
    }
}

impl From<Transform> for Rows {
    fn from(transform: Transform) -> Rows {
        transform.rows
    }
}

/// From the matrix of another library's affine transform.
#[cfg(feature = "glam")]
impl TryFrom<glam::DAffine3> for Transform {
    type Error = TransformError;
    fn try_from(affine: glam::DAffine3) -> Result<Self, TransformError> {
        let (m, t) = (affine.matrix3.to_cols_array_2d(), affine.translation);
        let row = |i: usize| [m[0][i], m[1][i], m[2][i], t[i]];
        Transform::from_rows([row(0), row(1), row(2)])
    }
}

/// From the matrix of another library's affine transform, widened to f64.
#[cfg(feature = "glam")]
impl TryFrom<glam::Affine3A> for Transform {
    type Error = TransformError;
    fn try_from(affine: glam::Affine3A) -> Result<Self, TransformError> {
        let (m, t) = (affine.matrix3.to_cols_array_2d(), affine.translation);
        let row = |i: usize| [m[0][i], m[1][i], m[2][i], t[i]].map(f64::from);
        Transform::from_rows([row(0), row(1), row(2)])
    }
}

/// From the upper three rows of a matrix for column vectors.
#[cfg(feature = "mint")]
impl TryFrom<mint::RowMatrix3x4<f64>> for Transform {
    type Error = TransformError;
    fn try_from(matrix: mint::RowMatrix3x4<f64>) -> Result<Self, TransformError> {
        Transform::from_rows(matrix.into())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_matrix_without_an_inverse_is_refused() {
        let flat = [
            [1.0, 0.0, 0.0, 5.0],
            [0.0, 1.0, 0.0, 0.0],
            [1.0, 1.0, 0.0, 0.0],
        ];
        assert_eq!(Transform::from_rows(flat), Err(TransformError::Singular));
        let broken = [[f64::NAN; 4]; 3];
        assert_eq!(Transform::from_rows(broken), Err(TransformError::NotFinite));
    }

    #[test]
    fn the_identity_changes_no_ray() {
        let ray = Ray::new([0.1, -7.3e-9, 2.5e9], [-0.3, 1e-20, 0.0]);
        assert_eq!(Transform::IDENTITY.local_ray(&ray), ray);
    }

    #[test]
    fn the_local_ray_of_a_moved_ray_is_the_ray() {
        let rows = [
            [0.0, -2.0, 0.0, 3.0],
            [1.0, 0.0, 0.0, -1.0],
            [0.0, 0.0, 4.0, 0.5],
        ];
        let transform = Transform::from_rows(rows).unwrap();
        let local = transform.local_ray(&Ray::new([1.0, 1.0, 4.5], [-2.0, 0.0, 8.0]));
        assert_eq!(local, Ray::new([2.0, 1.0, 1.0], [0.0, 1.0, 2.0]));
        assert_eq!(transform.point([2.0, 1.0, 1.0]), [1.0, 1.0, 4.5]);
    }

    #[test]
    fn normals_stay_upright_and_turn_in_a_mirror() {
        let squash = |z: f64| {
            [
                [1.0, 0.0, 0.0, 0.0],
                [0.0, 1.0, 0.0, 0.0],
                [0.0, 0.0, z, 0.0],
            ]
        };
        let slanted = [0.6, 0.0, 0.8];
        let [x, y, z] = Transform::from_rows(squash(0.5)).unwrap().normal(slanted);
        assert!((x / z - 0.375).abs() < 1e-6 && y == 0.0 && z > 0.0);
        // The mirrored triangle's vertices go round the other way.
        let [x, _, z] = Transform::from_rows(squash(-1.0)).unwrap().normal(slanted);
        assert_eq!((x, z), (-0.6, 0.8));
    }
}
