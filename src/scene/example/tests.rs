use std::collections::HashMap;
use std::io::BufReader;
use std::path::PathBuf;

use glam::DVec3;

use super::*;

fn mesh(triangles: u64) -> (MeshCounts, String) {
    let mut text = Vec::new();
    let counts = write_mesh(triangles, &mut text).unwrap();
    (counts, String::from_utf8(text).unwrap())
}

/// Positions, normals and the corners of each polygon, as tobj reads them.
struct Parsed {
    points: Vec<DVec3>,
    normals: Vec<DVec3>,
    faces: Vec<[u32; 3]>,
    models: Vec<tobj::Model>,
}

fn parse(text: &str) -> Parsed {
    let options = tobj::LoadOptions { triangulate: true, ..Default::default() };
    let no_materials = |_: &std::path::Path| Ok((Vec::new(), Default::default()));
    let (models, _) = tobj::load_obj_buf(&mut BufReader::new(text.as_bytes()), &options, no_materials).unwrap();
    let mesh = &models[0].mesh;
    assert!(mesh.normal_indices == mesh.indices || mesh.normals.is_empty());
    let vectors = |all: &[f64]| all.chunks_exact(3).map(DVec3::from_slice).collect();
    let faces = mesh.indices.chunks_exact(3).map(|f| [f[0], f[1], f[2]]).collect();
    Parsed { points: vectors(&mesh.positions), normals: vectors(&mesh.normals), faces, models }
}

/// That each edge is walked once each way, and V - E + F = 2.
fn assert_closed(faces: &[[u32; 3]], vertices: usize) {
    let mut walks: HashMap<[u32; 2], i32> = HashMap::new();
    for &[a, b, c] in faces {
        for [from, to] in [[a, b], [b, c], [c, a]] {
            assert_ne!(from, to);
            assert!(walks.insert([from, to], 1).is_none(), "edge {from}-{to} is walked twice the same way");
        }
    }
    for [from, to] in walks.keys() {
        assert!(walks.contains_key(&[*to, *from]), "edge {from}-{to} has one face");
    }
    assert_eq!(vertices as i64 - walks.len() as i64 / 2 + faces.len() as i64, 2);
}

#[test]
fn the_nearest_frequency_is_taken() {
    let cases = [
        ("nothing", 0, 20),
        ("below the least", 19, 20),
        ("the least", 20, 20),
        ("midway goes down", 50, 20),
        ("just above midway", 51, 80),
        ("exact", 80, 80),
        ("a million", 1_000_000, 1_003_520),
        ("five million", 5_000_000, 5_000_000),
        ("ten to the nine", 1_000_000_000, 999_980_820),
        ("the most", 8_589_683_520, 8_589_683_520),
    ];
    for (name, asked, want) in cases {
        let counts = Geodesic::nearest(asked).unwrap().counts();
        assert_eq!(counts.triangles, want, "{name}");
        assert_eq!(counts.vertices, want / 2 + 2, "{name}");
    }
}

#[test]
fn too_many_are_refused_before_a_byte_is_written() {
    // Midway to the next frequency, which needs more than 32 bits.
    for triangles in [8_590_098_011, 8_600_000_000, u64::MAX] {
        let mut text = Vec::new();
        let error = write_mesh(triangles, &mut text).unwrap_err();
        assert_eq!(error.kind(), io::ErrorKind::InvalidInput);
        assert!(error.to_string().contains("at most 8589683520"), "{error}");
        assert!(text.is_empty());
    }
    assert!(Geodesic::nearest(8_590_098_010).is_some());
}

#[test]
fn the_ball_is_closed_and_faces_outward() {
    for triangles in [20, 80, 180, 320, 2_000, 50_000] {
        let (counts, text) = mesh(triangles);
        let Parsed { points, normals, faces, .. } = parse(&text);
        assert_eq!(counts, MeshCounts { vertices: points.len() as u64, triangles: faces.len() as u64 });
        assert_eq!(normals.len(), points.len());
        assert_closed(&faces, points.len());
        for [a, b, c] in faces.iter().map(|face| face.map(|id| points[id as usize])) {
            // The surface is a graph over the sphere, so every triangle sees the origin from its back.
            assert!(a.dot(b.cross(c)) > 0.0, "{triangles}: {a} {b} {c}");
        }
        assert!(normals.iter().all(|n| (n.length() - 1.0).abs() < 2e-6));
        assert!(normals.iter().zip(&points).all(|(n, p)| n.dot(*p) > 0.0));
    }
}

#[test]
fn vertices_are_numbered_once_up_to_the_largest_grid() {
    // A small grid in full: every number is used. A large one by samples: neighbours are one edge apart.
    let grid = Geodesic::new(9);
    let mut used = vec![false; grid.counts().vertices as usize];
    (0..grid.counts().triangles).flat_map(|t| grid.triangle(t)).for_each(|id| used[id as usize] = true);
    assert!(used.iter().all(|u| *u));

    let grid = Geodesic::new(Geodesic::MAX_FREQUENCY);
    let MeshCounts { vertices, triangles } = grid.counts();
    assert!(vertices <= u64::from(u32::MAX));
    for t in (0..triangles).step_by(19_999_999).chain([triangles - 1]) {
        let corners = grid.triangle(t);
        assert!(corners.iter().all(|id| *id < vertices));
        let [a, b, c] = corners.map(|id| grid.direction(id));
        let edge = 1.1 / Geodesic::MAX_FREQUENCY as f64;
        for (p, q) in [(a, b), (b, c), (c, a)] {
            assert!((0.5 * edge..1.5 * edge).contains(&p.distance(q)), "triangle {t}: {corners:?}");
        }
        assert!(a.dot((b - a).cross(c - a)) > 0.0, "triangle {t}");
    }
}

#[test]
fn normals_follow_the_faces() {
    let grid = Geodesic::new(1024);
    let rock = Rock::new(grid.frequency());
    let mut angles: Vec<f64> = (0..grid.counts().triangles)
        .step_by(211)
        .map(|t| {
            let corners = grid.triangle(t).map(|id| grid.direction(id));
            let [a, b, c] = corners.map(|p| rock.point(p));
            let face = (b - a).cross(c - a).normalize();
            corners.iter().map(|p| rock.normal(*p).angle_between(face).to_degrees()).fold(0.0, f64::max)
        })
        .collect();
    angles.sort_by(f64::total_cmp);
    // Walls of cracks bend within a few edges; everything else is nearly flat at this size.
    let [median, most_of_all, worst] = [0.5, 0.99, 1.0].map(|part| angles[((angles.len() - 1) as f64 * part) as usize]);
    assert!(median < 2.0 && most_of_all < 12.0 && worst < 60.0, "{median}, {most_of_all}, {worst} degrees");
}

#[test]
fn bytes_do_not_depend_on_the_threads() {
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| mesh(200_000).1)
    };
    let one = with(1);
    assert!(one == with(5) && one == mesh(200_000).1);
    // More lines than one batch of one thread, so that batches follow each other.
    assert!(one.lines().filter(|l| l.starts_with("f ")).count() as u64 > 4 * CHUNK);
}

#[test]
fn the_head_says_what_it_became() {
    let (counts, text) = mesh(100);
    assert_eq!(counts, MeshCounts { vertices: 42, triangles: 80 });
    assert!(text.contains("\n# 80 triangles (asked for 100), 42 vertices with normals\n"), "{text}");
    assert_eq!(text.lines().filter(|l| l.starts_with("v ")).count(), 42);
    assert_eq!(text.lines().filter(|l| l.starts_with("vn ")).count(), 42);
    assert_eq!(text.lines().filter(|l| l.starts_with("f ")).count(), 80);
}

#[test]
fn a_failing_writer_ends_the_work() {
    struct Full(usize);
    impl Write for Full {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            self.0 = self.0.checked_sub(bytes.len()).ok_or(io::ErrorKind::StorageFull)?;
            Ok(bytes.len())
        }
        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }
    for room in [0, 1_000, 3_000_000] {
        let error = write_mesh(200_000, &mut Full(room)).unwrap_err();
        assert_eq!(error.kind(), io::ErrorKind::StorageFull, "{room}");
    }
}

/// Writes the committed scene anew with `TISON_BLESS=1 cargo test --lib the_committed_ember`.
#[test]
fn the_committed_ember_is_what_the_generator_writes() {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("scenes/ember.obj");
    let mut text = Vec::new();
    write_ember_scene(&mut text).unwrap();
    if std::env::var_os("TISON_BLESS").is_some() {
        std::fs::write(&path, &text).unwrap();
    }
    let committed = std::fs::read(&path).unwrap();
    assert!(committed == text, "scenes/ember.obj differs; TISON_BLESS=1 cargo test --lib the_committed_ember");
    assert!(text.len() < 1_200_000, "{} bytes", text.len());
}

#[test]
fn the_ember_scene_uses_what_a_reader_must_know() {
    let mut text = Vec::new();
    write_ember_scene(&mut text).unwrap();
    let text = String::from_utf8(text).unwrap();
    let mut materials = Vec::new();
    write_ember_materials(&mut materials).unwrap();
    let materials = String::from_utf8(materials).unwrap();

    let defined: Vec<_> = materials.lines().filter_map(|l| l.strip_prefix("newmtl ")).collect();
    let mut used: Vec<_> = text.lines().filter_map(|l| l.strip_prefix("usemtl ")).collect();
    used.dedup();
    assert_eq!(defined, used);
    for line in materials.lines().filter(|l| l.starts_with("Kd ")) {
        assert!(line.split(' ').skip(1).all(|c| c.parse::<f64>().unwrap() < 0.9), "{line}");
    }
    let corners = |l: &str| l.split(' ').count() - 1;
    let polygons = |n| text.lines().filter(|l| l.starts_with("f ") && corners(l) == n).count();
    assert_eq!((polygons(4), polygons(5)), (5, 2));
    assert!(text.lines().any(|l| l.starts_with("f -10 -9")));

    let parsed = parse(&text);
    let names: Vec<_> = parsed.models.iter().map(|m| m.name.as_str()).collect();
    assert_eq!(names, ["crust", "hot", "glow", "copper", "glaze", "slab"]);
    let triangles: Vec<_> = parsed.models.iter().map(|m| m.mesh.indices.len() / 3).collect();
    assert_eq!(triangles[..3].iter().sum::<usize>(), 13_520);
    assert!(triangles[..3].iter().all(|n| *n > 500), "{triangles:?}");
    assert_eq!(triangles[5], 2 * 3 + 5 * 2);
}

#[test]
fn no_normal_of_the_ember_turns_from_its_triangle() {
    let mut text = Vec::new();
    write_ember_scene(&mut text).unwrap();
    let text = String::from_utf8(text).unwrap();
    // Up to the second object all numbering is the ember's own.
    let (ember, _) = text.split_once("o copper").unwrap();
    let one_group: String =
        ember.lines().filter(|l| !l.starts_with("usemtl") && !l.starts_with("g ")).map(|l| format!("{l}\n")).collect();
    let Parsed { points, normals, faces, .. } = parse(&one_group);
    assert_closed(&faces, points.len());
    for face in faces.iter().map(|face| face.map(|id| id as usize)) {
        let [a, b, c] = face.map(|id| points[id]);
        let flat = (b - a).cross(c - a);
        assert!(face.iter().all(|&id| flat.dot(normals[id]) > 0.0), "{face:?}");
    }
}

#[test]
fn the_first_scene_has_one_of_each_and_nothing_odd() {
    use crate::scene::desc::ShapeDesc;
    use crate::scene::format::{ReadOptions, parse};
    let path = std::path::Path::new("scene.toml");
    let (scene, warnings) = parse(path, FIRST_SCENE.as_bytes(), &ReadOptions::default()).expect("it is right");
    assert!(warnings.is_empty(), "{warnings:?}");
    let has = |f: fn(&ShapeDesc) -> bool| scene.objects.iter().any(|o| f(&o.shape));
    assert!(has(|s| matches!(s, ShapeDesc::Sphere { .. })) && has(|s| matches!(s, ShapeDesc::Cube { .. })));
    assert!(has(|s| matches!(s, ShapeDesc::Cylinder { .. })) && has(|s| matches!(s, ShapeDesc::Quad { .. })));
    assert!(scene.cameras[0].camera.aperture > 0.0 && scene.lights.iter().any(|l| l.radius > 0.0));
    assert!(scene.materials.iter().all(|m| scene.objects.iter().any(|o| o.material.as_ref() == Some(&m.name))));
}

#[test]
fn the_mesh_in_memory_is_the_one_written() {
    let (counts, text) = mesh(2_000);
    let Parsed { points, faces, .. } = parse(&text);
    let made = super::mesh(2_000, Surface::Rock);
    assert_eq!((made.vertex_count() as u64, made.face_count() as u64), (counts.vertices, counts.triangles));
    assert_eq!(made.faults().total(), 0);
    // Readers may number the points as they come.
    for (made_face, face) in made.faces().iter().zip(&faces) {
        for (a, b) in made_face.map(|i| made.point(i)).iter().zip(face.map(|i| points[i as usize])) {
            assert!((a.as_dvec3() - b).length() < 2e-6, "{a} for {b}");
        }
    }
    let round = super::mesh(2_000, Surface::Round);
    assert_eq!(round.faces(), made.faces());
    assert!((0..round.vertex_count() as u32).all(|i| (round.point(i).length() - 1.0).abs() < 2e-7));
}
