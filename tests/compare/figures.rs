//! Figures against numbers of other programs, and against what they must be.
//!
//! The stored numbers were made from the same pictures by numpy 2.4.6 (f64, straight from the formulas of
//! `metrics::Values`), by `structural_similarity` of scikit-image 0.26.0 (`gaussian_weights=True, sigma=1.5,
//! use_sample_covariance=False, data_range=255`, of the luma 0.2126 R + 0.7152 G + 0.0722 B) and by `evaluate` of
//! flip-evaluator 1.7 (NVIDIA's C++ in f32: "LDR", sRGB input, at three numbers of pixels per degree). Linear
//! light went to the last two as `255 srgb(x)`, cut off at 0 and 1, not rounded.

use super::kit::{LARGE, SMALL, linear, picture, srgb8};
use tison::film::{Encoding, Picture};
use tison::metrics::{self, PIXELS_PER_DEGREE, Report};

/// What other programs say.
struct Known {
    pictures: [Picture; 2],
    rmse: f64,
    psnr: f64,
    max: f64,
    relmse: f64,
    relmse_trimmed: f64,
    smape: f64,
    beyond: f64,
    differing: u64,
    ssim: f64,
    /// Pixels per degree, mean, and the errors at (0,0), (35,12), (60,46), (21,3).
    flip: [(f64, f64, [f32; 4]); 3],
}

fn known() -> [Known; 3] {
    [
        Known {
            pictures: srgb8(SMALL),
            rmse: 32.04607520333312,
            psnr: 18.015306658203233,
            max: 255.0,
            relmse: 0.3030808869314496,
            relmse_trimmed: 0.2888259111278951,
            smape: 0.0715076298831764,
            beyond: 0.9870945238925707,
            differing: 2864,
            ssim: 0.6869895146490913,
            flip: [
                (67.0, 0.1930522471666336, [0.04296353, 0.9819197, 0.05697105, 0.04737765]),
                (20.0, 0.21390284597873688, [0.10031128, 0.97837198, 0.14021222, 0.14265582]),
                (120.0, 0.19513872265815735, [0.04347651, 0.98243564, 0.03671888, 0.06509659]),
            ],
        },
        Known {
            pictures: linear(SMALL),
            rmse: 0.50071992505208,
            psnr: 6.008102529201872,
            max: 3.984375,
            relmse: 0.5158726009707862,
            relmse_trimmed: 0.4724143915204531,
            smape: 0.07682743369639267,
            beyond: 0.9989536100453436,
            differing: 2864,
            ssim: 0.8632141901320342,
            flip: [
                (67.0, 0.12820719182491302, [0.32432529, 0.81976825, 0.10786051, 0.08264974]),
                (20.0, 0.18819454312324524, [0.50702536, 0.95346717, 0.13776746, 0.02322426]),
                (120.0, 0.11987247318029404, [0.28672879, 0.77877361, 0.11608800, 0.04917738]),
            ],
        },
        Known {
            pictures: srgb8(LARGE),
            rmse: 25.619232796056252,
            psnr: 19.9594812077877,
            max: 255.0,
            relmse: 0.2031101387575758,
            relmse_trimmed: 0.16726303552207658,
            smape: 0.09074223458149527,
            beyond: 0.9288549618320611,
            differing: 19017,
            ssim: 0.7412337595708987,
            flip: [
                (67.0, 0.17644834518432617, [0.04296353, 0.9819197, 0.37187797, 0.04737765]),
                (20.0, 0.23437082767486572, [0.10031128, 0.97837198, 0.23450308, 0.14265582]),
                (120.0, 0.14186611771583557, [0.04347651, 0.98243564, 0.35431644, 0.06509659]),
            ],
        },
    ]
}

fn compared(pictures: &[Picture; 2]) -> Report {
    metrics::compare(&pictures[0], &pictures[1], PIXELS_PER_DEGREE).expect("they are of one size")
}

#[track_caller]
fn near(name: &str, got: f64, want: f64, tolerance: f64) {
    assert!((got - want).abs() <= tolerance * want.abs().max(1.0), "{name}: {got:?}, not {want:?}");
}

#[test]
fn values_are_those_of_numpy() {
    for known in known() {
        let Report { values, encoding, mixed, .. } = compared(&known.pictures);
        assert_eq!((encoding, mixed), (known.pictures[0].encoding, false));
        near("rmse", values.rmse, known.rmse, 1e-9);
        near("psnr", values.psnr, known.psnr, 1e-9);
        near("max", values.max, known.max, 0.0);
        near("relmse", values.relmse, known.relmse, 1e-9);
        near("relmse_trimmed", values.relmse_trimmed, known.relmse_trimmed, 1e-9);
        near("smape", values.smape, known.smape, 1e-9);
        near("beyond", values.beyond_1_255, known.beyond, 1e-9);
        assert_eq!((values.differing, values.non_finite), (known.differing, 0));
    }
}

#[test]
fn ssim_is_that_of_scikit_image() {
    for known in known() {
        near("ssim", compared(&known.pictures).ssim.expect("the window fits"), known.ssim, 1e-9);
    }
}

#[test]
fn flip_is_that_of_its_authors() {
    for known in known() {
        let [a, b] = &known.pictures;
        for (ppd, mean, at) in known.flip {
            let flip = metrics::compare(a, b, ppd).expect("they are of one size").flip;
            near("flip", flip.mean, mean, 1e-6);
            for ((x, y), want) in [(0, 0), (35, 12), (60, 46), (21, 3)].into_iter().zip(at) {
                let got = flip.map.values[y * a.width as usize + x];
                assert!((got - want).abs() < 1e-5, "{ppd} pixels per degree, at {x},{y}: {got}, not {want}");
            }
        }
    }
}

#[test]
fn equal_pictures_do_not_differ() {
    for [_, b] in [srgb8(SMALL), linear(SMALL)] {
        let Report { values, ssim, flip, largest, .. } = compared(&[b.clone(), b]);
        assert!(values.identical());
        assert_eq!(
            (values.rmse, values.max, values.relmse, values.relmse_trimmed, values.smape),
            (0.0, 0.0, 0.0, 0.0, 0.0)
        );
        assert_eq!((values.psnr, values.beyond_1_255, ssim, flip.mean), (f64::INFINITY, 0.0, Some(1.0), 0.0));
        assert!(flip.map.values.iter().chain(&largest.values).all(|v| *v == 0.0));
    }
}

#[test]
fn black_and_white_are_as_far_apart_as_can_be() {
    let plain = |v: f32| picture((70, 20), Encoding::Srgb8, |_, _, _| v);
    let Report { values, ssim, flip, .. } = compared(&[plain(255.0), plain(0.0)]);
    assert_eq!((values.rmse, values.psnr, values.max, values.beyond_1_255), (255.0, 0.0, 255.0, 1.0));
    near("relmse", values.relmse, 100.0, 1e-12);
    near("smape", values.smape, 1.0 / 1.01, 1e-12);
    // Wang et al.: C1 / (1 + C1), as neither varies.
    near("ssim", ssim.expect("the window fits"), 1e-4 / (1.0 + 1e-4), 1e-12);
    // flip-evaluator 1.7, in f32: what rounding leaves of the edges of a plain picture, 3e-7, enters under a root.
    near("flip", flip.mean, 0.9673985242843628, 1e-4);
}

#[test]
fn any_number_of_threads_gives_the_same_figures() {
    let pictures = linear(LARGE);
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("so many can be had");
        let Report { values, ssim, flip, .. } = pool.install(|| compared(&pictures));
        (values, ssim.map(f64::to_bits), flip.mean.to_bits(), flip.map)
    };
    let one = with(1);
    for threads in [2, 5] {
        assert!(with(threads) == one, "{threads} threads");
    }
}

#[test]
fn one_step_of_a_byte_is_not_beyond_and_two_are() {
    let plain = |v: f32| picture((11, 11), Encoding::Srgb8, |x, y, _| if (x, y) == (3, 4) { v } else { 7.0 });
    for (v, beyond) in [(8.0, 0.0), (6.0, 0.0), (9.0, 1.0 / 121.0), (8.0f32.next_up(), 1.0 / 121.0)] {
        let values = compared(&[plain(v), plain(7.0)]).values;
        assert_eq!((values.beyond_1_255, values.differing), (beyond, 1), "{v}");
    }
}

#[test]
fn the_worst_thousandth_is_trimmed_and_no_more() {
    // 2000 pixels: two are left out.
    let picture = |values: [f32; 3]| {
        picture((50, 40), Encoding::Linear, |x, y, _| match (x, y) {
            (7, 7) => values[0],
            (30, 2) => values[1],
            (0, 39) => values[2],
            _ => 1.0,
        })
    };
    let trimmed = |values| compared(&[picture(values), picture([1.0; 3])]).values.relmse_trimmed;
    assert_eq!(trimmed([100.0, 50.0, 1.0]), 0.0);
    near("the third", trimmed([100.0, 2.0, 50.0]), 1.0 / 1.01 / 1998.0, 1e-12);
    near("ties", trimmed([2.0, 2.0, 2.0]), 1.0 / 1.01 / 1998.0, 1e-12);
}

#[test]
fn what_is_not_finite_is_counted_named_and_left_out() {
    let [a, b] = linear(SMALL);
    let clean = compared(&[a.clone(), b.clone()]);
    let with = |picture: &Picture, odd: &[(usize, f32)]| {
        let mut picture = picture.clone();
        odd.iter().for_each(|&(at, v)| picture.pixels[at] = [v; 3]);
        picture
    };
    let (nan, inf) = (f32::NAN, f32::INFINITY);
    let Report { values, ssim, flip, largest, .. } = compared(&[
        with(&a, &[(61, nan), (64, inf), (700, inf), (800, nan), (900, -inf)]),
        with(&b, &[(64, nan), (700, inf), (800, nan), (900, inf)]),
    ]);
    assert_eq!((values.non_finite, values.non_finite_differing), (5, 3), "those at 700 and 800 are the same");
    let [in_a, in_b] = values.non_finite_in;
    assert_eq!((in_a.nan, in_a.infinite, in_a.first), (2, 3, Some((0, 1))));
    assert_eq!((in_b.nan, in_b.infinite, in_b.first), (2, 2, Some((3, 1))));
    assert!(!values.identical() && values.rmse.is_finite() && values.relmse_trimmed.is_finite());
    assert!((values.rmse / clean.values.rmse - 1.0).abs() < 0.01, "the others are as they were");
    assert!(ssim.is_some_and(f64::is_finite) && flip.map.values.iter().all(|v| v.is_finite()));
    assert!(largest.values[64].is_nan() && largest.values[65].is_finite());

    let same = with(&b, &[(5, nan), (6, inf)]);
    let values = compared(&[same.clone(), same]).values;
    assert!(values.identical() && values.non_finite == 2 && values.rmse == 0.0);

    let nothing = picture((12, 12), Encoding::Linear, |_, _, _| nan);
    let values = compared(&[nothing.clone(), nothing]).values;
    assert!(values.rmse.is_nan() && values.max.is_nan() && values.relmse_trimmed.is_nan() && values.psnr.is_nan());
}

#[test]
fn huge_and_tiny_light_is_compared() {
    let plain = |v: f32| picture((11, 12), Encoding::Linear, |_, _, _| v);
    let values = compared(&[plain(f32::MAX), plain(f32::MIN)]).values;
    near("rmse", values.rmse, 2.0 * f64::from(f32::MAX), 1e-12);
    assert!(values.relmse.is_finite() && values.smape <= 1.0);
    let values = compared(&[plain(f32::from_bits(1)), plain(0.0)]).values;
    assert!(values.rmse > 0.0 && !values.identical());
}

#[test]
fn light_and_bytes_are_compared_as_the_bytes_that_would_be_written() {
    let [_, light] = linear(SMALL);
    let bytes = light.clone().into_srgb8();
    assert!(bytes.pixels.iter().flatten().all(|v| v.fract() == 0.0 && (0.0..=255.0).contains(v)));
    for pair in [[light.clone(), bytes.clone()], [bytes, light]] {
        let report = compared(&pair);
        assert!(report.mixed && report.encoding == Encoding::Srgb8 && report.values.identical());
    }
}

#[test]
fn small_pictures_have_no_ssim_and_the_rest() {
    for (size, window) in [((1, 1), false), ((10, 50), false), ((50, 10), false), ((11, 11), true), ((65, 11), true)] {
        let report = compared(&srgb8(size));
        assert_eq!(report.ssim.is_some(), window, "{size:?}");
        assert!(report.flip.mean > 0.0 && report.values.rmse > 0.0, "{size:?}");
    }
}

#[test]
fn what_cannot_be_compared() {
    let pictures = [srgb8(SMALL), srgb8(LARGE)];
    let error = metrics::compare(&pictures[0][0], &pictures[1][0], 67.0).expect_err("of other sizes");
    assert!(error.to_string().contains("61x47 and 150x131"), "{error}");
    for ppd in [0.0, -1.0, 1001.0, f64::NAN, f64::INFINITY] {
        assert!(metrics::compare(&pictures[0][0], &pictures[0][1], ppd).is_err(), "{ppd}");
    }
    for ppd in [1.0, 300.0] {
        assert!(metrics::compare(&pictures[0][0], &pictures[0][1], ppd).is_ok(), "{ppd}");
    }
}
