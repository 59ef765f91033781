//! `splitplane cast`: rays from a NumPy file, hits to one.

use std::fs::File;
use std::io::{self, BufReader, Cursor, Read, Write};
use std::path::Path;

use npyz::{DType, NpyFile, Order, TypeChar, WriterBuilder};
use splitplane::{Hit, Ray, TREES, Tree, TreeChoice};
use splitplane_lab::{LabError, Layouts, Preset, write_whole};
use splitplane_render::scene::Instancing;
use zip::{CompressionMethod, ZipWriter, write::SimpleFileOptions};

use crate::args::{CastCommand, Query, TreeSource, layout};
use crate::failure::{Failure, writable_place, writable_places};
use crate::numbers::{count, grouped, seconds};
use crate::progress::{self, Bar};
use crate::{print, scene};

pub fn run(command: &CastCommand) -> Result<(), Failure> {
    let read = [command.scene.file(), &command.rays];
    let tree = command.tree.as_ref().and_then(TreeSource::file);
    writable_place(&command.out, read.into_iter().chain(tree))?;
    let quiet = command.general.quiet;
    let rays = read_rays(&command.rays)
        .map_err(|error| Failure::input(format!("{}: {error}", command.rays.display())))?;
    let mut settings = command.build.settings(Preset::Default, &command.general);
    settings.layouts = Layouts::both(layout(command.layout, settings.traversal));
    let bar = Bar::new(quiet, 1);
    bar.spin(format!("reading {}", command.scene.scene));
    let scene = scene::load(&command.scene, Instancing::Flattened, quiet)?;
    writable_places([&command.out], &scene)?;
    let source = match &command.tree {
        Some(tree) => tree.clone(),
        None => TreeSource::Built(TreeChoice::new(TREES[0].name, None).map_err(Failure::input)?),
    };
    let built = scene::tree(&source, &scene.mesh, &command.build, &mut settings, &bar)?;
    scene::check_layout(&source, &built, command.layout)?;
    let (tree, made) = match source {
        TreeSource::Built(tree) => (tree, "built"),
        TreeSource::Saved(_) => (built.tree.choice(), "loaded"),
    };
    bar.spin(format!("casting {}", count(rays.len() as u64, "ray")));
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(command.general.threads())
        .build()
        .map_err(|source| LabError::Threads { source })?;
    let start = std::time::Instant::now();
    let hits = pool.install(|| Hits::of(&built.tree, &rays, command.query));
    let elapsed = start.elapsed().as_secs_f64();
    progress::clear();

    let written = hits
        .npz()
        .and_then(|npz| write_whole(&command.out, |file| file.write_all(&npz)));
    written.map_err(|source| LabError::Write {
        path: command.out.clone(),
        source,
    })?;
    print::line(&format!(
        "{} of {} hit {} ({}; {tree} {made} in {}, cast in {})",
        grouped(hits.count() as u64),
        count(rays.len() as u64, "ray"),
        scene.name,
        count(scene.mesh.triangles().len() as u64, "triangle"),
        seconds(built.seconds),
        seconds(elapsed),
    ))?;
    print::line(&format!("wrote {}", command.out.display()))?;
    Ok(())
}

/// What is wrong with a file of rays.
#[derive(Debug)]
enum RaysError {
    Io(io::Error),
    Not(String),
}

impl std::fmt::Display for RaysError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            RaysError::Io(error) => error.fmt(f),
            RaysError::Not(text) => f.write_str(text),
        }
    }
}

impl From<io::Error> for RaysError {
    fn from(error: io::Error) -> Self {
        RaysError::Io(error)
    }
}

/// The rays of a `.npy` file: (N,6) or (N,8), float32 or float64, in C or Fortran order.
fn read_rays(path: &Path) -> Result<Vec<Ray>, RaysError> {
    let file = File::open(path)?;
    let metadata = file.metadata()?;
    if metadata.is_dir() {
        return Err(RaysError::Not("is a folder, not a .npy file".into()));
    }
    let size = metadata.is_file().then_some(metadata.len());
    let npy = NpyFile::new(BufReader::new(file))
        .map_err(|error| RaysError::Not(format!("is not a .npy file: {error}")))?;
    let accepted = "rays are (N,6): origin, direction; or (N,8): origin, direction, tnear, tfar";
    let (count, columns) = match npy.shape() {
        &[count, columns @ (6 | 8)] => (count, columns as usize),
        shape => {
            return Err(RaysError::Not(format!(
                "has the shape {}; {accepted}",
                shape_text(shape)
            )));
        }
    };
    let width = match npy.dtype() {
        DType::Plain(plain) if plain.type_char() == TypeChar::Float => plain.size_field(),
        _ => 0,
    };
    if !matches!(width, 4 | 8) {
        return Err(RaysError::Not(format!(
            "holds {}; rays are float32 (or float64)",
            npy.dtype().descr()
        )));
    }
    // Before any memory is asked for: a header may promise more than any machine has.
    let needed = u128::from(count) * columns as u128 * u128::from(width);
    if let Some(size) = size.filter(|&size| u128::from(size) < needed) {
        return Err(RaysError::Not(format!(
            "is cut short: {count} rays need {needed} bytes, the file has {size}"
        )));
    }
    let order = npy.order();
    let numbers: Vec<f32> = if width == 4 {
        numbers::<f32, _>(npy, |x| x)?
    } else {
        numbers::<f64, _>(npy, |x| x as f32)?
    };
    let count = numbers.len() / columns;
    let at = |ray: usize, column: usize| match order {
        Order::C => numbers[ray * columns + column],
        Order::Fortran => numbers[column * count + ray],
    };
    let ray = |i: usize| {
        let mut ray = Ray::new(
            std::array::from_fn(|axis| at(i, axis)),
            std::array::from_fn(|axis| at(i, 3 + axis)),
        );
        if columns == 8 {
            (ray.t_min, ray.t_max) = (at(i, 6), at(i, 7));
        }
        ray
    };
    Ok((0..count).map(ray).collect())
}

fn numbers<T: npyz::Deserialize, R: Read>(
    npy: NpyFile<R>,
    narrow: impl Fn(T) -> f32,
) -> Result<Vec<f32>, RaysError> {
    let data = npy
        .data::<T>()
        .map_err(|error| RaysError::Not(error.to_string()))?;
    data.map(|number| number.map(&narrow))
        .collect::<io::Result<_>>()
        .map_err(|error| RaysError::Not(format!("is cut short: {error}")))
}

/// A shape as Python writes it: `(4,)`, `(10, 7)`.
fn shape_text(shape: &[u64]) -> String {
    match shape {
        [one] => format!("({one},)"),
        many => format!(
            "({})",
            many.iter()
                .map(u64::to_string)
                .collect::<Vec<_>>()
                .join(", ")
        ),
    }
}

/// The answers, in the order of the rays.
enum Hits {
    Closest(Vec<Option<Hit>>),
    Any(Vec<bool>),
}

impl Hits {
    fn of(tree: &Tree, rays: &[Ray], query: Query) -> Hits {
        match query {
            Query::Closest => {
                let mut hits = vec![None; rays.len()];
                tree.closest_hits(rays, &mut hits);
                Hits::Closest(hits)
            }
            Query::Any => {
                let mut hits = vec![false; rays.len()];
                tree.any_hits(rays, &mut hits);
                Hits::Any(hits)
            }
        }
    }

    fn count(&self) -> usize {
        match self {
            Hits::Closest(hits) => hits.iter().flatten().count(),
            Hits::Any(hits) => hits.iter().filter(|hit| **hit).count(),
        }
    }

    /// The arrays as the bytes of a file. In memory: a `ZipWriter` that cannot write to its file
    /// prints so when it is dropped.
    fn npz(&self) -> io::Result<Vec<u8>> {
        let mut npz = ZipWriter::new(Cursor::new(Vec::new()));
        self.write(&mut npz)?;
        Ok(npz.finish()?.into_inner())
    }

    fn write<W: io::Write + io::Seek>(&self, npz: &mut ZipWriter<W>) -> io::Result<()> {
        match self {
            Hits::Closest(hits) => {
                let or_miss = |value: fn(&Hit) -> f32, miss: f32| {
                    hits.iter().map(move |hit| hit.as_ref().map_or(miss, value))
                };
                array(npz, "t", hits.len(), or_miss(|hit| hit.t, f32::INFINITY))?;
                let triangles = hits
                    .iter()
                    .map(|hit| hit.map_or(u32::MAX, |hit| hit.triangle));
                array(npz, "triangle", hits.len(), triangles)?;
                array(npz, "u", hits.len(), or_miss(|hit| hit.u, 0.0))?;
                array(npz, "v", hits.len(), or_miss(|hit| hit.v, 0.0))
            }
            Hits::Any(hits) => array(npz, "occluded", hits.len(), hits.iter().copied()),
        }
    }
}

fn array<T: npyz::AutoSerialize, W: io::Write + io::Seek>(
    npz: &mut ZipWriter<W>,
    name: &str,
    count: usize,
    values: impl Iterator<Item = T>,
) -> io::Result<()> {
    // Not compressed, and without the time: the same hits are the same bytes.
    let options = SimpleFileOptions::DEFAULT
        .compression_method(CompressionMethod::Stored)
        .large_file((count * size_of::<T>()) as u64 >= 1 << 31);
    npz.start_file(npyz::npz::file_name_from_array_name(name), options)?;
    let mut writer = npyz::WriteOptions::new()
        .default_dtype()
        .shape(&[count as u64])
        .writer(npz)
        .begin_nd()?;
    writer.extend(values)?;
    writer.finish()
}
