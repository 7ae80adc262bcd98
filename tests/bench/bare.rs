//! Rate of rays inside `render` against a bare Embree loop that traces the very same rays in the very same packets
//! through the very same hierarchy and does nothing else. Both run in turn in one process, on the same threads.
//! `tison bench speed` does so over meshes of many sizes.
//!
//!     cargo bench --bench bare -- [MODEL.obj] [--size WxH] [--eye x,y,z] [--target x,y,z]
//!                                 [--fov D] [--threads N] [--rounds N] [--triangles N]
//!
//! Without a model a displaced sphere is generated.
use glam::DVec3;
use rayon::ThreadPoolBuilder;
use std::path::PathBuf;
use std::sync::atomic::AtomicBool;
use tison::backend::{AnyBackend, BackendKind, BuildOptions};
use tison::bench::record::{Recording, Tapes};
use tison::render::{self, Control, Job};
use tison::scene::{self, CameraOverrides, LoadOptions, Projection, View};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let args = Args::parse()?;
    let threads = args.threads;
    let pool = ThreadPoolBuilder::new().num_threads(threads).build()?;
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
    let backend = pool.install(|| AnyBackend::build(BackendKind::Embree, &scene, &build))?;
    let AnyBackend::Embree(embree) = &backend else { unreachable!("it was asked for") };
    let (tapes, _) = Tapes::of(&scene, &camera, embree, &job, &pool)?;
    let (rays, bare) = (tapes.rays(), embree.scene().bare());
    println!(
        "{} triangles, {rays} rays in {} batches, {threads} threads, {}",
        scene.counts().triangles,
        tapes.batches(),
        backend.details()
    );
    println!("round   render Mrays/s   bare Mrays/s   ratio");
    let mut ratios = Vec::new();
    let (mut best_render, mut best_bare) = (0f64, 0f64);
    for round in 0..=args.rounds {
        let outcome = pool.install(|| render::run(&scene, &camera, &backend, &job, &Control::default()))?;
        assert_eq!(outcome.stats.rays.total() as usize, rays, "both trace the same rays");
        let spent = tapes.replay(&pool, |recording| match recording {
            Recording::Nearest(batch) => bare.intersect_batch(batch),
            Recording::Any(batch) => bare.occluded_batch(batch),
        });
        let bare = rays as f64 / spent.as_secs_f64() / 1e6;
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
