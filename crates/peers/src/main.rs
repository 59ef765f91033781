//! Splitplane's queries beside those of Embree and others: the same rays through the same
//! triangles, on one thread, in turn.

mod builds;
mod bvh_crate;
mod contender;
mod embree;
mod leaks;
mod measure;
mod obvhs_crate;
mod ours;
mod parry;
mod plot;
mod rays;
mod record;
mod report;
mod tinybvh;

use std::fs::OpenOptions;
use std::io::Write;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail, ensure};
use clap::Parser;
use splitplane::{BuildParams, Tree};
use splitplane_lab::Machine;
use splitplane_render::scene::{LoadOptions, Scene, load};

use contender::Geometry;
use measure::{Plan, built, measure, pin};
use ours::Ours;
use rays::{Kind, Rays};
use record::{Row, Run, rows};

/// Casts four sets of rays through every contender in turn and compares speed and hits.
#[derive(Parser)]
#[command(version)]
struct Args {
    /// Scenes, by name or file, as the command `splitplane` takes them
    #[arg(default_values_t = ["killeroo", "sponza", "living-room", "kitchen", "coffee", "truck", "arcade"].map(String::from))]
    scenes: Vec<String>,
    /// Folders in which scenes are looked for, before those of SPLITPLANE_SCENES
    #[arg(long = "scenes", value_name = "DIR")]
    search: Vec<PathBuf>,
    /// Contenders: our trees by name (wn+kd:6@binary, wn+kd:6/fast@wide), and
    /// embree[-robust][-packet4|-packet8|-packet16], obvhs-bvh2, obvhs-cwbvh, bvh-crate, parry3d,
    /// tinybvh-bvh8
    #[arg(
        long,
        value_delimiter = ',',
        default_value = "embree,embree-robust,embree-packet8,embree-packet16,obvhs-bvh2,obvhs-cwbvh,parry3d,bvh-crate,bvh,kd,wn+kd:6"
    )]
    contenders: Vec<String>,
    /// The contender that the ratios are to; the first one where it does not take part
    #[arg(long, default_value = "embree")]
    baseline: String,
    /// Sets of rays
    #[arg(long, value_delimiter = ',', default_values_t = Kind::ALL.map(|kind| kind.name().to_owned()))]
    sets: Vec<String>,
    /// Times that every contender is measured
    #[arg(long, default_value_t = 7, value_parser = clap::value_parser!(u32).range(1..))]
    reps: u32,
    /// Rays a set, about; at most 1048576 camera rays
    #[arg(long, default_value_t = 1 << 18, value_parser = clap::value_parser!(u32).range(1024..=1 << 24))]
    rays: u32,
    /// Move our trees to another place in memory after so many repetitions; 0: never
    #[arg(long, default_value_t = 1, value_name = "REPS")]
    move_every: u32,
    /// Threads of the builds; the rays have one
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..))]
    build_threads: u32,
    /// Seed of the rays
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Measure nothing: cast so many of each set of rays that `splitplane verify` knows, and count
    /// the answers that are missing or wrong
    #[arg(long, value_name = "RAYS", value_parser = clap::value_parser!(u64).range(1..))]
    leaks: Option<u64>,
    /// Cast no rays: build every contender so many times, in turn
    #[arg(long, value_name = "REPS", value_parser = clap::value_parser!(u32).range(1..))]
    builds: Option<u32>,
    /// Append the rows to this file, as JSON, one a line
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Measure nothing: take the rows from these files of JSON lines; of rows for the same, the
    /// last counts
    #[arg(long, value_name = "FILE", num_args = 1..)]
    from: Vec<PathBuf>,
    /// Write all rows as CSV
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
    /// Write tables of all rows as Markdown
    #[arg(long, value_name = "FILE")]
    markdown: Option<PathBuf>,
    /// Draw the ratios of all rows, as SVG
    #[arg(long, value_name = "FILE")]
    plot: Option<PathBuf>,
}

fn main() -> Result<()> {
    let args = Args::parse();
    if let Some(rays) = args.leaks {
        let columns = leaks::leaks(&args.contenders, rays)?;
        let table = leaks::markdown(&args.contenders, &columns, rays);
        print!("{table}");
        if let Some(path) = &args.markdown {
            std::fs::write(path, table)?;
        }
        return Ok(());
    }
    if let Some(reps) = args.builds {
        let mut out = builds::HEAD.to_owned();
        for name in &args.scenes {
            let scene = scene(&args, name, &Machine::now())?;
            let geometry = Geometry::of(&scene.mesh);
            out += &builds::of_scene(&args, &scene.name, &geometry, reps)?;
        }
        print!("{out}");
        if let Some(path) = &args.markdown {
            std::fs::write(path, out)?;
        }
        return Ok(());
    }
    let rows = if args.from.is_empty() {
        let mut all = Vec::new();
        for scene in &args.scenes {
            let rows = of_scene(&args, scene)?;
            println!("{}", report::table(&rows));
            if let Some(path) = &args.json {
                append(path, &rows)?;
            }
            all.extend(rows);
        }
        all
    } else {
        read(&args.from)?
    };
    if let Some(path) = &args.csv {
        let mut writer = csv::Writer::from_path(path)?;
        rows.iter().try_for_each(|row| writer.serialize(row))?;
        writer.flush()?;
    }
    if let Some(path) = &args.markdown {
        std::fs::write(path, report::markdown(&rows))?;
    }
    if let Some(path) = &args.plot {
        std::fs::write(path, plot::svg(&rows))?;
    }
    let inexact: usize = rows.iter().map(|row| row.inexact).sum();
    ensure!(
        inexact == 0,
        "{inexact} answers of our trees differ from those of brute force"
    );
    Ok(())
}

/// A scene that has triangles; says so where the machine is busy.
fn scene(args: &Args, name: &str, machine: &Machine) -> Result<Scene> {
    if machine.is_busy() {
        eprintln!(
            "the machine is busy (load {:.1}): the times mean little",
            machine.load_1m.unwrap_or_default()
        );
    }
    let options = LoadOptions {
        search: args.search.clone(),
        ..LoadOptions::default()
    };
    let scene = load(name, &options)?;
    let triangles = scene.mesh.usable_triangles().len();
    ensure!(triangles > 0, "{name} has no triangles");
    eprintln!("{}: {triangles} triangles", scene.name);
    Ok(scene)
}

/// Measures all contenders on a scene.
fn of_scene(args: &Args, name: &str) -> Result<Vec<Row>> {
    let machine = Machine::now();
    let scene = scene(args, name, &machine)?;
    let geometry = Geometry::of(&scene.mesh);

    let kinds = args
        .sets
        .iter()
        .map(|set| {
            let mut kinds = Kind::ALL.into_iter();
            kinds.find(|kind| kind.name() == set).with_context(|| {
                format!("there is no set \"{set}\"; there are primary, ao, bounce, random")
            })
        })
        .collect::<Result<Vec<Kind>>>()?;
    let mut contenders = Vec::new();
    for name in &args.contenders {
        let one = built(name, &geometry, args.build_threads as usize)?;
        eprintln!("  {name} built in {:.2} s", one.build_wall);
        contenders.push(one);
    }
    if contenders.is_empty() {
        bail!("no contenders; name some with --contenders");
    }
    let baseline = args.contenders.iter().position(|c| *c == args.baseline);
    let is_embree = |name: &String| name.starts_with("embree");
    let run = Run {
        scene: scene.name.clone(),
        triangles: geometry.triangles.len(),
        build_threads: args.build_threads as usize,
        seed: args.seed,
        cpu: machine.cpu,
        load: machine.load_1m,
        embree: args
            .contenders
            .iter()
            .any(is_embree)
            .then(embree::version)
            .transpose()?,
    };

    // The hierarchy builds fastest, and answers as all our trees do: as brute force.
    let hierarchy = Tree::build(&scene.mesh, "bvh".parse()?, &BuildParams::default())?;
    let rays = Rays::new(&scene.camera, &hierarchy, args.rays as usize, args.seed);
    let truth = Ours::of(hierarchy);
    let plan = Plan {
        reps: args.reps as usize,
        move_every: args.move_every as usize,
        scale: scene.mesh.bounds().diagonal(),
    };
    pin()?;
    let mut all = Vec::new();
    for kind in kinds {
        let rays = rays.of(kind);
        if rays.is_empty() {
            eprintln!(
                "  the camera sees nothing: no rays of the set {}",
                kind.name()
            );
            continue;
        }
        let found = measure(&plan, kind, &rays, &mut contenders, &truth);
        all.extend(rows(
            &run,
            kind,
            rays.len(),
            &contenders,
            &found,
            baseline.unwrap_or(0),
        ));
    }
    Ok(all)
}

fn append(path: &Path, rows: &[Row]) -> Result<()> {
    let mut file = OpenOptions::new()
        .create(true)
        .append(true)
        .open(path)
        .with_context(|| format!("{} cannot be written", path.display()))?;
    let lines = rows.iter().map(serde_json::to_string);
    let lines: Vec<String> = lines.collect::<Result<_, _>>()?;
    file.write_all((lines.join("\n") + "\n").as_bytes())?;
    Ok(())
}

/// The rows of the files; of rows for the same, the last one, in the place of the first.
fn read(paths: &[PathBuf]) -> Result<Vec<Row>> {
    let mut rows: Vec<Row> = Vec::new();
    for path in paths {
        let text = std::fs::read_to_string(path)
            .with_context(|| format!("{} cannot be read", path.display()))?;
        for (line, number) in text.lines().zip(1..) {
            let row: Row = serde_json::from_str(line)
                .with_context(|| format!("{}:{number}: not a row", path.display()))?;
            let key = |row: &Row| (row.scene.clone(), row.contender.clone(), row.set);
            match rows.iter_mut().find(|other| key(other) == key(&row)) {
                Some(other) => *other = row,
                None => rows.push(row),
            }
        }
    }
    Ok(rows)
}
