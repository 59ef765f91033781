//! The truck that ships: a real model, mechanical, of many separate parts.

use glam::DVec3;

use crate::scene::Scene;
use crate::scene::geometry::{Placed, runs};
use crate::scene::material::Material;
use crate::scene::ply;
use crate::scene::view::{self, Up, color, matte};

pub(crate) const TRIANGLES: usize = 116_501;

/// The model as `scenes/truck-LICENSE.md` describes it.
const FILE: &[u8] = include_bytes!("../../../scenes/truck.ply.gz");

/// The materials, by the numbers of the file's faces.
fn materials() -> Vec<Material> {
    let plastic = |kd: [f32; 3], ks: f32, roughness: f32| Material::Plastic {
        kd: color(kd),
        ks: color([ks; 3]),
        roughness: color([roughness; 3]),
        remap_roughness: true,
    };
    let rubber = || matte([0.035; 3]);
    let metal = || plastic([0.36, 0.37, 0.39], 0.5, 0.06);
    NAMES
        .iter()
        .map(|name| match *name {
            "body" => plastic([0.42, 0.035, 0.03], 0.3, 0.03),
            "bodyTrailer" => plastic([0.62, 0.63, 0.62], 0.15, 0.1),
            "metal" | "metalTrailer" => metal(),
            "glass" => plastic([0.02, 0.025, 0.03], 0.5, 0.01),
            "reflector" | "reflectorTrailer" => plastic([0.75, 0.33, 0.05], 0.4, 0.05),
            "black" | "blackTrailer" => plastic([0.05; 3], 0.15, 0.2),
            "support" => matte([0.16, 0.16, 0.17]),
            _ => rubber(),
        })
        .collect()
}

/// The names of the materials in the original, in the order of their first use there.
const NAMES: [&str; 12] = [
    "body",
    "blackTrailer",
    "metalTrailer",
    "black",
    "reflectorTrailer",
    "tiresTrailer",
    "bodyTrailer",
    "metal",
    "reflector",
    "glass",
    "support",
    "tires",
];

pub(crate) fn scene(name: &str) -> Result<Scene, String> {
    let mesh = ply::parse("truck.ply.gz", FILE).map_err(|error| error.to_string())?;
    let (pieces, materials) = (pieces(&mesh), materials());
    let view = |mesh: &splitplane::Mesh| {
        let towards_eye = DVec3::new(0.8, 0.28, 0.72);
        let camera = view::fitted(&mesh.bounds(), mesh.positions(), towards_eye, Up::Y);
        (camera, view::daylight(DVec3::new(0.35, 0.8, 0.75)))
    };
    view::scene(name, pieces, materials, view, Vec::new())
}

/// One piece for each run of faces of the same material, so that triangles keep their order.
fn pieces(mesh: &ply::PlyMesh) -> Vec<Placed> {
    let materials: Vec<u32> = mesh.materials.iter().map(|&m| m.into()).collect();
    let last = NAMES.len() as u32 - 1;
    runs(&mesh.geometry, &materials)
        .into_iter()
        .map(|(material, own)| Placed::plain(own, material.min(last)))
        .collect()
}

#[cfg(test)]
mod tests {
    use std::io::Write;

    use super::*;
    use crate::scene::geometry::Geometry;
    use crate::scene::obj_file::obj;

    /// Makes `scenes/truck.ply.gz` of the original, which `TRUCK_OBJ` names:
    /// `TRUCK_OBJ=peterbilt.obj cargo test -p splitplane-render convert -- --ignored`
    #[test]
    #[ignore = "writes scenes/truck.ply.gz"]
    fn convert_the_original() {
        let path = std::env::var("TRUCK_OBJ").expect("TRUCK_OBJ names the original file");
        let mesh = obj(&path, &std::fs::read(&path).unwrap()).unwrap();
        let names: Vec<&str> = mesh.materials.iter().map(|m| m.name.as_str()).collect();
        assert_eq!(names, NAMES);
        let count = |of: fn(&Geometry) -> usize| -> usize {
            mesh.parts.iter().map(|part| of(&part.geometry)).sum()
        };
        let mut text = format!(
            "ply\nformat binary_little_endian 1.0\n\
             comment Public domain (CC0 1.0); see truck-LICENSE.md\n\
             element vertex {}\nproperty float x\nproperty float y\nproperty float z\n\
             element face {}\nproperty list uchar int vertex_indices\nproperty uchar material\n\
             end_header\n",
            count(|g| g.positions.len()),
            count(|g| g.triangles.len())
        )
        .into_bytes();
        for part in &mesh.parts {
            for c in part.geometry.positions.iter().flatten() {
                text.extend(c.to_le_bytes());
            }
        }
        let mut base = 0;
        for part in &mesh.parts {
            for triangle in &part.geometry.triangles {
                text.push(3);
                for index in triangle {
                    text.extend((base + index).to_le_bytes());
                }
                text.push(part.material.expect("the file names all materials") as u8);
            }
            base += part.geometry.positions.len() as u32;
        }
        let mut packed = flate2::GzBuilder::new().write(Vec::new(), flate2::Compression::best());
        packed.write_all(&text).unwrap();
        let target = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/truck.ply.gz");
        std::fs::write(target, packed.finish().unwrap()).unwrap();
    }

    #[test]
    fn the_truck_has_all_triangles_of_the_original() {
        let scene = scene("truck").unwrap();
        assert_eq!(scene.mesh.triangles().len(), TRIANGLES);
        assert_eq!(scene.materials.len(), NAMES.len());
    }
}
