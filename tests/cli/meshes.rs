//! Meshes in other formats than OBJ.

use super::{Bench, TETRAHEDRON, decode_file, text};
use serde_json::Value;
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
