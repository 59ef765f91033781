//! glTF 2.0 and GLB: meshes, nodes, cameras, lights and the core of its materials.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use base64::Engine;
use glam::{DMat4, DVec3};
use gltf::camera::Projection as GltfProjection;
use gltf::khr_lights_punctual::Kind;
use gltf::material::AlphaMode;
use gltf::mesh::Mode;

use super::geometry::{Geometry, LocalSurface, Notes, Placed};
use super::image_file::{Channels, Decoding, Images};
use super::light::{AreaLight, Light};
use super::material::Material;
use super::pbrt::shortened;
use super::texture::{ImageFilter, Mapping, Texture, TextureRef, Wrap};
use super::view::{self, Up, color};
use super::{Contents, Scene};
use crate::error::SceneError;
use crate::scene::camera::Camera;
use crate::transform::Transform;

/// The endings of the files that can be read, in lower case.
pub(crate) const ENDINGS: &[&str] = &[".gltf", ".glb"];

/// The extensions that are understood.
const EXTENSIONS: [&str; 4] = [
    "KHR_lights_punctual",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_transmission",
];

/// Nodes inside each other at most.
const DEEPEST: usize = 256;

struct Reader<'a> {
    file: String,
    folder: &'a Path,
    document: &'a gltf::Document,
    buffers: Vec<Vec<u8>>,
    images: Images,
    notes: Notes,
    contents: Contents,
    /// The triangles of every primitive of every mesh.
    primitives: Vec<Vec<Option<Arc<Geometry>>>>,
    pieces: Vec<Placed>,
    lights: Vec<Light>,
    camera: Option<(Camera, f32)>,
    /// There is a camera that shows nothing.
    unusable_camera: bool,
}

/// What a glTF material is here.
struct Surface {
    material: Material,
    emitted: [f32; 3],
    two_sided: bool,
    alpha: Option<TextureRef>,
}

/// Reads the file at `path` as a scene.
pub(crate) fn load(path: &Path, name: &str) -> Result<Scene, SceneError> {
    let file = path.display().to_string();
    let wrong = |reason: String| SceneError::file(&file, reason);
    let bytes = std::fs::read(path).map_err(|error| wrong(format!("cannot be read: {error}")))?;
    let gltf = gltf::Gltf::from_slice(&bytes)
        .map_err(|error| wrong(format!("not a glTF file that can be read: {error}")))?;
    let mut reader = Reader {
        file: file.clone(),
        folder: path.parent().unwrap_or(Path::new("")),
        document: &gltf.document,
        buffers: vec![],
        images: Images::default(),
        notes: Notes::default(),
        contents: Contents {
            format: "glTF 2.0".to_owned(),
            ..Contents::default()
        },
        primitives: vec![],
        pieces: vec![],
        lights: vec![],
        camera: None,
        unusable_camera: false,
    };
    for extension in gltf.document.extensions_used() {
        if !EXTENSIONS.contains(&extension) {
            let extension = shortened(extension);
            reader.warn(&format!(
                "the extension {extension} is not supported; rendered without"
            ));
        }
    }
    reader.read_buffers(gltf.blob.as_deref())?;
    let surfaces: Vec<Surface> = gltf
        .document
        .materials()
        .map(|material| reader.surface(&material))
        .chain([Surface {
            material: view::matte([0.8; 3]),
            emitted: [0.0; 3],
            two_sided: true,
            alpha: None,
        }])
        .collect();
    for mesh in gltf.document.meshes() {
        let primitives = mesh.primitives();
        let read: Result<Vec<_>, SceneError> = primitives
            .map(|primitive| reader.primitive(&primitive))
            .collect();
        reader.primitives.push(read?);
    }
    let scenes = gltf.document.scenes();
    let default = gltf.document.default_scene();
    if default.is_none() && scenes.len() > 1 {
        let text = format!(
            "of {} scenes none is the default; the first is taken",
            scenes.len()
        );
        reader.notes.tell(file.clone(), text);
    }
    let scene = default.or_else(|| gltf.document.scenes().next());
    match scene {
        Some(scene) => {
            for node in scene.nodes() {
                reader.node(&node, DMat4::IDENTITY, &surfaces, 0)?;
            }
        }
        None => return Err(wrong("has no scene to show".to_owned())),
    }
    reader.finish(name, surfaces)
}

impl Reader<'_> {
    fn wrong(&self, reason: impl Into<String>) -> SceneError {
        SceneError::file(&self.file, reason)
    }

    fn warn(&mut self, text: &str) {
        let file = &self.file;
        self.notes.warn(text, || file.clone(), text.to_owned());
    }

    fn read_buffers(&mut self, blob: Option<&[u8]>) -> Result<(), SceneError> {
        for buffer in self.document.buffers() {
            let bytes = match buffer.source() {
                gltf::buffer::Source::Bin => blob.map(<[u8]>::to_vec),
                gltf::buffer::Source::Uri(uri) => self.bytes_of(uri),
            };
            match bytes {
                Some(bytes) if bytes.len() >= buffer.length() => self.buffers.push(bytes),
                _ => {
                    return Err(self.wrong(format!(
                        "buffer {} is absent or shorter than the {} bytes that it announces",
                        buffer.index(),
                        buffer.length()
                    )));
                }
            }
        }
        Ok(())
    }

    /// The content of a file beside this one, or of a `data:` address.
    fn bytes_of(&mut self, uri: &str) -> Option<Vec<u8>> {
        match uri.strip_prefix("data:") {
            Some(data) => base64::engine::general_purpose::STANDARD
                .decode(data.split_once(";base64,")?.1)
                .ok(),
            None => {
                let path = self.path_of(uri);
                let bytes = std::fs::read(&path).ok();
                self.contents.files.insert(path);
                bytes
            }
        }
    }

    fn path_of(&self, uri: &str) -> PathBuf {
        // Spaces and the like are written as %20.
        let mut plain = Vec::new();
        let mut rest = uri.as_bytes();
        while let Some((&first, after)) = rest.split_first() {
            let code = after.get(..2).and_then(|hex| std::str::from_utf8(hex).ok());
            match code.and_then(|hex| u8::from_str_radix(hex, 16).ok()) {
                Some(byte) if first == b'%' => {
                    plain.push(byte);
                    rest = &after[2..];
                }
                _ => {
                    plain.push(first);
                    rest = after;
                }
            }
        }
        self.folder.join(String::from_utf8_lossy(&plain).as_ref())
    }

    fn texture(&mut self, texture: &gltf::Texture<'_>, channels: Channels) -> TextureRef {
        let wrap = match texture.sampler().wrap_s() {
            gltf::texture::WrappingMode::ClampToEdge => Wrap::Clamp,
            _ => Wrap::Repeat,
        };
        let decoding = Decoding {
            srgb: channels == Channels::Color,
            channels,
            wrap,
        };
        let image = texture.source();
        let path = match image.source() {
            gltf::image::Source::Uri { uri, .. } if !uri.starts_with("data:") => self.path_of(uri),
            source => {
                let bytes = match source {
                    gltf::image::Source::Uri { uri, .. } => self.bytes_of(uri),
                    gltf::image::Source::View { view, .. } => self
                        .buffers
                        .get(view.buffer().index())
                        .and_then(|buffer| buffer.get(view.offset()..view.offset() + view.length()))
                        .map(<[u8]>::to_vec),
                };
                let name = PathBuf::from(format!("{}#image{}", self.file, image.index()));
                self.images.embed(&name, bytes.unwrap_or_default().into());
                name
            }
        };
        Arc::new(Texture::Image {
            image: self.images.get(&path, decoding),
            // The image's upper edge is at 0.
            mapping: Mapping::Uv {
                scale: [1.0, -1.0],
                shift: [0.0, 1.0],
            },
            filter: ImageFilter::DEFAULT,
            scale: 1.0,
        })
    }

    fn surface(&mut self, material: &gltf::Material<'_>) -> Surface {
        let pbr = material.pbr_metallic_roughness();
        let [r, g, b, opacity] = pbr.base_color_factor();
        let mut base = color([r, g, b]);
        let mut alpha = None;
        if let Some(info) = pbr.base_color_texture() {
            let image = self.texture(&info.texture(), Channels::Color);
            base = Arc::new(Texture::Scale(base, image));
            if material.alpha_mode() != AlphaMode::Opaque {
                alpha = Some(self.texture(&info.texture(), Channels::Alpha));
            }
        }
        if pbr.metallic_roughness_texture().is_some() {
            self.warn("textures of metal and roughness are not supported; their factors are used");
        }
        if material.normal_texture().is_some() {
            self.warn("normal maps are not supported; rendered without");
        }
        let threshold = match material.alpha_mode() {
            AlphaMode::Mask => Some(material.alpha_cutoff().unwrap_or(0.5)),
            AlphaMode::Blend => {
                self.warn("blended alpha is not supported; cut out where it is below one half");
                Some(0.5)
            }
            AlphaMode::Opaque => None,
        };
        let alpha = threshold.map(|threshold| {
            let texture = alpha.unwrap_or_else(|| color([1.0; 3]));
            Arc::new(Texture::AtLeast {
                texture: Arc::new(Texture::Scale(color([opacity; 3]), texture)),
                threshold,
            })
        });
        let width = pbr.roughness_factor().powi(2).max(1e-3);
        let roughness = [color([width; 3]), color([width; 3])];
        let transmitted = material
            .transmission()
            .map_or(0.0, |transmission| transmission.transmission_factor());
        let metallic = pbr.metallic_factor();
        let found = if transmitted > 0.5 {
            let smooth = pbr.roughness_factor() < 0.02;
            Material::Glass {
                kr: color([1.0; 3]),
                kt: base,
                eta: color([material.ior().unwrap_or(1.5); 3]),
                roughness: if smooth {
                    [color([0.0; 3]), color([0.0; 3])]
                } else {
                    roughness
                },
                remap_roughness: false,
            }
        } else {
            Material::Substrate {
                kd: Arc::new(Texture::Scale(color([1.0 - metallic; 3]), base.clone())),
                ks: Arc::new(Texture::Mix {
                    from: color([0.04; 3]),
                    to: base,
                    amount: color([metallic; 3]),
                }),
                roughness,
                remap_roughness: false,
            }
        };
        if material.emissive_texture().is_some() {
            self.warn("textures of emission are not supported; its factor is used everywhere");
        }
        let strength = material.emissive_strength().unwrap_or(1.0);
        self.contents.count("material", "metallic-roughness");
        Surface {
            material: found,
            emitted: material.emissive_factor().map(|c| c * strength),
            two_sided: material.double_sided(),
            alpha,
        }
    }

    fn primitive(
        &mut self,
        primitive: &gltf::Primitive<'_>,
    ) -> Result<Option<Arc<Geometry>>, SceneError> {
        // The library trusts what the file says of its buffers.
        let fits = |accessor: &gltf::Accessor<'_>| {
            let Some(view) = accessor.view() else {
                return accessor.sparse().is_none();
            };
            let stride = view.stride().unwrap_or(accessor.size());
            let length = match accessor.count() {
                0 => 0,
                count => stride
                    .saturating_mul(count - 1)
                    .saturating_add(accessor.size()),
            };
            accessor.sparse().is_none()
                && accessor.offset().saturating_add(length) <= view.length()
                && self
                    .buffers
                    .get(view.buffer().index())
                    .is_some_and(|b| view.offset().saturating_add(view.length()) <= b.len())
        };
        let accessors = primitive.attributes().map(|(_, accessor)| accessor);
        if !accessors.chain(primitive.indices()).all(|a| fits(&a)) {
            return Err(self.wrong(
                "an accessor reaches beyond its buffer, or is sparse, which is not supported",
            ));
        }
        let reader = primitive.reader(|buffer| self.buffers.get(buffer.index()).map(Vec::as_slice));
        let Some(positions) = reader.read_positions() else {
            return Ok(None);
        };
        let positions: Vec<[f32; 3]> = positions.collect();
        if !positions.iter().flatten().all(|c| c.is_finite()) {
            return Err(self.wrong("a vertex is not finite"));
        }
        let count = positions.len() as u32;
        let indices: Vec<u32> = match reader.read_indices() {
            Some(indices) => indices.into_u32().collect(),
            None => (0..count).collect(),
        };
        if indices.iter().any(|&index| index >= count) {
            return Err(self.wrong("a triangle names a vertex that is not there"));
        }
        let triangles: Vec<[u32; 3]> = match primitive.mode() {
            Mode::Triangles => indices
                .chunks_exact(3)
                .map(|t| [t[0], t[1], t[2]])
                .collect(),
            Mode::TriangleStrip => (0..)
                .zip(indices.windows(3))
                .map(|(i, t)| {
                    if i % 2 == 0 {
                        [t[0], t[1], t[2]]
                    } else {
                        [t[1], t[0], t[2]]
                    }
                })
                .collect(),
            Mode::TriangleFan => indices
                .get(1..)
                .unwrap_or_default()
                .windows(2)
                .map(|t| [indices[0], t[0], t[1]])
                .collect(),
            _ => {
                self.warn("points and lines are not supported; rendered without");
                return Ok(None);
            }
        };
        let normals: Vec<_> = reader.read_normals().into_iter().flatten().collect();
        let uvs: Vec<_> = reader
            .read_tex_coords(0)
            .into_iter()
            .flat_map(|uvs| uvs.into_f32())
            .collect();
        let whole = |given: usize| given == positions.len();
        if reader.read_colors(0).is_some() {
            self.warn("colours of vertices are not supported in glTF; rendered without");
        }
        if primitive.morph_targets().len() > 0 {
            self.warn("morph targets are not supported; rendered as the mesh is");
        }
        Ok(Some(Arc::new(Geometry {
            normals: if whole(normals.len()) {
                normals
            } else {
                vec![]
            },
            uvs: if whole(uvs.len()) { uvs } else { vec![] },
            positions,
            triangles,
        })))
    }

    fn node(
        &mut self,
        node: &gltf::Node<'_>,
        parent: DMat4,
        surfaces: &[Surface],
        depth: usize,
    ) -> Result<(), SceneError> {
        if depth > DEEPEST {
            return Err(self.wrong(format!("nodes lie more than {DEEPEST} deep in each other")));
        }
        let local = node
            .transform()
            .matrix()
            .map(|column| column.map(f64::from));
        let matrix = parent * DMat4::from_cols_array_2d(&local);
        let Some(to_world) = Transform::from_matrix(matrix) else {
            self.warn("a node whose transform cannot be undone is left out");
            return Ok(());
        };
        if node.skin().is_some() {
            self.warn("skins are not supported; rendered in the pose of the file");
        }
        if let Some(mesh) = node.mesh() {
            for (i, primitive) in mesh.primitives().enumerate() {
                let found = self.primitives.get(mesh.index()).and_then(|p| p.get(i));
                let Some(Some(geometry)) = found else {
                    continue;
                };
                self.contents.count("shape", "primitive");
                let number = primitive.material().index().unwrap_or(surfaces.len() - 1);
                let surface = &surfaces[number.min(surfaces.len() - 1)];
                let shines = surface.emitted.iter().any(|&c| c > 0.0);
                self.pieces.push(Placed {
                    geometry: Arc::clone(geometry),
                    to_world,
                    reversed: false,
                    material: number as u32,
                    area_light: shines.then_some(AreaLight {
                        radiance: surface.emitted,
                        two_sided: surface.two_sided,
                        after: self.lights.len() as u32,
                    }),
                    surface: LocalSurface::Flat,
                    alpha: surface.alpha.clone(),
                    shadow_alpha: None,
                });
            }
        }
        if let Some(light) = node.light() {
            self.light(&light, &to_world);
        }
        if let (Some(camera), None) = (node.camera(), &self.camera) {
            self.camera(&camera, matrix);
        }
        for child in node.children() {
            self.node(&child, matrix, surfaces, depth + 1)?;
        }
        Ok(())
    }

    fn light(&mut self, light: &gltf::khr_lights_punctual::Light<'_>, to_world: &Transform) {
        let intensity = light.color().map(|c| c * light.intensity());
        let position = to_world.point([0.0; 3]);
        let along =
            glam::Vec3::from(to_world.vector([0.0, 0.0, -1.0])).normalize_or(-glam::Vec3::Z);
        let (kind, light) = match light.kind() {
            Kind::Point => (
                "point",
                Light::Point {
                    position,
                    intensity,
                },
            ),
            Kind::Directional => (
                "directional",
                Light::Distant {
                    towards: (-along).into(),
                    radiance: intensity,
                },
            ),
            Kind::Spot {
                inner_cone_angle,
                outer_cone_angle,
            } => (
                "spot",
                Light::Spot {
                    position,
                    direction: along.into(),
                    intensity,
                    cos_inner: inner_cone_angle.cos(),
                    cos_outer: outer_cone_angle.cos(),
                },
            ),
        };
        self.contents.count("light", kind);
        self.lights.push(light);
    }

    fn camera(&mut self, camera: &gltf::Camera<'_>, matrix: DMat4) {
        // glTF's cameras look along -z.
        let turned = matrix * DMat4::from_scale(DVec3::new(1.0, 1.0, -1.0));
        let default_aspect = view::WIDTH as f32 / view::HEIGHT as f32;
        let mut found = view::look(DVec3::ZERO, DVec3::Z, DVec3::Y, 40.0);
        let (aspect, near, far) = match camera.projection() {
            GltfProjection::Perspective(perspective) => {
                let aspect = perspective.aspect_ratio().unwrap_or(default_aspect);
                // Ours is along the shorter side.
                let half = (perspective.yfov() / 2.0).tan() * aspect.min(1.0);
                found.fov = 2.0 * half.atan().to_degrees();
                (aspect, perspective.znear(), perspective.zfar())
            }
            GltfProjection::Orthographic(view) => {
                let (x, y) = (view.xmag(), view.ymag());
                found.projection = super::camera::Projection::Orthographic;
                found.screen_window = Some([-x, x, -y, y]);
                ((x / y).abs(), view.znear(), Some(view.zfar()))
            }
        };
        let sees = found.fov > 0.0 && found.fov < 180.0 && aspect > 1e-2 && aspect < 1e2;
        match Transform::from_matrix(turned) {
            Some(camera_to_world) if sees && far.is_none_or(|far| far >= near) => {
                found.camera_to_world = camera_to_world;
                self.contents.count("camera", "camera");
                self.camera = Some((found, aspect));
            }
            _ => self.unusable_camera = true,
        }
    }

    fn finish(mut self, name: &str, surfaces: Vec<Surface>) -> Result<Scene, SceneError> {
        let shines = self.pieces.iter().any(|piece| piece.area_light.is_some());
        for (path, reason) in self.images.read() {
            let path = path.display().to_string();
            self.notes.warn(
                &path,
                || path.clone(),
                format!("the image cannot be read ({reason}); rendered white"),
            );
        }
        let file = self.file.clone();
        if self.unusable_camera {
            let instead = match self.camera {
                Some(_) => "another one is used",
                None => "one was chosen to suit the scene",
            };
            self.warn(&format!(
                "a camera cannot be used (its field of view or extent is none, or zfar lies before \
                 znear); {instead}"
            ));
        }
        let has_camera = self.camera.is_some() || self.unusable_camera;
        if !has_camera || self.lights.is_empty() && !shines {
            self.notes.tell(
                file.clone(),
                "a camera or light that is not there was chosen to suit the scene".to_owned(),
            );
        }
        let (camera, lights) = (self.camera.take(), std::mem::take(&mut self.lights));
        let aspect = camera.as_ref().map(|(_, aspect)| *aspect);
        let fit = |mesh: &splitplane::Mesh| {
            let camera = camera.map_or_else(
                || {
                    let towards_eye = DVec3::new(0.62, 0.42, 0.8);
                    view::fitted(&mesh.bounds(), mesh.positions(), towards_eye, Up::Y)
                },
                |(camera, _)| camera,
            );
            let lights = if lights.is_empty() && !shines {
                view::daylight(DVec3::new(-0.3, 0.9, 0.6))
            } else {
                lights
            };
            (camera, lights)
        };
        let materials = surfaces.into_iter().map(|s| s.material).collect();
        let notes = self.notes.into_list();
        let mut scene = view::scene(name, self.pieces, materials, fit, notes)
            .map_err(|message| SceneError::file(&file, message))?;
        if let Some(aspect) = aspect {
            scene.film.width = ((view::HEIGHT as f32 * aspect).round() as u32).max(1);
        }
        self.contents.unique_triangles = scene.contents.unique_triangles;
        self.contents.images = self.images.paths().map(Path::to_owned).collect();
        scene.contents = self.contents;
        Ok(scene)
    }
}
