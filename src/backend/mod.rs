//! The seam between "what is hit" and "what it looks like".

mod any;
#[cfg(feature = "embree")]
pub mod embree;
mod estimate;
mod exact;
pub mod native;

pub use any::{AnyBackend, BackendKind, BuildOptions, Error};
pub use estimate::Estimate;
pub use exact::{ExactBackend, ExactMaker};

use crate::geom::{Coherence, Hit, PacketBatch, Ray, RayHitPacket, RayPacket};

/// Answers visibility queries for one frozen scene.
///
/// Integrators are generic over it and compiled once per backend; which one runs is
/// chosen once per render, never per ray.
pub trait Backend: Sync {
    /// Nearest hit inside the ray's interval.
    fn intersect(&self, ray: &Ray) -> Option<Hit>;

    /// Whether anything is inside the ray's interval.
    fn occluded(&self, ray: &Ray) -> bool;

    /// Nearest hits of a whole batch. Each ray's `t_far` and the hit lanes take the answer.
    ///
    /// The hit lanes' ids need not be reset before.
    fn intersect_many(&self, rays: &mut PacketBatch<RayHitPacket>, _coherence: Coherence) {
        for (packet, live) in rays.packets_mut() {
            for lane in 0..live {
                let hit = self.intersect(&packet.ray.get(lane));
                packet.set_hit(lane, hit.as_ref());
            }
        }
    }

    /// Whether each ray of a batch meets anything; `t_far` becomes minus infinity where one does.
    fn occluded_many(&self, rays: &mut PacketBatch<RayPacket>, _coherence: Coherence) {
        for (packet, live) in rays.packets_mut() {
            for lane in 0..live {
                if self.occluded(&packet.get(lane)) {
                    packet.t_far[lane] = f32::NEG_INFINITY;
                }
            }
        }
    }
}
