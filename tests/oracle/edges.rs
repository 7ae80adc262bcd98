//! Closed shapes have no slits, and a ray that leaves a surface does not meet it again.
use super::kit::*;
use super::truth::Solid;
use glam::{DAffine3, DQuat, DVec3};
use tison::geom::offset_origin;

#[test]
fn nothing_slips_out_at_edges_corners_and_rims() {
    let mut random = Random(10);
    for s in all_plain().into_iter().chain(transforms().into_iter().flat_map(|(what, m)| all_under(what, m))) {
        let border = |random: &mut Random| -> DVec3 {
            let mut p = random.point().map(f64::signum) * HALF;
            match s.solid {
                Solid::Cylinder { half, .. } => {
                    let (y, x) = (random.unit() * 7.0).sin_cos();
                    DVec3::new(x, y, half.copysign(p.z))
                }
                _ => {
                    if random.bits().is_multiple_of(2) {
                        let axis = random.bits() as usize % 3;
                        p[axis] *= random.unit();
                    }
                    p
                }
            }
        };
        if !matches!(s.solid, Solid::Cube(_) | Solid::Cylinder { capped: true, .. }) {
            continue;
        }
        for _ in 0..5000 {
            let inner = s.to_world.transform_point3(0.35 * random.point());
            let target = s.to_world.transform_point3(border(&mut random));
            assert!(s.set.hit(&ray(inner, target - inner)).is_some(), "{}: from {inner} to {target}", s.name);
            // And from outside, through the border to what lies inside of it.
            let o = target + (target - inner);
            assert!(s.set.hit(&ray(o, inner - o)).is_some(), "{}: from {o} to {inner}", s.name);
        }
    }
}

#[test]
fn rays_exactly_on_edges_of_a_cube_hit() {
    let s = &all_plain()[1];
    let (a, b) = (HALF, DVec3::new(HALF.x, HALF.y, -HALF.z));
    // Along the edge between +x and +y, from outside and inside it.
    assert_eq!(s.set.hit(&ray(a + DVec3::Z, -DVec3::Z)), Some((a.z + 1.0) - a.z));
    assert_eq!(s.set.hit(&ray(0.5 * (a + b), DVec3::Z)), Some(a.z));
    // Across the edge, touching nothing else: powers of two, so that nothing is rounded.
    let unit = tison::geom::Cube::new(DVec3::ZERO, DVec3::ONE).unwrap();
    let s = plain("cube", unit, Solid::Cube([1.0; 3]), DAffine3::IDENTITY);
    assert_eq!(s.set.hit(&ray(DVec3::new(2.0, 0.0, 0.5), DVec3::new(-1.0, 1.0, 0.0))), Some(1.0));
    let r = ray(DVec3::new(3.0, -1.0, 0.0), DVec3::new(-1.0, 1.0, 0.5));
    assert_eq!(s.set.hit(&r), Some(2.0), "a corner");
    assert_eq!(s.set.refine(&r, 2.0).part, 1, "the least axis of those that meet");
}

#[test]
fn a_ray_that_leaves_a_solid_does_not_meet_it_again() {
    let mut random = Random(11);
    for scale in [1e-4, 1e-2, 1.0, 1e2, 1e4, 1e6] {
        for offset in [0.0, 1.0, 100.0] {
            let shift = scale * offset * random.direction();
            let m = DAffine3::from_scale_rotation_translation(DVec3::splat(scale), DQuat::from_rotation_x(0.4), shift);
            let convex = all_under("moved", m)
                .into_iter()
                .filter(|s| matches!(s.solid, Solid::Sphere | Solid::Cube(_) | Solid::Cylinder { capped: true, .. }));
            for s in convex {
                let mut left = 0;
                for _ in 0..8000 {
                    let r = towards(&mut random, &s, 3.0);
                    let Some(t) = s.set.hit(&r) else { continue };
                    left += 1;
                    let p = s.set.refine(&r, t);
                    let o = offset_origin(p.p, p.ng, p.extent).as_dvec3();
                    let d = random.direction();
                    let d = if d.dot(p.ng) < 0.0 { -d } else { d };
                    assert_eq!(s.set.hit(&ray(o, d)), None, "{} at scale {scale}, {offset} sizes off", s.name);
                    // Inwards it crosses to the other side.
                    let o = offset_origin(p.p, -p.ng, p.extent).as_dvec3();
                    assert!(s.set.hit(&ray(o, -d)).is_some() || on_border(&s, p.p, o), "{}: {o} {d}", s.name);
                }
                assert!(left > 1000, "{}: {left}", s.name);
            }
        }
    }
}

/// Whether `p` is so near to an edge that a step off one face has left through another.
fn on_border(s: &Specimen, p: DVec3, o: DVec3) -> bool {
    let step = (o - p).length() / s.to_world.matrix3.x_axis.length();
    let q = s.to_world.inverse().transform_point3(p);
    match s.solid {
        Solid::Cube(half) => (0..3).filter(|&k| half[k] - q[k].abs() < 2.0 * step).count() > 1,
        Solid::Cylinder { half, .. } => half - q.z.abs() < 2.0 * step && 1.0 - q.truncate().length() < 2.0 * step,
        _ => false,
    }
}
