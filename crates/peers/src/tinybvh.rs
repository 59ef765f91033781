//! tinybvh's eight-wide hierarchy for processors with AVX2. Its wrapper has no any-hit query, so
//! the closest hit answers those rays too.

use anyhow::Result;

use crate::contender::{Contender, Geometry};

/// Builds it.
#[cfg(all(feature = "tinybvh", target_feature = "avx2"))]
pub fn build(geometry: &Geometry<'_>) -> Result<Box<dyn Contender>> {
    with_avx2::build(geometry)
}

/// Says why there is none.
#[cfg(not(all(feature = "tinybvh", target_feature = "avx2")))]
pub fn build(_: &Geometry<'_>) -> Result<Box<dyn Contender>> {
    crate::contender::absent(
        "tinybvh",
        "build with RUSTFLAGS=-Ctarget-cpu=native and --features tinybvh, on a machine with AVX2 \
         and a C++20 compiler",
    )
}

#[cfg(all(feature = "tinybvh", target_feature = "avx2"))]
mod with_avx2 {
    use anyhow::{Result, anyhow};
    use splitplane::{Hit, Ray};
    use tinybvh_rs::{Intersector, Ray as TheirRay, bvh, bvh8_cpu, mbvh};

    use crate::contender::{Contender, Geometry, each};
    use crate::rays::Kind;

    struct Bvh8 {
        tree: bvh8_cpu::BVH,
        bytes: u64,
    }

    pub(super) fn build(geometry: &Geometry<'_>) -> Result<Box<dyn Contender>> {
        let corners = geometry.triangles.iter().map(|&t| geometry.corners(t));
        let positions: Vec<[f32; 4]> = corners.flatten().map(|[x, y, z]| [x, y, z, 0.0]).collect();
        let error = |error| anyhow!("tinybvh: {error}");
        let mut binary = bvh::BVH::new_hq(positions.as_slice().into()).map_err(error)?;
        binary.split_leaves(4);
        let wide = mbvh::BVH::new(&binary);
        let tree = bvh8_cpu::BVH::new(&wide).map_err(error)?;
        // The wrapper does not tell its size: 256 bytes a node, 160 for four triangles.
        let leaves = binary.nodes().iter().filter(|n| n.is_leaf()).count();
        let bytes = (wide.nodes().len() * 256 + leaves * 160) as u64;
        Ok(Box::new(Bvh8 { tree, bytes }))
    }

    impl Bvh8 {
        #[inline(always)]
        fn cast(&self, ray: &Ray) -> Option<Hit> {
            let mut theirs = TheirRay::new(ray.origin, ray.direction);
            let t_max = ray.t_max.min(tinybvh_rs::INFINITE);
            theirs.hit.t = t_max;
            self.tree.intersect(&mut theirs);
            let hit = theirs.hit;
            (hit.t < t_max).then_some(Hit {
                t: hit.t,
                u: hit.u,
                v: hit.v,
                triangle: hit.prim,
            })
        }
    }

    impl Contender for Bvh8 {
        fn closest(&self, _: Kind, rays: &[Ray], hits: &mut [Option<Hit>]) {
            each(rays, hits, |ray| self.cast(ray));
        }

        fn any(&self, _: Kind, rays: &[Ray], hits: &mut [bool]) {
            each(rays, hits, |ray| self.cast(ray).is_some());
        }

        fn bytes(&self) -> u64 {
            self.bytes
        }
    }
}
