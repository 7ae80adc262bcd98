//! The images: formats, parts, bytes.

use super::{Bench, decode, decode_file, text};

#[test]
fn every_format_is_written_by_its_extension() {
    let bench = Bench::new();
    bench.expect("a.obj --size 40x30 -o a.png -o a.exr -o a.hdr -o a.pfm -o a.ppm -o a.jpg -o a.bmp", 0);
    let magic: [(&str, &[u8]); 7] = [
        ("a.png", b"\x89PNG"),
        ("a.exr", b"\x76\x2f\x31\x01"),
        ("a.hdr", b"#?RADIANCE"),
        ("a.pfm", b"PF\n40 30\n"),
        ("a.ppm", b"P6\n40 30\n"),
        ("a.jpg", b"\xff\xd8\xff"),
        ("a.bmp", b"BM"),
    ];
    for (name, want) in magic {
        assert!(bench.read(name).starts_with(want), "{name}");
    }
    let (w, h, pixels) = decode_file(&bench.path("a.png"));
    assert_eq!((w, h), (40, 30));
    let mut colours: Vec<&[u8]> = pixels.chunks(3).collect();
    colours.sort_unstable();
    colours.dedup();
    assert!(colours.len() >= 3, "a background and two lit sides at least");
    assert!(bench.read("a.ppm")[13..] == pixels[..], "8-bit formats hold the same bytes");
}

#[test]
fn an_image_on_stdout_is_the_image_and_nothing_else() {
    let bench = Bench::new();
    let out = bench.expect("a.obj --size 40x30 -o -", 0);
    bench.expect("a.obj --size 40x30 -o a.png", 0);
    assert!(out.stdout == bench.read("a.png"));
    assert!(text(&out.stderr).contains("wrote     stdout"));
}

#[test]
fn the_bytes_do_not_depend_on_threads_nor_on_the_run() {
    let bench = Bench::new();
    let render = |threads: usize, seed: u32, name: &str| {
        bench
            .expect(&format!("a.obj --size 150x100 --spp 4 --seed {seed} -j {threads} -o {name}.png -o {name}.exr"), 0);
        (bench.read(&format!("{name}.png")), bench.read(&format!("{name}.exr")))
    };
    let one = render(1, 5, "one");
    for (threads, name) in [(2, "two"), (7, "seven"), (7, "again")] {
        assert!(one == render(threads, 5, name), "{threads} threads, {name}");
    }
    assert!(one.1 != render(1, 6, "seed").1, "another seed");
}

#[test]
fn a_part_is_that_part_of_the_whole() {
    let bench = Bench::new();
    bench.expect("a.obj --size 80x60 -o whole.png", 0);
    bench.expect("a.obj --size 80x60 --crop 20,10,50,45 -o pixels.png", 0);
    bench.expect("a.obj --size 80x60 --crop 0.25,0.2,0.75,0.5 -o shares.png", 0);
    let (_, _, whole) = decode_file(&bench.path("whole.png"));
    for (name, [x0, y0, x1, y1]) in [("pixels.png", [20, 10, 50, 45]), ("shares.png", [20, 12, 60, 30])] {
        let (w, h, part) = decode_file(&bench.path(name));
        assert_eq!((w as usize, h as usize), (x1 - x0, y1 - y0), "{name}");
        let cut: Vec<u8> = (y0..y1).flat_map(|y| whole[3 * (80 * y + x0)..3 * (80 * y + x1)].to_vec()).collect();
        assert!(part == cut, "{name}");
    }
}

#[test]
fn auxiliary_images_stand_beside_the_image() {
    let bench = Bench::new();
    bench.expect("a.obj --size 40x30 -o out.png --aov depth,normal,albedo,id,hits,cost,samples", 0);
    let (_, _, depth) = decode_file(&bench.path("out.depth.png"));
    let (_, _, hits) = decode_file(&bench.path("out.hits.png"));
    assert_eq!(depth[..3], [0; 3], "the corner is background");
    assert!(depth.contains(&255), "the nearest point is white");
    for (d, h) in depth.iter().zip(&hits) {
        assert_eq!(*d == 0, *h == 0, "black where nothing is hit, and only there");
    }
    for kind in ["normal", "albedo", "id", "cost", "samples"] {
        assert!(decode_file(&bench.path(&format!("out.{kind}.png"))).2.iter().any(|&b| b > 0), "{kind}");
    }
    bench.expect("a.obj --size 40x30 -o out.exr --aov depth,id", 0);
    let exr = bench.read("out.exr");
    for channel in [&b"Z\0"[..], b"id.object\0", b"id.primitive\0", b"R\0"] {
        assert!(exr.windows(channel.len()).any(|w| w == channel));
    }
    assert!(!bench.path("out.depth.exr").exists());
}

#[test]
fn a_turntable_is_numbered_and_every_frame_is_another() {
    let bench = Bench::new();
    bench.expect("a.obj --size 40x30 -o t.png --turntable 3", 0);
    assert_eq!(bench.names(), ["a.obj", "t-0001.png", "t-0002.png", "t-0003.png"]);
    let frames: Vec<_> = (1..=3).map(|i| bench.read(&format!("t-000{i}.png"))).collect();
    assert!(frames[0] != frames[1] && frames[1] != frames[2] && frames[0] != frames[2]);
}

#[test]
fn one_pixel_told_in_words() {
    let bench = Bench::new();
    let out = bench.expect("a.obj --size 40x30 --pixel 20,15", 0);
    assert!(text(&out.stdout).lines().count() >= 2, "{}", text(&out.stdout));
    assert_eq!(bench.names(), ["a.obj"], "and no image");
}

#[test]
fn views_and_cameras_differ() {
    let bench = Bench::new();
    // No two sides alike.
    bench.write("b.obj", "v 0 0 0\nv 2 0 0\nv 0 3 0\nv 0 0 5\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n");
    let image = |flags: &str| decode(&bench.expect(&format!("b.obj --size 40x30 -q -o - {flags}"), 0).stdout).2;
    let all = [
        "",
        "--camera front",
        "--camera back",
        "--camera left",
        "--camera right",
        "--camera top",
        "--camera bottom",
        "--eye -1,2,3",
        "--fov 20 --eye 2,2,2",
        "--ortho 3",
        "--up 1,0,0",
        "--target 1,0,0",
        "--aperture 0.3 --spp 2 --focus 1",
    ];
    let images: Vec<_> = all.iter().map(|flags| image(flags)).collect();
    for (i, a) in images.iter().enumerate() {
        for (b, flags) in images[..i].iter().zip(all) {
            assert!(a != b, "'{flags}' and '{}'", all[i]);
        }
    }
    assert!(image("--camera three-quarter") == images[0]);
}

#[test]
fn curves_change_8_bit_images_and_no_others() {
    let bench = Bench::new();
    let image = |flags: &str| {
        bench.expect(&format!("a.obj --size 40x30 -o a.png -o a.pfm {flags}"), 0);
        (decode_file(&bench.path("a.png")).2, bench.read("a.pfm"))
    };
    let plain = image("");
    assert!(image("--tonemap none --exposure 0") == plain);
    let mut seen = vec![plain.0];
    for flags in ["--tonemap reinhard", "--tonemap aces", "--tonemap stretch", "--exposure 1", "--exposure -1.5"] {
        let (png, pfm) = image(flags);
        assert!(!seen.contains(&png) && pfm == plain.1, "{flags}");
        seen.push(png);
    }
    assert!(seen[3].contains(&0) && seen[3].contains(&255), "stretched to both ends");
}

#[test]
fn a_stretched_image_runs_over_the_range_of_its_light() {
    let bench = Bench::new();
    bench.expect("a.obj --size 40x30 -o a.png -o a.pfm --tonemap stretch", 0);
    let (_, _, bytes) = decode_file(&bench.path("a.png"));
    let pfm = bench.read("a.pfm");
    let body = pfm.strip_prefix(b"PF\n40 30\n-1.0\n").unwrap();
    let light: Vec<f64> = body.chunks(4).map(|b| f64::from(f32::from_le_bytes(b.try_into().unwrap()))).collect();
    let (min, max) = light.iter().fold((f64::MAX, f64::MIN), |(lo, hi), &v| (lo.min(v), hi.max(v)));
    // Rows of a PFM go from the bottom up.
    let rows = light.chunks(120).rev().flatten();
    for (byte, v) in bytes.iter().zip(rows) {
        assert_eq!(*byte, (255.0 * ((v - min) / (max - min))) as u8, "{v}");
    }
}
