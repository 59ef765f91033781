//! Rows as a picture: a panel a set of rays, a line a contender, a dot a scene.

use std::fmt::Write;

use crate::rays::Kind;
use crate::record::Row;
use crate::report::{geometric_mean, in_order};

const PANEL: f64 = 190.0;
const GAP: f64 = 14.0;
const LINE: f64 = 22.0;
const TOP: f64 = 58.0;
/// Width of a character of the names.
const CHARACTER: f64 = 7.0;

/// The ratios of all rows on a logarithmic scale, as SVG.
pub fn svg(rows: &[Row]) -> String {
    let contenders = in_order(rows, |row| row.contender.clone());
    let sets: Vec<Kind> = (Kind::ALL.into_iter())
        .filter(|set| rows.iter().any(|row| row.set == *set))
        .collect();
    let longest = contenders.iter().map(|name| name.chars().count()).max();
    let left = CHARACTER * longest.unwrap_or(0) as f64 + 16.0;
    let (low, high) = rows.iter().fold((0.5f64, 2.0f64), |(low, high), row| {
        (low.min(row.ratio), high.max(row.ratio))
    });
    let (low, high) = ((0.93 * low).ln(), (1.07 * high).ln());
    let x = |ratio: f64| PANEL * (ratio.ln() - low) / (high - low);
    let width = left + (PANEL + GAP) * sets.len() as f64;
    let bottom = TOP + LINE * contenders.len() as f64;
    let mut out = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width:.0} {:.0}\" \
         font-family=\"sans-serif\" font-size=\"12\" fill=\"#222\">\n\
         <rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n",
        bottom + 30.0
    );
    let mut add = |text: String| {
        // Writing to a string does not fail.
        let _ = writeln!(out, "{text}");
    };
    let baseline = rows.first().map_or("", |row| row.baseline.as_str());
    add(format!(
        "<text x=\"{left:.1}\" y=\"18\">Speed as a multiple of that of {baseline}: dots are \
         scenes, bars their geometric mean</text>"
    ));
    for (i, name) in contenders.iter().enumerate() {
        let y = TOP + LINE * (i as f64 + 0.5);
        add(format!(
            "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>",
            left - 8.0,
            y + 4.0,
            name.replace('&', "&amp;").replace('<', "&lt;")
        ));
    }
    let ticks = [0.1, 0.2, 0.5, 1.0, 2.0, 4.0, 8.0];
    for (i, set) in sets.iter().enumerate() {
        let start = left + (PANEL + GAP) * i as f64;
        add(format!(
            "<text x=\"{:.1}\" y=\"{:.1}\" font-weight=\"bold\" text-anchor=\"middle\">{}</text>",
            start + PANEL / 2.0,
            TOP - 14.0,
            set.name()
        ));
        for tick in ticks {
            let at = x(tick);
            if !(0.0..=PANEL).contains(&at) {
                continue;
            }
            let colour = if tick == 1.0 { "#888" } else { "#ddd" };
            add(format!(
                "<line x1=\"{0:.1}\" x2=\"{0:.1}\" y1=\"{TOP}\" y2=\"{bottom}\" \
                 stroke=\"{colour}\"/><text x=\"{0:.1}\" y=\"{1:.1}\" font-size=\"10\" \
                 fill=\"#666\" text-anchor=\"middle\">{tick}</text>",
                start + at,
                bottom + 14.0
            ));
        }
        for (j, name) in contenders.iter().enumerate() {
            let y = TOP + LINE * (j as f64 + 0.5);
            let ratios: Vec<f64> = rows
                .iter()
                .filter(|row| row.set == *set && row.contender == *name)
                .map(|row| row.ratio)
                .collect();
            if ratios.is_empty() {
                continue;
            }
            for &ratio in &ratios {
                add(format!(
                    "<circle cx=\"{:.1}\" cy=\"{y:.1}\" r=\"3\" fill=\"#2a6fb0\" \
                     fill-opacity=\"0.45\"/>",
                    start + x(ratio)
                ));
            }
            add(format!(
                "<rect x=\"{:.1}\" y=\"{:.1}\" width=\"3\" height=\"14\" fill=\"#c0501f\"/>",
                start + x(geometric_mean(&ratios)) - 1.5,
                y - 7.0
            ));
        }
    }
    out + "</svg>\n"
}
