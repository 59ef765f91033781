//! Colours as linear RGB, with the sRGB primaries.
//!
//! pbrt-v3 renders in RGB unless it is built otherwise: `rgb` values are taken as they are, all
//! others are projected to RGB through CIE XYZ [PBRT3, 5.2]. Spectra are integrated against the
//! analytic fit of the CIE 1931 colour matching functions of [Wyman2013], which is within about
//! one percent of the tables that pbrt-v3 uses.

use super::params::{Param, Type, Values};
use super::source::Sources;
use crate::error::SceneError;

/// Wavelengths over which spectra are integrated, in nanometres.
const LAMBDA: std::ops::RangeInclusive<u32> = 360..=830;

/// From CIE XYZ to linear RGB with the sRGB primaries.
pub(crate) fn xyz_to_rgb([x, y, z]: [f64; 3]) -> [f32; 3] {
    [
        3.240_479 * x - 1.537_150 * y - 0.498_535 * z,
        -0.969_256 * x + 1.875_991 * y + 0.041_556 * z,
        0.055_648 * x - 0.204_043 * y + 1.057_311 * z,
    ]
    .map(|c| c as f32)
}

/// The CIE 1931 colour matching functions at a wavelength in nanometres: the multi-lobe fit
/// [Wyman2013, Listing 1].
fn matching_functions(lambda: f64) -> [f64; 3] {
    let lobe = |scale: f64, mean: f64, below: f64, above: f64| {
        let t = (lambda - mean) * if lambda < mean { below } else { above };
        scale * (-0.5 * t * t).exp()
    };
    [
        lobe(0.362, 442.0, 0.0624, 0.0374)
            + lobe(1.056, 599.8, 0.0264, 0.0323)
            + lobe(-0.065, 501.1, 0.0490, 0.0382),
        lobe(0.821, 568.8, 0.0213, 0.0247) + lobe(0.286, 530.9, 0.0613, 0.0322),
        lobe(1.217, 437.0, 0.0845, 0.0278) + lobe(0.681, 459.0, 0.0385, 0.0725),
    ]
}

/// The colour of a spectrum; 1 at all wavelengths has luminance 1.
fn of_spectrum(value: impl Fn(f64) -> f64) -> [f32; 3] {
    let mut xyz = [0.0; 3];
    let mut luminance_of_one = 0.0;
    for lambda in LAMBDA {
        let lambda = f64::from(lambda);
        let matching = matching_functions(lambda);
        let value = value(lambda);
        for (sum, m) in xyz.iter_mut().zip(matching) {
            *sum += value * m;
        }
        luminance_of_one += matching[1];
    }
    xyz_to_rgb(xyz.map(|sum| sum / luminance_of_one))
}

/// The colour of a spectrum given at some wavelengths, linear between them, constant outside.
fn of_samples(mut samples: Vec<(f64, f64)>) -> [f32; 3] {
    samples.sort_by(|a, b| a.0.total_cmp(&b.0));
    of_spectrum(|lambda| {
        let after = samples.partition_point(|&(at, _)| at <= lambda);
        match (after.checked_sub(1).map(|i| samples[i]), samples.get(after)) {
            (Some((l0, v0)), Some(&(l1, v1))) => v0 + (v1 - v0) * (lambda - l0) / (l1 - l0),
            (Some((_, v)), None) => v,
            (None, Some(&(_, v))) => v,
            (None, None) => 0.0,
        }
    })
}

/// The colour of a black body of `temperature` kelvins whose spectrum is scaled to a maximum
/// of 1, as pbrt-v3 does [PBRT3, 12.1.1].
pub(crate) fn of_blackbody(temperature: f64) -> [f32; 3] {
    if temperature <= 0.0 {
        return [0.0; 3];
    }
    /// Planck's constant times the speed of light over Boltzmann's constant, in metre kelvins.
    const SECOND_RADIATION: f64 = 1.438_776_877e-2;
    /// Wien's displacement constant, in metre kelvins.
    const WIEN: f64 = 2.897_772_1e-3;
    let planck =
        |metres: f64| metres.powi(-5) / ((SECOND_RADIATION / (metres * temperature)).exp_m1());
    let most = planck(WIEN / temperature);
    of_spectrum(|lambda| planck(lambda * 1e-9) / most)
}

/// The colour that a parameter gives; `None` where it names a file of a spectrum that is not there
/// or cannot be understood.
pub(crate) fn of_param(
    s: &Sources,
    param: &Param,
    find: &dyn Fn(&str) -> Option<std::path::PathBuf>,
) -> Result<Option<[f32; 3]>, SceneError> {
    let wrong = |takes: &str| {
        Err(s.error(
            param.span,
            format!("\"{}\" takes one colour: {takes}", param.name),
        ))
    };
    if let Values::Texts(files) = &param.values {
        let [file] = files.as_slice() else {
            return wrong("the name of one file");
        };
        let samples = find(file)
            .and_then(|path| std::fs::read_to_string(path).ok())
            .and_then(|text| pairs_of_text(&text));
        return Ok(samples.map(of_samples));
    }
    match (param.ty, param.numbers()) {
        (Type::Rgb, &[r, g, b]) => Ok(Some([r as f32, g as f32, b as f32])),
        (Type::Rgb, _) => wrong("three numbers"),
        (Type::Xyz, &[x, y, z]) => Ok(Some(xyz_to_rgb([x, y, z]))),
        (Type::Xyz, _) => wrong("three numbers"),
        (Type::Blackbody, &[temperature, scale]) => Ok(Some(
            of_blackbody(temperature).map(|c| (f64::from(c) * scale) as f32),
        )),
        // pbrt-v4's has a factor of its own.
        (Type::Blackbody, &[temperature]) => Ok(Some(of_blackbody(temperature))),
        (Type::Blackbody, _) => wrong("a temperature in kelvins and a factor"),
        (_, numbers) if numbers.len() >= 2 && numbers.len().is_multiple_of(2) => Ok(Some(
            of_samples(numbers.chunks_exact(2).map(|p| (p[0], p[1])).collect()),
        )),
        _ => wrong("pairs of a wavelength in nanometres and a value"),
    }
}

/// Pairs of wavelength and value, one a line, `#` starting a comment.
fn pairs_of_text(text: &str) -> Option<Vec<(f64, f64)>> {
    let mut numbers = Vec::new();
    for line in text.lines() {
        let line = line.split('#').next().unwrap_or_default();
        for word in line.split_whitespace() {
            numbers.push(
                word.parse::<f64>()
                    .ok()
                    .filter(|number| number.is_finite())?,
            );
        }
    }
    (numbers.len() >= 2 && numbers.len().is_multiple_of(2))
        .then(|| numbers.chunks_exact(2).map(|p| (p[0], p[1])).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_constant_spectrum_has_luminance_one() {
        let [r, g, b] = of_samples(vec![(400.0, 1.0), (700.0, 1.0)]);
        let luminance = 0.212_671 * r + 0.715_160 * g + 0.072_169 * b;
        assert!((luminance - 1.0).abs() < 1e-4, "{luminance}");
    }

    #[test]
    fn a_black_body_turns_from_red_to_blue() {
        let [r, _, b] = of_blackbody(2500.0);
        assert!(r > 3.0 * b.max(0.0), "{r} {b}");
        let [r, _, b] = of_blackbody(12000.0);
        assert!(b > r, "{r} {b}");
    }
}
