//! `splitplane build`: the tree card.

use std::collections::BTreeMap;

use splitplane::{Layout, Progress};
use splitplane_lab::{
    CardRecord, LabError, Layouts, Preset, Timeline, forget_peak_memory, median, peak_memory_bytes,
    save_tree, write_whole,
};
use splitplane_render::scene::Instancing;

use crate::args::{BuildCommand, TreeSource};
use crate::failure::{Failure, writable_place, writable_places};
use crate::numbers::{bytes, count, grouped, measured, percent, seconds};
use crate::progress::{self, Bar};
use crate::{print, scene};

pub fn run(command: &BuildCommand) -> Result<(), Failure> {
    let quiet = command.general.quiet;
    let written = || command.out.iter().chain(&command.timeline);
    for file in written() {
        let trees = command.tree.iter().filter_map(TreeSource::file);
        writable_place(file, trees.chain([command.scene.file()]))?;
    }
    if command.out.is_some() && command.tree.len() > 1 {
        return Err(Failure::input("--out takes one tree; name one with --tree"));
    }
    let mut asked = command.build.settings(Preset::Default, &command.general);
    asked.layouts = Layouts::both(command.layout.unwrap_or(Layout::Binary));
    let bar = Bar::new(quiet, 1);
    bar.spin(format!("reading {}", command.scene.scene));
    let scene = scene::load(&command.scene, Instancing::Flattened, quiet)?;
    writable_places(written(), &scene)?;
    let timeline = Timeline::default();
    let (mut cards, mut peaks, mut last) = (Vec::new(), Vec::new(), None);
    for repetition in 0..command.repeat {
        for tree in &command.tree {
            let which = match command.repeat {
                1 => String::new(),
                repeat => format!(" ({} of {repeat})", repetition + 1),
            };
            let timed = command.timeline.as_ref().map(|_| {
                let name = format!("{tree}{which}");
                timeline.build(cards.len(), &name, &bar)
            });
            let progress: &dyn Progress = match &timed {
                Some(timed) => timed,
                None => &bar,
            };
            let is_known = forget_peak_memory();
            let watched = (&bar, which.as_str(), progress);
            // A saved tree has its own, which are not those of the next.
            let mut settings = asked.clone();
            let built =
                scene::watched_tree(tree, &scene.mesh, &command.build, &mut settings, watched)?;
            scene::check_layout(tree, &built, command.layout)?;
            peaks.push(peak_memory_bytes().filter(|_| is_known));
            cards.push(CardRecord::new(&built, &scene.name, &settings));
            last = Some(built.tree);
        }
    }
    if let (Some(out), Some(tree)) = (&command.out, last) {
        bar.spin(format!("writing {}", out.display()));
        save_tree(out, &tree)?;
    }
    progress::clear();
    if let Some(path) = &command.timeline {
        let write = |file: &mut std::io::BufWriter<_>| {
            Ok(serde_json::to_writer(file, &timeline.to_json())?)
        };
        write_whole(path, write).map_err(|source| LabError::Write {
            path: path.clone(),
            source,
        })?;
    }
    match (&cards[..], command.json) {
        ([card], false) => print::line(&text(card, is_saved(&command.tree[0])))?,
        ([card], true) => print::line(&json(card)?)?,
        (cards, true) => print::line(&json(cards)?)?,
        (cards, false) => print::line(&table(cards, &peaks, command))?,
    }
    Ok(())
}

fn json(value: &(impl serde::Serialize + ?Sized)) -> Result<String, Failure> {
    serde_json::to_string_pretty(value).map_err(Failure::input)
}

fn is_saved(tree: &TreeSource) -> bool {
    tree.file().is_some()
}

/// The parameters of a build.
fn how(card: &CardRecord) -> String {
    format!(
        "{} parameters, {}, seed {}",
        card.preset,
        card.build_params.ways(),
        card.seed
    )
}

/// How long several trees took, and what came of it.
fn table(cards: &[CardRecord], peaks: &[Option<u64>], command: &BuildCommand) -> String {
    let trees = command.tree.len();
    let header = [
        "tree",
        "build time",
        "from",
        "to",
        "× first",
        "nodes",
        "references",
        "SAH cost",
        "size",
        "peak memory",
    ];
    let rows: Vec<Vec<String>> = (0..trees)
        .map(|tree| {
            let own = || cards.iter().skip(tree).step_by(trees);
            let times = || own().map(|card| card.build_s);
            // As often as each was built, each was built with the first.
            let ratios = own().zip(cards.iter().step_by(trees));
            let ratio = median(ratios.map(|(own, first)| own.build_s / first.build_s));
            let card = &cards[tree];
            let loaded = match is_saved(&command.tree[tree]) {
                true => " (loaded)",
                false => "",
            };
            vec![
                command.tree[tree].to_string(),
                seconds(median(times()).unwrap_or_default()) + loaded,
                seconds(times().fold(f64::INFINITY, f64::min)),
                seconds(times().fold(0.0, f64::max)),
                measured(ratio.unwrap_or_default()),
                grouped(card.nodes.total()),
                grouped(card.references),
                measured(card.sah_cost),
                bytes(card.tree_bytes),
                // The first build's: later ones find memory that earlier ones left.
                peaks[tree].map_or_else(|| "–".to_owned(), bytes),
            ]
        })
        .collect();
    let header = header.map(str::to_owned).to_vec();
    let table = match command.markdown {
        true => print::markdown(&header, &rows),
        false => print::table(header, rows).trim_fmt(),
    };
    let (saved, built): (Vec<usize>, Vec<usize>) =
        (0..trees).partition(|&tree| is_saved(&command.tree[tree]));
    let mut made = Vec::new();
    // All that are built are built alike.
    if let Some(&tree) = built.first() {
        let threads = count(cards[tree].threads as u64, "thread");
        made.push(format!(
            "{}, {threads}, {}",
            how(&cards[tree]),
            match command.repeat {
                1 => "built once".to_owned(),
                repeat => format!("medians of {repeat} builds, interleaved"),
            }
        ));
    }
    if let Some(&tree) = saved.first() {
        let threads = count(cards[tree].threads as u64, "thread");
        made.push(format!(
            "saved trees are as they were built, and loaded by {threads}"
        ));
    }
    let card = &cards[0];
    format!(
        "{table}\n\n{}, {}: {}",
        card.scene,
        count(card.triangles, "triangle"),
        made.join("; ")
    )
}

/// The card, to be read; `is_saved`: of a tree that was loaded.
fn text(card: &CardRecord, is_saved: bool) -> String {
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
    let (made, loaded) = match is_saved {
        true => ("loading time", "loaded by "),
        false => ("build time", ""),
    };
    let nodes = card.nodes;
    let share = |part: u64, whole: u64| percent(100.0 * part as f64 / (whole.max(1)) as f64);
    let all = nodes.total();
    let of_nodes = |part| format!("{} ({})", grouped(part), share(part, all));
    let won = |part| {
        format!(
            "{} ({})",
            grouped(part),
            share(part, nodes.kd + nodes.oblique)
        )
    };
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
        (made, seconds(card.build_s)),
        ("split candidates", grouped(card.candidates)),
        ("splits won", String::new()),
        ("  by axes", won(card.wins.axis)),
        ("  by other directions", won(card.wins.direction)),
        ("  by planes of triangles", won(card.wins.triangle)),
        ("  by planes of edges", won(card.wins.edge)),
        ("uncut cells", grouped(card.uncut_cells)),
        ("leaves by the limit", grouped(card.limited_leaves)),
    ];
    let mut rows = rows.map(|(label, value)| (label, value)).to_vec();
    if let Some(wide) = &card.wide {
        rows.extend([
            ("in the wide layout", String::new()),
            ("  nodes", grouped(wide.nodes)),
            ("  leaves", grouped(wide.leaves)),
            ("  references", grouped(wide.references)),
            ("  depth", grouped(wide.depth.into())),
            ("  frames", frames(&wide.frames)),
            ("  size", bytes(wide.bytes)),
            ("  time to bring it there", seconds(wide.seconds)),
        ]);
    }
    let rows = (rows.into_iter())
        .map(|(label, value)| vec![label.to_owned(), value])
        .collect();
    let mut text = format!(
        "{}\n\n{}\n\n{}",
        print::table(vec![tree, card.scene.clone()], rows).trim_fmt(),
        by_depth(card),
        by_leaf_size(card)
    );
    text.push_str(&format!(
        "\n\n{}, {loaded}{}\n",
        how(card),
        count(card.threads as u64, "thread"),
    ));
    text.push_str("A ray: a random line through the scene's box that tests all leaves on its way.");
    text
}

/// How many frames the nodes of a wide tree are in, and the share of those in the world's.
fn frames(nodes: &[u64]) -> String {
    let used = nodes.iter().filter(|&&nodes| nodes > 0).count() as u64;
    let all: u64 = nodes.iter().sum();
    let world = nodes.first().copied().unwrap_or_default();
    format!(
        "{} ({} of the nodes in the world's)",
        grouped(used),
        percent(100.0 * world as f64 / all.max(1) as f64)
    )
}

/// The most lines for interior nodes by depth.
const DEPTH_LINES: usize = 12;
/// The longest bar, in characters.
const LONGEST_BAR: usize = 30;

/// A bar for a part of the largest number; not empty unless the part is.
fn bar(part: u64, largest: u64) -> usize {
    (LONGEST_BAR as f64 * part as f64 / largest.max(1) as f64).ceil() as usize
}

fn bar_table(header: &[&str], rows: Vec<Vec<String>>) -> String {
    let mut table = print::table(header.iter().map(|&cell| cell.to_owned()).collect(), rows);
    if let Some(bars) = table.column_mut(header.len() - 1) {
        bars.set_cell_alignment(comfy_table::CellAlignment::Left);
    }
    table.trim_fmt()
}

fn range(first: impl Into<u64>, last: impl Into<u64>) -> String {
    match (first.into(), last.into()) {
        (first, last) if first == last => first.to_string(),
        (first, last) => format!("{first} to {last}"),
    }
}

/// Interior nodes by depth, several depths a line in deep trees.
fn by_depth(card: &CardRecord) -> String {
    let depths = &card.interior_by_depth;
    let per_line = depths.len().div_ceil(DEPTH_LINES).max(1);
    let bins: Vec<(u64, u64)> = depths
        .chunks(per_line)
        .map(|bin| {
            bin.iter()
                .fold((0, 0), |all, one| (all.0 + one.0, all.1 + one.1))
        })
        .collect();
    let most = bins
        .iter()
        .map(|(kd, oblique)| kd + oblique)
        .max()
        .unwrap_or(0);
    let rows = bins.into_iter().enumerate().map(|(i, (kd, oblique))| {
        let first = i * per_line;
        let last = (first + per_line).min(depths.len()) - 1;
        let length = bar(kd + oblique, most);
        let of_kd = length.min(bar(kd, most));
        vec![
            range(first as u64, last as u64),
            grouped(kd),
            grouped(oblique),
            "█".repeat(of_kd) + &"░".repeat(length - of_kd),
        ]
    });
    bar_table(
        &["interior nodes at depth", "kd █", "oblique ░", ""],
        rows.collect(),
    )
}

/// Leaves and expected tests by the leaf's number of triangles: one line each to 8, then one per
/// power of two.
fn by_leaf_size(card: &CardRecord) -> String {
    let bin = |triangles: u32| match triangles {
        0..=8 => (triangles, triangles),
        _ => {
            let power = (triangles - 1).ilog2();
            ((1 << power) + 1, (1_u32 << power).saturating_mul(2))
        }
    };
    let mut bins: BTreeMap<(u32, u32), (u64, f64)> = BTreeMap::new();
    for &(triangles, leaves) in &card.leaf_sizes {
        bins.entry(bin(triangles)).or_default().0 += leaves;
    }
    for &(triangles, share) in &card.tests_by_leaf_size {
        bins.entry(bin(triangles)).or_default().1 += share;
    }
    let most = bins.values().map(|&(leaves, _)| leaves).max().unwrap_or(0);
    let all = card.nodes.leaf.max(1);
    let rows = bins.into_iter().map(|((first, last), (leaves, tests))| {
        vec![
            range(first, last),
            grouped(leaves),
            percent(100.0 * leaves as f64 / all as f64),
            percent(100.0 * tests),
            "█".repeat(bar(leaves, most)),
        ]
    });
    let header = ["triangles in a leaf", "leaves", "", "of expected tests", ""];
    bar_table(&header, rows.collect())
}
