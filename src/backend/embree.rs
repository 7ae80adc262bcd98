//! The backend that asks Embree.

use super::{Backend, BuildOptions, Error};
use crate::embree::{self, Device, DeviceConfig, ExactBuilder, ExactScene, Quality, SceneBuilder, SceneOptions};
use crate::geom::{Coherence, Hit, PacketBatch, Ray, RayHitPacket, RayPacket, TriangleMesh};
use crate::scene::{Object, Scene};
use crate::with_shapes;
use std::collections::HashMap;
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
    /// Builds it: one geometry per object, buffers shared with the scene, ROBUST. A mesh that is placed many times
    /// gets one hierarchy of its own, which its instances share.
    ///
    /// # Errors
    /// See [`Error`].
    pub fn build(scene: &Scene, options: &BuildOptions<'_>) -> Result<Self, Error> {
        let device = device(options.threads, options.memory_limit)?;
        let mut build = Build::new(scene, &device, options);
        let quality = build.quality;
        let scene = build.scene(scene)?;
        Ok(Self { scene, device, quality })
    }

    /// The scene that answers, for who wants to ask it without the backend.
    #[must_use]
    pub fn scene(&self) -> &embree::Scene {
        &self.scene
    }

    /// Bytes that Embree holds.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        self.device.memory_live()
    }

    /// Whether it was built quickly rather than well.
    #[must_use]
    pub fn is_quick(&self) -> bool {
        matches!(self.quality, Quality::Low)
    }

    /// Most bytes that Embree held at once.
    #[must_use]
    pub fn peak_bytes(&self) -> u64 {
        self.device.memory_peak()
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

/// A device that builds with `threads` threads, 0 is all, and may hold so many bytes.
pub(super) fn device(threads: usize, memory_limit: Option<u64>) -> Result<Device, Error> {
    Ok(Device::new(&DeviceConfig { threads, memory_limit, ..DeviceConfig::default() })?)
}

/// The hierarchy of `scene` for rays in f64 that start within `reach` of the origin along each axis.
pub(super) fn build_exact(
    scene: &Scene,
    device: &Device,
    reach: f64,
    options: &BuildOptions<'_>,
) -> Result<ExactScene, Error> {
    let mut build = Build::new(scene, device, options);
    let mut builder = ExactBuilder::new(device, build.options(), reach)?;
    for object in &scene.objects {
        match object {
            Object::Mesh(mesh) => builder.mesh(Arc::clone(&mesh.data.triangles)),
            Object::Shapes(shapes) => with_shapes!(&shapes.set, set => builder.shapes(Arc::clone(set))),
            Object::Instance(i) => builder.instance(build.placed(&i.mesh.data.triangles)?, &i.to_scene),
        }?;
    }
    let left = build.total - build.done;
    build.committed(left, |progress| builder.commit(Some(progress)))
}

/// A build under way.
struct Build<'a> {
    device: &'a Device,
    quality: Quality,
    options: &'a BuildOptions<'a>,
    /// Primitives in the hierarchies that are finished.
    done: usize,
    /// Primitives in all of them.
    total: usize,
    /// The hierarchies of meshes that have instances.
    placed: HashMap<*const TriangleMesh, Arc<embree::Scene>>,
}

impl<'a> Build<'a> {
    fn new(scene: &Scene, device: &'a Device, options: &'a BuildOptions<'a>) -> Self {
        let quality = if options.prefers_quick_build(scene) { Quality::Low } else { Quality::Medium };
        Self { device, quality, options, done: 0, total: total(scene), placed: HashMap::new() }
    }

    /// Ids count up as geometries are added: an object's is its index.
    fn scene(&mut self, scene: &Scene) -> Result<embree::Scene, Error> {
        let mut builder = self.builder()?;
        for object in &scene.objects {
            match object {
                Object::Mesh(mesh) => builder.mesh(Arc::clone(&mesh.data.triangles)),
                Object::Shapes(shapes) => with_shapes!(&shapes.set, set => builder.shapes(Arc::clone(set))),
                Object::Instance(i) => builder.instance(self.placed(&i.mesh.data.triangles)?, &i.to_scene),
            }?;
        }
        self.commit(builder, self.total - self.done)
    }

    /// The hierarchy of a mesh in its own space.
    fn placed(&mut self, mesh: &Arc<TriangleMesh>) -> Result<Arc<embree::Scene>, Error> {
        if let Some(built) = self.placed.get(&Arc::as_ptr(mesh)) {
            return Ok(Arc::clone(built));
        }
        let mut builder = self.builder()?;
        builder.mesh(Arc::clone(mesh))?;
        let built = Arc::new(self.commit(builder, mesh.face_count())?);
        self.placed.insert(Arc::as_ptr(mesh), Arc::clone(&built));
        Ok(built)
    }

    fn options(&self) -> SceneOptions {
        SceneOptions { quality: self.quality, ..SceneOptions::default() }
    }

    fn builder(&self) -> Result<SceneBuilder, Error> {
        Ok(SceneBuilder::new(self.device, self.options())?)
    }

    /// Builds a hierarchy over `primitives`.
    fn commit(&mut self, builder: SceneBuilder, primitives: usize) -> Result<embree::Scene, Error> {
        self.committed(primitives, |progress| builder.commit(Some(progress)))
    }

    /// The same, as `commit` does it.
    fn committed<T>(
        &mut self,
        primitives: usize,
        commit: impl FnOnce(&(dyn Fn(f64) -> bool + Sync)) -> Result<T, embree::Error>,
    ) -> Result<T, Error> {
        let progress = |share: f64| {
            if let Some(tell) = self.options.progress {
                tell((self.done as f64 + share * primitives as f64) / self.total as f64);
            }
            !self.options.cancel.load(Relaxed)
        };
        let built = commit(&progress)?;
        self.done += primitives;
        Ok(built)
    }
}

/// Primitives in all hierarchies of `scene`, and never none.
fn total(scene: &Scene) -> usize {
    scene.stored_triangles() + scene.shapes() + scene.objects.len()
}

impl From<embree::Error> for Error {
    fn from(e: embree::Error) -> Self {
        match e {
            embree::Error::Cancelled => Self::Cancelled,
            other => Self::Embree(other),
        }
    }
}

/// A shape that panicked is missed by every later ray: no answer leaves here before it was asked whether one did.
impl Backend for EmbreeBackend {
    #[inline]
    fn intersect(&self, ray: &Ray) -> Option<Hit> {
        let hit = self.scene.intersect(ray);
        self.scene.resume_panics();
        hit
    }

    #[inline]
    fn occluded(&self, ray: &Ray) -> bool {
        let occluded = self.scene.occluded(ray);
        self.scene.resume_panics();
        occluded
    }

    #[inline]
    fn intersect_many(&self, rays: &mut PacketBatch<RayHitPacket>, coherence: Coherence) {
        self.scene.intersect_batch(rays, coherence);
        self.scene.resume_panics();
    }

    #[inline]
    fn occluded_many(&self, rays: &mut PacketBatch<RayPacket>, coherence: Coherence) {
        self.scene.occluded_batch(rays, coherence);
        self.scene.resume_panics();
    }
}
