//! The pure-Rust tracer: a hierarchy of its own, and a triangle test that decides in f64.
//!
//! | part | job |
//! |---|---|
//! | `build`, `bins` | the hierarchy from the triangles, in parallel |
//! | `bvh` | the hierarchy in memory |
//! | `ray` | a ray prepared for boxes and triangles |
//! | `traverse` | the way of a ray through the hierarchy |
//! | `packet` | the same for sixteen coherent rays |
//!
//! What a ray meets is decided by [`triangle::intersect`](crate::geom::triangle::intersect)
//! alone. Boxes and the f32 filter before it only skip triangles that it would turn away,
//! with their own rounding accounted for, so that the answer is that of a loop over all
//! triangles: the least `t`, and among equal ones the lowest `(geom_id, prim_id)`. Only a
//! triangle that holds the ray in its plane to within f64's rounding may be passed over:
//! whether it is hit, and where, is rounding as well.

mod bins;
mod build;
mod bvh;
mod packet;
mod ray;
mod traverse;

use super::Backend;
use crate::geom::{Coherence, Hit, PacketBatch, Ray, RayHitPacket, RayPacket, TriangleMesh};
use bvh::{Bvh, MAX_TRIANGLES};
use core::fmt;
use packet::Packets;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use traverse::Found;

/// How much time the hierarchy is worth.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Quality {
    /// Boxes are split in the middle: about 0.6 times the time to build. Rays over an even
    /// mesh are as fast, over triangles of very different size they are slower.
    Fast,
    /// The surface-area heuristic throughout.
    #[default]
    Good,
}

/// How to build.
#[derive(Clone, Copy, Debug)]
pub struct BuildOptions<'a> {
    /// Build time against trace time. The answers are the same.
    pub quality: Quality,
    /// Once true, the build stops within milliseconds.
    pub cancel: &'a AtomicBool,
}

/// Why there is no hierarchy.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum BuildError {
    /// [`BuildOptions::cancel`] was set.
    #[error("building the hierarchy was cancelled")]
    Cancelled,
    /// More triangles than it can number.
    #[error("{count} triangles in one scene are more than the native backend can number ({MAX_TRIANGLES})")]
    TooManyTriangles {
        /// Faces of all meshes.
        count: usize,
    },
}

/// A frozen scene of triangle meshes, traced without Embree.
pub struct Native {
    bvh: Bvh,
    /// Number of the first face of each mesh: faces are counted through all meshes.
    first: Vec<u32>,
}

impl Native {
    /// Builds one hierarchy over all `meshes` on the current rayon pool.
    ///
    /// `geom_id` of a hit is the index in `meshes`, `prim_id` the face's. The corners are
    /// copied: the meshes are not kept. The tree is the same for any number of threads.
    ///
    /// # Errors
    /// If it was cancelled, or there are 2^29 triangles and more.
    pub fn build(meshes: &[Arc<TriangleMesh>], options: &BuildOptions<'_>) -> Result<Self, BuildError> {
        let count = meshes.iter().map(|m| m.face_count()).sum();
        if count > MAX_TRIANGLES {
            return Err(BuildError::TooManyTriangles { count });
        }
        let first: Vec<u32> = meshes
            .iter()
            .scan(0, |next, mesh| {
                let first = *next;
                *next += mesh.face_count() as u32;
                Some(first)
            })
            .collect();
        let bvh = build::build(meshes, &first, options)?;
        Ok(Self { bvh, first })
    }

    /// Bytes of the hierarchy with its copy of the triangles.
    #[must_use]
    pub fn bytes(&self) -> usize {
        size_of_val(&self.bvh.nodes[..]) + size_of_val(&self.bvh.blocks[..]) + size_of_val(&self.first[..])
    }
}

impl fmt::Debug for Native {
    /// Counts: the hierarchy itself would fill many screens.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (nodes, leaves) = (self.bvh.nodes.len(), self.bvh.blocks.len());
        f.debug_struct("Native")
            .field("meshes", &self.first.len())
            .field("nodes", &nodes)
            .field("leaves", &leaves)
            .field("depth", &self.bvh.depth)
            .finish()
    }
}

/// `(geom_id, prim_id)` of the face with number `id`.
fn owner(first: &[u32], id: u32) -> (u32, u32) {
    let geom = first.partition_point(|&f| f <= id) - 1;
    (geom as u32, id - first[geom])
}

impl Native {
    fn hit(&self, found: &Found) -> Hit {
        let (geom_id, prim_id) = owner(&self.first, found.id);
        Hit { t: found.t, u: found.u, v: found.v, ng: found.ng, prim_id, geom_id }
    }
}

impl Backend for Native {
    fn intersect(&self, ray: &Ray) -> Option<Hit> {
        self.bvh.nearest(ray).map(|found| self.hit(&found))
    }

    fn occluded(&self, ray: &Ray) -> bool {
        self.bvh.any(ray)
    }

    fn intersect_many(&self, rays: &mut PacketBatch<RayHitPacket>, coherence: Coherence) {
        let mut packets = Packets::new(&self.bvh);
        for (packet, live) in rays.packets_mut() {
            packets.trace::<false>(&packet.ray, live, coherence);
            for lane in 0..live {
                let hit = packets.found(lane).map(|found| self.hit(&found));
                packet.set_hit(lane, hit.as_ref());
            }
        }
    }

    fn occluded_many(&self, rays: &mut PacketBatch<RayPacket>, coherence: Coherence) {
        let mut packets = Packets::new(&self.bvh);
        for (packet, live) in rays.packets_mut() {
            packets.trace::<true>(packet, live, coherence);
            for lane in (0..live).filter(|&lane| packets.any(lane)) {
                packet.t_far[lane] = f32::NEG_INFINITY;
            }
        }
    }
}
