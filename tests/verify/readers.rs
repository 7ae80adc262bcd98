//! Both OBJ readers on the same file.

use super::GO_ON;
use tison::scene::{Error, FreeMemory};
use tison::verify::readers::{Compared, compare};

const V: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0.3 0.1 0\nvn 0 0 2\nvt 0.25 0.75\n";

fn compared(text: impl AsRef<[u8]>) -> Result<Compared, Error> {
    let dir = tempfile::tempdir().expect("a temporary folder");
    let path = dir.path().join("a.obj");
    std::fs::write(&path, text).expect("it can be written");
    compare(&path, &[], &GO_ON, FreeMemory::UNKNOWN)
}

#[track_caller]
fn same(text: impl AsRef<[u8]>) -> Compared {
    let compared = compared(text).expect("both read it");
    assert_eq!((&compared.refused, &compared.differences), (&None, &vec![]));
    compared
}

#[test]
fn what_both_read_is_the_same_to_the_last_bit() {
    assert_eq!(same(format!("{V}f 1 2 3\nf -5/1 2//1 4/1/1\n")).made_up, 8);
    // Convex, concave, and with a corner on a straight side.
    let polygons = "f 1 2 3 4\nf 1 2 3 5\nf 1/1/1 2/1/1 3/1/1 4/1/1 5/1/1\no other\nf 4 3 2 1\n";
    assert_eq!(same(format!("{V}{polygons}")).triangles, 2 + 2 + 3 + 2);
    same(format!("{V}usemtl a\nf 1 2 3\nusemtl b\nf 1 2 4\nusemtl a\nf 2 3 4\n"));
    same(format!("{V}f 1 2 3\nusemtl b\nf 1 2 4\n"));
    let far = "v 500000.123456 4649776.223 112.9\nv 500001.5 4649776.223 112.9\nv 500000.1 4649777.75 113\n";
    same(format!("{far}f 1 2 3\n"));
}

#[test]
fn what_tobj_would_misread_is_kept_from_it() {
    // A weight, colours on some vertices, a line of three points, a byte order mark.
    same(format!("{V}v 2 0 0 2\nv 2 1 0 0\nf 1 6 7\n"));
    same(format!("{V}v 2 0 0 1 0 0\nv 2 1 0\nf 1 6 7\n"));
    assert_eq!(same(format!("{V}f 1 2 3\nl 1 2 3 4\np 1 2 3\n")).triangles, 1);
    same(format!("\u{feff}{V}f 1 2 3\n"));
}

#[test]
fn what_tobj_refuses_is_no_difference() {
    let refused = |text: &[u8]| {
        let compared = compared(text).expect("our own reader reads it");
        assert_eq!(compared.differences, []);
        compared.refused.expect("tobj does not")
    };
    assert_eq!(refused(format!("{V}f 1 2 \\\n3\n").as_bytes()), "line 8: face parse error");
    assert_eq!(refused(format!("{V}f 1 2 3 # note\n").as_bytes()), "line 8: face parse error");
    assert_eq!(refused(format!("{V}f 1 2 3\nusemtl\nf 1 2 4\n").as_bytes()), "line 9: material parse error");
    assert!(refused(&[V.as_bytes(), b"# \xff\nf 1 2 3\n"].concat()).contains("UTF-8"));
}

#[test]
fn a_file_that_no_reader_takes_is_an_error() {
    let error = compared(format!("{V}f 1 2 9\n")).expect_err("there is no vertex 9");
    assert!(matches!(error, Error::At { line: 8, .. }), "{error}");
}
