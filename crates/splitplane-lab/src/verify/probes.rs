//! Rays that are lost easily.

use rand::RngExt;
use rand_pcg::Pcg32;
use splitplane::{Mesh, Ray, brute_force};
use splitplane_render::render::leave;

use super::meshes::{jumble, sheet, sphere, stone};

/// What an answer to a ray must be, beyond what brute force answers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Expect {
    /// No more than that.
    AsBruteForce,
    /// A hit: the ray begins inside of a closed surface, or above a sheet that it cannot pass.
    Hit,
    /// Not a hit on this triangle, which the ray leaves.
    NotOn(u32),
}

/// A ray, and what is known of its answer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Probe {
    /// The ray.
    pub ray: Ray,
    /// What is known.
    pub expect: Expect,
}

/// Rays of one kind on a mesh.
#[derive(Clone, Debug)]
pub struct ProbeSet {
    name: &'static str,
    summary: &'static str,
    mesh: Mesh,
    make: fn(&Mesh, &mut Pcg32) -> Probe,
}

impl ProbeSet {
    /// A short name.
    pub fn name(&self) -> &'static str {
        self.name
    }

    /// What the rays are, in a line.
    pub fn summary(&self) -> &'static str {
        self.summary
    }

    /// The mesh that the rays are cast at.
    pub fn mesh(&self) -> &Mesh {
        &self.mesh
    }

    /// The ray of that number, always the same.
    pub fn probe(&self, index: u64) -> Probe {
        (self.make)(&self.mesh, &mut Pcg32::new(index, 7))
    }
}

/// Where rounding hurts: Embree tolerates 2e-5 of lost rays here.
const FAR: [f32; 3] = [148_376.0, 1_234.0, -223_423.0];

pub(super) fn built_in() -> Vec<ProbeSet> {
    let far = |p: [f32; 3]| std::array::from_fn(|i| p[i] + FAR[i]);
    let set = |name, summary, mesh, make| ProbeSet {
        name,
        summary,
        mesh,
        make,
    };
    let stone = stone().mesh();
    let mut sets = vec![
        set(
            "sphere",
            "from inside a sphere of radius 2, in all directions",
            sphere(16).moved(|p| p.map(|c| 2.0 * c)).mesh(),
            from_inside,
        ),
        set(
            "far sphere",
            "the same, at (148376, 1234, -223423)",
            sphere(16).moved(|p| far(p.map(|c| 2.0 * c))).mesh(),
            from_inside,
        ),
        set(
            "sheet",
            "from above a sheet of 722 triangles, onto it",
            sheet(19).mesh(),
            from_above,
        ),
        set(
            "far sheet",
            "the same, at (148376, 1234, -223423)",
            sheet(19).moved(far).mesh(),
            from_above,
        ),
        set(
            "inside",
            "from inside a closed surface at its vertices, the middles of its edges and points of \
             its edges",
            stone.clone(),
            from_inside_at_edges,
        ),
        set("outside", "the same, from outside", stone, at_edges),
    ];
    sets.extend(of_mesh(&jumble().mesh()));
    sets
}

pub(super) fn of_mesh(mesh: &Mesh) -> Vec<ProbeSet> {
    type Aim = fn(&Mesh, &mut Pcg32) -> Probe;
    let kinds: [(_, _, Aim); 7] = [
        (
            "edges",
            "at vertices, the middles of edges and points of edges",
            at_edges,
        ),
        (
            "in planes",
            "in planes where trees split: through a vertex, across an axis or a triangle's normal",
            in_planes,
        ),
        (
            "off planes",
            "from such a plane in all directions",
            off_planes,
        ),
        (
            "grazing",
            "along a triangle, at an angle of 1e-8 to 1e-2",
            grazing,
        ),
        (
            "far origins",
            "from up to a million times the mesh's size away, at points of triangles",
            from_afar,
        ),
        (
            "zeros",
            "along an axis, with components that are 0, -0 or too small to be normal, by way of \
             vertices",
            along_axes,
        ),
        (
            "spawned",
            "from where another ray hit, as the renderer's rays leave a surface: not onto it again",
            spawned,
        ),
    ];
    kinds
        .into_iter()
        .map(|(name, summary, make)| ProbeSet {
            name,
            summary,
            mesh: mesh.clone(),
            make,
        })
        .collect()
}

fn add(a: [f32; 3], scale: f32, b: [f32; 3]) -> [f32; 3] {
    std::array::from_fn(|i| a[i] + scale * b[i])
}

fn between(a: [f32; 3], b: [f32; 3], t: f32) -> [f32; 3] {
    std::array::from_fn(|i| a[i] + t * (b[i] - a[i]))
}

fn cross(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

fn towards(origin: [f32; 3], target: [f32; 3]) -> Ray {
    Ray::new(origin, std::array::from_fn(|i| target[i] - origin[i]))
}

/// From -1 to 1.
fn signed(random: &mut Pcg32) -> f32 {
    2.0 * random.random::<f32>() - 1.0
}

fn in_cube(random: &mut Pcg32) -> [f32; 3] {
    std::array::from_fn(|_| signed(random))
}

/// A direction, of any length but 0.
fn direction(random: &mut Pcg32) -> [f32; 3] {
    loop {
        let d = in_cube(random);
        let length = d.iter().map(|c| c * c).sum::<f32>();
        if (1e-4..=1.0).contains(&length) {
            return d;
        }
    }
}

fn as_brute_force(ray: Ray) -> Probe {
    Probe {
        ray,
        expect: Expect::AsBruteForce,
    }
}

fn triangle(mesh: &Mesh, random: &mut Pcg32) -> Option<u32> {
    let usable = mesh.usable_triangles();
    let place = (u64::from(random.random::<u32>()) * usable.len() as u64) >> 32;
    usable.get(place as usize).copied()
}

/// The corners of some triangle, in some order; points where there is no triangle.
fn corners(mesh: &Mesh, random: &mut Pcg32) -> [[f32; 3]; 3] {
    let mut corners = triangle(mesh, random).map_or([[0.0; 3]; 3], |i| mesh.corners(i));
    corners.rotate_left(random.random::<u32>() as usize % 3);
    corners
}

/// A vertex, the middle of an edge, or a point of an edge.
fn on_edges(mesh: &Mesh, random: &mut Pcg32) -> [f32; 3] {
    let [a, b, _] = corners(mesh, random);
    match random.random::<u32>() % 3 {
        0 => a,
        1 => between(a, b, 0.5),
        _ => between(a, b, random.random()),
    }
}

/// A point within three times the mesh's size.
fn around(mesh: &Mesh, random: &mut Pcg32) -> [f32; 3] {
    let bounds = mesh.bounds();
    add(bounds.center(), 1.5 * bounds.diagonal(), in_cube(random))
}

fn from_inside(mesh: &Mesh, random: &mut Pcg32) -> Probe {
    // Within the half of the inner radius.
    let origin = add(
        mesh.bounds().center(),
        0.15 * mesh.bounds().diagonal(),
        direction(random),
    );
    Probe {
        ray: Ray::new(origin, direction(random)),
        expect: Expect::Hit,
    }
}

fn from_above(mesh: &Mesh, random: &mut Pcg32) -> Probe {
    let center = mesh.bounds().center();
    let [x, y, z] = in_cube(random);
    let target = add(center, 0.98, [x, y, 0.0]);
    let [x, y, _] = in_cube(random);
    let origin = add(center, 1.0, [x, y, 0.1 + z.abs()]);
    Probe {
        ray: towards(origin, target),
        expect: Expect::Hit,
    }
}

fn from_inside_at_edges(mesh: &Mesh, random: &mut Pcg32) -> Probe {
    let origin = in_cube(random).map(|c| 0.05 * c);
    Probe {
        ray: towards(origin, on_edges(mesh, random)),
        expect: Expect::Hit,
    }
}

fn at_edges(mesh: &Mesh, random: &mut Pcg32) -> Probe {
    let origin = around(mesh, random);
    as_brute_force(towards(origin, on_edges(mesh, random)))
}

/// Two directions that span a plane where a tree may split.
fn plane(mesh: &Mesh, random: &mut Pcg32) -> [[f32; 3]; 2] {
    let kind = random.random::<u32>() as usize % 6;
    if kind < 3 {
        let axis = |i: usize| std::array::from_fn(|j| if (i + kind) % 3 == j { 1.0 } else { 0.0 });
        [axis(1), axis(2)]
    } else {
        // In its own plane, as exactly as its vertices say.
        let [a, b, c] = corners(mesh, random);
        [
            std::array::from_fn(|i| b[i] - a[i]),
            std::array::from_fn(|i| c[i] - a[i]),
        ]
    }
}

fn in_planes(mesh: &Mesh, random: &mut Pcg32) -> Probe {
    let span = plane(mesh, random);
    let through = on_edges(mesh, random);
    let [a, b] = [signed(random), signed(random)];
    let along = add(span[0].map(|c| a * c), b, span[1]);
    let back = match random.random::<u32>() % 4 {
        0 => 0.0,
        _ => 3.0 * random.random::<f32>() * mesh.bounds().diagonal(),
    };
    let length = along.iter().map(|c| c * c).sum::<f32>().sqrt();
    as_brute_force(Ray::new(
        add(through, -back / length.max(1e-6), along),
        along,
    ))
}

fn off_planes(mesh: &Mesh, random: &mut Pcg32) -> Probe {
    let span = plane(mesh, random);
    let through = on_edges(mesh, random);
    let origin = add(
        add(through, signed(random), span[0]),
        signed(random),
        span[1],
    );
    as_brute_force(Ray::new(origin, direction(random)))
}

fn grazing(mesh: &Mesh, random: &mut Pcg32) -> Probe {
    let [a, b, c] = corners(mesh, random);
    let edge = |p: [f32; 3], q: [f32; 3]| -> [f32; 3] { std::array::from_fn(|i| q[i] - p[i]) };
    let normal = cross(edge(a, b), edge(a, c));
    let size = |v: [f32; 3]| v.iter().map(|c| c * c).sum::<f32>().sqrt();
    let target = between(between(a, b, random.random()), c, random.random());
    let along = add(
        edge(a, b).map(|x| signed(random) * x),
        signed(random),
        edge(a, c),
    );
    let tilt = 10f32.powf(-2.0 - 6.0 * random.random::<f32>()) * size(along)
        / size(normal).max(1e-20)
        * signed(random).signum();
    let along = add(along, tilt, normal);
    let back = 3.0 * random.random::<f32>();
    as_brute_force(Ray::new(add(target, -back, along), along))
}

fn from_afar(mesh: &Mesh, random: &mut Pcg32) -> Probe {
    let [a, b, c] = corners(mesh, random);
    let target = between(between(a, b, random.random()), c, random.random());
    let distance = mesh.bounds().diagonal() * 10f32.powf(6.0 * random.random::<f32>());
    let origin = add(target, distance, direction(random));
    as_brute_force(towards(origin, target))
}

fn along_axes(mesh: &Mesh, random: &mut Pcg32) -> Probe {
    let axis = random.random::<u32>() as usize % 3;
    let mut small = || match random.random::<u32>() % 6 {
        0 => 0.0,
        1 => -0.0,
        2 => 1e-40,
        3 => -1e-45,
        4 => 1e-30,
        _ => -1e-9,
    };
    let mut along: [f32; 3] = std::array::from_fn(|_| small());
    along[axis] = [1.0, -1.0, 1e-20, -3e20][random.random::<u32>() as usize % 4];
    let mut origin = on_edges(mesh, random);
    origin[axis] = around(mesh, random)[axis];
    as_brute_force(Ray::new(origin, along))
}

/// The first ray is cast at its triangle alone, so that its hit is there even where others cover
/// it.
fn spawned(mesh: &Mesh, random: &mut Pcg32) -> Probe {
    let Some(index) = triangle(mesh, random) else {
        return as_brute_force(Ray::new([0.0; 3], direction(random)));
    };
    let [a, b, c] = mesh.corners(index);
    let ray = |random: &mut Pcg32| {
        let target = between(between(a, b, random.random()), c, random.random());
        towards(around(mesh, random), target)
    };
    let Ok(alone) = Mesh::new(vec![a, b, c], vec![[0, 1, 2]]) else {
        return as_brute_force(ray(random));
    };
    // A ray may pass beside a triangle that is thinner than its rounding.
    for _ in 0..64 {
        if let Some(hit) = brute_force(&alone, &ray(random)) {
            return Probe {
                ray: leave(&alone, &hit, direction(random)),
                expect: Expect::NotOn(index),
            };
        }
    }
    as_brute_force(ray(random))
}
