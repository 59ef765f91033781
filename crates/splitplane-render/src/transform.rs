//! Affine and projective transforms of 3D space, with their inverses.

use glam::DMat4;

/// A transform and its inverse, in f64: the vertices of a scene are rounded to f32 once.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Transform {
    matrix: DMat4,
    inverse: DMat4,
}

impl Transform {
    /// The transform that changes nothing.
    pub const IDENTITY: Transform = Transform {
        matrix: DMat4::IDENTITY,
        inverse: DMat4::IDENTITY,
    };

    /// The transform that undoes this one.
    pub fn inverse(&self) -> Transform {
        Transform {
            matrix: self.inverse,
            inverse: self.matrix,
        }
    }

    /// `self` after `first`.
    #[must_use]
    pub fn after(&self, first: &Transform) -> Transform {
        Transform {
            matrix: self.matrix * first.matrix,
            inverse: first.inverse * self.inverse,
        }
    }

    /// From a matrix; `None` where it has no inverse or is not finite.
    pub(crate) fn from_matrix(matrix: DMat4) -> Option<Transform> {
        let inverse = matrix.inverse();
        (matrix.is_finite() && inverse.is_finite() && matrix.determinant() != 0.0)
            .then_some(Transform { matrix, inverse })
    }

    /// The matrix, for column vectors.
    pub(crate) fn matrix(&self) -> DMat4 {
        self.matrix
    }

    /// Whether it leaves parallels parallel.
    pub(crate) fn is_affine(&self) -> bool {
        self.matrix.row(3).to_array() == [0.0, 0.0, 0.0, 1.0]
    }

    /// A point, transformed (and divided by its w where the transform is projective).
    pub fn point(&self, p: [f32; 3]) -> [f32; 3] {
        self.matrix
            .project_point3(glam::Vec3::from(p).as_dvec3())
            .as_vec3()
            .into()
    }

    /// A direction, transformed; its length changes with the scale.
    pub fn vector(&self, v: [f32; 3]) -> [f32; 3] {
        self.matrix
            .transform_vector3(glam::Vec3::from(v).as_dvec3())
            .as_vec3()
            .into()
    }

    /// A normal, transformed: by the inverse transpose; its length changes with the scale.
    pub fn normal(&self, n: [f32; 3]) -> [f32; 3] {
        self.inverse
            .transpose()
            .transform_vector3(glam::Vec3::from(n).as_dvec3())
            .as_vec3()
            .into()
    }

    /// Whether left and right hands change places.
    pub fn swaps_handedness(&self) -> bool {
        glam::DMat3::from_mat4(self.matrix).determinant() < 0.0
    }
}
