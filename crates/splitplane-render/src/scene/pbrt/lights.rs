//! Lights. Defaults are pbrt-v3's [PBRT3, 12].

use glam::Vec3;

use super::directive::Directive;
use super::lexer::shortened;
use super::params::Type;
use super::textures::{Maker, mean};
use crate::error::SceneError;
use crate::scene::image_file::Decoding;
use crate::scene::light::{AreaLight, Light};
use crate::scene::texture::{Texture, Wrap};
use crate::transform::Transform;

/// A colour parameter times `"scale"`.
fn scaled(maker: &mut Maker<'_>, d: &Directive, name: &str) -> Result<[f32; 3], SceneError> {
    let color = maker.color(&d.params, name, [1.0; 3])?;
    let scale = maker.color(&d.params, "scale", [1.0; 3])?;
    Ok(std::array::from_fn(|i| color[i] * scale[i]))
}

/// The light that a LightSource directive gives; `None` where it is left out.
pub(crate) fn light(
    maker: &mut Maker<'_>,
    d: &Directive,
    to_world: &Transform,
) -> Result<Option<Light>, SceneError> {
    let point = |name: &str, default: [f32; 3]| -> Result<[f32; 3], SceneError> {
        Ok(d.params
            .triple(maker.s, name, Type::Point3)?
            .unwrap_or(default))
    };
    let from = point("from", [0.0; 3])?;
    let to = point("to", [0.0, 0.0, 1.0])?;
    let kind = d.name();
    let what = format!("the light \"{}\"", shortened(kind));
    Ok(match kind {
        "point" => Some(Light::Point {
            position: to_world.point(from),
            intensity: scaled(maker, d, "I")?,
        }),
        "distant" => {
            let towards = Vec3::from(to_world.vector((Vec3::from(from) - Vec3::from(to)).into()));
            let Some(towards) = towards.try_normalize() else {
                return Err(maker.s.error(
                    d.span,
                    "\"from\" and \"to\" of this light are the same point; it has no direction",
                ));
            };
            Some(Light::Distant {
                towards: towards.into(),
                radiance: scaled(maker, d, "L")?,
            })
        }
        "infinite" | "exinfinite" => {
            d.params.ignore(&["nsamples", "samples"]);
            let mut radiance = scaled(maker, d, "L")?;
            if let Some(map) = d.params.text(maker.s, "mapname")? {
                let found = (maker.find)(map, d.span);
                let decoding = Decoding {
                    srgb: false,
                    gray: false,
                };
                let image = match found {
                    None => Err("there is no such file".to_owned()),
                    Some(path) => maker.images.get(&path, decoding),
                };
                let outcome = match image {
                    Ok(image) => {
                        let mapping = [1.0, 1.0, 0.0, 0.0];
                        let map = Texture::Image {
                            image,
                            mapping,
                            wrap: Wrap::Repeat,
                        };
                        let mean = mean(&map);
                        radiance = std::array::from_fn(|i| radiance[i] * mean[i]);
                        "rendered with its mean colour".to_owned()
                    }
                    Err(reason) => format!("it cannot be read either ({reason}); rendered without"),
                };
                maker.notes.warn(
                    &format!("environment map {map}"),
                    || maker.s.place(d.span),
                    format!(
                        "the environment map \"{}\" is not supported; {outcome}",
                        shortened(map)
                    ),
                );
            }
            Some(Light::Infinite { radiance })
        }
        "spot" | "goniometric" | "projection" => {
            let position = if kind == "spot" { from } else { [0.0; 3] };
            let intensity = scaled(maker, d, "I")?;
            d.params.ignore_all();
            maker.replaced(d.span, &what, "\"point\", which shines in all directions");
            Some(Light::Point {
                position: to_world.point(position),
                intensity,
            })
        }
        _ => {
            d.params.ignore_all();
            maker.notes.warn(
                &what,
                || maker.s.place(d.span),
                format!("{what} is not supported; left out"),
            );
            None
        }
    })
}

/// The light that an AreaLightSource directive gives to the shapes after it.
pub(crate) fn area_light(
    maker: &mut Maker<'_>,
    d: &Directive,
) -> Result<Option<AreaLight>, SceneError> {
    if !matches!(d.name(), "diffuse" | "area") {
        d.params.ignore_all();
        let what = format!("the area light \"{}\"", shortened(d.name()));
        maker.notes.warn(
            &what,
            || maker.s.place(d.span),
            format!("{what} is not supported; left out"),
        );
        return Ok(None);
    }
    d.params.ignore(&["nsamples", "samples"]);
    Ok(Some(AreaLight {
        radiance: scaled(maker, d, "L")?,
        two_sided: d.params.bool(maker.s, "twosided")?.unwrap_or(false),
    }))
}
