//! Rate of rays inside `render` against a bare Embree loop that traces the very same rays in the very same packets
//! through the very same hierarchy and does nothing else. Both run in turn in one process, on the same threads.
//! `tison bench speed` does so over meshes of many sizes.
//!
//!     cargo bench --bench bare -- [MODEL.obj] [--size WxH] [--eye x,y,z] [--target x,y,z]
//!                                 [--fov D] [--threads N] [--rounds N] [--triangles N]
//!
//!                                 [--recursion N] [--min-weight W]
//!
//! Without a model a displaced sphere is generated. A scene file brings its own camera and lights; rays that have bounced
//! (`--recursion`, 0 unless told) are replayed one by one, and where its plain spheres are all that it has besides boxes,
//! also through a hierarchy of Embree's own spheres and triangles.
use glam::DVec3;
use rayon::ThreadPoolBuilder;
use std::hint::black_box;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use tison::backend::{AnyBackend, BackendKind, BuildOptions};
use tison::bench::record::{Recording, Tapes};
use tison::embree::{self, Bare, Device, DeviceConfig, SceneBuilder, SceneOptions};
use tison::geom::{Bounds, Coherence, ShapeSet, TriangleMesh};
use tison::render::{self, Control, Job};
use tison::scene::{self, AnyShapes, CameraOverrides, LoadOptions, Object, Projection, Scene, Skip, Skips, View};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let args = Args::parse()?;
    let threads = args.threads;
    let pool = ThreadPoolBuilder::new().num_threads(threads).build()?;
    let model = args.model()?;
    let cancel = AtomicBool::new(false);
    let options = LoadOptions::new(&cancel);
    let loaded = scene::load(&model, &options)?;
    let mut scene = loaded.scene;
    let aspect = f64::from(args.size.0) / f64::from(args.size.1);
    let camera = match loaded.cameras.first() {
        Some(named) => named.camera,
        None => {
            let camera = scene.auto_camera(View::ThreeQuarter, &args.camera, aspect)?;
            scene.light_from(&camera);
            camera
        }
    };
    // The bare loop is asked about rays that pass the scene too.
    let skips = Skips::ALL.without(Skip::Bounds);
    let job = Job { k_max: args.recursion, min_weight: args.min_weight, skips, ..Job::whole(args.size) };
    let build = BuildOptions {
        threads,
        rays_expected: 3 * u64::from(args.size.0) * u64::from(args.size.1),
        ..BuildOptions::new(&cancel)
    };
    let backend = pool.install(|| AnyBackend::build(BackendKind::Embree, &scene, &build))?;
    let AnyBackend::Embree(embree) = &backend else { unreachable!("it was asked for") };
    let (tapes, _) = Tapes::of(&scene, &camera, embree, &job, &pool)?;
    let rays = tapes.rays();
    let own = own_spheres(&scene, threads)?;
    println!(
        "{} triangles, {rays} rays in {} batches, {threads} threads, {}",
        scene.counts().triangles,
        tapes.batches(),
        backend.details()
    );
    println!("round   render Mrays/s   bare Mrays/s   ratio   Embree's own spheres   ratio");
    let (mut ratios, mut to_own) = (Vec::new(), Vec::new());
    for round in 0..=args.rounds {
        let outcome = pool.install(|| render::run(&scene, &camera, &backend, &job, &Control::default()))?;
        let sent = outcome.stats.rays.total() - outcome.stats.rays_inside;
        assert_eq!(sent as usize, rays, "both trace the same rays");
        let rate = |scene: &embree::Scene| {
            let spent = tapes.replay(&pool, |recording| replay(recording, scene.bare()));
            rays as f64 / spent.as_secs_f64() / 1e6
        };
        let (bare, own) = (rate(embree.scene()), own.as_ref().map(rate));
        let ours = rays as f64 / outcome.stats.seconds / 1e6;
        if round == 0 {
            continue; // warms the caches
        }
        print!("{round:5} {ours:16.2} {bare:14.2} {:7.3}", ours / bare);
        println!("{}", own.map_or(String::new(), |own| format!(" {own:22.2} {:7.3}", ours / own)));
        ratios.push(ours / bare);
        to_own.extend(own.map(|own| ours / own));
    }
    for (name, mut ratios) in [("bare loop", ratios), ("Embree's own spheres", to_own)] {
        ratios.sort_by(f64::total_cmp);
        if let Some(median) = ratios.get(ratios.len() / 2) {
            println!("median of ratios to the {name}: {median:.3}");
        }
    }
    Ok(())
}

/// Asks again as the render asked: packets, or one by one where rays go apart.
fn replay(recording: &mut Recording, bare: Bare<'_>) {
    match recording {
        Recording::Nearest(batch, Coherence::Coherent) => bare.intersect_batch(batch),
        Recording::Nearest(batch, Coherence::Incoherent) => {
            for (packet, live) in batch.packets_mut() {
                for lane in (0..live).filter(|&lane| packet.ray.t_far[lane] > 0.0) {
                    black_box(bare.intersect(&packet.ray.get(lane)));
                }
            }
        }
        Recording::Any(batch) => bare.occluded_batch(batch),
    }
}

/// The spheres of a scene as Embree has them and its boxes as triangles, if it has spheres and nothing else.
fn own_spheres(scene: &Scene, threads: usize) -> Result<Option<embree::Scene>, Box<dyn std::error::Error>> {
    let device = Device::new(&DeviceConfig { threads, ..DeviceConfig::default() })?;
    let mut builder = SceneBuilder::new(&device, SceneOptions::default())?;
    let mut any = false;
    for object in &scene.objects {
        let Object::Shapes(shapes) = object else { return Ok(None) };
        match &shapes.set {
            AnyShapes::Spheres(set) => {
                let sphere = |i| set.get(i).center().extend(set.get(i).radius()).as_vec4().to_array();
                builder.own_spheres(&(0..set.len()).map(sphere).collect::<Vec<_>>())?;
                any = true;
            }
            AnyShapes::Cubes(set) => {
                let boxes: Vec<Bounds> = (0..set.len()).map(|i| set.bounds(i)).collect();
                builder.mesh(Arc::new(triangles(&boxes)))?;
            }
            _ => return Ok(None),
        }
    }
    Ok(if any { Some(builder.commit(None)?) } else { None })
}

fn triangles(boxes: &[Bounds]) -> TriangleMesh {
    let (mut points, mut faces) = (Vec::new(), Vec::new());
    for b in boxes {
        let first = (points.len() / 3) as u32;
        for corner in 0..8 {
            let at = |k: usize| if corner >> k & 1 == 0 { b.lo[k] } else { b.hi[k] } as f32;
            points.extend([at(0), at(1), at(2)]);
        }
        for [p, q, r, s] in [[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]] {
            faces.extend([[p, q, r], [p, r, s]].map(|face: [u32; 3]| face.map(|i| first + i)));
        }
    }
    TriangleMesh::new(points, faces)
}

struct Args {
    model: Option<PathBuf>,
    triangles: u64,
    size: (u32, u32),
    camera: CameraOverrides,
    threads: usize,
    rounds: usize,
    recursion: u32,
    min_weight: f32,
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
            recursion: 0,
            min_weight: 1.0 / 1024.0,
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
                "--recursion" => out.recursion = value()?.parse()?,
                "--min-weight" => out.min_weight = value()?.parse()?,
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
