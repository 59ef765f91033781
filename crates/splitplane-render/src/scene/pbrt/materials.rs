//! Materials. Defaults are pbrt-v3's [PBRT3, 9.2].

use std::collections::HashMap;
use std::rc::Rc;
use std::sync::Arc;

use super::lexer::shortened;
use super::params::Params;
use super::source::Span;
use super::textures::{Maker, constant, shortened_list};
use crate::error::SceneError;
use crate::scene::material::{Material, TextureRef};
use crate::scene::texture::Texture;

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
    "bumpmap",
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
    let bumps = maker.float_texture(params, "bumpmap")?;
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

    let material = match kind {
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
        "substrate" => Material::Substrate {
            kd: color(maker, "Kd", 0.5)?,
            ks: color(maker, "Ks", 0.5)?,
            roughness: [
                float(maker, "uroughness", 0.1)?,
                float(maker, "vroughness", 0.1)?,
            ],
            remap_roughness,
        },
        "metal" => Material::Metal {
            eta: maker.color_texture(params, "eta", COPPER_ETA)?,
            k: maker.color_texture(params, "k", COPPER_K)?,
            roughness: roughness(maker, 0.01)?,
            remap_roughness,
        },
        "translucent" => Material::Translucent {
            kd: color(maker, "Kd", 0.25)?,
            ks: color(maker, "Ks", 0.25)?,
            reflect: color(maker, "reflect", 0.5)?,
            transmit: color(maker, "transmit", 0.5)?,
            roughness: float(maker, "roughness", 0.1)?,
            remap_roughness,
        },
        "mix" => {
            let amount = color(maker, "amount", 0.5)?;
            let part = |name: &str| -> Result<Arc<Material>, SceneError> {
                let Some(part) = params.text(maker.s, name)? else {
                    return Err(maker
                        .s
                        .error(span, format!("a \"mix\" takes \"string {name}\"")));
                };
                let span = params.get(name).map_or(span, |param| param.span);
                let definition = find(maker, named, part, span)?;
                Ok(Arc::new(materials[definition.index as usize].clone()))
            };
            Material::Mix {
                amount,
                parts: [part("namedmaterial1")?, part("namedmaterial2")?],
            }
        }
        "kdsubsurface" | "subsurface" => {
            let kd = if params.has("Kd") {
                color(maker, "Kd", 0.5)?
            } else {
                constant(albedo(maker, params)?)
            };
            let material = Material::Uber {
                kd,
                ks: color(maker, "Kr", 1.0)?,
                kr: constant([0.0; 3]),
                kt: constant([0.0; 3]),
                roughness: [
                    float(maker, "uroughness", 0.0)?,
                    float(maker, "vroughness", 0.0)?,
                ],
                opacity: constant([1.0; 3]),
                eta: match maker.float_texture(params, "eta")? {
                    Some(eta) => eta,
                    None => constant([1.33; 3]),
                },
                remap_roughness,
            };
            params.ignore_all();
            maker.replaced(
                span,
                &what,
                "a diffuse surface of its colour under a coat of its index and roughness",
            );
            material
        }
        "disney" => {
            let base = color(maker, "color", 0.5)?;
            let metallic = float(maker, "metallic", 0.0)?;
            let eta = float(maker, "eta", 1.5)?;
            let roughness = float(maker, "roughness", 0.5)?;
            // Disney's width of the distribution is the square of its roughness.
            let width: TextureRef = Arc::new(Texture::Scale(roughness.clone(), roughness));
            let mix = |from: TextureRef, to: TextureRef, amount: &TextureRef| -> TextureRef {
                Arc::new(Texture::Mix {
                    from,
                    to,
                    amount: amount.clone(),
                })
            };
            let through = params.float(maker.s, "spectrans").unwrap_or_default();
            let black = constant([0.0; 3]);
            let material = if through.is_some_and(|part| part > 0.5) {
                Material::Glass {
                    kr: constant([1.0; 3]),
                    kt: base,
                    eta,
                    roughness: [width.clone(), width],
                    remap_roughness: false,
                }
            } else {
                Material::Substrate {
                    kd: mix(base.clone(), black, &metallic),
                    ks: mix(constant([0.04; 3]), base, &metallic),
                    roughness: [width.clone(), width],
                    remap_roughness: false,
                }
            };
            params.ignore_all();
            maker.replaced(
                span,
                &what,
                "\"substrate\" or \"glass\" of its colour, metallic and roughness",
            );
            material
        }
        "hair" => {
            let material = Material::Substrate {
                kd: color(maker, "color", 0.1)?,
                ks: constant([0.05; 3]),
                roughness: [constant([0.3; 3]), constant([0.3; 3])],
                remap_roughness: false,
            };
            params.ignore_all();
            maker.replaced(span, &what, "\"substrate\" of its colour");
            material
        }
        "fourier" => {
            params.ignore_all();
            maker.replaced(span, &what, "a grey \"substrate\"");
            Material::Substrate {
                kd: constant([0.2; 3]),
                ks: constant([0.4; 3]),
                roughness: [constant([0.2; 3]), constant([0.2; 3])],
                remap_roughness: false,
            }
        }
        _ => {
            params.ignore_all();
            maker.replaced(span, &what, "a grey \"matte\"");
            Material::Matte {
                kd: constant([0.5; 3]),
                sigma: constant([0.0; 3]),
            }
        }
    };
    Ok(match bumps {
        Some(height) => Material::Bumped {
            base: Arc::new(material),
            height,
        },
        None => material,
    })
}

/// The colour that a medium under a surface looks like from outside, by diffusion
/// [PBRT3, 11.4.3 and 15.5]: from `sigma_a` and `sigma_s`, whose defaults are those of marble.
fn albedo(maker: &mut Maker<'_>, params: &Params) -> Result<[f32; 3], SceneError> {
    let absorbed = maker.color(params, "sigma_a", [0.0011, 0.0024, 0.014])?;
    let scattered = maker.color(params, "sigma_s", [2.55, 3.21, 3.77])?;
    let g = params.float(maker.s, "g")?.unwrap_or(0.0);
    Ok(std::array::from_fn(|i| {
        let scattered = scattered[i] * (1.0 - g);
        let part = scattered / (scattered + absorbed[i]).max(1e-9);
        let root = (3.0 * (1.0 - part)).max(0.0).sqrt();
        // Without the boundary's reflection from inside.
        part / 2.0 * (1.0 + (-4.0 / 3.0 * root).exp()) * (-root).exp()
    }))
}

/// Copper at red, green and blue: pbrt-v3's default metal, as RGB.
const COPPER_ETA: [f32; 3] = [0.200_438, 0.924_033, 1.102_212];
const COPPER_K: [f32; 3] = [3.912_949, 2.452_848, 2.142_188];

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
