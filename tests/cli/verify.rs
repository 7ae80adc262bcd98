//! `verify`, `--obj-reader` and `--backend both`: the contract.

use super::{Bench, TETRAHEDRON, text};
use serde_json::Value;

fn json(bytes: &[u8]) -> Value {
    serde_json::from_slice(bytes).expect("one JSON object")
}

#[test]
fn readers_are_compared_without_backends() {
    let bench = Bench::new();
    let out = bench.expect("verify --readers a.obj", 0);
    assert!(text(&out.stdout).contains("readers   a.obj: 4 triangles, all the same"), "{}", text(&out.stdout));
    assert!(text(&out.stdout).ends_with("\nreaders agree\n") && out.stderr.is_empty());
    bench.write("b.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 \\\n3\n");
    let out = bench.expect("verify --readers b.obj", 0);
    assert!(text(&out.stdout).contains("tobj cannot read it (line 4: face parse error)"), "{}", text(&out.stdout));
    let out = bench.expect("verify --readers --json b.obj", 0);
    let told = json(&out.stdout);
    assert_eq!((&told["agree"], &told["backends"]), (&Value::Bool(true), &Value::Null));
    assert_eq!(told["readers"][0]["refused"], "line 4: face parse error");
}

#[test]
fn a_difference_of_the_readers_has_an_exit_code_and_a_line() {
    let bench = Bench::new();
    // tobj takes an indented statement for a material of that name.
    bench.write("c.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl blue\nf 1 2 3\n usemtl red\nf 3 2 1\n");
    let out = bench.expect("verify --readers c.obj", 5);
    let told = text(&out.stdout);
    assert!(told.contains("materials differ once, first in line 7: own 'red', tobj 'default'"), "{told}");
    assert!(told.contains("DISAGREE"), "{told}");
    let told = json(&bench.expect("verify --readers --json c.obj", 5).stdout);
    assert_eq!(told["agree"], false);
    assert_eq!(told["readers"][0]["differences"][0]["line"], 7);
}

#[test]
fn a_scene_has_the_readers_of_its_meshes_compared() {
    let bench = Bench::new();
    bench.write("s.toml", "tison = 1\n[[object]]\nmesh = \"a.obj\"\n[[object]]\nshape = \"sphere\"\n");
    let told = json(&bench.expect("verify --readers --json s.toml", 0).stdout);
    assert_eq!(told["readers"].as_array().map(Vec::len), Some(1));
    assert_eq!(told["readers"][0]["triangles"], 4);
    bench.write("t.toml", "tison = 1\n[[object]]\nshape = \"sphere\"\n");
    let out = bench.expect("verify --readers t.toml", 0);
    assert!(text(&out.stdout).contains("no OBJ file"), "{}", text(&out.stdout));
}

#[test]
fn what_verify_cannot_use() {
    let bench = Bench::new();
    bench.expect("verify", 2);
    bench.expect("verify none.obj --readers", 3);
    bench.expect("verify a.obj --rays 0", 2);
    bench.expect("verify a.obj --readers -D render.samples=4", 2);
    bench.expect("verify a.obj --readers --json=none/out.json", 4);
    bench.write("bad.obj", "v 0 0 0\nf 1 2 3\n");
    bench.expect("verify bad.obj --readers", 3);
}

#[test]
fn both_readers_make_the_same_picture() {
    let bench = Bench::new();
    bench.write("p.obj", "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0.3 0.1 0.2\nusemtl x\nf 1 2 3 4\nf 1 2 3 5\n");
    for name in ["a.obj", "p.obj"] {
        let options = "--backend native --size 40x30 -q";
        bench.expect(&format!("{name} {options} -o own.png"), 0);
        bench.expect(&format!("{name} {options} -o tobj.png --obj-reader tobj"), 0);
        assert_eq!(bench.read("own.png"), bench.read("tobj.png"), "{name}");
    }
    bench.expect("check a.obj --obj-reader tobj", 0);
    let counts = |words: &str| json(&bench.expect(words, 0).stdout)["scene"]["triangles"].clone();
    assert_eq!(counts("info a.obj --json --obj-reader tobj"), counts("info a.obj --json"));
    bench.write("bad.obj", format!("{TETRAHEDRON}f 1 2 3 # a note\n"));
    bench.expect("check bad.obj", 0);
    let out = bench.expect("check bad.obj --obj-reader tobj", 3);
    assert!(text(&out.stderr).contains("bad.obj:9: tobj cannot read it: face parse error"), "{}", text(&out.stderr));
    bench.write("nan.obj", "v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    let out = bench.expect("check nan.obj --obj-reader tobj", 3);
    assert!(text(&out.stderr).contains("not finite"), "{}", text(&out.stderr));
    bench.expect("check a.obj --obj-reader other", 2);
}

#[test]
fn libraries_stay_in_their_folders_for_either_reader() {
    let bench = Bench::new();
    std::fs::create_dir(bench.path("sub")).unwrap();
    bench.write("secret.mtl", "newmtl x\nKd 1 0 0\n");
    bench.write("sub/a.obj", format!("mtllib ../secret.mtl\nusemtl x\n{TETRAHEDRON}"));
    for reader in ["own", "tobj"] {
        let out = bench.expect(&format!("check sub/a.obj --obj-reader {reader}"), 3);
        assert!(text(&out.stderr).contains("--allow-path"), "{}", text(&out.stderr));
        bench.expect(&format!("check sub/a.obj --obj-reader {reader} --allow-path ."), 0);
    }
}

#[cfg(not(feature = "embree"))]
#[test]
fn without_embree_there_is_nothing_to_compare() {
    let bench = Bench::new();
    let out = bench.expect("verify a.obj", 2);
    assert!(text(&out.stderr).contains("--readers"), "{}", text(&out.stderr));
    bench.expect("a.obj --backend both -q", 2);
}

#[cfg(feature = "embree")]
mod with_embree {
    use super::*;

    #[test]
    fn backends_agree_over_a_mesh() {
        let bench = Bench::new();
        let out = bench.expect("verify a.obj --rays 2000 --json=told.json", 0);
        let table = text(&out.stdout);
        for word in ["camera, packets", "shadow", "silhouettes", "grazing", "real", "backends and readers agree"] {
            assert!(table.contains(word), "{word} is not in\n{table}");
        }
        let told = json(&bench.read("told.json"));
        assert_eq!(told["agree"], true);
        let [w, h] = [0, 1].map(|i| told["size"][i].as_u64().unwrap());
        assert!((1900..2100).contains(&(w * h)), "a picture of about as many rays: {w}x{h}");
        assert_eq!(told["backends"]["groups"]["camera"]["rays"], w * h);
        assert_eq!(told["backends"]["groups"]["at vertices"]["rays"], 2000);
        assert_eq!(told["backends"]["unexplained"], 0);
        assert_eq!(told["backends"]["all"]["real"], 0);
    }

    #[test]
    fn the_same_seed_sends_the_same_rays() {
        let bench = Bench::new();
        let told = |more: &str| {
            let mut told = json(&bench.expect(&format!("verify a.obj --size 64x48 --json {more}"), 0).stdout);
            told["seconds"] = Value::Null;
            told
        };
        assert_eq!(told("-j 1"), told("-j 3"));
        assert_ne!(told("")["backends"], told("--seed 2")["backends"]);
    }

    #[test]
    fn a_scene_of_shapes_is_verified_by_its_own_camera() {
        let bench = Bench::new();
        let scene = "tison = 1\n[render]\nsize = [60, 40]\n[camera.main]\neye = [0, 0, 5]\ntarget = [0, 0, 0]\n\
                     [light.l]\nposition = [3, 3, 3]\n[material]\nred = { color = [1, 0, 0] }\n\
                     [[object]]\nshape = \"sphere\"\nmaterial = \"red\"\n";
        bench.write("s.toml", scene);
        let told = json(&bench.expect("verify s.toml --json", 0).stdout);
        assert_eq!(told["size"], serde_json::json!([60, 40]));
        let groups = &told["backends"]["groups"];
        assert!(groups["camera"]["hits"].as_u64() > Some(300) && groups["shadow"]["rays"].as_u64() > Some(100));
    }

    #[test]
    fn both_backends_make_pictures_and_their_difference() {
        let bench = Bench::new();
        let out = bench.expect("a.obj --backend both --size 40x30 -o o.png -o o.exr --stats s.json --aov depth", 0);
        let names = ["o.png", "o.depth.png", "o.native.png", "o.native.depth.png", "o.diff.png", "o.exr"];
        let there = bench.names();
        assert!(names.iter().all(|n| there.iter().any(|t| t == n)), "{there:?}");
        assert!(there.contains(&"o.diff.exr".to_owned()) && !there.contains(&"o.diff.depth.png".to_owned()));
        assert!(text(&out.stderr).contains("pixels differ, RMSE"), "{}", text(&out.stderr));
        let told = json(&bench.read("s.json"));
        assert_eq!(told["backend"], "both");
        let comparison = &told["comparison"];
        assert_eq!(comparison["pixels"], 40 * 30);
        assert!(comparison["seconds"]["native"]["render"].as_f64() > Some(0.0));
        assert!(comparison["rmse"].as_f64() < Some(0.1));
        bench.expect("a.obj --backend embree --size 40x30 -o e.png -q", 0);
        bench.expect("a.obj --backend native --size 40x30 -o n.png -q", 0);
        let pixels = |name: &str| super::super::decode(&bench.read(name));
        assert_eq!(pixels("e.png"), pixels("o.png"));
        assert_eq!(pixels("n.png"), pixels("o.native.png"));
    }

    #[test]
    fn pictures_of_both_are_checked_before_anything_is_done() {
        let bench = Bench::new();
        bench.expect("a.obj --backend both -o -", 2);
        bench.expect("a.obj --backend both -o /dev/null --size 4x4", 2);
        bench.expect("a.obj --backend both --pixel 3,3", 2);
        bench.expect("a.obj --backend both -o o.png -o o.native.png", 2);
        bench.write("o.diff.png", "x");
        let mut permissions = std::fs::metadata(bench.path("o.diff.png")).unwrap().permissions();
        permissions.set_readonly(true);
        std::fs::set_permissions(bench.path("o.diff.png"), permissions).unwrap();
        bench.expect("a.obj --backend both -o o.png --size 4x4", 4);
        assert_eq!(bench.names(), ["a.obj", "o.diff.png"]);
        let out = bench.expect("a.obj --backend both --print-config", 0);
        assert!(text(&out.stdout).lines().any(|l| l.contains("backend") && l.contains("both")));
    }
}
