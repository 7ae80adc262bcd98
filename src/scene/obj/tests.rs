//! Odd input, and that neither pieces nor threads change a result.

use super::super::Error;
use super::super::source::Source;
use super::*;
use glam::DVec3;
use proptest::prelude::*;
use std::fmt::Write as _;

static GO_ON: AtomicBool = AtomicBool::new(false);

fn options() -> ReadOptions<'static> {
    ReadOptions::all(&GO_ON)
}

fn parse_in(bytes: &[u8], piece: u64) -> Result<ObjFile, Error> {
    read::read(&Source::memory(Path::new("dir/a.obj"), bytes), &options(), piece)
}

/// Reads `text` in pieces of several sizes, which must not matter.
fn parse(text: impl AsRef<[u8]>) -> Result<ObjFile, Error> {
    let whole = parse_in(text.as_ref(), 1 << 18);
    for piece in [1, 7, 40] {
        let again = parse_in(text.as_ref(), piece);
        assert_eq!(format!("{whole:?}"), format!("{again:?}"), "in pieces of {piece}");
    }
    whole
}

fn good(text: impl AsRef<[u8]>) -> ObjFile {
    parse(text).expect("the text is fine")
}

fn error(text: impl AsRef<[u8]>) -> String {
    parse(text).expect_err("the text is wrong").to_string()
}

fn world(file: &ObjFile, i: usize) -> DVec3 {
    file.frame.to_world(glam::Vec3::from_slice(&file.points[3 * i..]).as_dvec3())
}

fn told(file: &ObjFile) -> Vec<String> {
    file.warnings.iter().map(ToString::to_string).collect()
}

/// Three vertices, to have something to speak of.
const V: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";

#[test]
fn the_smallest_file() {
    let file = good(format!("{V}f 1 2 3"));
    assert_eq!(file.faces, [[0, 1, 2]]);
    assert_eq!(file.points.len(), 10);
    assert_eq!([0, 1, 2].map(|i| world(&file, i)), [DVec3::ZERO, DVec3::X, DVec3::Y]);
    assert!(file.normals.is_none() && file.uvs.is_none() && file.face_materials.is_none());
    assert_eq!(file.materials, [MtlMaterial::default()]);
    assert_eq!(file.counts, Counts { vertices: 3, polygons: 1, triangles: 1, ..Counts::default() });
    assert!(file.warnings.is_empty());
}

#[test]
fn ways_to_write_the_same() {
    let plain = good(format!("{V}f 1 2 3\n"));
    for (name, text) in [
        ("CRLF", format!("{V}f 1 2 3\n").replace('\n', "\r\n")),
        ("tabs and blanks", "  v\t0  0 0 \n v 1 0\t0\nv 0 1 0\r\n\n  f\t1  2 3 \t\n".into()),
        ("byte order mark", format!("\u{feff}{V}f 1 2 3\n")),
        ("comments after data", "v 0 0 0 # note\nv 1 0 0# note\nv 0 1 0 #\nf 1 2 3 # 4 5\n".into()),
        ("continued lines", "v 0 0 0\nv 1 \\\n0 0\nv 0 1 0\nf 1 \\\r\n2 \\\n3\n".into()),
        ("comments do not continue", format!("# C:\\models\\\n{V}f 1 2 3 # \\\n")),
        ("weights", "v 0 0 0 1\nv 1 0 0 2\nv 0 1 0 0\nf 1 2 3".into()),
        ("negative indices", format!("{V}f -3 -2 -1")),
        ("forward references", format!("f 1 2 3\n{V}")),
        ("negative and forward", "v 0 0 0\nf -1 2 3\nv 1 0 0\nv 0 1 0".into()),
        ("exponents and signs", "v +0 0e0 -0\nv 1.0E0 .0 0.\nv 0 10e-1 0\nf +1 2 3".into()),
        ("trailing slashes", format!("{V}f 1/ 2// 3/")),
        ("names that are passed over", format!("g a b\ns 1\no c\n{V}f 1 2 3\ns off\n")),
        ("text that is not UTF-8", format!("# \u{fc}\n{V}f 1 2 3")),
    ] {
        let mut bytes = text.into_bytes();
        if name.ends_with("UTF-8") {
            bytes[2] = 0xff;
        }
        let file = good(bytes);
        assert_eq!(file.points, plain.points, "{name}");
        assert_eq!(file.faces, plain.faces, "{name}");
        assert_eq!(told(&file), [""; 0], "{name}");
    }
}

#[test]
fn errors_say_what_and_where() {
    for (text, want) in [
        ("f 1 2 9", "dir/a.obj:4:7: vertex index 9 does not exist: the file has 3 'v' lines"),
        ("f 1 2 0", "dir/a.obj:4:7: vertex index 0: indices count from 1, or back from -1"),
        ("f -4 2 1", "dir/a.obj:4:3: vertex index -4 does not exist: 3 'v' lines come before this one"),
        ("f 1/1 2 3", "dir/a.obj:4:5: texture index 1 does not exist: the file has 0 'vt' lines"),
        ("vn 0 0 1\nf 1//1 2//0 3//1", "dir/a.obj:5:11: normal index 0: indices count from 1, or back from -1"),
        (
            "vn 0 0 1\nf 1//6148914691236517206 2//1 3//1",
            "dir/a.obj:5:6: normal index 6148914691236517206 does not exist: the file has 1 'vn' lines",
        ),
        ("f 1 2 3x", "dir/a.obj:4:7: cannot read a corner at 'x': expected v, v/vt, v//vn or v/vt/vn"),
        ("f 1 2 a", "dir/a.obj:4:7: cannot read a corner at 'a': expected v, v/vt, v//vn or v/vt/vn"),
        ("f 1.5 2 3", "dir/a.obj:4:3: cannot read a corner at '.5': expected v, v/vt, v//vn or v/vt/vn"),
        ("f", "dir/a.obj:4:1: a face without corners: three or more are needed"),
        ("f # 1 2 3", "dir/a.obj:4:1: a face without corners: three or more are needed"),
        ("v 1 2", "dir/a.obj:4:6: the line ends where a number should be"),
        ("v 1 2 # 3", "dir/a.obj:4:7: the line ends where a number should be"),
        ("v 1,5 2 3", "dir/a.obj:4:3: '1,5' is not a number"),
        ("v 1 nan 3", "dir/a.obj:4:5: 'nan' is not a finite number"),
        ("v 1 2 -inf", "dir/a.obj:4:7: '-inf' is not a finite number"),
        ("v 1 2 1e400", "dir/a.obj:4:7: '1e400' is not a finite number"),
        ("v 1e301 2 1", "dir/a.obj:4:3: '1e301' is beyond the largest coordinate, 1e300"),
        ("vn 0 0", "dir/a.obj:4:7: the line ends where a number should be"),
        ("vt 1e39", "dir/a.obj:4:4: '1e39' is too large for a texture coordinate"),
        ("v 0 0 \\\n 1 2 \\\nx\nv \\\n x", "dir/a.obj:8:2: 'x' is not a number"),
        ("\n\u{e9} \u{e9}\nv \u{e9} 1 1", "dir/a.obj:6:3: '\u{e9}' is not a number"),
    ] {
        assert_eq!(error(format!("{V}{text}\nf 1 2 3\nf 8 9 7\n")), want, "{text}");
    }
    // The mark at the start takes no column.
    assert!(error("\u{feff}v x 0 0").starts_with("dir/a.obj:1:3: "));
}

#[test]
fn nothing_to_render() {
    for (text, want) in [
        ("", "the file is empty"),
        ("# nothing\n\n", "it has no 'v' and no 'f' line; is it an OBJ file?"),
        (V, "it has 3 vertices and no 'f' line"),
        ("v 0 0 0\nv 1 0 0\nl 1 2\np 1\n", "it has 1 lines and 1 points, which are not rendered"),
        ("v 0 0 0\nv 1 0 0\nf 1 2\n", "no face has three corners"),
        ("V 0 0 0\nF 1 1 1\n", "keywords must be written in lower case, 'v' and 'f'"),
        ("\0\u{1}PNG \0", "it looks like a binary file, not like OBJ text"),
    ] {
        assert_eq!(error(text), format!("dir/a.obj: no renderable faces: {want}"));
    }
}

#[test]
fn what_is_skipped_is_told_once_a_kind() {
    let file = good(format!(
        "{V}f 1 2 3\nl 1 2 3 4\nf 1 2\np 1\nf 3\nl 1 2\nfo 1 2 3\nF 1 2 3\ncurv 0 1\nfoo\nbar\nusemtl\nmtllib\n\
         v 0 0 0 0.5 0.5 0.5\nf 1 2 3\n"
    ));
    assert_eq!(
        told(&file),
        [
            "dir/a.obj:5: lines ('l') are not rendered: skipped (and 1 more like it)",
            "dir/a.obj:6: a face needs at least three corners: skipped (and 1 more like it)",
            "dir/a.obj:7: points ('p') are not rendered: skipped",
            "dir/a.obj:10: 'fo' is not supported: skipped",
            "dir/a.obj:11: 'F' is not understood, did you mean 'f'? Skipped",
            "dir/a.obj:12: 'curv' is not supported: skipped",
            "dir/a.obj:13: 'foo' is no keyword of the format: line skipped (and 1 more like it)",
            "dir/a.obj:15: 'usemtl' without a name: the default material is used",
            "dir/a.obj:16: 'mtllib' without a file name: skipped",
            "dir/a.obj:17: colours of vertices are not used",
        ]
    );
    assert_eq!((file.counts.polylines, file.counts.points, file.counts.short_faces), (2, 1, 2));
    assert_eq!((file.counts.polygons, file.counts.triangles), (4, 2));
}

#[test]
fn normals_and_texture_coordinates_keep_their_own_indices() {
    let file = good(format!(
        "{V}vt 0.25\nvt 0.5 0.75 9\nvn 0 0 2\nvn 0 0 0\nvn 3e200 0 -4e200\nf 1/2/1 2/1/3 3\nf 1//-1 2/2 3/-2/2\n"
    ));
    let (normals, uvs) = (file.normals.expect("some corners have one"), file.uvs.expect("some corners have one"));
    assert_eq!(normals.values, [0., 0., 1., 0., 0., 0., 0.6, 0., -0.8]);
    assert_eq!(uvs.values, [0.25, 0., 0.5, 0.75]);
    const NONE: u32 = CornerData::NONE;
    assert_eq!(normals.indices, Some(vec![[0, 2, NONE], [2, NONE, 1]]));
    assert_eq!(uvs.indices, Some(vec![[1, 0, NONE], [NONE, 1, 0]]));
    assert_eq!(normals.of(&file.faces, 0), [0, 2, NONE]);
    assert_eq!(normals.get::<3>(2), Some([0.6, 0., -0.8]));
    assert_eq!((normals.get::<3>(3), normals.get::<3>(NONE)), (None, None));
}

#[test]
fn indices_that_are_those_of_the_vertices_are_not_stored() {
    let file = good(format!("{V}vn 0 0 1\nvn 0 1 0\nvn 1 0 0\nvt 1 2\nf 1//1 2//2 3//3\nf 3//3 2//2 1//-3\n"));
    let normals = file.normals.expect("they are used");
    assert_eq!((normals.indices.as_ref(), normals.of(&file.faces, 1)), (None, [2, 1, 0]));
    assert!(file.uvs.is_none());
}

#[test]
fn what_is_not_wanted_is_not_stored_but_checked() {
    let text = format!("{V}vn 0 0 1\nvt 0 0\nf 1/1/1 2/1/1 3/1/1\n");
    let wanted = ReadOptions { normals: false, uv: Uv::Never, ..options() };
    let source = Source::memory(Path::new("a.obj"), text.as_bytes());
    let file = read::read(&source, &wanted, 64).expect("the text is fine");
    assert!(file.normals.is_none() && file.uvs.is_none());
    let source = Source::memory(Path::new("a.obj"), text.replace("3/1/1", "3/1/2").as_bytes());
    assert!(read::read(&source, &wanted, 64).is_err());
}

#[test]
fn polygons_are_split_with_all_their_indices() {
    // A convex quad, an arrow head whose notch faces the first corner's fan, a pentagon.
    let file = good(
        "v 0 0 0\nv 2 -1 0\nv 0.5 0 0\nv 2 1 0\nvn 1 0 0\nvn 0 1 0\nvn 0 0 1\nvn -1 0 0\n\
         f 1//4 2//3 4//2\nf 2//1 3//2 4//3 1//4\nf 1 2 3 4\nf 2 4 1 2\n",
    );
    assert_eq!((file.counts.polygons, file.counts.triangles), (4, 7));
    assert_eq!(file.faces[0], [0, 1, 3]);
    let normals = file.normals.as_ref().expect("some corners have one").indices.as_ref().expect("their own");
    for (of, face) in normals.iter().zip(&file.faces).skip(1).take(2) {
        // Vertex 2 (index 1) has normal 1 (index 0) in that face, and so on around.
        assert_eq!(*of, face.map(|v| [3, 0, 1, 2][v as usize]));
    }
    let area: f64 = file.faces[1..3]
        .iter()
        .map(|f| {
            let [a, b, c] = f.map(|i| world(&file, i as usize));
            (b - a).cross(c - a).z
        })
        .inspect(|a| assert!(*a > 0.0))
        .sum();
    assert!((area - 1.0).abs() < 1e-6, "{area}");
    assert!(file.counts.clipped >= 1);
}

#[test]
fn points_keep_their_bits_at_any_scale_and_offset() {
    for size in [1e-30, 1e-3, 1.0, 1e4, 1e30] {
        for offset in [0.0, 1e6] {
            let mut text = String::new();
            let place = |i: u32| DVec3::new(f64::from(i) * 0.37, 1.0 - f64::from(i * i % 17) * 0.05, offset) * size;
            for i in 0..50 {
                let p = place(i);
                writeln!(text, "v {:e} {:e} {:e}\nf -1 1 2", p.x, p.y, p.z).expect("a string takes all");
            }
            let file = good(&text);
            let mut reach = 0f32;
            for i in 0..50 {
                let exact = file.frame.to_local(place(i as u32)).as_vec3();
                assert_eq!(glam::Vec3::from_slice(&file.points[3 * i..]), exact, "vertex {i} of size {size:e}");
                reach = reach.max(exact.abs().max_element());
            }
            assert!((0.1..=2.0).contains(&reach), "size {size:e}, offset {offset:e}: {reach}");
        }
    }
}

/// A file with `before`, many vertices around `at`, and `after`; faces over the many.
fn crowd(before: &str, at: f64, size: f64, after: &str) -> String {
    let mut text = before.to_owned();
    for i in 0..3000 {
        let x = f64::from(i % 60) / 60.0;
        writeln!(text, "v {:e} {:e} {:e}\nf -1 -1 -1", at + size * x, size * x * x, at).expect("a string takes all");
    }
    text + "f -1 -2 -3\n" + after
}

#[test]
fn a_sample_that_misleads_is_put_right() {
    // All that is sampled is one point, and the rest far from it.
    let mut same = "v 5 5 5\n".repeat(40_000);
    same += "v 1e-30 0 0\nv 0 1e20 0\nv 3e20 0 1\nf -1 -2 -3\n";
    for (name, text, size) in [
        ("one point sampled", same, 3e20),
        ("a far vertex that no face uses", crowd("v 1e30 0 0\n", 1e3, 1.0, "v 0 1e290 0\n"), 1.0),
        ("a far vertex that a face uses", crowd("", 0.0, 1.0, "v 0 1e290 0\nf -1 -2 -3\n"), 1e290),
        ("far used and farther unused", crowd("", 0.0, 1.0, "v 0 1e45 0\nf -1 -2 -3\nv 1e100 0 0\n"), 1e45),
    ] {
        let file = parse_in(text.as_bytes(), 1 << 14).expect("the text is fine");
        assert!(file.points.iter().all(|x| x.is_finite()), "{name}");
        let reach = file
            .faces
            .iter()
            .flatten()
            .map(|&i| file.points[3 * i as usize..][..3].iter().fold(0f32, |m, x| m.max(x.abs())));
        let reach = reach.fold(0.0, f32::max);
        assert!(reach > 1e-5 && reach < 1e10, "{name}: {reach:e}");
        let world = f64::from(reach) * file.frame.world_per_local();
        assert!(world > 0.2 * size && world < 5.0 * size, "{name}: {world:e}");
    }
}

#[test]
fn many_vertices_without_a_sampled_neighbour_of_faces() {
    // Vertices are a thousandth of the file: the sample must still find them.
    let mut text = String::from("v 1e6 0 0\nv 1000001 0 0\nv 1e6 1 0\n");
    text += &"f 1 2 3\n".repeat(50_000);
    let file = parse_in(text.as_bytes(), 1 << 12).expect("the text is fine");
    assert!((file.frame.origin.x - 1e6).abs() <= 1.0, "{:?}", file.frame);
    assert_eq!(file.faces.len(), 50_000);
}

#[test]
fn cancelling_and_progress() {
    let stop = AtomicBool::new(true);
    let source = Source::memory(Path::new("a.obj"), format!("{V}f 1 2 3\n").as_bytes());
    let wanted = ReadOptions { cancel: &stop, ..options() };
    assert!(matches!(read::read(&source, &wanted, 8), Err(Error::Cancelled)));
    let told = std::sync::Mutex::new(Vec::new());
    let progress = |done, total| told.lock().expect("no test panics here").push((done, total));
    let wanted = ReadOptions { progress: Some(&progress), ..options() };
    read::read(&source, &wanted, 8).expect("the text is fine");
    let told = told.into_inner().expect("no test panics here");
    assert_eq!(told.iter().map(|t| t.0).max(), Some(2 * source.len));
    assert!(told.iter().all(|t| t.1 == 2 * source.len));
}

/// Lines of well-formed and odd kinds, to be put together at random.
fn line() -> impl Strategy<Value = String> {
    prop_oneof![
        8 => (-9.0..9.0f64, -9.0..9.0f64, -9.0..9.0f64).prop_map(|(x, y, z)| format!("v {x} {y:.3} {z:.1e}")),
        2 => Just("vn 0 1 2".to_owned()),
        2 => Just("vt 0.5 \\\n 0.5".to_owned()),
        6 => proptest::collection::vec((1..4u32, proptest::option::of(1..3u32)), 3..7).prop_map(|corners| {
            let corner = |(v, n): (u32, Option<u32>)| n.map_or(format!(" -{v}"), |n| format!(" -{v}//{n}"));
            format!("f{}", corners.into_iter().map(corner).collect::<String>())
        }),
        1 => "usemtl [ab]{0,2}".prop_map(|s| s),
        1 => "[a-zA-Z# ]{0,6}".prop_map(|s| s),
        1 => "[ -~]{0,9}".prop_map(|s| format!("#{s}")),
    ]
}

proptest! {
    #[test]
    fn pieces_and_threads_change_nothing(
        lines in proptest::collection::vec(line(), 0..40), crlf: bool, piece in 1u64..200, threads in 1usize..5
    ) {
        let end = if crlf { "\r\n" } else { "\n" };
        let text = format!("v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 1\nvn 0 1 0\nf 1 2 3\n{}", lines.join("\n")).replace('\n', end);
        let whole = format!("{:?}", parse_in(text.as_bytes(), u64::MAX));
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads can be had");
        let again = pool.install(|| format!("{:?}", parse_in(text.as_bytes(), piece)));
        prop_assert_eq!(whole, again);
    }

    #[test]
    fn random_bytes_never_panic(bytes in proptest::collection::vec(any::<u8>(), 0..300), piece in 1u64..100) {
        let _ = parse_in(&bytes, piece);
    }

    #[test]
    fn random_text_never_panics(text in "([vf#l][tn]? [-0-9./#e\\\\ ]{0,12}\r?\n){0,30}", piece in 1u64..100) {
        let whole = format!("{:?}", parse_in(text.as_bytes(), u64::MAX));
        prop_assert_eq!(whole, format!("{:?}", parse_in(text.as_bytes(), piece)));
    }
}
