//! A batch of rays, timed: what `crates/splitplane-py/benches/overhead.py` holds the Python package
//! against. It writes the files, starts this example on their folder, and asks it, in turn with the
//! package, for one batch after the other. Without a folder: one batch of rays onto a torus.
//!
//! `cargo run --release --example batch [FOLDER]`: the folder is read, nothing is written.

mod shapes;

use std::io::{BufRead, Write};
use std::path::Path;
use std::time::Instant;

use splitplane::{Mesh, Ray, Tree};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let Some(folder) = std::env::args_os().nth(1) else {
        let tree = Tree::new(&shapes::torus([0.0; 3], 1.0, 0.4, 64)?)?;
        let rays: Vec<Ray> = (0..100_000)
            .map(|i| shapes::hemisphere([0.0, 0.0, 1.0], i, 100_000))
            .map(|up| Ray::new([0.0, 0.0, -2.0], up))
            .collect();
        println!("{}", batch(&tree, &rays, "closest")?);
        return Ok(());
    };
    let folder = Path::new(&folder);
    let positions = read(&folder.join("positions.f32"), f32::from_le_bytes)?;
    let triangles = read(&folder.join("triangles.u32"), u32::from_le_bytes)?;
    let mesh = Mesh::new(
        positions.as_chunks().0.to_vec(),
        triangles.as_chunks().0.to_vec(),
    )?;
    let tree = Tree::new(&mesh)?;
    let rays: Vec<Ray> = read(&folder.join("rays.f32"), f32::from_le_bytes)?
        .as_chunks()
        .0
        .iter()
        .map(|&[x, y, z, u, v, w]| Ray::new([x, y, z], [u, v, w]))
        .collect();
    for query in std::io::stdin().lock().lines() {
        let mut out = std::io::stdout().lock();
        writeln!(out, "{}", batch(&tree, &rays, query?.trim())?)?;
        out.flush()?;
    }
    Ok(())
}

/// Casts all rays: how long that took, in seconds, and how many hit.
fn batch(tree: &Tree, rays: &[Ray], query: &str) -> Result<String, String> {
    let start = Instant::now();
    let (seconds, hits) = match query {
        "closest" => {
            let mut hits = vec![None; rays.len()];
            tree.closest_hits(rays, &mut hits);
            (start.elapsed(), hits.iter().flatten().count())
        }
        "any" => {
            let mut hits = vec![false; rays.len()];
            tree.any_hits(rays, &mut hits);
            (start.elapsed(), hits.iter().filter(|hit| **hit).count())
        }
        _ => return Err(format!("closest or any, not {query:?}")),
    };
    Ok(format!("{} {hits}", seconds.as_secs_f64()))
}

/// The numbers of a file, little-endian.
fn read<T>(path: &Path, number: fn([u8; 4]) -> T) -> Result<Vec<T>, String> {
    let bytes = std::fs::read(path)
        .map_err(|error| format!("{} cannot be read: {error}", path.display()))?;
    Ok(bytes.as_chunks().0.iter().copied().map(number).collect())
}
