//! Offsets and weights against the filters as their papers write them.

use super::*;
use crate::math::{Sampler, Sampling};

const SMOOTH: [Filter; 3] = [Filter::Tent, Filter::BlackmanHarris, Filter::Mitchell];

/// The function of one axis, not normalised.
fn filter(filter: Filter, x: f64) -> f64 {
    let x = x.abs();
    match filter {
        Filter::Box => f64::from(x < 0.5),
        Filter::Tent => (1.0 - x).max(0.0),
        Filter::BlackmanHarris => {
            let n = 0.5 + x / 3.0;
            let wave = |k: f64| (2.0 * PI * k * n).cos();
            if x > 1.5 { 0.0 } else { 0.358_75 - 0.488_29 * wave(1.0) + 0.141_28 * wave(2.0) - 0.011_68 * wave(3.0) }
        }
        Filter::Mitchell => {
            let (b, c) = (1.0 / 3.0, 1.0 / 3.0);
            let cubic = |k3, k2, k1, k0| (((k3 * x + k2) * x + k1) * x + k0) / 6.0;
            match x {
                0.0..1.0 => cubic(12.0 - 9.0 * b - 6.0 * c, -18.0 + 12.0 * b + 6.0 * c, 0.0, 6.0 - 2.0 * b),
                1.0..2.0 => cubic(-b - 6.0 * c, 6.0 * b + 30.0 * c, -12.0 * b - 48.0 * c, 8.0 * b + 24.0 * c),
                _ => 0.0,
            }
        }
    }
}

/// Integral from `from` to `to` by the middles of many steps.
fn integral(f: impl Fn(f64) -> f64, from: f64, to: f64) -> f64 {
    const STEPS: u32 = 20_000;
    let width = (to - from) / f64::from(STEPS);
    (0..STEPS).map(|i| f(from + (f64::from(i) + 0.5) * width)).sum::<f64>() * width
}

#[test]
fn offsets_are_the_inverse_of_the_share_that_the_filter_has_within_them() {
    for kind in SMOOTH {
        let radius = kind.radius();
        let steps = 4000;
        let width = radius / f64::from(steps);
        // The share up to each step, by Simpson's rule.
        let f = |x: f64| filter(kind, x).abs();
        let mut shares = vec![0.0];
        for i in 0..steps {
            let x = f64::from(i) * width;
            let part = (f(x) + 4.0 * f(x + 0.5 * width) + f(x + width)) * width / 6.0;
            shares.push(shares[i as usize] + part);
        }
        let all = shares[steps as usize];
        let mut worst: f64 = 0.0;
        for (i, share) in shares.iter().enumerate() {
            let (x, share) = (i as f64 * width, (share / all).min(1.0));
            for (u, x) in [(0.5 + 0.5 * share, x), (0.5 - 0.5 * share, -x)] {
                worst = worst.max((kind.offset(u) - x).abs());
            }
        }
        assert!(worst < 3e-5, "{kind:?}: {worst:e} pixels");
    }
    assert_eq!([0.0, 0.25, 0.5, 0.75].map(|u| Filter::Box.offset(u)), [-0.5, -0.25, 0.0, 0.25]);
}

#[test]
fn offsets_rise_within_the_radius() {
    for kind in Filter::ALL {
        let offsets: Vec<f64> = (0..=100_000).map(|i| kind.offset(f64::from(i) / 100_001.0)).collect();
        assert!(offsets.is_sorted(), "{kind:?}");
        assert!(offsets.iter().all(|x| x.abs() <= kind.radius()), "{kind:?}");
        assert_eq!(kind.offset(0.0), -kind.radius(), "{kind:?}");
        let largest = kind.offset(1.0 - f64::EPSILON / 2.0);
        assert!((largest - kind.radius()).abs() < 1e-3 && largest <= kind.radius(), "{kind:?}: {largest}");
    }
}

#[test]
fn what_is_sampled_is_the_filter() {
    const BINS: usize = 12;
    const COUNT: u32 = 1 << 18;
    for kind in Filter::ALL {
        let radius = kind.radius();
        let all = integral(|x| filter(kind, x), -radius, radius);
        let moment = |power| integral(|x| x.powi(power) * filter(kind, x), -radius, radius) / all;
        let edge = |i: usize| radius * (2.0 * i as f64 / BINS as f64 - 1.0);
        let bin: Vec<f64> = (0..BINS).map(|i| integral(|x| filter(kind, x), edge(i), edge(i + 1)) / all).collect();
        let samples = Sampling::new(Sampler::Sobol, 9, COUNT, 1);
        let (mut mean, mut moments, mut counts) = (0.0, [0.0; 2], vec![0.0; BINS * BINS]);
        for i in 0..COUNT {
            let [u, v, ..] = samples.pixel(1, 2).point(i);
            let (x, y) = (kind.offset(u), kind.offset(v));
            let weight = kind.weight(x, y) / f64::from(COUNT);
            mean += weight;
            moments[0] += weight * x * x;
            moments[1] += weight * y.powi(4);
            let at = |x: f64| (((x / radius + 1.0) * 0.5 * BINS as f64) as usize).min(BINS - 1);
            counts[at(y) * BINS + at(x)] += weight;
        }
        let tolerance = if kind.has_negative_lobes() { 1e-4 } else { 1e-9 };
        assert!((mean - 1.0).abs() < tolerance, "{kind:?}: mean weight {mean}");
        for (found, power) in moments.into_iter().zip([2, 4]) {
            assert!((found - moment(power)).abs() < 1e-3, "{kind:?}, x^{power}: {found}, not {}", moment(power));
        }
        for (i, found) in counts.iter().enumerate() {
            let want = bin[i / BINS] * bin[i % BINS];
            assert!((found - want).abs() < 1e-4, "{kind:?}, bin {i}: {found}, not {want}");
        }
    }
}

#[test]
fn a_negative_sample_is_one_of_sixteen_and_the_noise_is_as_told() {
    let n = 1000;
    let unit = |i: u32| (f64::from(i) + 0.5) / f64::from(n);
    let weights = (0..n * n).map(|i| {
        let (x, y) = (Filter::Mitchell.offset(unit(i % n)), Filter::Mitchell.offset(unit(i / n)));
        Filter::Mitchell.weight(x, y)
    });
    let (mut negative, mut variance) = (0.0, 0.0);
    for weight in weights {
        negative += f64::from(weight < 0.0) / f64::from(n * n);
        variance += (weight - 1.0).powi(2) / f64::from(n * n);
    }
    assert!((negative - 1.0 / 16.0).abs() < 2e-3, "{negative}");
    assert!((variance.sqrt() - 0.56).abs() < 1e-2, "{variance}");
}

#[test]
fn names_differ() {
    assert_eq!(Filter::ALL.map(Filter::name), ["box", "tent", "blackman-harris", "mitchell"]);
}

#[test]
fn many_at_once_are_what_each_is() {
    for filter in Filter::ALL {
        for k in 0..4000 {
            let u: [f64; 8] = std::array::from_fn(|i| (f64::from(k) + i as f64 / 8.0) / 4000.0);
            assert_eq!(filter.offsets(&u), u.map(|u| filter.offset(u)), "{}", filter.name());
        }
        let ends = [0.0, f64::EPSILON, 0.5, 1.0 - 1e-7, 1.0 - f64::EPSILON];
        assert_eq!(filter.offsets(&ends), ends.map(|u| filter.offset(u)), "{}", filter.name());
    }
}
