//! Where meshes and shapes come to stand, and in which objects.

use crate::kit::*;
use glam::{DAffine3, DMat3, DVec3};
use proptest::prelude::*;
use std::sync::Arc;
use tison::geom::ShapeSet;
use tison::scene::{AnyShapes, Loaded, Material, Object};

#[test]
fn a_mesh_stands_where_its_steps_put_it() {
    let steps = "[{ scale = [2, 1, 1] }, { rotate = [0, 0, 1], degrees = 90 }, { translate = [10, 20, 30] }]";
    let loaded = scene(&format!("[[object]]\nmesh = 'a.obj'\ntransform = {steps}"), &[("a.obj", TRIANGLE)]);
    let got = corners(&loaded, 0);
    let want = [DVec3::new(10.0, 20.0, 30.0), DVec3::new(10.0, 22.0, 30.0), DVec3::new(9.0, 20.0, 30.0)];
    got.iter().zip(want).for_each(|(&got, want)| near(got, want, 1e-6));
    assert!(matches!(loaded.scene.objects[..], [Object::Mesh(_)]));
    assert_eq!(loaded.scene.materials, [Material::default()]);
}

/// Whether normals still point out of the box, and the mirror is told.
fn check_box(loaded: &Loaded, object: usize, mirrored: bool, name: &str) {
    assert_eq!(mesh(loaded, object).mirrored, mirrored, "{name}");
    let (p, n) = (corners(loaded, object), normals(loaded, object));
    let center = p.iter().sum::<DVec3>() / p.len() as f64;
    for (p, n) in p.chunks(3).zip(n.chunks(3)) {
        let ng = (p[1] - p[0]).cross(p[2] - p[0]).normalize() * if mirrored { -1.0 } else { 1.0 };
        assert!(ng.dot(p[0] - center) > 0.0, "{name}: winding and flag tell the outside");
        n.iter().for_each(|&n| near(n, ng, 1e-6));
    }
}

#[test]
fn normals_stay_normal_under_mirrors_shears_and_stretches() {
    let matrices = [
        ("plain", "matrix = [1,0,0,0, 0,1,0,0, 0,0,1,0, 0,0,0,1]", false),
        ("mirror", "scale = [-1, 1, 1]", true),
        ("three mirrors", "scale = -2", true),
        ("shear", "matrix = [1,2,0.5,7, 0,1,-1,0, 0,0,1,0, 0,0,0,1]", false),
        ("sheared mirror", "matrix = [1,2,0.5,7, 0,-1,-1,0, 0.1,0,1,0, 0,0,0,1]", true),
        ("1000:1", "scale = [1000, 1, 1]", false),
    ];
    for (name, step, mirrored) in matrices {
        for uses in [1, 2] {
            let object = format!("[[object]]\nmesh = 'box.obj'\ntransform = [{{ {step} }}]\n");
            let loaded = scene(&object.repeat(uses), &[("box.obj", BOX)]);
            check_box(&loaded, 0, mirrored, name);
        }
    }
}

#[test]
fn fit_takes_the_box_of_what_can_be_hit_after_the_steps_before_it() {
    let bounds = |object: &str| {
        let loaded = scene(&format!("[[object]]\n{object}"), &[("box.obj", BOX)]);
        let b = loaded.scene.bounds();
        [b.lo, b.hi].map(|p| (p * 1e5).round() / 1e5)
    };
    let at = |half: [f64; 3]| [-DVec3::from(half), DVec3::from(half)];
    assert_eq!(bounds("mesh = 'box.obj'\ntransform = [{ fit = 2 }]"), at([0.5, 0.25, 1.0]));
    assert_eq!(bounds("mesh = 'box.obj'\ntransform = [{ scale = [4, 1, 1] }, { fit = 2 }]"), at([1.0, 0.125, 0.5]));
    let moved = bounds("mesh = 'box.obj'\ntransform = [{ fit = 8 }, { translate = [1, 1, 1] }]");
    assert_eq!(moved, [DVec3::new(-1.0, 0.0, -3.0), DVec3::new(3.0, 2.0, 5.0)]);
    // Exact, not the box around a turned box: that would be sqrt(2) times as wide.
    let turned = "mesh = 'diamond.obj'\ntransform = [{ rotate = [0, 0, 1], degrees = 45 }, { fit = 1 }]";
    let diamond = "v 1 0 0\nv 0 1 0\nv -1 0 0\nv 0 -1 0\nf 1 2 3 4\n";
    let loaded = scene(&format!("[[object]]\n{turned}"), &[("diamond.obj", diamond)]);
    near(loaded.scene.bounds().size(), DVec3::new(1.0, 1.0, 0.0), 1e-6);
    assert_eq!(bounds("shape = 'sphere'\ncenter = [5, 6, 7]\nradius = 9\ntransform = [{ fit = 1 }]"), at([0.5; 3]));
    let cube = "shape = 'cube'\nhalf = [1, 2, 3]\ntransform = [{ scale = [6, 1, 1] }, { fit = 12 }]";
    assert_eq!(bounds(cube), at([6.0, 2.0, 3.0]));
}

#[test]
fn a_mesh_that_is_shown_often_is_stored_once() {
    let object = |more: &str| format!("[[object]]\nmesh = 'box.obj'\n{more}\n");
    let smooth = |more: &str| format!("[[object]]\nmesh = 'flat.obj'\n{more}\n");
    let text = [
        object("transform = [{ translate = [5, 0, 0] }]"),
        object("transform = [{ scale = [1, -1, 1] }]"),
        object("smooth = 30"),
        smooth("smooth = 30"),
        smooth("smooth = 30\ntransform = { scale = 2 }"),
        smooth(""),
        "[[object]]\nmesh = 'sub/../once.obj'".into(),
    ];
    let files = [("box.obj", BOX), ("flat.obj", TRIANGLE), ("once.obj", TRIANGLE), ("sub/x", "")];
    let loaded = scene(&text.concat(), &files);
    let data = |i| &mesh(&loaded, i).data;
    assert!(Arc::ptr_eq(data(0), data(1)) && Arc::ptr_eq(data(0), data(2)), "it has normals of its own");
    assert!(Arc::ptr_eq(data(3), data(4)) && !Arc::ptr_eq(data(3), data(5)));
    assert!(Arc::ptr_eq(&data(3).triangles, &data(5).triangles), "read once");
    assert!(data(3).normals.is_some() && data(5).normals.is_none());
    let kinds: Vec<_> = loaded.scene.objects.iter().map(|o| matches!(o, Object::Instance(_))).collect();
    assert_eq!(kinds, [true, true, true, true, true, true, false]);
    check_box(&loaded, 0, false, "shared");
    check_box(&loaded, 1, true, "shared, mirrored");
    near(corners(&loaded, 0)[0], DVec3::new(5.0, 1.0, 0.0), 1e-5);
    near(corners(&loaded, 1)[0], DVec3::new(0.0, -1.0, 0.0), 1e-5);
    near(corners(&loaded, 4)[1], DVec3::new(2.0, 0.0, 0.0), 1e-5);
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, ..ProptestConfig::default() })]
    /// Baked or shared, corners are where f64 puts them, to the rounding of f32.
    #[test]
    fn corners_are_where_they_should_be(
        m in proptest::array::uniform9(-3.0..3.0f64), t in proptest::array::uniform3(-1e6..1e6f64), size in -3..4i32,
    ) {
        let linear = DMat3::from_cols_array(&m);
        prop_assume!(linear.determinant().abs() > 0.1);
        let to_world = DAffine3::from_mat3_translation(linear * 10f64.powi(size), t.into());
        let [x, y, z] = [linear.x_axis, linear.y_axis, linear.z_axis].map(|c| c * 10f64.powi(size));
        let rows: Vec<_> = (0..3).map(|r| format!("{:?},{:?},{:?},{:?}", x[r], y[r], z[r], t[r])).collect();
        let object = format!("[[object]]\nmesh = 'box.obj'\ntransform = [{{ matrix = [{},0,0,0,1] }}]\n", rows.join(","));
        let points = [[0, 1, 0], [2, 1, 0], [2, 0, 0]].map(|p| to_world.transform_point3(DVec3::from(p.map(f64::from))));
        for uses in [1, 2] {
            let loaded = scene(&object.repeat(uses), &[("box.obj", BOX)]);
            let reach = 3.0 * 10f64.powi(size) * 12.0;
            for (got, want) in corners(&loaded, 0).into_iter().zip(points) {
                prop_assert!((got - want).length() < 3e-7 * reach + 1e-9, "{} {}", got, want);
            }
        }
    }
}

#[test]
fn shapes_go_to_one_set_a_class_in_the_order_of_first_use() {
    let text = "
        object = [
            { shape = 'cube', half = [1, 2, 3], transform = [{ scale = [2, 3, 4] }, { translate = [9, 0, 0] }] },
            { shape = 'sphere', center = [1, 2, 3], radius = 2, transform = { scale = 3 } },
            { mesh = 'a.obj' },
            { shape = 'sphere', center = [1, 0, 0], transform = { scale = [1, 2, 1] } },
            { shape = 'cube', transform = { rotate = [0, 1, 0], degrees = 30 } },
            { shape = 'cylinder' }, { shape = 'quad', half = 3 }, { shape = 'cylinder', capped = true },
            { shape = 'sphere', transform = { scale = -1 } },
            { shape = 'cube', transform = { scale = [1, -1, 1] } },
            { shape = 'sphere', radius = 0.5, transform = { rotate = [1, 0, 0], degrees = 360 } },
        ]";
    let loaded = scene(text, &[("a.obj", TRIANGLE)]);
    let scene = &loaded.scene;
    let kind = |o: &Object| match o {
        Object::Mesh(_) => ("mesh", 1),
        Object::Instance(_) => ("instance", 1),
        Object::Shapes(s) => {
            assert_eq!(s.materials.len(), s.set.len() as usize);
            let name = match s.set {
                AnyShapes::Spheres(_) => "spheres",
                AnyShapes::Cubes(_) => "cubes",
                AnyShapes::PlacedSpheres(_) => "placed spheres",
                AnyShapes::PlacedCubes(_) => "placed cubes",
                AnyShapes::Cylinders(_) => "cylinders",
                AnyShapes::Quads(_) => "quads",
                AnyShapes::Triangles(_) => "triangles",
            };
            (name, s.set.len())
        }
    };
    let kinds: Vec<_> = scene.objects.iter().map(kind).collect();
    let want = [
        ("cubes", 1),
        ("spheres", 2),
        ("mesh", 1),
        ("placed spheres", 2),
        ("placed cubes", 2),
        ("cylinders", 2),
        ("quads", 1),
    ];
    assert_eq!(kinds, want);
    let Object::Shapes(cubes) = &scene.objects[0] else { panic!("cubes") };
    let Object::Shapes(spheres) = &scene.objects[1] else { panic!("spheres") };
    let Object::Shapes(placed) = &scene.objects[3] else { panic!("spheres") };
    let bounds = |of: &AnyShapes, i| {
        let b = tison::with_shapes!(of, set => set.bounds(i));
        (scene.frame.to_world(b.center()), b.size() * scene.frame.world_per_local())
    };
    assert_eq!(bounds(&cubes.set, 0), (DVec3::new(9.0, 0.0, 0.0), DVec3::new(4.0, 12.0, 24.0)));
    assert_eq!(bounds(&spheres.set, 0), (DVec3::new(3.0, 6.0, 9.0), DVec3::splat(12.0)));
    assert_eq!(bounds(&spheres.set, 1), (DVec3::ZERO, DVec3::ONE));
    assert_eq!(bounds(&placed.set, 0), (DVec3::X, DVec3::new(2.0, 4.0, 2.0)));
}

#[test]
fn a_sphere_far_from_its_own_origin_keeps_its_digits() {
    let text = "[[object]]\nshape = 'sphere'\ncenter = [1e8, 0, 0]\ntransform = { rotate = [0, 0, 1], degrees = 45 }";
    let loaded = scene(text, &[]);
    let Object::Shapes(spheres) = &loaded.scene.objects[0] else { panic!("a set") };
    let AnyShapes::PlacedSpheres(set) = &spheres.set else { panic!("turned, for its texture") };
    let (b, unit) = (set.bounds(0), loaded.scene.frame.local_per_world());
    near(b.size() / unit, DVec3::splat(2.0), 1e-12);
    let t = set.hit(0, b.center() - DVec3::X * 3.0 * unit, DVec3::X, 0.0, f64::INFINITY).expect("it is hit");
    assert!((t / unit - 2.0).abs() < 1e-12, "{t}");
}

#[test]
fn a_floor_does_not_take_the_origin_away() {
    let ball = "[[object]]\nshape = 'sphere'\ncenter = [1000, 5, 0]\n";
    let floor = "[[object]]\nshape = 'quad'\nhalf = 1e7\ntransform = { translate = [1e7, 1e7, 0] }\n";
    for text in [format!("{ball}{floor}"), format!("{floor}{ball}")] {
        let frame = scene(&text, &[]).scene.frame;
        assert_eq!(frame.origin, DVec3::new(1000.0, 5.0, 0.0));
        assert!((1..=12).contains(&frame.exponent), "{}", frame.exponent);
    }
    // Meshes of survey coordinates keep their millimetres.
    let far =
        TRIANGLE.replace("v ", "v 500000.").replace("500000.0 0", "500000.001 0").replace("v 500000.1 0", "v 500001 0");
    let loaded =
        scene("[[object]]\nmesh = 'a.obj'\n[[object]]\nshape = 'sphere'\ncenter = [500000, 0, 0]", &[("a.obj", &far)]);
    let got = corners(&loaded, 0);
    near(got[0], DVec3::new(500_000.001, 0.0, 0.0), 2e-7);
    near(got[1], DVec3::new(500_001.0, 0.0, 0.0), 2e-7);
}
