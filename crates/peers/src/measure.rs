//! Times on one thread, repetition by repetition.

use std::time::{Duration, Instant};

use anyhow::{Context, Result};
use rustix::time::{ClockId, clock_gettime};
use splitplane::{Hit, Ray};

use crate::contender::{Contender, Geometry, Work, build};
use crate::rays::Kind;

/// A contender that is built.
pub struct Built {
    /// As it was asked for.
    pub name: String,
    /// The structure.
    pub contender: Box<dyn Contender>,
    /// Seconds of all processors that the build took.
    pub build_cpu: f64,
    /// Seconds that it took.
    pub build_wall: f64,
}

/// Builds a contender and takes the time.
pub fn built(name: &str, geometry: &Geometry<'_>, threads: usize) -> Result<Built> {
    let (cpu, wall) = (clock(ClockId::ProcessCPUTime), Instant::now());
    let contender = build(name, geometry, threads)?;
    Ok(Built {
        name: name.to_owned(),
        contender,
        build_cpu: clock(ClockId::ProcessCPUTime) - cpu,
        build_wall: wall.elapsed().as_secs_f64(),
    })
}

fn clock(id: ClockId) -> f64 {
    let time = clock_gettime(id);
    Duration::new(time.tv_sec as u64, time.tv_nsec as u32).as_secs_f64()
}

/// Keeps this thread on the processor that it is on, so that it is not moved from its caches.
pub fn pin() -> Result<usize> {
    let here = rustix::thread::sched_getcpu();
    let mut set = rustix::thread::CpuSet::new();
    set.set(here);
    rustix::thread::sched_setaffinity(None, &set).context("the thread cannot be pinned")?;
    Ok(here)
}

/// What contenders answered.
#[derive(Clone)]
pub enum Answers {
    /// The closest hits.
    Closest(Vec<Option<Hit>>),
    /// Whether anything was hit.
    Any(Vec<bool>),
}

impl Answers {
    fn of(kind: Kind, count: usize) -> Self {
        if kind.any_hit() {
            Answers::Any(vec![false; count])
        } else {
            Answers::Closest(vec![None; count])
        }
    }

    fn ask(&mut self, contender: &dyn Contender, kind: Kind, rays: &[Ray]) {
        match self {
            Answers::Closest(hits) => contender.closest(kind, rays, &mut hits[..rays.len()]),
            Answers::Any(hits) => contender.any(kind, rays, &mut hits[..rays.len()]),
        }
    }
}

/// How the answers differ from those that brute force would give.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Wrong {
    /// Rays that hit, answered with a miss.
    pub missed: usize,
    /// Rays that miss, answered with a hit.
    pub extra: usize,
    /// Closest hits at another distance, by more than rounding.
    pub elsewhere: usize,
    /// Answers that differ by a bit; of contenders that promise none.
    pub inexact: usize,
}

impl Wrong {
    /// `scale` is a length of the scene.
    fn of(answers: &Answers, truth: &Answers, scale: f32, exact: bool) -> Self {
        let mut wrong = Wrong::default();
        match (answers, truth) {
            (Answers::Closest(answers), Answers::Closest(truth)) => {
                for (answer, truth) in answers.iter().zip(truth) {
                    match (answer, truth) {
                        (None, Some(_)) => wrong.missed += 1,
                        (Some(_), None) => wrong.extra += 1,
                        (Some(a), Some(b)) => {
                            let tolerance = 1e-4 * b.t.abs() + 1e-5 * scale;
                            wrong.elsewhere += usize::from((a.t - b.t).abs() > tolerance);
                        }
                        (None, None) => {}
                    }
                    wrong.inexact += usize::from(exact && answer != truth);
                }
            }
            (Answers::Any(answers), Answers::Any(truth)) => {
                for (&answer, &truth) in answers.iter().zip(truth) {
                    wrong.missed += usize::from(truth && !answer);
                    wrong.extra += usize::from(answer && !truth);
                }
                wrong.inexact = if exact { wrong.missed + wrong.extra } else { 0 };
            }
            _ => {}
        }
        wrong
    }
}

/// What was found of a contender on a set of rays.
pub struct Found {
    /// Seconds of the thread, a repetition each.
    pub cpu: Vec<f64>,
    /// Seconds of the clock on the wall, a repetition each.
    pub wall: Vec<f64>,
    /// How its answers differ.
    pub wrong: Wrong,
    /// Its work on all rays.
    pub work: Work,
}

/// How to measure.
pub struct Plan {
    /// Times that every contender is measured.
    pub reps: usize,
    /// Repetitions after which contenders that can are moved in memory; 0: never.
    pub move_every: usize,
    /// A length of the scene.
    pub scale: f32,
}

/// Asks every contender `plan.reps` times, in turn, each time another one first.
pub fn measure(
    plan: &Plan,
    kind: Kind,
    rays: &[Ray],
    contenders: &mut [Built],
    truth: &dyn Contender,
) -> Vec<Found> {
    let mut answers = Answers::of(kind, rays.len());
    answers.ask(truth, kind, rays);
    let truth = answers.clone();
    let mut found: Vec<Found> = contenders
        .iter()
        .map(|Built { contender, .. }| {
            answers = Answers::of(kind, rays.len());
            answers.ask(&**contender, kind, rays);
            Found {
                cpu: Vec::new(),
                wall: Vec::new(),
                wrong: Wrong::of(&answers, &truth, plan.scale, contender.is_exact()),
                work: contender.work(kind, rays),
            }
        })
        .collect();
    for rep in 0..plan.reps {
        for turn in 0..contenders.len() {
            let i = (turn + rep) % contenders.len();
            let contender = &mut contenders[i].contender;
            if plan.move_every > 0 && rep > 0 && rep % plan.move_every == 0 {
                contender.move_elsewhere();
            }
            // The others have filled the caches.
            answers.ask(&**contender, kind, &rays[..rays.len() / 16]);
            let (cpu, wall) = (clock(ClockId::ThreadCPUTime), Instant::now());
            answers.ask(&**contender, kind, rays);
            found[i].cpu.push(clock(ClockId::ThreadCPUTime) - cpu);
            found[i].wall.push(wall.elapsed().as_secs_f64());
        }
    }
    found
}
