//! What the statements mean: checks their values and makes the scene.

use super::{Argument, Parameter, Value};
use crate::scene::desc::{
    Falloff, LightDesc, MaterialDesc, NamedCamera, ObjectDesc, Place, ReflectDesc, RenderDesc, SceneDesc, ShapeDesc,
    TextureDesc, TransformStep, Weight,
};
use crate::scene::format::diagnostic::Diagnostic;
use crate::scene::format::material::IOR;
use crate::scene::format::model::{MOST_PIXELS, MOST_RECURSION, MOST_SAMPLES};
use crate::scene::format::object::{rotation, singular};
use crate::scene::format::tree::{Context, Span};
use crate::scene::{CameraDesc, Projection};
use glam::{DMat4, DVec3, DVec4};
use std::collections::{HashMap, HashSet};
use std::path::PathBuf;

/// `PushMatrix` may be nested this deep.
const MOST_PUSHES: usize = 1000;

/// From a cylinder around z to the course's around y, by a quarter turn around x. The azimuth
/// `atan2(ny, nx)` there is `atan2(-nz, nx)`, a quarter turn less than `atan2(nx, nz)` here, so
/// that the texture's `u = fract(3/4 + atan2(nx, nz) / 2π)` is kept.
const FROM_Z_TO_Y: DMat4 = DMat4::from_cols(DVec4::X, DVec4::NEG_Z, DVec4::Y, DVec4::W);

type Number = Argument<f64>;
type Text<'a> = Argument<&'a str>;

pub(super) struct Builder<'c> {
    ctx: &'c Context,
    desc: SceneDesc,
    current: DMat4,
    pushed: Vec<(DMat4, Span)>,
    perspective: Option<[f64; 4]>,
    look_at: Option<([f64; 9], Span)>,
    /// Lens radius and focus distance.
    lens: Option<(f64, f64)>,
    /// Where statements that count once, and materials, were last given.
    once: HashMap<&'static str, Span>,
    materials: HashMap<String, (usize, Span)>,
    /// First use of each material's name.
    used: Vec<(String, Span)>,
    uses: HashSet<String>,
}

impl<'c> Builder<'c> {
    pub fn new(ctx: &'c Context) -> Self {
        let render = RenderDesc {
            background: Some([0.0; 3]),
            ambient: Some([0.0; 3]),
            min_weight: Some(0.0),
            course_rules: true,
            ..RenderDesc::default()
        };
        Self {
            ctx,
            desc: SceneDesc { render, ..SceneDesc::default() },
            current: DMat4::IDENTITY,
            pushed: Vec::new(),
            perspective: None,
            look_at: None,
            lens: None,
            once: HashMap::new(),
            materials: HashMap::new(),
            used: Vec::new(),
            uses: HashSet::new(),
        }
    }

    fn error(&self, at: Span, what: impl Into<String>, expected: &str) {
        self.ctx.error(at, |s| Diagnostic::error(s, what).expected(format!("expected {expected}")));
    }

    fn place(&self, at: Span) -> Place {
        self.ctx.source(at.file).place(at.start)
    }

    /// Notes a statement that counts once.
    fn once(&mut self, name: &'static str, at: Span) {
        if let Some(first) = self.once.insert(name, at) {
            self.ctx.warn(at, |s| {
                Diagnostic::warning(s, format!("`{name}` is given twice; the last one counts"))
                    .related(self.ctx.spot(first), "first given here")
            });
        }
    }

    fn whole(&self, x: Number, range: std::ops::RangeInclusive<u32>, what: &str) -> Option<u32> {
        let bounds = f64::from(*range.start())..=f64::from(*range.end());
        if x.value.fract() == 0.0 && bounds.contains(&x.value) {
            return Some(x.value as u32);
        }
        let expected = format!("a whole number from {} to {}", range.start(), range.end());
        self.error(x.at, format!("{what} cannot be {}", x.value), &expected);
        None
    }

    /// Whether `x` is above 0, else a mistake.
    fn positive(&self, x: Number, what: &str) -> bool {
        if x.value <= 0.0 {
            self.error(x.at, format!("{what} cannot be {}", x.value), "a number above 0");
        }
        x.value > 0.0
    }

    pub fn dimension(&mut self, at: Span, [w, h]: [Number; 2]) {
        self.once("dimension", at);
        let (w, h) = (self.whole(w, 1..=MOST_PIXELS, "the width"), self.whole(h, 1..=MOST_PIXELS, "the height"));
        self.desc.render.size = w.zip(h);
    }

    pub fn container(&mut self, at: Span, kind: Text<'_>) {
        self.once("container", at);
        if !matches!(kind.value, "Naive" | "BVH") {
            self.ctx.error(kind.at, |s| {
                Diagnostic::error(s, format!("unknown container \"{}\"", kind.value))
                    .expected("expected \"Naive\" or \"BVH\"")
                    .suggest(kind.value, ["Naive", "BVH"])
            });
        }
    }

    pub fn samples(&mut self, at: Span, [n]: [Number; 1]) {
        self.once("samples_per_pixel", at);
        self.desc.render.samples = self.whole(n, 1..=MOST_SAMPLES, "the number of samples");
    }

    pub fn depth(&mut self, at: Span, [n]: [Number; 1]) {
        self.once("max_ray_depth", at);
        self.desc.render.recursion = self.whole(n, 0..=MOST_RECURSION, "the number of bounces");
    }

    pub fn jitter(&mut self, at: Span, [r]: [Number; 1]) {
        self.once("jitter_radius", at);
        if !(0.0..=16.0).contains(&r.value) {
            self.error(r.at, format!("the jitter radius cannot be {}", r.value), "pixels from 0 to 16");
        }
        self.desc.render.jitter_radius = Some(r.value);
    }

    pub fn ambient(&mut self, at: Span, light: Argument<[f64; 3]>) {
        self.once("ambient_light", at);
        self.warn_negative("ambient_light", light.at, light.value);
        self.desc.render.ambient = Some(light.value);
    }

    fn warn_negative(&self, what: &str, at: Span, values: impl IntoIterator<Item = f64>) {
        if values.into_iter().any(|x| x < 0.0) {
            self.ctx.warn(at, |s| Diagnostic::warning(s, format!("{what} is negative: it takes light away")));
        }
    }

    pub fn perspective(&mut self, at: Span, [fov, aspect, near, far]: [Number; 4]) {
        self.once("Perspective", at);
        if !(fov.value > 0.0 && fov.value < 180.0) {
            self.error(fov.at, format!("the field of view cannot be {}", fov.value), "degrees, above 0 and below 180");
        }
        self.positive(aspect, "the aspect ratio");
        if near.value < 0.0 {
            self.error(near.at, format!("the near distance cannot be {}", near.value), "a distance, at least 0");
        } else if far.value <= near.value {
            self.error(far.at, "the far distance is not beyond the near one", &format!("more than {}", near.value));
        }
        self.perspective = Some([fov, aspect, near, far].map(|n| n.value));
    }

    pub fn look_at(&mut self, at: Span, n: [Number; 9]) {
        self.once("LookAt", at);
        let all = Span { end: n[8].at.end, ..n[0].at };
        self.look_at = Some((n.map(|n| n.value), all));
    }

    /// The angle is that of the whole cone from the point in focus to the lens.
    pub fn dof(&mut self, at: Span, [angle, distance]: [Number; 2]) {
        self.once("DOF", at);
        if !(0.0..180.0).contains(&angle.value) {
            self.error(angle.at, format!("the lens's angle cannot be {}", angle.value), "degrees, from 0 to below 180");
        }
        if angle.value == 0.0 {
            self.lens = None;
        } else if self.positive(distance, "the distance in focus") {
            self.lens = Some((distance.value * (0.5 * angle.value.to_radians()).tan(), distance.value));
        }
    }

    pub fn push(&mut self, at: Span) {
        if self.pushed.len() == MOST_PUSHES {
            self.error(at, format!("more than {MOST_PUSHES} matrices are pushed"), "PopMatrix before");
        }
        self.pushed.push((self.current, at));
    }

    pub fn pop(&mut self, at: Span) {
        match self.pushed.pop() {
            Some((matrix, _)) => self.current = matrix,
            None => self.error(at, "PopMatrix without a PushMatrix before it", "PushMatrix before it"),
        }
    }

    pub fn translate(&mut self, [x, y, z]: [Number; 3]) {
        self.current *= DMat4::from_translation(DVec3::new(x.value, y.value, z.value));
    }

    pub fn scale(&mut self, factors: [Number; 3]) {
        for f in factors.iter().filter(|f| f.value == 0.0) {
            self.error(f.at, "scaling by 0 makes everything flat", "a number other than 0");
        }
        // One that is wrong would be reported again at every object.
        let [x, y, z] = factors.map(|f| if f.value == 0.0 { 1.0 } else { f.value });
        self.current *= DMat4::from_scale(DVec3::new(x, y, z));
    }

    pub fn rotate(&mut self, [degrees, x, y, z]: [Number; 4]) {
        match rotation(DVec3::new(x.value, y.value, z.value), degrees.value) {
            Some(m) => self.current *= m,
            None => self.error(Span { end: z.at.end, ..x.at }, "the axis of the rotation is zero", "a direction"),
        }
    }

    fn object(&mut self, at: Span, shape: ShapeDesc, material: Text<'_>, own: DMat4) {
        let matrix = self.current * own;
        if singular(&matrix) {
            self.error(at, "the current transform cannot be undone", "smaller scales and distances");
        }
        let transform = if matrix == DMat4::IDENTITY { Vec::new() } else { vec![TransformStep::Matrix(matrix)] };
        if !self.uses.contains(material.value) {
            self.uses.insert(material.value.into());
            self.used.push((material.value.into(), material.at));
        }
        let name = format!("object.{}", self.desc.objects.len());
        let (material, place) = (Some(material.value.into()), self.place(at));
        self.desc.objects.push(ObjectDesc { name, shape, material, transform, place });
    }

    pub fn sphere(&mut self, at: Span, [r]: [Number; 1], material: Text<'_>) {
        if self.positive(r, "the radius") {
            let shape = ShapeDesc::Sphere { center: DVec3::ZERO, radius: r.value };
            self.object(at, shape, material, DMat4::IDENTITY);
        }
    }

    pub fn quad(&mut self, at: Span, [half]: [Number; 1], material: Text<'_>) {
        if self.positive(half, "half the side") {
            self.object(at, ShapeDesc::Quad { half: half.value }, material, DMat4::IDENTITY);
        }
    }

    pub fn cylinder(&mut self, at: Span, [r, half]: [Number; 2], material: Text<'_>) {
        if self.positive(r, "the radius") & self.positive(half, "half the height") {
            let shape = ShapeDesc::Cylinder { radius: r.value, height: 2.0 * half.value, capped: false };
            self.object(at, shape, material, FROM_Z_TO_Y);
        }
    }

    pub fn mesh(&mut self, at: Span, file: Text<'_>, material: Text<'_>) {
        if file.value.is_empty() || file.value.contains('\0') {
            self.error(file.at, "a mesh without a file", "the name of an .obj file");
            return;
        }
        let shape = ShapeDesc::Mesh { path: file.value.into(), smooth: None, place: self.place(file.at) };
        self.object(at, shape, material, DMat4::IDENTITY);
    }

    pub fn light(&mut self, at: Span, position: [Number; 3], list: &[Parameter<'_>]) {
        if self.current != DMat4::IDENTITY {
            self.ctx.warn(at, |s| Diagnostic::warning(s, "the current transform does not move lights"));
        }
        let (mut color, mut radius) = ([0.0; 3], 0.0);
        for p in list {
            match (p.key, p.value) {
                ("emission", Value::Vector(rgb)) => {
                    self.warn_negative("the emission", p.at, rgb);
                    color = rgb;
                }
                ("radius", Value::Number(r)) if r >= 0.0 => radius = r,
                ("radius", Value::Number(_)) => self.error(p.at, "a negative radius", "a number, at least 0"),
                _ => self.wrong_parameter("SphericalLight", p, &[("emission", "[r g b]"), ("radius", "a number")]),
            }
        }
        let name = format!("light.{}", self.desc.lights.len());
        let position = DVec3::from_array(position.map(|n| n.value));
        self.desc.lights.push(LightDesc { name, position, color, radius, falloff: Falloff::InverseSquare });
    }

    /// A key that is unknown, or whose value is of another kind.
    fn wrong_parameter(&self, statement: &str, p: &Parameter<'_>, keys: &[(&str, &str)]) {
        if let Some((key, kind)) = keys.iter().find(|(key, _)| *key == p.key) {
            return self.error(p.at, format!("\"{key}\" has a value of another kind"), kind);
        }
        let names = keys.iter().map(|(key, _)| *key);
        self.ctx.error(p.key_at, |s| {
            Diagnostic::error(s, format!("`{statement}` has no key \"{}\"", p.key))
                .expected(format!("expected one of {}", names.clone().collect::<Vec<_>>().join(", ")))
                .suggest(p.key, names)
        });
    }

    pub fn material(&mut self, at: Span, name: Text<'_>, list: &[Parameter<'_>]) {
        let desc = self.material_desc(at, name, list);
        match self.materials.get_mut(name.value) {
            Some((index, first)) => {
                self.ctx.warn(name.at, |s| {
                    let what = format!("material \"{}\" is defined twice; the last one counts", name.value);
                    Diagnostic::warning(s, what).related(self.ctx.spot(*first), "first defined here")
                });
                self.desc.materials[*index] = desc;
                *first = name.at;
            }
            None => {
                self.materials.insert(name.value.into(), (self.desc.materials.len(), name.at));
                self.desc.materials.push(desc);
            }
        }
    }

    /// Every number that is missing is 0.
    fn material_desc(&self, at: Span, name: Text<'_>, list: &[Parameter<'_>]) -> MaterialDesc {
        const KEYS: [(&str, &str); 10] = [
            ("texture_albedo", "the name of an image file in quotes"),
            ("color_albedo", "[r g b]"),
            ("k_ambient", "a number"),
            ("k_diffuse", "a number"),
            ("k_specular", "a number"),
            ("shininess", "a number, at least 0"),
            ("metallic", "a number"),
            ("k_reflection", "a number"),
            ("k_refraction", "a number"),
            ("refractive_index", "a number"),
        ];
        let mut m = MaterialDesc {
            name: name.value.into(),
            color: [0.0; 3],
            ambient: Weight::Share(0.0),
            diffuse: Weight::Share(0.0),
            shininess: 0.0,
            place: self.place(at),
            ..MaterialDesc::default()
        };
        let (mut ior, mut refraction) = ((0.0, name.at), 0.0);
        for p in list {
            match (p.key, p.value) {
                ("texture_albedo", Value::String("")) => m.texture = None,
                ("texture_albedo", Value::String(file)) if !file.contains('\0') => {
                    m.texture = Some(TextureDesc { path: file.into(), nearest: true, place: self.place(p.at) });
                }
                ("color_albedo", Value::Vector(rgb)) => {
                    self.warn_negative("the colour", p.at, rgb);
                    m.color = rgb;
                }
                ("shininess", Value::Number(x)) if x >= 0.0 => m.shininess = x,
                ("metallic", Value::Number(x)) => m.metallic = x,
                ("refractive_index", Value::Number(x)) => ior = (x, p.at),
                (
                    key @ ("k_ambient" | "k_diffuse" | "k_specular" | "k_reflection" | "k_refraction"),
                    Value::Number(x),
                ) => {
                    self.warn_negative(key, p.at, [x]);
                    match key {
                        "k_ambient" => m.ambient = Weight::Share(x),
                        "k_diffuse" => m.diffuse = Weight::Share(x),
                        "k_specular" => m.specular = Weight::Share(x),
                        "k_reflection" => m.reflect = ReflectDesc::Constant([x; 3]),
                        _ => refraction = x,
                    }
                }
                _ => self.wrong_parameter("Material", p, &KEYS),
            }
        }
        if m.texture.is_some() {
            m.color = [1.0; 3];
        }
        m.refract = [refraction; 3];
        m.ior = if IOR.contains(&ior.0) { ior.0 } else { 1.0 };
        if refraction != 0.0 && m.ior != ior.0 {
            let what = format!("material \"{}\" refracts with an index of {}", name.value, ior.0);
            self.error(ior.1, what, "\"refractive_index\" from 0.001 to 100");
        }
        m
    }

    /// The scene, after the last statement, which ends at `end`.
    pub fn finish(mut self, end: Span, files: Vec<PathBuf>) -> SceneDesc {
        if let Some(&(_, open)) = self.pushed.last() {
            self.ctx.warn(open, |s| Diagnostic::warning(s, "PushMatrix without a PopMatrix after it"));
        }
        for (name, at) in self.used.iter().filter(|(name, _)| !self.materials.contains_key(name)) {
            self.ctx.error(*at, |s| {
                Diagnostic::error(s, format!("no material is called \"{name}\""))
                    .expected("expected the name of a Material of this file")
                    .suggest(name, self.materials.keys().map(String::as_str))
            });
        }
        self.camera(end);
        self.desc.files = files;
        self.desc
    }

    fn camera(&mut self, end: Span) {
        let ([fov_deg, aspect, near, far], (n, at)) = match (self.perspective, self.look_at) {
            (Some(p), Some(l)) => (p, l),
            (None, None) => {
                let help = "add Perspective and LookAt";
                self.ctx.warn(end, |s| Diagnostic::warning(s, "the scene has no camera").help(help));
                return;
            }
            (p, _) => {
                let (there, missing) = if p.is_some() { ("Perspective", "LookAt") } else { ("LookAt", "Perspective") };
                let what = format!("{there} without {missing}");
                return self.error(self.once[there], what, &format!("{missing} as well"));
            }
        };
        let [eye, target, up] = [0, 3, 6].map(|i| DVec3::new(n[i], n[i + 1], n[i + 2]));
        let (aperture, focus) = self.lens.map_or((0.0, None), |(radius, distance)| (radius, Some(distance)));
        let camera = CameraDesc {
            eye,
            target,
            up,
            projection: Projection::Perspective { fov_deg },
            aperture,
            focus,
            aspect: Some(aspect),
            clip: Some((near, far)),
        };
        if camera.basis().is_err() {
            self.error(at, "the camera has no view", "an eye and a target apart, and up across the view");
        }
        self.desc.cameras.push(NamedCamera { name: "main".into(), camera });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::format::{ReadOptions, parse};
    use std::f64::consts::TAU;
    use std::path::Path;

    fn read(text: &str) -> SceneDesc {
        let found = parse(Path::new("a.ray"), text.as_bytes(), &ReadOptions::default());
        found.unwrap_or_else(|e| panic!("{}", e[0])).0
    }

    /// Where the last object of the scene puts a point.
    fn put(text: &str, point: [f64; 3]) -> DVec3 {
        let desc = read(&format!("{text}\nMaterial \"m\""));
        match desc.objects.last().expect("there is one").transform[..] {
            [] => DVec3::from_array(point),
            [TransformStep::Matrix(m)] => m.transform_point3(point.into()),
            _ => panic!("one matrix at most"),
        }
    }

    #[test]
    fn the_last_transform_is_applied_first() {
        let text = "Translate 1 2 3 Scale 2 1 1 Rotate 90 0 0 1";
        assert_eq!(put(&format!("{text} Sphere 1 \"m\""), [1.0, 0.0, 0.0]), DVec3::new(1.0, 3.0, 3.0));
        assert_eq!(put(&format!("{text} Sphere 1 \"m\""), [0.0, 1.0, 0.0]), DVec3::new(-1.0, 2.0, 3.0));
        // What is pushed is left as it was.
        let text = format!("Translate 0 0 1 PushMatrix {text} PushMatrix Scale 9 9 9 PopMatrix PopMatrix Quad 1 \"m\"");
        assert_eq!(put(&text, [1.0, 1.0, 1.0]), DVec3::new(1.0, 1.0, 2.0));
    }

    #[test]
    fn a_cylinder_stands_on_y_with_its_seam_where_the_course_has_it() {
        let desc = read("Material \"m\" Cylinder 0.75 1.5 \"m\"");
        assert_eq!(desc.objects[0].shape, ShapeDesc::Cylinder { radius: 0.75, height: 3.0, capped: false });
        assert_eq!(put("Cylinder 1 1 \"m\"", [0.0, 0.0, 1.0]), DVec3::Y);
        for i in 0..16 {
            let angle = (f64::from(i) + 0.5) / 16.0 * TAU;
            let own = [angle.cos(), angle.sin(), 0.0];
            let n = put("Cylinder 1 1 \"m\"", own);
            let course = (0.75 + n.x.atan2(n.z) / TAU).rem_euclid(1.0);
            let ours = (own[1].atan2(own[0]) / TAU).rem_euclid(1.0);
            assert!((course - ours).abs() < 1e-14, "{course} {ours}");
        }
    }

    #[test]
    fn the_camera_is_taken_literally() {
        let desc = read("Perspective 30 1.33 3 20 LookAt 0 1.25 15 0 0 0 0 0.99 -0.12 DOF 4 10 dimension 640 480");
        let c = &desc.cameras[0];
        assert_eq!((c.camera.aspect, c.camera.clip), (Some(1.33), Some((3.0, 20.0))));
        assert_eq!(c.camera.eye, DVec3::new(0.0, 1.25, 15.0));
        assert_eq!(c.camera.projection, Projection::Perspective { fov_deg: 30.0 });
        // Half of the 4 degrees on each side of the axis, 10 away.
        assert!((c.camera.aperture - 10.0 * 2.0_f64.to_radians().tan()).abs() < 1e-15);
        assert_eq!(c.camera.focus, Some(10.0));
        let pinhole = read("Perspective 30 1 3 20 LookAt 0 0 9 0 0 0 0 1 0 DOF 0 10");
        assert_eq!((pinhole.cameras[0].camera.aperture, pinhole.cameras[0].camera.focus), (0.0, None));
    }

    #[test]
    fn materials_lights_and_settings_mean_what_the_sheet_says() {
        let desc = read(
            "\u{feff}# caf\u{e9}\r\nambient_light[.5 0 1.]samples_per_pixel 5 jitter_radius .5 max_ray_depth 0\r\n\
             Material \"full\" \"texture_albedo\" \"a b.bmp\" \"color_albedo\" [.1 .2 .3] \"k_ambient\" .4 \"k_diffuse\" 5e-1\n\
             \"k_specular\" 0.6 \"shininess\" 7 \"metallic\" 0.25 \"k_reflection\" 0.8 \"k_refraction\" 0.9 \"refractive_index\" 4\n\
             Material \"bare\" Material \"plain\" \"texture_albedo\" \"\" \"color_albedo\" [.1 .2 .3]\n\
             SphericalLight 1 -2 3 \"radius\" 0.4 \"emission\" [1 2 3] SphericalLight 0 0 0",
        );
        let r = &desc.render;
        assert_eq!((r.ambient, r.samples, r.jitter_radius), (Some([0.5, 0.0, 1.0]), Some(5), Some(0.5)));
        assert_eq!((r.recursion, r.background, r.min_weight), (Some(0), Some([0.0; 3]), Some(0.0)));
        let [full, bare, plain] = &desc.materials[..] else { panic!("three") };
        assert_eq!((full.ambient, full.diffuse), (Weight::Share(0.4), Weight::Share(0.5)));
        assert_eq!((full.specular, full.shininess, full.metallic), (Weight::Share(0.6), 7.0, 0.25));
        assert_eq!((full.reflect, full.refract, full.ior), (ReflectDesc::Constant([0.8; 3]), [0.9; 3], 4.0));
        assert_eq!(full.color, [1.0; 3], "the texture stands for the colour");
        let texture = full.texture.as_ref().expect("it has one");
        assert!(texture.nearest && texture.path == Path::new("a b.bmp"));
        assert_eq!((bare.color, bare.ambient, bare.diffuse), ([0.0; 3], Weight::Share(0.0), Weight::Share(0.0)));
        assert_eq!((bare.specular, bare.shininess, bare.refract), (Weight::Share(0.0), 0.0, [0.0; 3]));
        assert!(plain.texture.is_none() && plain.color == [0.1, 0.2, 0.3]);
        assert_eq!(desc.lights[0].position, DVec3::new(1.0, -2.0, 3.0));
        assert_eq!((desc.lights[0].color, desc.lights[0].radius), ([1.0, 2.0, 3.0], 0.4));
        assert_eq!((desc.lights[1].color, desc.lights[1].radius), ([0.0; 3], 0.0));
    }

    #[test]
    fn the_last_of_two_counts() {
        let desc = read(
            "Material \"m\" \"k_diffuse\" 1 Sphere 1 \"m\" Material \"m\" \"k_diffuse\" 2 dimension 1 2 dimension 3 4",
        );
        assert_eq!((desc.materials.len(), desc.materials[0].diffuse), (1, Weight::Share(2.0)));
        assert_eq!(desc.render.size, Some((3, 4)));
    }
}
