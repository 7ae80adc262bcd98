//! Flag, scene file, default: in this order.

use super::*;
use crate::cli::plan::tests::plan_ok;

/// A scene file that says everything.
fn said() -> RenderDesc {
    RenderDesc {
        size: Some((640, 480)),
        samples: Some(4),
        recursion: Some(3),
        min_weight: Some(0.25),
        seed: Some(7),
        jitter_radius: Some(0.25),
        filter: Some(Filter::Box),
        sampler: Some(Sampler::Random),
        lens_sampler: Some(LensSampler::Polar),
        ..RenderDesc::default()
    }
}

fn course() -> RenderDesc {
    RenderDesc { min_weight: Some(0.0), course_rules: true, ..said() }
}

fn settings(flags: &str, render: &RenderDesc) -> Settings {
    Settings::new(&plan_ok(flags), render).unwrap_or_else(|f| panic!("{flags}: {f:?}"))
}

fn refused(flags: &str, render: &RenderDesc) -> String {
    let failure = Settings::new(&plan_ok(flags), render).expect_err(flags);
    format!("{} {}", failure.what, failure.help.unwrap_or_default())
}

#[test]
fn each_setting_is_the_flags_else_the_scenes_else_the_default() {
    // Name, flags, and what is then shown without a word in the scene, with one, and with the flags.
    let cases = [
        ("size", "--size 30x20", ["1280x720", "640x480", "30x20"]),
        ("spp", "--spp 2", ["16", "4", "2"]),
        ("recursion", "-r=50", ["8", "3", "50"]),
        ("min-weight", "--min-weight 0.5", ["0.0009765625", "0.25", "0.5"]),
        ("seed", "--seed 9", ["0", "7", "9"]),
        ("filter", "--filter box", ["blackman-harris", "box", "box"]),
        ("sampler", "--sampler stratified", ["sobol", "random", "stratified"]),
        ("lens-sampler", "--lens-sampler rejection", ["concentric", "polar", "rejection"]),
    ];
    for (name, flags, want) in cases {
        let shown = |flags: &str, render: &RenderDesc| {
            let list = settings(&format!("a.toml {flags}"), render).list;
            let setting = list.into_iter().find(|s| s.name == name).expect(name);
            (setting.value, setting.origin)
        };
        assert_eq!(shown("", &RenderDesc::default()), (want[0].into(), Origin::Default), "{name}");
        assert_eq!(shown("", &said()), (want[1].into(), Origin::Scene), "{name}");
        for render in [RenderDesc::default(), said()] {
            assert_eq!(shown(flags, &render), (want[2].into(), Origin::Flag), "{name}");
        }
    }
}

#[test]
fn what_is_shown_is_what_the_job_does() {
    let job = settings("a.toml", &said()).job;
    assert_eq!((job.size, job.spp, job.k_max, job.seed), ((640, 480), 4, 3, 7));
    assert_eq!((job.min_weight, job.jitter_radius, job.light_samples), (0.25, 0.25, 1));
    assert_eq!((job.sampler, job.lens_sampler), (Sampler::Random, LensSampler::Polar));
    let flags = "a.toml --size 8x6 --spp 2 -r 5 --seed 1 --min-weight 0 --lens-sampler rejection --light-samples 9 \
                 --sampler sobol";
    let job = settings(flags, &said()).job;
    assert_eq!((job.size, job.spp, job.k_max, job.seed), ((8, 6), 2, 5, 1));
    assert_eq!((job.min_weight, job.light_samples, job.lens_sampler), (0.0, 9, LensSampler::Rejection));
    assert_eq!(job.sampler, Sampler::Sobol);
}

#[test]
fn the_filter_is_a_bell_unless_there_is_reason_for_a_box() {
    let silent = RenderDesc::default();
    let with = |filter| RenderDesc { filter: Some(filter), ..RenderDesc::default() };
    let course = RenderDesc { course_rules: true, ..RenderDesc::default() };
    let wide = RenderDesc { jitter_radius: Some(2.0), ..RenderDesc::default() };
    for (flags, render, want, origin) in [
        ("a.toml", &silent, Filter::BlackmanHarris, Origin::Default),
        ("a.obj --spp 2", &silent, Filter::BlackmanHarris, Origin::Default),
        ("a.obj", &silent, Filter::Box, Origin::Default),
        ("a.toml", &with(Filter::Tent), Filter::Tent, Origin::Scene),
        ("a.toml -D render.filter=tent", &with(Filter::Tent), Filter::Tent, Origin::Define),
        ("a.toml --spp 1", &with(Filter::Tent), Filter::Tent, Origin::Scene),
        ("a.toml --filter mitchell", &with(Filter::Tent), Filter::Mitchell, Origin::Flag),
        ("a.obj --filter box", &silent, Filter::Box, Origin::Flag),
        ("a.ray", &course, Filter::Box, Origin::Scene),
        ("a.ray --filter tent", &course, Filter::Tent, Origin::Flag),
        ("a.toml", &wide, Filter::Box, Origin::Scene),
        ("a.toml --filter box", &wide, Filter::Box, Origin::Flag),
    ] {
        let settings = settings(flags, render);
        let shown = settings.list.iter().find(|s| s.name == "filter").expect("it is shown");
        assert_eq!((settings.job.filter, shown.value.as_str(), shown.origin), (want, want.name(), origin), "{flags}");
    }
    assert!(refused("a.toml --filter tent", &wide).contains("sets jitter_radius"));
    assert!(refused("a.toml --filter tent --spp 1", &silent).contains("add --spp 16"));
}

#[test]
fn flags_about_the_image_count_on_the_scenes_size() {
    let job = settings("a.toml --scale 50% --crop 0.5,0.0,1.0,1.0", &said()).job;
    assert_eq!((job.size, job.crop.x0, job.crop.x1, job.crop.y1), ((320, 240), 160, 320, 240));
    assert_eq!(settings("a.toml --pixel 639,479", &said()).pixel, Some((639, 479)));
    assert!(refused("a.toml --crop 0,0,641,480", &said()).contains("640x480"));
    assert!(refused("a.toml --pixel 640,0", &said()).contains("outside the image"));
}

#[test]
fn course_scenes_are_shown_and_lit_as_the_courses_program_does() {
    let plain = settings("a.toml", &said());
    assert_eq!((plain.display.tonemap, plain.job.light_samples), (Tonemap::None, 1));
    let s = settings("a.ray", &course());
    assert_eq!((s.display.tonemap, s.job.light_samples, s.job.min_weight), (Tonemap::Stretch, 4, 0.0));
    assert_eq!(settings("a.ray --spp 64", &course()).job.light_samples, 4, "a number of the scene's own");
    let silent = RenderDesc { samples: None, ..course() };
    assert_eq!(settings("a.ray", &silent).job.light_samples, 1);
    let s = settings("a.ray --tonemap none --exposure 1 --light-samples 2", &course());
    assert_eq!((s.display.tonemap, s.display.exposure, s.job.light_samples), (Tonemap::None, 1.0, 2));
}

#[test]
fn what_would_do_nothing_is_refused() {
    assert!(refused("a.toml --centre", &said()).contains("there are 4; add --spp 1"));
    assert!(refused("a.toml --centre --spp 3", &said()).contains("not for --spp 3"));
    assert!(settings("a.toml --centre --spp 1", &said()).job.centre);
    assert!(settings("a.toml --centre", &RenderDesc { samples: Some(1), ..said() }).job.centre);
    assert!(refused("a.ray --exposure 1", &course()).contains("--tonemap"));
}

#[test]
fn a_key_set_by_define_says_so() {
    let origin =
        |defines: &[&str], key| origin_in_scene(&defines.iter().map(|&d| d.to_owned()).collect::<Vec<_>>(), key);
    assert_eq!(origin(&["render.samples=4"], "render.samples"), Origin::Define);
    assert_eq!(origin(&["render={samples=4}"], "render.samples"), Origin::Define);
    assert_eq!(origin(&["camera.main.lens.radius = 4"], "camera.main.lens"), Origin::Define);
    assert_eq!(origin(&["render.samples_of=4", "camera.main.fov=3"], "render.samples"), Origin::Scene);
    assert_eq!(origin(&[], "render.samples"), Origin::Scene);
    let list = settings("a.toml -D render.seed=7", &said()).list;
    let of = |name| list.iter().find(|s| s.name == name).map(|s| s.origin);
    assert_eq!((of("seed"), of("spp")), (Some(Origin::Define), Some(Origin::Scene)));
}
