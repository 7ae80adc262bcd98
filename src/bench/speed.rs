//! `tison bench speed`: the native tracer against Embree, the same rays in turn.

use super::cost::median;
use super::leaving;
use super::plot::{Line, Plot};
use super::report::{Machine, Report, Section, Table};
use super::setup::{self, plain};
use crate::backend::{self, AnyBackend, Backend, BackendKind};
use crate::geom::{Coherence, LANES, PacketBatch, Ray, RayHitPacket, RayPacket, Sphere};
use crate::math::Random;
use crate::render::Surfaces;
use crate::scene::example::{self, Surface};
use crate::scene::{self, AnyShapes, CameraOverrides, Mesh, Object, Scene, Shapes, View};
use glam::{DVec2, DVec3};
use rayon::ThreadPool;
use rayon::prelude::*;
use serde_json::{Value, json};
use std::hint::black_box;
use std::path::PathBuf;
use std::time::Instant;

/// What to trace.
#[derive(Clone, Debug)]
pub struct Options {
    /// Triangles of generated meshes.
    pub triangles: Vec<u64>,
    /// Numbers of spheres at random places.
    pub spheres: Vec<u32>,
    /// Scene and mesh files, looked at through their first camera.
    pub files: Vec<PathBuf>,
    /// Times that everything is traced; the medians count. At least 1.
    pub rounds: usize,
}

/// Why there is no report.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the messages say it")]
pub enum Error {
    #[error("a scene cannot be built")]
    Build(#[from] backend::Error),
    #[error("a scene cannot be read")]
    Load(#[from] scene::Error),
    #[error("no rays can be made: {0}")]
    Camera(String),
    #[error("so many threads cannot be had")]
    Threads(#[from] rayon::ThreadPoolBuildError),
}

/// Pixels along a side of what the camera sees.
const SIDE: u32 = 512;
/// Rays that one thread takes at a time.
const CHUNK: usize = 4096;
/// Primitives from which on a hierarchy is built only once.
const LARGE: usize = 2_000_000;

/// Measures; `tell` hears what it is at.
///
/// # Errors
/// See [`Error`].
pub fn run(options: &Options, tell: &dyn Fn(&str)) -> Result<Report, Error> {
    let all = std::thread::available_parallelism().map_or(1, usize::from);
    let threads = if all > 1 { vec![1, all] } else { vec![1] };
    let mut found = Vec::new();
    let mut measure = |name: String, scene: &Scene| -> Result<(), Error> {
        tell(&name);
        found.extend(measured(&name, scene, &threads, options.rounds.max(1))?);
        Ok(())
    };
    for &n in &options.triangles {
        let mesh = example::mesh(n, Surface::Rock);
        let name = format!("{} triangles", mesh.face_count());
        measure(name, &Scene::of(vec![Object::Mesh(Mesh::bare(mesh))]))?;
    }
    for &n in &options.spheres {
        measure(format!("{n} spheres"), &spheres(n))?;
    }
    for file in &options.files {
        measure(file.display().to_string(), &leaving::load(file)?.scene)?;
    }
    let about = "The same rays through both backends, in turn in one process. Single rays are asked for one by one, \
                 packets hold sixteen neighbours. Rates are without shading.";
    let sections = threads.iter().map(|&threads| section(&found, threads, options)).collect();
    Ok(Report { title: "tison: native against Embree".into(), about: about.into(), machine: Machine::this(), sections })
}

/// What one row of the table tells.
struct Found {
    scene: String,
    primitives: usize,
    threads: usize,
    /// `None`: building. Else what kind of rays.
    rays: Option<&'static str>,
    /// Seconds or Mrays per second.
    native: f64,
    embree: Option<Against>,
}

/// The other one.
struct Against {
    value: f64,
    /// Median of the rounds' ratios of native to it.
    ratio: f64,
}

fn spheres(n: u32) -> Scene {
    let mut random = Random(7);
    // So large that about half of the camera rays hit one.
    let radius = 1.27 / f64::from(n).sqrt();
    let balls = (0..n).map(|_| Sphere::new(random.point(), radius).expect("a size above 0"));
    Scene::of(vec![Object::Shapes(Shapes::bare(AnyShapes::Spheres(plain(balls))))])
}

fn measured(name: &str, scene: &Scene, threads: &[usize], rounds: usize) -> Result<Vec<Found>, Error> {
    let primitives = scene.stored_triangles() + scene.shapes();
    let found = |threads, rays, times: &[(f64, Option<f64>)]| Found {
        scene: name.to_owned(),
        primitives,
        threads,
        rays,
        native: median(times.iter().map(|t| t.0).collect()),
        embree: times[0].1.is_some().then(|| Against {
            value: median(times.iter().filter_map(|t| t.1).collect()),
            ratio: median(times.iter().filter_map(|t| Some(t.0 / t.1?)).collect()),
        }),
    };
    let mut out = Vec::new();
    let mut work: Option<Vec<Work>> = None;
    for &threads in threads {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build()?;
        let times = if primitives > LARGE { 1 } else { rounds.min(3) };
        let (mut seconds, mut last) = (Vec::new(), None);
        for _ in 0..times {
            // The last pair goes before the next one comes: memory for two is enough.
            drop(last.take());
            let native = built(BackendKind::Native, scene, &pool)?;
            let embree = if cfg!(feature = "embree") { Some(built(BackendKind::Embree, scene, &pool)?) } else { None };
            seconds.push((native.1, embree.as_ref().map(|e| e.1)));
            last = Some((native.0, embree.map(|e| e.0)));
        }
        out.push(found(threads, None, &seconds));
        let Some((native, embree)) = last else { continue };
        if work.is_none() {
            work = Some(all_work(scene, native.as_dyn())?);
        }
        for work in work.iter_mut().flatten() {
            // The first round warms the caches.
            let rates = (0..=rounds).map(|_| {
                let native = work.rate(native.as_dyn(), &pool);
                (native, embree.as_ref().map(|e| work.rate(e.as_dyn(), &pool)))
            });
            let rates: Vec<_> = rates.collect();
            out.push(found(threads, Some(work.name), &rates[1..]));
        }
    }
    Ok(out)
}

fn built(kind: BackendKind, scene: &Scene, pool: &ThreadPool) -> Result<(AnyBackend, f64), Error> {
    pool.install(|| {
        let start = Instant::now();
        let backend = setup::build_on(kind, scene, pool.current_num_threads())?;
        Ok((backend, start.elapsed().as_secs_f64()))
    })
}

/// Rays and how they are asked.
struct Work {
    name: &'static str,
    asked: Asked,
}

enum Asked {
    Singly(Vec<Ray>),
    /// As they were asked, and the memory for the answers.
    Nearest(Vec<PacketBatch<RayHitPacket>>, Vec<PacketBatch<RayHitPacket>>),
    Any(Vec<PacketBatch<RayPacket>>, Vec<PacketBatch<RayPacket>>),
}

impl Work {
    /// Mrays per second on `pool`.
    fn rate(&mut self, backend: &dyn Backend, pool: &ThreadPool) -> f64 {
        let (rays, seconds) = match &mut self.asked {
            Asked::Singly(rays) => {
                let sum = |rays: &[Ray]| rays.iter().filter_map(|r| Some(backend.intersect(r)?.t)).sum::<f32>();
                (rays.len(), timed(pool, || black_box(rays.par_chunks(CHUNK).map(sum).sum::<f32>())))
            }
            Asked::Nearest(fresh, work) => {
                work.clone_from(fresh);
                let trace = |batch: &mut PacketBatch<_>| backend.intersect_many(batch, Coherence::Coherent);
                (count(fresh), timed(pool, || work.par_iter_mut().for_each(trace)))
            }
            Asked::Any(fresh, work) => {
                work.clone_from(fresh);
                let trace = |batch: &mut PacketBatch<_>| backend.occluded_many(batch, Coherence::Coherent);
                (count(fresh), timed(pool, || work.par_iter_mut().for_each(trace)))
            }
        };
        rays as f64 / seconds / 1e6
    }
}

fn timed<R: Send>(pool: &ThreadPool, f: impl FnOnce() -> R + Send) -> f64 {
    pool.install(|| {
        let start = Instant::now();
        f();
        start.elapsed().as_secs_f64()
    })
}

fn count<P: crate::geom::RayQueue>(batches: &[PacketBatch<P>]) -> usize {
    batches.iter().map(PacketBatch::len).sum()
}

fn batches<P: crate::geom::RayQueue>(rays: &[Ray]) -> Vec<PacketBatch<P>> {
    let batch = |rays: &[Ray]| {
        let mut batch = PacketBatch::default();
        rays.iter().for_each(|ray| batch.push(ray));
        batch
    };
    rays.chunks(CHUNK).map(batch).collect()
}

/// Rays of all kinds through what there is to see.
fn all_work(scene: &Scene, backend: &dyn Backend) -> Result<Vec<Work>, Error> {
    let camera = camera_rays(scene)?;
    let (shadow, bounced) = rays_from_hits(scene, backend, &camera);
    let bounds = scene.local_bounds();
    let mut random = Random(13);
    let place = |random: &mut Random| bounds.center() + 0.5 * bounds.size() * random.point();
    let anywhere = |_| Ray::new(place(&mut random).as_vec3(), random.direction().as_vec3());
    let random: Vec<Ray> = (0..camera.len() / 2).map(anywhere).collect();
    Ok(vec![
        Work { name: "camera, packets", asked: Asked::Nearest(batches(&camera), Vec::new()) },
        Work { name: "camera, single", asked: Asked::Singly(camera) },
        Work { name: "shadow, packets", asked: Asked::Any(batches(&shadow), Vec::new()) },
        Work { name: "bounced, single", asked: Asked::Singly(bounced) },
        Work { name: "random, single", asked: Asked::Singly(random) },
    ])
}

/// One ray per pixel, in blocks of 4 x 4.
fn camera_rays(scene: &Scene) -> Result<Vec<Ray>, Error> {
    let camera = scene.auto_camera(View::ThreeQuarter, &CameraOverrides::default(), 1.0).map_err(Error::Camera)?;
    let camera = camera.prepare(&scene.frame, (SIDE, SIDE)).map_err(Error::Camera)?;
    let lanes = LANES as u32;
    let ray = |i: u32| {
        let (block, lane) = (i / lanes, i % lanes);
        let (x, y) = (block % (SIDE / 4) * 4 + lane % 4, block / (SIDE / 4) * 4 + lane / 4);
        let (o, d) = camera.ray(f64::from(x) + 0.500_37, f64::from(y) + 0.500_61, DVec2::ZERO);
        Ray::new(o.as_vec3(), d.as_vec3())
    };
    Ok((0..SIDE * SIDE).map(ray).collect())
}

/// From what the camera sees to one light, and on in a random direction.
fn rays_from_hits(scene: &Scene, backend: &dyn Backend, camera: &[Ray]) -> (Vec<Ray>, Vec<Ray>) {
    let (bounds, mut random) = (scene.local_bounds(), Random(11));
    let light = bounds.center() + bounds.size().length() * DVec3::new(0.6, 1.0, 0.9);
    let (mut shadow, mut bounced) = (Vec::new(), Vec::new());
    let (mut surfaces, mut packet) = (Surfaces::new(scene), RayHitPacket::EMPTY);
    for ray in camera {
        packet.ray.set(0, ray);
        packet.set_hit(0, backend.intersect(ray).as_ref());
        let Some(point) = surfaces.of(&packet, 1)[0] else { continue };
        let (start, normal) = (point.origin_towards(point.ng), point.ng);
        let to_light = light - start.as_dvec3();
        if normal.dot(to_light) > 0.0 {
            shadow.push(Ray::segment(start, to_light.as_vec3(), 1.0));
        }
        bounced.push(Ray::new(start, (normal + 0.999 * random.direction()).as_vec3()));
    }
    (shadow, bounced)
}

fn section(found: &[Found], threads: usize, options: &Options) -> Section {
    let mut table = Table::new(&["scene", "what", "native", "Embree", "native / Embree"]);
    let here = || found.iter().filter(|f| f.threads == threads);
    let mut data = Vec::new();
    for f in here() {
        let what = f.rays.unwrap_or("build, seconds");
        let value = |v: f64| if f.rays.is_some() { format!("{v:.2}") } else { format!("{v:.4}") };
        let (embree, ratio) = match &f.embree {
            Some(against) => (value(against.value), format!("{:.2}", against.ratio)),
            None => ("-".into(), "-".into()),
        };
        table.rows.push(vec![f.scene.clone(), what.into(), value(f.native), embree, ratio]);
        data.push(json!({
            "scene": f.scene, "primitives": f.primitives, "threads": threads,
            "what": f.rays.unwrap_or("build"), "unit": if f.rays.is_some() { "Mrays/s" } else { "s" },
            "native": f.native, "embree": f.embree.as_ref().map(|e| e.value),
            "ratio": f.embree.as_ref().map(|e| e.ratio),
        }));
    }
    let meshes = || here().filter(|f| f.scene.ends_with(" triangles"));
    let mut kinds: Vec<&'static str> = Vec::new();
    for kind in meshes().filter_map(|f| f.rays) {
        if !kinds.contains(&kind) {
            kinds.push(kind);
        }
    }
    let plot = |kind: &&'static str| {
        let line = |name: &str, of: fn(&Found) -> Option<f64>| Line {
            name: name.into(),
            points: meshes()
                .filter(|f| f.rays == Some(kind))
                .filter_map(|f| Some((f.primitives as f64, of(f)?)))
                .collect(),
        };
        let mut lines = vec![line("native", |f| Some(f.native)), line("Embree", |f| Some(f.embree.as_ref()?.value))];
        lines.retain(|l| !l.points.is_empty());
        Plot { title: (*kind).into(), x: "triangles".into(), y: "Mrays/s".into(), lines, floor: None }
    };
    Section {
        name: if threads == 1 { "one_thread" } else { "all_threads" }.into(),
        title: if threads == 1 { "One thread".into() } else { format!("{threads} threads") },
        about: format!(
            "Mrays/s, more is better, and seconds to build, less is better; medians of {} rounds in turn.",
            options.rounds.max(1)
        ),
        repeat: repeat(options),
        table,
        data: Value::Array(data),
        plots: kinds.iter().map(plot).collect(),
        pictures: vec![],
    }
}

/// The command line of a run.
fn repeat(options: &Options) -> String {
    fn list<T: ToString>(of: &[T]) -> String {
        if of.is_empty() { "0".into() } else { of.iter().map(T::to_string).collect::<Vec<_>>().join(",") }
    }
    let files: String = options.files.iter().map(|f| format!(" {}", f.display())).collect();
    format!(
        "tison bench speed --triangles {} --spheres {} --rounds {}{files}",
        list(&options.triangles),
        list(&options.spheres),
        options.rounds
    )
}
