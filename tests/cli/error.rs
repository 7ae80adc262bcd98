//! `tison bench error`, on pictures so small that it takes no time.

use super::{Bench, text};
use serde_json::Value;

/// Everything that is measured of a picture but the seconds.
fn without_seconds(json: &Value) -> Vec<Value> {
    let mut points = json["sections"]["error_lens"]["data"].as_array().unwrap().clone();
    for point in &mut points {
        let point = point.as_object_mut().unwrap();
        assert!(point["seconds"].as_f64().unwrap() > 0.0);
        point.retain(|key, _| !["seconds", "efficiency"].contains(&key.as_str()));
    }
    points
}

#[test]
fn a_report_as_page_json_and_csv() {
    let bench = Bench::new();
    let words = "bench error lens --only sampling --size 16x9 --seeds 2 --spp 16 --reference 64";
    let out = bench.expect(&format!("{words} -o r.html --json j.json --csv c.csv"), 0);
    assert!(text(&out.stdout).contains(&format!("repeat: tison {words}")), "{}", text(&out.stdout));
    assert_eq!(bench.names(), ["a.obj", "c.csv", "j.json", "r.html"]);

    let json: Value = serde_json::from_slice(&bench.read("j.json")).unwrap();
    let points = without_seconds(&json);
    let of = |who: &str| points.iter().filter(|p| p["candidate"] == who).collect::<Vec<_>>();
    let ours = of("ours, Owen-Sobol");
    assert_eq!(ours.iter().map(|p| p["spp"].as_f64().unwrap()).collect::<Vec<_>>(), [1.0, 4.0, 16.0]);
    let rmse = |p: &Value| p["rmse"].as_f64().unwrap();
    assert!(rmse(ours[2]) < 0.5 * rmse(ours[0]), "more samples, less error: {ours:?}");
    let noise = ours[0]["reference_noise"].as_f64().unwrap();
    assert!(noise > 0.0 && noise < rmse(ours[2]), "the reference is better than what it judges: {noise}");
    for p in &points {
        let measured = p["rmse_measured"].as_f64().unwrap();
        assert!((measured.powi(2) - rmse(p).powi(2) - noise.powi(2)).abs() < 1e-9 * measured, "{p}");
    }
    if cfg!(feature = "embree") {
        // The same samples, whoever answers the rays.
        for (a, b) in ours.iter().zip(of("ours, native")) {
            assert!((rmse(a) - rmse(b)).abs() < 1e-3 * rmse(a), "{a} {b}");
        }
    }
    assert_eq!(json["sections"]["reached_lens"]["data"].as_array().unwrap().len() % 3, 0, "three levels each");

    let csv = bench.read("c.csv");
    let mut lines = text(&csv).lines();
    assert!(lines.next().unwrap().starts_with("section,"));
    assert_eq!(lines.filter(|l| l.starts_with("error_lens,")).count(), points.len());
    let html = bench.read("r.html");
    let html = text(&html);
    assert!(html.contains("data:image/png;base64,") && html.contains("stroke-dasharray") && html.contains("<svg"));
    for outside in ["<script", "<link", "src=\"http", "href=", "url("] {
        assert!(!html.contains(outside), "the page asks for {outside}");
    }

    let again = bench.expect(&format!("{words} --json -"), 0);
    let again: Value = serde_json::from_slice(&again.stdout).unwrap();
    assert_eq!(without_seconds(&again), points, "the same figures, but for the seconds");
}

#[test]
fn any_scene_can_be_measured() {
    let bench = Bench::new();
    let out = bench.expect("bench error a.obj --only sampling --size 8x6 --seeds 1 --spp 4 --reference 16 --csv -", 0);
    let csv = text(&out.stdout);
    assert!(csv.starts_with("section,") && csv.contains("error_a.obj,") && csv.contains("slope_a.obj,"), "{csv}");
}

#[test]
fn what_cannot_be_measured_is_refused() {
    let bench = Bench::new();
    for (words, code, want) in [
        ("bench error lost.toml", 3, "lost.toml"),
        ("bench error lens --size 5000x5000", 6, "--size"),
        ("bench error lens --size 0x5", 2, "1x1"),
        ("bench error lens --spp 0", 2, "--spp"),
        ("bench error lens --only precision", 2, "without a scene"),
        ("bench error lens --json - --csv -", 2, "stdout"),
        ("bench error lens -o no/such/folder.html", 4, "no/such"),
    ] {
        let out = bench.expect(words, code);
        assert!(text(&out.stderr).contains(want), "{words}: {}", text(&out.stderr));
        assert!(out.stdout.is_empty(), "{words}");
    }
    assert_eq!(bench.names(), ["a.obj"]);
}
