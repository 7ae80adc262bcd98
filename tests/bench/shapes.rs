//! Time of one ray-shape test in ns: one ray at a time and 16 lanes wide, against the textbook
//! f32 sphere.
//!
//!     cargo bench --bench shapes [--no-default-features]
//!
//! Every ray meets every one of 64 shapes. `near` rays go towards a shape's surroundings (about
//! half of them hit), `far` rays mostly pass by, as most tests of a traversal do not.
//!
//! Then what it saves to invert each shape's transform once, when it is added, instead of at each
//! test of a ray (or of 16) with it, as a 3x3 or as a general 4x4 matrix.
use glam::{DAffine3, DMat3, DMat4, DVec3, Vec3};
use std::hint::black_box;
use std::time::Instant;
use tison::geom::{Affine, Cube, Cylinder, LANES, Lanes, Plain, Quad, Ray, RayPacket, Shape, ShapeSet, Sphere};
use tison::math::Random;
use tison::simd::{self, Kernel};

const SHAPES: u32 = 64;
const PACKETS: usize = 64;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut random = Random(7);
    let rays: [(&str, Vec<RayPacket>); 2] = [("near", packets(&mut random, 0.8)), ("far", packets(&mut random, 6.0))];
    let centers: Vec<DVec3> = (0..SHAPES).map(|_| 0.05 * random.point()).collect();
    let sphere = |c: DVec3| Sphere::new(c, 1.0);
    let textbook: Vec<(Vec3, f32)> = centers.iter().map(|c| (c.as_vec3(), 1.0)).collect();

    println!("{:24} {:>14} {:>14} {:>14} {:>14}   ns per test", "", "scalar near", "scalar far", "16 near", "16 far");
    let f32_near = per_test(|| textbook_f32(&textbook, &rays[0].1));
    let f32_far = per_test(|| textbook_f32(&textbook, &rays[1].1));
    println!("{:24} {f32_near:14.2} {f32_far:14.2}", "textbook f32 sphere");

    row("sphere", &plain(&centers, sphere)?, &rays);
    row("cube", &plain(&centers, |c| Cube::new(c, DVec3::ONE))?, &rays);
    row("affine sphere", &affine(&centers, Sphere::new(DVec3::ZERO, 1.0)?)?, &rays);
    row("affine cube", &affine(&centers, Cube::new(DVec3::ZERO, DVec3::ONE)?)?, &rays);
    row("affine cylinder, open", &affine(&centers, Cylinder::new(1.0, 2.0, false)?)?, &rays);
    row("affine cylinder, capped", &affine(&centers, Cylinder::new(1.0, 2.0, true)?)?, &rays);
    row("affine quad", &affine(&centers, Quad::new(glam::DVec2::ONE)?)?, &rays);

    println!(
        "\n{:24} {:>26} {:>26}   near rays, times the cost when inverted",
        "precomputed transforms", "scalar, ns", "16, ns"
    );
    precomputed("sphere", &centers, Sphere::new(DVec3::ZERO, 1.0)?, &rays[0].1)?;
    precomputed("cube", &centers, Cube::new(DVec3::ZERO, DVec3::ONE)?, &rays[0].1)?;
    precomputed("cylinder, open", &centers, Cylinder::new(1.0, 2.0, false)?, &rays[0].1)?;
    Ok(())
}

fn plain<S: Shape, E>(centers: &[DVec3], make: impl Fn(DVec3) -> Result<S, E>) -> Result<Plain<S>, E> {
    let mut set = Plain::default();
    for &c in centers {
        set.push(make(c)?);
    }
    Ok(set)
}

fn affine<S: Shape>(centers: &[DVec3], shape: S) -> Result<Affine<S>, tison::geom::ShapeError> {
    let mut set = Affine::default();
    for to_world in placements(centers) {
        set.push(shape, to_world)?;
    }
    Ok(set)
}

fn placements(centers: &[DVec3]) -> impl Iterator<Item = DAffine3> {
    centers.iter().enumerate().map(|(i, &c)| {
        let turn = DMat3::from_rotation_z(i as f64) * DMat3::from_rotation_x(0.3 * i as f64);
        DAffine3::from_mat3_translation(turn, c)
    })
}

fn row<S: ShapeSet>(name: &str, set: &S, rays: &[(&str, Vec<RayPacket>); 2]) {
    let scalar = rays.each_ref().map(|(_, r)| per_test(|| one_by_one(set, r)));
    let lanes = rays.each_ref().map(|(_, r)| per_test(|| sixteen(set, r)));
    for (_, r) in rays {
        assert_eq!(one_by_one(set, r), sixteen(set, r), "both count the same hits");
    }
    println!("{name:24} {:14.2} {:14.2} {:14.2} {:14.2}", scalar[0], scalar[1], lanes[0], lanes[1]);
}

fn one_by_one<S: ShapeSet>(set: &S, packets: &[RayPacket]) -> u32 {
    let mut hits = 0;
    for packet in packets {
        for lane in 0..LANES {
            let r = packet.get(lane);
            let (o, d) = (r.o.as_dvec3(), r.d.as_dvec3());
            for prim in 0..SHAPES {
                let t = set.hit(black_box(prim), o, d, f64::from(r.t_near), f64::from(r.t_far));
                hits += u32::from(t.is_some());
            }
        }
    }
    hits
}

fn sixteen<S: ShapeSet>(set: &S, packets: &[RayPacket]) -> u32 {
    let mut hits = 0;
    for packet in packets {
        for prim in 0..SHAPES {
            if let Some(t) = set.hit_lanes(black_box(prim), &packet.into()) {
                hits += t.iter().map(|&t| u32::from(t < f64::INFINITY)).sum::<u32>();
            }
        }
    }
    hits
}

/// One line: the inverse kept, and how many times as long a test takes that inverts 3x3 or 4x4.
fn precomputed<S: Shape>(
    name: &str,
    centers: &[DVec3],
    shape: S,
    packets: &[RayPacket],
) -> Result<(), tison::geom::ShapeError> {
    let kept = affine(centers, shape)?;
    let to_world: Vec<_> = placements(centers).collect();
    let three = |m: &DAffine3| m.matrix3.inverse();
    let four = |m: &DAffine3| DMat3::from_mat4(DMat4::from(*m).inverse());
    assert_eq!(one_by_one(&kept, packets), one_by_one_inverting(&shape, &to_world, packets, three), "the same hits");
    assert_eq!(sixteen(&kept, packets), sixteen_inverting(&shape, &to_world, packets, four), "the same hits");
    let scalar = [
        per_test(|| one_by_one(&kept, packets)),
        per_test(|| one_by_one_inverting(&shape, &to_world, packets, three)),
        per_test(|| one_by_one_inverting(&shape, &to_world, packets, four)),
    ];
    let lanes = [
        per_test(|| sixteen(&kept, packets)),
        per_test(|| sixteen_inverting(&shape, &to_world, packets, three)),
        per_test(|| sixteen_inverting(&shape, &to_world, packets, four)),
    ];
    let text = |[kept, three, four]: [f64; 3]| format!("{kept:.2}, 3x3 {:.2}x, 4x4 {:.2}x", three / kept, four / kept);
    println!("{name:24} {:>26} {:>26}", text(scalar), text(lanes));
    Ok(())
}

fn one_by_one_inverting<S: Shape>(
    shape: &S,
    to_world: &[DAffine3],
    packets: &[RayPacket],
    invert: impl Fn(&DAffine3) -> DMat3,
) -> u32 {
    let mut hits = 0;
    for packet in packets {
        for lane in 0..LANES {
            let r = packet.get(lane);
            let (o, d) = (r.o.as_dvec3(), r.d.as_dvec3());
            for prim in 0..SHAPES {
                let m = &to_world[black_box(prim) as usize];
                let inverse = invert(m);
                let (o, d) = (inverse * (o - m.translation), inverse * d);
                hits += u32::from(shape.hit(o, d, f64::from(r.t_near), f64::from(r.t_far)).is_some());
            }
        }
    }
    hits
}

fn sixteen_inverting<S: Shape>(
    shape: &S,
    to_world: &[DAffine3],
    packets: &[RayPacket],
    invert: impl Fn(&DAffine3) -> DMat3,
) -> u32 {
    let mut hits = 0;
    for packet in packets {
        for prim in 0..SHAPES {
            let to_world = &to_world[black_box(prim) as usize];
            if let Some(t) = simd::run(Inverting { shape, to_world, invert: &invert, packet }) {
                hits += t.iter().map(|&t| u32::from(t < f64::INFINITY)).sum::<u32>();
            }
        }
    }
    hits
}

struct Inverting<'a, S, F> {
    shape: &'a S,
    to_world: &'a DAffine3,
    invert: &'a F,
    packet: &'a RayPacket,
}

impl<S: Shape, F: Fn(&DAffine3) -> DMat3> Kernel for Inverting<'_, S, F> {
    type Output = Option<[f64; LANES]>;

    #[inline(always)]
    fn run(self) -> Self::Output {
        let inverse = (self.invert)(self.to_world);
        let p = self.packet;
        let (mut o, mut d) = ([[0.0; LANES]; 3], [[0.0; LANES]; 3]);
        let (mut t_near, mut t_far) = ([0.0; LANES], [0.0; LANES]);
        for i in 0..LANES {
            let (o_i, d_i) = (Vec3::new(p.o_x[i], p.o_y[i], p.o_z[i]), Vec3::new(p.d_x[i], p.d_y[i], p.d_z[i]));
            (o[0][i], o[1][i], o[2][i]) = (inverse * (o_i.as_dvec3() - self.to_world.translation)).into();
            (d[0][i], d[1][i], d[2][i]) = (inverse * d_i.as_dvec3()).into();
            (t_near[i], t_far[i]) = (f64::from(p.t_near[i]), f64::from(p.t_far[i]));
        }
        self.shape.hit_lanes(&Lanes { o: o.each_ref(), d: d.each_ref(), t_near: &t_near, t_far: &t_far })
    }
}

/// The quadratic formula as most books have it, in f32.
fn textbook_f32(spheres: &[(Vec3, f32)], packets: &[RayPacket]) -> u32 {
    let hit = |r: &Ray, c: Vec3, radius: f32| {
        let f = r.o - c;
        let (a, b, c) = (r.d.dot(r.d), 2.0 * f.dot(r.d), f.dot(f) - radius * radius);
        let disc = b * b - 4.0 * a * c;
        if disc < 0.0 {
            return None;
        }
        let root = disc.sqrt();
        let (near, far) = ((-b - root) / (2.0 * a), (-b + root) / (2.0 * a));
        let t = if near > r.t_near { near } else { far };
        (t > r.t_near && t < r.t_far).then_some(t)
    };
    let mut hits = 0;
    for packet in packets {
        for lane in 0..LANES {
            let r = packet.get(lane);
            for prim in 0..SHAPES {
                let (c, radius) = spheres[black_box(prim) as usize];
                hits += u32::from(hit(&r, c, radius).is_some());
            }
        }
    }
    hits
}

/// Best of several runs.
fn per_test(mut f: impl FnMut() -> u32) -> f64 {
    let tests = (PACKETS * LANES * SHAPES as usize) as f64;
    let mut best = f64::INFINITY;
    for _ in 0..60 {
        let start = Instant::now();
        black_box(f());
        best = best.min(start.elapsed().as_secs_f64() * 1e9 / tests);
    }
    best
}

/// Packets of 4 x 4 neighbours that pass the origin at a distance up to about `spread`.
fn packets(random: &mut Random, spread: f64) -> Vec<RayPacket> {
    let mut packets = vec![RayPacket::EMPTY; PACKETS];
    for packet in &mut packets {
        let o = 6.0 * random.point().normalize();
        let target = spread * random.point();
        for lane in 0..LANES {
            let pixel = DVec3::new((lane % 4) as f64, (lane / 4) as f64, 0.0);
            let d = target + 0.02 * pixel - o;
            packet.set(lane, &Ray::new(o.as_vec3(), d.as_vec3()));
        }
    }
    packets
}
