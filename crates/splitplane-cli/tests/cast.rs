//! `splitplane cast`: rays in, hits out, against every triangle tested one by one.

mod common;

use std::fs::File;
use std::io::{BufReader, Write};
use std::path::Path;

use common::{folder, hills, hills_scene, outcome, splitplane};
use npyz::{NpyFile, WriterBuilder};
use splitplane::TREES;

/// Rays towards the hills and past them, with tnear and tfar; a few that can hit nothing.
fn rays() -> Vec<[f32; 8]> {
    let mut state = 1_u32;
    let mut draw = || {
        state = state.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
        (state >> 8) as f32 / (1 << 24) as f32
    };
    let mut rays: Vec<[f32; 8]> = (0..500)
        .map(|i| {
            let [a, b, c, d] = [draw(), draw(), draw(), draw()];
            let t_max = if i % 3 == 0 { 3.9 } else { f32::INFINITY };
            [
                a - 0.5,
                b - 0.5,
                0.0,
                1.6 * c - 0.8,
                1.6 * d - 0.8,
                1.0,
                0.0,
                t_max,
            ]
        })
        .collect();
    rays.push([0.0, 0.0, 0.0, f32::NAN, 0.0, 1.0, 0.0, f32::INFINITY]);
    rays.push([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, f32::INFINITY]);
    rays.push([0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, f32::NAN]);
    rays.push([0.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.0, f32::INFINITY]);
    rays
}

fn write_npy<T: npyz::AutoSerialize + Copy>(
    path: &Path,
    shape: &[u64],
    order: npyz::Order,
    values: &[T],
) {
    let mut writer = npyz::WriteOptions::new()
        .default_dtype()
        .order(order)
        .shape(shape)
        .writer(File::create(path).unwrap())
        .begin_nd()
        .unwrap();
    writer.extend(values.iter().copied()).unwrap();
    writer.finish().unwrap();
}

fn read<T: npyz::Deserialize>(path: &Path, name: &str) -> Vec<T> {
    let mut npz = zip::ZipArchive::new(BufReader::new(File::open(path).unwrap())).unwrap();
    let array = npz.by_name(&format!("{name}.npy")).unwrap();
    NpyFile::new(array).unwrap().into_vec().unwrap()
}

/// The nearest hit among all triangles, in f64 (t, triangle).
fn brute_force(ray: &[f32; 8]) -> Option<(f64, u32)> {
    type V = [f64; 3];
    let sub = |a: V, b: V| -> V { std::array::from_fn(|i| a[i] - b[i]) };
    let dot = |a: V, b: V| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let cross = |a: V, b: V| -> V {
        [
            a[1] * b[2] - a[2] * b[1],
            a[2] * b[0] - a[0] * b[2],
            a[0] * b[1] - a[1] * b[0],
        ]
    };
    let r = ray.map(f64::from);
    let (o, d) = ([r[0], r[1], r[2]], [r[3], r[4], r[5]]);
    let (positions, triangles) = hills(12);
    let mut best: Option<(f64, u32)> = None;
    for (i, corners) in triangles.iter().enumerate() {
        let [a, b, c] = corners.map(|index| positions[index as usize].map(f64::from));
        let (e, f) = (sub(b, a), sub(c, a));
        let p = cross(d, f);
        let det = dot(e, p);
        let s = sub(o, a);
        let u = dot(s, p) / det;
        let q = cross(s, e);
        let (v, t) = (dot(d, q) / det, dot(f, q) / det);
        let inside = u >= 0.0 && v >= 0.0 && u + v <= 1.0;
        if inside && t > r[6] && t <= r[7] && best.is_none_or(|(nearest, _)| t < nearest) {
            best = Some((t, i as u32));
        }
    }
    best
}

#[test]
fn hits_are_those_of_testing_every_triangle_with_every_tree_and_any_number_of_threads() {
    let folder = folder();
    hills_scene(folder.path(), "");
    let rays = rays();
    let flat: Vec<f32> = rays.iter().flatten().copied().collect();
    let count = rays.len() as u64;
    write_npy(
        &folder.path().join("rays.npy"),
        &[count, 8],
        npyz::Order::C,
        &flat,
    );
    let mut bytes = Vec::new();
    for spec in TREES {
        for threads in ["1", "2"] {
            let (code, out, err) = outcome(splitplane(&folder).args([
                "cast",
                "hills.pbrt",
                "--rays",
                "rays.npy",
                "--out",
                "hits.npz",
                "--tree",
                spec.name,
                "--threads",
                threads,
            ]));
            assert_eq!(code, 0, "{err}");
            assert!(out.contains("hits.npz"), "{out}");
            bytes.push(std::fs::read(folder.path().join("hits.npz")).unwrap());
        }
        let (code, _, err) = outcome(splitplane(&folder).args([
            "cast",
            "hills.pbrt",
            "--rays",
            "rays.npy",
            "--out",
            "any.npz",
            "--tree",
            spec.name,
            "--query",
            "ANY",
        ]));
        assert_eq!(code, 0, "{err}");
        let occluded: Vec<bool> = read(&folder.path().join("any.npz"), "occluded");
        let t: Vec<f32> = read(&folder.path().join("hits.npz"), "t");
        let hit: Vec<bool> = t.iter().map(|t| t.is_finite()).collect();
        assert_eq!(occluded, hit, "{}", spec.name);
    }
    assert!(bytes.windows(2).all(|pair| pair[0] == pair[1]));

    let hits = folder.path().join("hits.npz");
    let (t, triangle): (Vec<f32>, Vec<u32>) = (read(&hits, "t"), read(&hits, "triangle"));
    let (u, v): (Vec<f32>, Vec<f32>) = (read(&hits, "u"), read(&hits, "v"));
    assert_eq!([t.len(), triangle.len(), u.len(), v.len()], [rays.len(); 4]);
    let (positions, triangles) = hills(12);
    let mut found = 0;
    for (i, ray) in rays.iter().enumerate() {
        match brute_force(ray) {
            None => assert_eq!((t[i], triangle[i]), (f32::INFINITY, u32::MAX), "ray {i}"),
            Some((nearest, index)) => {
                found += 1;
                assert_eq!(triangle[i], index, "ray {i}");
                assert!((f64::from(t[i]) - nearest).abs() < 1e-5, "ray {i}");
                let corners = triangles[index as usize].map(|corner| positions[corner as usize]);
                for axis in 0..3 {
                    let w = 1.0 - u[i] - v[i];
                    let on =
                        w * corners[0][axis] + u[i] * corners[1][axis] + v[i] * corners[2][axis];
                    assert!(
                        (on - (ray[axis] + t[i] * ray[3 + axis])).abs() < 1e-4,
                        "ray {i}"
                    );
                }
            }
        }
    }
    assert!((100..rays.len()).contains(&found), "{found} hits");
}

#[test]
fn six_columns_both_precisions_and_both_orders_are_the_same_rays() {
    let folder = folder();
    hills_scene(folder.path(), "");
    let rays: Vec<[f32; 6]> = rays()
        .iter()
        .map(|ray| std::array::from_fn(|i| ray[i]))
        .collect();
    let count = rays.len() as u64;
    let rows: Vec<f32> = rays.iter().flatten().copied().collect();
    let columns: Vec<f32> = (0..6)
        .flat_map(|c| rays.iter().map(move |ray| ray[c]))
        .collect();
    let wide: Vec<f64> = rows.iter().copied().map(f64::from).collect();
    let path = |name: &str| folder.path().join(name);
    write_npy(&path("c.npy"), &[count, 6], npyz::Order::C, &rows);
    write_npy(
        &path("fortran.npy"),
        &[count, 6],
        npyz::Order::Fortran,
        &columns,
    );
    write_npy(&path("wide.npy"), &[count, 6], npyz::Order::C, &wide);
    let mut hits = Vec::new();
    for name in ["c.npy", "fortran.npy", "wide.npy"] {
        let (code, _, err) = outcome(splitplane(&folder).args([
            "cast",
            "hills.pbrt",
            "--rays",
            name,
            "--out",
            "hits.npz",
        ]));
        assert_eq!(code, 0, "{name}: {err}");
        hits.push(std::fs::read(path("hits.npz")).unwrap());
    }
    assert!(hits[0] == hits[1] && hits[0] == hits[2]);
}

#[test]
fn no_rays_give_no_hits() {
    let folder = folder();
    hills_scene(folder.path(), "");
    write_npy::<f32>(
        &folder.path().join("rays.npy"),
        &[0, 6],
        npyz::Order::C,
        &[],
    );
    let (code, _, err) = outcome(splitplane(&folder).args([
        "cast",
        "hills.pbrt",
        "--rays",
        "rays.npy",
        "--out",
        "hits.npz",
    ]));
    assert_eq!(code, 0, "{err}");
    assert_eq!(read::<f32>(&folder.path().join("hits.npz"), "t"), []);
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_gives_one_error() {
    let folder = folder();
    hills_scene(folder.path(), "");
    let rays = [0.0_f32, 0.0, 0.0, 0.0, 0.0, 1.0];
    write_npy(
        &folder.path().join("rays.npy"),
        &[1, 6],
        npyz::Order::C,
        &rays,
    );
    let cast = ["cast", "hills.pbrt", "--rays", "rays.npy", "-q"];
    let (code, _, err) = outcome(splitplane(&folder).args(cast).args(["--out", "/dev/full"]));
    assert_eq!(code, 2);
    assert!(
        err.starts_with("error: ") && err.contains("/dev/full"),
        "{err}"
    );
    assert_eq!(err.lines().count(), 1, "{err}");
}

#[test]
fn files_that_hold_no_rays_are_refused_and_say_why() {
    let folder = folder();
    hills_scene(folder.path(), "");
    let path = |name: &str| folder.path().join(name);
    write_npy(&path("flat.npy"), &[12], npyz::Order::C, &[0.0_f32; 12]);
    write_npy(&path("seven.npy"), &[2, 7], npyz::Order::C, &[0.0_f32; 14]);
    write_npy(&path("whole.npy"), &[2, 6], npyz::Order::C, &[0_i32; 12]);
    write_npy(&path("cut.npy"), &[2, 6], npyz::Order::C, &[0.0_f32; 12]);
    let whole = std::fs::read(path("cut.npy")).unwrap();
    std::fs::write(path("cut.npy"), &whole[..whole.len() - 5]).unwrap();
    std::fs::write(path("header.npy"), &whole[..40]).unwrap();
    std::fs::write(path("empty.npy"), b"").unwrap();
    std::fs::write(path("text.npy"), b"origin direction\n0 0 0 0 0 1\n").unwrap();
    // A header that promises more rays than any machine can hold.
    let text = "{'descr': '<f4', 'fortran_order': False, 'shape': (1000000000000, 6), }\n";
    let mut huge = File::create(path("huge.npy")).unwrap();
    huge.write_all(b"\x93NUMPY\x01\x00").unwrap();
    huge.write_all(&(text.len() as u16).to_le_bytes()).unwrap();
    huge.write_all(text.as_bytes()).unwrap();
    assert!(NpyFile::new(File::open(path("huge.npy")).unwrap()).is_ok());
    for (name, word) in [
        ("flat.npy", "(12,)"),
        ("seven.npy", "(2, 7)"),
        ("whole.npy", "float32"),
        ("cut.npy", "cut short"),
        ("header.npy", "not a .npy file"),
        ("empty.npy", "not a .npy file"),
        ("text.npy", "not a .npy file"),
        ("huge.npy", "cut short"),
        ("missing.npy", "missing.npy"),
        (".", "folder"),
    ] {
        let (code, _, err) = outcome(splitplane(&folder).args([
            "cast",
            "hills.pbrt",
            "--rays",
            name,
            "--out",
            "hits.npz",
        ]));
        assert_eq!(code, 2, "{name}: {err}");
        assert!(err.contains(word) && err.contains(name), "{name}: {err}");
        assert!(!path("hits.npz").exists());
    }
}
