//! Rays of a render, kept as they reached the backend and asked again without the render around them.

use crate::backend::Backend;
use crate::geom::{Coherence, Hit, LANES, PacketBatch, Ray, RayHitPacket, RayPacket};
use crate::render::{self, Control, Job, Outcome};
use crate::scene::{CameraDesc, Scene};
use rayon::ThreadPool;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// A batch as it reached the backend.
#[derive(Clone, Debug)]
pub enum Recording {
    /// What is the nearest hit? Rays that go alike or not.
    Nearest(PacketBatch<RayHitPacket>, Coherence),
    /// Is anything in the way?
    Any(PacketBatch<RayPacket>),
}

impl Recording {
    fn rays(&self) -> usize {
        // A lane that ends at minus infinity asks nothing.
        match self {
            Self::Nearest(b, _) => (0..b.len()).filter(|i| b.packets()[i / LANES].ray.t_far[i % LANES] > 0.0).count(),
            Self::Any(b) => (0..b.len()).filter(|i| b.packets()[i / LANES].t_far[i % LANES] > 0.0).count(),
        }
    }
}

/// All rays of a render, by the thread that asked: replayed so, neighbouring rays stay on one thread, as they do in a
/// render.
#[derive(Debug)]
pub struct Tapes {
    fresh: Vec<Vec<Recording>>,
    /// A copy that takes the answers, where the last one's were: its memory is touched already.
    work: Vec<Mutex<Vec<Recording>>>,
    rays: usize,
}

impl Tapes {
    /// Renders on `pool` and keeps all rays; also what came of the render.
    ///
    /// # Errors
    /// As [`render::run`].
    pub fn of<B: Backend>(
        scene: &Scene,
        camera: &CameraDesc,
        backend: &B,
        job: &Job,
        pool: &ThreadPool,
    ) -> Result<(Self, Outcome), String> {
        let tapes = (0..pool.current_num_threads()).map(|_| Mutex::default()).collect();
        let recorder = Recorder { inner: backend, tapes };
        let outcome = pool.install(|| render::run_with(scene, camera, &recorder, job, &Control::default()))?;
        let fresh: Vec<Vec<Recording>> =
            recorder.tapes.into_iter().map(|tape| tape.into_inner().unwrap_or_else(PoisonError::into_inner)).collect();
        let rays = fresh.iter().flatten().map(Recording::rays).sum();
        let work = fresh.iter().map(|tape| Mutex::new(tape.clone())).collect();
        Ok((Self { fresh, work, rays }, outcome))
    }

    /// Number of rays.
    #[must_use]
    pub fn rays(&self) -> usize {
        self.rays
    }

    /// Number of batches.
    #[must_use]
    pub fn batches(&self) -> usize {
        self.fresh.iter().map(Vec::len).sum()
    }

    /// Lets `ask` answer all of them on `pool`, which has as many threads as the one they were recorded on; the mean of
    /// the threads' times.
    pub fn replay(&self, pool: &ThreadPool, ask: impl Fn(&mut Recording) + Sync) -> Duration {
        pool.broadcast(|t| lock(&self.work[t.index()]).clone_from(&self.fresh[t.index()]));
        let spent = pool.broadcast(|t| {
            let mut tape = lock(&self.work[t.index()]);
            let started = Instant::now();
            tape.iter_mut().for_each(&ask);
            started.elapsed()
        });
        spent.iter().sum::<Duration>() / spent.len() as u32
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Answers through another backend and keeps a copy of every question.
struct Recorder<'a, B> {
    inner: &'a B,
    tapes: Vec<Mutex<Vec<Recording>>>,
}

impl<B> Recorder<'_, B> {
    fn keep(&self, recording: Recording) {
        let thread = rayon::current_thread_index().expect("renders run on the pool");
        lock(&self.tapes[thread]).push(recording);
    }
}

/// Single rays are not kept: a render asks for none.
impl<B: Backend> Backend for Recorder<'_, B> {
    fn intersect(&self, ray: &Ray) -> Option<Hit> {
        self.inner.intersect(ray)
    }

    fn occluded(&self, ray: &Ray) -> bool {
        self.inner.occluded(ray)
    }

    fn intersect_many(&self, rays: &mut PacketBatch<RayHitPacket>, coherence: Coherence) {
        self.keep(Recording::Nearest(rays.clone(), coherence));
        self.inner.intersect_many(rays, coherence);
    }

    fn occluded_many(&self, rays: &mut PacketBatch<RayPacket>, coherence: Coherence) {
        self.keep(Recording::Any(rays.clone()));
        self.inner.occluded_many(rays, coherence);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::backend::{AnyBackend, BackendKind};
    use crate::bench::setup;
    use crate::scene::example::{self, Surface};
    use crate::scene::{CameraOverrides, Mesh, Object, Skip, Skips, View};
    use rayon::ThreadPoolBuilder;

    #[test]
    fn every_ray_of_a_render_is_asked_again_and_answered_alike() {
        let mut scene = Scene::of(vec![Object::Mesh(Mesh::bare(example::mesh(500, Surface::Rock)))]);
        let camera = scene.auto_camera(View::default(), &CameraOverrides::default(), 1.0).expect("there is a mesh");
        scene.light_from(&camera);
        let pool = ThreadPoolBuilder::new().num_threads(2).build().expect("threads");
        let built = setup::build(BackendKind::Native, &scene).expect("it is small");
        #[cfg_attr(not(feature = "embree"), expect(irrefutable_let_patterns, reason = "there is no other backend"))]
        let AnyBackend::Native(backend) = built else { unreachable!("it was asked for") };
        // Rays that pass the scene would not be asked.
        let job = Job { k_max: 0, skips: Skips::ALL.without(Skip::Bounds), ..Job::whole((64, 48)) };
        let (tapes, outcome) = Tapes::of(&scene, &camera, &backend, &job, &pool).expect("a good camera");
        assert_eq!(tapes.rays() as u64, outcome.stats.rays.total());
        assert!(outcome.stats.rays.shadow > 100 && tapes.batches() > 4);
        let hits = Mutex::new((0, 0));
        tapes.replay(&pool, |recording| {
            let mut found = (0, 0);
            match recording {
                Recording::Nearest(batch, coherence) => {
                    backend.intersect_many(batch, *coherence);
                    let live = |i: &usize| batch.packets()[i / 16].hit(i % 16).is_some();
                    found.0 = (0..batch.len()).filter(live).count();
                }
                Recording::Any(batch) => {
                    found.1 = (0..batch.len()).filter(|i| batch.packets()[i / 16].get(i % 16).t_far > 0.0).count();
                }
            }
            let mut hits = lock(&hits);
            *hits = (hits.0 + found.0, hits.1 + found.1);
        });
        let (seen, asked) = *lock(&hits);
        assert_eq!(asked as u64, outcome.stats.rays.shadow);
        assert!(seen > 300 && seen < 64 * 48, "{seen}");
    }
}
