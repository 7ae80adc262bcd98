//! The rest of a scene, and files that are at fault.

use crate::kit::*;
use glam::{DVec3, Vec3};
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use tison::scene::{Error, LoadOptions, load};

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
    let options = LoadOptions { progress: Some(tell), ..LoadOptions::new(&stop) };
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
