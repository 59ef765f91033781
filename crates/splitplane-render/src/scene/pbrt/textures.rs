//! Textures, and parameters that take one.

use std::collections::HashMap;
use std::path::PathBuf;
use std::sync::Arc;

use super::color;
use super::directive::Directive;
use super::lexer::shortened;
use super::params::{Param, Params, Type};
use super::source::{Sources, Span};
use crate::error::SceneError;
use crate::scene::geometry::Notes;
use crate::scene::image_file::{Channels, Decoding, Images};
use crate::scene::texture::{Image, ImageFilter, Mapping, Pattern, Texture, TextureRef, Wrap};
use crate::transform::Transform;

/// What stands in for a texture that is not known.
const MIDDLE_GRAY: [f32; 3] = [0.5; 3];

/// The textures that a block of the scene can name.
#[derive(Clone, Debug, Default)]
pub(crate) struct NamedTextures {
    pub(crate) floats: HashMap<String, TextureRef>,
    pub(crate) colors: HashMap<String, TextureRef>,
}

/// What is needed to make a texture, a material or a light of a directive's parameters.
pub(crate) struct Maker<'a> {
    pub(crate) s: &'a Sources,
    pub(crate) notes: &'a mut Notes,
    pub(crate) images: &'a mut Images,
    pub(crate) textures: &'a NamedTextures,
    pub(crate) find: &'a dyn Fn(&str, Span) -> Option<PathBuf>,
}

/// The same everywhere.
pub(crate) fn constant(value: [f32; 3]) -> TextureRef {
    Arc::new(Texture::Constant(value))
}

impl Maker<'_> {
    /// A colour; `default` where the parameter is absent.
    pub(crate) fn color(
        &mut self,
        params: &Params,
        name: &str,
        default: [f32; 3],
    ) -> Result<[f32; 3], SceneError> {
        match params.color_param(self.s, name, false)? {
            Some(param) => self.color_of(param, default),
            None => Ok(default),
        }
    }

    fn color_of(&mut self, param: &Param, default: [f32; 3]) -> Result<[f32; 3], SceneError> {
        let find = |name: &str| (self.find)(name, param.span);
        if let Some(color) = color::of_param(self.s, param, &find)? {
            return Ok(color);
        }
        self.notes.warn(
            "spectrum file",
            || self.s.place(param.span),
            format!(
                "the file of the spectrum \"{}\" is absent or holds no pairs of numbers; its \
                 default is used",
                param.name
            ),
        );
        Ok(default)
    }

    /// A parameter that is a colour or a texture.
    pub(crate) fn color_texture(
        &mut self,
        params: &Params,
        name: &str,
        default: [f32; 3],
    ) -> Result<TextureRef, SceneError> {
        match params.color_param(self.s, name, true)? {
            Some(param) if param.ty == Type::Texture => {
                self.named(&self.textures.colors, "spectrum", params, param)
            }
            Some(param) => self.color_of(param, default).map(constant),
            None => Ok(constant(default)),
        }
    }

    /// A parameter that is a number or a texture; `None` where it is absent.
    pub(crate) fn float_texture(
        &mut self,
        params: &Params,
        name: &str,
    ) -> Result<Option<TextureRef>, SceneError> {
        match params.numbers(self.s, name, &[Type::Float, Type::Texture])? {
            Some(param) if param.ty == Type::Texture => self
                .named(&self.textures.floats, "float", params, param)
                .map(Some),
            Some(_) => Ok(params
                .float(self.s, name)?
                .map(|value| constant([value; 3]))),
            None => Ok(None),
        }
    }

    fn named(
        &self,
        textures: &HashMap<String, TextureRef>,
        kind: &str,
        params: &Params,
        param: &Param,
    ) -> Result<TextureRef, SceneError> {
        let name = params.texture(self.s, &param.name)?.unwrap_or_default();
        textures.get(name).map(Arc::clone).ok_or_else(|| {
            let mut names: Vec<_> = textures.keys().map(|name| format!("\"{name}\"")).collect();
            names.sort();
            let there_are = if names.is_empty() {
                "none is defined here".to_owned()
            } else {
                format!("defined here are {}", shortened_list(&names))
            };
            self.s.error(
                param.span,
                format!(
                    "there is no {kind} texture \"{}\"; {there_are}",
                    shortened(name)
                ),
            )
        })
    }

    /// Warns about a class, a mapping and so on that is replaced by something else.
    pub(crate) fn replaced(&mut self, span: Span, what: &str, by: &str) {
        self.notes.warn(
            what,
            || self.s.place(span),
            format!("{what} is not supported; rendered as {by}"),
        );
    }

    /// A number; `default` where the parameter is absent.
    fn float(&self, d: &Directive, name: &str, default: f32) -> Result<f32, SceneError> {
        Ok(d.params.float(self.s, name)?.unwrap_or(default))
    }

    /// The texture that a Texture directive defines, whether its values are numbers or colours.
    /// `to_world` is the transform in force.
    pub(crate) fn texture(
        &mut self,
        d: &Directive,
        is_float: bool,
        to_world: &Transform,
    ) -> Result<TextureRef, SceneError> {
        let class = d.names[2].as_str();
        let value =
            |maker: &mut Self, name: &str, default: f32| -> Result<TextureRef, SceneError> {
                if is_float {
                    Ok(maker
                        .float_texture(&d.params, name)?
                        .unwrap_or_else(|| constant([default; 3])))
                } else {
                    maker.color_texture(&d.params, name, [default; 3])
                }
            };
        let octaves = || -> Result<u32, SceneError> {
            let octaves = d.params.integer_in(self.s, "octaves", 0..=64)?;
            Ok(octaves.unwrap_or(8))
        };
        // pbrt-v3 takes the transform in force for that from the world to the texture.
        let noise = |pattern: Pattern| Texture::Noise {
            pattern,
            to_texture: *to_world,
        };
        let texture = match class {
            "constant" => return value(self, "value", 1.0),
            "scale" => Texture::Scale(value(self, "tex1", 1.0)?, value(self, "tex2", 1.0)?),
            "imagemap" => return self.image_map(d, is_float, to_world),
            "mix" => Texture::Mix {
                from: value(self, "tex1", 0.0)?,
                to: value(self, "tex2", 1.0)?,
                amount: self
                    .float_texture(&d.params, "amount")?
                    .unwrap_or_else(|| constant([0.5; 3])),
            },
            "checkerboard" => {
                let (even, odd) = (value(self, "tex1", 1.0)?, value(self, "tex2", 0.0)?);
                match d.params.integer(self.s, "dimension")? {
                    None | Some(2) => Texture::Checkerboard {
                        even,
                        odd,
                        mapping: self.mapping(d, to_world)?,
                        filtered: match d.params.text(self.s, "aamode")? {
                            None | Some("closedform") => true,
                            Some("none") => false,
                            Some(other) => {
                                return Err(self.s.error(
                                    d.span,
                                    format!(
                                        "\"{}\" is not an aamode; there are \"closedform\" and \
                                         \"none\"",
                                        shortened(other)
                                    ),
                                ));
                            }
                        },
                    },
                    Some(3) => Texture::Checkerboard3 {
                        even,
                        odd,
                        to_texture: *to_world,
                    },
                    Some(other) => {
                        return Err(self.s.error(
                            d.span,
                            format!("a \"checkerboard\" has 2 or 3 dimensions, not {other}"),
                        ));
                    }
                }
            }
            "bilerp" => {
                let mut corners = [[0.0; 3], [1.0; 3], [0.0; 3], [1.0; 3]];
                for (corner, name) in corners.iter_mut().zip(["v00", "v01", "v10", "v11"]) {
                    *corner = if is_float {
                        [self.float(d, name, corner[0])?; 3]
                    } else {
                        self.color(&d.params, name, *corner)?
                    };
                }
                Texture::Bilerp {
                    corners,
                    mapping: self.mapping(d, to_world)?,
                }
            }
            "uv" => Texture::Uv {
                mapping: self.mapping(d, to_world)?,
            },
            "dots" => Texture::Dots {
                inside: value(self, "inside", 1.0)?,
                outside: value(self, "outside", 0.0)?,
                mapping: self.mapping(d, to_world)?,
            },
            "fbm" => noise(Pattern::Fbm {
                octaves: octaves()?,
                roughness: self.float(d, "roughness", 0.5)?,
            }),
            "wrinkled" => noise(Pattern::Wrinkled {
                octaves: octaves()?,
                roughness: self.float(d, "roughness", 0.5)?,
            }),
            "windy" => noise(Pattern::Windy),
            "marble" => noise(Pattern::Marble {
                octaves: octaves()?,
                roughness: self.float(d, "roughness", 0.5)?,
                scale: self.float(d, "scale", 1.0)?,
                variation: self.float(d, "variation", 0.2)?,
            }),
            _ => {
                let what = format!("the texture class \"{}\"", shortened(class));
                self.replaced(d.span, &what, "a middle grey");
                d.params.ignore_all();
                Texture::Constant(MIDDLE_GRAY)
            }
        };
        Ok(Arc::new(texture))
    }

    /// How a texture of two dimensions lies on surfaces.
    fn mapping(&mut self, d: &Directive, to_world: &Transform) -> Result<Mapping, SceneError> {
        let to_texture = to_world.inverse();
        Ok(match d.params.text(self.s, "mapping")? {
            None | Some("uv") => Mapping::Uv {
                scale: [self.float(d, "uscale", 1.0)?, self.float(d, "vscale", 1.0)?],
                shift: [self.float(d, "udelta", 0.0)?, self.float(d, "vdelta", 0.0)?],
            },
            Some("spherical") => Mapping::Spherical { to_texture },
            Some("cylindrical") => Mapping::Cylindrical { to_texture },
            Some("planar") => {
                let axis = |name: &str, default: [f32; 3]| -> Result<[f32; 3], SceneError> {
                    let axis = d.params.triple(self.s, name, Type::Vector3)?;
                    Ok(axis.unwrap_or(default))
                };
                Mapping::Planar {
                    axes: [axis("v1", [1.0, 0.0, 0.0])?, axis("v2", [0.0, 1.0, 0.0])?],
                    shift: [self.float(d, "udelta", 0.0)?, self.float(d, "vdelta", 0.0)?],
                }
            }
            Some(other) => {
                let what = format!("the texture mapping \"{}\"", shortened(other));
                self.replaced(d.span, &what, "the mapping \"uv\"");
                Mapping::IDENTITY
            }
        })
    }

    /// The image that a directive names; `None` where there is no such file, which is warned about.
    pub(crate) fn image(
        &mut self,
        d: &Directive,
        name: &str,
        decoding: Decoding,
        without: &str,
    ) -> Option<Arc<Image>> {
        match (self.find)(name, d.span) {
            Some(path) => Some(self.images.get(&path, decoding)),
            None => {
                self.notes.warn(
                    &format!("image {name}"),
                    || self.s.place(d.span),
                    format!("there is no image \"{}\"; {without}", shortened(name)),
                );
                None
            }
        }
    }

    fn image_map(
        &mut self,
        d: &Directive,
        is_float: bool,
        to_world: &Transform,
    ) -> Result<TextureRef, SceneError> {
        let Some(name) = d.params.text(self.s, "filename")? else {
            return Err(self.s.error(
                d.span,
                "an \"imagemap\" takes \"string filename\", which is not given",
            ));
        };
        let mapping = self.mapping(d, to_world)?;
        let trilinear = d.params.bool(self.s, "trilinear")?.unwrap_or(false);
        let max_anisotropy = self.float(d, "maxanisotropy", 8.0)?;
        let filter = if trilinear {
            ImageFilter::Trilinear
        } else {
            ImageFilter::Elliptic { max_anisotropy }
        };
        let wrap = match d.params.text(self.s, "wrap")? {
            None | Some("repeat") => Wrap::Repeat,
            Some("black") => Wrap::Black,
            Some("clamp") => Wrap::Clamp,
            Some(other) => {
                return Err(self.s.error(
                    d.params.get("wrap").map_or(d.span, |param| param.span),
                    format!(
                        "\"{}\" is not a way to wrap; there are \"repeat\", \"black\" and \"clamp\"",
                        shortened(other)
                    ),
                ));
            }
        };
        let lower = name.to_ascii_lowercase();
        let srgb = d.params.bool(self.s, "gamma")?.unwrap_or_else(|| {
            [".tga", ".png", ".jpg", ".jpeg"]
                .iter()
                .any(|end| lower.ends_with(end))
        });
        let scale = self.float(d, "scale", 1.0)?;
        let decoding = Decoding {
            srgb,
            channels: if is_float {
                Channels::Luminance
            } else {
                Channels::Color
            },
            wrap,
        };
        Ok(
            match self.image(d, name, decoding, "rendered white, as pbrt-v3 does") {
                Some(image) => Arc::new(Texture::Image {
                    image,
                    mapping,
                    filter,
                    scale,
                }),
                None => constant([scale; 3]),
            },
        )
    }
}

/// Names for a message, not all where there are many.
pub(crate) fn shortened_list(names: &[String]) -> String {
    const MOST: usize = 12;
    match names.len() {
        0..=MOST => names.join(", "),
        count => format!("{} and {} more", names[..MOST].join(", "), count - MOST),
    }
}
