//! Adaptive sampling, and the error that a picture says it has.

use super::kit::{build, job, load, render};
use std::sync::LazyLock;
use std::time::{Duration, Instant};
use tison::backend::BackendKind;
use tison::film::{Aov, Film};
use tison::math::Filter;
use tison::render::{self, Adapted, Control, Ended, Job, Outcome, Stop};

/// A ball and its soft shadow on a floor, through a lens: flat parts, edges, and much that is out of focus.
const STILL: &str = r#"
[render]
background = [0.2, 0.3, 0.5]
ambient = 0.2
[camera.main]
eye = [0, 1.4, 5]
target = [0, 0.6, 0]
fov = 40
lens = { radius = 0.08, focus = 5 }
[light.lamp]
position = [3, 5, 3]
radius = 0.6
color = 0.8
[material]
red = { color = [0.8, 0.2, 0.1], specular = 0.3 }
grey = { color = 0.5 }
[[object]]
shape = "sphere"
center = [0.1, 0.8, 0]
radius = 0.8
material = "red"
[[object]]
shape = "cube"
half = [20, 0.1, 20]
material = "grey"
transform = [{ translate = [0, -0.1, 0] }]
[[object]]
shape = "cube"
half = [0.2, 0.3, 0.2]
material = "red"
transform = [{ translate = [-1.4, 0.3, 2.2] }]
"#;

fn samples(outcome: &Outcome) -> Vec<u32> {
    let image = outcome.film.aovs.iter().find(|a| a.kind == Aov::Samples).expect("it was asked for");
    image.data.iter().map(|&n| n as u32).collect()
}

fn rmse(a: &Film, b: &Film) -> f64 {
    let pairs = a.color.as_flattened().iter().zip(b.color.as_flattened());
    (pairs.map(|(a, b)| (f64::from(*a) - f64::from(*b)).powi(2)).sum::<f64>() / a.color.len() as f64 / 3.0).sqrt()
}

fn adapted(outcome: &Outcome) -> Adapted {
    outcome.stats.adapted.expect("it is adaptive")
}

/// Good enough to measure errors of 0.002 by; by another seed than any that is measured.
static REFERENCE: LazyLock<Film> = LazyLock::new(|| {
    render(BackendKind::Native, &load(STILL), &Job { spp: 2048, seed: 999, ..job(SIZE.0, SIZE.1) }).film
});
const SIZE: (u32, u32) = (96, 64);

#[test]
fn adaptive_pictures_have_the_same_bytes_for_any_number_of_threads() {
    let still = load(STILL);
    for &kind in BackendKind::COMPILED {
        for stop in [Stop::Noise(0.02), Stop::Rmse(0.001)] {
            let job = Job { spp: 512, stop, aovs: vec![Aov::Samples, Aov::Depth], ..job(75, 50) };
            let with = |threads| {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
                pool.install(|| render(kind, &still, &job))
            };
            let (one, two, seven) = (with(1), with(2), with(7));
            assert!(adapted(&one).rounds > 2, "{stop:?} had {} rounds", adapted(&one).rounds);
            for other in [two, seven] {
                assert!(one.film.color == other.film.color, "{stop:?}, {kind:?}");
                assert!(
                    one.film.aovs.iter().zip(&other.film.aovs).all(|(a, b)| a.data == b.data),
                    "{stop:?}, {kind:?}"
                );
                assert_eq!(one.stats.sampling_rmse, other.stats.sampling_rmse);
                assert_eq!((one.stats.samples, one.stats.rays), (other.stats.samples, other.stats.rays));
            }
        }
    }
}

#[test]
fn flat_pixels_stop_and_edges_go_on() {
    let still = load(STILL);
    let job = Job { spp: 256, stop: Stop::Noise(0.01), aovs: vec![Aov::Samples], ..job(SIZE.0, SIZE.1) };
    let outcome = render(BackendKind::Native, &still, &job);
    let samples = samples(&outcome);
    assert!(samples.iter().all(|n| n.is_power_of_two() && (16..=256).contains(n)));
    assert_eq!(samples.iter().map(|&n| u64::from(n)).sum::<u64>(), outcome.stats.samples);
    let (flat, most) = (samples[0], samples.iter().filter(|&&n| n == 256).count());
    assert_eq!(flat, 16, "the sky has no noise");
    assert!(most > 100, "{most} pixels have the most samples");
    let early = samples.iter().filter(|&&n| n < 256).count() as u64;
    assert_eq!(adapted(&outcome).stopped_early, early);
    assert!(early > u64::from(SIZE.0 * SIZE.1) / 2, "{early} pixels stopped early");
    // What stopped is as good as if it had gone on.
    let full = render(BackendKind::Native, &still, &Job { stop: Stop::Count, ..job.clone() });
    assert!(rmse(&outcome.film, &REFERENCE) < 1.1 * rmse(&full.film, &REFERENCE));
    assert!(outcome.stats.samples * 2 < full.stats.samples);
}

#[test]
fn the_target_is_reached_and_not_overshot() {
    let still = load(STILL);
    for seed in 0..3 {
        for target in [0.0015, 0.0006] {
            let job = Job { spp: 1 << 14, stop: Stop::Rmse(target), seed, ..job(SIZE.0, SIZE.1) };
            let outcome = render(BackendKind::Native, &still, &job);
            let error = rmse(&outcome.film, &REFERENCE);
            assert_eq!(adapted(&outcome).ended, Ended::Enough);
            assert!(outcome.stats.sampling_rmse.expect("it is adaptive") <= target);
            assert!((1.0 / 1.5..1.5).contains(&(error / target)), "{error} for {target}, seed {seed}");
        }
    }
}

#[test]
fn a_picture_knows_its_error() {
    let still = load(STILL);
    for seed in 0..5 {
        for spp in [4, 16, 100] {
            let job = Job { spp, seed, estimate: true, ..job(SIZE.0, SIZE.1) };
            let outcome = render(BackendKind::Native, &still, &job);
            let estimate = outcome.stats.sampling_rmse.expect("it was asked for");
            let error = rmse(&outcome.film, &REFERENCE);
            assert!((0.5..2.0).contains(&(estimate / error)), "{estimate} for {error}: {spp} samples, seed {seed}");
            let plain = render(BackendKind::Native, &still, &Job { estimate: false, ..job });
            assert!(plain.film.color == outcome.film.color, "to ask changes nothing");
            assert_eq!((plain.stats.sampling_rmse, plain.stats.rays_for_estimate), (None, 0));
            assert_eq!(plain.stats.rays, outcome.stats.rays);
            let share = outcome.stats.rays_for_estimate as f64 / outcome.stats.rays.total() as f64;
            assert!((0.2..0.3).contains(&share), "{share}: one pixel in four");
        }
    }
}

#[test]
fn filtered_pictures_know_their_error_too() {
    let still = load(STILL);
    for filter in Filter::ALL {
        let plain = Job { filter, spp: 1024, seed: 999, ..job(60, 40) };
        let truth = render(BackendKind::Native, &still, &plain).film;
        let adaptive = Job { stop: Stop::Rmse(0.003), spp: 4096, seed: 1, ..plain };
        let outcome = render(BackendKind::Native, &still, &adaptive);
        assert_eq!(adapted(&outcome).ended, Ended::Enough);
        let (estimate, error) = (outcome.stats.sampling_rmse.expect("it is adaptive"), rmse(&outcome.film, &truth));
        assert!((0.5..2.0).contains(&(estimate / error)), "{filter:?}: {estimate} for {error}");
    }
}

#[test]
fn time_runs_out_after_every_pixel_has_a_sample() {
    let still = load(STILL);
    let backend = build(BackendKind::Native, &still);
    for (seconds, stop) in [(1e-9, Stop::Count), (0.3, Stop::Count), (0.3, Stop::Rmse(1e-9))] {
        let job = Job {
            spp: 1 << 16,
            stop,
            time_limit: Some(Duration::from_secs_f64(seconds)),
            aovs: vec![Aov::Samples],
            ..job(120, 80)
        };
        let (control, started) = (Control::default(), Instant::now());
        let camera = &still.cameras[0].camera;
        let outcome = render::run(&still.scene, camera, &backend, &job, &control).expect("a good camera");
        assert!(started.elapsed() < Duration::from_secs(20), "far from 2^16 samples");
        assert_eq!(adapted(&outcome).ended, Ended::Time);
        assert!(samples(&outcome).iter().all(|&n| n > 0) && outcome.film.is_complete());
    }
}

#[test]
fn the_most_samples_are_the_most() {
    let still = load(STILL);
    for spp in [8, 24, 40] {
        let job = Job { spp, stop: Stop::Rmse(1e-6), aovs: vec![Aov::Samples, Aov::Hits], ..job(40, 30) };
        let outcome = render(BackendKind::Native, &still, &job);
        let samples = samples(&outcome);
        assert_eq!(adapted(&outcome).ended, Ended::Most);
        assert!(samples.contains(&spp) && samples.iter().all(|&n| n <= spp));
        // Whoever has all samples has those of a plain render.
        let plain = render(BackendKind::Native, &still, &Job { stop: Stop::Count, ..job.clone() });
        for (i, _) in samples.iter().enumerate().filter(|&(_, &n)| n == spp) {
            assert_eq!(outcome.film.color[i], plain.film.color[i], "pixel {i}, {spp} samples");
            assert_eq!(outcome.film.aovs[1].data[i], plain.film.aovs[1].data[i]);
        }
    }
}

#[test]
fn a_stopped_adaptive_picture_is_whole_or_tells_what_it_lacks() {
    let still = load(STILL);
    let backend = build(BackendKind::Native, &still);
    let job = Job { spp: 1 << 16, stop: Stop::Rmse(1e-9), ..job(64, 64) };
    let control = Control::default();
    control.cancel.store(true, std::sync::atomic::Ordering::Relaxed);
    let outcome = render::run(&still.scene, &still.cameras[0].camera, &backend, &job, &control).expect("a good camera");
    assert_eq!((outcome.film.finished, adapted(&outcome).ended), (0, Ended::Stopped));
    let control = Control::default();
    std::thread::scope(|scope| {
        scope.spawn(|| {
            while control.pixels.load(std::sync::atomic::Ordering::Relaxed) * 3 < 64 * 64 {
                std::thread::yield_now();
            }
            control.cancel.store(true, std::sync::atomic::Ordering::Relaxed);
        });
        let outcome = render::run(&still.scene, &still.cameras[0].camera, &backend, &job, &control);
        let outcome = outcome.expect("a good camera");
        assert_eq!(adapted(&outcome).ended, Ended::Stopped);
        assert!(
            outcome.film.is_complete() && outcome.stats.samples >= 64 * 64 * 16,
            "a third is beyond the first round"
        );
    });
}
