//! Scene files: every mistake has its message, good scenes read back as they were, and no text
//! brings the readers down.

use proptest::prelude::*;
use std::fs;
use std::path::{Path, PathBuf};
use tison::math::{Filter, Sampler};
use tison::scene::desc::{Falloff, ReflectDesc, SceneDesc, ShapeDesc, TransformStep, Weight};
use tison::scene::format::{Diagnostic, Look, Override, ReadOptions, Severity, parse, to_toml};

fn read(path: &str, text: &str) -> Result<(SceneDesc, Vec<Diagnostic>), Vec<Diagnostic>> {
    parse(Path::new(path), text.as_bytes(), &ReadOptions::default())
}

fn good(path: &str, text: &str) -> SceneDesc {
    read(path, text).unwrap_or_else(|e| panic!("{path}\n{}", shown(&e))).0
}

fn shown(list: &[Diagnostic]) -> String {
    list.iter().map(|d| d.render(Look::Plain) + "\n\n").collect()
}

/// A scene without what it does not say about the world.
fn without_places(mut desc: SceneDesc) -> SceneDesc {
    desc.files.clear();
    for m in &mut desc.materials {
        m.place = Default::default();
        if let Some(t) = &mut m.texture {
            t.place = Default::default();
        }
    }
    for o in &mut desc.objects {
        o.place = Default::default();
        if let ShapeDesc::Mesh { place, .. } = &mut o.shape {
            *place = Default::default();
        }
    }
    desc
}

/// Files of a folder by name, without those that hold what others should say.
fn files(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).expect("the folder is part of the tests");
    let mut files: Vec<_> = entries.map(|e| e.expect("it can be listed").path()).collect();
    files.retain(|p| p.is_file() && p.extension().is_none_or(|e| e != "txt"));
    files.sort();
    files
}

#[test]
fn every_mistake_has_its_message() {
    let bless = std::env::var_os("TISON_BLESS").is_some();
    let mut wrong = String::new();
    let all = files(Path::new("tests/bad"));
    for path in &all {
        let text = fs::read(path).expect("it is there");
        let found = parse(path, &text, &ReadOptions::default()).expect_err(&format!("{path:?} must be refused"));
        assert!(found.iter().any(|d| d.severity == Severity::Error), "{path:?}");
        let order: Vec<_> = found.iter().map(|d| (d.place().file, d.place().line, d.place().column)).collect();
        assert!(order.is_sorted(), "{path:?}: {order:?}");
        let here = std::env::current_dir().and_then(|d| d.canonicalize()).expect("it is there");
        let found = shown(&found).replace(&*here.to_string_lossy(), "HERE");
        let mut expected = path.clone().into_os_string();
        expected.push(".txt");
        if bless {
            fs::write(&expected, &found).expect("the folder can be written to");
        } else if fs::read_to_string(&expected).ok().as_deref() != Some(found.as_str()) {
            wrong += &format!("{}\n{found}", path.display());
        }
    }
    assert!(all.len() > 60, "the folder is not empty");
    assert!(wrong.is_empty(), "accept with TISON_BLESS=1 cargo test --test formats\n{wrong}");
}

const EVERYTHING: &str = include_str!("good/everything.toml");

#[test]
fn every_key_is_read() {
    let d = good("everything.toml", EVERYTHING);
    let (main, flat, shot) = (&d.cameras[0], &d.cameras[1], &d.cameras[2]);
    assert_eq!((main.name.as_str(), flat.name.as_str(), shot.name.as_str()), ("main", "flat", "a \"shot\""));
    assert_eq!((d.render.filter, d.render.sampler), (Some(Filter::Box), Some(Sampler::Stratified)));
    assert_eq!(main.camera.focus, Some(8.0));
    assert!((shot.camera.focus.expect("on a point") - 65.0_f64.sqrt()).abs() < 1e-14);
    assert_eq!(d.lights[0].color, [60.0, 30.0, 0.0]);
    assert_eq!(d.lights[1].falloff, Falloff::None);
    let names: Vec<_> = d.materials.iter().map(|m| m.name.as_str()).collect();
    assert_eq!(names, ["red", "gold", "glass", "wood"], "the order of the file");
    assert_eq!(d.materials[1].reflect, ReflectDesc::Constant([0.7; 3]));
    assert_eq!(d.materials[2].reflect, ReflectDesc::Fresnel);
    assert_eq!(d.materials[0].specular, Weight::Color([0.5, 0.5, 0.25]));
    assert_eq!(d.materials[3].color, [1.0; 3], "a texture alone is not tinted");
    let [TransformStep::Matrix(m)] = d.objects[2].transform[..] else { panic!("one matrix") };
    // Scaled, then turned by 90 degrees around z, then moved.
    let p = m.transform_point3([1.0, 1.0, 1.0].into());
    assert!(p.abs_diff_eq([2.0 - 1.0, 1.0 + 0.3, 0.3].into(), 1e-15), "{p}");
    let [TransformStep::Fit(2.0), TransformStep::Matrix(m)] = d.objects[4].transform[..] else { panic!("two steps") };
    assert_eq!(m.transform_point3([0.0; 3].into()).to_array(), [-2.0, 3.0, 4.0]);
    let ShapeDesc::Mesh { path, smooth: Some(180.0), place } = &d.objects[4].shape else { panic!("a smooth mesh") };
    assert_eq!((path.as_path(), place.line, place.column), (Path::new("models/dragon.obj"), 99, 8));
    assert_eq!((d.objects[0].place.line, d.objects[0].place.column), (75, 1));
}

#[test]
fn scenes_survive_being_written() {
    let mut scenes = vec![good("everything.toml", EVERYTHING), good("empty.json", r#"{"tison": 1}"#)];
    scenes.push(good("nothing.ray", ""));
    scenes.extend(course().into_iter().map(|(path, text)| good(&path, &text)));
    for scene in scenes {
        let text = to_toml(&scene);
        let again = good("again.toml", &text);
        assert_eq!(format!("{:?}", without_places(again)), format!("{:?}", without_places(scene)), "{text}");
    }
}

#[test]
fn json_says_the_same_as_toml() {
    let json = r#"{"tison": 1, "render": {"size": [64, 48], "min_weight": 0.5},
        "camera": {"main": {"eye": [0, 2, 8], "target": [0, 1, 0], "lens": {"radius": 0.1}}},
        "light": {"key": {"position": [5, 8, 5], "power": 60}},
        "material": {"b": {"color": 0.5}, "a": {"reflect": "fresnel", "refract": 1, "diffuse": [0, 0, 1e-2]}},
        "object": [{"shape": "cube", "half": 2, "material": "a", "transform": {"translate": [1, 0, 0]}},
                   {"shape": "quad", "material": "b"}]}"#;
    let toml = r#"
        tison = 1
        object = [{shape = "cube", half = 2, material = "a", transform = [{translate = [1, 0, 0]}]},
                  {shape = "quad", material = "b"}]
        [render]
        size = [64, 48]
        min_weight = 0.5
        [camera.main]
        eye = [0, 2, 8]
        target = [0, 1, 0]
        lens.radius = 0.1
        [light.key]
        position = [5, 8, 5]
        power = 60
        [material.b]
        color = [0.5, 0.5, 0.5]
        [material.a]
        reflect = "fresnel"
        refract = 1
        diffuse = [0, 0, 0.01]"#;
    let [json, toml] = [good("a.json", json), good("a.toml", toml)].map(without_places);
    assert_eq!(format!("{json:?}"), format!("{toml:?}"));
    assert_eq!(json.materials[0].name, "b", "the order of the file");
}

#[test]
fn included_files_add_to_the_scene() {
    let dir = tempfile::tempdir().expect("a folder for the test");
    let write = |name: &str, text: &str| {
        let path = dir.path().join(name);
        fs::create_dir_all(path.parent().expect("it has one")).expect("a folder");
        fs::write(&path, text).expect("a file");
        path
    };
    write("library/wood.toml", "tison = 1\ninclude = ['more/steel.json']\n[material.wood]\ntexture = 'wood.png'\n");
    write(
        "library/more/steel.json",
        r#"{"tison": 1, "material": {"steel": {}, "iron": {}}, "object": [{"mesh": "s.obj"}]}"#,
    );
    let text = "tison = 1\ninclude = ['library/wood.toml', 'library/more/steel.json']\n[material.red]\n\
                [[object]]\nshape = 'sphere'\nmaterial = 'steel'\n[[object]]\nshape = 'cube'\nmaterial = 'red'";
    let main = write("main.toml", text);
    let (desc, warnings) =
        parse(&main, text.as_bytes(), &ReadOptions::default()).unwrap_or_else(|e| panic!("{}", shown(&e)));
    let names: Vec<_> = desc.materials.iter().map(|m| (m.name.as_str(), m.place.file)).collect();
    assert_eq!(names, [("red", 0), ("wood", 1), ("steel", 2), ("iron", 2)]);
    let texture = desc.materials[1].texture.as_ref().expect("it has one");
    assert_eq!(texture.path, Path::new("library/wood.png"), "beside the file that names it");
    let ShapeDesc::Mesh { path, .. } = &desc.objects[2].shape else { panic!("the mesh comes last") };
    assert_eq!(path, Path::new("library/more/s.obj"));
    assert_eq!(desc.files[2].strip_prefix(dir.path()), Ok(Path::new("library/more/steel.json")));
    // What a library offers may stay unused.
    assert_eq!(
        warnings.iter().map(|w| w.message.as_str()).collect::<Vec<_>>(),
        ["nothing gives light: the objects will be black"]
    );
}

#[test]
fn deep_nesting_does_not_exhaust_the_stack() {
    let (keys, n) = ("a.".repeat(100_000), 100_000);
    let texts = [
        ("a.toml", format!("a = {}", "[".repeat(n))),
        ("a.toml", format!("a = {}", "{a=".repeat(n))),
        ("a.toml", format!("{keys}a = 1")),
        ("a.toml", format!("[{keys}a]")),
        ("a.json", format!("{{\"a\":{}", "[".repeat(n))),
        ("a.json", "{\"a\":".repeat(n)),
        ("a.ray", "PushMatrix ".repeat(n)),
    ];
    for (name, text) in texts {
        read(name, &text).expect_err("far too deep");
    }
    for set in [format!("render.{keys}a=1"), format!("render.a={}", "[".repeat(n)), format!("render.a={{{keys}a=1}}")] {
        with("a.toml", "tison = 1", &[&set]).expect_err("far too deep");
    }
}

#[test]
fn what_looks_odd_is_warned_of() {
    let text = "tison = 1\n[render]\nambient = 1\n[material.glass]\nreflect = 0.7\nrefract = [0.1, 0.5, 0]\n\
                [material.ice]\nreflect = 'fresnel'\nrefract = 1\n[[object]]\nshape = 'sphere'\nmaterial = 'glass'\n";
    let (_, warnings) = read("odd.toml", text).expect("only warnings");
    let lines: Vec<_> = warnings.iter().map(|w| (w.place().line, w.message.as_str())).collect();
    let want = [(6, "material `glass` makes light: reflect + refract is 1.2"), (7, "no object uses material `ice`")];
    assert_eq!(lines, want);
    let text = "PushMatrix\nMaterial \"a\" \"metallic\" 0 \"metallic\" 1\nMaterial \"a\"\nSphere 1 \"a\"\ncontainer \"BVH\"\ncontainer \"BVH\"";
    let (_, warnings) = read("odd.ray", text).expect("only warnings");
    assert_eq!(warnings.iter().map(|w| w.place().line).collect::<Vec<_>>(), [1, 2, 3, 6, 6]);
}

/// The course's scenes, where they are at hand.
fn course() -> Vec<(String, String)> {
    let folder =
        ["../shared/course/scene", "../../shared/course/scene"].map(Path::new).into_iter().find(|f| f.is_dir());
    let Some(folder) = folder else { return Vec::new() };
    let text = |p: PathBuf| (p.display().to_string(), fs::read_to_string(&p).expect("it is there"));
    files(folder).into_iter().map(text).collect()
}

#[test]
fn the_scenes_of_the_course_are_read() {
    for (path, text) in course() {
        let (desc, warnings) = read(&path, &text).unwrap_or_else(|e| panic!("{}", shown(&e)));
        assert!(warnings.is_empty(), "{}", shown(&warnings));
        assert_eq!(desc.objects.len(), text.matches("\nPushMatrix").count(), "{path}");
        assert_eq!(desc.lights.len(), text.matches("\nSphericalLight").count(), "{path}");
        assert_eq!(desc.materials.len(), text.matches("\nMaterial").count(), "{path}");
        let r = &desc.render;
        assert!(r.course_rules && r.size == Some((640, 480)) && r.min_weight == Some(0.0), "{path}");
        assert_eq!(desc.cameras[0].camera.clip, Some((3.0, 20.0)), "{path}");
    }
}

fn with(path: &str, text: &str, overrides: &[&str]) -> Result<SceneDesc, String> {
    let overrides = overrides.iter().map(|&o| o.into()).collect::<Vec<Override>>();
    let options = ReadOptions { overrides, ..ReadOptions::default() };
    parse(Path::new(path), text.as_bytes(), &options).map(|(desc, _)| desc).map_err(|e| shown(&e))
}

#[test]
fn keys_can_be_set_from_outside() {
    let set = [
        "render.samples=3",
        "camera.main.fov = 30",
        "material.red.diffuse=0.2",
        "object.0.center=[0, 1, 0]",
        "object.table.material=gold",
        "camera.main.lens.radius=0.5",
        "object.2.transform.1.degrees=0",
        "render.seed=9",
        "camera.main.eye.0=0.5",
        "light.key.power=2",
        "render.size=[8, 4]",
    ];
    let d = with("everything.toml", EVERYTHING, &set).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!((d.render.samples, d.render.seed, d.render.size), (Some(3), Some(9), Some((8, 4))));
    assert_eq!(d.materials[0].diffuse, Weight::Share(0.2));
    assert_eq!(d.objects[0].shape, ShapeDesc::Sphere { center: [0.0, 1.0, 0.0].into(), radius: 1.0 });
    assert_eq!(d.objects[1].material.as_deref(), Some("gold"));
    assert_eq!((d.cameras[0].camera.aperture, d.cameras[0].camera.eye.x), (0.5, 0.5));
    assert_eq!(d.lights[0].color, [2.0, 1.0, 0.0]);
    let [TransformStep::Matrix(m)] = d.objects[2].transform[..] else { panic!("one matrix") };
    assert_eq!(m.transform_vector3([1.0, 0.0, 0.0].into()).to_array(), [0.3, 0.0, 0.0]);
    assert!(with("a.toml", "tison = 1", &["render.samples=3"]).expect("made on the way").render.samples == Some(3));
}

#[test]
fn keys_of_a_course_scene_can_be_set_too() {
    let text = "Perspective 30 1.33 3 20\nLookAt 0 0 15 0 0 0 0 1 0\nDOF 2 10\nMaterial \"red\"\nRotate 10 1 2 3\nCylinder 1 2 \"red\"\n";
    let plain = good("a.ray", text);
    let set = with("a.ray", text, &["camera.main.fov=35", "material.red.color=[1, 0, 0]", "render.samples=7"]);
    let mut want = plain.clone();
    want.cameras[0].camera.projection = tison::scene::Projection::Perspective { fov_deg: 35.0 };
    want.materials[0].color = [1.0, 0.0, 0.0];
    want.render.samples = Some(7);
    let mut set = set.unwrap_or_else(|e| panic!("{e}"));
    set.files.clone_from(&want.files);
    assert_eq!(format!("{set:?}"), format!("{want:?}"), "places and all");
}

#[test]
fn overrides_that_name_nothing_are_refused() {
    let cases = [
        ("rendr.samples=4", "did you mean `render`?"),
        ("camera.mian.fov=30", "did you mean `main`?"),
        ("material.glod.diffuse=0", "did you mean `gold`?"),
        ("object.bal.center=[0, 0, 0]", "did you mean `ball`?"),
        ("object.7.center=[0, 0, 0]", "expected one of 0 to 4, ball, table"),
        ("render.sampels=4", "did you mean `samples`?"),
        ("render.samples=0.5", "-D:1:16"),
        ("render.samples.few=3", "it has no key `few`"),
        ("object.0.center=[0, 1", "TOML"),
        ("object.0.radius=1 2", "TOML"),
        ("render.samples=", "TOML"),
        ("render.samples", "there is no value"),
        ("render..samples=4", "not complete"),
        ("=4", "not complete"),
        ("render.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a=4", "too long"),
        ("", "not complete"),
        ("\"render", "there is no value"),
        ("camera.main.eye.x=4", "has no element `x`"),
        ("render=4", "expected a table of keys"),
        ("light=[]", "expected a table for each name"),
        ("object=é", "expected an array of tables"),
        ("object.0.material=gld", "did you mean `gold`?"),
    ];
    for (text, want) in cases {
        let e = with("everything.toml", EVERYTHING, &[text]).expect_err(text);
        assert!(e.contains(want) && e.contains("--> -D:1:"), "{text}: {e}");
    }
}

/// Words that scenes are made of, and some that they are not.
fn soup(words: &'static [&'static str]) -> impl Strategy<Value = String> {
    prop::collection::vec((prop::sample::select(words), prop::sample::select(&[" ", "\n", "", ". ", " = "][..])), 0..60)
        .prop_map(|list| list.into_iter().flat_map(|(word, gap)| [word, gap]).collect())
}

const RAY_WORDS: &[&str] = &[
    "dimension 4 4",
    "container",
    "\"BVH\"",
    "samples_per_pixel",
    "Perspective 30 1 3 20",
    "LookAt 0 0 9 0 0 0 0 1 0",
    "DOF 3 4",
    "Material",
    "\"red\"",
    "\"color_albedo\"",
    "[1 0 0]",
    "\"k_diffuse\"",
    "PushMatrix",
    "PopMatrix",
    "Translate",
    "Scale",
    "Rotate 90",
    "Sphere",
    "Quad 1",
    "Cylinder 1 2",
    "Mesh",
    "SphericalLight 0 0 0",
    "1",
    "-.5",
    "1e300",
    "[",
    "]",
    "\"",
    "#",
    "é",
    "nan",
];
const TOML_WORDS: &[&str] = &[
    "tison = 1\n",
    "[render]\n",
    "[camera.main]\n",
    "[light.key]\n",
    "[material.red]\n",
    "[[object]]\n",
    "eye = [0, 0, 1]\n",
    "target = [0, 0, 0]\n",
    "position = [0, 0, 0]\n",
    "shape = \"sphere\"\n",
    "material = \"red\"\n",
    "transform = [{ scale = 2 }]\n",
    "size = [4, 4]\n",
    "reflect = \"fresnel\"\n",
    "lens = { radius = 1 }\n",
    "fov",
    "=",
    "[",
    "]",
    "{",
    "}",
    "\"",
    "'",
    "#",
    "1",
    "nan",
    "-1e99",
    "é",
    "include",
    "\"\"\"",
];
const JSON_WORDS: &[&str] = &[
    "{\"tison\": 1,",
    "\"render\": {",
    "\"object\": [",
    "{\"shape\": \"sphere\"}",
    "\"camera\": {\"main\": {\"eye\": [0, 0, 1]}}",
    "{",
    "}",
    "[",
    "]",
    ",",
    ":",
    "\"",
    "\"a\"",
    "1",
    "-",
    "1e9",
    "null",
    "true",
    "\\u12",
    "\\",
    "é",
];

const COURSE_LIKE: &str = "# caf\u{e9}\ncontainer \"BVH\"\ndimension 64 48\nsamples_per_pixel 5\njitter_radius 0.5\nmax_ray_depth 2\n\
    ambient_light [0.1 0.1 0.1]\nPerspective 30.0 1.33 3 20\nLookAt 0 1.25 15 0 0 0 0 1 0\nDOF 3 15\nMaterial \"m\"\n    \
    \"texture_albedo\" \"a.bmp\"\n    \"k_refraction\" 1 \"refractive_index\" 1.5\nPushMatrix\n    Rotate 90 1 0 0\n    \
    Cylinder 0.75 1.5 \"m\"\nPopMatrix\nMesh \"a.obj\" \"m\"\nSphericalLight 1 1 2\n    \"emission\" [1 1 1]\n    \"radius\" 0";

/// A good statement of a course scene.
fn statement() -> impl Strategy<Value = String> {
    let size = 0.01..100.0_f64;
    let v = -9.0..9.0_f64;
    let names = prop::sample::select(&["m", "n n", "é"][..]);
    prop_oneof![
        (size.clone(), names.clone()).prop_map(|(r, m)| format!("Sphere {r} \"{m}\"")),
        (size.clone(), names.clone()).prop_map(|(s, m)| format!("Quad {s:e}\"{m}\"")),
        (size.clone(), size.clone(), names.clone()).prop_map(|(r, h, m)| format!("Cylinder +{r} {h} \"{m}\"")),
        names.clone().prop_map(|m| format!("Mesh \"a b.obj\" \"{m}\"")),
        (size.clone(), size.clone(), size).prop_map(|(x, y, z)| format!("Scale {x} -{y} {z}")),
        [v.clone(), v.clone(), v.clone()].prop_map(|[x, y, z]| format!("Translate {x} {y} {z} # moved")),
        [v.clone(), v.clone(), v.clone()].prop_map(|[a, x, y]| format!("Rotate {a} {x} {y} 1")),
        [v.clone(), v.clone(), v].prop_map(|[x, y, z]| format!("SphericalLight {x} {y} {z} \"emission\"[1 2 3]")),
        names.prop_map(|m| format!("Material \"{m}\" \"k_diffuse\" .5 \"color_albedo\" [1 0 0]")),
        Just("PushMatrix\r\n".into()),
        Just("max_ray_depth 3 DOF 1 5".into()),
    ]
}

proptest! {
    #[test]
    fn good_statements_are_read_in_any_order(list in prop::collection::vec(statement(), 0..30)) {
        let scene = format!("Material \"m\" Material \"n n\" Material \"é\" {}", list.join("\n"));
        let desc = good("a.ray", &scene);
        let shapes = ["Sphere ", "Quad ", "Cylinder ", "Mesh "];
        prop_assert_eq!(desc.objects.len(), list.iter().filter(|s| shapes.iter().any(|w| s.starts_with(w))).count());
        prop_assert_eq!(desc.lights.len(), list.iter().filter(|s| s.starts_with("Spherical")).count());
        let again = good("again.toml", &to_toml(&desc));
        prop_assert_eq!(format!("{:?}", without_places(again)), format!("{:?}", without_places(desc)));
    }

    #[test]
    fn no_slip_of_the_pen_brings_the_readers_down(at in any::<prop::sample::Index>(), len in 0..8_usize,
            with in prop::sample::select(&["", "\"", "]", "[", "{", "#", "=", "-", "é", "\n", "nan", "1e999", "0", "x"][..])) {
        let json = r#"{"tison": 1, "camera": {"main": {"eye": [0, 2, 8], "target": [0, 1, 0]}}, "object": [{"shape": "cube"}]}"#;
        for (name, text) in [("a.toml", EVERYTHING), ("a.ray", COURSE_LIKE), ("a.json", json)] {
            let cuts: Vec<usize> = text.char_indices().map(|(i, _)| i).chain([text.len()]).collect();
            let from = at.index(cuts.len());
            let to = (from + len).min(cuts.len() - 1);
            let text = format!("{}{with}{}", &text[..cuts[from]], &text[cuts[to]..]);
            let found = read(name, &text).map_or_else(|e| e, |(_, w)| w);
            prop_assert!(found.iter().all(|d| !d.render(Look::Plain).is_empty() && d.place().line > 0));
        }
    }

    #[test]
    fn no_bytes_bring_the_readers_down(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
        for name in ["a.toml", "a.json", "a.ray", "a.scn", "a"] {
            for d in parse(Path::new(name), &bytes, &ReadOptions::default()).map_or_else(|e| e, |(_, w)| w) {
                prop_assert!(!d.render(Look::Plain).is_empty() && d.place().line <= d.end().line);
            }
        }
    }

    #[test]
    fn no_soup_of_words_brings_the_readers_down(ray in soup(RAY_WORDS), toml in soup(TOML_WORDS), json in soup(JSON_WORDS), set in "[a-z\"]{0,9}[.=]?[a-z0-9\".]{0,6}=?.{0,9}") {
        let overrides = vec![set.as_str().into(), "object.0.radius=2".into()];
        let options = [ReadOptions::default(), ReadOptions { overrides, ..ReadOptions::default() }];
        for (name, text) in [("a.ray", &ray), ("a.toml", &toml), ("a.json", &json), ("a.toml", &format!("tison = 1\n{toml}"))] {
            for options in &options {
                match parse(Path::new(name), text.as_bytes(), options) {
                    Ok((desc, warnings)) => {
                        prop_assert!(warnings.iter().all(|d| !d.render(Look::Plain).is_empty()));
                        let again = good("again.toml", &to_toml(&desc));
                        prop_assert_eq!(format!("{:?}", without_places(again)), format!("{:?}", without_places(desc)));
                    }
                    Err(errors) => prop_assert!(!errors.is_empty() && errors.len() <= 21 && !shown(&errors).is_empty()),
                }
            }
        }
    }
}
