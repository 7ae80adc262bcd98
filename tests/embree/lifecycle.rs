//! Handles, memory, and every way in which no scene comes to be.

use crate::{OneByOne, Set, blob, build, device, grid, panic_of, rays};
use glam::Vec3;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};
use tison::embree::{Device, DeviceConfig, Error, Scene, SceneBuilder, SceneOptions};
use tison::geom::{Bounds, Faults, Ray, TriangleMesh};

#[test]
fn a_scene_outlives_all_that_it_was_built_from() {
    let scene = build(&device(), grid(4), SceneOptions::default());
    let hit = scene.intersect(&Ray::new(Vec3::new(1.3, 1.2, -1.0), Vec3::Z)).unwrap();
    assert_eq!((hit.geom_id, hit.prim_id), (0, 10));
    assert!((hit.t - 1.0).abs() < 1e-6, "{}", hit.t);
}

#[test]
fn a_device_tells_what_it_is() {
    let device = device();
    assert!(device.version().starts_with("4."), "{}", device.version());
    assert!([1, 4, 8, 16].contains(&device.packet_width()));
    assert_eq!((device.memory_live(), device.memory_peak()), (0, 0));
    let narrow = Device::new(&DeviceConfig { isa: Some("sse2"), ..Default::default() }).unwrap();
    assert_eq!(narrow.packet_width(), 4);
}

#[test]
fn a_wrong_configuration_is_an_error_that_says_what_is_right() {
    let error = Device::new(&DeviceConfig { isa: Some("avx3"), ..Default::default() }).unwrap_err();
    assert!(matches!(error, Error::Isa { .. }));
    assert!(error.to_string().contains("'avx3'") && error.to_string().contains("avx2"), "{error}");
}

struct Counted(Arc<AtomicUsize>);

impl Drop for Counted {
    fn drop(&mut self) {
        self.0.fetch_add(1, Relaxed);
    }
}

impl OneByOne for Counted {
    fn len(&self) -> u32 {
        3
    }
    fn bounds(&self, _: u32) -> Bounds {
        Bounds { lo: glam::DVec3::NEG_ONE, hi: glam::DVec3::ONE }
    }
    fn hit(&self, _: u32, _: &Ray) -> Option<f64> {
        None
    }
}

#[test]
fn each_set_of_shapes_is_dropped_once_and_after_its_scene() {
    let drops = Arc::new(AtomicUsize::new(0));
    let device = device();
    let mut builder = SceneBuilder::new(&device, SceneOptions::default()).unwrap();
    for id in 0..4 {
        assert_eq!(builder.shapes(Arc::new(Set(Counted(drops.clone())))).unwrap(), id);
    }
    let scene = builder.commit(None).unwrap();
    for ray in rays(50) {
        assert_eq!(scene.intersect(&ray), None);
    }
    drop(device);
    assert_eq!(drops.load(Relaxed), 0);
    drop(scene);
    assert_eq!(drops.load(Relaxed), 4);
}

#[test]
fn a_builder_that_is_dropped_drops_its_shapes() {
    let drops = Arc::new(AtomicUsize::new(0));
    let mut builder = SceneBuilder::new(&device(), SceneOptions::default()).unwrap();
    builder.shapes(Arc::new(Set(Counted(drops.clone())))).unwrap();
    drop(builder);
    assert_eq!(drops.load(Relaxed), 1);
}

#[test]
fn a_mesh_is_shared_and_its_memory_is_not_counted() {
    let device = device();
    let mesh = Arc::new(grid(64));
    let mut builder = SceneBuilder::new(&device, SceneOptions::default()).unwrap();
    for id in 0..2 {
        assert_eq!(builder.mesh(mesh.clone()).unwrap(), id);
    }
    assert_eq!(Arc::strong_count(&mesh), 3);
    assert!(device.memory_live() < mesh.bytes() as u64, "{} bytes", device.memory_live());
    let scene = builder.commit(None).unwrap();
    assert!(device.memory_live() > 0);
    assert!(device.memory_peak() >= device.memory_live());
    drop(scene);
    assert_eq!(Arc::strong_count(&mesh), 1);
    assert_eq!(device.memory_live(), 0);
}

#[test]
fn neither_corners_nor_indices_are_copied() {
    // Many corners that no triangle has, and many triangles without area: the hierarchy has two triangles.
    let few = grid(1);
    let mut points = few.padded_points()[..12].to_vec();
    points.resize(3_000_000, 0.5);
    let mut faces = few.faces().to_vec();
    faces.resize(300_000, [0, 1, 1]);
    let mesh = Arc::new(TriangleMesh::new(points, faces));
    let indices = size_of_val(mesh.faces()) as u64;
    assert!(mesh.bytes() as u64 - indices >= 12_000_000 && indices == 3_600_000);
    for quality in crate::rays::QUALITIES {
        let device = device();
        let mut builder = SceneBuilder::new(&device, SceneOptions { quality, ..SceneOptions::default() }).unwrap();
        builder.mesh(mesh.clone()).unwrap();
        let scene = builder.commit(None).unwrap();
        assert!(scene.occluded(&Ray::new(Vec3::new(0.3, 0.2, -1.0), Vec3::Z)));
        // Low quality keeps eight bytes of its own for each.
        assert!(device.memory_live() < indices, "{quality:?}: {} bytes", device.memory_live());
    }
}

#[test]
fn a_build_over_the_limit_is_an_error_and_the_device_lives_on() {
    let limit = 1 << 20;
    let device = Device::new(&DeviceConfig { threads: 2, memory_limit: Some(limit), ..Default::default() }).unwrap();
    for _ in 0..3 {
        let mut builder = SceneBuilder::new(&device, SceneOptions::default()).unwrap();
        builder.mesh(Arc::new(grid(200))).unwrap();
        let error = builder.commit(None).expect_err("80,000 triangles do not fit into 1 MiB");
        match error {
            Error::OverBudget { needed, limit: said } => assert!(needed > limit && said == limit, "{needed}"),
            other => panic!("{other:?}"),
        }
        assert!(error.to_string().contains("raise the memory limit"), "{error}");
        assert_eq!(device.memory_live(), 0, "what the build had taken is given back");
        assert!(device.memory_peak() <= limit);
    }
    let scene = build(&device, grid(8), SceneOptions::default());
    assert!(scene.occluded(&Ray::new(Vec3::new(1.3, 1.2, -1.0), Vec3::Z)));
}

#[test]
fn the_progress_callback_sees_the_build_and_can_stop_it() {
    let device = device();
    let builder = || {
        let mut builder = SceneBuilder::new(&device, SceneOptions::default()).unwrap();
        builder.mesh(Arc::new(blob(100))).unwrap();
        builder
    };
    let calls = AtomicUsize::new(0);
    let scene = builder().commit(Some(&|_| calls.fetch_add(1, Relaxed) < usize::MAX)).unwrap();
    assert!(calls.load(Relaxed) > 0);
    assert!(scene.occluded(&Ray::new(3.0 * Vec3::X, -Vec3::X)));

    let asked = AtomicUsize::new(0);
    let error = builder()
        .commit(Some(&|_| {
            asked.fetch_add(1, Relaxed);
            false
        }))
        .expect_err("it was told to stop");
    assert!(matches!(error, Error::Cancelled), "{error:?}");
    assert!(asked.load(Relaxed) >= 1);
    drop(scene);
    assert_eq!(device.memory_live(), 0);
    assert!(builder().commit(None).is_ok(), "the next build is not cancelled");
}

#[test]
fn a_panic_of_the_progress_callback_comes_out_of_commit() {
    let device = device();
    let mut builder = SceneBuilder::new(&device, SceneOptions::default()).unwrap();
    builder.mesh(Arc::new(blob(40))).unwrap();
    let said = panic_of(|| drop(builder.commit(Some(&|_| panic!("no more coffee")))));
    assert_eq!(said, "no more coffee");
    assert_eq!(device.memory_live(), 0);
    build(&device, grid(2), SceneOptions::default());
}

#[test]
fn threads_that_build_on_one_device_do_not_take_each_others_errors() {
    let device = device();
    std::thread::scope(|scope| {
        for stop in [true, false, true, false] {
            let device = &device;
            scope.spawn(move || {
                for _ in 0..5 {
                    let mut builder = SceneBuilder::new(device, SceneOptions::default()).unwrap();
                    builder.mesh(Arc::new(blob(30))).unwrap();
                    let built = builder.commit(Some(&|_| !stop));
                    assert_eq!(built.is_err(), stop, "{built:?}");
                }
            });
        }
    });
    assert_eq!(device.memory_live(), 0);
}

#[test]
fn an_empty_scene_and_an_empty_mesh_answer_with_misses() {
    let device = device();
    let empty = SceneBuilder::new(&device, SceneOptions::default()).unwrap().commit(None).unwrap();
    let hollow = build(&device, TriangleMesh::new(vec![], vec![]), SceneOptions::default());
    for ray in rays(20) {
        assert_eq!((empty.intersect(&ray), hollow.intersect(&ray)), (None, None));
        assert!(!empty.occluded(&ray) && !hollow.occluded(&ray));
    }
}

#[test]
fn bad_triangles_are_never_hit_and_their_neighbours_keep_their_numbers() {
    let good = grid(3);
    let (mut points, mut faces) = (good.padded_points()[..48].to_vec(), good.faces().to_vec());
    let first = (points.len() / 3) as u32;
    points.extend([f32::NAN, 1.0, 0.0, 1.0, f32::INFINITY, 0.0, 1.0, 1.0, 3e18]);
    faces[2][1] = first; // NaN
    faces[5][0] = first + 1; // infinite
    faces[7][2] = first + 2; // beyond what Embree takes
    faces[11][2] = 4_000_000_000; // no such vertex
    faces[16][1] = faces[16][0]; // no area
    let mesh = TriangleMesh::new(points, faces);
    assert_eq!(mesh.faults(), Faults { non_finite: 3, out_of_range: 1, degenerate: 1 });

    let bad = [2, 5, 7, 11, 16];
    for quality in crate::rays::QUALITIES {
        let mesh = TriangleMesh::new(mesh.padded_points().to_vec(), mesh.faces().to_vec());
        let scene = build(&device(), mesh, SceneOptions { quality, ..Default::default() });
        for prim in 0..18 {
            let (square, upper) = (prim / 2, prim % 2);
            let corner = Vec3::new((square % 3) as f32, (square / 3) as f32, 2.0);
            let ray = Ray::new(corner + [0.25, 0.7][upper as usize] * Vec3::new(1.0, 1.0, 0.0), -Vec3::Z);
            let want = (!bad.contains(&prim)).then_some(prim);
            assert_eq!(scene.intersect(&ray).map(|hit| hit.prim_id), want, "{quality:?}");
            assert_eq!(scene.occluded(&ray), want.is_some());
        }
    }
}

#[test]
fn handles_may_cross_threads() {
    fn crosses<T: Send + Sync>() {}
    crosses::<Device>();
    crosses::<SceneBuilder>();
    crosses::<Scene>();
    crosses::<Error>();
}
