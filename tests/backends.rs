//! Embree and the native tracer answer the same rays alike, but for what rounding decides.
#![cfg(feature = "embree")]

use glam::{DAffine3, DMat3, DVec2, DVec3, Vec3};
use proptest::prelude::*;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use tison::backend::{AnyBackend, Backend, BackendKind, BuildOptions};
use tison::geom::{
    Affine, Coherence, Cube, Cylinder, Hit, PacketBatch, Plain, Quad, Ray, RayHitPacket, RayPacket, ShapeSet, Sphere,
    TriangleMesh,
};
use tison::scene::{AnyShapes, Instance, Mesh, Object, Scene, Shapes};
use tison::with_shapes;

/// What a scene is made of here: all that there is.
const KINDS: &[Kind] = &[
    Kind::Mesh,
    Kind::Placed,
    Kind::Spheres,
    Kind::Cubes,
    Kind::PlacedSpheres,
    Kind::PlacedCubes,
    Kind::Cylinders,
    Kind::Quads,
];

#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    Mesh,
    Placed,
    Spheres,
    Cubes,
    PlacedSpheres,
    PlacedCubes,
    Cylinders,
    Quads,
}

/// All coordinates are below this.
const SCALE: f32 = 8.0;

fn point(r: f64) -> impl Strategy<Value = DVec3> + Clone {
    [-r..r, -r..r, -r..r].prop_map(DVec3::from)
}

fn direction() -> impl Strategy<Value = Vec3> {
    point(1.0).prop_filter("too short to have a direction", |d| d.length() > 0.1).prop_map(DVec3::as_vec3)
}

/// Turned, stretched, often mirrored.
fn placement() -> impl Strategy<Value = DAffine3> + Clone {
    let stretch = [0.2..1.5f64, 0.2..1.5, -1.5..-0.2].prop_map(DVec3::from);
    (point(3.0), stretch, 0.0..6.0f64, 0.0..3.0f64).prop_map(|(at, stretch, a, b)| {
        let turn = DMat3::from_rotation_z(a) * DMat3::from_rotation_x(b);
        DAffine3::from_mat3_translation(turn * DMat3::from_diagonal(stretch), at)
    })
}

fn mesh(points: &[Vec3]) -> Mesh {
    let faces = (0..points.len() as u32 / 3).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    let triangles = Arc::new(TriangleMesh::new(points.iter().flat_map(|p| p.to_array()).collect(), faces));
    Mesh::bare(triangles)
}

fn plain<S: tison::geom::Shape>(of: &[DAffine3], make: impl Fn(DVec3, f64) -> S) -> Arc<Plain<S>> {
    let mut set = Plain::default();
    for p in of {
        set.push(make(p.translation, 0.7 * p.matrix3.x_axis.length()));
    }
    Arc::new(set)
}

fn affine<S: tison::geom::Shape>(of: &[DAffine3], make: impl Fn(usize) -> S) -> Arc<Affine<S>> {
    let mut set = Affine::default();
    for (i, &p) in of.iter().enumerate() {
        set.push(make(i), p).expect("can be undone");
    }
    Arc::new(set)
}

/// The objects of one kind, at up to some places.
fn objects(kind: Kind, at: &[DAffine3], own: &Mesh) -> Vec<Object> {
    let sphere = |c, r| Sphere::new(c, r).expect("a sphere");
    let cube = |c, r| Cube::new(c, DVec3::new(r, 0.5 * r, 0.8 * r)).expect("a cube");
    let cylinder = |i: usize| Cylinder::new(0.6, 1.8, i % 2 == 1).expect("a cylinder");
    let quad = |_| Quad::new(DVec2::new(1.0, 0.7)).expect("a quad");
    let set = match kind {
        Kind::Mesh => return vec![Object::Mesh(own.clone())],
        Kind::Placed => {
            return at.iter().map(|&p| Object::Instance(Instance::new(own.clone(), p))).collect();
        }
        Kind::Spheres => AnyShapes::Spheres(plain(at, sphere)),
        Kind::Cubes => AnyShapes::Cubes(plain(at, cube)),
        Kind::PlacedSpheres => AnyShapes::PlacedSpheres(affine(at, |_| sphere(DVec3::ZERO, 0.8))),
        Kind::PlacedCubes => AnyShapes::PlacedCubes(affine(at, |_| cube(DVec3::ZERO, 0.9))),
        Kind::Cylinders => AnyShapes::Cylinders(affine(at, cylinder)),
        Kind::Quads => AnyShapes::Quads(affine(at, quad)),
    };
    vec![Object::Shapes(Shapes::bare(set))]
}

fn scene() -> impl Strategy<Value = Scene> {
    let triangles = proptest::collection::vec([point(2.0), point(2.0), point(2.0)], 1..20);
    let part = (prop::sample::select(KINDS), proptest::collection::vec(placement(), 1..6), triangles);
    proptest::collection::vec(part, 1..6).prop_map(|parts| {
        let object = |(kind, at, triangles): (Kind, Vec<DAffine3>, Vec<[DVec3; 3]>)| {
            let corners: Vec<_> = triangles.as_flattened().iter().map(|p| p.as_vec3()).collect();
            objects(kind, &at, &mesh(&corners))
        };
        Scene::of(parts.into_iter().flat_map(object).collect())
    })
}

fn build(kind: BackendKind, scene: &Scene) -> AnyBackend {
    let cancel = AtomicBool::new(false);
    let options = BuildOptions { threads: 1, rays_expected: 1 << 40, ..BuildOptions::new(&cancel) };
    AnyBackend::build(kind, scene, &options).expect("a good scene")
}

fn both(scene: &Scene) -> (impl Backend, impl Backend) {
    let AnyBackend::Embree(embree) = build(BackendKind::Embree, scene) else { unreachable!("it was asked for") };
    let AnyBackend::Native(native) = build(BackendKind::Native, scene) else { unreachable!("it was asked for") };
    (embree, native)
}

type Ids = Option<(u32, u32)>;

fn ids(hit: Option<Hit>) -> Ids {
    hit.map(|h| (h.geom_id, h.prim_id))
}

/// What is hit, unless rays a little beside this one hit something else.
fn decided(native: &impl Backend, ray: &Ray) -> Option<Ids> {
    let what = ids(native.intersect(ray));
    let beside = 32.0 * f32::EPSILON * SCALE;
    let x = ray.d.normalize().any_orthonormal_vector();
    let y = ray.d.normalize().cross(x);
    let around = (0..8).map(|i| i as f32 * std::f32::consts::FRAC_PI_4).map(|a| beside * (a.cos() * x + a.sin() * y));
    let mut moved = around.map(|by| Ray { o: ray.o + by, ..*ray });
    moved.all(|moved| ids(native.intersect(&moved)) == what).then_some(what)
}

/// Cosine between the ray and the normal of what it hit.
fn cosine(scene: &Scene, ray: &Ray, hit: &Hit) -> f64 {
    let d = ray.d.as_dvec3().normalize();
    let ng = match &scene.objects[hit.geom_id as usize] {
        Object::Shapes(shapes) => with_shapes!(&shapes.set, set => {
            set.refine(hit.prim_id, ray.o.as_dvec3(), ray.d.as_dvec3(), f64::from(ray.t_near), f64::from(hit.t)).ng
        }),
        _ => hit.ng.as_dvec3().normalize(),
    };
    d.dot(ng)
}

/// The answers must have the same ids, and `t` within what f32 can do at this angle.
fn agree(scene: &Scene, ray: &Ray, want: Option<&Hit>, got: Option<&Hit>) -> Result<(), TestCaseError> {
    prop_assert_eq!(ids(got.copied()), ids(want.copied()), "{:?}", ray);
    let (Some(want), Some(got)) = (want, got) else { return Ok(()) };
    let cos = cosine(scene, ray, want);
    let tolerance = 64.0 * f32::EPSILON * SCALE / (cos.abs() as f32 * ray.d.length());
    prop_assert!((got.t - want.t).abs() <= tolerance, "t {} for {}; {:?}", got.t, want.t, ray);
    if !matches!(scene.objects[want.geom_id as usize], Object::Shapes(_)) {
        let off = (got.ng.normalize() - want.ng.normalize()).length();
        prop_assert!(off < 1e-4, "normal {} for {}", got.ng, want.ng);
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn the_same_is_hit(
        scene in scene(), rays in proptest::collection::vec((point(6.0), direction(), 0.1..30f32), 48)
    ) {
        let (embree, native) = both(&scene);
        let rays: Vec<_> = rays.into_iter().map(|(o, d, end)| Ray::segment(o.as_vec3(), d, end)).collect();
        let mut nearest = PacketBatch::<RayHitPacket>::default();
        let mut any = PacketBatch::<RayPacket>::default();
        for ray in &rays {
            nearest.push(ray);
            any.push(ray);
        }
        embree.intersect_many(&mut nearest, Coherence::Incoherent);
        embree.occluded_many(&mut any, Coherence::Incoherent);
        for (i, ray) in rays.iter().enumerate() {
            let want = native.intersect(ray);
            prop_assert_eq!(native.occluded(ray), want.is_some(), "{:?}", ray);
            // Below this angle an edge may be hit or not; `decided` sees the rest of what is close.
            if want.as_ref().is_some_and(|hit| cosine(&scene, ray, hit).abs() < 1e-2) || decided(&native, ray).is_none() {
                continue;
            }
            agree(&scene, ray, want.as_ref(), embree.intersect(ray).as_ref())?;
            agree(&scene, ray, want.as_ref(), nearest.packets()[i / 16].hit(i % 16).as_ref())?;
            prop_assert_eq!(embree.occluded(ray), want.is_some(), "{:?}", ray);
            prop_assert_eq!(any.packets()[i / 16].is_occluded(i % 16), want.is_some(), "{:?}", ray);
        }
    }

    #[test]
    fn coherent_packets_hit_the_same(scene in scene(), eye in point(6.0), target in point(2.0), spread in 0.001..1.0f32) {
        prop_assume!((target - eye).length() > 0.1);
        let (embree, native) = both(&scene);
        let z = (target - eye).as_vec3();
        let x = z.any_orthogonal_vector();
        let y = x.cross(z).normalize() * x.length();
        let ray = |i: usize| Ray::new(eye.as_vec3(), z + spread * ((i % 4) as f32 * x + (i / 4) as f32 * y));
        let mut nearest = PacketBatch::<RayHitPacket>::default();
        (0..64).for_each(|i| nearest.push(&ray(i)));
        let mut natives = nearest.clone();
        embree.intersect_many(&mut nearest, Coherence::Coherent);
        native.intersect_many(&mut natives, Coherence::Coherent);
        for i in 0..64 {
            let want = natives.packets()[i / 16].hit(i % 16);
            prop_assert_eq!(want, native.intersect(&ray(i)), "{:?}", ray(i));
            if want.as_ref().is_some_and(|hit| cosine(&scene, &ray(i), hit).abs() < 1e-2) || decided(&native, &ray(i)).is_none() {
                continue;
            }
            agree(&scene, &ray(i), want.as_ref(), nearest.packets()[i / 16].hit(i % 16).as_ref())?;
        }
    }
}
