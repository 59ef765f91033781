#![allow(dead_code, reason = "not every example uses all of them")]
//! Meshes and a few vectors for the examples.

use splitplane::{Mesh, MeshError};

/// A closed torus around the z axis: `radius` from its centre to that of the tube.
pub(crate) fn torus(
    center: [f32; 3],
    radius: f32,
    tube: f32,
    segments: u32,
) -> Result<Mesh, MeshError> {
    let angle = |i: u32| std::f32::consts::TAU * i as f32 / segments as f32;
    let positions = (0..segments * segments)
        .map(|i| {
            let (around, across) = (angle(i / segments), angle(i % segments));
            let far = radius + tube * across.cos();
            let [x, y, z] = center;
            [
                x + far * around.cos(),
                y + far * around.sin(),
                z + tube * across.sin(),
            ]
        })
        .collect();
    let at = |i: u32, j: u32| (i % segments) * segments + j % segments;
    let triangles = (0..segments * segments)
        .flat_map(|k| {
            let (i, j) = (k / segments, k % segments);
            let (a, b, c, d) = (at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1));
            [[a, b, c], [a, c, d]]
        })
        .collect();
    Mesh::new(positions, triangles)
}

/// A square in the plane z = `height`, seen from above.
pub(crate) fn floor(height: f32, half: f32) -> Result<Mesh, MeshError> {
    let positions = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
        .map(|(x, y): (f32, f32)| [x * half, y * half, height]);
    Mesh::new(positions.to_vec(), vec![[0, 1, 2], [0, 2, 3]])
}

pub(crate) fn add(a: [f32; 3], b: [f32; 3], scale: f32) -> [f32; 3] {
    std::array::from_fn(|i| a[i] + scale * b[i])
}

pub(crate) fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(crate) fn unit(a: [f32; 3]) -> [f32; 3] {
    a.map(|c| c / dot(a, a).sqrt())
}

/// Two unit vectors across a unit vector.
pub(crate) fn across([x, y, z]: [f32; 3]) -> [[f32; 3]; 2] {
    let sign = 1f32.copysign(z);
    let a = -1.0 / (sign + z);
    let b = x * y * a;
    [
        [1.0 + sign * x * x * a, sign * b, -sign * x],
        [b, sign + y * y * a, -y],
    ]
}

/// The `i`th of `n` directions over the half-space of a unit vector, distributed by the cosine.
pub(crate) fn hemisphere(normal: [f32; 3], i: u32, n: u32) -> [f32; 3] {
    // A spiral of equal steps in area, by the golden angle.
    let share = (i as f32 + 0.5) / n as f32;
    let angle = i as f32 * 2.399_963;
    let [s, t] = across(normal);
    let (x, y) = (share.sqrt() * angle.cos(), share.sqrt() * angle.sin());
    let up = (1.0 - share).sqrt();
    std::array::from_fn(|k| x * s[k] + y * t[k] + up * normal[k])
}

/// A grey picture as a PGM file, rows from the top, values from 0 to 1.
pub(crate) fn write_pgm(path: &str, width: usize, values: &[f32]) -> Result<(), String> {
    let mut bytes = format!("P5 {width} {} 255\n", values.len() / width).into_bytes();
    bytes.extend(
        values
            .iter()
            .map(|v| (v.clamp(0.0, 1.0) * 255.0 + 0.5) as u8),
    );
    write(path, &bytes)
}

/// A file; the error names it.
pub(crate) fn write(path: &str, bytes: &[u8]) -> Result<(), String> {
    std::fs::write(path, bytes).map_err(|error| format!("{path} cannot be written: {error}"))
}
