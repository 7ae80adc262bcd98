//! Reading OBJ files from disk, and a second opinion from tobj.

use glam::{DVec3, Vec3};
use proptest::prelude::*;
use std::fmt::Write as _;
use std::io::Read as _;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use tempfile::TempDir;
use tison::scene::Error;
use tison::scene::obj::{MtlMaterial, ObjFile, ReadOptions, Uv, read};

static GO_ON: AtomicBool = AtomicBool::new(false);

fn options(allow: &[PathBuf]) -> ReadOptions<'_> {
    ReadOptions { allow, ..ReadOptions::all(&GO_ON) }
}

fn load(path: &Path) -> Result<ObjFile, Error> {
    read(path, &options(&[]))
}

const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";

/// A folder with these files in it.
fn folder(files: &[(&str, &str)]) -> TempDir {
    let dir = tempfile::tempdir().expect("a temporary folder can be made");
    for (name, text) in files {
        let path = dir.path().join(name);
        std::fs::create_dir_all(path.parent().expect("it is in the folder")).expect("a folder can be made");
        std::fs::write(path, text).expect("a file can be written");
    }
    dir
}

/// Messages with the folder's name left out.
fn told(dir: &TempDir, file: &ObjFile) -> Vec<String> {
    let real = dir.path().canonicalize().expect("it is there");
    let strip = |s: String| s.replace(&format!("{}/", real.display()), "");
    file.warnings.iter().map(|w| strip(w.to_string()).replace(&format!("{}/", dir.path().display()), "")).collect()
}

#[test]
fn what_is_no_file() {
    let dir = folder(&[("empty.obj", "")]);
    let message = |name: &str| load(&dir.path().join(name)).expect_err("there is no mesh").to_string();
    assert!(message("none.obj").starts_with("cannot read "), "{}", message("none.obj"));
    assert!(matches!(load(&dir.path().join("none.obj")), Err(Error::Read { .. })));
    assert!(matches!(load(dir.path()), Err(Error::NotAFile { .. })));
    assert!(message("empty.obj").ends_with("no renderable faces: the file is empty"));
}

#[cfg(unix)]
#[test]
fn a_pipe_is_read_once() {
    let dir = folder(&[]);
    let pipe = dir.path().join("pipe.obj");
    let made = std::process::Command::new("mkfifo").arg(&pipe).status().expect("mkfifo is part of every Unix");
    assert!(made.success());
    let writer = std::thread::spawn({
        let pipe = pipe.clone();
        move || std::fs::write(pipe, TRIANGLE).expect("a reader is there")
    });
    let file = load(&pipe).expect("the text is fine");
    writer.join().expect("it does not panic");
    assert_eq!(file.faces, [[0, 1, 2]]);
}

#[test]
fn libraries_in_every_spelling() {
    let red = "newmtl red\nKd 1 0 0\nnewmtl unused\n";
    let blue = "\u{feff}newmtl blue\nKd 0 0 1\nnewmtl red\nKd 9 9 9\n";
    let dir = folder(&[("red.mtl", red), ("a b.mtl", blue), ("sub/blue.mtl", blue)]);
    for libraries in [
        "mtllib red.mtl\nmtllib a b.mtl",
        "mtllib red.mtl \"a b.mtl\"",
        "mtllib \"red.mtl\" sub/blue.mtl",
        "mtllib red.mtl sub\\blue.mtl\r",
        "mtllib C:\\models\\red.mtl\nmtllib /nowhere/at/all/a b.mtl\nmtllib red.mtl",
    ] {
        let text =
            format!("{libraries}\n{TRIANGLE}usemtl blue\nf 1 2 3\nusemtl \"red\"\nf 1 2 3\nusemtl blue\nf 1 2 3\n");
        let path = dir.path().join("a.obj");
        std::fs::write(&path, text).expect("a file can be written");
        let file = load(&path).expect("the text is fine");
        let grey = MtlMaterial::default();
        let blue = MtlMaterial { kd: Some([0., 0., 1.]), ..MtlMaterial::named("blue".into()) };
        let red = MtlMaterial { kd: Some([1., 0., 0.]), ..MtlMaterial::named("red".into()) };
        assert_eq!(file.materials, [grey, blue, red], "{libraries}");
        assert_eq!(file.face_materials, Some(vec![0, 1, 2, 1]));
        assert_eq!(file.counts.unused_materials, 1);
    }
}

#[test]
fn missing_libraries_and_materials_are_warnings() {
    let text = format!("mtllib none.mtl\nusemtl a\n{TRIANGLE}usemtl b\nf 1 2 3\n");
    let dir = folder(&[("a.obj", text.as_str())]);
    let file = load(&dir.path().join("a.obj")).expect("it is only grey");
    let names: Vec<_> = file.materials.iter().map(|m| m.name.as_str()).collect();
    assert_eq!(names, ["a", "b"]);
    assert!(file.materials.iter().all(|m| m.kd.is_none()));
    assert_eq!(
        told(&dir, &file),
        [
            "a.obj:1: material library 'none.mtl' is not there: faces are shown in grey",
            "a.obj: material 'a' is not in any library: shown in grey (and 1 more like it)",
        ]
    );
}

#[test]
fn a_library_that_no_face_needs_is_not_read() {
    let dir = folder(&[("a.obj", &format!("mtllib none.mtl\nusemtl a\nusemtl\n{TRIANGLE}"))]);
    let file = load(&dir.path().join("a.obj")).expect("the text is fine");
    assert_eq!(file.materials, [MtlMaterial::default()]);
    assert_eq!(told(&dir, &file), ["a.obj:3: 'usemtl' without a name: the default material is used"]);
}

#[test]
fn libraries_outside_the_folder_need_permission() {
    let text = format!("# one\nmtllib ../lib/a.mtl\nusemtl a\n{TRIANGLE}");
    let dir = folder(&[("mesh/a.obj", text.as_str()), ("lib/a.mtl", "newmtl a\nKd 1 2 3\n")]);
    let path = dir.path().join("mesh/a.obj");
    let message = load(&path).expect_err("it is outside").to_string();
    assert!(message.contains("a.obj:2: ") && message.contains("copy it into that folder"), "{message}");
    let allow = [dir.path().join("lib")];
    let file = read(&path, &options(&allow)).expect("it is allowed");
    assert_eq!(file.materials[0].kd, Some([1., 2., 3.]));
    #[cfg(unix)]
    {
        // A link does not lead out either.
        std::os::unix::fs::symlink(dir.path().join("lib"), dir.path().join("mesh/link")).expect("a link can be made");
        std::fs::write(&path, text.replace("../lib", "link")).expect("a file can be written");
        assert!(matches!(load(&path), Err(Error::Forbidden { .. })));
    }
}

#[test]
fn texture_coordinates_are_kept_where_an_image_in_use_needs_them() {
    let mtl = "newmtl plain\nmap_Kd none.png\nnewmtl wood\nmap_Kd C:\\tex\\wood.png\nnewmtl spare\nmap_Kd spare.png\n";
    let dir = folder(&[("a.mtl", mtl), ("wood.png", "")]);
    let path = dir.path().join("a.obj");
    let read_as = |material: &str, uv, materials| {
        let faces = TRIANGLE.replace("f 1 2 3", "f 1/1 2/1 3/1");
        std::fs::write(&path, format!("mtllib a.mtl\nusemtl {material}\nvt 0 0\n{faces}")).expect("it can be written");
        read(&path, &ReadOptions { uv, materials, ..options(&[]) }).expect("the text is fine")
    };
    let wood = read_as("wood", Uv::IfTextured, true);
    assert!(wood.uvs.is_some());
    assert_eq!(wood.materials[0].map_kd, Some(dir.path().canonicalize().expect("it is there").join("wood.png")));
    assert_eq!((wood.counts.unused_materials, wood.counts.unused_images), (2, 2));
    // An image that is not there needs none.
    let plain = read_as("plain", Uv::IfTextured, true);
    assert!(plain.uvs.is_none() && plain.materials[0].map_kd.is_none());
    assert_eq!(told(&dir, &plain), ["a.mtl:2: image 'none.png' is not there: Kd is used alone"]);
    let bare = read_as("wood", Uv::IfTextured, false);
    assert!(bare.uvs.is_none() && bare.materials.is_empty() && bare.face_materials.is_none());
    assert!(read_as("wood", Uv::Always, false).uvs.is_some() && read_as("wood", Uv::Never, true).uvs.is_none());
}

/// Position, normal and texture coordinates of every corner, as tobj has them.
type Corner = (DVec3, Option<DVec3>, Option<[f32; 2]>);

fn corners_by_tobj(models: &[tobj::Model]) -> Vec<Corner> {
    let mut out = Vec::new();
    for mesh in models.iter().map(|m| &m.mesh) {
        for (i, &v) in mesh.indices.iter().enumerate() {
            let normal = mesh.normal_indices.get(i).map(|&n| DVec3::from_slice(&mesh.normals[3 * n as usize..]));
            let uv = mesh.texcoord_indices.get(i).map(|&t| [0, 1].map(|k| mesh.texcoords[2 * t as usize + k] as f32));
            out.push((DVec3::from_slice(&mesh.positions[3 * v as usize..]), normal, uv));
        }
    }
    out
}

/// Compares all that both readers say about every corner.
fn compare(file: &ObjFile, tobj: &[Corner], name: &str) {
    assert_eq!(3 * file.faces.len(), tobj.len(), "{name}");
    for (i, (position, normal, uv)) in tobj.iter().enumerate() {
        let (t, k) = (i / 3, i % 3);
        let ours = Vec3::from_slice(&file.points[3 * file.faces[t][k] as usize..]);
        assert_eq!(ours, file.frame.to_local(*position).as_vec3(), "{name}: corner {i}");
        // Where a corner has none, tobj repeats that of another.
        if let Some(ours) = file.normals.as_ref().and_then(|n| n.get::<3>(n.of(&file.faces, t)[k])) {
            let theirs = normal.expect("tobj has it too").normalize_or_zero();
            assert!((Vec3::from(ours).as_dvec3() - theirs).length() < 1e-7, "{name}: normal of corner {i}");
        }
        if let Some(ours) = file.uvs.as_ref().and_then(|n| n.get::<2>(n.of(&file.faces, t)[k])) {
            assert_eq!(Some(ours), *uv, "{name}: texture coordinates of corner {i}");
        }
    }
}

const FAN: tobj::LoadOptions =
    tobj::LoadOptions { triangulate: true, single_index: false, ignore_points: true, ignore_lines: true };

/// A well-formed file: points, normals, texture coordinates, faces that use them.
fn well_formed() -> impl Strategy<Value = String> {
    let point = proptest::array::uniform3(-1e3..1e3f64);
    let face = (proptest::collection::vec((1..6u32, 1..4u32, 1..5u32), 3..4), any::<bool>());
    (
        proptest::collection::vec(point, 5..6),
        proptest::collection::vec(proptest::array::uniform3(-9..9i32), 3..4),
        proptest::collection::vec(proptest::array::uniform2(0.0..1.0f64), 4..5),
        proptest::collection::vec(face, 1..30),
        0..4u8,
    )
        .prop_map(|(points, normals, uvs, faces, form)| {
            let mut text = String::new();
            let fine = "a string takes all";
            for [x, y, z] in points {
                writeln!(text, "v {x} {y:.4} {z:e}").expect(fine);
            }
            for [x, y, z] in normals {
                writeln!(text, "vn {x} {y} {z}").expect(fine);
            }
            for [u, v] in uvs {
                writeln!(text, "vt {u} {v:.6}").expect(fine);
            }
            for (corners, back) in faces {
                text.push('f');
                for (v, n, t) in corners {
                    let (v, n, t) = (i64::from(v), i64::from(n), i64::from(t));
                    let (v, n, t) = if back { (v - 6, n - 4, t - 5) } else { (v, n, t) };
                    match form {
                        0 => write!(text, " {v}"),
                        1 => write!(text, " {v}/{t}"),
                        2 => write!(text, " {v}//{n}"),
                        _ => write!(text, " {v}/{t}/{n}"),
                    }
                    .expect(fine);
                }
                text.push('\n');
            }
            text
        })
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]
    #[test]
    fn well_formed_files_are_read_as_tobj_does(text in well_formed()) {
        let dir = folder(&[("a.obj", &text)]);
        let file = load(&dir.path().join("a.obj")).expect("it is well-formed");
        let (models, _) = tobj::load_obj(dir.path().join("a.obj"), &FAN).expect("it is well-formed");
        compare(&file, &corners_by_tobj(&models), "generated");
    }
}

/// `v`, `vt`, `vn` and `f` lines, and triangles, as the meshes' own list has them.
const MESHES: [(&str, [u64; 5]); 19] = [
    ("bunny.obj", [35_947, 0, 0, 69_451, 69_451]),
    ("armadillo.obj", [43_243, 0, 0, 86_482, 86_482]),
    ("dragon_res2.obj", [100_250, 0, 0, 202_520, 202_520]),
    ("lucy_100k.obj", [49_987, 0, 0, 99_970, 99_970]),
    ("teapot.obj", [3_644, 0, 0, 6_320, 6_320]),
    ("suzanne.obj", [507, 0, 507, 500, 968]),
    ("horse_quad.obj", [2_400, 0, 0, 2_398, 4_796]),
    ("beast.obj", [32_311, 33_963, 0, 32_364, 64_618]),
    ("fandisk.obj", [6_475, 0, 0, 12_946, 12_946]),
    ("pirate.obj", [2_889, 3_156, 2_771, 2_527, 5_010]),
    ("spot/spot_triangulated.obj", [2_930, 3_225, 0, 5_856, 5_856]),
    ("spot/spot_quadrangulated.obj", [2_930, 3_225, 0, 2_928, 5_856]),
    ("cornell/CornellBox-Original.obj", [72, 0, 0, 18, 36]),
    ("cornell/CornellBox-Mirror.obj", [72, 0, 0, 18, 36]),
    ("cornell/CornellBox-Sphere.obj", [1_116, 1_256, 1_101, 2_188, 2_188]),
    ("cornell/CornellBox-Glossy.obj", [578, 638, 561, 1_112, 1_112]),
    ("cornell/CornellBox-Water.obj", [3_666, 1_262, 3_533, 7_088, 7_088]),
    ("kitchen/kitchen.obj", [556_282, 556_282, 556_282, 1_021_813, 1_021_813]),
    ("terrain_N44W072.obj", [1_442_401, 0, 0, 2_880_000, 2_880_000]),
];

/// What is in a file that may be compressed.
fn unpacked(path: &Path) -> Vec<u8> {
    let mut bytes = std::fs::read(path).expect("it was read before");
    if path.extension().is_some_and(|e| e == "zst") {
        let mut decoder = ruzstd::decoding::StreamingDecoder::new(&bytes[..]).expect("it was unpacked before");
        let mut out = Vec::new();
        decoder.read_to_end(&mut out).expect("it was unpacked before");
        bytes = out;
    }
    bytes
}

/// Runs only where the meshes are: next to the repository, or in `TISON_MESHES`.
#[test]
fn real_meshes_are_read_exactly() {
    let beside = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/meshes");
    let root = std::env::var_os("TISON_MESHES").map_or(beside, PathBuf::from);
    for (name, want) in MESHES {
        let packed = root.join(format!("{name}.zst"));
        let path = if packed.is_file() { packed } else { root.join(name) };
        if !path.is_file() {
            continue;
        }
        let file = load(&path).unwrap_or_else(|e| panic!("{e}"));
        let c = file.counts;
        assert_eq!([c.vertices, c.textures, c.normals, c.polygons, c.triangles], want, "{name}");
        let text = unpacked(&path);
        let text = String::from_utf8_lossy(&text);
        let numbers = |l: &str| l.split_whitespace().skip(1).take(3).map(|x| x.parse().expect("a number")).collect();
        for (i, line) in text.lines().filter(|l| l.starts_with("v ") || l.starts_with("v\t")).enumerate() {
            let p: Vec<f64> = numbers(line);
            let exact = file.frame.to_local(DVec3::from_slice(&p)).as_vec3();
            assert_eq!(Vec3::from_slice(&file.points[3 * i..]), exact, "{name}: vertex {i}");
        }
        let library = |name: &Path| tobj::load_mtl(path.with_file_name(name));
        let (models, materials) = tobj::load_obj_buf(&mut text.as_bytes(), &FAN, library).expect("tobj reads it too");
        if c.clipped == 0 {
            compare(&file, &corners_by_tobj(&models), name);
        }
        if let Ok(materials) = materials {
            compare_materials(&file, &models, &materials, name);
        }
        println!("{name}: {} polygons clipped, {} warnings", c.clipped, file.warnings.len());
    }
}

fn compare_materials(file: &ObjFile, models: &[tobj::Model], materials: &[tobj::Material], name: &str) {
    let mut t = 0;
    for mesh in models.iter().map(|m| &m.mesh) {
        for _ in 0..mesh.indices.len() / 3 {
            let ours = &file.materials[file.face_materials.as_ref().map_or(0, |m| m[t] as usize)];
            if let Some(theirs) = mesh.material_id.map(|i| &materials[i]) {
                assert_eq!(ours.name, theirs.name, "{name}: material of triangle {t}");
                assert_eq!(ours.kd, theirs.diffuse.map(|c| c.map(|x| x as f32)), "{name}: Kd of {}", ours.name);
                assert_eq!(ours.ns, theirs.shininess.map(|x| x as f32), "{name}: Ns of {}", ours.name);
            } else {
                assert_eq!(ours.kd, None, "{name}: material of triangle {t}");
            }
            t += 1;
        }
    }
}
