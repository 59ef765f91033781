//! The size of a picture and the part of it that is rendered, as people write them.

use std::fmt;
use std::str::FromStr;

/// The size of a picture: `800x600`, or a width alone.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Resolution {
    /// Width and height, in pixels.
    Full(u32, u32),
    /// The width, in pixels; the height follows from the scene's proportions.
    Width(u32),
}

/// The widest and highest picture that can be asked for.
pub const MAX_SIDE: u32 = 65_536;

/// The most samples per pixel that can be asked for.
pub const MOST_SAMPLES: u32 = 1_000_000;

impl FromStr for Resolution {
    type Err = String;

    fn from_str(text: &str) -> Result<Resolution, String> {
        let side = |part: &str| {
            part.trim()
                .parse()
                .ok()
                .filter(|side| (1..=MAX_SIDE).contains(side))
                .ok_or_else(|| {
                    format!("a size is like 800x600 or 800, each number from 1 to {MAX_SIDE}")
                })
        };
        match text.split_once(['x', 'X', '×']) {
            Some((width, height)) => Ok(Resolution::Full(side(width)?, side(height)?)),
            None => Ok(Resolution::Width(side(text)?)),
        }
    }
}

impl fmt::Display for Resolution {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Resolution::Full(width, height) => write!(f, "{width}x{height}"),
            Resolution::Width(width) => write!(f, "{width}"),
        }
    }
}

impl Resolution {
    /// Width and height, given those of the scene.
    pub fn of(self, (width, height): (u32, u32)) -> (u32, u32) {
        match self {
            Resolution::Full(width, height) => (width, height),
            Resolution::Width(given) => {
                let proportion = f64::from(height) / f64::from(width.max(1));
                let height = (f64::from(given) * proportion).round() as u32;
                (given, height.clamp(1, MAX_SIDE))
            }
        }
    }
}

/// A part of a picture, `x0,x1,y0,y1` in fractions from its left and top.
///
/// # Errors
/// Not four numbers from 0 to 1, or nothing between them.
pub fn crop_named(text: &str) -> Result<[f32; 4], String> {
    let accepted = || {
        "a part of the picture is like 0.25,0.75,0,1: x0,x1,y0,y1 from 0 to 1, x0 < x1, y0 < y1"
            .to_owned()
    };
    let numbers: Vec<f32> = text
        .split(',')
        .map(|part| part.trim().parse().map_err(|_| accepted()))
        .collect::<Result<_, _>>()?;
    let crop: [f32; 4] = numbers.try_into().map_err(|_| accepted())?;
    let [x0, x1, y0, y1] = crop;
    let inside = crop.iter().all(|c| (0.0..=1.0).contains(c));
    (inside && x0 < x1 && y0 < y1)
        .then_some(crop)
        .ok_or_else(accepted)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_width_alone_keeps_the_proportions() {
        let parse = |text: &str| text.parse::<Resolution>();
        assert_eq!(parse("300").unwrap().of((1000, 500)), (300, 150));
        assert_eq!(parse("30x40").unwrap().of((1000, 500)), (30, 40));
        for wrong in ["", "0", "10x", "x10", "10x10x10", "-5", "1e3", "99999999"] {
            assert!(parse(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn a_crop_lies_inside_the_picture() {
        assert_eq!(crop_named("0, 0.5 ,0.25,1"), Ok([0.0, 0.5, 0.25, 1.0]));
        for wrong in [
            "",
            "0,1,0",
            "0.5,0.5,0,1",
            "0,1,0,1.5",
            "0,nan,0,1",
            "0,1,0,1,0",
        ] {
            assert!(crop_named(wrong).is_err(), "{wrong}");
        }
    }
}
