//! Every tree, on scenes that are hard in different ways, against testing every triangle.

use std::sync::atomic::{AtomicU64, Ordering};

use splitplane::{
    BuildError, BuildParams, Counts, DepthLimit, Directions, Hit, Layout, Mesh, Progress, Ray,
    TREES, Ties, Tree, TreeChoice,
};

mod common;

use common::{Random, soup, sphere};

/// A flat grid in the plane z = 0.25: planes that contain many triangles, and a scene without
/// volume.
fn coplanar(side: u32) -> Mesh {
    let positions = (0..=side)
        .flat_map(|y| (0..=side).map(move |x| [x as f32, y as f32, 0.25]))
        .collect();
    let at = |x: u32, y: u32| y * (side + 1) + x;
    let triangles = (0..side)
        .flat_map(|y| (0..side).map(move |x| (x, y)))
        .flat_map(|(x, y)| {
            let (a, b, c, d) = (at(x, y), at(x + 1, y), at(x, y + 1), at(x + 1, y + 1));
            [[a, b, d], [a, d, c]]
        })
        .collect();
    Mesh::new(positions, triangles).unwrap()
}

/// The same few triangles many times: ties in t everywhere.
fn duplicates(copies: usize) -> Mesh {
    let few = soup(4, 1.5);
    let triangles = few.triangles().repeat(copies);
    Mesh::new(few.positions().to_vec(), triangles).unwrap()
}

/// Long thin triangles in all directions.
fn needles(count: usize) -> Mesh {
    let mut random = Random(3);
    let mut positions = Vec::new();
    for _ in 0..count {
        let (a, b) = (random.point(2.0), random.point(2.0));
        let side = random.point(0.01);
        positions.extend([a, b, std::array::from_fn(|i| b[i] + side[i])]);
    }
    let triangles = (0..count as u32)
        .map(|i| [3 * i, 3 * i + 1, 3 * i + 2])
        .collect();
    Mesh::new(positions, triangles).unwrap()
}

/// A soup far from the origin, where coordinates are coarse.
fn far_away(count: usize) -> Mesh {
    let near = soup(count, 0.7);
    let positions = near
        .positions()
        .iter()
        .map(|p| [p[0] + 148_376.0, p[1] + 1_234.0, p[2] - 223_423.0])
        .collect();
    Mesh::new(positions, near.triangles().to_vec()).unwrap()
}

/// Boxes that are turned, each its own way, of which each face is many triangles: frames to be
/// found.
fn turned_boxes(boxes: u32, side: u32) -> Mesh {
    let mut random = Random(11);
    let (mut positions, mut triangles) = (Vec::new(), Vec::new());
    for _ in 0..boxes {
        let center = random.point(6.0);
        let (a, b) = (random.point(2.0), random.point(2.0));
        let cross = |a: [f32; 3], b: [f32; 3]| {
            [
                a[1] * b[2] - a[2] * b[1],
                a[2] * b[0] - a[0] * b[2],
                a[0] * b[1] - a[1] * b[0],
            ]
        };
        let unit = |v: [f32; 3]| {
            let length = v.iter().map(|c| c * c).sum::<f32>().sqrt();
            v.map(|c| c / length)
        };
        let x = unit(a);
        let z = unit(cross(x, b));
        let y = cross(z, x);
        for (u, v, w) in [(x, y, z), (y, z, x), (z, x, y)] {
            for sign in [-1.0, 1.0] {
                let first = positions.len() as u32;
                for i in 0..=side {
                    for j in 0..=side {
                        let [s, t] = [i, j].map(|k| 2.0 * k as f32 / side as f32 - 1.0);
                        positions.push(std::array::from_fn(|c| {
                            center[c] + s * u[c] + t * v[c] + sign * w[c]
                        }));
                    }
                }
                let at = |i: u32, j: u32| first + i * (side + 1) + j;
                for (i, j) in (0..side).flat_map(|i| (0..side).map(move |j| (i, j))) {
                    triangles.extend([
                        [at(i, j), at(i + 1, j), at(i + 1, j + 1)],
                        [at(i, j), at(i + 1, j + 1), at(i, j + 1)],
                    ]);
                }
            }
        }
    }
    Mesh::new(positions, triangles).unwrap()
}

fn scenes() -> Vec<(&'static str, Mesh)> {
    vec![
        ("turned boxes", turned_boxes(2, 3)),
        ("soup", soup(150, 0.8)),
        ("sphere", sphere(8)),
        ("coplanar", coplanar(7)),
        ("duplicates", duplicates(20)),
        ("one", soup(1, 1.0)),
        ("none", Mesh::new(vec![], vec![]).unwrap()),
        ("needles", needles(100)),
        ("far away", far_away(80)),
    ]
}

/// Rays at random, and rays that are hard: at vertices and edges, along axes and planes, from
/// vertices, with a short interval.
fn rays(mesh: &Mesh) -> Vec<Ray> {
    let mut random = Random(7);
    let bounds = mesh.bounds();
    let (center, size) = if bounds.is_empty() {
        ([0.0; 3], 2.0)
    } else {
        (bounds.center(), bounds.diagonal())
    };
    let near = |random: &mut Random| {
        let offset = random.point(2.0 * size);
        std::array::from_fn(|i| center[i] + offset[i])
    };
    let towards = |origin: [f32; 3], target: [f32; 3]| {
        Ray::new(origin, std::array::from_fn(|i| target[i] - origin[i]))
    };
    let mut rays = Vec::new();
    for _ in 0..300 {
        let (a, b) = (near(&mut random), near(&mut random));
        rays.push(towards(a, b));
    }
    for &triangle in mesh.usable_triangles().iter().step_by(3) {
        let [a, b, c] = mesh.corners(triangle);
        let origin = near(&mut random);
        let middle = std::array::from_fn(|i| 0.5 * (a[i] + b[i]));
        rays.push(towards(origin, a));
        rays.push(towards(origin, middle));
        rays.push(towards(a, c));
        rays.push(Ray {
            t_min: 0.25,
            t_max: 0.75,
            ..towards(origin, b)
        });
        for axis in 0..3 {
            let mut direction = [0.0; 3];
            direction[axis] = if random.next() < 0.5 { 1.0 } else { -1.0 };
            direction[(axis + 1) % 3] = -0.0;
            let mut start = a;
            start[axis] -= 1.5 * size * direction[axis];
            rays.push(Ray::new(start, direction));
            rays.push(Ray::new(middle, direction));
            direction[(axis + 1) % 3] = 1e-40;
            rays.push(Ray::new(start, direction));
        }
    }
    rays
}

/// The tree without splits: one leaf with everything.
fn brute_force(mesh: &Mesh) -> Tree {
    let params = BuildParams {
        max_depth: DepthLimit::Fixed(0),
        ..BuildParams::THESIS
    };
    Tree::build(mesh, "kd".parse().unwrap(), &params).unwrap()
}

fn choices() -> Vec<TreeChoice> {
    TREES
        .iter()
        .flat_map(|spec| match spec.direction_counts() {
            None => vec![TreeChoice::new(spec.name, None).unwrap()],
            Some((min, _)) => [min, min + 3, 13]
                .map(|k| TreeChoice::new(spec.name, Some(k)).unwrap())
                .to_vec(),
        })
        .collect()
}

fn params() -> [BuildParams; 4] {
    let ways = [
        (Ties::AsPublished, false),
        (Ties::Tolerant, false),
        (Ties::AsPublished, true),
        (Ties::Tolerant, true),
    ];
    ways.map(|(ties, clip)| BuildParams {
        ties,
        clip,
        oblique_up_to: if clip { 100 } else { u32::MAX },
        seed: 5,
        ..BuildParams::THESIS
    })
}

fn in_layouts(mesh: &Mesh, choice: TreeChoice, params: &BuildParams) -> [Tree; 2] {
    let tree = Tree::build(mesh, choice, params).unwrap();
    Layout::ALL.map(|layout| tree.clone().with_layout(layout).unwrap())
}

fn bits(hit: Option<Hit>) -> Option<(u32, u32, u32, u32)> {
    hit.map(|h| (h.t.to_bits(), h.u.to_bits(), h.v.to_bits(), h.triangle))
}

#[test]
fn every_tree_gives_the_hits_of_brute_force_bit_for_bit() {
    for (scene, mesh) in scenes() {
        let brute = brute_force(&mesh);
        let rays = rays(&mesh);
        let expected: Vec<_> = rays
            .iter()
            .map(|ray| brute.closest_hit(ray, &mut ()))
            .collect();
        if mesh.triangles().len() > 1 {
            let hits = expected.iter().flatten().count();
            assert!(
                10 * hits > rays.len(),
                "{scene}: {hits} hits of {} rays test little",
                rays.len()
            );
        }
        for choice in choices() {
            for params in params() {
                let binary = Tree::build(&mesh, choice, &params).unwrap();
                let wide = binary.clone().with_layout(Layout::Wide).unwrap();
                for tree in [binary, wide] {
                    let layout = tree.layout();
                    for (ray, expected) in rays.iter().zip(&expected) {
                        let hit = tree.closest_hit(ray, &mut ());
                        assert_eq!(
                            bits(hit),
                            bits(*expected),
                            "{choice} ({:?}, {layout}) on {scene}: {ray:?} gives {hit:?}, not {expected:?}",
                            params.ties
                        );
                        let any = tree.any_hit(ray, &mut ());
                        assert_eq!(
                            any,
                            expected.is_some(),
                            "{choice} ({layout}) on {scene}: any hit of {ray:?}"
                        );
                    }
                }
            }
        }
    }
}

#[test]
fn every_tree_gives_all_hits_of_brute_force_and_those_that_a_filter_takes() {
    let odd = |hit: &Hit| hit.triangle % 2 == 1 && hit.u < 0.5;
    for (scene, mesh) in scenes() {
        let brute = brute_force(&mesh);
        let rays = rays(&mesh);
        let all = |tree: &Tree, ray: &Ray| {
            let mut hits = vec![];
            tree.all_hits(ray, &mut hits, &mut ());
            hits
        };
        let expected: Vec<Vec<Hit>> = rays.iter().map(|ray| all(&brute, ray)).collect();
        for (ray, hits) in rays.iter().zip(&expected) {
            assert!(hits.is_sorted_by(|a, b| (a.t, a.triangle) < (b.t, b.triangle)));
            assert_eq!(hits.first().copied(), brute.closest_hit(ray, &mut ()));
        }
        for choice in choices() {
            for tree in params().iter().flat_map(|p| in_layouts(&mesh, choice, p)) {
                for (ray, expected) in rays.iter().zip(&expected) {
                    assert_eq!(&all(&tree, ray), expected, "{choice} on {scene}: {ray:?}");
                    let mut taken: Vec<Hit> = expected.iter().copied().filter(odd).collect();
                    let first = tree.closest_hit_where(ray, odd, &mut ());
                    assert_eq!(
                        first,
                        taken.first().copied(),
                        "{choice} on {scene}: {ray:?}"
                    );
                    assert_eq!(tree.any_hit_where(ray, odd, &mut ()), first.is_some());
                    tree.all_hits_where(ray, odd, &mut taken, &mut ());
                    assert!(taken.iter().eq(expected.iter().filter(|hit| odd(hit))));
                }
            }
        }
    }
}

/// Points near and far, on vertices, in the middle of edges, and right below both.
fn points(mesh: &Mesh) -> Vec<[f32; 3]> {
    let mut random = Random(11);
    let bounds = mesh.bounds();
    let (center, size) = if bounds.is_empty() {
        ([0.0; 3], 2.0)
    } else {
        (bounds.center(), bounds.diagonal())
    };
    let mut points = vec![center];
    for i in 0..200 {
        let offset = random.point(if i % 4 == 0 { 5.0 * size } else { 1.2 * size });
        points.push(std::array::from_fn(|i| center[i] + offset[i]));
    }
    for &triangle in mesh.usable_triangles().iter().step_by(7) {
        let [a, b, _] = mesh.corners(triangle);
        let middle: [f32; 3] = std::array::from_fn(|i| 0.5 * (a[i] + b[i]));
        for [x, y, z] in [a, middle] {
            points.extend([[x, y, z], [x, y, z - 0.1 * size], [x, y, z - 3.0 * size]]);
        }
    }
    points
}

#[test]
fn every_tree_finds_what_lies_near_as_brute_force_does() {
    for (scene, mesh) in scenes() {
        let brute = brute_force(&mesh);
        let size = mesh.bounds().diagonal();
        let points = points(&mesh);
        let ask = |tree: &Tree, &point: &[f32; 3], radius: f32| {
            let region = splitplane::Aabb {
                min: point.map(|c| c - radius),
                max: std::array::from_fn(|i| point[i] + radius * (i + 1) as f32),
            };
            (
                tree.closest_point(point, f32::INFINITY, &mut ()),
                tree.closest_point(point, radius, &mut ()),
                tree.triangles_in_sphere(point, radius, &mut ()),
                tree.triangles_in_box(&region, &mut ()),
                tree.contains(point, &mut ()),
                tree.signed_distance(point, &mut ()),
            )
        };
        let radius = |i: usize| [0.0, 0.02, 0.1, 0.4][i % 4] * size;
        let expected: Vec<_> = (points.iter().enumerate())
            .map(|(i, point)| ask(&brute, point, radius(i)))
            .collect();
        for (i, (closest, within, in_sphere, ..)) in expected.iter().enumerate() {
            let near = closest.filter(|closest| closest.distance <= radius(i));
            assert_eq!(near.is_some(), !in_sphere.is_empty());
            assert_eq!(&near, within);
        }
        for choice in choices() {
            for tree in params().iter().flat_map(|p| in_layouts(&mesh, choice, p)) {
                for (i, point) in points.iter().enumerate() {
                    let found = ask(&tree, point, radius(i));
                    assert_eq!(found, expected[i], "{choice} on {scene}: {point:?}");
                }
            }
        }
    }
}

#[test]
fn a_tree_looks_at_few_triangles_for_the_closest_point() {
    let mesh = sphere(24);
    for spec in TREES {
        let choice = TreeChoice::new(spec.name, None).unwrap();
        for tree in in_layouts(&mesh, choice, &BuildParams::default()) {
            let mut counts = Counts::default();
            let mut random = Random(5);
            for _ in 0..100 {
                tree.closest_point(random.point(4.0), f32::INFINITY, &mut counts);
            }
            let each = counts.triangle_tests as f64 / 100.0;
            // Cells without a side across an axis say less about distances.
            let share = match spec.axes || tree.layout() == Layout::Wide {
                true => 0.2,
                false => 0.6,
            };
            let limit = share * mesh.triangles().len() as f64;
            let layout = tree.layout();
            assert!(
                each < limit,
                "{choice} ({layout}): {each} of at most {limit}"
            );
        }
    }
}

/// How often a closed mesh winds around a point: the sum of the solid angles of its triangles,
/// over 4π [VanOosterom1983].
fn winding(mesh: &Mesh, point: [f32; 3]) -> f64 {
    let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let angle = |&i: &u32| {
        let [a, b, c] = mesh
            .corners(i)
            .map(|p| std::array::from_fn(|i| f64::from(p[i]) - f64::from(point[i])));
        let cross = [
            b[1] * c[2] - b[2] * c[1],
            b[2] * c[0] - b[0] * c[2],
            b[0] * c[1] - b[1] * c[0],
        ];
        let [la, lb, lc] = [a, b, c].map(|v| dot(v, v).sqrt());
        let below = la * lb * lc + dot(a, b) * lc + dot(b, c) * la + dot(c, a) * lb;
        2.0 * dot(a, cross).atan2(below)
    };
    mesh.usable_triangles().iter().map(angle).sum::<f64>() / (4.0 * std::f64::consts::PI)
}

#[test]
fn a_point_is_inside_where_the_mesh_winds_around_it() {
    let mesh = sphere(9);
    assert!(mesh.is_closed() && !soup(9, 1.0).is_closed());
    let tree = Tree::new(&mesh).unwrap();
    let mut random = Random(13);
    let mut inside = 0;
    let near = (0..300).map(|_| random.point(2.2));
    for point in points(&mesh).into_iter().chain(near) {
        let distance = tree.signed_distance(point, &mut ()).unwrap();
        if distance.abs() > 1e-4 {
            let winds = winding(&mesh, point).abs() > 0.5;
            assert_eq!(tree.contains(point, &mut ()), winds, "{point:?}");
            assert_eq!(distance < 0.0, winds);
            inside += u32::from(winds);
        }
    }
    assert!(inside > 50);
}

#[test]
fn what_is_no_point_and_no_region_finds_nothing() {
    let tree = Tree::new(&sphere(8)).unwrap();
    let none = |point: [f32; 3], radius: f32| {
        assert_eq!(tree.closest_point(point, radius, &mut ()), None);
        assert!(tree.triangles_in_sphere(point, radius, &mut ()).is_empty());
    };
    none([f32::NAN, 0.0, 0.0], 1.0);
    none([0.0, f32::INFINITY, 0.0], f32::INFINITY);
    none([0.0; 3], f32::NAN);
    none([0.0; 3], -1.0);
    assert!(!tree.contains([f32::NAN; 3], &mut ()));
    let empty = splitplane::Aabb::EMPTY;
    assert!(tree.triangles_in_box(&empty, &mut ()).is_empty());
    let whole = tree.bounds();
    let all = tree.triangles_in_box(&whole, &mut ());
    assert_eq!(all, tree.mesh().usable_triangles());
}

#[test]
fn every_tree_keeps_its_promises() {
    for (scene, mesh) in scenes() {
        for choice in choices() {
            for params in params() {
                let mut tree = Tree::build(&mesh, choice, &params).unwrap();
                for layout in Layout::ALL {
                    tree = tree.with_layout(layout).unwrap();
                    if let Err(error) = tree.validate() {
                        panic!("{choice} ({:?}, {layout}) on {scene}: {error}", params.ties);
                    }
                }
            }
        }
    }
}

#[test]
fn every_tree_takes_the_fewest_and_the_most_directions() {
    let mesh = soup(60, 0.8);
    let brute = brute_force(&mesh);
    for spec in TREES {
        let Some((min, max)) = spec.direction_counts() else {
            continue;
        };
        for k in [min, max] {
            let choice = TreeChoice::new(spec.name, Some(k)).unwrap();
            let tree = Tree::build(&mesh, choice, &BuildParams::default()).unwrap();
            tree.validate().unwrap();
            for ray in rays(&mesh) {
                assert_eq!(
                    bits(tree.closest_hit(&ray, &mut ())),
                    bits(brute.closest_hit(&ray, &mut ())),
                    "{choice}: {ray:?}"
                );
            }
        }
        assert!(TreeChoice::new(spec.name, Some(min - 1)).is_err());
        assert!(TreeChoice::new(spec.name, Some(max + 1)).is_err());
    }
}

#[test]
fn counting_never_changes_a_hit_and_the_counts_add_up() {
    let mesh = soup(200, 0.6);
    for choice in choices() {
        let tree = Tree::build(&mesh, choice, &BuildParams::THESIS).unwrap();
        for ray in rays(&mesh) {
            let mut counts = Counts::default();
            let counted = tree.closest_hit(&ray, &mut counts);
            assert_eq!(bits(counted), bits(tree.closest_hit(&ray, &mut ())));
            if counted.is_some() {
                assert!(
                    counts.triangle_tests > 0 && counts.leaf_visits > 0,
                    "{choice}"
                );
            }
            let spec = choice.spec;
            if spec.axis_nodes && spec.directions == Directions::None && !spec.triangle_planes {
                assert_eq!(counts.oblique_visits, 0);
            }
        }
    }
}

#[test]
fn the_same_seed_gives_the_same_tree_at_any_number_of_threads() {
    // More triangles than are built by one thread alone.
    let mesh = soup(10_000, 0.05);
    for spec in TREES {
        let choice = TreeChoice::new(spec.name, None).unwrap();
        let build = |threads| {
            let pool = rayon::ThreadPoolBuilder::new()
                .num_threads(threads)
                .build()
                .unwrap();
            pool.install(|| Tree::build(&mesh, choice, &BuildParams::THESIS).unwrap())
        };
        let (one, two, again) = (build(1), build(2), build(2));
        assert!(one == two && two == again, "{choice} depends on threads");
    }
}

#[test]
fn another_seed_gives_another_tree_where_draws_are_random() {
    let mesh = sphere(20);
    let build = |seed| {
        let params = BuildParams {
            seed,
            ..BuildParams::THESIS
        };
        Tree::build(&mesh, "wn+kd:6".parse().unwrap(), &params).unwrap()
    };
    assert!(build(1) != build(2));
}

#[test]
fn rays_that_are_no_rays_miss() {
    let mesh = sphere(8);
    let tree = Tree::build(&mesh, "wn+kd:6".parse().unwrap(), &BuildParams::default()).unwrap();
    for broken in [f32::NAN, f32::INFINITY] {
        for ray in [
            Ray::new([broken, 0.0, 0.0], [0.0, 0.0, 1.0]),
            Ray::new([0.0; 3], [0.0, broken, 1.0]),
        ] {
            assert_eq!(tree.closest_hit(&ray, &mut ()), None);
            assert!(!tree.any_hit(&ray, &mut ()));
        }
    }
    assert_eq!(
        tree.closest_hit(&Ray::new([0.0; 3], [0.0; 3]), &mut ()),
        None
    );
}

/// Remembers how far a build has come, and stops it there.
struct StopAt {
    seen: AtomicU64,
    at: u64,
}

impl Progress for StopAt {
    fn advanced(&self, done: u64, total: u64) {
        assert!(done <= total, "{done} of {total}");
        self.seen.fetch_max(done, Ordering::Relaxed);
    }

    fn cancelled(&self) -> bool {
        self.seen.load(Ordering::Relaxed) >= self.at
    }
}

#[test]
fn a_build_tells_how_far_it_is_and_can_be_stopped() {
    let mesh = soup(2_000, 0.1);
    for spec in TREES {
        let choice = TreeChoice::new(spec.name, None).unwrap();
        let build = |at| {
            let watch = StopAt {
                seen: AtomicU64::new(0),
                at,
            };
            let tree = Tree::build_watched(&mesh, choice, &BuildParams::default(), &watch);
            (tree, watch.seen.into_inner())
        };
        let (tree, seen) = build(u64::MAX);
        assert_eq!(seen, 2_000, "{choice}");
        assert!(tree.unwrap() == Tree::build(&mesh, choice, &BuildParams::default()).unwrap());
        for at in [0, 500] {
            let (tree, seen) = build(at);
            assert_eq!(tree.unwrap_err(), BuildError::Cancelled, "{choice}");
            assert!(seen < 2_000, "{choice} went on to {seen}");
        }
    }
}

#[test]
fn a_tree_has_no_more_references_than_it_may() {
    let mesh = needles(300);
    let brute = brute_force(&mesh);
    for spec in TREES.iter().filter(|spec| !spec.objects) {
        let choice = TreeChoice::new(spec.name, None).unwrap();
        // Needles that lie askew are in hundreds of leaves of some trees.
        let unlimited = BuildParams {
            max_references: f64::MAX,
            ..BuildParams::default()
        };
        let full = Tree::build(&mesh, choice, &unlimited).unwrap();
        let card = full.card();
        assert_eq!(card.build.limited_leaves, 0, "{choice}");
        for max_references in [0.0, 1.0, 1.5, 3.0] {
            let params = BuildParams {
                max_references,
                ..BuildParams::default()
            };
            let tree = Tree::build(&mesh, choice, &params).unwrap();
            tree.validate().unwrap();
            let limited = tree.card();
            let limit = max_references.max(1.0) * 300.0;
            assert!(limited.references as f64 <= limit, "{choice}: {limit}");
            let is_limited = card.references as f64 > limit;
            assert_eq!(is_limited, limited.build.limited_leaves > 0, "{choice}");
            for ray in rays(&mesh).iter().step_by(7) {
                assert_eq!(
                    bits(tree.closest_hit(ray, &mut ())),
                    bits(brute.closest_hit(ray, &mut ()))
                );
            }
        }
    }
}
