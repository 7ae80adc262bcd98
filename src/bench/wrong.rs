//! Wrong answers about single shapes: hits that are missed or made up, and how far off `t` is, against exact numbers.

use super::cost::median;
use super::setup::{self, placed, plain, soup};
use super::truth::{Solid, truth};
use super::{robust, textbook};
use crate::backend::{AnyBackend, BackendKind, Error};
use crate::geom::{self, Ray, ShapeSet, triangle};
use crate::math::Frame;
use crate::math::Random;
use crate::scene::{AnyShapes, Mesh, Object, Scene, Shapes};
use crate::with_shapes;
use glam::{DAffine3, DVec3, Vec3};
use rayon::prelude::*;
use std::hint::black_box;
use std::time::Instant;

/// What is asked about. All are about 1 in size at scale 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[expect(missing_docs, reason = "the shapes")]
pub enum Shape {
    Sphere,
    Cube,
    /// Open.
    Cylinder,
    Triangle,
}

impl Shape {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Sphere, Self::Cube, Self::Cylinder, Self::Triangle];

    /// Name in tables.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Sphere => "sphere",
            Self::Cube => "cube",
            Self::Cylinder => "cylinder",
            Self::Triangle => "triangle",
        }
    }
}

/// What is far from 1.
#[derive(Clone, Copy, Debug)]
pub struct Setting {
    /// Size of the shape.
    pub scale: f64,
    /// Distance of the eye, in sizes.
    pub distance: f64,
    /// Length of the direction.
    pub length: f64,
}

impl Setting {
    /// Nothing.
    pub const PLAIN: Self = Self { scale: 1.0, distance: 3.0, length: 1.0 };
}

/// A ray counts only if its yes or no does not change for a relative change of the input below this.
pub const MARGIN: f64 = 1e-6;

/// How many answers were wrong.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Count {
    /// Rays that count.
    pub rays: u64,
    /// Hits that were not found.
    pub missed: u64,
    /// Hits that are none.
    pub made_up: u64,
    /// Largest relative error of `t` where there is a hit.
    pub worst_t: f64,
    /// Hits that were found.
    pub found: u64,
    /// Sum of the squares of their relative errors of `t`.
    pub squares_t: f64,
}

impl Count {
    fn add(&mut self, want: Option<f64>, got: Option<f64>) {
        self.rays += 1;
        match (want, got) {
            (Some(want), Some(got)) => {
                let off = got / want - 1.0;
                self.worst_t = worse(self.worst_t, off.abs());
                self.found += 1;
                self.squares_t += off * off;
            }
            (Some(_), None) => self.missed += 1,
            (None, Some(_)) => self.made_up += 1,
            (None, None) => {}
        }
    }

    fn plus(self, o: Self) -> Self {
        Self {
            rays: self.rays + o.rays,
            missed: self.missed + o.missed,
            made_up: self.made_up + o.made_up,
            worst_t: worse(self.worst_t, o.worst_t),
            found: self.found + o.found,
            squares_t: self.squares_t + o.squares_t,
        }
    }

    /// Share of wrong answers.
    #[must_use]
    pub fn share(&self) -> f64 {
        (self.missed + self.made_up) as f64 / self.rays.max(1) as f64
    }

    /// Root of the mean of the squared relative errors of `t`; NaN if no hit was found.
    #[must_use]
    pub fn rms_t(&self) -> f64 {
        (self.squares_t / self.found as f64).sqrt()
    }
}

/// The larger one, or NaN if there is one, which `max` would let go.
fn worse(a: f64, b: f64) -> f64 {
    if b > a || b.is_nan() { b } else { a }
}

/// Numbers of a shape at some scale: in f32, so that who takes f32 and who takes f64 are asked the same.
#[derive(Clone, Copy, Debug)]
struct Sizes {
    scale: f32,
    half: Vec3,
    height: f32,
    corners: [Vec3; 3],
}

impl Sizes {
    fn new(scale: f64) -> Self {
        let at = |x: f64, y: f64, z: f64| (scale * DVec3::new(x, y, z)).as_vec3();
        Self {
            scale: scale as f32,
            half: at(1.0, 0.7, 0.4),
            height: (1.6 * scale) as f32,
            corners: [at(-0.8, -0.6, 0.1), at(0.9, -0.5, -0.2), at(-0.1, 0.9, 0.3)],
        }
    }

    /// The shape at a size of about 1, and the way to the size it has, exactly.
    fn solid(&self, shape: Shape) -> (Solid, DAffine3) {
        let unit = frame(f64::from(self.scale)).world_per_local();
        let down = |x: f32| f64::from(x) / unit;
        let radius = f64::from(self.scale);
        let (solid, scale) = match shape {
            Shape::Sphere => (Solid::Sphere, DVec3::splat(radius)),
            Shape::Cube => (Solid::Cube(self.half.to_array().map(down)), DVec3::splat(unit)),
            Shape::Cylinder => {
                let half = 0.5 * down(self.height);
                (Solid::Cylinder { half, capped: false }, DVec3::new(radius, radius, unit))
            }
            Shape::Triangle => {
                let corners = self.corners.map(|p| DVec3::from(p.to_array().map(down)));
                (Solid::Triangle(corners), DVec3::splat(unit))
            }
        };
        (solid, DAffine3::from_scale(scale))
    }

    /// As the loader would have it: in a frame that makes its size about 1, by a power of two.
    fn scene(&self, shape: Shape) -> Scene {
        let frame = frame(f64::from(self.scale));
        let down = frame.local_per_world();
        let local = |v: Vec3| v.as_dvec3() * down;
        let shapes = |set| Object::Shapes(Shapes::bare(set));
        let object = match shape {
            Shape::Sphere => shapes(AnyShapes::Spheres(plain([sphere(f64::from(self.scale) * down)]))),
            Shape::Cube => shapes(AnyShapes::Cubes(plain([cube(local(self.half))]))),
            Shape::Cylinder => {
                let set =
                    placed(cylinder(f64::from(self.scale) * down, f64::from(self.height) * down), DAffine3::IDENTITY);
                shapes(AnyShapes::Cylinders(set))
            }
            Shape::Triangle => {
                let corners = self.corners.map(|p| local(p).as_vec3());
                Object::Mesh(Mesh::bare(soup(&[corners])))
            }
        };
        Scene { frame, ..Scene::of(vec![object]) }
    }
}

fn frame(scale: f64) -> Frame {
    Frame::IDENTITY.rescaled(scale)
}

fn sphere(radius: f64) -> geom::Sphere {
    geom::Sphere::new(DVec3::ZERO, radius).expect("a size above 0")
}

fn cube(half: DVec3) -> geom::Cube {
    geom::Cube::new(DVec3::ZERO, half).expect("sizes above 0")
}

fn cylinder(radius: f64, height: f64) -> geom::Cylinder {
    geom::Cylinder::new(radius, height, false).expect("sizes above 0")
}

/// Who is asked: a name, and the `t` that it answers.
struct Asked {
    name: &'static str,
    answer: Answer,
}

/// Of many rays, one after the other: one call through a pointer for all of them, so that it does not show in their time.
type Answer = Box<dyn Fn(&[Ray], &mut [Option<f64>]) + Send + Sync>;

fn each(answer: impl Fn(&Ray) -> Option<f64> + Send + Sync + 'static) -> Answer {
    Box::new(move |rays, out| rays.iter().zip(out).for_each(|(ray, out)| *out = answer(black_box(ray))))
}

fn each_f32(answer: impl Fn(&Ray) -> Option<f32> + Send + Sync + 'static) -> Answer {
    each(move |ray| answer(ray).map(f64::from))
}

/// Wrong answers of everybody who can be asked about `shape`, by name; the same rays for all.
///
/// # Errors
/// If a backend cannot be built.
pub fn wrong(shape: Shape, setting: Setting, rays: u64) -> Result<Vec<(&'static str, Count)>, Error> {
    let sizes = Sizes::new(setting.scale);
    let asked = everybody(shape, &sizes)?;
    let (solid, to_world) = sizes.solid(shape);
    const CHUNK: u64 = 500;
    let chunk = |chunk: u64| {
        let mut random = Random(0xace ^ (chunk << 8));
        let (mut rays_of_chunk, mut wanted) = (Vec::new(), Vec::new());
        for _ in 0..CHUNK.min(rays - chunk * CHUNK) {
            let ray = ray(setting, &mut random);
            let want = truth(solid, &to_world, ray.o.as_dvec3(), ray.d.as_dvec3(), 0.0);
            // A NaN margin is none either.
            if want.margin >= MARGIN {
                rays_of_chunk.push(ray);
                wanted.push(want.hit.map(|h| h.0));
            }
        }
        let mut answers = vec![None; wanted.len()];
        let count = |asked: &Asked| {
            (asked.answer)(&rays_of_chunk, &mut answers);
            let mut count = Count::default();
            wanted.iter().zip(&answers).for_each(|(&want, &got)| count.add(want, got));
            count
        };
        asked.iter().map(count).collect()
    };
    let none = || vec![Count::default(); asked.len()];
    let sum = |a: Vec<Count>, b: Vec<Count>| a.into_iter().zip(b).map(|(a, b)| a.plus(b)).collect();
    let counts: Vec<Count> = (0..rays.div_ceil(CHUNK)).into_par_iter().map(chunk).reduce(none, sum);
    Ok(asked.iter().map(|a| a.name).zip(counts).collect())
}

/// Nanoseconds that each ray takes everybody, on one thread, one ray after the other: medians of so many rounds in turn.
/// Backends go through their hierarchy of one primitive.
///
/// # Errors
/// If a backend cannot be built.
pub fn times(shape: Shape, setting: Setting, rounds: usize) -> Result<Vec<(&'static str, f64)>, Error> {
    const RAYS: usize = 4096;
    let asked = everybody(shape, &Sizes::new(setting.scale))?;
    let mut random = Random(0xbee);
    let rays: Vec<Ray> = (0..RAYS).map(|_| ray(setting, &mut random)).collect();
    let mut answers = vec![None; RAYS];
    let mut taken: Vec<Vec<f64>> = vec![Vec::new(); asked.len()];
    // The first round warms the caches.
    for round in 0..=rounds.max(1) {
        for (asked, taken) in asked.iter().zip(&mut taken) {
            let start = Instant::now();
            (asked.answer)(&rays, &mut answers);
            black_box(&answers);
            if round > 0 {
                taken.push(start.elapsed().as_secs_f64() * 1e9 / RAYS as f64);
            }
        }
    }
    Ok(asked.iter().map(|a| a.name).zip(taken.into_iter().map(median)).collect())
}

/// From the eye towards the shape's surroundings, about half of them hit.
fn ray(setting: Setting, random: &mut Random) -> Ray {
    let o = (setting.distance * setting.scale * random.direction()).as_vec3();
    let target = setting.scale * 1.3 * random.point();
    let d = (target - o.as_dvec3()).normalize() * setting.length;
    Ray::new(o, d.as_vec3())
}

fn everybody(shape: Shape, sizes: &Sizes) -> Result<Vec<Asked>, Error> {
    let mut all = vec![textbook_form(shape, *sizes), robust_form(shape, *sizes), formula(shape, *sizes)];
    for &kind in BackendKind::COMPILED.iter().rev() {
        all.push(backend(kind, shape, sizes)?);
    }
    #[cfg(feature = "embree")]
    all.extend(raw_embree(shape, sizes)?);
    Ok(all)
}

fn textbook_form(shape: Shape, s: Sizes) -> Asked {
    let answer = match shape {
        Shape::Sphere => each_f32(move |ray| textbook::sphere(s.scale, ray)),
        Shape::Cube => each_f32(move |ray| textbook::cube(s.half, ray)),
        Shape::Cylinder => each_f32(move |ray| textbook::cylinder(s.scale, 0.5 * s.height, ray)),
        Shape::Triangle => each_f32(move |ray| textbook::triangle(s.corners, ray)),
    };
    Asked { name: "textbook f32", answer }
}

fn robust_form(shape: Shape, s: Sizes) -> Asked {
    let answer = match shape {
        Shape::Sphere => each_f32(move |ray| robust::sphere(s.scale, ray)),
        Shape::Cube => each_f32(move |ray| robust::cube(s.half, ray)),
        Shape::Cylinder => each_f32(move |ray| robust::cylinder(s.scale, 0.5 * s.height, ray)),
        Shape::Triangle => each_f32(move |ray| robust::triangle(s.corners, ray)),
    };
    Asked { name: "robust f32", answer }
}

/// Our own test by itself.
fn formula(shape: Shape, s: Sizes) -> Asked {
    fn test(of: impl geom::Shape) -> Answer {
        each(move |ray| of.hit(ray.o.as_dvec3(), ray.d.as_dvec3(), 0.0, f64::INFINITY))
    }
    let answer = match shape {
        Shape::Sphere => test(sphere(f64::from(s.scale))),
        Shape::Cube => test(cube(s.half.as_dvec3())),
        Shape::Cylinder => test(cylinder(f64::from(s.scale), f64::from(s.height))),
        Shape::Triangle => each(move |ray| triangle::intersect(&ray.into(), s.corners).map(|h| h.t)),
    };
    Asked { name: "ours, f64", answer }
}

/// A backend as the renderer asks it: in the scene's frame, and refined.
fn backend(kind: BackendKind, shape: Shape, sizes: &Sizes) -> Result<Asked, Error> {
    let scene = sizes.scene(shape);
    let backend = setup::build(kind, &scene)?;
    let name = if kind == BackendKind::Native { "native" } else { "Embree + refine" };
    Ok(Asked { name, answer: each(move |ray| refined(&backend, &scene, ray)) })
}

fn refined(backend: &AnyBackend, scene: &Scene, ray: &Ray) -> Option<f64> {
    // A power of two: nothing is rounded, and `t` counts in units of the direction.
    let local = Ray { o: scene.frame.to_local(ray.o.as_dvec3()).as_vec3(), ..*ray };
    let hit = backend.as_dyn().intersect(&local)?;
    let (o, d) = (local.o.as_dvec3(), local.d.as_dvec3());
    let t = match &scene.objects[hit.geom_id as usize] {
        Object::Shapes(shapes) => with_shapes!(&shapes.set, set => {
            set.refine_for(hit.prim_id, o, d, 0.0, f64::from(hit.t), false).t
        }),
        Object::Mesh(mesh) => {
            triangle::refine(local.o, local.d, mesh.data.triangles.triangle(hit.prim_id), (hit.u, hit.v)).t
        }
        Object::Instance(_) => unreachable!("there is none in these scenes"),
    };
    Some(t * scene.frame.world_per_local())
}

/// Embree's own primitive with nothing of ours around it: no frame, no care for directions, no refinement.
#[cfg(feature = "embree")]
fn raw_embree(shape: Shape, s: &Sizes) -> Result<Option<Asked>, Error> {
    use crate::embree::{Device, DeviceConfig, SceneBuilder, SceneOptions};
    let device = Device::new(&DeviceConfig::default())?;
    let mut builder = SceneBuilder::new(&device, SceneOptions::default())?;
    match shape {
        Shape::Sphere => builder.own_spheres(&[[0.0, 0.0, 0.0, s.scale]])?,
        Shape::Triangle => builder.mesh(std::sync::Arc::new(soup(&[s.corners])))?,
        Shape::Cube | Shape::Cylinder => return Ok(None),
    };
    let scene = builder.commit(None)?;
    Ok(Some(Asked { name: "Embree raw", answer: each_f32(move |ray| scene.intersect_raw(ray).map(|hit| hit.t)) }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_truth_tells_right_from_wrong() {
        let at = |shape, setting| wrong(shape, setting, 2000).expect("a good scene");
        let far = Setting { distance: 1.5e4, ..Setting::PLAIN };
        for (setting, shape) in [Setting::PLAIN, far].into_iter().flat_map(|s| Shape::ALL.map(|shape| (s, shape))) {
            for (who, count) in at(shape, setting) {
                let what = format!("{}, {who}, {setting:?}: {count:?}", shape.name());
                assert!(count.rays > 1800, "{what}");
                // f32 cannot tell at this margin from far away, which is Embree's lot with triangles.
                let exact =
                    ["ours, f64", "native"].contains(&who) || shape != Shape::Triangle && who == "Embree + refine";
                if exact {
                    assert!(count.share() == 0.0 && count.worst_t < 1e-13, "{what}");
                }
                if who == "textbook f32" && shape == Shape::Sphere {
                    assert_eq!(count.share() > 0.1, setting.distance > 1e3, "{what}");
                }
                if who == "robust f32" {
                    assert!(count.share() < 0.01, "{what}");
                }
                assert!(count.rms_t() <= count.worst_t && count.found > 0, "{what}");
                assert!(count.worst_t < 0.1, "{what}");
            }
        }
    }

    #[test]
    fn scale_and_length_change_nothing_for_us() {
        for (scale, length) in [(1e-15, 1.0), (1e15, 1.0), (1.0, 1e-30), (1.0, 1e25)] {
            for shape in Shape::ALL {
                let setting = Setting { scale, length, ..Setting::PLAIN };
                for (who, count) in wrong(shape, setting, 500).expect("a good scene") {
                    if !["textbook f32", "robust f32", "Embree raw"].contains(&who) {
                        let what = format!("{}, {who}, {setting:?}: {count:?}", shape.name());
                        assert!(count.share() == 0.0 && count.worst_t < 1e-13, "{what}");
                    }
                }
            }
        }
    }
}
