//! Geometry that crashes others: a right answer and a count of what was skipped, or a clear error;
//! with bounded work and memory.

use splitplane::{
    BuildParams, Layout, Mesh, MeshError, Ray, Skipped, TREES, Ties, Tree, TreeChoice, brute_force,
};

mod common;

use common::{Random, soup};

/// Three vertices a triangle.
fn mesh(corners: &[[[f32; 3]; 3]]) -> Mesh {
    let positions = corners.iter().flatten().copied().collect();
    let triangles = (0..corners.len() as u32)
        .map(|i| [3 * i, 3 * i + 1, 3 * i + 2])
        .collect();
    Mesh::new(positions, triangles).unwrap()
}

fn towards(origin: [f32; 3], target: [f32; 3]) -> Ray {
    Ray::new(origin, std::array::from_fn(|i| target[i] - origin[i]))
}

/// Rays at the triangles of a mesh, wherever those are.
fn rays(mesh: &Mesh, count: usize) -> Vec<Ray> {
    let mut random = Random(11);
    let usable = mesh.usable_triangles();
    let bounds = mesh.bounds();
    (0..count)
        .map(|i| {
            let far = random.point(3.0);
            let size = bounds.extent().into_iter().fold(1e-3, f32::max);
            let origin = std::array::from_fn(|axis| {
                let center = if usable.is_empty() {
                    0.0
                } else {
                    bounds.center()[axis]
                };
                center + size * far[axis]
            });
            let target = match usable.len() {
                0 => random.point(1.0),
                n => {
                    let [a, b, c] = mesh.corners(usable[i * 7919 % n]);
                    let (u, v) = (0.5 * random.next(), 0.5 * random.next());
                    std::array::from_fn(|i| a[i] + u * (b[i] - a[i]) + v * (c[i] - a[i]))
                }
            };
            towards(origin, target)
        })
        .collect()
}

fn default_trees() -> impl Iterator<Item = TreeChoice> {
    TREES
        .iter()
        .map(|spec| TreeChoice::new(spec.name, None).unwrap())
}

/// Builds a tree, checks it and casts rays. `references` bounds what a triangle may be stored
/// times over.
fn check(
    name: &str,
    mesh: &Mesh,
    choice: TreeChoice,
    params: &BuildParams,
    rays: &[Ray],
    references: u64,
) {
    let tree = Tree::build(mesh, choice, params).unwrap();
    tree.validate()
        .unwrap_or_else(|error| panic!("{name}, {choice}: {error}"));
    let card = tree.card();
    let most = references * card.triangles.max(1);
    assert!(
        card.references <= most && card.nodes.total() <= 8 * most,
        "{name}, {choice}: {} references, {} nodes for {} triangles",
        card.references,
        card.nodes.total(),
        card.triangles
    );
    let wide = tree.clone().with_layout(Layout::Wide).unwrap();
    let mut all = Vec::new();
    for ray in rays {
        let truth = brute_force(mesh, ray);
        for tree in [&tree, &wide] {
            let case = || format!("{name}, {choice}, {}: {ray:?}", tree.layout());
            assert_eq!(tree.closest_hit(ray, &mut ()), truth, "{}", case());
            let any = tree.any_hit(ray, &mut ());
            assert_eq!(any, truth.is_some(), "{}", case());
            tree.all_hits(ray, &mut all, &mut ());
            assert_eq!(all.first(), truth.as_ref(), "{}", case());
        }
    }
}

fn clipped_and_not() -> [BuildParams; 2] {
    [true, false].map(|clip| BuildParams {
        clip,
        ..BuildParams::default()
    })
}

fn check_all(name: &str, mesh: &Mesh, count: usize, references: u64) {
    let rays = rays(mesh, count);
    for choice in default_trees() {
        for (ties, clip) in [
            (Ties::Tolerant, false),
            (Ties::AsPublished, false),
            (Ties::Tolerant, true),
        ] {
            let params = BuildParams {
                ties,
                clip,
                ..BuildParams::default()
            };
            check(name, mesh, choice, &params, &rays, references);
        }
    }
}

/// A soup with other numbers among its coordinates.
fn spoilt(count: usize, numbers: &[f32]) -> Mesh {
    let clean = soup(count, 0.5);
    let mut positions = clean.positions().to_vec();
    for (i, position) in positions.iter_mut().enumerate() {
        if i % 5 == 0 {
            position[i % 3] = numbers[i / 5 % numbers.len()];
        }
    }
    Mesh::new(positions, clean.triangles().to_vec()).unwrap()
}

#[test]
fn triangles_with_nan_or_infinity_are_counted_and_the_others_are_hit() {
    let mesh = spoilt(
        100,
        &[f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -f32::NAN],
    );
    // A vertex in five is spoilt, so three triangles in five.
    let expected = Skipped {
        not_finite: 60,
        degenerate: 0,
    };
    assert_eq!(mesh.skipped(), expected);
    check_all("nan", &mesh, 100, 64);
}

/// A soup of another size.
fn scaled(scale: f32) -> Mesh {
    let clean = soup(60, 0.5);
    let positions = clean.positions().iter();
    let positions = positions.map(|p| p.map(|c| c * scale)).collect();
    Mesh::new(positions, clean.triangles().to_vec()).unwrap()
}

#[test]
fn huge_and_tiny_numbers_are_hit_or_counted() {
    let huge = spoilt(100, &[1e30, -1e30, f32::MAX]);
    assert_eq!(huge.skipped().not_finite, 60);
    check_all("too large", &huge, 100, 64);
    check_all("large", &spoilt(100, &[1e17, -1e18, 3e12]), 100, 64);
    check_all("small", &spoilt(100, &[1e-30, -1e-30, 1e-38]), 100, 64);
    check_all("denormal", &spoilt(100, &[1e-40, -1e-45, -0.0]), 100, 64);
    for scale in [1e-10, 1e-18, 1e-30, 1e-41, 1e17] {
        check_all(&format!("scale {scale:e}"), &scaled(scale), 60, 64);
    }
}

/// However long t gets: where it is more than f32 holds, it is infinite, and still a hit.
#[test]
fn directions_may_have_any_length() {
    let longest = |d: [f32; 3]| d.into_iter().fold(0.0, |a: f32, c| a.max(c.abs()));
    let mut infinite = 0;
    for scale in [1e-30, 1e-18, 1.0, 1e17, 1e18] {
        let mesh = scaled(scale);
        let mut lengths = [1e-45, 1e-40, 1e-38, 1e-30, 1e-18, 1e18, 1e38]
            .into_iter()
            .cycle();
        let resized = |ray: Ray| {
            let length = lengths.next().unwrap() / f64::from(longest(ray.direction));
            let resized = |c: f32| (f64::from(c) * length) as f32;
            Ray::new(ray.origin, ray.direction.map(resized))
        };
        let rays: Vec<Ray> = rays(&mesh, 70).into_iter().map(resized).collect();
        let hits = rays.iter().filter_map(|ray| brute_force(&mesh, ray));
        infinite += hits.filter(|hit| hit.t == f32::INFINITY).count();
        for choice in default_trees() {
            let name = format!("scale {scale:e}");
            for params in clipped_and_not() {
                check(&name, &mesh, choice, &params, &rays, 64);
            }
        }
    }
    assert!(infinite > 0);
}

#[test]
fn triangles_without_area_are_counted() {
    let point = [[0.5; 3]; 3];
    let line = [[0.0; 3], [1.0, 2.0, 3.0], [0.5, 1.0, 1.5]];
    let edge = [[0.0; 3], [0.0; 3], [1.0, 0.0, 0.0]];
    let whole = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let mesh = mesh(&[point, line, edge, whole]);
    assert_eq!((mesh.skipped().degenerate, mesh.skipped().total()), (3, 3));
    check_all("no area", &mesh, 20, 64);
    let hit = brute_force(&mesh, &Ray::new([0.25, 0.25, 1.0], [0.0, 0.0, -1.0])).unwrap();
    assert_eq!(hit.triangle, 3);
}

#[test]
fn ten_thousand_of_the_same_triangle_are_one_to_a_ray() {
    let one = [[0.1, 0.2, 0.3], [1.0, 0.25, -0.5], [0.3, 1.5, 0.2]];
    let mesh = mesh(&vec![one; 10_000]);
    check_all("the same", &mesh, 4, 8);
}

#[test]
fn ten_thousand_triangles_in_a_plane() {
    let mut random = Random(3);
    let mut point = || {
        let [x, y, _] = random.point(2.0);
        // Not across an axis.
        [x, y, 0.3 * x - 0.7 * y]
    };
    let corners: Vec<[[f32; 3]; 3]> = (0..10_000)
        .map(|_| {
            let a = point();
            [a, point(), point()].map(|p| std::array::from_fn(|i| a[i] + 0.02 * (p[i] - a[i])))
        })
        .collect();
    let mesh = mesh(&corners);
    let rays = rays(&mesh, 30);
    for choice in default_trees() {
        for params in clipped_and_not() {
            check("in a plane", &mesh, choice, &params, &rays, 64);
        }
    }
}

#[test]
fn none_and_one() {
    let none = Mesh::new(vec![], vec![]).unwrap();
    check_all("none", &none, 10, 64);
    let only_vertices = Mesh::new(vec![[0.0; 3]; 5], vec![]).unwrap();
    check_all("only vertices", &only_vertices, 10, 64);
    let all_skipped = mesh(&[[[f32::NAN; 3]; 3], [[1.0; 3]; 3]]);
    assert_eq!(all_skipped.skipped().total(), 2);
    check_all("all skipped", &all_skipped, 10, 64);
    check_all("one", &soup(1, 1.0), 30, 64);
}

#[test]
fn a_vertex_that_is_not_there_is_named() {
    let error = Mesh::new(vec![[0.0; 3]; 4], vec![[0, 1, 2], [3, 4, 0]]).unwrap_err();
    let expected = MeshError::IndexOutOfRange {
        triangle: 1,
        index: 4,
        positions: 4,
    };
    assert_eq!(error, expected);
    assert!(
        error.to_string().contains("triangle 1 names vertex 4"),
        "{error}"
    );
    assert!(Mesh::new(vec![], vec![[0, 0, u32::MAX]]).is_err());
}

/// `count` triangles, each a hundred-thousandth of the one that they lie in front of.
fn tiny_and_huge(count: usize) -> Mesh {
    let mut random = Random(9);
    let mut corners = Vec::with_capacity(count + 1);
    corners.push([[-1e3, -1e3, -1.0], [3e3, -1e3, 1.0], [-1e3, 3e3, 0.5]]);
    for _ in 0..count {
        let center = random.point(2.0);
        corners.push(std::array::from_fn(|_| {
            let offset = random.point(0.01);
            std::array::from_fn(|i| center[i] + offset[i])
        }));
    }
    mesh(&corners)
}

#[test]
fn many_tiny_triangles_and_a_huge_one() {
    let mesh = tiny_and_huge(5_000);
    let rays = rays(&mesh, 40);
    for choice in default_trees() {
        for params in clipped_and_not() {
            check("tiny and huge", &mesh, choice, &params, &rays, 64);
        }
    }
}

/// Takes minutes: `cargo test --release --test bad_geometry -- --ignored`.
#[test]
#[ignore = "ten million triangles"]
fn ten_million_tiny_triangles_and_a_huge_one() {
    let mesh = tiny_and_huge(10_000_000);
    let rays = rays(&mesh, 8);
    for name in ["bvh", "kd"] {
        let choice = name.parse().unwrap();
        for params in clipped_and_not() {
            check("ten million", &mesh, choice, &params, &rays, 64);
        }
    }
}

/// Embree's test of garbage: a thousand scenes of twenty meshes whose coordinates are random bits.
#[test]
fn a_thousand_scenes_of_random_bits() {
    const MESHES: usize = 20;
    const TRIANGLES: usize = 8;
    let mut bits = 0x2545_f491_4f6c_dd1d_u64;
    let mut any_number = || {
        bits ^= bits << 13;
        bits ^= bits >> 7;
        bits ^= bits << 17;
        f32::from_bits((bits >> 32) as u32)
    };
    let choices: Vec<TreeChoice> = default_trees().collect();
    let mut usable = 0;
    for scene in 0..1000 {
        let corners: Vec<[[f32; 3]; 3]> = (0..MESHES * TRIANGLES)
            .map(|_| std::array::from_fn(|_| std::array::from_fn(|_| any_number())))
            .collect();
        let mesh = mesh(&corners);
        let kept = mesh.usable_triangles().len();
        assert_eq!(kept + mesh.skipped().total(), corners.len());
        usable += kept;
        let mut rays = rays(&mesh, 8);
        rays.extend((0..8).map(|_| Ray {
            origin: std::array::from_fn(|_| any_number()),
            direction: std::array::from_fn(|_| any_number()),
            t_min: any_number(),
            t_max: any_number(),
        }));
        let choice = choices[scene % choices.len()];
        let ties = [Ties::Tolerant, Ties::AsPublished][scene / choices.len() % 2];
        let params = BuildParams {
            ties,
            clip: scene % 2 == 1,
            ..BuildParams::default()
        };
        check(
            &format!("garbage {scene}"),
            &mesh,
            choice,
            &params,
            &rays,
            256,
        );
    }
    // All nine numbers are small enough for a tree in about one triangle of seventeen.
    assert!(usable > 5_000, "{usable}");
}
