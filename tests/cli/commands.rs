//! Commands, flags and streams.

use super::{Bench, text};
use serde_json::Value;

#[test]
fn version_names_tison_and_embree() {
    let out = Bench::new().expect("--version", 0);
    let embree = if cfg!(feature = "embree") { "(Embree 4." } else { "(without Embree)" };
    let version = text(&out.stdout);
    assert!(
        version.starts_with(concat!("tison ", env!("CARGO_PKG_VERSION"), " ")) && version.contains(embree),
        "{version}"
    );
}

#[test]
fn help_is_on_stdout_when_asked_for_and_on_stderr_when_needed() {
    let bench = Bench::new();
    for words in ["--help", "-h", "render --help", "info --help"] {
        let out = bench.expect(words, 0);
        assert!(text(&out.stdout).contains("Usage: tison") && out.stderr.is_empty(), "{words}");
    }
    let out = bench.expect("", 2);
    assert!(out.stdout.is_empty() && text(&out.stderr).contains("Usage: tison"));
}

#[test]
fn mistakes_name_the_nearest_right_word() {
    let bench = Bench::new();
    let cases = [
        ("a.obj --sise 3x3", "--size"),
        ("a.obj --aov dept", "'depth'"),
        ("a.obj --backend nativ", "'native'"),
        ("a.obj --camera tpo", "'top'"),
        ("a.obj -o a.pgn", ".png"),
        ("a.obj b.obj", "one file"),
        ("chek", "tison check"),
    ];
    for (words, want) in cases {
        let out = bench.run(words);
        assert_eq!(out.status.code(), Some(if words == "chek" { 3 } else { 2 }), "{words}");
        assert!(text(&out.stderr).contains(want), "{words}: {}", text(&out.stderr));
        assert!(out.stdout.is_empty(), "{words}");
    }
    assert_eq!(bench.names(), ["a.obj"], "a mistake writes nothing");
}

#[test]
fn nothing_is_accepted_and_ignored() {
    let bench = Bench::new();
    for words in [
        "a.obj -o a.exr --exposure 2",
        "a.obj -o a.exr --tonemap aces",
        "a.obj --tonemap stretch --exposure 2",
        "a.obj -D render.samples=4",
        "check a.obj -D render.samples=4",
        "info a.obj -D render.samples=4",
        "a.obj --focus 2",
        "info a.obj --size 3x3",
        "info a.obj --strict",
        "check a.obj --json",
        "man --json",
    ] {
        bench.expect(words, 2);
    }
    assert_eq!(bench.names(), ["a.obj"]);
}

#[test]
fn bare_and_with_the_subcommand_it_is_the_same() {
    let bench = Bench::new();
    bench.expect("a.obj --size 40x30 -o bare.png", 0);
    bench.expect("render a.obj --size 40x30 -o sub.png", 0);
    assert!(bench.read("bare.png") == bench.read("sub.png"));
}

#[test]
fn streams_carry_what_they_should() {
    let bench = Bench::new();
    let out = bench.expect("a.obj --size 40x30", 0);
    assert!(out.stdout.is_empty());
    let summary = text(&out.stderr);
    for want in
        ["4 triangles", "40x30", "camera", "shadow", "Mrays/s", "read ", "build ", "peak memory", "wrote     a.png"]
    {
        assert!(summary.contains(want), "{want} in\n{summary}");
    }
    assert!(!summary.contains('\x1b'), "no colours but on a terminal");
    let out = bench.expect("a.obj --size 40x30 -q", 0);
    assert!(out.stdout.is_empty() && out.stderr.is_empty());
    let out = bench.expect("a.obj --size 40x30 -v", 0);
    assert!(text(&out.stderr).contains("--eye "));
}

#[test]
fn a_reader_that_leaves_is_no_error() {
    let bench = Bench::new();
    let tison = env!("CARGO_BIN_EXE_tison");
    for words in ["info a.obj --json", "man", "a.obj --size 300x300 -q -o -", "--help"] {
        let script = format!("{{ {tison} {words}; echo $? >code; }} | true");
        let out = assert_cmd::Command::new("sh").current_dir(bench.dir.path()).args(["-c", &script]).output().unwrap();
        assert_eq!(text(&out.stderr), "", "{words}");
        assert_eq!(text(&bench.read("code")).trim(), "0", "{words}");
    }
}

#[test]
fn stats_have_the_keys_that_others_read() {
    let bench = Bench::new();
    bench.expect("a.obj --size 40x30 --stats s.json -j 2", 0);
    let stats: Value = serde_json::from_slice(&bench.read("s.json")).unwrap();
    let wanted = [
        ("", "tison backend embree threads image scene seconds rays mrays_per_s peak_rss_bytes skipped error adaptive"),
        ("image", "width height spp_mean"),
        ("scene", "triangles degenerate spheres cubes cylinders quads instances lights materials textures"),
        ("seconds", "read textures build render write total"),
        ("rays", "camera shadow reflected refracted for_error_estimate"),
        ("error", "cut_off_max cut_off_mean sampling_rmse_estimate cut_off_is_estimate non_finite_samples"),
    ];
    for (part, keys) in wanted {
        let object = if part.is_empty() { &stats } else { &stats[part] };
        for key in keys.split(' ') {
            assert!(object.get(key).is_some(), "{part}.{key}");
        }
    }
    assert_eq!(stats["image"]["width"], 40);
    assert_eq!(stats["image"]["height"], 30);
    assert_eq!(stats["image"]["spp_mean"], 1.0);
    assert_eq!(stats["scene"]["triangles"], 4);
    assert_eq!(stats["scene"]["lights"], 2);
    assert_eq!(stats["threads"], 2);
    assert_eq!(stats["rays"]["camera"], 1200);
    assert!(stats["rays"]["shadow"].as_u64().unwrap() > 0);
    for name in ["refraction", "textures", "area_lights", "absorption", "lens", "pixel_jitter", "user_geometry"] {
        assert!(stats["skipped"][name].is_string(), "{name}");
    }
    assert!(stats["skipped"].get("meshes").is_none() && stats["skipped"].get("specular").is_none());
    assert!(stats["peak_rss_bytes"].as_u64().unwrap() > 1_000_000);
    let seconds = &stats["seconds"];
    let sum: f64 = ["read", "build", "render", "write"].iter().map(|s| seconds[s].as_f64().unwrap()).sum();
    assert!(sum > 0.0 && sum <= seconds["total"].as_f64().unwrap());
}

#[test]
fn stats_on_stdout_are_json_and_nothing_else() {
    let bench = Bench::new();
    let out = bench.expect("a.obj --size 40x30 --stats - --backend native", 0);
    let stats: Value = serde_json::from_slice(&out.stdout).unwrap();
    assert_eq!(stats["backend"], "native");
}

#[test]
fn info_tells_what_is_there() {
    let bench = Bench::new();
    let out = bench.expect("info a.obj", 0);
    let told = text(&out.stdout);
    for want in [
        "triangles  4",
        "vertices   4",
        "0, 0, 0 to 1, 1, 1",
        "needs      specular, shadow rays",
        "needs not  reflection",
    ] {
        assert!(told.contains(want), "{want} in\n{told}");
    }
    let info: Value = serde_json::from_slice(&bench.expect("info a.obj --json", 0).stdout).unwrap();
    assert_eq!(info["scene"]["triangles"], 4);
    assert_eq!(info["bounds"]["max"], serde_json::json!([1.0, 1.0, 1.0]));
    assert_eq!(info["materials"].as_array().unwrap().len(), 1);
    assert_eq!(info["needs"]["refraction"], false);
    assert!(info["memory"]["scene_bytes"].as_u64().unwrap() > 48);
    assert_eq!(bench.names(), ["a.obj"]);
}

#[test]
fn check_says_ok_and_shows_warnings() {
    let bench = Bench::new();
    let out = bench.expect("check a.obj", 0);
    assert_eq!(text(&out.stdout), "a.obj: ok\n");
    assert!(out.stderr.is_empty());
    bench.write("b.obj", format!("mtllib gone.mtl\nusemtl red\n{}", super::TETRAHEDRON));
    let out = bench.expect("check b.obj", 0);
    let warnings = text(&out.stderr);
    assert!(warnings.lines().all(|l| l.starts_with("warning: b.obj:")) && warnings.contains("gone.mtl"), "{warnings}");
    let count = warnings.lines().count();
    let want = if count == 1 { "1 warning".into() } else { format!("{count} warnings") };
    assert_eq!(text(&out.stdout), format!("b.obj: ok, with {want}\n"));
}

#[test]
fn examples_are_listed_and_written() {
    let bench = Bench::new();
    assert!(text(&bench.expect("example", 0).stdout).contains("mesh"));
    bench.expect("example mesh --triangles 2000 -o ball.obj", 0);
    let info: Value = serde_json::from_slice(&bench.expect("info ball.obj --json", 0).stdout).unwrap();
    let triangles = info["scene"]["triangles"].as_u64().unwrap();
    assert!(triangles.abs_diff(2000) < 300, "{triangles}");
    assert_eq!(bench.names(), ["a.obj", "ball.obj"]);
    bench.expect("example mesh --triangles 0 -o b.obj", 2);
    bench.expect("example mesh --triangles 100000000000000 -o b.obj", 2);
    bench.expect("example mesh --triangles 20 -o no/b.obj", 4);
    bench.expect("example nonsense", 2);
    assert_eq!(bench.names(), ["a.obj", "ball.obj"]);
}

#[test]
fn the_example_scene_goes_to_a_file_or_to_stdout_and_over_nobodys_work() {
    let bench = Bench::new();
    assert!(text(&bench.expect("example", 0).stdout).contains("example scene -o scene.toml"));
    bench.expect("example scene -o scene.toml", 0);
    assert!(bench.read("scene.toml") == bench.expect("example scene", 0).stdout);
    bench.expect("example scene -o scene.toml", 0);
    bench.write("scene.toml", "mine");
    assert!(text(&bench.expect("example scene -o scene.toml", 4).stderr).contains("already"));
    assert_eq!(bench.read("scene.toml"), b"mine");
    bench.expect("example scene -o no/scene.toml", 4);
}

#[test]
fn settings_of_a_mesh_and_where_they_come_from() {
    let bench = Bench::new();
    let words = "a.obj --print-config --spp 4 --fov 30 --aov depth -j 2 -o x.exr";
    let out = bench.expect(words, 0);
    let told = text(&out.stdout);
    let rows: Vec<Vec<&str>> = told.lines().map(|l| l.split_whitespace().collect()).collect();
    for want in [
        ["size", "1280x720", "default"],
        ["spp", "4", "flag"],
        ["recursion", "8", "default"],
        ["camera", "three-quarter", "default"],
        ["fov", "30", "flag"],
        ["up", "0,1,0", "default"],
        ["tonemap", "none", "default"],
        ["threads", "2", "flag"],
        ["output", "x.exr", "flag"],
        ["aov", "depth", "flag"],
    ] {
        assert!(rows.iter().any(|r| r[..] == want), "{want:?} in\n{told}");
    }
    assert!(out.stderr.is_empty());
    assert_eq!(bench.names(), ["a.obj"], "nothing is rendered");
}

#[test]
fn completions_and_manual_come_from_the_same_flags() {
    let bench = Bench::new();
    for shell in ["bash", "zsh", "fish"] {
        let out = bench.expect(&format!("completions {shell}"), 0);
        assert!(text(&out.stdout).contains("turntable"), "{shell}");
    }
    let page = bench.expect("man", 0).stdout;
    let page = text(&page);
    assert!(page.contains(".TH tison") && page.contains("turntable") && page.contains("Exit codes"));
    bench.expect("completions tcsh", 2);
}

#[test]
fn progress_as_json_lines() {
    let bench = Bench::new();
    let out = bench.expect("a.obj --size 400x300 --spp 40 --progress json", 0);
    let lines: Vec<Value> =
        text(&out.stderr).lines().filter(|l| l.starts_with('{')).map(|l| serde_json::from_str(l).unwrap()).collect();
    for line in &lines {
        assert!(line["stage"].is_string() && line["elapsed_s"].as_f64().unwrap() >= 0.5);
        assert!((0.0..=1.0).contains(&line["done"].as_f64().unwrap()));
    }
    let out = bench.expect("a.obj --size 40x30 --progress json", 0);
    assert!(!text(&out.stderr).contains('{'), "silent below half a second");
}

#[test]
fn bench_stability_reports_as_text_json_and_page() {
    let bench = Bench::new();
    let out = bench.expect("bench stability --only leaks --rays 1000 -o page.html --json all.json", 0);
    let table = text(&out.stdout);
    assert!(table.contains("Leaks of closed meshes") && table.contains("at vertices"), "{table}");
    assert_eq!(bench.names(), ["a.obj", "all.json", "page.html"]);
    let json: Value = serde_json::from_slice(&bench.read("all.json")).unwrap();
    let cases = json["sections"]["leaks"]["data"].as_array().unwrap();
    assert!(cases.len() >= 20);
    for case in cases.iter().filter(|c| c["who"] == "native") {
        assert_eq!((&case["leaks"], &case["rays"]), (&0.into(), &1000.into()), "{case}");
    }
    let page = bench.read("page.html");
    assert!(text(&page).starts_with("<!DOCTYPE html>") && text(&page).contains("--only leaks --rays 1000"));
    let out = bench.expect("bench stability --only leaks --rays 10 --json -", 0);
    assert!(serde_json::from_slice::<Value>(&out.stdout).is_ok());
    bench.expect("bench stability --only leaks -o none/page.html", 4);
    bench.expect("bench stability --only leak", 2);
    bench.expect("bench stability --rays 0", 2);
}

#[test]
fn bench_speed_compares_the_backends() {
    let bench = Bench::new();
    let out = bench.expect("bench speed a.obj --rounds 1 --json -", 0);
    let json: Value = serde_json::from_slice(&out.stdout).unwrap();
    let rows = json["sections"]["one_thread"]["data"].as_array().unwrap();
    assert_eq!(rows.len(), 8, "reading, building, five kinds of rays, and a whole render");
    for row in rows {
        assert!(row["scene"] == "a.obj" && row["native"].as_f64().unwrap() > 0.0, "{row}");
        let no_embree = cfg!(not(feature = "embree")) || row["what"] == "load";
        assert_eq!(row["embree"].is_null(), no_embree, "{row}");
    }
    bench.expect("bench speed none.obj", 3);
    bench.expect("bench speed --rounds 0", 2);
}
