//! A library of materials of OBJ files.

use std::path::Path;

use super::image_file::{Channels, Decoding, Images};
use super::light::AreaLight;
use super::material::Material;
use super::obj_file::{first_word, lines, numbers};
use super::pbrt::shortened;
use super::texture::{ImageFilter, Mapping, Texture, TextureRef, Wrap};
use super::view;

/// A material as its library has it.
#[derive(Debug, Default)]
pub(crate) struct Mtl {
    diffuse: Option<[f32; 3]>,
    specular: Option<[f32; 3]>,
    emissive: Option<[f32; 3]>,
    shininess: Option<f32>,
    optical_density: Option<f32>,
    dissolve: Option<f32>,
    illumination_model: Option<u8>,
    diffuse_map: Option<Map>,
    dissolve_map: Option<Map>,
    /// What is said of it and has no effect here, with the lines.
    unsupported: Vec<(u32, String)>,
}

/// An image, and where it lies.
#[derive(Debug)]
struct Map {
    file: String,
    scale: [f32; 2],
    shift: [f32; 2],
}

/// The materials of the library at `path`, with their names.
///
/// # Errors
/// A message, with the line where one is at fault.
pub(crate) fn read(path: &Path) -> Result<Vec<(String, Mtl)>, String> {
    let bytes = std::fs::read(path).map_err(|error| error.to_string())?;
    let mut materials: Vec<(String, Mtl)> = Vec::new();
    for (number, line) in lines(&bytes) {
        let (key, rest) = first_word(&line);
        if key.is_empty() || key.starts_with('#') {
            continue;
        }
        let wrong = |message: String| format!("line {number}: {message}");
        if key.eq_ignore_ascii_case("newmtl") {
            if rest.is_empty() {
                return Err(wrong("newmtl gives no name".to_owned()));
            }
            materials.push((rest.to_owned(), Mtl::default()));
        } else if let Some((_, material)) = materials.last_mut() {
            material.set(number, key, rest).map_err(wrong)?;
        }
    }
    Ok(materials)
}

/// What changes nothing where all its numbers are 0.
const NOTHING_AT_ZERO: [&str; 7] = ["tr", "pm", "ps", "pc", "pcr", "aniso", "anisor"];

impl Mtl {
    fn set(&mut self, line: u32, key: &str, rest: &str) -> Result<(), String> {
        match key.to_ascii_lowercase().as_str() {
            "kd" => self.diffuse = Some(color(key, rest)?),
            "ks" => self.specular = Some(color(key, rest)?),
            "ke" => self.emissive = Some(color(key, rest)?),
            "ns" => self.shininess = Some(number(key, rest)?),
            "ni" => self.optical_density = Some(number(key, rest)?),
            "d" => self.dissolve = Some(number(key, rest)?),
            "illum" => self.illumination_model = Some(number(key, rest)? as u8),
            "map_kd" => self.diffuse_map = Some(self.map(line, key, rest)?),
            "map_d" => self.dissolve_map = Some(self.map(line, key, rest)?),
            // There is no light from nowhere that they could reflect.
            "ka" => _ = color(key, rest)?,
            "map_ka" => {}
            lower => {
                let all = |value: f32| {
                    let is = |word: &str| word.parse() == Ok(value);
                    rest.split_whitespace().all(is)
                };
                let nothing = match lower {
                    "tf" => all(1.0),
                    _ => NOTHING_AT_ZERO.contains(&lower) && all(0.0),
                };
                if !nothing {
                    self.unsupported.push((line, shortened(key)));
                }
            }
        }
        Ok(())
    }

    /// The image that a map names: options come first, then the name, which may have spaces in it.
    fn map(&mut self, line: u32, key: &str, rest: &str) -> Result<Map, String> {
        let mut map = Map {
            file: String::new(),
            scale: [1.0; 2],
            shift: [0.0; 2],
        };
        let mut name = rest;
        loop {
            let (word, after) = first_word(name);
            let Some(option) = OPTIONS.iter().find(|option| option.name == word) else {
                break;
            };
            let mut arguments = Vec::new();
            name = after;
            while arguments.len() < option.most {
                let (word, after) = first_word(name);
                if arguments.len() >= option.least && word.parse::<f32>().is_err() {
                    break;
                }
                arguments.push(word);
                name = after;
            }
            let placed = match option.name {
                "-s" => Some(&mut map.scale),
                "-o" => Some(&mut map.shift),
                _ => None,
            };
            match placed {
                // The third number is for textures in space.
                Some(placed) => {
                    for (own, argument) in placed.iter_mut().zip(&arguments) {
                        *own = number(option.name, argument)?;
                    }
                }
                None if option.changes(&arguments) => {
                    let what = format!("{key} {} {}", option.name, arguments.join(" "));
                    self.unsupported.push((line, shortened(&what)));
                }
                None => {}
            }
        }
        if name.is_empty() {
            return Err(format!("{key} names no image"));
        }
        map.file = name.replace('\\', "/");
        Ok(map)
    }

    /// What is said of it and has no effect here, with the lines.
    pub(crate) fn unsupported(&self) -> impl Iterator<Item = &(u32, String)> {
        // Beside `d`, `Tr` says the same once more.
        let said = |key: &str| self.dissolve.is_some() && key.eq_ignore_ascii_case("tr");
        self.unsupported.iter().filter(move |(_, key)| !said(key))
    }

    /// The material, the light that it gives off, and where it is not there; images are looked for
    /// in `folder`.
    pub(crate) fn made(&self, folder: &Path, images: &mut Images) -> Made {
        let mut image = |map: &Map, channels: Channels| -> TextureRef {
            let decoding = Decoding {
                srgb: channels == Channels::Color,
                channels,
                wrap: Wrap::Repeat,
            };
            TextureRef::new(Texture::Image {
                image: images.get(&folder.join(&map.file), decoding),
                mapping: Mapping::Uv {
                    scale: map.scale,
                    shift: map.shift,
                },
                filter: ImageFilter::DEFAULT,
                scale: 1.0,
            })
        };
        // A factor of zero beside a map is a mistake of the file's writer.
        let diffuse = self.diffuse.unwrap_or([0.6; 3]);
        let kd = match &self.diffuse_map {
            Some(map) => {
                let factor = if diffuse == [0.0; 3] {
                    [1.0; 3]
                } else {
                    diffuse
                };
                TextureRef::new(Texture::Scale(
                    view::color(factor),
                    image(map, Channels::Color),
                ))
            }
            None => view::color(diffuse),
        };
        let alpha = self.dissolve_map.as_ref().map(|map| {
            TextureRef::new(Texture::AtLeast {
                texture: image(map, Channels::Luminance),
                threshold: 0.5,
            })
        });
        let specular = self.specular.unwrap_or([0.0; 3]);
        let width = (2.0 / (self.shininess.unwrap_or(10.0).max(0.0) + 2.0)).sqrt();
        let roughness = || [view::color([width; 3]), view::color([width; 3])];
        let opacity = self.dissolve.unwrap_or(1.0);
        let model = self.illumination_model.unwrap_or(2);
        let index = self.optical_density.filter(|&n| n > 1.0).unwrap_or(1.5);
        let material = if opacity < 1.0 && matches!(model, 4 | 6 | 7 | 9) {
            Material::Glass {
                kr: view::color([1.0; 3]),
                kt: view::color([1.0; 3]),
                eta: view::color([index; 3]),
                roughness: [view::color([0.0; 3]), view::color([0.0; 3])],
                remap_roughness: false,
            }
        } else if opacity < 1.0 {
            Material::Uber {
                kd,
                ks: view::color(specular),
                kr: view::color([0.0; 3]),
                kt: view::color([0.0; 3]),
                roughness: roughness(),
                opacity: view::color([opacity; 3]),
                eta: view::color([index; 3]),
                remap_roughness: false,
            }
        } else if specular == [0.0; 3] || model < 2 {
            Material::Matte {
                kd,
                sigma: view::color([0.0; 3]),
            }
        } else {
            Material::Substrate {
                kd,
                ks: view::color(specular),
                roughness: roughness(),
                remap_roughness: false,
            }
        };
        let light = match self.emissive {
            Some([r, g, b]) if r.max(g).max(b) > 0.0 && (r + g + b).is_finite() => {
                Some(AreaLight {
                    radiance: [r, g, b].map(|c| c.max(0.0)),
                    two_sided: false,
                    after: 0,
                })
            }
            _ => None,
        };
        (material, light, alpha)
    }
}

type Made = (Material, Option<AreaLight>, Option<TextureRef>);

/// An option of a map.
struct MapOption {
    name: &'static str,
    /// How many arguments it has; those beyond the least are numbers.
    least: usize,
    most: usize,
    /// Its arguments where it changes nothing; none where it never does, for an image of colours.
    neutral: &'static [&'static str],
}

const fn option(
    name: &'static str,
    least: usize,
    most: usize,
    neutral: &'static [&'static str],
) -> MapOption {
    MapOption {
        name,
        least,
        most,
        neutral,
    }
}

const OPTIONS: [MapOption; 13] = [
    option("-s", 1, 3, &["1", "1", "1"]),
    option("-o", 1, 3, &["0", "0", "0"]),
    option("-t", 1, 3, &["0", "0", "0"]),
    option("-mm", 2, 2, &["0", "1"]),
    option("-blendu", 1, 1, &["on"]),
    option("-blendv", 1, 1, &["on"]),
    option("-boost", 1, 1, &["0"]),
    option("-cc", 1, 1, &["off"]),
    option("-clamp", 1, 1, &["off"]),
    option("-imfchan", 1, 1, &["l"]),
    option("-type", 1, 1, &["none"]),
    option("-bm", 1, 1, &[]),
    option("-texres", 1, 1, &[]),
];

impl MapOption {
    fn changes(&self, arguments: &[&str]) -> bool {
        let same = |a: &str, b: &str| match (a.parse::<f32>(), b.parse::<f32>()) {
            (Ok(a), Ok(b)) => a == b,
            _ => a == b,
        };
        let mut pairs = arguments.iter().zip(self.neutral);
        pairs.any(|(given, neutral)| !same(given, neutral))
    }
}

/// A colour; where it is given by its red alone, that is its green and blue too.
fn color(key: &str, rest: &str) -> Result<[f32; 3], String> {
    let words = || rest.split_whitespace();
    let found = match words().count() {
        1 => numbers(words()).map(|[red]| [red; 3]),
        _ => numbers(words()),
    };
    found.map_err(|wrong| wrong_number(key, "one or three numbers", wrong))
}

fn number(key: &str, rest: &str) -> Result<f32, String> {
    let found = numbers(rest.split_whitespace());
    found
        .map(|[number]| number)
        .map_err(|wrong| wrong_number(key, "a number", wrong))
}

fn wrong_number(key: &str, takes: &str, word: Option<&str>) -> String {
    match word {
        Some(word) => format!("{key} takes {takes}; \"{}\" is none", shortened(word)),
        None => format!("{key} takes {takes}"),
    }
}
