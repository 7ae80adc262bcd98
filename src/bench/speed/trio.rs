//! The three that answer.

use super::Error;
use super::subject::Sight;
use crate::backend::{AnyBackend, Backend, BackendKind};
use crate::bench::setup;
use crate::geom::{Coherence, PacketBatch, Ray, RayHitPacket, RayPacket};
use rayon::ThreadPool;
use std::time::Instant;

#[cfg(feature = "embree")]
use crate::embree::{self, Bare, Device, DeviceConfig, SceneBuilder, SceneOptions};

/// Who answers batches. Called once for many rays: which one it is costs nothing.
pub(super) trait Asked: Sync {
    fn nearest(&self, batch: &mut PacketBatch<RayHitPacket>);
    fn any(&self, batch: &mut PacketBatch<RayPacket>);
    /// The sum of all `t`, asked one by one.
    fn singly(&self, rays: &[Ray]) -> f32;
}

/// Through the seam, as a render asks.
struct Through<'a, B>(&'a B);

impl<B: Backend> Asked for Through<'_, B> {
    fn nearest(&self, batch: &mut PacketBatch<RayHitPacket>) {
        self.0.intersect_many(batch, Coherence::Coherent);
    }

    fn any(&self, batch: &mut PacketBatch<RayPacket>) {
        self.0.occluded_many(batch, Coherence::Coherent);
    }

    fn singly(&self, rays: &[Ray]) -> f32 {
        rays.iter().filter_map(|ray| Some(self.0.intersect(ray)?.t)).sum()
    }
}

#[cfg(feature = "embree")]
impl Asked for Bare<'_> {
    fn nearest(&self, batch: &mut PacketBatch<RayHitPacket>) {
        self.intersect_batch(batch);
    }

    fn any(&self, batch: &mut PacketBatch<RayPacket>) {
        self.occluded_batch(batch);
    }

    fn singly(&self, rays: &[Ray]) -> f32 {
        rays.iter().filter_map(|ray| Some(self.intersect(ray)?.t)).sum()
    }
}

/// The native tracer, Embree, and what the bare loop asks if that is another scene.
pub(super) struct Trio {
    pub(super) native: AnyBackend,
    pub(super) embree: Option<AnyBackend>,
    #[cfg(feature = "embree")]
    own: Option<embree::Scene>,
}

impl Trio {
    /// Builds them on `pool`, and the seconds of each: where the bare loop asks what Embree asks, there is nothing to
    /// build for it.
    pub(super) fn build(sight: &Sight, pool: &ThreadPool) -> Result<(Self, [Option<f64>; 3]), Error> {
        let build = |kind| -> Result<(AnyBackend, f64), Error> {
            let (built, seconds) = timed(pool, || setup::build_on(kind, &sight.scene, pool.current_num_threads()));
            Ok((built?, seconds))
        };
        let (native, native_seconds) = build(BackendKind::Native)?;
        #[cfg(feature = "embree")]
        {
            let (embree, embree_seconds) = build(BackendKind::Embree)?;
            let (own, own_seconds) = if sight.spheres.is_empty() {
                (None, None)
            } else {
                let (built, seconds) = timed(pool, || own_spheres(&sight.spheres, pool.current_num_threads()));
                (Some(built.map_err(|e| Error::Build(e.into()))?), Some(seconds))
            };
            let trio = Self { native, embree: Some(embree), own };
            Ok((trio, [Some(native_seconds), Some(embree_seconds), own_seconds]))
        }
        #[cfg(not(feature = "embree"))]
        Ok((Self { native, embree: None }, [Some(native_seconds), None, None]))
    }

    /// Native, Embree, bare Embree.
    pub(super) fn asked(&self) -> [Option<Box<dyn Asked + '_>>; 3] {
        fn through(backend: &AnyBackend) -> Box<dyn Asked + '_> {
            match backend {
                #[cfg(feature = "embree")]
                AnyBackend::Embree(b) => Box::new(Through(b)),
                AnyBackend::Native(b) => Box::new(Through(b)),
            }
        }
        [Some(through(&self.native)), self.embree.as_ref().map(through), self.bare()]
    }

    #[cfg(feature = "embree")]
    pub(super) fn bare(&self) -> Option<Box<dyn Asked + '_>> {
        let scene = match (&self.own, &self.embree) {
            (Some(own), _) => own,
            (None, Some(AnyBackend::Embree(embree))) => embree.scene(),
            _ => return None,
        };
        Some(Box::new(scene.bare()))
    }

    #[cfg(not(feature = "embree"))]
    pub(super) fn bare(&self) -> Option<Box<dyn Asked + '_>> {
        None
    }
}

/// Embree's own spheres.
#[cfg(feature = "embree")]
fn own_spheres(spheres: &[[f32; 4]], threads: usize) -> Result<embree::Scene, embree::Error> {
    let device = Device::new(&DeviceConfig { threads, ..DeviceConfig::default() })?;
    let mut builder = SceneBuilder::new(&device, SceneOptions::default())?;
    builder.own_spheres(spheres)?;
    builder.commit(None)
}

/// What `f` answers on `pool`, and the seconds it takes.
pub(super) fn timed<R: Send>(pool: &ThreadPool, f: impl FnOnce() -> R + Send) -> (R, f64) {
    pool.install(|| {
        let start = Instant::now();
        let answer = f();
        (answer, start.elapsed().as_secs_f64())
    })
}
