//! `info` and `check`: read a file and tell about it.

use super::args::{CheckArgs, InfoArgs, ProgressMode, ReadingArgs, RenderArgs};
use super::cost::Cost;
use super::exit::{Exit, Failure};
use super::message::Messages;
use super::notice::Notice;
use super::plan::{Input, Plan};
use super::progress::Progress;
use super::render::Reading;
use super::settings::Settings;
use super::signals::Signals;
use super::style::{bytes, counted, grouped};
use super::{output, render, stats, system};
use glam::{DVec3, Vec3};
use serde_json::{Map, Value, json};
use std::fmt::Write;
use std::path::Path;
use std::sync::Arc;
use tison::geom::Bounds;
use tison::math::{Filter, Frame, Sampler};
use tison::render::Control;
use tison::scene::desc::{LensSampler, NamedCamera, RenderDesc};
use tison::scene::{CameraOverrides, Light, Loaded, Material, Projection, Reflect, Scene, View};

/// Materials that the text lists; JSON has all.
const FEW: usize = 20;

/// What is in a file.
pub fn info(args: &InfoArgs, messages: &Messages) -> Result<Exit, Failure> {
    let mut loaded = load(&args.file, &args.reading)?;
    if Input::of(&args.file) == Input::Mesh {
        // Lit as a render would light it, so that what it needs is what a render needs.
        if let Ok(camera) = loaded.scene.auto_camera(View::default(), &CameraOverrides::default(), 1.0) {
            loaded.scene.light_from(&camera);
        }
    }
    let cost = cost_of_render(args, &loaded)?;
    if args.json {
        return output::print(format!("{:#}\n", as_json(&args.file, &loaded, &cost)).as_bytes());
    }
    messages.warnings(&Notice::about(&loaded), false, "tison check shows all");
    output::print(as_text(&args.file, &loaded, &cost).as_bytes())
}

/// What a render of the file without further flags takes.
fn cost_of_render(args: &InfoArgs, loaded: &Loaded) -> Result<Cost, Failure> {
    let file = Some(args.file.clone());
    let plan = Plan::new(&RenderArgs { input: file, reading: args.reading.clone(), ..RenderArgs::default() })?;
    let settings = Settings::new(&plan, &loaded.render)?;
    let rays = render::rays_expected(&plan, &settings.job, &loaded.scene);
    Ok(Cost::of_unbuilt(&loaded.scene, plan.backend.kinds(), rays))
}

/// Whether a file can be rendered.
pub fn check(args: &CheckArgs, messages: &Messages) -> Result<Exit, Failure> {
    let loaded = load(&args.file, &args.reading)?;
    let notices = Notice::about(&loaded);
    if args.strict {
        messages.strict(&notices)?;
    }
    messages.warnings(&notices, true, "");
    let count = match notices.len() {
        0 => String::new(),
        n => format!(", with {}", counted(n as u64, "warning")),
    };
    output::print(format!("{}: ok{count}\n", args.file.display()).as_bytes())
}

fn load(file: &Path, reading: &ReadingArgs) -> Result<Loaded, Failure> {
    Input::of(file).check_reading(reading, file)?;
    let control = Arc::new(Control::default());
    let signals =
        Signals::install(&control).map_err(|e| Failure::new(Exit::Internal, "cannot listen for signals").because(e))?;
    let progress = Progress::start(ProgressMode::Auto, &control);
    let reading = Reading {
        skips: tison::scene::Skips::ALL,
        exact: false,
        reader: reading.obj_reader,
        smooth: None,
        allow: &reading.allow_path,
        defines: &reading.define,
    };
    render::load(file, &reading, &control, &progress).map_err(|e| match signals.caught() {
        Some(exit) => Failure::new(exit, "stopped"),
        None => e.into(),
    })
}

fn as_json(file: &Path, loaded: &Loaded, cost: &Cost) -> Value {
    let scene = &loaded.scene;
    let bounds = scene.bounds();
    let needs: Map<_, _> =
        scene.needs().list().map(|(name, needed)| (name.to_owned(), needed.into())).into_iter().collect();
    let mut memory = cost.json();
    memory["peak_rss_bytes"] = system::peak_memory().into();
    json!({
        "file": file.to_string_lossy(),
        "scene": stats::scene_json(&scene.counts()),
        // Infinite ends of an empty box become null.
        "bounds": { "min": bounds.lo.to_array(), "max": bounds.hi.to_array(), "size": bounds.size().to_array() },
        "render": render_json(&loaded.render),
        "cameras": loaded.cameras.iter().map(camera_json).collect::<Vec<_>>(),
        "lights": scene.lights.iter().map(|l| light_json(l, &scene.frame)).collect::<Vec<_>>(),
        "materials": scene.materials.iter().map(material_json).collect::<Vec<_>>(),
        "textures": scene.textures.iter().map(|t| json!({ "width": t.width, "height": t.height })).collect::<Vec<_>>(),
        "needs": needs,
        "memory": memory,
        "warnings": Notice::about(loaded).iter().map(ToString::to_string).collect::<Vec<_>>(),
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
        "absorption": m.absorption.to_array(),
        "texture": m.texture.map(|t| t.image),
    })
}

/// What the scene file says about the picture; null where it is silent.
fn render_json(r: &RenderDesc) -> Value {
    json!({
        "size": r.size,
        "samples": r.samples,
        "recursion": r.recursion,
        "min_weight": r.min_weight,
        "seed": r.seed,
        "background": r.background,
        "ambient": r.ambient,
        "jitter_radius": r.jitter_radius,
        "filter": r.filter.map(Filter::name),
        "sampler": r.sampler.map(Sampler::name),
        "lens_sampler": r.lens_sampler.map(LensSampler::name),
        "course_rules": r.course_rules,
    })
}

fn camera_json(NamedCamera { name, camera }: &NamedCamera) -> Value {
    let (fov, height) = match camera.projection {
        Projection::Perspective { fov_deg } => (Some(fov_deg), None),
        Projection::Orthographic { height } => (None, Some(height)),
    };
    json!({
        "name": name,
        "eye": camera.eye.to_array(),
        "target": camera.target.to_array(),
        "up": camera.up.to_array(),
        "fov": fov,
        "height": height,
        "aperture": camera.aperture,
        "focus": camera.focus,
        "aspect": camera.aspect,
        "clip": camera.clip,
    })
}

fn light_json(l: &Light, frame: &Frame) -> Value {
    json!({
        "position": frame.to_world(l.position).to_array(),
        "color": l.color.to_array(),
        "radius": l.radius * frame.world_per_local(),
        "falloff": if l.falloff.is_some() { "inverse-square" } else { "none" },
    })
}

fn as_text(file: &Path, loaded: &Loaded, cost: &Cost) -> String {
    let scene = &loaded.scene;
    let mut out = format!("{}\n", file.display());
    let mut row = |name: &str, value: String| {
        let _ = writeln!(out, "  {name:<11}{value}");
    };
    for (name, value) in counts_text(scene, Input::of(file)) {
        row(name, value);
    }
    if !loaded.cameras.is_empty() {
        let names: Vec<&str> = loaded.cameras.iter().map(|c| c.name.as_str()).collect();
        row("cameras", format!("{}: {}", grouped(names.len() as u64), names.join(", ")));
    }
    for (name, value) in bounds_text(scene.bounds()) {
        row(name, value);
    }
    let names = |wanted: bool| {
        let list: Vec<String> =
            scene.needs().list().iter().filter(|n| n.1 == wanted).map(|n| n.0.replace('_', " ")).collect();
        if list.is_empty() { "nothing".to_owned() } else { list.join(", ") }
    };
    row("needs", names(true));
    row("needs not", names(false));
    row("memory", cost.text());
    row("", cost.buffers_text());
    if let Some(peak) = system::peak_memory() {
        row("", format!("peak {} to read it", bytes(peak)));
    }
    let textured = scene.materials.iter().filter(|m| m.texture.is_some()).count() as u64;
    let with_texture = if textured > 0 { format!(", {} with a texture", grouped(textured)) } else { String::new() };
    row("materials", grouped(scene.materials.len() as u64) + &with_texture);
    for material in scene.materials.iter().take(FEW) {
        let _ = writeln!(out, "    {}", material_text(material));
    }
    if scene.materials.len() > FEW {
        let _ = writeln!(out, "    and {} more (--json lists all)", scene.materials.len() - FEW);
    }
    out
}

/// Numbers of things that the file has; the lights of a bare mesh are ours.
fn counts_text(scene: &Scene, kind: Input) -> Vec<(&'static str, String)> {
    let c = scene.counts();
    let mut rows = Vec::new();
    if c.triangles > 0 {
        let never = format!(
            "{} without area, {} out of range: never hit",
            grouped(c.degenerate as u64),
            grouped(c.non_finite as u64)
        );
        rows.extend([
            ("triangles", grouped(c.triangles as u64)),
            ("degenerate", never),
            ("vertices", grouped(c.vertices as u64)),
        ]);
    }
    let others = [
        ("instances", c.instances),
        ("spheres", c.spheres),
        ("cubes", c.cubes),
        ("cylinders", c.cylinders),
        ("quads", c.quads),
        ("lights", if kind == Input::Scene { c.lights } else { 0 }),
        ("textures", c.textures),
    ];
    rows.extend(others.into_iter().filter(|&(_, n)| n > 0).map(|(name, n)| (name, grouped(n as u64))));
    rows
}

fn bounds_text(b: Bounds) -> Vec<(&'static str, String)> {
    if b.is_empty() {
        return vec![("bounds", "nothing to hit".into())];
    }
    // f32 holds seven digits of a scene's size; what stands behind them is rounding.
    let decimals = 6 - b.size().max_element().log10().floor().clamp(-30.0, 6.0) as i32;
    let point = |p: DVec3| {
        let [x, y, z] = p.to_array().map(|v| rounded(v, decimals));
        format!("{x}, {y}, {z}")
    };
    vec![("bounds", format!("{} to {}", point(b.lo), point(b.hi))), ("size", point(b.size()))]
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
    if m.absorption != Vec3::ZERO {
        let _ = write!(text, ", absorbs {}", colour(m.absorption));
    }
    if m.emission != Vec3::ZERO {
        let _ = write!(text, ", emits {}", colour(m.emission));
    }
    if let Some(texture) = m.texture {
        let _ = write!(text, ", texture {}", texture.image);
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
