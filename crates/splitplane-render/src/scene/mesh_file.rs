//! A mesh file as a scene: PLY, OBJ or STL, grey, with a camera and light that suit it.

use std::collections::HashMap;
use std::io::Cursor;
use std::path::Path;

use glam::DVec3;

use super::geometry::{Geometry, Placed};
use super::polygon::triangulate;
use super::view::{self, Up};
use super::{Note, Scene, ply};
use crate::error::SceneError;

/// The endings of the files that can be read, in lower case.
pub(crate) const ENDINGS: &[&str] = &[".ply", ".ply.gz", ".obj", ".stl"];

/// Whether the file's name is that of a mesh.
pub(crate) fn is_mesh(path: &Path) -> bool {
    let name = path.to_string_lossy().to_ascii_lowercase();
    ENDINGS.iter().any(|ending| name.ends_with(ending))
}

/// Reads the mesh at `path` as a scene.
pub(crate) fn load(path: &Path, name: &str) -> Result<Scene, SceneError> {
    let file = path.display().to_string();
    let lower = file.to_ascii_lowercase();
    let bytes = std::fs::read(path)
        .map_err(|error| SceneError::file(&file, format!("cannot be read: {error}")))?;
    let (geometry, concave, usual_up) = if lower.ends_with(".obj") {
        let mesh = obj(&file, &bytes)?;
        (mesh.geometry, mesh.concave, Up::Y)
    } else if lower.ends_with(".stl") {
        (stl(&file, bytes)?, 0, Up::Z)
    } else {
        let mesh = ply::parse(&file, &bytes)?;
        (mesh.geometry, mesh.concave, Up::Y)
    };
    if geometry.triangles.is_empty() {
        return Err(SceneError::file(
            &file,
            "has no triangles; a mesh to look at has some",
        ));
    }
    let mut notes = Vec::new();
    if concave > 0 {
        notes.push(Note {
            place: file.clone(),
            text: format!("{concave} faces are not convex; triangulated by their ears"),
            warning: false,
        });
    }
    notes.push(Note {
        place: file.clone(),
        text: "a mesh has no camera, light or material; they were chosen to suit it".to_owned(),
        warning: false,
    });
    let piece = Placed::plain(geometry, 0);
    let fit = |mesh: &splitplane::Mesh| {
        let bounds = mesh.bounds();
        let up = Up::guessed(usual_up, &bounds);
        // Three quarters from the front, which lies towards +z where y is up, towards -y else.
        let (towards_eye, towards_sun) = match up {
            Up::Y => (DVec3::new(0.62, 0.42, 0.8), DVec3::new(-0.3, 0.9, 0.6)),
            Up::Z => (DVec3::new(0.62, -0.8, 0.42), DVec3::new(-0.3, -0.6, 0.9)),
        };
        (
            view::fitted(&bounds, mesh.positions(), towards_eye, up),
            view::daylight(towards_sun),
        )
    };
    view::scene(name, &[piece], vec![view::matte([0.6; 3])], fit, notes)
        .map_err(|message| SceneError::file(&file, message))
}

/// What an OBJ file holds.
#[derive(Debug, Default)]
pub(crate) struct ObjMesh {
    pub(crate) geometry: Geometry,
    /// The names of its materials, in the order of their first use.
    pub(crate) material_names: Vec<String>,
    /// Per triangle, an index into the names.
    pub(crate) materials: Vec<u8>,
    /// Faces of more than three vertices that are not convex.
    pub(crate) concave: usize,
}

/// Reads the content of an OBJ file, which messages call `name`.
pub(crate) fn obj(name: &str, bytes: &[u8]) -> Result<ObjMesh, SceneError> {
    let mut mesh = ObjMesh::default();
    for line in bytes.split(|&b| b == b'\n') {
        let line = line.trim_ascii();
        if let Some(material) = line.strip_prefix(b"usemtl ") {
            let material = String::from_utf8_lossy(material.trim_ascii()).into_owned();
            if !mesh.material_names.contains(&material) && mesh.material_names.len() < 255 {
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
            mesh.concave += usize::from(triangulate(&g.positions, &face, &mut g.triangles));
        }
        let material = part.material_id.unwrap_or(0).min(255) as u8;
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
    let mesh = stl_io::read_stl(&mut Cursor::new(bytes)).map_err(|error| {
        SceneError::file(name, format!("not an STL file that can be read: {error}"))
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
