//! `--no-skip`: what can be switched off, and what the figures say then.

use crate::{Bench, text};
use serde_json::Value;
use tison::scene::Skip;

const SCENE: &str = "tison = 1
[render]
ambient = 0.2
[camera.main]
eye = [0, 1, 5]
target = [0, 0, 0]
[light.key]
position = [3, 5, 4]
[light.out]
position = [0, 5, 0]
color = 0
[[object]]
shape = 'sphere'
";

fn skipped(bench: &Bench, words: &str) -> Value {
    bench.expect(&format!("s.toml --size 40x30 -o s.pfm --stats s.json -q {words}"), 0);
    let stats: Value = serde_json::from_slice(&bench.read("s.json")).unwrap();
    stats["skipped"].clone()
}

#[test]
fn what_is_switched_off_says_so_and_the_picture_stays() {
    let bench = Bench::new();
    bench.write("s.toml", SCENE);
    let on = skipped(&bench, "");
    let picture = bench.read("s.pfm");
    assert!(!on.to_string().contains("--no-skip"), "{on}");
    assert_eq!(on["lights_without_power"], 1);
    assert!(on["shadow_rays_facing_away"].is_number() && on["packets_outside_bounds"].is_number(), "{on}");
    for &skip in Skip::ALL {
        let off = skipped(&bench, &format!("--no-skip {}", skip.name()));
        assert!(off.to_string().contains("off (--no-skip)"), "{}: {off}", skip.name());
        if skip.is_exact() {
            assert!(bench.read("s.pfm") == picture, "{}", skip.name());
        }
    }
    let two = skipped(&bench, "--no-skip dark-lights --no-skip bounds");
    for name in ["lights_without_power", "packets_outside_bounds"] {
        assert_eq!(two[name], "off (--no-skip)");
    }
    assert_eq!(two["lens"], on["lens"], "the others stay");
    let all = skipped(&bench, "--no-skip all");
    let still_on = |name: &str| all.get(name).is_some_and(|why| why != "off (--no-skip)");
    for name in ["lens", "pixel_jitter", "smooth_normals", "meshes", "shadow_rays_facing_away", "good_build"] {
        assert!(!still_on(name), "{name}: {all}");
    }
}

#[test]
fn an_unknown_name_lists_the_known_ones() {
    let bench = Bench::new();
    let out = bench.expect("a.obj --no-skip lenz", 2);
    let message = text(&out.stderr);
    for name in Skip::ALL.iter().map(|skip| skip.name()).chain(["all"]) {
        assert!(message.contains(name), "{name} in\n{message}");
    }
    assert_eq!(bench.names(), ["a.obj"]);
    for words in ["--help", "-h", "render --help"] {
        assert!(!text(&bench.expect(words, 0).stdout).contains("no-skip"), "{words}");
    }
    let config = bench.expect("a.obj --no-skip powf --print-config", 0);
    assert!(
        text(&config.stdout)
            .lines()
            .any(|line| line.split_whitespace().collect::<Vec<_>>() == ["no-skip", "powf", "flag"])
    );
}

#[test]
fn the_bench_compares_what_it_measures() {
    let bench = Bench::new();
    bench.write("s.toml", SCENE);
    let out = bench.expect("bench skip --only jitter,uv --rounds 1 --backend native --json b.json -o b.html", 0);
    let table = text(&out.stdout);
    assert_eq!(table.matches("same bytes").count(), 2, "{table}");
    let json: Value = serde_json::from_slice(&bench.read("b.json")).unwrap();
    let rows = json["sections"]["skips"]["data"].as_array().unwrap();
    assert_eq!(rows.iter().map(|row| row["skip"].as_str().unwrap()).collect::<Vec<_>>(), ["jitter", "uv"]);
    for row in rows {
        assert!(row["left_out"].as_u64().unwrap() > 0 && row["ratio"].as_f64().unwrap() > 0.0, "{row}");
    }
    assert!(text(&bench.read("b.html")).contains("<svg"));
    // Somebody's files: one with a dark light, one without any.
    let out = bench.expect("bench skip s.toml a.obj --only dark-lights --rounds 1 --csv -", 0);
    let rows: Vec<&str> = text(&out.stdout).lines().skip(1).collect();
    assert!(rows[0].contains("s.toml") && rows[1].contains("a.obj"), "{rows:?}");
    assert!(rows[0].contains("same bytes") && rows[1].contains("same bytes"), "{rows:?}");
    assert_eq!(bench.expect("bench skip nothing.toml", 3).status.code(), Some(3));
    bench.expect("bench skip --only lenz", 2);
}
