//! From what the directives gave to the scene.

use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::DVec3;
use rayon::prelude::*;

use super::{Copied, Piece, World};
use crate::error::SceneError;
use crate::scene::geometry::{Geometry, LocalSurface, Placed, assemble};
use crate::scene::light::{Light, SphereMap};
use crate::scene::pbrt::shapes::Source;
use crate::scene::pbrt::source::Span;
use crate::scene::view::{self, Up};
use crate::scene::{Instance, Instancing, Object, Scene, ply};

impl World<'_> {
    /// The scene, after all directives.
    pub(super) fn finish(mut self, name: &str) -> Result<Scene, SceneError> {
        let Some(world) = self.world else {
            return Err(self.error(
                Span { file: 0, offset: 0 },
                "there is no WorldBegin; a scene has WorldBegin, shapes and lights, WorldEnd",
            ));
        };
        if let Some(block) = self.blocks.last() {
            return Err(self.not_closed(block));
        }
        if !self.ended && !self.parser.is_v4 && !self.parser.is_part {
            return Err(self.error(world, "this WorldBegin has no WorldEnd"));
        }
        let lists: Vec<Vec<Piece>> = std::iter::once(std::mem::take(&mut self.pieces))
            .chain(self.placed.iter().map(|pieces| pieces.to_vec()))
            .collect();
        let mut placed = self.placed(&lists)?;
        self.count_triangles(&lists, &placed);
        self.check_sphere_maps();
        // Only the placed pieces have the triangles now: a single one is not copied.
        drop(lists);
        self.objects.clear();
        self.placed.clear();
        let objects: Vec<Object> = placed
            .split_off(1)
            .into_iter()
            .map(|pieces| {
                let assembled = assemble(pieces).map_err(|message| self.error(world, message))?;
                Ok(Object {
                    mesh: assembled.mesh,
                    normals: assembled.normals,
                    uvs: assembled.uvs,
                    shapes: assembled.shapes,
                })
            })
            .collect::<Result<_, SceneError>>()?;
        let own = placed.pop().unwrap_or_default();
        let assembled = assemble(own).map_err(|message| self.error(world, message))?;
        let instances: Vec<Instance> = (self.copies.iter())
            .map(|&Copied { object, to_world }| Instance { object, to_world })
            .collect();
        if self.parser.is_part {
            let bounds = assembled.mesh.bounds();
            let (towards_eye, towards_sun) =
                (DVec3::new(0.62, 0.42, 0.8), DVec3::new(-0.3, 0.9, 0.6));
            let up = Up::guessed(Up::Y, &bounds);
            self.settings.camera =
                view::fitted(&bounds, assembled.mesh.positions(), towards_eye, up);
            self.lights = view::daylight(towards_sun);
        }
        Ok(Scene {
            name: name.to_owned(),
            mesh: assembled.mesh,
            normals: assembled.normals,
            uvs: assembled.uvs,
            colors: vec![],
            shapes: assembled.shapes,
            objects,
            instances,
            materials: self.materials,
            lights: self.lights,
            camera: self.settings.camera,
            film: self.settings.film,
            filter: self.settings.filter,
            sampler: self.settings.sampler,
            integrator: self.settings.integrator,
            accelerator: self.settings.accelerator,
            contents: self.contents,
            notes: self.notes.into_list(),
        })
    }

    /// A map of pbrt-v4 that is no square is one by longitude and latitude, of an older scene.
    fn check_sphere_maps(&mut self) {
        for &(light, span) in &self.sphere_maps {
            if let Light::Infinite { map, sphere, .. } | Light::Goniometric { map, sphere, .. } =
                &mut self.lights[light]
                && let Some((width, height)) = map.as_ref().map(|map| map.size())
                && width != height
            {
                *sphere = SphereMap::LongitudeLatitude;
                let sources = &self.parser.sources;
                self.notes.warn(
                    "a light's map that is no square",
                    || sources.place(span),
                    format!(
                        "the map of this light has {width} × {height} pixels; pbrt-v4 takes \
                         squares, so it is read by longitude and latitude, as in pbrt-v3"
                    ),
                );
            }
        }
    }

    /// Notes how many triangles there are, and that objects are copied or kept.
    fn count_triangles(&mut self, lists: &[Vec<Piece>], placed: &[Vec<Placed>]) {
        let of = |placed: &Placed| placed.geometry.triangles.len() as u64;
        let all = |list: &[Placed]| list.iter().map(of).sum::<u64>();
        let (own, objects) = (&placed[0], &placed[1..]);
        let mut seen = HashSet::new();
        let (mut unique, mut copied) = (0, 0);
        for (piece, placed) in lists[0].iter().zip(own) {
            let geometry = Arc::as_ptr(&placed.geometry);
            if piece.is_instance {
                copied += of(placed);
            }
            if !piece.is_instance || seen.insert((piece.span.file, piece.span.offset, geometry)) {
                unique += of(placed);
            }
        }
        unique += objects.iter().map(|object| all(object)).sum::<u64>();
        let kept = self.copies.iter();
        copied += kept
            .map(|copy| all(&objects[copy.object as usize]))
            .sum::<u64>();
        self.contents.unique_triangles = unique;
        self.contents.instanced_triangles = copied;
        if let Some((count, span)) = self.instances {
            self.contents.instances = count as u64;
            let what = match self.instancing {
                Instancing::Flattened => "copied into the mesh",
                Instancing::Kept => "kept, each object with a tree of its own",
            };
            self.notes.tell(
                self.parser.sources.place(span),
                format!("{count} object instances {what}: {copied} triangles (the first is here)"),
            );
        }
    }

    /// The pieces with their triangles, in order; every PLY file and every image is read once, many
    /// at a time.
    fn placed(&mut self, lists: &[Vec<Piece>]) -> Result<Vec<Vec<Placed>>, SceneError> {
        let mut files: Vec<(&PathBuf, Span)> = Vec::new();
        let mut numbers: HashMap<&PathBuf, usize> = HashMap::new();
        for piece in lists.iter().flatten() {
            if let Source::Ply { path } = &piece.source {
                numbers.entry(path).or_insert_with(|| {
                    files.push((path, piece.span));
                    files.len() - 1
                });
            }
        }
        let images = &self.images;
        // Images and meshes at the same time.
        let (unread, read): (_, Vec<Result<ply::PlyMesh, SceneError>>) = rayon::join(
            || images.read(),
            || files.par_iter().map(|(path, _)| ply::read(path)).collect(),
        );
        let missing: HashSet<&Path> = unread.iter().map(|(path, _)| *path).collect();
        self.contents.files = self.parser.found.take();
        self.contents.images = images
            .paths()
            .filter(|path| !missing.contains(path))
            .map(Path::to_owned)
            .collect();
        for (path, reason) in unread {
            let path = path.display().to_string();
            self.notes.warn(
                &format!("image {path}"),
                || path.clone(),
                format!("the image cannot be read ({reason}); rendered white, as pbrt-v3 does"),
            );
        }
        let mut geometries: Vec<Arc<Geometry>> = Vec::with_capacity(files.len());
        // In the order of the file: which error is told does not depend on the threads.
        for (mesh, (path, span)) in read.into_iter().zip(&files) {
            let place = || self.parser.sources.place(*span);
            let mesh = mesh.map_err(|error| SceneError {
                message: format!("{} (a mesh of {})", error.message, place()),
                ..error
            })?;
            self.notes
                .add(mesh.faces.notes(&path.display().to_string()));
            geometries.push(Arc::new(mesh.geometry));
        }
        let placed = |piece: &Piece| Placed {
            geometry: match &piece.source {
                Source::Ready(geometry, _) => Arc::clone(geometry),
                Source::Ply { path } => Arc::clone(&geometries[numbers[path]]),
            },
            to_world: piece.to_world,
            reversed: piece.reversed,
            material: piece.material,
            area_light: piece.area_light.clone(),
            surface: match piece.source {
                Source::Ready(_, surface) => surface,
                Source::Ply { .. } => LocalSurface::Flat,
            },
            alpha: piece.alpha.clone(),
            shadow_alpha: piece.shadow_alpha.clone(),
        };
        let list = |pieces: &Vec<Piece>| pieces.iter().map(placed).collect();
        Ok(lists.iter().map(list).collect())
    }
}
