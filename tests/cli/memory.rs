//! What memory is told, and what `--max-memory` refuses and stops.

use super::{Bench, text};
use serde_json::Value;
use std::fmt::Write;

/// Of a square grid of `side` x `side` quads, two triangles each.
fn corners(side: u32) -> impl Iterator<Item = [f32; 3]> {
    let height = |x: u32, y: u32| (f64::from(x) * 0.7).sin() * (f64::from(y) * 0.9).cos();
    (0..=side).flat_map(move |y| (0..=side).map(move |x| [x as f32, height(x, y) as f32, y as f32]))
}

fn triangles(side: u32) -> impl Iterator<Item = [u32; 3]> {
    (0..side * side).flat_map(move |i| {
        let a = i / side * (side + 1) + i % side;
        let (b, c, d) = (a + 1, a + side + 1, a + side + 2);
        [[a, c, b], [b, c, d]]
    })
}

/// The grid as a binary PLY file.
fn ply(side: u32) -> Vec<u8> {
    let (vertices, faces) = ((side + 1).pow(2), 2 * side * side);
    let mut out = format!(
        "ply\nformat binary_little_endian 1.0\nelement vertex {vertices}\nproperty float x\nproperty float y\n\
         property float z\nelement face {faces}\nproperty list uchar uint vertex_indices\nend_header\n"
    )
    .into_bytes();
    out.extend(corners(side).flatten().flat_map(f32::to_le_bytes));
    for face in triangles(side) {
        out.push(3);
        out.extend(face.into_iter().flat_map(u32::to_le_bytes));
    }
    out
}

fn obj(side: u32) -> String {
    let mut out = String::new();
    for [x, y, z] in corners(side) {
        writeln!(out, "v {x} {y} {z}").expect("memory takes all");
    }
    for [a, b, c] in triangles(side) {
        writeln!(out, "f {} {} {}", a + 1, b + 1, c + 1).expect("memory takes all");
    }
    out
}

fn json(bytes: &[u8]) -> Value {
    serde_json::from_slice(bytes).expect("JSON")
}

fn bytes(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is no number"))
}

#[test]
fn info_tells_the_bytes_of_a_triangle_and_a_render_what_they_came_to() {
    let bench = Bench::new();
    bench.write("grid.ply", ply(120));
    let (vertices, faces) = (121.0 * 121.0, 2.0 * 120.0 * 120.0);
    let told = json(&bench.expect("info grid.ply --json", 0).stdout);
    let memory = &told["memory"];
    assert_eq!(memory["hierarchy_is_estimate"], true);
    assert_eq!(bytes(&memory["buffers"]["indices"]), 12.0 * faces);
    assert_eq!(bytes(&memory["buffers"]["positions"]), 12.0 * vertices + 4.0);
    for none in ["normals", "uvs", "face_materials", "shapes", "textures"] {
        assert_eq!(bytes(&memory["buffers"][none]), 0.0, "{none}");
    }
    let each = (12.0 * (vertices + faces) + 4.0) / faces;
    assert_eq!(bytes(&memory["bytes_per_triangle"]["buffers"]), each);
    assert_eq!(bytes(&memory["scene_bytes"]), each * faces);

    bench.expect("grid.ply -o out.png --stats s.json", 0);
    let built = json(&bench.read("s.json"));
    let built = &built["memory"];
    assert_eq!(built["hierarchy_is_estimate"], false);
    assert_eq!(built["buffers"], memory["buffers"]);
    assert_eq!(built["hierarchy_bytes"], built["backend_bytes"]);
    let estimate = bytes(&memory["hierarchy_bytes"]) / bytes(&built["hierarchy_bytes"]);
    assert!((estimate - 1.0).abs() < 0.2, "{estimate}");
    assert!(bytes(&built["hierarchy_peak_bytes"]) >= bytes(&built["hierarchy_bytes"]));

    let output = bench.expect("info grid.ply", 0);
    let shown = text(&output.stdout);
    assert!(shown.contains("; a triangle takes 18.1 B in buffers + about"), "{shown}");
    let output = bench.expect("grid.ply -o out.png -v", 0);
    let shown = text(&output.stderr);
    assert!(shown.contains("memory    scene ") && shown.contains("buffers   indices "), "{shown}");
}

#[test]
fn shapes_leave_open_what_a_triangle_takes_of_the_hierarchy() {
    let bench = Bench::new();
    bench.write("s.toml", "tison = 1\n[[object]]\nmesh = \"a.obj\"\n[[object]]\nshape = \"sphere\"\n");
    let told = json(&bench.expect("info s.toml --json", 0).stdout);
    let each = &told["memory"]["bytes_per_triangle"];
    assert!(bytes(&each["buffers"]) > 0.0 && each["hierarchy"].is_null(), "{each}");
    assert!(bytes(&told["memory"]["buffers"]["shapes"]) > 0.0);
}

/// Runs it, expects it to be refused by a limit with a message that has each of `says` (`|` means or), and nothing to be left behind.
#[track_caller]
fn refused(bench: &Bench, words: &str, says: &[&str]) {
    let before = bench.names();
    let output = bench.expect(words, 6);
    let told = text(&output.stderr);
    for part in says.iter().chain(&["--max-memory"]) {
        assert!(part.split('|').any(|part| told.contains(part)), "{words}: no '{part}' in\n{told}");
    }
    assert!(output.stdout.is_empty(), "{words}");
    assert_eq!(bench.names(), before, "{words}");
}

#[test]
fn what_is_known_before_is_refused_before() {
    let bench = Bench::new();
    bench.write("big.obj", obj(300));
    bench.write("big.ply", ply(300));
    bench.write("big.toml", "tison = 1\n[[object]]\nmesh = \"big.ply\"\n");
    let sphere = "[[object]]\nshape = \"sphere\"\nradius = 0.1\n";
    bench.write("long.toml", format!("tison = 1\n{}", sphere.repeat(50_000)));
    let sphere = r#"{"shape": "sphere", "radius": 0.1}"#;
    bench.write("long.json", format!(r#"{{"tison": 1, "object": [{}]}}"#, [sphere; 100_000].join(",")));
    let image = "an image of 8000x4000 pixels needs about";
    refused(&bench, "nowhere.obj --size 8000x4000 --max-memory 400M", &[image, "are free", "419.4 MB"]);
    refused(&bench, "a.obj --size 8000x4000 --aov depth,normal --max-memory 1.2GB", &[image, "1.2 GB"]);
    // The first has a size that only the scene tells.
    bench.write("large.toml", "tison = 1\n[render]\nsize = [8000, 4000]\n[[object]]\nmesh = \"a.obj\"\n");
    refused(&bench, "large.toml -o out.png --max-memory 400M", &[image]);
    for backend in ["embree", "native"].into_iter().filter(|b| *b == "native" || cfg!(feature = "embree")) {
        for file in ["big.obj", "big.ply", "big.toml", "big.obj --obj-reader tobj"] {
            let words = format!("{file} --size 64x64 -o out.png --max-memory 30M --backend {backend}");
            // By its counts, or where the program itself is small, once it is read.
            let counted = "180000 triangles, and the hierarchy over them, takes at least";
            refused(&bench, &words, &[&format!("{counted}|the hierarchy needs at least"), "31.5 MB"]);
        }
    }
    for file in ["long.toml", "long.json"] {
        let words = format!("{file} --size 64x64 -o out.png --max-memory 60M");
        refused(&bench, &words, &[file, "a scene of this length takes at least "]);
    }
    refused(&bench, "a.obj --max-memory 1M", &["the program itself holds"]);
}

#[test]
fn a_read_that_grows_past_the_limit_is_stopped() {
    let bench = Bench::new();
    let mut packed = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    std::io::Write::write_all(&mut packed, &vec![b' '; 100 << 20]).expect("memory takes all");
    bench.write("blank.obj.gz", packed.finish().expect("memory takes all"));
    refused(&bench, "blank.obj.gz --size 64x64 --max-memory 80M", &["blank.obj.gz: it does not fit into memory"]);
}

/// The limits around what a render takes, as its own figures tell them.
fn around(bench: &Bench, words: &str) -> (f64, f64) {
    bench.expect(&format!("{words} -o first.png --stats s.json"), 0);
    let stats = json(&bench.read("s.json"));
    (bytes(&stats["peak_rss_bytes"]), bytes(&stats["memory"]["hierarchy_peak_bytes"]))
}

#[test]
#[cfg(target_os = "linux")]
fn a_build_that_grows_past_the_limit_is_stopped_and_one_that_does_not_is_not() {
    let bench = Bench::new();
    bench.write("big.ply", ply(600));
    for backend in ["embree", "native"].into_iter().filter(|b| *b == "native" || cfg!(feature = "embree")) {
        let words = format!("big.ply --size 16x16 --spp 4096 --no-error-estimate -j 1 --backend {backend}");
        let (peak, hierarchy) = around(&bench, &words);
        // Less than it takes, and more than was known for sure before, which is less of a native one.
        let short = if backend == "native" { 0.25 } else { 0.05 } * hierarchy;
        let words = format!("{words} -o out.png --max-memory");
        // The hierarchy's own count comes to its end first, or the system's of the process.
        refused(&bench, &format!("{words} {}", (peak - short) as u64), &[" needs at least |memory grew to "]);
        let enough = peak + 0.25 * hierarchy;
        bench.expect(&format!("{words} {} --stats s.json", enough as u64), 0);
        assert!(bytes(&json(&bench.read("s.json"))["peak_rss_bytes"]) <= enough, "{backend}");
        assert_eq!(bench.read("out.png"), bench.read("first.png"), "{backend}: a limit changes no pixel");
        std::fs::remove_file(bench.path("out.png")).expect("it is there");
    }
}

#[test]
fn sizes_are_understood_or_refused() {
    let bench = Bench::new();
    for size in ["1G", "1.5GiB", "800MB", "900000000"] {
        bench.expect(&format!("a.obj --size 8x8 -o out.png --max-memory {size}"), 0);
    }
    for size in ["much", "0", "-1M", "1e9", "5X"] {
        let output = bench.expect(&format!("a.obj --size 8x8 -o out.png --max-memory {size}"), 2);
        let told = text(&output.stderr);
        assert!(told.contains("--max-memory") && told.contains("expected"), "{told}");
    }
    let output = bench.expect("a.obj --max-memory 2G --print-config", 0);
    assert!(text(&output.stdout).lines().any(|l| l.contains("max-memory") && l.contains("2147483648")));
}
