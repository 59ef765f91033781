//! Scenes with instances: a tree for each object, placed.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Instant;

use splitplane::{Aabb, BuildStats, Instances, NodeCounts, Progress, Tree, TreeCard, TreeChoice};
use splitplane_render::render::place;
use splitplane_render::scene::Scene;

use crate::LabError;
use crate::run::{Built, Settings, build};

/// The trees of a scene's objects, placed as its instances are.
#[derive(Clone, Debug)]
pub struct Objects {
    /// One over the mesh of each object; in the layout of [`Built::tree`].
    pub trees: Vec<Arc<Tree>>,
    /// They and [`Built::tree`], where they are.
    pub placed: Instances,
    /// The same in the wide layout, where that was asked for; else as `placed`.
    pub wide: Instances,
}

/// Builds the tree over a scene's mesh, and where it has instances, one over each object.
///
/// # Errors
/// As [`build`]; or an instance cannot be placed.
pub fn build_scene(
    scene: &Scene,
    choice: TreeChoice,
    settings: &Settings,
    progress: &dyn Progress,
) -> Result<Built, LabError> {
    let mut whole = build(&scene.mesh, choice, settings, progress)?;
    if scene.instances.is_empty() {
        return Ok(whole);
    }
    let objects: Vec<Built> = (scene.objects.iter())
        .map(|object| build(&object.mesh, choice, settings, progress))
        .collect::<Result<_, _>>()?;
    let trees: Vec<Arc<Tree>> = objects
        .iter()
        .map(|built| Arc::clone(&built.tree))
        .collect();
    let start = Instant::now();
    let placed = place(scene, Arc::clone(&whole.tree), &trees)?;
    whole.seconds += start.elapsed().as_secs_f64();
    let wide = match &whole.wide {
        Some(own) => {
            let wide = |built: &Built| Arc::clone(built.wide.as_ref().unwrap_or(&built.tree));
            let trees: Vec<Arc<Tree>> = objects.iter().map(wide).collect();
            place(scene, Arc::clone(own), &trees)?
        }
        None => placed.clone(),
    };
    whole.seconds += objects.iter().map(|built| built.seconds).sum::<f64>();
    whole.others_load = (objects.iter())
        .map(|built| built.others_load)
        .chain([whole.others_load])
        .flatten()
        .reduce(f64::max);
    let cards = || objects.iter().map(|built| &built.card);
    let weights = weights(scene);
    whole.card = together(&whole.card, cards(), &weights);
    if let Some(own) = &mut whole.wide_card {
        for wide in objects.iter().filter_map(|built| built.wide_card.as_ref()) {
            own.add(wide);
        }
    }
    whole.objects = Some(Box::new(Objects {
        trees,
        placed,
        wide,
    }));
    Ok(whole)
}

/// How many copies of the mesh, then of each object, a random line through the scene's box meets
/// on average: areas of boxes over that of the scene's.
fn weights(scene: &Scene) -> Vec<f64> {
    let whole = scene.bounds().surface_area();
    let share = |bounds: Aabb| match whole > 0.0 && !bounds.is_empty() {
        true => bounds.surface_area() / whole,
        false => 0.0,
    };
    let mut weights = vec![0.0; 1 + scene.objects.len()];
    weights[0] = share(scene.mesh.bounds());
    for instance in &scene.instances {
        weights[1 + instance.object as usize] += share(scene.bounds_of(instance));
    }
    weights
}

/// What is known of several trees together: sums, and expectations weighted. The hierarchy over
/// the instances is left out.
fn together<'a>(
    own: &'a TreeCard,
    objects: impl Iterator<Item = &'a TreeCard>,
    weights: &[f64],
) -> TreeCard {
    let mut whole = TreeCard {
        triangles: 0,
        nodes: NodeCounts::default(),
        references: 0,
        depth: 0,
        largest_leaf: 0,
        leaf_sizes: Vec::new(),
        depths: Vec::new(),
        expected_visits: 0.0,
        expected_tests: 0.0,
        tests_by_leaf_size: Vec::new(),
        sah_cost: 0.0,
        bytes: 0,
        build: BuildStats::default(),
        ..own.clone()
    };
    let mut leaves: BTreeMap<u32, u64> = BTreeMap::new();
    let mut tests: BTreeMap<u32, f64> = BTreeMap::new();
    for (card, weight) in std::iter::once(own).chain(objects).zip(weights) {
        whole.triangles += card.triangles;
        whole.nodes.kd += card.nodes.kd;
        whole.nodes.oblique += card.nodes.oblique;
        whole.nodes.leaf += card.nodes.leaf;
        whole.nodes.empty_leaf += card.nodes.empty_leaf;
        whole.references += card.references;
        whole.depth = whole.depth.max(card.depth);
        whole.largest_leaf = whole.largest_leaf.max(card.largest_leaf);
        whole.bytes += card.bytes;
        for &(size, count) in &card.leaf_sizes {
            *leaves.entry(size).or_default() += count;
        }
        if whole.depths.len() < card.depths.len() {
            whole.depths.resize(card.depths.len(), (0, 0));
        }
        for (sum, (kd, oblique)) in whole.depths.iter_mut().zip(&card.depths) {
            sum.0 += kd;
            sum.1 += oblique;
        }
        // An empty tree expects nothing, and may say so by NaN.
        if card.triangles > 0 {
            whole.expected_visits += weight * card.expected_visits;
            whole.expected_tests += weight * card.expected_tests;
            whole.sah_cost += weight * card.sah_cost;
            for &(size, share) in &card.tests_by_leaf_size {
                *tests.entry(size).or_default() += weight * card.expected_tests * share;
            }
        }
        whole.build += card.build;
    }
    whole.leaf_sizes = leaves.into_iter().collect();
    let all: f64 = tests.values().sum();
    whole.tests_by_leaf_size = tests.into_iter().map(|(size, t)| (size, t / all)).collect();
    whole
}
