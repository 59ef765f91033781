//! Camera, film, filter, sampler, integrator and accelerator. Defaults are pbrt-v3's.

use splitplane::{TreeChoice, TreeSpec};

use super::directive::Directive;
use super::params::Type;
use super::source::Sources;
use crate::error::SceneError;
use crate::scene::camera::{Camera, Projection};
use crate::scene::geometry::Notes;
use crate::scene::settings::{Film, Filter, Integrator, LightStrategy, Sampler, SamplerKind};
use crate::transform::Transform;

/// What stands before WorldBegin.
#[derive(Debug)]
pub(crate) struct Settings {
    pub(crate) camera: Camera,
    pub(crate) film: Film,
    pub(crate) filter: Filter,
    pub(crate) sampler: Sampler,
    pub(crate) integrator: Integrator,
    pub(crate) accelerator: Option<String>,
}

impl Default for Settings {
    fn default() -> Self {
        Settings {
            camera: Camera {
                camera_to_world: Transform::IDENTITY,
                projection: Projection::Perspective,
                fov: 90.0,
                screen_window: None,
                frame_aspect_ratio: None,
                lens_radius: 0.0,
                focal_distance: 1e6,
            },
            film: Film {
                width: 640,
                height: 480,
                crop: [0.0, 1.0, 0.0, 1.0],
                scale: 1.0,
                max_sample_luminance: f32::INFINITY,
            },
            filter: Filter::Box { radius: [0.5; 2] },
            sampler: Sampler {
                kind: SamplerKind::Halton {
                    sample_at_center: false,
                },
                samples_per_pixel: 16,
            },
            integrator: Integrator::Path {
                max_depth: 5,
                rr_threshold: 1.0,
                light_strategy: LightStrategy::Spatial,
            },
            accelerator: None,
        }
    }
}

/// A number that must be above zero.
fn positive(s: &Sources, d: &Directive, name: &str, default: f32) -> Result<f32, SceneError> {
    let value = d.params.float(s, name)?.unwrap_or(default);
    if value > 0.0 {
        return Ok(value);
    }
    let span = d.params.get(name).map_or(d.span, |param| param.span);
    Err(s.error(span, format!("\"{name}\" is {value}; it must be above 0")))
}

/// Four numbers.
fn four(s: &Sources, d: &Directive, name: &str) -> Result<Option<[f32; 4]>, SceneError> {
    let Some(param) = d.params.numbers(s, name, &[Type::Float])? else {
        return Ok(None);
    };
    match *param.numbers() {
        [a, b, c, d] => Ok(Some([a, b, c, d].map(|v| v as f32))),
        ref numbers => Err(s.error(
            param.span,
            format!("\"{name}\" has {} numbers; it takes four", numbers.len()),
        )),
    }
}

pub(crate) fn camera(
    s: &Sources,
    d: &Directive,
    world_to_camera: &Transform,
    notes: &mut Notes,
) -> Result<Camera, SceneError> {
    let projection = match d.name() {
        "perspective" | "realistic" => Projection::Perspective,
        "orthographic" => Projection::Orthographic,
        "environment" => Projection::Environment,
        _ => Projection::Perspective,
    };
    if !matches!(d.name(), "perspective" | "orthographic" | "environment") {
        notes.warn(
            &format!("camera {}", d.name()),
            || s.place(d.span),
            format!(
                "the camera \"{}\" is not supported; rendered as perspective",
                d.name()
            ),
        );
        d.params.ignore_all();
    }
    let mut fov = positive(s, d, "fov", 90.0)?;
    if let Some(half) = d.params.float(s, "halffov")?
        && half > 0.0
    {
        fov = 2.0 * half;
    }
    if fov >= 180.0 {
        let span = d.params.get("fov").map_or(d.span, |param| param.span);
        return Err(s.error(
            span,
            format!("the field of view is {fov}°; it must be below 180°"),
        ));
    }
    let screen_window = four(s, d, "screenwindow")?;
    if let Some([x0, x1, y0, y1]) = screen_window
        && (x0 == x1 || y0 == y1)
    {
        let span = d
            .params
            .get("screenwindow")
            .map_or(d.span, |param| param.span);
        return Err(s.error(span, "\"screenwindow\" is empty; it takes [x0 x1 y0 y1]"));
    }
    let frame_aspect_ratio = match d.params.has("frameaspectratio") {
        true => Some(positive(s, d, "frameaspectratio", 1.0)?),
        false => None,
    };
    d.params.ignore(&["shutteropen", "shutterclose"]);
    Ok(Camera {
        camera_to_world: world_to_camera.inverse(),
        projection,
        fov,
        screen_window,
        frame_aspect_ratio,
        lens_radius: d.params.float(s, "lensradius")?.unwrap_or(0.0).max(0.0),
        focal_distance: positive(s, d, "focaldistance", 1e6)?,
    })
}

pub(crate) fn film(s: &Sources, d: &Directive, notes: &mut Notes) -> Result<Film, SceneError> {
    /// The largest picture, along one side.
    const LARGEST: u32 = 1 << 16;
    if d.name() != "image" {
        notes.warn(
            &format!("film {}", d.name()),
            || s.place(d.span),
            format!(
                "the film \"{}\" is not supported; rendered as \"image\"",
                d.name()
            ),
        );
    }
    d.params.ignore(&["filename", "diagonal"]);
    let mut crop = four(s, d, "cropwindow")?.unwrap_or([0.0, 1.0, 0.0, 1.0]);
    let [x0, x1, y0, y1] = crop.map(|c| c.clamp(0.0, 1.0));
    crop = [x0.min(x1), x0.max(x1), y0.min(y1), y0.max(y1)];
    if crop[0] >= crop[1] || crop[2] >= crop[3] {
        let span = d
            .params
            .get("cropwindow")
            .map_or(d.span, |param| param.span);
        return Err(s.error(
            span,
            "\"cropwindow\" is empty; it takes [x0 x1 y0 y1] within 0 to 1",
        ));
    }
    Ok(Film {
        width: d
            .params
            .integer_in(s, "xresolution", 1..=LARGEST)?
            .unwrap_or(640),
        height: d
            .params
            .integer_in(s, "yresolution", 1..=LARGEST)?
            .unwrap_or(480),
        crop,
        scale: d.params.float(s, "scale")?.unwrap_or(1.0),
        max_sample_luminance: d
            .params
            .float(s, "maxsampleluminance")?
            .unwrap_or(f32::INFINITY),
    })
}

pub(crate) fn filter(s: &Sources, d: &Directive, notes: &mut Notes) -> Result<Filter, SceneError> {
    let width = |name: &str, default: f32| -> Result<f32, SceneError> {
        let width = positive(s, d, name, default)?;
        if width <= Filter::MAX_RADIUS {
            return Ok(width);
        }
        let span = d.params.get(name).map_or(d.span, |param| param.span);
        Err(s.error(
            span,
            format!(
                "\"{name}\" is {width}; it can be up to {} pixels",
                Filter::MAX_RADIUS
            ),
        ))
    };
    let radius = |default: f32| -> Result<[f32; 2], SceneError> {
        Ok([width("xwidth", default)?, width("ywidth", default)?])
    };
    let float = |name: &str, default: f32| -> Result<f32, SceneError> {
        Ok(d.params.float(s, name)?.unwrap_or(default))
    };
    Ok(match d.name() {
        "box" => Filter::Box {
            radius: radius(0.5)?,
        },
        "triangle" => Filter::Triangle {
            radius: radius(2.0)?,
        },
        "gaussian" => Filter::Gaussian {
            radius: radius(2.0)?,
            alpha: float("alpha", 2.0)?,
        },
        "mitchell" => Filter::Mitchell {
            radius: radius(2.0)?,
            b: float("B", 1.0 / 3.0)?,
            c: float("C", 1.0 / 3.0)?,
        },
        "sinc" => Filter::Sinc {
            radius: radius(4.0)?,
            tau: positive(s, d, "tau", 3.0)?,
        },
        other => {
            notes.warn(
                &format!("filter {other}"),
                || s.place(d.span),
                format!("the filter \"{other}\" is not supported; rendered with \"mitchell\""),
            );
            d.params.ignore_all();
            Filter::Mitchell {
                radius: [2.0; 2],
                b: 1.0 / 3.0,
                c: 1.0 / 3.0,
            }
        }
    })
}

pub(crate) fn sampler(
    s: &Sources,
    d: &Directive,
    notes: &mut Notes,
) -> Result<Sampler, SceneError> {
    /// The most samples per pixel.
    const MOST: u32 = 1 << 24;
    let count = |name: &str, default: u32| -> Result<u32, SceneError> {
        Ok(d.params.integer_in(s, name, 1..=MOST)?.unwrap_or(default))
    };
    let halton = SamplerKind::Halton {
        sample_at_center: d.params.bool(s, "samplepixelcenter")?.unwrap_or(false),
    };
    let dimensions = || -> Result<u32, SceneError> {
        Ok(d.params.integer_in(s, "dimensions", 0..=64)?.unwrap_or(4))
    };
    let (kind, samples_per_pixel) = match d.name() {
        "halton" => (halton, count("pixelsamples", 16)?),
        "random" => (SamplerKind::Random, count("pixelsamples", 4)?),
        "sobol" => (SamplerKind::Sobol, count("pixelsamples", 16)?),
        "stratified" => {
            let columns = count("xsamples", 4)?;
            let stratified = SamplerKind::Stratified {
                columns,
                jitter: d.params.bool(s, "jitter")?.unwrap_or(true),
                dimensions: dimensions()?,
            };
            let samples = columns.saturating_mul(count("ysamples", 4)?).min(MOST);
            (stratified, samples)
        }
        "02sequence" | "lowdiscrepancy" => (
            SamplerKind::ZeroTwo {
                dimensions: dimensions()?,
            },
            count("pixelsamples", 16)?,
        ),
        "maxmindist" => {
            notes.warn(
                "sampler maxmindist",
                || s.place(d.span),
                "the sampler \"maxmindist\" is not supported; rendered with \"02sequence\""
                    .to_owned(),
            );
            let kind = SamplerKind::ZeroTwo {
                dimensions: dimensions()?,
            };
            (kind, count("pixelsamples", 16)?)
        }
        other => {
            notes.warn(
                &format!("sampler {other}"),
                || s.place(d.span),
                format!("the sampler \"{other}\" is not supported; rendered with \"halton\""),
            );
            d.params.ignore_all();
            (halton, count("pixelsamples", 16)?)
        }
    };
    Ok(Sampler {
        kind,
        samples_per_pixel,
    })
}

pub(crate) fn integrator(
    s: &Sources,
    d: &Directive,
    notes: &mut Notes,
) -> Result<Integrator, SceneError> {
    let max_depth = |d: &Directive| -> Result<u32, SceneError> {
        Ok(d.params
            .integer_in(s, "maxdepth", 0..=1_000_000)?
            .unwrap_or(5))
    };
    match d.name() {
        "directlighting" => {
            let all_lights = match d.params.text(s, "strategy")? {
                None | Some("all") => true,
                Some("one") => false,
                Some(other) => {
                    let span = d.params.get("strategy").map_or(d.span, |param| param.span);
                    return Err(s.error(
                        span,
                        format!("\"{other}\" is not a strategy; there are \"all\" and \"one\""),
                    ));
                }
            };
            return Ok(Integrator::Direct {
                max_depth: max_depth(d)?,
                all_lights,
            });
        }
        "ambientocclusion" | "ao" => {
            return Ok(Integrator::AmbientOcclusion {
                cosine: d.params.bool(s, "cossample")?.unwrap_or(true),
                samples: d
                    .params
                    .integer_in(s, "nsamples", 1..=1 << 20)?
                    .unwrap_or(64),
            });
        }
        "whitted" => {
            return Ok(Integrator::Whitted {
                max_depth: max_depth(d)?,
            });
        }
        "path" => {}
        other => {
            notes.warn(
                &format!("integrator {other}"),
                || s.place(d.span),
                format!("the integrator \"{other}\" is not supported; rendered with \"path\""),
            );
            d.params.ignore_all();
        }
    }
    let light_strategy = match d.params.text(s, "lightsamplestrategy")? {
        None | Some("spatial") => LightStrategy::Spatial,
        Some("uniform") => LightStrategy::Uniform,
        Some("power") => LightStrategy::Power,
        Some(other) => {
            let span = d
                .params
                .get("lightsamplestrategy")
                .map_or(d.span, |param| param.span);
            return Err(s.error(
                span,
                format!(
                    "\"{other}\" is not a strategy; there are \"uniform\", \"power\" and \"spatial\""
                ),
            ));
        }
    };
    Ok(Integrator::Path {
        max_depth: max_depth(d)?,
        rr_threshold: d.params.float(s, "rrthreshold")?.unwrap_or(1.0),
        light_strategy,
    })
}

/// The tree that the file asks for, where it is one of ours.
pub(crate) fn accelerator(
    s: &Sources,
    d: &Directive,
    notes: &mut Notes,
) -> Result<Option<String>, SceneError> {
    let count = d.params.integer_in(s, "nbDirections", 0..=u32::MAX)?;
    let Some(spec) = TreeSpec::named(d.name()) else {
        notes.tell(
            s.place(d.span),
            format!(
                "the accelerator \"{}\" is none of our trees; the choice is free",
                d.name()
            ),
        );
        return Ok(None);
    };
    let count = if spec.takes_direction_count() {
        count
    } else {
        None
    };
    match TreeChoice::new(spec.name, count) {
        Ok(choice) => Ok(Some(choice.to_string())),
        Err(error) => Err(s.error(d.span, error.to_string())),
    }
}
