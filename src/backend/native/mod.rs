//! The pure-Rust tracer: hierarchies of its own, a triangle test that decides in f64, and the
//! shared formulas of the shapes.
//!
//! | part | job |
//! |---|---|
//! | `build`, `bins` | a hierarchy from boxes, in parallel |
//! | `bvh` | a hierarchy in memory |
//! | `held` | the memory that building takes |
//! | `ray` | a ray prepared for boxes and triangles |
//! | `traverse` | the way of a ray through a hierarchy |
//! | `world` | the hierarchy of the scene; its shapes and placed meshes |
//! | `placed` | a mesh in a space of its own |
//! | `exact` | rays in f64 |
//! | `packet`, `beam`, `wide` | the same for sixteen coherent rays |
//!
//! What a ray meets is decided by [`triangle::intersect`](crate::geom::triangle::intersect) and
//! [`ShapeSet::hit`](crate::geom::ShapeSet::hit) alone, in f64, for a placed mesh with the ray in
//! the mesh's own space. Boxes and the f32 filter before triangles only skip what would be turned
//! away, with their own rounding accounted for, so that the answer is that of a loop over
//! everything: the least `t`, and among equal ones the lowest `(geom_id, prim_id)`. Passed over may
//! be only what f64 cannot decide: a triangle that holds the ray in its plane to within rounding
//! (whether it is hit, and where, is rounding as well), and a shape that the ray passes at less
//! than a millionth of its size.
//!
//! Of a shape only `t` is reported; [`ShapeSet::refine`](crate::geom::ShapeSet::refine) tells the
//! rest. The normal of a placed triangle is in scene space, as its moved corners are wound: under a
//! mirror it points to the side that the winding in the mesh's own space calls inner.

mod beam;
mod bins;
mod build;
mod bvh;
mod exact;
mod held;
mod packet;
mod placed;
mod ray;
mod traverse;
mod wide;
mod world;

use super::Backend;
use crate::geom::{Coherence, Hit, Hit64, PacketBatch, Ray, Ray64, RayHitPacket, RayPacket, ShapeError};
use crate::scene::Object;
use bvh::MAX_THINGS;
use core::fmt;
use packet::Packets;
use std::sync::atomic::AtomicBool;
use world::World;

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
    /// Bytes that the build may hold at once, the hierarchy included; `None` means no limit.
    pub memory_limit: Option<u64>,
}

/// Why there is no hierarchy.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum BuildError {
    /// [`BuildOptions::cancel`] was set.
    #[error("building the hierarchy was cancelled")]
    Cancelled,
    /// It would hold more than [`BuildOptions::memory_limit`] allows.
    #[error("the native hierarchy needs at least {needed} bytes while it is built, but may use only {limit}")]
    OverBudget {
        /// Bytes that would have been held at once when the limit stopped the build; it may need more.
        needed: u64,
        /// Bytes allowed.
        limit: u64,
    },
    /// More than it can number.
    #[error("{count} triangles and shapes in one scene are more than the native backend can number ({MAX_THINGS})")]
    TooMany {
        /// Faces of all meshes and shapes of all sets; a placed mesh counts as one.
        count: usize,
    },
    /// A mesh is placed where no ray can be taken back from.
    #[error("object {object} cannot be traced where it is placed")]
    Transform {
        /// Its index in the scene.
        object: usize,
        /// What is wrong with the transform.
        source: ShapeError,
    },
}

/// A frozen scene, traced without Embree.
pub struct Native {
    world: World,
    quality: Quality,
}

impl Native {
    /// Builds the hierarchies of all `objects` on the current rayon pool: one of the scene, one of
    /// each mesh that is placed.
    ///
    /// `geom_id` of a hit is the index in `objects`, `prim_id` the face's or the shape's. Corners
    /// are copied, sets of shapes are shared. The trees are the same for any number of threads.
    ///
    /// # Errors
    /// If it was cancelled or needs more memory than it may use, a placement cannot be undone, or there are 2^29 triangles and shapes
    /// and more.
    pub fn build(objects: &[Object], options: &BuildOptions<'_>) -> Result<Self, BuildError> {
        Ok(Self { world: World::build(objects, options)?, quality: options.quality })
    }

    /// Nearest hit of a ray in f64, inside its open interval; everything is decided in f64. A direction of zero length,
    /// a number that is not finite and an origin beyond f32 are misses.
    #[must_use]
    pub fn intersect_exact(&self, ray: &Ray64) -> Option<Hit64> {
        self.world.nearest_exact(ray)
    }

    /// How much time the hierarchies took.
    #[must_use]
    pub fn quality(&self) -> Quality {
        self.quality
    }

    /// Bytes of the hierarchies with their copies of the triangles.
    #[must_use]
    pub fn bytes(&self) -> usize {
        self.world.bytes()
    }

    /// Most bytes that were held at once while they were built.
    #[must_use]
    pub fn peak_bytes(&self) -> u64 {
        self.world.peak_bytes
    }
}

impl fmt::Debug for Native {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Native").field(&self.world).finish()
    }
}

impl Backend for Native {
    fn intersect(&self, ray: &Ray) -> Option<Hit> {
        self.world.nearest(ray)
    }

    fn occluded(&self, ray: &Ray) -> bool {
        self.world.any(ray)
    }

    fn intersect_many(&self, rays: &mut PacketBatch<RayHitPacket>, coherence: Coherence) {
        let mut packets = Packets::new(&self.world);
        for (packet, live) in rays.packets_mut() {
            packets.trace::<false>(&packet.ray, live, coherence);
            for lane in 0..live {
                packet.set_hit(lane, packets.hit(lane).as_ref());
            }
        }
    }

    fn occluded_many(&self, rays: &mut PacketBatch<RayPacket>, coherence: Coherence) {
        let mut packets = Packets::new(&self.world);
        for (packet, live) in rays.packets_mut() {
            packets.trace::<true>(packet, live, coherence);
            for lane in (0..live).filter(|&lane| packets.any(lane)) {
                packet.t_far[lane] = f32::NEG_INFINITY;
            }
        }
    }
}
