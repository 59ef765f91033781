//! A page on one tree. All that it says follows from the tree's row.

use splitplane::{BuildParams, Directions, TREES, TreeChoice, TreeSpec, references};

use crate::numbers::measured;

/// What the page says, with a heading each.
pub fn sections(choice: TreeChoice) -> Vec<(&'static str, String)> {
    let spec = choice.spec;
    let mut sections = vec![
        ("names", names(spec)),
        ("planes", planes(spec)),
        ("cells", cells(spec).to_owned()),
        ("node", node(spec)),
        ("price", price(spec)),
    ];
    if let Some(k) = directions(spec) {
        sections.push(("k", k));
    }
    sections.push(("paper", papers(spec)));
    sections
}

/// The tree's name with `:k` where it takes a number of directions.
pub fn name_with_k(spec: &TreeSpec) -> String {
    match spec.takes_direction_count() {
        true => format!("{}:k", spec.name),
        false => spec.name.to_owned(),
    }
}

/// Commands that use the tree, ready to be run.
pub fn commands(choice: TreeChoice) -> Vec<String> {
    let first = TREES[0].name;
    let trees = match choice.spec.name == first {
        true => choice.to_string(),
        false => format!("{first},{choice}"),
    };
    vec![
        format!("splitplane build truck --tree {choice}"),
        format!(
            "splitplane slice arcade --tree {choice} --axis y --at 0.3 -o {}.svg",
            choice.spec.name
        ),
        format!("splitplane render truck --tree {choice}"),
        format!("splitplane compare truck --trees {trees}"),
    ]
}

/// How a .pbrt file asks for the tree.
pub fn directive(choice: TreeChoice) -> String {
    let spec = choice.spec;
    let name = match spec.pbrt_name {
        "" => spec.name,
        name => name,
    };
    match choice.direction_count {
        Some(count) => format!("Accelerator \"{name}\" \"integer nbDirections\" [{count}]"),
        None => format!("Accelerator \"{name}\""),
    }
}

fn names(spec: &TreeSpec) -> String {
    let mut names = vec![name_with_k(spec)];
    for (place, name) in [
        ("the thesis", spec.thesis_name),
        ("its fork of pbrt-v3", spec.pbrt_name),
    ] {
        if !name.is_empty() {
            names.push(format!("in {place} {name}"));
        }
    }
    names.join("; ")
}

fn planes(spec: &TreeSpec) -> String {
    if spec.frames {
        return "Across the axes of a frame: three directions at right angles. The world's is the \
                first; others, up to 64 in all, come from the normals, by their areas: those that \
                many triangles are across. A subtree goes on in another frame where its boxes are \
                so much smaller there that it pays. A node is divided by a plane, which cuts \
                triangles in two, or by the centres of their boxes, which leaves them whole."
            .to_owned();
    }
    if spec.objects {
        return "None: a node divides its triangles, not space. They are sorted along each axis by \
                the centres of their boxes, and every division of that order is a candidate."
            .to_owned();
    }
    let others = if spec.axes { "k - 3" } else { "k" };
    let source = match spec.directions {
        Directions::None => None,
        Directions::Fixed if spec.axes => Some(
            "directions that are fixed for the whole tree. With 7, 9 or 13 they and the axes are \
             Klosowski's: with the diagonals of a cube, of its faces, or both; else they are \
             spread evenly"
                .to_owned(),
        ),
        Directions::Fixed => Some(
            "k directions that are fixed for the whole tree. 3, 7, 9 and 13 are Klosowski's: the \
             axes; with the diagonals of a cube, of its faces, or both. Else they are spread \
             evenly"
                .to_owned(),
        ),
        Directions::Random => Some(format!(
            "{others} random directions, drawn afresh in every node"
        )),
        Directions::SampledNormals => Some(format!(
            "the normals of {others} triangles of the node, picked at random (of all, where it has \
             no more)"
        )),
        Directions::ClusteredNormals => Some(format!(
            "the centres of {others} clusters of the normals of the node's triangles (k-means by \
             angle; all normals, where it has no more)"
        )),
    };
    let mut swept: Vec<String> = Vec::new();
    if spec.axes {
        swept.push("the three axes".to_owned());
    }
    swept.extend(source);
    let mut text = String::new();
    if !swept.is_empty() {
        text = format!(
            "Across {}. Along each direction a sweep tries every plane inside the cell at which a \
             triangle begins or ends.",
            swept.join(", and across ")
        );
    }
    if spec.triangle_planes {
        if !text.is_empty() {
            text.push(' ');
        }
        text.push_str(
            "Four planes for every triangle of the node: its own, and one through each edge, \
             perpendicular to it; triangles on both sides are counted with an auxiliary bounding \
             volume hierarchy.",
        );
    }
    text
}

fn only_axes(spec: &TreeSpec) -> bool {
    spec.directions == Directions::None && !spec.triangle_planes
}

fn cells(spec: &TreeSpec) -> &'static str {
    if spec.frames {
        "Boxes in the frame of the node, around what of the triangles lies in it. They may overlap, \
         and a triangle that was cut is in more than one leaf."
    } else if spec.objects {
        "Boxes around the triangles of a node. They may overlap; each triangle is in one leaf."
    } else if only_axes(spec) {
        "Boxes. They fill the scene's box; a triangle is in every leaf that it touches."
    } else {
        "Convex polytopes. They fill the scene's box; a triangle is in every leaf that it touches."
    }
}

fn node(spec: &TreeSpec) -> String {
    let what = if spec.frames {
        "a box, the index of a frame, and that of the second child"
    } else if spec.objects {
        "a box, and the index of the second child"
    } else if only_axes(spec) {
        "an axis, an offset, and the index of the child above"
    } else if spec.directions == Directions::Fixed {
        "the index of a direction in a few bits, an offset, and the index of the child above"
    } else {
        "a normal, an offset, and the index of the child above"
    };
    let axes = match spec.axis_nodes && !only_axes(spec) {
        true => {
            " Planes across an axis are kd nodes: visiting one takes a subtraction and a \
                 multiplication."
        }
        false => "",
    };
    format!("{} bytes: {what}.{axes}", spec.node_bytes())
}

fn price(spec: &TreeSpec) -> String {
    if spec.frames {
        return "By the SAH, as the wide layout sees it: testing up to eight triangles costs twice a \
                visit of a node, and both count by the box's share of the node's surface."
            .to_owned();
    }
    let params = BuildParams::default();
    let test = measured_cost(params.intersection_cost);
    let kd = measured_cost(params.kd_traversal_cost);
    let oblique = measured_cost(params.oblique_traversal_cost);
    let part = if spec.objects { "box" } else { "cell" };
    let visit = if !spec.axis_nodes {
        format!("{oblique} for a visit of the node, whatever its plane")
    } else if only_axes(spec) {
        format!("{kd} for a visit of the node")
    } else {
        format!(
            "{kd} for a visit of a node across an axis. Oblique splits compete with a cost of \
             visits that grows with the node's triangles; where nothing beats a leaf so, with \
             {oblique} (Ize's scheme; see --pricing)"
        )
    };
    format!(
        "By the SAH. A leaf costs {test} per triangle; a split, for each child, {test} times its \
         triangles times its {part}'s share of the node's surface, and {visit}."
    )
}

/// A cost: a whole number without decimals.
fn measured_cost(cost: f64) -> String {
    if cost.fract() == 0.0 {
        format!("{cost}")
    } else {
        measured(cost)
    }
}

fn directions(spec: &'static TreeSpec) -> Option<String> {
    let (min, max) = spec.direction_counts()?;
    let default = TreeChoice::new(spec.name, None).ok()?.direction_count?;
    let axes = if spec.axes {
        ", the three axes included"
    } else {
        ""
    };
    Some(format!(
        "Directions that are tried in a node: {min} to {max}{axes}; {default} where none is given."
    ))
}

/// The papers that the summary cites, as the project's list of references has them.
fn papers(spec: &TreeSpec) -> String {
    let papers: Vec<String> = cited(spec.summary).map(paper).collect();
    papers.join("\n")
}

/// The keys between brackets in a text.
fn cited(text: &str) -> impl Iterator<Item = &str> {
    let groups = text.split('[').skip(1);
    groups
        .filter_map(|part| part.split_once(']'))
        .flat_map(|(keys, _)| keys.split(',').map(str::trim))
}

/// A paper by its key; the key itself where the list does not have it.
fn paper(key: &str) -> String {
    let entry = references::TEXT
        .lines()
        .find_map(|line| line.strip_prefix(&format!("**[{key}]** ")));
    entry.map_or_else(|| format!("[{key}]"), |text| text.replace('*', ""))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_paper_that_a_tree_cites_is_found() {
        for spec in TREES {
            assert!(cited(spec.summary).count() > 0, "{}", spec.name);
            let papers = papers(spec);
            assert!(!papers.contains('['), "{}: {papers}", spec.name);
        }
    }

    #[test]
    fn the_page_says_what_the_row_says() {
        let pricing = |spec: &TreeSpec| price(spec).contains("--pricing");
        for spec in TREES {
            let planes = planes(spec);
            let from_axes = planes.starts_with("Across the three axes");
            assert_eq!(from_axes, spec.axes && !spec.objects, "{planes}");
            assert_eq!(
                planes.contains("triangle of the node"),
                spec.triangle_planes
            );
            assert_eq!(pricing(spec), spec.axis_nodes && !only_axes(spec));
            let bytes = format!("{} bytes", spec.node_bytes());
            assert!(node(spec).starts_with(&bytes));
        }
    }
}
