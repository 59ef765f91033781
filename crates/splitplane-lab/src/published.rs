//! Published figures, to be set beside our own. The data and their sources: `data/README.md`.

use serde::Deserialize;
use splitplane::{Ties, TreeChoice};

use crate::params::ties_named;

/// What is compared with published figures, by column: of a tree and of a scene rendered with it.
/// Visits are those of interior nodes and leaves together; closest-hit rays are camera and bounce
/// rays.
pub const QUANTITIES: [&str; 6] = [
    "nodes",
    "SAH cost",
    "tests, closest",
    "tests, shadow",
    "visits, closest",
    "visits, shadow",
];

/// How many of [`QUANTITIES`], from the first, are those of the tree alone.
pub(crate) const OF_THE_TREE: usize = 2;

/// A value for each of [`QUANTITIES`], where it is known.
pub(crate) type Figures = [Option<f64>; QUANTITIES.len()];

/// What a source says of a tree in a scene.
#[derive(Clone, Debug, PartialEq)]
struct Row {
    scene: String,
    triangles: u64,
    /// How many camera rays were cast, if that is known.
    camera_rays: Option<u64>,
    ties: Ties,
    tree: String,
    k: Option<u32>,
    in_percent: bool,
    figures: Figures,
}

/// A publication.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Source {
    /// Its name, in a word.
    pub(crate) name: &'static str,
    rows: Vec<Row>,
}

/// A scene of which figures were published, and the trees' measure in it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Place<'a> {
    pub(crate) scene: &'a str,
    pub(crate) triangles: u64,
    pub(crate) measure: TreeChoice,
}

impl Source {
    /// All sources, the one that is nearest to what we do first: the thesis's program run again,
    /// and the thesis.
    pub(crate) fn all() -> [Source; 2] {
        let well_formed = "a test reads the embedded figures";
        [
            Source {
                name: "fork",
                rows: fork(include_str!("../data/fork.csv")).expect(well_formed),
            },
            Source {
                name: "thesis",
                rows: thesis(THESIS).expect(well_formed),
            },
        ]
    }

    fn row(&self, place: Place<'_>, ties: Ties, tree: TreeChoice) -> Option<&Row> {
        self.rows.iter().find(|row| {
            (row.scene.as_str(), row.triangles, row.ties) == (place.scene, place.triangles, ties)
                && (row.tree.as_str(), row.k) == (tree.spec.name, tree.direction_count)
        })
    }

    fn measure(&self, place: Place<'_>) -> Option<&Row> {
        self.row(place, Ties::AsPublished, place.measure)
            .filter(|row| !row.in_percent)
    }

    /// The absolute figures of the measure, and the camera rays that were cast.
    pub(crate) fn absolute(&self, place: Place<'_>) -> (Figures, Option<u64>) {
        self.measure(place)
            .map_or((Figures::default(), None), |row| {
                (row.figures, row.camera_rays)
            })
    }

    /// What is said of a tree, in per cent of the measure with published ties.
    pub(crate) fn percent(&self, place: Place<'_>, ties: Ties, tree: TreeChoice) -> Figures {
        let Some(row) = self.row(place, ties, tree) else {
            return Figures::default();
        };
        if row.in_percent {
            return row.figures;
        }
        let measure = self
            .measure(place)
            .map_or(Figures::default(), |row| row.figures);
        std::array::from_fn(|i| Some(100.0 * row.figures[i]? / measure[i]?))
    }
}

fn fork(text: &str) -> Result<Vec<Row>, csv::Error> {
    #[derive(Deserialize)]
    struct Line {
        scene: String,
        triangles: u64,
        camera_rays: u64,
        ties: String,
        tree: String,
        k: Option<u32>,
        unit: String,
        nodes: Option<f64>,
        sah_cost: Option<f64>,
        tests_closest: Option<f64>,
        tests_shadow: Option<f64>,
        visits_closest: Option<f64>,
        visits_shadow: Option<f64>,
    }
    let mut reader = csv::Reader::from_reader(text.as_bytes());
    let row = |line: Line| {
        let ties = ties_named(&line.ties);
        Row {
            scene: line.scene,
            triangles: line.triangles,
            camera_rays: Some(line.camera_rays),
            ties: ties.unwrap_or(Ties::AsPublished),
            tree: line.tree,
            k: line.k,
            in_percent: line.unit == "percent",
            figures: [
                line.nodes,
                line.sah_cost,
                line.tests_closest,
                line.tests_shadow,
                line.visits_closest,
                line.visits_shadow,
            ],
        }
    };
    reader.deserialize().map(|line| line.map(row)).collect()
}

/// The triangles of the thesis's scenes.
const THESIS_SCENES: [(&str, u64); 4] = [
    ("killeroo-legs", 33_264),
    ("sponza", 227_309),
    ("conference", 123_651),
    ("museum", 1_462_840),
];

/// A line of the thesis's results.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub(crate) struct ThesisLine {
    experiment: String,
    tree: String,
    k: Option<u32>,
    scene: String,
    pub(crate) render_s: f64,
    pub(crate) build_s: f64,
    pub(crate) nodes: f64,
    pub(crate) kd_nodes: f64,
    pub(crate) oblique_nodes: f64,
    pub(crate) sah_cost: f64,
    pub(crate) triangle_tests_closest: f64,
    pub(crate) triangle_tests_shadow: f64,
    pub(crate) kd_visits_closest: f64,
    pub(crate) kd_visits_shadow: f64,
    pub(crate) oblique_visits_closest: f64,
    pub(crate) oblique_visits_shadow: f64,
    total_visits_closest: f64,
    total_visits_shadow: f64,
}

/// What the thesis has of one scene.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Thesis {
    /// The triangles of its scene; those of a scene of the same name may be more or fewer.
    pub(crate) triangles: u64,
    lines: Vec<ThesisLine>,
    /// Cumulative shares of the triangle tests by leaf size: `(tree, size, share)`.
    leaf_sizes: Vec<(String, f64, f64)>,
    /// Shares of kd nodes among the interior nodes of a depth: `(tree, depth, share)`.
    depths: Vec<(String, f64, f64)>,
}

/// A curve of the thesis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Curve {
    /// The cumulative share of triangle tests by the size of the leaf.
    TestsByLeafSize,
    /// The share of kd nodes among the interior nodes of a depth.
    KdShareByDepth,
}

impl Thesis {
    /// What the thesis has of the scene of that name; nothing of most.
    pub(crate) fn of(scene: &str) -> Thesis {
        let well_formed = "a test reads the embedded figures";
        let Some(&(_, triangles)) = THESIS_SCENES.iter().find(|(name, _)| *name == scene) else {
            return Thesis::default();
        };
        let mut lines = thesis_lines(THESIS).expect(well_formed);
        lines.retain(|line| line.scene == scene);
        let of_scene = |text| {
            let curves = thesis_curves(text).expect(well_formed);
            let of_scene = curves.into_iter().filter(|line| line.1 == scene);
            of_scene.map(|(tree, _, x, y)| (tree, x, y)).collect()
        };
        Thesis {
            triangles,
            lines,
            leaf_sizes: of_scene(include_str!("../data/thesis-leaf-size.csv")),
            depths: of_scene(include_str!("../data/thesis-kd-share-by-depth.csv")),
        }
    }

    /// What it has of a tree.
    pub(crate) fn line(&self, tree: TreeChoice) -> Option<&ThesisLine> {
        (self.lines.iter())
            .find(|line| (line.tree.as_str(), line.k) == (tree.spec.name, tree.direction_count))
    }

    /// A curve of a tree; empty where it has none.
    pub(crate) fn curve(&self, curve: Curve, tree: TreeChoice) -> Vec<(f64, f64)> {
        let name = tree.to_string();
        let lines = match curve {
            Curve::TestsByLeafSize => &self.leaf_sizes,
            Curve::KdShareByDepth => &self.depths,
        };
        let of_tree = lines.iter().filter(|(tree, _, _)| *tree == name);
        of_tree.map(|&(_, x, y)| (x, y)).collect()
    }
}

const THESIS: &str = include_str!("../data/thesis.csv");

/// The lines; the first of a tree and scene is the one that counts.
fn thesis_lines(text: &str) -> Result<Vec<ThesisLine>, csv::Error> {
    let mut reader = csv::Reader::from_reader(text.as_bytes());
    let mut lines: Vec<ThesisLine> = reader.deserialize().collect::<Result<_, _>>()?;
    lines.sort_by_key(|line| line.experiment != "comparison");
    Ok(lines)
}

/// Tree, scene, x and y of each line.
fn thesis_curves(text: &str) -> Result<Vec<(String, String, f64, f64)>, csv::Error> {
    let mut reader = csv::Reader::from_reader(text.as_bytes());
    reader.deserialize().collect()
}

fn thesis(text: &str) -> Result<Vec<Row>, csv::Error> {
    let row = |line: ThesisLine| Row {
        triangles: THESIS_SCENES
            .iter()
            .find(|(scene, _)| *scene == line.scene)
            .map_or(0, |&(_, triangles)| triangles),
        scene: line.scene,
        camera_rays: None,
        ties: Ties::AsPublished,
        tree: line.tree,
        k: line.k,
        in_percent: false,
        figures: [
            line.nodes,
            line.sah_cost,
            line.triangle_tests_closest,
            line.triangle_tests_shadow,
            line.total_visits_closest,
            line.total_visits_shadow,
        ]
        .map(Some),
    };
    Ok(thesis_lines(text)?.into_iter().map(row).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use splitplane::TREES;

    #[test]
    fn every_published_line_is_of_a_tree_and_a_scene_that_there_is() {
        for source in Source::all() {
            assert!(!source.rows.is_empty());
            for row in &source.rows {
                let choice = TreeChoice::new(&row.tree, row.k).unwrap();
                assert_eq!(
                    (choice.spec.name, choice.direction_count),
                    (row.tree.as_str(), row.k)
                );
                assert!(row.triangles > 0, "{}", row.scene);
                assert!(row.figures[0].is_some());
            }
        }
        let text = include_str!("../data/fork.csv");
        for line in text.lines().skip(1) {
            let ties = line.split(',').nth(3).unwrap();
            assert!(ties_named(ties).is_ok(), "{ties}");
            let unit = line.split(',').nth(6).unwrap();
            assert!(["count", "percent"].contains(&unit), "{unit}");
        }
    }

    #[test]
    fn both_sources_know_all_trees_of_the_thesis_somewhere() {
        let measure = TreeChoice::new(TREES[0].name, None).unwrap();
        let [fork, thesis] = Source::all();
        for (source, triangles) in [(fork, 8_316), (thesis, 33_264)] {
            let place = Place {
                scene: "killeroo-legs",
                triangles,
                measure,
            };
            for spec in TREES.iter().filter(|spec| !spec.thesis_name.is_empty()) {
                let tree = TreeChoice::new(spec.name, None).unwrap();
                let percent = source.percent(place, Ties::AsPublished, tree);
                // The thesis's sweep leaves out the trees of fixed directions and Ize's; its
                // comparison has them.
                assert!(percent[0].is_some(), "{} of {tree}", source.name);
            }
            assert_eq!(
                source.percent(place, Ties::AsPublished, measure)[0],
                Some(100.0)
            );
        }
    }

    #[test]
    fn of_the_thesis_the_comparison_comes_before_the_sweep() {
        let [_, thesis] = Source::all();
        let place = Place {
            scene: "killeroo-legs",
            triangles: 33_264,
            measure: TreeChoice::new(TREES[0].name, None).unwrap(),
        };
        let tree = TreeChoice::new("wn+kd", Some(6)).unwrap();
        let percent = thesis.percent(place, Ties::AsPublished, tree);
        // The table of the thesis has 147.6, 28.5, 19.0 and 16.1.
        let rounded = percent.map(|p| (10.0 * p.unwrap()).round() / 10.0);
        assert_eq!(rounded[..4], [147.6, 28.5, 19.0, 16.1]);
    }

    #[test]
    fn every_curve_of_the_thesis_is_of_a_tree_of_its_table_and_ends_where_it_must() {
        for (scene, _) in THESIS_SCENES {
            let thesis = Thesis::of(scene);
            assert!(!thesis.lines.is_empty());
            for curve in [Curve::TestsByLeafSize, Curve::KdShareByDepth] {
                let (lines, cumulative) = match curve {
                    Curve::TestsByLeafSize => (&thesis.leaf_sizes, true),
                    Curve::KdShareByDepth => (&thesis.depths, false),
                };
                assert!(!lines.is_empty());
                for (tree, _, share) in lines {
                    let choice: TreeChoice = tree.parse().unwrap();
                    assert!(thesis.line(choice).is_some(), "{tree} in {scene}");
                    assert!(
                        (0.0..=1.0 + 1e-9).contains(share),
                        "{tree} in {scene}: {share}"
                    );
                    let curve = thesis.curve(curve, choice);
                    let rises = curve
                        .windows(2)
                        .all(|w| w[0].0 < w[1].0 && w[0].1 <= w[1].1 + 1e-9);
                    assert!(!cumulative || rises, "{tree} in {scene}");
                }
            }
        }
        assert_eq!(Thesis::of("truck"), Thesis::default());
    }
}
