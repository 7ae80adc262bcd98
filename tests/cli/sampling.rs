//! How many samples, and what the picture says about its error.

use super::{Bench, text};
use serde_json::Value;
use std::path::Path;

/// An edge or two of a tetrahedron before a plain background.
const SMALL: &str = "a.obj --size 64x48 --seed 3";

fn stats(bench: &Bench) -> Value {
    serde_json::from_slice(&bench.read("s.json")).unwrap()
}

/// Texts of a PNG, by keyword.
fn texts(path: &Path) -> Vec<(String, String)> {
    let reader = png::Decoder::new(std::io::BufReader::new(std::fs::File::open(path).unwrap())).read_info().unwrap();
    let info = reader.info();
    info.uncompressed_latin1_text.iter().map(|t| (t.keyword.clone(), t.text.clone())).collect()
}

#[test]
fn a_target_ends_the_render_and_is_told() {
    let bench = Bench::new();
    let out = bench.expect(&format!("{SMALL} --target-error 0.002 --stats s.json -o a.png -o a.exr"), 0);
    let stats = stats(&bench);
    let estimate = stats["error"]["sampling_rmse_estimate"].as_f64().unwrap();
    assert!(estimate > 0.0005 && estimate <= 0.002, "{estimate}");
    assert_eq!(stats["adaptive"]["ended"], "enough");
    let spp = stats["image"]["spp_mean"].as_f64().unwrap();
    assert!(spp > 16.0 && spp < 4096.0, "{spp}");
    let camera = stats["rays"]["camera"].as_f64().unwrap();
    assert!((camera / (64.0 * 48.0) - spp).abs() < 1e-9, "rays to compare with are counted apart");
    assert!(stats["rays"]["for_error_estimate"].as_u64().unwrap() > 0);
    let said = text(&out.stderr);
    assert!(said.contains("ended as the error is at most 0.002"), "{said}");
    let certificate = texts(&bench.path("a.png")).into_iter().find(|(keyword, _)| keyword == "Error").unwrap().1;
    assert!(
        certificate.contains(&format!("sampling about {estimate:.2e} RMSE; 0 non-finite samples")),
        "{certificate}"
    );
    assert!(said.contains(&certificate));
    let exr = bench.read("a.exr");
    assert!(exr.windows(certificate.len()).any(|w| w == certificate.as_bytes()), "the same in the EXR");
}

#[test]
fn clean_pixels_stop_and_a_map_shows_it() {
    let bench = Bench::new();
    bench.expect(&format!("{SMALL} --spp 256 --adaptive --aov samples --stats s.json -o a.pfm"), 0);
    let adaptive = stats(&bench);
    let early = adaptive["skipped"]["pixels_that_need_no_more"].as_u64().unwrap();
    assert_eq!(adaptive["adaptive"]["pixels_stopped_early"], early);
    let map = bench.read("a.samples.pfm");
    let counts = map[map.len() - 4 * 64 * 48..].as_chunks().0.iter().map(|b| f32::from_le_bytes(*b));
    assert_eq!(counts.clone().filter(|&n| n < 256.0).count() as u64, early);
    assert!(early > 64 * 48 / 2 && counts.clone().any(|n| n == 256.0) && counts.clone().all(|n| n >= 16.0));
    let mean = counts.map(f64::from).sum::<f64>() / (64.0 * 48.0);
    assert!((mean - adaptive["image"]["spp_mean"].as_f64().unwrap()).abs() < 1e-9);
    bench.expect(&format!("{SMALL} --spp 256 --adaptive=0.5 --stats s.json -o b.pfm"), 0);
    assert!(stats(&bench)["image"]["spp_mean"].as_f64().unwrap() < mean, "a larger share stops earlier");
}

#[test]
fn time_is_a_limit() {
    let bench = Bench::new();
    let out = bench.expect("a.obj --size 200x200 --time-limit 0.2 --stats s.json -o a.png", 0);
    assert_eq!(stats(&bench)["adaptive"]["ended"], "time");
    assert!(stats(&bench)["image"]["finished"] == 1.0);
    assert!(text(&out.stderr).contains("ended as 0.2 seconds are over"), "{}", text(&out.stderr));
}

#[test]
fn the_most_samples_may_be_too_few() {
    let bench = Bench::new();
    let out = bench.expect(&format!("{SMALL} --spp 32 --target-error 1e-6 --stats s.json -o a.png"), 0);
    assert_eq!(stats(&bench)["adaptive"]["ended"], "most samples");
    assert!(text(&out.stderr).contains("ended as 32 samples are the most a pixel may get"));
}

#[test]
fn the_estimate_can_be_left_out_and_changes_nothing() {
    let bench = Bench::new();
    bench.expect(&format!("{SMALL} --spp 8 --stats s.json -o a.pfm"), 0);
    let with = stats(&bench);
    bench.expect(&format!("{SMALL} --spp 8 --no-error-estimate --stats s.json -o b.pfm"), 0);
    let without = stats(&bench);
    assert!(bench.read("a.pfm") == bench.read("b.pfm"));
    assert!(with["error"]["sampling_rmse_estimate"].as_f64().unwrap() > 0.0);
    assert!(without["error"]["sampling_rmse_estimate"].is_null());
    assert_eq!((&without["rays"]["for_error_estimate"], &without["adaptive"]), (&0.into(), &Value::Null));
    assert_eq!(with["rays"]["camera"], without["rays"]["camera"]);
    bench.expect(&format!("{SMALL} --stats s.json -o c.pfm"), 0);
    assert!(stats(&bench)["error"]["sampling_rmse_estimate"].is_null(), "one sample has no spread");
}

#[test]
fn what_cannot_be_meant_is_refused() {
    let bench = Bench::new();
    for (words, want) in [
        ("--adaptive", "--adaptive changes nothing: 16 samples come first, and --spp is 1"),
        ("--adaptive --spp 16", "name the most that a pixel may get"),
        ("--adaptive=0", "expected a share between 0 and 1"),
        ("--adaptive=0.1 --target-error 0.1", "cannot be used with"),
        ("--target-error 0", "expected an error greater than 0"),
        ("--target-error=-1", "expected an error greater than 0"),
        ("--time-limit 0", "expected seconds"),
        ("--time-limit nan", "expected a finite number"),
        ("--target-error 0.1 --no-error-estimate", "cannot be used with"),
        ("--target-error 0.1 --sampler stratified", "has to know the number of samples"),
        ("--target-error 0.1 --centre", "--centre is for one sample a pixel"),
    ] {
        let out = bench.expect(&format!("a.obj -o x.png {words}"), 2);
        assert!(text(&out.stderr).contains(want), "{words}: {}", text(&out.stderr));
        assert!(!bench.path("x.png").exists());
    }
}

#[test]
fn who_says_so_can_be_printed() {
    let bench = Bench::new();
    let out = bench.expect("a.obj --target-error 0.01 --time-limit 2.5 --print-config", 0);
    let config = text(&out.stdout);
    for (name, value) in [("target-error", "0.01"), ("time-limit", "2.5"), ("spp", "65536")] {
        let line = config.lines().find(|l| l.trim_start().starts_with(name)).unwrap_or_else(|| panic!("{config}"));
        assert!(line.contains(value), "{line}");
    }
}
