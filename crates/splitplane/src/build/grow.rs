//! The top-down loop.

use rayon::prelude::*;

use super::built::{AXES, Built, BuiltNode, Origin, SplitPlane, Work};
use super::cell::Cell;
use super::cost::{Choice, Contest};
use super::extents::{Corners, Extents};
use super::lists::{LISTS_FROM, MAX_LISTED, SortedLists};
use super::outlines::{Knife, Outlines};
use super::params::{BuildParams, BuildStats, Ties};
use super::search::{Best, Search, SearchScratch, Shape};
use super::sweep::{Events, search_extents, sweep};
use super::ties::{Boundary, Touching};
use super::triangle_planes::{self, Counter, PlaneSearch, TrianglePlane};
use super::watch::{BuildPart, Progress, WHOLE, Watched, divide};
use super::{framed, objects};
use crate::catalog::{Directions, TreeChoice};
use crate::directions::{self, NodeView, Random, fixed};
use crate::geometry::Mesh;
use crate::geometry::polytope::{CutScratch, Polytope};

/// Subtrees with at least this many triangles are built in parallel.
pub(super) const PARALLEL_FROM: usize = 4096;

/// In a node of at least this many triangles each direction is swept on its own, in parallel.
const SHARED_FROM: usize = 1 << 14;

/// In a node of at least this many triangles it is asked whether to stop.
pub(super) const ASKED_FROM: usize = 64;

/// A path ends after this many bad refines [PBRT3, 4.4].
const MAX_BAD_REFINES: u8 = 3;

/// A plane that may split a node, and what becomes of the triangles that touch it.
#[derive(Clone, Copy, Debug)]
struct Candidate {
    plane: SplitPlane,
    touching: Touching,
}

impl Candidate {
    fn new(normal: [f32; 3], boundary: Boundary, origin: Origin) -> Self {
        Candidate {
            plane: SplitPlane {
                normal,
                offset: boundary.offset,
                origin,
            },
            touching: boundary.touching,
        }
    }

    fn boundary(&self) -> Boundary {
        Boundary {
            offset: self.plane.offset,
            touching: self.touching,
        }
    }
}

/// A node to be built.
struct Node {
    triangles: Vec<u32>,
    /// What of them lies in the cell, where they are clipped.
    outlines: Outlines,
    /// Where the triangles start and end, in nodes that are large enough for it.
    lists: Option<Box<SortedLists>>,
    /// `None` where the node is sure to be a leaf.
    cell: Option<Cell>,
    /// The area of the cell.
    area: f64,
    depth: u32,
    bad_refines: u8,
    /// Names the node's place in the tree, for its random numbers.
    path: u64,
    /// The node's share of the references that the tree may have.
    references: f64,
    /// The node's share of the work.
    share: u64,
}

/// Buffers of one thread.
#[derive(Default)]
struct Scratch {
    corners: Corners,
    directions: Vec<[f32; 3]>,
    sweeps: SweepScratch,
    /// The cell of a node that is a box.
    of_box: Polytope,
    cut: CutScratch,
    /// On which sides of a plane a triangle of the mesh is: 1 below, 2 above, 3 both.
    sides: Vec<u8>,
    /// The same of a node's references, where they are clipped, and their outlines on either side.
    sides_in_node: Vec<u8>,
    outlines: [Outlines; 2],
    /// The triangles below and above a plane.
    parts: [Vec<u32>; 2],
}

/// Buffers of sweeps.
#[derive(Default)]
struct SweepScratch {
    extents: Extents,
    events: Events,
    search: SearchScratch,
}

/// What the sweeps of a node have in common.
struct Swept<'a> {
    node: &'a Node,
    cell: &'a Cell,
    shape: Option<Shape<'a>>,
    /// The node has lists of the first so many directions.
    listed: usize,
    /// The triangles, for other directions.
    corners: &'a Corners,
}

struct Builder<'a> {
    mesh: &'a Mesh,
    /// The corners and unit normals of the mesh's triangles, by index.
    corners: Vec<[[f32; 3]; 3]>,
    normals: Vec<[f32; 3]>,
    /// Ize's planes of the mesh's triangles, where they are candidates.
    planes: Vec<[TrianglePlane; 4]>,
    /// The directions that are swept in every node, and what they are.
    everywhere: Vec<([f32; 3], Origin)>,
    choice: TreeChoice,
    params: &'a BuildParams,
    max_depth: u32,
    /// The tolerance of ties; `None` as published.
    tolerance: Option<f32>,
    /// How far a triangle may reach beyond a plane on a side where it is not referenced.
    overhang: f64,
    watched: Watched<'a>,
}

/// Builds the tree, on the threads of the current rayon pool; `None` if it was cancelled.
pub(crate) fn grow(
    mesh: &Mesh,
    choice: TreeChoice,
    params: &BuildParams,
    progress: &dyn Progress,
) -> Option<Built> {
    let spec = choice.spec;
    let triangles = mesh.usable_triangles().to_vec();
    let limit = params.max_references * triangles.len() as f64;
    let watched = |limit| Watched::new(progress, triangles.len(), limit);
    if spec.frames {
        return framed::grow(mesh, &watched(f64::INFINITY));
    }
    if spec.objects {
        return objects::grow(mesh, params, &watched(f64::INFINITY));
    }
    let bounds = mesh.bounds();
    let fixed = match spec.directions {
        Directions::Fixed => fixed::directions(
            choice.direction_count.unwrap_or_default() as usize,
            spec.axes,
        ),
        _ => Vec::new(),
    };
    let axes = if spec.axes { AXES.as_slice() } else { &[] };
    let listed_axes = axes.iter().map(|&axis| (axis, Origin::Axis));
    let listed_fixed = fixed.iter().enumerate().skip(axes.len());
    let all = || (0..mesh.triangles().len() as u32).into_par_iter();
    let corners: Vec<_> = all().map(|i| mesh.corners(i)).collect();
    let mut builder = Builder {
        mesh,
        normals: match spec.directions {
            Directions::SampledNormals | Directions::ClusteredNormals => {
                all().map(|i| mesh.normal(i)).collect()
            }
            _ => Vec::new(),
        },
        planes: match spec.triangle_planes {
            true => corners
                .par_iter()
                .map(|corners| triangle_planes::planes(corners, params.ties))
                .collect(),
            false => Vec::new(),
        },
        corners,
        everywhere: listed_axes
            .chain(listed_fixed.map(|(i, &direction)| (direction, Origin::Fixed(i as u8))))
            .collect(),
        choice,
        params,
        max_depth: params.max_depth.for_triangles(triangles.len()),
        tolerance: match params.ties {
            Ties::AsPublished => None,
            Ties::Tolerant => Some(params.ties.tolerance(&bounds)),
        },
        overhang: params.overhang(&bounds),
        watched: watched(limit),
    };
    // Which part of a tree takes too much is not known before it is all there, and must not depend
    // on threads: so only once the limit is passed has every subtree its share of it.
    let mut built = builder.run(f64::INFINITY);
    if builder.watched.is_over() {
        drop(built);
        builder.watched = watched(f64::INFINITY);
        built = builder.run(limit);
    }
    built.fixed = fixed;
    (!builder.watched.is_stopped()).then_some(built)
}

impl BuildStats {
    fn count_win(&mut self, plane: &SplitPlane) {
        let wins = &mut self.wins;
        *match plane.origin {
            _ if plane.is_axis() => &mut wins.axis,
            Origin::Axis | Origin::Fixed(_) | Origin::Direction => &mut wins.direction,
            Origin::Triangle => &mut wins.triangle,
            Origin::Edge => &mut wins.edge,
        } += 1;
    }
}

impl Builder<'_> {
    /// The whole tree, of no more references than `max_references` if it can be helped.
    fn run(&self, max_references: f64) -> Built {
        let triangles = self.mesh.usable_triangles().to_vec();
        let splits = triangles.len() > self.params.max_prims as usize && self.max_depth > 0;
        let cell = Cell::Box(self.mesh.bounds());
        let root = Node {
            outlines: Outlines::default(),
            // What is cut starts and ends elsewhere.
            lists: (splits && triangles.len() >= LISTS_FROM && !self.params.clip)
                .then(|| self.sorted(&triangles)),
            area: cell.surface_area(),
            cell: splits.then_some(cell),
            depth: 0,
            bad_refines: 0,
            path: Random::new(self.params.seed).next(),
            references: max_references,
            share: WHOLE,
            triangles,
        };
        let mut built = Built::default();
        self.grow(root, &mut built, &mut Scratch::default());
        built
    }

    /// Appends the subtree of `node`.
    fn grow(&self, mut node: Node, built: &mut Built, scratch: &mut Scratch) {
        let n = node.triangles.len();
        let _part = self.watched.part(BuildPart::Subtree, n);
        let stopped = n >= ASKED_FROM && self.watched.ask();
        let children = match stopped {
            true => None,
            false => self.divide(&mut node, built, scratch),
        };
        let Some((plane, [below, above])) = children else {
            built.leaf(node.triangles.iter().copied(), node.area);
            self.watched.finished(node.share, node.triangles.len());
            return;
        };
        let area = node.area;
        drop(node);
        built.join(
            (|above| BuiltNode::Interior { plane, above }, area),
            below.triangles.len().min(above.triangles.len()) >= PARALLEL_FROM,
            scratch,
            |built, scratch| self.grow(below, built, scratch),
            |built, scratch| self.grow(above, built, scratch),
        );
    }

    /// The plane that splits a node, and the two children; `None` where it is to be a leaf. Takes
    /// what is the node's alone.
    fn divide(
        &self,
        node: &mut Node,
        built: &mut Built,
        scratch: &mut Scratch,
    ) -> Option<(SplitPlane, [Node; 2])> {
        let n = node.triangles.len();
        let cell = node.cell.take()?;
        let part = self.watched.part(BuildPart::Search, n);
        let (contest, candidates, work) = self.contest(node, &cell, scratch);
        drop(part);
        built.work += work;
        let stats = &mut built.stats;
        stats.candidates += candidates;
        let choice = contest.decide(self.choice.spec, self.params, n)?;
        let bad_refines = node.bad_refines + u8::from(choice.bad_refine);
        if choice.hopeless || bad_refines >= MAX_BAD_REFINES {
            self.recycle(cell, scratch);
            return None;
        }
        let _part = self.watched.part(BuildPart::Divide, n);
        let triangles = self.sides(node, &choice.candidate, scratch);
        let plane = choice.candidate.plane;
        let references = triangles[0].len() + triangles[1].len();
        if references > n && references as f64 > node.references {
            stats.limited_leaves += 1;
            return None;
        }
        built.work.moved += references as u64;
        stats.count_win(&plane);
        stats.bad_refines += u64::from(choice.bad_refine);
        let children = self.children(node, cell, &choice, triangles, (stats, scratch));
        Some((plane, children))
    }

    fn recycle(&self, cell: Cell, scratch: &mut Scratch) {
        if let Cell::Polytope(polytope) = cell {
            scratch.cut.recycle(polytope);
        }
    }

    /// The corners of a node's triangles, by their place in the node, all that they are.
    fn whole(&self, node: &Node) -> impl Fn(usize) -> [[f32; 3]; 3] + Sync {
        |i| self.corners[node.triangles[i] as usize]
    }

    /// All candidates of a node.
    fn contest(
        &self,
        node: &Node,
        cell: &Cell,
        scratch: &mut Scratch,
    ) -> (Contest<Candidate>, u64, Work) {
        let (spec, params) = (self.choice.spec, self.params);
        let n = node.triangles.len();
        let oblique = !spec.axes || n <= params.oblique_up_to as usize;
        let mut contest = Contest::new();
        let (mut candidates, mut work) = (0, Work::default());
        let Scratch {
            corners,
            directions,
            sweeps,
            of_box,
            ..
        } = scratch;
        let polytope = match cell {
            Cell::Polytope(polytope) => Some(polytope),
            Cell::Box(_) if spec.only_axes() || !oblique => None,
            Cell::Box(aabb) => {
                of_box.set_box(aabb);
                Some(&*of_box)
            }
        };
        let shape = polytope.map(Shape::of);
        directions.clear();
        let view = NodeView {
            normals: &self.normals,
            triangles: &node.triangles,
            random: Random::new(node.path),
        };
        if oblique {
            directions::generate(self.choice, view, directions);
        }
        let listed = match &node.lists {
            Some(_) => self.everywhere.len().min(MAX_LISTED),
            None => 0,
        };
        if self.everywhere.len() + directions.len() > listed {
            corners.gather(n, self.whole(node));
            (node.outlines.cut()).for_each(|(i, outline)| corners.replace(i, outline));
        }
        let swept = Swept {
            node,
            cell,
            shape,
            listed,
            corners,
        };
        let own = directions
            .iter()
            .map(|&direction| (direction, Origin::Direction));
        let all = self.everywhere.iter().copied().chain(own).enumerate();
        // Axes first, since they may compete with other planes at another price.
        for are_axes in [true, false] {
            if !are_axes && !oblique {
                break;
            }
            let bar = contest.bar(are_axes, spec, params, n);
            let group = all
                .clone()
                .filter(|(_, (_, origin))| (*origin == Origin::Axis) == are_axes);
            if n < SHARED_FROM {
                let (found, count, done) = self.sweep(&swept, group, bar, sweeps);
                candidates += count;
                work += done;
                found
                    .into_iter()
                    .for_each(|(candidate, best)| contest.enter(candidate, are_axes, best));
                continue;
            }
            // Whether there are other threads or not, so that rounding is the same.
            let group: Vec<_> = group.collect();
            let all_found: Vec<_> = group
                .into_par_iter()
                .map(|direction| {
                    let _part = self.watched.part(BuildPart::Sweep, n);
                    let scratch = &mut SweepScratch::default();
                    self.sweep(&swept, std::iter::once(direction), bar, scratch)
                })
                .collect();
            for (found, count, done) in all_found {
                candidates += count;
                work += done;
                found
                    .into_iter()
                    .for_each(|(candidate, best)| contest.enter(candidate, are_axes, best));
            }
        }
        if let (true, Some(shape)) = (spec.triangle_planes && oblique, shape) {
            let bar = contest.bar(false, spec, params, n);
            let counter = Counter::new(
                n,
                self.whole(node),
                &node.outlines,
                (params.ties, self.tolerance, self.overhang),
            );
            let search = PlaneSearch::new(
                shape,
                (&node.triangles, counter),
                &self.planes,
                (bar, params.empty_bonus),
            );
            let (found, inside) = search.run();
            candidates += inside;
            if let Some((plane, is_edge, best)) = found {
                let origin = match is_edge {
                    true => Origin::Edge,
                    false => Origin::Triangle,
                };
                let candidate = Candidate::new(plane.normal, best.boundary, origin);
                contest.enter(candidate, false, best);
            }
        }
        (contest, candidates, work)
    }

    /// The best plane across some of a node's directions, if it has fewer expected tests than `bar`;
    /// how many planes were candidates, and what was done.
    fn sweep(
        &self,
        swept: &Swept,
        directions: impl Iterator<Item = (usize, ([f32; 3], Origin))> + Clone,
        bar: f64,
        SweepScratch {
            extents,
            events,
            search,
        }: &mut SweepScratch,
    ) -> (Option<(Candidate, Best)>, u64, Work) {
        let Swept {
            node,
            cell,
            shape,
            listed,
            corners,
        } = *swept;
        let area = shape.map_or(node.area, |shape| shape.area);
        let mut search = Search::new(area, shape, (bar, self.params.empty_bonus), search);
        let (mut candidates, mut work) = (0, Work::default());
        for (i, (normal, origin)) in directions.clone() {
            work.sweeps += 1;
            work.events += 2 * node.triangles.len() as u64;
            let axis = AXES.iter().position(|&axis| axis == normal);
            match (cell, axis) {
                (Cell::Box(aabb), Some(axis)) => search.turn_in_box(aabb, axis),
                _ => {
                    let direction = glam::Vec3::from(normal).as_dvec3();
                    search.turn(direction, origin != Origin::Direction);
                }
            }
            candidates += match &node.lists {
                Some(lists) if i < listed => sweep(&lists.of(i), self.tolerance, &mut search),
                _ => {
                    corners.extents(self.params.ties, normal, axis, extents);
                    search_extents(extents, self.tolerance, events, &mut search)
                }
            };
            search.probe();
        }
        let (found, areas) = search.finish(self.tolerance);
        work.areas = areas;
        let found = found.and_then(|(found, best)| {
            let (_, (normal, origin)) = directions.clone().nth(found)?;
            Some((Candidate::new(normal, best.boundary, origin), best))
        });
        (found, candidates, work)
    }

    /// The extent of a triangle along a direction, which may be an axis.
    #[inline(always)]
    fn extent(&self, axis: Option<usize>, normal: [f32; 3], triangle: u32) -> (f32, f32) {
        let corners = &self.corners[triangle as usize];
        let Some(axis) = axis else {
            return self.params.ties.extent(normal, corners);
        };
        let [a, b, c] = corners.map(|p| p[axis]);
        (a.min(b).min(c), a.max(b).max(c))
    }

    /// The sorted lists of a node, from nothing.
    fn sorted(&self, triangles: &[u32]) -> Box<SortedLists> {
        let _part = self.watched.part(BuildPart::Sort, triangles.len());
        let listed = self.everywhere.len().min(MAX_LISTED);
        let axes = self.everywhere.iter().map(|&(normal, _)| {
            let axis = AXES.iter().position(|&axis| axis == normal);
            (axis, normal)
        });
        let axes: Vec<_> = axes.collect();
        Box::new(SortedLists::sort(
            triangles,
            listed,
            self.tolerance,
            |i, triangle| self.extent(axes[i].0, axes[i].1, triangle),
        ))
    }

    /// The triangles below and above a plane; where the node has lists, or its triangles are clipped,
    /// the sides of each are noted.
    fn sides(&self, node: &Node, candidate: &Candidate, scratch: &mut Scratch) -> [Vec<u32>; 2] {
        let (plane, boundary) = (candidate.plane, candidate.boundary());
        let axis = plane.axis();
        let n = node.triangles.len();
        let Scratch {
            corners,
            sweeps,
            sides,
            sides_in_node,
            parts,
            ..
        } = scratch;
        parts.iter_mut().for_each(|part| {
            part.clear();
            part.reserve(n);
        });
        if node.lists.is_some() {
            sides.resize(self.corners.len(), 0);
        }
        let extents = &mut sweeps.extents;
        if self.params.clip {
            corners.extents(self.params.ties, plane.normal, axis, extents);
            sides_in_node.clear();
        }
        for (i, &triangle) in node.triangles.iter().enumerate() {
            let extent = match self.params.clip {
                true => (extents.mins[i], extents.maxs[i]),
                false => self.extent(axis, plane.normal, triangle),
            };
            let (below, above) = boundary.sides(extent);
            if below {
                parts[0].push(triangle);
            }
            if above {
                parts[1].push(triangle);
            }
            let side = u8::from(below) | u8::from(above) << 1;
            if node.lists.is_some() {
                sides[triangle as usize] = side;
            }
            if self.params.clip {
                sides_in_node.push(side);
            }
        }
        // As much memory as they take, whatever the node took.
        [&*parts[0], &*parts[1]].map(<[u32]>::to_vec)
    }

    /// The two children of a node with these triangles.
    fn children(
        &self,
        node: &mut Node,
        cell: Cell,
        choice: &Choice<Candidate>,
        mut triangles: [Vec<u32>; 2],
        (stats, scratch): (&mut BuildStats, &mut Scratch),
    ) -> [Node; 2] {
        let depth = node.depth + 1;
        let plane = choice.candidate.plane;
        let counts = [triangles[0].len(), triangles[1].len()];
        // Others are leaves, of which only the area is of use.
        let wanted = counts.map(|n| n > self.params.max_prims as usize && depth < self.max_depth);
        let mut lists = match node.lists.take() {
            Some(lists) => {
                let listed = [0, 1].map(|i| wanted[i] && counts[i] >= LISTS_FROM);
                lists.divide(&scratch.sides, listed)
            }
            None => [None, None],
        };
        let mut outlines = match self.params.clip {
            true => {
                let knife = Knife {
                    normal: glam::Vec3::from(plane.normal).as_dvec3(),
                    offset: f64::from(plane.offset),
                    outset: 2.0 * self.overhang,
                };
                let (sides, buffers) = (&scratch.sides_in_node, &mut scratch.outlines);
                (node.outlines).divide(&knife, sides, wanted, self.whole(node), buffers)
            }
            false => Default::default(),
        };
        let mut cells = match wanted {
            [false, false] => [None, None],
            _ => cell
                .cut(&plane, wanted, &mut scratch.cut)
                .unwrap_or_else(|| {
                    stats.uncut_cells += 1;
                    [Some(cell.clone()), Some(cell.clone())]
                }),
        };
        self.recycle(cell, scratch);
        let mut paths = Random::new(node.path ^ u64::from(node.depth) << 48);
        let all = (counts[0] + counts[1]).max(1) as f64;
        let areas = <[f64; 2]>::from(choice.areas).map(|area| area * node.area);
        let shares = <[u64; 2]>::from(divide(node.share, counts[0], counts[1]));
        let mut child = |i: usize| {
            let cell = cells[i].take().filter(|_| wanted[i]);
            Node {
                references: node.references * counts[i] as f64 / all,
                area: cell.as_ref().map_or(areas[i], Cell::surface_area),
                triangles: std::mem::take(&mut triangles[i]),
                outlines: std::mem::take(&mut outlines[i]),
                lists: lists[i].take(),
                cell,
                depth,
                bad_refines: node.bad_refines + u8::from(choice.bad_refine),
                path: paths.next(),
                share: shares[i],
            }
        };
        [child(0), child(1)]
    }
}

#[cfg(test)]
mod tests {
    use std::fmt::Write;

    use super::*;
    use crate::TREES;

    /// A wavy sheet of 2 · side² triangles.
    fn sheet(side: usize) -> Mesh {
        let at = |i: usize, j: usize| {
            let (x, y) = (i as f32, j as f32);
            [x, y, 0.01 * ((7 * i + 3 * j) % 11) as f32 * (x - y)]
        };
        let positions = (0..=side)
            .flat_map(|i| (0..=side).map(move |j| at(i, j)))
            .collect();
        let corner = |i: usize, j: usize| (i * (side + 1) + j) as u32;
        let triangles = (0..side)
            .flat_map(|i| (0..side).map(move |j| (i, j)))
            .flat_map(|(i, j)| {
                let [a, b] = [corner(i, j), corner(i + 1, j)];
                let [c, d] = [corner(i, j + 1), corner(i + 1, j + 1)];
                [[a, b, c], [b, d, c]]
            })
            .collect();
        Mesh::new(positions, triangles).unwrap()
    }

    fn work_of(mesh: &Mesh, choice: TreeChoice, params: &BuildParams, threads: usize) -> Built {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
        let pool = pool.build().unwrap();
        pool.install(|| grow(mesh, choice, params, &()).unwrap())
    }

    /// The gate against builds that do more than they did: exact numbers, where a time or a count of
    /// instructions would depend on the machine. Where more is meant,
    /// `INSTA_UPDATE=always cargo test -p splitplane --lib build::` writes the new numbers.
    #[test]
    fn no_tree_takes_more_work_than_it_did() {
        let mesh = sheet(24);
        let mut table = String::new();
        for spec in TREES.iter().filter(|spec| !spec.objects && !spec.frames) {
            let choice = TreeChoice::new(spec.name, None).unwrap();
            for (ties, clip) in [
                (Ties::AsPublished, false),
                (Ties::Tolerant, false),
                (Ties::Tolerant, true),
            ] {
                let clipped = if clip { " clipped" } else { "" };
                let params = BuildParams {
                    ties,
                    clip,
                    ..BuildParams::THESIS
                };
                let built = work_of(&mesh, choice, &params, 1);
                let Work {
                    sweeps,
                    events,
                    areas,
                    moved,
                } = built.work;
                writeln!(
                    table,
                    "{choice} {ties:?}{clipped}: {} candidates, {sweeps} sweeps, {events} events, {areas} areas, {moved} moved",
                    built.stats.candidates
                )
                .unwrap();
            }
        }
        insta::assert_snapshot!(table);
    }

    #[test]
    fn without_oblique_planes_a_tree_is_a_kd_tree() {
        let mesh = sheet(12);
        for clip in [false, true] {
            let params = BuildParams {
                clip,
                oblique_up_to: 0,
                ..BuildParams::default()
            };
            let built = |name: &str| work_of(&mesh, name.parse().unwrap(), &params, 1);
            let kd = built("kd");
            for name in ["wn+kd:5", "cn+kd:5", "rbsp-kd:9", "ize-kd"] {
                let other = built(name);
                assert!(other.pieces == kd.pieces, "{name}");
            }
        }
    }

    /// Large enough that directions are shared among threads.
    #[test]
    fn threads_change_neither_a_tree_nor_the_work() {
        let mesh = sheet(96);
        assert!(mesh.triangles().len() >= SHARED_FROM);
        for name in ["kd", "wn+kd:5", "rbsp-kd:9"] {
            let choice: TreeChoice = name.parse().unwrap();
            let [one, two] = [1, 2].map(|threads| {
                let params = BuildParams {
                    max_depth: super::super::params::DepthLimit::Fixed(12),
                    ..BuildParams::default()
                };
                work_of(&mesh, choice, &params, threads)
            });
            assert_eq!(one.work, two.work, "{name}");
            assert!(one.pieces == two.pieces, "{name}");
        }
    }
}
