//! Wide answers are the single answers, bit for bit; NaN never hits.
use super::kit::*;
use glam::DVec3;
use tison::geom::{Affine, Lanes, RayPacket, Shape, ShapeSet};

/// Rays of all sorts: hits, misses, along axes, on planes, with short intervals, huge, tiny, broken.
fn odd_ray(random: &mut Random) -> Ray64 {
    const ODD: [f64; 14] = [
        0.0,
        -0.0,
        1.0,
        -1.0,
        0.7,
        0.8,
        -0.4,
        f64::NAN,
        f64::INFINITY,
        f64::NEG_INFINITY,
        f64::MIN_POSITIVE,
        5e-324,
        1e300,
        -1e20,
    ];
    let mut number = |scale: f64| {
        let pick = random.bits() as usize % 40;
        if pick < ODD.len() { ODD[pick] } else { scale * (2.0 * random.unit() - 1.0) }
    };
    let o = DVec3::new(number(2.0), number(2.0), number(2.0));
    let d = DVec3::new(number(1.0), number(1.0), number(1.0));
    let t_near = if number(1.0) > 0.6 { number(1.0) } else { 0.0 };
    let t_far = if number(1.0) > 0.3 { number(5.0) } else { f64::INFINITY };
    Ray64 { o, d, t_near, t_far }
}

fn same_bits<S: Shape, const N: usize>(shape: &S, random: &mut Random) {
    for _ in 0..3000 {
        let rays: [Ray64; N] = std::array::from_fn(|_| odd_ray(random));
        let wide = lanes_at_all_levels(shape, &rays);
        for (r, bits) in rays.iter().zip(wide) {
            let single = shape.hit(r.o, r.d, r.t_near, r.t_far).unwrap_or(f64::INFINITY);
            assert_eq!(single.to_bits(), bits, "{shape:?}, {r:?}: {single} and {}", f64::from_bits(bits));
        }
    }
}

fn same_bits_at_all_widths<S: Shape>(shape: &S) {
    let mut random = Random(6);
    same_bits::<S, 1>(shape, &mut random);
    same_bits::<S, 4>(shape, &mut random);
    same_bits::<S, 8>(shape, &mut random);
    same_bits::<S, 16>(shape, &mut random);
}

#[test]
fn wide_is_single() {
    same_bits_at_all_widths(&unit_sphere());
    same_bits_at_all_widths(&cube());
    same_bits_at_all_widths(&cylinder(false));
    same_bits_at_all_widths(&cylinder(true));
    same_bits_at_all_widths(&quad());
}

#[test]
fn wide_is_single_in_sets_and_from_f32() {
    let mut random = Random(7);
    for (what, to_world) in transforms() {
        for s in all_under(what, to_world) {
            for _ in 0..100 {
                let rays: [Ray64; 16] = std::array::from_fn(|_| towards(&mut random, &s, 3.0));
                let wide = s.set.lanes(&rays).unwrap_or([f64::INFINITY; 16]);
                let single = rays.map(|r| s.set.hit(&r).unwrap_or(f64::INFINITY));
                assert_eq!(wide.map(f64::to_bits), single.map(f64::to_bits), "{}", s.name);
            }
        }
    }
    let mut set = Affine::default();
    set.push(cylinder(true), transforms()[0].1).unwrap();
    let mut packet = RayPacket::<16>::EMPTY;
    for lane in 0..16 {
        let o = (4.0 * random.direction()).as_vec3();
        packet.set(lane, &tison::geom::Ray::new(o, -o + random.point().as_vec3()));
    }
    let wide = set.hit_lanes(0, &Lanes::from(&packet)).expect("some of them hit");
    for (lane, t) in wide.into_iter().enumerate() {
        let r = packet.get(lane);
        let single = set.hit(0, r.o.as_dvec3(), r.d.as_dvec3(), 0.0, f64::INFINITY);
        assert_eq!(single.unwrap_or(f64::INFINITY).to_bits(), t.to_bits());
    }
}

#[test]
fn nan_is_a_miss() {
    let mut random = Random(8);
    for s in all_plain().into_iter().chain(all_under("turned", transforms()[0].1)) {
        let mut tried = 0;
        for _ in 0..400 {
            let r = towards(&mut random, &s, 3.0);
            if s.set.hit(&r).is_none() {
                continue;
            }
            tried += 1;
            for k in 0..8 {
                let mut bad = r;
                match k {
                    0..3 => bad.o[k] = f64::NAN,
                    3..6 => bad.d[k - 3] = f64::NAN,
                    6 => bad.t_near = f64::NAN,
                    _ => bad.t_far = f64::NAN,
                }
                assert_eq!(s.set.hit(&bad), None, "{}: {bad:?}", s.name);
                let mut rays = [r; 16];
                rays[5] = bad;
                let wide = s.set.lanes(&rays).expect("fifteen hit");
                assert!(wide[5] == f64::INFINITY && wide[4] < f64::INFINITY);
            }
            assert_eq!(s.set.hit(&Ray64 { d: DVec3::ZERO, ..r }), None, "{}: no direction", s.name);
        }
        assert!(tried > 40, "{}: {tried}", s.name);
    }
}

#[test]
fn both_zeros_are_the_same() {
    let mut random = Random(9);
    let values = [0.0, 0.3, -0.4, 1.0, -1.0];
    for s in all_plain() {
        let mut hits = 0;
        for _ in 0..20_000 {
            let mut number = || values[random.bits() as usize % values.len()];
            let o = DVec3::new(number(), number(), number()) * 2.0;
            let d = DVec3::new(number(), number(), number());
            let negative = |v: DVec3| v.map(|x| if x == 0.0 { -0.0 } else { x });
            let want = s.set.hit(&ray(o, d)).map(f64::to_bits);
            hits += u32::from(want.is_some());
            for (o, d) in [(negative(o), d), (o, negative(d)), (negative(o), negative(d))] {
                assert_eq!(s.set.hit(&ray(o, d)).map(f64::to_bits), want, "{}: {o} {d}", s.name);
            }
        }
        assert!(hits > 500, "{}: {hits}", s.name);
    }
}
