//! The same for programs. Others read these keys: add, never rename.

use super::{DiffOf, Story};
use serde_json::{Value, json};
use tison::metrics::NonFinite;

pub fn text(story: &Story<'_>) -> String {
    format!("{:#}\n", of(story))
}

/// What is infinite or NaN becomes null.
fn of(story: &Story<'_>) -> Value {
    let (args, report) = (story.args, &story.report);
    let values = &report.values;
    let [in_a, in_b] = values.non_finite_in.map(non_finite);
    let diff = story.diff.as_ref().map(|(path, shows)| {
        let map = if args.diff_of == DiffOf::Flip { &report.flip.map } else { &report.largest };
        json!({ "file": path.to_string_lossy(), "shows": shows, "brightest": map.brightest })
    });
    json!({
        "tison": env!("CARGO_PKG_VERSION"),
        "a": args.a.to_string_lossy(),
        "b": args.b.to_string_lossy(),
        "layer": args.layer,
        "width": story.size.0,
        "height": story.size.1,
        "kind": report.encoding.name(),
        "mixed": report.mixed,
        "identical": values.identical(),
        "rmse": values.rmse,
        "psnr": values.psnr,
        "max": values.max,
        "relmse": values.relmse,
        "relmse_trimmed": values.relmse_trimmed,
        "smape": values.smape,
        "ssim": report.ssim,
        "flip": report.flip.mean,
        "pixels_per_degree": args.ppd,
        "beyond_1_255": values.beyond_1_255,
        "differing": values.differing,
        "non_finite": values.non_finite,
        "non_finite_differing": values.non_finite_differing,
        "non_finite_in": { "a": in_a, "b": in_b },
        "diff": diff,
        "notes": story.notes,
    })
}

fn non_finite(of: NonFinite) -> Value {
    json!({ "nan": of.nan, "infinite": of.infinite, "first": of.first })
}
