//! The plots of a group.

use std::collections::BTreeMap;

use splitplane::{Directions, TreeChoice};

use super::group::{Group, Point, Told};
use super::measures::Measure;
use super::plot::{Kind, Plot, PlotPoint, Series, colour, step};
use crate::published::Curve;
use crate::run::Run;
use crate::stats::{Estimate, estimate};

/// The largest leaf, and the greatest depth, that curves go to.
const MOST_TRIANGLES: u32 = 20;

/// All plots of a group.
pub(crate) fn of_group(group: &Group) -> Vec<Plot> {
    let mut plots = Vec::new();
    for measure in group.measures() {
        plots.extend(match group.sweeps_k() {
            true => over_k(group, measure),
            false => bars(group, measure),
        });
    }
    for (curve, key, title, x, y) in [
        (
            Curve::TestsByLeafSize,
            "tests-by-leaf-size",
            "triangle tests by leaf size",
            "triangles in the leaf, at most",
            "share of all triangle tests, %",
        ),
        (
            Curve::KdShareByDepth,
            "kd-share-by-depth",
            "kd share of interior nodes by depth",
            "depth",
            "kd share, %",
        ),
    ] {
        for (suffix, points) in families(group) {
            let series = curves(group, curve, &points);
            if series.iter().all(|series| series.points.is_empty()) {
                continue;
            }
            let (of, key) = match suffix.as_str() {
                "" => (String::new(), format!("{}-{key}", group.slug())),
                tree => (
                    format!(", {tree}"),
                    format!("{}-{key}-{tree}", group.slug()),
                ),
            };
            plots.push(Plot {
                key,
                title: format!("{}: {title}{of}", group.title()),
                caption: format!("{title}{of}"),
                x: x.to_owned(),
                y: y.to_owned(),
                kind: Kind::Lines,
                series,
            });
        }
    }
    plots
}

/// Build time over the size of the scene, for scenes that are there in three or more sizes: a name,
/// a colon and a size, as `arcade:40000`. In units of n log n, so that a build whose time grows as
/// n log n is a level line.
pub(crate) fn over_sizes(groups: &[Group]) -> Vec<Plot> {
    let family = |group: &Group| {
        let (name, _) = group.scene.split_once(':')?;
        Some((name.to_owned(), group.conditions.clone()))
    };
    let mut families: Vec<((String, String), Vec<&Group>)> = Vec::new();
    for group in groups.iter().filter(|group| group.timed) {
        let Some(key) = family(group) else { continue };
        match families.iter_mut().find(|(other, _)| *other == key) {
            Some((_, members)) => members.push(group),
            None => families.push((key, vec![group])),
        }
    }
    families.retain(|(_, members)| members.len() >= 3);
    (families.into_iter())
        .map(|((name, conditions), mut members)| {
            let triangles = |group: &Group| group.points[0].runs[0].record.triangles as f64;
            members.sort_by(|a, b| triangles(a).total_cmp(&triangles(b)));
            let mut series: Vec<Series> = Vec::new();
            for (group, point) in
                (members.iter()).flat_map(|g| g.points.iter().map(move |p| (g, p)))
            {
                let n = triangles(group);
                let unit = 1e-9 * n * n.log2();
                let times = point.runs.iter().map(|run| run.record.build_s / unit);
                let Some(time) = estimate(times) else {
                    continue;
                };
                let name = point.tree.to_string();
                let at = estimated(n.log10(), &time);
                add(&mut series, &name, point.tree, false, at);
            }
            let (of, key) = match conditions.as_str() {
                "" => (name.clone(), name),
                conditions => (
                    format!("{name}, {conditions}"),
                    format!("{name} {conditions}"),
                ),
            };
            Plot {
                key: format!("{}-build-time-over-size", super::group::slug(&key)),
                title: format!("{of}: build time over n log₂ n, by the number of triangles n"),
                caption: format!("{of}: build time over n log₂ n"),
                x: "log₁₀ of the number of triangles".to_owned(),
                y: "build time / (n log₂ n), ns".to_owned(),
                kind: Kind::Lines,
                series,
            }
        })
        .collect()
}

/// The points whose curves share a plot: all; or, where numbers of directions are swept, those of
/// each tree that has several.
fn families(group: &Group) -> Vec<(String, Vec<&Point>)> {
    let all: Vec<&Point> = group.points.iter().collect();
    if !group.sweeps_k() {
        return vec![(String::new(), all)];
    }
    let mut families: Vec<(String, Vec<&Point>)> = Vec::new();
    for point in all {
        let name = point.tree.spec.name;
        match families.iter_mut().find(|(family, _)| family == name) {
            Some((_, points)) => points.push(point),
            None => families.push((name.to_owned(), vec![point])),
        }
    }
    families.retain(|(_, points)| points.len() > 1);
    families
}

fn y_label(measure: &Measure, group: &Group) -> String {
    match measure.relative {
        true => format!("{}, % of {}", measure.label, group.points[0].tree),
        false => format!("{}, %", measure.label),
    }
}

fn plot_point(x: f64, told: &Told) -> Option<PlotPoint> {
    Some(estimated(x, &told.percent?))
}

fn estimated(x: f64, y: &Estimate) -> PlotPoint {
    PlotPoint {
        x,
        y: y.median,
        low: y.interval.0,
        high: y.interval.1,
    }
}

fn exact(x: f64, y: f64) -> PlotPoint {
    PlotPoint {
        x,
        y,
        low: y,
        high: y,
    }
}

/// Puts a point on the line of this name, in the colour of the tree.
fn add(series: &mut Vec<Series>, name: &str, tree: TreeChoice, published: bool, at: PlotPoint) {
    let found = series
        .iter_mut()
        .find(|series| series.name == name && series.published == published);
    match found {
        Some(series) => series.points.push(at),
        None => series.push(Series {
            name: name.to_owned(),
            colour: colour(tree.spec),
            published,
            points: vec![at],
        }),
    }
}

/// A measure over the number of directions, a line for each tree.
fn over_k(group: &Group, measure: &Measure) -> Option<Plot> {
    let mut series: Vec<Series> = Vec::new();
    let mut add = |point: &Point, published: bool, at: PlotPoint| {
        let name = point.tree.spec.name;
        add(&mut series, name, point.tree, published, at);
    };
    for point in &group.points {
        let Some(k) = point.tree.direction_count else {
            continue;
        };
        let Some(told) = group.told(measure, point) else {
            continue;
        };
        if let Some(at) = plot_point(f64::from(k), &told) {
            add(point, false, at);
        }
        if let Some(thesis) = told.thesis {
            add(point, true, exact(f64::from(k), thesis));
        }
    }
    (!series.is_empty()).then(|| Plot {
        key: format!("{}-{}", group.slug(), measure.key),
        title: format!("{}: {}", group.title(), measure.label),
        caption: measure.label.to_owned(),
        x: "k".to_owned(),
        y: y_label(measure, group),
        kind: Kind::Lines,
        series,
    })
}

/// A measure, a bar for each tree.
fn bars(group: &Group, measure: &Measure) -> Option<Plot> {
    let names: Vec<String> = group.points.iter().map(|p| p.tree.to_string()).collect();
    let series = |published: bool| {
        let point = |(i, point): (usize, &Point)| {
            let told = group.told(measure, point)?;
            match published {
                true => Some(exact(i as f64, told.thesis?)),
                false => plot_point(i as f64, &told),
            }
        };
        Series {
            name: if published { "thesis" } else { "ours" }.to_owned(),
            colour: [0; 3],
            published,
            points: group.points.iter().enumerate().filter_map(point).collect(),
        }
    };
    let mut series = vec![series(false), series(true)];
    series.retain(|series| !series.points.is_empty());
    (!series.is_empty()).then(|| Plot {
        key: format!("{}-{}", group.slug(), measure.key),
        title: format!("{}: {}", group.title(), measure.label),
        caption: measure.label.to_owned(),
        x: "tree".to_owned(),
        y: y_label(measure, group),
        kind: Kind::Bars(names),
        series,
    })
}

fn curves(group: &Group, curve: Curve, points: &[&Point]) -> Vec<Series> {
    let one_tree = points
        .iter()
        .all(|point| point.tree.spec.name == points[0].tree.spec.name);
    let mut series = Vec::new();
    for (i, point) in points.iter().enumerate() {
        let colour = match one_tree && points.len() > 1 {
            true => step(i, points.len()),
            false => colour(point.tree.spec),
        };
        let ours = match curve {
            Curve::TestsByLeafSize => tests_by_leaf_size(&point.runs[0]),
            Curve::KdShareByDepth => kd_share_by_depth(&point.runs[0], point.tree),
        };
        let end = ours.last().map_or(0.0, |point| point.0);
        let thesis = group.thesis.curve(curve, point.tree);
        for (published, curve) in [(false, ours), (true, thesis)] {
            let points: Vec<PlotPoint> = (curve.into_iter())
                .filter(|(x, _)| !published || *x <= end)
                .map(|(x, share)| exact(x, 100.0 * share))
                .collect();
            if !points.is_empty() {
                series.push(Series {
                    name: point.tree.to_string(),
                    colour,
                    published,
                    points,
                });
            }
        }
    }
    series
}

/// Cumulative shares of the tests of all rays.
fn tests_by_leaf_size(run: &Run) -> Vec<(f64, f64)> {
    let sizes = &run.tests_by_leaf_size;
    let mut tests: BTreeMap<u32, u64> = BTreeMap::new();
    for (size, count) in sizes.closest.iter().chain(&sizes.shadow) {
        *tests.entry(*size).or_default() += count;
    }
    let all: u64 = tests.values().sum();
    let share = |most: u32| {
        let up_to: u64 = tests.range(..=most).map(|(_, count)| count).sum();
        (f64::from(most), up_to as f64 / all.max(1) as f64)
    };
    if all == 0 {
        return Vec::new();
    }
    (0..=MOST_TRIANGLES).map(share).collect()
}

/// Shares of kd nodes; nothing of a tree that has no others.
fn kd_share_by_depth(run: &Run, tree: TreeChoice) -> Vec<(f64, f64)> {
    let only_axes = tree.spec.directions == Directions::None && !tree.spec.triangle_planes;
    if only_axes {
        return Vec::new();
    }
    (run.card.interior_by_depth.iter().enumerate())
        .filter(|(_, (kd, oblique))| kd + oblique > 0)
        .map(|(depth, &(kd, oblique))| (depth as f64, kd as f64 / (kd + oblique) as f64))
        .collect()
}
