//! Cameras of hand-made scenes.

use super::*;
use crate::cli::plan::tests::{plan, plan_ok};
use tison::geom::TriangleMesh;
use tison::scene::desc::RenderDesc;
use tison::scene::{Mesh, Object, Scene, Unused};

const MAIN: CameraDesc = CameraDesc {
    eye: DVec3::new(0.0, 2.0, 8.0),
    target: DVec3::new(0.0, 1.0, 0.0),
    up: DVec3::new(0.0, 1.0, 1.0),
    projection: Projection::Perspective { fov_deg: 30.0 },
    aperture: 0.5,
    focus: Some(6.0),
    aspect: Some(1.25),
    clip: Some((1.0, 50.0)),
};

const FLAT: CameraDesc = CameraDesc {
    projection: Projection::Orthographic { height: 3.0 },
    aperture: 0.0,
    focus: None,
    aspect: None,
    clip: None,
    ..MAIN
};

/// One triangle, seen by `cameras`, for an image of 640x512.
fn loaded(cameras: &[(&str, CameraDesc)]) -> Loaded {
    let triangles = TriangleMesh::new(vec![0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0], vec![[0, 1, 2]]);
    let scene = Scene::of(vec![Object::Mesh(Mesh::bare(triangles))]);
    let cameras = cameras.iter().map(|&(name, camera)| NamedCamera { name: name.into(), camera }).collect();
    let render = RenderDesc { size: Some((640, 512)), ..RenderDesc::default() };
    Loaded {
        scene,
        render,
        cameras,
        diagnostics: vec![],
        warnings: vec![],
        unused: Unused::default(),
        files: vec![],
        texture_seconds: 0.0,
    }
}

fn try_choose(flags: &str, loaded: &Loaded) -> Result<Chosen, Failure> {
    let plan = plan_ok(flags);
    choose(&plan, loaded, &Settings::new(&plan, &loaded.render).unwrap())
}

fn chosen(flags: &str, loaded: &Loaded) -> CameraDesc {
    try_choose(flags, loaded).unwrap_or_else(|f| panic!("{flags}: {f:?}")).camera
}

fn refused(flags: &str, loaded: &Loaded) -> String {
    let failure = try_choose(flags, loaded).expect_err(flags);
    assert_eq!(failure.exit, Exit::Usage, "{flags}");
    format!("{} {}", failure.what, failure.help.unwrap_or_default())
}

#[test]
fn cameras_of_a_scene_go_by_name_and_the_first_is_the_default() {
    let scene = loaded(&[("main", MAIN), ("flat", FLAT)]);
    assert_eq!(chosen("a.toml", &scene), MAIN);
    assert_eq!(chosen("a.toml --camera main", &scene), MAIN);
    assert_eq!(chosen("a.toml --camera flat", &scene), FLAT);
    let said = refused("a.toml --camera mian", &scene);
    assert!(said.contains("a.toml has main, flat") && said.contains("did you mean 'main'?"), "{said}");
    assert!(refused("a.toml --camera front", &scene).contains("main, flat"), "a view is no camera of the file");
}

#[test]
fn flags_change_parts_of_the_camera_and_leave_the_rest() {
    let scene = loaded(&[("main", MAIN), ("flat", FLAT)]);
    let (x, orthographic) = (DVec3::X, Projection::Orthographic { height: 2.0 });
    let perspective = Projection::Perspective { fov_deg: 50.0 };
    let cases = [
        ("--eye 1,0,0", CameraDesc { eye: x, ..MAIN }),
        ("--target 1,0,0", CameraDesc { target: x, ..MAIN }),
        ("--up 1,0,0", CameraDesc { up: x, ..MAIN }),
        ("--fov 50", CameraDesc { projection: perspective, ..MAIN }),
        ("--ortho 2", CameraDesc { projection: orthographic, ..MAIN }),
        ("--camera flat --ortho 2", CameraDesc { projection: orthographic, ..FLAT }),
        ("--camera flat --fov 50", CameraDesc { projection: perspective, ..FLAT }),
        ("--camera main --eye 1,0,0", CameraDesc { eye: x, ..MAIN }),
        ("--aperture 0", CameraDesc { aperture: 0.0, ..MAIN }),
        ("--focus 3", CameraDesc { focus: Some(3.0), ..MAIN }),
        ("--camera flat --aperture 2 --focus 3", CameraDesc { aperture: 2.0, focus: Some(3.0), ..FLAT }),
    ];
    for (flags, want) in cases {
        assert_eq!(chosen(&format!("a.toml {flags}"), &scene), want, "{flags}");
    }
    assert!(refused("a.toml --camera flat --focus 3", &scene).contains("--aperture"));
    assert!(refused("a.toml --eye 0,1,0", &scene).contains("same point"));
}

#[test]
fn pixels_keep_the_shape_that_the_scene_gives_them() {
    let scene = loaded(&[("main", MAIN)]);
    let aspect = |flags: &str| chosen(flags, &scene).aspect;
    assert_eq!(aspect("a.toml --size 320x256"), Some(1.25));
    assert_eq!(aspect("a.toml --scale 25%"), Some(1.25));
    assert_eq!(aspect("a.toml --crop 0,0,64,64"), Some(1.25));
    assert_eq!(aspect("a.toml --size 1280x512"), Some(2.5));
    let silent = Loaded { render: RenderDesc::default(), ..loaded(&[("main", MAIN)]) };
    assert_eq!(chosen("a.toml --size 10x1", &silent).aspect, Some(1.25), "the scene was written for any size");
    assert_eq!(chosen("a.toml --size 1280x512", &scene).clip, MAIN.clip);
}

#[test]
fn a_scene_without_cameras_is_framed_as_a_mesh_is() {
    let scene = loaded(&[]);
    let from = |flags: &str| {
        let c = chosen(&format!("a.toml {flags}"), &scene);
        (c.eye - c.target).normalize()
    };
    assert!(from("--camera front").abs_diff_eq(DVec3::Z, 1e-12));
    assert!(from("--camera top").abs_diff_eq(DVec3::Y, 1e-12));
    assert_eq!(from(""), from("--camera three-quarter"));
    assert!(refused("a.toml --camera fornt", &scene).contains("did you mean 'front'?"));
    assert!(refused("a.toml --camera front --eye 1,2,3", &scene).contains("--eye"));
    assert_eq!(chosen("a.toml --eye 1,2,3", &scene).eye, DVec3::new(1.0, 2.0, 3.0));
    let nothing = Loaded { scene: Scene { objects: vec![], ..scene.scene }, ..loaded(&[]) };
    assert_eq!(try_choose("a.toml", &nothing).unwrap_err().exit, Exit::Input);
}

#[test]
fn a_turntable_keeps_the_scenes_camera_and_turns_around_its_up() {
    let scene = loaded(&[("main", MAIN)]);
    let c = try_choose("a.toml --turntable 4", &scene).unwrap();
    assert_eq!((c.camera, c.axis), (MAIN, MAIN.up));
    let c = try_choose("a.toml --turntable 4 --up 1,0,0", &scene).unwrap();
    assert_eq!(c.axis, DVec3::X);
    let framed = try_choose("a.toml --turntable 4", &loaded(&[])).unwrap();
    assert_eq!(framed.axis, DVec3::Y);
    assert!(framed.camera.eye != chosen("a.toml", &loaded(&[])).eye, "further off, to fit from all sides");
}

#[test]
fn every_part_tells_where_it_comes_from() {
    let scene = loaded(&[("main", MAIN)]);
    let list = try_choose("a.toml --fov 50 -D camera.main.lens.radius=0.5", &scene).unwrap().list;
    let of = |name| list.iter().find(|s| s.name == name).map(|s| (s.value.as_str(), s.origin)).expect(name);
    assert_eq!(of("camera"), ("main", Origin::Scene));
    assert_eq!(of("eye"), ("0,2,8", Origin::Scene));
    assert_eq!(of("fov"), ("50", Origin::Flag));
    assert_eq!(of("aperture"), ("0.5", Origin::Define));
    assert_eq!(of("clip"), ("1,50", Origin::Scene));
    let list = try_choose("a.obj --camera front --up 0,1,0", &loaded(&[])).unwrap().list;
    let of = |name| list.iter().find(|s| s.name == name).map(|s| s.origin).expect(name);
    assert_eq!((of("camera"), of("up"), of("eye")), (Origin::Flag, Origin::Flag, Origin::Default));
}

#[test]
fn a_mesh_is_asked_before_it_is_read() {
    for flags in ["a.obj --camera fornt", "a.obj --camera front --eye 1,2,3", "a.obj --focus 2"] {
        assert!(plan(flags).is_err(), "{flags}");
    }
    for flags in ["a.toml --camera fornt", "a.toml --camera front --eye 1,2,3", "a.toml --focus 2"] {
        assert!(plan(flags).is_ok(), "{flags}: the file may have such a camera");
    }
}
