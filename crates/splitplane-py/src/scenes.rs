//! Scenes from files and by name, pictures of them, and comparisons.

use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};

use numpy::{PyArray1, PyArray2, PyArray3, PyArrayMethods};
use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use splitplane::{Mesh, TREES, TreeChoice};
use splitplane_lab::{Preset, Settings, Watch};
use splitplane_render::render::{PixelCounts, Progress, RenderSettings};
use splitplane_render::scene::LoadOptions;

use crate::batch::{array2, interruptible};
use crate::tree::Tree;

/// A scene, as it was read.
#[pyclass(frozen, module = "splitplane._native")]
pub(crate) struct Scene {
    scene: splitplane_render::scene::Scene,
}

/// Stops a build or a rendering once the flag is set.
pub(crate) struct Stop<'a>(pub(crate) &'a AtomicBool);

impl Progress for Stop<'_> {}

impl splitplane::Progress for Stop<'_> {
    fn cancelled(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}

impl Watch for Stop<'_> {}

/// Reads a scene: a file, or one by its name.
#[pyfunction]
pub(crate) fn load_scene(py: Python<'_>, name: &str, search: Vec<PathBuf>) -> PyResult<Scene> {
    // One that is not there would be passed over, and a scene not found.
    if let Some(missing) = search.iter().find(|folder| !folder.is_dir()) {
        let message = format!("search: there is no folder {}", missing.display());
        return Err(PyValueError::new_err(message));
    }
    let options = LoadOptions {
        search,
        ..LoadOptions::default()
    };
    let scene = interruptible(py, |_| splitplane_render::scene::load(name, &options))?
        .map_err(|error| PyValueError::new_err(error.to_string()))?;
    Ok(Scene { scene })
}

/// The trees that can be built: name, thesis's name, whether it takes a number of directions, and
/// what it is.
#[pyfunction]
pub(crate) fn trees() -> Vec<(&'static str, &'static str, bool, &'static str)> {
    (TREES.iter())
        .map(|spec| {
            let numbered = spec.takes_direction_count();
            (spec.name, spec.thesis_name, numbered, spec.summary)
        })
        .collect()
}

/// How to render: threads, seed, samples per pixel, resolution, crop, depth.
type Picture = (
    usize,
    u64,
    Option<u32>,
    Option<(u32, u32)>,
    Option<[f32; 4]>,
    Option<u32>,
);

fn settings(picture: Picture, count: bool) -> RenderSettings {
    let (threads, seed, samples_per_pixel, resolution, crop, max_depth) = picture;
    RenderSettings {
        threads,
        seed,
        samples_per_pixel,
        resolution,
        crop,
        max_depth,
        count,
        time: None,
    }
}

#[pymethods]
impl Scene {
    /// Its short name.
    #[getter]
    fn name(&self) -> &str {
        &self.scene.name
    }

    /// Its vertices, (N, 3).
    #[getter]
    fn vertices<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f32>>> {
        array2(py, self.scene.mesh.positions().to_vec())
    }

    /// Its triangles, (M, 3).
    #[getter]
    fn triangles<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<u32>>> {
        array2(py, self.scene.mesh.triangles().to_vec())
    }

    /// What was approximated or left out: place, text, and whether it changes the picture.
    #[getter]
    fn notes(&self) -> Vec<(&str, &str, bool)> {
        let note = |note: &'_ splitplane_render::scene::Note| note.warning;
        (self.scene.notes.iter())
            .map(|n| (n.place.as_str(), n.text.as_str(), note(n)))
            .collect()
    }

    /// A tree over the scene's mesh.
    fn build(&self, py: Python<'_>, tree: &str, layout: &str, nthreads: usize) -> PyResult<Tree> {
        let mesh = Mesh::join([&self.scene.mesh])
            .map_err(|error| PyValueError::new_err(error.to_string()))?;
        Tree::over(py, mesh, (tree, layout), nthreads)
    }

    /// A picture, (height, width, 3), and other pictures by name.
    fn render<'py>(
        &self,
        py: Python<'py>,
        tree: &Tree,
        picture: Picture,
        stats: bool,
    ) -> PyResult<(Bound<'py, PyArray3<f32>>, Bound<'py, PyDict>)> {
        let settings = settings(picture, stats);
        let built = &*tree.built().tree;
        let rendered = interruptible(py, |stop| {
            splitplane_render::render::render(&self.scene, built, &settings, &Stop(stop))
        })?
        .map_err(|error| PyValueError::new_err(error.to_string()))?;
        let (height, width) = (rendered.height as usize, rendered.width as usize);
        let others = PyDict::new(py);
        others.set_item("seconds", rendered.seconds)?;
        others.set_item("samples_per_pixel", rendered.samples_per_pixel)?;
        let depth = PyArray1::from_vec(py, rendered.depth).reshape([height, width])?;
        others.set_item("depth", depth)?;
        let normal = PyArray1::from_vec(py, rendered.normal.into_flattened());
        others.set_item("normal", normal.reshape([height, width, 3])?)?;
        for (kind, rays) in [
            ("camera_rays", rendered.rays.camera),
            ("bounce_rays", rendered.rays.bounce),
            ("shadow_rays", rendered.rays.shadow),
        ] {
            others.set_item(kind, rays)?;
        }
        if let Some(pixels) = rendered.pixel_counts {
            for (name, of) in PixelCounts::NAMED {
                let both = pixels.closest.iter().zip(&pixels.shadow);
                let counts = both.map(|(a, b)| of(a).saturating_add(of(b))).collect();
                let plane = PyArray1::from_vec(py, counts).reshape([height, width])?;
                others.set_item(name, plane)?;
            }
        }
        let radiance = PyArray1::from_vec(py, rendered.radiance.into_flattened());
        Ok((radiance.reshape([height, width, 3])?, others))
    }
}

/// The records of trees on the same scene, as JSON.
#[pyfunction]
pub(crate) fn compare(
    py: Python<'_>,
    scene: &Scene,
    trees: Vec<String>,
    preset: &str,
    repeat: u32,
    picture: Picture,
) -> PyResult<String> {
    let value_error = |error: &dyn std::fmt::Display| PyValueError::new_err(error.to_string());
    let preset: Preset = preset.parse().map_err(|error| value_error(&error))?;
    let trees = (trees.iter().map(|name| name.parse()))
        .collect::<Result<Vec<TreeChoice>, _>>()
        .map_err(|error| value_error(&error))?;
    let settings = Settings {
        render: settings(picture, false),
        ..Settings::of_preset(preset)
    };
    let found = interruptible(py, |stop| {
        splitplane_lab::compare(&scene.scene, &trees, &settings, repeat, &Stop(stop))
    })?
    .map_err(|error| value_error(&error))?;
    if let Some(difference) = found.differences.first() {
        // It is our own bug: every tree gives the same picture.
        return Err(PyRuntimeError::new_err(format!(
            "the trees' results differ: {difference:?}"
        )));
    }
    serde_json::to_string(&found.records).map_err(|error| value_error(&error))
}
