//! Shapes in scenes, asked through the backends as the renderer asks them.

use glam::{DAffine3, DMat3, DQuat, DVec2, DVec3, Vec3};
use tison::backend::{AnyBackend, BackendKind};
use tison::bench::setup::{self, placed, plain};
use tison::bench::truth::{Solid, truth};
use tison::geom::{Cube, Cylinder, Quad, Ray, ShapePoint, ShapeSet, Sphere};
use tison::math::Random;
use tison::scene::{AnyShapes, Object, Scene, Shapes};
use tison::with_shapes;

/// A test once per backend: `name::native` and `name::embree`.
#[macro_export]
macro_rules! for_each_backend {
    ($($(#[$about:meta])* fn $name:ident($kind:ident: $kinds:ident) $body:block)*) => {
        $(mod $name {
            use super::*;

            $(#[$about])*
            fn check($kind: $kinds) $body

            #[test]
            fn native() {
                check($kinds::Native);
            }

            #[cfg(feature = "embree")]
            #[test]
            fn embree() {
                check($kinds::Embree);
            }
        })*
    };
}

/// One shape alone in a scene.
pub struct Specimen {
    pub name: String,
    pub solid: Solid,
    pub to_world: DAffine3,
    pub scene: Scene,
    backend: AnyBackend,
}

impl Specimen {
    pub fn new(kind: BackendKind, name: &str, solid: Solid, to_world: DAffine3, set: AnyShapes) -> Self {
        let scene = Scene::of(vec![Object::Shapes(Shapes::bare(set))]);
        let backend = setup::build(kind, &scene).expect("a good scene");
        Self { name: format!("{name}, {kind:?}"), solid, to_world, scene, backend }
    }

    /// What the renderer makes of the hit: the surface point in f64.
    pub fn hit(&self, ray: &Ray) -> Option<ShapePoint> {
        let backend = self.backend.as_dyn();
        let hit = backend.intersect(ray);
        assert_eq!(backend.occluded(ray), hit.is_some(), "{}: {ray:?}", self.name);
        let hit = hit?;
        let Object::Shapes(shapes) = &self.scene.objects[0] else { unreachable!("it is one") };
        let (o, d) = (ray.o.as_dvec3(), ray.d.as_dvec3());
        let (t_near, t) = (f64::from(ray.t_near), f64::from(hit.t));
        let point = with_shapes!(&shapes.set, set => set.refine(hit.prim_id, o, d, t_near, t));
        // What is reported is the answer in f64, rounded once, but where the direction was scaled.
        assert!((point.t / t - 1.0).abs() < 2e-7, "{}: {} reported as {t}; {ray:?}", self.name, point.t);
        Some(point)
    }

    /// A ray from `distance` sizes away at the shape's surroundings.
    pub fn ray(&self, random: &mut Random, distance: f64) -> Ray {
        let o = self.to_world.transform_point3(distance * random.direction()).as_vec3();
        let target = self.to_world.transform_point3(1.3 * random.point());
        Ray::new(o, (target - o.as_dvec3()).as_vec3())
    }

    /// Compares with the truth for the very ray; whether it was a decidable hit.
    pub fn check(&self, ray: &Ray, limits: &Limits) -> Option<bool> {
        let (o, d) = (ray.o.as_dvec3(), ray.d.as_dvec3());
        let want = truth(self.solid, &self.to_world, o, d, f64::from(ray.t_near));
        let got = self.hit(ray);
        if want.margin.is_nan() || want.margin < limits.margin {
            return None;
        }
        assert_eq!(got.is_some(), want.hit.is_some(), "{}: {ray:?}, margin {:e}", self.name, want.margin);
        let (Some(got), Some((t, n))) = (got, want.hit) else { return Some(false) };
        let off = (got.t / t - 1.0).abs();
        assert!(off <= limits.t, "{}: t {} for {t}, off by {off:e}; {ray:?}", self.name, got.t);
        let angle = 2.0 * (0.5 * (got.ng - n).length()).asin();
        assert!(angle <= limits.radians, "{}: normal {} for {n}, off by {angle:e}; {ray:?}", self.name, got.ng);
        assert_eq!(got.entering(d), n.dot(d) < 0.0, "{}: {ray:?}", self.name);
        Some(true)
    }
}

/// What `check` allows.
pub struct Limits {
    /// A yes or no counts only if it is this far from changing.
    pub margin: f64,
    /// Error of t relative to t.
    pub t: f64,
    /// Angle between the normals.
    pub radians: f64,
}

pub const LIMITS: Limits = Limits { margin: 1e-6, t: 1.5e-7, radians: 1e-6 };

pub const HALF: DVec3 = DVec3::new(1.0, 0.7, 0.4);

pub fn sphere(kind: BackendKind) -> Specimen {
    let set = plain([Sphere::new(DVec3::ZERO, 1.0).expect("a sphere")]);
    Specimen::new(kind, "sphere", Solid::Sphere, DAffine3::IDENTITY, AnyShapes::Spheres(set))
}

pub fn cube(kind: BackendKind, half: DVec3) -> Specimen {
    let set = plain([Cube::new(DVec3::ZERO, half).expect("a cube")]);
    Specimen::new(kind, "cube", Solid::Cube(half.into()), DAffine3::IDENTITY, AnyShapes::Cubes(set))
}

pub fn cylinder(kind: BackendKind, capped: bool, to_world: DAffine3) -> Specimen {
    let set = placed(Cylinder::new(1.0, 1.6, capped).expect("a cylinder"), to_world);
    let solid = Solid::Cylinder { half: 0.8, capped };
    Specimen::new(kind, if capped { "can" } else { "tube" }, solid, to_world, AnyShapes::Cylinders(set))
}

/// Every shape as `to_world` places it.
pub fn all_under(kind: BackendKind, to_world: DAffine3) -> Vec<Specimen> {
    let ball = placed(Sphere::new(DVec3::ZERO, 1.0).expect("a sphere"), to_world);
    let cube = placed(Cube::new(DVec3::ZERO, HALF).expect("a cube"), to_world);
    let quad = placed(Quad::new(DVec2::new(1.0, 0.7)).expect("a quad"), to_world);
    vec![
        Specimen::new(kind, "sphere", Solid::Sphere, to_world, AnyShapes::PlacedSpheres(ball)),
        Specimen::new(kind, "cube", Solid::Cube(HALF.into()), to_world, AnyShapes::PlacedCubes(cube)),
        cylinder(kind, false, to_world),
        cylinder(kind, true, to_world),
        Specimen::new(kind, "quad", Solid::Quad([1.0, 0.7]), to_world, AnyShapes::Quads(quad)),
    ]
}

/// Every shape in its own space.
pub fn all_plain(kind: BackendKind) -> Vec<Specimen> {
    let mut all = all_under(kind, DAffine3::IDENTITY);
    all.extend([sphere(kind), cube(kind, HALF)]);
    all
}

/// The transforms every shape must stand.
pub fn transforms() -> Vec<(&'static str, DAffine3)> {
    let turn = DMat3::from_quat(DQuat::from_rotation_z(0.7) * DQuat::from_rotation_x(-1.1));
    let shear = DMat3::from_cols(DVec3::X, DVec3::new(1.5, 1.0, 0.3), DVec3::new(-0.4, 2.0, 1.0));
    let near = DVec3::new(0.3, -2.0, 1.0);
    let at = DAffine3::from_mat3_translation;
    vec![
        ("mirrored", at(turn * DMat3::from_diagonal(DVec3::new(-1.0, 1.0, 1.0)), near)),
        ("stretched 1000:1", at(turn * DMat3::from_diagonal(DVec3::new(1000.0, 1.0, 1.0)), near)),
        ("flattened 1000:1", at(turn * DMat3::from_diagonal(DVec3::new(1.0, 1.0, 1e-3)), near)),
        ("sheared", at(shear, near)),
        ("moved by 1e5", at(turn, DVec3::new(1e5, -1e5, 5e4))),
    ]
}

pub fn ray(o: [f64; 3], d: [f64; 3]) -> Ray {
    // As it is: `Ray::new` would take the sign off a small zero.
    Ray { o: DVec3::from(o).as_vec3(), d: DVec3::from(d).as_vec3(), t_near: 0.0, t_far: f32::INFINITY }
}

/// Root of the mean of the squared differences of all channels.
pub fn rmse(a: &[[f32; 3]], b: &[[f32; 3]]) -> f64 {
    assert_eq!(a.len(), b.len());
    let squares = a.iter().zip(b).map(|(a, b)| (Vec3::from(*a) - Vec3::from(*b)).as_dvec3().length_squared());
    (squares.sum::<f64>() / (3 * a.len()) as f64).sqrt()
}
