//! A mesh file as a scene: PLY, OBJ or STL, with a camera and light that suit it.

use std::collections::{BTreeMap, HashMap};
use std::io::Cursor;
use std::path::Path;

use glam::DVec3;

use super::geometry::{Geometry, Placed};
use super::image_file::Images;
use super::material::Material;
use super::mtl_file::{self, Mtl};
use super::obj_file::{Named, numbers, obj};
use super::pbrt::{shortened, shortened_to};
use super::polygon::Faces;
use super::texture::{Texture, TextureRef};
use super::view::{self, Up};
use super::{Contents, Note, Scene, ply};
use crate::error::{SceneError, place};

/// The endings of the files that can be read, in lower case.
pub(crate) const ENDINGS: &[&str] = &[".ply", ".ply.gz", ".obj", ".stl"];

/// What a mesh file gave.
#[derive(Default)]
struct Found {
    pieces: Vec<Placed>,
    materials: Vec<Material>,
    colors: Vec<[f32; 3]>,
    contents: Contents,
    images: Images,
    notes: Vec<Note>,
    faces: Faces,
}

impl Found {
    fn plain(geometry: Geometry, faces: Faces, format: &str) -> Self {
        Found {
            pieces: vec![Placed::plain(geometry, 0)],
            materials: vec![view::matte([0.6; 3])],
            contents: Contents {
                format: format.to_owned(),
                ..Contents::default()
            },
            faces,
            ..Found::default()
        }
    }
}

/// Reads the mesh at `path` as a scene.
pub(crate) fn load(path: &Path, name: &str) -> Result<Scene, SceneError> {
    let file = path.display().to_string();
    let lower = file.to_ascii_lowercase();
    let whole = || {
        std::fs::read(path)
            .map_err(|error| SceneError::file(&file, format!("cannot be read: {error}")))
    };
    let (mut found, usual_up) = if lower.ends_with(".obj") {
        (obj_scene(&file, path, &whole()?)?, Up::Y)
    } else if lower.ends_with(".stl") {
        (
            Found::plain(stl(&file, whole()?)?, Faces::default(), "STL"),
            Up::Z,
        )
    } else {
        let mesh = ply::read(path)?;
        let mut found = Found::plain(mesh.geometry, mesh.faces, "PLY");
        if !mesh.colors.is_empty() {
            found.materials = vec![Material::Matte {
                kd: TextureRef::new(Texture::VertexColor),
                sigma: view::color([0.0; 3]),
            }];
            found.colors = mesh.colors;
        }
        (found, Up::Y)
    };
    if found.pieces.iter().all(|p| p.geometry.triangles.is_empty()) {
        return Err(SceneError::file(
            &file,
            "has no triangles; a mesh to look at has some",
        ));
    }
    let mut notes = found.notes;
    notes.extend(found.faces.notes(&file));
    for (path, reason) in found.images.read() {
        notes.push(Note {
            place: path.display().to_string(),
            text: format!("the image cannot be read ({reason}); rendered white"),
            warning: true,
        });
    }
    let shines = found.pieces.iter().any(|piece| piece.area_light.is_some());
    notes.push(Note {
        place: file.clone(),
        text: if shines {
            "a mesh has no camera; it was chosen to suit it".to_owned()
        } else if lower.ends_with(".obj") {
            "a mesh has no camera or light; they were chosen to suit it".to_owned()
        } else {
            "a mesh has no camera, light or material; they were chosen to suit it".to_owned()
        },
        warning: false,
    });
    let fit = |mesh: &splitplane::Mesh| {
        let bounds = mesh.bounds();
        let up = Up::guessed(usual_up, &bounds);
        // Three quarters from the front, which lies towards +z where y is up, towards -y else.
        let (towards_eye, towards_sun) = match up {
            Up::Y => (DVec3::new(0.62, 0.42, 0.8), DVec3::new(-0.3, 0.9, 0.6)),
            Up::Z => (DVec3::new(0.62, -0.8, 0.42), DVec3::new(-0.3, -0.6, 0.9)),
        };
        let lights = if shines {
            vec![]
        } else {
            view::daylight(towards_sun)
        };
        (
            view::fitted(&bounds, mesh.positions(), towards_eye, up),
            lights,
        )
    };
    let mut scene = view::scene(name, found.pieces, found.materials, fit, notes)
        .map_err(|message| SceneError::file(&file, message))?;
    found.contents.unique_triangles = scene.contents.unique_triangles;
    found.contents.images = found.images.paths().map(Path::to_owned).collect();
    scene.contents = found.contents;
    scene.colors = found.colors;
    Ok(scene)
}

/// Reads an OBJ file with the materials of its library files.
fn obj_scene(file: &str, path: &Path, bytes: &[u8]) -> Result<Found, SceneError> {
    let mesh = obj(file, bytes)?;
    let folder = path.parent().unwrap_or(Path::new(""));
    let mut found = Found {
        contents: Contents {
            format: "OBJ".to_owned(),
            ..Contents::default()
        },
        faces: mesh.faces,
        ..Found::default()
    };
    let mut warn = |place: String, text: String| {
        found.notes.push(Note {
            place,
            text,
            warning: true,
        });
    };
    if mesh.others > 0 {
        let text = "points, lines, curves and surfaces are not supported; left out";
        warn(file.to_owned(), format!("{text}: {}", mesh.others));
    }
    if mesh.uneven > 0 {
        let text = "faces that have normals or texture coordinates at some of their vertices alone \
                    are rendered without";
        warn(file.to_owned(), format!("{text}: {}", mesh.uneven));
    }
    if mesh.colored {
        let text = "colours of vertices are not supported in OBJ; rendered without";
        warn(file.to_owned(), text.to_owned());
    }
    let mut libraries: Vec<String> = Vec::new();
    for name in mesh.libraries.iter().flat_map(|line| files(folder, line)) {
        if !libraries.contains(&name) {
            libraries.push(name);
        }
    }
    // Each material with its library.
    let mut known: HashMap<String, (&str, Mtl)> = HashMap::new();
    let mut all_read = true;
    for library in &libraries {
        let path = folder.join(library);
        let materials = mtl_file::read(&path);
        found.contents.files.insert(path);
        match materials {
            Ok(materials) => {
                let with_library = |(name, mtl)| (name, (library.as_str(), mtl));
                known.extend(materials.into_iter().map(with_library));
            }
            Err(error) => {
                all_read = false;
                let name = shortened_to(library, 200);
                warn(
                    file.to_owned(),
                    format!("the materials of \"{name}\" cannot be read ({error}); rendered grey"),
                );
            }
        }
    }
    let mut unknown = Vec::new();
    // By library and what it says: the materials, and the first line.
    let mut unsupported: BTreeMap<(&str, &str), (Vec<&str>, u32)> = BTreeMap::new();
    let mut emitted = Vec::new();
    let mut alphas = Vec::new();
    for Named { name, line } in &mesh.materials {
        let (material, light, alpha) = match known.get(name) {
            Some((library, mtl)) => {
                found.contents.count("material", "MTL");
                for (line, key) in mtl.unsupported() {
                    let new = || (Vec::new(), *line);
                    let entry = unsupported.entry((library, key)).or_insert_with(new);
                    if entry.0.last() != Some(&name.as_str()) {
                        entry.0.push(name);
                    }
                    entry.1 = entry.1.min(*line);
                }
                mtl.made(folder, &mut found.images)
            }
            None => {
                unknown.push((name.as_str(), *line));
                (view::matte([0.6; 3]), None, None)
            }
        };
        found.materials.push(material);
        emitted.push(light);
        alphas.push(alpha);
    }
    // Where a library cannot be read, that is all there is to say.
    if let (Some((_, line)), true) = (unknown.first(), all_read) {
        let names: Vec<&str> = unknown.iter().map(|(name, _)| *name).collect();
        let text = format!("no library (mtllib) has {}; rendered grey", listed(&names));
        warn(place(file, *line, 0), text);
    }
    for ((library, key), (names, line)) in &unsupported {
        let library = folder.join(library).display().to_string();
        let text = format!(
            "\"{key}\" of {} is not supported; rendered without",
            listed(names)
        );
        warn(place(&library, *line, 0), text);
    }
    // Faces before the first `usemtl`.
    let default = found.materials.len() as u32;
    if mesh.parts.iter().any(|part| part.material.is_none()) {
        found.materials.push(view::matte([0.6; 3]));
    }
    for part in mesh.parts {
        let material = part.material.unwrap_or(default);
        let mut piece = Placed::plain(part.geometry, material);
        piece.area_light = emitted.get(material as usize).cloned().flatten();
        piece.alpha = alphas.get(material as usize).cloned().flatten();
        found.pieces.push(piece);
    }
    Ok(found)
}

fn listed(materials: &[&str]) -> String {
    let first = shortened(materials.first().unwrap_or(&""));
    match materials.len() {
        0 | 1 => format!("the material \"{first}\""),
        count => format!("the material \"{first}\" and {} more", count - 1),
    }
}

/// The files that a line names: what it says as a whole, where that is a file or where none of its
/// words is; else its words.
fn files(folder: &Path, line: &str) -> Vec<String> {
    let is_file = |name: &str| folder.join(name).is_file();
    let line = line.replace('\\', "/");
    let words: Vec<String> = line.split_whitespace().map(str::to_owned).collect();
    if is_file(&line) || !words.iter().any(|word| is_file(word)) {
        return vec![line];
    }
    words
}

/// Reads the content of an STL file, ASCII or binary, which messages call `name`.
fn stl(name: &str, mut bytes: Vec<u8>) -> Result<Geometry, SceneError> {
    // Some binary files start as ASCII ones do: those have exactly the size that they announce.
    if let (Some(count), Some(b's')) = (bytes.get(80..84), bytes.first()) {
        let count = u32::from_le_bytes([count[0], count[1], count[2], count[3]]) as usize;
        if bytes.len() == 84 + 50 * count {
            bytes[0] = b' ';
        }
    }
    let mesh = stl_io::read_stl(&mut Cursor::new(&bytes)).map_err(|error| {
        let (line, reason) = wrong_in_stl(&bytes).unwrap_or_else(|| (0, error.to_string()));
        SceneError {
            line,
            ..SceneError::file(name, format!("not an STL file that can be read: {reason}"))
        }
    })?;
    Ok(Geometry {
        positions: mesh.vertices.iter().map(|v| v.0).collect(),
        triangles: mesh
            .faces
            .iter()
            .map(|face| face.vertices.map(|v| v as u32))
            .collect(),
        ..Geometry::default()
    })
}

/// What is wrong with an STL file that cannot be read, and in which line (0: the file as a whole),
/// where it is one of the usual things: the crate that reads it does not say.
fn wrong_in_stl(bytes: &[u8]) -> Option<(u32, String)> {
    const HEAD: usize = 84;
    const TRIANGLE: usize = 50;
    if bytes.starts_with(b"solid ") {
        return bytes
            .split(|&b| b == b'\n')
            .zip(1..)
            .find_map(|(line, at)| {
                let line = String::from_utf8_lossy(line);
                let mut words = line.split_whitespace();
                let given = match words.next()? {
                    "vertex" => words,
                    "facet" => {
                        words.next();
                        words
                    }
                    _ => return None,
                };
                match numbers::<3>(given) {
                    Ok(_) => None,
                    Err(Some(word)) => Some((at, format!("\"{word}\" is no number"))),
                    Err(None) => Some((at, "three numbers are missing".to_owned())),
                }
            });
    }
    let Some(count) = bytes.get(HEAD - 4..HEAD) else {
        let length = bytes.len();
        return Some((
            0,
            format!("it has {length} bytes, and its head alone is 84"),
        ));
    };
    let count = u32::from_le_bytes([count[0], count[1], count[2], count[3]]) as usize;
    let there = (bytes.len() - HEAD) / TRIANGLE;
    (there < count).then(|| {
        let reason = format!("it is cut short: {there} triangles of the {count} that it announces");
        (0, reason)
    })
}
