//! The trees, as data. A tree is a row of [`TREES`]; nothing else in the project names one.

use std::fmt;
use std::str::FromStr;

/// A kind of tree: which split planes are candidates in a node, and which nodes it has.
#[derive(Debug, PartialEq)]
pub struct TreeSpec {
    /// The name that we use, without `:k`.
    pub name: &'static str,
    /// The name in the thesis \[Hoobergs2019\]; empty where it has none.
    pub thesis_name: &'static str,
    /// The name of the accelerator in the thesis's fork of pbrt-v3; empty where it has none.
    pub pbrt_name: &'static str,
    /// The three axes are candidate directions.
    pub axes: bool,
    /// Where the other candidate directions come from.
    pub directions: Directions,
    /// Per triangle, its own plane and the three planes through an edge perpendicular to it
    /// \[Ize2008\] are candidates.
    pub triangle_planes: bool,
    /// Axis-aligned nodes are stored, priced and traversed as kd nodes (superscript Kd).
    pub axis_nodes: bool,
    /// Nodes have boxes of their own, which may overlap, instead of planes.
    pub objects: bool,
    /// Boxes lie along frames that come from the normals, and triangles are cut where that is
    /// better than dividing them.
    pub frames: bool,
    /// One line: what it is, and its source.
    pub summary: &'static str,
}

/// Where the split directions of a node come from, the axes apart.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Directions {
    /// None.
    None,
    /// A fixed set for the whole tree.
    Fixed,
    /// Random ones, drawn afresh in every node.
    Random,
    /// Normals of distinct triangles of the node, picked at random.
    SampledNormals,
    /// Centres of clusters of the normals of the node's triangles.
    ClusteredNormals,
}

/// The trees that can be built.
pub static TREES: &[TreeSpec] = &[
    TreeSpec {
        name: "kd",
        thesis_name: "Kd",
        pbrt_name: "kdtree",
        axes: true,
        directions: Directions::None,
        triangle_planes: false,
        axis_nodes: true,
        objects: false,
        frames: false,
        summary: "kd-tree: planes across the three axes, swept, by the SAH [WaldHavran2006]",
    },
    TreeSpec {
        name: "rbsp",
        thesis_name: "RBSP",
        pbrt_name: "rbsp",
        axes: false,
        directions: Directions::Fixed,
        triangle_planes: false,
        axis_nodes: false,
        objects: false,
        frames: false,
        summary: "restricted BSP tree: k directions, fixed for the whole tree [KammajeMora2007]",
    },
    TreeSpec {
        name: "rbsp-kd",
        thesis_name: "RBSP^Kd",
        pbrt_name: "rbspkd",
        axes: true,
        directions: Directions::Fixed,
        triangle_planes: false,
        axis_nodes: true,
        objects: false,
        frames: false,
        summary: "restricted BSP tree: the axes and k-3 fixed directions; cheap kd nodes across axes [Budge2008]",
    },
    TreeSpec {
        name: "ize",
        thesis_name: "BSP_IZE",
        pbrt_name: "bsppaper",
        axes: true,
        directions: Directions::None,
        triangle_planes: true,
        axis_nodes: false,
        objects: false,
        frames: false,
        summary: "BSP tree: the axes, and four planes per triangle: its own, one through each edge [Ize2008]",
    },
    TreeSpec {
        name: "ize-kd",
        thesis_name: "BSP_IZE^Kd",
        pbrt_name: "bsppaperkd",
        axes: true,
        directions: Directions::None,
        triangle_planes: true,
        axis_nodes: true,
        objects: false,
        frames: false,
        summary: "BSP tree: the axes, and four planes per triangle; cheap kd nodes across axes [Ize2008]",
    },
    TreeSpec {
        name: "random",
        thesis_name: "BSP_random",
        pbrt_name: "bsprandom",
        axes: false,
        directions: Directions::Random,
        triangle_planes: false,
        axis_nodes: false,
        objects: false,
        frames: false,
        summary: "BSP tree: k random directions, drawn afresh in each node [Hoobergs2019]",
    },
    TreeSpec {
        name: "random+",
        thesis_name: "BSP_random+",
        pbrt_name: "bsprandomwithkd",
        axes: true,
        directions: Directions::Random,
        triangle_planes: false,
        axis_nodes: false,
        objects: false,
        frames: false,
        summary: "BSP tree: the axes and k-3 random directions in each node [Hoobergs2019]",
    },
    TreeSpec {
        name: "random+kd",
        thesis_name: "BSP_random+^Kd",
        pbrt_name: "bsprandomfastkd",
        axes: true,
        directions: Directions::Random,
        triangle_planes: false,
        axis_nodes: true,
        objects: false,
        frames: false,
        summary: "BSP tree: the axes and k-3 random directions; cheap kd nodes across axes [Hoobergs2019]",
    },
    TreeSpec {
        name: "wn",
        thesis_name: "BSP_wn",
        pbrt_name: "bsparbitrary",
        axes: false,
        directions: Directions::SampledNormals,
        triangle_planes: false,
        axis_nodes: false,
        objects: false,
        frames: false,
        summary: "BSP tree: the normals of k random triangles of each node [Hoobergs2019]",
    },
    TreeSpec {
        name: "wn+",
        thesis_name: "BSP_wn+",
        pbrt_name: "bsparbitrarywithkd",
        axes: true,
        directions: Directions::SampledNormals,
        triangle_planes: false,
        axis_nodes: false,
        objects: false,
        frames: false,
        summary: "BSP tree: the axes and the normals of k-3 random triangles of each node [Hoobergs2019]",
    },
    TreeSpec {
        name: "wn+kd",
        thesis_name: "BSP_wn+^Kd",
        pbrt_name: "bsparbitraryfastkd",
        axes: true,
        directions: Directions::SampledNormals,
        triangle_planes: false,
        axis_nodes: true,
        objects: false,
        frames: false,
        summary: "BSP tree: the axes and k-3 random triangles' normals; cheap kd nodes across axes [Hoobergs2019]",
    },
    TreeSpec {
        name: "cn",
        thesis_name: "BSP_cn",
        pbrt_name: "bspcluster",
        axes: false,
        directions: Directions::ClusteredNormals,
        triangle_planes: false,
        axis_nodes: false,
        objects: false,
        frames: false,
        summary: "BSP tree: the centres of k clusters of each node's normals [Hoobergs2019]",
    },
    TreeSpec {
        name: "cn+",
        thesis_name: "BSP_cn+",
        pbrt_name: "bspclusterwithkd",
        axes: true,
        directions: Directions::ClusteredNormals,
        triangle_planes: false,
        axis_nodes: false,
        objects: false,
        frames: false,
        summary: "BSP tree: the axes and the centres of k-3 clusters of each node's normals [Hoobergs2019]",
    },
    TreeSpec {
        name: "cn+kd",
        thesis_name: "BSP_cn+^Kd",
        pbrt_name: "bspclusterfastkd",
        axes: true,
        directions: Directions::ClusteredNormals,
        triangle_planes: false,
        axis_nodes: true,
        objects: false,
        frames: false,
        summary: "BSP tree: the axes and k-3 clusters of normals; cheap kd nodes across axes [Hoobergs2019]",
    },
    TreeSpec {
        name: "framed",
        thesis_name: "",
        pbrt_name: "",
        axes: true,
        directions: Directions::None,
        triangle_planes: false,
        axis_nodes: true,
        objects: true,
        frames: true,
        summary: "boxes along frames found from the normals; space cut or triangles divided [Hoobergs2019, Stich2009]",
    },
    TreeSpec {
        name: "bvh",
        thesis_name: "",
        pbrt_name: "",
        axes: true,
        directions: Directions::None,
        triangle_planes: false,
        axis_nodes: true,
        objects: true,
        frames: false,
        summary: "bounding volume hierarchy by SAH sweeps, for comparison [MacDonaldBooth1990]",
    },
];

impl TreeSpec {
    /// Whether all planes of the tree are axis-aligned.
    pub(crate) fn only_axes(&self) -> bool {
        self.directions == Directions::None && !self.triangle_planes
    }

    /// Whether the tree takes a number of directions, `:k`.
    pub fn takes_direction_count(&self) -> bool {
        self.directions != Directions::None
    }
}

/// A tree and its number of directions: `kd`, `wn+kd:6`.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(try_from = "String", into = "String")
)]
pub struct TreeChoice {
    /// The kind of tree.
    pub spec: &'static TreeSpec,
    /// How many directions are tested in a node, the axes included where they are used; `None`
    /// for trees that take no number.
    pub direction_count: Option<u32>,
}

/// Why a tree's name could not be read.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ParseTreeError {
    /// No tree has this name.
    #[error("no tree is called \"{name}\"; there are {}", tree_names())]
    Unknown {
        /// The name given.
        name: String,
    },
    /// The number behind the colon is not one that the tree takes.
    #[error(
        "\"{name}\" takes a number of directions from {min} to {max}, as in \"{name}:{min}\", not \"{given}\""
    )]
    DirectionCount {
        /// The tree.
        name: &'static str,
        /// What was given.
        given: String,
        /// The smallest number it takes.
        min: u32,
        /// The largest number it takes.
        max: u32,
    },
    /// The tree takes no number of directions.
    #[error("\"{name}\" takes no number of directions, but \"{given}\" was given")]
    NoDirectionCount {
        /// The tree.
        name: &'static str,
        /// What was given.
        given: String,
    },
}

/// The most directions that a tree may be asked to test in a node.
pub(crate) const MAX_DIRECTION_COUNT: u32 = 64;

fn tree_names() -> String {
    let names: Vec<String> = TREES
        .iter()
        .map(|spec| {
            format!(
                "{}{}",
                spec.name,
                if spec.takes_direction_count() {
                    ":k"
                } else {
                    ""
                }
            )
        })
        .collect();
    names.join(", ")
}

/// Letters and digits of a name, lower case, so that "BSP_wn+^Kd", "bsp-wn+kd" and "bsp_wn+kd"
/// are one.
fn folded(name: &str) -> String {
    name.chars()
        .filter(|c| c.is_alphanumeric() || *c == '+')
        .flat_map(char::to_lowercase)
        .collect()
}

impl TreeSpec {
    /// The tree of that name: ours, the thesis's or that of the thesis's fork of pbrt, in upper or
    /// lower case.
    pub fn named(name: &str) -> Option<&'static TreeSpec> {
        let name = folded(name);
        TREES.iter().find(|spec| {
            [spec.name, spec.thesis_name, spec.pbrt_name]
                .iter()
                .any(|own| !own.is_empty() && folded(own) == name)
        })
    }

    /// The numbers of directions that the tree takes, smallest and largest; `None` where it takes
    /// none.
    pub fn direction_counts(&self) -> Option<(u32, u32)> {
        self.takes_direction_count()
            .then_some((if self.axes { 3 } else { 1 }, MAX_DIRECTION_COUNT))
    }
}

impl TreeChoice {
    /// The tree of that name with that number of directions; the thesis's number where a tree
    /// takes one and none is given.
    ///
    /// # Errors
    /// No such tree, or a number of directions that it does not take.
    pub fn new(name: &str, direction_count: Option<u32>) -> Result<Self, ParseTreeError> {
        let spec = TreeSpec::named(name).ok_or_else(|| ParseTreeError::Unknown {
            name: name.to_owned(),
        })?;
        let Some((min, max)) = spec.direction_counts() else {
            return match direction_count {
                None => Ok(TreeChoice {
                    spec,
                    direction_count: None,
                }),
                Some(given) => Err(ParseTreeError::NoDirectionCount {
                    name: spec.name,
                    given: given.to_string(),
                }),
            };
        };
        let count = direction_count.unwrap_or(spec.directions.default_count());
        if !(min..=max).contains(&count) {
            return Err(ParseTreeError::DirectionCount {
                name: spec.name,
                given: count.to_string(),
                min,
                max,
            });
        }
        Ok(TreeChoice {
            spec,
            direction_count: Some(count),
        })
    }
}

impl TreeChoice {
    /// The name of the tree that is built where none is named: in the wide layout it answered rays
    /// fastest over the scenes that we measure, and it is built in a fraction of the time of the
    /// thesis's trees.
    pub const DEFAULT: &str = "framed";
}

impl Default for TreeChoice {
    /// The tree that [`TreeChoice::DEFAULT`] names.
    fn default() -> Self {
        TreeChoice::DEFAULT.parse().expect("a test parses it")
    }
}

impl Directions {
    /// How many directions the thesis compares the trees with.
    fn default_count(self) -> u32 {
        match self {
            Directions::None => 3,
            Directions::Fixed => 13,
            Directions::Random => 10,
            Directions::SampledNormals | Directions::ClusteredNormals => 6,
        }
    }
}

impl FromStr for TreeChoice {
    type Err = ParseTreeError;

    fn from_str(text: &str) -> Result<Self, ParseTreeError> {
        let text = text.trim();
        let Some((name, count)) = text.split_once(':') else {
            return TreeChoice::new(text, None);
        };
        match count.trim().parse() {
            Ok(count) => TreeChoice::new(name, Some(count)),
            // The name's own error comes first; then the number's.
            Err(_) => Err(match TreeChoice::new(name, None) {
                Err(error) => error,
                Ok(TreeChoice { spec, .. }) => match spec.direction_counts() {
                    Some((min, max)) => ParseTreeError::DirectionCount {
                        name: spec.name,
                        given: count.to_owned(),
                        min,
                        max,
                    },
                    None => ParseTreeError::NoDirectionCount {
                        name: spec.name,
                        given: count.to_owned(),
                    },
                },
            }),
        }
    }
}

impl TryFrom<String> for TreeChoice {
    type Error = ParseTreeError;
    fn try_from(name: String) -> Result<Self, ParseTreeError> {
        name.parse()
    }
}

impl From<TreeChoice> for String {
    fn from(choice: TreeChoice) -> String {
        choice.to_string()
    }
}

impl fmt::Display for TreeChoice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.direction_count {
            Some(count) => write!(f, "{}:{count}", self.spec.name),
            None => f.write_str(self.spec.name),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_tree_answers_to_all_its_names_in_any_case() {
        for spec in TREES {
            for name in [spec.name, spec.thesis_name, spec.pbrt_name] {
                if !name.is_empty() {
                    assert_eq!(TreeSpec::named(name).unwrap().name, spec.name, "{name}");
                    assert_eq!(
                        TreeSpec::named(&name.to_uppercase()).unwrap().name,
                        spec.name
                    );
                }
            }
        }
    }

    #[test]
    fn the_default_is_a_tree() {
        assert_eq!(TreeChoice::default().to_string(), TreeChoice::DEFAULT);
    }

    #[test]
    fn a_choice_prints_as_it_is_read() {
        for spec in TREES {
            let choice = TreeChoice::new(spec.name, None).unwrap();
            assert_eq!(choice.to_string().parse(), Ok(choice));
        }
    }

    #[test]
    fn a_wrong_number_of_directions_names_the_range() {
        let error = "wn+kd:2".parse::<TreeChoice>().unwrap_err().to_string();
        assert!(error.contains("from 3 to 64"), "{error}");
        let error = "wn+kd:many".parse::<TreeChoice>().unwrap_err().to_string();
        assert!(error.contains("from 3 to 64"), "{error}");
        let error = "kd:3".parse::<TreeChoice>().unwrap_err().to_string();
        assert!(error.contains("takes no number"), "{error}");
        let error = "oak".parse::<TreeChoice>().unwrap_err().to_string();
        assert!(
            error.contains("kd, ") && error.contains("wn+kd:k"),
            "{error}"
        );
    }
}
