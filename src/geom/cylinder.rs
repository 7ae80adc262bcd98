//! The cylinder: a tube, or a solid with two lids.

use super::shape::{Roots, first_inside, inverse_length, size, slab, some_hit, some_lane};
use super::{Bounds, Lanes, Shape, ShapeError, ShapePoint};
use glam::{DAffine3, DVec2, DVec3};
use std::f64::consts::TAU;

/// Around the z axis, `x² + y² = r²`, `|z| <= height / 2`; open, or closed by two discs.
///
/// Bounds of the error: hit or miss is right for every ray that passes the outline by more than
/// 1e-6 radii, from up to 1e7 radii away; `t` within 1e-9 of itself, or of a
/// thousandth of the size where it is less. An open one is met from
/// inside as well. The capped one is the part of the infinite cylinder between two planes, so
/// there is no slit along its rim, which belongs to the wall.
///
/// Parts: 0 is the wall, 1 the cap at -z, 2 the cap at +z. Texture of the wall:
/// `u = fract(atan2(n.y, n.x) / 2π)` with `n` the normal turned to the side that the ray comes
/// from, `v = 1/2 - z/height`. Caps: `(1 ± x/r) / 2, (1 - y/r) / 2`, `±` so that the picture is
/// not mirrored for a viewer outside.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cylinder {
    radius: f64,
    half: f64,
    capped: bool,
}

/// A ray seen along the axis: where it meets the infinite cylinder.
struct Flat {
    a: f64,
    b: f64,
    c: f64,
    /// A quarter of the discriminant; negative or NaN for a miss.
    disc: f64,
}

impl Cylinder {
    /// # Errors
    /// When the radius or the height is not a finite number above 0.
    pub fn new(radius: f64, height: f64, capped: bool) -> Result<Self, ShapeError> {
        let half = 0.5 * size("height", height)?;
        Ok(Self { radius: size("radius", radius)?, half: size("height", half)?, capped })
    }

    /// Distance of the wall from the axis.
    #[must_use]
    pub fn radius(&self) -> f64 {
        self.radius
    }

    /// Distance between the ends.
    #[must_use]
    pub fn height(&self) -> f64 {
        2.0 * self.half
    }

    /// Whether it has lids.
    #[must_use]
    pub fn capped(&self) -> bool {
        self.capped
    }

    /// The discriminant from the moment `w` of the ray about the axis, in which nothing cancels when the origin is far.
    #[inline(always)]
    fn flat(&self, o: DVec3, d: DVec3) -> Flat {
        let rr = self.radius * self.radius;
        let a = d.x * d.x + d.y * d.y;
        // Of the two zeros only +0.
        let b = 0.0 - (o.x * d.x + o.y * d.y);
        let w = o.x * d.y - o.y * d.x;
        Flat { a, b, c: o.x * o.x + o.y * o.y - rr, disc: a * rr - w * w }
    }

    /// The roots in turn: the second is the inner wall, seen over the near rim.
    #[inline(always)]
    fn nearest_open(&self, flat: &Flat, o: DVec3, d: DVec3, t_near: f64, t_far: f64) -> f64 {
        let roots = Roots::new(flat.a, flat.b, flat.c, flat.disc.sqrt());
        let (near, far) = (roots.near(), roots.far());
        let on_wall = |t: f64| ((o.z + t * d.z).abs() <= self.half) & (t > t_near) & (t < t_far);
        let second = if on_wall(far) { far } else { f64::INFINITY };
        let first = if on_wall(near) { near } else { second };
        // A ray along the axis (a = 0) never meets the wall. Compare with nothing but 0: a slight tilt is no trouble.
        if (flat.a > 0.0) & (flat.disc >= 0.0) { first } else { f64::INFINITY }
    }

    /// The part of the ray inside the infinite cylinder; `near > far` when there is none.
    #[inline(always)]
    fn inside_wall(flat: &Flat) -> (f64, f64) {
        let roots = Roots::new(flat.a, flat.b, flat.c, flat.disc.sqrt());
        let along = flat.a == 0.0;
        let near = if along { f64::NEG_INFINITY } else { roots.near() };
        let far = if along { f64::INFINITY } else { roots.far() };
        let ok = if along { flat.c <= 0.0 } else { flat.disc >= 0.0 };
        if ok { (near, far) } else { (f64::INFINITY, f64::NEG_INFINITY) }
    }

    #[inline(always)]
    fn nearest_capped(&self, flat: &Flat, o: DVec3, d: DVec3, t_near: f64, t_far: f64) -> f64 {
        let wall = Self::inside_wall(flat);
        let caps = slab(self.half, o.z, d.z);
        let enter = if caps.0 > wall.0 { caps.0 } else { wall.0 };
        let leave = if caps.1 < wall.1 { caps.1 } else { wall.1 };
        let ok = (caps.0 <= caps.1) & (enter <= leave);
        first_inside(enter, leave, t_near, t_far, ok)
    }

    /// The nearest hit beyond `t_near`, infinity for none, and the part it is on.
    #[inline]
    fn nearest_part(&self, o: DVec3, d: DVec3, t_near: f64) -> (f64, u8) {
        let flat = self.flat(o, d);
        if !self.capped {
            return (self.nearest_open(&flat, o, d, t_near, f64::INFINITY), 0);
        }
        let wall = Self::inside_wall(&flat);
        let caps = slab(self.half, o.z, d.z);
        let (caps_last, caps_first) = (caps.0 > wall.0, caps.1 < wall.1);
        let enter = if caps_last { caps.0 } else { wall.0 };
        let leave = if caps_first { caps.1 } else { wall.1 };
        let t = first_inside(enter, leave, t_near, f64::INFINITY, (caps.0 <= caps.1) & (enter <= leave));
        let (on_cap, top) = if enter > t_near { (caps_last, d.z < 0.0) } else { (caps_first, d.z > 0.0) };
        (t, if on_cap { 1 + u8::from(top) } else { 0 })
    }

    /// The part that is nearest to `p`.
    fn part_near(&self, p: DVec3) -> u8 {
        let from_cap = (p.z.abs() - self.half).abs();
        let from_wall = (p.truncate().length() - self.radius).abs();
        if self.capped && from_cap < from_wall { 1 + u8::from(p.z > 0.0) } else { 0 }
    }
}

impl Shape for Cylinder {
    fn bounds(&self, to_world: &DAffine3) -> Bounds {
        let m = to_world.matrix3;
        let rim = (m.x_axis * m.x_axis + m.y_axis * m.y_axis).map(f64::sqrt);
        let half = self.radius * rim + self.half * m.z_axis.abs();
        let center = to_world.translation;
        Bounds { lo: center - half, hi: center + half }
    }

    #[inline]
    fn hit(&self, o: DVec3, d: DVec3, t_near: f64, t_far: f64) -> Option<f64> {
        let flat = self.flat(o, d);
        if flat.disc < 0.0 {
            return None;
        }
        some_hit(if self.capped {
            self.nearest_capped(&flat, o, d, t_near, t_far)
        } else {
            self.nearest_open(&flat, o, d, t_near, t_far)
        })
    }

    #[inline(always)]
    fn hit_lanes<T: Copy + Into<f64>, const N: usize>(&self, rays: &Lanes<'_, T, N>) -> Option<[f64; N]> {
        let (mut a, mut b, mut c, mut disc) = ([0.0; N], [0.0; N], [0.0; N], [0.0; N]);
        let mut any = 0u64;
        for i in 0..N {
            let flat = self.flat(rays.o(i), rays.d(i));
            (a[i], b[i], c[i], disc[i]) = (flat.a, flat.b, flat.c, flat.disc);
            any |= u64::from(flat.disc >= 0.0);
        }
        if any == 0 {
            return None;
        }
        let flat = |i: usize| Flat { a: a[i], b: b[i], c: c[i], disc: disc[i] };
        let mut t = [0.0; N];
        if self.capped {
            for (i, t) in t.iter_mut().enumerate() {
                *t = self.nearest_capped(&flat(i), rays.o(i), rays.d(i), rays.t_near(i), rays.t_far(i));
            }
        } else {
            for (i, t) in t.iter_mut().enumerate() {
                *t = self.nearest_open(&flat(i), rays.o(i), rays.d(i), rays.t_near(i), rays.t_far(i));
            }
        }
        some_lane(t)
    }

    fn contains(&self, p: DVec3) -> bool {
        self.capped && p.truncate().length_squared() < self.radius * self.radius && p.z.abs() < self.half
    }

    #[inline]
    fn refine_for(&self, o: DVec3, d: DVec3, t_near: f64, t: f64, uv: bool) -> ShapePoint {
        let (own, part) = self.nearest_part(o, d, t_near);
        let found = own < f64::INFINITY;
        let t = if found { own } else { t };
        let p = o + t * d;
        let part = if found { part } else { self.part_near(p) };
        let extent = self.radius.max(self.half);
        if part == 0 {
            let flat = p.truncate();
            let n = flat * inverse_length(flat.length_squared(), self.radius);
            let n = if n.is_finite() { n } else { DVec2::X };
            let viewed = if n.dot(d.truncate()) > 0.0 { -n } else { n };
            let turn = if uv { viewed.y.atan2(viewed.x) / TAU } else { 0.0 };
            let z = p.z.clamp(-self.half, self.half);
            let down = if uv { 0.5 - 0.5 * (z / self.half) } else { 0.0 };
            let uv = DVec2::new(if turn < 0.0 { 1.0 + turn } else { turn }, down);
            return ShapePoint { t, p: (self.radius * n).extend(z), ng: n.extend(0.0), uv, extent, part };
        }
        let side = if part == 2 { 1.0 } else { -1.0 };
        let p = p.truncate().clamp_length_max(self.radius);
        let map = || {
            let q = p / self.radius;
            DVec2::new(0.5 + 0.5 * side * q.x, 0.5 - 0.5 * q.y)
        };
        let uv = if uv { map() } else { DVec2::ZERO };
        ShapePoint { t, p: p.extend(side * self.half), ng: side * DVec3::Z, uv, extent, part }
    }
}
