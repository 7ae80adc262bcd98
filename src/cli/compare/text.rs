//! The table for people.

use super::super::style::{figure, grouped};
use super::Story;
use std::fmt::Write;
use tison::film::Encoding;

pub fn of(story: &Story<'_>) -> String {
    let (args, report) = (story.args, &story.report);
    let values = &report.values;
    let (kind, white) = match report.encoding {
        Encoding::Linear => ("linear light", "white is 1"),
        Encoding::Srgb8 => ("sRGB from 0 to 255", "white is 255"),
    };
    let (w, h) = story.size;
    let mut out = format!("{} against {}\n  {w}x{h} pixels, {kind}\n\n", args.a.display(), args.b.display());
    let pixels = u64::from(w) * u64::from(h);
    let identical = if values.identical() {
        "yes".into()
    } else {
        format!("no: {} of {} pixels differ", grouped(values.differing), grouped(pixels))
    };
    let ssim = report.ssim.map_or_else(|| "none".into(), figure);
    let ppd = format!("what an eye notices, 0 nothing to 1, at {} pixels per degree", figure(args.ppd));
    let rmse = format!("root of the mean squared difference; {white}");
    let rows = [
        ("RMSE", figure(values.rmse), rmse.as_str()),
        ("PSNR", figure(values.psnr), "20 log10(white / RMSE), in dB"),
        ("max", figure(values.max), "largest difference of any channel"),
        ("relMSE", figure(values.relmse), "mean of (a - b)² / (b² + 0.01), values from 0 to 1"),
        ("relMSE trimmed", figure(values.relmse_trimmed), "without the worst 0.1 % of the pixels"),
        ("SMAPE", figure(values.smape), "mean of |a - b| / (|a| + |b| + 0.01)"),
        ("SSIM", ssim, "structural similarity, 1 is the same; sides of 11 pixels or more"),
        ("FLIP", figure(report.flip.mean), ppd.as_str()),
        ("beyond 1/255", figure(values.beyond_1_255), "share of the pixels that are off by more than 1/255 of white"),
    ];
    for (name, value, meaning) in rows {
        let _ = writeln!(out, "  {name:15} {value:>12}   {meaning}");
    }
    let _ = writeln!(out, "\n  identical       {identical}");
    for note in &story.notes {
        let _ = writeln!(out, "  note: {note}");
    }
    out
}
