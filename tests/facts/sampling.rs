//! However samples are drawn, they find the same picture.

use super::kit::{job, load, render};
use tison::backend::BackendKind;
use tison::film::Film;
use tison::math::{Filter, Sampler};
use tison::render::Job;

/// Root mean square of the difference of all channels.
fn rmse(a: &Film, b: &Film) -> f64 {
    let (a, b) = (a.color.as_flattened(), b.color.as_flattened());
    let squares = a.iter().zip(b).map(|(a, b)| f64::from(a - b).powi(2));
    (squares.sum::<f64>() / a.len() as f64).sqrt()
}

#[test]
fn all_samplers_find_the_same_picture() {
    // A ball out of focus, its soft shadow, and a mirror that shows both.
    let scene = load(
        "[camera.main]\neye = [0, 1, 6]\ntarget = [0, 0.5, 0]\nfov = 40\nlens = { radius = 0.3, focus = 4 }\n
        [light.key]\nposition = [2, 5, 3]\nradius = 1\nfalloff = 'none'\n
        [material.red]\ncolor = [0.9, 0.3, 0.2]\n
        [material.mirror]\ncolor = [0.1, 0.1, 0.1]\nreflect = 0.8\n
        [[object]]\nshape = 'sphere'\nradius = 0.7\nmaterial = 'red'\ntransform = [{ translate = [0, 0.7, 0] }]\n
        [[object]]\nshape = 'quad'\nhalf = 4\nmaterial = 'mirror'\ntransform = [{ rotate = [1, 0, 0], degrees = -90 }]\n",
    );
    let kind = BackendKind::COMPILED[0];
    let film = |sampler, spp, light_samples, seed| {
        render(kind, &scene, &Job { sampler, spp, light_samples, seed, ..job(24, 18) }).film
    };
    let truth = film(Sampler::Sobol, 4096, 1, 1);
    // Over eight seeds.
    let error = |sampler, spp, lights| {
        let squares = (2..10).map(|seed| rmse(&film(sampler, spp, lights, seed), &truth).powi(2));
        (squares.sum::<f64>() / 8.0).sqrt()
    };
    for (spp, lights) in [(64, 1), (9, 7)] {
        let [sobol, random, stratified] = Sampler::ALL.map(|sampler| error(sampler, spp, lights));
        let told = format!("{spp} x {lights}: Sobol {sobol}, random {random}, stratified {stratified}");
        assert!(random < 0.25 / f64::from(spp).sqrt(), "{told}");
        assert!(sobol < 0.75 * random && stratified < 0.75 * random, "{told}");
    }
    for sampler in Sampler::ALL {
        assert!(rmse(&film(sampler, 1024, 1, 2), &truth) < 0.3 * error(sampler, 64, 1), "{sampler:?}");
        assert!(film(sampler, 3, 1, 2).color != film(sampler, 3, 1, 3).color, "{sampler:?}");
    }
}

/// White on the left, black on the right: each pixel shows the integral of the filter over the white side.
#[test]
fn filters_see_an_edge_as_they_should() {
    // A pixel is 0.1 wide; the edge is at x = 0, between pixels 19 and 20.
    let scene = load(
        "[render]\nbackground = [0, 0, 0]\nambient = [1, 1, 1]\n
        [camera.main]\ntype = 'orthographic'\nheight = 1.6\neye = [0, 0, 5]\ntarget = [0, 0, 0]\n
        [material.white]\ncolor = [1, 1, 1]\n
        [[object]]\nshape = 'quad'\nhalf = 5\nmaterial = 'white'\ntransform = [{ translate = [-5, 0, 0] }]\n",
    );
    for &kind in BackendKind::COMPILED {
        for filter in Filter::ALL {
            let film = render(kind, &scene, &Job { filter, spp: 1024, ..job(40, 16) }).film;
            // The mean of a column.
            let at = |x: usize| film.color.iter().skip(x).step_by(40).map(|c| f64::from(c[0])).sum::<f64>() / 16.0;
            // The mean of the filter left of the edge, which is this far to the right of the centre.
            let share = |edge: f64| {
                let steps = 1 << 16;
                let unit = |i: u32| (f64::from(i) + 0.5) / f64::from(steps);
                let seen = (0..steps).map(unit).map(|u| filter.offset(u)).filter(|&x| x < edge);
                let one_axis = filter.weight(0.0, 0.0).sqrt();
                seen.map(|x| filter.weight(x, 0.0) / one_axis).sum::<f64>() / f64::from(steps)
            };
            let tolerance = if filter.has_negative_lobes() { 4e-3 } else { 1e-3 };
            for x in 17..23 {
                let want = share(19.5 - x as f64);
                assert!((at(x) - want).abs() < tolerance, "{kind:?}, {filter:?}, {x}: {} instead of {want}", at(x));
            }
            let known = match filter {
                Filter::Box => [1.0, 1.0],
                Filter::Tent => [1.0, 0.875],
                Filter::BlackmanHarris => [1.0, 0.8814],
                // Its negative lobes sharpen: brighter than white on one side.
                Filter::Mitchell => [1.0078, 0.8793],
            };
            for (x, want) in [18, 19].into_iter().zip(known) {
                assert!((at(x) - want).abs() < tolerance, "{kind:?}, {filter:?}, {x}: {}", at(x));
            }
        }
    }
}

#[test]
fn a_constant_picture_stays_constant() {
    let scene = load(
        "[render]\nbackground = [0.3, 0.7, 0.11]\n[camera.main]\neye = [0, 0, 5]\ntarget = [0, 0, 0]\n
        [[object]]\nshape = 'sphere'\nradius = 0.1\ntransform = [{ translate = [0, 0, 9] }]\n",
    );
    let kind = BackendKind::COMPILED[0];
    let want = [0.3, 0.7, 0.11];
    for filter in Filter::ALL {
        for (sampler, spp) in Sampler::ALL.into_iter().flat_map(|s| [2, 5, 16, 37].map(|spp| (s, spp))) {
            let film = render(kind, &scene, &Job { filter, sampler, spp, ..job(16, 16) }).film;
            let off = |c: &[f32; 3]| (0..3).map(|i| (f64::from(c[i]) / want[i] - 1.0).abs()).fold(0.0, f64::max);
            let worst = film.color.iter().map(off).fold(0.0, f64::max);
            assert!(worst < 1e-6, "{filter:?}, {sampler:?}, {spp} spp: {worst}");
        }
    }
}

#[test]
fn a_lone_sample_is_not_filtered_and_threads_do_not_matter() {
    let scene = load(
        "[render]\nambient = [0.2, 0.2, 0.2]\n[camera.main]\neye = [0, 1, 6]\ntarget = [0, 0.5, 0]\n
        [light.key]\nposition = [2, 5, 3]\nradius = 1\nfalloff = 'none'\n
        [material.mirror]\ncolor = [0.3, 0.2, 0.1]\nreflect = 0.8\n
        [[object]]\nshape = 'sphere'\nradius = 0.7\nmaterial = 'mirror'\n
        [[object]]\nshape = 'sphere'\nradius = 0.7\nmaterial = 'mirror'\ntransform = [{ translate = [1.4, 0, 0] }]\n",
    );
    let kind = BackendKind::COMPILED[0];
    for filter in Filter::ALL {
        let film = |filter, sampler, spp| render(kind, &scene, &Job { filter, sampler, spp, ..job(70, 50) });
        assert!(film(filter, Sampler::Sobol, 1).film.color == film(Filter::Box, Sampler::Sobol, 1).film.color);
        let with = |threads, sampler| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
            pool.install(|| film(filter, sampler, 6)).film.color
        };
        for sampler in Sampler::ALL {
            assert!(with(1, sampler) == with(3, sampler), "{filter:?}, {sampler:?}");
        }
    }
}

#[test]
fn what_is_cut_off_counts_whatever_the_sign() {
    // A ball that mirrors the sky, one bounce deep at most: how much of the sky is lost.
    let scene = load(
        "[render]\nbackground = [1, 1, 1]\n[camera.main]\neye = [0, 0, 4]\ntarget = [0, 0, 0]\nfov = 10\n
        [material.mirror]\ncolor = [0, 0, 0]\nreflect = 0.5\n
        [[object]]\nshape = 'sphere'\nradius = 1\nmaterial = 'mirror'\n",
    );
    let kind = BackendKind::COMPILED[0];
    let cut = |filter| render(kind, &scene, &Job { filter, spp: 64, k_max: 0, ..job(8, 8) }).stats.cut_off_mean;
    let (plain, signed) = (cut(Filter::Tent), cut(Filter::Mitchell));
    let weight = Filter::Mitchell.weight(0.0, 0.0);
    assert!((signed - weight * plain).abs() < 1e-2 * signed && plain > 0.1, "{plain}, {signed}");
}
