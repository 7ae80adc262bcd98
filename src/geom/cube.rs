//! The box.

use super::shape::{first_inside, size, slab, some_hit, some_lane};
use super::{Bounds, Lanes, Shape, ShapeError, ShapePoint};
use glam::{DAffine3, DMat3, DVec2, DVec3};

/// A closed box with its edges along the axes.
///
/// Bounds of the error: `t` within 1e-9 of itself, or of a thousandth of the size where it is less. A ray that meets an edge or corner exactly hits.
///
/// Parts are the faces: 0 is -x, 1 is +x, then -y, +y, -z, +z; where several meet, the one with
/// the least axis. Texture: each face shows the whole picture, upright and not mirrored for a
/// viewer outside. On the faces across x and z up is +y; on +y it is -z, on -y it is +z.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cube {
    center: DVec3,
    half: DVec3,
}

impl Cube {
    /// A box around `center` that reaches `half` to either side along each axis.
    ///
    /// # Errors
    /// When a half size is not a finite number above 0 or the centre is not finite.
    pub fn new(center: DVec3, half: DVec3) -> Result<Self, ShapeError> {
        for (what, value) in [("half size x", half.x), ("half size y", half.y), ("half size z", half.z)] {
            size(what, value)?;
        }
        if !center.is_finite() {
            return Err(ShapeError::Center { center });
        }
        Ok(Self { center, half })
    }

    /// Middle.
    #[must_use]
    pub fn center(&self) -> DVec3 {
        self.center
    }

    /// Distances of the faces from the middle.
    #[must_use]
    pub fn half(&self) -> DVec3 {
        self.half
    }

    /// The box that `to_world` makes of this one, if its edges stay along the axes and its faces
    /// keep their numbers: only for shifts and positive scales along the axes.
    #[must_use]
    pub fn under(&self, to_world: &DAffine3) -> Option<Self> {
        let m = to_world.matrix3;
        let scale = DVec3::new(m.x_axis.x, m.y_axis.y, m.z_axis.z);
        let plain = scale.cmpgt(DVec3::ZERO).all() && m == DMat3::from_diagonal(scale);
        plain.then(|| Self::new(to_world.transform_point3(self.center), self.half * scale).ok()).flatten()
    }

    #[inline(always)]
    fn slabs(&self, o: DVec3, d: DVec3) -> [(f64, f64); 3] {
        let f = o - self.center;
        [slab(self.half.x, f.x, d.x), slab(self.half.y, f.y, d.y), slab(self.half.z, f.z, d.z)]
    }

    #[inline(always)]
    fn nearest(&self, o: DVec3, d: DVec3, t_near: f64, t_far: f64) -> f64 {
        let [x, y, z] = self.slabs(o, d);
        let enter = greater(greater(x.0, y.0), z.0);
        let leave = lesser(lesser(x.1, y.1), z.1);
        // A NaN may drop out of `enter` and `leave`, not out of these.
        let ok = (x.0 <= x.1) & (y.0 <= y.1) & (z.0 <= z.1) & (enter <= leave);
        first_inside(enter, leave, t_near, t_far, ok)
    }

    /// Axis of the face at the nearest hit beyond `t_near` and its side, +1 or -1.
    fn face(&self, o: DVec3, d: DVec3, t_near: f64) -> (usize, f64) {
        let slabs = self.slabs(o, d);
        let (mut first, mut last) = (0, 0);
        for axis in 1..3 {
            if slabs[axis].0 > slabs[first].0 {
                first = axis;
            }
            if slabs[axis].1 < slabs[last].1 {
                last = axis;
            }
        }
        if slabs[first].0 > t_near { (first, -d[first].signum()) } else { (last, d[last].signum()) }
    }

    /// Axis and side of the face that is nearest to `p`, given from the centre.
    fn face_near(&self, p: DVec3) -> (usize, f64) {
        let depth = p.abs() - self.half;
        let axis = depth.max_position();
        (axis, 1f64.copysign(p[axis]))
    }
}

/// Plain comparisons: `f64::max` looks for NaN, which costs the vector loop instructions.
#[inline(always)]
fn greater(a: f64, b: f64) -> f64 {
    if b > a { b } else { a }
}

#[inline(always)]
fn lesser(a: f64, b: f64) -> f64 {
    if b < a { b } else { a }
}

impl Shape for Cube {
    fn bounds(&self, to_world: &DAffine3) -> Bounds {
        let m = to_world.matrix3;
        let half = m.x_axis.abs() * self.half.x + m.y_axis.abs() * self.half.y + m.z_axis.abs() * self.half.z;
        let center = to_world.transform_point3(self.center);
        Bounds { lo: center - half, hi: center + half }
    }

    #[inline]
    fn hit(&self, o: DVec3, d: DVec3, t_near: f64, t_far: f64) -> Option<f64> {
        some_hit(self.nearest(o, d, t_near, t_far))
    }

    #[inline(always)]
    fn hit_lanes<T: Copy + Into<f64>, const N: usize>(&self, rays: &Lanes<'_, T, N>) -> Option<[f64; N]> {
        let mut t = [0.0; N];
        for (i, t) in t.iter_mut().enumerate() {
            *t = self.nearest(rays.o(i), rays.d(i), rays.t_near(i), rays.t_far(i));
        }
        some_lane(t)
    }

    fn contains(&self, p: DVec3) -> bool {
        (p - self.center).abs().cmplt(self.half).all()
    }

    #[inline]
    fn refine_for(&self, o: DVec3, d: DVec3, t_near: f64, t: f64, _: bool) -> ShapePoint {
        let own = self.hit(o, d, t_near, f64::INFINITY);
        let t = own.unwrap_or(t);
        let mut p = ((o - self.center) + t * d).clamp(-self.half, self.half);
        let (axis, side) = if own.is_some() { self.face(o, d, t_near) } else { self.face_near(p) };
        p[axis] = side * self.half[axis];
        let ng = side * DVec3::AXES[axis];
        let q = p / self.half;
        let uv = match axis {
            0 => DVec2::new(-side * q.z, -q.y),
            1 => DVec2::new(q.x, side * q.z),
            _ => DVec2::new(side * q.x, -q.y),
        };
        let part = 2 * axis as u8 + u8::from(side > 0.0);
        let extent = self.half.max_element();
        ShapePoint { t, p: self.center + p, ng, uv: 0.5 + 0.5 * uv, extent, part }
    }
}
