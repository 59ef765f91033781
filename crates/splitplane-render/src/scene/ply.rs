//! PLY files: ASCII or binary, as they are or compressed by gzip.

use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;

use ply_rs_bw::parser::{ParseError, Parser, Reader};
use ply_rs_bw::ply::{
    ElementDef, Encoding, Header, Property, PropertyAccess, PropertyAccessResult, PropertyType,
    ScalarType,
};

use super::geometry::Geometry;
use super::pbrt::{shortened, shortened_to};
use super::polygon::Faces;
use crate::error::SceneError;

/// What a PLY file holds.
#[derive(Clone, Debug, Default)]
pub(crate) struct PlyMesh {
    pub(crate) geometry: Geometry,
    /// Linear RGB, one per vertex; empty where vertices have none.
    pub(crate) colors: Vec<[f32; 3]>,
    /// Per triangle, the face property `material`; empty where faces have none.
    pub(crate) materials: Vec<u8>,
    pub(crate) faces: Faces,
}

/// Reads the file at `path`.
///
/// # Errors
/// The file cannot be read, is no PLY file, ends early, or names a vertex that does not exist.
pub(crate) fn read(path: &Path) -> Result<PlyMesh, SceneError> {
    let name = path.display().to_string();
    let wrong = |error: std::io::Error| SceneError::file(&name, format!("cannot be read: {error}"));
    let file = File::open(path).map_err(wrong)?;
    let length = file.metadata().map_err(wrong)?.len();
    parse_from(&name, file, usize::try_from(length).unwrap_or(usize::MAX))
}

/// Reads the content of a file, which messages call `name`.
pub(crate) fn parse(name: &str, bytes: &[u8]) -> Result<PlyMesh, SceneError> {
    parse_from(name, bytes, bytes.len())
}

/// The longest header that is read.
const LONGEST_HEADER: usize = 1 << 20;

/// Reads `length` bytes, as they are or compressed. Files of the usual layout are read as they
/// come, never whole.
fn parse_from(name: &str, source: impl Read, length: usize) -> Result<PlyMesh, SceneError> {
    let wrong = |error: std::io::Error| SceneError::file(name, format!("cannot be read: {error}"));
    let mut source = BufReader::with_capacity(1 << 16, source);
    if source.fill_buf().map_err(wrong)?.starts_with(&[0x1f, 0x8b]) {
        // Deflate makes at most some thousand times as much of it.
        let most = length.saturating_mul(1032);
        let plain = flate2::bufread::MultiGzDecoder::new(source);
        return parse_stream(name, &mut BufReader::with_capacity(1 << 16, plain), most);
    }
    parse_stream(name, &mut source, length)
}

fn parse_stream(
    name: &str,
    source: &mut impl BufRead,
    length: usize,
) -> Result<PlyMesh, SceneError> {
    let wrong = |error: std::io::Error| SceneError::file(name, format!("cannot be read: {error}"));
    let mut head = Vec::new();
    while !head.ends_with(b"end_header\n") && !head.ends_with(b"end_header\r\n") {
        let room = (LONGEST_HEADER - head.len().min(LONGEST_HEADER)) as u64;
        let read = Read::by_ref(source)
            .take(room)
            .read_until(b'\n', &mut head)
            .map_err(wrong)?;
        if read == 0 {
            break;
        }
    }
    let header = Parser::<Row>::new().read_header(&mut Reader::new(head.as_slice()));
    if let Ok(header) = header
        && counts_fit(name, &header, length).is_ok()
        && let Some(mesh) = quick(name, &header, source)?
    {
        return Ok(mesh);
    }
    source.read_to_end(&mut head).map_err(wrong)?;
    parse_plain(name, &head)
}

/// That a file does not announce more than its bytes can hold; also keeps elements without
/// properties from being counted to the end of time.
fn counts_fit(name: &str, header: &Header, length: usize) -> Result<(), SceneError> {
    for (_, element) in &header.elements {
        if element.count > length {
            return Err(SceneError::file(
                name,
                format!(
                    "announces {} of \"{}\", more than fit into the file's {length} bytes",
                    element.count, element.name,
                ),
            ));
        }
    }
    Ok(())
}

fn parse_plain(name: &str, bytes: &[u8]) -> Result<PlyMesh, SceneError> {
    let wrong = |error: ParseError| SceneError {
        file: name.to_owned(),
        line: error
            .line()
            .and_then(|line| u32::try_from(line).ok())
            .unwrap_or(0),
        column: 0,
        message: format!("not a PLY file that can be read: {}", shown(&error)),
    };
    let parser = Parser::<Row>::new();
    let mut reader = Reader::new(bytes);
    let header = parser.read_header(&mut reader).map_err(wrong)?;
    counts_fit(name, &header, bytes.len())?;
    let mut mesh = PlyMesh::default();
    let mut faces = Vec::new();
    for (_, element) in &header.elements {
        let rows = parser
            .read_payload_for_element(&mut reader, element, &header)
            .map_err(wrong)?;
        match element.name.as_str() {
            "vertex" => {
                let has =
                    |names: [&str; 2]| names.iter().all(|n| element.properties.contains_key(*n));
                let g = &mut mesh.geometry;
                g.positions = rows.iter().map(|row| row.position).collect();
                if has(["nx", "ny"]) && element.properties.contains_key("nz") {
                    g.normals = rows.iter().map(|row| row.normal).collect();
                }
                if UV_NAMES.iter().any(|names| has(*names)) {
                    g.uvs = rows.iter().map(|row| row.uv).collect();
                }
                if has(["red", "green"]) && element.properties.contains_key("blue") {
                    let bytes = |name: &str| {
                        element
                            .properties
                            .get(name)
                            .is_some_and(|p| p.data_type == PropertyType::Scalar(ScalarType::UChar))
                    };
                    let scale = if bytes("red") { 1.0 / 255.0 } else { 1.0 };
                    let linear = |c: f32| super::image_file::linear(c * scale);
                    mesh.colors = rows.iter().map(|row| row.color.map(linear)).collect();
                }
            }
            "face" => faces = rows,
            _ => {}
        }
    }
    let has_materials = faces.iter().any(|row| row.material.is_some());
    for (index, row) in faces.iter().enumerate() {
        mesh.face(
            name,
            index,
            &row.indices,
            has_materials.then_some(row.material.unwrap_or(0)),
        )?;
    }
    Ok(mesh)
}

/// What the parser found, and the line that it could not read, as far as it says so.
fn shown(error: &ParseError) -> String {
    let text = error.to_string();
    let mut lines = text.lines();
    let what = lines.next().unwrap_or_default();
    // Its place is told apart.
    let what = match what.strip_prefix("Line ").and_then(|w| w.split_once(": ")) {
        Some((_, what)) => what,
        None => what,
    };
    let what = shortened_to(what, 200);
    let found = lines.find_map(|line| line.trim().strip_prefix("String: "));
    match found.map(|line| line.trim_matches('\'')) {
        Some(line) => {
            let (what, line) = (what.trim_end_matches('.'), shortened(line));
            format!(
                "{what}: \"{line}\" (numbers must be finite, and of the kind that the header says)"
            )
        }
        None => what,
    }
}

/// The names that texture coordinates have.
const UV_NAMES: [[&str; 2]; 4] = [
    ["u", "v"],
    ["s", "t"],
    ["texture_u", "texture_v"],
    ["texture_s", "texture_t"],
];

/// The names that a face's list of vertices has.
const INDEX_NAMES: [&str; 2] = ["vertex_indices", "vertex_index"];

impl PlyMesh {
    fn face(
        &mut self,
        name: &str,
        face: usize,
        indices: &[i64],
        material: Option<u8>,
    ) -> Result<(), SceneError> {
        let count = self.geometry.positions.len();
        let mut polygon = [0_u32; 8];
        let mut long = Vec::new();
        let polygon: &mut [u32] = match polygon.get_mut(..indices.len()) {
            Some(short) => short,
            None => {
                long.resize(indices.len(), 0);
                &mut long
            }
        };
        for (own, &index) in polygon.iter_mut().zip(indices) {
            match u32::try_from(index).ok().filter(|&i| (i as usize) < count) {
                Some(index) => *own = index,
                None => {
                    return Err(SceneError::file(
                        name,
                        format!("face {face} names vertex {index}, but there are {count} vertices"),
                    ));
                }
            }
        }
        let g = &mut self.geometry;
        (self.faces).add(&g.positions, polygon, &mut g.triangles);
        if let Some(material) = material {
            self.materials.resize(g.triangles.len(), material);
        }
        Ok(())
    }
}

/// A vertex or a face.
#[derive(Debug, Default)]
struct Row {
    position: [f32; 3],
    normal: [f32; 3],
    uv: [f32; 2],
    color: [f32; 3],
    indices: Vec<i64>,
    material: Option<u8>,
}

impl PropertyAccess for Row {
    fn new() -> Self {
        Row::default()
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        let place = match name {
            "x" => &mut self.position[0],
            "y" => &mut self.position[1],
            "z" => &mut self.position[2],
            "nx" => &mut self.normal[0],
            "ny" => &mut self.normal[1],
            "nz" => &mut self.normal[2],
            "red" => &mut self.color[0],
            "green" => &mut self.color[1],
            "blue" => &mut self.color[2],
            "u" | "s" | "texture_u" | "texture_s" => &mut self.uv[0],
            "v" | "t" | "texture_v" | "texture_t" => &mut self.uv[1],
            "material" => {
                self.material = property.to_f32_lossy().map(|value| value as u8);
                return PropertyAccessResult::Set;
            }
            _ if INDEX_NAMES.contains(&name) => {
                let list = match property {
                    Property::ListChar(list) => list.into_iter().map(i64::from).collect(),
                    Property::ListUChar(list) => list.into_iter().map(i64::from).collect(),
                    Property::ListShort(list) => list.into_iter().map(i64::from).collect(),
                    Property::ListUShort(list) => list.into_iter().map(i64::from).collect(),
                    Property::ListInt(list) => list.into_iter().map(i64::from).collect(),
                    Property::ListUInt(list) => list.into_iter().map(i64::from).collect(),
                    _ => return PropertyAccessResult::UnsupportedType,
                };
                self.indices = list;
                return PropertyAccessResult::Set;
            }
            _ => return PropertyAccessResult::Ignored,
        };
        match property.to_f32_lossy() {
            Some(value) => {
                *place = value;
                PropertyAccessResult::Set
            }
            None => PropertyAccessResult::UnsupportedType,
        }
    }
}

/// Reads the layout that nearly all binary files have: vertices of floats, faces of one list of
/// 32-bit indices with a count of 8 bits (and a material of 8 bits); `None` where the file has
/// another. `payload` is what follows the header; of it nothing is read in that case.
fn quick(
    name: &str,
    header: &Header,
    payload: &mut impl BufRead,
) -> Result<Option<PlyMesh>, SceneError> {
    if header.encoding != Encoding::BinaryLittleEndian {
        return Ok(None);
    }
    let elements: Vec<&ElementDef> = header.elements.values().collect();
    let [vertex, face] = elements.as_slice() else {
        return Ok(None);
    };
    let float = PropertyType::Scalar(ScalarType::Float);
    let is = |range: std::ops::Range<usize>, names: &[&str]| {
        range.len() == names.len()
            && range.zip(names).all(|(i, name)| {
                let property = vertex.properties.get_index(i);
                property.is_some_and(|(_, p)| p.name == *name && p.data_type == float)
            })
    };
    let floats = vertex.properties.len();
    let has_normals = is(3..6, &["nx", "ny", "nz"]);
    let after_normals = if has_normals { 6 } else { 3 };
    let has_uvs = UV_NAMES
        .iter()
        .any(|names| is(after_normals..after_normals + 2, names));
    let expected = after_normals + if has_uvs { 2 } else { 0 };
    let faces_fit = |property: Option<(&String, &ply_rs_bw::ply::PropertyDef)>| {
        property.is_some_and(|(_, p)| {
            INDEX_NAMES.contains(&p.name.as_str())
                && matches!(
                    p.data_type,
                    PropertyType::List(ScalarType::UChar, ScalarType::Int | ScalarType::UInt)
                )
        })
    };
    let has_material = face.properties.get_index(1).is_some_and(|(_, p)| {
        p.name == "material" && p.data_type == PropertyType::Scalar(ScalarType::UChar)
    });
    if vertex.name != "vertex"
        || face.name != "face"
        || !is(0..3, &["x", "y", "z"])
        || floats != expected
        || !faces_fit(face.properties.get_index(0))
        || face.properties.len() != 1 + usize::from(has_material)
    {
        return Ok(None);
    }

    let short = |what: &str, index: usize| {
        SceneError::file(name, format!("the file ends within {what} {index}"))
    };
    let too_many = || SceneError::file(name, "does not fit into memory");
    let mut mesh = PlyMesh::default();
    let g = &mut mesh.geometry;
    let reserved = g.positions.try_reserve_exact(vertex.count).is_ok()
        && (!has_normals || g.normals.try_reserve_exact(vertex.count).is_ok())
        && (!has_uvs || g.uvs.try_reserve_exact(vertex.count).is_ok())
        && g.triangles.try_reserve_exact(face.count).is_ok();
    if !reserved {
        return Err(too_many());
    }
    // A vertex has at most eight floats.
    let mut bytes = [0; 32];
    let bytes = &mut bytes[..4 * floats];
    for index in 0..vertex.count {
        payload
            .read_exact(bytes)
            .map_err(|_| short("vertex", index))?;
        let mut numbers = [0.0; 8];
        for (number, bytes) in numbers.iter_mut().zip(bytes.chunks_exact(4)) {
            *number = f32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]);
        }
        g.positions.push([numbers[0], numbers[1], numbers[2]]);
        if has_normals {
            g.normals.push([numbers[3], numbers[4], numbers[5]]);
        }
        if has_uvs {
            g.uvs
                .push([numbers[after_normals], numbers[after_normals + 1]]);
        }
    }
    let mut indices = Vec::with_capacity(255);
    let mut list = [0; 4 * 255];
    for index in 0..face.count {
        let mut count = [0];
        payload
            .read_exact(&mut count)
            .map_err(|_| short("face", index))?;
        let list = &mut list[..4 * usize::from(count[0])];
        payload.read_exact(list).map_err(|_| short("face", index))?;
        indices.clear();
        indices.extend(
            list.chunks_exact(4)
                .map(|b| i64::from(u32::from_le_bytes([b[0], b[1], b[2], b[3]]))),
        );
        let material = match has_material {
            false => None,
            true => {
                let mut material = [0];
                payload
                    .read_exact(&mut material)
                    .map_err(|_| short("face", index))?;
                Some(material[0])
            }
        };
        mesh.face(name, index, &indices, material)?;
    }
    Ok(Some(mesh))
}
