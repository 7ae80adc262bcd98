//! Meshes in other formats than OBJ, and compressed ones.

use super::{Bench, TETRAHEDRON, decode_file, text};
use serde_json::Value;
use std::io::Write;
use std::process::Output;

/// The header of a PLY file with what OBJ text has, which must be `v` and `f` lines.
fn header(obj: &str, format: &str) -> String {
    let count = |keyword: &str| obj.lines().filter(|l| l.starts_with(keyword)).count();
    format!(
        "ply\nformat {format} 1.0\ncomment made of OBJ\nelement vertex {}\nproperty double x\nproperty double y\n\
         property double z\nelement face {}\nproperty list uchar int vertex_indices\nend_header\n",
        count("v "),
        count("f ")
    )
}

fn numbers(line: &str) -> Vec<f64> {
    line.split_whitespace().skip(1).map(|word| word.parse().expect("a number")).collect()
}

fn ascii(obj: &str) -> String {
    let vertices = obj.lines().filter(|l| l.starts_with("v ")).map(|l| l[2..].to_owned() + "\n");
    let faces = obj.lines().filter(|l| l.starts_with("f ")).map(|l| {
        let corners = numbers(l);
        format!("{}{}\n", corners.len(), corners.iter().map(|i| format!(" {}", i - 1.0)).collect::<String>())
    });
    header(obj, "ascii") + &vertices.chain(faces).collect::<String>()
}

fn binary(obj: &str, big: bool) -> Vec<u8> {
    let order = if big { "binary_big_endian" } else { "binary_little_endian" };
    let mut out = header(obj, order).into_bytes();
    for x in obj.lines().filter(|l| l.starts_with("v ")).flat_map(numbers) {
        out.extend_from_slice(&if big { x.to_be_bytes() } else { x.to_le_bytes() });
    }
    for corners in obj.lines().filter(|l| l.starts_with("f ")).map(numbers) {
        out.push(corners.len() as u8);
        for corner in corners {
            let index = corner as i32 - 1;
            out.extend_from_slice(&if big { index.to_be_bytes() } else { index.to_le_bytes() });
        }
    }
    out
}

/// A bowl of quads on a floor that is not convex.
fn bowl() -> String {
    let mut out = String::new();
    for i in 0..12 {
        for j in 0..12 {
            let (x, y) = (f64::from(i) / 5.5 - 1.0, f64::from(j) / 5.5 - 1.0);
            out += &format!("v {x} {y} {}\n", x * x + 0.7 * y * y);
        }
    }
    for (i, j) in (0..11).flat_map(|i| (0..11).map(move |j| (i, j))) {
        let at = 12 * i + j + 1;
        out += &format!("f {} {} {} {}\n", at, at + 12, at + 13, at + 1);
    }
    out + "v -3 -3 -1\nv 3 -3 -1\nv 0 -1 -1\nv 3 3 -1\nv -3 3 -1\nf 145 146 147 148 149\n"
}

fn json(output: &Output) -> Value {
    serde_json::from_slice(&output.stdout).expect("one JSON object")
}

#[test]
fn ply_in_every_encoding_gives_the_picture_of_the_obj() {
    let bench = Bench::new();
    bench.write("bowl.obj", bowl());
    bench.write("text.ply", ascii(&bowl()));
    bench.write("little.ply", binary(&bowl(), false));
    bench.write("BIG.PLY", binary(&bowl(), true));
    bench.write(
        "s.toml",
        "tison = 1\n[[object]]\nmesh = \"little.ply\"\nsmooth = 30\n[light.a]\nposition = [2, 3, 9]\n",
    );
    for flags in ["", "--smooth 40"] {
        bench.expect(&format!("bowl.obj {flags} --backend native --size 80x60 -q -o want.png"), 0);
        for name in ["text.ply", "little.ply", "BIG.PLY"] {
            bench.expect(&format!("{name} {flags} --backend native --size 80x60 -q -o got.png"), 0);
            // Not all bytes are: the file has the name of the mesh in it.
            assert!(decode_file(&bench.path("want.png")) == decode_file(&bench.path("got.png")), "{name} {flags}");
        }
    }
    bench.expect("little.ply --backend native --size 20x15 -q", 0);
    assert!(bench.path("little.png").is_file());
    let counts = |name: &str| json(&bench.expect(&format!("info --json {name}"), 0))["scene"].clone();
    let of_obj = counts("bowl.obj");
    assert_eq!((&of_obj["triangles"], &of_obj["vertices"]), (&Value::from(245), &Value::from(149)));
    for name in ["text.ply", "little.ply", "BIG.PLY"] {
        assert_eq!(counts(name), of_obj, "{name}");
        // The second reader is for OBJ files.
        bench.expect(&format!("check {name} --obj-reader tobj"), 0);
    }
    assert_eq!(counts("s.toml")["triangles"], 245);
    bench.expect("s.toml --backend native --size 20x15 -q", 0);
    let out = bench.expect("verify --readers little.ply", 0);
    assert!(text(&out.stdout).contains("no OBJ file"), "{}", text(&out.stdout));
}

fn gzip(bytes: impl AsRef<[u8]>) -> Vec<u8> {
    let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::default());
    encoder.write_all(bytes.as_ref()).expect("memory takes all");
    encoder.finish().expect("memory takes all")
}

fn zstd(bytes: impl AsRef<[u8]>) -> Vec<u8> {
    ruzstd::encoding::compress_to_vec(bytes.as_ref(), ruzstd::encoding::CompressionLevel::Fastest)
}

#[test]
fn compressed_meshes_give_the_picture_of_the_obj() {
    let bench = Bench::new();
    let red = format!("mtllib m.mtl\nusemtl red\n{}", bowl());
    bench.write("m.mtl", "newmtl red\nKd 0.9 0.1 0.1\n");
    bench.write("bowl.obj", &red);
    bench.write("a.obj.gz", gzip(&red));
    bench.write("b.obj.zst", zstd(&red));
    bench.write("plain.obj", bowl());
    bench.write("c.ply.gz", gzip(ascii(&bowl())));
    bench.write("d.ply.zst", zstd(binary(&bowl(), true)));
    bench.write("s.toml", "tison = 1\n[[object]]\nmesh = \"b.obj.zst\"\n[light.a]\nposition = [2, 3, 9]\n");
    for (want, names) in [("bowl.obj", ["a.obj.gz", "b.obj.zst"]), ("plain.obj", ["c.ply.gz", "d.ply.zst"])] {
        bench.expect(&format!("{want} --backend native --size 80x60 -q -o want.png"), 0);
        for name in names {
            bench.expect(&format!("{name} --backend native --size 80x60 -q"), 0);
            // Named after the mesh, without both extensions.
            let picture = format!("{}.png", &name[..1]);
            assert!(decode_file(&bench.path("want.png")) == decode_file(&bench.path(&picture)), "{name}");
        }
    }
    let told = json(&bench.expect("info --json s.toml", 0));
    assert_eq!((&told["scene"]["triangles"], &told["materials"][0]["name"]), (&Value::from(245), &Value::from("red")));
    bench.expect("check b.obj.zst --obj-reader tobj", 0);
    let told = json(&bench.expect("verify --readers --json s.toml", 0));
    assert_eq!(told["readers"][0]["triangles"], 245);
    let out = bench.command("info --json /dev/stdin").write_stdin(zstd(ascii(&bowl()))).output().expect("it runs");
    assert_eq!(json(&out)["scene"]["triangles"], 245, "{}", text(&out.stderr));
}

#[test]
fn what_is_wrong_with_a_compressed_mesh_is_told() {
    let bench = Bench::new();
    bench.write("index.obj.gz", gzip(TETRAHEDRON.replace("f 1 3 2", "f 1 3 9")));
    bench.write("cut.obj.zst", &zstd(TETRAHEDRON)[..30]);
    bench.write("plain.ply.gz", ascii(TETRAHEDRON));
    for (name, want) in [
        ("index.obj.gz", "index.obj.gz:5:7: vertex index 9 does not exist: the file has 4 'v' lines\n"),
        ("cut.obj.zst", "cut.obj.zst: it cannot be unpacked: "),
        ("plain.ply.gz", "plain.ply.gz: it is not compressed by gzip, as its name says"),
    ] {
        let out = bench.expect(&format!("{name} -o out.png"), 3);
        assert!(text(&out.stderr).contains(want), "{}", text(&out.stderr));
        // The line would be one of compressed bytes.
        assert!(!text(&out.stderr).contains(" | "), "{}", text(&out.stderr));
    }
}

#[test]
fn single_rays_are_answered_alike() {
    let bench = Bench::new();
    bench.write("a.ply", binary(TETRAHEDRON, true));
    let ray = "{\"o\":[0.2,0.3,5],\"d\":[0.01,0.02,-1]}\n";
    let answer = |name: &str| {
        let out = bench.command(&format!("probe {name}")).write_stdin(ray).output().expect("it runs");
        assert!(out.status.success(), "{}", text(&out.stderr));
        text(&out.stdout).to_owned()
    };
    assert!(answer("a.obj").contains("\"hit\":true"));
    assert_eq!(answer("a.obj"), answer("a.ply"));
}

#[test]
fn a_pipe_is_told_by_its_first_line() {
    let bench = Bench::new();
    for (input, name) in [(binary(TETRAHEDRON, false), "PLY"), (TETRAHEDRON.into(), "OBJ")] {
        let out = bench.command("info --json /dev/stdin").write_stdin(input).output().expect("it runs");
        assert_eq!(json(&out)["scene"]["triangles"], 4, "{name}: {}", text(&out.stderr));
    }
}

#[test]
fn what_is_wrong_with_a_ply_file_is_told() {
    let bench = Bench::new();
    let good = ascii(TETRAHEDRON);
    bench.write("index.ply", good.replace("3 0 2 1", "3 0 2 4"));
    bench.write("cut.ply", &binary(TETRAHEDRON, false)[..300]);
    bench.write(
        "points.ply",
        good.split("element face").next().unwrap_or_default().to_owned() + "end_header\n0 0 0\n0 0 0\n0 0 0\n0 0 0\n",
    );
    bench.write("other.ply", TETRAHEDRON);
    for (name, want) in [
        ("index.ply", "index.ply:15:7: face 0: vertex index 4 does not exist: the file has 4 vertices\n"),
        ("cut.ply", "cut.ply: face 0 (byte 288): the file ends within it"),
        ("points.ply", "points.ply: no renderable faces: it has 4 vertices and no face: it is a cloud of points"),
        ("other.ply", "other.ply:1:1: a PLY file begins with a line 'ply', not with 'v 0 0 0'"),
    ] {
        let out = bench.expect(&format!("{name} -o out.png"), 3);
        assert!(text(&out.stderr).contains(want), "{}", text(&out.stderr));
    }
    let told = bench.expect("index.ply", 3);
    assert!(text(&told.stderr).contains("15 | 3 0 2 4\n   |       ^"), "{}", text(&told.stderr));
    assert!(!bench.path("out.png").exists());
}
