//! A mesh file as a scene: PLY, OBJ or STL, with a camera and light that suit it.

use std::collections::HashMap;
use std::io::Cursor;
use std::path::Path;

use glam::DVec3;

use super::geometry::{Geometry, Placed, runs};
use super::image_file::{Channels, Decoding, Images};
use super::light::AreaLight;
use super::material::Material;
use super::polygon::Faces;
use super::texture::{ImageFilter, Mapping, Texture, TextureRef, Wrap};
use super::view::{self, Up};
use super::{Contents, Note, Scene, ply};
use crate::error::SceneError;

/// The endings of the files that can be read, in lower case.
pub(crate) const ENDINGS: &[&str] = &[".ply", ".ply.gz", ".obj", ".stl"];

/// Whether the file's name is that of a mesh.
pub(crate) fn is_mesh(path: &Path) -> bool {
    let name = path.to_string_lossy().to_ascii_lowercase();
    ENDINGS.iter().any(|ending| name.ends_with(ending))
}

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
    let warn = |found: &mut Found, text: String| {
        if found.notes.iter().all(|note| note.text != text) {
            found.notes.push(Note {
                place: file.to_owned(),
                text,
                warning: true,
            });
        }
    };
    let mut library: HashMap<String, tobj::Material> = HashMap::new();
    for line in bytes.split(|&b| b == b'\n') {
        let Some(name) = line.trim_ascii().strip_prefix(b"mtllib ") else {
            continue;
        };
        let name = String::from_utf8_lossy(name.trim_ascii()).replace('\\', "/");
        match materials_of(&folder.join(&name)) {
            Ok(materials) => {
                library.extend(materials.into_iter().map(|m| (m.name.clone(), m)));
            }
            Err(error) => warn(
                &mut found,
                format!("the materials of \"{name}\" cannot be read ({error}); rendered grey"),
            ),
        }
    }
    let mut emitted = Vec::new();
    let mut alphas = Vec::new();
    for name in &mesh.material_names {
        let (material, light, alpha) = match library.get(name) {
            Some(material) => {
                found.contents.count("material", "MTL");
                mtl(material, folder, &mut found)
            }
            None => (view::matte([0.6; 3]), None, None),
        };
        found.materials.push(material);
        emitted.push(light);
        alphas.push(alpha);
    }
    if found.materials.is_empty() {
        found.materials.push(view::matte([0.6; 3]));
    }
    for (material, own) in runs(&mesh.geometry, &mesh.materials) {
        let number = material as usize;
        let mut piece = Placed::plain(own, material.min(found.materials.len() as u32 - 1));
        piece.area_light = emitted.get(number).cloned().flatten();
        piece.alpha = alphas.get(number).cloned().flatten();
        found.pieces.push(piece);
    }
    Ok(found)
}

/// The materials of an OBJ's library file. A colour may be given by its red alone, which is then its
/// green and blue too; the crate that reads the rest would panic.
fn materials_of(path: &Path) -> Result<Vec<tobj::Material>, String> {
    let bytes = std::fs::read(path).map_err(|error| error.to_string())?;
    let mut text = String::with_capacity(bytes.len());
    for (number, line) in String::from_utf8_lossy(&bytes).lines().enumerate() {
        let mut words = line.split_whitespace();
        text.push_str(line);
        if let Some(color @ ("Ka" | "Kd" | "Ks" | "Ke")) = words.next() {
            match (words.next(), words.next(), words.next()) {
                (Some(red), None, None) => text.push_str(&format!(" {red} {red}")),
                (Some(_), Some(_), Some(_)) => {}
                _ => {
                    return Err(format!(
                        "line {}: {color} takes one or three numbers",
                        number + 1
                    ));
                }
            }
        }
        text.push('\n');
    }
    match tobj::load_mtl_buf(&mut Cursor::new(text)) {
        Ok((materials, _)) => Ok(materials),
        Err(error) => Err(error.to_string()),
    }
}

type Made = (Material, Option<AreaLight>, Option<TextureRef>);

/// A material of an OBJ's library, the light that it gives off, and where it is not there.
fn mtl(m: &tobj::Material, folder: &Path, found: &mut Found) -> Made {
    let mut image = |name: &str, channels: Channels| -> TextureRef {
        // Options such as -bm come before the name.
        let name = name.rsplit(' ').next().unwrap_or(name).replace('\\', "/");
        let decoding = Decoding {
            srgb: channels == Channels::Color,
            channels,
            wrap: Wrap::Repeat,
        };
        TextureRef::new(Texture::Image {
            image: found.images.get(&folder.join(name), decoding),
            mapping: Mapping::IDENTITY,
            filter: ImageFilter::DEFAULT,
            scale: 1.0,
        })
    };
    // A factor of zero beside a map is a mistake of the file's writer.
    let diffuse = m.diffuse.unwrap_or([0.6; 3]);
    let kd = match &m.diffuse_texture {
        Some(name) => {
            let factor = if diffuse == [0.0; 3] {
                [1.0; 3]
            } else {
                diffuse
            };
            TextureRef::new(Texture::Scale(
                view::color(factor),
                image(name, Channels::Color),
            ))
        }
        None => view::color(diffuse),
    };
    let alpha = m.dissolve_texture.as_ref().map(|name| {
        TextureRef::new(Texture::AtLeast {
            texture: image(name, Channels::Luminance),
            threshold: 0.5,
        })
    });
    let specular = m.specular.unwrap_or([0.0; 3]);
    let width = (2.0 / (m.shininess.unwrap_or(10.0).max(0.0) + 2.0)).sqrt();
    let roughness = || [view::color([width; 3]), view::color([width; 3])];
    let opacity = m.dissolve.unwrap_or(1.0);
    let model = m.illumination_model.unwrap_or(2);
    let index = m.optical_density.filter(|&n| n > 1.0).unwrap_or(1.5);
    let material = if opacity < 1.0 && matches!(model, 4 | 6 | 7 | 9) {
        Material::Glass {
            kr: view::color([1.0; 3]),
            kt: view::color([1.0; 3]),
            eta: view::color([index; 3]),
            roughness: [view::color([0.0; 3]), view::color([0.0; 3])],
            remap_roughness: false,
        }
    } else if opacity < 1.0 {
        Material::Uber {
            kd,
            ks: view::color(specular),
            kr: view::color([0.0; 3]),
            kt: view::color([0.0; 3]),
            roughness: roughness(),
            opacity: view::color([opacity; 3]),
            eta: view::color([index; 3]),
            remap_roughness: false,
        }
    } else if specular == [0.0; 3] || model < 2 {
        Material::Matte {
            kd,
            sigma: view::color([0.0; 3]),
        }
    } else {
        Material::Substrate {
            kd,
            ks: view::color(specular),
            roughness: roughness(),
            remap_roughness: false,
        }
    };
    let light = match m.emissive {
        Some([r, g, b]) if r.max(g).max(b) > 0.0 && (r + g + b).is_finite() => Some(AreaLight {
            radiance: [r, g, b].map(|c| c.max(0.0)),
            two_sided: false,
            after: 0,
        }),
        _ => None,
    };
    (material, light, alpha)
}

/// What an OBJ file holds.
#[derive(Debug, Default)]
pub(crate) struct ObjMesh {
    pub(crate) geometry: Geometry,
    /// The names of its materials, in the order of their first use.
    pub(crate) material_names: Vec<String>,
    /// Per triangle, an index into the names.
    pub(crate) materials: Vec<u32>,
    pub(crate) faces: Faces,
}

/// Refuses what is no number, and faces that name a vertex, a texture coordinate or a normal that is
/// not there, with the line. The crate that reads the file does not say where, calculates with what
/// they say, and may overflow.
fn check_lines(name: &str, bytes: &[u8]) -> Result<(), SceneError> {
    const KINDS: [&str; 3] = ["vertex", "texture coordinate", "normal"];
    let wrong = |line: usize, message: String| SceneError {
        line: u32::try_from(line + 1).unwrap_or(0),
        ..SceneError::file(name, message)
    };
    let mut counts = [0_i64; 3];
    // Of each kind, the first index that counts back too far, and the greatest, which may stand
    // before what it names; with their lines.
    let mut before: [Option<(i64, i64, usize)>; 3] = [None; 3];
    let mut greatest = [(0_i64, 0_usize); 3];
    for (number, line) in bytes.split(|&b| b == b'\n').enumerate() {
        // The crate refuses what is not UTF-8.
        let mut words = std::str::from_utf8(line)
            .unwrap_or_default()
            .split_whitespace();
        let (kind, numbers) = match words.next() {
            Some("v") => (0, 3),
            Some("vt") => (1, 2),
            Some("vn") => (2, 3),
            Some("f" | "l") => {
                // What has one corner or two is left out.
                let is_face = words.clone().nth(2).is_some();
                for (kind, index) in words.flat_map(|corner| corner.split('/').take(3).enumerate())
                {
                    let index = match index.parse::<i64>() {
                        Ok(index) if is_face => index,
                        Err(_) if !index.is_empty() => {
                            let what = KINDS[kind];
                            let message = format!("{what} \"{index}\": it is named by its number");
                            return Err(wrong(number, message));
                        }
                        _ => continue,
                    };
                    // Of the other kinds 0 is none, as if it were not given.
                    let is_before = index < 0 && index + counts[kind] < 0;
                    if is_before || (index == 0 && kind == 0) {
                        before[kind].get_or_insert((index, counts[kind], number));
                    }
                    if index > greatest[kind].0 {
                        greatest[kind] = (index, number);
                    }
                }
                continue;
            }
            _ => continue,
        };
        counts[kind] += 1;
        let what = KINDS[kind];
        let message = match numbers_in(words, numbers) {
            Ok(()) => continue,
            Err(Some(word)) => format!("a {what} has {numbers} numbers; \"{word}\" is none"),
            Err(None) => format!("a {what} has {numbers} numbers; here are fewer"),
        };
        return Err(wrong(number, message));
    }
    for (kind, what) in KINDS.iter().enumerate() {
        let count = counts[kind];
        // Without any texture coordinates or normals, their indices say nothing.
        if count == 0 && kind > 0 {
            continue;
        }
        let (line, message) = match (before[kind], greatest[kind]) {
            (Some((0, _, line)), _) => (line, format!("{what} 0: they are counted from 1")),
            (Some((index, so_far, line)), _) => (
                line,
                format!("{what} {index}, but only {so_far} come before it"),
            ),
            (None, (index, line)) if index > count => (line, format!("{what} {index} of {count}")),
            _ => continue,
        };
        return Err(wrong(line, message));
    }
    Ok(())
}

/// Whether so many words are numbers; else the first one that is none, where there are so many.
fn numbers_in<'a>(
    words: impl Iterator<Item = &'a str>,
    count: usize,
) -> Result<(), Option<&'a str>> {
    let mut found = 0;
    for word in words.take(count) {
        word.parse::<f32>().map_err(|_| Some(word))?;
        found += 1;
    }
    if found < count { Err(None) } else { Ok(()) }
}

/// Reads the content of an OBJ file, which messages call `name`.
pub(crate) fn obj(name: &str, bytes: &[u8]) -> Result<ObjMesh, SceneError> {
    check_lines(name, bytes)?;
    let mut mesh = ObjMesh::default();
    for line in bytes.split(|&b| b == b'\n') {
        let line = line.trim_ascii();
        if let Some(material) = line.strip_prefix(b"usemtl ") {
            let material = String::from_utf8_lossy(material.trim_ascii()).into_owned();
            if !mesh.material_names.contains(&material) {
                mesh.material_names.push(material);
            }
        }
    }
    let numbers: HashMap<String, usize> = mesh
        .material_names
        .iter()
        .enumerate()
        .map(|(i, name)| (name.clone(), i))
        .collect();
    let options = tobj::LoadOptions {
        single_index: true,
        ignore_points: true,
        ignore_lines: true,
        ..tobj::LoadOptions::default()
    };
    // Materials are told apart by their names alone: the library files are not read.
    let (models, _) = tobj::load_obj_buf(&mut Cursor::new(bytes), &options, |_| {
        let named = |name: &String| tobj::Material {
            name: name.clone(),
            ..Default::default()
        };
        let numbers = numbers.iter().map(|(name, &i)| (name.clone(), i)).collect();
        Ok((mesh.material_names.iter().map(named).collect(), numbers))
    })
    .map_err(|error| {
        SceneError::file(name, format!("not an OBJ file that can be read: {error}"))
    })?;
    let g = &mut mesh.geometry;
    let whole = |list: &[f32], per_vertex: usize, vertices: usize| {
        !list.is_empty() && list.len() == per_vertex * vertices
    };
    let all = |per_vertex: usize, list: fn(&tobj::Mesh) -> &Vec<f32>| {
        models
            .iter()
            .all(|m| whole(list(&m.mesh), per_vertex, m.mesh.positions.len() / 3))
    };
    let has_normals = all(3, |mesh| &mesh.normals);
    let has_uvs = all(2, |mesh| &mesh.texcoords);
    for model in &models {
        let part = &model.mesh;
        let base = u32::try_from(g.positions.len()).unwrap_or(u32::MAX);
        g.positions
            .extend(part.positions.chunks_exact(3).map(|p| [p[0], p[1], p[2]]));
        if has_normals {
            g.normals
                .extend(part.normals.chunks_exact(3).map(|n| [n[0], n[1], n[2]]));
        }
        if has_uvs {
            g.uvs
                .extend(part.texcoords.chunks_exact(2).map(|t| [t[0], t[1]]));
        }
        let mut rest = part.indices.as_slice();
        let arities = part.face_arities.iter().map(|&arity| arity as usize);
        let triangles = std::iter::repeat_n(3, part.indices.len() / 3);
        let arities: Vec<usize> = if part.face_arities.is_empty() {
            triangles.collect()
        } else {
            arities.collect()
        };
        for arity in arities {
            let Some((face, after)) = rest.split_at_checked(arity) else {
                break;
            };
            rest = after;
            let face: Vec<u32> = face
                .iter()
                .map(|&index| base.saturating_add(index))
                .collect();
            if face
                .iter()
                .any(|&index| index as usize >= g.positions.len())
            {
                return Err(SceneError::file(
                    name,
                    "a face names a vertex that is not there",
                ));
            }
            (mesh.faces).add(&g.positions, &face, &mut g.triangles);
        }
        let material = part.material_id.unwrap_or(0) as u32;
        mesh.materials.resize(g.triangles.len(), material);
    }
    Ok(mesh)
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
                let numbers = match words.next()? {
                    "vertex" => words,
                    "facet" => {
                        words.next();
                        words
                    }
                    _ => return None,
                };
                match numbers_in(numbers, 3) {
                    Ok(()) => None,
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
