//! Curves with a width, and rational splines, as triangles.

use std::f64::consts::TAU;

use glam::{DQuat, DVec3, DVec4};

use super::geometry::Geometry;
use super::tessellate::{Segments, grid};

/// A chain of Bézier curves of degree 2 or 3, with a width.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Curve {
    /// Control points of each, three or four; the end of one is the start of the next.
    pub(crate) parts: Vec<Vec<DVec3>>,
    /// At the start and the end.
    pub(crate) width: [f64; 2],
    /// Of a ribbon: the normals at the joints, one more than parts. `None`: the curve is round.
    pub(crate) normals: Option<Vec<DVec3>>,
}

impl Curve {
    /// From the control points of a uniform B-spline, or of Bézier curves that share their ends.
    ///
    /// # Errors
    /// What number of points there should be.
    pub(crate) fn parts(
        points: &[DVec3],
        degree: usize,
        is_spline: bool,
    ) -> Result<Vec<Vec<DVec3>>, String> {
        let count = points.len();
        if is_spline {
            if count < degree + 1 {
                return Err(format!("at least {} points", degree + 1));
            }
            // The Bézier points are the blossom's at the knots of a uniform spline.
            let part = |p: &[DVec3]| match p {
                [a, b, c] => vec![(a + b) / 2.0, *b, (b + c) / 2.0],
                [a, b, c, d] => vec![
                    (a + 4.0 * b + c) / 6.0,
                    (2.0 * b + c) / 3.0,
                    (b + 2.0 * c) / 3.0,
                    (b + 4.0 * c + d) / 6.0,
                ],
                _ => p.to_vec(),
            };
            return Ok(points.windows(degree + 1).map(part).collect());
        }
        if count < degree + 1 || !(count - 1).is_multiple_of(degree) {
            return Err(format!(
                "{} points, or {degree} more for each further part",
                degree + 1
            ));
        }
        Ok((0..(count - 1) / degree)
            .map(|i| points[i * degree..=(i + 1) * degree].to_vec())
            .collect())
    }

    /// Point and derivative at `u` from 0 to 1 along all parts.
    fn at(&self, u: f64) -> (DVec3, DVec3) {
        let place = u * self.parts.len() as f64;
        let part = (place as usize).min(self.parts.len().saturating_sub(1));
        let t = place - part as f64;
        let mut points = self.parts[part].clone();
        let degree = points.len() - 1;
        while points.len() > 2 {
            points = points.windows(2).map(|p| p[0].lerp(p[1], t)).collect();
        }
        (
            points[0].lerp(points[1], t),
            degree as f64 * (points[1] - points[0]),
        )
    }

    fn width_at(&self, u: f64) -> f64 {
        self.width[0] + u * (self.width[1] - self.width[0])
    }

    /// A tube or a ribbon of `along` segments a part; a tube has `around` sides.
    pub(crate) fn tessellated(&self, along: u32, around: u32) -> (Geometry, Segments) {
        let steps = along * self.parts.len() as u32;
        let tangent = |u: f64| {
            // Where control points coincide the derivative is zero: that of the neighbourhood is
            // near enough.
            let (_, derivative) = self.at(u);
            derivative.try_normalize().unwrap_or_else(|| {
                let near = self.at((u + 1e-3).min(1.0)).0 - self.at((u - 1e-3).max(0.0)).0;
                near.normalize_or(DVec3::Z)
            })
        };
        if let Some(normals) = &self.normals {
            let segments = Segments { u: steps, v: 2 };
            let geometry = grid(segments, |u, v| {
                let place = u * (normals.len() - 1) as f64;
                let i = (place as usize).min(normals.len().saturating_sub(2));
                let next = normals[(i + 1).min(normals.len() - 1)];
                let normal = turned(normals[i], next, place - i as f64);
                let side = normal.cross(tangent(u)).normalize_or_zero();
                let p = self.at(u).0 + (v - 0.5) * self.width_at(u) * side;
                (p.into(), normal.into())
            });
            return (geometry, segments);
        }
        // Frames that turn with the curve and not around it.
        let mut frames = vec![tangent(0.0).any_orthonormal_vector()];
        for i in 1..=steps {
            let t = tangent(f64::from(i) / f64::from(steps));
            let last = frames[frames.len() - 1];
            let level = last - last.dot(t) * t;
            frames.push(
                level
                    .try_normalize()
                    .unwrap_or_else(|| t.any_orthonormal_vector()),
            );
        }
        let segments = Segments {
            u: around,
            v: steps,
        };
        let mut geometry = grid(segments, |around, along| {
            let i = (along * f64::from(steps)).round() as usize;
            let t = tangent(along);
            let angle = if around == 1.0 { 0.0 } else { around * TAU };
            let (sin, cos) = angle.sin_cos();
            let normal = cos * frames[i] + sin * t.cross(frames[i]);
            let p = self.at(along).0 + 0.5 * self.width_at(along) * normal;
            (p.into(), normal.into())
        });
        // u runs along the curve.
        geometry.uvs.iter_mut().for_each(|uv| uv.swap(0, 1));
        (geometry, segments)
    }
}

/// From one direction to another.
fn turned(from: DVec3, to: DVec3, part: f64) -> DVec3 {
    let (from, to) = (from.normalize_or(DVec3::Z), to.normalize_or(DVec3::Z));
    DQuat::IDENTITY.slerp(DQuat::from_rotation_arc(from, to), part) * from
}

/// A spline's knots along one parameter, and what of it is shown.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Knots {
    /// Degree plus 1.
    pub(crate) order: usize,
    pub(crate) knots: Vec<f64>,
    pub(crate) range: [f64; 2],
}

impl Knots {
    /// The weights of all control points at `t` by Cox and de Boor's recurrence.
    fn basis(&self, t: f64) -> Vec<f64> {
        let count = self.knots.len() - self.order;
        // The last span that begins at or before t.
        let span = (self.order - 1..count)
            .rev()
            .find(|&i| self.knots[i] <= t && self.knots[i] < self.knots[i + 1])
            .unwrap_or(self.order - 1);
        let mut weights = vec![0.0; self.knots.len()];
        weights[span] = 1.0;
        for degree in 1..self.order {
            for i in span.saturating_sub(degree)..=span {
                let ratio = |low: usize, high: usize, x: f64| {
                    let length = self.knots[high] - self.knots[low];
                    if length > 0.0 { x / length } else { 0.0 }
                };
                let left = ratio(i, i + degree, t - self.knots[i]) * weights[i];
                let right =
                    ratio(i + 1, i + degree + 1, self.knots[i + degree + 1] - t) * weights[i + 1];
                weights[i] = left + right;
            }
        }
        weights.truncate(count);
        weights
    }
}

/// The surface of control points (times their weights, with the weights), row by row along u.
pub(crate) fn nurbs(u: &Knots, v: &Knots, points: &[DVec4], segments: Segments) -> Geometry {
    let columns = u.knots.len() - u.order;
    let place = |k: &Knots, x: f64| k.range[0] + x * (k.range[1] - k.range[0]);
    let point = |s: f64, t: f64| {
        let (bu, bv) = (u.basis(place(u, s)), v.basis(place(v, t)));
        let mut sum = DVec4::ZERO;
        for (row, weight) in bv.iter().enumerate() {
            for (column, w) in bu.iter().enumerate() {
                sum += points[row * columns + column] * (weight * w);
            }
        }
        sum.truncate() / sum.w
    };
    grid(segments, |s, t| {
        const STEP: f64 = 1e-4;
        let slope = |a: DVec3, b: DVec3| b - a;
        let du = slope(point((s - STEP).max(0.0), t), point((s + STEP).min(1.0), t));
        let dv = slope(point(s, (t - STEP).max(0.0)), point(s, (t + STEP).min(1.0)));
        (point(s, t).into(), du.cross(dv).into())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_straight_tube_is_a_cylinder_that_faces_outwards() {
        let points: Vec<DVec3> = (0..4).map(|i| DVec3::Z * f64::from(i)).collect();
        let curve = Curve {
            parts: Curve::parts(&points, 3, false).unwrap(),
            width: [1.0, 1.0],
            normals: None,
        };
        let (g, segments) = curve.tessellated(4, 8);
        assert_eq!((segments.u, segments.v, g.triangles.len()), (8, 4, 64));
        for (p, n) in g.positions.iter().zip(&g.normals) {
            assert!((p[0].hypot(p[1]) - 0.5).abs() < 1e-6);
            assert!((p[0] * n[0] + p[1] * n[1] - 0.5).abs() < 1e-6);
        }
    }

    #[test]
    fn a_spline_and_its_bezier_curves_are_the_same() {
        let p: Vec<DVec3> = [[0.0, 0.0], [1.0, 2.0], [3.0, -1.0], [4.0, 1.0], [6.0, 0.0]]
            .map(|[x, y]| DVec3::new(x, y, 0.0))
            .to_vec();
        for degree in [2, 3] {
            let curve = Curve {
                parts: Curve::parts(&p, degree, true).unwrap(),
                width: [1.0; 2],
                normals: None,
            };
            // Parts meet with the same derivative.
            let joint = 1.0 / curve.parts.len() as f64;
            let (before, after) = (curve.at(joint - 1e-9), curve.at(joint + 1e-9));
            assert!((before.0 - after.0).length() < 1e-6);
            assert!((before.1 - after.1).length() < 1e-6);
        }
        assert!(Curve::parts(&p, 3, false).is_err());
    }

    #[test]
    fn a_rational_quarter_circle_is_round() {
        let w = 0.5f64.sqrt();
        let row = [
            DVec4::new(1.0, 0.0, 0.0, 1.0),
            DVec4::new(w, w, 0.0, w),
            DVec4::new(0.0, 1.0, 0.0, 1.0),
        ];
        let up = |p: DVec4| p + DVec4::new(0.0, 0.0, p.w, 0.0);
        let points: Vec<DVec4> = row.iter().copied().chain(row.map(up)).collect();
        let u = Knots {
            order: 3,
            knots: vec![0.0, 0.0, 0.0, 1.0, 1.0, 1.0],
            range: [0.0, 1.0],
        };
        let v = Knots {
            order: 2,
            knots: vec![0.0, 0.0, 1.0, 1.0],
            range: [0.0, 1.0],
        };
        let g = nurbs(&u, &v, &points, Segments { u: 8, v: 2 });
        assert_eq!(g.triangles.len(), 32);
        for p in &g.positions {
            assert!((p[0].hypot(p[1]) - 1.0).abs() < 1e-6);
        }
    }
}
