//! Flags checked together.

use super::*;
use crate::cli::args::{Cli, Command};
use crate::cli::exit::Exit;
use tison::render::{Crop, Job};
use tison::scene::desc::LensSampler;

/// A plan by the words of a command line.
pub fn plan(flags: &str) -> Result<Plan, Failure> {
    let cli = Cli::from_words(["tison"].into_iter().chain(flags.split_whitespace()))
        .map_err(|e| Failure::usage(e.to_string()))?;
    match cli.command {
        Some(Command::Render(args)) => Plan::new(&args),
        None => Plan::new(&cli.render),
        Some(other) => panic!("{flags}: {other:?}"),
    }
}

pub fn plan_ok(flags: &str) -> Plan {
    plan(flags).unwrap_or_else(|f| panic!("{flags}: {f:?}"))
}

/// The job of a mesh, about which a file says nothing.
fn job(flags: &str) -> Job {
    Settings::new(&plan_ok(flags), &RenderDesc::default()).unwrap_or_else(|f| panic!("{flags}: {f:?}")).job
}

#[test]
fn defaults_of_a_bare_mesh() {
    let (plan, job) = (plan_ok("models/a.b.obj"), job("models/a.b.obj"));
    assert_eq!(job.size, (1280, 720));
    assert_eq!(job.crop, Crop { x0: 0, y0: 0, x1: 1280, y1: 720 });
    assert_eq!((job.spp, job.k_max, job.seed, job.light_samples), (1, 8, 0, 1));
    assert_eq!((job.min_weight, job.jitter_radius), (1.0 / 1024.0, 0.5));
    assert_eq!(job.lens_sampler, LensSampler::Concentric);
    assert_eq!(plan.kind, Input::Mesh);
    assert_eq!(plan.backend, Backends::One(tison::backend::BackendKind::COMPILED[0]));
    assert_eq!(plan.outputs.len(), 1);
    assert_eq!(plan.outputs[0].target, Target::File("a.b.png".into()));
    assert!(plan.picture.pixel.is_none() && plan.camera.turntable.is_none());
    assert!(!plan.quiet && !plan.verbose && !plan.strict && !plan.print_config);
}

#[test]
fn a_scene_is_told_by_its_name() {
    for (name, kind) in [
        ("a.toml", Input::Scene),
        ("d/a.JSON", Input::Scene),
        ("a.ray", Input::Scene),
        ("a.obj", Input::Mesh),
        ("a", Input::Mesh),
        ("toml", Input::Mesh),
    ] {
        assert_eq!(plan_ok(name).kind, kind, "{name}");
    }
    assert_eq!(plan_ok("d/a.toml").outputs[0].target, Target::File("a.png".into()));
}

#[test]
fn the_size_of_a_scene_is_known_if_it_is_given() {
    let size = |flags: &str| plan_ok(flags).known_frame().unwrap().map(|f| f.size);
    assert_eq!(size("a.obj"), Some((1280, 720)));
    assert_eq!(size("a.toml"), None);
    assert_eq!(size("a.toml --size 40x30 --scale 50%"), Some((20, 15)));
    assert!(plan("a.toml --size 40x30 --crop 0,0,41,30").is_err(), "before the file is read");
    assert!(plan_ok("a.toml --crop 0,0,4100,3000 --camera any").known_frame().unwrap().is_none());
}

#[test]
fn sizes_scales_and_crops() {
    let cases = [
        ("a.obj --size 200x100", (200, 100), [0, 0, 200, 100]),
        ("a.obj --size 200x100 --scale 50%", (100, 50), [0, 0, 100, 50]),
        ("a.obj --size 3x3 --scale 1%", (1, 1), [0, 0, 1, 1]),
        ("a.obj --size 200x100 --crop 10,20,30,40", (200, 100), [10, 20, 30, 40]),
        ("a.obj --size 200x100 --crop 0.25,0.0,0.75,0.5", (200, 100), [50, 0, 150, 50]),
        ("a.obj --size 200x100 --crop=0.5,0,1,1", (200, 100), [100, 0, 200, 100]),
        ("a.obj --size 100000x50000 --crop 0,0,64,64", (100_000, 50_000), [0, 0, 64, 64]),
    ];
    for (flags, size, [x0, y0, x1, y1]) in cases {
        let job = job(flags);
        assert_eq!(job.size, size, "{flags}");
        assert_eq!(job.crop, Crop { x0, y0, x1, y1 }, "{flags}");
    }
}

#[test]
fn neighbouring_shares_meet() {
    let edges: Vec<Crop> = ["0.0,0,0.333,1", "0.333,0,0.667,1", "0.667,0,1,1"]
        .iter()
        .map(|c| job(&format!("a.obj --size 100x9 --crop {c}")).crop)
        .collect();
    assert_eq!(edges[0].x1, edges[1].x0);
    assert_eq!(edges[1].x1, edges[2].x0);
    assert_eq!(edges[2].x1, 100);
}

#[test]
fn what_cannot_be_is_refused() {
    let cases = [
        ("a.obj --size 200x100 --crop 0,0,201,100", "beyond the image"),
        ("a.obj --size 9x9 --crop 0.50,0.5,0.51,0.51", "no pixel"),
        ("a.obj --size 200x100 --pixel 200,0", "outside the image"),
        ("a.obj --pixel 1,1 -o a.png", "cannot be used with"),
        ("a.obj --pixel 1,1 --aov depth", "cannot be used with"),
        ("a.obj --pixel 1,1 --turntable 3", "cannot be used with"),
        ("a.obj --pixel 1,1 --stats -", "cannot be used with"),
        ("a.obj --fov 30 --ortho 2", "cannot be used with"),
        ("a.obj --camera front --eye 1,2,3", "cannot be used with"),
        ("a.obj -D render.samples=4", "a.obj is none"),
        ("a.toml --allow-path /no/such/folder", "no such folder"),
        ("a.toml -D render.samples", "path.to.key=value"),
        ("a.obj --pixel 1,1 --exposure 1", "cannot be used with"),
        ("a.obj --print-config --pixel 1,1", "cannot be used with"),
        ("a.obj --print-config --stats -", "cannot be used with"),
        ("a.obj -o a.exr --exposure 1", "a.exr holds light as it is"),
        ("a.toml -o a.exr -o a.pfm --tonemap none", "--tonemap is for 8-bit formats"),
        ("a.obj --tonemap stretch --exposure 1", "--exposure changes nothing"),
        ("a.obj --tonemap acse", "'aces'"),
        ("a.obj --exposure 65", "from -64 to 64"),
        ("a.obj --lens-sampler polr", "'polar'"),
        ("a.obj --sampler sobel", "'sobol'"),
        ("a.obj --filter mitchel", "'mitchell'"),
        ("a.obj --filter tent", "changes nothing with one sample a pixel"),
        ("a.obj --light-samples 0", "0 is not in 1.."),
        ("a.obj -r 100001", "100001 is not in"),
        ("a.obj --camera frnt", "did you mean 'front'?"),
        ("a.obj --camera frnt", "three-quarter, front, back, left, right, top, bottom"),
        ("a.obj --focus 3", "--aperture"),
        ("a.obj --fov 180", "between 0 and 180"),
        ("a.obj --centre --spp 4", "--centre is for one sample"),
        ("a.obj -q -v", "cannot be used with"),
        ("a.obj -q --progress bar", "cannot be used with"),
        ("a.obj --spp 0", "0 is not in 1.."),
        ("a.obj -j 0", "0 is not in 1.."),
        ("a.obj --turntable 0", "0 is not in 1.."),
        ("a.obj -o - --aov depth", "do not fit on stdout"),
        ("a.obj -o - --turntable 4", "do not fit on stdout"),
        ("a.obj -o - -o -", "one stdout"),
        ("a.obj -o - --stats -", "both go to stdout"),
        ("a.obj -o x.png -o x.png", "written twice"),
        ("a.obj -o x.png --stats x.png", "written twice"),
        ("a.obj -o x.png -o x.depth.png --aov depth", "written twice"),
        ("a.obj -o x.jqg", "did you mean .jpg?"),
        ("a.obj -o x.tiff", "png, exr, hdr"),
        ("a.obj -o x", "no extension"),
        ("a.obj --aov dept", "depth"),
        ("a.obj --backend embre", "embree"),
        ("a.obj --recusion 5", "--recursion"),
        ("a.obj --nonsense", "unexpected argument"),
        ("a.obj b.obj", "unexpected argument"),
        ("a.obj --eye 1,2", "expected x,y,z"),
        ("a.obj --up 0,0,0", "no direction"),
        ("a.obj --min-weight -1", "from 0 to 1"),
        ("a.obj --seed -1", "invalid"),
        ("a.obj --size 0x0", "at least 1x1"),
    ];
    for (flags, want) in cases {
        let failure = plan(flags).err().unwrap_or_else(|| panic!("accepted: {flags}"));
        let text = format!("{} {}", failure.what, failure.help.unwrap_or_default());
        assert_eq!(failure.exit, Exit::Usage, "{flags}");
        assert!(text.contains(want), "{flags}: {text}");
    }
}

#[test]
fn negative_values_and_short_forms() {
    let plan = plan_ok("a.obj --eye -1,2,-3 --target -0.5,0,0 --up 0,-1,0 -r=50 -j2");
    assert_eq!(plan.camera.eye, Some(glam::DVec3::new(-1.0, 2.0, -3.0)));
    assert_eq!(plan.camera.up, Some(glam::DVec3::NEG_Y));
    assert_eq!((plan.picture.recursion, plan.threads), (Some(50), 2));
    for flags in ["a.obj -r 50", "a.obj -r=50", "a.obj -r50", "render a.obj --recursion=50", "-r=50 a.obj"] {
        assert_eq!(job(flags).k_max, 50, "{flags}");
    }
    assert_eq!(job("a.obj -r 100000").k_max, 100_000);
    assert_eq!(plan_ok("-q info").input, Path::new("info"), "flags first: a file, not a command");
}

#[test]
fn every_file_of_a_run_is_known_before() {
    let plan = plan_ok("a.obj -o d/x.png -o d/x.exr --aov depth,id,depth --stats s.json");
    assert_eq!(plan.aovs, [tison::film::Aov::Depth, tison::film::Aov::Id]);
    let want = ["d/x.png", "d/x.depth.png", "d/x.id.png", "d/x.exr", "s.json"].map(PathBuf::from);
    assert_eq!(plan.files(), want);
    assert_eq!(plan_ok("a.obj -o x.png --turntable 8").files(), [PathBuf::from("x-0001.png")]);
    assert!(plan_ok("a.obj -o -").files().is_empty());
    assert_eq!(plan_ok("d/a.ray --aov depth").files(), ["a.png", "a.depth.png"].map(PathBuf::from));
}

#[test]
fn the_input_is_not_overwritten() {
    let dir = tempfile::tempdir().unwrap();
    let (input, link) = (dir.path().join("a.png"), dir.path().join("b.png"));
    fs::write(&input, "v 0 0 0").unwrap();
    std::os::unix::fs::symlink(&input, &link).unwrap();
    for output in [&input, &link] {
        let failure = plan(&format!("{} -o {}", input.display(), output.display())).unwrap_err();
        assert!(failure.what.contains("would be overwritten"), "{}", failure.what);
    }
}
