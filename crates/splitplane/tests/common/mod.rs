#![allow(dead_code, reason = "not every test uses all of them")]
//! Scenes for tests, and saved trees.

use sha2::{Digest, Sha256};
use splitplane::{Mesh, Tree};

/// A small generator of random numbers (xorshift), so that scenes are the same everywhere.
pub(crate) struct Random(pub(crate) u64);

impl Random {
    pub(crate) fn next(&mut self) -> f32 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 40) as f32 / (1u64 << 24) as f32
    }

    pub(crate) fn point(&mut self, size: f32) -> [f32; 3] {
        std::array::from_fn(|_| (self.next() - 0.5) * size)
    }
}

/// Triangles of about that size, in a box of edge 2.
pub(crate) fn soup(count: usize, size: f32) -> Mesh {
    let mut random = Random(1);
    let mut positions = Vec::new();
    for _ in 0..count {
        let center = random.point(2.0);
        for _ in 0..3 {
            let offset = random.point(size);
            positions.push(std::array::from_fn(|i| center[i] + offset[i]));
        }
    }
    let triangles = (0..count as u32)
        .map(|i| [3 * i, 3 * i + 1, 3 * i + 2])
        .collect();
    Mesh::new(positions, triangles).unwrap()
}

/// A sphere of latitudes and longitudes, closed.
pub(crate) fn sphere(rings: u32) -> Mesh {
    let segments = 2 * rings;
    let mut positions = vec![[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]];
    for ring in 1..rings {
        let polar = std::f32::consts::PI * ring as f32 / rings as f32;
        for segment in 0..segments {
            let azimuth = std::f32::consts::TAU * segment as f32 / segments as f32;
            positions.push([
                polar.sin() * azimuth.cos(),
                polar.sin() * azimuth.sin(),
                polar.cos(),
            ]);
        }
    }
    let at = |ring: u32, segment: u32| 2 + (ring - 1) * segments + segment % segments;
    let mut triangles = Vec::new();
    for segment in 0..segments {
        triangles.push([0, at(1, segment), at(1, segment + 1)]);
        triangles.push([1, at(rings - 1, segment + 1), at(rings - 1, segment)]);
        for ring in 1..rings - 1 {
            let (a, b) = (at(ring, segment), at(ring, segment + 1));
            let (c, d) = (at(ring + 1, segment), at(ring + 1, segment + 1));
            triangles.extend([[a, c, d], [a, d, b]]);
        }
    }
    Mesh::new(positions, triangles).unwrap()
}

/// A tree as a file holds it.
pub(crate) fn saved(tree: &Tree) -> Vec<u8> {
    let mut bytes = Vec::new();
    tree.write_to(&mut bytes).unwrap();
    bytes
}

/// The same content with the sum that it should have.
pub(crate) fn with_sum(mut bytes: Vec<u8>) -> Vec<u8> {
    let content = bytes.len() - 32;
    let sum = Sha256::digest(&bytes[..content]);
    bytes[content..].copy_from_slice(&sum);
    bytes
}
