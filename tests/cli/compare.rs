//! `compare`: the contract.

use super::{Bench, decode, text};
use serde_json::{Value, json};

/// A picture of a mesh in all formats, once as it is and once brighter.
fn bench() -> Bench {
    let bench = Bench::new();
    let all =
        |name: &str| ["png", "exr", "pfm", "hdr", "ppm", "jpg", "bmp"].map(|e| format!("-o {name}.{e}")).join(" ");
    bench.expect(&format!("a.obj --backend native --size 40x30 --aov depth,albedo {} -q", all("a")), 0);
    bench.expect(&format!("a.obj --backend native --size 40x30 --camera front {} -q", all("b")), 0);
    bench
}

fn figures(bench: &Bench, words: &str) -> Value {
    let out = bench.expect(&format!("compare {words} --json"), 0);
    serde_json::from_slice(&out.stdout).expect("one JSON object")
}

#[test]
fn the_table_has_each_figure_and_its_meaning() {
    let bench = bench();
    let out = bench.expect("compare a.png b.png", 0);
    let table = text(&out.stdout);
    assert!(table.starts_with("a.png against b.png\n  40x30 pixels, sRGB from 0 to 255\n"), "{table}");
    for name in
        ["RMSE", "PSNR", "max", "relMSE", "relMSE trimmed", "SMAPE", "SSIM", "FLIP", "beyond 1/255", "identical"]
    {
        assert_eq!(table.lines().filter(|l| l.starts_with(&format!("  {name:15} "))).count(), 1, "{name} in\n{table}");
    }
    assert!(
        out.stderr.is_empty() && table.lines().count() < 24 && table.lines().all(|l| l.chars().count() <= 110),
        "{table}"
    );
    let table = bench.expect("compare a.exr b.exr", 0).stdout;
    assert!(text(&table).contains("linear light") && text(&table).contains("white is 1"), "{}", text(&table));
}

#[test]
fn keys_for_programs() {
    let bench = bench();
    let told = figures(&bench, "a.png b.png");
    for key in ["rmse", "psnr", "max", "relmse", "relmse_trimmed", "smape", "ssim", "flip", "beyond_1_255"] {
        assert!(told[key].as_f64().is_some_and(|v| v > 0.0), "{key}: {told}");
    }
    assert_eq!((&told["width"], &told["height"], &told["kind"]), (&json!(40), &json!(30), &json!("srgb8")));
    assert_eq!((&told["non_finite"], &told["identical"], &told["diff"]), (&json!(0), &json!(false), &Value::Null));
    // By hand, from the bytes.
    let [a, b] = ["a.png", "b.png"].map(|name| decode(&bench.read(name)).2);
    let off: Vec<f64> = a.iter().zip(&b).map(|(a, b)| f64::from(*a) - f64::from(*b)).collect();
    let rmse = (off.iter().map(|d| d * d).sum::<f64>() / off.len() as f64).sqrt();
    assert!((told["rmse"].as_f64().unwrap() - rmse).abs() < 1e-9);
    assert_eq!(told["max"].as_f64().unwrap(), off.iter().fold(0.0, |m, d| d.abs().max(m)));
    assert!((told["psnr"].as_f64().unwrap() - 20.0 * (255.0 / rmse).log10()).abs() < 1e-9);
    assert_eq!(figures(&bench, "a.exr b.exr")["kind"], "linear");
}

#[test]
fn the_same_picture_is_identical_in_every_lossless_format() {
    let bench = bench();
    for name in ["a.png", "a.exr", "a.pfm", "a.hdr", "a.ppm", "a.jpg", "a.bmp"] {
        let told = figures(&bench, &format!("{name} {name} --max-rmse 0 --max-flip 0"));
        assert_eq!(
            (&told["identical"], &told["psnr"], &told["rmse"]),
            (&json!(true), &Value::Null, &json!(0.0)),
            "{name}"
        );
        assert_eq!((&told["ssim"], &told["flip"]), (&json!(1.0), &json!(0.0)), "{name}");
    }
    for (a, b) in [("a.png", "a.ppm"), ("a.bmp", "a.png"), ("a.exr", "a.pfm"), ("a.exr", "a.png"), ("a.png", "a.pfm")] {
        assert_eq!(figures(&bench, &format!("{a} {b}"))["identical"], true, "{a} {b}");
    }
    let told = figures(&bench, "a.exr a.png");
    assert_eq!((&told["kind"], &told["mixed"]), (&json!("srgb8"), &json!(true)));
    assert!(told["notes"][0].as_str().is_some_and(|n| n.starts_with("a.exr is linear light")), "{told}");
    assert!(text(&bench.expect("compare a.png a.png", 0).stdout).contains("PSNR                infinite"));
}

#[test]
fn a_bound_that_is_passed_is_said_and_ends_with_5() {
    let bench = bench();
    bench.expect("compare a.png b.png --max-rmse 255 --max-flip 1", 0);
    let out = bench.expect("compare a.png b.png --max-rmse 0.5", 5);
    let said = text(&out.stderr);
    assert!(
        said.starts_with("error: a.png is too far from b.png: RMSE ") && said.contains("more than --max-rmse 0.5"),
        "{said}"
    );
    assert!(text(&out.stdout).contains("RMSE"), "the figures are told all the same");
    let out = bench.expect("compare a.png b.png --max-flip 0.0001 --max-rmse 0.5 --json", 5);
    assert!(text(&out.stderr).contains("--max-flip 0.0001"), "{}", text(&out.stderr));
    assert!(serde_json::from_slice::<Value>(&out.stdout).is_ok());
    let rmse = figures(&bench, "a.png b.png")["rmse"].as_f64().unwrap();
    bench.expect(&format!("compare a.png b.png --max-rmse {rmse}"), 0);
    bench.expect(&format!("compare a.png b.png --max-rmse {}", rmse.next_down()), 5);
}

#[test]
fn a_picture_of_the_difference() {
    let bench = bench();
    let out = bench.expect("compare a.png b.png --diff d.png --json=figures.json", 0);
    assert!(text(&out.stderr).contains("wrote     d.png (") && text(&out.stderr).contains("FLIP, from black at 0"));
    assert!(text(&out.stdout).contains("RMSE"));
    let told: Value = serde_json::from_slice(&bench.read("figures.json")).unwrap();
    assert_eq!((&told["diff"]["file"], &told["diff"]["brightest"]), (&json!("d.png"), &json!(1.0)));
    let (w, h, flip) = decode(&bench.read("d.png"));
    assert_eq!((w, h), (40, 30));
    assert!(flip.chunks(3).any(|p| p != [0, 0, 4]), "not all black");

    let told = figures(&bench, "a.png b.png --diff d.png --diff-of abs");
    assert_eq!(told["diff"]["brightest"], told["max"]);
    let (_, _, abs) = decode(&bench.read("d.png"));
    assert!(abs != flip && abs.chunks(3).any(|p| p == [252, 253, 191]), "the largest is the brightest");
    let [a, b] = ["a.png", "b.png"].map(|name| decode(&bench.read(name)).2);
    for ((pa, pb), d) in a.chunks(3).zip(b.chunks(3)).zip(abs.chunks(3)) {
        assert_eq!(pa == pb, d == [0, 0, 4], "black where nothing differs");
    }

    figures(&bench, "a.png b.png --diff d.pfm --diff-of abs");
    let pfm = bench.read("d.pfm");
    let numbers = pfm.strip_prefix(b"PF\n40 30\n-1.0\n").unwrap();
    let most = numbers.chunks(4).map(|c| f32::from_le_bytes(c.try_into().unwrap())).fold(0.0, f32::max);
    assert_eq!(json!(f64::from(most)), told["max"], "the numbers themselves");
}

#[test]
fn a_part_and_a_layer() {
    let bench = bench();
    let part = figures(&bench, "a.png b.png --crop 10,5,30,25 --diff d.png");
    assert_eq!((&part["width"], &part["height"]), (&json!(20), &json!(20)));
    assert_eq!(decode(&bench.read("d.png")).0, 20);
    assert_ne!(part["rmse"], figures(&bench, "a.png b.png")["rmse"]);
    assert_eq!(part["rmse"], figures(&bench, "a.png b.png --crop 0.25,0.1667,0.75,0.8333")["rmse"]);
    for words in ["--crop 10,5,41,25", "--crop 10,5,10,25", "--crop 1,2,3"] {
        bench.expect(&format!("compare a.png b.png {words}"), 2);
    }
    assert_eq!(figures(&bench, "a.exr a.exr --layer albedo")["layer"], "albedo");
    // Rays that hit nothing are infinitely far, in both pictures.
    let depth = figures(&bench, "a.exr a.exr --layer depth --max-rmse 0");
    assert!(depth["non_finite"].as_u64() > Some(0) && depth["identical"] == true, "{depth}");
    let out = bench.expect("compare a.exr b.exr --layer albedo", 3);
    assert!(text(&out.stderr).contains("b.exr has no layer 'albedo', but there are B, G, R"), "{}", text(&out.stderr));
}

#[test]
fn what_is_not_finite_is_named_and_passes_every_bound() {
    let bench = Bench::new();
    let pfm = |odd: &[(usize, f32)]| {
        let mut values = vec![0.5f32; 16 * 12];
        odd.iter().for_each(|&(at, v)| values[at] = v);
        let body = values.iter().flat_map(|v| v.to_le_bytes());
        b"Pf\n16 12\n-1\n".iter().copied().chain(body).collect::<Vec<u8>>()
    };
    bench.write("good.pfm", pfm(&[]));
    // The first of the file is the last row's.
    bench.write("bad.pfm", pfm(&[(3, f32::NAN), (16, f32::INFINITY)]));
    let told = figures(&bench, "bad.pfm good.pfm");
    assert_eq!((&told["non_finite"], &told["rmse"], &told["identical"]), (&json!(2), &json!(0.0), &json!(false)));
    assert_eq!(told["non_finite_in"]["a"], json!({ "nan": 1, "infinite": 1, "first": [0, 10] }));
    assert_eq!(told["non_finite_in"]["b"], json!({ "nan": 0, "infinite": 0, "first": null }));
    let out = bench.expect("compare bad.pfm good.pfm --max-rmse 1", 5);
    assert!(text(&out.stderr).contains("NaN or infinity differs in 2 pixels"), "{}", text(&out.stderr));
    let said = text(&out.stdout);
    assert!(said.contains("note: bad.pfm is not finite in 2 pixels (NaN 1, infinite 1), first at 0,10"), "{said}");
    bench.expect("compare bad.pfm bad.pfm --max-rmse 0", 0);
}

#[test]
fn what_cannot_be_compared_or_written() {
    let bench = bench();
    bench.expect("a.obj --backend native --size 20x20 -o small.png -q", 0);
    bench.write("cut.png", &bench.read("a.png")[..100]);
    bench.write("cut.exr", &bench.read("a.exr")[..900]);
    let names = bench.names();
    let cases = [
        ("a.png", 2, &["<B>"][..]),
        ("a.png b.png --max-rmse -1", 2, &["0 or more"]),
        ("a.png b.png --max-rmse nan", 2, &["finite"]),
        ("a.png b.png --ppd 0", 2, &["pixels per degree"]),
        ("a.png b.png --diff-of abs", 2, &["--diff"]),
        ("a.png b.png --diff -", 2, &["stdout"]),
        ("a.png b.png --diff d.tiff", 2, &["'.tiff' is no image format"]),
        ("a.png b.png --diff a.png", 2, &["a.png is compared: it would be overwritten"]),
        ("a.png b.png --json=b.png", 2, &["b.png is compared"]),
        ("a.png b.png --diff d.png --json=d.png", 2, &["written twice"]),
        ("none.png b.png", 3, &["cannot read none.png", "caused by"]),
        ("a.pngg b.png", 3, &["did you mean a.png?"]),
        ("a.png a.obj", 3, &["a.obj is no PNG, JPEG, BMP, HDR, PNM, PFM or EXR image"]),
        ("cut.png a.png", 3, &["cut.png cannot be decoded"]),
        ("a.png cut.exr", 3, &["cut.exr cannot be decoded"]),
        ("a.png small.png", 3, &["a.png has 40x30 pixels and small.png has 20x20", "same size"]),
        ("a.png b.png --layer depth", 3, &["only EXR files have layers"]),
        ("a.png none.png --diff no/d.png", 4, &["no/d.png", "does not exist"]),
        ("a.png b.png --json=no/d.json", 4, &["no/d.json"]),
    ];
    for (words, code, says) in cases {
        let out = bench.expect(&format!("compare {words}"), code);
        let said = text(&out.stderr);
        assert!(said.starts_with("error: ") && out.stdout.is_empty(), "{words}: {said}");
        for want in says {
            assert!(said.contains(want), "{words}: '{want}' in\n{said}");
        }
    }
    assert_eq!(bench.names(), names, "nothing is written, nothing is left behind");
}

#[test]
fn figures_do_not_depend_on_threads_and_pipes_are_read() {
    let bench = bench();
    let told = |words: &str| bench.expect(&format!("compare a.exr b.exr --json {words}"), 0).stdout;
    assert_eq!(told("-j 1"), told("-j 3"));
    let out = bench.command("compare /dev/stdin a.png --json").write_stdin(bench.read("a.png")).output().unwrap();
    assert_eq!(serde_json::from_slice::<Value>(&out.stdout).unwrap()["identical"], true);
}
