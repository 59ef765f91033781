//! Rays that are easily lost: how often each contender loses them.
//!
//! No contender is held to the rounding of another. Where geometry alone decides (a ray from inside
//! a closed surface hits it; one that leaves a triangle does not hit that triangle again) that is
//! what is asked. Elsewhere a ray is lost only if every ray nearby hits as well, and a hit is wrong
//! if it is not on the triangle that it names, or beyond what every ray nearby hits.

use anyhow::Result;
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use splitplane::{Hit, Mesh, Ray, Tree, brute_force};
use splitplane_lab::numbers::grouped;
use splitplane_lab::verify::{Expect, Leaks, ProbeSet, probe_sets};

use crate::contender::{Contender, Geometry, build};
use crate::rays::Kind;

/// Rays that are asked at once.
const CHUNK: u64 = 1 << 14;

/// How far off nearby rays begin, of the largest coordinate there is: sixteen roundings of f32.
const NEARBY: f64 = 1.0 / (1 << 20) as f64;

/// A set of rays, and how often each contender was wrong.
pub struct LeakColumn {
    /// The set.
    pub set: ProbeSet,
    /// Rays that hit, or miss, as all rays nearby do.
    pub certain: u64,
    /// Per contender.
    pub leaks: Vec<Leaks>,
}

/// Asks all contenders `rays` rays of each set.
///
/// # Errors
/// A contender that cannot be built.
pub fn leaks(contenders: &[String], rays: u64) -> Result<Vec<LeakColumn>> {
    probe_sets()
        .into_iter()
        .map(|set| {
            let geometry = Geometry::of(set.mesh());
            let built = contenders
                .iter()
                .map(|name| build(name, &geometry, 1))
                .collect::<Result<Vec<_>>>()?;
            let mut column = LeakColumn {
                certain: 0,
                leaks: vec![Leaks::default(); built.len()],
                set,
            };
            for first in (0..rays).step_by(CHUNK as usize) {
                let asked = first..rays.min(first + CHUNK);
                let questions: Vec<Question> = asked
                    .into_par_iter()
                    .map(|i| Question::new(&column.set, i))
                    .collect();
                let is_certain = |question: &&Question| question.bounds.is_certain();
                column.certain += questions.iter().filter(is_certain).count() as u64;
                for (contender, leaks) in built.iter().zip(&mut column.leaks) {
                    ask(&**contender, column.set.mesh(), &questions, leaks);
                }
            }
            eprintln!("{}: {} rays", column.set.name(), grouped(rays));
            Ok(column)
        })
        .collect()
}

/// A ray, and what answers will do.
struct Question {
    /// With a direction of unit length, which some ask for.
    ray: Ray,
    expect: Expect,
    /// By brute force, with our test of a ray and a triangle.
    truth: Option<Hit>,
    bounds: Bounds,
}

/// What brute force says of a ray and of those nearby.
struct Bounds {
    some_hit: bool,
    some_miss: bool,
    nearest: f32,
    farthest: f32,
    /// What else a hit may be off by.
    slack: f32,
}

impl Bounds {
    fn is_certain(&self) -> bool {
        self.some_hit != self.some_miss
    }
}

impl Question {
    fn new(set: &ProbeSet, index: u64) -> Self {
        let probe = set.probe(index);
        let direction = DVec3::from(probe.ray.direction.map(f64::from)).normalize();
        let ray = Ray {
            direction: direction.as_vec3().into(),
            ..probe.ray
        };
        let truth = brute_force(set.mesh(), &ray);
        Question {
            bounds: bounds(set.mesh(), &ray, truth),
            truth,
            ray,
            expect: probe.expect,
        }
    }

    /// What is wrong with the answers, if anything.
    fn judge(&self, closest: Option<Hit>, any: bool, mesh: &Mesh) -> Leaks {
        let bounds = &self.bounds;
        let missed = closest.is_none() || !any;
        if missed && (!bounds.some_miss || self.expect == Expect::Hit) {
            return Leaks::MISSED;
        }
        let is_wrong = |hit: Hit| {
            let own = self.expect == Expect::NotOn(hit.triangle);
            // As far off again as the rays nearby are.
            let last = 2.0 * bounds.farthest - bounds.nearest + bounds.slack;
            own || !bounds.some_miss && hit.t > last
                || self.truth.map(|truth| truth.triangle) != Some(hit.triangle)
                    && distance(mesh, hit.triangle, self.ray.at(hit.t)) > bounds.slack
        };
        match closest.is_some_and(is_wrong) {
            true => Leaks::WRONG,
            false => Leaks::default(),
        }
    }
}

/// How far a point is from a triangle.
fn distance(mesh: &Mesh, triangle: u32, point: [f32; 3]) -> f32 {
    let alone = Mesh::new(mesh.corners(triangle).to_vec(), vec![[0, 1, 2]]);
    let tree = alone.ok().and_then(|alone| Tree::new(&alone).ok());
    let closest = tree.and_then(|tree| tree.closest_point(point, f32::INFINITY, &mut ()));
    closest.map_or(f32::INFINITY, |closest| closest.distance)
}

/// Asks brute force for a ray whose answer is `truth`, and for those that begin a little off it on
/// all sides: of two that begin on opposite sides, one passes an edge where the other does not.
fn bounds(mesh: &Mesh, ray: &Ray, truth: Option<Hit>) -> Bounds {
    let reach = Vec3::from(mesh.bounds().min)
        .abs()
        .max(Vec3::from(mesh.bounds().max).abs())
        .max(Vec3::from(ray.origin).abs())
        .max_element();
    let off = (NEARBY * f64::from(reach)) as f32;
    let mut bounds = Bounds {
        some_hit: false,
        some_miss: false,
        nearest: f32::INFINITY,
        farthest: f32::NEG_INFINITY,
        slack: 4.0 * off,
    };
    let mut add = |hit: Option<Hit>| match hit {
        Some(hit) => {
            bounds.some_hit = true;
            bounds.nearest = bounds.nearest.min(hit.t);
            bounds.farthest = bounds.farthest.max(hit.t);
        }
        None => bounds.some_miss = true,
    };
    add(truth);
    for axis in 0..3 {
        for off in [off, -off] {
            let mut nearby = *ray;
            nearby.origin[axis] += off;
            add(brute_force(mesh, &nearby));
        }
    }
    bounds
}

fn ask(contender: &dyn Contender, mesh: &Mesh, questions: &[Question], leaks: &mut Leaks) {
    let rays: Vec<Ray> = questions.iter().map(|question| question.ray).collect();
    let mut closest: Vec<Option<Hit>> = vec![None; rays.len()];
    let mut any = vec![false; rays.len()];
    contender.closest(Kind::Random, &rays, &mut closest);
    contender.any(Kind::Random, &rays, &mut any);
    for ((question, closest), any) in questions.iter().zip(closest).zip(any) {
        *leaks += if contender.is_exact() {
            let found = Leaks::of(closest, question.truth, question.expect, Hit::eq);
            match found.is_tight() && any != question.truth.is_some() {
                true => Leaks::WRONG,
                false => found,
            }
        } else {
            // The others know of no triangles that cannot be hit.
            let of_mesh = |hit: Hit| Hit {
                triangle: mesh.usable_triangles()[hit.triangle as usize],
                ..hit
            };
            question.judge(closest.map(of_mesh), any, mesh)
        };
    }
}

/// A Markdown table: a line a set, a column a contender.
pub fn markdown(contenders: &[String], columns: &[LeakColumn], rays: u64) -> String {
    let line = |cells: Vec<String>| format!("| {} |\n", cells.join(" | "));
    let mut head = vec!["rays".to_owned(), "certain".to_owned()];
    head.extend(contenders.iter().cloned());
    let mut out = line(head);
    out += &format!("| :-- |{}\n", " --: |".repeat(contenders.len() + 1));
    for LeakColumn {
        set,
        certain,
        leaks,
    } in columns
    {
        let certain = 100.0 * *certain as f64 / rays as f64;
        let mut cells = vec![set.name().to_owned(), format!("{certain:.1} %")];
        cells.extend(leaks.iter().map(ToString::to_string));
        out += &line(cells);
    }
    out
}
