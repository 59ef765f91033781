//! On which side of a plane a triangle is: one predicate, for the sweep and for the partition.

/// A plane's offset along its direction, with what becomes of the triangles that touch it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Boundary {
    pub(crate) offset: f32,
    pub(crate) touching: Touching,
}

/// What becomes of triangles that touch a plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Touching {
    /// They are above.
    Above,
    /// They are below.
    Below,
    /// They are on both sides.
    Both,
    /// They are where they reach further than the tolerance.
    Tolerated {
        tolerance: f32,
        /// Where those are that are too flat to reach further on either side.
        flat: Side,
    },
}

/// A side of a plane.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Side {
    Below,
    Above,
}

impl Boundary {
    /// Whether a triangle with this extent along the direction is below, and whether it is above.
    /// It is on one side at least, and on one only if it is flat (but for [`Touching::Both`]).
    #[inline(always)]
    pub(crate) fn sides(&self, (min, max): (f32, f32)) -> (bool, bool) {
        let t = self.offset;
        match self.touching {
            Touching::Above => (min < t, max >= t),
            Touching::Below => (min <= t, max > t),
            Touching::Both => (min <= t, max >= t),
            Touching::Tolerated { tolerance, flat } => {
                let (below, above) = (min + tolerance < t, max - tolerance > t);
                match (is_flat((min, max), tolerance), flat) {
                    (false, _) => (below, above),
                    (true, Side::Below) => (!above, above),
                    (true, Side::Above) => (below, !below),
                }
            }
        }
    }

    /// Whether a triangle of this extent lies in the plane: it is on the side that
    /// [`Touching::Tolerated`] names.
    #[inline(always)]
    pub(crate) fn holds(&self, (min, max): (f32, f32)) -> bool {
        let t = self.offset;
        match self.touching {
            Touching::Tolerated { tolerance, .. } => max - tolerance <= t && t <= min + tolerance,
            _ => false,
        }
    }
}

/// Whether an extent is too short to reach beyond the tolerance on two sides of a plane.
#[inline(always)]
pub(crate) fn is_flat((min, max): (f32, f32), tolerance: f32) -> bool {
    min + tolerance >= max - tolerance
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(crate::testing::cases(1_000))]

        #[test]
        fn every_triangle_is_on_a_side_and_a_flat_one_on_one(
            min in -2.0f32..2.0,
            length in prop_oneof![Just(0.0f32), 0.0f32..1e-5, 0.0f32..2.0],
            offset in prop_oneof![-2.5f32..2.5, Just(f32::NAN)],
            on in 0usize..4,
            tolerance in prop_oneof![Just(1e-6f32), Just(0.1), Just(0.0)],
        ) {
            let max = min + length;
            let offset = [offset, min, max, min + tolerance][on];
            prop_assume!(!offset.is_nan());
            let tolerated = |flat| Touching::Tolerated { tolerance, flat };
            let all = [Touching::Above, Touching::Below, Touching::Both, tolerated(Side::Below), tolerated(Side::Above)];
            for touching in all {
                let boundary = Boundary { offset, touching };
                let (below, above) = boundary.sides((min, max));
                if boundary.holds((min, max)) {
                    prop_assert_eq!((below, above), (touching == all[3], touching == all[4]));
                }
                prop_assert!(below || above, "{touching:?}");
                if min == max && touching != Touching::Both {
                    prop_assert!(below != above, "{touching:?}");
                }
            }
        }
    }
}
