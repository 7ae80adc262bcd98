//! From values to objects and their transforms.

use super::diagnostic::Diagnostic;
use super::material::path;
use super::model::{items, place};
use super::reader::{Field, Table};
use super::tree::{Context, Entry, Node, Value};
use crate::scene::desc::{ObjectDesc, ShapeDesc, TransformStep};
use glam::{DMat3, DMat4, DVec3, DVec4};
use std::collections::HashSet;

/// Every object of the group; `materials` are the names they may use.
pub(super) fn read_all(ctx: &Context, group: &Entry, materials: Vec<&str>) -> Vec<ObjectDesc> {
    let field = Field::of(ctx, &group.key, &group.node);
    let known: HashSet<&str> = materials.iter().copied().collect();
    let reader = Reader { ctx, materials, known };
    let nodes = items(field, "an array of tables: [[object]]");
    nodes.iter().enumerate().filter_map(|(i, node)| reader.object(i, node)).collect()
}

struct Reader<'a> {
    ctx: &'a Context,
    materials: Vec<&'a str>,
    known: HashSet<&'a str>,
}

#[derive(Clone, Copy)]
enum Kind {
    Sphere,
    Cube,
    Cylinder,
    Quad,
    Mesh,
}

const KINDS: [(&str, Kind); 5] = [
    ("sphere", Kind::Sphere),
    ("cube", Kind::Cube),
    ("cylinder", Kind::Cylinder),
    ("quad", Kind::Quad),
    ("mesh", Kind::Mesh),
];

impl Reader<'_> {
    fn object(&self, index: usize, node: &Node) -> Option<ObjectDesc> {
        let ctx = self.ctx;
        let mut t = Table::open(ctx, node, node.span, format!("object {index}"))?;
        let name =
            t.opt("name").map_or_else(|| Some(format!("object.{index}")), |f| f.string("a name").map(Into::into));
        let shape = self.shape(&mut t);
        let material = t.opt("material").map_or(Some(None), |f| self.material(f).map(Some));
        let transform = t.opt("transform").map_or(Some(Vec::new()), |f| transform(ctx, f));
        if shape.is_some() {
            t.finish();
        }
        let place = place(ctx, node.span);
        Some(ObjectDesc { name: name?, shape: shape??, material: material?, transform: transform?, place })
    }

    /// `None` where the kind is not known, `Some(None)` for a mistake in its keys.
    fn shape(&self, t: &mut Table<'_>) -> Option<Option<ShapeDesc>> {
        let kind = if t.has("mesh") && !t.has("shape") {
            Kind::Mesh
        } else {
            t.req("shape", "a shape: shape = \"sphere\", or a file: mesh = \"model.obj\"")?.choice(&KINDS)?
        };
        Some(match kind {
            Kind::Sphere => sphere(t),
            Kind::Cube => t.opt("half").map_or(Some(DVec3::ONE), half).map(|half| ShapeDesc::Cube { half }),
            Kind::Cylinder => cylinder(t),
            Kind::Quad => t.opt("half").map_or(Some(1.0), |f| f.positive()).map(|half| ShapeDesc::Quad { half }),
            Kind::Mesh => self.mesh(t),
        })
    }

    fn mesh(&self, t: &mut Table<'_>) -> Option<ShapeDesc> {
        t.opt("shape");
        let file = t.req("mesh", "the name of a file: mesh = \"model.obj\"");
        let path = file.and_then(|f| path(self.ctx, &f, "the name of a mesh file"));
        let smooth = t.opt("smooth").map_or(Some(None), smooth);
        let place = place(self.ctx, file?.node.span);
        Some(ShapeDesc::Mesh { path: path?, smooth: smooth?, place })
    }

    fn material(&self, f: Field<'_>) -> Option<String> {
        let name = f.string("the name of a material")?;
        if self.known.contains(name) {
            return Some(name.into());
        }
        self.ctx.error(f.node.span, |s| {
            let d = Diagnostic::error(s, format!("no material is called `{}`", name.escape_debug()))
                .expected("expected the name of a material")
                .suggest(name, self.materials.iter().copied());
            if self.materials.is_empty() { d.help("define it: [material.NAME]") } else { d }
        });
        None
    }
}

fn sphere(t: &mut Table<'_>) -> Option<ShapeDesc> {
    let center = t.opt("center").map_or(Some(DVec3::ZERO), |f| f.vec3());
    let radius = t.opt("radius").map_or(Some(1.0), |f| f.positive());
    Some(ShapeDesc::Sphere { center: center?, radius: radius? })
}

fn cylinder(t: &mut Table<'_>) -> Option<ShapeDesc> {
    let radius = t.opt("radius").map_or(Some(1.0), |f| f.positive());
    let height = t.opt("height").map_or(Some(2.0), |f| f.positive());
    let capped = t.opt("capped").map_or(Some(false), |f| f.bool());
    Some(ShapeDesc::Cylinder { radius: radius?, height: height?, capped: capped? })
}

fn half(f: Field<'_>) -> Option<DVec3> {
    const EXPECTED: &str = "a number above 0, or 3 of them: half sizes along x, y, z";
    if let Value::Number(_) = f.node.value {
        return f.number(EXPECTED, |x| x > 0.0).map(DVec3::splat);
    }
    let half = DVec3::from_array(f.numbers(EXPECTED)?);
    if half.min_element() > 0.0 { Some(half) } else { f.wrong(EXPECTED) }
}

/// `true` smooths every edge, a number those up to so many degrees.
fn smooth(f: Field<'_>) -> Option<Option<f64>> {
    match f.node.value {
        Value::Bool(all) => Some(all.then_some(180.0)),
        Value::Number(_) => f.number("degrees from 0 to 180", |x| (0.0..=180.0).contains(&x)).map(Some),
        _ => f.wrong("true, false or the largest angle in degrees of an edge that is smoothed"),
    }
}

/// The steps, neighbouring matrices multiplied.
fn transform(ctx: &Context, field: Field<'_>) -> Option<Vec<TransformStep>> {
    let nodes = match &field.node.value {
        Value::Array(_) => items(field, ""),
        Value::Table(_) => std::slice::from_ref(field.node),
        _ => return field.wrong("an array of steps: [{ scale = 2 }, { translate = [0, 1, 0] }]"),
    };
    let mut steps: Vec<TransformStep> = Vec::new();
    let mut good = true;
    for node in nodes {
        match (step(ctx, node), steps.last_mut()) {
            (None, _) => good = false,
            (Some(TransformStep::Matrix(next)), Some(TransformStep::Matrix(so_far))) => *so_far = next * *so_far,
            (Some(next), _) => steps.push(next),
        }
    }
    let sound = |s: &TransformStep| !matches!(s, TransformStep::Matrix(m) if singular(m));
    if good && !steps.iter().all(sound) {
        return field.wrong("steps that together can be undone");
    }
    good.then_some(steps)
}

fn step(ctx: &Context, node: &Node) -> Option<TransformStep> {
    let mut t = Table::open(ctx, node, node.span, "a step of a transform".into())?;
    let fields = [t.opt("scale"), t.opt("translate"), t.opt("rotate"), t.opt("matrix"), t.opt("fit")];
    let degrees = t.opt("degrees");
    t.finish();
    let mut given = fields.into_iter().flatten();
    let (Some(field), None) = (given.next(), given.next()) else {
        ctx.error(node.span, |s| {
            Diagnostic::error(s, "not one step of a transform")
                .expected("expected one of scale, translate, rotate with degrees, matrix, fit")
        });
        return None;
    };
    if let (Some(d), true) = (degrees, field.key != "rotate") {
        return d.wrong("`rotate = [x, y, z]` beside it");
    }
    match field.key {
        "scale" => scale(field).map(DMat4::from_scale),
        "translate" => field.vec3().map(DMat4::from_translation),
        "rotate" => rotate(ctx, field, degrees),
        "matrix" => matrix(field),
        _ => return field.positive().map(TransformStep::Fit),
    }
    .map(TransformStep::Matrix)
}

fn scale(f: Field<'_>) -> Option<DVec3> {
    const EXPECTED: &str = "a number other than 0, or 3 of them";
    if let Value::Number(_) = f.node.value {
        return f.number(EXPECTED, |x| x != 0.0).map(DVec3::splat);
    }
    let scale = DVec3::from_array(f.numbers(EXPECTED)?);
    if scale.cmpne(DVec3::ZERO).all() { Some(scale) } else { f.wrong(EXPECTED) }
}

fn rotate(ctx: &Context, f: Field<'_>, degrees: Option<Field<'_>>) -> Option<DMat4> {
    let axis = f.vec3();
    let Some(degrees) = degrees else {
        ctx.error(f.node.span, |s| {
            Diagnostic::error(s, "`rotate` without an angle").expected("expected the axis, and `degrees` beside it")
        });
        return None;
    };
    let degrees = degrees.number("an angle in degrees", |_| true);
    match rotation(axis?, degrees?) {
        Some(m) => Some(m),
        None => f.wrong("an axis that is not zero"),
    }
}

fn matrix(f: Field<'_>) -> Option<DMat4> {
    let m: [f64; 16] = f.numbers("16 numbers: 4 rows of 4")?;
    let m = DMat4::from_cols_array(&m).transpose();
    if m.row(3) != DVec4::W {
        return f.wrong("0, 0, 0, 1 in the last row");
    }
    if singular(&m) { f.wrong("a matrix that can be undone (its determinant is zero)") } else { Some(m) }
}

/// Right-handed rotation around `axis`, exact at multiples of 90 degrees around an axis of
/// coordinates; `None` for an axis that is zero.
pub(super) fn rotation(axis: DVec3, degrees: f64) -> Option<DMat4> {
    let a = axis.try_normalize()?;
    let turn = degrees.rem_euclid(360.0);
    let quarters = [(0.0, 1.0), (1.0, 0.0), (0.0, -1.0), (-1.0, 0.0)];
    let (sin, cos) =
        if turn % 90.0 == 0.0 { quarters[(turn / 90.0) as usize % 4] } else { turn.to_radians().sin_cos() };
    let rest = (1.0 - cos) * a;
    let x = DVec3::new(cos + rest.x * a.x, rest.x * a.y + sin * a.z, rest.x * a.z - sin * a.y);
    let y = DVec3::new(rest.y * a.x - sin * a.z, cos + rest.y * a.y, rest.y * a.z + sin * a.x);
    let z = DVec3::new(rest.z * a.x + sin * a.y, rest.z * a.y - sin * a.x, cos + rest.z * a.z);
    Some(DMat4::from_mat3(DMat3::from_cols(x, y, z)))
}

/// Whether `m` cannot be undone in f64: its volume is below 1e-12 of that of a box with the same
/// edges, or a number in it or in its inverse is not finite.
pub(super) fn singular(m: &DMat4) -> bool {
    let edges = DMat3::from_mat4(*m);
    let unit = [edges.x_axis, edges.y_axis, edges.z_axis].map(DVec3::try_normalize);
    let [Some(x), Some(y), Some(z)] = unit else { return true };
    let volume = DMat3::from_cols(x, y, z).determinant().abs();
    !(volume >= 1e-12 && m.is_finite() && m.inverse().is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn quarter_turns_are_exact() {
        let cases = [
            (DVec3::X, -90.0, DVec3::Z, DVec3::Y),
            (DVec3::new(0.0, 3.0, 0.0), 90.0, DVec3::Z, DVec3::X),
            (DVec3::Z, 450.0, DVec3::X, DVec3::Y),
            (DVec3::NEG_Y, 180.0, DVec3::X, DVec3::NEG_X),
        ];
        for (axis, degrees, from, to) in cases {
            let m = rotation(axis, degrees).expect("a good axis");
            assert_eq!(m.transform_vector3(from), to, "{axis} {degrees}");
        }
        assert_eq!(rotation(DVec3::ZERO, 10.0), None);
    }

    proptest! {
        #[test]
        fn rotations_are_those_of_glam(x in -1.0..1.0_f64, y in -1.0..1.0_f64, z in 0.1..1.0_f64, deg in -720.0..720.0_f64) {
            let axis = DVec3::new(x, y, z);
            let ours = rotation(axis, deg).expect("a good axis");
            let theirs = DMat4::from_axis_angle(axis.normalize(), deg.to_radians());
            prop_assert!(ours.abs_diff_eq(theirs, 1e-13), "{ours} {theirs}");
        }
    }

    #[test]
    fn thin_is_not_singular_and_flat_is() {
        let scale = |x, y, z| DMat4::from_scale(DVec3::new(x, y, z));
        let turn = rotation(DVec3::new(1.0, 2.0, 3.0), 33.0).expect("a good axis");
        for good in [scale(1e-6, 1e6, 1.0), scale(-1.0, 1.0, 1.0), turn * scale(1000.0, 1.0, 1.0)] {
            assert!(!singular(&good), "{good}");
        }
        let flat = DMat4::from_cols(DVec4::X, DVec4::Y, DVec4::new(1.0, 1.0, 0.0, 0.0), DVec4::W);
        for bad in [scale(1.0, 0.0, 1.0), flat, scale(1e-320, 1.0, 1.0), scale(f64::INFINITY, 1.0, 1.0)] {
            assert!(singular(&bad), "{bad}");
        }
    }
}
