//! Builds of trees over the scenes that ship with Splitplane, by criterion: `cargo bench`. For
//! looking at, not for a gate: that is `just instructions`.

use criterion::{BatchSize, BenchmarkId, Criterion, criterion_group, criterion_main};
use splitplane::{BuildParams, Layout, Tree, TreeChoice};
use splitplane_render::scene::{LoadOptions, load};

const SCENES: [&str; 3] = ["truck", "arcade", "grove"];
const TREES: [&str; 5] = ["kd", "wn+kd:6", "cn+kd:6", "bvh", "framed"];

/// Threads are those of rayon: RAYON_NUM_THREADS=1 for one.
fn builds(criterion: &mut Criterion) {
    for scene in SCENES {
        let mesh = load(scene, &LoadOptions::default())
            .expect("the scene ships with Splitplane")
            .mesh;
        let mut group = criterion.benchmark_group(format!("build {scene}"));
        group.sample_size(10);
        for tree in TREES {
            let choice: TreeChoice = tree.parse().expect("a tree's name");
            let build =
                || Tree::build(&mesh, choice, &BuildParams::default()).expect("it can be built");
            group.bench_function(BenchmarkId::from_parameter(choice), |bencher| {
                bencher.iter_with_large_drop(build);
            });
            let id = BenchmarkId::new("to wide", choice);
            group.bench_function(id, |bencher| {
                let wide =
                    |tree: Tree| tree.with_layout(Layout::Wide).expect("it is not too large");
                bencher.iter_batched(build, wide, BatchSize::PerIteration);
            });
        }
    }
}

criterion_group!(benches, builds);
criterion_main!(benches);
