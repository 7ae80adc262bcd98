//! Shading, shadows, lenses: against formulas written out anew.

use crate::kit::{job, load, render};
use glam::{DVec3, Vec3};
use tison::backend::BackendKind;
use tison::math::Sampler;
use tison::render::Job;
use tison::scene::desc::LensSampler;

const LOOK_DOWN: &str = "[camera.main]\ntype = 'orthographic'\neye = [0, 0, 10]\ntarget = [0, 0, 0]\nheight = 4\n";

/// World points that the pixels of an image of `n` x `n` show of the plane z = 0, at their centres.
fn points(n: u32) -> impl Iterator<Item = (usize, DVec3)> {
    let at = move |i: u32| 4.0 * (f64::from(i) + 0.5) / f64::from(n) - 2.0;
    (0..n * n).map(move |i| (i as usize, DVec3::new(at(i % n), -at(i / n), 0.0)))
}

#[test]
fn plastic_and_metal_under_a_light_that_weakens() {
    let light = DVec3::new(0.7, -0.4, 1.5);
    for metallic in [0.0, 0.25, 1.0] {
        let scene = load(&format!(
            "{LOOK_DOWN}[render]\nambient = [0.1, 0.2, 0.3]\n
            [light.key]\nposition = [0.7, -0.4, 1.5]\ncolor = [1, 0.8, 0.6]\npower = 3\n
            [material.m]\ncolor = [0.9, 0.5, 0.1]\nambient = 0.5\ndiffuse = 0.6\nspecular = 0.7\nshininess = 25\nmetallic = {metallic}\n
            [[object]]\nshape = 'quad'\nhalf = 5\nmaterial = 'm'\n"
        ));
        for &kind in BackendKind::COMPILED {
            let film = render(kind, &scene, &Job { centre: true, ..job(16, 16) }).film;
            for (i, p) in points(16) {
                let (l, square) = ((light - p).normalize(), (light - p).length_squared());
                let highlight = (l + DVec3::Z).normalize().z.powi(25);
                let base = DVec3::new(0.9, 0.5, 0.1);
                let shine = 0.7 * DVec3::ONE.lerp(base, metallic) * highlight;
                let arrives = 3.0 * DVec3::new(1.0, 0.8, 0.6) / square;
                let want = 0.5 * base * DVec3::new(0.1, 0.2, 0.3) + arrives * (0.6 * base * l.z + shine);
                let off = (Vec3::from(film.color[i]).as_dvec3() - want).abs().max_element();
                assert!(
                    off < 3e-6 * want.max_element().max(1.0),
                    "{kind:?}, metallic {metallic}, at {p}: {} instead of {want}",
                    Vec3::from(film.color[i])
                );
            }
        }
    }
}

#[test]
fn a_ball_of_light_throws_a_half_shadow_of_the_right_width() {
    // The edge at x = 0 of a half plane at height 1, a light of radius 0.5 at height 3: the half
    // shadow ends 0.25 to either side of the edge's.
    let scene = load(&format!(
        "{LOOK_DOWN}[light.key]\nposition = [0, 0, 3]\nradius = 0.5\nfalloff = 'none'\n
        [material.white]\ncolor = [1, 1, 1]\nambient = 0\n
        [material.clear]\nambient = 0\ndiffuse = 0\nrefract = 1\nior = 1\n
        [[object]]\nshape = 'quad'\nhalf = 5\nmaterial = 'white'\n
        [[object]]\nshape = 'quad'\nhalf = 5\nmaterial = 'clear'\ntransform = [{{ translate = [5, 0, 1] }}]\n"
    ));
    let n = 32;
    for &kind in BackendKind::COMPILED {
        use Sampler::{Sobol, Stratified};
        for (spp, light_samples, sampler) in
            [(1024, 1, Sobol), (16, 64, Sobol), (16, 64, Stratified), (7, 129, Stratified)]
        {
            let outcome = render(kind, &scene, &Job { spp, light_samples, sampler, jitter_radius: 0.0, ..job(n, n) });
            for (i, p) in points(n).filter(|(_, p)| p.y.abs() < 0.1) {
                // Where the plane of the edge cuts the light's disc, in radii from its middle.
                let cut = (-2.0 * p.x) / 0.5;
                let hidden = if cut <= -1.0 {
                    1.0
                } else if cut >= 1.0 {
                    0.0
                } else {
                    (cut.acos() - cut * (1.0 - cut * cut).sqrt()) / std::f64::consts::PI
                };
                let unshadowed = 3.0 / (p.length_squared() + 9.0).sqrt();
                let share = f64::from(outcome.film.color[i][0]) / unshadowed;
                // The disc is turned towards each point: a little narrower than seen from straight below.
                assert!(
                    (share - (1.0 - hidden)).abs() < 0.02,
                    "{kind:?}, {sampler:?}, {spp} spp, x = {}: {share} of the light, not {}",
                    p.x,
                    1.0 - hidden
                );
            }
            let shadow = outcome.stats.rays.shadow;
            assert!(shadow <= u64::from(n * n * spp * light_samples), "{shadow}");
        }
    }
}

#[test]
fn a_constant_plane_through_the_lens_is_exactly_constant() {
    let scene = load(
        "[render]\nambient = [0.3, 0.7, 0.11]\n[camera.main]\neye = [0, 0, 5]\ntarget = [0, 0, 0]\nfov = 20\nlens = { radius = 0.4, focus = 3 }\n
        [material.m]\ncolor = [0.3, 0.9, 0.7]\n[[object]]\nshape = 'quad'\nhalf = 50\nmaterial = 'm'\n",
    );
    let samplers =
        [LensSampler::Concentric, LensSampler::Polar, LensSampler::Rejection, LensSampler::PolarUniformRadius];
    for &kind in BackendKind::COMPILED {
        let want = render(kind, &scene, &job(1, 1)).film.color[0];
        for (lens_sampler, spp) in samplers.into_iter().flat_map(|s| [1, 7, 64].map(|spp| (s, spp))) {
            let film = render(kind, &scene, &Job { lens_sampler, spp, ..job(9, 6) }).film;
            assert!(film.color.iter().all(|c| *c == want), "{kind:?}, {lens_sampler:?}, {spp} spp");
        }
    }
}

#[test]
fn three_lens_samplers_find_the_same_picture_and_the_biased_one_another() {
    // The rim of a disc out of focus: how much of the lens sees it.
    let scene = load(
        "[render]\nbackground = [0, 0, 0]\nambient = [1, 1, 1]\n[camera.main]\neye = [0, 0, 4]\ntarget = [0, 0, 0]\nfov = 30\nlens = { radius = 0.5, focus = 2 }\n
        [material.m]\ncolor = [1, 1, 1]\n[[object]]\nshape = 'sphere'\nradius = 0.5\nmaterial = 'm'\n",
    );
    let kind = BackendKind::COMPILED[0];
    let film = |lens_sampler, spp| render(kind, &scene, &Job { lens_sampler, spp, ..job(12, 12) }).film;
    let truth = film(LensSampler::Concentric, 16_384);
    let rmse = |lens_sampler, spp| {
        let film = film(lens_sampler, spp);
        let squares = film.color.iter().zip(&truth.color).map(|(a, b)| f64::from(a[0] - b[0]).powi(2));
        (squares.sum::<f64>() / truth.color.len() as f64).sqrt()
    };
    for sampler in [LensSampler::Polar, LensSampler::Rejection, LensSampler::Concentric] {
        assert!(rmse(sampler, 4096) < 4e-3, "{sampler:?}: {}", rmse(sampler, 4096));
    }
    let (few, many) = (rmse(LensSampler::PolarUniformRadius, 256), rmse(LensSampler::PolarUniformRadius, 4096));
    assert!(few > 0.03 && many > 0.03, "more samples do not help: {few}, then {many}");
}
