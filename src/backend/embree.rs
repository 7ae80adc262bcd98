//! The backend that asks Embree.

use super::{Backend, BuildOptions, Error};
use crate::embree::{self, Device, DeviceConfig, Quality, SceneBuilder, SceneOptions};
use crate::geom::{Coherence, Hit, PacketBatch, Ray, RayHitPacket, RayPacket};
use crate::scene::Scene;
use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;

/// Embree's hierarchy over a scene.
#[derive(Debug)]
pub struct EmbreeBackend {
    scene: embree::Scene,
    device: Device,
    quality: Quality,
}

impl EmbreeBackend {
    /// Builds it: one geometry per object, buffers shared with the scene, ROBUST.
    ///
    /// # Errors
    /// See [`Error`].
    pub fn build(scene: &Scene, options: &BuildOptions<'_>) -> Result<Self, Error> {
        let device = Device::new(&DeviceConfig { threads: options.threads, ..DeviceConfig::default() })?;
        let quality = if options.prefers_quick_build(scene) { Quality::Low } else { Quality::Medium };
        let mut builder = SceneBuilder::new(&device, SceneOptions { quality, ..SceneOptions::default() })?;
        for mesh in scene.objects.iter().filter_map(|o| o.mesh()) {
            builder.mesh(Arc::clone(&mesh.data.triangles))?;
        }
        let progress = |share: f64| {
            if let Some(tell) = options.progress {
                tell(share);
            }
            !options.cancel.load(Relaxed)
        };
        let scene = builder.commit(Some(&progress))?;
        Ok(Self { scene, device, quality })
    }

    /// Bytes that Embree holds.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        self.device.memory_live()
    }

    /// Release, packet width, build quality.
    #[must_use]
    pub fn details(&self) -> String {
        let quality = match self.quality {
            Quality::Low => "low",
            Quality::Medium => "medium",
            Quality::High => "high",
        };
        let (version, width) = (self.device.version(), self.device.packet_width());
        format!("{version}, packets of {width}, {quality} build quality")
    }
}

impl From<embree::Error> for Error {
    fn from(e: embree::Error) -> Self {
        match e {
            embree::Error::Cancelled => Self::Cancelled,
            other => Self::Embree(other),
        }
    }
}

impl Backend for EmbreeBackend {
    #[inline]
    fn intersect(&self, ray: &Ray) -> Option<Hit> {
        self.scene.intersect(ray)
    }

    #[inline]
    fn occluded(&self, ray: &Ray) -> bool {
        self.scene.occluded(ray)
    }

    #[inline]
    fn intersect_many(&self, rays: &mut PacketBatch<RayHitPacket>, coherence: Coherence) {
        self.scene.intersect_batch(rays, coherence);
    }

    #[inline]
    fn occluded_many(&self, rays: &mut PacketBatch<RayPacket>, coherence: Coherence) {
        self.scene.occluded_batch(rays, coherence);
    }
}
