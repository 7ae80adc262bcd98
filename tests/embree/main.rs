//! The wrapper of Embree, from outside: life and death of its handles, rays of every width and length, and shapes
//! written in Rust. Clean under valgrind, which sees what Rust cannot: what the C library reads and writes.
#![cfg(feature = "embree")]

mod backend;
mod instances;
mod lifecycle;
mod rays;
mod shapes;
mod user;

use glam::Vec3;
use std::sync::Arc;
use tison::embree::{Device, DeviceConfig, PrimSet, Scene, SceneBuilder, SceneOptions};
use tison::geom::{Bounds, Lanes, Ray, TriangleMesh};
use tison::math::Random;

fn device() -> Device {
    Device::new(&DeviceConfig { threads: 2, ..Default::default() }).unwrap()
}

fn build(device: &Device, mesh: TriangleMesh, options: SceneOptions) -> Scene {
    let mut builder = SceneBuilder::new(device, options).unwrap();
    builder.mesh(Arc::new(mesh)).unwrap();
    builder.commit(None).unwrap()
}

/// `n x n` squares of two triangles each in the plane z = 0, from the origin to (n, n).
fn grid(n: u32) -> TriangleMesh {
    let points = (0..=n).flat_map(|y| (0..=n).flat_map(move |x| [x as f32, y as f32, 0.0])).collect();
    let w = n + 1;
    let square = |i: u32| {
        let a = i / n * w + i % n;
        [[a, a + 1, a + w], [a + 1, a + w + 1, a + w]]
    };
    TriangleMesh::new(points, (0..n * n).flat_map(square).collect())
}

/// A closed bumpy sphere of radius about 1 with `4 n (n - 1)` triangles.
fn blob(n: u32) -> TriangleMesh {
    use std::f32::consts::PI;
    let around = 2 * n;
    let mut points = Vec::new();
    for i in 0..=n {
        for j in 0..around {
            let (theta, phi) = (PI * i as f32 / n as f32, PI * j as f32 / n as f32);
            let r = 1.0 + 0.1 * (5.0 * theta).sin() * (4.0 * phi).cos();
            points.extend([r * theta.sin() * phi.cos(), r * theta.sin() * phi.sin(), r * theta.cos()]);
        }
    }
    let at = |i: u32, j: u32| i * around + j % around;
    let faces = (0..n).flat_map(|i| (0..around).map(move |j| (i, j))).flat_map(|(i, j)| {
        let lower = (i + 1 < n).then(|| [at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
        let upper = (i > 0).then(|| [at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
        lower.into_iter().chain(upper)
    });
    TriangleMesh::new(points, faces.collect())
}

/// Numbers in [0, 1) that are the same on every run.
struct Numbers(Random);

impl Numbers {
    fn new(seed: u64) -> Self {
        Self(Random(seed))
    }

    fn next(&mut self) -> f32 {
        self.0.unit() as f32
    }

    /// Inside the cube from -1 to 1.
    fn point(&mut self) -> Vec3 {
        2.0 * Vec3::new(self.next(), self.next(), self.next()) - 1.0
    }

    /// From about five units away towards the middle; some of them pass the unit sphere by.
    fn ray(&mut self) -> Ray {
        let o = 5.0 * (self.point() + 0.01).normalize();
        Ray::new(o, (1.3 * self.point() - o) * (0.1 + self.next()))
    }
}

fn rays(n: usize) -> Vec<Ray> {
    let mut numbers = Numbers::new(7);
    (0..n).map(|_| numbers.ray()).collect()
}

/// A set that is written for one ray at a time.
trait OneByOne: Send + Sync + 'static {
    fn len(&self) -> u32;
    fn bounds(&self, prim: u32) -> Bounds;
    /// Parameter of the nearest hit in the open interval.
    fn hit(&self, prim: u32, ray: &Ray) -> Option<f64>;
}

/// Any of them, for Embree.
struct Set<S>(S);

impl<S: OneByOne> PrimSet for Set<S> {
    fn len(&self) -> u32 {
        self.0.len()
    }
    fn bounds(&self, prim: u32) -> Bounds {
        self.0.bounds(prim)
    }
    fn hit_lanes<const N: usize>(&self, prim: u32, rays: &Lanes<'_, f32, N>) -> Option<[f64; N]> {
        Some(std::array::from_fn(|i| {
            let [o, d] = [rays.o, rays.d].map(|axes| Vec3::from(axes.map(|axis| axis[i])));
            let ray = Ray { o, d, t_near: rays.t_near[i], t_far: rays.t_far[i] };
            self.0.hit(prim, &ray).unwrap_or(f64::INFINITY)
        }))
    }
}

/// What a panic said.
fn message(payload: &(dyn std::any::Any + Send)) -> &str {
    payload.downcast_ref::<&str>().copied().or_else(|| payload.downcast_ref::<String>().map(|s| &s[..])).unwrap()
}

/// The message of the panic that `f` ends in.
fn panic_of(f: impl FnOnce()) -> String {
    let payload = std::panic::catch_unwind(std::panic::AssertUnwindSafe(f)).expect_err("should have panicked");
    message(&*payload).to_owned()
}
