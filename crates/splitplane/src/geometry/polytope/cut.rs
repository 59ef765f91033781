//! Cutting a polytope by a plane.

use glam::DVec3;

use super::Polytope;

/// More vertices than this and a polytope is no longer cut: its children keep its shape, which
/// bounds them.
const MAX_VERTICES: usize = 192;

const ABSENT: u16 = u16::MAX;

/// Buffers for cutting, to be used again and again.
#[derive(Debug, Default)]
pub(crate) struct CutScratch {
    heights: Vec<f64>,
    crossings: Vec<Crossing>,
    /// Edges of the cap, from crossing to crossing, as the faces of the lower part run.
    segments: Vec<(u16, u16)>,
    cap: Vec<u16>,
    below: PartScratch,
    above: PartScratch,
    /// Polytopes that are done with: their memory is used again.
    spare: Vec<Polytope>,
}

/// More spare polytopes than this are given back: a path of a tree has no more alive.
const MAX_SPARE: usize = 256;

impl CutScratch {
    /// Takes a polytope that is done with.
    pub(crate) fn recycle(&mut self, polytope: Polytope) {
        if self.spare.len() < MAX_SPARE {
            self.spare.push(polytope);
        }
    }
}

/// What one side needs while it is made.
#[derive(Debug, Default)]
struct PartScratch {
    /// The index in the part of each vertex of the source.
    kept: Vec<u16>,
    /// The index in the part of each crossing.
    crossed: Vec<u16>,
    /// The loop of the face that is being made.
    face: Vec<u16>,
}

/// Where the plane meets an edge.
#[derive(Clone, Copy, Debug)]
enum Crossing {
    /// In a vertex that lies in the plane.
    Vertex(u16),
    /// Between two vertices.
    Edge {
        below: u16,
        above: u16,
        point: DVec3,
    },
}

impl Polytope {
    /// Cuts the polytope by `normal · x = offset` into the part below and the part above; only those
    /// that are wanted are made.
    ///
    /// `None` where the plane misses it, or where rounding has made a polytope so thin that its
    /// cap does not close.
    pub(crate) fn cut(
        &self,
        normal: DVec3,
        offset: f64,
        wanted: [bool; 2],
        scratch: &mut CutScratch,
    ) -> Option<[Option<Polytope>; 2]> {
        if self.vertices.len() > MAX_VERTICES {
            return None;
        }
        let CutScratch {
            heights,
            crossings,
            segments,
            cap,
            below,
            above,
            spare,
        } = scratch;
        heights.clear();
        heights.extend(self.vertices.iter().map(|v| normal.dot(*v) - offset));
        crossings.clear();
        segments.clear();
        let mut below = Part::new(self, wanted[0], below, spare);
        let mut above = Part::new(self, wanted[1], above, spare);
        // The vertices in the plane count as below: one consistent choice is what makes the two
        // parts close.
        let is_below = |vertex: u16| heights[usize::from(vertex)] <= 0.0;
        for face in &self.faces {
            let indices = self.indices(face);
            let (mut leaves, mut enters) = (None, None);
            for (k, &i) in indices.iter().enumerate() {
                let j = indices[if k + 1 == indices.len() { 0 } else { k + 1 }];
                let part = if is_below(i) { &mut below } else { &mut above };
                part.keep(i);
                if is_below(i) != is_below(j) {
                    let crossing = self.crossing(heights, crossings, i, j);
                    let end = if is_below(i) {
                        &mut leaves
                    } else {
                        &mut enters
                    };
                    if end.replace(crossing).is_some() {
                        return None;
                    }
                    below.cross(crossing, crossings);
                    above.cross(crossing, crossings);
                }
            }
            below.end_face(face.normal);
            above.end_face(face.normal);
            if let (Some(leaves), Some(enters)) = (leaves, enters)
                && leaves != enters
            {
                segments.push((leaves, enters));
            }
        }
        chain(segments, cap)?;
        // A face of the lower part runs along its segment; the cap that closes that part runs the
        // other way.
        let normal = normal.normalize();
        cap.iter()
            .for_each(|&crossing| above.cross(crossing, crossings));
        above.end_face(-normal);
        cap.iter()
            .rev()
            .for_each(|&crossing| below.cross(crossing, crossings));
        below.end_face(normal);
        let [below, above] = [below, above].map(|part| part.wanted.then_some(part.polytope));
        Some([below, above])
    }

    /// The index of the crossing of an edge.
    fn crossing(&self, heights: &[f64], crossings: &mut Vec<Crossing>, i: u16, j: u16) -> u16 {
        let height = |vertex: u16| heights[usize::from(vertex)];
        let (low, high) = if height(i) <= 0.0 { (i, j) } else { (j, i) };
        let found = crossings.iter().position(|crossing| match *crossing {
            Crossing::Vertex(vertex) => height(low) == 0.0 && vertex == low,
            Crossing::Edge { below, above, .. } => (below, above) == (low, high),
        });
        found.unwrap_or_else(|| {
            crossings.push(if height(low) == 0.0 {
                Crossing::Vertex(low)
            } else {
                let (p, q) = (
                    self.vertices[usize::from(low)],
                    self.vertices[usize::from(high)],
                );
                let point = p + (q - p) * (height(low) / (height(low) - height(high)));
                Crossing::Edge {
                    below: low,
                    above: high,
                    point,
                }
            });
            crossings.len() - 1
        }) as u16
    }
}

/// Chains the segments to one closed loop.
fn chain(segments: &[(u16, u16)], cap: &mut Vec<u16>) -> Option<()> {
    cap.clear();
    let &(start, mut at) = segments.first()?;
    cap.push(start);
    while at != start {
        cap.push(at);
        if cap.len() > segments.len() {
            return None;
        }
        at = segments.iter().find(|segment| segment.0 == at)?.1;
    }
    (cap.len() == segments.len() && cap.len() >= 3).then_some(())
}

/// One side of a polytope that is being cut.
struct Part<'a> {
    source: &'a Polytope,
    wanted: bool,
    polytope: Polytope,
    scratch: &'a mut PartScratch,
}

impl<'a> Part<'a> {
    fn new(
        source: &'a Polytope,
        wanted: bool,
        scratch: &'a mut PartScratch,
        spare: &mut Vec<Polytope>,
    ) -> Self {
        scratch.kept.clear();
        scratch.kept.resize(source.vertices.len(), ABSENT);
        scratch.crossed.clear();
        scratch.face.clear();
        let mut polytope = match wanted {
            true => spare.pop().unwrap_or_default(),
            false => Polytope::default(),
        };
        polytope.clear();
        Part {
            source,
            wanted,
            polytope,
            scratch,
        }
    }

    fn keep(&mut self, vertex: u16) {
        if !self.wanted {
            return;
        }
        let slot = &mut self.scratch.kept[usize::from(vertex)];
        if *slot == ABSENT {
            *slot = self.polytope.vertices.len() as u16;
            self.polytope
                .vertices
                .push(self.source.vertices[usize::from(vertex)]);
        }
        let index = *slot;
        self.extend(index);
    }

    fn cross(&mut self, crossing: u16, crossings: &[Crossing]) {
        if !self.wanted {
            return;
        }
        let point = match crossings[usize::from(crossing)] {
            Crossing::Vertex(vertex) => return self.keep(vertex),
            Crossing::Edge { point, .. } => point,
        };
        let crossed = &mut self.scratch.crossed;
        if crossed.len() < crossings.len() {
            crossed.resize(crossings.len(), ABSENT);
        }
        let slot = &mut crossed[usize::from(crossing)];
        if *slot == ABSENT {
            *slot = self.polytope.vertices.len() as u16;
            self.polytope.vertices.push(point);
        }
        let index = *slot;
        self.extend(index);
    }

    fn extend(&mut self, index: u16) {
        if self.scratch.face.last() != Some(&index) {
            self.scratch.face.push(index);
        }
    }

    fn end_face(&mut self, normal: DVec3) {
        let face = &mut self.scratch.face;
        while face.len() > 1 && face.first() == face.last() {
            face.pop();
        }
        if face.len() >= 3 {
            self.polytope.push_face(normal, face);
        }
        face.clear();
    }
}
