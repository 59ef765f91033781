/// An axis-aligned box, in scene units.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Aabb {
    /// The corner with the smallest coordinates.
    pub min: [f32; 3],
    /// The corner with the largest coordinates.
    pub max: [f32; 3],
}

impl Aabb {
    /// The box that holds nothing: growing it by a point gives that point.
    pub const EMPTY: Aabb = Aabb {
        min: [f32::INFINITY; 3],
        max: [f32::NEG_INFINITY; 3],
    };

    /// The smallest box that holds all `points`.
    pub fn of_points(points: impl IntoIterator<Item = [f32; 3]>) -> Self {
        points.into_iter().fold(Aabb::EMPTY, Aabb::with_point)
    }

    /// The smallest box that holds this one and `point`.
    #[must_use]
    pub fn with_point(mut self, point: [f32; 3]) -> Self {
        for (axis, c) in point.into_iter().enumerate() {
            self.min[axis] = self.min[axis].min(c);
            self.max[axis] = self.max[axis].max(c);
        }
        self
    }

    /// The smallest box that holds both.
    #[must_use]
    pub fn union(&self, other: &Aabb) -> Self {
        Aabb {
            min: std::array::from_fn(|axis| self.min[axis].min(other.min[axis])),
            max: std::array::from_fn(|axis| self.max[axis].max(other.max[axis])),
        }
    }

    /// The box of the points that are in both.
    #[must_use]
    pub(crate) fn intersection(&self, other: &Aabb) -> Self {
        Aabb {
            min: std::array::from_fn(|axis| self.min[axis].max(other.min[axis])),
            max: std::array::from_fn(|axis| self.max[axis].min(other.max[axis])),
        }
    }

    /// Whether the box holds no point.
    pub fn is_empty(&self) -> bool {
        (0..3).any(|axis| self.min[axis] > self.max[axis])
    }

    /// The lengths of the edges, in scene units; 0 for an empty box.
    pub fn extent(&self) -> [f32; 3] {
        std::array::from_fn(|axis| (self.max[axis] - self.min[axis]).max(0.0))
    }

    /// The centre, in scene units.
    pub fn center(&self) -> [f32; 3] {
        std::array::from_fn(|axis| 0.5 * self.min[axis] + 0.5 * self.max[axis])
    }

    /// The length of the space diagonal, in scene units.
    pub fn diagonal(&self) -> f32 {
        let [x, y, z] = self.extent();
        (x * x + y * y + z * z).sqrt()
    }

    /// The area of the surface, in square scene units.
    pub fn surface_area(&self) -> f64 {
        let [x, y, z] = self.extent().map(f64::from);
        2.0 * (x * y + y * z + z * x)
    }

    /// The largest absolute coordinate, in scene units; 0 for an empty box.
    pub(crate) fn reach(&self) -> f32 {
        if self.is_empty() {
            return 0.0;
        }
        self.min
            .iter()
            .chain(&self.max)
            .fold(0.0, |reach, c| reach.max(c.abs()))
    }
}
