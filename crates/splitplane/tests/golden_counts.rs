//! The size of every tree on a small mesh, and what fixed rays cost in it: exact numbers, so that
//! no change to a build or to the traversal goes unseen.
//!
//! Where a change is meant, `INSTA_UPDATE=always cargo test -p splitplane --test golden_counts`
//! writes the new numbers.

mod common;

use std::fmt::Write;

use common::{Random, soup};
use splitplane::{BuildParams, Counts, Layout, Ray, TREES, Ties, Traversal, Tree, TreeChoice};

#[test]
fn every_tree_has_its_golden_counts() {
    let mesh = soup(400, 0.35);
    let mut random = Random(11);
    let rays: Vec<Ray> = (0..2_000)
        .map(|_| {
            let (a, b) = (random.point(5.0), random.point(1.5));
            Ray::new(a, std::array::from_fn(|i| b[i] - a[i]))
        })
        .collect();
    let mut table = String::new();
    for (ties, clip) in [
        (Ties::AsPublished, false),
        (Ties::Tolerant, false),
        (Ties::Tolerant, true),
    ] {
        let clipped = if clip { " clipped" } else { "" };
        for spec in TREES {
            let choice = TreeChoice::new(spec.name, None).unwrap();
            let params = BuildParams {
                ties,
                clip,
                ..BuildParams::THESIS
            };
            let tree = Tree::build(&mesh, choice, &params).unwrap();
            let card = tree.card();
            let nodes = card.nodes;
            writeln!(
                table,
                "{ties:?}{clipped} {choice}: {} kd, {} oblique, {} leaves, {} empty, {} references, depth {}, {} bad \
                 refines, {} candidates, SAH {:.3}",
                nodes.kd,
                nodes.oblique,
                nodes.leaf,
                nodes.empty_leaf,
                card.references,
                card.depth,
                card.build.bad_refines,
                card.build.candidates,
                card.sah_cost
            )
            .unwrap();
            let wide = tree.clone().with_layout(Layout::Wide).unwrap();
            let mut counts = Counts::default();
            for ray in &rays {
                wide.closest_hit(ray, &mut counts);
                wide.any_hit(ray, &mut counts);
            }
            let wide = wide.card().wide.unwrap();
            writeln!(
                table,
                "  wide: {} nodes, {} leaves, {} references; {} tests, {} visits, {} leaf visits",
                wide.nodes,
                wide.leaves,
                wide.references,
                counts.triangle_tests,
                counts.wide_visits,
                counts.leaf_visits
            )
            .unwrap();
            for traversal in [Traversal::Exact, Traversal::AsPublished] {
                let tree = tree.clone().with_traversal(traversal);
                let (mut closest, mut any) = (Counts::default(), Counts::default());
                for ray in &rays {
                    tree.closest_hit(ray, &mut closest);
                    tree.any_hit(ray, &mut any);
                }
                for (query, counts) in [("closest", closest), ("any", any)] {
                    writeln!(
                        table,
                        "  {traversal:?} {query}: {} tests, {} kd, {} oblique, {} leaf visits",
                        counts.triangle_tests,
                        counts.kd_visits,
                        counts.oblique_visits,
                        counts.leaf_visits
                    )
                    .unwrap();
                }
            }
        }
    }
    insta::assert_snapshot!(table);
}
