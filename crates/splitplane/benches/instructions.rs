//! How many instructions builds and queries take, by callgrind: exact, whatever else the machine
//! does. Fails where there are more than are recorded beside this file.
//!
//! `cargo bench -p splitplane --bench instructions`, with `-- --record` to record what is found.
//! Compilers differ, so figures of another one are shown but not held against the record.

use std::fmt::Write as _;
use std::hint::black_box;
use std::path::Path;
use std::process::{Command, ExitCode};

use splitplane::{BuildParams, Coherence, Hit, Layout, Mesh, Ray, Tree};

/// More than the record by this share is too much.
const TOLERANCE: f64 = 0.02;

const RECORD: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/benches/instructions.txt");

const RAYS: usize = 10_000;

struct Case {
    name: &'static str,
    /// What it is counted for each of.
    per: &'static str,
    /// Does what is counted in [`counted`].
    run: fn(&Scene),
}

const fn case(name: &'static str, per: &'static str, run: fn(&Scene)) -> Case {
    Case { name, per, run }
}

const CASES: [Case; 13] = [
    case("build kd", "triangle", |scene| build(scene, "kd")),
    case("build wn+kd:6", "triangle", |scene| build(scene, "wn+kd:6")),
    case("build bvh", "triangle", |scene| build(scene, "bvh")),
    case("build framed", "triangle", |scene| build(scene, "framed")),
    case("framed to wide", "triangle", |scene| {
        let tree = scene.tree("framed");
        counted(&mut || drop(tree.clone().with_layout(Layout::Wide)));
    }),
    case("closest, chords", "ray", |scene| {
        closest(scene, &scene.chords())
    }),
    case("closest, bounces", "ray", |scene| {
        closest(scene, &scene.bounces())
    }),
    case("any, bounces", "ray", |scene| {
        let (tree, rays) = (scene.wide(), scene.bounces());
        counted(&mut || {
            for ray in &rays {
                black_box(tree.any_hit(ray, &mut ()));
            }
        });
    }),
    case("closest, chords in batches", "ray", |scene| {
        closest_in_batches(scene, &scene.chords())
    }),
    case("closest, bounces in batches", "ray", |scene| {
        closest_in_batches(scene, &scene.bounces())
    }),
    case("any, bounces in batches", "ray", |scene| {
        let (tree, rays) = (scene.wide(), scene.bounces());
        let mut found = vec![false; rays.len()];
        counted(&mut || {
            for (rays, found) in rays.chunks(1000).zip(found.chunks_mut(1000)) {
                tree.any_hits_as(Coherence::Unknown, rays, found);
            }
        });
        black_box(found);
    }),
    case("closest, camera in batches", "ray", |scene| {
        closest_in_batches(scene, &scene.camera(25))
    }),
    case("closest, coarse camera in batches", "ray", |scene| {
        closest_in_batches(scene, &scene.camera(4))
    }),
];

/// What callgrind looks at; nothing else has its name.
#[inline(never)]
fn counted(what: &mut dyn FnMut()) {
    what();
}

fn build(scene: &Scene, tree: &str) {
    counted(&mut || drop(black_box(scene.tree(tree))));
}

fn closest(scene: &Scene, rays: &[Ray]) {
    let tree = scene.wide();
    counted(&mut || {
        for ray in rays {
            black_box(tree.closest_hit(ray, &mut ()));
        }
    });
}

fn closest_in_batches(scene: &Scene, rays: &[Ray]) {
    let tree = scene.wide();
    let mut hits: Vec<Option<Hit>> = vec![None; rays.len()];
    counted(&mut || {
        for (rays, hits) in rays.chunks(1000).zip(hits.chunks_mut(1000)) {
            tree.closest_hits_as(Coherence::Unknown, rays, hits);
        }
    });
    black_box(hits);
}

/// A room with a bumpy ball, turned boxes and slanted slivers.
struct Scene {
    mesh: Mesh,
}

/// Numbers in [0, 1), always the same ones.
struct Random(u64);

impl Random {
    fn next(&mut self) -> f32 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 40) as f32 / (1u64 << 24) as f32
    }

    fn point(&mut self) -> [f32; 3] {
        [0; 3].map(|_| 2.0 * self.next() - 1.0)
    }

    fn direction(&mut self) -> [f32; 3] {
        loop {
            let p = self.point();
            let length = dot(p, p).sqrt();
            if (0.1..=1.0).contains(&length) {
                return p.map(|c| c / length);
            }
        }
    }
}

fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// `a` and so much of `b`.
fn along(a: [f32; 3], b: [f32; 3], much: f32) -> [f32; 3] {
    std::array::from_fn(|i| a[i] + much * b[i])
}

impl Scene {
    fn new() -> Self {
        let mut random = Random(88_172_645_463_325_252);
        let (mut positions, mut triangles) = (Vec::new(), Vec::new());
        // The ball, of rings and sectors.
        const RINGS: u32 = 40;
        const SECTORS: u32 = 60;
        for ring in 0..=RINGS {
            let up = std::f32::consts::PI * ring as f32 / RINGS as f32;
            for sector in 0..=SECTORS {
                let around = std::f32::consts::TAU * sector as f32 / SECTORS as f32;
                let radius = 0.4 + 0.03 * (7.0 * around).sin() * (9.0 * up).cos();
                let [x, y, z] = [up.sin() * around.cos(), up.sin() * around.sin(), up.cos()];
                positions.push([radius * x, radius * y, radius * z]);
            }
        }
        for ring in 0..RINGS {
            for sector in 0..SECTORS {
                let a = ring * (SECTORS + 1) + sector;
                let b = a + SECTORS + 1;
                triangles.extend([[a, b, a + 1], [a + 1, b, b + 1]]);
            }
        }
        let mut quad = |corner: [f32; 3], u: [f32; 3], v: [f32; 3]| {
            let first = positions.len() as u32;
            positions.extend([
                corner,
                along(corner, u, 1.0),
                along(along(corner, u, 1.0), v, 1.0),
            ]);
            positions.push(along(corner, v, 1.0));
            triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
        };
        let mut block = |corner: [f32; 3], edges: [[f32; 3]; 3]| {
            for axis in 0..3 {
                let (u, v) = (edges[(axis + 1) % 3], edges[(axis + 2) % 3]);
                quad(corner, u, v);
                quad(along(corner, edges[axis], 1.0), u, v);
            }
        };
        block(
            [-1.0; 3],
            [[2.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 2.0]],
        );
        // Boxes turned by a few angles about z.
        for i in 0..100 {
            let turn = [0.3f32, 0.7, 1.1][i % 3];
            let (sin, cos) = turn.sin_cos();
            let size = [0; 3].map(|_| 0.02 + 0.1 * random.next());
            let corner = random.point().map(|c| 0.85 * c);
            let u = [cos * size[0], sin * size[0], 0.0];
            block(
                corner,
                [u, [-sin * size[1], cos * size[1], 0.0], [0.0, 0.0, size[2]]],
            );
        }
        // Slivers.
        for _ in 0..600 {
            let (corner, way) = (random.point().map(|c| 0.7 * c), random.direction());
            let beside = random.direction();
            let first = positions.len() as u32;
            positions.extend([corner, along(corner, way, 0.3), along(corner, beside, 0.01)]);
            triangles.push([first, first + 1, first + 2]);
        }
        Scene {
            mesh: Mesh::new(positions, triangles).expect("it is sound"),
        }
    }

    fn tree(&self, name: &str) -> Tree {
        let choice = name.parse().expect("a tree's name");
        Tree::build(&self.mesh, choice, &BuildParams::default()).expect("it is small")
    }

    fn wide(&self) -> Tree {
        let tree = self.tree("framed").with_layout(Layout::Wide);
        tree.expect("it is small")
    }

    fn chords(&self) -> Vec<Ray> {
        let mut random = Random(2);
        let chord = |_| {
            let (from, to) = (random.direction(), random.direction());
            Ray::new(from.map(|c| 1.8 * c), along(to, from, -1.0))
        };
        (0..RAYS).map(chord).collect()
    }

    /// From where rays from inside the room hit, to the side that they came from.
    fn bounces(&self) -> Vec<Ray> {
        let (tree, mut random) = (self.tree("framed"), Random(3));
        let mut bounces = Vec::new();
        while bounces.len() < RAYS {
            let ray = Ray::new(random.point().map(|c| 0.9 * c), random.direction());
            let Some(hit) = tree.closest_hit(&ray, &mut ()) else {
                continue;
            };
            let normal = self.mesh.normal(hit.triangle);
            let side = -dot(normal, ray.direction).signum();
            let normal = normal.map(|c| side * c);
            let from = along(ray.at(hit.t), normal, 1e-4);
            bounces.push(Ray::new(from, along(normal, random.direction(), 0.99)));
        }
        bounces
    }

    /// In tiles of 4 x 4 pixels, pictures until there are enough of them.
    fn camera(&self, tiles: usize) -> Vec<Ray> {
        let pixel = |i: usize| {
            let (tile, place) = (i / 16, i % 16);
            let x = 4 * (tile % tiles) + place % 4;
            let y = 4 * (tile / tiles) + place / 4;
            let across = |at: usize| (at as f32 + 0.5) / (2.0 * tiles as f32) - 1.0;
            Ray::new([0.0, -0.95, 0.1], [0.8 * across(x), 1.0, 0.8 * across(y)])
        };
        (0..RAYS).map(|i| pixel(i % (16 * tiles * tiles))).collect()
    }
}

/// Counts what a case takes, per triangle or ray.
fn count(case: usize) -> Result<f64, String> {
    let own = std::env::current_exe().map_err(|error| error.to_string())?;
    let output = Command::new("valgrind")
        .args(["--tool=callgrind", "--callgrind-out-file=/dev/null"])
        .arg("--toggle-collect=instructions::counted")
        .arg(own)
        .args(["--case", &case.to_string()])
        .output()
        .map_err(|error| format!("valgrind cannot be run: {error}; install it"))?;
    let said = String::from_utf8_lossy(&output.stderr);
    let found = said.split("Collected : ").nth(1);
    let found = found.and_then(|rest| rest.split_whitespace().next()?.parse::<f64>().ok());
    match found {
        Some(all) if output.status.success() && all > 0.0 => {
            let per = match CASES[case].per {
                "ray" => RAYS as f64,
                _ => Scene::new().mesh.triangles().len() as f64,
            };
            Ok(all / per)
        }
        _ => Err(format!("{}: {said}", CASES[case].name)),
    }
}

fn compiler() -> String {
    let rustc = std::env::var("RUSTC").unwrap_or_else(|_| "rustc".into());
    let output = Command::new(rustc).arg("--version").output();
    output.map_or_else(
        |_| "an unknown compiler".into(),
        |output| String::from_utf8_lossy(&output.stdout).trim().to_owned(),
    )
}

/// The recorded compiler, and instructions by case.
fn recorded() -> (String, Vec<(String, f64)>) {
    let text = std::fs::read_to_string(Path::new(RECORD)).unwrap_or_default();
    let mut lines = text.lines();
    let compiler = lines.next().unwrap_or_default().to_owned();
    let case = |line: &str| {
        let (figure, name) = line.trim().split_once(' ')?;
        Some((name.to_owned(), figure.parse().ok()?))
    };
    (compiler, lines.filter_map(case).collect())
}

fn compare(record: bool) -> Result<(), String> {
    let (their_compiler, figures) = recorded();
    let compiler = compiler();
    let held = compiler == their_compiler;
    let (mut more, mut text) = (Vec::new(), format!("{compiler}\n"));
    println!(
        "{:>12}  {:>12}  {:>7}",
        "instructions", "recorded", "change"
    );
    for (case, Case { name, per, .. }) in CASES.iter().enumerate() {
        let now = count(case)?;
        let then = figures.iter().find(|(other, _)| other == name);
        let change = then.map(|(_, then)| now / then - 1.0);
        println!(
            "{now:>12.1}  {:>12}  {:>7}  {name}, a {per}",
            then.map_or_else(|| "-".into(), |(_, then)| format!("{then:.1}")),
            change.map_or_else(|| "-".into(), |change| format!("{:+.1} %", 100.0 * change)),
        );
        writeln!(text, "{now:.1} {name}").expect("a string takes everything");
        if change.is_none_or(|change| change > TOLERANCE) {
            more.push(*name);
        }
    }
    if record {
        return std::fs::write(RECORD, text).map_err(|error| format!("{RECORD}: {error}"));
    }
    if !held {
        println!("recorded with {their_compiler}, counted with {compiler}: not held against it");
        return Ok(());
    }
    match more.is_empty() {
        true => Ok(()),
        false => Err(format!(
            "more instructions than are recorded, or none recorded: {}; where they are worth it, \
             `cargo bench -p splitplane --bench instructions -- --record`",
            more.join("; ")
        )),
    }
}

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().collect();
    if let Some(case) = arguments.iter().position(|argument| argument == "--case") {
        let case: usize = arguments[case + 1].parse().expect("the number of a case");
        // Callgrind counts by thread: all of it is to be on the one that it looks at.
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
        pool.expect("there is a thread")
            .install(|| (CASES[case].run)(&Scene::new()));
        return ExitCode::SUCCESS;
    }
    match compare(arguments.iter().any(|argument| argument == "--record")) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}
