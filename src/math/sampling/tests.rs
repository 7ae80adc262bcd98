//! Where samples lie, and what averaging over them is worth.

use super::*;

/// One look at a light for each of `spp` samples.
fn of(sampler: Sampler, seed: u32, spp: u32) -> Sampling {
    Sampling::new(sampler, seed, spp, 1)
}

/// All numbers of a sample: pixel, lens, two lights, and a light after a bounce.
fn numbers(samples: PixelSamples<'_>, index: u32) -> [f64; 10] {
    let bounced = Branch::CAMERA.bounced(1);
    let lights = [(0, Branch::CAMERA), (1, Branch::CAMERA), (0, bounced)];
    let lights = lights.map(|(light, branch)| samples.on_light(index, light, branch));
    let mut all = [0.0; 10];
    all[..4].copy_from_slice(&samples.point(index));
    all[4..].copy_from_slice(lights.as_flattened());
    all
}

/// Pearson's chi-squared of counts that should be alike.
fn chi_squared(counts: &[u32]) -> f64 {
    let mean = f64::from(counts.iter().sum::<u32>()) / counts.len() as f64;
    counts.iter().map(|&n| (f64::from(n) - mean).powi(2) / mean).sum()
}

/// What [`chi_squared`] of `n` counts exceeds by chance once in 10^8: 5.6 deviations by Wilson and Hilferty's cube root.
fn most(n: usize) -> f64 {
    let k = (n - 1) as f64;
    k * (1.0 - 2.0 / (9.0 * k) + 5.6 * (2.0 / (9.0 * k)).sqrt()).powi(3)
}

#[test]
fn every_number_is_uniform() {
    for sampler in Sampler::ALL {
        for spp in [1, 5, 16, 61] {
            let mut counts = [[0; 100]; 10];
            let sampling = of(sampler, 3, spp);
            for i in 0..20_000 {
                let samples = sampling.pixel(i % 640, i / 640);
                for (count, x) in counts.iter_mut().zip(numbers(samples, i % spp)) {
                    count[(100.0 * x) as usize] += 1;
                }
            }
            for (number, count) in counts.iter().enumerate() {
                let chi = chi_squared(count);
                assert!(chi < most(100), "{sampler:?}, {spp} spp, number {number}: {chi}");
            }
        }
    }
}

#[test]
fn numbers_pixels_and_samples_do_not_know_of_each_other() {
    /// Joint counts of pairs in an 8 by 8 grid.
    fn independent(pairs: impl Iterator<Item = (f64, f64)>, what: &str) {
        let mut counts = [0; 64];
        pairs.for_each(|(a, b)| counts[8 * (8.0 * a) as usize + (8.0 * b) as usize] += 1);
        let chi = chi_squared(&counts);
        assert!(chi < most(64), "{what}: {chi}");
    }
    for sampler in Sampler::ALL {
        for spp in [9, 16] {
            let sampling = of(sampler, 11, spp);
            let drawn: Vec<_> = (0..20_000).map(|i| numbers(sampling.pixel(i % 200, i / 200), i / 7 % spp)).collect();
            for a in 0..10 {
                for b in 0..a {
                    independent(drawn.iter().map(|n| (n[a], n[b])), &format!("{sampler:?}, numbers {a} and {b}"));
                }
                for (name, step) in [("right", 1), ("below", 200)] {
                    let beside = drawn.iter().zip(&drawn[step..]).map(|(n, m)| (n[a], m[a]));
                    independent(beside, &format!("{sampler:?}, number {a} and that of the pixel to the {name}"));
                }
            }
        }
    }
    let sampling = of(Sampler::Random, 1, 1);
    let samples = sampling.pixel(3, 3);
    for a in 0..10 {
        let next = (0..20_000).map(|i| (numbers(samples, i)[a], numbers(samples, i + 1)[a]));
        independent(next, &format!("number {a} and that of the next sample"));
    }
}

/// Root mean square error over 256 pixels.
fn rmse(sampler: Sampler, spp: u32, truth: f64, integrand: &dyn Fn([f64; 4]) -> f64) -> f64 {
    let sampling = of(sampler, 2, spp);
    let squares = (0..256).map(|pixel| {
        let samples = sampling.pixel(pixel % 16, pixel / 16);
        let sum: f64 = (0..spp).map(|i| integrand(samples.point(i))).sum();
        (sum / f64::from(spp) - truth).powi(2)
    });
    (squares.sum::<f64>() / 256.0).sqrt()
}

/// Radius of the blur of an edge in pixels, and how far from the pixel's middle the edge is.
const BLUR: f64 = 1.5;
const EDGE: f64 = 0.8;

/// 1 on one side of a slanted edge out of focus: a box of a pixel, and `disc` of the lens.
fn blurred_edge([a, b, u, v]: [f64; 4], disc: fn(f64, f64) -> DVec2) -> f64 {
    let across = 0.8 * (a - 0.5) + 0.6 * (b - 0.5) + BLUR * disc(u, v).x;
    f64::from(across < EDGE)
}

/// Its integral: the share of a disc on one side of a line, averaged over the pixel.
fn truth_of_edge() -> f64 {
    const N: u32 = 500;
    let middle = |i: u32| (f64::from(i) + 0.5) / f64::from(N) - 0.5;
    let share = |s: f64| {
        let s = s.clamp(-1.0, 1.0);
        0.5 + (s * (1.0 - s * s).sqrt() + s.asin()) / std::f64::consts::PI
    };
    let row = |j| (0..N).map(|i| share((EDGE - 0.8 * middle(i) - 0.6 * middle(j)) / BLUR)).sum::<f64>();
    (0..N).map(row).sum::<f64>() / f64::from(N * N)
}

/// Smooth in all four, mean 1.
fn smooth(p: [f64; 4]) -> f64 {
    p.iter().map(|x| std::f64::consts::FRAC_PI_2 * (std::f64::consts::PI * x).sin()).product()
}

/// Like the edge of an object in focus: a matter of the pixel alone. The mean is 1/2 + 0.1.
fn sharp_edge([a, b, ..]: [f64; 4]) -> f64 {
    f64::from(0.8 * (a - 0.5) + 0.6 * (b - 0.5) < 0.08)
}

/// Errors at 16, 64, 256, 1024 and 4096 samples, and their slope from end to end.
fn errors(sampler: Sampler, truth: f64, integrand: &dyn Fn([f64; 4]) -> f64) -> ([f64; 5], f64) {
    let errors = [16, 64, 256, 1024, 4096].map(|spp| rmse(sampler, spp, truth, integrand));
    (errors, (errors[4] / errors[0]).ln() / 256f64.ln())
}

#[test]
fn errors_fall_as_fast_as_they_should() {
    use Sampler::{Random, Sobol, Stratified};
    let blurred_edge = |p| blurred_edge(p, concentric_disc);
    // Strata of pairs matched by chance leave the part of the error that needs both pairs: there the slope is that of
    // chance, and the error smaller.
    let of = |sampler, slope| Expected { sampler, slope };
    let chance = of(Random, -0.5);
    check("sharp edge", 0.6, &sharp_edge, [chance, of(Stratified, -0.75), of(Sobol, -0.75)]);
    check("blurred edge", truth_of_edge(), &blurred_edge, [chance, of(Stratified, -0.5), of(Sobol, -0.6)]);
    check("smooth", 1.0, &smooth, [chance, of(Stratified, -0.5), of(Sobol, -1.05)]);
}

#[derive(Clone, Copy)]
struct Expected {
    sampler: Sampler,
    /// Of the error's logarithm over that of the count.
    slope: f64,
}

/// Each sampler has the slope expected of it, and all but [`Sampler::Random`] are clearly better than chance.
fn check(name: &str, truth: f64, integrand: &dyn Fn([f64; 4]) -> f64, expected: [Expected; 3]) {
    let chance = errors(Sampler::Random, truth, integrand).0;
    for Expected { sampler, slope: want } in expected {
        let (errors, slope) = errors(sampler, truth, integrand);
        assert!((slope - want).abs() < 0.06, "{name}, {sampler:?}: {errors:?}, slope {slope:.2}");
        let better = errors.iter().zip(chance).all(|(e, chance)| *e < 0.7 * chance);
        assert!(better || sampler == Sampler::Random, "{name}, {sampler:?}: {errors:?}, by chance {chance:?}");
    }
}

#[test]
fn a_lens_sampled_by_uniform_radius_never_gets_there() {
    for sampler in Sampler::ALL {
        let errors =
            [64, 4096].map(|spp| rmse(sampler, spp, truth_of_edge(), &|p| blurred_edge(p, uniform_radius_disc)));
        assert!(errors[1] > 0.05 && errors[1] > 0.7 * errors[0], "{sampler:?}: {errors:?}");
    }
}

#[test]
fn every_sampler_but_the_biased_one_covers_the_disc_uniformly() {
    let sobol = of(Sampler::Sobol, 5, 16);
    let samples = sobol.pixel(3, 4);
    let n = 1 << 14;
    let within_half = |draw: &dyn Fn(u32, f64, f64) -> DVec2| {
        let points = (0..n).map(|i| {
            let [_, _, u, v] = samples.point(i);
            draw(i, u, v)
        });
        let points: Vec<DVec2> = points.collect();
        let mean = points.iter().sum::<DVec2>() / f64::from(n);
        assert!(mean.length() < 5e-3 && points.iter().all(|p| p.length() <= 1.0), "{mean}");
        points.iter().filter(|p| p.length() < 0.5).count() as f64 / f64::from(n)
    };
    let rejection = |i, u, v| {
        let mut number = 0;
        rejection_disc([u, v], || {
            number += 1;
            samples.beyond(i, number)
        })
    };
    for (name, share, tolerance) in [
        ("concentric", within_half(&|_, u, v| concentric_disc(u, v)), 2e-3),
        ("polar", within_half(&|_, u, v| polar_disc(u, v)), 2e-3),
        ("rejection", within_half(&rejection), 1e-2),
    ] {
        assert!((share - 0.25).abs() < tolerance, "{name}: {share} of the points in a quarter of the area");
    }
    let biased = within_half(&|_, u, v| uniform_radius_disc(u, v));
    assert!((biased - 0.5).abs() < 2e-3, "{biased}");
}

#[test]
fn points_on_lights_are_stratified_and_differ_by_light_and_branch() {
    let sobol = of(Sampler::Sobol, 5, 16);
    let samples = sobol.pixel(8, 1);
    let bounced = Branch::CAMERA.bounced(0);
    assert_ne!(bounced, Branch::CAMERA.bounced(1));
    assert_ne!(bounced.bounced(1), Branch::CAMERA.bounced(1).bounced(0));
    for (light, branch) in [(0, Branch::CAMERA), (3, Branch::CAMERA), (200, Branch::CAMERA), (0, bounced)] {
        let points: Vec<_> = (0..16).map(|i| samples.on_light(i, light, branch)).collect();
        for dim in 0..2 {
            let mut strata: Vec<u32> = points.iter().map(|p| (p[dim] * 16.0) as u32).collect();
            strata.sort_unstable();
            assert_eq!(strata, (0..16).collect::<Vec<_>>(), "light {light}, {branch:?}");
        }
        assert_ne!(points[0], samples.on_light(0, light + 1, branch));
        assert_ne!(points[0], samples.on_light(0, light, branch.bounced(1)));
    }
}

#[test]
fn without_a_lens_the_first_light_has_its_dimensions_and_no_two_lights_share_any() {
    let with = of(Sampler::Sobol, 5, 16);
    let without = with.without_lens();
    let points =
        |sampling: &Sampling, light| (0..16).map(|i| sampling.pixel(8, 1).on_light(i, light, Branch::CAMERA)).collect();
    let lens: Vec<_> = (0..16).map(|i| with.pixel(8, 1).point(i)).map(|[.., u, v]| [u, v]).collect();
    let lights: Vec<Vec<_>> = (0..4).map(|light| points(&without, light)).collect();
    assert_eq!(lights[0], lens);
    let moved: Vec<Vec<_>> = (0..3).map(|light| points(&with, light)).collect();
    assert_eq!(lights[1..], moved);
    assert!((0..4).all(|a| (0..a).all(|b| lights[a] != lights[b])));
}

#[test]
fn the_disc_is_covered_uniformly() {
    let n = 512;
    let points = (0..n * n).map(|i| {
        let (u, v) = ((i % n) as f64 + 0.5, (i / n) as f64 + 0.5);
        concentric_disc(u / n as f64, v / n as f64)
    });
    let (mut inner, mut mean, mut worst) = (0, DVec2::ZERO, 0f64);
    for p in points {
        inner += usize::from(p.length() < 0.5);
        mean += p;
        worst = worst.max(p.length());
    }
    let total = (n * n) as f64;
    assert!((inner as f64 / total - 0.25).abs() < 1e-3, "a quarter of the area lies within half the radius");
    assert!(mean.length() / total < 1e-12 && worst <= 1.0 + 1e-12);
}

#[test]
fn each_block_of_sixteen_is_stratified_in_every_dimension() {
    let sobol = of(Sampler::Sobol, 5, 16);
    for pixel in 0..50 {
        let samples = sobol.pixel(pixel, 3 * pixel + 1);
        for dim in 0..4 {
            let mut strata: Vec<u32> = (0..16).map(|i| (samples.point(i)[dim] * 16.0) as u32).collect();
            strata.sort_unstable();
            assert_eq!(strata, (0..16).collect::<Vec<_>>(), "pixel {pixel}, dimension {dim}");
        }
    }
}

#[test]
fn samples_past_the_first_block_or_set_are_new() {
    for sampler in Sampler::ALL {
        let sampling = of(sampler, 7, 16);
        let samples = sampling.pixel(5, 6);
        for later in [BLOCK + 1, 17] {
            assert_ne!(samples.point(1), samples.point(later), "{sampler:?}");
            assert_ne!(
                samples.on_light(1, 0, Branch::CAMERA),
                samples.on_light(later, 0, Branch::CAMERA),
                "{sampler:?}"
            );
        }
        assert_ne!(of(sampler, 8, 16).pixel(5, 6).point(0), samples.point(0), "{sampler:?}");
    }
}

#[test]
fn names_differ() {
    assert_eq!(Sampler::ALL.map(Sampler::name), ["sobol", "random", "stratified"]);
}
