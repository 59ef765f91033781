//! A cell of a grid: one run, described in full.

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use splitplane::{ObliquePricing, TreeChoice};

use crate::params::{Preset, ties_named, traversal_named};
use crate::run::{Layouts, Settings};
use crate::window::{MOST_SAMPLES, Resolution, crop_named};

/// Everything about a run but its scene and its tree. What is left out is as the preset or the
/// scene says. The names are those of a record, and the axes of a grid.
///
/// A further parameter is a field here and a line in [`Conditions::settings`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Conditions {
    /// Build parameters by name; left out: "thesis".
    #[serde(skip_serializing_if = "Option::is_none")]
    pub preset: Option<String>,
    /// How triangles that touch a plane are treated: "published" or "tolerant".
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ties: Option<String>,
    /// Whether triangles are clipped to their cells.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub clip: Option<bool>,
    /// In nodes of more triangles only axes are tried, in trees that try axes.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub oblique_up_to: Option<u32>,
    /// How oblique nodes are priced: "published" or "fork".
    #[serde(skip_serializing_if = "Option::is_none")]
    pub oblique_pricing: Option<String>,
    /// Which cells a ray passes: "exact" or "published".
    #[serde(skip_serializing_if = "Option::is_none")]
    pub traversal: Option<String>,
    /// How the tree is stored that answers the rays, of times and of counts alike: "binary" or
    /// "wide"; left out: "binary", as in the thesis.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub layout: Option<String>,
    /// Cost of a ray-triangle test.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub intersection_cost: Option<f64>,
    /// Cost of a visit of an axis-aligned node.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub kd_traversal_cost: Option<f64>,
    /// Cost of a visit of a node with an oblique plane.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub oblique_traversal_cost: Option<f64>,
    /// Ize's α.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub alpha: Option<f64>,
    /// Fraction of the cost taken off where a child is empty.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub empty_bonus: Option<f64>,
    /// A node of at most this many triangles is a leaf.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_prims: Option<u32>,
    /// Seed of the build's random draws; left out: 0.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub seed: Option<u64>,
    /// Seed of the samples; left out: 0.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sample_seed: Option<u64>,
    /// Threads that build and render; left out: 1.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub threads: Option<u16>,
    /// Samples per pixel.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub spp: Option<u32>,
    /// Size of the full picture: "800x600", or a width.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub resolution: Option<Size>,
    /// The part of the picture to render: "x0,x1,y0,y1".
    #[serde(skip_serializing_if = "Option::is_none")]
    pub crop: Option<String>,
    /// The most bounces.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_depth: Option<u32>,
}

/// A size as TOML has it: a number or a text.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Size {
    /// A width.
    Width(u32),
    /// Anything that a [`Resolution`] can be read from.
    Text(String),
}

impl Size {
    fn resolution(&self) -> Result<Resolution, String> {
        match self {
            Size::Width(width) => width.to_string().parse(),
            Size::Text(text) => text.parse(),
        }
    }
}

impl Conditions {
    /// The settings that these conditions ask for, for a scene whose picture is `scene_size`.
    ///
    /// # Errors
    /// A name that stands for nothing, or a number out of range.
    pub fn settings(&self, scene_size: (u32, u32)) -> Result<Settings, String> {
        let text = |error: crate::UnknownName| error.to_string();
        let preset: Preset = match &self.preset {
            Some(name) => name.parse().map_err(text)?,
            None => Preset::Thesis,
        };
        let mut settings = Settings::of_preset(preset);
        let params = &mut settings.params;
        if let Some(ties) = &self.ties {
            params.ties = ties_named(ties).map_err(text)?;
        }
        params.clip = self.clip.unwrap_or(params.clip);
        params.oblique_up_to = self.oblique_up_to.unwrap_or(params.oblique_up_to);
        let (ObliquePricing::Published { alpha } | ObliquePricing::Fork { alpha }) =
            params.oblique_pricing;
        let alpha = self.alpha.unwrap_or(alpha);
        params.oblique_pricing = match (self.oblique_pricing.as_deref(), params.oblique_pricing) {
            (Some("published"), _) | (None, ObliquePricing::Published { .. }) => {
                ObliquePricing::Published { alpha }
            }
            (Some("fork"), _) | (None, ObliquePricing::Fork { .. }) => {
                ObliquePricing::Fork { alpha }
            }
            (Some(other), _) => {
                return Err(format!(
                    "no pricing is called \"{other}\"; there are published, fork"
                ));
            }
        };
        let or = |given: Option<f64>, value: &mut f64| *value = given.unwrap_or(*value);
        or(self.intersection_cost, &mut params.intersection_cost);
        or(self.kd_traversal_cost, &mut params.kd_traversal_cost);
        or(
            self.oblique_traversal_cost,
            &mut params.oblique_traversal_cost,
        );
        or(self.empty_bonus, &mut params.empty_bonus);
        params.max_prims = self.max_prims.unwrap_or(params.max_prims);
        params.seed = self.seed.unwrap_or(params.seed);
        params.check().map_err(|error| error.to_string())?;
        if let Some(traversal) = &self.traversal {
            settings.traversal = traversal_named(traversal).map_err(text)?;
        }
        if let Some(layout) = &self.layout {
            settings.layouts = Layouts::both(layout.parse()?);
        }
        let checked = settings.layouts.check(settings.traversal);
        checked.map_err(|error| error.to_string())?;
        let render = &mut settings.render;
        render.threads = usize::from(self.threads.unwrap_or(1));
        if render.threads == 0 {
            return Err("threads are 1 or more".to_owned());
        }
        render.seed = self.sample_seed.unwrap_or(0);
        if self
            .spp
            .is_some_and(|spp| !(1..=MOST_SAMPLES).contains(&spp))
        {
            return Err(format!("spp is from 1 to {MOST_SAMPLES}"));
        }
        render.samples_per_pixel = self.spp;
        render.resolution = match &self.resolution {
            Some(size) => Some(size.resolution()?.of(scene_size)),
            None => None,
        };
        render.crop = self.crop.as_deref().map(crop_named).transpose()?;
        render.max_depth = self.max_depth;
        Ok(settings)
    }

    /// The conditions as JSON, without what is left out.
    pub(crate) fn fields(&self) -> serde_json::Map<String, serde_json::Value> {
        match serde_json::to_value(self) {
            Ok(serde_json::Value::Object(fields)) => fields,
            _ => serde_json::Map::new(),
        }
    }
}

/// Version and commit of the program that planned an experiment or ran a cell.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Program {
    /// Version of Splitplane.
    pub version: String,
    /// Its commit; "unknown" outside a checkout.
    pub commit: String,
}

impl Program {
    /// This one.
    pub fn this() -> Program {
        let (version, commit) = crate::record::version_and_commit();
        Program { version, commit }
    }
}

/// One run of an experiment.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Cell {
    /// 16 hexadecimal digits that follow from everything that the result depends on: the scene's
    /// geometry, the tree, the conditions, the repetition, the program's commit.
    pub id: String,
    /// The scene, by its label in the plan.
    pub scene: String,
    /// The tree, without its number of directions.
    pub tree: String,
    /// The number of directions tested in a node; null for trees that take none.
    pub k: Option<u32>,
    /// Which of several runs, from 0.
    pub repetition: u32,
    /// The times count: the cell wants the machine for itself.
    pub timed: bool,
    /// What each pixel cost is kept.
    pub picture: bool,
    /// Everything else.
    pub conditions: Conditions,
    /// The cell is ended after so many seconds.
    pub limit_s: f64,
}

impl Cell {
    /// The tree with its number of directions.
    pub fn tree_with_k(&self) -> String {
        match self.k {
            Some(k) => format!("{}:{k}", self.tree),
            None => self.tree.clone(),
        }
    }

    /// The tree.
    ///
    /// # Errors
    /// There is no such tree.
    pub fn choice(&self) -> Result<TreeChoice, splitplane::ParseTreeError> {
        TreeChoice::new(&self.tree, self.k)
    }

    /// The same cell with its id, for a scene of that digest.
    pub(crate) fn identified(mut self, program: &Program, scene_digest: &str) -> Cell {
        let content = serde_json::json!([
            program,
            scene_digest,
            self.tree,
            self.k,
            self.repetition,
            self.timed,
            self.picture,
            self.conditions,
        ]);
        self.id = digest([content.to_string().as_bytes()]);
        self.id.truncate(16);
        self
    }
}

/// SHA-256 of all parts, one behind the other, in hexadecimal digits.
pub(crate) fn digest<'a>(parts: impl IntoIterator<Item = &'a [u8]>) -> String {
    let mut hash = Sha256::new();
    for part in parts {
        hash.update(part);
    }
    hash.finalize().iter().map(|b| format!("{b:02x}")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cell(conditions: Conditions) -> Cell {
        Cell {
            id: String::new(),
            scene: "hills".into(),
            tree: "kd".into(),
            k: None,
            repetition: 0,
            timed: true,
            picture: false,
            conditions,
            limit_s: 10.0,
        }
    }

    #[test]
    fn an_id_follows_from_what_the_result_depends_on_and_from_nothing_else() {
        let program = Program {
            version: "1".into(),
            commit: "a".into(),
        };
        let id = |cell: Cell, digest: &str| cell.identified(&program, digest).id;
        let plain = || cell(Conditions::default());
        let first = id(plain(), "x");
        assert_eq!(first.len(), 16);
        let later = Cell {
            limit_s: 20.0,
            scene: "the hills".into(),
            ..plain()
        };
        assert_eq!(id(later, "x"), first);
        let seeded = cell(Conditions {
            seed: Some(1),
            ..Conditions::default()
        });
        let again = Cell {
            repetition: 1,
            ..plain()
        };
        let ids = [
            first,
            id(plain(), "y"),
            id(seeded, "x"),
            id(again, "x"),
            plain()
                .identified(
                    &Program {
                        commit: "b".into(),
                        ..program.clone()
                    },
                    "x",
                )
                .id,
        ];
        for (i, one) in ids.iter().enumerate() {
            assert!(!ids[..i].contains(one), "{ids:?}");
        }
    }

    #[test]
    fn conditions_that_cannot_be_say_what_would_do() {
        let wrong = |conditions: Conditions| conditions.settings((100, 50)).unwrap_err();
        let text = wrong(Conditions {
            ties: Some("loose".into()),
            ..Conditions::default()
        });
        assert!(text.contains("published, tolerant"), "{text}");
        let text = wrong(Conditions {
            resolution: Some(Size::Text("wide".into())),
            ..Conditions::default()
        });
        assert!(text.contains("800x600"), "{text}");
        let settings = Conditions {
            resolution: Some(Size::Width(20)),
            alpha: Some(0.2),
            clip: Some(true),
            oblique_up_to: Some(9),
            ..Conditions::default()
        };
        let settings = settings.settings((100, 50)).unwrap();
        assert!(settings.params.clip && settings.params.oblique_up_to == 9);
        assert_eq!(settings.render.resolution, Some((20, 10)));
        assert_eq!(settings.render.threads, 1);
        let priced = ObliquePricing::Published { alpha: 0.2 };
        assert_eq!(settings.params.oblique_pricing, priced);
    }
}
