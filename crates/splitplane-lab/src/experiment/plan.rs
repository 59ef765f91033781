//! A plan: the scenes and cells of an experiment, each with what identifies it.

use std::collections::BTreeMap;
use std::io::Write;
use std::path::PathBuf;

use serde::{Deserialize, Serialize};
use splitplane::Mesh;
use splitplane_render::scene::{Instancing, LoadOptions, Scene, load};
use toml::Table;

use super::cell::{Cell, Conditions, Program, digest};
use super::file::{Experiment, ExperimentError, SceneEntry, conditions};
use super::folder::Folder;
use crate::{LabError, write_whole};

/// What an experiment will do, cell by cell.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Plan {
    /// What the experiment is called.
    pub title: String,
    /// What it shows.
    pub description: String,
    /// The program that made the plan, and that its cells are to be run with.
    pub program: Program,
    /// The scenes.
    pub scenes: Vec<PlannedScene>,
    /// The trees in their order, with their numbers of directions; the first is the measure.
    pub trees: Vec<String>,
    /// The cells, in the order in which they are run: repetition by repetition, and in each scene
    /// tree by tree.
    pub cells: Vec<Cell>,
    /// What was left out, and why.
    pub notes: Vec<String>,
    /// The text of the experiment's file.
    pub source: String,
    /// The experiment's file.
    pub file: PathBuf,
    /// Folders in which scenes were looked for besides the usual ones; absolute.
    pub search: Vec<PathBuf>,
    /// Whether `--quick` put other things in place of the file's.
    pub quick: bool,
}

/// A scene of a plan.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PlannedScene {
    /// Its name in tables.
    pub label: String,
    /// Its name on the scene search path, or its file; absolute, since cells are run anywhere.
    pub name: String,
    /// Subdivision level of its surfaces, where the experiment says one.
    pub subdivide: Option<u32>,
    /// Copies of objects become a part of the mesh.
    pub flatten: bool,
    /// Values of `$name` in its file.
    pub define: BTreeMap<String, String>,
    /// What is known of it.
    pub facts: SceneFacts,
}

/// What is known of a scene without rendering it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SceneFacts {
    /// The scene's short name, as records have it.
    pub name: String,
    /// Its triangles.
    pub triangles: u64,
    /// Triangles among them that no ray can hit.
    pub triangles_skipped: u64,
    /// The share of the triangles that can be hit whose normal is along an axis (to 10⁻⁶).
    pub axis_aligned: f64,
    /// Materials.
    pub materials: u64,
    /// Lights; a mesh that gives off light is one.
    pub lights: u64,
    /// The picture's size as the scene says, in pixels.
    pub size: (u32, u32),
    /// The samples per pixel as the scene says.
    pub spp: u32,
    /// SHA-256 of the vertices, triangles, shading normals, camera, film, sampler, filter and
    /// integrator.
    pub digest: String,
    /// What a reader of the scene's figures should know, from its file.
    pub warnings: Vec<String>,
}

impl SceneFacts {
    /// What is known of `scene`.
    pub fn of(scene: &Scene) -> SceneFacts {
        // Triangles of objects count once.
        let along_an_axis = |mesh: &Mesh, triangle: u32| {
            let normal = mesh.normal(triangle);
            normal.iter().any(|c| c.abs() > 1.0 - 1e-6)
        };
        let usable: usize = scene
            .meshes()
            .map(|mesh| mesh.usable_triangles().len())
            .sum();
        let aligned = |mesh: &Mesh| {
            let usable = mesh.usable_triangles().iter();
            usable
                .filter(|&&triangle| along_an_axis(mesh, triangle))
                .count()
        };
        let aligned: usize = scene.meshes().map(aligned).sum();
        let settings = format!(
            "{:?} {:?} {:?} {:?} {:?}",
            scene.camera, scene.film, scene.sampler, scene.filter, scene.integrator
        );
        let instances = match scene.instances.as_slice() {
            [] => String::new(),
            instances => format!("{instances:?}"),
        };
        let emitters = (scene.shapes.iter())
            .filter(|shape| shape.area_light.is_some())
            .count();
        SceneFacts {
            name: scene.name.clone(),
            triangles: scene.triangles(),
            triangles_skipped: scene
                .meshes()
                .map(|mesh| mesh.skipped().total() as u64)
                .sum(),
            axis_aligned: aligned as f64 / usable.max(1) as f64,
            materials: scene.materials.len() as u64,
            lights: (scene.lights.len() + emitters) as u64,
            size: (scene.film.width, scene.film.height),
            spp: scene.sampler.samples_per_pixel,
            digest: digest(
                (scene.meshes())
                    .flat_map(|mesh| {
                        [
                            bytemuck::cast_slice(mesh.positions()),
                            bytemuck::cast_slice(mesh.triangles()),
                        ]
                    })
                    .chain([bytemuck::cast_slice(&scene.normals), settings.as_bytes()])
                    .chain((scene.objects.iter()).map(|o| bytemuck::cast_slice(&o.normals)))
                    .chain([instances.as_bytes()]),
            ),
            warnings: (scene.notes.iter().filter(|note| note.warning))
                .map(|note| note.text.clone())
                .collect(),
        }
    }
}

impl PlannedScene {
    /// Reads the scene.
    ///
    /// # Errors
    /// It cannot be read, or is not the one that was planned.
    pub fn load(&self, search: &[PathBuf]) -> Result<Scene, LabError> {
        let scene = load_with(
            &self.name,
            self.subdivide,
            self.flatten,
            &self.define,
            search,
        )?;
        if SceneFacts::of(&scene).digest == self.facts.digest {
            Ok(scene)
        } else {
            Err(LabError::OtherScene {
                scene: self.label.clone(),
            })
        }
    }
}

fn load_with(
    name: &str,
    subdivide: Option<u32>,
    flatten: bool,
    define: &BTreeMap<String, String>,
    search: &[PathBuf],
) -> Result<Scene, LabError> {
    let options = LoadOptions {
        defines: define.clone(),
        search: search.to_vec(),
        subdivision_levels: subdivide,
        instances: match flatten {
            true => Instancing::Flattened,
            false => Instancing::Kept,
        },
    };
    Ok(load(name, &options)?)
}

impl Plan {
    /// Plans an experiment. Reads each scene, so that what is wrong with one is found now;
    /// `reading` is told which.
    ///
    /// # Errors
    /// A scene cannot be read, two have the same label, or the conditions do not suit one.
    pub fn new(
        experiment: &Experiment,
        file: PathBuf,
        source: String,
        quick: bool,
        search: &[PathBuf],
        reading: &dyn Fn(&str),
    ) -> Result<Plan, LabError> {
        let program = Program::this();
        let mut notes = experiment.notes.clone();
        let mut scenes: Vec<(PlannedScene, &SceneEntry)> = Vec::new();
        let wrong = |entry: &SceneEntry, message: String| {
            let (line, column) = entry.place;
            LabError::Experiment(Box::new(ExperimentError {
                file: file.clone(),
                line,
                column,
                message,
            }))
        };
        for entry in &experiment.scenes {
            reading(&entry.name);
            let loaded = load_with(
                &entry.name,
                entry.subdivide,
                entry.flatten,
                &entry.define,
                search,
            );
            let scene = match loaded {
                Ok(scene) => scene,
                // An error in a scene that is there is one all the same.
                Err(LabError::Scene(error)) if entry.if_found && error.line == 0 => {
                    notes.push(format!("{} is not here and was left out", entry.name));
                    continue;
                }
                Err(LabError::Scene(error)) if error.line == 0 => {
                    return Err(wrong(entry, error.to_string()));
                }
                Err(error) => return Err(error),
            };
            let facts = SceneFacts::of(&scene);
            let label = entry.label.clone().unwrap_or_else(|| facts.name.clone());
            if scenes.iter().any(|(scene, _)| scene.label == label) {
                let message =
                    format!("two scenes are called \"{label}\"; give this one another label");
                return Err(wrong(entry, message));
            }
            let file = std::path::absolute(&entry.name)
                .ok()
                .filter(|file| file.is_file());
            let planned = PlannedScene {
                label,
                name: file.map_or(entry.name.clone(), |file| {
                    file.to_string_lossy().into_owned()
                }),
                subdivide: entry.subdivide,
                flatten: entry.flatten,
                define: entry.define.clone(),
                facts,
            };
            scenes.push((planned, entry));
        }
        let mut cells: Vec<Cell> = Vec::new();
        for repetition in 0..experiment.repetitions {
            for (scene, entry) in &scenes {
                for conditions in scene_conditions(scene, entry, &experiment.conditions)? {
                    for tree in &experiment.trees {
                        let cell = Cell {
                            id: String::new(),
                            scene: scene.label.clone(),
                            tree: tree.spec.name.to_owned(),
                            k: tree.direction_count,
                            repetition,
                            timed: experiment.timed,
                            picture: experiment.pictures && repetition == 0,
                            conditions: conditions.clone(),
                            limit_s: experiment.time_limit_s,
                        };
                        cells.push(cell.identified(&program, &scene.facts.digest));
                    }
                }
            }
        }
        Ok(Plan {
            title: experiment.title.clone(),
            description: experiment.description.clone(),
            program,
            scenes: scenes.into_iter().map(|(scene, _)| scene).collect(),
            trees: experiment.trees.iter().map(|t| t.to_string()).collect(),
            cells,
            notes,
            source,
            file,
            search: search
                .iter()
                .filter_map(|folder| std::path::absolute(folder).ok())
                .collect(),
            quick,
        })
    }

    /// The scene of that label.
    ///
    /// # Errors
    /// The plan has none.
    pub fn scene(&self, label: &str) -> Result<&PlannedScene, LabError> {
        let found = self.scenes.iter().find(|scene| scene.label == label);
        found.ok_or_else(|| LabError::NotPlanned {
            what: format!("scene {label}"),
            planned: format!("scenes are {}", self.labels().join(", ")),
        })
    }

    /// The cell of that id; or, where `named` is a shorter number, the cell at that place, from 0.
    ///
    /// # Errors
    /// The plan has none.
    pub fn cell(&self, named: &str) -> Result<&Cell, LabError> {
        let by_id = self.cells.iter().find(|cell| cell.id == named);
        let by_place = || self.cells.get(named.parse::<usize>().ok()?);
        by_id.or_else(by_place).ok_or_else(|| LabError::NotPlanned {
            what: format!("cell {named}"),
            planned: format!(
                "cells are 0 to {}, or the ids of plan.json",
                self.cells.len().saturating_sub(1)
            ),
        })
    }

    fn labels(&self) -> Vec<&str> {
        self.scenes
            .iter()
            .map(|scene| scene.label.as_str())
            .collect()
    }

    /// Writes the plan into the folder.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn write(&self, folder: &Folder) -> Result<(), LabError> {
        let path = folder.plan();
        let json = serde_json::to_string_pretty(self).map_err(LabError::json)?;
        write_whole(&path, |file| file.write_all(json.as_bytes()))
            .map_err(|source| LabError::Write { path, source })
    }
}

/// The conditions of a scene: the grid's, with the scene's own in their place; each once.
fn scene_conditions(
    scene: &PlannedScene,
    entry: &SceneEntry,
    grid: &[Table],
) -> Result<Vec<Conditions>, LabError> {
    let mut all: Vec<Conditions> = Vec::new();
    for table in grid {
        let mut table = table.clone();
        table.extend(entry.conditions.clone());
        let suits = conditions(&table).and_then(|conditions| {
            conditions.settings(scene.facts.size)?;
            Ok(conditions)
        });
        let conditions = suits.map_err(|message| LabError::Conditions {
            scene: scene.label.clone(),
            message,
        })?;
        if !all.contains(&conditions) {
            all.push(conditions);
        }
    }
    Ok(all)
}
