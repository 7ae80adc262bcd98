//! Backends of either kind for rays in f64.

use super::{BackendKind, BuildOptions, Error, native};
use crate::geom::{Bounds, Hit64, Ray64};
use crate::scene::Scene;

#[cfg(feature = "embree")]
use crate::embree;

/// Makes backends of one kind, as many as there are scenes; with Embree they share a device.
#[derive(Clone, Debug)]
pub struct ExactMaker {
    kind: Kind,
}

#[derive(Clone, Debug)]
enum Kind {
    #[cfg(feature = "embree")]
    Embree(embree::Device),
    Native,
}

/// A scene's hierarchy, for rays in f64.
///
/// Native decides everything in f64. With Embree shapes see the f64 ray, and triangles are found by the ray rounded to
/// f32: who asks computes their `t` anew and says whether it counts.
#[derive(Debug)]
pub struct ExactBackend {
    tracer: Tracer,
    clip: Bounds,
    slack: f64,
    /// Embree may let a ray through exactly at a vertex.
    may_leak: bool,
}

#[derive(Debug)]
enum Tracer {
    #[cfg(feature = "embree")]
    Embree(embree::ExactScene),
    Native(native::Native),
}

impl ExactMaker {
    /// For backends of this kind; Embree builds with so many threads, 0 is all.
    ///
    /// # Errors
    /// [`Error::NotCompiledIn`], or Embree's own.
    pub fn new(kind: BackendKind, threads: usize) -> Result<Self, Error> {
        let kind = match kind {
            #[cfg(feature = "embree")]
            BackendKind::Embree => Kind::Embree(super::embree::device(threads, None)?),
            #[cfg(not(feature = "embree"))]
            BackendKind::Embree => return Err(Error::NotCompiledIn),
            BackendKind::Native => Kind::Native,
        };
        let _ = threads;
        Ok(Self { kind })
    }

    /// Builds the hierarchy of `scene`.
    ///
    /// # Errors
    /// See [`Error`].
    pub fn build(&self, scene: &Scene, options: &BuildOptions<'_>) -> Result<ExactBackend, Error> {
        /// Room around the scene, as a share of its size: more than the rounding of where a ray enters it.
        const ROOM: f64 = 1.0 / 64.0;
        /// The same for what the rounding of a ray to f32 moves its hits by, if it meets them at all steeply.
        const SLACK: f64 = 1.0 / (1 << 14) as f64;
        let bounds = scene.local_bounds();
        let room = (ROOM * bounds.size().max_element()).max(f64::from(f32::MIN_POSITIVE));
        let clip = Bounds { lo: bounds.lo - room, hi: bounds.hi + room };
        let reach = if bounds.is_empty() { 1.0 } else { clip.lo.abs().max(clip.hi.abs()).max_element() };
        let slack = SLACK * reach;
        let tracer = match &self.kind {
            #[cfg(feature = "embree")]
            Kind::Embree(device) => Tracer::Embree(super::embree::build_exact(scene, device, reach + slack, options)?),
            Kind::Native => {
                let quality = native::Quality::Good;
                let options =
                    native::BuildOptions { quality, cancel: options.cancel, memory_limit: options.memory_limit };
                Tracer::Native(native::Native::build(&scene.objects, &options)?)
            }
        };
        let may_leak = !matches!(self.kind, Kind::Native) && scene.objects.iter().any(|o| o.mesh().is_some());
        Ok(ExactBackend { tracer, clip, slack, may_leak })
    }
}

impl ExactBackend {
    /// A box with room to spare around all that can be hit, in scene space; empty when there is nothing.
    #[must_use]
    pub fn clip(&self) -> Bounds {
        self.clip
    }

    /// Distance from the exact ray, in scene units, at which a point of a triangle may still be what the rounded ray met.
    #[must_use]
    pub fn slack(&self) -> f64 {
        self.slack
    }

    /// The hits of `ray` one after the other, in about the order of `t`, each found when it is asked for.
    ///
    /// The ray must start inside [`clip`](Self::clip), and the largest component of its direction be in `[1, 2)`.
    pub fn hits_along(&self, ray: &Ray64) -> impl Iterator<Item = Hit64> {
        self.hits(ray, false)
    }

    /// The same when all that may count is what the rounded ray would have met but for gaps: no more than the rounding of
    /// the ray itself.
    #[must_use]
    pub fn slack_beside(&self) -> f64 {
        self.slack / 512.0
    }

    /// What a ray meets that passes a little beside `ray`, at up to 4e-7 of the scene's size; only where a ray that meets the
    /// very vertex of a mesh may slip through it.
    #[must_use]
    pub fn hits_beside(&self, ray: &Ray64) -> Option<impl Iterator<Item = Hit64>> {
        self.may_leak.then(|| self.hits(ray, true))
    }

    fn hits(&self, ray: &Ray64, aside: bool) -> Hits<'_> {
        match &self.tracer {
            #[cfg(feature = "embree")]
            Tracer::Embree(scene) => Hits::Embree(scene.hits_along(ray, self.slack, aside)),
            Tracer::Native(native) => {
                let _ = aside;
                Hits::Native(native, *ray)
            }
        }
    }
}

enum Hits<'a> {
    #[cfg(feature = "embree")]
    Embree(embree::HitsAlong<'a>),
    Native(&'a native::Native, Ray64),
}

impl Iterator for Hits<'_> {
    type Item = Hit64;

    fn next(&mut self) -> Option<Hit64> {
        match self {
            #[cfg(feature = "embree")]
            Self::Embree(hits) => hits.next(),
            Self::Native(native, ray) => {
                let hit = native.intersect_exact(ray)?;
                ray.t_near = hit.t;
                Some(hit)
            }
        }
    }
}
