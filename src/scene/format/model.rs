//! From values to a scene: the picture, cameras, lights.

use super::diagnostic::Diagnostic;
use super::reader::{Field, Table};
use super::tree::{Context, Entry, Node, Span, Value};
use super::{material, object};
use crate::math::{Filter, Sampler};
use crate::scene::desc::{Falloff, LensSampler, LightDesc, NamedCamera, Place, RenderDesc, SceneDesc};
use crate::scene::{CameraDesc, Projection};
use glam::DVec3;

/// Largest width or height of an image in pixels.
pub(super) const MOST_PIXELS: u32 = 65_535;
/// Most samples of a pixel.
pub(super) const MOST_SAMPLES: u32 = 1 << 24;
/// Most reflections and refractions in a row.
pub(super) const MOST_RECURSION: u32 = 100_000;
/// Vertical field of view where a perspective camera gives none, in degrees.
const DEFAULT_FOV: f64 = 40.0;

/// The scene that the groups of [`super::include::join`] describe.
pub(super) fn read(ctx: &Context, root: &[Entry]) -> SceneDesc {
    let mut desc = SceneDesc { files: ctx.paths(), ..SceneDesc::default() };
    for entry in root {
        match entry.key.as_str() {
            "render" => desc.render = render(ctx, entry),
            "camera" => desc.cameras = named(ctx, entry, camera),
            "light" => desc.lights = named(ctx, entry, light),
            "material" => desc.materials = named(ctx, entry, material::read),
            _ => desc.objects = object::read_all(ctx, entry, material_names(root)),
        }
    }
    if !ctx.has_errors() {
        material::warn_unused(ctx, root, &desc);
        warn_dark(ctx, &desc);
    }
    desc
}

/// Names that objects may use, those with mistakes in them as well.
fn material_names(root: &[Entry]) -> Vec<&str> {
    let group = root.iter().find(|e| e.key == "material");
    match group.map(|e| &e.node.value) {
        Some(Value::Table(entries)) => entries.iter().map(|e| e.key.as_str()).collect(),
        _ => Vec::new(),
    }
}

/// Each named thing of a group, read by `read`.
fn named<T>(ctx: &Context, group: &Entry, read: fn(&Context, &Entry) -> Option<T>) -> Vec<T> {
    let Value::Table(entries) = &group.node.value else {
        let expected = format!("a table for each name: [{}.NAME]", group.key);
        return Field::of(ctx, &group.key, &group.node).wrong(&expected).unwrap_or_default();
    };
    entries.iter().filter_map(|e| read(ctx, e)).collect()
}

pub(super) fn place(ctx: &Context, span: Span) -> Place {
    ctx.source(span.file).place(span.start)
}

fn render(ctx: &Context, entry: &Entry) -> RenderDesc {
    let Some(mut t) = Table::open(ctx, &entry.node, entry.key_span, "`render`".into()) else {
        return RenderDesc::default();
    };
    let share = "a number from 0 to below 1: 0 traces every branch";
    let radius = "a number of pixels from 0 to 16";
    let has_jitter_radius = t.has("jitter_radius");
    let desc = RenderDesc {
        size: t.opt("size").and_then(|f| f.size(MOST_PIXELS)),
        samples: t.opt("samples").and_then(|f| f.whole(1..=MOST_SAMPLES)),
        recursion: t.opt("recursion").and_then(|f| f.whole(0..=MOST_RECURSION)),
        min_weight: t.opt("min_weight").and_then(|f| f.number(share, |x| (0.0..1.0).contains(&x))).map(|x| x as f32),
        seed: t.opt("seed").and_then(|f| f.whole(0..=u32::MAX)),
        background: t.opt("background").and_then(|f| f.color()),
        ambient: t.opt("ambient").and_then(|f| f.color()),
        jitter_radius: t.opt("jitter_radius").and_then(|f| f.number(radius, |x| (0.0..=16.0).contains(&x))),
        filter: t.opt("filter").and_then(|f| filter(ctx, &f, has_jitter_radius)),
        sampler: t.opt("sampler").and_then(|f| f.choice(&Sampler::ALL.map(|s| (s.name(), s)))),
        lens_sampler: t.opt("lens_sampler").and_then(|f| f.choice(&LensSampler::ALL.map(|s| (s.name(), s)))),
        course_rules: t.opt("course_rules").and_then(|f| f.bool()).unwrap_or(false),
    };
    t.finish();
    desc
}

/// A pixel filter; other than the box they have a width of their own.
fn filter(ctx: &Context, field: &Field<'_>, has_jitter_radius: bool) -> Option<Filter> {
    let filter = field.choice(&Filter::ALL.map(|f| (f.name(), f)))?;
    if has_jitter_radius && filter != Filter::Box {
        ctx.error(field.node.span, |s| {
            Diagnostic::error(s, format!("`filter` is \"{}\", but there is a `jitter_radius` too", filter.name()))
                .expected("expected \"box\", the filter that has such a radius")
                .help("leave one of the two out")
        });
    }
    Some(filter)
}

#[derive(Clone, Copy)]
enum Kind {
    Perspective,
    Orthographic,
}

fn camera(ctx: &Context, entry: &Entry) -> Option<NamedCamera> {
    let mut t = Table::open(ctx, &entry.node, entry.key_span, format!("camera `{}`", entry.key))?;
    let kinds = [("perspective", Kind::Perspective), ("orthographic", Kind::Orthographic)];
    let kind = t.opt("type").map_or(Some(Kind::Perspective), |f| f.choice(&kinds));
    let eye = t.req("eye", "a point: eye = [x, y, z]");
    let target = t.req("target", "a point to look at: target = [x, y, z]");
    let up = t.opt("up");
    let (eye_at, target_at, up_at) = (span(eye, entry), span(target, entry), span(up, entry));
    let (eye, target) = (eye.and_then(|f| f.vec3()), target.and_then(|f| f.vec3()));
    let up = up.map_or(Some(DVec3::Y), |f| f.vec3());
    let projection = match kind {
        Some(Kind::Perspective) => fov(&mut t).map(|fov_deg| Projection::Perspective { fov_deg }),
        Some(Kind::Orthographic) => t
            .req("height", "the height of the view: height = 4.0")
            .and_then(|f| f.positive())
            .map(|height| Projection::Orthographic { height }),
        None => {
            // Both are possible while the kind is not known.
            t.opt("fov");
            t.opt("height");
            None
        }
    };
    let lens = t.opt("lens").map_or(Some(Lens::default()), |f| lens(ctx, f));
    let aspect = optional(t.opt("aspect"), |f| f.positive());
    let clip = optional(t.opt("clip"), clip);
    t.finish();
    let (eye, target, up, lens) = (eye?, target?, up?, lens?);
    let camera = CameraDesc {
        eye,
        target,
        up,
        projection: projection?,
        aperture: lens.radius,
        focus: lens.focus,
        aspect: aspect?,
        clip: clip?,
    };
    let [_, _, forward] = match camera.basis() {
        Ok(basis) => basis,
        Err(why) => return no_view(ctx, &camera, [eye_at, target_at, up_at], &why),
    };
    let focus = match lens.focus_on {
        Some((on, at)) => Some(focus_on(ctx, &camera, forward, on, at)?),
        None => lens.focus,
    };
    Some(NamedCamera { name: entry.key.clone(), camera: CameraDesc { focus, ..camera } })
}

/// `None` for a mistake, `Some(None)` where there is no value.
fn optional<'a, T>(field: Option<Field<'a>>, read: impl Fn(Field<'a>) -> Option<T>) -> Option<Option<T>> {
    field.map_or(Some(None), |f| read(f).map(Some))
}

fn span(field: Option<Field<'_>>, entry: &Entry) -> Span {
    field.map_or(entry.key_span, |f| f.node.span)
}

fn fov(t: &mut Table<'_>) -> Option<f64> {
    let expected = "degrees, above 0 and below 180";
    t.opt("fov").map_or(Some(DEFAULT_FOV), |f| f.number(expected, |x| x > 0.0 && x < 180.0))
}

fn clip(f: Field<'_>) -> Option<(f64, f64)> {
    const EXPECTED: &str = "2 distances: [near, far], 0 <= near < far";
    let [near, far] = f.numbers(EXPECTED)?;
    if near >= 0.0 && near < far { Some((near, far)) } else { f.wrong(EXPECTED) }
}

/// Reports a camera that has no view; the place is the value that most likely is wrong.
fn no_view<T>(ctx: &Context, camera: &CameraDesc, [eye, target, up]: [Span; 3], why: &str) -> Option<T> {
    let view = camera.target - camera.eye;
    let (at, what, expected) = if camera.up == DVec3::ZERO {
        (up, "the camera's up direction is zero", "expected a direction, like [0, 1, 0]")
    } else if view.try_normalize().is_none() {
        let what = "the camera's eye and target are the same point, or too far apart";
        (if target.start > eye.start { target } else { eye }, what, "expected another point")
    } else if camera.up.try_normalize().is_some() {
        (up, "the camera's up direction is along its view", "expected a direction across the view, like [0, 0, 1]")
    } else {
        (up, why, "expected other numbers")
    };
    ctx.error(at, |s| Diagnostic::error(s, what).expected(expected));
    None
}

/// Distance along the view to a point; the point must be in front.
fn focus_on(ctx: &Context, camera: &CameraDesc, forward: DVec3, on: DVec3, at: Span) -> Option<f64> {
    let distance = (on - camera.eye).dot(forward);
    if distance > 0.0 && distance.is_finite() {
        return Some(distance);
    }
    ctx.error(at, |s| {
        Diagnostic::error(s, "the point in focus is not in front of the camera").expected("expected a point in view")
    });
    None
}

#[derive(Default)]
struct Lens {
    radius: f64,
    focus: Option<f64>,
    focus_on: Option<(DVec3, Span)>,
}

fn lens(ctx: &Context, field: Field<'_>) -> Option<Lens> {
    let mut t = Table::open(ctx, field.node, field.node.span, "`lens`".into())?;
    let radius = t.req("radius", "the lens's radius: radius = 0.1").and_then(|f| f.not_negative());
    let focus = optional(t.opt("focus"), |f| f.positive());
    let on = t.opt("focus_on");
    let focus_on = optional(on, |f| f.vec3().map(|p| (p, f.node.span)));
    t.finish();
    if let (Some(Some(_)), Some(on)) = (focus, on) {
        ctx.error(on.node.span, |s| {
            Diagnostic::error(s, "`focus` and `focus_on` are both given").expected("expected one of them")
        });
        return None;
    }
    Some(Lens { radius: radius?, focus: focus?, focus_on: focus_on? })
}

fn light(ctx: &Context, entry: &Entry) -> Option<LightDesc> {
    let mut t = Table::open(ctx, &entry.node, entry.key_span, format!("light `{}`", entry.key))?;
    let kind = t.opt("type").map_or(Some(()), |f| f.choice(&[("point", ())]));
    let position = t.req("position", "a point: position = [x, y, z]").and_then(|f| f.vec3());
    let color = t.opt("color").map_or(Some([1.0; 3]), |f| f.color());
    let power = t.opt("power").map_or(Some(1.0), |f| f.not_negative());
    let radius = t.opt("radius").map_or(Some(0.0), |f| f.not_negative());
    let falloffs = [("inverse-square", Falloff::InverseSquare), ("none", Falloff::None)];
    let falloff = t.opt("falloff").map_or(Some(Falloff::default()), |f| f.choice(&falloffs));
    t.finish();
    kind?;
    let (color, power) = (color?, power?);
    let color = color.map(|c| c * power);
    if color.iter().any(|c| !c.is_finite()) {
        ctx.error(entry.key_span, |s| {
            Diagnostic::error(s, "color times power is no finite number").expected("expected a weaker light")
        });
    }
    Some(LightDesc { name: entry.key.clone(), position: position?, color, radius: radius?, falloff: falloff? })
}

/// Warns of a picture with nothing in it.
fn warn_dark(ctx: &Context, desc: &SceneDesc) {
    let start = Span { file: 0, start: 0, end: 0 };
    let dark = |c: &[f64; 3]| *c == [0.0; 3];
    if desc.objects.is_empty() {
        ctx.warn(start, |s| Diagnostic::warning(s, "the scene has no object").help("add one with [[object]]"));
    } else if desc.lights.iter().all(|l| dark(&l.color))
        && desc.render.ambient.as_ref().is_none_or(dark)
        && desc.materials.iter().all(|m| dark(&m.emission))
    {
        ctx.warn(start, |s| {
            let help = "add a light with [light.NAME], or ambient light with `ambient` in [render]";
            Diagnostic::warning(s, "nothing gives light: the objects will be black").help(help)
        });
    }
}

/// The elements of an array, or nothing, which is reported.
pub(super) fn items<'a>(field: Field<'a>, expected: &str) -> &'a [Node] {
    match &field.node.value {
        Value::Array(items) => items,
        _ => field.wrong::<&[Node]>(expected).unwrap_or_default(),
    }
}
