//! Times of builds, repetition by repetition.

use anyhow::Result;
use splitplane_lab::median;

use crate::Args;
use crate::contender::Geometry;
use crate::measure::built;
use crate::report::number;

/// The head of the Markdown table whose lines [`of_scene`] gives.
pub const HEAD: &str = "| scene, triangles | contender | time, s | × baseline | range | bytes a triangle |\n\
                        |---|---|--:|--:|--:|--:|\n";

/// Builds all contenders in turn, `reps` times; a line for each. Ratios are medians of those of the
/// same repetition, by the wall's time: a library's idle threads may spin. They are to the first
/// contender where the baseline is not among them.
pub fn of_scene(args: &Args, name: &str, geometry: &Geometry<'_>, reps: u32) -> Result<String> {
    let mut seconds = vec![Vec::new(); args.contenders.len()];
    let mut bytes = vec![0; args.contenders.len()];
    for _ in 0..reps {
        for (i, contender) in args.contenders.iter().enumerate() {
            let built = built(contender, geometry, args.build_threads as usize)?;
            eprintln!("  {contender} built in {:.2} s", built.build_wall);
            seconds[i].push(built.build_wall);
            bytes[i] = built.contender.bytes();
        }
    }
    let baseline = args.contenders.iter().position(|c| *c == args.baseline);
    let baseline = baseline.unwrap_or(0);
    let triangles = geometry.triangles.len();
    let mut out = String::new();
    for (i, contender) in args.contenders.iter().enumerate() {
        let ratios: Vec<f64> = (seconds[i].iter().zip(&seconds[baseline]))
            .map(|(own, base)| own / base)
            .collect();
        let of = |values: &[f64]| number(median(values.iter().copied()).unwrap_or(f64::NAN));
        let (low, high) = (ratios.iter()).fold((f64::INFINITY, 0.0_f64), |(low, high), &ratio| {
            (low.min(ratio), high.max(ratio))
        });
        out += &format!(
            "| {name}, {triangles} | {contender} | {} | **{}** | {}–{} | {} |\n",
            of(&seconds[i]),
            of(&ratios),
            number(low),
            number(high),
            number(bytes[i] as f64 / triangles as f64),
        );
    }
    Ok(out)
}
