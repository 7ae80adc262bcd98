//! Which backend answers, chosen once per render.

use super::{Backend, native};
use crate::scene::Scene;
use std::sync::atomic::AtomicBool;

#[cfg(feature = "embree")]
use super::embree::EmbreeBackend;

/// The backends there are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BackendKind {
    /// The C library.
    Embree,
    /// Pure Rust.
    Native,
}

impl BackendKind {
    /// The ones in this binary, the default first.
    pub const COMPILED: &'static [Self] =
        if cfg!(feature = "embree") { &[Self::Embree, Self::Native] } else { &[Self::Native] };

    /// Name on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Embree => "embree",
            Self::Native => "native",
        }
    }
}

/// How to build a hierarchy.
#[derive(Clone, Copy)]
pub struct BuildOptions<'a> {
    /// Threads to build with; 0 is all.
    pub threads: usize,
    /// Rays the render is going to send: few of them do not pay for a good hierarchy.
    pub rays_expected: u64,
    /// Bytes that the build may hold at once, the hierarchy included and the scene not; `None` means no limit.
    pub memory_limit: Option<u64>,
    /// Set by another thread to give up.
    pub cancel: &'a AtomicBool,
    /// Told the share that is done, from any thread.
    pub progress: Option<&'a (dyn Fn(f64) + Sync)>,
}

impl std::fmt::Debug for BuildOptions<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("BuildOptions")
            .field("threads", &self.threads)
            .field("rays_expected", &self.rays_expected)
            .finish_non_exhaustive()
    }
}

/// Rays per primitive below which a quick, worse hierarchy wins as a whole: it saves 0.14 s
/// of building per million triangles and costs 0.02 s per million packet rays.
const RAYS_PER_PRIMITIVE_WORTH_A_GOOD_BUILD: u64 = 10;

impl<'a> BuildOptions<'a> {
    /// A good hierarchy, built on all threads, in whatever memory it takes.
    #[must_use]
    pub fn new(cancel: &'a AtomicBool) -> Self {
        Self { threads: 0, rays_expected: u64::MAX, memory_limit: None, cancel, progress: None }
    }

    /// Whether a quick hierarchy is the better deal for this scene.
    #[must_use]
    pub fn prefers_quick_build(&self, scene: &Scene) -> bool {
        let primitives = (scene.stored_triangles() + scene.shapes()) as u64;
        self.rays_expected < RAYS_PER_PRIMITIVE_WORTH_A_GOOD_BUILD.saturating_mul(primitives)
    }
}

/// Why a backend could not be had.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// Somebody asked to stop.
    #[error("the build was cancelled")]
    Cancelled,
    /// This binary was built without Embree.
    #[error("this tison was built without Embree; use --backend native, or build with the feature 'embree'")]
    NotCompiledIn,
    /// Embree's own.
    #[cfg(feature = "embree")]
    #[error(transparent)]
    Embree(crate::embree::Error),
    /// The native tracer's own.
    #[error(transparent)]
    Native(native::BuildError),
}

impl From<native::BuildError> for Error {
    fn from(e: native::BuildError) -> Self {
        match e {
            native::BuildError::Cancelled => Self::Cancelled,
            other => Self::Native(other),
        }
    }
}

/// A backend of either kind, ready to answer.
#[derive(Debug)]
#[non_exhaustive]
pub enum AnyBackend {
    /// The C library.
    #[cfg(feature = "embree")]
    Embree(EmbreeBackend),
    /// Pure Rust.
    Native(native::Native),
}

impl AnyBackend {
    /// Builds the hierarchy of `scene`.
    ///
    /// # Errors
    /// See [`Error`].
    pub fn build(kind: BackendKind, scene: &Scene, options: &BuildOptions<'_>) -> Result<Self, Error> {
        match kind {
            #[cfg(feature = "embree")]
            BackendKind::Embree => EmbreeBackend::build(scene, options).map(Self::Embree),
            #[cfg(not(feature = "embree"))]
            BackendKind::Embree => Err(Error::NotCompiledIn),
            BackendKind::Native => {
                let quality =
                    if options.prefers_quick_build(scene) { native::Quality::Fast } else { native::Quality::Good };
                let build =
                    native::BuildOptions { quality, cancel: options.cancel, memory_limit: options.memory_limit };
                Ok(Self::Native(native::Native::build(&scene.objects, &build)?))
            }
        }
    }

    /// Whichever it is, for who sends too few rays to be compiled once per backend.
    #[must_use]
    pub fn as_dyn(&self) -> &dyn Backend {
        match self {
            #[cfg(feature = "embree")]
            Self::Embree(b) => b,
            Self::Native(b) => b,
        }
    }

    /// Which one it is.
    #[must_use]
    pub fn kind(&self) -> BackendKind {
        match self {
            #[cfg(feature = "embree")]
            Self::Embree(_) => BackendKind::Embree,
            Self::Native(_) => BackendKind::Native,
        }
    }

    /// Bytes of the hierarchy, without the mesh buffers.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        match self {
            #[cfg(feature = "embree")]
            Self::Embree(b) => b.bytes(),
            Self::Native(b) => b.bytes() as u64,
        }
    }

    /// Whether the hierarchy was built quickly rather than well.
    #[must_use]
    pub fn is_quick(&self) -> bool {
        match self {
            #[cfg(feature = "embree")]
            Self::Embree(b) => b.is_quick(),
            Self::Native(b) => b.quality() == native::Quality::Fast,
        }
    }

    /// Most bytes that were held at once while it was built.
    #[must_use]
    pub fn peak_bytes(&self) -> u64 {
        match self {
            #[cfg(feature = "embree")]
            Self::Embree(b) => b.peak_bytes(),
            Self::Native(b) => b.peak_bytes(),
        }
    }

    /// A few words for the summary: release, packet width, build quality.
    #[must_use]
    pub fn details(&self) -> String {
        match self {
            #[cfg(feature = "embree")]
            Self::Embree(b) => b.details(),
            Self::Native(_) => "pure Rust".into(),
        }
    }
}
