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
use crate::scene::image_file::{Decoding, Images};
use crate::scene::material::TextureRef;
use crate::scene::texture::{Texture, Wrap};

/// What stands in for a texture that is not there.
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

/// The mean of a texture, for what cannot vary.
pub(crate) fn mean(texture: &Texture) -> [f32; 3] {
    match texture {
        Texture::Constant(value) => *value,
        Texture::Scale(a, b) => {
            let (a, b) = (mean(a), mean(b));
            std::array::from_fn(|i| a[i] * b[i])
        }
        Texture::Image { image, .. } => {
            let mut sum = [0.0_f64; 3];
            for pixel in &image.pixels {
                for (sum, c) in sum.iter_mut().zip(pixel) {
                    *sum += f64::from(*c);
                }
            }
            sum.map(|sum| (sum / image.pixels.len().max(1) as f64) as f32)
        }
    }
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

    /// The texture that a Texture directive defines, whether its values are numbers or colours.
    pub(crate) fn texture(
        &mut self,
        d: &Directive,
        is_float: bool,
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
        let average = |textures: &[TextureRef]| -> [f32; 3] {
            let mut sum = [0.0; 3];
            for texture in textures {
                let mean = mean(texture);
                sum = std::array::from_fn(|i| sum[i] + mean[i] / textures.len() as f32);
            }
            sum
        };
        let what = format!("the texture class \"{}\"", shortened(class));
        let color = match class {
            "constant" => return value(self, "value", 1.0),
            "scale" => {
                let (a, b) = (value(self, "tex1", 1.0)?, value(self, "tex2", 1.0)?);
                return Ok(Arc::new(Texture::Scale(a, b)));
            }
            "imagemap" => return self.image_map(d, is_float),
            "mix" => {
                let (a, b) = (value(self, "tex1", 0.0)?, value(self, "tex2", 1.0)?);
                let amount = self.float_texture(&d.params, "amount")?;
                let amount = amount.map_or(0.5, |amount| mean(&amount)[0]);
                let [m, n] = [mean(&a), mean(&b)];
                let mixed = std::array::from_fn(|i| (1.0 - amount) * m[i] + amount * n[i]);
                if let (Texture::Constant(_), Texture::Constant(_)) = (&*a, &*b) {
                    return Ok(constant(mixed));
                }
                self.replaced(d.span, &what, "the mix of its textures' means");
                mixed
            }
            "checkerboard" => {
                let both = [value(self, "tex1", 1.0)?, value(self, "tex2", 0.0)?];
                self.replaced(d.span, &what, "the mean of its two textures");
                average(&both)
            }
            "bilerp" => {
                let corners = [
                    value(self, "v00", 0.0)?,
                    value(self, "v01", 1.0)?,
                    value(self, "v10", 0.0)?,
                    value(self, "v11", 1.0)?,
                ];
                self.replaced(d.span, &what, "the mean of its four values");
                average(&corners)
            }
            "dots" => {
                let outside = value(self, "outside", 0.0)?;
                self.replaced(d.span, &what, "its texture outside the dots");
                d.params.ignore_all();
                return Ok(outside);
            }
            _ => {
                self.replaced(d.span, &what, "a middle grey");
                MIDDLE_GRAY
            }
        };
        d.params.ignore_all();
        Ok(constant(color))
    }

    fn image_map(&mut self, d: &Directive, is_float: bool) -> Result<TextureRef, SceneError> {
        let Some(name) = d.params.text(self.s, "filename")? else {
            return Err(self.s.error(
                d.span,
                "an \"imagemap\" takes \"string filename\", which is not given",
            ));
        };
        // Filtering is the renderer's own.
        d.params.ignore(&["trilinear", "maxanisotropy"]);
        let mapping = match d.params.text(self.s, "mapping")? {
            None | Some("uv") => {
                let float = |name: &str, default: f32| -> Result<f32, SceneError> {
                    Ok(d.params.float(self.s, name)?.unwrap_or(default))
                };
                [
                    float("uscale", 1.0)?,
                    float("vscale", 1.0)?,
                    float("udelta", 0.0)?,
                    float("vdelta", 0.0)?,
                ]
            }
            Some(other) => {
                let what = format!("the texture mapping \"{}\"", shortened(other));
                self.replaced(d.span, &what, "the mapping \"uv\"");
                d.params
                    .ignore(&["v1", "v2", "udelta", "vdelta", "uscale", "vscale"]);
                [1.0, 1.0, 0.0, 0.0]
            }
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
        let scale = d.params.float(self.s, "scale")?.unwrap_or(1.0);
        let path = (self.find)(name, d.span);
        let decoding = Decoding {
            srgb,
            gray: is_float,
        };
        let image = match path {
            None => Err("there is no such file".to_owned()),
            Some(path) => self.images.get(&path, decoding),
        };
        let texture = match image {
            Ok(image) => Arc::new(Texture::Image {
                image,
                mapping,
                wrap,
            }),
            Err(reason) => {
                self.notes.warn(
                    &format!("image {name}"),
                    || self.s.place(d.span),
                    format!(
                        "the image \"{}\" cannot be read ({reason}); rendered as a middle grey",
                        shortened(name)
                    ),
                );
                constant(MIDDLE_GRAY)
            }
        };
        Ok(if scale == 1.0 {
            texture
        } else {
            Arc::new(Texture::Scale(constant([scale; 3]), texture))
        })
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
