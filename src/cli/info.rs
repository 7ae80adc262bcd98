//! `info` and `check`: read a file and tell about it.

use super::args::{InfoArgs, ProgressMode};
use super::exit::{Exit, Failure};
use super::message::Messages;
use super::progress::Progress;
use super::signals::Signals;
use super::style::{bytes, counted, grouped};
use super::{output, render, stats, system};
use glam::{DVec3, Vec3};
use serde_json::{Map, Value, json};
use std::fmt::Write;
use std::path::Path;
use std::sync::Arc;
use tison::render::Control;
use tison::scene::{CameraOverrides, Loaded, Material, Reflect, Scene, View};

/// Materials that the text lists; JSON has all.
const FEW: usize = 20;

/// What is in a file.
pub fn info(args: &InfoArgs, messages: &Messages) -> Result<Exit, Failure> {
    let mut loaded = load(&args.file)?;
    // Lit as a render would light it, so that what it needs is what a render needs.
    let camera = loaded.scene.auto_camera(View::default(), &CameraOverrides::default(), 1.0);
    if let (true, Ok(camera)) = (loaded.scene.lights.is_empty(), camera) {
        loaded.scene.light_from(&camera);
    }
    if args.json {
        return output::print(format!("{:#}\n", as_json(&args.file, &loaded)).as_bytes());
    }
    messages.warnings(&loaded.warnings, false, "tison check shows all");
    output::print(as_text(&args.file, &loaded.scene).as_bytes())
}

/// Whether a file can be rendered.
pub fn check(file: &Path, messages: &Messages) -> Result<Exit, Failure> {
    let loaded = load(file)?;
    messages.warnings(&loaded.warnings, true, "");
    let count = match loaded.warnings.len() {
        0 => String::new(),
        n => format!(", with {}", counted(n as u64, "warning")),
    };
    output::print(format!("{}: ok{count}\n", file.display()).as_bytes())
}

fn load(file: &Path) -> Result<Loaded, Failure> {
    let control = Arc::new(Control::default());
    let signals =
        Signals::install(&control).map_err(|e| Failure::new(Exit::Internal, "cannot listen for signals").because(e))?;
    let progress = Progress::start(ProgressMode::Auto, &control);
    render::load(file, None, &control, &progress).map_err(|e| match signals.caught() {
        Some(exit) => Failure::new(exit, "stopped"),
        None => e.into(),
    })
}

fn as_json(file: &Path, loaded: &Loaded) -> Value {
    let scene = &loaded.scene;
    let bounds = scene.bounds();
    let needs: Map<_, _> =
        scene.needs().list().map(|(name, needed)| (name.to_owned(), needed.into())).into_iter().collect();
    json!({
        "file": file.to_string_lossy(),
        "scene": stats::scene_json(&scene.counts()),
        "bounds": { "min": bounds.lo.to_array(), "max": bounds.hi.to_array(), "size": bounds.size().to_array() },
        "materials": scene.materials.iter().map(material_json).collect::<Vec<_>>(),
        "needs": needs,
        "memory": { "scene_bytes": scene.bytes(), "peak_rss_bytes": system::peak_memory() },
        "warnings": loaded.warnings.iter().map(ToString::to_string).collect::<Vec<_>>(),
    })
}

fn material_json(m: &Material) -> Value {
    let reflect = match m.reflect {
        Reflect::Constant(color) => json!(color.to_array()),
        Reflect::Metal(color) => json!({ "metal": color.to_array() }),
        Reflect::Fresnel => json!("fresnel"),
    };
    json!({
        "name": m.name,
        "ambient": m.ambient.to_array(),
        "diffuse": m.diffuse.to_array(),
        "specular": m.specular.to_array(),
        "shininess": m.shininess,
        "emission": m.emission.to_array(),
        "reflect": reflect,
        "refract": m.refract.to_array(),
        "ior": m.ior,
    })
}

fn as_text(file: &Path, scene: &Scene) -> String {
    let (c, b) = (scene.counts(), scene.bounds());
    let mut out = format!("{}\n", file.display());
    let mut row = |name: &str, value: String| {
        let _ = writeln!(out, "  {name:<11}{value}");
    };
    row("triangles", grouped(c.triangles as u64));
    row(
        "degenerate",
        format!(
            "{} without area, {} out of range: never hit",
            grouped(c.degenerate as u64),
            grouped(c.non_finite as u64)
        ),
    );
    row("vertices", grouped(c.vertices as u64));
    // The mesh holds seven digits of its size; what stands behind them is rounding.
    let decimals = 6 - b.size().max_element().log10().floor().clamp(-30.0, 6.0) as i32;
    let point = |p: DVec3| {
        let [x, y, z] = p.to_array().map(|v| rounded(v, decimals));
        format!("{x}, {y}, {z}")
    };
    row("bounds", format!("{} to {}", point(b.lo), point(b.hi)));
    row("size", point(b.size()));
    let names = |wanted: bool| {
        let list: Vec<String> =
            scene.needs().list().iter().filter(|n| n.1 == wanted).map(|n| n.0.replace('_', " ")).collect();
        if list.is_empty() { "nothing".to_owned() } else { list.join(", ") }
    };
    row("needs", names(true));
    row("needs not", names(false));
    let peak = system::peak_memory().map_or(String::new(), |p| format!(", peak {}", bytes(p)));
    row("memory", format!("scene {}{peak}", bytes(scene.bytes() as u64)));
    row("materials", grouped(c.materials as u64));
    for material in scene.materials.iter().take(FEW) {
        let _ = writeln!(out, "    {}", material_text(material));
    }
    if scene.materials.len() > FEW {
        let _ = writeln!(out, "    and {} more (--json lists all)", scene.materials.len() - FEW);
    }
    out
}

fn material_text(m: &Material) -> String {
    let mut text = format!("{}: diffuse {}", m.name, colour(m.diffuse));
    if m.specular != Vec3::ZERO {
        let _ = write!(text, ", specular {} shininess {}", colour(m.specular), m.shininess);
    }
    match m.reflect {
        _ if !m.reflects() => {}
        Reflect::Constant(color) => drop(write!(text, ", reflects {}", colour(color))),
        Reflect::Metal(color) => drop(write!(text, ", metal {}", colour(color))),
        Reflect::Fresnel => text += ", reflects by Fresnel",
    }
    if m.refracts() {
        let _ = write!(text, ", refracts {} ior {}", colour(m.refract), m.ior);
    }
    if m.emission != Vec3::ZERO {
        let _ = write!(text, ", emits {}", colour(m.emission));
    }
    text
}

fn colour(c: Vec3) -> String {
    format!("{},{},{}", c.x, c.y, c.z)
}

/// `v` with `decimals` digits behind the point, the last zeros left out.
fn rounded(v: f64, decimals: i32) -> f64 {
    format!("{v:.0$}", decimals.max(0) as usize).parse::<f64>().map_or(v, |r| r + 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rounding_leaves_the_digits_that_count() {
        assert_eq!(rounded(-1.600_000_023_841_858, 6).to_string(), "-1.6");
        assert_eq!(rounded(4_649_776.220_000_1, 4).to_string(), "4649776.22");
        assert_eq!(rounded(1.234_567_8e-9, 15).to_string(), "0.000000001234568");
        assert_eq!(rounded(-1e-12, 6).to_string(), "0");
        assert_eq!(rounded(f64::INFINITY, 3), f64::INFINITY);
    }
}
