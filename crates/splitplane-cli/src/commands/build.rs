//! `splitplane build`: the tree card.

use splitplane_lab::{CardRecord, Preset, build};

use crate::args::BuildCommand;
use crate::failure::Failure;
use crate::numbers::{bytes, count, grouped, measured, percent, seconds};
use crate::progress::{self, Bar};
use crate::{print, scene};

pub fn run(command: &BuildCommand) -> Result<(), Failure> {
    let quiet = command.general.quiet;
    let settings = command.build.settings(Preset::Default, &command.general);
    let bar = Bar::new(quiet, 1);
    bar.spin(format!("reading {}", command.scene.scene));
    let scene = scene::load(&command.scene, quiet)?;
    bar.spin(format!("{}: building the tree", command.tree));
    let built = build(&scene.mesh, command.tree, &settings)?;
    progress::clear();
    let card = CardRecord::new(&built, &scene.name, &settings);
    if command.json {
        let json = serde_json::to_string_pretty(&card).map_err(Failure::input)?;
        print::line(&json)?;
    } else {
        print::line(&text(&card))?;
    }
    Ok(())
}

/// The card, to be read.
fn text(card: &CardRecord) -> String {
    let tree = match card.k {
        Some(k) => format!("{}:{k}", card.tree),
        None => card.tree.clone(),
    };
    let skipped = match (card.skipped_not_finite, card.skipped_degenerate) {
        (0, 0) => "none".to_owned(),
        (not_finite, degenerate) => format!(
            "{} not finite, {} without area",
            grouped(not_finite),
            grouped(degenerate)
        ),
    };
    let nodes = card.nodes;
    let share = |part: u64, whole: u64| percent(100.0 * part as f64 / (whole.max(1)) as f64);
    let all = nodes.total();
    let of_nodes = |part| format!("{} ({})", grouped(part), share(part, all));
    let per_triangle = card.references as f64
        / (card.triangles - card.skipped_not_finite - card.skipped_degenerate).max(1) as f64;
    let rows = [
        ("triangles", grouped(card.triangles)),
        ("skipped triangles", skipped),
        ("nodes", grouped(all)),
        ("  kd", of_nodes(nodes.kd)),
        ("  oblique", of_nodes(nodes.oblique)),
        ("  leaves", of_nodes(nodes.leaf)),
        ("  empty leaves", of_nodes(nodes.empty_leaf)),
        (
            "references",
            format!(
                "{} ({} per triangle)",
                grouped(card.references),
                measured(per_triangle)
            ),
        ),
        ("depth", grouped(card.depth.into())),
        ("bad refines", grouped(card.bad_refines)),
        ("largest leaf", count(card.largest_leaf, "triangle")),
        ("expected visits per ray", measured(card.expected_visits)),
        ("expected tests per ray", measured(card.expected_tests)),
        ("SAH cost", measured(card.sah_cost)),
        ("size", bytes(card.tree_bytes)),
        ("build time", seconds(card.build_s)),
        ("split candidates", grouped(card.candidates)),
        ("uncut cells", grouped(card.uncut_cells)),
    ];
    let rows = rows
        .map(|(label, value)| vec![label.to_owned(), value])
        .to_vec();
    let mut text = format!(
        "{}\n\n{}",
        print::table(vec![tree, card.scene.clone()], rows).trim_fmt(),
        histogram(card)
    );
    text.push_str(&format!(
        "\n\n{} parameters, ties {}, seed {}, {}\n",
        card.preset,
        card.build_params.ties,
        card.seed,
        count(card.threads as u64, "thread"),
    ));
    text.push_str("A ray: a random line through the scene's box that tests all leaves on its way.");
    text
}

/// Leaves by their number of triangles: one line each to 8, then one per power of two.
fn histogram(card: &CardRecord) -> String {
    let mut bins: Vec<(u32, u32, u64)> = Vec::new();
    for &(triangles, leaves) in &card.leaf_sizes {
        let (first, last) = match triangles {
            0..=8 => (triangles, triangles),
            _ => {
                let power = (triangles - 1).ilog2();
                ((1 << power) + 1, (1_u32 << power).saturating_mul(2))
            }
        };
        match bins.last_mut() {
            Some((bin, _, count)) if *bin == first => *count += leaves,
            _ => bins.push((first, last, leaves)),
        }
    }
    let most = bins.iter().map(|&(_, _, leaves)| leaves).max().unwrap_or(0);
    let all = card.nodes.leaf.max(1);
    let rows = bins.into_iter().map(|(first, last, leaves)| {
        let length = (30.0 * leaves as f64 / most.max(1) as f64).ceil() as usize;
        let label = if first == last {
            first.to_string()
        } else {
            format!("{first} to {last}")
        };
        let share = 100.0 * leaves as f64 / all as f64;
        vec![label, grouped(leaves), percent(share), "█".repeat(length)]
    });
    let header = ["triangles in a leaf", "leaves", "", ""].map(str::to_owned);
    let mut table = print::table(header.to_vec(), rows.collect());
    if let Some(bars) = table.column_mut(3) {
        bars.set_cell_alignment(comfy_table::CellAlignment::Left);
    }
    table.trim_fmt()
}
