//! What accuracy costs: our tests against textbook forms on the same rays, and what it takes to refine a hit.

use super::setup;
use super::textbook;
use crate::backend::{BackendKind, Error};
use crate::geom::triangle::{self, ShearedRay};
use crate::geom::{self, Coherence, LANES, Lanes, PacketBatch, Ray, RayHitPacket, RayPacket, Shape};
use crate::math::Random;
use crate::render::block::{Block, Hits};
use crate::render::facets::Facets;
use crate::render::paint::Palette;
use crate::scene::example::{self, Surface};
use crate::scene::{Mesh, Object, Scene};
use crate::simd::{self, Kernel};
use glam::{DVec2, DVec3, Vec3};
use std::hint::black_box;
use std::time::Instant;

/// One test, three ways, in nanoseconds each.
#[derive(Clone, Copy, Debug)]
pub struct TestCost {
    /// What is tested.
    pub shape: &'static str,
    /// As textbooks have it, in f32, one ray at a time.
    pub textbook: f64,
    /// Ours in f64, one ray at a time.
    pub ours: f64,
    /// Median of the rounds' ratios of the two.
    pub ratio: f64,
    /// Ours for sixteen rays at once, each; only shapes have that.
    pub lanes: Option<f64>,
}

/// Nanoseconds for each hit that is refined.
#[derive(Clone, Copy, Debug)]
pub struct RefineCost {
    /// What is refined, and how.
    pub what: &'static str,
    /// Median.
    pub ns: f64,
}

/// Rays that meet every shape.
const RAYS: usize = 1024;
/// Shapes that every ray meets.
const SHAPES: usize = 64;

/// All tests, medians of so many rounds.
#[must_use]
pub fn tests(rounds: usize) -> Vec<TestCost> {
    let mut random = Random(7);
    let rays = rays(&mut random);
    let packets: Vec<RayPacket> = rays.chunks_exact(LANES).map(packed).collect();
    let places: Vec<DVec3> = (0..SHAPES).map(|_| 0.05 * random.point()).collect();
    let narrow: Vec<Vec3> = places.iter().map(|p| p.as_vec3()).collect();
    let local = |ray: &Ray, i: usize| Ray { o: ray.o - narrow[i], ..*ray };
    let line = |ray: &Ray| (ray.o.as_dvec3(), ray.d.as_dvec3(), f64::from(ray.t_near), f64::from(ray.t_far));

    let spheres: Vec<_> = places.iter().map(|&p| geom::Sphere::new(p, 1.0).expect("a sphere")).collect();
    let cubes: Vec<_> = places.iter().map(|&p| geom::Cube::new(p, DVec3::ONE).expect("a cube")).collect();
    // Its own space has no place: the eye moves instead, in every form.
    let cylinder = geom::Cylinder::new(1.0, 2.0, false).expect("a cylinder");
    let corners: Vec<[Vec3; 3]> = (0..SHAPES).map(|_| [0, 1, 2].map(|_| (1.2 * random.point()).as_vec3())).collect();

    vec![
        pair(
            "sphere",
            rounds,
            || per_pair(&rays, |ray, i| textbook::sphere(1.0, &local(ray, i)).is_some()),
            || {
                per_pair(&rays, |ray, i| {
                    let (o, d, near, far) = line(ray);
                    spheres[i].hit(o, d, near, far).is_some()
                })
            },
            Some(&|| per_lane(&packets, &spheres)),
        ),
        pair(
            "cube",
            rounds,
            || per_pair(&rays, |ray, i| textbook::cube(Vec3::ONE, &local(ray, i)).is_some()),
            || {
                per_pair(&rays, |ray, i| {
                    let (o, d, near, far) = line(ray);
                    cubes[i].hit(o, d, near, far).is_some()
                })
            },
            Some(&|| per_lane(&packets, &cubes)),
        ),
        pair(
            "cylinder",
            rounds,
            || per_pair(&rays, |ray, i| textbook::cylinder(1.0, 1.0, &local(ray, i)).is_some()),
            || {
                per_pair(&rays, |ray, i| {
                    let (o, d, near, far) = line(ray);
                    cylinder.hit(o - places[i], d, near, far).is_some()
                })
            },
            Some(&|| per_lane(&packets, &[cylinder; SHAPES])),
        ),
        pair(
            "triangle",
            rounds,
            || per_pair(&rays, |ray, i| textbook::triangle(corners[i], ray).is_some()),
            || per_triangle(&rays, &corners),
            None,
        ),
    ]
}

/// Refining, medians of so many rounds.
///
/// # Errors
/// If the scene with the triangles cannot be built.
pub fn refining(rounds: usize) -> Result<Vec<RefineCost>, Error> {
    let mut random = Random(9);
    let rays = rays(&mut random);
    let mut all = triangles(rounds)?;
    let mut shape = |what, ns| all.push(RefineCost { what, ns });
    shape("sphere", refine_shape(rounds, &rays, &geom::Sphere::new(DVec3::ZERO, 1.0).expect("a sphere")));
    shape("cube", refine_shape(rounds, &rays, &geom::Cube::new(DVec3::ZERO, DVec3::ONE).expect("a cube")));
    shape("cylinder, open", refine_shape(rounds, &rays, &geom::Cylinder::new(1.0, 2.0, false).expect("a cylinder")));
    shape("cylinder, capped", refine_shape(rounds, &rays, &geom::Cylinder::new(1.0, 2.0, true).expect("a cylinder")));
    shape("quad", refine_shape(rounds, &rays, &geom::Quad::new(DVec2::ONE).expect("a quad")));
    Ok(all)
}

/// Four by four neighbours that pass the origin at up to about 0.8, about half of which hit what is there.
fn rays(random: &mut Random) -> Vec<Ray> {
    let mut rays = Vec::with_capacity(RAYS);
    for _ in 0..RAYS / LANES {
        let (o, target) = (6.0 * random.direction(), 0.8 * random.point());
        for lane in 0..LANES {
            let pixel = DVec3::new((lane % 4) as f64, (lane / 4) as f64, 0.0);
            rays.push(Ray::new(o.as_vec3(), (target + 0.02 * pixel - o).as_vec3()));
        }
    }
    rays
}

fn packed(rays: &[Ray]) -> RayPacket {
    let mut packet = RayPacket::EMPTY;
    rays.iter().enumerate().for_each(|(lane, ray)| packet.set(lane, ray));
    packet
}

/// The two in turn, and then the third.
fn pair(
    shape: &'static str,
    rounds: usize,
    textbook: impl Fn() -> u32,
    ours: impl Fn() -> u32,
    lanes: Option<&dyn Fn() -> u32>,
) -> TestCost {
    let count = RAYS * SHAPES;
    let times: Vec<(f64, f64)> = (0..rounds).map(|_| (ns(count, &textbook), ns(count, &ours))).collect();
    let of = |f: fn(&(f64, f64)) -> f64| median(times.iter().map(f).collect());
    TestCost {
        shape,
        textbook: of(|t| t.0),
        ours: of(|t| t.1),
        ratio: of(|t| t.1 / t.0),
        lanes: lanes.map(|lanes| median((0..rounds).map(|_| ns(count, lanes)).collect())),
    }
}

/// Nanoseconds of each of `count` things that `f` does.
fn ns(count: usize, f: impl Fn() -> u32) -> f64 {
    let start = Instant::now();
    black_box(f());
    start.elapsed().as_secs_f64() * 1e9 / count as f64
}

/// The one in the middle.
///
/// # Panics
/// If there is none.
#[must_use]
pub fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

#[inline(always)]
fn per_pair(rays: &[Ray], hit: impl Fn(&Ray, usize) -> bool) -> u32 {
    let mut hits = 0;
    for ray in rays {
        for i in 0..SHAPES {
            hits += u32::from(hit(ray, black_box(i)));
        }
    }
    hits
}

/// A ray is prepared once for all its triangles, as a traversal does.
fn per_triangle(rays: &[Ray], corners: &[[Vec3; 3]]) -> u32 {
    let mut hits = 0;
    for ray in rays {
        let sheared = ShearedRay::from(ray);
        for i in 0..SHAPES {
            hits += u32::from(triangle::intersect(&sheared, corners[black_box(i)]).is_some());
        }
    }
    hits
}

struct Sixteen<'a, S>(&'a S, Lanes<'a, f32, LANES>);

impl<S: Shape> Kernel for Sixteen<'_, S> {
    type Output = Option<[f64; LANES]>;

    #[inline(always)]
    fn run(self) -> Self::Output {
        self.0.hit_lanes(&self.1)
    }
}

fn per_lane<S: Shape>(packets: &[RayPacket], shapes: &[S]) -> u32 {
    let mut hits = 0;
    for packet in packets {
        for i in 0..SHAPES {
            if let Some(t) = simd::run(Sixteen(&shapes[black_box(i)], packet.into())) {
                hits += t.iter().filter(|&&t| t < f64::INFINITY).count() as u32;
            }
        }
    }
    hits
}

fn refine_shape<S: Shape>(rounds: usize, rays: &[Ray], shape: &S) -> f64 {
    let found: Vec<(DVec3, DVec3, f64)> = rays
        .iter()
        .filter_map(|r| {
            let (o, d) = (r.o.as_dvec3(), r.d.as_dvec3());
            Some((o, d, shape.hit(o, d, 0.0, f64::INFINITY)?))
        })
        .collect();
    let pass = || {
        for _ in 0..16 {
            for &(o, d, t) in &found {
                black_box(shape.refine_for(o, d, 0.0, black_box(t), false));
            }
        }
        0
    };
    median((0..rounds).map(|_| ns(16 * found.len().max(1), pass)).collect())
}

/// Triangles of a mesh as the renderer meets them, coherent: the bare formula, and what a block of sixteen takes
/// with everything that belongs to it.
fn triangles(rounds: usize) -> Result<Vec<RefineCost>, Error> {
    let scene = Scene::of(vec![Object::Mesh(Mesh::bare(example::mesh(20_480, Surface::Rock)))]);
    let backend = setup::build(BackendKind::Native, &scene)?;
    let mut batch = PacketBatch::<RayHitPacket>::default();
    for i in 0..16_384 {
        let (block, lane) = (i / 16, i % 16);
        let (x, y) = (block % 32 * 4 + lane % 4, block / 32 * 4 + lane / 4);
        let target = Vec3::new(x as f32 / 128.0 - 0.5, y as f32 / 128.0 - 0.5, 0.0);
        let eye = Vec3::new(0.3, 0.4, 4.0);
        batch.push(&Ray::new(eye, target - eye));
    }
    backend.as_dyn().intersect_many(&mut batch, Coherence::Coherent);
    let packets: Vec<&RayHitPacket> =
        batch.packets().iter().filter(|p| (0..LANES).all(|lane| p.hit(lane).is_some())).collect();
    let count = LANES * packets.len().max(1);
    let Object::Mesh(mesh) = &scene.objects[0] else { unreachable!("it is one") };
    let found = packets.iter().flat_map(|packet| {
        (0..LANES).map(|lane| {
            let corners = mesh.data.triangles.triangle(packet.hit.prim_id[lane]);
            (packet.ray.get(lane), corners, (packet.hit.u[lane], packet.hit.v[lane]))
        })
    });
    let found: Vec<_> = found.collect();
    let scalar = || {
        for (ray, corners, reported) in &found {
            black_box(triangle::refine(ray.o, ray.d, *corners, *reported));
        }
        0
    };
    let palette = Palette::of(&scene);
    let lanes = || {
        let (mut facets, mut block) = (Facets::new(&scene), Block::EMPTY);
        for packet in &packets {
            facets.set_all(packet);
            facets.finish(LANES, &scene, &palette, black_box(&mut block));
        }
        0
    };
    let times: Vec<(f64, f64)> = (0..rounds).map(|_| (ns(count, scalar), ns(count, lanes))).collect();
    Ok(vec![
        RefineCost { what: "triangle, one by one", ns: median(times.iter().map(|t| t.0).collect()) },
        RefineCost {
            what: "triangle, blocks of 16 with material, normals and origins",
            ns: median(times.iter().map(|t| t.1).collect()),
        },
    ])
}
