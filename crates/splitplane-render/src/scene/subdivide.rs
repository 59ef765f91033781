//! Loop's subdivision surfaces [Loop1987], with the rules, limit positions and limit normals of
//! pbrt-v3 [PBRT3, 3.8].

use std::collections::HashMap;

use glam::DVec3;

use super::geometry::Geometry;

/// No face lies on the other side of the edge.
const NONE: u32 = u32::MAX;

/// More triangles than this are not made.
const MOST_TRIANGLES: usize = 1 << 27;

#[derive(Clone, Copy, Debug)]
struct Vertex {
    p: DVec3,
    /// One of the faces around the vertex.
    face: u32,
    boundary: bool,
    /// Has the usual number of neighbours: 6, or 4 on a boundary.
    regular: bool,
}

#[derive(Clone, Copy, Debug)]
struct Face {
    v: [u32; 3],
    /// The face across the edge from `v[i]` to `v[i + 1]`.
    across: [u32; 3],
}

impl Face {
    /// Where the vertex stands in the face.
    fn number(&self, vertex: u32) -> usize {
        // Callers walk from a vertex over faces that have it.
        self.v.iter().position(|&v| v == vertex).unwrap_or(0)
    }

    fn next_face(&self, vertex: u32) -> u32 {
        self.across[self.number(vertex)]
    }

    fn previous_face(&self, vertex: u32) -> u32 {
        self.across[(self.number(vertex) + 2) % 3]
    }

    fn next_vertex(&self, vertex: u32) -> u32 {
        self.v[(self.number(vertex) + 1) % 3]
    }

    fn previous_vertex(&self, vertex: u32) -> u32 {
        self.v[(self.number(vertex) + 2) % 3]
    }

    /// The vertex that is on neither end of an edge.
    fn other_vertex(&self, a: u32, b: u32) -> u32 {
        self.v.into_iter().find(|&v| v != a && v != b).unwrap_or(a)
    }
}

#[derive(Debug)]
struct Surface {
    vertices: Vec<Vertex>,
    faces: Vec<Face>,
}

/// Subdivides a closed or open surface of triangles `levels` times; each level makes four of one
/// triangle. Positions and normals are those of the limit surface.
///
/// # Errors
/// A message, where an edge has more than two triangles or two that run along it in the same
/// direction, or where the result would be too large.
pub(crate) fn loop_subdivide(
    positions: &[[f32; 3]],
    triangles: &[[u32; 3]],
    levels: u32,
) -> Result<Geometry, String> {
    let count = 4_usize
        .checked_pow(levels)
        .and_then(|factor| factor.checked_mul(triangles.len()));
    if count.is_none_or(|count| count > MOST_TRIANGLES) {
        return Err(format!(
            "{} triangles subdivided {levels} times are more than {MOST_TRIANGLES}",
            triangles.len()
        ));
    }
    let mut surface = Surface::new(positions, triangles)?;
    for _ in 0..levels {
        surface = surface.subdivided();
    }
    Ok(surface.limit())
}

impl Surface {
    fn new(positions: &[[f32; 3]], triangles: &[[u32; 3]]) -> Result<Surface, String> {
        let mut faces: Vec<Face> = triangles
            .iter()
            .map(|&v| Face {
                v,
                across: [NONE; 3],
            })
            .collect();
        // Edges by direction: the face that has it, and which of its edges it is.
        let mut edges: HashMap<(u32, u32), (u32, usize)> = HashMap::new();
        for (index, face) in faces.iter().enumerate() {
            if face.v[0] == face.v[1] || face.v[1] == face.v[2] || face.v[2] == face.v[0] {
                return Err(format!("triangle {index} names a vertex twice"));
            }
            for edge in 0..3 {
                let ends = (face.v[edge], face.v[(edge + 1) % 3]);
                if edges.insert(ends, (index as u32, edge)).is_some() {
                    return Err(format!(
                        "two triangles run in the same direction along the edge from vertex {} to \
                         {}",
                        ends.0, ends.1
                    ));
                }
            }
        }
        for (index, face) in faces.iter_mut().enumerate() {
            for edge in 0..3 {
                let ends = (face.v[(edge + 1) % 3], face.v[edge]);
                if let Some(&(other, _)) = edges.get(&ends) {
                    debug_assert_ne!(other, index as u32);
                    face.across[edge] = other;
                }
            }
        }
        let mut vertices: Vec<Vertex> = positions
            .iter()
            .map(|&p| Vertex {
                p: glam::Vec3::from(p).as_dvec3(),
                face: NONE,
                boundary: false,
                regular: false,
            })
            .collect();
        for (index, face) in faces.iter().enumerate() {
            for &v in &face.v {
                vertices[v as usize].face = index as u32;
            }
        }
        let mut surface = Surface { vertices, faces };
        let mut ring = Vec::new();
        for v in 0..surface.vertices.len() {
            if surface.vertices[v].face == NONE {
                continue;
            }
            let boundary = surface.one_ring(v as u32, &mut ring);
            let vertex = &mut surface.vertices[v];
            vertex.boundary = boundary;
            vertex.regular = ring.len() == if boundary { 4 } else { 6 };
        }
        Ok(surface)
    }

    fn face(&self, index: u32) -> &Face {
        &self.faces[index as usize]
    }

    /// The neighbours of a vertex that has a face, in order; gives whether it lies on a boundary.
    fn one_ring(&self, v: u32, ring: &mut Vec<DVec3>) -> bool {
        ring.clear();
        let start = self.vertices[v as usize].face;
        let mut at = start;
        loop {
            ring.push(self.vertices[self.face(at).next_vertex(v) as usize].p);
            at = self.face(at).next_face(v);
            if at == start {
                return false;
            }
            if at == NONE {
                break;
            }
        }
        // A boundary: from its one end to the other.
        ring.clear();
        let mut at = start;
        loop {
            let next = self.face(at).next_face(v);
            if next == NONE {
                break;
            }
            at = next;
        }
        ring.push(self.vertices[self.face(at).next_vertex(v) as usize].p);
        while at != NONE {
            ring.push(self.vertices[self.face(at).previous_vertex(v) as usize].p);
            at = self.face(at).previous_face(v);
        }
        true
    }

    /// A boundary vertex moved towards its two neighbours on the boundary.
    fn boundary_rule(p: DVec3, ring: &[DVec3], weight: f64) -> DVec3 {
        (1.0 - 2.0 * weight) * p + weight * (ring[0] + ring[ring.len() - 1])
    }

    /// A vertex moved towards its neighbours.
    fn ring_rule(p: DVec3, ring: &[DVec3], weight: f64) -> DVec3 {
        let sum: DVec3 = ring.iter().sum();
        (1.0 - ring.len() as f64 * weight) * p + weight * sum
    }

    fn subdivided(&self) -> Surface {
        let mut ring = Vec::new();
        let mut vertices: Vec<Vertex> = Vec::with_capacity(4 * self.vertices.len());
        for (index, vertex) in self.vertices.iter().enumerate() {
            let mut child = *vertex;
            if vertex.face != NONE {
                self.one_ring(index as u32, &mut ring);
                child.p = if vertex.boundary {
                    Self::boundary_rule(vertex.p, &ring, 1.0 / 8.0)
                } else if vertex.regular {
                    Self::ring_rule(vertex.p, &ring, 1.0 / 16.0)
                } else {
                    Self::ring_rule(vertex.p, &ring, beta(ring.len()))
                };
                // The middle child of a face is its last; a corner's child is at its number.
                let number = self.face(vertex.face).number(index as u32) as u32;
                child.face = 4 * vertex.face + number;
            }
            vertices.push(child);
        }
        let mut on_edges: HashMap<(u32, u32), u32> = HashMap::new();
        let mut faces = Vec::with_capacity(4 * self.faces.len());
        for (index, face) in self.faces.iter().enumerate() {
            let middle = 4 * index as u32 + 3;
            let mut odd = [0; 3];
            for (edge, odd) in odd.iter_mut().enumerate() {
                let (a, b) = (face.v[edge], face.v[(edge + 1) % 3]);
                *odd = *on_edges.entry((a.min(b), a.max(b))).or_insert_with(|| {
                    let p = |v: u32| self.vertices[v as usize].p;
                    let across = face.across[edge];
                    let boundary = across == NONE;
                    let position = if boundary {
                        0.5 * (p(a) + p(b))
                    } else {
                        let opposite = face.other_vertex(a, b);
                        let beyond = self.face(across).other_vertex(a, b);
                        3.0 / 8.0 * (p(a) + p(b)) + 1.0 / 8.0 * (p(opposite) + p(beyond))
                    };
                    vertices.push(Vertex {
                        p: position,
                        face: middle,
                        boundary,
                        regular: true,
                    });
                    vertices.len() as u32 - 1
                });
            }
            for corner in 0..3 {
                // The children across the two outer edges: of the neighbour, the one at the same
                // vertex.
                let child_across = |edge: usize| match face.across[edge] {
                    NONE => NONE,
                    across => 4 * across + self.face(across).number(face.v[corner]) as u32,
                };
                let mut v = [0; 3];
                let mut across = [NONE; 3];
                v[corner] = face.v[corner];
                v[(corner + 1) % 3] = odd[corner];
                v[(corner + 2) % 3] = odd[(corner + 2) % 3];
                across[corner] = child_across(corner);
                across[(corner + 1) % 3] = middle;
                across[(corner + 2) % 3] = child_across((corner + 2) % 3);
                faces.push(Face { v, across });
            }
            // The middle child's edge from odd[i] to odd[i + 1] cuts off the corner i + 1.
            let first = 4 * index as u32;
            faces.push(Face {
                v: odd,
                across: [first + 1, first + 2, first],
            });
        }
        Surface { vertices, faces }
    }

    /// The points of the limit surface, and its normals there.
    fn limit(mut self) -> Geometry {
        let mut ring = Vec::new();
        let mut limits = Vec::with_capacity(self.vertices.len());
        for (index, vertex) in self.vertices.iter().enumerate() {
            limits.push(if vertex.face == NONE {
                vertex.p
            } else if self.one_ring(index as u32, &mut ring) {
                Self::boundary_rule(vertex.p, &ring, 1.0 / 5.0)
            } else {
                Self::ring_rule(vertex.p, &ring, gamma(ring.len()))
            });
        }
        for (vertex, p) in self.vertices.iter_mut().zip(limits) {
            vertex.p = p;
        }
        let mut normals = Vec::with_capacity(self.vertices.len());
        for (index, vertex) in self.vertices.iter().enumerate() {
            if vertex.face == NONE {
                normals.push([0.0; 3]);
                continue;
            }
            let boundary = self.one_ring(index as u32, &mut ring);
            let (s, t) = if boundary {
                boundary_tangents(vertex.p, &ring)
            } else {
                tangents(&ring)
            };
            normals.push(s.cross(t).as_vec3().into());
        }
        Geometry {
            positions: self.vertices.iter().map(|v| v.p.as_vec3().into()).collect(),
            triangles: self.faces.iter().map(|face| face.v).collect(),
            normals,
            uvs: Vec::new(),
        }
    }
}

/// Two directions in the tangent plane of a vertex inside the surface.
fn tangents(ring: &[DVec3]) -> (DVec3, DVec3) {
    let step = std::f64::consts::TAU / ring.len() as f64;
    ring.iter()
        .enumerate()
        .fold((DVec3::ZERO, DVec3::ZERO), |(s, t), (j, &p)| {
            let angle = step * j as f64;
            (s + angle.cos() * p, t + angle.sin() * p)
        })
}

/// Two directions in the tangent plane of a vertex on a boundary: along it, and across it.
fn boundary_tangents(p: DVec3, ring: &[DVec3]) -> (DVec3, DVec3) {
    let last = ring.len() - 1;
    let along = ring[last] - ring[0];
    let across = match ring.len() {
        2 => ring[0] + ring[1] - 2.0 * p,
        3 => ring[1] - p,
        4 => -ring[0] + 2.0 * ring[1] + 2.0 * ring[2] - ring[3] - 2.0 * p,
        count => {
            let theta = std::f64::consts::PI / (count - 1) as f64;
            let ends = theta.sin() * (ring[0] + ring[last]);
            let inner: DVec3 = (1..last)
                .map(|k| (2.0 * theta.cos() - 2.0) * (k as f64 * theta).sin() * ring[k])
                .sum();
            -(ends + inner)
        }
    };
    (along, across)
}

/// The weight of each of `valence` neighbours in a new position.
fn beta(valence: usize) -> f64 {
    if valence == 3 {
        3.0 / 16.0
    } else {
        3.0 / (8.0 * valence as f64)
    }
}

/// The weight of each of `valence` neighbours in the limit position.
fn gamma(valence: usize) -> f64 {
    1.0 / (valence as f64 + 3.0 / (8.0 * beta(valence)))
}

#[cfg(test)]
mod tests {
    use super::*;

    const TETRAHEDRON: [[f32; 3]; 4] =
        [[1., 1., 1.], [1., -1., -1.], [-1., 1., -1.], [-1., -1., 1.]];
    const SIDES: [[u32; 3]; 4] = [[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]];

    #[test]
    fn each_level_makes_four_triangles_of_one_and_keeps_the_surface_closed() {
        for levels in 0..4 {
            let g = loop_subdivide(&TETRAHEDRON, &SIDES, levels).unwrap();
            assert_eq!(g.triangles.len(), 4 << (2 * levels));
            assert_eq!(
                g.positions.len(),
                g.triangles.len() / 2 + 2,
                "Euler's formula"
            );
            let mut edges = std::collections::HashSet::new();
            for t in &g.triangles {
                for i in 0..3 {
                    assert!(edges.insert((t[i], t[(i + 1) % 3])));
                }
            }
            assert!(edges.iter().all(|&(a, b)| edges.contains(&(b, a))));
        }
    }

    #[test]
    fn limit_positions_do_not_depend_on_the_level() {
        let coarse = loop_subdivide(&TETRAHEDRON, &SIDES, 1).unwrap();
        let fine = loop_subdivide(&TETRAHEDRON, &SIDES, 3).unwrap();
        for (a, b) in coarse.positions.iter().zip(&fine.positions) {
            for axis in 0..3 {
                assert!((a[axis] - b[axis]).abs() < 1e-6, "{a:?} {b:?}");
            }
        }
    }

    #[test]
    fn a_flat_open_sheet_stays_flat_with_normals_across_it() {
        let mut positions = Vec::new();
        let mut triangles = Vec::new();
        for y in 0..4_u32 {
            for x in 0..4_u32 {
                positions.push([x as f32, y as f32, 0.0]);
                if x < 3 && y < 3 {
                    let a = 4 * y + x;
                    triangles.extend([[a, a + 1, a + 5], [a, a + 5, a + 4]]);
                }
            }
        }
        let g = loop_subdivide(&positions, &triangles, 2).unwrap();
        for (p, n) in g.positions.iter().zip(&g.normals) {
            assert!(p[2].abs() < 1e-6);
            assert!(
                n[0].abs() < 1e-6 && n[1].abs() < 1e-6 && n[2].abs() > 1e-3,
                "{n:?}"
            );
        }
        let sign = g.normals[0][2].signum();
        assert!(g.normals.iter().all(|n| n[2].signum() == sign));
    }

    #[test]
    fn edges_that_are_no_manifold_are_refused() {
        let same_way = [[0, 1, 2], [0, 1, 3]];
        assert!(loop_subdivide(&TETRAHEDRON, &same_way, 1).is_err());
    }
}
