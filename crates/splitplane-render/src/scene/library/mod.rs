//! Scenes by name: those that are built in, and those that are found on the search path.

mod arcade;
mod build;
mod grove;
mod truck;

use std::path::{Path, PathBuf};

use super::{Scene, gltf_file, mesh_file, pbrt};
use crate::error::SceneError;

/// A scene that [`super::load`] knows by name.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SceneEntry {
    /// Its name, as it is listed; names are read in upper or lower case.
    pub name: String,
    /// Its triangles, where that is known without reading it.
    pub triangles: Option<usize>,
    /// Where it was found; `None`: it is built in.
    pub file: Option<PathBuf>,
    /// One line: what it is.
    pub description: String,
}

/// What a name or path stands for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Resolved {
    /// A file.
    File {
        /// Where it is.
        path: PathBuf,
        /// The scene's name.
        name: String,
    },
    /// A scene that is built in.
    BuiltIn {
        /// Its name.
        name: &'static str,
        /// About how many triangles it is to have, where that was asked for.
        size: Option<usize>,
    },
}

/// A scene that is built in.
struct BuiltIn {
    name: &'static str,
    triangles: usize,
    description: &'static str,
    /// The fewest triangles that `name:N` can ask for; `None`: it comes in one size.
    fewest: Option<usize>,
    make: fn(&str, usize) -> Result<Scene, String>,
}

const BUILT_IN: &[BuiltIn] = &[
    BuiltIn {
        name: "truck",
        triangles: truck::TRIANGLES,
        description: "a lorry with its trailer, all parts (CC0)",
        fewest: None,
        make: |name, _| truck::scene(name),
    },
    BuiltIn {
        name: "arcade",
        triangles: 100_000,
        description: "a courtyard of arches turned by 30°, 45° and 60°; arcade:N has about N \
                      triangles",
        fewest: Some(40_000),
        make: arcade::scene,
    },
    BuiltIn {
        name: "grove",
        triangles: 100_000,
        description: "trees of thin slanted triangles; grove:N has about N triangles",
        fewest: Some(40_000),
        make: grove::scene,
    },
];

/// The most triangles that a generated scene can be asked for.
const MOST: usize = 100_000_000;

/// The folders in which scenes are looked for: those given, those of the environment variable
/// `SPLITPLANE_SCENES` (a list like `PATH`), and `../shared/scenes` where that exists.
pub fn search_path(given: &[PathBuf]) -> Vec<PathBuf> {
    let named = std::env::var_os("SPLITPLANE_SCENES").unwrap_or_default();
    let shared = PathBuf::from("../shared/scenes");
    let mut path: Vec<PathBuf> = given.to_vec();
    path.extend(std::env::split_paths(&named).filter(|folder| !folder.as_os_str().is_empty()));
    path.extend(shared.is_dir().then_some(shared));
    path
}

/// All scenes that have a name: first those built in, then those of the folders of `search`, by
/// folder and name. A scene of the same name as one before it is left out.
pub fn list(search: &[PathBuf]) -> Vec<SceneEntry> {
    let mut entries: Vec<SceneEntry> = BUILT_IN
        .iter()
        .map(|scene| SceneEntry {
            name: scene.name.to_owned(),
            triangles: Some(scene.triangles),
            file: None,
            description: scene.description.to_owned(),
        })
        .collect();
    for folder in search {
        for (name, file) in found(folder) {
            if entries
                .iter()
                .all(|entry| !entry.name.eq_ignore_ascii_case(&name))
            {
                let description = first_comment(&file);
                entries.push(SceneEntry {
                    name,
                    triangles: None,
                    file: Some(file),
                    description,
                });
            }
        }
    }
    entries
}

/// The scenes in a folder: its scene files by their names, and those of its folders.
fn found(folder: &Path) -> Vec<(String, PathBuf)> {
    let mut scenes: Vec<(String, PathBuf)> = scene_files(folder)
        .into_iter()
        .map(|file| (stem(&file), file))
        .collect();
    for inner in children(folder).into_iter().filter(|path| path.is_dir()) {
        let files = scene_files(&inner);
        let alone = files.len() == 1;
        for file in files {
            let own = stem(&file);
            let of_folder = alone || own.eq_ignore_ascii_case("scene");
            let name = if of_folder { file_name(&inner) } else { own };
            scenes.push((name, file));
        }
    }
    scenes.sort();
    scenes
}

fn children(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).into_iter().flatten();
    let mut paths: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).collect();
    paths.sort();
    paths
}

/// The pbrt files in a folder that are scenes: others are parts, to be included.
fn scene_files(folder: &Path) -> Vec<PathBuf> {
    let is_scene = |path: &PathBuf| {
        path.extension()
            .is_some_and(|ending| ending.eq_ignore_ascii_case("pbrt"))
            && std::fs::read(path).is_ok_and(|text| {
                text.split(|b| b.is_ascii_whitespace())
                    .any(|word| word == b"WorldBegin")
            })
    };
    children(folder).into_iter().filter(is_scene).collect()
}

fn stem(path: &Path) -> String {
    path.file_stem()
        .unwrap_or_default()
        .to_string_lossy()
        .into_owned()
}

fn file_name(path: &Path) -> String {
    path.file_name()
        .unwrap_or_default()
        .to_string_lossy()
        .into_owned()
}

/// The comment on the first line of a scene file, where there is one.
fn first_comment(file: &Path) -> String {
    let text = std::fs::read(file).unwrap_or_default();
    let line = text.split(|&b| b == b'\n').next().unwrap_or_default();
    match String::from_utf8_lossy(line).trim().strip_prefix('#') {
        Some(comment) => comment.trim().to_owned(),
        None => String::new(),
    }
}

/// What a name or path stands for: the file of that path where there is one, else the scene of
/// that name, in upper or lower case.
///
/// # Errors
/// There is neither; the message lists what there is. Or a size that a scene does not take.
pub fn resolve(name_or_path: &str, search: &[PathBuf]) -> Result<Resolved, SceneError> {
    let path = Path::new(name_or_path);
    if path.is_file() {
        let name = scene_name(path);
        return Ok(Resolved::File {
            path: path.to_owned(),
            name,
        });
    }
    let (name, size) = match name_or_path.split_once(':') {
        Some((name, size)) => (name, Some(size)),
        None => (name_or_path, None),
    };
    if let Some(scene) = BUILT_IN
        .iter()
        .find(|scene| scene.name.eq_ignore_ascii_case(name))
    {
        let size = match (size, scene.fewest) {
            (None, _) => None,
            (Some(_), None) => {
                return Err(SceneError::file(
                    name_or_path,
                    format!(
                        "\"{}\" is of one size; it takes no number of triangles",
                        scene.name
                    ),
                ));
            }
            (Some(size), Some(fewest)) => match size.replace('_', "").parse() {
                Ok(size) if (fewest..=MOST).contains(&size) => Some(size),
                _ => {
                    return Err(SceneError::file(
                        name_or_path,
                        format!(
                            "\"{}\" takes a number of triangles from {fewest} to {MOST}, as in \
                             {}:{}",
                            scene.name, scene.name, scene.triangles
                        ),
                    ));
                }
            },
        };
        return Ok(Resolved::BuiltIn {
            name: scene.name,
            size,
        });
    }
    let entries = list(search);
    let entry = entries
        .iter()
        .find(|entry| entry.name.eq_ignore_ascii_case(name_or_path));
    if let Some(SceneEntry {
        name,
        file: Some(path),
        ..
    }) = entry
    {
        return Ok(Resolved::File {
            path: path.clone(),
            name: name.clone(),
        });
    }
    let names: Vec<_> = entries.iter().map(|entry| entry.name.as_str()).collect();
    let there = match path.is_dir() {
        true => "a folder, and no scene of this name: give a file in it",
        false => "there is no such file, and no scene of this name",
    };
    Err(SceneError::file(
        name_or_path,
        format!("{there}; scenes are {}; {}", names.join(", "), endings()),
    ))
}

/// What files can end in, as messages say it.
pub(crate) fn endings() -> String {
    let all = [pbrt::ENDINGS, gltf_file::ENDINGS, mesh_file::ENDINGS].concat();
    format!("files can end in {}", all.join(", "))
}

/// The name of the scene in a file: the file's, or its folder's where the file is `scene.pbrt`.
fn scene_name(path: &Path) -> String {
    let own = stem(path);
    match path.parent().map(file_name) {
        Some(folder) if own.eq_ignore_ascii_case("scene") && !folder.is_empty() => folder,
        // x.ply.gz, x.pbrt.gz
        _ => [".ply", ".pbrt"]
            .iter()
            .find_map(|ending| own.strip_suffix(ending))
            .unwrap_or(&own)
            .to_owned(),
    }
}

/// Makes a scene that is built in, of about `size` triangles where it comes in sizes.
pub(crate) fn build(name: &str, size: Option<usize>) -> Result<Scene, SceneError> {
    let Some(scene) = BUILT_IN.iter().find(|scene| scene.name == name) else {
        return Err(SceneError::file(name, "no such scene is built in"));
    };
    let full_name = match size {
        Some(size) => format!("{name}:{size}"),
        None => name.to_owned(),
    };
    (scene.make)(&full_name, size.unwrap_or(scene.triangles))
        .map_err(|message| SceneError::file(full_name, message))
}
