//! Single rays in f64, exact answers. Knows `backend`, `scene`, `geom` and `math`.
//!
//! | file | job |
//! |---|---|
//! | `sight` | a ray in the scene's own space, where backends see it best |
//! | `surface` | what a backend hit, anew in f64 for the ray as it is |
//!
//! # Bounds of the error
//!
//! Hit or miss is right for every ray that is decidable by 1e-6 of the size of the scene, from up to 1e7 of its sizes
//! away; `t` is within 2.5e-7 of itself, normals are within 2e-6 radians. The native backend and shapes of either one
//! do far better, 1e-12, as nothing about them is decided in f32. Triangles of a mesh are found by their
//! stored corners, which are f32 in the scene's own space, and answered by the file's own where the scene keeps those
//! ([`LoadOptions::exact`](crate::scene::LoadOptions::exact)).
//!
//! ```
//! use glam::{DAffine3, DVec3};
//! use tison::backend::BackendKind;
//! use tison::geom::Sphere;
//! use tison::probe::{ProbeRay, Prober};
//! use tison::scene::{OneShape, Scene};
//!
//! let ball = OneShape::Sphere(Sphere::new(DVec3::ZERO, 1.0)?);
//! let scene = Scene::of_one(ball, &DAffine3::from_translation(DVec3::new(1e6, 0.0, 0.0)))?;
//! let prober = Prober::new(scene, BackendKind::Native)?;
//! let answer = prober.probe(&ProbeRay::new(DVec3::ZERO, DVec3::X)).expect("aimed at the ball");
//! assert_eq!((answer.t, answer.n), (1e6 - 1.0, -DVec3::X));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod sight;
mod surface;

use crate::backend::{AnyBackend, BackendKind, BuildOptions, Error, ExactBackend, ExactMaker};
use crate::geom::{Hit64, Ray, Ray64};
use crate::scene::Scene;
use glam::{DVec2, DVec3};
use sight::Sight;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use surface::Surface;

/// The part `(t_min, t_max)` of the line `o + t*d` in world space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ProbeRay {
    /// Origin.
    pub o: DVec3,
    /// Direction, of any length but zero: `t` counts in units of it.
    pub d: DVec3,
    /// Start of the open interval; may be negative.
    pub t_min: f64,
    /// End of the open interval; may be infinity.
    pub t_max: f64,
}

impl ProbeRay {
    /// From `o` along `d` without end.
    #[must_use]
    pub fn new(o: DVec3, d: DVec3) -> Self {
        Self { o, d, t_min: 0.0, t_max: f64::INFINITY }
    }
}

/// What a ray meets first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Answer {
    /// Ray parameter, in units of the ray's direction as given.
    pub t: f64,
    /// The point, in world space.
    pub p: DVec3,
    /// Unit shading normal on the side that the ray comes from.
    pub n: DVec3,
    /// Unit geometric normal: outwards, or as the triangle is wound (where a placement mirrors space, still to the side that
    /// the file's winding calls outer).
    pub ng: DVec3,
    /// Weights of a triangle's second and third corner; texture coordinates of a shape, v downwards.
    pub uv: DVec2,
    /// Texture coordinates of a mesh that keeps them (always with [`LoadOptions::exact`](crate::scene::LoadOptions::exact)), v
    /// upwards as in the file.
    pub texcoord: Option<DVec2>,
    /// Index of the object in [`Scene::objects`].
    pub object: u32,
    /// Triangle of the mesh, as numbered in its file from 0, or shape of the set.
    pub prim: u32,
    /// Whether the ray comes from the side that `ng` points to.
    pub entering: bool,
}

/// Answers rays about one scene, on any number of threads.
#[derive(Debug)]
pub struct Prober {
    scene: Arc<Scene>,
    backend: Tracer,
}

#[derive(Debug)]
enum Tracer {
    Exact(ExactBackend),
    /// Sees rays rounded to f32, as a render sends them.
    Rounded(AnyBackend),
}

/// Hits that are turned away one after the other before a ray is given up: as many triangles may meet in its start.
const MOST_HITS: usize = 1 << 16;

impl Prober {
    /// Builds the hierarchy of `scene` with all threads.
    ///
    /// # Errors
    /// As [`ExactMaker::build`].
    pub fn new(scene: impl Into<Arc<Scene>>, kind: BackendKind) -> Result<Self, Error> {
        static GO_ON: AtomicBool = AtomicBool::new(false);
        let options = BuildOptions::new(&GO_ON);
        Self::build(scene, &ExactMaker::new(kind, 0)?, &options)
    }

    /// The same with a backend that `maker` makes as `options` say.
    ///
    /// # Errors
    /// As [`ExactMaker::build`].
    pub fn build(scene: impl Into<Arc<Scene>>, maker: &ExactMaker, options: &BuildOptions<'_>) -> Result<Self, Error> {
        let scene = scene.into();
        let backend = Tracer::Exact(maker.build(&scene, options)?);
        Ok(Self { scene, backend })
    }

    /// A prober that asks what a render would ask: rays are rounded to f32 in scene space, and the backend's first word
    /// is taken, whatever it missed. The hit itself is computed in f64.
    ///
    /// # Errors
    /// As [`AnyBackend::build`].
    pub fn rounded(scene: impl Into<Arc<Scene>>, kind: BackendKind, options: &BuildOptions<'_>) -> Result<Self, Error> {
        let scene = scene.into();
        let backend = Tracer::Rounded(AnyBackend::build(kind, &scene, options)?);
        Ok(Self { scene, backend })
    }

    /// The scene that is asked about.
    #[must_use]
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// The nearest hit in the open interval of `ray`; `None` as well for a ray with a zero direction or a number that is not
    /// finite (`t_max` may be infinity).
    #[must_use]
    pub fn probe(&self, ray: &ProbeRay) -> Option<Answer> {
        match &self.backend {
            Tracer::Exact(backend) => self.exact(backend, ray),
            Tracer::Rounded(backend) => self.first_word(backend, ray),
        }
    }

    fn exact(&self, backend: &ExactBackend, ray: &ProbeRay) -> Option<Answer> {
        let sight = Sight::new(ray, &self.scene.frame, &backend.clip())?;
        let hits = backend.hits_along(&sight.ray);
        let nearest = self.first(ray, &sight, f64::INFINITY, backend.slack(), hits);
        // Nearer than that by more than rounding, in case the ray slipped through between triangles.
        let t_far = nearest.as_ref().map_or(sight.ray.t_far, |(s, _)| s - 2.0 * backend.slack());
        let nearer = Ray64 { t_far, ..sight.ray };
        let beside = if t_far > nearer.t_near { backend.hits_beside(&nearer) } else { None };
        let missed = beside.and_then(|hits| self.first(ray, &sight, t_far, backend.slack_beside(), hits));
        missed.or(nearest).map(|(_, answer)| answer)
    }

    fn first_word(&self, backend: &AnyBackend, ray: &ProbeRay) -> Option<Answer> {
        let frame = &self.scene.frame;
        let rounded = Ray {
            o: frame.to_local(ray.o).as_vec3(),
            d: (ray.d * frame.local_per_world()).as_vec3(),
            t_near: ray.t_min as f32,
            t_far: ray.t_max as f32,
        };
        let hit = backend.as_dyn().intersect(&rounded)?;
        let (t, u, v) = (hit.t.into(), hit.u.into(), hit.v.into());
        let hit = Hit64 { t, u, v, prim_id: hit.prim_id, geom_id: hit.geom_id };
        let (t_near, t_far) = (rounded.t_near.into(), rounded.t_far.into());
        let line = Ray64 { o: rounded.o.as_dvec3(), d: rounded.d.as_dvec3(), t_near, t_far };
        let surface = Surface::of(&self.scene, &line, &hit, t_near);
        Some(surface.answer(&self.scene, &hit, surface.t))
    }

    /// The first of `hits` that counts, and its parameter along `sight`: inside the ray's interval, before `t_far`, and no
    /// further from the exact ray than `slack`, or it was never met.
    fn first(
        &self,
        ray: &ProbeRay,
        sight: &Sight,
        t_far: f64,
        slack: f64,
        hits: impl Iterator<Item = Hit64>,
    ) -> Option<(f64, Answer)> {
        let answers = hits.take(MOST_HITS).map(|hit| {
            // Beyond anything before it, so that the formula of a shape finds this hit again.
            let surface = Surface::of(&self.scene, &sight.ray, &hit, hit.t.next_down());
            let t = sight.t(surface.t);
            let counts = surface.off <= slack && surface.t < t_far && t > ray.t_min && t < ray.t_max;
            counts.then(|| (surface.t, surface.answer(&self.scene, &hit, t)))
        });
        answers.flatten().next()
    }
}
