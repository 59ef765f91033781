//! From directives to a scene.

mod finish;

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::rc::Rc;

use glam::{DMat4, DVec3};

use super::directive::{Directive, Parser, Word};
use super::lexer::shortened;
use super::materials::{self, Definition, NamedMaterials};
use super::params::{Param, Params, Values};
use super::settings::{self, Settings};
use super::shapes::{self, Source};
use super::source::Span;
use super::textures::{Maker, NamedTextures, constant};
use super::{lights, textures};
use crate::error::SceneError;
use crate::scene::geometry::Notes;
use crate::scene::image_file::Images;
use crate::scene::light::{AreaLight, Light};
use crate::scene::material::Material;
use crate::scene::settings::{Filter, SamplerKind};
use crate::scene::texture::{Texture, TextureRef};
use crate::scene::{Contents, Instancing, LoadOptions, Scene};
use crate::transform::Transform;

/// What directives change and blocks bring back.
#[derive(Clone, Debug)]
struct State {
    to_world: Transform,
    /// Transform directives apply to the start of the animation; pictures are of that time.
    at_start: bool,
    reversed: bool,
    material: Rc<Definition>,
    area_light: Option<AreaLight>,
    textures: Rc<NamedTextures>,
    named_materials: Rc<NamedMaterials>,
    /// pbrt-v4: what parameters are given for, and the parameters.
    attributes: Vec<(String, Param)>,
}

/// A block that is open: its first directive and the state before it.
#[derive(Debug)]
struct Block {
    word: Word,
    span: Span,
    before: State,
}

/// A shape in the world, or in an object that is to be placed.
#[derive(Clone, Debug)]
struct Piece {
    source: Source,
    span: Span,
    to_world: Transform,
    reversed: bool,
    material: u32,
    area_light: Option<AreaLight>,
    alpha: Option<TextureRef>,
    shadow_alpha: Option<TextureRef>,
    /// A copy of a shape of an object.
    is_instance: bool,
}

/// A copy of an object that is kept as one.
struct Copied {
    /// Index into [`World::placed`].
    object: u32,
    to_world: Transform,
}

struct World<'a> {
    parser: Parser<'a>,
    notes: Notes,
    images: Images,
    contents: Contents,
    settings: Settings,
    state: State,
    blocks: Vec<Block>,
    /// Where WorldBegin stands.
    world: Option<Span>,
    ended: bool,
    pieces: Vec<Piece>,
    objects: HashMap<String, Rc<Vec<Piece>>>,
    /// Objects that are kept and have copies, in the order of their first.
    placed: Vec<Rc<Vec<Piece>>>,
    copies: Vec<Copied>,
    /// The object that is being defined.
    object: Option<(String, Vec<Piece>)>,
    /// How many instances there are, and where the first is.
    instances: Option<(usize, Span)>,
    materials: Vec<Material>,
    lights: Vec<Light>,
    /// Lights that may have a square map of all directions, and where they are.
    sphere_maps: Vec<(usize, Span)>,
    coordinate_systems: HashMap<String, Transform>,
    /// In place of what the file says; see [`LoadOptions`].
    subdivision_levels: Option<u32>,
    instancing: Instancing,
}

/// Reads the pbrt-v3 scene at `path`.
pub(crate) fn load(path: &Path, name: &str, options: &LoadOptions) -> Result<Scene, SceneError> {
    let matte = Material::Matte {
        kd: constant([0.5; 3]),
        sigma: constant([0.0; 3]),
    };
    let start = Span { file: 0, offset: 0 };
    let definition = Definition {
        kind: "matte".to_owned(),
        params: Params::default(),
        span: start,
        index: 0,
    };
    let mut world = World {
        parser: Parser::new(path, &options.defines, &options.search)?,
        notes: Notes::default(),
        images: Images::default(),
        contents: Contents {
            format: "pbrt-v3".to_owned(),
            ..Contents::default()
        },
        settings: Settings::default(),
        state: State {
            to_world: Transform::IDENTITY,
            at_start: true,
            reversed: false,
            material: Rc::new(definition),
            area_light: None,
            textures: Rc::default(),
            named_materials: Rc::default(),
            attributes: Vec::new(),
        },
        blocks: Vec::new(),
        world: None,
        ended: false,
        pieces: Vec::new(),
        objects: HashMap::new(),
        placed: Vec::new(),
        copies: Vec::new(),
        object: None,
        instances: None,
        materials: vec![matte],
        lights: Vec::new(),
        sphere_maps: Vec::new(),
        coordinate_systems: HashMap::new(),
        subdivision_levels: options.subdivision_levels,
        instancing: options.instances,
    };
    if world.parser.is_v4 {
        world.contents.format = "pbrt-v4".to_owned();
        // Its defaults, in pbrt-v3's words.
        world.settings.filter = Filter::Gaussian {
            radius: [1.5; 2],
            alpha: 2.0,
        };
        world.settings.sampler.kind = SamplerKind::Sobol;
    }
    if world.parser.is_part {
        // The camera that is chosen for it looks at the mesh.
        world.instancing = Instancing::Flattened;
        world.world = Some(start);
        let place = world.parser.sources.place(start);
        let text = "a part of a scene, without camera or light; they were chosen to suit it";
        world.notes.tell(place, text.to_owned());
    }
    while let Some(directive) = world.parser.next()? {
        if world.ended {
            let place = world.parser.sources.place(directive.span);
            world.notes.warn(
                "after the end",
                || place,
                "what follows the first WorldEnd is not read".to_owned(),
            );
            break;
        }
        world.report_missing();
        world.take(directive)?;
    }
    world.report_missing();
    world.finish(name)
}

impl World<'_> {
    fn error(&self, span: Span, message: impl Into<String>) -> SceneError {
        self.parser.error(span, message)
    }

    fn warn(&mut self, kind: &str, span: Span, text: String) {
        let sources = &self.parser.sources;
        self.notes.warn(kind, || sources.place(span), text);
    }

    /// Runs `make` with what it takes to make textures, materials and lights.
    fn with_maker<T>(
        &mut self,
        make: impl FnOnce(&mut Maker<'_>, &mut Vec<Material>) -> Result<T, SceneError>,
    ) -> Result<T, SceneError> {
        let parser = &self.parser;
        let find = |name: &str, span: Span| -> Option<PathBuf> { parser.find(name, span) };
        let textures = Rc::clone(&self.state.textures);
        let mut maker = Maker {
            s: &parser.sources,
            notes: &mut self.notes,
            images: &mut self.images,
            textures: &textures,
            find: &find,
        };
        make(&mut maker, &mut self.materials)
    }

    fn take(&mut self, mut d: Directive) -> Result<(), SceneError> {
        self.check_section(&d)?;
        // pbrt-v4: parameters that are given for all directives of a kind.
        for (of, param) in &self.state.attributes {
            let applies = match of.as_str() {
                "shape" => d.word == Word::Shape,
                "light" => matches!(d.word, Word::LightSource | Word::AreaLightSource),
                "material" => matches!(d.word, Word::Material | Word::MakeNamedMaterial),
                "texture" => d.word == Word::Texture,
                _ => false,
            };
            if applies && !d.params.has(&param.name) {
                d.params.list.push(param.clone());
            }
        }
        self.count(&d);
        let s = &self.parser.sources;
        match d.word {
            Word::Accelerator => {
                self.settings.accelerator = settings::accelerator(s, &d, &mut self.notes)?;
            }
            Word::Camera => {
                let camera = settings::camera(s, &d, &self.state.to_world, &mut self.notes)?;
                self.coordinate_systems
                    .insert("camera".to_owned(), camera.camera_to_world);
                self.settings.camera = camera;
            }
            Word::Film => self.settings.film = settings::film(s, &d, &mut self.notes)?,
            Word::Integrator => {
                self.settings.integrator = settings::integrator(s, &d, &mut self.notes)?;
            }
            Word::PixelFilter => self.settings.filter = settings::filter(s, &d, &mut self.notes)?,
            Word::Sampler => self.settings.sampler = settings::sampler(s, &d, &mut self.notes)?,

            Word::Identity
            | Word::Translate
            | Word::Scale
            | Word::Rotate
            | Word::LookAt
            | Word::Transform
            | Word::ConcatTransform => self.transform(&d)?,
            Word::CoordinateSystem => {
                self.coordinate_systems
                    .insert(d.name().to_owned(), self.state.to_world);
            }
            Word::CoordSysTransform => match self.coordinate_systems.get(d.name()) {
                Some(transform) => self.state.to_world = *transform,
                None => {
                    let mut names: Vec<_> = self
                        .coordinate_systems
                        .keys()
                        .map(|name| format!("\"{name}\""))
                        .collect();
                    names.sort();
                    return Err(self.error(
                        d.span,
                        format!(
                            "there is no coordinate system \"{}\"; there are {}",
                            shortened(d.name()),
                            textures::shortened_list(&names)
                        ),
                    ));
                }
            },
            Word::ActiveTransform => {
                self.state.at_start = match d.name() {
                    "All" | "StartTime" => true,
                    "EndTime" => false,
                    other => {
                        return Err(self.error(
                            d.span,
                            format!(
                                "ActiveTransform takes All, StartTime or EndTime, not `{}`",
                                shortened(other)
                            ),
                        ));
                    }
                };
                self.moving(d.span);
            }
            Word::TransformTimes => self.moving(d.span),

            Word::AttributeBegin | Word::TransformBegin => self.begin(&d),
            Word::AttributeEnd => self.end(&d, Word::AttributeBegin)?,
            Word::TransformEnd => self.end(&d, Word::TransformBegin)?,
            Word::ObjectBegin => {
                if let Some(block) = self.blocks.iter().find(|b| b.word == Word::ObjectBegin) {
                    let place = self.parser.sources.place(block.span);
                    return Err(self.error(
                        d.span,
                        format!("objects do not nest; the one of {place} has no ObjectEnd yet"),
                    ));
                }
                self.begin(&d);
                self.object = Some((d.name().to_owned(), Vec::new()));
            }
            Word::ObjectEnd => {
                self.end(&d, Word::ObjectBegin)?;
                if let Some((name, pieces)) = self.object.take() {
                    self.objects.insert(name, Rc::new(pieces));
                }
            }
            Word::ObjectInstance => self.instance(&d)?,
            Word::WorldBegin => {
                self.world = Some(d.span);
                self.state.to_world = Transform::IDENTITY;
                self.state.at_start = true;
                self.coordinate_systems
                    .insert("world".to_owned(), Transform::IDENTITY);
            }
            Word::WorldEnd => {
                if let Some(block) = self.blocks.last() {
                    return Err(self.not_closed(block));
                }
                self.ended = true;
            }

            Word::Attribute => {
                d.params.ignore_all();
                for param in &d.params.list {
                    self.state
                        .attributes
                        .push((d.name().to_owned(), param.clone()));
                }
            }
            Word::ColorSpace => {
                if d.name() != "srgb" {
                    let text = format!(
                        "the colour space \"{}\" is not supported; colours are taken as sRGB's",
                        shortened(d.name())
                    );
                    self.warn("color space", d.span, text);
                }
            }
            Word::ReverseOrientation => self.state.reversed = !self.state.reversed,
            Word::MakeNamedMedium | Word::MediumInterface => {
                d.params.ignore_all();
                self.warn(
                    "medium",
                    d.span,
                    "participating media are not supported; rendered as vacuum".to_owned(),
                );
            }
            Word::LightSource => {
                let to_world = self.state.to_world;
                let is_v4 = self.parser.is_v4;
                let light =
                    self.with_maker(|maker, _| lights::light(maker, &d, &to_world, is_v4))?;
                if is_v4
                    && matches!(
                        light,
                        Some(Light::Infinite { .. } | Light::Goniometric { .. })
                    )
                {
                    self.sphere_maps.push((self.lights.len(), d.span));
                }
                self.lights.extend(light);
            }
            Word::AreaLightSource => {
                self.state.area_light =
                    self.with_maker(|maker, _| lights::area_light(maker, &d))?;
            }
            Word::Texture => self.texture(&d)?,
            Word::Material => {
                let definition = self.define(d.name(), &d.params, d.span)?;
                self.state.material = Rc::new(definition);
            }
            Word::MakeNamedMaterial => {
                let Some(kind) = d.params.text(s, "type")?.map(str::to_owned) else {
                    return Err(
                        self.error(d.span, "MakeNamedMaterial takes \"string type\", its kind")
                    );
                };
                let definition = self.define(&kind, &d.params, d.span)?;
                Rc::make_mut(&mut self.state.named_materials)
                    .insert(d.name().to_owned(), Rc::new(definition));
            }
            Word::NamedMaterial => {
                let named = Rc::clone(&self.state.named_materials);
                self.state.material =
                    self.with_maker(|maker, _| materials::find(maker, &named, d.name(), d.span))?;
            }
            Word::Shape => self.shape(&d)?,
        }
        self.report_unused(&d);
        Ok(())
    }

    /// Notes what kind of thing the directive asks for.
    fn count(&mut self, d: &Directive) {
        let (what, kind) = match d.word {
            Word::Camera => ("camera", d.name()),
            Word::Integrator => ("integrator", d.name()),
            Word::Sampler => ("sampler", d.name()),
            Word::PixelFilter => ("filter", d.name()),
            Word::Shape => ("shape", d.name()),
            Word::LightSource => ("light", d.name()),
            Word::AreaLightSource => ("area light", d.name()),
            Word::Material => ("material", d.name()),
            Word::Texture => ("texture", d.names[2].as_str()),
            Word::MakeNamedMaterial => {
                let kind = d.params.list.iter().find(|param| param.name == "type");
                match kind.map(|param| &param.values) {
                    Some(Values::Texts(texts)) if texts.len() == 1 => {
                        ("material", texts[0].as_str())
                    }
                    _ => return,
                }
            }
            Word::ObjectBegin => ("object", "definition"),
            Word::ObjectInstance => ("object", "instance"),
            _ => return,
        };
        self.contents.count(what, kind);
    }

    /// Settings stand before WorldBegin, the world's content after it.
    fn check_section(&self, d: &Directive) -> Result<(), SceneError> {
        let name = d.word.name();
        match d.word {
            Word::Accelerator
            | Word::Camera
            | Word::Film
            | Word::Integrator
            | Word::PixelFilter
            | Word::Sampler
            | Word::TransformTimes
            | Word::WorldBegin
                if self.world.is_some() =>
            {
                Err(self.error(
                    d.span,
                    format!("{name} stands before WorldBegin, not after it"),
                ))
            }
            Word::AttributeBegin
            | Word::AttributeEnd
            | Word::AreaLightSource
            | Word::LightSource
            | Word::MakeNamedMaterial
            | Word::Material
            | Word::NamedMaterial
            | Word::ObjectBegin
            | Word::ObjectEnd
            | Word::ObjectInstance
            | Word::ReverseOrientation
            | Word::Shape
            | Word::Texture
            | Word::WorldEnd
                if self.world.is_none() =>
            {
                Err(self.error(
                    d.span,
                    format!("{name} stands after WorldBegin, not before it"),
                ))
            }
            _ => Ok(()),
        }
    }

    /// Names the files that were to be included and are not there.
    fn report_missing(&mut self) {
        for (name, span) in std::mem::take(&mut self.parser.missing) {
            let text = format!(
                "there is no file \"{}\" to include; rendered without it. It is looked for beside \
                 the file that includes it, beside the scene's main file and on the search path",
                shortened(&name)
            );
            self.warn(&format!("file {name}"), span, text);
        }
    }

    fn report_unused(&mut self, d: &Directive) {
        for param in d.params.unused() {
            let what = match d.word {
                Word::Texture => format!("the texture class \"{}\"", shortened(&d.names[2])),
                word => format!("{} \"{}\"", word.name(), shortened(d.name())),
            };
            // A named material is known by its own name: its parameters by their names alone.
            let kind = match d.word {
                Word::MakeNamedMaterial => format!("unused {}", param.name),
                _ => format!("unused {} of {what}", param.name),
            };
            let sources = &self.parser.sources;
            self.notes.warn(
                &kind,
                || sources.place(param.span),
                format!(
                    "{what} does not use \"{} {}\"",
                    param.ty.name(),
                    shortened(&param.name)
                ),
            );
        }
    }

    fn moving(&mut self, span: Span) {
        self.warn(
            "animation",
            span,
            "movement is not supported; rendered as it is at the start".to_owned(),
        );
    }

    fn transform(&mut self, d: &Directive) -> Result<(), SceneError> {
        let n = &d.numbers;
        let matrix = match d.word {
            Word::Translate => DMat4::from_translation(DVec3::new(n[0], n[1], n[2])),
            Word::Scale => DMat4::from_scale(DVec3::new(n[0], n[1], n[2])),
            Word::Rotate => {
                let Some(axis) = DVec3::new(n[1], n[2], n[3]).try_normalize() else {
                    return Err(self.error(d.span, "the axis of this Rotate has no length"));
                };
                DMat4::from_axis_angle(axis, n[0].to_radians())
            }
            Word::LookAt => {
                let [eye, at, up] = [0, 3, 6].map(|i| DVec3::new(n[i], n[i + 1], n[i + 2]));
                let forward = (at - eye).try_normalize();
                let right = forward.and_then(|forward| up.cross(forward).try_normalize());
                let (Some(forward), Some(right)) = (forward, right) else {
                    return Err(self.error(
                        d.span,
                        "this LookAt has no direction: its eye and target are the same point, or \
                         its up vector is zero or points along the view",
                    ));
                };
                let up = forward.cross(right);
                DMat4::from_cols(
                    right.extend(0.0),
                    up.extend(0.0),
                    forward.extend(0.0),
                    eye.extend(1.0),
                )
                .inverse()
            }
            Word::Transform | Word::ConcatTransform => {
                let mut columns = [0.0; 16];
                columns.copy_from_slice(n);
                DMat4::from_cols_array(&columns)
            }
            _ => DMat4::IDENTITY,
        };
        let Some(transform) = Transform::from_matrix(matrix) else {
            return Err(self.error(
                d.span,
                format!(
                    "this {} cannot be undone: it flattens space, or its numbers are too large",
                    d.word.name()
                ),
            ));
        };
        let result = match d.word {
            Word::Identity | Word::Transform => transform,
            _ => self.state.to_world.after(&transform),
        };
        if !result.matrix().is_finite() || !result.inverse().matrix().is_finite() {
            return Err(self.error(d.span, "the transforms up to here overflow"));
        }
        if self.state.at_start {
            self.state.to_world = result;
        }
        Ok(())
    }

    fn begin(&mut self, d: &Directive) {
        self.blocks.push(Block {
            word: d.word,
            span: d.span,
            before: self.state.clone(),
        });
    }

    fn not_closed(&self, block: &Block) -> SceneError {
        let name = block.word.name();
        let end = name.replace("Begin", "End");
        self.error(block.span, format!("this {name} has no {end}"))
    }

    fn end(&mut self, d: &Directive, begin: Word) -> Result<(), SceneError> {
        match self.blocks.pop() {
            Some(block) if block.word == begin => {
                if begin == Word::TransformBegin {
                    self.state.to_world = block.before.to_world;
                    self.state.at_start = block.before.at_start;
                } else {
                    self.state = block.before;
                }
                Ok(())
            }
            Some(block) => {
                let place = self.parser.sources.place(block.span);
                Err(self.error(
                    d.span,
                    format!(
                        "{} stands here, but the innermost open block is the {} of {place}",
                        d.word.name(),
                        block.word.name()
                    ),
                ))
            }
            None => Err(self.error(
                d.span,
                format!("this {} has no {}", d.word.name(), begin.name()),
            )),
        }
    }

    fn texture(&mut self, d: &Directive) -> Result<(), SceneError> {
        let is_float = match d.names[1].as_str() {
            "float" => true,
            "spectrum" | "color" | "rgb" => false,
            other => {
                return Err(self.error(
                    d.span,
                    format!(
                        "a texture's values are \"float\" or \"spectrum\", not \"{}\"",
                        shortened(other)
                    ),
                ));
            }
        };
        let to_world = self.state.to_world;
        let texture = self.with_maker(|maker, _| maker.texture(d, is_float, &to_world))?;
        let named = Rc::make_mut(&mut self.state.textures);
        let map = if is_float {
            &mut named.floats
        } else {
            &mut named.colors
        };
        map.insert(d.name().to_owned(), texture);
        Ok(())
    }

    /// Adds a material to the scene.
    fn define(
        &mut self,
        kind: &str,
        params: &Params,
        span: Span,
    ) -> Result<Definition, SceneError> {
        let named = Rc::clone(&self.state.named_materials);
        let index = self.with_maker(|maker, all| {
            let material = materials::material(maker, kind, params, span, &named, all)?;
            all.push(material);
            Ok(all.len() as u32 - 1)
        })?;
        Ok(Definition {
            kind: kind.to_owned(),
            params: params.clone(),
            span,
            index,
        })
    }

    fn shape(&mut self, d: &Directive) -> Result<(), SceneError> {
        let base = Rc::clone(&self.state.material);
        let material = match materials::overridden(&d.params, &base.params) {
            Some(params) => self.define(&base.kind, &params, base.span)?.index,
            None => base.index,
        };
        // A number of an alpha matters only where it is 0: nothing is there.
        let mask = |maker: &mut Maker<'_>, name: &str| -> Result<Option<TextureRef>, SceneError> {
            let mask = maker.float_texture(&d.params, name)?;
            Ok(mask.filter(|mask| !matches!(**mask, Texture::Constant([v, ..]) if v != 0.0)))
        };
        let (alpha, shadow_alpha) =
            self.with_maker(|maker, _| Ok((mask(maker, "alpha")?, mask(maker, "shadowalpha")?)))?;
        let mut area_light = self.state.area_light.clone();
        if let Some(area_light) = &mut area_light {
            // As pbrt-v3 has it: the light comes into being with its shape.
            area_light.after = self.lights.len() as u32;
        }
        if self.object.is_some() && area_light.take().is_some() {
            self.warn(
                "area light of an object",
                d.span,
                "shapes of objects do not shine, as in pbrt-v3; rendered without their light"
                    .to_owned(),
            );
        }
        let shines = area_light.is_some();
        let parser = &self.parser;
        let find = |name: &str, span: Span| parser.find(name, span);
        let levels = self.subdivision_levels;
        let source = shapes::shape(&parser.sources, d, shines, levels, &mut self.notes, &find)?;
        let Some(source) = source else {
            return Ok(());
        };
        let piece = Piece {
            source,
            span: d.span,
            to_world: self.state.to_world,
            reversed: self.state.reversed,
            material,
            area_light,
            alpha,
            shadow_alpha,
            is_instance: false,
        };
        match &mut self.object {
            Some((_, pieces)) => pieces.push(piece),
            None => self.pieces.push(piece),
        }
        Ok(())
    }

    fn instance(&mut self, d: &Directive) -> Result<(), SceneError> {
        if self.object.is_some() {
            return Err(self.error(d.span, "objects have no instances of objects in them"));
        }
        let Some(pieces) = self.objects.get(d.name()) else {
            let mut names: Vec<_> = self
                .objects
                .keys()
                .map(|name| format!("\"{name}\""))
                .collect();
            names.sort();
            let there_are = if names.is_empty() {
                "none is defined before it".to_owned()
            } else {
                format!("defined before it are {}", textures::shortened_list(&names))
            };
            return Err(self.error(
                d.span,
                format!(
                    "there is no object \"{}\"; {there_are}",
                    shortened(d.name())
                ),
            ));
        };
        let to_world = self.state.to_world;
        // What is not affine cannot be kept.
        let kept = self.instancing == Instancing::Kept && to_world.is_affine();
        match if kept {
            Instancing::Kept
        } else {
            Instancing::Flattened
        } {
            Instancing::Flattened => self.pieces.extend(pieces.iter().map(|piece| Piece {
                to_world: to_world.after(&piece.to_world),
                is_instance: true,
                ..piece.clone()
            })),
            Instancing::Kept => {
                let known = self
                    .placed
                    .iter()
                    .position(|placed| Rc::ptr_eq(placed, pieces));
                let object = known.unwrap_or_else(|| {
                    self.placed.push(Rc::clone(pieces));
                    self.placed.len() - 1
                }) as u32;
                self.copies.push(Copied { object, to_world });
            }
        }
        let (count, _) = self.instances.get_or_insert((0, d.span));
        *count += 1;
        Ok(())
    }
}
