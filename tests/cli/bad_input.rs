//! Bad input and bad targets: a clear message, its exit code, and nothing harmed.

use super::{Bench, TETRAHEDRON, text};

struct Case {
    name: &'static str,
    words: &'static str,
    code: i32,
    /// Each is part of the message.
    says: &'static [&'static str],
}

const CASES: &[Case] = &[
    Case {
        name: "missing file",
        words: "nowhere.obj -o out.png",
        code: 3,
        says: &["cannot read nowhere.obj", "caused by"],
    },
    Case { name: "a slip in the name", words: "b.obj -o out.png", code: 3, says: &["did you mean a.obj"] },
    Case { name: "a folder", words: "folder -o out.png", code: 3, says: &["folder", "director"] },
    Case { name: "empty file", words: "empty.obj -o out.png", code: 3, says: &["empty.obj", "faces"] },
    Case { name: "garbage", words: "garbage.obj -o out.png", code: 3, says: &["garbage.obj"] },
    Case {
        name: "an index too large",
        words: "range.obj -o out.png",
        code: 3,
        says: &["range.obj:9:7", "9 | f 1 2 9", "^"],
    },
    Case { name: "no number", words: "number.obj -o out.png", code: 3, says: &["number.obj:2:", "2 | v 1 x 0"] },
    Case { name: "no faces", words: "points.obj -o out.png", code: 3, says: &["points.obj", "faces"] },
    Case { name: "nothing to hit", words: "flat.obj -o out.png", code: 3, says: &["flat.obj"] },
    Case {
        name: "no such folder",
        words: "a.obj -o no/out.png",
        code: 4,
        says: &["no/out.png", "folder no does not exist"],
    },
    Case {
        name: "target is a folder",
        words: "a.obj -o folder",
        code: 4,
        says: &["cannot write folder", "is a folder"],
    },
    Case { name: "folder named like an image", words: "a.obj -o x.png", code: 4, says: &["cannot write x.png"] },
    Case {
        name: "nobody can write there",
        words: "a.obj -o /proc/out.png",
        code: 4,
        says: &["/proc/out.png", "caused by"],
    },
    Case { name: "write-protected", words: "a.obj -o kept.png", code: 4, says: &["kept.png", "write-protected"] },
    Case {
        name: "figures cannot be written",
        words: "a.obj -o out.png --stats no/s.json",
        code: 4,
        says: &["no/s.json"],
    },
    Case { name: "bad target before bad input", words: "nowhere.obj -o no/out.png", code: 4, says: &["no/out.png"] },
    Case { name: "no size", words: "a.obj --size 0x0", code: 2, says: &["--size", "1x1"] },
    Case { name: "half a size", words: "a.obj --size 100", code: 2, says: &["1280x720"] },
    Case { name: "too large", words: "a.obj --size 100000x100000", code: 6, says: &["240.0 GB", "--crop"] },
    Case {
        name: "too large before anything is read",
        words: "nowhere.obj --size 100000x100000",
        code: 6,
        says: &["--size"],
    },
    Case { name: "beyond counting", words: "a.obj --size 99999999999x9", code: 6, says: &["--size"] },
    Case { name: "the input as output", words: "a.png -o a.png", code: 2, says: &["a.png is the input"] },
    Case {
        name: "eye in the target",
        words: "a.obj --eye 1,1,1 --target 1,1,1 -o out.png",
        code: 2,
        says: &["eye", "target"],
    },
    Case { name: "up along the view", words: "a.obj --eye 0,5,0 --target 0,0,0 -o out.png", code: 2, says: &["up"] },
];

fn bench() -> Bench {
    use std::os::unix::fs::PermissionsExt;
    let bench = Bench::new();
    bench.write("empty.obj", "");
    bench.write("garbage.obj", (0..4000u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 24) as u8).collect::<Vec<_>>());
    bench.write("range.obj", format!("{TETRAHEDRON}f 1 2 9\n"));
    bench.write("number.obj", "v 0 0 0\nv 1 x 0\nv 0 1 0\nf 1 2 3\n");
    bench.write("points.obj", "v 0 0 0\nv 1 0 0\n");
    bench.write("flat.obj", "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n");
    bench.write("a.png", TETRAHEDRON);
    bench.write("kept.png", "mine");
    std::fs::set_permissions(bench.path("kept.png"), std::fs::Permissions::from_mode(0o444)).unwrap();
    std::fs::create_dir(bench.path("folder")).unwrap();
    std::fs::create_dir(bench.path("x.png")).unwrap();
    bench.write("out.png", "the old picture");
    bench
}

#[test]
fn each_is_refused_with_its_code_and_a_message_that_helps() {
    let bench = bench();
    let names = bench.names();
    for case in CASES {
        let out = bench.run(case.words);
        let said = text(&out.stderr);
        assert_eq!(out.status.code(), Some(case.code), "{}: {said}", case.name);
        assert!(said.starts_with("error: "), "{}: {said}", case.name);
        assert!(!said.contains("panicked") && !said.contains("internal error"), "{}: {said}", case.name);
        for want in case.says {
            assert!(said.contains(want), "{}: '{want}' in\n{said}", case.name);
        }
        assert!(out.stdout.is_empty(), "{}", case.name);
    }
    assert_eq!(bench.names(), names, "nothing is written, nothing is left behind");
    assert_eq!(bench.read("out.png"), b"the old picture");
    assert_eq!(bench.read("kept.png"), b"mine");
    assert_eq!(bench.read("a.png"), TETRAHEDRON.as_bytes());
}

#[test]
fn check_and_info_refuse_the_same_files() {
    let bench = bench();
    for name in
        ["nowhere.obj", "folder", "empty.obj", "garbage.obj", "range.obj", "number.obj", "points.obj", "flat.obj"]
    {
        for command in ["check", "info"] {
            let out = bench.expect(&format!("{command} {name}"), 3);
            assert!(out.stdout.is_empty() && text(&out.stderr).starts_with("error: "), "{command} {name}");
        }
    }
}

#[test]
fn the_old_image_is_replaced_only_by_a_whole_one() {
    let bench = bench();
    bench.expect("a.obj --size 40x30 -o out.png", 0);
    assert_eq!(super::decode_file(&bench.path("out.png")).0, 40);
    bench.expect("range.obj --size 50x30 -o out.png", 3);
    assert_eq!(super::decode_file(&bench.path("out.png")).0, 40);
}

#[test]
fn colour_is_for_terminals() {
    let bench = bench();
    assert!(!text(&bench.expect("nowhere.obj", 3).stderr).contains('\x1b'));
}

#[test]
fn warnings_do_not_stop_a_render_and_can_be_silenced() {
    let bench = bench();
    bench.write("odd.obj", format!("mtllib gone.mtl\nusemtl red\n{TETRAHEDRON}"));
    let said = |words: &str| text(&bench.expect(words, 0).stderr).contains("warning: ");
    assert!(said("odd.obj --size 20x20 -o odd.png"));
    assert!(!said("odd.obj --size 20x20 -o odd.png -q"));
}

#[test]
fn under_strict_a_warning_is_an_error_and_nothing_is_rendered() {
    let bench = bench();
    bench.write("odd.obj", format!("mtllib gone.mtl\nusemtl red\n{TETRAHEDRON}"));
    let names = bench.names();
    for words in ["odd.obj --strict -o odd.png", "odd.obj --strict -q -o odd.png", "check odd.obj --strict"] {
        let out = bench.expect(words, 3);
        let said = text(&out.stderr);
        assert!(said.lines().all(|l| l.starts_with("error: ")) && said.contains("gone.mtl"), "{words}: {said}");
        assert!(said.contains("--strict") && out.stdout.is_empty(), "{words}: {said}");
    }
    assert_eq!(bench.names(), names);
    bench.expect("a.obj --strict --size 20x20 -o fine.png", 0);
    bench.expect("check a.obj --strict", 0);
}

#[test]
fn only_some_of_many_warnings_unless_asked_for() {
    let bench = bench();
    let libraries: String = (0..8).map(|i| format!("mtllib gone{i}.mtl\n")).collect();
    bench.write("odd.obj", format!("{libraries}usemtl red\n{TETRAHEDRON}"));
    let warnings = |words: &str| {
        let out = bench.expect(words, 0);
        let said = text(&out.stderr).to_owned();
        (said.lines().filter(|l| l.starts_with("warning: ")).count(), said.contains("more (-v shows all)"))
    };
    assert_eq!(warnings("odd.obj --size 20x20 -o odd.png"), (6, true));
    assert_eq!(warnings("odd.obj --size 20x20 -o odd.png -v"), (9, false), "each library and the material");
    assert_eq!(warnings("check odd.obj"), (9, false));
}

#[test]
fn a_biased_lens_is_warned_of_where_there_is_a_lens() {
    let bench = bench();
    let said = |flags: &str| {
        let words = format!("a.obj --size 20x20 -o b.png --lens-sampler polar-uniform-radius {flags}");
        text(&bench.run(&words).stderr).matches("biased").count()
    };
    assert_eq!((said("--aperture 0.1"), said(""), said("--aperture 0.1 -q")), (1, 0, 0));
    bench.expect("a.obj --aperture 0.1 --lens-sampler polar-uniform-radius --strict -o c.png", 3);
    assert!(!bench.path("c.png").exists());
}
