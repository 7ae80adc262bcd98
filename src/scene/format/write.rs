//! A scene as TOML text.

use crate::scene::Projection;
use crate::scene::desc::{
    Falloff, LightDesc, MaterialDesc, NamedCamera, ObjectDesc, ReflectDesc, RenderDesc, SceneDesc, ShapeDesc,
    TransformStep, Weight,
};
use std::fmt::{Debug, Write};
use std::path::Path;

/// The scene as a TOML file that reads back as the same scene, places apart.
#[must_use]
pub fn to_toml(desc: &SceneDesc) -> String {
    let mut out = Writer("tison = 1\n".into());
    out.render(&desc.render);
    for c in &desc.cameras {
        out.camera(c);
    }
    for l in &desc.lights {
        out.light(l);
    }
    for m in &desc.materials {
        out.material(m);
    }
    for o in &desc.objects {
        out.object(o);
    }
    out.0
}

struct Writer(String);

impl Writer {
    fn line(&mut self, line: std::fmt::Arguments<'_>) {
        self.0.write_fmt(line).expect("a String takes all");
        self.0.push('\n');
    }

    /// Numbers, booleans and arrays of them look the same in Rust's debug format, with every digit.
    fn key(&mut self, key: &str, value: impl Debug) {
        self.line(format_args!("{key} = {value:?}"));
    }

    fn opt(&mut self, key: &str, value: Option<impl Debug>) {
        if let Some(value) = value {
            self.key(key, value);
        }
    }

    fn text(&mut self, key: &str, value: &str) {
        self.line(format_args!("{key} = {}", quoted(value)));
    }

    fn header(&mut self, group: &str, name: &str) {
        self.line(format_args!("\n[{group}.{}]", quoted(name)));
    }

    fn render(&mut self, r: &RenderDesc) {
        self.line(format_args!("\n[render]"));
        self.opt("size", r.size.map(|(w, h)| [w, h]));
        self.opt("samples", r.samples);
        self.opt("recursion", r.recursion);
        self.opt("min_weight", r.min_weight);
        self.opt("seed", r.seed);
        self.opt("background", r.background);
        self.opt("ambient", r.ambient);
        self.opt("jitter_radius", r.jitter_radius);
        if let Some(filter) = r.filter {
            self.text("filter", filter.name());
        }
        if let Some(sampler) = r.sampler {
            self.text("sampler", sampler.name());
        }
        if let Some(sampler) = r.lens_sampler {
            self.text("lens_sampler", sampler.name());
        }
        if r.course_rules {
            self.key("course_rules", true);
        }
    }

    fn camera(&mut self, NamedCamera { name, camera }: &NamedCamera) {
        self.header("camera", name);
        match camera.projection {
            Projection::Perspective { fov_deg } => {
                self.text("type", "perspective");
                self.key("fov", fov_deg);
            }
            Projection::Orthographic { height } => {
                self.text("type", "orthographic");
                self.key("height", height);
            }
        }
        self.key("eye", camera.eye.to_array());
        self.key("target", camera.target.to_array());
        self.key("up", camera.up.to_array());
        match (camera.aperture, camera.focus) {
            (radius, Some(focus)) => self.line(format_args!("lens = {{ radius = {radius:?}, focus = {focus:?} }}")),
            (radius, None) if radius > 0.0 => self.line(format_args!("lens = {{ radius = {radius:?} }}")),
            _ => {}
        }
        self.opt("aspect", camera.aspect);
        self.opt("clip", camera.clip.map(|(near, far)| [near, far]));
    }

    fn light(&mut self, l: &LightDesc) {
        self.header("light", &l.name);
        self.key("position", l.position.to_array());
        self.key("color", l.color);
        self.key("radius", l.radius);
        if l.falloff == Falloff::None {
            self.text("falloff", "none");
        }
    }

    fn material(&mut self, m: &MaterialDesc) {
        self.header("material", &m.name);
        self.key("color", m.color);
        if let Some(t) = &m.texture {
            self.path("texture", &t.path);
            if t.nearest {
                self.text("texture_filter", "nearest");
            }
        }
        for (key, weight) in [("ambient", m.ambient), ("diffuse", m.diffuse), ("specular", m.specular)] {
            match weight {
                Weight::Share(x) => self.key(key, x),
                Weight::Color(rgb) => self.key(key, rgb),
            }
        }
        self.key("shininess", m.shininess);
        self.key("metallic", m.metallic);
        self.key("emission", m.emission);
        match m.reflect {
            ReflectDesc::Fresnel => self.text("reflect", "fresnel"),
            ReflectDesc::Constant(rgb) => self.key("reflect", rgb),
        }
        self.key("refract", m.refract);
        self.key("ior", m.ior);
        self.key("absorption", m.absorption);
    }

    fn object(&mut self, o: &ObjectDesc) {
        self.line(format_args!("\n[[object]]"));
        self.text("name", &o.name);
        match &o.shape {
            ShapeDesc::Sphere { center, radius } => {
                self.text("shape", "sphere");
                self.key("center", center.to_array());
                self.key("radius", radius);
            }
            ShapeDesc::Cube { half } => {
                self.text("shape", "cube");
                self.key("half", half.to_array());
            }
            ShapeDesc::Cylinder { radius, height, capped } => {
                self.text("shape", "cylinder");
                self.key("radius", radius);
                self.key("height", height);
                self.key("capped", capped);
            }
            ShapeDesc::Quad { half } => {
                self.text("shape", "quad");
                self.key("half", half);
            }
            ShapeDesc::Mesh { path, smooth, .. } => {
                self.path("mesh", path);
                self.opt("smooth", *smooth);
            }
        }
        if let Some(material) = &o.material {
            self.text("material", material);
        }
        if !o.transform.is_empty() {
            let steps: Vec<_> = o.transform.iter().map(step).collect();
            self.line(format_args!("transform = [{}]", steps.join(", ")));
        }
    }

    fn path(&mut self, key: &str, path: &Path) {
        self.text(key, &path.to_string_lossy());
    }
}

fn step(step: &TransformStep) -> String {
    match step {
        TransformStep::Matrix(m) => format!("{{ matrix = {:?} }}", m.transpose().to_cols_array()),
        TransformStep::Fit(length) => format!("{{ fit = {length:?} }}"),
    }
}

/// A TOML basic string.
fn quoted(text: &str) -> String {
    let mut out = String::from("\"");
    for c in text.chars() {
        match c {
            '"' | '\\' => out.extend(['\\', c]),
            c if c.is_control() => write!(out, "\\u{:04X}", u32::from(c)).expect("a String takes all"),
            c => out.push(c),
        }
    }
    out + "\""
}
