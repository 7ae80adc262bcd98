//! Where a ray meets a shape, the textbook way, in numbers so long that it does not matter.
//!
//! It shares no formula with [`geom`](crate::geom): what both say is right.

use crate::math::dd::{Dd, Dd3, dd};
use glam::{DAffine3, DVec3};

/// A shape of size about 1 around the origin of its own space.
#[derive(Clone, Copy, Debug)]
pub enum Solid {
    /// Radius 1.
    Sphere,
    /// Half sizes.
    Cube([f64; 3]),
    /// Radius 1 around the z axis.
    Cylinder {
        /// Half the height.
        half: f64,
        /// Whether it has lids.
        capped: bool,
    },
    /// Half sizes, in the plane z = 0.
    Quad([f64; 2]),
    /// Corners.
    Triangle([DVec3; 3]),
}

/// One place where the line meets the surface.
#[derive(Clone, Copy, Debug)]
struct Crossing {
    t: Dd,
    /// Outward normal in the shape's space.
    n: [Dd; 3],
    /// How far inside the border of its part of the surface, relative to the shape's size.
    inside: f64,
}

/// Answer with the margin by which the yes or no is safe.
#[derive(Clone, Copy, Debug)]
pub struct Truth {
    /// The nearest beyond `t_near`, and its normal in world space.
    pub hit: Option<(f64, DVec3)>,
    /// Least relative change of the input that may change `hit.is_some()` or the part that is hit.
    pub margin: f64,
}

/// What a ray from `o` along `d` meets first beyond `t_near` of `solid` as `to_world` places it.
#[must_use]
pub fn truth(solid: Solid, to_world: &DAffine3, o: DVec3, d: DVec3, t_near: f64) -> Truth {
    let columns = [to_world.matrix3.x_axis, to_world.matrix3.y_axis, to_world.matrix3.z_axis].map(Dd3::of);
    let [x, y, z] = columns;
    let cofactors = [y.cross(z), z.cross(x), x.cross(y)];
    let det = x.dot(cofactors[0]);
    let take_back = |v: Dd3| cofactors.map(|c| c.dot(v) / det);
    let local_o = take_back(Dd3::of(o) - Dd3::of(to_world.translation));
    let local_d = take_back(Dd3::of(d));
    let (crossings, silhouette) = crossings(solid, local_o, local_d);
    let mut margin = silhouette;
    let mut hit: Option<Crossing> = None;
    for c in crossings {
        let scale = c.t.abs().to_f64() * Dd3(local_d).length().to_f64() + 1.0;
        margin = margin.min(c.inside.abs());
        // Right at the start of the interval nothing is decidable.
        margin = margin.min((c.t - dd(t_near)).to_f64().abs() * Dd3(local_d).length().to_f64() / scale * 1e3);
        if c.inside >= 0.0 && c.t > dd(t_near) && hit.is_none_or(|h| c.t < h.t) {
            hit = Some(c);
        }
    }
    let hit = hit.map(|h| {
        let [a, b, c] = cofactors;
        let n = a.scale(h.n[0]) + b.scale(h.n[1]) + c.scale(h.n[2]);
        let sign = if det < dd(0.0) { dd(-1.0) } else { dd(1.0) };
        (h.t.to_f64(), n.scale(sign / n.length()).to_f64())
    });
    Truth { hit, margin }
}

/// All crossings of the line with the whole surfaces that bound the solid, and how far the line
/// is from only touching a curved one.
fn crossings(solid: Solid, o: [Dd; 3], d: [Dd; 3]) -> (Vec<Crossing>, f64) {
    let at = |t: Dd| [o[0] + t * d[0], o[1] + t * d[1], o[2] + t * d[2]];
    let zero = dd(0.0);
    match solid {
        Solid::Sphere => {
            let (ts, silhouette) = quadratic(&[0, 1, 2], o, d);
            (ts.into_iter().map(|t| Crossing { t, n: at(t), inside: 1.0 }).collect(), silhouette)
        }
        Solid::Cube(half) => {
            let plane = |axis: usize, side: f64| {
                let t = (dd(side * half[axis]) - o[axis]) / d[axis];
                let p = at(t);
                let others = (0..3).filter(|&k| k != axis);
                let inside = others.map(|k| 1.0 - p[k].abs().to_f64() / half[k]).fold(f64::INFINITY, f64::min);
                let mut n = [zero; 3];
                n[axis] = dd(side);
                Crossing { t, n, inside }
            };
            let axes = (0..3).filter(|&k| d[k] != zero);
            (axes.flat_map(|k| [plane(k, -1.0), plane(k, 1.0)]).collect(), f64::INFINITY)
        }
        Solid::Cylinder { half, capped } => {
            let (ts, silhouette) = quadratic(&[0, 1], o, d);
            let mut all: Vec<_> = ts
                .into_iter()
                .map(|t| {
                    let p = at(t);
                    Crossing { t, n: [p[0], p[1], zero], inside: 1.0 - p[2].abs().to_f64() / half }
                })
                .collect();
            if capped && d[2] != zero {
                all.extend([-1.0, 1.0].map(|side| {
                    let t = (dd(side * half) - o[2]) / d[2];
                    let p = at(t);
                    let inside = (dd(1.0) - (p[0] * p[0] + p[1] * p[1])).to_f64();
                    Crossing { t, n: [zero, zero, dd(side)], inside }
                }));
            }
            (all, silhouette)
        }
        Solid::Quad(half) => {
            if d[2] == zero {
                return (vec![], f64::INFINITY);
            }
            let t = -o[2] / d[2];
            let p = at(t);
            let inside = (1.0 - p[0].abs().to_f64() / half[0]).min(1.0 - p[1].abs().to_f64() / half[1]);
            (vec![Crossing { t, n: [zero, zero, dd(1.0)], inside }], f64::INFINITY)
        }
        Solid::Triangle(corners) => (triangle(corners, Dd3(o), Dd3(d)).into_iter().collect(), f64::INFINITY),
    }
}

/// Where the line meets the plane; the weights of the corners are ratios of areas.
fn triangle(corners: [DVec3; 3], o: Dd3, d: Dd3) -> Option<Crossing> {
    let [a, b, c] = corners.map(Dd3::of);
    let n = (b - a).cross(c - a);
    let along = n.dot(d);
    if along == dd(0.0) {
        return None;
    }
    let t = n.dot(a - o) / along;
    let p = o + d.scale(t);
    let part = |from: Dd3, to: Dd3| (n.dot((to - from).cross(p - from)) / n.dot(n)).to_f64();
    Some(Crossing { t, n: n.0, inside: part(a, b).min(part(b, c)).min(part(c, a)) })
}

/// Roots of `sum (o + t d)^2 = 1` over `axes`, and the discriminant relative to its scale.
fn quadratic(axes: &[usize], o: [Dd; 3], d: [Dd; 3]) -> (Vec<Dd>, f64) {
    let sum = |f: &dyn Fn(usize) -> Dd| axes.iter().fold(dd(0.0), |s, &k| s + f(k));
    let (a, b) = (sum(&|k| d[k] * d[k]), sum(&|k| o[k] * d[k]));
    let c = sum(&|k| o[k] * o[k]) - dd(1.0);
    if a == dd(0.0) {
        return (vec![], f64::INFINITY);
    }
    let disc = b * b - a * c;
    let silhouette = (disc / a).to_f64();
    if disc < dd(0.0) {
        return (vec![], silhouette.abs());
    }
    let root = disc.sqrt();
    (vec![(-b - root) / a, (-b + root) / a], silhouette.abs())
}
