//! Scene files: what they say, what flags change of it, and what is said about mistakes.

use super::{Bench, TETRAHEDRON, decode, decode_file, text};
use serde_json::Value;

const SCENE: &str = r#"
tison = 1
[render]
size = [40, 30]
samples = 2
recursion = 3
min_weight = 0.25
seed = 7
background = [0.1, 0.2, 0.3]
ambient = [0.1, 0.1, 0.1]
filter = "tent"
sampler = "stratified"
lens_sampler = "polar"
[camera.main]
eye = [0, 1, 8]
target = [0, 0.5, 0]
lens = { radius = 0.05, focus = 8 }
[camera.flat]
type = "orthographic"
eye = [5, 1, 8]
target = [0, 0.5, 0]
height = 4
[light.key]
position = [5, 8, 5]
falloff = "none"
[light.off]
position = [1, 1, 1]
power = 0
[material]
red = { color = [0.8, 0.1, 0.1] }
mirror = { color = [0.2, 0.2, 0.2], reflect = 0.5 }
[[object]]
name = "ball"
shape = "sphere"
material = "mirror"
[[object]]
shape = "cube"
half = [0.4, 0.4, 0.4]
material = "red"
transform = [{ translate = [1.6, 0.4, 0] }]
[[object]]
shape = "cylinder"
radius = 0.4
height = 1
material = "red"
transform = [{ rotate = [1, 0, 0], degrees = 90 }, { translate = [-1.6, 0.5, 0] }]
[[object]]
shape = "quad"
half = 4
transform = [{ rotate = [1, 0, 0], degrees = -90 }]
"#;

const COURSE: &str = r#"
dimension 32 24
samples_per_pixel 3
jitter_radius 0.5
ambient_light [0.1 0.1 0.1]
max_ray_depth 2
Perspective 40 1.33 2 50
LookAt 0 1 7  0 0 0  0 1 0
Material "grey" "color_albedo" [0.6 0.5 0.4] "k_ambient" 1 "k_diffuse" 0.8 "k_specular" 0.2 "shininess" 20
Sphere 1 "grey"
PushMatrix
Translate 0 0 -2
Quad 1.5 "grey"
PopMatrix
SphericalLight 4 6 5 "emission" [60 60 60] "radius" 0.5
"#;

fn bench() -> Bench {
    let bench = Bench::new();
    bench.write("s.toml", SCENE);
    bench.write("s.ray", COURSE);
    bench
}

/// What `--print-config` says: name, value, origin.
fn settings(bench: &Bench, words: &str) -> Vec<[String; 3]> {
    let out = bench.expect(&format!("{words} --print-config"), 0);
    let row = |line: &str| {
        let (name, rest) = line.trim_start().split_once("  ")?;
        let (value, origin) = rest.trim().rsplit_once("  ")?;
        Some([name.trim(), value.trim(), origin.trim()].map(str::to_owned))
    };
    text(&out.stdout).lines().filter_map(row).collect()
}

#[track_caller]
fn assert_setting(bench: &Bench, words: &str, [name, value, origin]: [&str; 3]) {
    let all = settings(bench, words);
    let found = all.iter().find(|s| s[0] == name).unwrap_or_else(|| panic!("{words}: no {name} in {all:?}"));
    assert_eq!(found[1..], [value, origin], "{words}: {name}");
}

fn image(bench: &Bench, words: &str) -> (u32, u32, Vec<u8>) {
    decode(&bench.expect(&format!("{words} -q -o -"), 0).stdout)
}

/// Light of a PFM, rows from the top.
fn light(pfm: &[u8], width: usize, channels: usize) -> Vec<f64> {
    let header = pfm.iter().enumerate().filter(|(_, b)| **b == b'\n').nth(2).unwrap().0;
    let values: Vec<f64> = pfm[header + 1..].as_chunks().0.iter().map(|&b| f64::from(f32::from_le_bytes(b))).collect();
    values.chunks(width * channels).rev().flatten().copied().collect()
}

fn stretched(values: &[f64]) -> Vec<u8> {
    let (min, max) = values.iter().fold((f64::MAX, f64::MIN), |(lo, hi), &v| (lo.min(v), hi.max(v)));
    values.iter().map(|v| (255.0 * ((v - min) / (max - min))) as u8).collect()
}

#[test]
fn a_flag_wins_over_the_scene_and_the_scene_over_the_default() {
    let bench = bench();
    bench.write("silent.toml", "tison = 1\n[[object]]\nshape = \"sphere\"\n");
    let cases = [
        ("size", "--size 8x6", ["1280x720", "40x30", "8x6"]),
        ("spp", "--spp 4", ["16", "2", "4"]),
        ("recursion", "-r=50", ["8", "3", "50"]),
        ("recursion", "-r 50", ["8", "3", "50"]),
        ("min-weight", "--min-weight 0", ["0.0009765625", "0.25", "0"]),
        ("seed", "--seed 1", ["0", "7", "1"]),
        ("filter", "--filter box", ["blackman-harris", "tent", "box"]),
        ("sampler", "--sampler random", ["sobol", "stratified", "random"]),
        ("lens-sampler", "--lens-sampler rejection", ["concentric", "polar", "rejection"]),
    ];
    for (name, flag, [default, scene, given]) in cases {
        assert_setting(&bench, "silent.toml -q", [name, default, "default"]);
        assert_setting(&bench, "s.toml", [name, scene, "scene file"]);
        for file in ["silent.toml -q", "s.toml"] {
            assert_setting(&bench, &format!("{file} {flag}"), [name, given, "flag"]);
        }
    }
    assert_setting(&bench, "s.toml -D render.samples=5", ["spp", "5", "-D"]);
    assert_setting(&bench, "s.toml -D render.samples=5", ["-D", "render.samples=5", "flag"]);
    assert_setting(&bench, "s.toml -D render.samples=5 --spp 6", ["spp", "6", "flag"]);
    assert_setting(&bench, "s.toml", ["background", "0.1,0.2,0.3", "scene file"]);
    assert_setting(&bench, "s.toml", ["camera", "main", "scene file"]);
    assert_setting(&bench, "s.toml --camera flat", ["ortho", "4", "scene file"]);
    assert_setting(&bench, "s.toml --eye 1,2,3", ["eye", "1,2,3", "flag"]);
    assert_eq!(bench.names(), ["a.obj", "s.ray", "s.toml", "silent.toml"], "nothing is rendered");
}

#[test]
fn the_image_is_what_the_settings_say() {
    let bench = bench();
    let out = bench.expect("s.toml --stats s.json", 0);
    let summary = text(&out.stderr);
    for want in ["1 sphere, 1 cube, 1 cylinder, 1 quad", "3 materials, 1 light", "40x30, 2 samples", "seed 7"] {
        assert!(summary.contains(want), "{want} in\n{summary}");
    }
    assert!(!summary.contains("triangle"), "{summary}");
    assert_eq!(decode_file(&bench.path("s.png")).0, 40);
    let stats: Value = serde_json::from_slice(&bench.read("s.json")).unwrap();
    let scene = &stats["scene"];
    for (name, n) in [("spheres", 1), ("cubes", 1), ("cylinders", 1), ("quads", 1), ("triangles", 0), ("lights", 1)] {
        assert_eq!(scene[name], n, "{name}");
    }
    assert_eq!((&stats["image"]["spp_mean"], &stats["rays"]["camera"]), (&2.0.into(), &2400.into()));
    let skipped = &stats["skipped"];
    assert!(skipped["meshes"].is_string() && skipped["textures"].is_string(), "{skipped}");
    assert_eq!(skipped["lights_without_power"], 1);
    for used in ["lens", "pixel_jitter", "user_geometry", "reflection"] {
        assert!(skipped.get(used).is_none(), "{used}");
    }
    assert!(image(&bench, "s.toml --seed 7 --spp 2 -r 3") == image(&bench, "s.toml"));
    assert!(image(&bench, "s.toml --seed 8") != image(&bench, "s.toml"));
    assert!(image(&bench, "s.toml -r=0") != image(&bench, "s.toml -r=3"));
}

#[test]
fn the_filter_shows_and_is_noted() {
    let bench = bench();
    let images = ["box", "tent", "blackman-harris", "mitchell"].map(|name| {
        bench.expect(&format!("s.toml -q --spp 16 --filter {name} -o {name}.png -o {name}.pfm"), 0);
        let noted = format!("filter {name}");
        let has = |bytes: &[u8]| bytes.windows(noted.len()).any(|w| w == noted.as_bytes());
        assert_eq!(has(&bench.read(&format!("{name}.png"))), name != "blackman-harris", "{name}");
        light(&bench.read(&format!("{name}.pfm")), 40, 3)
    });
    for (i, image) in images.iter().enumerate() {
        assert!(images[..i].iter().all(|other| other != image));
    }
    bench.write("silent.toml", SCENE.replace("filter = \"tent\"\n", ""));
    assert!(image(&bench, "silent.toml --filter blackman-harris") == image(&bench, "silent.toml"));
    let told = bench.expect("s.toml --filter mitchell --pixel 3,4", 0);
    assert!(text(&told.stdout).contains("filter mitchell: the sample counts "), "{}", text(&told.stdout));
}

#[test]
fn cameras_go_by_name() {
    let bench = bench();
    let (main, flat) = (image(&bench, "s.toml --camera main"), image(&bench, "s.toml --camera flat"));
    assert!(main == image(&bench, "s.toml") && main != flat);
    assert!(image(&bench, "s.toml --camera flat --ortho 4") == flat);
    for flags in ["--eye 1,1,8", "--target 1,0,0", "--up 1,1,0", "--fov 20", "--ortho 3", "--aperture 1", "--focus 2"] {
        assert!(image(&bench, &format!("s.toml {flags}")) != main, "{flags}");
    }
    let out = bench.expect("s.toml --camera mian", 2);
    let said = text(&out.stderr);
    assert!(said.contains("'mian'") && said.contains("main, flat") && said.contains("did you mean 'main'"), "{said}");
    assert!(text(&bench.expect("s.toml --camera top", 2).stderr).contains("main, flat"));
    assert!(text(&bench.expect("s.toml --camera flat --focus 3", 2).stderr).contains("--aperture"));
    bench.expect("s.toml --eye 1,1,1 --target 1,1,1", 2);
}

#[test]
fn a_scene_without_cameras_is_framed() {
    let bench = bench();
    let start = SCENE.find("[camera.main]").unwrap();
    let end = SCENE.find("[light.key]").unwrap();
    bench.write("free.toml", SCENE[..start].to_owned() + &SCENE[end..]);
    let images = ["", "--camera front", "--camera top"].map(|flags| image(&bench, &format!("free.toml {flags}")));
    assert!(images[0] != images[1] && images[1] != images[2]);
    assert!(text(&bench.expect("free.toml --camera mian", 2).stderr).contains("three-quarter"));
}

#[test]
fn a_turntable_turns_the_scenes_camera() {
    let bench = bench();
    bench.expect("s.toml -o t.png --turntable 2", 0);
    let first = decode_file(&bench.path("t-0001.png"));
    assert!(first == image(&bench, "s.toml") && first != decode_file(&bench.path("t-0002.png")));
}

#[test]
fn keys_can_be_set_from_outside() {
    let bench = bench();
    bench.write("edited.toml", SCENE.replace("half = [0.4, 0.4, 0.4]", "half = [0.9, 0.4, 0.4]"));
    assert!(image(&bench, "s.toml -D object.1.half=[0.9,0.4,0.4]") == image(&bench, "edited.toml"));
    assert!(image(&bench, "s.toml -D object.ball.material=red") != image(&bench, "s.toml"));
    assert_eq!(image(&bench, "s.toml -D render.size=[20,10] -D render.samples=1").0, 20);
    let cases = [
        ("camera.mian.fov=20", "did you mean `main`?"),
        ("camera.main.fov=400", "below 180"),
        ("object.5.half=1", "0 to 3"),
        ("nonsense.x=1", "no key `nonsense`"),
        ("render.samples=", "value"),
    ];
    for (define, want) in cases {
        let out = bench.expect(&format!("s.toml -D {define} -o no.png"), 3);
        let said = text(&out.stderr);
        assert!(said.starts_with("error: ") && said.contains("--> -D:1:") && said.contains(want), "{define}: {said}");
    }
    bench.expect("s.toml -D render.samples", 2);
    for command in ["info", "check"] {
        bench.expect(&format!("{command} s.toml -D render.samples=3"), 0);
        bench.expect(&format!("{command} s.toml -D render.smaples=3"), 3);
    }
    assert!(!bench.path("no.png").exists());
}

#[test]
fn mistakes_are_shown_with_their_lines() {
    let bench = bench();
    bench.write("bad.toml", SCENE.replace("samples = 2", "samples = 0").replace("\"mirror\"\n", "\"miror\"\n"));
    for words in ["bad.toml -o out.png", "bad.toml -o out.png -q", "check bad.toml", "info bad.toml"] {
        let out = bench.expect(words, 3);
        let said = text(&out.stderr);
        assert!(said.starts_with("error: ") && out.stdout.is_empty(), "{words}: {said}");
        for want in ["--> bad.toml:5:11", "5 | samples = 0", "^", "did you mean `mirror`?"] {
            assert!(said.contains(want), "{words}: '{want}' in\n{said}");
        }
        assert_eq!(said.matches("error: ").count(), 2, "{said}");
        assert!(!said.contains('\x1b'), "no colours but on a terminal");
    }
    bench.write("lost.scn", "");
    assert!(text(&bench.expect("lost.scn -o out.png", 3).stderr).contains("lost"));
    assert!(text(&bench.expect("s.tmol -o out.png", 3).stderr).contains("did you mean s.toml"));
    assert!(!bench.path("out.png").exists());
}

#[test]
fn warnings_are_shown_counted_silenced_or_taken_for_errors() {
    let bench = bench();
    bench.write("odd.toml", SCENE.replace("[material]\n", "[material]\nunused = { color = [1, 1, 1] }\n"));
    let out = bench.expect("odd.toml -o odd.png --stats odd.json", 0);
    let said = text(&out.stderr);
    assert!(said.contains("warning: ") && said.contains("--> odd.toml:30:1"), "{said}");
    let stats: Value = serde_json::from_slice(&bench.read("odd.json")).unwrap();
    assert_eq!((&stats["warnings"], &stats["skipped"]["unused_materials"]), (&1.into(), &1.into()));
    assert!(bench.expect("odd.toml -o odd.png -q", 0).stderr.is_empty());
    assert_eq!(text(&bench.expect("check odd.toml", 0).stdout), "odd.toml: ok, with 1 warning\n");
    bench.expect("s.toml --strict", 0);
    for words in ["odd.toml --strict -o none.png", "odd.toml --strict -q -o none.png", "check odd.toml --strict"] {
        let out = bench.expect(words, 3);
        let said = text(&out.stderr);
        assert!(said.starts_with("error: ") && said.contains("odd.toml:30:1") && said.contains("--strict"), "{said}");
        assert!(!said.contains("warning: ") && out.stdout.is_empty(), "{said}");
    }
    assert!(!bench.path("none.png").exists());
}

#[test]
fn a_biased_sampler_of_the_scene_is_warned_of() {
    let bench = bench();
    bench.write("b.toml", SCENE.replace("\"polar\"", "\"polar-uniform-radius\""));
    let biased = |words: &str| text(&bench.expect(words, 0).stderr).matches("picture is biased").count();
    assert_eq!((biased("b.toml"), biased("b.toml --lens-sampler polar"), biased("b.toml --aperture 0")), (1, 0, 0));
}

#[test]
fn a_scene_without_light_stays_dark() {
    let bench = bench();
    bench.write("dark.toml", "tison = 1\n[render]\nsize = [8, 6]\n[[object]]\nshape = \"sphere\"\n");
    let out = bench.expect("dark.toml", 0);
    assert!(text(&out.stderr).contains("nothing gives light"), "{}", text(&out.stderr));
    assert!(decode_file(&bench.path("dark.png")).2.iter().all(|&b| b == 0));
}

#[test]
fn a_course_scene_is_written_as_the_courses_program_writes() {
    let bench = bench();
    for (name, value) in
        [("size", "32x24"), ("spp", "3"), ("light-samples", "3"), ("recursion", "2"), ("min-weight", "0")]
    {
        assert_setting(&bench, "s.ray", [name, value, "scene file"]);
    }
    assert_setting(&bench, "s.ray", ["filter", "box", "scene file"]);
    assert!(text(&bench.expect("s.ray --filter tent", 2).stderr).contains("jitter_radius"));
    assert_setting(&bench, "s.ray", ["tonemap", "stretch", "scene file"]);
    assert_setting(&bench, "s.ray --spp 5", ["light-samples", "3", "scene file"]);
    assert_setting(&bench, "s.ray", ["clip", "2,50", "scene file"]);
    bench.expect("s.ray -o c.png -o c.pfm --aov depth", 0);
    let (w, h, bytes) = decode_file(&bench.path("c.png"));
    assert_eq!((w, h), (32, 24));
    assert!(bytes == stretched(&light(&bench.read("c.pfm"), 32, 3)));
    let depth = light(&bench.read("c.depth.pfm"), 32, 1);
    let share = |t: &f64| if t.is_finite() { (t - 2.0) / 48.0 } else { 0.0 };
    let want: Vec<u8> = stretched(&depth.iter().map(share).collect::<Vec<_>>());
    let shown = decode_file(&bench.path("c.depth.png")).2;
    assert!(shown.chunks(3).map(|p| p[0]).eq(want));
    assert!(shown.contains(&0) && shown.contains(&255), "a miss is black, the farthest hit white");
    bench.expect("s.ray -o n.png -o n.pfm --tonemap none --aov depth", 0);
    assert!(bench.read("n.pfm") == bench.read("c.pfm"));
    assert!(bench.read("n.png") != bench.read("c.png") && bench.read("n.depth.png") != bench.read("c.depth.png"));
    assert!(text(&bench.expect("s.ray --exposure 1", 2).stderr).contains("--tonemap"));
    assert!(bench.path("c.depth.png").exists() && !bench.path("s.png").exists());
}

#[test]
fn a_clipped_hit_is_a_miss() {
    let bench = bench();
    // The ball is 6 to 7 away, the square behind it 9.
    bench.write("near.ray", COURSE.replace("Perspective 40 1.33 2 50", "Perspective 40 1.33 2 8"));
    let depth = |name: &str| {
        bench.expect(&format!("{name} -o d.pfm --aov depth,hits"), 0);
        light(&bench.read("d.depth.pfm"), 32, 1)
    };
    let (all, near) = (depth("s.ray"), depth("near.ray"));
    assert!(all.iter().any(|t| t.is_finite() && *t > 8.5));
    assert!(near.iter().all(|t| !t.is_finite() || *t < 8.0) && near.iter().any(|t| t.is_finite()));
}

#[test]
fn limits_hold_for_the_size_of_the_file_too() {
    let bench = bench();
    bench.write("huge.toml", SCENE.replace("size = [40, 30]", "size = [65535, 65535]"));
    let out = bench.expect("huge.toml -o huge.png", 6);
    assert!(text(&out.stderr).contains("65535x65535"), "{}", text(&out.stderr));
    bench.expect("huge.toml -o part.png --crop 0,0,4,4", 0);
    bench.expect("huge.toml -o small.png --size 4x4", 0);
    bench.expect("s.toml -o out.png --crop 0,0,41,30", 2);
    bench.expect("s.toml --pixel 40,0", 2);
    assert!(text(&bench.expect("s.toml --pixel 20,20", 0).stdout).contains("colour"));
    bench.expect("s.toml -o out.png --centre", 2);
}

#[test]
fn files_outside_of_the_scenes_folder_need_leave() {
    let bench = bench();
    let far = tempfile::tempdir().unwrap();
    std::fs::write(far.path().join("far.obj"), TETRAHEDRON).unwrap();
    let mesh = far.path().join("far.obj");
    bench.write("m.toml", format!("{SCENE}\n[[object]]\nmesh = \"{}\"\n", mesh.display()));
    let out = bench.expect("m.toml -o m.png", 3);
    assert!(text(&out.stderr).contains("--allow-path"), "{}", text(&out.stderr));
    for words in ["m.toml -o m.png", "check m.toml", "info m.toml"] {
        bench.expect(&format!("{words} --allow-path {}", far.path().display()), 0);
    }
}

#[test]
fn a_mesh_shown_twice_is_counted_as_instances() {
    let bench = bench();
    let object = |x: i32| format!("[[object]]\nmesh = \"a.obj\"\ntransform = [{{ translate = [{x}, 2, 0] }}]\n");
    bench.write("m.toml", format!("{SCENE}\n{}{}", object(-1), object(1)));
    let info: Value = serde_json::from_slice(&bench.expect("info m.toml --json", 0).stdout).unwrap();
    assert_eq!((&info["scene"]["instances"], &info["scene"]["triangles"]), (&2.into(), &8.into()));
    assert!(text(&bench.expect("m.toml", 0).stderr).contains("8 triangles, 8 vertices, 2 instances, 1 sphere"));
}

#[test]
fn info_tells_what_is_in_a_scene() {
    let bench = bench();
    bench.write("dot.bmp", bmp());
    bench.write("t.toml", SCENE.replace("red = { color = [0.8, 0.1, 0.1] }", "red = { texture = \"dot.bmp\" }"));
    let out = bench.expect("info t.toml", 0);
    let told = text(&out.stdout);
    for want in [
        "spheres    1",
        "cubes      1",
        "cylinders  1",
        "quads      1",
        "lights     1",
        "cameras    2: main, flat",
        "textures   1",
        "materials  3, 1 with a texture",
        "needs      reflection",
        "needs not  refraction",
        "memory     scene ",
    ] {
        assert!(told.contains(want), "{want} in\n{told}");
    }
    assert!(!told.contains("triangles") && out.stderr.is_empty(), "{told}");
    let info: Value = serde_json::from_slice(&bench.expect("info t.toml --json", 0).stdout).unwrap();
    assert_eq!(info["scene"]["quads"], 1);
    assert_eq!(info["cameras"][1]["name"], "flat");
    assert_eq!(info["cameras"][1]["height"], 4.0);
    assert_eq!(info["render"]["samples"], 2);
    assert_eq!((&info["needs"]["textures"], &info["textures"][0]["width"]), (&true.into(), &2.into()));
    assert_eq!(info["lights"][0]["position"], serde_json::json!([5.0, 8.0, 5.0]));
    assert_eq!(text(&bench.expect("check t.toml", 0).stdout), "t.toml: ok\n");
}

/// 2x1 pixels, 24 bits each.
fn bmp() -> Vec<u8> {
    let mut bytes = Vec::new();
    image::codecs::bmp::BmpEncoder::new(&mut bytes)
        .encode(&[255, 0, 0, 0, 255, 0], 2, 1, image::ExtendedColorType::Rgb8)
        .unwrap();
    bytes
}

#[test]
fn json_says_the_same() {
    let bench = bench();
    let scene = r#"{"tison": 1, "render": {"size": [8, 6]}, "camera": {"c": {"eye": [0, 0, 5], "target": [0, 0, 0]}},
        "light": {"l": {"position": [5, 5, 5], "falloff": "none"}}, "object": [{"shape": "sphere"}]}"#;
    bench.write("j.json", scene);
    assert_eq!(image(&bench, "j.json").0, 8);
    bench.expect("j.json --stats j.json", 2);
    assert_eq!(bench.read("j.json"), scene.as_bytes(), "the input is not overwritten");
}

#[test]
fn what_a_scene_is_made_of_is_not_overwritten() {
    let bench = bench();
    bench.write("s.png", bmp());
    bench.write("s.toml", SCENE.replace("red = { color = [0.8, 0.1, 0.1] }", "red = { texture = \"s.png\" }"));
    bench.write("dot.bmp", bmp());
    bench.write("t.toml", SCENE.replace("red = { color = [0.8, 0.1, 0.1] }", "red = { texture = \"dot.bmp\" }"));
    for words in ["t.toml -o dot.bmp", "t.toml -o d.png --stats dot.bmp"] {
        let out = bench.expect(words, 2);
        assert!(text(&out.stderr).contains("dot.bmp is read for the scene"), "{words}: {}", text(&out.stderr));
    }
    assert!(bench.read("dot.bmp") == bmp());
}

#[test]
fn the_example_is_a_scene_without_a_fault() {
    let bench = Bench::new();
    bench.expect("example scene -o scene.toml", 0);
    let out = bench.expect("check scene.toml --strict", 0);
    assert_eq!((text(&out.stdout), text(&out.stderr)), ("scene.toml: ok\n", ""));
    bench.expect("scene.toml --size 48x30 --spp 1", 0);
    assert_eq!(decode_file(&bench.path("scene.png")).0, 48);
    for flags in ["--camera above", "-D object.ball.material=red"] {
        bench.expect(&format!("scene.toml --size 48x30 --spp 1 {flags}"), 0);
    }
}
