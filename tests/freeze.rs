//! From scene files on disk to frozen scenes.

use glam::{DAffine3, DMat3, DVec3, Vec2, Vec3};
use image::{Rgb, RgbImage};
use proptest::prelude::*;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::{Arc, Mutex};
use tison::geom::{BAD_FACE, ShapeSet};
use tison::scene::format::Look;
use tison::scene::obj::Reader;
use tison::scene::{AnyShapes, Error, LoadOptions, Loaded, Material, Mesh, MeshPaint, Object, Unused, load};

/// A folder with a scene in it.
struct Folder(tempfile::TempDir);

impl Folder {
    fn new(files: &[(&str, &str)]) -> Self {
        let folder = Self(tempfile::tempdir().expect("a folder for the test"));
        for (name, text) in files {
            folder.write(name, text);
        }
        folder
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().canonicalize().expect("it is there").join(name)
    }

    fn write(&self, name: &str, text: impl AsRef<[u8]>) {
        let path = self.path(name);
        std::fs::create_dir_all(path.parent().expect("it has one")).expect("a folder");
        std::fs::write(path, text).expect("a file");
    }

    /// An image with a red texel at the top left, green at the top right, and grey below.
    fn image(&self, name: &str) {
        let pixel = |x, y| [Rgb([255, 0, 0]), Rgb([0, 255, 0]), Rgb([128; 3]), Rgb([128; 3])][(2 * y + x) as usize];
        std::fs::create_dir_all(self.path(name).parent().expect("it has one")).expect("a folder");
        RgbImage::from_fn(2, 2, pixel).save(self.path(name)).expect("the image can be written");
    }

    fn load_with(&self, name: &str, change: impl FnOnce(&mut LoadOptions<'_>)) -> Result<Loaded, Error> {
        static GO_ON: AtomicBool = AtomicBool::new(false);
        let mut options = LoadOptions {
            reader: Reader::Own,
            exact: false,
            smooth: None,
            allow: vec![],
            overrides: vec![],
            cancel: &GO_ON,
            progress: None,
        };
        change(&mut options);
        load(&self.path(name), &options)
    }

    fn good(&self, name: &str) -> Loaded {
        self.load_with(name, |_| {}).unwrap_or_else(|e| panic!("{}", self.shown(&e)))
    }

    /// What is wrong with it, as a user sees it.
    fn bad(&self, name: &str) -> String {
        self.shown(&self.load_with(name, |_| {}).expect_err("it must be refused"))
    }

    fn shown(&self, e: &Error) -> String {
        let text = match e {
            Error::Scene(list) => list.iter().map(|d| d.render(Look::Plain) + "\n").collect(),
            e => e.to_string(),
        };
        text.replace(&format!("{}", self.path("").display()), "")
    }
}

/// A folder with `a.toml` in it, which needs no version and lights of its own, and other files.
fn scene(text: &str, files: &[(&str, &str)]) -> Loaded {
    let folder = Folder::new(files);
    folder.write("a.toml", format!("tison = 1\n{text}"));
    folder.good("a.toml")
}

const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
/// A box with a corner at the origin, outward normals, texture coordinates on one face, and a vertex far off.
const BOX: &str = "v 0 0 0\nv 2 0 0\nv 2 1 0\nv 0 1 0\nv 0 0 4\nv 2 0 4\nv 2 1 4\nv 0 1 4\nv 90 90 90\n\
    vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nvn 0 0 -1\nvn 0 0 1\nvn 0 -1 0\nvn 0 1 0\nvn -1 0 0\nvn 1 0 0\n\
    f 4//1 3//1 2//1 1//1\nf 5/1/2 6/2/2 7/3/2 8/4/2\nf 1//3 2//3 6//3 5//3\nf 3//4 4//4 8//4 7//4\n\
    f 4//5 1//5 5//5 8//5\nf 2//6 3//6 7//6 6//6\n";

fn mesh(loaded: &Loaded, object: usize) -> &Mesh {
    loaded.scene.objects[object].mesh().expect("it is a mesh")
}

/// World positions of the corners of every triangle of an object that is a mesh.
fn corners(loaded: &Loaded, object: usize) -> Vec<DVec3> {
    let object = &loaded.scene.objects[object];
    let triangles = &object.mesh().expect("it is a mesh").data.triangles;
    let to_scene = match object {
        Object::Instance(i) => i.to_scene,
        _ => DAffine3::IDENTITY,
    };
    let good = triangles.faces().iter().filter(|&&f| f != BAD_FACE).flatten();
    let to_world = |i: &u32| loaded.scene.frame.to_world(to_scene.transform_point3(triangles.point(*i).as_dvec3()));
    good.map(to_world).collect()
}

/// Scene-space normals at the corners of every triangle, of unit length.
fn normals(loaded: &Loaded, object: usize) -> Vec<DVec3> {
    let object = &loaded.scene.objects[object];
    let data = &object.mesh().expect("it is a mesh").data;
    let matrix = match object {
        Object::Instance(i) => i.normal_to_scene,
        _ => DMat3::IDENTITY,
    };
    let of = data.normals.as_ref().expect("it has normals");
    let numbers = (0..data.triangles.face_count()).map(|t| of.of(data.triangles.faces(), t));
    let three = numbers.flat_map(|n| of.three::<3>(n).expect("all corners have one"));
    three.map(|n| (matrix * DVec3::from(n.map(f64::from))).normalize()).collect()
}

#[track_caller]
fn near(got: DVec3, want: DVec3, tolerance: f64) {
    assert!((got - want).length() <= tolerance, "{got} is not {want}");
}

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

#[test]
fn nothing_that_is_unused_is_read() {
    let text = "
        [material.used]
        color = [1, 0, 0]
        [material.spare]
        texture = 'not there.png'
        [material.flat]
        texture = 'not there either.png'
        diffuse = [1, 1, 1]
        ambient = 0
        [[object]]
        shape = 'quad'
        material = 'flat'
        [[object]]
        shape = 'quad'
        material = 'used'
        [[object]]
        mesh = 'a.obj'
        material = 'used'";
    let files = [("a.obj", &*format!("mtllib not there.mtl\nusemtl x\nvt 0 0\n{}", TRIANGLE.replace("f 1", "f 1/1")))];
    let loaded = scene(text, &files);
    assert_eq!(loaded.unused, Unused { materials: 1, textures: 2, lights: 0 });
    assert_eq!(loaded.warnings, []);
    let names: Vec<_> = loaded.scene.materials.iter().map(|m| m.name.as_str()).collect();
    assert_eq!(names, ["flat", "used"]);
    assert!(loaded.scene.textures.is_empty() && loaded.scene.materials.iter().all(|m| m.texture.is_none()));
    let mesh = mesh(&loaded, 1);
    assert!(mesh.data.uvs.is_none() && mesh.data.face_materials.is_none());
    assert_eq!(mesh.paint, MeshPaint::One(1));
}

/// A quad with the image the right way up, as OBJ files have it: v upwards.
const PICTURE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nf 1/1 2/2 3/3 4/4\n";

/// What the texture of object 0 shows at the share (x, y) of the picture, from the bottom left.
fn seen(loaded: &Loaded, x: f32, y: f32) -> Vec3 {
    let mesh = mesh(loaded, 0);
    let corners = [[0, 1, 2], [0, 2, 3]].map(|c| c.map(|i| Vec2::new(f32::from(i == 1 || i == 2), f32::from(i > 1))));
    let t = usize::from(y > x);
    let [a, b, c] = mesh.data.uvs_of(t as u32).expect("it has texture coordinates");
    // Barycentrics of the point in the unit square's triangles.
    let (u, v) = if t == 0 { (x - y, y) } else { (x, y - x) };
    assert_eq!(corners[t][0] * (1.0 - u - v) + corners[t][1] * u + corners[t][2] * v, Vec2::new(x, y));
    let image = loaded.scene.materials[mesh.material(t as u32) as usize].texture.expect("it is textured").image;
    loaded.scene.textures[image as usize].sample(a * (1.0 - u - v) + b * u + c * v)
}

#[test]
fn pictures_stand_upright_and_are_taken_for_srgb() {
    let folder = Folder::new(&[("a.obj", PICTURE)]);
    folder.image("images/p.png");
    let object = "[[object]]\nmesh = 'a.obj'\nmaterial = 'm'";
    folder.write("a.toml", format!("tison = 1\n[material.m]\ntexture = 'images/p.png'\n{object}"));
    folder.write("b.ray", "Material \"m\" \"texture_albedo\" \"images/p.png\" \"k_diffuse\" 1 Mesh \"a.obj\" \"m\"");
    let (toml, ray) = (folder.good("a.toml"), folder.good("b.ray"));
    assert_eq!(seen(&toml, 0.25, 0.75), Vec3::X);
    assert_eq!(seen(&toml, 0.75, 0.75), Vec3::Y);
    let grey = tison::math::colour::linear(128.0 / 255.0) as f32;
    assert_eq!(seen(&toml, 0.25, 0.25), Vec3::splat(grey));
    assert!(!toml.scene.textures[0].nearest);
    // The course counts v downwards, and takes bytes as they are.
    assert_eq!(seen(&ray, 0.25, 0.25), Vec3::X);
    assert_eq!(seen(&ray, 0.25, 0.75), Vec3::splat(128.0 / 255.0));
    assert!(ray.scene.textures[0].nearest && ray.scene.course_rules);
    assert_eq!(ray.scene.background, Vec3::ZERO);
    // So does the same scene in TOML.
    folder.write("c.toml", format!("tison = 1\n[render]\ncourse_rules = true\n[material.m]\ntexture = 'images/p.png'\ntexture_filter = 'nearest'\n{object}"));
    assert_eq!(seen(&folder.good("c.toml"), 0.25, 0.25), Vec3::X);
    assert!(toml.texture_seconds > 0.0);
}

#[test]
fn an_image_is_read_once_for_each_way_to_look_it_up() {
    let folder = Folder::new(&[("sub/x", "")]);
    folder.image("p.png");
    folder.write(
        "a.json",
        r#"{"tison": 1, "material": {"a": {"texture": "p.png"}, "b": {"texture": "sub/../p.png", "color": 0.5},
        "c": {"texture": "p.png", "texture_filter": "nearest"}}, "object": [{"shape": "quad", "material": "a"},
        {"shape": "quad", "material": "b"}, {"shape": "quad", "material": "c"}]}"#,
    );
    let scene = folder.good("a.json").scene;
    let images: Vec<_> = scene.materials.iter().map(|m| m.texture.expect("it is textured").image).collect();
    assert_eq!(images, [0, 0, 1]);
    assert_eq!(scene.textures.iter().map(|t| t.nearest).collect::<Vec<_>>(), [false, true]);
    assert_eq!(scene.materials[1].texture.expect("it is textured").diffuse, Vec3::splat(0.5));
}

#[test]
fn a_mesh_brings_its_own_materials_and_their_images() {
    let mtl = "newmtl wood\nKd 0.5 1 1\nmap_Kd -s 1 1 1 images/p.png\nnewmtl red\nKd 1 0 0\nnewmtl unused\nmap_Kd other.png\n";
    let text = format!("mtllib a.mtl\nusemtl wood\n{PICTURE}usemtl red\nf 1 2 3\n");
    let folder = Folder::new(&[("models/a.obj", &text), ("models/a.mtl", mtl)]);
    folder.image("models/images/p.png");
    let own = "[[object]]\nmesh = 'models/a.obj'\n";
    folder.write("a.toml", format!("tison = 1\n[material.blue]\n[[object]]\nshape = 'cube'\n{own}"));
    folder.write("b.toml", format!("tison = 1\n[material.blue]\n{own}{own}material = 'blue'\n"));
    let bare = folder.good("models/a.obj");
    let names = |l: &Loaded| l.scene.materials.iter().map(|m| m.name.clone()).collect::<Vec<_>>();
    assert_eq!(names(&bare), ["wood", "red"]);
    assert_eq!(bare.unused, Unused { materials: 1, textures: 1, lights: 0 });
    assert_eq!((seen(&bare, 0.25, 0.75), seen(&bare, 0.75, 0.75)), (Vec3::X, Vec3::Y));
    assert_eq!(bare.scene.materials[0].texture.expect("wood").diffuse, Vec3::new(0.5, 1.0, 1.0));
    assert_eq!((bare.scene.materials[0].diffuse, bare.scene.materials[1].texture), (Vec3::ZERO, None));
    let told: Vec<_> = bare.warnings.iter().map(|w| w.what.as_str()).collect();
    assert_eq!(told, ["the options of 'map_Kd' have no effect here"]);
    // After those of the scene file.
    let loaded = folder.good("a.toml");
    assert_eq!(names(&loaded), ["default", "wood", "red"]);
    assert_eq!(mesh(&loaded, 1).paint, MeshPaint::PerFace(1));
    assert_eq!([0, 1, 2].map(|t| mesh(&loaded, 1).material(t)), [1, 1, 2]);
    assert_eq!(loaded.unused, Unused { materials: 2, textures: 1, lights: 0 });
    let loaded = folder.good("b.toml");
    assert_eq!(names(&loaded), ["blue", "wood", "red"]);
    assert_eq!((mesh(&loaded, 0).paint, mesh(&loaded, 1).paint), (MeshPaint::PerFace(1), MeshPaint::One(0)));
    assert!(mesh(&loaded, 0).data.uvs.is_some());
}

#[test]
fn images_of_a_library_that_cannot_be_used_are_warnings() {
    let mtl = "newmtl a\nmap_Kd gone.png\nnewmtl b\nmap_Kd broken.png\nnewmtl c\nmap_Kd gone too.png\n";
    let text = format!("mtllib a.mtl\nusemtl a\n{TRIANGLE}usemtl b\nf 1 2 3\nusemtl c\nf 1 2 3\n");
    let folder = Folder::new(&[("a.obj", &text), ("a.mtl", mtl), ("broken.png", "\u{89}PNG")]);
    let loaded = folder.good("a.obj");
    let told: Vec<_> =
        loaded.warnings.iter().map(|w| w.to_string().replace(&format!("{}", folder.path("").display()), "")).collect();
    assert_eq!(
        told,
        [
            "a.mtl:2: image 'gone.png' is not there: Kd is used alone (and 1 more like it)",
            "a.obj: it has no texture coordinates ('vt'): the images of its materials are not shown",
            "broken.png: the image is no PNG, JPEG, BMP, HDR or PNM image; Kd is used alone",
        ]
    );
    assert!(loaded.scene.materials.iter().all(|m| m.texture.is_none() && m.diffuse == Material::default().diffuse));
}

#[test]
fn images_outside_the_folder_of_the_mesh_need_permission() {
    let mtl = "newmtl a\nmap_Kd ../images/p.png\n";
    let text = format!("mtllib a.mtl\nusemtl a\n{PICTURE}");
    let folder = Folder::new(&[("models/a.obj", &text), ("models/a.mtl", mtl)]);
    folder.image("images/p.png");
    let said = folder.bad("models/a.obj");
    assert_eq!(
        said,
        "models/a.mtl:2: images/p.png is outside the folder of the mesh that needs it and is not read; copy it into \
         that folder and name it there, or allow its folder with --allow-path images"
    );
    let allowed = folder.load_with("models/a.obj", |o| o.allow = vec![folder.path("images")]).expect("allowed");
    assert_eq!(allowed.scene.textures.len(), 1);
}

#[test]
fn lights_come_to_scene_space() {
    let text = "
        [render]
        ambient = [0.1, 0.2, 0.3]
        background = [0.5, 0.25, 1]
        [light.key]
        position = [8, 16, 24]
        color = [1, 0.5, 0]
        power = 4
        radius = 2
        [light.off]
        position = [0, 0, 0]
        color = 0
        [light.sun]
        position = [0, 1, 0]
        falloff = 'none'
        [[object]]
        shape = 'sphere'
        center = [8, 16, 16]
        radius = 7";
    let loaded = scene(text, &[]);
    let s = &loaded.scene;
    assert_eq!((s.frame.origin, s.frame.exponent), (DVec3::new(8.0, 16.0, 16.0), 3));
    let [key, sun] = &s.lights[..] else { panic!("two give light") };
    assert_eq!((key.position, key.radius, key.color), (DVec3::Z, 0.25, Vec3::new(4.0, 2.0, 0.0)));
    assert_eq!((key.falloff, sun.falloff), (Some(64.0), None));
    assert_eq!((s.ambient, s.background), (Vec3::new(0.1, 0.2, 0.3), Vec3::new(0.5, 0.25, 1.0)));
    assert_eq!(loaded.render.background, Some([0.5, 0.25, 1.0]));
    let silent = scene("[camera.c]\neye = [0, 0, 1]\ntarget = [0, 0, 0]", &[]);
    assert_eq!((silent.scene.ambient, silent.scene.background), (Vec3::ZERO, Vec3::ZERO));
    assert!(silent.scene.objects.is_empty() && silent.scene.materials.len() == 1);
    assert_eq!((silent.cameras.len(), silent.diagnostics.len()), (1, 1));
}

#[test]
fn files_that_are_not_there_are_told_where_they_are_named() {
    let folder = Folder::new(&[("wood.png", ""), ("library/m.toml", "tison = 1\n[material.m]\ntexture = 'm.png'\n")]);
    folder.write(
        "a.toml",
        "tison = 1\ninclude = ['library/m.toml']\n[material.w]\ntexture = \"wod.png\"\n\n[[object]]\nmesh = 'dragon.obj' # here\n\
         material = 'w'\n[[object]]\nmesh = 'dragon.obj'\nmaterial = 'm'\n",
    );
    let said = folder.bad("a.toml");
    let want = "\
error: there is no file wod.png; looked for wod.png
 --> a.toml:4:11
  |
4 | texture = \"wod.png\"
  |           ^^^^^^^^^
  |
  = help: did you mean `wood.png`?
error: there is no file dragon.obj; looked for dragon.obj
 --> a.toml:7:8
  |
7 | mesh = 'dragon.obj' # here
  |        ^^^^^^^^^^^^
error: there is no file library/m.png; looked for library/m.png
 --> library/m.toml:3:11
  |
3 | texture = 'm.png'
  |           ^^^^^^^
";
    assert_eq!(said, want);
    folder.write(
        "b.ray",
        "Material \"m\"\n  \"texture_albedo\" \"gone.bmp\" \"k_ambient\" 1\nSphere 1 \"m\" Mesh \"gone.obj\" \"m\"",
    );
    let said = folder.bad("b.ray");
    assert!(
        said.contains("2 |   \"texture_albedo\" \"gone.bmp\" \"k_ambient\" 1\n  |                    ^^^^^^^^^^"),
        "{said}"
    );
    assert!(said.contains("3 | Sphere 1 \"m\" Mesh \"gone.obj\" \"m\"\n  |                   ^^^^^^^^^^"), "{said}");
}

#[test]
fn files_that_cannot_be_used_are_told_where_they_are_named() {
    let folder =
        Folder::new(&[("inner/wood.png", "no image"), ("out.obj", TRIANGLE), ("inner/bad.obj", "v 0 0 x\nf 1 1 1\n")]);
    folder.write("inner/flat.obj", "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n");
    let said = |text: &str| {
        folder.write("inner/a.toml", format!("tison = 1\n{text}"));
        folder.bad("inner/a.toml")
    };
    let image = said("[material.w]\ntexture = 'wood.png'\n[[object]]\nshape = 'cube'\nmaterial = 'w'");
    let want = "\
error: the image inner/wood.png is no PNG, JPEG, BMP, HDR or PNM image
 --> inner/a.toml:3:11
  |
3 | texture = 'wood.png'
  |           ^^^^^^^^^^
";
    assert_eq!(image, want);
    let outside = said("[[object]]\nmesh = '../out.obj'");
    assert!(outside.contains("out.obj is outside of inner") && outside.contains("--allow-path"), "{outside}");
    assert!(outside.contains("3 | mesh = '../out.obj'\n  |        ^^^^^^^^^^^^"), "{outside}");
    folder.load_with("inner/a.toml", |o| o.allow = vec![folder.path("")]).expect("allowed");
    assert_eq!(said("[[object]]\nmesh = 'bad.obj'"), "inner/bad.obj:1:7: 'x' is not a number");
    assert!(said("[[object]]\nmesh = 'flat.obj'").starts_with("inner/flat.obj: none of its 1 triangles can be hit"));
}

#[test]
fn what_cannot_be_placed_is_told_with_its_name() {
    // Each step can be undone, all of them together not.
    let lean = "{ matrix = [1,1,0,0, 0,1e-11,0,0, 0,0,1,0, 0,0,0,1] }";
    let object =
        |what: &str| format!("[[object]]\nname = 'thin'\n{what}\ntransform = [{lean}, {{ fit = 1 }}, {lean}]\n");
    let folder = Folder::new(&[("a.obj", TRIANGLE)]);
    folder.write("a.toml", format!("tison = 1\n{}{}", object("shape = 'cylinder'"), object("mesh = 'a.obj'")));
    let said = folder.bad("a.toml");
    assert!(said.contains("error: object `thin`: the transform is singular"), "{said}");
    assert!(said.contains("6 | [[object]]\n  | ^^^^^^^^^^"), "the mesh:\n{said}");
    let huge = "[[object]]\nname = 'huge'\nshape = 'cube'\nhalf = 1e300\ntransform = { scale = 1e90 }";
    folder.write("b.toml", format!("tison = 1\n{huge}"));
    assert!(folder.bad("b.toml").starts_with("error: object `huge` reaches further than numbers do\n --> b.toml:2:1"));
}

#[test]
fn sizes_at_the_edge_of_numbers_are_taken_or_refused() {
    let sphere = |size: f64| format!("shape = 'sphere'\nradius = {size:e}");
    let cylinder = |size: f64| format!("shape = 'cylinder'\ntransform = {{ scale = {size:e} }}");
    let mesh = |size: f64| format!("mesh = 'a.obj'\ntransform = {{ scale = {size:e} }}");
    let fitted = |size: f64| format!("mesh = 'a.obj'\ntransform = {{ fit = {size:e} }}");
    let all: [(&dyn Fn(f64) -> String, i32); 4] = [(&sphere, 290), (&cylinder, 90), (&mesh, 90), (&fitted, 290)];
    for (object, most) in all {
        for exponent in [-most, -40, 40, most] {
            let object = object(10f64.powi(exponent));
            let text = format!("[light.l]\nposition = [0, 0, 1]\n[[object]]\n{object}");
            let loaded = scene(&text, &[("a.obj", TRIANGLE)]);
            let size = loaded.scene.local_bounds().size().max_element();
            assert!((0.25..=4.0).contains(&size), "{object}: {size}");
            assert!(loaded.scene.lights[0].falloff.is_some_and(|f| f.is_finite() && f > 0.0));
        }
    }
}

#[test]
fn which_files_are_scenes() {
    let folder = Folder::new(&[
        ("a.scn", "x"),
        ("a.tmol", "tison = 1"),
        ("plain", "v"),
        ("A.OBJ", TRIANGLE),
        ("B.TOML", "tison = 1"),
    ]);
    assert!(folder.bad("a.scn").contains("the format of .scn scenes is lost"));
    assert!(folder.bad("a.tmol").contains("did you mean `toml`?"));
    assert!(folder.bad("plain").contains("without an extension"));
    assert!(folder.bad("none.toml").starts_with("cannot read none.toml"));
    assert!(matches!(folder.load_with("", |_| {}), Err(Error::NotAFile { .. })));
    assert!(folder.good("A.OBJ").render == Default::default() && folder.good("B.TOML").scene.objects.is_empty());
}

#[test]
fn options_reach_the_reader() {
    let folder = Folder::new(&[("a.obj", TRIANGLE), ("b.obj", BOX)]);
    folder.write(
        "a.toml",
        "tison = 1\n[[object]]\nmesh = 'a.obj'\n[[object]]\nmesh = 'b.obj'\n[[object]]\nshape = 'sphere'",
    );
    let set = |text: &str| vec![text.into()];
    let loaded = folder.load_with("a.toml", |o| (o.overrides, o.smooth) = (set("object.2.radius=3"), Some(30.0)));
    let loaded = loaded.expect("it is good");
    assert_eq!(loaded.scene.bounds().lo, DVec3::splat(-3.0));
    assert!(mesh(&loaded, 0).data.normals.is_some());
    // Bytes of both files, twice each.
    let told = Mutex::new(Vec::new());
    let tell = |done, total| told.lock().expect("nothing panics here").push((done, total));
    let tell: &(dyn Fn(u64, u64) + Sync) = &tell;
    let stop = AtomicBool::new(false);
    let options = LoadOptions {
        reader: Reader::Own,
        exact: false,
        smooth: None,
        allow: vec![],
        overrides: vec![],
        cancel: &stop,
        progress: Some(tell),
    };
    load(&folder.path("a.toml"), &options).expect("it is good");
    let total = 2 * (TRIANGLE.len() + BOX.len()) as u64;
    let told = told.lock().expect("nothing panics here");
    assert!(told.iter().all(|&(done, of)| of == total && done <= of) && told.is_sorted());
    assert_eq!(told.last(), Some(&(total, total)));
    stop.store(true, Relaxed);
    assert!(matches!(load(&folder.path("a.toml"), &options), Err(Error::Cancelled)));
}

#[test]
fn absorption_counts_in_scene_units() {
    let text = "[material.ink]\nabsorption = [1, 2, 0.5]\nrefract = 1\n[[object]]\nshape = 'sphere'\nradius = 7\nmaterial = 'ink'";
    assert_eq!(scene(text, &[]).scene.materials[0].absorption, Vec3::new(8.0, 16.0, 4.0));
}
