//! What a report has of each tree: one row per column of its tables.

use crate::compare::Unit;
use crate::published::ThesisLine;
use crate::record::Record;

/// A column of a table, and a plot.
pub(crate) struct Measure {
    /// Its name in names of files.
    pub(crate) key: &'static str,
    /// Its name.
    pub(crate) label: &'static str,
    /// What its numbers count.
    pub(crate) unit: Unit,
    /// Whether it is told in per cent of the first tree; else it is a share itself, in per cent.
    pub(crate) relative: bool,
    /// Whether it is a time, which means nothing where only counts were asked for.
    pub(crate) time: bool,
    /// Of a run; `None`: there is nothing to take a share of.
    pub(crate) of: fn(&Record) -> Option<f64>,
    /// Of the thesis's tree.
    pub(crate) thesis: Option<fn(&ThesisLine) -> f64>,
}

fn share(part: u64, whole: u64) -> Option<f64> {
    (whole > 0).then(|| 100.0 * part as f64 / whole as f64)
}

/// Smaller is better in all that are relative.
pub(crate) static MEASURES: &[Measure] = &[
    Measure {
        key: "render-time",
        label: "render time",
        unit: Unit::Seconds,
        relative: true,
        time: true,
        of: |r| Some(r.render_s),
        thesis: Some(|t| t.render_s),
    },
    Measure {
        key: "build-time",
        label: "build time",
        unit: Unit::Seconds,
        relative: true,
        time: true,
        of: |r| Some(r.build_s),
        thesis: Some(|t| t.build_s),
    },
    Measure {
        key: "tests-closest",
        label: "triangle tests, closest-hit rays",
        unit: Unit::Count,
        relative: true,
        time: false,
        of: |r| Some(r.triangle_tests.closest() as f64),
        thesis: Some(|t| t.triangle_tests_closest),
    },
    Measure {
        key: "tests-shadow",
        label: "triangle tests, shadow rays",
        unit: Unit::Count,
        relative: true,
        time: false,
        of: |r| Some(r.triangle_tests.shadow as f64),
        thesis: Some(|t| t.triangle_tests_shadow),
    },
    Measure {
        key: "visits-closest",
        label: "interior visits, closest-hit rays",
        unit: Unit::Count,
        relative: true,
        time: false,
        of: |r| Some(r.interior_visits().closest() as f64),
        thesis: Some(|t| t.kd_visits_closest + t.oblique_visits_closest),
    },
    Measure {
        key: "visits-shadow",
        label: "interior visits, shadow rays",
        unit: Unit::Count,
        relative: true,
        time: false,
        of: |r| Some(r.interior_visits().shadow as f64),
        thesis: Some(|t| t.kd_visits_shadow + t.oblique_visits_shadow),
    },
    Measure {
        key: "sah-cost",
        label: "SAH cost",
        unit: Unit::Cost,
        relative: true,
        time: false,
        of: |r| Some(r.sah_cost),
        thesis: Some(|t| t.sah_cost),
    },
    Measure {
        key: "nodes",
        label: "nodes",
        unit: Unit::Count,
        relative: true,
        time: false,
        of: |r| Some(r.nodes.total() as f64),
        thesis: Some(|t| t.nodes),
    },
    Measure {
        key: "interior-nodes",
        label: "interior nodes",
        unit: Unit::Count,
        relative: true,
        time: false,
        of: |r| Some((r.nodes.kd + r.nodes.oblique) as f64),
        thesis: Some(|t| t.kd_nodes + t.oblique_nodes),
    },
    Measure {
        key: "tree-size",
        label: "size of the tree",
        unit: Unit::Bytes,
        relative: true,
        time: false,
        of: |r| Some(r.tree_bytes as f64),
        thesis: None,
    },
    Measure {
        key: "kd-share-of-nodes",
        label: "kd share of interior nodes",
        unit: Unit::Percent,
        relative: false,
        time: false,
        of: |r| share(r.nodes.kd, r.nodes.kd + r.nodes.oblique),
        thesis: Some(|t| 100.0 * t.kd_nodes / (t.kd_nodes + t.oblique_nodes)),
    },
    Measure {
        key: "kd-share-of-visits-closest",
        label: "kd share of visits, closest-hit rays",
        unit: Unit::Percent,
        relative: false,
        time: false,
        of: |r| {
            let kd = r.kd_visits.closest();
            share(kd, kd + r.oblique_visits.closest())
        },
        thesis: Some(|t| {
            100.0 * t.kd_visits_closest / (t.kd_visits_closest + t.oblique_visits_closest)
        }),
    },
    Measure {
        key: "kd-share-of-visits-shadow",
        label: "kd share of visits, shadow rays",
        unit: Unit::Percent,
        relative: false,
        time: false,
        of: |r| {
            let kd = r.kd_visits.shadow;
            share(kd, kd + r.oblique_visits.shadow)
        },
        thesis: Some(|t| {
            100.0 * t.kd_visits_shadow / (t.kd_visits_shadow + t.oblique_visits_shadow)
        }),
    },
];
