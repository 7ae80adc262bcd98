//! Shapes under transforms: normals and distances against formulas in f64.

use crate::kit::{job, load, normals, render};
use glam::{DMat3, DVec3};
use tison::backend::BackendKind;
use tison::film::Aov;
use tison::render::Job;

/// A transform in the words of a scene and as a matrix; the object stays near the origin.
fn transforms() -> Vec<(&'static str, String, DMat3)> {
    let of = |m: DMat3| {
        let [x, y, z] = [m.row(0), m.row(1), m.row(2)];
        let row = |r: DVec3| format!("{},{},{},0", r.x, r.y, r.z);
        format!("transform = [{{ matrix = [{}, {}, {}, 0,0,0,1] }}]", row(x), row(y), row(z))
    };
    let turn = DMat3::from_axis_angle(DVec3::new(1.0, 2.0, -0.5).normalize(), 0.7);
    let list = [
        ("as it is", DMat3::IDENTITY),
        ("mirrored", DMat3::from_diagonal(DVec3::new(-1.0, 1.0, 1.0))),
        ("sheared", DMat3::from_cols(DVec3::X, DVec3::new(0.8, 1.0, 0.0), DVec3::new(0.0, -0.4, 1.0))),
        ("1000:1", DMat3::from_diagonal(DVec3::new(1.0, 0.001, 1.0))),
        ("turned, 1000:1, mirrored", turn * DMat3::from_diagonal(DVec3::new(-1.0, 0.001, 0.5)) * turn.transpose()),
    ];
    list.map(|(name, m)| (name, of(m), m)).into()
}

/// Nearest hit of a ray with the unit shape, by the textbook in f64: its distance parameter and the
/// outward normal there.
fn textbook(shape: &str, o: DVec3, d: DVec3) -> Option<(f64, DVec3)> {
    let round = |a: f64, b: f64, c: f64| {
        let disc = b * b - a * c;
        (disc > 1e-9 * b * b).then(|| ((-b - disc.sqrt()) / a, (-b + disc.sqrt()) / a))
    };
    match shape {
        "sphere" => {
            let (t, _) = round(d.dot(d), o.dot(d), o.dot(o) - 1.0)?;
            Some((t, o + t * d))
        }
        "cube" => {
            let (a, b) = ((-1.0 - o) / d, (1.0 - o) / d);
            let (enter, leave) = (a.min(b), a.max(b));
            let axis = enter.max_position();
            let t = enter[axis];
            (t < leave.min_element()).then(|| (t, -DVec3::AXES[axis] * d[axis].signum()))
        }
        _ => {
            let flat = |v: DVec3| v.truncate();
            let (a, b, c) = (flat(d).length_squared(), flat(o).dot(flat(d)), flat(o).length_squared() - 1.0);
            let (wall, wall_end) = round(a, b, c)?;
            let (cap, cap_end) = ((-d.z.signum() - o.z) / d.z, (d.z.signum() - o.z) / d.z);
            let on_wall = wall > cap;
            let t = wall.max(cap);
            let n = if on_wall { flat(o + t * d).extend(0.0) } else { -DVec3::Z * d.z.signum() };
            (t < wall_end.min(cap_end)).then_some((t, n))
        }
    }
}

#[test]
fn normals_and_distances_of_transformed_shapes() {
    let n = 64;
    for (name, words, m) in transforms() {
        for shape in ["sphere", "cube", "cylinder"] {
            let capped = if shape == "cylinder" { "capped = true" } else { "" };
            let loaded = load(&format!(
                "[camera.main]\neye = [2.5, 3.1, 4.2]\ntarget = [0, 0, 0]\nfov = 35\n
                [[object]]\nshape = '{shape}'\n{capped}\n{words}\n"
            ));
            let frame = loaded.scene.frame;
            let camera = loaded.cameras[0].camera.prepare(&frame, (n, n)).expect("a good camera");
            for &kind in BackendKind::COMPILED {
                let aovs = vec![Aov::Normal, Aov::Depth];
                let outcome = render(kind, &loaded, &Job { centre: true, aovs, ..job(n, n) });
                let (normals, depth) = (normals(&outcome), &outcome.film.aovs[1].data);
                let (mut compared, mut worst, mut worst_t) = (0, 0f64, 0f64);
                for i in 0..(n * n) as usize {
                    let (x, y) = (f64::from(i as u32 % n) + 0.5, f64::from(i as u32 / n) + 0.5);
                    let (o, d) = camera.ray(x, y, glam::DVec2::ZERO);
                    // The ray that was traced has components in f32.
                    let (o, d) = (frame.to_world(o.as_vec3().as_dvec3()), d.as_vec3().as_dvec3());
                    let inverse = m.inverse();
                    let Some((t, own)) = textbook(shape, inverse * o, inverse * d) else { continue };
                    let n = (inverse.transpose() * own).normalize();
                    let facing = if n.dot(d) > 0.0 { -n } else { n };
                    let got =
                        DVec3::from_slice(&normals[3 * i..3 * i + 3].iter().map(|&c| f64::from(c)).collect::<Vec<_>>());
                    worst = worst.max((got - facing).length());
                    worst_t = worst_t.max((f64::from(depth[i]) / (t * d.length()) - 1.0).abs());
                    compared += 1;
                }
                assert!(compared > 20, "{kind:?} {shape} {name}: only {compared} points");
                assert!(worst < 1e-6, "{kind:?} {shape} {name}: normals off by {worst:e}");
                assert!(worst_t < 1.5e-7, "{kind:?} {shape} {name}: distances off by {worst_t:e}");
            }
        }
    }
}
