//! Bytes per triangle and per sphere of every hierarchy: what [`Estimate`](tison::backend::Estimate) is made from.
//!
//!     cargo bench --bench memory [-- --triangles 10000,100000 FILE.obj …]
//!
//! `rss` is what the process grew by while it was built, as the system saw it; nothing where it does not say.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use tison::backend::{AnyBackend, BackendKind, BuildOptions};
use tison::geom::{Plain, Sphere};
use tison::math::Random;
use tison::scene::example::{self, Surface};
use tison::scene::{AnyShapes, LoadOptions, Mesh, Object, Scene, Shapes, load};

static GO_ON: AtomicBool = AtomicBool::new(false);

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let (mut triangles, mut files) = (vec![10_000, 100_000, 1_000_000, 10_000_000], Vec::new());
    let mut args = std::env::args().skip(1).filter(|a| a != "--bench");
    while let Some(arg) = args.next() {
        match arg.as_str() {
            "--triangles" => {
                let list = args.next().ok_or("--triangles needs numbers")?;
                triangles = list.split(',').filter(|n| *n != "0").map(str::parse).collect::<Result<_, _>>()?;
            }
            file => files.push(PathBuf::from(file)),
        }
    }
    println!(
        "{:28} {:>10}  {:8} {:6} {:>9} {:>9} {:>9}",
        "scene", "things", "backend", "build", "bytes", "peak", "rss"
    );
    for n in triangles {
        for surface in [Surface::Round, Surface::Rock] {
            let scene = Scene::of(vec![Object::Mesh(Mesh::bare(example::mesh(n, surface)))]);
            rows(&format!("{surface:?}").to_lowercase(), &scene)?;
        }
    }
    for n in [10_000, 1_000_000] {
        let mut random = Random(7);
        let radius = 1.27 / f64::from(n).sqrt();
        let mut spheres = Plain::default();
        for _ in 0..n {
            spheres.push(Sphere::new(random.point(), radius)?);
        }
        rows("spheres", &Scene::of(vec![Object::Shapes(Shapes::bare(AnyShapes::Spheres(Arc::new(spheres))))]))?;
    }
    for file in files {
        rows(&file.display().to_string(), &load(&file, &LoadOptions::new(&GO_ON))?.scene)?;
    }
    Ok(())
}

fn rows(name: &str, scene: &Scene) -> Result<(), Box<dyn std::error::Error>> {
    let things = (scene.stored_triangles() + scene.shapes()) as f64;
    for &kind in BackendKind::COMPILED {
        for (quality, rays_expected) in [("quick", 0), ("good", u64::MAX)] {
            let before = rss("VmRSS:");
            // Forgets the peak of what came before.
            let forgotten = std::fs::write("/proc/self/clear_refs", "5").is_ok();
            let options = BuildOptions { rays_expected, ..BuildOptions::new(&GO_ON) };
            let built = AnyBackend::build(kind, scene, &options)?;
            let grown =
                before.zip(rss("VmHWM:")).filter(|_| forgotten).map(|(before, peak)| peak.saturating_sub(before));
            let per = |bytes: u64| format!("{:.1}", bytes as f64 / things);
            println!(
                "{name:28} {things:10}  {:8} {quality:6} {:>9} {:>9} {:>9}",
                kind.name(),
                per(built.bytes()),
                per(built.peak_bytes()),
                grown.map_or_else(|| "-".into(), per)
            );
        }
    }
    Ok(())
}

fn rss(field: &str) -> Option<u64> {
    let text = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = text.lines().find_map(|line| line.strip_prefix(field))?;
    Some(line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()? * 1024)
}
