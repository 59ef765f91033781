//! Build parameters, by name and as a record.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};
use splitplane::{BuildParams, DepthLimit, ObliquePricing, Ties, Traversal};

/// A set of build parameters that has a name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Preset {
    /// [`BuildParams::THESIS`]: what experiments measure.
    Thesis,
    /// [`BuildParams::PBRT3`].
    Pbrt3,
    /// [`BuildParams::PBRT4`].
    Pbrt4,
    /// [`BuildParams::default`].
    Default,
    /// [`BuildParams::FAST`].
    Fast,
}

impl Preset {
    /// All presets.
    pub const ALL: [Preset; 5] = [
        Preset::Thesis,
        Preset::Pbrt3,
        Preset::Pbrt4,
        Preset::Default,
        Preset::Fast,
    ];

    /// Its name, what it is in a line, and its parameters.
    fn row(self) -> (&'static str, &'static str, BuildParams) {
        match self {
            Preset::Thesis => (
                "thesis",
                "the thesis's costs, depths and ties",
                BuildParams::THESIS,
            ),
            Preset::Pbrt3 => (
                "pbrt3",
                "those of pbrt-v3's kd-tree: costs 80 and 1, empty bonus 0.5, deeper; ties as in \
                 the thesis",
                BuildParams::PBRT3,
            ),
            Preset::Pbrt4 => (
                "pbrt4",
                "those of pbrt-v4's kd-tree: as pbrt3, but costs 5 and 1",
                BuildParams::PBRT4,
            ),
            Preset::Default => (
                "default",
                "the thesis's costs and depths; tolerant ties, clipped, oblique planes in nodes of up \
                 to 512 triangles",
                BuildParams::default(),
            ),
            Preset::Fast => (
                "fast",
                "built soon: as default, with leaves of up to eight triangles",
                BuildParams::FAST,
            ),
        }
    }

    /// Its name.
    pub fn name(self) -> &'static str {
        self.row().0
    }

    /// What it is, in a line.
    pub fn summary(self) -> &'static str {
        self.row().1
    }

    /// Its parameters.
    pub fn params(self) -> BuildParams {
        self.row().2
    }
}

/// The name of a way to treat ties.
pub fn ties_name(ties: Ties) -> &'static str {
    match ties {
        Ties::AsPublished => "published",
        Ties::Tolerant => "tolerant",
    }
}

/// A name that stands for nothing, and the names that do.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("no {what} is called \"{given}\"; there are {known}")]
pub struct UnknownName {
    what: &'static str,
    given: String,
    known: String,
}

fn find<T: Copy>(
    what: &'static str,
    given: &str,
    all: &[T],
    name: impl Fn(T) -> &'static str,
) -> Result<T, UnknownName> {
    let found = all
        .iter()
        .find(|item| name(**item).eq_ignore_ascii_case(given.trim()));
    found.copied().ok_or_else(|| UnknownName {
        what,
        given: given.to_owned(),
        known: all
            .iter()
            .map(|item| name(*item))
            .collect::<Vec<_>>()
            .join(", "),
    })
}

impl Preset {
    /// The preset that parameters came from, ties, clipping, pricing and seed apart; the default one where
    /// none is like them.
    pub(crate) fn of(params: &BuildParams) -> Preset {
        let like = |preset: &Preset| {
            let own = BuildParams {
                ties: params.ties,
                clip: params.clip,
                oblique_pricing: params.oblique_pricing,
                seed: params.seed,
                ..preset.params()
            };
            own == *params
        };
        let exactly = |preset: &&Preset| preset.params() == *params;
        let all = || Preset::ALL.iter();
        (all()
            .find(exactly)
            .or_else(|| all().find(|preset| like(preset))))
        .copied()
        .unwrap_or(Preset::Default)
    }
}

impl FromStr for Preset {
    type Err = UnknownName;

    fn from_str(text: &str) -> Result<Self, UnknownName> {
        find("preset", text, &Preset::ALL, Preset::name)
    }
}

impl fmt::Display for Preset {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// The way to treat ties of that name, in upper or lower case.
///
/// # Errors
/// No such way.
pub fn ties_named(text: &str) -> Result<Ties, UnknownName> {
    find(
        "way to treat ties",
        text,
        &[Ties::AsPublished, Ties::Tolerant],
        ties_name,
    )
}

/// The name of a way to decide which cells a ray passes.
pub fn traversal_name(traversal: Traversal) -> &'static str {
    match traversal {
        Traversal::Exact => "exact",
        Traversal::AsPublished => "published",
    }
}

/// The way to decide which cells a ray passes of that name, in upper or lower case.
///
/// # Errors
/// No such way.
pub fn traversal_named(text: &str) -> Result<Traversal, UnknownName> {
    find(
        "traversal",
        text,
        &[Traversal::Exact, Traversal::AsPublished],
        traversal_name,
    )
}

/// The name of a way to price oblique nodes.
fn pricing_name(pricing: ObliquePricing) -> &'static str {
    match pricing {
        ObliquePricing::Published { .. } => "published",
        ObliquePricing::Fork { .. } => "fork",
    }
}

/// [`BuildParams`] as a record holds them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ParamsRecord {
    /// Cost of a ray-triangle test.
    pub intersection_cost: f64,
    /// Cost of a visit of an axis-aligned node.
    pub kd_traversal_cost: f64,
    /// Cost of a visit of a node with an oblique plane.
    pub oblique_traversal_cost: f64,
    /// How oblique nodes are priced in trees with kd nodes: "published" or "fork".
    pub oblique_pricing: String,
    /// Ize's α, of the pricing.
    pub alpha: f64,
    /// Fraction of the cost taken off where a child is empty.
    pub empty_bonus: f64,
    /// A node of at most this many triangles is a leaf.
    pub max_prims: u32,
    /// The depth limit's constant part.
    pub max_depth_base: f64,
    /// The depth limit's part per doubling of the triangles.
    pub max_depth_per_level: f64,
    /// "published" or "tolerant".
    pub ties: String,
    /// Whether triangles are clipped to their cells.
    #[serde(default)]
    pub clip: bool,
    /// In nodes of more triangles only axes are tried, in trees that try axes; none: in no node.
    #[serde(default)]
    pub oblique_up_to: Option<u32>,
}

impl ParamsRecord {
    /// How triangles are treated that a plane touches or cuts, in words: "ties tolerant, clipped".
    pub fn ways(&self) -> String {
        match self.clip {
            true => format!("ties {}, clipped", self.ties),
            false => format!("ties {}", self.ties),
        }
    }
}

impl From<&BuildParams> for ParamsRecord {
    fn from(params: &BuildParams) -> Self {
        let (ObliquePricing::Published { alpha } | ObliquePricing::Fork { alpha }) =
            params.oblique_pricing;
        let (base, per_level) = match params.max_depth {
            DepthLimit::Log2 { base, per_level } => (base, per_level),
            DepthLimit::Fixed(depth) => (f64::from(depth), 0.0),
        };
        ParamsRecord {
            intersection_cost: params.intersection_cost,
            kd_traversal_cost: params.kd_traversal_cost,
            oblique_traversal_cost: params.oblique_traversal_cost,
            oblique_pricing: pricing_name(params.oblique_pricing).to_owned(),
            alpha,
            empty_bonus: params.empty_bonus,
            max_prims: params.max_prims,
            max_depth_base: base,
            max_depth_per_level: per_level,
            ties: ties_name(params.ties).to_owned(),
            clip: params.clip,
            oblique_up_to: (params.oblique_up_to < u32::MAX).then_some(params.oblique_up_to),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_found_in_any_case_and_an_unknown_name_lists_them() {
        assert_eq!("Thesis".parse(), Ok(Preset::Thesis));
        assert_eq!(ties_named("TOLERANT"), Ok(Ties::Tolerant));
        let error = "slow".parse::<Preset>().unwrap_err().to_string();
        assert!(
            error.contains("thesis, pbrt3, pbrt4, default, fast"),
            "{error}"
        );
        assert_eq!(traversal_named("Exact"), Ok(Traversal::Exact));
        assert!(traversal_named("loose").is_err());
        let error = ties_named("fuzzy").unwrap_err().to_string();
        assert!(error.contains("published, tolerant"), "{error}");
    }
}
