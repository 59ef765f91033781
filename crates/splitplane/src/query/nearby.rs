//! What lies near a point or a box: closest points and overlaps.

use std::ops::ControlFlow;

use super::traverse::{OfMesh, Search, Triangle};
use super::{Counters, NONE};
use crate::build::BuildParams;
use crate::geometry::proximity::{Nearest, nearest_on_triangle, overlaps_box};
use crate::geometry::triangle::{difference, dot};
use crate::geometry::{Aabb, Frame, Mesh};
use crate::tree::nodes::{Layout, View};
use crate::tree::wide::{Child, Link, WIDTH, Wide};
use crate::tree::{Tree, with_nodes};

/// The point of a mesh that is nearest to another point.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ClosestPoint {
    /// Where it is, in scene units.
    pub point: [f32; 3],
    /// How far it is, in scene units.
    pub distance: f32,
    /// Barycentric weight of the triangle's second vertex, in `[0, 1]`.
    pub u: f32,
    /// Barycentric weight of the triangle's third vertex, in `[0, 1]`.
    pub v: f32,
    /// Index of the triangle in the mesh.
    pub triangle: u32,
}

/// What the distances are measured from: a box, or a point, which is one without extent.
#[derive(Clone, Copy)]
struct Probe {
    center: [f64; 3],
    half: [f64; 3],
}

impl Probe {
    fn point(point: [f32; 3]) -> Self {
        Probe {
            center: point.map(f64::from),
            half: [0.0; 3],
        }
    }

    fn of(region: &Aabb) -> Self {
        let middle = |sign: f64| {
            let ends = |i: usize| (f64::from(region.min[i]), f64::from(region.max[i]));
            std::array::from_fn(|i| 0.5 * ends(i).1 + 0.5 * sign * ends(i).0)
        };
        Probe {
            center: middle(1.0),
            half: middle(-1.0),
        }
    }

    /// The probe in a frame: its box there.
    fn in_frame(&self, frame: u32, frames: &[Frame]) -> Local {
        if frame == Frame::WORLD {
            return Local {
                probe: *self,
                scale: 1.0,
            };
        }
        let frame = &frames[frame as usize];
        let rows = frame.rows.map(|row| row.map(f64::from));
        // No vector is longer in the frame than by the root of this: no eigenvalue of a symmetric
        // matrix is larger than its largest sum of a row [GolubVanLoan2013, 7.2].
        let sums = rows.map(|a| rows.iter().map(|&b| dot(a, b).abs()).sum());
        let longest: f64 = sums.into_iter().fold(0.0, f64::max);
        Local {
            probe: Probe {
                center: frame.map(self.center),
                half: rows.map(|row| (0..3).map(|i| row[i].abs() * self.half[i]).sum()),
            },
            scale: 1.0 / longest.sqrt(),
        }
    }
}

/// The probe as the boxes of one frame see it.
struct Local {
    probe: Probe,
    /// Distances in space over distances in the frame, at least.
    scale: f64,
}

impl Local {
    /// How far the probe is from a box, in space, at least; axis by axis.
    #[inline(always)]
    fn gap(&self, bounds: &Aabb, slack: f64) -> [f64; 3] {
        let Probe { center, half } = &self.probe;
        std::array::from_fn(|i| {
            let below = f64::from(bounds.min[i]) - center[i];
            let above = center[i] - f64::from(bounds.max[i]);
            let gap = (below.max(above) - half[i] - slack).max(0.0) * self.scale;
            if below > above { gap } else { -gap }
        })
    }
}

/// How far a cell is at least: by the axes alone, and by all planes.
#[derive(Clone, Copy)]
struct Gap {
    axes: [f64; 3],
    /// Every w from the probe to the cell has `w · planes >= planes · planes`.
    planes: [f64; 3],
}

impl Gap {
    /// The gap to a box, given axis by axis.
    #[inline(always)]
    fn of(gap: [f64; 3]) -> Self {
        Gap {
            axes: gap.map(f64::abs),
            planes: gap,
        }
    }

    #[inline(always)]
    fn squared(&self) -> f64 {
        // Less what the steps of `behind` have rounded.
        dot(self.axes, self.axes).max((1.0 - 1e-8) * dot(self.planes, self.planes))
    }

    /// The gap of the part of the cell with `w · normal >= distance`; the normal is a unit vector.
    ///
    /// Of two half-spaces, the shortest w in both leads to one of their planes, or to both; and
    /// both lie in the half-space that it is the shortest of in its turn.
    #[inline(always)]
    fn behind(mut self, normal: [f64; 3], distance: f64) -> Self {
        if distance <= 0.0 {
            return self;
        }
        let length = dot(self.planes, self.planes).sqrt();
        let cosine = match length > 0.0 {
            true => dot(self.planes, normal) / length,
            false => 0.0,
        };
        let sine = 1.0 - cosine * cosine;
        let (own, other) = (length - distance * cosine, distance - length * cosine);
        if other <= 0.0 || sine < 1e-6 && distance <= length {
            return self;
        }
        let scale = match own <= 0.0 || sine < 1e-6 || length == 0.0 {
            true => [0.0, distance],
            false => [own / (sine * length), other / sine],
        };
        self.planes = std::array::from_fn(|i| scale[0] * self.planes[i] + scale[1] * normal[i]);
        self
    }
}

/// Visits the leaves whose triangles may be nearer than the root of the search's limit, near ones
/// roughly first.
///
/// A triangle that is not referenced on the side of a plane where its nearest point lies reaches
/// beyond the plane by no more than the overhang, and is then referenced on the other side: so a
/// child behind a plane is at least as far as the plane, less the overhang. `slack` is that, and
/// what f64 rounds.
fn approach<N: Layout>(
    tree: &Tree,
    nodes: &[N],
    probe: &Probe,
    slack: f64,
    search: &mut impl Search,
    counters: &mut impl Counters,
) {
    let (mesh, shared, references) = (tree.mesh(), tree.shared(), tree.references());
    let mut local = probe.in_frame(Frame::WORLD, &[]);
    let mut current = Frame::WORLD;
    let mut gap = Gap::of(local.gap(&tree.place().bounds, slack));
    let mut stack = [(0u32, gap); BuildParams::MAX_DEPTH as usize];
    let mut depth = 0;
    let mut at = 0;
    loop {
        let (near, far, far_gap) = match nodes[at].view(shared) {
            View::Axis {
                axis,
                offset,
                above,
            } => {
                counters.kd_visit();
                let distance = probe.center[axis] - f64::from(offset);
                let far = distance.abs() - probe.half[axis] - slack;
                let mut normal = [0.0; 3];
                normal[axis] = -distance.signum();
                let mut far_gap = gap.behind(normal, far);
                far_gap.axes[axis] = gap.axes[axis].max(far);
                let (near, far) = sides(at, above, distance);
                (near, far, far_gap)
            }
            View::Oblique {
                normal,
                offset,
                above,
                ..
            } => {
                counters.oblique_visit();
                let n = normal.map(f64::from);
                // It is 1 up to rounding.
                let length = dot(n, n).sqrt();
                let distance = (dot(n, probe.center) - f64::from(offset)) / length;
                let radius: f64 = (0..3).map(|i| n[i].abs() * probe.half[i]).sum();
                let towards = n.map(|c| -distance.signum() * c / length);
                let far_gap = gap.behind(towards, distance.abs() - radius / length - slack);
                let (near, far) = sides(at, above, distance);
                (near, far, far_gap)
            }
            View::Objects { above, frame } => {
                counters.kd_visit();
                if frame != current {
                    current = frame;
                    local = probe.in_frame(frame, &shared.frames);
                }
                let [below_gap, above_gap] =
                    [at + 1, above].map(|node| Gap::of(local.gap(&nodes[node].bounds(), slack)));
                if above_gap.squared() < below_gap.squared() {
                    gap = above_gap;
                    (above, at + 1, below_gap)
                } else {
                    gap = below_gap;
                    (at + 1, above, above_gap)
                }
            }
            View::Leaf(leaf) => {
                counters.leaf_visit(leaf.count);
                for &index in leaf.triangles(references) {
                    counters.triangle_tests(1);
                    if search.test(&OfMesh { mesh, index }).is_break() {
                        return;
                    }
                }
                loop {
                    if depth == 0 {
                        return;
                    }
                    depth -= 1;
                    (at, gap) = (stack[depth].0 as usize, stack[depth].1);
                    if gap.squared() <= search.limit() {
                        break;
                    }
                }
                continue;
            }
        };
        if far_gap.squared() <= search.limit() {
            stack[depth] = (far as u32, far_gap);
            depth += 1;
        }
        at = near;
    }
}

/// The child on the probe's side of a plane, and the other.
#[inline(always)]
fn sides(at: usize, above: usize, distance: f64) -> (usize, usize) {
    if distance < 0.0 {
        (at + 1, above)
    } else {
        (above, at + 1)
    }
}

/// The same in the wide layout, whose boxes hold all of the triangles in their cells.
fn approach_wide<S: Search>(
    mesh: &Mesh,
    wide: &Wide,
    probe: &Probe,
    slack: f64,
    search: &mut S,
    counters: &mut impl Counters,
) {
    // Boxes are relative to the centre of the scene.
    let relative = Probe {
        center: difference(probe.center, wide.center.map(f64::from)),
        half: probe.half,
    };
    let mut local = relative.in_frame(Frame::WORLD, &wide.frames);
    let mut current = Frame::WORLD;
    let mut pending = vec![(0.0, Link::ROOT)];
    while let Some((squared, link)) = pending.pop() {
        if squared > search.limit() {
            continue;
        }
        match link.child() {
            Child::Node(index) => {
                counters.wide_visit();
                let node = &wide.nodes[index];
                if node.frame != current {
                    current = node.frame;
                    local = relative.in_frame(current, &wide.frames);
                }
                let first = pending.len();
                for slot in 0..WIDTH {
                    let side = |high: usize| std::array::from_fn(|i| node.bounds[high + i][slot]);
                    let bounds = Aabb {
                        min: side(0),
                        max: side(3),
                    };
                    let gap = local.gap(&bounds, slack);
                    let squared = dot(gap, gap);
                    if !bounds.is_empty() && squared <= search.limit() {
                        pending.push((squared, node.children[slot]));
                    }
                }
                if S::NEAREST_FIRST {
                    pending[first..].sort_unstable_by(|a, b| b.0.total_cmp(&a.0));
                }
            }
            Child::Leaf { start, count } => {
                counters.leaf_visit(count as u32);
                counters.triangle_tests(count as u32);
                for &index in wide.triangles(start, count) {
                    if search.test(&OfMesh { mesh, index }).is_break() {
                        return;
                    }
                }
            }
        }
    }
}

fn run(tree: &Tree, probe: &Probe, search: &mut impl Search, counters: &mut impl Counters) {
    let place = tree.place();
    let far = (0..3).map(|i| probe.center[i].abs() + probe.half[i]);
    let reach = far.fold(f64::from(place.bounds.reach()), f64::max);
    let slack = 1.1 * place.overhang + 1e-12 * reach;
    let whole = probe.in_frame(Frame::WORLD, &[]).gap(&place.bounds, slack);
    if place.bounds.is_empty() || dot(whole, whole) > search.limit() {
        return;
    }
    if let Some(wide) = tree.wide() {
        return approach_wide(tree.mesh(), wide, probe, slack, search, counters);
    }
    with_nodes!(tree, nodes => approach(tree, nodes, probe, slack, search, counters));
}

struct Closest {
    point: [f64; 3],
    best: Nearest,
    triangle: u32,
}

impl Search for Closest {
    const NEAREST_FIRST: bool = true;

    #[inline(always)]
    fn limit(&self) -> f64 {
        self.best.squared
    }

    #[inline(always)]
    fn test(&mut self, triangle: &impl Triangle) -> ControlFlow<()> {
        let near = nearest_on_triangle(self.point, &triangle.corners());
        let triangle = triangle.index();
        if near.squared < self.best.squared
            || near.squared == self.best.squared && triangle < self.triangle
        {
            (self.best, self.triangle) = (near, triangle);
        }
        ControlFlow::Continue(())
    }
}

pub(crate) fn closest_point(
    tree: &Tree,
    point: [f32; 3],
    max_distance: f32,
    counters: &mut impl Counters,
) -> Option<ClosestPoint> {
    if !point.iter().all(|c| c.is_finite()) || max_distance.is_nan() || max_distance < 0.0 {
        return None;
    }
    let probe = Probe::point(point);
    let mut search = Closest {
        point: probe.center,
        best: Nearest {
            squared: f64::from(max_distance) * f64::from(max_distance),
            point: [0.0; 3],
            weights: [0.0; 2],
        },
        triangle: NONE,
    };
    run(tree, &probe, &mut search, counters);
    let Closest { best, triangle, .. } = search;
    (triangle != NONE).then(|| ClosestPoint {
        point: best.point.map(|c| c as f32),
        distance: best.squared.sqrt() as f32,
        u: best.weights[0] as f32,
        v: best.weights[1] as f32,
        triangle,
    })
}

/// Collects the triangles that `overlaps` takes; one for each reference that is met.
struct Overlaps<F> {
    limit: f64,
    overlaps: F,
    found: Vec<u32>,
}

impl<F: Fn(&[[f32; 3]; 3]) -> bool> Search for Overlaps<F> {
    const NEAREST_FIRST: bool = false;

    #[inline(always)]
    fn limit(&self) -> f64 {
        self.limit
    }

    #[inline(always)]
    fn test(&mut self, triangle: &impl Triangle) -> ControlFlow<()> {
        if (self.overlaps)(&triangle.corners()) {
            self.found.push(triangle.index());
        }
        ControlFlow::Continue(())
    }
}

impl<F> Overlaps<F> {
    fn in_order(mut self) -> Vec<u32> {
        self.found.sort_unstable();
        self.found.dedup();
        self.found
    }
}

pub(crate) fn overlaps_region(
    tree: &Tree,
    region: &Aabb,
    counters: &mut impl Counters,
) -> Vec<u32> {
    let mut corners = region.min.iter().chain(&region.max);
    if region.is_empty() || !corners.all(|c| c.is_finite()) {
        return Vec::new();
    }
    let probe = Probe::of(region);
    let mut search = Overlaps {
        limit: 0.0,
        overlaps: |corners: &[[f32; 3]; 3]| overlaps_box(corners, probe.center, probe.half),
        found: Vec::new(),
    };
    run(tree, &probe, &mut search, counters);
    search.in_order()
}

pub(crate) fn overlaps_sphere(
    tree: &Tree,
    center: [f32; 3],
    radius: f32,
    counters: &mut impl Counters,
) -> Vec<u32> {
    if !center.iter().all(|c| c.is_finite()) || radius.is_nan() || radius < 0.0 {
        return Vec::new();
    }
    let probe = Probe::point(center);
    let limit = f64::from(radius) * f64::from(radius);
    let mut search = Overlaps {
        limit,
        overlaps: |corners: &[[f32; 3]; 3]| {
            nearest_on_triangle(probe.center, corners).squared <= limit
        },
        found: Vec::new(),
    };
    run(tree, &probe, &mut search, counters);
    search.in_order()
}
