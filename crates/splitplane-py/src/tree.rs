//! A tree and its batches of queries.

use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use numpy::{IntoPyArray, PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray2};
use pyo3::exceptions::{PyMemoryError, PyValueError};
use pyo3::prelude::*;
use rayon::prelude::*;
use splitplane::{Counts, Hit, Layout, LoadError, Mesh, MeshError, Parts, Ray, TreeChoice};
use splitplane_lab::{Built, CardRecord, LabError, Layouts, Preset, Settings};

use crate::batch::{self, CHUNK, array2, empty, in_blocks, interruptible};
use crate::scenes::Stop;

type Array1<'py, T> = Bound<'py, PyArray1<T>>;
type Array2<'py, T> = Bound<'py, PyArray2<T>>;

fn read(path: &Path, mesh: &Mesh) -> Result<splitplane::Tree, LoadError> {
    splitplane::Tree::load(path, mesh)
}

#[allow(
    unsafe_code,
    reason = "who asks for it is told, as by `numpy.load(mmap_mode=...)`"
)]
fn mapped(path: &Path, mesh: &Mesh) -> Result<splitplane::Tree, LoadError> {
    // SAFETY: `RaycastingScene.load` asks its caller to leave the file as it is.
    unsafe { splitplane::Tree::load_mapped(path, mesh) }
}

/// What Open3D gives where nothing is hit.
const MISS: u32 = u32::MAX;

/// A tree over a mesh, or over several that were put one behind the other.
#[pyclass(frozen, module = "splitplane._native")]
pub(crate) struct Tree {
    built: Built,
    settings: Settings,
    /// Which triangle is of which mesh.
    parts: Parts,
    /// The normals of all triangles, once one is asked for: reading them takes a fraction of the
    /// time of reading vertices, which lie anywhere.
    normals: OnceLock<Vec<[f32; 3]>>,
}

/// An answer: its geometry, its triangle there, and where on it.
struct Place {
    geometry: u32,
    triangle: u32,
    uv: [f32; 2],
    normal: [f32; 3],
}

impl Place {
    /// That of a ray that hits nothing.
    const NONE: Place = Place {
        geometry: MISS,
        triangle: MISS,
        uv: [0.0; 2],
        normal: [0.0; 3],
    };
}

impl Tree {
    /// Builds a tree, which may take a while.
    pub(crate) fn over(
        py: Python<'_>,
        (mesh, parts): (Mesh, Parts),
        (tree, layout): (&str, &str),
        nthreads: usize,
    ) -> PyResult<Self> {
        let layout: Layout = layout.parse().map_err(PyValueError::new_err)?;
        let choice: TreeChoice =
            (tree.parse()).map_err(|error| PyValueError::new_err(format!("{error}")))?;
        let mut settings = Settings::of_preset(Preset::Default);
        settings.render.threads = nthreads;
        settings.layouts = Layouts::both(layout);
        let built = interruptible(py, |stop| {
            splitplane_lab::build(&mesh, choice, &settings, &Stop(stop))
        })?
        .map_err(|error| PyMemoryError::new_err(error.to_string()))?;
        Ok(Tree {
            built,
            settings,
            parts,
            normals: OnceLock::new(),
        })
    }

    fn mesh(&self) -> &Mesh {
        self.built.tree.mesh()
    }

    fn normals(&self) -> &[[f32; 3]] {
        self.normals.get_or_init(|| {
            let count = self.mesh().triangles().len() as u32;
            (0..count).map(|i| self.mesh().normal(i)).collect()
        })
    }

    /// Which geometry a triangle of the tree belongs to, and its index there.
    #[inline]
    fn own(&self, triangle: u32) -> (u32, u32) {
        let (geometry, triangle) = self.parts.locate(triangle);
        (geometry as u32, triangle)
    }

    #[inline]
    fn place(&self, triangle: u32, u: f32, v: f32) -> Place {
        let normal = self.normals()[triangle as usize];
        let (geometry, triangle) = self.own(triangle);
        Place {
            geometry,
            triangle,
            uv: [u, v],
            normal,
        }
    }

    fn closest_hits<'py, C: Cost>(
        &self,
        py: Python<'py>,
        rays: &Rays<'_>,
        nthreads: usize,
        costs: &mut [C],
    ) -> PyResult<Hits<'py>> {
        let count = rays.len();
        // Once, and without the interpreter's lock.
        py.detach(|| self.normals());
        let t: Array1<'_, f32> = empty(py, &[count], numpy::dtype::<f32>(py))?;
        let geometry: Array1<'_, u32> = empty(py, &[count], numpy::dtype::<u32>(py))?;
        let triangle: Array1<'_, u32> = empty(py, &[count], numpy::dtype::<u32>(py))?;
        let uv: Array2<'_, f32> = empty(py, &[count, 2], numpy::dtype::<f32>(py))?;
        let normal: Array2<'_, f32> = empty(py, &[count, 3], numpy::dtype::<f32>(py))?;
        {
            let mut guards = (t.readwrite(), geometry.readwrite(), triangle.readwrite());
            let t: &mut [f32] = guards.0.as_slice_mut()?;
            let geometry: &mut [u32] = guards.1.as_slice_mut()?;
            let triangle: &mut [u32] = guards.2.as_slice_mut()?;
            let mut guards = (uv.readwrite(), normal.readwrite());
            let uv: &mut [[f32; 2]] = guards.0.as_slice_mut()?.as_chunks_mut().0;
            let normal: &mut [[f32; 3]] = guards.1.as_slice_mut()?.as_chunks_mut().0;
            in_blocks(py, count, nthreads, |block| {
                (
                    t[block.clone()].par_chunks_mut(CHUNK),
                    geometry[block.clone()].par_chunks_mut(CHUNK),
                    triangle[block.clone()].par_chunks_mut(CHUNK),
                    uv[block.clone()].par_chunks_mut(CHUNK),
                    normal[block.clone()].par_chunks_mut(CHUNK),
                    costs[block.clone()].par_chunks_mut(CHUNK),
                    rays.rows[block].par_chunks(CHUNK),
                )
                    .into_par_iter()
                    .for_each_init(Vec::new, |chunk, outputs| {
                        let (t, geometry, triangle, uv, normal, costs, rows) = outputs;
                        let mut hits = [None; CHUNK];
                        let hits = &mut hits[..rows.len()];
                        C::closest_hits(&self.built.tree, rays.of_rows(rows, chunk), hits, costs);
                        for (i, hit) in hits.iter().enumerate() {
                            let place;
                            (t[i], place) = match hit {
                                Some(hit) => (hit.t, self.place(hit.triangle, hit.u, hit.v)),
                                None => (f32::INFINITY, Place::NONE),
                            };
                            (geometry[i], triangle[i]) = (place.geometry, place.triangle);
                            (uv[i], normal[i]) = (place.uv, place.normal);
                        }
                    });
            })?;
        }
        Ok((t, geometry, triangle, uv, normal))
    }

    fn any_hits<'py, C: Cost>(
        &self,
        py: Python<'py>,
        rays: &Rays<'_>,
        nthreads: usize,
        costs: &mut [C],
    ) -> PyResult<Array1<'py, bool>> {
        let found: Array1<'_, bool> = empty(py, &[rays.len()], numpy::dtype::<bool>(py))?;
        {
            let mut guard = found.readwrite();
            let found: &mut [bool] = guard.as_slice_mut()?;
            in_blocks(py, rays.len(), nthreads, |block| {
                (
                    found[block.clone()].par_chunks_mut(CHUNK),
                    costs[block.clone()].par_chunks_mut(CHUNK),
                    rays.rows[block].par_chunks(CHUNK),
                )
                    .into_par_iter()
                    .for_each_init(Vec::new, |chunk, (found, costs, rows)| {
                        C::any_hits(&self.built.tree, rays.of_rows(rows, chunk), found, costs);
                    });
            })?;
        }
        Ok(found)
    }

    /// All hits of all rays, ray by ray.
    fn every_hit(
        &self,
        py: Python<'_>,
        rays: &Rays<'_>,
        nthreads: usize,
    ) -> PyResult<Vec<(u32, Vec<Hit>)>> {
        let mut all = Vec::new();
        in_blocks(py, rays.len(), nthreads, |block| {
            let hits = block.into_par_iter().with_min_len(CHUNK).map(|i| {
                let mut hits = Vec::new();
                let ray = rays.of_row(&rays.rows[i]);
                self.built.tree.all_hits(&ray, &mut hits, &mut ());
                (i as u32, hits)
            });
            all.par_extend(hits.filter(|(_, hits)| !hits.is_empty()));
        })?;
        Ok(all)
    }
}

/// How the rays of a batch are cast: as the core's batches, or one by one, counting what each cost.
trait Cost: Copy + Default + Send + Sync {
    fn closest_hits(
        tree: &splitplane::Tree,
        rays: &[Ray],
        hits: &mut [Option<Hit>],
        costs: &mut [Self],
    );
    fn any_hits(tree: &splitplane::Tree, rays: &[Ray], hits: &mut [bool], costs: &mut [Self]);
}

impl Cost for () {
    fn closest_hits(
        tree: &splitplane::Tree,
        rays: &[Ray],
        hits: &mut [Option<Hit>],
        _: &mut [Self],
    ) {
        tree.closest_hits(rays, hits);
    }

    fn any_hits(tree: &splitplane::Tree, rays: &[Ray], hits: &mut [bool], _: &mut [Self]) {
        tree.any_hits(rays, hits);
    }
}

impl Cost for Counts {
    fn closest_hits(
        tree: &splitplane::Tree,
        rays: &[Ray],
        hits: &mut [Option<Hit>],
        costs: &mut [Self],
    ) {
        for ((ray, hit), cost) in rays.iter().zip(hits).zip(costs) {
            *hit = tree.closest_hit(ray, cost);
        }
    }

    fn any_hits(tree: &splitplane::Tree, rays: &[Ray], hits: &mut [bool], costs: &mut [Self]) {
        for ((ray, hit), cost) in rays.iter().zip(hits).zip(costs) {
            *hit = tree.any_hit(ray, cost);
        }
    }
}

/// `t`, geometry, triangle, (u, v) and normal of each ray.
type Hits<'py> = (
    Array1<'py, f32>,
    Array1<'py, u32>,
    Array1<'py, u32>,
    Array2<'py, f32>,
    Array2<'py, f32>,
);

/// Rays in an array, origin and direction, with the t that all of them have.
struct Rays<'a> {
    rows: &'a [[f32; 6]],
    interval: (f32, f32),
}

impl<'a> Rays<'a> {
    fn of(array: &'a PyReadonlyArray2<'_, f32>, interval: (f32, f32)) -> PyResult<Self> {
        let rows = batch::rows(array, "rays")?;
        Ok(Rays { rows, interval })
    }

    fn len(&self) -> usize {
        self.rows.len()
    }

    /// The rays of some rows, in that memory.
    #[inline]
    fn of_rows<'m>(&self, rows: &[[f32; 6]], memory: &'m mut Vec<Ray>) -> &'m [Ray] {
        memory.clear();
        memory.extend(rows.iter().map(|row| self.of_row(row)));
        memory
    }

    #[inline]
    fn of_row(&self, &[x, y, z, u, v, w]: &[f32; 6]) -> Ray {
        Ray {
            origin: [x, y, z],
            direction: [u, v, w],
            t_min: self.interval.0,
            t_max: self.interval.1,
        }
    }
}

/// Visits of axis-aligned, oblique and wide nodes and of leaves, and triangle tests.
fn counted(py: Python<'_>, counts: Vec<Counts>) -> PyResult<Array2<'_, u32>> {
    let row = |c: Counts| {
        [
            c.kd_visits,
            c.oblique_visits,
            c.wide_visits,
            c.leaf_visits,
            c.triangle_tests,
        ]
    };
    let narrow = |c: u64| u32::try_from(c).unwrap_or(u32::MAX);
    array2(py, counts.into_iter().map(|c| row(c).map(narrow)).collect())
}

#[pymethods]
impl Tree {
    /// The tree of that name over meshes, each of positions (N, 3), float32 or float64, and
    /// triangles (M, 3), indices into them.
    #[new]
    fn new(
        py: Python<'_>,
        meshes: Vec<Arrays<'_>>,
        tree: &str,
        layout: &str,
        nthreads: usize,
    ) -> PyResult<Self> {
        Tree::over(py, mesh_of(&meshes)?, (tree, layout), nthreads)
    }

    /// The tree in a file, over meshes as for a tree that is built; mapped into memory if so
    /// asked.
    #[staticmethod]
    fn load(py: Python<'_>, path: PathBuf, meshes: Vec<Arrays<'_>>, mmap: bool) -> PyResult<Self> {
        let (mesh, parts) = mesh_of(&meshes)?;
        let mut settings = Settings::of_preset(Preset::Default);
        let built = interruptible(py, |_| {
            let built = splitplane_lab::load_tree(
                &path,
                &mesh,
                &mut settings,
                match mmap {
                    true => mapped,
                    false => read,
                },
            );
            built.map(|built| (built, settings))
        })?;
        let (built, settings) = built.map_err(|error| match error {
            LabError::LoadTree {
                source: LoadError::Read(source),
                path,
            } => io_error(source, &path),
            error => PyValueError::new_err(error.to_string()),
        })?;
        Ok(Tree {
            built,
            settings,
            parts,
            normals: OnceLock::new(),
        })
    }

    /// Writes the tree to a file.
    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        py.detach(|| self.built.tree.save(&path))
            .map_err(|error| io_error(error, &path))
    }

    /// How the nodes are stored.
    #[getter]
    fn layout(&self) -> &'static str {
        self.built.tree.layout().name()
    }

    /// The position in space of the (0, 0, 0) that rays and points are counted from.
    #[getter]
    fn origin(&self) -> [f64; 3] {
        self.mesh().origin()
    }

    /// The tree's name.
    #[getter]
    fn name(&self) -> String {
        self.built.tree.choice().to_string()
    }

    /// Whether the meshes close a volume.
    #[getter]
    fn is_closed(&self) -> bool {
        self.mesh().is_closed()
    }

    /// What is known of the tree, as JSON.
    fn card(&self, scene: &str) -> PyResult<String> {
        let record = CardRecord::new(&self.built, scene, &self.settings);
        serde_json::to_string(&record).map_err(|error| PyValueError::new_err(error.to_string()))
    }

    /// The closest hits of (N, 6) rays: t, geometry, triangle, (u, v), normal; and (N, 4) counts
    /// where `stats`, which is `None` otherwise.
    fn closest_hit<'py>(
        &self,
        py: Python<'py>,
        rays: PyReadonlyArray2<'py, f32>,
        nthreads: usize,
        stats: bool,
    ) -> PyResult<(Hits<'py>, Option<Array2<'py, u32>>)> {
        let rays = Rays::of(&rays, (0.0, f32::INFINITY))?;
        if stats {
            let mut counts = vec![Counts::default(); rays.len()];
            let hits = self.closest_hits(py, &rays, nthreads, &mut counts)?;
            return Ok((hits, Some(counted(py, counts)?)));
        }
        let hits = self.closest_hits(py, &rays, nthreads, &mut vec![(); rays.len()])?;
        Ok((hits, None))
    }

    /// Whether each of (N, 6) rays hits anything in that interval of t; counts as for `closest_hit`.
    fn any_hit<'py>(
        &self,
        py: Python<'py>,
        rays: PyReadonlyArray2<'py, f32>,
        interval: (f32, f32),
        nthreads: usize,
        stats: bool,
    ) -> PyResult<(Array1<'py, bool>, Option<Array2<'py, u32>>)> {
        let rays = Rays::of(&rays, interval)?;
        if stats {
            let mut counts = vec![Counts::default(); rays.len()];
            let found = self.any_hits(py, &rays, nthreads, &mut counts)?;
            return Ok((found, Some(counted(py, counts)?)));
        }
        let found = self.any_hits(py, &rays, nthreads, &mut vec![(); rays.len()])?;
        Ok((found, None))
    }

    /// How many triangles each of (N, 6) rays hits.
    fn count_hits<'py>(
        &self,
        py: Python<'py>,
        rays: PyReadonlyArray2<'py, f32>,
        nthreads: usize,
    ) -> PyResult<Array1<'py, i32>> {
        let rays = Rays::of(&rays, (0.0, f32::INFINITY))?;
        let mut counts = vec![0i32; rays.len()];
        for (ray, hits) in self.every_hit(py, &rays, nthreads)? {
            counts[ray as usize] = i32::try_from(hits.len()).unwrap_or(i32::MAX);
        }
        Ok(counts.into_pyarray(py))
    }

    /// All hits of (N, 6) rays, ray by ray and in order of t: the ray of each, t, geometry,
    /// triangle and (u, v).
    #[expect(clippy::type_complexity, reason = "it is a list of columns")]
    fn all_hits<'py>(
        &self,
        py: Python<'py>,
        rays: PyReadonlyArray2<'py, f32>,
        nthreads: usize,
    ) -> PyResult<(
        Array1<'py, u32>,
        Array1<'py, f32>,
        Array1<'py, u32>,
        Array1<'py, u32>,
        Array2<'py, f32>,
    )> {
        let rays = Rays::of(&rays, (0.0, f32::INFINITY))?;
        let all = self.every_hit(py, &rays, nthreads)?;
        let count = all.iter().map(|(_, hits)| hits.len()).sum();
        let (mut ids, mut t) = (Vec::with_capacity(count), Vec::with_capacity(count));
        let (mut geometries, mut triangles) =
            (Vec::with_capacity(count), Vec::with_capacity(count));
        let mut uvs = Vec::with_capacity(count);
        for (ray, hits) in all {
            for hit in hits {
                let (geometry, triangle) = self.own(hit.triangle);
                ids.push(ray);
                t.push(hit.t);
                geometries.push(geometry);
                triangles.push(triangle);
                uvs.push([hit.u, hit.v]);
            }
        }
        Ok((
            ids.into_pyarray(py),
            t.into_pyarray(py),
            geometries.into_pyarray(py),
            triangles.into_pyarray(py),
            array2(py, uvs)?,
        ))
    }

    /// The closest points to (N, 3) points: point, distance, geometry, triangle, (u, v), normal.
    #[expect(clippy::type_complexity, reason = "it is a list of columns")]
    fn closest_point<'py>(
        &self,
        py: Python<'py>,
        points: PyReadonlyArray2<'py, f32>,
        nthreads: usize,
    ) -> PyResult<(
        Array2<'py, f32>,
        Array1<'py, f32>,
        Array1<'py, u32>,
        Array1<'py, u32>,
        Array2<'py, f32>,
        Array2<'py, f32>,
    )> {
        let points = batch::rows(&points, "points")?;
        let mut found = vec![None; points.len()];
        in_blocks(py, points.len(), nthreads, |block| {
            (
                found[block.clone()].par_iter_mut(),
                points[block].par_iter(),
            )
                .into_par_iter()
                .with_min_len(CHUNK / 4)
                .for_each(|(found, &point)| {
                    *found = self.built.tree.closest_point(point, f32::INFINITY, &mut ());
                });
        })?;
        let count = points.len();
        let mut closest = vec![[f32::NAN; 3]; count];
        let mut distance = vec![f32::INFINITY; count];
        let (mut geometry, mut triangle) = (vec![MISS; count], vec![MISS; count]);
        let (mut uv, mut normal) = (vec![[0.0; 2]; count], vec![[0.0; 3]; count]);
        for (i, near) in found.iter().enumerate() {
            if let Some(near) = near {
                let place = self.place(near.triangle, near.u, near.v);
                closest[i] = near.point;
                distance[i] = near.distance;
                geometry[i] = place.geometry;
                triangle[i] = place.triangle;
                uv[i] = place.uv;
                normal[i] = place.normal;
            }
        }
        Ok((
            array2(py, closest)?,
            distance.into_pyarray(py),
            geometry.into_pyarray(py),
            triangle.into_pyarray(py),
            array2(py, uv)?,
            array2(py, normal)?,
        ))
    }

    /// Whether each of (N, 3) points is inside.
    fn contains<'py>(
        &self,
        py: Python<'py>,
        points: PyReadonlyArray2<'py, f32>,
        nthreads: usize,
    ) -> PyResult<Array1<'py, bool>> {
        let points = batch::rows(&points, "points")?;
        let mut inside = vec![false; points.len()];
        in_blocks(py, points.len(), nthreads, |block| {
            (
                inside[block.clone()].par_iter_mut(),
                points[block].par_iter(),
            )
                .into_par_iter()
                .with_min_len(CHUNK / 4)
                .for_each(|(inside, &point)| {
                    *inside = self.built.tree.contains(point, &mut ());
                });
        })?;
        Ok(inside.into_pyarray(py))
    }
}

impl Tree {
    pub(crate) fn built(&self) -> &Built {
        &self.built
    }
}

/// The error as Python has it: FileNotFoundError, PermissionError and so on, with the file's name.
fn io_error(error: std::io::Error, path: &Path) -> PyErr {
    let text = format!("{}: {error}", path.display());
    std::io::Error::new(error.kind(), text).into()
}

/// Positions and triangles of a mesh.
type Arrays<'py> = (Bound<'py, PyAny>, PyReadonlyArray2<'py, u32>);

/// The meshes as one.
fn mesh_of(meshes: &[Arrays<'_>]) -> PyResult<(Mesh, Parts)> {
    let value_error = |error: MeshError| PyValueError::new_err(error.to_string());
    let meshes: Vec<Mesh> = (meshes.iter())
        .map(|(positions, triangles)| {
            let triangles = batch::rows(triangles, "triangles")?.to_vec();
            let mesh = if let Ok(positions) = positions.extract::<PyReadonlyArray2<'_, f64>>() {
                Mesh::from_f64(batch::rows(&positions, "vertices")?, triangles)
            } else {
                let positions = positions.extract::<PyReadonlyArray2<'_, f32>>()?;
                Mesh::new(batch::rows(&positions, "vertices")?.to_vec(), triangles)
            };
            mesh.map_err(value_error)
        })
        .collect::<PyResult<_>>()?;
    Mesh::join(&meshes).map_err(value_error)
}
