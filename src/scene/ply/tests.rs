//! Odd files, and that neither parts nor threads nor the encoding change a result.

use super::super::obj::{self, MtlMaterial, Uv};
use super::*;
use crate::math::Frame;
use glam::{DVec3, Vec3};
use proptest::prelude::*;
use std::fmt::Write as _;
use std::sync::atomic::AtomicBool;

static GO_ON: AtomicBool = AtomicBool::new(false);

fn options() -> ReadOptions<'static> {
    ReadOptions::all(&GO_ON)
}

fn parse_in(bytes: &[u8], piece: u64) -> Result<ObjFile, Error> {
    read::read(&Source::memory(Path::new("dir/a.ply"), bytes), &options(), piece)
}

/// Reads a file in parts of several sizes, which must not matter.
fn parse(bytes: impl AsRef<[u8]>) -> Result<ObjFile, Error> {
    let whole = parse_in(bytes.as_ref(), PIECE);
    for piece in [1, 13, 100] {
        let again = parse_in(bytes.as_ref(), piece);
        assert_eq!(format!("{whole:?}"), format!("{again:?}"), "in parts of {piece}");
    }
    whole
}

fn good(bytes: impl AsRef<[u8]>) -> ObjFile {
    parse(bytes).expect("the file is fine")
}

fn error(bytes: impl AsRef<[u8]>) -> String {
    parse(bytes).expect_err("the file is wrong").to_string()
}

fn told(file: &ObjFile) -> Vec<String> {
    file.warnings.iter().map(ToString::to_string).collect()
}

fn world(file: &ObjFile, i: usize) -> DVec3 {
    file.frame.to_world(Vec3::from_slice(&file.points[3 * i..]).as_dvec3())
}

/// The header of a text file with these elements.
fn header(elements: &str) -> String {
    format!("ply\nformat ascii 1.0\n{elements}\nend_header\n")
}

const VERTEX: &str = "element vertex 3\nproperty float x\nproperty float y\nproperty float z";
const FACE: &str = "element face 1\nproperty list uchar int vertex_indices";
const POINTS: &str = "0 0 0\n1 0 0\n0 1 0\n";

fn smallest() -> String {
    format!("{}{POINTS}3 0 1 2\n", header(&format!("{VERTEX}\n{FACE}")))
}

/// The same file in another encoding, made of the text by the types that its header names; this is for tests, and
/// knows no errors.
fn encoded(text: &str, big: bool) -> Vec<u8> {
    let (head, body) = text.split_once("end_header\n").expect("it has a header");
    let order = if big { "binary_big_endian" } else { "binary_little_endian" };
    let mut out = format!("{}end_header\n", head.replace("ascii", order)).into_bytes();
    let mut words = body.split_whitespace();
    let elements: Vec<&str> = head.split("element ").skip(1).collect();
    for element in elements {
        let mut lines = element.lines();
        let count: usize = lines.next().and_then(|l| l.split(' ').nth(1)).expect("a count").parse().expect("a number");
        let properties: Vec<Vec<&str>> =
            lines.filter(|l| l.starts_with("property")).map(|l| l.split(' ').collect()).collect();
        for property in std::iter::repeat_n(&properties, count).flatten() {
            let mut next = |t: &str| {
                let word = words.next().expect("there is a word for it");
                put(&mut out, t, word, big);
                word.parse::<usize>().unwrap_or(0)
            };
            if property[1] == "list" {
                for _ in 0..next(property[2]) {
                    next(property[3]);
                }
            } else {
                next(property[1]);
            }
        }
    }
    out
}

fn put(out: &mut Vec<u8>, t: &str, word: &str, big: bool) {
    macro_rules! as_type {
        ($t:ty) => {{
            let x = word.parse::<f64>().expect("a number") as $t;
            out.extend_from_slice(&if big { x.to_be_bytes() } else { x.to_le_bytes() });
        }};
    }
    match t {
        "char" | "int8" => as_type!(i8),
        "uchar" | "uint8" => as_type!(u8),
        "short" | "int16" => as_type!(i16),
        "ushort" | "uint16" => as_type!(u16),
        "int" | "int32" => as_type!(i32),
        "uint" | "uint32" => as_type!(u32),
        "float" | "float32" => as_type!(f32),
        _ => as_type!(f64),
    }
}

/// The same mesh as text and in both binary orders, which must not matter either; numbers must be exact in f32.
fn every_way(text: &str) -> ObjFile {
    let file = good(text);
    for big in [false, true] {
        let again = good(encoded(text, big));
        let show = |f: &ObjFile| format!("{:?} {:?} {:?} {:?} {:?}", f.frame, f.points, f.faces, f.normals, f.uvs);
        assert_eq!(show(&file), show(&again), "big: {big}");
        assert_eq!(file.counts, again.counts);
    }
    file
}

#[test]
fn the_smallest_file() {
    let file = every_way(&smallest());
    assert_eq!(file.faces, [[0, 1, 2]]);
    assert_eq!(file.points.len(), 10);
    assert_eq!([0, 1, 2].map(|i| world(&file, i)), [DVec3::ZERO, DVec3::X, DVec3::Y]);
    assert!(file.normals.is_none() && file.uvs.is_none() && file.face_materials.is_none());
    assert_eq!(file.materials, [MtlMaterial::default()]);
    assert_eq!(file.counts, obj::Counts { vertices: 3, polygons: 1, triangles: 1, ..Default::default() });
    assert_eq!(told(&file), [""; 0]);
}

#[test]
fn ways_to_write_the_same() {
    let plain = good(smallest());
    let with = |from: &str, to: &str| smallest().replace(from, to);
    let rows = |rows: [&str; 3]| with(POINTS, &(rows.join("\n") + "\n"));
    let around = [
        "element a 2\nproperty int q\nproperty list char float l",
        "element b 1\nproperty short s",
        VERTEX,
        "element c 1\nproperty list uint double d",
        "element d 2\nproperty uchar t\nproperty uchar u",
        FACE,
    ];
    let around = header(&around.join("\n")) + "5 1 1\n5 2 3 3\n2\n" + POINTS + "4 5 6 7 8\n7 7\n9 9\n3 0 1 2\n";
    for (name, text) in [
        ("CRLF", with("\n", "\r\n")),
        ("comments", with("element v", "comment element face 7\nobj_info made by hand\n\nelement v")),
        ("old and new names", with("uchar int", "uint8 int32").replace("float x", "float32 x")),
        ("doubles", with("float", "double")),
        ("whole coordinates", with("float", "short")),
        ("another list name", with("vertex_indices", "vertex_index")),
        ("other types", with("uchar int", "int uchar")),
        ("signed lengths", with("uchar int", "char ushort")),
        ("blank lines and blanks", rows([" 0 0 0", "", " \t 1\t0  0 \n\n 0 1 0"])),
        ("exponents", with("1 0 0", "1e0 +0 -0.0")),
        ("no last line end", smallest().trim_end().to_owned()),
        (
            "a property more",
            rows(["0 9 0 0", "1 8 0 0", "0 7 1 0"])
                .replace("property float y", "property uchar flags\nproperty float y"),
        ),
        (
            "a list in the vertices",
            rows(["0 0 0 0", "1 2 5 5 0 0", "0 1 5 1 0"])
                .replace("property float y", "property list uchar float w\nproperty float y"),
        ),
        (
            "a list before the corners",
            with("property list", "property list uchar float t\nproperty list").replace("3 0 1 2", "2 8 8 3 0 1 2"),
        ),
        (
            "a list and a number behind the corners",
            with("vertex_indices", "vertex_indices\nproperty list int float texcoord\nproperty char quality")
                .replace("3 0 1 2", "3 0 1 2 6 .1 .2 .3 .4 .5 .6 7"),
        ),
        ("elements before and between", around),
        ("an element without properties", with("element v", "element empty 9\nelement v")),
        ("faces first", format!("{}3 0 1 2\n{POINTS}", header(&format!("{FACE}\n{VERTEX}")))),
        (
            "elements behind",
            with("end_header", "element edge 1\nproperty int v1\nproperty int v2\nend_header") + "1 2\n",
        ),
    ] {
        let file = good(&text);
        assert_eq!((&file.points, &file.faces), (&plain.points, &plain.faces), "{name}");
        assert_eq!(told(&file), [""; 0], "{name}");
        if !text.contains('\r') {
            let file = every_way(&text);
            assert_eq!((&file.points, &file.faces), (&plain.points, &plain.faces), "{name}");
        }
    }
}

#[test]
fn line_ends_of_binary_headers() {
    let plain = good(smallest());
    let binary = encoded(&smallest(), false);
    let at = binary.windows(11).position(|w| w == b"end_header\n").expect("it is there") + 11;
    let head = String::from_utf8(binary[..at].to_vec()).expect("it is text");
    for end in ["\r\n", "\r", "\n", " \n"] {
        let mut other = head.replace('\n', end).into_bytes();
        other.extend_from_slice(&binary[at..]);
        assert_eq!(good(&other).points, plain.points, "{end:?}");
    }
    let old = smallest().replace('\n', "\r");
    assert!(error(old).contains("dir/a.ply:9:1: lines end with CR alone"));
}

#[test]
fn normals_and_texture_coordinates() {
    let normals = "property float nx\nproperty float ny\nproperty float nz";
    for (u, v) in [("s", "t"), ("u", "v"), ("texture_u", "texture_v"), ("texture_s", "texture_t")] {
        let elements = format!("{VERTEX}\n{normals}\nproperty float {u}\nproperty float {v}\n{FACE}");
        let text = header(&elements) + "0 0 0 0 0 2 .25 .5\n1 0 0 0 0 0 1 2\n0 1 0 3 0 -4 0 0\n3 0 1 2\n";
        let file = every_way(&text);
        let (normals, uvs) = (file.normals.as_ref().expect("there are some"), file.uvs.as_ref().expect("likewise"));
        assert_eq!(normals.values, [0., 0., 1., 0., 0., 0., 0.6, 0., -0.8]);
        assert_eq!(uvs.values, [0.25, 0.5, 1., 2., 0., 0.]);
        assert_eq!((normals.of(&file.faces, 0), &uvs.indices), ([0, 1, 2], &None));
        assert_eq!((file.counts.normals, file.counts.textures), (3, 3));
        let wanted = ReadOptions { normals: false, uv: Uv::IfTextured, ..options() };
        let source = Source::memory(Path::new("a.ply"), text.as_bytes());
        let bare = read_source(&source, &wanted).expect("the file is fine");
        assert!(bare.normals.is_none() && bare.uvs.is_none());
        assert_eq!(bare.points, file.points);
    }
}

#[test]
fn errors_in_headers_say_what_and_where() {
    let with = |from: &str, to: &str| smallest().replacen(from, to, 1);
    let types = |name: &str| format!("'{name}' is no type of numbers: {}", number::Type::NAMES);
    for (text, want) in [
        (String::new(), "1:1: the file is empty"),
        ("plywood\n".into(), "1:1: a PLY file begins with a line 'ply', not with 'plywood'"),
        ("v 0 0 0\nv 1".into(), "1:1: a PLY file begins with a line 'ply', not with 'v 0 0 0'"),
        ("ply\nformat ascii 1.0\nelem".into(), "3:1: the file ends without a line 'end_header'"),
        (
            with("ascii", "ASCII"),
            "2:8: 'ASCII' is no format of a PLY file: ascii, binary_little_endian or binary_big_endian",
        ),
        (with("1.0", "2.0"), "2:14: version '2.0' is not known: there is 1.0"),
        (with(" 1.0", ""), "2:13: the line ends where the version, 1.0, should be"),
        (with("format ascii 1.0\n", ""), "8:1: the header has no line 'format'"),
        (with("element", "format ascii 1.0\nelement"), "3:14: a second line 'format'"),
        (
            with("element", "elements"),
            "3:1: 'elements' is no keyword of a PLY header: \
             format, comment, obj_info, element, property, end_header",
        ),
        (with("vertex 3", "vertex -3"), "3:16: '-3' is no number of things: 0 or more are needed"),
        (with("vertex 3", "vertex"), "3:15: the line ends where the number of them should be"),
        (with("element face 1", "element vertex 1"), "7:9: a second element 'vertex'"),
        (with("float z", "flaot z"), &format!("6:10: {}", types("flaot"))),
        (with("float z", "float y"), "6:16: element 'vertex' has a property 'y' already"),
        (with("float z", "float"), "6:15: the line ends where the name of the property should be"),
        (with("uchar int", "float int"), "8:15: the length of a list must be a whole number"),
        (with("uchar int", "uchar"), &format!("8:21: {}", types("vertex_indices"))),
        (with("uchar int", "uchar float"), "8:1: property 'vertex_indices' must be a list of whole numbers"),
        (with("list uchar int", "int"), "8:1: property 'vertex_indices' must be a list of whole numbers"),
        (with("vertex_indices", "corners"), "7:1: element 'face' has no property 'vertex_indices' or 'vertex_index'"),
        (with("float z", "float w"), "3:1: element 'vertex' has no property 'z' that is a number"),
        (with("element vertex 3\n", ""), "3:16: a property before the first element"),
        (
            with("vertex 3", "vertex 99999999999999"),
            "3:1: the file is too short for 99999999999999 of element 'vertex', \
             which take at least 599999999999994 bytes: 27 are left",
        ),
        (
            with("face 1", "face 18446744073709551615"),
            "7:1: the file is too short for 18446744073709551615 of element 'face', \
             which take at least 36893488147419103230 bytes: 9 are left",
        ),
    ] {
        assert_eq!(error(&text), format!("dir/a.ply:{want}"), "{text}");
    }
    let long = format!("ply\n{}", "comment that goes on and on\n".repeat(40_000));
    assert_eq!(
        parse_in(long.as_bytes(), PIECE).expect_err("it is long").to_string(),
        format!("dir/a.ply:{}:1: the header is longer than 1 MiB without a line 'end_header'", 2 + (1048576 - 4) / 28)
    );
}

#[test]
fn nothing_to_render() {
    let points = header(VERTEX) + POINTS;
    let strips =
        header(&format!("{VERTEX}\nelement tristrips 1\nproperty list int int vertex_indices")) + POINTS + "3 0 1 2\n";
    for (text, want) in [
        (points.clone(), "it has 3 vertices and no face: it is a cloud of points, which are not rendered"),
        (
            header(&format!("{VERTEX}\n{}", FACE.replace('1', "0"))) + POINTS,
            "it has 3 vertices and no face: it is a cloud of points, which are not rendered",
        ),
        (strips, "it has triangle strips ('tristrips') only, which are not read: convert it to faces"),
        (header(FACE) + "3 0 1 2\n", "it has no element 'vertex'"),
        (smallest().replace("3 0 1 2", "2 0 1"), "no face has three corners"),
    ] {
        assert_eq!(error(&text), format!("dir/a.ply: no renderable faces: {want}"));
        assert_eq!(error(encoded(&text, true)), format!("dir/a.ply: no renderable faces: {want}"));
    }
}

#[test]
fn errors_in_text_say_what_and_where() {
    let with = |from: &str, to: &str| smallest().replace(from, to);
    let face = |to: &str| with("3 0 1 2", to);
    let second = |to: &str| with("1 0 0\n", to);
    for (text, want) in [
        (face("3 0 1 3"), "13:7: face 0: vertex index 3 does not exist: the file has 3 vertices"),
        (face("3 0 -1 2"), "13:5: face 0: vertex index -1: indices count from 0"),
        (face("3 0 1"), "13:6: face 0: the line ends where 'vertex_indices' should be"),
        (face("3 0 1 1.5"), "13:7: face 0: '1.5' is not a whole number"),
        (face("x 0 1 2"), "13:1: face 0: 'x' is not a whole number"),
        (face("-3 0 1 2"), "13:1: face 0: a list cannot have -3 numbers"),
        (face("99 0 1 2"), "13:1: face 0: 'vertex_indices' should have 99 numbers, but the line ends before"),
        (second("1 0\n"), "11:4: vertex 1: the line ends where 'z' should be"),
        (second("1 0 o\n"), "11:5: vertex 1: 'o' is not a number"),
        (second("1 nan 0\n"), "11:1: vertex 1: 'y' is NaN, not a finite number"),
        (second("1 0 -1e400\n"), "11:1: vertex 1: 'z' is -inf, not a finite number"),
        (second("1e301 0 0\n"), "11:1: vertex 1: 'x' is 1e301, beyond the largest coordinate, 1e300"),
        (
            with("0 1 0\n", "").replace("0 0 0", "0    0 0"),
            " the file ends after 0 of 1 of element 'face', each of which needs a line of its own: is it cut off?",
        ),
    ] {
        assert_eq!(error(&text), format!("dir/a.ply:{want}"), "{text}");
    }
}

#[test]
fn errors_in_binary_files_say_what_and_where() {
    let text = smallest();
    let face = encoded(&text, false).len() - 13;
    let bad = |text: &str| error(encoded(text, true));
    let index = |to: &str| bad(&text.replace("3 0 1 2", to));
    assert_eq!(
        index("3 0 1 3").replace(&(face + 6).to_string(), "N"),
        "dir/a.ply: face 0 (byte N): vertex index 3 does not exist: the file has 3 vertices"
    );
    assert!(index("3 -7 1 2").ends_with(": vertex index -7: indices count from 0"));
    assert!(index("4 0 1 2 9").ends_with(": vertex index 9 does not exist: the file has 3 vertices"));
    assert!(bad(&text.replace("1 0 0\n", "1 0 nan\n")).ends_with(": 'z' is NaN, not a finite number"));
    let signed = text.replace("uchar int", "char int").replace("3 0 1 2", "-3 0 1 2");
    assert!(bad(&signed).ends_with(": a list cannot have -3 numbers"), "{}", bad(&signed));
    let whole = encoded(&text, false);
    let cut = error(&whole[..whole.len() - 1]);
    assert!(cut.contains("face 0 (byte ") && cut.contains("the file ends within it"), "{cut}");
    let cut = error(&whole[..whole.len() - 13]);
    assert!(cut.contains("dir/a.ply:7:1: the file is too short for 1 of element 'face'"), "{cut}");
    let long = text.replace("uchar int", "uint int").replace("3 0 1 2", "4294967295 0 1 2");
    let cut = error(patched(&encoded(&long.replace("4294967295", "3"), false), 16, &u32::MAX.to_le_bytes()));
    assert!(cut.contains("the length of a list is wrong"), "{cut}");
}

/// `bytes` with others from `back` bytes before the end on.
fn patched(bytes: &[u8], back: usize, by: &[u8]) -> Vec<u8> {
    let (mut bytes, at) = (bytes.to_vec(), bytes.len() - back);
    bytes[at..at + by.len()].copy_from_slice(by);
    bytes
}

#[test]
fn what_is_odd_is_told_once() {
    let colours = VERTEX.to_owned() + "\nproperty uchar red\nproperty uchar green\nproperty uchar blue";
    let text = header(&format!("{colours}\n{}", FACE.replace('1', "4")))
        + "0 0 0 1 2 3 4\n1 0 0 1 2 3\n0 1 0 1 2 3\n2 0 1\n3 0 1 2\n1 0\n3 2 1 0 9\n5 5 5\n\n6\n";
    let file = good(&text);
    assert_eq!(
        told(&file),
        [
            "dir/a.ply:7: colours of vertices are not used",
            "dir/a.ply:13: vertex 0: there is more on its line than the header says: passed over",
            "dir/a.ply:19: face 3: there is more on its line than the header says: passed over",
            "dir/a.ply:16: face 0: a face needs at least three corners: skipped (and 1 more like it)",
            "dir/a.ply: 2 lines behind the last element are not read",
        ]
    );
    assert_eq!((file.counts.short_faces, file.counts.triangles, file.counts.polygons), (2, 2, 4));
    let tidy = text.replace("3 4\n", "3\n").replace(" 9\n", "\n").replace("5 5 5\n\n6\n", "");
    let mut binary = encoded(&tidy, false);
    binary.extend_from_slice(b"more");
    assert_eq!(
        told(&good(binary)),
        [
            "dir/a.ply:7: colours of vertices are not used",
            "dir/a.ply: face 0: a face needs at least three corners: skipped (and 1 more like it)",
            "dir/a.ply: 4 bytes behind the last element are not read",
        ]
    );
}

#[test]
fn polygons_are_split_as_those_of_obj_files() {
    let points = ["0 0 0", "2 -1 0", "0.5 0 0", "2 1 0", "3 3 0"];
    let faces: [&[u32]; 5] = [&[0, 1, 3], &[0, 1, 2, 3], &[1, 2, 3, 0], &[1, 4, 3, 2, 0], &[0, 1]];
    let mut text = header(&format!("{VERTEX}\n{FACE}").replace("vertex 3", "vertex 5").replace("face 1", "face 5"));
    let mut as_obj = String::new();
    for p in points {
        writeln!(text, "{p}").expect("a string takes all");
        writeln!(as_obj, "v {p}").expect("a string takes all");
    }
    for face in faces {
        let list = |by: u32| face.iter().map(|i| format!(" {}", i + by)).collect::<String>();
        writeln!(text, "{}{}", face.len(), list(0)).expect("a string takes all");
        writeln!(as_obj, "f{}", list(1)).expect("a string takes all");
    }
    let file = every_way(&text);
    let source = Source::memory(Path::new("a.obj"), as_obj.as_bytes());
    let other = obj::read_source(&source, &options()).expect("the text is fine");
    assert_eq!((&file.points, &file.faces, file.frame), (&other.points, &other.faces, other.frame));
    assert_eq!(file.counts, other.counts);
    assert!(file.counts.clipped >= 2 && file.counts.triangles == 8);
}

/// A file with `before`, many vertices near `at`, and `after`, all of them doubles.
fn crowd(before: &[[f64; 3]], at: f64, size: f64, after: &[[f64; 3]], last_face: &str) -> String {
    let many = (0..9000).map(|i| {
        let x = f64::from(i % 60) / 60.0;
        [at + size * x, size * x * x, at]
    });
    let all: Vec<_> = before.iter().copied().chain(many).chain(after.iter().copied()).collect();
    let elements = format!("{VERTEX}\n{FACE}").replace("float", "double");
    let elements = elements.replace("vertex 3", &format!("vertex {}", all.len())).replace("face 1", "face 2");
    let rows = all.iter().map(|[x, y, z]| format!("{x:e} {y:e} {z:e}\n"));
    header(&elements) + &rows.collect::<String>() + "3 1 2 3\n" + last_face
}

#[test]
fn a_sample_that_misleads_is_put_right() {
    for (name, text, size) in [
        ("far vertices that no face uses", crowd(&[[1e30, 0., 0.]], 1e3, 1.0, &[[0., 1e290, 0.]], "3 4 5 6\n"), 1.0),
        ("a far vertex that a face uses", crowd(&[], 0.0, 1.0, &[[0., 1e290, 0.]], "3 4 5 9000\n"), 1e290),
    ] {
        for bytes in [text.clone().into_bytes(), encoded(&text, true)] {
            let file = parse_in(&bytes, 1 << 12).expect("the file is fine");
            assert!(file.points.iter().all(|x| x.is_finite()), "{name}");
            let corner = |&i: &u32| file.points[3 * i as usize..][..3].iter().fold(0f32, |m, x| m.max(x.abs()));
            let reach = file.faces.iter().flatten().map(corner).fold(0.0, f32::max);
            let world = f64::from(reach) * file.frame.world_per_local();
            assert!(world > 0.2 * size && world < 5.0 * size, "{name}: {world:e}");
            assert!(reach > 1e-5 && reach < 1e10, "{name}: {reach:e}");
        }
    }
}

#[test]
fn rests_make_points_whole() {
    let text = crowd(&[], 500_000.3, 0.1, &[], "3 4 5 6\n");
    let rows: Vec<&str> = text.split("end_header\n").nth(1).expect("it has a body").lines().collect();
    for bytes in [text.clone().into_bytes(), encoded(&text, false)] {
        let source = Source::memory(Path::new("a.ply"), &bytes);
        let file = read::read(&source, &ReadOptions { rests: true, ..options() }, 999).expect("the file is fine");
        let rests = file.rests.as_ref().expect("they are wanted");
        for i in (0..9000).step_by(7) {
            let numbers: Vec<f64> = rows[i].split(' ').map(|x| x.parse().expect("a number")).collect();
            let at = |of: &[f32]| Vec3::from_slice(&of[3 * i..]).as_dvec3();
            let local = at(&file.points) + at(rests);
            assert!((local - file.frame.to_local(DVec3::from_slice(&numbers))).abs().max_element() < 1e-14);
        }
    }
}

#[test]
fn all_encodings_of_many_vertices_have_one_frame() {
    let text = crowd(&[], 77.25, 8.0, &[[0.0, 1.0, 2.0]], "3 4 5 6\n");
    let frames = |piece| {
        let all = [text.clone().into_bytes(), encoded(&text, false), encoded(&text, true)];
        all.map(|bytes| parse_in(&bytes, piece).expect("the file is fine").frame)
    };
    let all: Vec<Frame> = [1 << 10, PIECE].into_iter().flat_map(frames).collect();
    assert!(all.iter().all(|f| *f == all[0] && *f != Frame::IDENTITY), "{all:?}");
}

#[test]
fn cancelling_and_progress() {
    for bytes in [smallest().into_bytes(), encoded(&smallest(), false)] {
        let stop = AtomicBool::new(true);
        let source = Source::memory(Path::new("a.ply"), &bytes);
        let wanted = ReadOptions { cancel: &stop, ..options() };
        assert!(matches!(read::read(&source, &wanted, 8), Err(Error::Cancelled)));
        let told = std::sync::Mutex::new(Vec::new());
        let progress = |done, total| told.lock().expect("no test panics here").push((done, total));
        let wanted = ReadOptions { progress: Some(&progress), ..options() };
        read::read(&source, &wanted, 8).expect("the file is fine");
        let told = told.into_inner().expect("no test panics here");
        assert!(!told.is_empty() && told.iter().all(|t| t.1 == 2 * source.len && t.0 <= t.1));
    }
}

#[test]
fn cut_off_and_flipped_files_never_panic() {
    let text = header(&format!(
        "element a 1\nproperty list uchar short l\n{}\n{}\nproperty list char float t",
        VERTEX.replace("vertex 3", "vertex 4") + "\nproperty float nx\nproperty float ny\nproperty float nz",
        FACE.replace('1', "3")
    )) + "2 1 1\n0 0 0 1 1 1\n1 0 0 1 1 1\n0 1 0 1 1 1\n1 1 0 1 1 1\n3 0 1 2 0\n4 0 1 3 2 1 5\n3 1 2 3 2 1 1\n";
    let (mut good, mut bad) = (0, 0);
    let mut count = |bytes: &[u8]| match parse_in(bytes, 40) {
        Ok(file) => {
            good += 1;
            assert!(file.faces.iter().flatten().all(|&i| 3 * i as usize + 3 < file.points.len()));
            assert!(file.points.iter().all(|x| x.is_finite()));
        }
        Err(_) => bad += 1,
    };
    for whole in [text.clone().into_bytes(), encoded(&text, false), encoded(&text, true)] {
        count(&whole);
        for end in 0..whole.len() {
            count(&whole[..end]);
            for flip in [0x01, 0x10, 0x80, 0xff] {
                let mut flipped = whole.clone();
                flipped[end] ^= flip;
                count(&flipped);
            }
        }
    }
    assert!(good > 100 && bad > 1000, "{good} {bad}");
}

/// Rows of well-formed faces: none, one or several corners, and a list that is passed over.
fn faces() -> impl Strategy<Value = Vec<(Vec<u32>, u8)>> {
    let any = (proptest::collection::vec(0..6u32, 0..7), 0..3u8);
    let triangle = (proptest::collection::vec(0..6u32, 3..4), 0..1u8);
    prop_oneof![proptest::collection::vec(any, 1..40), proptest::collection::vec(triangle, 1..40)]
}

proptest! {
    #[test]
    fn encodings_parts_and_threads_change_nothing(
        faces in faces(), behind: bool, piece in 1u64..300, threads in 1usize..5
    ) {
        let list = "property list uchar ushort t";
        let element = format!("element face {}\nproperty list ushort uint vertex_index", faces.len());
        let before = || element.replacen('\n', &format!("\n{list}\n"), 1);
        let element = if behind { format!("{element}\n{list}") } else { before() };
        let mut text = header(&format!("{}\n{element}", VERTEX.replace('3', "6")));
        text += "0 0 0\n4 0 1\n4 3 -1\n0 4 0.5\n1 1 1\n2 -3 9\n";
        for (corners, other) in &faces {
            let other = format!("{other}{}", " 7".repeat(*other as usize));
            let corners = format!("{}{}", corners.len(), corners.iter().map(|c| format!(" {c}")).collect::<String>());
            let row = if behind { [corners, other] } else { [other, corners] };
            text += &(row.join(" ") + "\n");
        }
        let shown = |bytes: &[u8], piece| match parse_in(bytes, piece) {
            Ok(f) => format!("{:?} {:?} {:?} {:?}", f.frame, f.points, f.faces, f.counts),
            Err(e) => e.to_string(),
        };
        let whole = shown(text.as_bytes(), PIECE);
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads can be had");
        for bytes in [text.clone().into_bytes(), encoded(&text, false), encoded(&text, true)] {
            prop_assert_eq!(&whole, &pool.install(|| shown(&bytes, piece)));
        }
    }

    #[test]
    fn random_bytes_never_panic(
        head in "(element (vertex|face|a) [0-9]{1,2}\n|property (list )?(uchar|int|float) (x|y|z|vertex_index)\n){0,8}",
        order in 0usize..3, body in proptest::collection::vec(any::<u8>(), 0..200), piece in 1u64..100
    ) {
        let order = ["ascii", "binary_little_endian", "binary_big_endian"][order];
        let head = format!("ply\nformat {order} 1.0\n{}end_header\n", head.replace("list uchar", "list uchar int"));
        let _ = parse_in(&[head.as_bytes(), &body].concat(), piece);
    }
}
