//! All of the library's `unsafe`, on few triangles: little enough work for an interpreter that
//! looks at every access to memory (`just miri`).

use splitplane::{
    BuildParams, Coherence, Hit, Layout, Mesh, Ray, TREES, Tree, TreeChoice, TreeSpec, brute_force,
};

mod common;

use common::{Random, saved, soup, sphere, with_sum};

/// All trees over a mesh, in all layouts, each as it was built and as it is loaded again.
fn trees(mesh: &Mesh) -> impl Iterator<Item = Tree> {
    let of = |spec: &TreeSpec| {
        let choice = TreeChoice::new(spec.name, None).unwrap();
        let tree = Tree::build(mesh, choice, &BuildParams::default()).unwrap();
        let both = Layout::ALL.map(|layout| tree.clone().with_layout(layout).unwrap());
        both.into_iter()
            .flat_map(|tree| [Tree::from_bytes(&saved(&tree), mesh).unwrap(), tree])
    };
    // The interpreter has time for one tree of each kind of node.
    let few = ["kd", "wn+kd", "framed"];
    let asked = move |spec: &&TreeSpec| !cfg!(miri) || few.contains(&spec.name);
    TREES.iter().filter(asked).flat_map(of)
}

fn rays(mesh: &Mesh) -> Vec<Ray> {
    let mut random = Random(5);
    let mut rays: Vec<Ray> = (0..6)
        .map(|_| Ray::new(random.point(3.0), random.point(1.0)))
        .collect();
    for vertex in mesh.positions().iter().step_by(7) {
        rays.push(Ray::new([vertex[0], vertex[1], 3.0], [0.0, -0.0, -1.0]));
    }
    rays.push(Ray::new([1e19, 0.0, 0.0], [-1.0, 0.0, 0.0]));
    rays.push(Ray::new([f32::NAN; 3], [f32::NAN; 3]));
    rays
}

fn check(mesh: &Mesh) {
    let rays = rays(mesh);
    let truth: Vec<Option<Hit>> = rays.iter().map(|ray| brute_force(mesh, ray)).collect();
    assert!(truth.iter().any(Option::is_some));
    let mut all = Vec::new();
    for tree in trees(mesh) {
        let name = format!("{}, {}", tree.choice(), tree.layout());
        for (ray, truth) in rays.iter().zip(&truth) {
            assert_eq!(tree.closest_hit(ray, &mut ()), *truth, "{name}: {ray:?}");
            assert_eq!(tree.any_hit(ray, &mut ()), truth.is_some(), "{name}");
            tree.all_hits(ray, &mut all, &mut ());
            assert_eq!(all.first(), truth.as_ref(), "{name}: {ray:?}");
        }
        let near = tree.closest_point([0.2, 0.1, 3.0], f32::INFINITY, &mut ());
        assert!(near.is_some(), "{name}");
        assert!(!tree.contains([0.2, 0.1, 3.0], &mut ()), "{name}");
        let found = tree.triangles_in_box(&tree.bounds(), &mut ()).len();
        assert_eq!(found, mesh.usable_triangles().len(), "{name}");
    }
}

#[test]
fn few_triangles_are_hit_as_by_brute_force() {
    check(&soup(12, 0.8));
}

#[test]
fn a_small_sphere_is_hit_as_by_brute_force() {
    check(&sphere(3));
}

#[test]
fn a_batch_is_answered_like_its_rays() {
    let mesh = soup(16, 0.8);
    let tree = Tree::new(&mesh).unwrap().with_layout(Layout::Wide).unwrap();
    let rays = rays(&mesh);
    let mut hits = vec![None; rays.len()];
    let truth: Vec<Option<Hit>> = rays.iter().map(|ray| brute_force(&mesh, ray)).collect();
    for coherence in [
        Coherence::Unknown,
        Coherence::Coherent,
        Coherence::Incoherent,
    ] {
        tree.closest_hits_as(coherence, &rays, &mut hits);
        assert_eq!(hits, truth);
    }
}

/// Whatever a file says, with the sum that it should have, no query reads what is not there.
#[test]
fn changed_files_lead_no_query_astray() {
    let mesh = soup(8, 1.0);
    let rays = rays(&mesh);
    let (mut loaded, mut refused, mut hits) = (0, 0, Vec::new());
    for name in ["kd", "wn+kd:6", "framed"] {
        let tree = Tree::build(&mesh, name.parse().unwrap(), &BuildParams::default()).unwrap();
        let bytes = saved(&tree.with_layout(Layout::Wide).unwrap());
        let content = bytes.len() - 32;
        // Few of the places there are: `saved_trees` tries them all.
        for place in (12..content).step_by(content / 8) {
            let mut changed = bytes.clone();
            changed[place] ^= 0xff;
            let Ok(tree) = Tree::from_bytes(&with_sum(changed), &mesh) else {
                refused += 1;
                continue;
            };
            loaded += 1;
            for ray in &rays {
                tree.closest_hit(ray, &mut ());
                tree.any_hit(ray, &mut ());
                tree.all_hits(ray, &mut hits, &mut ());
            }
        }
    }
    assert!(loaded > 0 && refused > 0, "{loaded} {refused}");
}
