//! Points, texture coordinates, bounds, and what is refused.
use super::kit::*;
use super::truth::Solid;
use glam::{DAffine3, DMat3, DVec2, DVec3};
use std::f64::consts::PI;
use tison::geom::{Affine, Cube, Cylinder, Quad, Shape, ShapeError, Sphere};

/// How far local point `q` is from the surface.
fn off_surface(solid: Solid, q: DVec3) -> f64 {
    let outside = |half: f64, x: f64| (x.abs() - half).max(0.0);
    match solid {
        Solid::Sphere => (q.length() - 1.0).abs(),
        Solid::Cube(half) => {
            let depth = DVec3::from(half) - q.abs();
            depth.min_element().abs()
        }
        Solid::Cylinder { half, capped } => {
            let wall = (q.truncate().length() - 1.0).abs() + outside(half, q.z);
            let cap = (q.z.abs() - half).abs() + outside(1.0, q.truncate().length());
            if capped { wall.min(cap) } else { wall }
        }
        Solid::Quad(half) => q.z.abs() + outside(half[0], q.x) + outside(half[1], q.y),
        Solid::Triangle(_) => unreachable!("a triangle is no shape of its own"),
    }
}

#[test]
fn refined_points_lie_on_the_surface_and_in_tight_bounds() {
    let mut random = Random(12);
    let moved = transforms().into_iter().flat_map(|(what, m)| all_under(what, m));
    for s in all_plain().into_iter().chain(moved) {
        let bounds = s.set.bounds();
        let slack = 1e-14 * bounds.lo.abs().max(bounds.hi.abs());
        let size = bounds.size().max_element();
        let back = s.to_world.inverse();
        let norm = |m: DMat3| m.to_cols_array().iter().map(|x| x * x).sum::<f64>().sqrt();
        let condition = norm(s.to_world.matrix3) * norm(back.matrix3);
        let far = s.to_world.translation.length() / size;
        let (mut lo, mut hi) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        let mut hits = 0;
        for i in 0..20_000 {
            let r = towards(&mut random, &s, 1.2 + 3.0 * f64::from(i % 7));
            let Some(t) = s.set.hit(&r) else { continue };
            hits += 1;
            let p = s.set.refine(&r, t);
            let off = off_surface(s.solid, back.transform_point3(p.p));
            assert!(off <= 1e-15 * condition * (1.0 + far), "{}: {off:e} off", s.name);
            assert!((p.p - (r.o + t * r.d)).length() <= 1e-9 * (size + r.d.length() * t), "{}", s.name);
            assert!(p.p.cmpge(bounds.lo - slack).all() && p.p.cmple(bounds.hi + slack).all(), "{}", s.name);
            assert!(p.uv.cmpge(DVec2::ZERO).all() && p.uv.cmple(DVec2::ONE).all(), "{}: {}", s.name, p.uv);
            assert_eq!(p.extent, 0.5 * size, "{}", s.name);
            (lo, hi) = (lo.min(p.p), hi.max(p.p));
        }
        assert!(hits > 2000, "{}: {hits}", s.name);
        let unused = (bounds.size() - (hi - lo)) / bounds.size().max(DVec3::splat(1e-9 * size));
        assert!(unused.max_element() < 0.1, "{}: unused {unused}", s.name);
    }
}

#[test]
fn sphere_bounds_are_exact() {
    let s = Sphere::new(DVec3::new(1.0, 2.0, 3.0), 0.5).unwrap();
    let b = s.bounds(&DAffine3::IDENTITY);
    assert_eq!((b.lo, b.hi), (DVec3::new(0.5, 1.5, 2.5), DVec3::new(1.5, 2.5, 3.5)));
    // A cylinder tilted by 45 degrees: half its height plus its radius, both over sqrt 2.
    let tilt = DAffine3::from_rotation_x(PI / 4.0);
    let b = cylinder(true).bounds(&tilt);
    let want = DVec3::new(1.0, 1.8 / 2f64.sqrt(), 1.8 / 2f64.sqrt());
    assert!((b.hi - want).length() < 1e-15 && (b.lo + want).length() < 1e-15, "{b:?}");
}

fn uv(s: &Specimen, o: DVec3, target: DVec3) -> (DVec2, u8) {
    let r = ray(o, target - o);
    let p = s.set.refine(&r, s.set.hit(&r).expect("aimed at it"));
    (p.uv, p.part)
}

#[test]
fn texture_coordinates() {
    let [sphere, cube, tube, can, quad] = &all_plain()[..] else { unreachable!("five of them") };
    let near = |a: DVec2, u: f64, v: f64| assert!((a - DVec2::new(u, v)).length() < 1e-12, "{a} for {u}, {v}");
    // From outside, of the normal itself: u = 1/2 at -z, a quarter more at -x; v = 0 at +y.
    near(uv(sphere, -3.0 * DVec3::Z, DVec3::ZERO).0, 0.5, 0.5);
    near(uv(sphere, -3.0 * DVec3::X, DVec3::ZERO).0, 0.75, 0.5);
    near(uv(sphere, 3.0 * DVec3::X, DVec3::ZERO).0, 0.25, 0.5);
    assert!(uv(sphere, 3.0 * DVec3::Y, DVec3::ZERO).0.y < 1e-12);
    near(uv(sphere, DVec3::new(0.0, 1.0, -1.0), DVec3::ZERO).0, 0.5, 0.25);
    // From inside, of the normal that looks back.
    near(uv(sphere, DVec3::ZERO, DVec3::Z).0, 0.5, 0.5);
    // Wall: u turns from +x to +y; v = 0 at the top.
    near(uv(tube, 3.0 * DVec3::X, DVec3::ZERO).0, 0.0, 0.5);
    near(uv(tube, 3.0 * DVec3::Y, DVec3::ZERO).0, 0.25, 0.5);
    near(uv(tube, DVec3::new(0.0, -3.0, 0.4), DVec3::new(0.0, 0.0, 0.4)).0, 0.75, 0.25);
    near(uv(tube, DVec3::ZERO, DVec3::Y).0, 0.75, 0.5);
    let up = DVec3::new(0.5, 0.25, 0.0);
    assert_eq!(uv(can, up + 3.0 * DVec3::Z, up), (DVec2::new(0.75, 0.375), 2));
    assert_eq!(uv(can, up - 3.0 * DVec3::Z, up), (DVec2::new(0.25, 0.375), 1));
    near(uv(quad, DVec3::new(0.5, 0.35, 2.0), DVec3::new(0.5, 0.35, 0.0)).0, 0.75, 0.25);
    near(uv(quad, DVec3::new(0.5, 0.35, -2.0), DVec3::new(0.5, 0.35, 0.0)).0, 0.75, 0.25);
    // Each face of the cube, seen from outside: u grows to the viewer's right, v downwards.
    for (part, up) in [(0, DVec3::Y), (1, DVec3::Y), (2, DVec3::Z), (3, -DVec3::Z), (4, DVec3::Y), (5, DVec3::Y)] {
        let out = DVec3::AXES[part / 2] * if part % 2 == 1 { 1.0 } else { -1.0 };
        let right = up.cross(out);
        let at = |x: f64, y: f64| {
            let target = (out + x * right + y * up) * HALF;
            uv(cube, target + 3.0 * out, target)
        };
        for (x, y) in [(0.0, 0.0), (0.5, 0.25), (-0.75, -0.5)] {
            let (got, face) = at(x, y);
            assert_eq!(usize::from(face), part);
            near(got, 0.5 + 0.5 * x, 0.5 - 0.5 * y);
        }
    }
}

#[test]
fn a_reported_hit_stays_one() {
    let mut random = Random(13);
    let moved = transforms().into_iter().flat_map(|(what, m)| all_under(what, m));
    for s in all_plain().into_iter().chain(moved) {
        let size = 0.5 * s.set.bounds().size().max_element();
        let back = s.to_world.inverse();
        let mut tried = 0;
        for _ in 0..1000 {
            // Rays that pass by; a backend that saw a slightly different one says they hit.
            let r = towards(&mut random, &s, 3.0);
            if s.set.hit(&r).is_some() {
                continue;
            }
            tried += 1;
            let p = s.set.refine(&r, 0.9);
            assert_eq!(p.t, 0.9);
            assert!(p.p.is_finite() && (p.ng.length() - 1.0).abs() < 1e-14, "{}: {p:?}", s.name);
            let off = off_surface(s.solid, back.transform_point3(p.p));
            let far = s.to_world.translation.length() / size;
            assert!(off < 1e-9 * (1.0 + far), "{}: {off:e}", s.name);
        }
        assert!(tried > 100, "{}: {tried}", s.name);
    }
    let p = unit_sphere().refine(DVec3::ZERO, DVec3::ZERO, 0.0, 0.0);
    assert!(p.ng.is_finite() && p.p.length() == 1.0);
}

#[test]
fn simple_transforms_are_baked_in() {
    let m = DAffine3::from_scale_rotation_translation(DVec3::splat(3.0), glam::DQuat::IDENTITY, DVec3::X);
    assert_eq!(unit_sphere().under(&m), Some(Sphere::new(DVec3::X, 3.0).unwrap()));
    let m = DAffine3::from_scale_rotation_translation(DVec3::new(1.0, 2.0, 3.0), glam::DQuat::IDENTITY, DVec3::Y);
    assert_eq!(unit_sphere().under(&m), None);
    assert_eq!(cube().under(&m), Some(Cube::new(DVec3::Y, HALF * DVec3::new(1.0, 2.0, 3.0)).unwrap()));
    for m in [DMat3::from_rotation_z(0.1), -DMat3::IDENTITY, DMat3::from_rotation_z(PI / 2.0), DMat3::ZERO] {
        let m = DAffine3::from_mat3(m);
        assert_eq!((unit_sphere().under(&m), cube().under(&m)), (None, None));
    }
}

#[test]
fn what_cannot_be_is_refused() {
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(matches!(Sphere::new(DVec3::ZERO, bad), Err(ShapeError::Size { what: "radius", .. })));
        assert!(matches!(Cylinder::new(bad, 1.0, true), Err(ShapeError::Size { what: "radius", .. })));
        assert!(matches!(Cylinder::new(1.0, bad, true), Err(ShapeError::Size { what: "height", .. })));
        assert!(matches!(Cube::new(DVec3::ZERO, DVec3::new(1.0, bad, 1.0)), Err(ShapeError::Size { .. })));
        assert!(matches!(Quad::new(DVec2::new(bad, 1.0)), Err(ShapeError::Size { .. })));
    }
    assert!(matches!(Sphere::new(DVec3::NAN, 1.0), Err(ShapeError::Center { .. })));
    assert!(matches!(Cube::new(DVec3::INFINITY, DVec3::ONE), Err(ShapeError::Center { .. })));
    let message = Sphere::new(DVec3::ZERO, -2.0).unwrap_err().to_string();
    assert_eq!(message, "radius is -2; it must be a finite number above 0");
}

#[test]
fn singular_transforms_are_refused_and_small_ones_are_not() {
    let try_matrix = |m: DMat3| Affine::default().push(unit_sphere(), DAffine3::from_mat3(m));
    let flat = DMat3::from_diagonal(DVec3::new(1.0, 0.0, 1.0));
    let twins = DMat3::from_cols(DVec3::new(0.1, 0.2, 0.3), DVec3::new(0.3, 0.6, 0.9), DVec3::Z);
    for m in [flat, twins, DMat3::ZERO] {
        let error = try_matrix(m).unwrap_err();
        assert!(matches!(error, ShapeError::Singular { .. }), "{m:?}: {error:?}");
        assert!(error.to_string().contains("singular"));
    }
    for bad in [f64::NAN, f64::INFINITY] {
        let m = DMat3::from_diagonal(DVec3::new(1.0, bad, 1.0));
        assert_eq!(try_matrix(m), Err(ShapeError::TransformNotFinite));
        let moved = DAffine3::from_translation(DVec3::new(0.0, bad, 0.0));
        assert_eq!(Affine::default().push(unit_sphere(), moved), Err(ShapeError::TransformNotFinite));
    }
    for scale in [1e-150, 1e-30, 1e30, 1e150] {
        assert_eq!(try_matrix(DMat3::IDENTITY * scale), Ok(0), "{scale:e}");
    }
    // Thin is not flat.
    assert_eq!(try_matrix(DMat3::from_diagonal(DVec3::new(1.0, 1.0, 1e-20))), Ok(0));
}
