//! Rays that must hit, or must not hit the triangle that they leave: how often each contender gets
//! it wrong.
//!
//! Only such rays are asked whose answer geometry alone decides, so that no contender is held to
//! the rounding of another.

use anyhow::Result;
use glam::Vec3;
use splitplane::{Hit, Ray};
use splitplane_lab::numbers::grouped;
use splitplane_lab::verify::{Expect, Leaks, Probe, ProbeSet, probe_sets};

use crate::contender::{Contender, Geometry, build};
use crate::rays::Kind;

/// Rays that are asked at once.
const CHUNK: u64 = 1 << 14;

/// A set of rays, and how often each contender was wrong.
pub struct LeakColumn {
    /// The set.
    pub set: ProbeSet,
    /// Per contender.
    pub leaks: Vec<Leaks>,
}

/// Asks all contenders `rays` rays of each set whose answers are certain.
pub fn leaks(contenders: &[String], rays: u64) -> Result<Vec<LeakColumn>> {
    let certain = |set: &ProbeSet| set.probe(0).expect != Expect::AsBruteForce;
    probe_sets()
        .into_iter()
        .filter(certain)
        .map(|set| {
            let geometry = Geometry::of(set.mesh());
            let leaks = contenders
                .iter()
                .map(|name| {
                    let contender = build(name, &geometry, 1)?;
                    let usable = set.mesh().usable_triangles();
                    Ok(leaks_of(&*contender, &set, usable, rays))
                })
                .collect::<Result<Vec<Leaks>>>()?;
            eprintln!("{}: {} rays", set.name(), grouped(rays));
            Ok(LeakColumn { set, leaks })
        })
        .collect()
}

fn leaks_of(contender: &dyn Contender, set: &ProbeSet, usable: &[u32], rays: u64) -> Leaks {
    let mut sum = Leaks::default();
    for first in (0..rays).step_by(CHUNK as usize) {
        let probes: Vec<Probe> = (first..rays.min(first + CHUNK))
            .map(|i| set.probe(i))
            .collect();
        // Some ask for directions of unit length.
        let unit = |Probe { ray, .. }: &Probe| Ray {
            direction: Vec3::from(ray.direction).normalize().into(),
            ..*ray
        };
        let rays: Vec<Ray> = probes.iter().map(unit).collect();
        let mut hits: Vec<Option<Hit>> = vec![None; rays.len()];
        contender.closest(Kind::Random, &rays, &mut hits);
        for (probe, hit) in probes.iter().zip(hits) {
            match (probe.expect, hit) {
                (Expect::Hit, None) => sum.missed += 1,
                (Expect::NotOn(own), Some(hit)) => {
                    let triangle = usable.get(hit.triangle as usize);
                    sum.wrong += u64::from(triangle == Some(&own));
                }
                _ => {}
            }
        }
    }
    sum
}

/// A Markdown table: a line a contender, a column a set.
pub fn markdown(contenders: &[String], columns: &[LeakColumn]) -> String {
    let line = |cells: Vec<String>| format!("| {} |\n", cells.join(" | "));
    let head = columns.iter().map(|column| column.set.name().to_owned());
    let mut out = line(
        std::iter::once("contender".to_owned())
            .chain(head)
            .collect(),
    );
    out += &format!("|---|{}\n", "--:|".repeat(columns.len()));
    for (i, name) in contenders.iter().enumerate() {
        let cells = columns.iter().map(|column| column.leaks[i].to_string());
        out += &line(std::iter::once(name.clone()).chain(cells).collect());
    }
    out
}
