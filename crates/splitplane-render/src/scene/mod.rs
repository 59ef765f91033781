//! What a scene is: geometry, materials, lights, camera, and what the file says of how to render.

pub mod camera;
pub mod library;
pub mod light;
pub mod material;
pub mod settings;
pub mod texture;

mod curve;
mod geometry;
mod gltf_file;
mod image_file;
mod mesh_file;
mod mtl_file;
mod obj_file;
mod pbrt;
mod ply;
mod polygon;
mod pyramid;
mod subdivide;
mod tessellate;
mod view;

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use std::path::{Path, PathBuf};

use splitplane::{Aabb, Mesh};

use camera::Camera;
use light::{AreaLight, Light};
use material::Material;
use settings::{Film, Filter, Integrator, Sampler};
use texture::TextureRef;

use crate::error::SceneError;
use crate::transform::Transform;

/// A scene, ready to be rendered. All geometry but that of [`Scene::objects`] is in world space.
#[derive(Clone, Debug)]
pub struct Scene {
    /// A short name, for records and file names: `killeroo-legs`, `arcade:100000`.
    pub name: String,
    /// All triangles, but those of objects.
    pub mesh: Mesh,
    /// Shading normals, one per vertex of the mesh; only those of a shape with
    /// [`Shape::has_normals`] mean anything. Not of unit length: to be interpolated as they are,
    /// then normalised, as pbrt-v3 does. Empty where no shape has any.
    pub normals: Vec<[f32; 3]>,
    /// Texture coordinates, one per vertex of the mesh; only those of a shape with
    /// [`Shape::has_uvs`] mean anything. Empty where no shape has any.
    pub uvs: Vec<[f32; 2]>,
    /// Colours, one per vertex of the mesh, linear RGB, for [`texture::Texture::VertexColor`].
    /// Empty where there are none.
    pub colors: Vec<[f32; 3]>,
    /// What the triangles belong to: consecutive ranges that cover the mesh, in order.
    pub shapes: Vec<Shape>,
    /// What [`Scene::instances`] place, each once; see [`LoadOptions::instances`].
    pub objects: Vec<Object>,
    /// Copies of objects in the scene.
    pub instances: Vec<Instance>,
    /// The materials that shapes name.
    pub materials: Vec<Material>,
    /// The lights, apart from area lights, which belong to shapes.
    pub lights: Vec<Light>,
    /// The camera.
    pub camera: Camera,
    /// The size of the picture and the part of it to render.
    pub film: Film,
    /// How samples are weighted into pixels.
    pub filter: Filter,
    /// Where samples come from.
    pub sampler: Sampler,
    /// How light is gathered.
    pub integrator: Integrator,
    /// The tree that the file asks for, as it is named there, with its directions: "kd",
    /// "wn+kd:6".
    pub accelerator: Option<String>,
    /// What the file holds.
    pub contents: Contents,
    /// What was approximated or could not be used, each once per kind, with its place; and what
    /// was tessellated and how finely.
    pub notes: Vec<Note>,
}

/// Geometry that is placed several times, in a space of its own. Objects give off no light, as in
/// pbrt-v3.
#[derive(Clone, Debug)]
pub struct Object {
    /// Its triangles.
    pub mesh: Mesh,
    /// As [`Scene::normals`].
    pub normals: Vec<[f32; 3]>,
    /// As [`Scene::uvs`].
    pub uvs: Vec<[f32; 2]>,
    /// As [`Scene::shapes`].
    pub shapes: Vec<Shape>,
}

/// An object in the scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Instance {
    /// Index into [`Scene::objects`].
    pub object: u32,
    /// From the object's space to the world.
    pub to_world: Transform,
}

impl Scene {
    /// The box in world space that everything lies in; that of objects as their boxes are placed.
    pub fn bounds(&self) -> Aabb {
        let placed = self
            .instances
            .iter()
            .map(|instance| self.bounds_of(instance));
        placed.fold(self.mesh.bounds(), |all, bounds| all.union(&bounds))
    }

    /// The box in world space around the box of an instance's object.
    pub fn bounds_of(&self, instance: &Instance) -> Aabb {
        let own = self.objects[instance.object as usize].mesh.bounds();
        if own.is_empty() {
            return own;
        }
        let ends = [own.min, own.max];
        Aabb::of_points((0..8_usize).map(|corner| {
            let p = std::array::from_fn(|axis| ends[corner >> axis & 1][axis]);
            instance.to_world.point(p)
        }))
    }

    /// All meshes: the scene's own, then those of the objects.
    pub fn meshes(&self) -> impl Iterator<Item = &Mesh> {
        std::iter::once(&self.mesh).chain(self.objects.iter().map(|object| &object.mesh))
    }

    /// How many triangles there are to be seen: those of an object as often as it is there.
    pub fn triangles(&self) -> u64 {
        let of = |mesh: &Mesh| mesh.triangles().len() as u64;
        let placed = self
            .instances
            .iter()
            .map(|instance| of(&self.objects[instance.object as usize].mesh));
        of(&self.mesh) + placed.sum::<u64>()
    }
}

/// A range of triangles with the same material and light.
#[derive(Clone, Debug)]
pub struct Shape {
    /// The triangles, as indices into the mesh.
    pub triangles: Range<u32>,
    /// Index into [`Scene::materials`].
    pub material: u32,
    /// The light that the shape's triangles give off, if any.
    pub area_light: Option<AreaLight>,
    /// The vertices have shading normals.
    pub has_normals: bool,
    /// The vertices have texture coordinates.
    pub has_uvs: bool,
    /// Geometric normals point the other way (ReverseOrientation, or a transform that changes
    /// handedness; not both). Where there are shading normals, those decide instead, as in pbrt-v3:
    /// geometric normals point to their side (ReverseOrientation is applied to them already).
    pub flip_normals: bool,
    /// What the triangles stand for.
    pub surface: Surface,
    /// Where this texture is 0 there is no surface, for any ray.
    pub alpha: Option<TextureRef>,
    /// Where this texture is 0 there is no surface for shadow rays.
    pub shadow_alpha: Option<TextureRef>,
}

/// What the triangles of a shape stand for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Surface {
    /// Themselves.
    Flat,
    /// A curved surface: tangents follow it.
    Curved,
    /// A sphere; where it shines it is one light, not one a triangle.
    Sphere {
        /// In world space.
        center: [f32; 3],
        /// In world space.
        radius: f32,
    },
    /// A disk; where it shines it is one light.
    Disk {
        /// In world space.
        center: [f32; 3],
        /// From the centre to two points of the edge, in world space.
        axes: [[f32; 3]; 2],
    },
}

/// What a scene's file holds, for people.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Contents {
    /// What the file is, e.g. `pbrt-v3`.
    pub format: String,
    /// How many there are of each kind of thing, e.g. `shape` and `sphere`.
    pub kinds: BTreeMap<(&'static str, String), u64>,
    /// Triangles of all shapes, those of an object once.
    pub unique_triangles: u64,
    /// Copies of objects in the scene.
    pub instances: u64,
    /// Triangles of those copies.
    pub instanced_triangles: u64,
    /// Images that are there, in the order of their first use.
    pub images: Vec<PathBuf>,
    /// All files that were read, images among them, or that the scene names and that are there; in
    /// the order of their names.
    pub files: BTreeSet<PathBuf>,
}

impl Contents {
    pub(crate) fn count(&mut self, what: &'static str, kind: &str) {
        *self.kinds.entry((what, kind.to_owned())).or_default() += 1;
    }
}

/// Something that a reader of the scene's picture or figures should know.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Note {
    /// Where: `file:line:column`, or the file.
    pub place: String,
    /// What.
    pub text: String,
    /// Whether the scene is rendered otherwise than its file says.
    pub warning: bool,
}

/// How scenes are looked for and read.
#[derive(Clone, Debug, Default)]
pub struct LoadOptions {
    /// The values of `$name` in files that are templates.
    pub defines: BTreeMap<String, String>,
    /// Folders in which scenes, and the files that they name, are looked for.
    pub search: Vec<PathBuf>,
    /// How often `loopsubdiv` surfaces are subdivided, at most 16, in place of what the file says.
    /// 0: the control mesh, its vertices moved to the limit surface.
    pub subdivision_levels: Option<u32>,
    /// What becomes of copies of objects.
    pub instances: Instancing,
}

/// What becomes of copies of objects.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Instancing {
    /// They become a part of [`Scene::mesh`], so that one tree has all of the scene.
    #[default]
    Flattened,
    /// They are [`Scene::instances`]: each object is in memory once, with a tree of its own.
    Kept,
}

/// Reads a scene: a file of pbrt-v3 or pbrt-v4 (`.pbrt`, `.pbrt.gz`), of glTF 2.0 (`.gltf`, `.glb`),
/// a mesh (`.ply`, `.ply.gz`, `.obj`, `.stl`), or a scene by its name; see [`library`].
///
/// # Errors
/// There is no such scene, or its files are wrong; the error tells where, and what would be
/// accepted. Or the options have what only files of pbrt take: definitions, levels of subdivision.
pub fn load(name_or_path: &str, options: &LoadOptions) -> Result<Scene, SceneError> {
    let search = library::search_path(&options.search);
    let found = library::resolve(name_or_path, &search)?;
    let is_pbrt =
        matches!(&found, library::Resolved::File { path, .. } if ends_in(path, pbrt::ENDINGS));
    if !is_pbrt && (!options.defines.is_empty() || options.subdivision_levels.is_some()) {
        return Err(SceneError::file(
            name_or_path,
            "it is no .pbrt file, and only those have definitions and surfaces to subdivide; leave \
             out --define and --subdivide",
        ));
    }
    let (path, name) = match found {
        library::Resolved::BuiltIn { name, size } => return library::build(name, size),
        library::Resolved::File { path, name } => (path, name),
    };
    let mut scene = if ends_in(&path, gltf_file::ENDINGS) {
        gltf_file::load(&path, &name)
    } else if ends_in(&path, mesh_file::ENDINGS) {
        mesh_file::load(&path, &name)
    } else if is_pbrt {
        let options = LoadOptions {
            search,
            ..options.clone()
        };
        pbrt::load(&path, &name, &options)
    } else {
        let endings = library::endings();
        Err(SceneError::file(
            path.display().to_string(),
            format!("this is no kind of file that is read; {endings}"),
        ))
    }?;
    let contents = &mut scene.contents;
    contents.files.extend(contents.images.iter().cloned());
    contents.files.insert(path.clone());
    let nothing = |mesh: &Mesh| mesh.usable_triangles().is_empty();
    if scene.triangles() > 0 && scene.meshes().all(nothing) {
        scene.notes.push(Note {
            place: path.display().to_string(),
            text: "there is nothing to see: all triangles are without area or not finite"
                .to_owned(),
            warning: true,
        });
    }
    Ok(scene)
}

/// Whether a file's name ends in one of these, in upper or lower case.
fn ends_in(path: &Path, endings: &[&str]) -> bool {
    let name = path.to_string_lossy().to_ascii_lowercase();
    endings.iter().any(|ending| name.ends_with(ending))
}
