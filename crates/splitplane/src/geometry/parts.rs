use std::ops::Range;

use super::{Mesh, MeshError};

/// Which triangles of a mesh that [`Mesh::join`] made are of which mesh.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Parts {
    /// Where the triangles of each mesh end.
    ends: Vec<u32>,
}

impl Parts {
    /// How many meshes there are.
    pub fn len(&self) -> usize {
        self.ends.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.ends.is_empty()
    }

    /// The mesh that a triangle is of, by its place among those that were joined, and the index
    /// that the triangle has in it.
    ///
    /// # Panics
    /// Where the joined mesh has no such triangle.
    #[inline]
    pub fn locate(&self, triangle: u32) -> (usize, u32) {
        let part = self.ends.partition_point(|&end| end <= triangle);
        assert!(part < self.ends.len(), "triangle {triangle} is of no mesh");
        (part, triangle - self.start(part))
    }

    /// The triangles of the joined mesh that are of a mesh, by its place among those that were
    /// joined.
    ///
    /// # Panics
    /// Where there is no such mesh.
    pub fn triangles(&self, part: usize) -> Range<u32> {
        self.start(part)..self.ends[part]
    }

    #[inline]
    fn start(&self, part: usize) -> u32 {
        if part == 0 { 0 } else { self.ends[part - 1] }
    }
}

impl Mesh {
    /// Several meshes as one, their triangles one behind the other. In one tree over all of them a
    /// ray goes through a single tree; in [`Instances`](crate::Instances), which can be placed
    /// several times, through that of each mesh that it comes near.
    ///
    /// Where the meshes have different [origins](Mesh::origin), that of the joined mesh is chosen
    /// as [`Mesh::from_f64`] does.
    ///
    /// ```
    /// # use splitplane::{Mesh, Ray, Tree};
    /// # let floor = Mesh::new(vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], vec![[0, 1, 2]])?;
    /// # let table = Mesh::new(vec![[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]], vec![[0, 1, 2]])?;
    /// let (mesh, parts) = Mesh::join([&floor, &table])?;
    /// let ray = Ray::new([0.2, 0.2, 3.0], [0.0, 0.0, -1.0]);
    /// let hit = Tree::new(&mesh)?.closest_hit(&ray, &mut ()).expect("the ray meets the table");
    /// assert_eq!((hit.triangle, parts.locate(hit.triangle)), (1, (1, 0)));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// More than [`Mesh::MAX_COUNT`] triangles or vertices in all.
    pub fn join<'m>(
        meshes: impl IntoIterator<Item = &'m Mesh>,
    ) -> Result<(Mesh, Parts), MeshError> {
        let meshes: Vec<&Mesh> = meshes.into_iter().collect();
        let vertices = meshes.iter().map(|mesh| mesh.positions().len()).sum();
        Mesh::check_count("vertices", vertices)?;
        let count = meshes.iter().map(|mesh| mesh.triangles().len()).sum();
        Mesh::check_count("triangles", count)?;

        let (mut triangles, mut ends) = (Vec::with_capacity(count), Vec::new());
        let mut shift = 0;
        for mesh in &meshes {
            let own = mesh.triangles().iter();
            triangles.extend(own.map(|triangle| triangle.map(|index| index + shift)));
            ends.push(triangles.len() as u32);
            shift += mesh.positions().len() as u32;
        }
        let joined = match meshes[..] {
            [mesh] => mesh.clone(),
            _ if meshes
                .windows(2)
                .all(|two| two[0].origin() == two[1].origin()) =>
            {
                let origin = meshes.first().map_or([0.0; 3], |mesh| mesh.origin());
                let positions = meshes.iter().flat_map(|mesh| mesh.positions());
                Mesh::at(origin, positions.copied().collect(), triangles)?
            }
            _ => {
                let positions: Vec<[f64; 3]> = (meshes.iter())
                    .flat_map(|mesh| mesh.positions().iter().map(|p| mesh.in_space(p)))
                    .collect();
                Mesh::from_f64(&positions, triangles)?
            }
        };
        Ok((joined, Parts { ends }))
    }

    fn in_space(&self, position: &[f32; 3]) -> [f64; 3] {
        let origin = self.origin();
        std::array::from_fn(|i| origin[i] + f64::from(position[i]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mesh(height: f64, triangles: usize) -> Mesh {
        let positions = [[0.0, 0.0, height], [1.0, 0.0, height], [0.0, 1.0, height]];
        Mesh::from_f64(&positions, vec![[0, 1, 2]; triangles]).unwrap()
    }

    #[test]
    fn each_triangle_of_a_joined_mesh_is_that_of_its_part() {
        let meshes = [mesh(1.0, 0), mesh(2.0, 3), mesh(3.0, 0), mesh(4.0, 2)];
        let (joined, parts) = Mesh::join(&meshes).unwrap();
        assert_eq!((parts.len(), joined.triangles().len()), (4, 5));
        let located: Vec<_> = (0..5).map(|i| parts.locate(i)).collect();
        assert_eq!(located, [(1, 0), (1, 1), (1, 2), (3, 0), (3, 1)]);
        for (triangle, &(part, own)) in (0..).zip(&located) {
            assert_eq!(joined.corners(triangle), meshes[part].corners(own));
            assert_eq!(parts.triangles(part).start + own, triangle);
        }
        assert_eq!(parts.triangles(0), 0..0);
        let (none, parts) = Mesh::join([]).unwrap();
        assert!(parts.is_empty() && none.triangles().is_empty());
    }

    #[test]
    fn meshes_of_different_origins_keep_their_places() {
        let meshes = [mesh(5_427_901.1, 1), mesh(5_427_902.3, 1), mesh(0.5, 1)];
        assert_ne!(meshes[0].origin(), meshes[1].origin());
        let (joined, _) = Mesh::join(&meshes).unwrap();
        for (triangle, height) in (0..).zip([5_427_901.1, 5_427_902.3, 0.5]) {
            let found = joined.in_space(&joined.corners(triangle)[0])[2];
            assert!((found - height).abs() < 5.5e6 * 2f64.powi(-24), "{found}");
        }
        // One mesh is itself.
        let (same, _) = Mesh::join(&meshes[..1]).unwrap();
        assert_eq!(same.origin(), meshes[0].origin());
    }
}
