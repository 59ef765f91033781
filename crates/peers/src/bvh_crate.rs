//! The crate bvh. It gives the triangles whose boxes a ray meets; the test of the triangle and the
//! choice of the nearest are its user's.

use bvh::aabb::{Aabb, Bounded};
use bvh::bounding_hierarchy::BHShape;
use bvh::bvh::{Bvh, BvhNode};
use bvh::ray::Ray as TheirRay;
use nalgebra::{Point3, Vector3};
use splitplane::{Hit, Ray};

use crate::contender::{Contender, Geometry, Work, each, hit};
use crate::rays::Kind;

struct Shape {
    corners: [Point3<f32>; 3],
    triangle: u32,
    node: usize,
}

impl Bounded<f32, 3> for Shape {
    fn aabb(&self) -> Aabb<f32, 3> {
        let [a, b, c] = self.corners;
        Aabb::with_bounds(a.inf(&b).inf(&c), a.sup(&b).sup(&c))
    }
}

impl BHShape<f32, 3> for Shape {
    fn set_bh_node_index(&mut self, index: usize) {
        self.node = index;
    }
    fn bh_node_index(&self) -> usize {
        self.node
    }
}

impl Shape {
    /// t of the hit [Möller and Trumbore 1997]: the crate's own test sees front faces only.
    #[inline(always)]
    fn test(&self, ray: &TheirRay<f32, 3>) -> Option<f32> {
        let [a, b, c] = &self.corners;
        let (e1, e2) = (b - a, c - a);
        let p = ray.direction.cross(&e2);
        let inverse = 1.0 / e1.dot(&p);
        let s = ray.origin - a;
        let u = s.dot(&p) * inverse;
        if !(0.0..=1.0).contains(&u) {
            return None;
        }
        let q = s.cross(&e1);
        let v = ray.direction.dot(&q) * inverse;
        (v >= 0.0 && u + v <= 1.0).then(|| e2.dot(&q) * inverse)
    }
}

/// A hierarchy and its triangles.
pub struct Candidates {
    tree: Bvh<f32, 3>,
    shapes: Vec<Shape>,
}

impl Candidates {
    /// Builds it.
    pub fn build(geometry: &Geometry<'_>) -> Self {
        let mut shapes: Vec<Shape> = geometry
            .triangles
            .iter()
            .zip(0..)
            .map(|(&indices, triangle)| Shape {
                corners: geometry.corners(indices).map(Point3::from),
                triangle,
                node: 0,
            })
            .collect();
        Candidates {
            tree: Bvh::build(&mut shapes),
            shapes,
        }
    }

    /// The candidates come in no order that would allow to stop early, or at the price of a heap
    /// that costs more than it saves.
    #[inline(always)]
    fn closest_of(&self, ray: &Ray, tests: &mut u64) -> Option<Hit> {
        let theirs = theirs(ray);
        let mut best = None;
        let mut t_max = ray.t_max;
        for shape in self.tree.traverse_iterator(&theirs, &self.shapes) {
            *tests += 1;
            if let Some(t) = shape.test(&theirs)
                && t > ray.t_min
                && t < t_max
            {
                t_max = t;
                best = Some(hit(t, shape.triangle));
            }
        }
        best
    }

    #[inline(always)]
    fn any_of(&self, ray: &Ray, tests: &mut u64) -> bool {
        let theirs = theirs(ray);
        self.tree
            .traverse_iterator(&theirs, &self.shapes)
            .any(|shape| {
                *tests += 1;
                let t = shape.test(&theirs);
                t.is_some_and(|t| t > ray.t_min && t <= ray.t_max)
            })
    }
}

#[inline(always)]
fn theirs(ray: &Ray) -> TheirRay<f32, 3> {
    TheirRay::new(Point3::from(ray.origin), Vector3::from(ray.direction))
}

impl Contender for Candidates {
    fn closest(&self, _: Kind, rays: &[Ray], hits: &mut [Option<Hit>]) {
        each(rays, hits, |ray| self.closest_of(ray, &mut 0));
    }

    fn any(&self, _: Kind, rays: &[Ray], hits: &mut [bool]) {
        each(rays, hits, |ray| self.any_of(ray, &mut 0));
    }

    fn bytes(&self) -> u64 {
        (self.tree.nodes.len() * size_of::<BvhNode<f32, 3>>() + size_of_val(self.shapes.as_slice()))
            as u64
    }

    fn work(&self, kind: Kind, rays: &[Ray]) -> Work {
        let mut tests = 0;
        for ray in rays {
            if kind.any_hit() {
                self.any_of(ray, &mut tests);
            } else {
                self.closest_of(ray, &mut tests);
            }
        }
        Work {
            tests: Some(tests),
            ..Work::default()
        }
    }
}
