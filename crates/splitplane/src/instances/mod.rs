//! Trees that are placed in space, several times if need be: the second level.

mod search;
mod transform;

use std::cell::RefCell;
use std::sync::Arc;

pub use transform::{Transform, TransformError};

use crate::build::{BuildError, BuildParams};
use crate::catalog::TreeChoice;
use crate::geometry::{Aabb, Mesh, MeshError, Ray};
use crate::query::{self, Counters, Hit, Place, Traversal};
use crate::tree::Tree;
use search::{All, Any, Closest, Upper};

/// Trees, each placed in space by a [`Transform`]; one may be placed many times.
///
/// ```
/// use std::sync::Arc;
/// use splitplane::{Instances, Mesh, Ray, Transform, Tree};
///
/// let positions = vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
/// let tree = Arc::new(Tree::new(&Mesh::new(positions, vec![[0, 1, 2]])?)?);
/// let row = (0..10).map(|i| (tree.clone(), Transform::translation([f64::from(i), 0.0, 0.0])));
/// let instances = Instances::new(row)?;
/// let found = instances.closest_hit(&Ray::new([7.25, 0.25, 1.0], [0.0, 0.0, -1.0]), &mut ());
/// let found = found.expect("the ray meets the eighth");
/// assert_eq!((found.instance, found.hit.triangle, found.hit.t), (7, 0, 1.0));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// A ray is brought into the space of an instance in f64 and rounded once to f32; `t` is the same
/// in both. The hits are those that this ray has there, bit for bit: asking every instance gives
/// the same. The identity changes no ray.
#[derive(Clone, Debug)]
pub struct Instances {
    placed: Vec<Placed>,
    /// A hierarchy over the boxes of the instances: over a mesh with a triangle in each box.
    upper: Tree,
    /// How far from the ray's point in space an instance may be hit: this, and `slope` times the
    /// largest coordinate of the ray's origin.
    base: f64,
    slope: f64,
}

#[derive(Clone, Debug)]
struct Placed {
    tree: Arc<Tree>,
    transform: Transform,
}

/// Where a ray meets an instance.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct InstanceHit {
    /// The hit; its triangle is one of the instance's mesh.
    pub hit: Hit,
    /// Index of the instance.
    pub instance: u32,
}

/// Why instances could not be placed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum InstancesError {
    /// An instance lies where no mesh may lie.
    #[error("instance {instance} reaches beyond ±1e18 in space")]
    OutOfReach {
        /// The instance's index.
        instance: usize,
    },
    /// More instances than can be indexed.
    #[error(transparent)]
    TooMany(#[from] MeshError),
    /// More instances than the hierarchy over them can address.
    #[error(transparent)]
    Build(#[from] BuildError),
}

/// What the test of a triangle may be off by, and what the ray's rounding adds: 11 units for the
/// test, of distances that are at most √3 · 2 times the sum below; one for the ray's origin and
/// one for its direction. The rest is reserve.
const ERROR: f64 = 64.0 * 0.5 * f32::EPSILON as f64;

impl Instances {
    /// The trees of `placed`, each where its transform brings it; the first is instance 0.
    ///
    /// # Errors
    /// An instance beyond ±1e18, or too many.
    pub fn new(
        placed: impl IntoIterator<Item = (Arc<Tree>, Transform)>,
    ) -> Result<Self, InstancesError> {
        let placed: Vec<Placed> = (placed.into_iter())
            .map(|(tree, transform)| Placed { tree, transform })
            .collect();
        let (mut positions, mut triangles) = (Vec::new(), Vec::new());
        let (mut base, mut slope) = (0.0f64, 0.0f64);
        for (instance, Placed { tree, transform }) in placed.iter().enumerate() {
            let bounds = tree.bounds();
            let own = transform.bounds(&bounds);
            if !bounds.is_empty() && own.reach() > Mesh::MAX_COORDINATE {
                return Err(InstancesError::OutOfReach { instance });
            }
            // With corners at both ends of the box, it is the box of the triangle.
            let Aabb { min, max } = own;
            let start = positions.len() as u32;
            positions.extend([min, max, [max[0], max[1], min[2]]]);
            triangles.push([start, start + 1, start + 2]);
            // An error of the ray in the instance's space grows by the stretch of the transform
            // on its way back.
            let stretch = transform.stretch();
            let distortion = stretch * transform.inverse_stretch();
            base = base.max(
                ERROR * (distortion * transform.offset() + stretch * f64::from(bounds.reach())),
            );
            slope = slope.max(ERROR * distortion);
        }
        let boxes = Mesh::new(positions, triangles)?;
        let choice: TreeChoice = "bvh".parse().expect("there is such a tree");
        let upper = Tree::build(&boxes, choice, &BuildParams::default())?;
        Ok(Instances {
            placed,
            upper,
            base,
            slope,
        })
    }

    /// How many instances there are.
    pub fn len(&self) -> usize {
        self.placed.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.placed.is_empty()
    }

    /// The tree of an instance.
    ///
    /// # Panics
    /// Where there is no such instance.
    pub fn tree(&self, instance: u32) -> &Arc<Tree> {
        &self.placed[instance as usize].tree
    }

    /// Where an instance is.
    ///
    /// # Panics
    /// Where there is no such instance.
    pub fn transform(&self, instance: u32) -> &Transform {
        &self.placed[instance as usize].transform
    }

    /// The box in space that all instances lie in; a little larger than the smallest.
    pub fn bounds(&self) -> Aabb {
        self.upper.bounds()
    }

    /// The ray as an instance sees it: what its tree is asked.
    ///
    /// # Panics
    /// Where there is no such instance.
    pub fn local_ray(&self, instance: u32, ray: &Ray) -> Ray {
        self.transform(instance).local_ray(ray)
    }

    /// The unit normal in space of the triangle that was hit, by the right-hand rule of its
    /// vertices in space; zero for a triangle without area.
    ///
    /// # Panics
    /// Where there is no such instance or triangle.
    pub fn normal(&self, found: &InstanceHit) -> [f32; 3] {
        let Placed { tree, transform } = &self.placed[found.instance as usize];
        transform.normal(tree.mesh().normal(found.hit.triangle))
    }

    /// The nearest hit with `t_min < t <= t_max`; of hits at the same `t`, that of the first
    /// instance, and in it of the lowest triangle. Visits of the hierarchy over the instances
    /// count as visits of axis-aligned nodes.
    pub fn closest_hit(&self, ray: &Ray, counters: &mut impl Counters) -> Option<InstanceHit> {
        self.closest_hit_where(ray, |_| true, counters)
    }

    /// The nearest hit that `accept` takes; see [`Tree::closest_hit_where`].
    pub fn closest_hit_where(
        &self,
        ray: &Ray,
        accept: impl Fn(&InstanceHit) -> bool,
        counters: &mut impl Counters,
    ) -> Option<InstanceHit> {
        let counters = RefCell::new(counters);
        let mut search = Closest {
            placed: &self.placed,
            ray: *ray,
            accept,
            best: None,
            counters: &counters,
        };
        query::run_in(
            &self.upper,
            &self.place(ray),
            ray,
            &mut search,
            &mut Upper(&counters),
        );
        search.best
    }

    /// Whether anything is hit with `t_min < t <= t_max`.
    pub fn any_hit(&self, ray: &Ray, counters: &mut impl Counters) -> bool {
        self.any_hit_where(ray, |_| true, counters)
    }

    /// Whether anything is hit that `accept` takes; see [`Tree::closest_hit_where`].
    pub fn any_hit_where(
        &self,
        ray: &Ray,
        accept: impl Fn(&InstanceHit) -> bool,
        counters: &mut impl Counters,
    ) -> bool {
        let counters = RefCell::new(counters);
        let mut search = Any {
            placed: &self.placed,
            ray,
            accept,
            found: false,
            counters: &counters,
        };
        query::run_in(
            &self.upper,
            &self.place(ray),
            ray,
            &mut search,
            &mut Upper(&counters),
        );
        search.found
    }

    /// All hits with `t_min < t <= t_max`, by `t`, then by instance, then by triangle. `hits` is
    /// emptied first. See [`Tree::all_hits`].
    pub fn all_hits(&self, ray: &Ray, hits: &mut Vec<InstanceHit>, counters: &mut impl Counters) {
        self.all_hits_where(ray, |_| true, hits, counters);
    }

    /// All hits that `accept` takes; see [`Tree::closest_hit_where`].
    pub fn all_hits_where(
        &self,
        ray: &Ray,
        accept: impl Fn(&InstanceHit) -> bool,
        hits: &mut Vec<InstanceHit>,
        counters: &mut impl Counters,
    ) {
        hits.clear();
        let counters = RefCell::new(counters);
        let mut search = All {
            placed: &self.placed,
            ray,
            accept,
            hits,
            own: Vec::new(),
            counters: &counters,
        };
        query::run_in(
            &self.upper,
            &self.place(ray),
            ray,
            &mut search,
            &mut Upper(&counters),
        );
        // Within an instance they are in order already, and its hits came together.
        hits.sort_by(|a, b| {
            let key = |found: &InstanceHit| found.hit.t + 0.0;
            (key(a).total_cmp(&key(b))).then(a.instance.cmp(&b.instance))
        });
    }

    /// What decides where the hierarchy over the boxes looks for this ray.
    fn place(&self, ray: &Ray) -> Place {
        let far = ray.origin.iter().fold(0.0f32, |far, c| far.max(c.abs()));
        Place {
            overhang: self.base + self.slope * f64::from(far),
            traversal: Traversal::Exact,
            ..*self.upper.place()
        }
    }
}

#[cfg(test)]
mod tests;
