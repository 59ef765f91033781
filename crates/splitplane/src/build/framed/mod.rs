//! The tree `framed`: boxes along frames that come from the normals, space and triangles divided.
//!
//! What a node's triangles are cut down to lies in boxes (references), and the boxes of both
//! children are those around them: tight, with no empty space to be cut off. A node is divided
//! either by a plane across one of its frame's axes, which cuts references in two [Stich2009], or
//! by the centres of the references, which leaves them whole. The plane is better where triangles
//! are large, the centres where they are many; that boxes of children overlap is charged, and where
//! they would by much, only the plane is allowed. Where another frame fits the normals of a subtree
//! so much better that its boxes shrink, the subtree goes on in that frame.

mod bins;
mod frames;
mod split;

use glam::{DVec3, Vec3A};

use super::built::{Built, BuiltNode};
use super::grow::{ASKED_FROM, PARALLEL_FROM};
use super::params::BuildParams;
use super::watch::{self, WHOLE, Watched};
use crate::geometry::frame::round_outward;
use crate::geometry::polygon::Polygon;
use crate::geometry::{Aabb, Frame, Mesh};
use crate::tree::wide::{MAX_FRAMES, WIDTH, leaf_cost};
use split::{Scratch, Split};

/// Cost of a visit of a node, and of a full leaf.
const NODE_COST: f32 = 0.3;
const LEAF_COST: f32 = 2.0;

/// Cutting may give this many references for each triangle, at most, on top of the first one.
const MAX_CUTS: usize = 3;

/// No subtree changes its frame more often.
const MAX_CHANGES: u32 = 2;
/// Below this many references a change of frame is not looked for.
const CHANGE_FROM: usize = 64;
/// How far from the frame's axes normals are, on average, for a change to be looked for: by how
/// much the sum of a unit normal's components exceeds 1.
const MISFIT: f32 = 0.05;
/// A change must make the sum of the references' boxes smaller than this, in units of that before.
const SHRINKS_TO: f32 = 0.8;
/// How many references a change is judged by.
const SAMPLE: usize = 128;

/// Below this depth triangles are divided evenly, so that no tree is too deep.
const MAX_DEPTH: u32 = BuildParams::MAX_DEPTH - 40;

/// What of a triangle lies in a node: its box, in the node's frame.
#[derive(Clone, Copy, Debug)]
pub(super) struct Reference {
    pub(super) min: Vec3A,
    pub(super) max: Vec3A,
    pub(super) triangle: u32,
    /// What of the triangle was left when the frame last changed: an index into
    /// [`Place::pieces`]; `NONE`: all of it.
    piece: u32,
}

const NONE: u32 = u32::MAX;

impl Reference {
    /// The sum of the coordinates of both corners: a centre.
    fn center(&self) -> Vec3A {
        self.min + self.max
    }
}

/// A box that grows.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bounds {
    pub(super) min: Vec3A,
    pub(super) max: Vec3A,
}

impl Bounds {
    const EMPTY: Bounds = Bounds {
        min: Vec3A::INFINITY,
        max: Vec3A::NEG_INFINITY,
    };

    fn of(references: &[Reference]) -> Bounds {
        references.iter().fold(Bounds::EMPTY, |bounds, reference| {
            bounds.union(reference.min, reference.max)
        })
    }

    #[inline(always)]
    fn union(self, min: Vec3A, max: Vec3A) -> Bounds {
        Bounds {
            min: self.min.min(min),
            max: self.max.max(max),
        }
    }

    /// Half the surface area; 0 for an empty box.
    #[inline(always)]
    fn half_area(&self) -> f32 {
        let e = (self.max - self.min).max(Vec3A::ZERO);
        e.x * e.y + e.y * e.z + e.z * e.x
    }

    fn aabb(&self) -> Aabb {
        Aabb {
            min: self.min.into(),
            max: self.max.into(),
        }
    }
}

/// What all nodes of a subtree of one frame share.
struct Place {
    frame: u32,
    changes: u32,
    /// Parts of triangles, in the world's coordinates, that references of other frames left.
    pieces: Vec<Polygon>,
}

struct Node {
    references: Vec<Reference>,
    bounds: Bounds,
    depth: u32,
    /// How many references may still be added by cutting.
    cuts: usize,
    /// The node's share of the work.
    share: u64,
}

struct Builder<'a> {
    mesh: &'a Mesh,
    watched: &'a Watched<'a>,
    frames: Vec<Frame>,
    /// The normals of the mesh's triangles, as long as their areas; none if there is one frame.
    normals: Vec<[f32; 3]>,
    reach: f64,
}

/// Builds the tree, on the threads of the current rayon pool; `None` if it was cancelled.
pub(super) fn grow(mesh: &Mesh, watched: &Watched) -> Option<Built> {
    let mut builder = Builder {
        mesh,
        watched,
        frames: frames::find(mesh, MAX_FRAMES),
        normals: Vec::new(),
        reach: f64::from(mesh.bounds().reach()),
    };
    if builder.frames.len() > 1 {
        builder.normals = (0..mesh.triangles().len() as u32)
            .map(|i| mesh.normal(i).map(|c| c * mesh.area(i) as f32))
            .collect();
    }
    let references: Vec<Reference> = mesh
        .usable_triangles()
        .iter()
        .map(|&triangle| {
            let own = Aabb::of_points(mesh.corners(triangle));
            Reference {
                min: own.min.into(),
                max: own.max.into(),
                triangle,
                piece: NONE,
            }
        })
        .collect();
    let mut built = Built::default();
    let root = Node {
        bounds: Bounds::of(&references),
        depth: 0,
        cuts: MAX_CUTS * references.len(),
        share: WHOLE,
        references,
    };
    let world = Place {
        frame: Frame::WORLD,
        changes: 0,
        pieces: Vec::new(),
    };
    builder.grow(root, &world, &mut built, &mut Scratch::default());
    built.frames = builder.frames;
    (!watched.is_stopped()).then_some(built)
}

/// What so many references will cost where they are met, in units of a full leaf.
#[inline(always)]
pub(super) fn cost_of(count: usize) -> f32 {
    // Of a single leaf, or of as many full ones as they fill.
    leaf_cost(count).max(count as f32 / WIDTH as f32)
}

impl Builder<'_> {
    /// Appends the subtree of `node`.
    fn grow(&self, node: Node, place: &Place, built: &mut Built, scratch: &mut Scratch) {
        built.bounds(node.bounds.aabb());
        match self.change_frame(&node, place) {
            Some((node, place)) => self.grow_in_frame(node, &place, built, scratch),
            None => self.grow_in_frame(node, place, built, scratch),
        }
    }

    fn grow_in_frame(&self, node: Node, place: &Place, built: &mut Built, scratch: &mut Scratch) {
        let area = 2.0 * f64::from(node.bounds.half_area());
        let stopped = node.references.len() >= ASKED_FROM && self.watched.ask();
        let split = match node.depth < MAX_DEPTH {
            _ if stopped => None,
            true => split::find(&node.references, &node.bounds, node.cuts, scratch),
            false if node.references.len() <= WIDTH => None,
            false => Some(Split::Even),
        };
        built.stats.candidates += std::mem::take(&mut scratch.candidates);
        let Some(split) = split.filter(|_| node.depth < BuildParams::MAX_DEPTH) else {
            // In the mesh's order, as in every tree.
            let mut triangles: Vec<u32> = node.references.iter().map(|r| r.triangle).collect();
            triangles.sort_unstable();
            triangles.dedup();
            built.leaf(triangles.into_iter(), area);
            self.watched.finished(node.share, node.references.len());
            return;
        };
        match place.frame {
            Frame::WORLD => built.stats.wins.axis += 1,
            _ => built.stats.wins.direction += 1,
        }
        let (below, above) = self.divide(node, split, place);
        built.join(
            (
                |above| BuiltNode::Objects {
                    above,
                    frame: place.frame,
                },
                area,
            ),
            below.references.len().min(above.references.len()) >= PARALLEL_FROM,
            scratch,
            |built, scratch| self.grow(below, place, built, scratch),
            |built, scratch| self.grow(above, place, built, scratch),
        );
    }

    /// What is left of a reference's triangle, before its box in this frame, in the world.
    fn piece(&self, reference: &Reference, place: &Place) -> Polygon {
        match reference.piece {
            NONE => {
                let corners = self.mesh.corners(reference.triangle);
                Polygon::new(&corners.map(|p| glam::Vec3::from(p).as_dvec3()))
            }
            piece => place.pieces[piece as usize],
        }
    }

    /// A polygon of the world in a frame.
    fn in_frame(&self, polygon: &Polygon, frame: u32) -> Polygon {
        match frame {
            Frame::WORLD => *polygon,
            _ => polygon.map(|p| self.frames[frame as usize].map(p.into()).into()),
        }
    }

    /// The box around a polygon of a frame; `None` where it is empty.
    fn bounds(&self, polygon: &Polygon) -> Option<Bounds> {
        let (min, max) = polygon.bounds()?;
        // Coordinates in a frame are up to √3 times as large.
        let aabb = round_outward(min, max, 2.0 * self.reach);
        Some(Bounds {
            min: aabb.min.into(),
            max: aabb.max.into(),
        })
    }

    /// The two children of a node.
    fn divide(&self, node: Node, split: Split, place: &Place) -> (Node, Node) {
        let n = node.references.len();
        let mut sides = [Vec::new(), Vec::new()];
        match split {
            Split::Even => {
                let mut references = node.references;
                let axis = longest_axis(&node.bounds);
                references.sort_unstable_by(|a, b| {
                    (a.center()[axis].total_cmp(&b.center()[axis]))
                        .then(a.triangle.cmp(&b.triangle))
                });
                sides[1] = references.split_off(references.len() / 2);
                sides[0] = references;
            }
            Split::Centers { axis, at } => {
                for reference in node.references {
                    sides[usize::from(reference.center()[axis] >= at)].push(reference);
                }
            }
            Split::Plane {
                axis,
                at,
                flat_below,
            } => {
                for reference in node.references {
                    let (min, max) = (reference.min[axis], reference.max[axis]);
                    if min < at && at < max {
                        let parts = self.cut(&reference, axis, at, place);
                        for (side, part) in sides.iter_mut().zip(parts) {
                            side.extend(part);
                        }
                    } else {
                        let is_below = max < at || (max == at && (min < at || flat_below));
                        sides[usize::from(!is_below)].push(reference);
                    }
                }
            }
        }
        let total = sides[0].len() + sides[1].len();
        let cuts = node.cuts.saturating_sub(total.saturating_sub(n));
        let shares = watch::divide(node.share, sides[0].len(), sides[1].len());
        let child = |references: Vec<Reference>, share| Node {
            bounds: Bounds::of(&references),
            depth: node.depth + 1,
            cuts: cuts * references.len() / total.max(1),
            references,
            share,
        };
        let [below, above] = sides;
        (child(below, shares.0), child(above, shares.1))
    }

    /// Both parts of a reference that a plane passes through.
    fn cut(
        &self,
        reference: &Reference,
        axis: usize,
        at: f32,
        place: &Place,
    ) -> [Option<Reference>; 2] {
        let mut polygon = self.in_frame(&self.piece(reference, place), place.frame);
        cut_to(&mut polygon, &(reference.min.into(), reference.max.into()));
        [1.0, -1.0].map(|sign| {
            let mut part = polygon;
            part.cut(|p| sign * (p[axis] - f64::from(at)));
            let found = self.bounds(&part)?;
            let mut part = Reference {
                min: reference.min.max(found.min),
                max: reference.max.min(found.max),
                ..*reference
            };
            match sign > 0.0 {
                true => part.max[axis] = part.max[axis].min(at),
                false => part.min[axis] = part.min[axis].max(at),
            }
            // Rounding may leave a box without inside, never less than a point.
            part.min = part.min.min(part.max);
            Some(part)
        })
    }

    /// The same node in the frame that fits its normals best, if that is worth it.
    fn change_frame(&self, node: &Node, place: &Place) -> Option<(Node, Place)> {
        let n = node.references.len();
        if self.frames.len() < 2 || place.changes >= MAX_CHANGES || n < CHANGE_FROM {
            return None;
        }
        let step = n.div_ceil(SAMPLE);
        let sample = || node.references.iter().step_by(step);
        let total: f32 = sample()
            .map(|r| Vec3A::from(self.normals[r.triangle as usize]).length())
            .sum();
        let misfit = |frame: usize| {
            let rows = self.frames[frame].rows.map(Vec3A::from);
            let along: f32 = sample()
                .map(|r| {
                    let normal = Vec3A::from(self.normals[r.triangle as usize]);
                    rows.iter().map(|row| row.dot(normal).abs()).sum::<f32>()
                })
                .sum();
            along / total - 1.0
        };
        let now = misfit(place.frame as usize);
        if now < MISFIT || now.is_nan() {
            return None;
        }
        let (best, frame) = (0..self.frames.len())
            .map(|frame| (misfit(frame), frame as u32))
            .min_by(|a, b| a.0.total_cmp(&b.0))?;
        if best > now - MISFIT {
            return None;
        }
        let turned = |reference: &Reference| {
            let mut polygon = self.piece(reference, place);
            let before = polygon;
            let rows = &self.frames[place.frame as usize];
            let (min, max): (DVec3, DVec3) = (reference.min.as_dvec3(), reference.max.as_dvec3());
            for (axis, row) in rows.rows.iter().enumerate() {
                let row = glam::Vec3::from(*row).as_dvec3();
                polygon.cut(|p| row.dot(p) - max[axis]);
                polygon.cut(|p| min[axis] - row.dot(p));
            }
            // Rounding may leave nothing of a thin part.
            match polygon.corners().is_empty() {
                true => before,
                false => polygon,
            }
        };
        let (mut before, mut after) = (0.0, 0.0);
        for reference in sample() {
            let own = Bounds {
                min: reference.min,
                max: reference.max,
            };
            before += own.half_area();
            let polygon = self.in_frame(&turned(reference), frame);
            after += self
                .bounds(&polygon)
                .map_or(0.0, |bounds| bounds.half_area());
        }
        let gain = LEAF_COST * (before - after) * step as f32 / 4.0;
        if after >= SHRINKS_TO * before || gain <= node.bounds.half_area() {
            return None;
        }
        let mut pieces = Vec::new();
        let references: Vec<Reference> = (node.references.iter())
            .filter_map(|reference| {
                let polygon = turned(reference);
                let bounds = self.bounds(&self.in_frame(&polygon, frame))?;
                let is_whole = reference.piece == NONE
                    && polygon.corners() == self.piece(reference, place).corners();
                let piece = match is_whole {
                    true => NONE,
                    false => {
                        pieces.push(polygon);
                        pieces.len() as u32 - 1
                    }
                };
                Some(Reference {
                    min: bounds.min,
                    max: bounds.max,
                    triangle: reference.triangle,
                    piece,
                })
            })
            .collect();
        let changed = Node {
            bounds: Bounds::of(&references),
            references,
            ..*node
        };
        let place = Place {
            frame,
            changes: place.changes + 1,
            pieces,
        };
        Some((changed, place))
    }
}

fn longest_axis(bounds: &Bounds) -> usize {
    let extent = bounds.max - bounds.min;
    (1..3).fold(0, |longest, axis| match extent[axis] > extent[longest] {
        true => axis,
        false => longest,
    })
}

/// Keeps what of a polygon lies in a box.
fn cut_to(polygon: &mut Polygon, (min, max): &(glam::Vec3, glam::Vec3)) {
    for axis in 0..3 {
        let (min, max) = (f64::from(min[axis]), f64::from(max[axis]));
        polygon.cut(|p| p[axis] - max);
        polygon.cut(|p| min - p[axis]);
    }
}
