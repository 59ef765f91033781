//! Where hits are looked up: the scene's own geometry, or an object's where it is placed.

use std::sync::Arc;

use glam::{DMat3, Vec3};
use splitplane::{Instances, Mesh, Tree};

use super::RenderError;
use crate::scene::{Object, Scene, Shape};
use crate::transform::Transform;

/// What the rays of a scene are cast against. Anything that this can be made of is taken by
/// [`super::render()`].
#[derive(Clone, Copy, Debug)]
pub enum SceneTree<'t> {
    /// A tree over the mesh of a scene without instances.
    Tree(&'t Tree),
    /// First the tree over the scene's mesh, where it is; then that of the object of each of
    /// [`Scene::instances`], in order.
    Instances(&'t Instances),
}

impl<'t> From<&'t Tree> for SceneTree<'t> {
    fn from(tree: &'t Tree) -> Self {
        SceneTree::Tree(tree)
    }
}

impl<'t> From<&'t Instances> for SceneTree<'t> {
    fn from(instances: &'t Instances) -> Self {
        SceneTree::Instances(instances)
    }
}

impl<'t> SceneTree<'t> {
    /// The tree over the scene's mesh.
    pub(super) fn own(self) -> &'t Tree {
        match self {
            SceneTree::Tree(tree) => tree,
            SceneTree::Instances(instances) => instances.tree(0),
        }
    }
}

/// Geometry with what belongs to it; see [`Scene`] and [`Object`].
#[derive(Clone, Debug)]
pub(super) struct Part<'s> {
    pub(super) mesh: &'s Mesh,
    pub(super) normals: &'s [[f32; 3]],
    pub(super) uvs: &'s [[f32; 2]],
    pub(super) colors: &'s [[f32; 3]],
    pub(super) shapes: &'s [Shape],
}

impl<'s> Part<'s> {
    /// The scene's own.
    pub(super) fn own(scene: &'s Scene) -> Part<'s> {
        Part {
            mesh: &scene.mesh,
            normals: &scene.normals,
            uvs: &scene.uvs,
            colors: &scene.colors,
            shapes: &scene.shapes,
        }
    }

    /// The scene's own, then the objects.
    pub(super) fn all(scene: &'s Scene) -> impl Iterator<Item = Part<'s>> {
        let object = |object: &'s Object| Part {
            mesh: &object.mesh,
            normals: &object.normals,
            uvs: &object.uvs,
            colors: &[],
            shapes: &object.shapes,
        };
        std::iter::once(Part::own(scene)).chain(scene.objects.iter().map(object))
    }
}

/// A part where it is.
#[derive(Clone, Copy, Debug)]
pub(super) struct InPlace<'s> {
    pub(super) part: &'s Part<'s>,
    /// `None`: in world space already.
    pub(super) to_world: Option<&'s Transform>,
}

impl InPlace<'_> {
    /// The vertices of a triangle in the world, and how far they and what is found by a ray in the
    /// part's own space may be off, over that by their own rounding.
    pub(super) fn corners(&self, triangle: u32) -> ([Vec3; 3], Vec3) {
        let own = self.part.mesh.corners(triangle);
        let Some(to_world) = self.to_world else {
            return (own.map(Vec3::from), Vec3::ZERO);
        };
        // A rounding in the part's space grows by the transform.
        let linear = DMat3::from_mat4(to_world.matrix()).as_mat3();
        let far = own
            .iter()
            .fold(Vec3::ZERO, |far, p| far.max(Vec3::from(*p).abs()));
        let grown = [linear.x_axis, linear.y_axis, linear.z_axis].map(Vec3::abs);
        let error = grown[0] * far.x + grown[1] * far.y + grown[2] * far.z;
        (own.map(|p| to_world.point(p).into()), error)
    }

    pub(super) fn normal(&self, vertex: usize) -> Vec3 {
        let own = self.part.normals[vertex];
        self.to_world
            .map_or(own, |to_world| to_world.normal(own))
            .into()
    }

    /// Whether geometric normals of a shape point the other way; see [`Shape::flip_normals`].
    pub(super) fn flips(&self, shape: &Shape) -> bool {
        shape.flip_normals != self.to_world.is_some_and(Transform::swaps_handedness)
    }
}

/// The trees of a scene with instances, placed: `own`, over [`Scene::mesh`], and one over the mesh of
/// each of [`Scene::objects`].
///
/// # Errors
/// There is no tree for an object, or it cannot be placed.
pub fn place(
    scene: &Scene,
    own: Arc<Tree>,
    objects: &[Arc<Tree>],
) -> Result<Instances, RenderError> {
    let mut placed = vec![(own, splitplane::Transform::IDENTITY)];
    for (number, instance) in scene.instances.iter().enumerate() {
        let wrong = |what: String| RenderError::Inconsistent(format!("instance {number} {what}"));
        let tree = objects.get(instance.object as usize);
        let tree = tree.ok_or_else(|| wrong("has an object without a tree".to_owned()))?;
        let m = instance.to_world.matrix();
        let rows = [0, 1, 2].map(|i| m.row(i).to_array());
        let transform = splitplane::Transform::from_rows(rows);
        let transform = transform.map_err(|error| wrong(format!("cannot be placed: {error}")))?;
        placed.push((Arc::clone(tree), transform));
    }
    Instances::new(placed).map_err(|error| RenderError::Inconsistent(error.to_string()))
}
