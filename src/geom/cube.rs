//! The box.

use super::shape::{first_inside, size, some_hit, some_lane};
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

    /// Where the ray enters and leaves each of the three slabs, as fractions over the length of
    /// the direction along that axis.
    #[inline(always)]
    fn slabs(&self, o: DVec3, d: DVec3) -> Slabs {
        let f = o - self.center;
        let f = [along(f.x, d.x), along(f.y, d.y), along(f.z, d.z)];
        let half = self.half.to_array();
        Slabs {
            enter: [0, 1, 2].map(|k| -half[k] - f[k]),
            leave: [0, 1, 2].map(|k| half[k] - f[k]),
            over: d.abs().to_array(),
        }
    }

    #[inline(always)]
    fn nearest(&self, o: DVec3, d: DVec3, t_near: f64, t_far: f64) -> f64 {
        let slabs = self.slabs(o, d);
        let (enter, leave) = (slabs.entered(), slabs.left());
        first_inside(enter.t, leave.t, t_near, t_far, slabs.meet())
    }

    /// Axis and side of the face that is nearest to `p`, given from the centre.
    fn face_near(&self, p: DVec3) -> (usize, f64) {
        let depth = p.abs() - self.half;
        let axis = depth.max_position();
        (axis, 1f64.copysign(p[axis]))
    }
}

/// Fractions are compared by their products with each other's denominators, and only the two that matter are
/// divided. Equal ones stay equal: a ray that meets an edge exactly hits. An axis that the ray does not move along has
/// nothing to divide by: its products are 0 on one side and tell by the sign whether it starts inside.
struct Slabs {
    enter: [f64; 3],
    leave: [f64; 3],
    over: [f64; 3],
}

/// A face that the ray meets.
struct Meeting {
    t: f64,
    axis: usize,
}

impl Slabs {
    /// Whether there is a stretch of the ray in all three; not if it has a NaN.
    #[inline(always)]
    fn meet(&self) -> bool {
        let before = |i: usize, j: usize| self.enter[i] * self.over[j] <= self.leave[j] * self.over[i];
        before(0, 1) & before(1, 0) & before(0, 2) & before(2, 0) & before(1, 2) & before(2, 1)
    }

    /// Where it enters the last of them; of those at once, that of the least axis.
    #[inline(always)]
    fn entered(&self) -> Meeting {
        self.first(self.enter, |a, b| a > b)
    }

    /// Where it leaves the first of them.
    #[inline(always)]
    fn left(&self) -> Meeting {
        self.first(self.leave, |a, b| a < b)
    }

    #[inline(always)]
    fn first(&self, of: [f64; 3], better: impl Fn(f64, f64) -> bool) -> Meeting {
        let over = self.over;
        let takes = |i: usize, best: f64, under: f64| better(of[i] * under, best * over[i]) | (under == 0.0);
        let y = takes(1, of[0], over[0]);
        let (best, under) = if y { (of[1], over[1]) } else { (of[0], over[0]) };
        let z = takes(2, best, under);
        let (best, under) = if z { (of[2], over[2]) } else { (best, under) };
        let axis = if y { 1 } else { 0 };
        Meeting { t: best / under, axis: if z { 2 } else { axis } }
    }
}

/// `x` on an axis that runs with `d`: negated where that is negative.
#[inline(always)]
fn along(x: f64, d: f64) -> f64 {
    f64::from_bits(x.to_bits() ^ (d.to_bits() & (1 << 63)))
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
    fn refine_for(&self, o: DVec3, d: DVec3, t_near: f64, t: f64, uv: bool) -> ShapePoint {
        let slabs = self.slabs(o, d);
        let (enter, leave) = (slabs.entered(), slabs.left());
        let own = first_inside(enter.t, leave.t, t_near, f64::INFINITY, slabs.meet());
        let found = own < f64::INFINITY;
        let t = if found { own } else { t };
        let mut p = ((o - self.center) + t * d).clamp(-self.half, self.half);
        let (axis, side) = match found {
            true if enter.t > t_near => (enter.axis, -d[enter.axis].signum()),
            true => (leave.axis, d[leave.axis].signum()),
            false => self.face_near(p),
        };
        p[axis] = side * self.half[axis];
        let ng = side * DVec3::AXES[axis];
        let map = || {
            let q = p / self.half;
            let uv = match axis {
                0 => DVec2::new(-side * q.z, -q.y),
                1 => DVec2::new(q.x, side * q.z),
                _ => DVec2::new(side * q.x, -q.y),
            };
            0.5 + 0.5 * uv
        };
        let uv = if uv { map() } else { DVec2::ZERO };
        let part = 2 * axis as u8 + u8::from(side > 0.0);
        let extent = self.half.max_element();
        ShapePoint { t, p: self.center + p, ng, uv, extent, part }
    }
}
