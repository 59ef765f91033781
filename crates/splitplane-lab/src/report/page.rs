//! The page.

use maud::{DOCTYPE, Markup, PreEscaped, html};
use serde_json::{Value, json};
use splitplane_render::output::false_colours;

use super::group::{Group, Point, Told, tenth};
use super::measures::{MEASURES, Measure};
use super::plot::Plot;
use super::{Gallery, Report, plots};
use crate::LabError;
use crate::experiment::SceneFacts;
use crate::numbers::{bytes, count, grouped, measured, percent, seconds};
use crate::pictures::Quantity;
use crate::stats::Estimate;

const STYLE: &str = include_str!("../../assets/report.css");
const SCRIPT: &str = include_str!("../../assets/report.js");
/// What the plots run with, in the order in which it is loaded.
const VEGA: [&str; 3] = [
    include_str!("../../assets/vega/vega.min.js"),
    include_str!("../../assets/vega/vega-lite.min.js"),
    include_str!("../../assets/vega/vega-embed.min.js"),
];
const VEGA_LICENCE: &str = include_str!("../../assets/vega/vega.LICENSE");

pub(super) fn html(report: &Report) -> Result<String, LabError> {
    let plots: Vec<Vec<_>> = report.groups.iter().map(plots::of_group).collect();
    let over_sizes = plots::over_sizes(&report.groups);
    let specs: Value = (plots.iter().flatten().chain(&over_sizes))
        .map(|plot| (plot.key.clone(), plot.vega_lite()))
        .collect::<serde_json::Map<String, Value>>()
        .into();
    let pictures = galleries(report)?;
    let data =
        json!({ "plots": specs, "galleries": pictures, "colours": false_colours().to_vec() });
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                meta name="color-scheme" content="light dark";
                title { (report.title) " – Splitplane" }
                style { (PreEscaped(STYLE)) }
            }
            body {
                header {
                    button #theme type="button" title="dark or light" aria-label="dark or light" { "◐" }
                    h1 { (report.title) }
                    (paragraphs(&report.description))
                    nav {
                        a href="#summary" { "Summary" }
                        @for group in &report.groups {
                            a href={ "#" (group.slug()) } { (group.title()) }
                        }
                        @if !over_sizes.is_empty() { a href="#sizes" { "Over the size" } }
                        a href="#scenes" { "Scenes" }
                        a href="#method" { "Method" }
                    }
                }
                main {
                    (summary(report))
                    @for (i, group) in report.groups.iter().enumerate() {
                        section id=(group.slug()) {
                            h2 { (group.title()) }
                            (conditions(group))
                            (table(group))
                            h3 { "Plots" }
                            (figures(&plots[i]))
                            @if let Some(gallery) = report.galleries.iter().position(|g| g.group == i) {
                                (gallery_markup(gallery, &report.galleries[gallery]))
                            }
                            (cards(group))
                        }
                    }
                    @if !over_sizes.is_empty() {
                        section #sizes {
                            h2 { "Over the size" }
                            (figures(&over_sizes))
                        }
                    }
                    (scenes(report))
                    (method(report))
                }
                footer {
                    p {
                        "Made by Splitplane " (report.method.program.version) ". Plots are drawn by "
                        "Vega, Vega-Lite and Vega-Embed, which are part of this file:"
                    }
                    details { summary { "their licence" } pre { (VEGA_LICENCE) } }
                }
                script type="application/json" id="data" { (PreEscaped(in_script(&data))) }
                @for script in VEGA { script { (PreEscaped(script)) } }
                script { (PreEscaped(SCRIPT)) }
            }
        }
    };
    Ok(page.into_string())
}

fn figures(plots: &[Plot]) -> Markup {
    html! {
        div.plots {
            @for plot in plots {
                figure.plot {
                    figcaption { (plot.caption) }
                    div.vega id={ "plot-" (plot.key) } data-plot=(plot.key) {}
                }
            }
        }
    }
}

/// JSON that cannot end the script that it is in.
fn in_script(value: &Value) -> String {
    value
        .to_string()
        .replace("</", "<\\/")
        .replace("<!--", "<\\u0021--")
}

fn paragraphs(text: &str) -> Markup {
    html! { @for paragraph in text.split("\n\n").filter(|p| !p.trim().is_empty()) { p { (paragraph) } } }
}

fn summary(report: &Report) -> Markup {
    let status = &report.status;
    let disturbed = disturbed(report);
    let timed = report.groups.iter().any(|group| group.timed);
    html! {
        section #summary {
            h2 { "Summary" }
            ul.findings {
                @for group in &report.groups { @if let Some(text) = finding(group) { li { (text) } } }
            }
            ul.status {
                li.good[status.done == status.planned] .bad[status.done != status.planned] {
                    (status.done) " of " (count(status.planned as u64, "run")) " done"
                    @if !status.failed.is_empty() { ", " (status.failed.len()) " failed" }
                }
                @if status.variances.is_empty() {
                    li.good { "All counts are the same in every repetition, and all pictures that must be are identical, bit by bit." }
                } @else {
                    @for variance in &status.variances { li.bad { (variance) } }
                }
                @if !timed {
                    li { "Only counts were asked for; times were not taken." }
                } @else if disturbed.is_empty() {
                    li.good { "No other work disturbed the times." }
                } @else {
                    li.bad {
                        "Times may mislead: other work kept the machine busy during "
                        (disturbed.len()) " of " (count(status.done as u64, "run")) ". "
                        details { summary { "which" } ul { @for run in &disturbed { li { (run) } } } }
                    }
                }
                @for (cell, reason) in &status.failed { li.bad { (cell) " failed: " (reason) } }
                @for note in &status.notes { li { (note) } }
            }
        }
    }
}

fn disturbed(report: &Report) -> Vec<String> {
    let mut disturbed = Vec::new();
    for group in report.groups.iter().filter(|group| group.timed) {
        for point in &group.points {
            for run in point.runs.iter().filter(|run| run.record.was_disturbed()) {
                let load = match run.record.others_load {
                    Some(load) => format!("others used {load:.2} processors"),
                    None => "the load before was high".to_owned(),
                };
                disturbed.push(format!(
                    "{}, {}, repetition {}: {load}",
                    group.title(),
                    point.tree,
                    run.record.repetition + 1
                ));
            }
        }
    }
    disturbed
}

/// What a group shows, in a sentence.
fn finding(group: &Group) -> Option<Markup> {
    let first = group.points.first()?;
    if group.points.len() < 2 {
        return None;
    }
    let best = |key: &str| -> Option<(String, Estimate)> {
        let measure = group.measures().find(|measure| measure.key == key)?;
        let percents = group.points.iter().filter_map(|point| {
            let told = group.told(measure, point)?;
            Some((point.tree.to_string(), told.percent?))
        });
        percents.min_by(|a, b| a.1.median.total_cmp(&b.1.median))
    };
    let told = [
        ("render-time", "fastest to render"),
        ("build-time", "fastest to build"),
        ("tests-closest", "fewest triangle tests of closest-hit rays"),
        ("tests-shadow", "of shadow rays"),
        (
            "visits-closest",
            "fewest interior visits of closest-hit rays",
        ),
        ("visits-shadow", "of shadow rays"),
        ("nodes", "fewest nodes"),
    ];
    let clauses: Vec<Markup> = (told.iter())
        .filter_map(|(key, what)| {
            let (tree, share) = best(key)?;
            let (low, high) = share.interval;
            Some(html! {
                (what) " " b { (tree) } " (" (percent(share.median))
                @if high > low { ", between " (format!("{low:.1}")) " and " (format!("{high:.1}")) }
                ")"
            })
        })
        .collect();
    Some(html! {
        a href={ "#" (group.slug()) } { (group.title()) } ": "
        @for (i, clause) in clauses.iter().enumerate() { @if i > 0 { "; " } (clause) }
        ". In per cent of " (first.tree) "."
    })
}

/// Under which conditions a group was measured.
fn conditions(group: &Group) -> Markup {
    let record = &group.points[0].runs[0].record;
    let repetitions = group.points.iter().map(|p| p.runs.len()).max().unwrap_or(0);
    let depth = record.max_depth.map(|depth| format!(" to depth {depth}"));
    html! {
        p.conditions {
            (count(record.triangles, "triangle")) "; "
            (record.width) " × " (record.height) " pixels"
            @if record.crop != [0.0, 1.0, 0.0, 1.0] { ", " (grouped(record.pixels)) " of them rendered" }
            ", " (count(record.spp.into(), "sample")) " each, " (record.integrator)
            @if let Some(depth) = depth { (depth) }
            "; " (grouped(record.rays.camera)) " camera, " (grouped(record.rays.bounce)) " bounce and "
            (grouped(record.rays.shadow)) " shadow rays. Parameters: " (record.preset) ", "
            (record.build_params.ways()) ", traversal " (record.traversal) ", seed " (record.seed) ". "
            @if group.timed && record.layout != record.counts_layout {
                "Rendered for time in the " (record.layout) " layout, counted in the "
                (record.counts_layout) " one. "
            } @else {
                "Layout " (record.counts_layout) ". "
            }
            @if group.timed {
                @if repetitions > 1 { "Medians of " (repetitions) " runs in turn" } @else { "One run" }
                " on " (count(record.threads as u64, "thread")) "."
            }
        }
        @if group.thesis.triangles > 0 && group.thesis.triangles != record.triangles {
            p.note {
                "The thesis's scene of this name is another model of the same building or thing, of "
                (count(group.thesis.triangles, "triangle")) ": its percentages are shown, not its counts."
            }
        }
    }
}

/// The table of a group: a tree a line; a measure a column, with the thesis's beside it.
fn table(group: &Group) -> Markup {
    let measures: Vec<&Measure> = group.measures().collect();
    let told: Vec<Vec<Option<Told>>> = (group.points.iter())
        .map(|point| measures.iter().map(|m| group.told(m, point)).collect())
        .collect();
    let in_thesis = |column: usize| {
        told.iter()
            .any(|row| row[column].is_some_and(|told| told.thesis.is_some()))
    };
    let best: Vec<Option<f64>> = measures.iter().map(|m| group.best(m)).collect();
    let any_thesis = (0..measures.len()).any(in_thesis);
    let several = group.points.iter().any(|point| point.runs.len() > 1);
    html! {
        div.wide {
            table.trees {
                thead {
                    tr {
                        th rowspan="2" scope="col" { "tree" }
                        @for (i, measure) in measures.iter().enumerate() {
                            th scope="col" colspan=(1 + usize::from(in_thesis(i))) rowspan=(2 - usize::from(in_thesis(i))) { (measure.label) }
                        }
                    }
                    tr {
                        @for i in 0..measures.len() {
                            @if in_thesis(i) { th scope="col" { "ours" } th.thesis scope="col" { "thesis" } }
                        }
                    }
                }
                tbody {
                    @for (point, row) in group.points.iter().zip(&told) {
                        tr {
                            th scope="row" { (point.tree) }
                            @for (i, told) in row.iter().enumerate() {
                                (cell(measures[i], told.as_ref(), best[i]))
                                @if in_thesis(i) {
                                    td.thesis {
                                        @match told.and_then(|told| told.thesis) {
                                            Some(p) => (percent(p)),
                                            None => "–",
                                        }
                                    }
                                }
                            }
                        }
                    }
                }
            }
        }
        p.legend {
            "In per cent of " (group.points[0].tree) "; the absolute figure is below. "
            mark { "Best." }
            @if several && group.timed { (confidence(group)) }
            @if any_thesis {
                " Thesis: in per cent of its own " (group.points[0].tree) "; its ties and traversal were as published."
            }
            " Shares of kd nodes are parts of a hundred themselves. Where trees price nodes differently (with and without cheap kd nodes), their SAH costs cannot be compared."
        }
    }
}

fn confidence(group: &Group) -> Markup {
    let widest = (group.points.iter())
        .filter_map(|point| {
            let measure = MEASURES.iter().find(|measure| measure.time)?;
            group.told(measure, point)?.percent
        })
        .min_by(|a, b| a.confidence.total_cmp(&b.confidence));
    html! {
        @if let Some(Estimate { confidence, .. }) = widest {
            " In brackets: the interval of the true median, from the ratios within a repetition; exact, with "
            (format!("{:.1} %", 100.0 * confidence)) " confidence."
        }
    }
}

fn cell(measure: &Measure, told: Option<&Told>, best: Option<f64>) -> Markup {
    let Some(told) = told else {
        return html! { td { "–" } };
    };
    let Some(estimate) = told.percent else {
        return html! { td { (measure.unit.text(told.value.median)) } };
    };
    let (low, high) = estimate.interval;
    let is_best = best == Some(tenth(estimate.median));
    html! {
        td.best[is_best] {
            span.percent { (percent(estimate.median)) }
            @if high > low {
                span.interval { "[" (format!("{low:.1}")) ", " (format!("{high:.1}")) "]" }
            }
            @if measure.relative { span.absolute { (measure.unit.text(told.value.median)) } }
        }
    }
}

/// The table of a group as CSV.
pub(super) fn table_csv(group: &Group) -> Result<Vec<u8>, LabError> {
    let failed = |error: csv::Error| LabError::json(serde_json::Error::io(error.into()));
    let mut writer = csv::Writer::from_writer(Vec::new());
    let mut header = vec!["tree".to_owned()];
    for measure in group.measures() {
        for what in ["", " %", " % low", " % high", " confidence", " thesis %"] {
            header.push(format!("{}{what}", measure.key));
        }
    }
    writer.write_record(&header).map_err(failed)?;
    for point in &group.points {
        let mut line = vec![point.tree.to_string()];
        for measure in group.measures() {
            let told = group.told(measure, point);
            let percent = told.and_then(|told| told.percent);
            let numbers = [
                told.map(|told| told.value.median),
                percent.map(|p| p.median),
                percent.map(|p| p.interval.0),
                percent.map(|p| p.interval.1),
                percent.map(|p| p.confidence),
                told.and_then(|told| told.thesis),
            ];
            line.extend(numbers.map(|n| n.map_or(String::new(), |n| n.to_string())));
        }
        writer.write_record(&line).map_err(failed)?;
    }
    writer
        .into_inner()
        .map_err(|error| LabError::json(serde_json::Error::io(error.into_error())))
}

/// The data of the galleries for the script.
fn galleries(report: &Report) -> Result<Vec<Value>, LabError> {
    let gallery = |gallery: &Gallery| {
        let (_, first) = &gallery.trees[0];
        let (width, height) = first.page_size();
        let mut trees = Vec::new();
        for (tree, pixels) in &gallery.trees {
            let mut quantities = Vec::new();
            for (i, &common) in gallery.ends.iter().enumerate() {
                let own = Gallery::own_end(pixels, i);
                let end = own.max(common);
                quantities.push(json!({ "grey": pixels.grey(i, end)?, "end": end, "own": own }));
            }
            trees.push(json!({ "tree": tree, "quantities": quantities }));
        }
        Ok(json!({
            "width": width, "height": height, "ends": gallery.ends, "trees": trees,
            "picture": first.picture()?,
            "labels": Quantity::ALL.map(Quantity::label),
        }))
    };
    report.galleries.iter().map(gallery).collect()
}

fn gallery_markup(number: usize, gallery: &Gallery) -> Markup {
    let trees: Vec<&str> = gallery
        .trees
        .iter()
        .map(|(tree, _)| tree.as_str())
        .collect();
    let right = trees.len() - 1;
    let choose = |name: &str, at: usize| {
        html! {
            label { (name) " "
                select data-role=(name) {
                    @for (i, tree) in trees.iter().enumerate() { option value=(i) selected[i == at] { (tree) } }
                }
            }
        }
    };
    html! {
        h3 { "What each pixel cost" }
        div.gallery data-gallery=(number) {
            div.controls {
                label { "Show "
                    select data-role="quantity" {
                        @for (i, quantity) in Quantity::ALL.iter().enumerate() { option value=(i) { (quantity.label()) " per sample" } }
                    }
                }
                label { "Scale "
                    select data-role="scale" {
                        option value="common" { "common" }
                        option value="own" { "each its own" }
                    }
                }
                (choose("left", 0)) (choose("right", right))
            }
            div.wipe {
                canvas data-role="under" {}
                canvas data-role="over" {}
                div.handle aria-hidden="true" {}
                span.name.left-name {} span.name.right-name {}
            }
            label.slider { span { "Wipe" } input type="range" min="0" max="100" value="50" step="0.5" data-role="wipe" aria-label="wipe between the two trees"; }
            div.bar { canvas data-role="bar" width="256" height="1" {} span data-role="bar-low" { "0" } span data-role="bar-middle" {} span data-role="bar-high" {} }
            div.thumbnails {
                figure { img data-role="picture" alt="the scene, rendered"; figcaption { "the scene" } }
                @for (i, tree) in trees.iter().enumerate() {
                    figure data-tree=(i) { canvas tabindex="0" role="button" aria-label={ "show " (tree) " on the right" } {} figcaption { (tree) span.end {} } }
                }
            }
        }
    }
}

/// The cards of a group's trees.
fn cards(group: &Group) -> Markup {
    type Line = (&'static str, fn(&Point) -> String);
    let share = |part: u64, whole: u64| percent(100.0 * part as f64 / whole.max(1) as f64);
    fn card(point: &Point) -> &crate::CardRecord {
        &point.runs[0].card
    }
    let lines: &[Line] = &[
        ("nodes", |p| grouped(card(p).nodes.total())),
        ("kd", |p| grouped(card(p).nodes.kd)),
        ("oblique", |p| grouped(card(p).nodes.oblique)),
        ("leaves", |p| grouped(card(p).nodes.leaf)),
        ("empty leaves", |p| grouped(card(p).nodes.empty_leaf)),
        ("references", |p| grouped(card(p).references)),
        ("depth", |p| grouped(card(p).depth.into())),
        ("largest leaf", |p| grouped(card(p).largest_leaf)),
        ("bad refines", |p| grouped(card(p).bad_refines)),
        ("expected visits per ray", |p| {
            measured(card(p).expected_visits)
        }),
        ("expected tests per ray", |p| {
            measured(card(p).expected_tests)
        }),
        ("SAH cost", |p| measured(card(p).sah_cost)),
        ("size", |p| bytes(card(p).tree_bytes)),
        ("peak memory of a run", |p| {
            let peak = p.runs[0].record.peak_memory_bytes;
            peak.map_or("–".to_owned(), bytes)
        }),
        ("split candidates", |p| grouped(card(p).candidates)),
    ];
    let wins = |point: &Point| {
        let wins = card(point).wins;
        let all = wins.axis + wins.direction + wins.triangle + wins.edge;
        [
            ("splits won by axes", wins.axis),
            ("by other directions", wins.direction),
            ("by planes of triangles", wins.triangle),
            ("by planes of edges", wins.edge),
        ]
        .map(|(label, won)| (label, share(won, all)))
    };
    html! {
        details.cards {
            summary { "Tree cards" }
            div.cards {
                @for point in &group.points {
                    table.card {
                        caption { (point.tree) " " small { (point.tree.spec.summary) } }
                        @for (label, value) in lines { tr { th scope="row" { (label) } td { (value(point)) } } }
                        @for (label, value) in wins(point) { tr { th scope="row" { (label) } td { (value) } } }
                    }
                }
            }
        }
    }
}

/// The table of the scenes.
fn scenes(report: &Report) -> Markup {
    let record = |label: &str| {
        let group = report.groups.iter().find(|group| group.scene == label)?;
        Some(&group.points.first()?.runs.first()?.record)
    };
    let warnings = |facts: &SceneFacts| facts.warnings.clone();
    html! {
        section #scenes {
            h2 { "Scenes" }
            div.wide {
                table {
                    thead { tr {
                        th scope="col" { "scene" } th scope="col" { "triangles" } th scope="col" { "that cannot be hit" }
                        th scope="col" { "along the axes" } th scope="col" { "materials" } th scope="col" { "lights" }
                        th scope="col" { "pixels" } th scope="col" { "samples" } th scope="col" { "integrator" }
                        th scope="col" { "camera rays" } th scope="col" { "bounce rays" } th scope="col" { "shadow rays" }
                    } }
                    tbody {
                        @for (label, facts) in &report.scenes {
                            tr {
                                th scope="row" { (label) }
                                td { (grouped(facts.triangles)) } td { (grouped(facts.triangles_skipped)) }
                                td { (percent(100.0 * facts.axis_aligned)) }
                                td { (grouped(facts.materials)) } td { (grouped(facts.lights)) }
                                @if let Some(record) = record(label) {
                                    td { (grouped(record.pixels)) } td { (record.spp) }
                                    td { (record.integrator) @if let Some(depth) = record.max_depth { ", depth " (depth) } }
                                    td { (grouped(record.rays.camera)) } td { (grouped(record.rays.bounce)) } td { (grouped(record.rays.shadow)) }
                                } @else { @for _ in 0..6 { td { "–" } } }
                            }
                        }
                    }
                }
            }
            p.legend { "Along the axes: triangles whose normal is an axis. Of rays, those of the first tree and conditions." }
            @for (label, facts) in &report.scenes {
                @let warnings = warnings(facts);
                @if !warnings.is_empty() {
                    details { summary { (label) ": " (count(warnings.len() as u64, "warning")) } ul { @for warning in &warnings { li { (warning) } } } }
                }
            }
        }
    }
}

fn method(report: &Report) -> Markup {
    let records = || {
        (report.groups.iter())
            .flat_map(|group| &group.points)
            .flat_map(|point| &point.runs)
            .map(|run| &run.record)
    };
    let mut machines: Vec<String> = records()
        .map(|record| {
            let machine = &record.machine;
            format!(
                "{}, {}, {}",
                machine.cpu,
                count(machine.cores as u64, "core"),
                machine.os
            )
        })
        .collect();
    machines.sort();
    machines.dedup();
    let total: f64 = (report.groups.iter())
        .flat_map(|group| &group.points)
        .flat_map(|point| &point.runs)
        .map(|run| run.seconds)
        .sum();
    html! {
        section #method {
            h2 { "Method" }
            p { "To repeat it:" }
            pre { (report.method.command) }
            ul {
                li { "Splitplane " (report.method.program.version) ", commit " (report.method.program.commit) "." }
                @for machine in &machines { li { (machine) "." } }
                @if total > 0.0 { li { "All runs together took " (seconds(total)) "." } }
                li { "Each tree is built anew in each run, in a process of its own in an experiment. Trees take turns, repetition by repetition (A B C A B C): what disturbs the machine disturbs all alike." }
                li { "Times are taken without counters; counts come from a rendering of their own and are exactly reproducible. Times in per cent are medians of the ratios within a repetition; their intervals are those between two of these ratios that hold the true median with the stated probability, whatever the distribution." }
                li { "Triangle tests and visits: closest-hit rays are camera and bounce rays. Visits are those of interior nodes." }
                li { "The thesis: J. Hoobergs, Het gebruik van de normalen bij het bouwen van BSP acceleratiestructuren, KU Leuven, 2019." }
            }
            @if let Some((file, text)) = &report.method.source {
                details { summary { (file) } pre { (text) } }
            }
        }
    }
}
