//! Curved surfaces as triangles. Vertices lie on the surface, normals are those of the surface.

use super::geometry::{Geometry, LocalSurface};

/// A point of a surface and its normal there.
pub(crate) type Point = ([f64; 3], [f64; 3]);

/// How many triangles a surface is made of, along its two parameters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Segments {
    pub(crate) u: u32,
    pub(crate) v: u32,
}

/// The surface `at(u, v)` for u and v from 0 to 1, where the normal points to the side from which
/// u and v are a right-handed pair. Triangles whose corners coincide (at poles) are left out.
pub(crate) fn grid(segments: Segments, at: impl Fn(f64, f64) -> Point) -> Geometry {
    let Segments { u: nu, v: nv } = segments;
    let mut g = Geometry::default();
    for j in 0..=nv {
        let v = f64::from(j) / f64::from(nv);
        for i in 0..=nu {
            let u = f64::from(i) / f64::from(nu);
            let (p, n) = at(u, v);
            let length = n.iter().map(|c| c * c).sum::<f64>().sqrt();
            let unit = if length > 0.0 {
                n.map(|c| c / length)
            } else {
                [0.0, 0.0, 1.0]
            };
            g.positions.push(p.map(|c| c as f32));
            g.normals.push(unit.map(|c| c as f32));
            g.uvs.push([u as f32, v as f32]);
        }
    }
    let row = nu + 1;
    // At a pole each vertex belongs to one triangle: it gets the middle of that triangle's u.
    for (first, shift) in [(0, 0.5), (nv * row, -0.5)] {
        let ring = first as usize..(first + row) as usize;
        if g.positions[ring.clone()].windows(2).all(|p| p[0] == p[1]) {
            for uv in &mut g.uvs[ring] {
                uv[0] += shift / nu as f32;
            }
        }
    }
    for j in 0..nv {
        for i in 0..nu {
            let a = j * row + i;
            for t in [[a, a + 1, a + row + 1], [a, a + row + 1, a + row]] {
                let [p, q, r] = t.map(|index| g.positions[index as usize]);
                if p != q && q != r && r != p {
                    g.triangles.push(t);
                }
            }
        }
    }
    g
}

/// The surfaces of revolution of pbrt-v3 [PBRT3, 3.2 to 3.5], around the z axis; angles in radians.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Quadric {
    Sphere {
        radius: f64,
        z_min: f64,
        z_max: f64,
    },
    Cylinder {
        radius: f64,
        z_min: f64,
        z_max: f64,
    },
    Disk {
        radius: f64,
        inner_radius: f64,
        height: f64,
    },
    Cone {
        radius: f64,
        height: f64,
    },
    Paraboloid {
        radius: f64,
        z_min: f64,
        z_max: f64,
    },
    /// What the line from one point to the other sweeps.
    Hyperboloid {
        from: [f64; 3],
        to: [f64; 3],
    },
}

impl Quadric {
    /// The surface with `around` segments on a full turn, over angles from 0 to `phi_max`.
    pub(crate) fn tessellated(self, phi_max: f64, around: u32) -> (Geometry, Segments) {
        let turn = std::f64::consts::TAU;
        let u = (f64::from(around) * phi_max / turn).ceil().max(3.0) as u32;
        let v = match self {
            Quadric::Sphere { .. } => around / 2,
            Quadric::Cylinder { .. } => 1,
            Quadric::Disk { .. } | Quadric::Cone { .. } => around / 8,
            Quadric::Paraboloid { .. } | Quadric::Hyperboloid { .. } => around / 4,
        };
        let segments = Segments { u, v: v.max(1) };
        // The seam of a full turn is closed: its two sides have the same points.
        let full = phi_max >= turn;
        let at = |u: f64, v: f64| {
            let phi = if full && u == 1.0 { 0.0 } else { u * phi_max };
            let (sin, cos) = phi.sin_cos();
            let ([px, py, pz], [nx, ny, nz]) = self.profile(v);
            let turned = |x: f64, y: f64, z: f64| [x * cos - y * sin, x * sin + y * cos, z];
            (turned(px, py, pz), turned(nx, ny, nz))
        };
        (grid(segments, at), segments)
    }

    /// What the surface is known as, where all of it is there.
    pub(crate) fn surface(self, phi_max: f64) -> LocalSurface {
        if phi_max < std::f64::consts::TAU {
            return LocalSurface::Curved;
        }
        match self {
            Quadric::Sphere {
                radius,
                z_min,
                z_max,
            } if z_min <= -radius && z_max >= radius => LocalSurface::Sphere { radius },
            Quadric::Disk {
                radius,
                inner_radius: 0.0,
                height,
            } => LocalSurface::Disk { radius, height },
            _ => LocalSurface::Curved,
        }
    }

    /// The point and the normal at `v` where the angle is 0.
    fn profile(self, v: f64) -> Point {
        let between = |a: f64, b: f64| a + v * (b - a);
        match self {
            Quadric::Sphere {
                radius,
                z_min,
                z_max,
            } => {
                let polar = |z: f64| (z / radius).clamp(-1.0, 1.0).acos();
                let z = radius * between(polar(z_min), polar(z_max)).cos();
                let r = (radius * radius - z * z).max(0.0).sqrt();
                ([r, 0.0, z], [r, 0.0, z])
            }
            Quadric::Cylinder {
                radius,
                z_min,
                z_max,
            } => ([radius, 0.0, between(z_min, z_max)], [1.0, 0.0, 0.0]),
            Quadric::Disk {
                radius,
                inner_radius,
                height,
            } => (
                [between(radius, inner_radius), 0.0, height],
                [0.0, 0.0, 1.0],
            ),
            Quadric::Cone { radius, height } => {
                ([radius * (1.0 - v), 0.0, v * height], [height, 0.0, radius])
            }
            Quadric::Paraboloid {
                radius,
                z_min,
                z_max,
            } => {
                let z = between(z_min, z_max);
                let r = radius * (z / z_max).max(0.0).sqrt();
                ([r, 0.0, z], [r, 0.0, -radius * radius / (2.0 * z_max)])
            }
            Quadric::Hyperboloid { from, to } => {
                let p: [f64; 3] = std::array::from_fn(|i| between(from[i], to[i]));
                let along: [f64; 3] = std::array::from_fn(|i| to[i] - from[i]);
                // Across: the derivative by the angle is (-y, x, 0).
                let normal = [
                    p[0] * along[2],
                    p[1] * along[2],
                    -p[1] * along[1] - p[0] * along[0],
                ];
                (p, normal)
            }
        }
    }
}

/// Samples `z` of `nu` by `nv` heights over the unit square, row by row [PBRT3, 3.6].
pub(crate) fn heightfield(nu: u32, nv: u32, heights: &[f64]) -> Geometry {
    let mut g = Geometry::default();
    for (i, &z) in heights.iter().enumerate() {
        let (x, y) = (i as u32 % nu, i as u32 / nu);
        let [u, v] = [x as f32 / (nu - 1) as f32, y as f32 / (nv - 1) as f32];
        g.positions.push([u, v, z as f32]);
        g.uvs.push([u, v]);
    }
    for y in 0..nv - 1 {
        for x in 0..nu - 1 {
            let a = y * nu + x;
            g.triangles
                .extend([[a, a + 1, a + nu + 1], [a, a + nu + 1, a + nu]]);
        }
    }
    g
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sphere_is_closed_and_its_triangles_face_outwards() {
        let sphere = Quadric::Sphere {
            radius: 2.0,
            z_min: -2.0,
            z_max: 2.0,
        };
        let (g, segments) = sphere.tessellated(std::f64::consts::TAU, 32);
        assert_eq!(segments, Segments { u: 32, v: 16 });
        assert_eq!(g.triangles.len(), 2 * 32 * 15);
        let mut edges = std::collections::HashSet::new();
        for t in &g.triangles {
            let corners = t.map(|i| glam::Vec3::from(g.positions[i as usize]));
            let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
            assert!(normal.dot(corners[0]) > 0.0);
            let bits = t.map(|i| g.positions[i as usize].map(|c| (c + 0.0).to_bits()));
            for i in 0..3 {
                edges.insert((bits[i], bits[(i + 1) % 3]));
            }
        }
        assert!(
            edges.iter().all(|&(a, b)| edges.contains(&(b, a))),
            "no gap at seam or poles"
        );
    }

    #[test]
    fn every_quadric_has_the_normals_that_its_triangles_have() {
        let all = [
            Quadric::Sphere {
                radius: 1.0,
                z_min: -0.5,
                z_max: 0.7,
            },
            Quadric::Cylinder {
                radius: 1.0,
                z_min: -1.0,
                z_max: 1.0,
            },
            Quadric::Disk {
                radius: 1.0,
                inner_radius: 0.2,
                height: 0.3,
            },
            Quadric::Cone {
                radius: 0.75,
                height: 2.0,
            },
            Quadric::Paraboloid {
                radius: 1.0,
                z_min: 0.1,
                z_max: 1.5,
            },
            Quadric::Hyperboloid {
                from: [3.0, 1.2, 1.0],
                to: [0.65, -0.5, -1.0],
            },
        ];
        for quadric in all {
            let (g, _) = quadric.tessellated(4.0, 256);
            for t in &g.triangles {
                let [a, b, c] = t.map(|i| glam::Vec3::from(g.positions[i as usize]));
                let face = (b - a).cross(c - a).normalize_or_zero();
                let exact = glam::Vec3::from(g.normals[t[0] as usize]);
                assert!(face.dot(exact) > 0.95, "{quadric:?}: {face} {exact}");
            }
        }
    }
}
