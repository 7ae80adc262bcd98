//! What a line says: a ray, and where there is no scene a shape.

use super::json::{At, Fault, Read, Reader, shown};
use crate::cli::message::nearest;
use glam::{DAffine3, DMat3, DVec2, DVec3};
use tison::geom::{Cube, Cylinder, ExactTriangle, Quad, ShapeError, Sphere};
use tison::probe::ProbeRay;
use tison::scene::OneShape;

/// A shape as a line places it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placed {
    pub shape: OneShape,
    pub to_world: DAffine3,
}

const RAY_KEYS: [&str; 4] = ["o", "d", "tmin", "tmax"];
const LINE_KEYS: [&str; 4] = ["shape", "params", "object_to_world", "ray"];
const SHAPES: [&str; 5] = ["sphere", "cube", "cylinder", "quad", "triangle"];

const POINT: &str = "three numbers, [x, y, z]";
const MATRIX: &str = "four rows of four numbers, the last one [0, 0, 0, 1]";

/// A line of rays at a scene: the ray itself, or the same inside of `ray`.
pub fn ray(line: &[u8]) -> Read<ProbeRay> {
    let mut reader = Reader::new(line);
    let start = reader.place();
    let (mut outside, mut inside) = (Parts::default(), None);
    reader.object("an object, {\"o\": [x, y, z], \"d\": [x, y, z]}", |reader, key| {
        if key.value == b"ray" {
            return once(&mut inside, key, ray_object(reader)?);
        }
        if LINE_KEYS.iter().any(|k| k.as_bytes() == key.value) {
            let what = format!("a line brings its own {} only where no SCENE is named", shown(key.value));
            return Err(Fault::new(key.at, what));
        }
        outside.read(reader, key)
    })?;
    reader.end()?;
    match inside {
        None => outside.ray(start),
        Some(_) if !outside.is_empty() => Err(Fault::new(start, "a ray both inside of `ray` and beside it")),
        Some(ray) => Ok(ray),
    }
}

/// A line with a shape of its own, and where that begins in it.
pub fn shape_and_ray(line: &[u8]) -> Read<(At<Placed>, ProbeRay)> {
    let mut reader = Reader::new(line);
    let start = reader.place();
    let (mut name, mut params, mut to_world, mut ray) = (None, None, None, None);
    reader.object("an object, {\"shape\": .., \"params\": {..}, \"ray\": {..}}", |reader, key| match key.value {
        b"shape" => once(&mut name, key, reader.text()?),
        b"params" => once(&mut params, key, Params::read(reader)?),
        b"object_to_world" => {
            let at = reader.place();
            once(&mut to_world, key, At { at, value: if reader.null() { DAffine3::IDENTITY } else { matrix(reader)? } })
        }
        b"ray" => once(&mut ray, key, ray_object(reader)?),
        other if RAY_KEYS.iter().any(|k| k.as_bytes() == other) => {
            let what = format!("{} belongs inside of `ray`, unless a SCENE is named", shown(other));
            Err(Fault::new(key.at, what))
        }
        _ => Err(unknown(key, &LINE_KEYS)),
    })?;
    reader.end()?;
    let name = name.ok_or_else(|| missing(start, "shape", "one of sphere, cube, cylinder, quad, triangle"))?;
    let params = params.ok_or_else(|| missing(start, "params", "an object with the measures of the shape"))?;
    let shape = params.shape(name)?;
    let ray = ray.ok_or_else(|| missing(start, "ray", "an object, {\"o\": [x, y, z], \"d\": [x, y, z]}"))?;
    let At { at, value: to_world } = to_world.unwrap_or(At { at: name.at, value: DAffine3::IDENTITY });
    Ok((At { at, value: Placed { shape, to_world } }, ray))
}

/// The parts of a ray so far.
#[derive(Default)]
struct Parts {
    o: Option<DVec3>,
    d: Option<DVec3>,
    t_min: Option<f64>,
    t_max: Option<f64>,
}

impl Parts {
    fn read(&mut self, reader: &mut Reader<'_>, key: At<&[u8]>) -> Read<()> {
        match key.value {
            b"o" => once(&mut self.o, key, vector(reader)?),
            b"d" => {
                let at = reader.place();
                let d = vector(reader)?;
                if d == DVec3::ZERO {
                    return Err(Fault::new(at, "a direction of length 0; expected any other"));
                }
                once(&mut self.d, key, d)
            }
            b"tmin" => once(&mut self.t_min, key, limit(reader, 0.0)?),
            b"tmax" => once(&mut self.t_max, key, limit(reader, f64::INFINITY)?),
            _ => Err(unknown(key, &RAY_KEYS)),
        }
    }

    fn is_empty(&self) -> bool {
        self.o.is_none() && self.d.is_none() && self.t_min.is_none() && self.t_max.is_none()
    }

    fn ray(&self, at: usize) -> Read<ProbeRay> {
        let o = self.o.ok_or_else(|| missing(at, "o", POINT))?;
        let d = self.d.ok_or_else(|| missing(at, "d", POINT))?;
        Ok(ProbeRay { o, d, t_min: self.t_min.unwrap_or(0.0), t_max: self.t_max.unwrap_or(f64::INFINITY) })
    }
}

fn ray_object(reader: &mut Reader<'_>) -> Read<ProbeRay> {
    let (at, mut parts) = (reader.place(), Parts::default());
    reader.object("an object, {\"o\": [x, y, z], \"d\": [x, y, z]}", |reader, key| parts.read(reader, key))?;
    parts.ray(at)
}

/// `null` is the default.
fn limit(reader: &mut Reader<'_>, default: f64) -> Read<f64> {
    if reader.null() { Ok(default) } else { reader.any_number() }
}

fn vector(reader: &mut Reader<'_>) -> Read<DVec3> {
    reader.list(POINT, Reader::number).map(DVec3::from_array)
}

/// Row by row, with the translation in the last column.
fn matrix(reader: &mut Reader<'_>) -> Read<DAffine3> {
    let mut places = [0; 4];
    let mut row = 0;
    let rows: [[f64; 4]; 4] = reader.list(MATRIX, |reader| {
        places[row] = reader.place();
        row += 1;
        reader.list("four numbers", Reader::number)
    })?;
    if rows[3] != [0.0, 0.0, 0.0, 1.0] {
        return Err(Fault::new(places[3], "the last row of object_to_world must be [0, 0, 0, 1]: points are columns"));
    }
    let column = |k: usize| DVec3::new(rows[0][k], rows[1][k], rows[2][k]);
    Ok(DAffine3 { matrix3: DMat3::from_cols(column(0), column(1), column(2)), translation: column(3) })
}

/// The measures of all shapes.
#[derive(Default)]
struct Params<'a> {
    at: usize,
    center: Option<At<DVec3>>,
    radius: Option<At<f64>>,
    half: Option<At<Half>>,
    height: Option<At<f64>>,
    capped: Option<At<bool>>,
    corners: [Option<At<DVec3>>; 3],
    /// In the order of the line.
    keys: Vec<At<&'a [u8]>>,
}

/// One half size, or one for each axis.
#[derive(Clone, Copy)]
enum Half {
    One(f64),
    Two([f64; 2]),
    Three([f64; 3]),
}

impl<'a> Params<'a> {
    fn read(reader: &mut Reader<'a>) -> Read<Self> {
        let mut params = Params { at: reader.place(), ..Self::default() };
        reader.object("an object with the measures of the shape", |reader, key| {
            let at = reader.place();
            params.keys.push(key);
            match key.value {
                b"center" => once(&mut params.center, key, At { at, value: vector(reader)? }),
                b"radius" => once(&mut params.radius, key, At { at, value: reader.number()? }),
                b"half" => once(&mut params.half, key, At { at, value: half(reader)? }),
                b"height" => once(&mut params.height, key, At { at, value: reader.number()? }),
                b"capped" => once(&mut params.capped, key, At { at, value: reader.boolean()? }),
                b"a" => once(&mut params.corners[0], key, At { at, value: vector(reader)? }),
                b"b" => once(&mut params.corners[1], key, At { at, value: vector(reader)? }),
                b"c" => once(&mut params.corners[2], key, At { at, value: vector(reader)? }),
                _ => Err(unknown(key, &["center", "radius", "half", "height", "capped", "a", "b", "c"])),
            }
        })?;
        Ok(params)
    }

    fn shape(&self, name: At<&[u8]>) -> Read<OneShape> {
        let at = self.at;
        match name.value {
            b"sphere" => {
                self.only(&["center", "radius"], "a sphere")?;
                let radius = self.radius.ok_or_else(|| missing(at, "radius", "a number above 0"))?;
                let center = self.center.map_or(DVec3::ZERO, |c| c.value);
                made(Sphere::new(center, radius.value), radius.at).map(OneShape::Sphere)
            }
            b"cube" => {
                self.only(&["half", "center"], "a cube")?;
                let half = self.half.ok_or_else(|| missing(at, "half", "three half sizes, [x, y, z]"))?;
                let sizes = match half.value {
                    Half::Three(sizes) => DVec3::from_array(sizes),
                    Half::One(size) => DVec3::splat(size),
                    Half::Two(_) => return Err(Fault::new(half.at, "2 half sizes; expected three, [x, y, z]")),
                };
                let center = self.center.map_or(DVec3::ZERO, |c| c.value);
                made(Cube::new(center, sizes), half.at).map(OneShape::Cube)
            }
            b"cylinder" => {
                self.only(&["radius", "height", "capped"], "a cylinder")?;
                let radius = self.radius.ok_or_else(|| missing(at, "radius", "a number above 0"))?;
                let height = self.height.ok_or_else(|| missing(at, "height", "a number above 0"))?;
                let capped = self.capped.is_some_and(|c| c.value);
                let place = if radius.value > 0.0 { height.at } else { radius.at };
                made(Cylinder::new(radius.value, height.value, capped), place).map(OneShape::Cylinder)
            }
            b"quad" => {
                self.only(&["half"], "a quad")?;
                let half = self.half.ok_or_else(|| missing(at, "half", "half the side, or two of them, [x, y]"))?;
                let sizes = match half.value {
                    Half::One(size) => DVec2::splat(size),
                    Half::Two(sizes) => DVec2::from_array(sizes),
                    Half::Three(_) => return Err(Fault::new(half.at, "3 half sizes; expected one, or two, [x, y]")),
                };
                made(Quad::new(sizes), half.at).map(OneShape::Quad)
            }
            b"triangle" => {
                self.only(&["a", "b", "c"], "a triangle")?;
                let corner =
                    |k: usize| self.corners[k].map(|c| c.value).ok_or_else(|| missing(at, ["a", "b", "c"][k], POINT));
                Ok(OneShape::Triangle(ExactTriangle::new([corner(0)?, corner(1)?, corner(2)?])))
            }
            other => {
                let what = format!("no shape is called {}; expected one of {}", shown(other), SHAPES.join(", "));
                Err(Fault::new(name.at, what + &meant(other, &SHAPES)))
            }
        }
    }

    /// Refuses what belongs to other shapes.
    fn only(&self, keys: &[&str], of: &str) -> Read<()> {
        match self.keys.iter().find(|key| !keys.iter().any(|k| k.as_bytes() == key.value)) {
            Some(key) => {
                let what = format!("{of} has no {}; expected {}", shown(key.value), keys.join(", "));
                Err(Fault::new(key.at, what))
            }
            None => Ok(()),
        }
    }
}

fn half(reader: &mut Reader<'_>) -> Read<Half> {
    if reader.peek() != Some(b'[') {
        return reader.number().map(Half::One);
    }
    let start = reader.place();
    let expected = "half sizes, [x, y] of a quad or [x, y, z] of a cube";
    let mut sizes = [0.0; 3];
    let count = reader.up_to(expected, &mut sizes)?;
    match (count, sizes) {
        (2, [x, y, _]) => Ok(Half::Two([x, y])),
        (3, sizes) => Ok(Half::Three(sizes)),
        _ => Err(Fault::new(start, format!("expected {expected}"))),
    }
}

/// What `made` says about a measure, at its place.
fn made<T>(made: Result<T, ShapeError>, at: usize) -> Read<T> {
    made.map_err(|e| Fault::new(at, e.to_string()))
}

fn once<T>(slot: &mut Option<T>, key: At<&[u8]>, value: T) -> Read<()> {
    match slot.replace(value) {
        Some(_) => Err(Fault::new(key.at, format!("the key {} is given twice", shown(key.value)))),
        None => Ok(()),
    }
}

fn missing(at: usize, key: &str, expected: &str) -> Fault {
    Fault::new(at, format!("the key `{key}` is missing; expected {expected}"))
}

fn unknown(key: At<&[u8]>, keys: &[&str]) -> Fault {
    let what = format!("unknown key {}; expected one of {}", shown(key.value), keys.join(", "));
    Fault::new(key.at, what + &meant(key.value, keys))
}

fn meant(written: &[u8], names: &[&str]) -> String {
    let near = nearest(&String::from_utf8_lossy(written), names.iter().copied());
    near.map_or_else(String::new, |name| format!("; did you mean `{name}`?"))
}
