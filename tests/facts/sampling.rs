//! However samples are drawn, they find the same picture.

use super::kit::{job, load, render};
use tison::backend::BackendKind;
use tison::film::Film;
use tison::math::Sampler;
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
