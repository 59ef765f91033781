use glam::Vec3A;

/// A ray: the points `origin + t · direction` with `t_min < t <= t_max`.
///
/// `t` is in multiples of the direction's length; the direction need not be normalised.
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Ray {
    /// Where `t` is 0, in scene units.
    pub origin: [f32; 3],
    /// Where the ray goes; its length is the unit of `t`.
    pub direction: [f32; 3],
    /// Hits at or before this `t` do not count.
    pub t_min: f32,
    /// Hits beyond this `t` do not count; a hit at it does.
    pub t_max: f32,
}

impl Ray {
    /// The ray from `origin` along `direction`, with `t` in `(0, ∞]`.
    pub fn new(origin: [f32; 3], direction: [f32; 3]) -> Self {
        Ray {
            origin,
            direction,
            t_min: 0.0,
            t_max: f32::INFINITY,
        }
    }

    /// The point at `t`, in scene units.
    pub fn at(&self, t: f32) -> [f32; 3] {
        std::array::from_fn(|axis| self.origin[axis] + t * self.direction[axis])
    }

    /// Whether a query can answer the ray: all numbers finite (`t_max` may be infinite), the
    /// direction not zero. A query answers any other ray with a miss.
    #[inline]
    pub fn is_valid(&self) -> bool {
        let (origin, direction) = (Vec3A::from(self.origin), Vec3A::from(self.direction));
        // A number times 0 is 0 if it is finite, otherwise not a number.
        let is_finite = origin * 0.0 + direction * 0.0 == Vec3A::ZERO;
        is_finite && direction != Vec3A::ZERO && !self.t_min.is_nan() && !self.t_max.is_nan()
    }
}
