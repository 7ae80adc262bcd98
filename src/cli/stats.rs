//! The figures of a run as JSON. Others read these keys: add, never rename.

use super::EMBREE;
use super::both::Comparison;
use super::report::Report;
use super::skipped::{Skipped, skipped};
use serde_json::{Map, Value, json};
use tison::render::{Adapted, Ended};
use tison::scene::SceneCounts;

/// Counts under the names that `info --json` uses too.
pub fn scene_json(c: &SceneCounts) -> Value {
    json!({
        "triangles": c.triangles,
        "degenerate": c.degenerate,
        "non_finite": c.non_finite,
        "vertices": c.vertices,
        "objects": c.objects,
        "instances": c.instances,
        "spheres": c.spheres,
        "cubes": c.cubes,
        "cylinders": c.cylinders,
        "quads": c.quads,
        "lights": c.lights,
        "materials": c.materials,
        "textures": c.textures,
    })
}

fn adaptive(a: Adapted) -> Value {
    let ended = match a.ended {
        Ended::Enough => "enough",
        Ended::Most => "most samples",
        Ended::Time => "time",
        Ended::Stopped => "stopped",
    };
    json!({ "rounds": a.rounds, "ended": ended, "pixels_stopped_early": a.stopped_early })
}

/// All figures of a run.
pub fn json(report: &Report<'_>) -> Value {
    let (width, height) = report.image_size();
    let (rays, s, stats) = (&report.done.stats.rays, &report.done.seconds, &report.done.stats);
    let share = report.done.finished as f64 / report.pixels() as f64;
    let skipped: Map<String, Value> = skipped(report)
        .into_iter()
        .map(|(name, why)| {
            let value = match why {
                Skipped::Count(n) => n.into(),
                Skipped::Because(why) => why.into(),
            };
            (name.to_owned(), value)
        })
        .collect();
    json!({
        "tison": env!("CARGO_PKG_VERSION"),
        "backend": report.plan.backend.name(),
        "embree": EMBREE,
        "threads": report.plan.threads,
        "image": {
            "width": width, "height": height, "spp_mean": report.spp_mean(),
            "frames": report.plan.camera.turntable.unwrap_or(1), "finished": share,
        },
        "scene": scene_json(&report.counts),
        "seconds": {
            "read": s.read, "textures": s.textures, "build": s.build, "render": s.render, "write": s.write,
            "total": s.total,
        },
        "rays": {
            "camera": rays.camera, "shadow": rays.shadow, "reflected": rays.reflected, "refracted": rays.refracted,
            "for_error_estimate": stats.rays_for_estimate,
        },
        "adaptive": stats.adapted.map(adaptive),
        "mrays_per_s": report.mrays_per_s(),
        "peak_rss_bytes": report.peak_memory,
        "memory": report.cost.json(),
        "skipped": skipped,
        "error": {
            "cut_off_max": stats.cut_off_max,
            "cut_off_mean": stats.cut_off_mean,
            "cut_off_is_estimate": stats.cut_off_is_estimate,
            "sampling_rmse_estimate": stats.sampling_rmse,
            "non_finite_samples": stats.non_finite_samples,
        },
        "warnings": report.done.warnings,
        "comparison": report.done.comparison.as_ref().map(Comparison::json),
    })
}
