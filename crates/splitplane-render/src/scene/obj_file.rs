//! What a Wavefront OBJ file says: its faces, and which materials they name.
//!
//! Crates that read such files do not say which faces have no normals or texture coordinates, what
//! they pass over, or where something is wrong; the one used before could also panic.

use std::borrow::Cow;
use std::collections::HashMap;

use super::geometry::Geometry;
use super::pbrt::shortened;
use super::polygon::Faces;
use crate::error::SceneError;

/// What an OBJ file holds.
#[derive(Debug, Default)]
pub(crate) struct ObjMesh {
    /// Its faces in the order of the file.
    pub(crate) parts: Vec<Part>,
    /// What its faces may be made of, in the order of their first use.
    pub(crate) materials: Vec<Named>,
    /// What follows each `mtllib`: a file, or several.
    pub(crate) libraries: Vec<String>,
    pub(crate) faces: Faces,
    /// Elements that are no faces: points, lines, free-form curves and surfaces.
    pub(crate) others: usize,
    /// Faces of which some corners have a texture coordinate or a normal, and others none.
    pub(crate) uneven: usize,
    /// Vertices have colours.
    pub(crate) colored: bool,
}

/// Consecutive faces of the same material, all of them with normals or all without, and with texture
/// coordinates or without.
#[derive(Debug)]
pub(crate) struct Part {
    /// Index into [`ObjMesh::materials`]; `None` before the first `usemtl`.
    pub(crate) material: Option<u32>,
    pub(crate) geometry: Geometry,
}

/// A material's name, and the line in which it is used first.
#[derive(Debug, PartialEq, Eq)]
pub(crate) struct Named {
    pub(crate) name: String,
    pub(crate) line: u32,
}

/// Reads the content of an OBJ file, which messages call `name`.
pub(crate) fn obj(name: &str, bytes: &[u8]) -> Result<ObjMesh, SceneError> {
    let wrong = |(line, message)| SceneError {
        line,
        ..SceneError::file(name, message)
    };
    let mut reader = Reader::default();
    for (number, line) in lines(bytes) {
        (reader.line(number, &line)).map_err(|message| wrong((number, message)))?;
    }
    reader.check_indices().map_err(wrong)?;
    Ok(reader.finish())
}

/// The lines of an OBJ or MTL file with their numbers. One that ends in a backslash goes on in the
/// next, unless it is a comment, which may end in a path.
pub(crate) fn lines(bytes: &[u8]) -> impl Iterator<Item = (u32, Cow<'_, str>)> {
    let mut rest = bytes.split(|&b| b == b'\n').zip(1..);
    std::iter::from_fn(move || {
        let (line, number) = rest.next()?;
        let mut line = String::from_utf8_lossy(line);
        let is_comment = line.trim_start().starts_with('#');
        while let (false, Some(before)) = (is_comment, line.trim_end().strip_suffix('\\')) {
            let length = before.len();
            let line = line.to_mut();
            line.truncate(length);
            if let Some((next, _)) = rest.next() {
                line.push(' ');
                line.push_str(&String::from_utf8_lossy(next));
            }
        }
        Some((number, line))
    })
}

/// The first word, and what follows it; both may be empty.
pub(crate) fn first_word(line: &str) -> (&str, &str) {
    let line = line.trim();
    let (word, rest) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
    (word, rest.trim_start())
}

/// So many words as numbers; else the first one that is none, where there are so many.
pub(crate) fn numbers<'a, const N: usize>(
    words: impl Iterator<Item = &'a str>,
) -> Result<[f32; N], Option<&'a str>> {
    let mut found = [0.0; N];
    let mut count = 0;
    for (number, word) in found.iter_mut().zip(words) {
        *number = word.parse().map_err(|_| Some(word))?;
        count += 1;
    }
    if count < N { Err(None) } else { Ok(found) }
}

const KINDS: [&str; 3] = ["vertex", "texture coordinate", "normal"];
const VERTEX: usize = 0;
const UV: usize = 1;
const NORMAL: usize = 2;

/// In place of an index: there is none.
const NONE: u32 = u32::MAX;

#[derive(Default)]
struct Reader {
    positions: Vec<[f32; 3]>,
    uvs: Vec<[f32; 2]>,
    normals: Vec<[f32; 3]>,
    /// Indices of each kind, of all faces one after the other.
    corners: Vec<[u32; 3]>,
    /// Each face's number of corners and material. They may come before what they name.
    faces: Vec<(usize, Option<u32>)>,
    material: Option<u32>,
    numbers: HashMap<String, u32>,
    /// Of each kind, what is wrong with the first index that counts back too far, and the greatest
    /// index; with their lines.
    before: [Option<(u32, String)>; 3],
    greatest: [(i64, u32); 3],
    mesh: ObjMesh,
}

impl Reader {
    fn line(&mut self, number: u32, line: &str) -> Result<(), String> {
        let (key, rest) = first_word(line);
        let mut words = rest
            .split_whitespace()
            .take_while(|word| !word.starts_with('#'));
        match key {
            "v" => {
                let mut position: [f32; 3] = numbers_of(VERTEX, &mut words)?;
                match (words.next(), words.next()) {
                    (Some(w), None) => {
                        let w: f32 = w.parse().map_err(|_| {
                            let w = shortened(w);
                            format!("the weight of a vertex is a number; \"{w}\" is none")
                        })?;
                        position = position.map(|c| c / w);
                    }
                    (Some(_), Some(_)) => self.mesh.colored = true,
                    (None, _) => {}
                }
                if let Some(c) = position.iter().find(|c| !c.is_finite()) {
                    return Err(format!(
                        "the numbers of a vertex must be finite; here is {c}"
                    ));
                }
                self.positions.push(position);
            }
            "vt" => self.uvs.push(numbers_of(UV, &mut words)?),
            "vn" => self.normals.push(numbers_of(NORMAL, &mut words)?),
            "f" => self.face(number, words)?,
            "p" | "l" | "curv" | "curv2" | "surf" => self.mesh.others += 1,
            "mtllib" => self.mesh.libraries.push(rest.to_owned()),
            "usemtl" if rest.is_empty() => self.material = None,
            "usemtl" => {
                let known = self.numbers.get(rest).copied();
                self.material = Some(known.unwrap_or_else(|| {
                    let index = self.mesh.materials.len() as u32;
                    self.numbers.insert(rest.to_owned(), index);
                    self.mesh.materials.push(Named {
                        name: rest.to_owned(),
                        line: number,
                    });
                    index
                }));
            }
            _ => {}
        }
        Ok(())
    }

    fn face<'a>(
        &mut self,
        line: u32,
        words: impl Iterator<Item = &'a str> + Clone,
    ) -> Result<(), String> {
        let counts = self.counts();
        // What has one corner or two is left out.
        let is_face = words.clone().nth(2).is_some();
        let start = self.corners.len();
        for word in words {
            let mut corner = [NONE; 3];
            for (kind, index) in word.split('/').take(3).enumerate() {
                if index.is_empty() && kind != VERTEX {
                    continue;
                }
                let what = KINDS[kind];
                let Ok(index) = index.parse::<i64>() else {
                    let index = shortened(index);
                    return Err(format!("{what} \"{index}\": it is named by its number"));
                };
                let count = counts[kind];
                // Of the other kinds 0 is none, as if it were not given.
                let wrong = if index == 0 && kind == VERTEX {
                    Some(format!("{what} 0: they are counted from 1"))
                } else if index < 0 && index + count < 0 {
                    Some(format!("{what} {index}, but only {count} come before it"))
                } else {
                    None
                };
                if let (Some(message), true) = (wrong, is_face) {
                    self.before[kind].get_or_insert((line, message));
                } else if index != 0 && is_face {
                    let from_start = if index < 0 { index + count } else { index - 1 };
                    corner[kind] = u32::try_from(from_start).unwrap_or(NONE);
                    if index > self.greatest[kind].0 {
                        self.greatest[kind] = (index, line);
                    }
                }
            }
            self.corners.push(corner);
        }
        if is_face {
            let count = self.corners.len() - start;
            self.faces.push((count, self.material));
        } else {
            self.corners.truncate(start);
            self.mesh.faces.leave_out();
        }
        Ok(())
    }

    fn counts(&self) -> [i64; 3] {
        [self.positions.len(), self.uvs.len(), self.normals.len()].map(|count| count as i64)
    }

    /// Refuses faces that name a vertex, a texture coordinate or a normal that is not there. Without
    /// any texture coordinates or normals, their indices say nothing.
    fn check_indices(&mut self) -> Result<(), (u32, String)> {
        for (kind, count) in self.counts().into_iter().enumerate() {
            if count == 0 && kind != VERTEX {
                continue;
            }
            if let Some(wrong) = self.before[kind].take() {
                return Err(wrong);
            }
            let (index, line) = self.greatest[kind];
            if index > count {
                return Err((line, format!("{} {index} of {count}", KINDS[kind])));
            }
        }
        Ok(())
    }

    fn finish(self) -> ObjMesh {
        let counts = self.counts();
        let mut mesh = self.mesh;
        let mut corners = self.corners.as_slice();
        // The numbers of vertices within the part, by what they consist of.
        let mut numbers: HashMap<[u32; 3], u32> = HashMap::new();
        let mut kind_of_part = None;
        let mut polygon = Vec::new();
        for (count, material) in self.faces {
            let (own, rest) = corners.split_at(count);
            corners = rest;
            let given = [VERTEX, UV, NORMAL].map(|kind| match counts[kind] {
                0 => 0,
                _ => own.iter().filter(|corner| corner[kind] != NONE).count(),
            });
            mesh.uneven += usize::from(given.iter().any(|&g| g != 0 && g != count));
            let has = given.map(|given| given == count);
            if kind_of_part != Some((material, has)) {
                kind_of_part = Some((material, has));
                numbers.clear();
                mesh.parts.push(Part {
                    material,
                    geometry: Geometry::default(),
                });
            }
            let Some(Part { geometry: g, .. }) = mesh.parts.last_mut() else {
                continue;
            };
            polygon.clear();
            for corner in own {
                let key = [VERTEX, UV, NORMAL].map(|k| if has[k] { corner[k] } else { NONE });
                polygon.push(*numbers.entry(key).or_insert_with(|| {
                    let [v, uv, normal] = key.map(|index| index as usize);
                    g.positions.extend(self.positions.get(v));
                    g.uvs.extend(self.uvs.get(uv));
                    g.normals.extend(self.normals.get(normal));
                    g.positions.len() as u32 - 1
                }));
            }
            (mesh.faces).add(&g.positions, &polygon, &mut g.triangles);
        }
        mesh
    }
}

/// The numbers of a vertex, a texture coordinate or a normal.
fn numbers_of<'a, const N: usize>(
    kind: usize,
    words: impl Iterator<Item = &'a str>,
) -> Result<[f32; N], String> {
    let what = KINDS[kind];
    numbers(words).map_err(|wrong| match wrong {
        Some(word) => {
            let word = shortened(word);
            format!("a {what} has {N} numbers; \"{word}\" is none")
        }
        None => format!("a {what} has {N} numbers; here are fewer"),
    })
}
