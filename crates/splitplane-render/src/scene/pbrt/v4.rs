//! pbrt-v4's spelling of what pbrt-v3 also has: directives are put into pbrt-v3's words before
//! anything else looks at them [PBRT4; its file format's page].

use super::directive::{Directive, Word};
use super::params::{Param, Params, Type, Values};
use super::source::Span;

/// Words that only pbrt-v4's files have.
const MARKS: &[&str] = &[
    "Attribute",
    "Option",
    "ColorSpace",
    "Import",
    "\"diffuse\"",
    "\"coateddiffuse\"",
    "\"dielectric\"",
    "\"thindielectric\"",
    "\"conductor\"",
    "\"coatedconductor\"",
    "\"diffusetransmission\"",
    "\"zsobol\"",
    "\"paddedsobol\"",
    "\"pmj02bn\"",
    "\"independent\"",
    "\"bilinearmesh\"",
    "\"interface\"",
];

/// Whether a scene's main file is of pbrt-v4: its world has no end, and a word of it is only there.
pub(crate) fn is_v4(text: &[u8]) -> bool {
    let mut marked = false;
    for line in text.split(|&b| b == b'\n') {
        let line = line.split(|&b| b == b'#').next().unwrap_or_default();
        for word in line.split(|b| b.is_ascii_whitespace() || matches!(b, b'[' | b']')) {
            if word == b"WorldEnd" {
                return false;
            }
            marked |= MARKS.iter().any(|mark| mark.as_bytes() == word);
        }
    }
    marked
}

/// Spectra that have a name: their colours as linear RGB.
const SPECTRA: &[(&str, [f64; 3])] = &[
    ("metal-Ag-eta", [0.155, 0.117, 0.138]),
    ("metal-Ag-k", [4.828, 3.122, 2.147]),
    ("metal-Al-eta", [1.657, 0.880, 0.521]),
    ("metal-Al-k", [9.224, 6.270, 4.837]),
    ("metal-Au-eta", [0.143, 0.375, 1.442]),
    ("metal-Au-k", [3.983, 2.386, 1.603]),
    ("metal-Cu-eta", [0.200_438, 0.924_033, 1.102_212]),
    ("metal-Cu-k", [3.912_949, 2.452_848, 2.142_188]),
    ("metal-CuZn-eta", [0.444, 0.527, 1.094]),
    ("metal-CuZn-k", [3.695, 2.765, 1.829]),
    ("metal-MgO-eta", [1.735, 1.740, 1.751]),
    ("metal-MgO-k", [0.0, 0.0, 0.0]),
    ("metal-TiO2-eta", [2.574, 2.659, 2.872]),
    ("metal-TiO2-k", [0.0, 0.0, 0.0]),
    ("glass-BK7", [1.517, 1.517, 1.517]),
    ("glass-BAF10", [1.670, 1.670, 1.670]),
    ("glass-FK51A", [1.487, 1.487, 1.487]),
    ("glass-LASF9", [1.850, 1.850, 1.850]),
    ("glass-F5", [1.603, 1.603, 1.603]),
    ("glass-F10", [1.623, 1.623, 1.623]),
    ("glass-F11", [1.621, 1.621, 1.621]),
    ("glass-SF5", [1.673, 1.673, 1.673]),
    ("glass-SF10", [1.728, 1.728, 1.728]),
    ("glass-SF11", [1.785, 1.785, 1.785]),
];

/// The directive in pbrt-v3's words.
pub(crate) fn translated(mut d: Directive) -> Directive {
    for param in &mut d.params.list {
        plain_spectrum(param);
    }
    match d.word {
        Word::Material => {
            let kind = material(&d.names[0], &mut d.params, d.span);
            d.names[0] = kind;
        }
        Word::MakeNamedMaterial => {
            let at = d.params.list.iter().position(|param| param.name == "type");
            if let Some(at) = at
                && let Values::Texts(texts) = &d.params.list[at].values
                && let [kind] = texts.as_slice()
            {
                let kind = kind.clone();
                let kind = material(&kind, &mut d.params, d.span);
                if let Some(ty) = d.params.list.iter_mut().find(|param| param.name == "type") {
                    ty.values = Values::Texts(vec![kind]);
                }
            }
        }
        Word::Texture => {
            // "sRGB" is the default of images of 8 bits in both.
            if let Some(encoding) = take(&mut d.params, "encoding")
                && let Values::Texts(texts) = encoding.values
            {
                let srgb = texts.first().is_none_or(|text| text != "linear");
                put(
                    &mut d.params,
                    "gamma",
                    Type::Bool,
                    Values::Bools(vec![srgb]),
                    encoding.span,
                );
            }
            if let Some(filter) = take(&mut d.params, "filter")
                && let Values::Texts(texts) = filter.values
            {
                let trilinear = texts.first().is_some_and(|text| text != "ewa");
                put(
                    &mut d.params,
                    "trilinear",
                    Type::Bool,
                    Values::Bools(vec![trilinear]),
                    filter.span,
                );
            }
        }
        Word::LightSource | Word::AreaLightSource => {
            rename(&mut d.params, "filename", "mapname");
            // Factors are numbers in pbrt-v4.
            if let Some(scale) = d.params.list.iter_mut().find(|param| param.name == "scale")
                && let Values::Numbers(numbers) = &scale.values
                && let [factor] = numbers[..]
            {
                scale.ty = Type::Rgb;
                scale.values = Values::Numbers(vec![factor; 3]);
            }
        }
        Word::Film => {
            if matches!(d.names[0].as_str(), "rgb" | "gbuffer" | "spectral") {
                d.names[0] = "image".to_owned();
            }
        }
        Word::PixelFilter => {
            rename(&mut d.params, "xradius", "xwidth");
            rename(&mut d.params, "yradius", "ywidth");
            if d.names[0] == "gaussian" {
                let sigma = take(&mut d.params, "sigma").and_then(|p| p.numbers().first().copied());
                let sigma = sigma.unwrap_or(0.5);
                let alpha = Values::Numbers(vec![0.5 / (sigma * sigma)]);
                put(&mut d.params, "alpha", Type::Float, alpha, d.span);
                for name in ["xwidth", "ywidth"] {
                    if !d.params.has(name) {
                        let radius = Values::Numbers(vec![1.5]);
                        put(&mut d.params, name, Type::Float, radius, d.span);
                    }
                }
            }
        }
        Word::Sampler => {
            let own = match d.names[0].as_str() {
                "independent" => "random",
                "zsobol" | "paddedsobol" => "sobol",
                "pmj02bn" => "02sequence",
                other => other,
            };
            d.names[0] = own.to_owned();
            take(&mut d.params, "randomization");
            take(&mut d.params, "seed");
        }
        Word::Integrator => {
            if matches!(
                d.names[0].as_str(),
                "volpath" | "simplevolpath" | "simplepath"
            ) {
                // Without media they are the same.
                d.names[0] = "path".to_owned();
            }
            rename(&mut d.params, "lightsampler", "lightsamplestrategy");
            if let Some(strategy) = d
                .params
                .list
                .iter_mut()
                .find(|p| p.name == "lightsamplestrategy")
                && let Values::Texts(texts) = &mut strategy.values
            {
                for text in texts {
                    if text == "bvh" {
                        *text = "spatial".to_owned();
                    }
                }
            }
            for name in ["regularize", "samplelights", "samplebsdf"] {
                take(&mut d.params, name);
            }
        }
        _ => {}
    }
    d
}

/// A named spectrum as its colour.
fn plain_spectrum(param: &mut Param) {
    if param.ty != Type::Spectrum {
        return;
    }
    let Values::Texts(texts) = &param.values else {
        return;
    };
    let [name] = texts.as_slice() else {
        return;
    };
    let known = SPECTRA
        .iter()
        .find(|(own, _)| own == name)
        .map(|(_, rgb)| *rgb);
    // Illuminants are white here: colours are relative to them.
    let white = name.starts_with("stdillum-").then_some([1.0; 3]);
    if let Some(rgb) = known.or(white) {
        param.ty = Type::Rgb;
        param.values = Values::Numbers(rgb.to_vec());
    }
}

/// The material's name in pbrt-v3; its parameters become those of that.
fn material(kind: &str, params: &mut Params, span: Span) -> String {
    rename(params, "displacement", "bumpmap");
    let grey = |value: f64| Values::Numbers(vec![value; 3]);
    match kind {
        "diffuse" => {
            rename(params, "reflectance", "Kd");
            "matte"
        }
        "coateddiffuse" => {
            rename(params, "reflectance", "Kd");
            let eta = take(params, "eta").and_then(|p| p.numbers().first().copied());
            let eta = eta.unwrap_or(1.5);
            let normal = ((eta - 1.0) / (eta + 1.0)).powi(2);
            put(params, "Ks", Type::Rgb, grey(normal), span);
            widths(params, span, 0.0);
            forget(
                params,
                &["thickness", "g", "albedo", "maxdepth", "nsamples"],
            );
            "substrate"
        }
        "conductor" | "coatedconductor" => {
            for name in ["eta", "k", "roughness", "uroughness", "vroughness"] {
                rename(params, &format!("conductor.{name}"), name);
            }
            forget(
                params,
                &[
                    "interface.roughness",
                    "interface.eta",
                    "thickness",
                    "g",
                    "albedo",
                ],
            );
            widths(params, span, 0.0);
            if params.has("reflectance") {
                rename(params, "reflectance", "Ks");
                put(params, "Kd", Type::Rgb, grey(0.0), span);
                "substrate"
            } else {
                "metal"
            }
        }
        "dielectric" | "thindielectric" => {
            if let Some(eta) = params.list.iter_mut().find(|param| param.name == "eta")
                && let Values::Numbers(numbers) = &mut eta.values
                && numbers.len() == 3
            {
                numbers.truncate(1);
                eta.ty = Type::Float;
            }
            if kind == "thindielectric" {
                // Enters and leaves at once: nearly all goes straight through.
                forget(params, &["eta"]);
                put(params, "opacity", Type::Rgb, grey(0.08), span);
                put(params, "Kr", Type::Rgb, grey(1.0), span);
                put(params, "Kd", Type::Rgb, grey(0.0), span);
                put(params, "Ks", Type::Rgb, grey(0.0), span);
                put(
                    params,
                    "index",
                    Type::Float,
                    Values::Numbers(vec![100.0]),
                    span,
                );
                return "uber".to_owned();
            }
            widths(params, span, 0.0);
            "glass"
        }
        "diffusetransmission" => {
            rename(params, "reflectance", "reflect");
            rename(params, "transmittance", "transmit");
            for name in ["reflect", "transmit"] {
                if !params.has(name) {
                    put(params, name, Type::Rgb, grey(0.25), span);
                }
            }
            put(params, "Kd", Type::Rgb, grey(1.0), span);
            put(params, "Ks", Type::Rgb, grey(0.0), span);
            "translucent"
        }
        "mix" => {
            if let Some(parts) = take(params, "materials")
                && let Values::Texts(names) = parts.values
            {
                // There the amount is that of the second.
                for (name, part) in ["namedmaterial2", "namedmaterial1"].into_iter().zip(names) {
                    put(
                        params,
                        name,
                        Type::Text,
                        Values::Texts(vec![part]),
                        parts.span,
                    );
                }
            }
            if let Some(amount) = params.list.iter_mut().find(|param| param.name == "amount")
                && let Values::Numbers(numbers) = &amount.values
                && let [value] = numbers[..]
            {
                amount.ty = Type::Rgb;
                amount.values = grey(value);
            }
            "mix"
        }
        "interface" => "none",
        "measured" => "fourier",
        other => other,
    }
    .to_owned()
}

/// From a roughness to the width of the distribution, which in pbrt-v4 is its root.
fn widths(params: &mut Params, span: Span, default: f64) {
    let remapped = match take(params, "remaproughness").map(|param| param.values) {
        Some(Values::Bools(bools)) => bools.first().copied().unwrap_or(true),
        _ => true,
    };
    let common = take(params, "roughness");
    for name in ["uroughness", "vroughness"] {
        if !params.has(name) {
            let (ty, values, span) = match &common {
                Some(param) => (param.ty, param.values.clone(), param.span),
                None => (Type::Float, Values::Numbers(vec![default]), span),
            };
            put(params, name, ty, values, span);
        }
        if let Some(param) = params.list.iter_mut().find(|param| param.name == name)
            && let Values::Numbers(numbers) = &mut param.values
            && remapped
        {
            numbers.iter_mut().for_each(|x| *x = x.max(0.0).sqrt());
        }
    }
    put(
        params,
        "remaproughness",
        Type::Bool,
        Values::Bools(vec![false]),
        span,
    );
}

fn take(params: &mut Params, name: &str) -> Option<Param> {
    let at = params.list.iter().position(|param| param.name == name)?;
    Some(params.list.remove(at))
}

fn forget(params: &mut Params, names: &[&str]) {
    for name in names {
        take(params, name);
    }
}

fn rename(params: &mut Params, from: &str, to: &str) {
    if let Some(param) = params.list.iter_mut().find(|param| param.name == from) {
        param.name = to.to_owned();
    }
}

fn put(params: &mut Params, name: &str, ty: Type, values: Values, span: Span) {
    if !params.has(name) {
        params
            .list
            .push(Param::new(name.to_owned(), ty, values, span));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_known_by_its_words() {
        assert!(is_v4(b"WorldBegin\nMaterial \"diffuse\"\n"));
        assert!(is_v4(b"Option \"bool x\" true\nWorldBegin\n"));
        assert!(!is_v4(b"WorldBegin\nMaterial \"diffuse\"\nWorldEnd"));
        assert!(!is_v4(b"WorldBegin # Option\n"));
    }
}
