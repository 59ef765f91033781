//! The areas of a cell's two parts under a plane that moves along one direction.

use glam::DVec3;

use super::{Aim, Polytope};

/// The areas of a cell's two parts as functions of the plane's offset along one direction:
/// quadratics from vertex to vertex [Budge2008]. A buffer to be filled again and again.
#[derive(Debug, Default)]
pub(crate) struct Profile {
    area: f64,
    pieces: Vec<Piece>,
    /// The piece of the last offset that was asked for.
    current: usize,
    /// The vertices, by height.
    order: Vec<u16>,
    /// Where each vertex stands in `order`.
    rank: Vec<u16>,
}

/// Two quadratics in `t - middle`, by their coefficients: the area of the surface below, and that
/// of the cross-section.
#[derive(Clone, Copy, Debug, Default)]
struct Piece {
    end: f64,
    middle: f64,
    below: [f64; 3],
    cap: [f64; 3],
}

impl Profile {
    /// For a polytope along the unit direction d, at which `aim` is.
    ///
    /// A face with the unit normal n meets the plane at t in a segment of width w(t), which is
    /// linear between two vertices. With c = n·d, s = √(1 - c²), and h(t) the distance of that
    /// segment from a fixed line along d, the area below grows by w/s, and the cross-section is
    /// ½ Σ h w. The width is summed over half-edges: those that rise along the face's loop are at
    /// its far end along u = (d × n)/s, those that fall at its near end.
    pub(crate) fn fill_polytope(&mut self, polytope: &Polytope, direction: DVec3, aim: &Aim) {
        let vertices = &polytope.vertices;
        self.area = polytope.surface_area();
        self.current = 0;
        let heights = &aim.heights;
        self.order.clear();
        self.order.extend(0..vertices.len() as u16);
        self.order
            .sort_unstable_by(|&i, &j| heights[usize::from(i)].total_cmp(&heights[usize::from(j)]));
        self.rank.clear();
        self.rank.resize(vertices.len(), 0);
        for (rank, &vertex) in self.order.iter().enumerate() {
            self.rank[usize::from(vertex)] = rank as u16;
        }
        self.pieces.clear();
        self.pieces.extend(self.order.windows(2).map(|pair| {
            let [start, end] = [pair[0], pair[1]].map(|i| heights[usize::from(i)]);
            Piece {
                end,
                middle: 0.5 * (start + end),
                ..Piece::default()
            }
        }));

        // Coordinates relative to a point inside: differences of large numbers lose digits.
        let center = vertices.iter().sum::<DVec3>() / vertices.len() as f64;
        let center_height = direction.dot(center);
        let mut below = 0.0;
        for face in &polytope.faces {
            let tangent = direction.cross(face.normal);
            let sine_squared = tangent.length_squared();
            let cosine = face.normal.dot(direction);
            if sine_squared < 1e-16 {
                // Across the direction: it closes the polytope at one end.
                if cosine < 0.0 {
                    below += face.area;
                }
                continue;
            }
            let per_sine = 1.0 / sine_squared.sqrt();
            let tangent = tangent * per_sine;
            let indices = polytope.indices(face);
            let across = |i: usize| tangent.dot(vertices[i] - center);
            let reach = face.normal.dot(vertices[usize::from(indices[0])] - center) * per_sine;
            let h_slope = -cosine * per_sine;
            let mut i = usize::from(indices[indices.len() - 1]);
            let mut across_i = across(i);
            for &j in indices {
                let j = usize::from(j);
                let across_j = across(j);
                // A falling edge counts against the width: seen from its low end, reversed.
                let (low, high, at_low, at_high) = match self.rank[i] < self.rank[j] {
                    true => (i, j, across_i, across_j),
                    false => (j, i, -across_j, -across_i),
                };
                (i, across_i) = (j, across_j);
                let rise = heights[high] - heights[low];
                if rise <= 0.0 {
                    continue;
                }
                let per_rise = 1.0 / rise;
                let gain = at_high - at_low;
                let slope = gain * per_rise;
                let (from, to) = (usize::from(self.rank[low]), usize::from(self.rank[high]));
                for piece in &mut self.pieces[from..to] {
                    // Between its values at the ends, however short the edge is.
                    let width = at_low + gain * ((piece.middle - heights[low]) * per_rise);
                    let h = reach + h_slope * (piece.middle - center_height);
                    piece.below[1] += per_sine * width;
                    piece.below[2] += per_sine * slope;
                    piece.cap[0] += h * width;
                    piece.cap[1] += h * slope + h_slope * width;
                    piece.cap[2] += h_slope * slope;
                }
            }
        }
        let mut start = aim.extent.low;
        for piece in &mut self.pieces {
            let half = 0.5 * (piece.end - start);
            start = piece.end;
            let [at_middle, rate, slope] = &mut piece.below;
            *at_middle = below + half * (*rate - 0.5 * half * *slope);
            below += 2.0 * half * *rate;
            *slope *= 0.5;
            piece.cap = piece.cap.map(|c| 0.5 * c);
        }
    }

    /// The areas of the cells below and above the plane at `t`, as fractions of the cell's.
    /// Offsets must ascend from call to call, strictly inside the cell.
    #[inline]
    pub(crate) fn areas(&mut self, t: f64) -> (f64, f64) {
        while t > self.pieces[self.current].end && self.current + 1 < self.pieces.len() {
            self.current += 1;
        }
        let piece = &self.pieces[self.current];
        let x = t - piece.middle;
        let value = |c: &[f64; 3]| c[0] + x * (c[1] + x * c[2]);
        let below = value(&piece.below).clamp(0.0, self.area);
        let cap = value(&piece.cap).max(0.0);
        (
            (below + cap) / self.area,
            (self.area - below + cap) / self.area,
        )
    }
}
