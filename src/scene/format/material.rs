//! From values to materials.

use super::diagnostic::Diagnostic;
use super::model::place;
use super::reader::{Field, Table};
use super::tree::{Context, Entry, Span, Value};
use crate::scene::desc::{MaterialDesc, ReflectDesc, SceneDesc, TextureDesc, Weight};
use std::collections::HashSet;
use std::path::PathBuf;

/// Indices of refraction that a material may have.
pub(super) const IOR: std::ops::RangeInclusive<f64> = 1e-3..=100.0;

pub(super) fn read(ctx: &Context, entry: &Entry) -> Option<MaterialDesc> {
    let mut t = Table::open(ctx, &entry.node, entry.key_span, format!("material `{}`", entry.key))?;
    let default = MaterialDesc::default();
    let texture = texture(ctx, &mut t);
    let plain = if matches!(texture, Some(Some(_))) { [1.0; 3] } else { default.color };
    let color = t.opt("color").map_or(Some(plain), |f| f.color());
    let ambient = t.opt("ambient").map_or(Some(default.ambient), weight);
    let diffuse = t.opt("diffuse").map_or(Some(default.diffuse), weight);
    let specular = t.opt("specular").map_or(Some(default.specular), weight);
    let shininess = t.opt("shininess").map_or(Some(default.shininess), |f| f.not_negative());
    let part = "a number from 0 (plastic) to 1 (metal)";
    let metallic = t.opt("metallic").map_or(Some(default.metallic), |f| f.number(part, |x| (0.0..=1.0).contains(&x)));
    let emission = t.opt("emission").map_or(Some(default.emission), |f| f.color());
    let (reflect_at, refract_at) = (t.opt("reflect"), t.opt("refract"));
    let reflect = reflect_at.map_or(Some(default.reflect), reflect);
    let refract = refract_at.map_or(Some(default.refract), |f| f.color());
    let index = "an index of refraction from 0.001 to 100";
    let ior = t.opt("ior").map_or(Some(default.ior), |f| f.number(index, |x| IOR.contains(&x)));
    let absorption = t.opt("absorption").map_or(Some(default.absorption), |f| f.color());
    t.finish();
    let desc = MaterialDesc {
        name: entry.key.clone(),
        color: color?,
        texture: texture?,
        ambient: ambient?,
        diffuse: diffuse?,
        specular: specular?,
        shininess: shininess?,
        metallic: metallic?,
        emission: emission?,
        reflect: reflect?,
        refract: refract?,
        ior: ior?,
        absorption: absorption?,
        place: place(ctx, entry.key_span),
    };
    let at = refract_at.or(reflect_at).map_or(entry.key_span, |f| f.node.span);
    warn_energy(ctx, &desc, at);
    Some(desc)
}

/// A path in a scene, put below the folder of the file that names it.
pub(super) fn path(ctx: &Context, f: &Field<'_>, expected: &str) -> Option<PathBuf> {
    let written = f.string(expected)?;
    if written.is_empty() || written.contains('\0') {
        return f.wrong(expected);
    }
    Some(ctx.folder(f.node.span.file).join(written))
}

fn texture(ctx: &Context, t: &mut Table<'_>) -> Option<Option<TextureDesc>> {
    let file = t.opt("texture");
    let filter = t.opt("texture_filter");
    let nearest = filter.map_or(Some(false), |f| f.choice(&[("bilinear", false), ("nearest", true)]));
    match (file, filter) {
        (None, None) => Some(None),
        (None, Some(f)) => {
            ctx.error(f.node.span, |s| {
                Diagnostic::error(s, "`texture_filter` without a texture").expected("expected `texture` beside it")
            });
            None
        }
        (Some(f), _) => {
            let path = path(ctx, &f, "the name of an image file");
            Some(Some(TextureDesc { path: path?, nearest: nearest?, place: place(ctx, f.node.span) }))
        }
    }
}

fn weight(f: Field<'_>) -> Option<Weight> {
    match f.node.value {
        Value::Number(_) => f.not_negative().map(Weight::Share),
        Value::Array(_) => f.color().map(Weight::Color),
        _ => f.wrong("a number, which multiplies the color, or a colour [red, green, blue]"),
    }
}

fn reflect(f: Field<'_>) -> Option<ReflectDesc> {
    match f.node.value {
        Value::String(_) => f.choice(&[("fresnel", ReflectDesc::Fresnel)]),
        Value::Number(_) | Value::Array(_) => f.color().map(ReflectDesc::Constant),
        _ => f.wrong("a number, a colour [red, green, blue] or \"fresnel\""),
    }
}

/// Warns of a surface that sends out more light than arrives.
fn warn_energy(ctx: &Context, m: &MaterialDesc, at: Span) {
    let sum = match m.reflect {
        // F R + (1 - F) T is at most the larger of the two.
        ReflectDesc::Fresnel => m.refract.iter().fold(1.0, |a: f64, &b| a.max(b)),
        ReflectDesc::Constant(r) => r.iter().zip(m.refract).map(|(a, b)| a + b).fold(0.0, f64::max),
    };
    if sum > 1.0 + 1e-9 {
        ctx.warn(at, |s| {
            Diagnostic::warning(s, format!("material `{}` makes light: reflect + refract is {sum}", m.name))
                .help("a sum of at most 1 keeps what comes back bounded")
        });
    }
}

/// Warns of materials of the main file that nothing uses; a library may hold more.
pub(super) fn warn_unused(ctx: &Context, root: &[Entry], desc: &SceneDesc) {
    let used: HashSet<_> = desc.objects.iter().filter_map(|o| o.material.as_deref()).collect();
    let Some(Value::Table(entries)) = root.iter().find(|e| e.key == "material").map(|e| &e.node.value) else { return };
    for entry in entries.iter().filter(|e| e.key_span.file == 0 && !used.contains(e.key.as_str())) {
        ctx.warn(entry.key_span, |s| Diagnostic::warning(s, format!("no object uses material `{}`", entry.key)));
    }
}
