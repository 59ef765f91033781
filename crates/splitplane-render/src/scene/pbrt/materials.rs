//! Materials. Defaults are pbrt-v3's [PBRT3, 9.2].

use std::collections::HashMap;
use std::rc::Rc;

use super::lexer::shortened;
use super::params::Params;
use super::source::Span;
use super::textures::{Maker, constant, mean, shortened_list};
use crate::error::SceneError;
use crate::scene::material::{Material, TextureRef};

/// A material as the file gives it, and its index in the scene.
#[derive(Debug)]
pub(crate) struct Definition {
    pub(crate) kind: String,
    pub(crate) params: Params,
    pub(crate) span: Span,
    pub(crate) index: u32,
}

/// The materials that a block of the scene can name.
pub(crate) type NamedMaterials = HashMap<String, Rc<Definition>>;

/// The parameters of materials that a shape may override.
const OVERRIDABLE: &[&str] = &[
    "Kd",
    "Ks",
    "Kr",
    "Kt",
    "sigma",
    "roughness",
    "uroughness",
    "vroughness",
    "eta",
    "index",
    "opacity",
    "remaproughness",
    "reflect",
    "transmit",
    "k",
];

/// The material's parameters with those that a shape overrides; `None` where it overrides none.
pub(crate) fn overridden(shape: &Params, material: &Params) -> Option<Params> {
    let mut list: Vec<_> = OVERRIDABLE
        .iter()
        .filter(|name| shape.has(name))
        .filter_map(|name| shape.get(name).cloned())
        .collect();
    if list.is_empty() {
        return None;
    }
    let kept = material
        .list
        .iter()
        .filter(|own| list.iter().all(|new| new.name != own.name));
    let kept: Vec<_> = kept.cloned().collect();
    list.extend(kept);
    Some(Params { list })
}

/// The material of a kind with parameters.
pub(crate) fn material(
    maker: &mut Maker<'_>,
    kind: &str,
    params: &Params,
    span: Span,
    named: &NamedMaterials,
    materials: &[Material],
) -> Result<Material, SceneError> {
    if let Some(param) = params.get("bumpmap") {
        maker.notes.warn(
            "bumpmap",
            || maker.s.place(param.span),
            "bump maps are not supported; rendered without".to_owned(),
        );
    }
    let what = format!("the material \"{}\"", shortened(kind));
    let float =
        |maker: &mut Maker<'_>, name: &str, default: f32| -> Result<TextureRef, SceneError> {
            Ok(maker
                .float_texture(params, name)?
                .unwrap_or_else(|| constant([default; 3])))
        };
    let color =
        |maker: &mut Maker<'_>, name: &str, default: f32| -> Result<TextureRef, SceneError> {
            maker.color_texture(params, name, [default; 3])
        };
    let eta = |maker: &mut Maker<'_>| -> Result<TextureRef, SceneError> {
        match maker.float_texture(params, "eta")? {
            Some(eta) => Ok(eta),
            None => float(maker, "index", 1.5),
        }
    };
    // Roughness along u and v, each where given, else the common one.
    let roughness = |maker: &mut Maker<'_>, default: f32| -> Result<[TextureRef; 2], SceneError> {
        let common = float(maker, "roughness", default)?;
        let u = maker.float_texture(params, "uroughness")?;
        let v = maker.float_texture(params, "vroughness")?;
        Ok([u.unwrap_or_else(|| common.clone()), v.unwrap_or(common)])
    };
    let remap_roughness = params.bool(maker.s, "remaproughness")?.unwrap_or(true);

    Ok(match kind {
        "" | "none" => Material::Interface,
        "matte" => Material::Matte {
            kd: color(maker, "Kd", 0.5)?,
            sigma: float(maker, "sigma", 0.0)?,
        },
        "plastic" => Material::Plastic {
            kd: color(maker, "Kd", 0.25)?,
            ks: color(maker, "Ks", 0.25)?,
            roughness: float(maker, "roughness", 0.1)?,
            remap_roughness,
        },
        "mirror" => Material::Mirror {
            kr: color(maker, "Kr", 0.9)?,
        },
        "glass" => Material::Glass {
            kr: color(maker, "Kr", 1.0)?,
            kt: color(maker, "Kt", 1.0)?,
            eta: eta(maker)?,
            roughness: [
                float(maker, "uroughness", 0.0)?,
                float(maker, "vroughness", 0.0)?,
            ],
            remap_roughness,
        },
        "uber" => Material::Uber {
            kd: color(maker, "Kd", 0.25)?,
            ks: color(maker, "Ks", 0.25)?,
            kr: color(maker, "Kr", 0.0)?,
            kt: color(maker, "Kt", 0.0)?,
            roughness: roughness(maker, 0.1)?,
            opacity: color(maker, "opacity", 1.0)?,
            eta: eta(maker)?,
            remap_roughness,
        },
        "substrate" => {
            let material = Material::Plastic {
                kd: color(maker, "Kd", 0.5)?,
                ks: color(maker, "Ks", 0.5)?,
                roughness: float(maker, "uroughness", 0.1)?,
                remap_roughness,
            };
            params.ignore(&["vroughness"]);
            maker.replaced(
                span,
                &what,
                "\"plastic\" with its Kd, Ks and roughness along u",
            );
            material
        }
        "metal" => {
            let eta = maker.color_texture(params, "eta", COPPER_ETA)?;
            let k = maker.color_texture(params, "k", COPPER_K)?;
            let reflectance = reflectance_of_conductor(mean(&eta), mean(&k));
            let black = constant([0.0; 3]);
            let material = Material::Uber {
                kd: black.clone(),
                ks: constant(reflectance),
                kr: black.clone(),
                kt: black,
                roughness: roughness(maker, 0.01)?,
                opacity: constant([1.0; 3]),
                // So large that the coat reflects nearly all at any angle: the colour is Ks.
                eta: constant([100.0; 3]),
                remap_roughness,
            };
            maker.replaced(
                span,
                &what,
                "a glossy coat of its roughness with its reflectance at normal incidence",
            );
            material
        }
        "translucent" => {
            let reflect = color(maker, "reflect", 0.5)?;
            params.ignore(&["transmit"]);
            let scaled = |texture: TextureRef| -> TextureRef {
                std::sync::Arc::new(crate::scene::texture::Texture::Scale(
                    reflect.clone(),
                    texture,
                ))
            };
            let material = Material::Plastic {
                kd: scaled(color(maker, "Kd", 0.25)?),
                ks: scaled(color(maker, "Ks", 0.25)?),
                roughness: float(maker, "roughness", 0.1)?,
                remap_roughness,
            };
            maker.replaced(span, &what, "\"plastic\", without its transmission");
            material
        }
        "mix" => {
            let amount = color(maker, "amount", 0.5)?;
            let amount = mean(&amount);
            let part = |name: &str| -> Result<u32, SceneError> {
                let Some(part) = params.text(maker.s, name)? else {
                    return Err(maker
                        .s
                        .error(span, format!("a \"mix\" takes \"string {name}\"")));
                };
                find(
                    maker,
                    named,
                    part,
                    params.get(name).map_or(span, |param| param.span),
                )
                .map(|definition| definition.index)
            };
            let parts = [part("namedmaterial1")?, part("namedmaterial2")?];
            let second = amount.iter().sum::<f32>() < 1.5;
            maker.replaced(span, &what, "the material that has the larger share");
            materials[parts[usize::from(second)] as usize].clone()
        }
        "kdsubsurface" | "subsurface" | "disney" => {
            let name = if kind == "disney" { "color" } else { "Kd" };
            let material = Material::Plastic {
                kd: color(maker, name, 0.5)?,
                ks: constant([0.25; 3]),
                roughness: constant([0.1; 3]),
                remap_roughness: true,
            };
            params.ignore_all();
            maker.replaced(span, &what, "\"plastic\" of its colour");
            material
        }
        _ => {
            params.ignore_all();
            maker.replaced(span, &what, "a grey \"matte\"");
            Material::Matte {
                kd: constant([0.5; 3]),
                sigma: constant([0.0; 3]),
            }
        }
    })
}

/// Copper at red, green and blue: pbrt-v3's default metal, as RGB.
const COPPER_ETA: [f32; 3] = [0.200_438, 0.924_033, 1.102_212];
const COPPER_K: [f32; 3] = [3.912_949, 2.452_848, 2.142_188];

/// What a conductor reflects of light that falls on it at a right angle.
fn reflectance_of_conductor(eta: [f32; 3], k: [f32; 3]) -> [f32; 3] {
    std::array::from_fn(|i| {
        let (n, k2) = (eta[i], k[i] * k[i]);
        ((n - 1.0).powi(2) + k2) / ((n + 1.0).powi(2) + k2)
    })
}

/// The material of that name.
pub(crate) fn find(
    maker: &Maker<'_>,
    named: &NamedMaterials,
    name: &str,
    span: Span,
) -> Result<Rc<Definition>, SceneError> {
    named.get(name).cloned().ok_or_else(|| {
        let mut names: Vec<_> = named.keys().map(|name| format!("\"{name}\"")).collect();
        names.sort();
        let there_are = if names.is_empty() {
            "none is defined here".to_owned()
        } else {
            format!("defined here are {}", shortened_list(&names))
        };
        maker.s.error(
            span,
            format!("there is no material \"{}\"; {there_are}", shortened(name)),
        )
    })
}
