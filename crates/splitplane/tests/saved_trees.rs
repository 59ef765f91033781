//! Saved trees: loaded as they were, or refused.

use splitplane::{
    Axis, BuildParams, Counts, Layout, LoadError, Mesh, ObliquePricing, Ray, TREES, Ties, Tree,
    TreeChoice,
};

mod common;

use common::{Random, saved, soup, sphere, with_sum};

fn choices() -> impl Iterator<Item = TreeChoice> {
    TREES
        .iter()
        .map(|spec| TreeChoice::new(spec.name, None).unwrap())
}

/// All trees over a mesh, in all layouts.
fn trees(mesh: &Mesh, params: &BuildParams) -> Vec<Tree> {
    let of = |choice| {
        let tree = Tree::build(mesh, choice, params).unwrap();
        Layout::ALL.map(|layout| tree.clone().with_layout(layout).unwrap())
    };
    choices().flat_map(of).collect()
}

fn rays(count: usize) -> Vec<Ray> {
    let mut random = Random(8);
    (0..count)
        .map(|_| Ray::new(random.point(4.0), random.point(2.0)))
        .collect()
}

/// Asks all that can be asked; only that it ends matters.
fn ask(tree: &Tree) {
    for ray in rays(4) {
        let mut hits = Vec::new();
        tree.closest_hit(&ray, &mut Counts::default());
        tree.any_hit(&ray, &mut ());
        tree.all_hits(&ray, &mut hits, &mut ());
        tree.closest_point(ray.origin, f32::INFINITY, &mut ());
        tree.contains(ray.origin, &mut ());
        tree.triangles_in_sphere(ray.origin, 1.0, &mut ());
    }
    // So far away that every box is looked into.
    tree.closest_hit(&Ray::new([1e19, 0.0, 0.0], [-1.0, 0.0, 0.0]), &mut ());
    tree.triangles_in_box(&tree.bounds(), &mut ());
    tree.section(Axis::Z, 0.1, u32::MAX);
    let _ = tree.validate();
    tree.card();
}

#[test]
fn every_tree_is_loaded_as_it_was_saved() {
    let broken = Mesh::new(
        vec![[f32::NAN; 3], [0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.5]],
        vec![[0, 1, 2], [1, 1, 2], [1, 2, 3]],
    );
    let far = [
        [458_317.3, 5_427_901.1, 0.1],
        [458_318.3, 5_427_901.1, 0.1],
        [458_317.3, 5_427_902.1, 0.3],
    ];
    let meshes = [
        soup(150, 0.6),
        sphere(9),
        Mesh::new(vec![], vec![]).unwrap(),
        broken.unwrap(),
        Mesh::from_f64(&far, vec![[0, 1, 2]]).unwrap(),
    ];
    let fork = BuildParams {
        ties: Ties::AsPublished,
        oblique_pricing: ObliquePricing::Fork { alpha: 0.125 },
        seed: 7,
        ..BuildParams::PBRT3
    };
    let rays = rays(200);
    for mesh in &meshes {
        for tree in [BuildParams::default(), fork.clone()]
            .iter()
            .flat_map(|p| trees(mesh, p))
        {
            let loaded = Tree::from_bytes(&saved(&tree), mesh).unwrap();
            assert!(loaded == tree, "{} {}", tree.choice(), tree.layout());
            assert_eq!(loaded.card(), tree.card());
            assert_eq!(loaded.layout(), tree.layout());
            loaded.validate().unwrap();
            for ray in &rays {
                let (mut a, mut b) = (Counts::default(), Counts::default());
                assert_eq!(
                    loaded.closest_hit(ray, &mut a),
                    tree.closest_hit(ray, &mut b)
                );
                assert_eq!(a, b);
            }
        }
    }
}

#[test]
fn a_file_with_any_byte_changed_is_refused() {
    let mesh = soup(12, 1.0);
    for tree in trees(&mesh, &BuildParams::default()) {
        let mut bytes = saved(&tree);
        for i in 0..bytes.len() {
            for mask in [1, 0xff] {
                bytes[i] ^= mask;
                let error = Tree::from_bytes(&bytes, &mesh).unwrap_err();
                let right = match i {
                    0..8 => matches!(error, LoadError::NotATree),
                    8..12 => matches!(error, LoadError::Version { .. }),
                    _ => matches!(error, LoadError::Damaged),
                };
                assert!(right, "{}, byte {i}: {error}", tree.choice());
                bytes[i] ^= mask;
            }
        }
    }
}

#[test]
fn a_file_that_is_cut_short_or_has_a_tail_is_refused() {
    let mesh = soup(12, 1.0);
    for tree in trees(&mesh, &BuildParams::default()) {
        let mut bytes = saved(&tree);
        for end in 0..bytes.len() {
            assert!(Tree::from_bytes(&bytes[..end], &mesh).is_err(), "{end}");
        }
        bytes.push(0);
        assert!(matches!(
            Tree::from_bytes(&bytes, &mesh),
            Err(LoadError::Damaged)
        ));
        let with_tail = with_sum(bytes);
        let error = Tree::from_bytes(&with_tail, &mesh).unwrap_err();
        assert!(matches!(error, LoadError::Invalid { .. }), "{error}");
    }
}

/// Every byte and every number changed, with a sum that is right again: refused, or a tree that
/// answers whatever it is asked.
#[test]
fn no_file_leads_a_query_astray() {
    let mesh = soup(8, 1.0);
    for tree in trees(&mesh, &BuildParams::default()) {
        let bytes = saved(&tree);
        let (mut loaded, mut refused) = (0, 0);
        let mut open = |bytes: Vec<u8>| match Tree::from_bytes(&with_sum(bytes), &mesh) {
            Ok(tree) => {
                ask(&tree);
                loaded += 1;
            }
            Err(LoadError::Damaged | LoadError::Read(_)) => panic!("the sum is right"),
            Err(_) => refused += 1,
        };
        for i in 12..bytes.len() - 32 {
            for mask in [1, 0x80, 0xff] {
                let mut changed = bytes.clone();
                changed[i] ^= mask;
                open(changed);
            }
        }
        let numbers = [
            0,
            1,
            u32::MAX,
            1 << 31,
            f32::NAN.to_bits(),
            f32::INFINITY.to_bits(),
        ];
        for i in (12..bytes.len() - 36).step_by(2) {
            for number in numbers {
                let mut changed = bytes.clone();
                changed[i..i + 4].copy_from_slice(&number.to_le_bytes());
                open(changed);
            }
        }
        assert!(loaded > 0 && refused > 100, "{loaded} {refused}");
    }
}

/// With another place of the scene or other axes, a ray may meet boxes at what is no number, and so
/// children that there are not.
#[test]
fn a_wide_tree_is_where_its_mesh_is_and_its_axes_are_of_unit_length() {
    let mesh = soup(12, 1.0);
    let refused = |tree: &Tree, found: &[f32], changed: [f32; 2], what: &str| {
        let bytes = saved(tree);
        let found: &[u8] = &found
            .iter()
            .flat_map(|c| c.to_le_bytes())
            .collect::<Vec<u8>>();
        let place = bytes.windows(found.len()).position(|here| here == found);
        let place = place.expect("it is in the file");
        for number in changed {
            let mut changed = bytes.clone();
            changed[place..place + 4].copy_from_slice(&number.to_le_bytes());
            let error = Tree::from_bytes(&with_sum(changed), &mesh).unwrap_err();
            assert!(error.to_string().contains(what), "{error}");
        }
    };
    for tree in trees(&mesh, &BuildParams::default()) {
        if tree.layout() == Layout::Wide {
            let center = mesh.bounds().center();
            refused(
                &tree,
                &center,
                [-1e30, f32::NAN],
                "is not where the scene is",
            );
            let axes = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];
            refused(
                &tree,
                &axes,
                [1e30, f32::NAN],
                "axes are not of unit length",
            );
        }
    }
}

#[test]
fn a_tree_is_loaded_over_its_own_mesh_alone() {
    let (mesh, other) = (soup(20, 1.0), soup(21, 1.0));
    let tree = Tree::new(&mesh).unwrap();
    let text = |other: &Mesh| {
        Tree::from_bytes(&saved(&tree), other)
            .unwrap_err()
            .to_string()
    };
    assert_eq!(
        text(&other),
        "is the tree of another mesh, of 20 triangles and 60 vertices"
    );
    let mut positions = mesh.positions().to_vec();
    positions[5][1] = positions[5][1].next_up();
    let moved = Mesh::new(positions, mesh.triangles().to_vec()).unwrap();
    assert!(text(&moved).ends_with("vertices as this one, but not the same"));
}

#[test]
fn foreign_and_older_files_are_named() {
    let mesh = soup(20, 1.0);
    let text = |bytes: &[u8]| Tree::from_bytes(bytes, &mesh).unwrap_err().to_string();
    assert_eq!(text(b""), "is not a saved tree");
    assert_eq!(text(b"ply\nformat ascii 1.0\n"), "is not a saved tree");
    let mut bytes = saved(&Tree::new(&mesh).unwrap());
    bytes[8] = 0;
    assert!(text(&with_sum(bytes)).starts_with("was saved in version 0 of the format"));
}

#[test]
fn a_file_is_written_whole_or_not_at_all() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("tree.spt");
    let mesh = soup(30, 1.0);
    let [first, second] = ["kd", "wn+kd:6"]
        .map(|t| Tree::build(&mesh, t.parse().unwrap(), &BuildParams::default()).unwrap());
    first.save(&path).unwrap();
    assert!(Tree::load(&path, &mesh).unwrap() == first);
    second.save(&path).unwrap();
    assert!(Tree::load(&path, &mesh).unwrap() == second);
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    assert!(first.save(folder.path().join("nowhere/tree.spt")).is_err());
    assert!(matches!(
        Tree::load(folder.path(), &mesh),
        Err(LoadError::NotATree)
    ));
    let missing = Tree::load(folder.path().join("none.spt"), &mesh);
    assert!(matches!(missing, Err(LoadError::Read(_))));
}

/// The tree in these bytes, read out of them and used where it lies in a file.
#[allow(unsafe_code)]
fn both(bytes: &[u8], mesh: &Mesh) -> [Result<Tree, String>; 2] {
    let file = tempfile::NamedTempFile::new().unwrap();
    std::fs::write(&file, bytes).unwrap();
    // SAFETY: nobody else knows the file; it is removed, not changed, below.
    let mapped = unsafe { Tree::load_mapped(file.path(), mesh) };
    #[cfg(unix)]
    drop(file);
    [Tree::from_bytes(bytes, mesh), mapped].map(|tree| tree.map_err(|e| e.to_string()))
}

#[test]
fn a_mapped_tree_is_the_same_and_as_well_checked() {
    let mesh = soup(12, 1.0);
    for tree in trees(&mesh, &BuildParams::default()) {
        let bytes = saved(&tree);
        let [read, mapped] = both(&bytes, &mesh).map(Result::unwrap);
        assert!(read == tree && mapped == tree);
        let copy = mapped.clone();
        drop(mapped);
        ask(&copy);
        let step = if tree.choice().spec.name == "framed" {
            1
        } else {
            61
        };
        for i in (0..bytes.len()).step_by(step) {
            let mut changed = bytes.clone();
            changed[i] ^= 0x80;
            let mut files = vec![bytes[..i].to_vec(), changed.clone()];
            if (12..bytes.len() - 32).contains(&i) {
                files.push(with_sum(changed));
            }
            for file in files {
                match both(&file, &mesh) {
                    [Ok(read), Ok(mapped)] => {
                        assert!(read == mapped);
                        ask(&mapped);
                    }
                    [read, mapped] => assert_eq!(read.unwrap_err(), mapped.unwrap_err()),
                }
            }
        }
    }
    let folder = tempfile::tempdir().unwrap();
    // SAFETY: there is no file.
    #[allow(unsafe_code)]
    let error = unsafe { Tree::load_mapped(folder.path(), &mesh) };
    assert!(matches!(error, Err(LoadError::NotATree)));
}
