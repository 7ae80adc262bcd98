//! Rate of rays inside `render` against a bare Embree loop that traces the very same rays in
//! the very same packets and does nothing else. Both run in turn in one process, with the
//! same build quality, ROBUST, on the same threads.
//!
//!     cargo bench --bench bare -- [MODEL.obj] [--size WxH] [--eye x,y,z] [--target x,y,z]
//!                                 [--fov D] [--threads N] [--rounds N] [--triangles N]
//!
//! Without a model a displaced sphere is generated.
use embree4_sys as sys;
use glam::DVec3;
use std::path::PathBuf;
use std::sync::Mutex;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};
use tison::backend::{AnyBackend, Backend, BackendKind, BuildOptions};
use tison::geom::{Coherence, Hit, LANES, PacketBatch, Ray, RayHitPacket, RayPacket};
use tison::render::{self, Control, Job};
use tison::scene::{self, CameraOverrides, LoadOptions, Projection, Scene, View};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let args = Args::parse()?;
    let threads = args.threads;
    rayon::ThreadPoolBuilder::new().num_threads(threads).build_global()?;
    let model = args.model()?;
    let cancel = AtomicBool::new(false);
    let options = LoadOptions::new(&cancel);
    let mut scene = scene::load(&model, &options)?.scene;
    let aspect = f64::from(args.size.0) / f64::from(args.size.1);
    let camera = scene.auto_camera(View::ThreeQuarter, &args.camera, aspect)?;
    scene.light_from(&camera);
    let job = Job { k_max: 0, ..Job::whole(args.size) };
    let build = BuildOptions {
        threads,
        rays_expected: 3 * u64::from(args.size.0) * u64::from(args.size.1),
        cancel: &cancel,
        memory_limit: None,
        progress: None,
    };
    let low = build.prefers_quick_build(&scene);
    // Where in memory a hierarchy lies can double the cost of a ray: the bare loop has first choice.
    let raw = RawScene::build(&scene, threads, low);
    let backend = AnyBackend::build(BackendKind::Embree, &scene, &build)?;
    let AnyBackend::Embree(embree) = &backend else { unreachable!("it was asked for") };
    let recorder = Recorder { inner: embree, tapes: (0..threads).map(|_| Mutex::default()).collect() };
    render::run_with(&scene, &camera, &recorder, &job, &Control::default())?;
    let fresh = recorder.tapes.into_iter().map(Mutex::into_inner).collect::<Result<Vec<_>, _>>()?;
    let rays: usize = fresh.iter().flatten().map(Recording::rays).sum();
    let tapes: Vec<_> = fresh.iter().map(|tape| Mutex::new(tape.clone())).collect();

    println!(
        "{} triangles, {rays} rays in {} batches, {threads} threads, {}",
        scene.counts().triangles,
        fresh.iter().map(Vec::len).sum::<usize>(),
        backend.details()
    );
    println!("round   render Mrays/s   bare Mrays/s   ratio");
    let mut ratios = Vec::new();
    let (mut best_render, mut best_bare) = (0f64, 0f64);
    for round in 0..=args.rounds {
        let outcome = render::run(&scene, &camera, &backend, &job, &Control::default())?;
        assert_eq!(outcome.stats.rays.total() as usize, rays, "both trace the same rays");
        // Last round's answers lie where the questions were.
        rayon::broadcast(|t| tapes[t.index()].lock().expect("nobody panics with it").clone_from(&fresh[t.index()]));
        let bare = rays as f64 / raw.replay(&tapes).as_secs_f64() / 1e6;
        let ours = rays as f64 / outcome.stats.seconds / 1e6;
        if round == 0 {
            continue; // warms the caches
        }
        println!("{round:5} {ours:16.2} {bare:14.2} {:7.3}", ours / bare);
        ratios.push(ours / bare);
        best_render = best_render.max(ours);
        best_bare = best_bare.max(bare);
    }
    ratios.sort_by(f64::total_cmp);
    println!(
        "median of ratios {:.3}; best render {best_render:.2}, best bare {best_bare:.2} Mrays/s",
        ratios[ratios.len() / 2]
    );
    Ok(())
}

struct Args {
    model: Option<PathBuf>,
    triangles: u64,
    size: (u32, u32),
    camera: CameraOverrides,
    threads: usize,
    rounds: usize,
}

impl Args {
    fn parse() -> Result<Self, Box<dyn std::error::Error>> {
        let mut out = Self {
            model: None,
            triangles: 1_310_720,
            size: (1920, 1080),
            camera: CameraOverrides::default(),
            threads: std::thread::available_parallelism().map_or(1, usize::from),
            rounds: 7,
        };
        let mut args = std::env::args().skip(1).filter(|a| a != "--bench");
        while let Some(arg) = args.next() {
            let mut value = || args.next().ok_or(format!("{arg} needs a value"));
            match arg.as_str() {
                "--size" => {
                    let text = value()?;
                    let (w, h) = text.split_once('x').ok_or("--size WxH")?;
                    out.size = (w.parse()?, h.parse()?);
                }
                "--eye" => out.camera.eye = Some(point(&value()?)?),
                "--target" => out.camera.target = Some(point(&value()?)?),
                "--fov" => out.camera.projection = Some(Projection::Perspective { fov_deg: value()?.parse()? }),
                "--threads" => out.threads = value()?.parse()?,
                "--rounds" => out.rounds = value()?.parse()?,
                "--triangles" => out.triangles = value()?.parse()?,
                flag if flag.starts_with('-') => return Err(format!("unknown flag {flag}").into()),
                model => out.model = Some(model.into()),
            }
        }
        Ok(out)
    }

    /// The model asked for, or a generated one.
    fn model(&self) -> std::io::Result<PathBuf> {
        if let Some(model) = &self.model {
            return Ok(model.clone());
        }
        let path = std::env::temp_dir().join(format!("tison-bench-{}.obj", self.triangles));
        scene::example::write_mesh(self.triangles, &mut std::fs::File::create(&path)?)?;
        Ok(path)
    }
}

fn point(text: &str) -> Result<DVec3, Box<dyn std::error::Error>> {
    let v = text.split(',').map(str::parse).collect::<Result<Vec<f64>, _>>()?;
    let v: [f64; 3] = v.try_into().map_err(|_| "a point is x,y,z")?;
    Ok(DVec3::from(v))
}

/// A batch as it reached the backend.
#[derive(Clone)]
enum Recording {
    Nearest(PacketBatch<RayHitPacket>),
    Any(PacketBatch<RayPacket>),
}

impl Recording {
    fn rays(&self) -> usize {
        match self {
            Self::Nearest(b) => b.len(),
            // A lane that ends at minus infinity asks nothing.
            Self::Any(b) => b.packets().iter().flat_map(|p| p.t_far).filter(|&t| t > 0.0).count(),
        }
    }
}

/// Answers through another backend and keeps a copy of every question, by the thread that
/// asked: replayed so, neighbouring rays stay on one thread, as they do in a render.
struct Recorder<'a, B> {
    inner: &'a B,
    tapes: Vec<Mutex<Vec<Recording>>>,
}

impl<B> Recorder<'_, B> {
    fn keep(&self, recording: Recording) {
        let thread = rayon::current_thread_index().expect("renders run on the pool");
        self.tapes[thread].lock().expect("nobody panics with it").push(recording);
    }
}

impl<B: Backend> Backend for Recorder<'_, B> {
    fn intersect(&self, ray: &Ray) -> Option<Hit> {
        self.inner.intersect(ray)
    }
    fn occluded(&self, ray: &Ray) -> bool {
        self.inner.occluded(ray)
    }
    fn intersect_many(&self, rays: &mut PacketBatch<RayHitPacket>, coherence: Coherence) {
        self.keep(Recording::Nearest(rays.clone()));
        self.inner.intersect_many(rays, coherence);
    }
    fn occluded_many(&self, rays: &mut PacketBatch<RayPacket>, coherence: Coherence) {
        self.keep(Recording::Any(rays.clone()));
        self.inner.occluded_many(rays, coherence);
    }
}

/// Embree's scene, made and asked through nothing but the bindings.
struct RawScene {
    device: sys::RTCDevice,
    scene: sys::RTCScene,
}

// SAFETY: Embree allows concurrent queries on a committed scene.
unsafe impl Sync for RawScene {}

impl RawScene {
    fn build(scene: &Scene, threads: usize, low: bool) -> Self {
        let quality = if low {
            sys::RTCBuildQuality::RTC_BUILD_QUALITY_LOW
        } else {
            sys::RTCBuildQuality::RTC_BUILD_QUALITY_MEDIUM
        };
        let config = std::ffi::CString::new(format!("threads={threads}")).expect("no NUL in it");
        // SAFETY: a NUL-terminated string.
        let device = unsafe { sys::rtcNewDevice(config.as_ptr()) };
        // SAFETY: the device is live.
        let raw = unsafe { sys::rtcNewScene(device) };
        // SAFETY: the scene is live.
        unsafe { sys::rtcSetSceneFlags(raw, sys::RTCSceneFlags::RTC_SCENE_FLAG_ROBUST) };
        // SAFETY: the scene is live.
        unsafe { sys::rtcSetSceneBuildQuality(raw, quality) };
        for mesh in scene.objects.iter().filter_map(|o| o.mesh()) {
            Self::attach(device, raw, &mesh.data.triangles, quality);
        }
        // SAFETY: the scene is live and nobody else has it.
        unsafe { sys::rtcCommitScene(raw) };
        Self { device, scene: raw }
    }

    /// Shares the mesh's buffers, as a user who counts bytes would.
    fn attach(
        device: sys::RTCDevice,
        scene: sys::RTCScene,
        mesh: &tison::geom::TriangleMesh,
        quality: sys::RTCBuildQuality,
    ) {
        // SAFETY: the device is live.
        let geometry = unsafe { sys::rtcNewGeometry(device, sys::RTCGeometryType::RTC_GEOMETRY_TYPE_TRIANGLE) };
        // SAFETY: the geometry is live.
        unsafe { sys::rtcSetGeometryBuildQuality(geometry, quality) };
        let share = |slot, format, data: *const std::ffi::c_void, count: usize| {
            // SAFETY: `data` are `count` items of 12 bytes, the vertices followed by padding; the mesh outlives
            // the scene, which `main` drops first.
            unsafe { sys::rtcSetSharedGeometryBuffer(geometry, slot, 0, format, data, 0, 12, count) };
        };
        let (vertex, index) = (sys::RTCBufferType::RTC_BUFFER_TYPE_VERTEX, sys::RTCBufferType::RTC_BUFFER_TYPE_INDEX);
        share(vertex, sys::RTCFormat::RTC_FORMAT_FLOAT3, mesh.padded_points().as_ptr().cast(), mesh.vertex_count());
        share(index, sys::RTCFormat::RTC_FORMAT_UINT3, mesh.faces().as_ptr().cast(), mesh.face_count());
        // SAFETY: the geometry is live.
        unsafe { sys::rtcCommitGeometry(geometry) };
        // SAFETY: both are live; the scene takes a reference of its own.
        unsafe { sys::rtcAttachGeometry(scene, geometry) };
        // SAFETY: gives back ours.
        unsafe { sys::rtcReleaseGeometry(geometry) };
    }

    /// Traces the tapes in place, each on its thread; the mean of the threads' times.
    fn replay(&self, tapes: &[Mutex<Vec<Recording>>]) -> Duration {
        let spent = rayon::broadcast(|thread| {
            let mut tape = tapes[thread.index()].lock().expect("nobody panics with it");
            let started = Instant::now();
            for recording in tape.iter_mut() {
                match recording {
                    Recording::Nearest(b) => b.packets_mut().for_each(|(p, live)| self.intersect(p, live)),
                    Recording::Any(b) => b.packets_mut().for_each(|(p, live)| self.occluded(p, live)),
                }
            }
            started.elapsed()
        });
        spent.iter().sum::<Duration>() / tapes.len() as u32
    }

    fn intersect(&self, packet: &mut RayHitPacket, live: usize) {
        let mut args = ARGS_INTERSECT;
        let packet: *mut RayHitPacket = packet;
        // SAFETY: the scene is committed; mask and packet are 64-byte aligned and laid out as
        // Embree's own (the library asserts that); the packet is ours alone.
        unsafe { sys::rtcIntersect16(VALID[live].0.as_ptr(), self.scene, packet.cast(), &mut args) };
    }

    fn occluded(&self, packet: &mut RayPacket, live: usize) {
        let mut args = ARGS_OCCLUDED;
        let packet: *mut RayPacket = packet;
        // SAFETY: as above.
        unsafe { sys::rtcOccluded16(VALID[live].0.as_ptr(), self.scene, packet.cast(), &mut args) };
    }
}

impl Drop for RawScene {
    fn drop(&mut self) {
        // SAFETY: gives back the reference `rtcNewScene` gave.
        unsafe { sys::rtcReleaseScene(self.scene) };
        // SAFETY: gives back the reference `rtcNewDevice` gave.
        unsafe { sys::rtcReleaseDevice(self.device) };
    }
}

#[repr(align(64))]
struct Valid([i32; LANES]);

/// Masks for the first `n` lanes.
static VALID: [Valid; LANES + 1] = {
    let mut all = [const { Valid([0; LANES]) }; LANES + 1];
    let mut n = 0;
    while n <= LANES {
        let mut lane = 0;
        while lane < n {
            all[n].0[lane] = -1;
            lane += 1;
        }
        n += 1;
    }
    all
};

const ARGS_INTERSECT: sys::RTCIntersectArguments = sys::RTCIntersectArguments {
    flags: sys::RTCRayQueryFlags::RTC_RAY_QUERY_FLAG_COHERENT,
    feature_mask: sys::RTCFeatureFlags::RTC_FEATURE_FLAG_ALL,
    context: std::ptr::null_mut(),
    filter: None,
    intersect: None,
};

const ARGS_OCCLUDED: sys::RTCOccludedArguments = sys::RTCOccludedArguments {
    flags: sys::RTCRayQueryFlags::RTC_RAY_QUERY_FLAG_COHERENT,
    feature_mask: sys::RTCFeatureFlags::RTC_FEATURE_FLAG_ALL,
    context: std::ptr::null_mut(),
    filter: None,
    occluded: None,
};
