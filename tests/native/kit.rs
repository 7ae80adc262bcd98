//! Things to trace, rays to trace, and the loop over everything that says what is right.

use glam::{DAffine3, DMat3, DVec2, DVec3, Vec3};
use std::collections::HashMap;
use std::f32::consts::TAU;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use tison::backend::Backend;
use tison::backend::native::{BuildOptions, Native, Quality};
use tison::geom::triangle::{self, ShearedRay};
use tison::geom::{
    Affine, BAD_FACE, Coherence, Cube, Cylinder, Hit, PacketBatch, Plain, Quad, Ray, RayHitPacket, RayPacket, ShapeSet,
    Sphere, TriangleMesh, invert,
};
use tison::scene::{AnyShapes, Instance, Mesh, MeshData, MeshPaint, Object, Shapes};
use tison::with_shapes;

pub static NEVER: AtomicBool = AtomicBool::new(false);

pub fn built(meshes: &[Arc<TriangleMesh>], quality: Quality) -> Native {
    Native::build(&objects(meshes), &BuildOptions { quality, cancel: &NEVER, memory_limit: None })
        .expect("never cancelled")
}

pub fn build(objects: &[Object]) -> Native {
    Native::build(objects, &BuildOptions { quality: Quality::Good, cancel: &NEVER, memory_limit: None })
        .expect("never cancelled")
}

pub fn objects(meshes: &[Arc<TriangleMesh>]) -> Vec<Object> {
    meshes.iter().map(|m| Object::Mesh(bare(m))).collect()
}

pub fn bare(triangles: &Arc<TriangleMesh>) -> Mesh {
    let triangles = Arc::clone(triangles);
    let data = Arc::new(MeshData { triangles, normals: None, uvs: None, face_materials: None });
    Mesh { data, paint: MeshPaint::One(0), mirrored: false }
}

pub fn placed(mesh: &Mesh, to_scene: DAffine3) -> Object {
    Object::Instance(Instance::new(mesh.clone(), to_scene))
}

pub fn shapes(set: AnyShapes) -> Object {
    let materials = vec![0; set.len() as usize];
    Object::Shapes(Shapes { set, materials })
}

pub fn mesh(points: &[Vec3], faces: Vec<[u32; 3]>) -> Arc<TriangleMesh> {
    Arc::new(TriangleMesh::new(points.iter().flat_map(|p| p.to_array()).collect(), faces))
}

/// Three points per triangle, nothing shared.
pub fn soup(triangles: &[[Vec3; 3]]) -> Arc<TriangleMesh> {
    let faces = (0..triangles.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    mesh(triangles.as_flattened(), faces)
}

pub fn key(hit: Option<Hit>) -> Option<(f32, u32, u32)> {
    hit.map(|h| (h.t, h.geom_id, h.prim_id))
}

/// A closed sphere-like mesh: an octahedron with every edge cut in `n`, 8 n^2 triangles.
pub fn ball(n: i64, radius: impl Fn(Vec3) -> f32) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let (mut points, mut faces, mut known) = (Vec::new(), Vec::new(), HashMap::new());
    let mut vertex = |p: [i64; 3]| {
        *known.entry(p).or_insert_with(|| {
            let d = Vec3::from(p.map(|x| x as f32)).normalize();
            points.push(d * radius(d));
            points.len() as u32 - 1
        })
    };
    for [x, y, z] in (0..8).map(|s| [0, 1, 2].map(|axis| 1 - 2 * (s >> axis & 1))) {
        let mut at = |i: i64, j: i64| vertex([x * i, y * j, z * (n - i - j)]);
        for (i, j) in (0..n).flat_map(|i| (0..n - i).map(move |j| (i, j))) {
            faces.push([at(i, j), at(i + 1, j), at(i, j + 1)]);
            if i + j + 1 < n {
                faces.push([at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]);
            }
        }
    }
    (points, faces)
}

pub fn round(_: Vec3) -> f32 {
    1.0
}

pub fn bumpy(d: Vec3) -> f32 {
    1.0 + 0.05 * (9.0 * d.x).sin() * (11.0 * d.y + 1.0).cos() + 0.03 * (23.0 * d.z).sin()
}

/// Numbers that look random, the same on every run.
pub struct Numbers(pub u64);

impl Numbers {
    pub fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 40) as f32 / (1 << 24) as f32
    }

    pub fn point(&mut self) -> Vec3 {
        Vec3::new(self.next(), self.next(), self.next()) * 2.0 - 1.0
    }

    pub fn direction(&mut self) -> Vec3 {
        let (z, a) = (2.0 * self.next() - 1.0, TAU * self.next());
        let r = (1.0 - z * z).sqrt();
        Vec3::new(r * a.cos(), r * a.sin(), z)
    }
}

/// Batches of all sorts: coherent and not, from one point and to one point, in all eight
/// octants, with intervals that end before, at and behind the mesh.
pub fn batches(numbers: &mut Numbers, points: &[Vec3]) -> Vec<Vec<Ray>> {
    let mut batches = Vec::new();
    for octant in (0..8).map(|s| Vec3::from([0, 1, 2].map(|axis| 1.0 - 2.0 * (s >> axis & 1) as f32))) {
        let (eye, to) = (octant * Vec3::new(2.0, 3.0, 4.0), |p: Vec3| Vec3::new(p.y, p.z, p.x));
        let pixel = |i: i32| Vec3::new((i % 32) as f32, (i / 32) as f32, 0.0) / 16.0 - 1.0;
        batches.push((0..1024).map(|i| Ray::new(eye, octant * pixel(i) - eye)).collect());
        batches.push(
            (0..1024).map(|i| Ray::segment(eye, to(octant * pixel(i)) - eye, 0.3 + 0.1 * (i % 9) as f32)).collect(),
        );
        // From the surface to a light: origins differ, and some lie far apart.
        batches.push(points.iter().take(1003).map(|&p| Ray::segment(p * 1.001, eye - p, 1.0)).collect());
        batches.push((0..512).map(|i| Ray::new(eye + 0.5 * pixel(i), -eye)).collect());
        // With lanes that ask nothing.
        let end = |i: i32| if i % 5 == 1 { f32::NEG_INFINITY } else { 8.0 };
        batches.push((0..519).map(|i| Ray::segment(eye, octant * pixel(i) - eye, end(i))).collect());
    }
    let mut scattered = || Ray::segment(numbers.point() * 2.0, numbers.direction(), 4.0 * numbers.next());
    batches.push((0..1003).map(|_| scattered()).collect());
    // Some that are none, among coherent ones.
    let broken = |i: i32| if i % 37 == 5 { Vec3::ZERO } else { Vec3::new(1.0, 0.1, 0.01 * i as f32) };
    batches.push((0..128).map(|i| Ray { d: broken(i), ..Ray::new(Vec3::ZERO, Vec3::X) }).collect());
    batches.push((0..128).map(|i| Ray::new(Vec3::ZERO, Vec3::new(1.0, 0.0, 0.01 * i as f32))).collect());
    batches
}

// ---- what is right ----

/// What a loop over everything finds: the least `t` in f64, among equal ones the lowest ids.
pub fn loop_over(objects: &[Object], ray: &Ray) -> Option<(f32, u32, u32)> {
    let mut best: Option<(f64, u32, u32)> = None;
    let whole = |o: DVec3, d: DVec3| ShearedRay::new(o, d, f64::NEG_INFINITY, f64::INFINITY);
    let (o, d) = (ray.o.as_dvec3(), ray.d.as_dvec3());
    if d == DVec3::ZERO {
        return None;
    }
    for (geom, object) in (0..).zip(objects) {
        let mut offer = |prim: u32, t: Option<f64>| {
            if let Some(t) = t.filter(|&t| is_inside(ray, t)) {
                best = Some(best.map_or((t, geom, prim), |b| if (t, geom, prim) < b { (t, geom, prim) } else { b }));
            }
        };
        let mut mesh = |mesh: &Mesh, line: &ShearedRay| {
            let mesh = &mesh.data.triangles;
            for (prim, face) in (0..).zip(mesh.faces()).filter(|(_, f)| **f != BAD_FACE) {
                offer(prim, triangle::intersect(line, face.map(|i| mesh.point(i))).map(|h| h.t));
            }
        };
        match object {
            Object::Mesh(m) => mesh(m, &whole(o, d)),
            Object::Instance(i) => {
                let inverse = invert(&i.to_scene).expect("placements can be undone");
                mesh(&i.mesh, &whole(inverse * (o - i.to_scene.translation), inverse * d));
            }
            Object::Shapes(s) => with_shapes!(&s.set, set => {
                for prim in 0..set.len() {
                    let mut t = set.hit(prim, o, d, f64::from(ray.t_near), f64::INFINITY);
                    while t.is_some_and(|t| t as f32 <= ray.t_near) {
                        t = set.hit(prim, o, d, t.expect("just seen"), f64::INFINITY);
                    }
                    offer(prim, t);
                }
            }),
        }
    }
    best.map(|(t, geom, prim)| (t as f32, geom, prim))
}

/// Whether `t` is inside the ray's open interval as f32 has it.
fn is_inside(ray: &Ray, t: f64) -> bool {
    t as f32 > ray.t_near && (t as f32) < ray.t_far
}

/// Asks one by one and in batches, coherent and not: all must agree with `want`.
pub fn check(native: &Native, rays: &[Ray], want: &[Option<(f32, u32, u32)>]) {
    for (i, (ray, want)) in rays.iter().zip(want).enumerate() {
        assert_eq!(key(native.intersect(ray)), *want, "ray {i}: {ray:?}");
        assert_eq!(native.occluded(ray), want.is_some(), "ray {i}: {ray:?}");
    }
    check_batches(native, rays);
}

/// Batches must answer as single rays do.
pub fn check_batches(native: &Native, rays: &[Ray]) {
    for coherence in [Coherence::Coherent, Coherence::Incoherent] {
        let (mut nearest, mut any) = (PacketBatch::<RayHitPacket>::default(), PacketBatch::<RayPacket>::default());
        for ray in rays {
            nearest.push(ray);
            any.push(ray);
        }
        native.intersect_many(&mut nearest, coherence);
        native.occluded_many(&mut any, coherence);
        for (i, ray) in rays.iter().enumerate() {
            let want = native.intersect(ray);
            assert_eq!(nearest.packets()[i / 16].hit(i % 16), want, "ray {i}, {coherence:?}: {ray:?}");
            let occluded = any.packets()[i / 16].is_occluded(i % 16) && ray.t_far > f32::NEG_INFINITY;
            assert_eq!(occluded, want.is_some(), "ray {i}, {coherence:?}: {ray:?}");
        }
    }
}

/// 32 x 32 rays from `eye` through a square around `target`, each packet a square of them.
pub fn view(eye: Vec3, target: Vec3, half: f32) -> Vec<Ray> {
    let z = target - eye;
    let x = z.any_orthonormal_vector();
    let y = x.cross(z).normalize();
    let spread = |i: usize| (i % 4 + i / 16 % 8 * 4, i / 4 % 4 + i / 128 * 4);
    let at = |i: usize| half * (i as f32 / 15.6 - 1.0);
    (0..1024).map(spread).map(|(i, j)| Ray::new(eye, z + at(i) * x + at(j) * y)).collect()
}

// ---- sets of shapes ----

/// Positions and sizes of shapes, all of about the same size.
pub fn placements(numbers: &mut Numbers, n: usize, size: f32) -> Vec<DAffine3> {
    let mut placement = || {
        let turn = DMat3::from_rotation_z(6.0 * f64::from(numbers.next())) * DMat3::from_rotation_x(3.0);
        let stretch = DVec3::from_array(std::array::from_fn(|_| f64::from(size * (0.5 + numbers.next()))));
        DAffine3::from_mat3_translation(turn * DMat3::from_diagonal(stretch), numbers.point().as_dvec3())
    };
    (0..n).map(|_| placement()).collect()
}

/// One set of each class, of shapes that are placed so.
pub fn every_class(placements: &[DAffine3]) -> [AnyShapes; 7] {
    fn plain<S: tison::geom::Shape>(of: &[DAffine3], make: impl Fn(&DAffine3) -> S) -> Arc<Plain<S>> {
        let mut set = Plain::default();
        of.iter().for_each(|p| {
            set.push(make(p));
        });
        Arc::new(set)
    }
    fn affine<S: tison::geom::Shape>(of: &[DAffine3], shape: S) -> Arc<Affine<S>> {
        let mut set = Affine::default();
        of.iter().for_each(|&p| {
            set.push(shape, p).expect("can be undone");
        });
        Arc::new(set)
    }
    let size = |p: &DAffine3| p.matrix3.x_axis.length();
    let sphere = Sphere::new(DVec3::ZERO, 1.0).expect("a sphere");
    let cube = Cube::new(DVec3::ZERO, DVec3::new(1.0, 0.7, 0.4)).expect("a cube");
    let cylinder = |capped| Cylinder::new(0.6, 1.8, capped).expect("a cylinder");
    [
        AnyShapes::Spheres(plain(placements, |p| Sphere::new(p.translation, size(p)).expect("a sphere"))),
        AnyShapes::Cubes(plain(placements, |p| Cube::new(p.translation, DVec3::splat(size(p))).expect("a cube"))),
        AnyShapes::PlacedSpheres(affine(placements, sphere)),
        AnyShapes::PlacedCubes(affine(placements, cube)),
        AnyShapes::Cylinders(affine(placements, cylinder(false))),
        AnyShapes::Cylinders(affine(placements, cylinder(true))),
        AnyShapes::Quads(affine(placements, Quad::new(DVec2::new(1.0, 0.7)).expect("a quad"))),
    ]
}

/// Rays of all sorts at what lies around the origin within about 1.
pub fn rays(numbers: &mut Numbers) -> Vec<Ray> {
    let eye = 3.0 * numbers.direction();
    let mut rays = view(eye, 0.3 * numbers.point(), 0.3);
    // Shadow rays: towards one point, each with an end.
    rays.extend((0..256).map(|i| {
        let o = Vec3::new((i % 16) as f32, (i / 16) as f32, -16.0) / 8.0 - 1.0;
        Ray::segment(o, eye - o, 1.0)
    }));
    for _ in 0..256 {
        let (o, d) = (1.5 * numbers.point(), numbers.direction());
        rays.push(Ray::segment(o, d, 3.0 * numbers.next()));
        rays.push(Ray { t_near: numbers.next(), ..Ray::new(o, d) });
        let mut along = Vec3::ZERO;
        along[rays.len() % 3] = if numbers.next() < 0.5 { 1.0 } else { -1.0 };
        rays.push(Ray::new(o, along));
    }
    rays
}
