//! Every query, in a few lines each: the snippets of `docs/rust.md`.
//!
//! `cargo run --example tour`

use std::sync::Arc;

use splitplane::{Aabb, BuildParams, Counts, Instances, Mesh, Ray, Transform, Tree};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let positions = vec![
        [0.0, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [0.0, 0.0, 1.0],
    ];
    let mesh = Mesh::new(positions, vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])?;
    let tree = Tree::new(&mesh)?; // the default
    let kd = Tree::build(&mesh, "kd".parse()?, &BuildParams::default())?; // by name

    let ray = Ray::new([0.2, 0.2, 5.0], [0.0, 0.0, -1.0]);
    let hit = tree.closest_hit(&ray, &mut ()).expect("a hit");
    assert_eq!(Some(hit), kd.closest_hit(&ray, &mut ()));
    let short = Ray { t_max: 1.0, ..ray };
    assert!(tree.any_hit(&ray, &mut ()) && !tree.any_hit(&short, &mut ()));
    println!("{:?} {:?}", ray.at(hit.t), mesh.normal(hit.triangle));

    let mut hits = Vec::new(); // its memory serves many rays
    let ray = Ray::new([0.2, 0.2, 5.0], [0.0, 0.0, -1.0]);
    tree.all_hits(&ray, &mut hits, &mut ());
    assert_eq!(
        hits.iter().map(|hit| hit.triangle).collect::<Vec<_>>(),
        [2, 0]
    );
    // Alpha masks, layers, "not the triangle I stand on".
    let behind = tree.closest_hit_where(&ray, |hit| hit.triangle != hits[0].triangle, &mut ());
    assert_eq!(behind, Some(hits[1]));

    let near = tree
        .closest_point([0.25, 0.25, -1.0], f32::INFINITY, &mut ())
        .expect("a mesh");
    assert_eq!(
        (near.distance, near.triangle, near.point),
        (1.0, 0, [0.25, 0.25, 0.0])
    );
    assert!(mesh.is_closed() && tree.contains([0.1, 0.1, 0.1], &mut ()));
    assert_eq!(tree.signed_distance([0.25, 0.25, -1.0], &mut ()), Some(1.0));
    assert_eq!(
        tree.triangles_in_sphere([0.25, 0.25, -1.0], 1.0, &mut ()),
        [0]
    );
    let corner = Aabb {
        min: [-0.1; 3],
        max: [0.1; 3],
    };
    assert_eq!(tree.triangles_in_box(&corner, &mut ()), [0, 1, 3]);

    let lid = [[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]];
    let lid = Mesh::new(lid.to_vec(), vec![[0, 1, 2]])?;
    let (both, parts) = Mesh::join([&mesh, &lid])?;
    let hit = Tree::new(&both)?.closest_hit(&ray, &mut ()).expect("a hit");
    assert_eq!(parts.locate(hit.triangle), (1, 0)); // mesh, triangle in it

    let shared = Arc::new(Tree::new(&mesh)?);
    let twice_as_high = Transform::from_rows([
        [1.0, 0.0, 0.0, 10.0],
        [0.0, 1.0, 0.0, 0.0],
        [0.0, 0.0, 2.0, 0.0],
    ])?;
    let scene = Instances::new([
        (shared.clone(), Transform::IDENTITY),
        (shared, twice_as_high),
    ])?;
    let found = scene.closest_hit(&Ray::new([10.0, 0.0, 5.0], [0.0, 0.0, -1.0]), &mut ());
    let found = found.expect("a hit");
    assert_eq!((found.instance, found.hit.t), (1, 3.0));
    println!("{:?}", scene.normal(&found));

    let rays: Vec<Ray> = (0..10_000)
        .map(|i| Ray::new([1e-4 * i as f32, 0.1, 5.0], [0.0, 0.0, -1.0]))
        .collect();
    let mut hits = vec![None; rays.len()];
    tree.closest_hits(&rays, &mut hits);
    assert!(hits.iter().flatten().count() > 8_000);

    let folder = std::env::temp_dir().join(format!("splitplane-tour-{}", std::process::id()));
    std::fs::create_dir_all(&folder)?;
    let path = folder.join("mesh.spt");
    tree.save(&path)?;
    let loaded = Tree::load(&path, &mesh)?;
    assert_eq!(loaded, tree);
    std::fs::remove_dir_all(&folder)?;

    let mut counts = Counts::default();
    tree.closest_hit(&Ray::new([0.2, 0.2, 5.0], [0.0, 0.0, -1.0]), &mut counts);
    println!("{counts:?}, {:?}", tree.card());
    Ok(())
}
