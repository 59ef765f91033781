//! Lights. Defaults are pbrt-v3's [PBRT3, 12].

use std::sync::Arc;

use glam::Vec3;

use super::directive::Directive;
use super::lexer::shortened;
use super::params::Type;
use super::textures::Maker;
use crate::error::SceneError;
use crate::scene::image_file::{Channels, Decoding};
use crate::scene::light::{AreaLight, Light, SphereMap};
use crate::scene::texture::{Image, Wrap};
use crate::transform::Transform;

/// A colour parameter times `"scale"`.
fn scaled(maker: &mut Maker<'_>, d: &Directive, name: &str) -> Result<[f32; 3], SceneError> {
    let color = maker.color(&d.params, name, [1.0; 3])?;
    let scale = maker.color(&d.params, "scale", [1.0; 3])?;
    Ok(std::array::from_fn(|i| color[i] * scale[i]))
}

fn no_direction(maker: &Maker<'_>, d: &Directive) -> SceneError {
    maker.s.error(
        d.span,
        "\"from\" and \"to\" of this light are the same point; it has no direction",
    )
}

/// The picture that a light's `"mapname"` names, with its values as they are in the file.
fn map(
    maker: &mut Maker<'_>,
    d: &Directive,
    without: &str,
    wrap: Wrap,
) -> Result<Option<Arc<Image>>, SceneError> {
    let decoding = Decoding {
        srgb: false,
        channels: Channels::Color,
        wrap,
    };
    Ok(match d.params.text(maker.s, "mapname")? {
        Some(name) if !name.is_empty() => maker.image(d, name, decoding, without),
        _ => None,
    })
}

/// The light that a LightSource directive gives; `None` where it is left out.
pub(crate) fn light(
    maker: &mut Maker<'_>,
    d: &Directive,
    to_world: &Transform,
    is_v4: bool,
) -> Result<Option<Light>, SceneError> {
    let (sphere, wrap) = match is_v4 {
        true => (SphereMap::EqualArea, Wrap::Clamp),
        false => (SphereMap::LongitudeLatitude, Wrap::Repeat),
    };
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
                return Err(no_direction(maker, d));
            };
            Some(Light::Distant {
                towards: towards.into(),
                radiance: scaled(maker, d, "L")?,
            })
        }
        "infinite" | "exinfinite" => {
            d.params.ignore(&["nsamples", "samples"]);
            Some(Light::Infinite {
                radiance: scaled(maker, d, "L")?,
                map: map(maker, d, "rendered as if it were white", wrap)?,
                sphere,
                to_world: *to_world,
            })
        }
        "spot" => {
            let degrees = |names: [&str; 2], default: f32| -> Result<f32, SceneError> {
                for name in names {
                    if let Some(value) = d.params.float(maker.s, name)? {
                        return Ok(value);
                    }
                }
                Ok(default)
            };
            let cone = degrees(["coneangle", "coneangle"], 30.0)?;
            let delta = degrees(["conedelta", "conedeltaangle"], 5.0)?;
            let axis = Vec3::from(to_world.vector((Vec3::from(to) - Vec3::from(from)).into()));
            let Some(direction) = axis.try_normalize() else {
                return Err(no_direction(maker, d));
            };
            Some(Light::Spot {
                position: to_world.point(from),
                direction: direction.into(),
                intensity: scaled(maker, d, "I")?,
                cos_inner: (cone - delta).to_radians().cos(),
                cos_outer: cone.to_radians().cos(),
            })
        }
        "goniometric" => {
            d.params.ignore(&["fov"]);
            Some(Light::Goniometric {
                to_world: *to_world,
                intensity: scaled(maker, d, "I")?,
                map: map(maker, d, "rendered the same in all directions", wrap)?,
                sphere,
            })
        }
        "projection" => {
            let fov = d.params.float(maker.s, "fov")?.unwrap_or(45.0);
            if !(fov > 0.0 && fov < 180.0) {
                return Err(maker.s.error(
                    d.span,
                    format!("the field of view is {fov}°; it must be above 0° and below 180°"),
                ));
            }
            Some(Light::Projection {
                to_world: *to_world,
                intensity: scaled(maker, d, "I")?,
                fov,
                map: map(maker, d, "rendered as a white square", Wrap::Repeat)?,
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
        after: 0,
    }))
}
