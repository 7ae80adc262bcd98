//! Rays aimed at what is hard to decide.

use super::report::Group;
use super::targets::{Outline, Targets};
use crate::geom::{Bounds, Ray, ShapeSet, TriangleMesh};
use crate::math::Random;
use crate::scene::{AnyShapes, Object, Scene};
use crate::with_shapes;
use glam::{DAffine3, DVec3, Vec3};

/// Aims at the things of a scene.
#[derive(Debug)]
pub(super) struct Aim<'a> {
    scene: &'a Scene,
    targets: Targets<'a>,
    center: DVec3,
    radius: f64,
}

/// A point to aim at and how large what it belongs to is.
struct Target {
    at: DVec3,
    size: f64,
    /// From where it is to be seen, if that matters.
    from: Option<DVec3>,
}

impl<'a> Aim<'a> {
    pub(super) fn new(scene: &'a Scene, seed: u32) -> Self {
        let bounds = scene.local_bounds();
        let radius = 0.5 * bounds.size().length();
        Self { scene, targets: Targets::of(scene, seed), center: bounds.center(), radius }
    }

    /// A ray of `group`; none where what was picked has nothing to aim at.
    pub(super) fn ray(&self, group: Group, random: &mut Random) -> Option<Ray> {
        let on_ball = |random: &mut Random| self.center + self.radius * random.direction();
        if group == Group::Chords {
            let (from, to) = (on_ball(random), on_ball(random));
            return ray(to.as_vec3(), from, random);
        }
        let (geom, prim) = self.targets.pick(random)?;
        let target = match &self.scene.objects[geom as usize] {
            Object::Shapes(shapes) => return self.at_shape(group, &shapes.set, prim, random),
            Object::Mesh(mesh) => self.at_mesh(group, geom, &mesh.data.triangles, prim, None, random)?,
            Object::Instance(i) => {
                self.at_mesh(group, geom, &i.mesh.data.triangles, prim, Some(&i.to_scene), random)?
            }
        };
        let from = match target.from {
            Some(towards) => target.at + towards * self.distance(target.size, random),
            None => self.start(&target, random),
        };
        if matches!(group, Group::Vertices | Group::Edges) && random.flip() {
            return exact_ray(target.at.as_vec3(), from, random);
        }
        ray(target.at.as_vec3(), from, random)
    }

    /// From one to a hundred sizes, or as far as the scene reaches.
    fn distance(&self, size: f64, random: &mut Random) -> f64 {
        if random.flip() { size * 10f64.powf(random.between(0.0, 2.0)) } else { self.radius * random.between(0.3, 3.0) }
    }

    /// Where a ray at `target` starts: near it, or anywhere in the scene and around it.
    fn start(&self, target: &Target, random: &mut Random) -> DVec3 {
        if random.flip() {
            target.at + random.direction() * self.distance(target.size, random)
        } else {
            self.center + random.direction() * (self.radius * random.between(0.0, 3.0))
        }
    }

    fn at_mesh(
        &self,
        group: Group,
        geom: u32,
        mesh: &TriangleMesh,
        prim: u32,
        to_scene: Option<&DAffine3>,
        random: &mut Random,
    ) -> Option<Target> {
        let placed = |p: DVec3| to_scene.map_or(p, |to| to.transform_point3(p));
        let corners = |face: u32| mesh.triangle(face).map(|p| placed(p.as_dvec3()));
        let size = |p: [DVec3; 3]| (p[1] - p[0]).length().max((p[2] - p[0]).length());
        let (at, size, from) = match group {
            Group::Silhouettes => {
                let Outline { edge, face, other } = self.targets.outline(geom, random)?;
                let normal = |face: u32| {
                    let [a, b, c] = corners(face);
                    (b - a).cross(c - a).try_normalize()
                };
                let [a, b] = edge.map(|i| placed(mesh.point(i).as_dvec3()));
                let across = match other {
                    // Seen so, one of the two faces the eye and the other does not.
                    Some(other) => (normal(face)? - normal(other)?).try_normalize()?,
                    None => random.direction(),
                };
                let along = (b - a).try_normalize()?;
                let towards = (across * random.between(0.2, 1.0) + along * random.between(-1.0, 1.0)).normalize();
                (a + random.unit() * (b - a), (b - a).length(), Some(towards))
            }
            _ => {
                let p = corners(prim);
                let at = match group {
                    Group::Vertices => p[random.below(3)],
                    Group::Edges => {
                        let i = random.below(3);
                        p[i] + share(random) * (p[(i + 1) % 3] - p[i])
                    }
                    _ => {
                        let (mut u, mut v) = (random.unit(), random.unit());
                        if u + v > 1.0 {
                            (u, v) = (1.0 - u, 1.0 - v);
                        }
                        p[0] + u * (p[1] - p[0]) + v * (p[2] - p[0])
                    }
                };
                (at, size(p), None)
            }
        };
        Some(Target { at, size, from })
    }

    fn at_shape(&self, group: Group, set: &AnyShapes, prim: u32, random: &mut Random) -> Option<Ray> {
        let bounds = with_shapes!(set, set => set.bounds(prim));
        let at = match group {
            Group::Vertices => in_box(&bounds, || random.below(2) as f64),
            Group::Edges => {
                let free = random.below(3);
                let mut axis = 0;
                in_box(&bounds, || {
                    axis += 1;
                    if axis - 1 == free { random.unit() } else { random.below(2) as f64 }
                })
            }
            _ => in_box(&bounds, || random.between(0.15, 0.85)),
        };
        let target = Target { at, size: bounds.size().max_element(), from: None };
        let from = self.start(&target, random);
        let at = if group == Group::Silhouettes { outline(set, prim, &target, from, random)? } else { at.as_vec3() };
        ray(at, from, random)
    }
}

/// A part of an edge: often a half or a quarter, which f32 can hit exactly.
fn share(random: &mut Random) -> f64 {
    if random.flip() { random.unit() } else { (1 + random.below(7)) as f64 / 8.0 }
}

fn in_box(b: &Bounds, mut share: impl FnMut() -> f64) -> DVec3 {
    let mut at = |axis: usize| b.lo[axis] + share() * (b.hi[axis] - b.lo[axis]);
    DVec3::new(at(0), at(1), at(2))
}

/// A point within four ulps of where the shape, seen from `from`, ends.
fn outline(set: &AnyShapes, prim: u32, target: &Target, from: DVec3, random: &mut Random) -> Option<Vec3> {
    let hit = |p: DVec3| with_shapes!(set, set => set.hit(prim, from, p - from, 0.0, f64::INFINITY)).is_some();
    let view = (target.at - from).try_normalize()?;
    let across = random.direction().cross(view).try_normalize()?;
    let (mut inside, mut outside) = (target.at, target.at + across * (2.0 * target.size));
    if !hit(inside) || hit(outside) {
        return None;
    }
    for _ in 0..60 {
        let middle = 0.5 * (inside + outside);
        *(if hit(middle) { &mut inside } else { &mut outside }) = middle;
    }
    let ulp = f64::from(f32::EPSILON) * inside.abs().max_element();
    Some((inside + across * (ulp * random.between(-4.0, 4.0))).as_vec3())
}

/// A ray at `at` that starts near `from`. It passes within half an ulp of the coordinates of the start.
fn ray(at: Vec3, from: DVec3, random: &mut Random) -> Option<Ray> {
    let step = |axis: usize| power_above(f64::from(at[axis]).abs().max(from[axis].abs())) * 2f64.powi(-22);
    in_steps(at, from, step, random)
}

/// A ray that meets `at` exactly. f32 can start it only where no coordinate is in a higher binade than that of `at`:
/// that is as near to `from` as it can be.
fn exact_ray(at: Vec3, from: DVec3, random: &mut Random) -> Option<Ray> {
    let most = |axis: usize| match f64::from(at[axis]) {
        0.0 => power_above(from[axis].abs()),
        x => power_above(x.abs()),
    };
    let reach = DVec3::new(most(0), most(1), most(2)) * (1.0 - 2f64.powi(-20));
    in_steps(at, from.clamp(-reach, reach), |axis| most(axis) * 2f64.powi(-22), random)
}

/// The least power of two that is not below `x`.
fn power_above(x: f64) -> f64 {
    2f64.powi(x.max(1e-30).log2().ceil() as i32)
}

/// The way from the start to `at` is made of whole steps, of a power of two each, so that it is exact; the start is what
/// is left. The direction has any length from 1/8 to 8 times that.
fn in_steps(at: Vec3, from: DVec3, step: impl Fn(usize) -> f64, random: &mut Random) -> Option<Ray> {
    let (mut o, mut d) = (Vec3::ZERO, Vec3::ZERO);
    for axis in 0..3 {
        let (to, step) = (f64::from(at[axis]), step(axis));
        let way = ((to - from[axis]) / step).round() * step;
        d[axis] = way as f32;
        o[axis] = (to - way) as f32;
    }
    let d = d * 2f32.powi(random.below(7) as i32 - 3);
    (o.is_finite() && d.is_finite() && d != Vec3::ZERO).then(|| Ray::new(o, d))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// How far the ray passes `at` by.
    fn off(ray: &Ray, at: Vec3) -> f64 {
        let (o, d) = (ray.o.as_dvec3(), ray.d.as_dvec3());
        let t = (at.as_dvec3() - o).dot(d) / d.length_squared();
        let t = 2f64.powi(t.log2().round() as i32);
        (o + t * d - at.as_dvec3()).abs().max_element()
    }

    #[test]
    fn rays_meet_what_they_are_aimed_at() {
        let mut random = Random::of(1, 2, 3);
        for i in 0..1000 {
            let mut at = (random.direction() * 0.7).as_vec3();
            if i % 10 == 0 {
                at.y = 0.0;
            }
            let from = random.direction() * 3.0;
            let near = ray(at, from, &mut random).expect("they are apart");
            assert!(off(&near, at) <= f64::from(f32::EPSILON), "{:e}", off(&near, at));
            assert!((near.o.as_dvec3() - from).length() < 1e-5);
            let exact = exact_ray(at, from, &mut random).expect("they are apart");
            assert_eq!(off(&exact, at), 0.0, "{exact:?} at {at}");
        }
    }
}
