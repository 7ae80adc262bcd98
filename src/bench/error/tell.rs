//! Tables, plots and pictures of what was measured.

use super::candidates::BASELINE;
use super::measure::{Curve, Measured, Point};
use super::reference::{BLOCKS, Reference};
use super::subject::Subject;
use super::{Options, fit, smooth};
use crate::bench::plot::{Line, Plot};
use crate::bench::report::{Section, Table, Thumbnail};
use crate::film::Film;
use crate::metrics::Map;
use serde_json::{Value, json};

/// What is measured, and how.
pub const ABOUT: &str = "Small pictures with more and more samples, against a reference with many. Errors are of linear \
    light; seconds are those of the render loop on all threads, medians over the seeds like every other figure. The \
    last part is about single rays: what is wrong with the numbers, over \
    the time that a ray takes.";

/// RMSE that everybody is to reach.
const LEVELS: [f64; 3] = [1e-2, 3e-3, 1e-3];
/// Points that a slope is fitted over, the last ones.
const LAST: usize = 4;
/// The first number of samples of the other slope.
const FROM: f64 = 16.0;

/// What a plot or a slope takes of a point: its place and its error.
type Of = fn(&Point) -> (f64, f64);

/// Points that are more than the reference's noise, up to the first that is not: what more samples add to that one tells
/// about the reference.
fn points(curve: &Curve, of: Of, lost: fn(&Point) -> bool) -> Vec<(f64, f64)> {
    let all = curve.points.iter().take_while(|p| !lost(p)).map(of);
    all.filter(|p| p.0 > 0.0 && p.1 > 0.0 && p.1.is_finite()).collect()
}

fn by_samples(curve: &Curve) -> Vec<(f64, f64)> {
    points(curve, |p| (p.spp, p.rmse), |p| p.is_lost)
}

fn by_seconds(curve: &Curve) -> Vec<(f64, f64)> {
    points(curve, |p| (p.seconds, p.rmse), |p| p.is_lost)
}

fn smooth_by_samples(curve: &Curve) -> Vec<(f64, f64)> {
    points(curve, |p| (p.spp, p.rmse_smooth), |p| p.smooth_is_lost)
}

/// All about one scene.
pub fn sections(subject: &Subject, reference: &Reference, measured: &Measured, options: &Options) -> Vec<Section> {
    let repeat = repeat(subject, reference, options);
    vec![
        Section { repeat: repeat.clone(), ..figures(subject, reference, measured) },
        Section { repeat: repeat.clone(), ..slopes(subject, measured) },
        Section { repeat, ..reached(subject, measured) },
    ]
}

/// The command line that measures it again.
fn repeat(subject: &Subject, reference: &Reference, options: &Options) -> String {
    let (width, height) = subject.job.size;
    let all = if options.all_to_most { " --full" } else { "" };
    format!(
        "tison bench error {}{all} --only sampling --size {width}x{height} --seeds {} --spp {} --reference {}",
        subject.name,
        options.seeds.max(1),
        options.most,
        reference.spp
    )
}

fn figures(subject: &Subject, reference: &Reference, measured: &Measured) -> Section {
    let mut table = Table::new(&[
        "candidate",
        "spp",
        "seconds",
        "RMSE",
        "smooth",
        "relMSE",
        "trimmed",
        "SMAPE",
        "largest",
        "> 1/255 %",
        "FLIP",
        "SSIM",
        "1 / (MSE s)",
    ]);
    let mut data = Vec::new();
    for curve in &measured.curves {
        for p in &curve.points {
            let name = curve.candidate.name;
            table.rows.push(row(name, p));
            data.push(json!({
                "scene": subject.name, "candidate": name, "target": p.target, "spp": p.spp, "seconds": p.seconds, "rmse": p.rmse,
                "rmse_measured": p.rmse_measured, "reference_noise": reference.noise,
                "rmse_smooth": finite(p.rmse_smooth), "reference_noise_smooth": finite(reference.noise_smooth),
                "relmse": p.relmse, "relmse_trimmed": p.relmse_trimmed, "smape": p.smape, "max": p.max,
                "beyond_1_255": p.beyond_1_255, "flip": p.flip, "ssim": finite(p.ssim),
                "efficiency": finite(p.efficiency()),
            }));
        }
    }
    Section {
        name: format!("error_{}", subject.name),
        title: format!("{}: error", subject.name),
        about: about(subject, reference),
        repeat: String::new(),
        table,
        data: Value::Array(data),
        plots: plots(reference, measured),
        pictures: pictures(reference, measured),
    }
}

fn row(name: &str, p: &Point) -> Vec<String> {
    let lost = |value: f64, lost: bool| if lost { format!("({value:.2e})") } else { format!("{value:.2e}") };
    let or_none = |value: f64, text: String| if value.is_nan() { "-".to_owned() } else { text };
    vec![
        p.target.map_or(name.to_owned(), |t| format!("{name} to {t:.0e}")),
        samples(p.spp),
        format!("{:.2e}", p.seconds),
        lost(p.rmse, p.is_lost),
        or_none(p.rmse_smooth, lost(p.rmse_smooth, p.smooth_is_lost)),
        format!("{:.2e}", p.relmse),
        format!("{:.2e}", p.relmse_trimmed),
        format!("{:.2e}", p.smape),
        format!("{:.2e}", p.max),
        format!("{:.2}", 100.0 * p.beyond_1_255),
        format!("{:.2e}", p.flip),
        or_none(p.ssim, format!("{:.5}", p.ssim)),
        if p.is_lost { "-".into() } else { format!("{:.1e}", p.efficiency()) },
    ]
}

fn about(subject: &Subject, reference: &Reference) -> String {
    let job = &subject.job;
    let (width, height) = job.size;
    let smooth = match reference.smooth_share() {
        0.0 => "Of smooth pixels there are too few to tell about.".to_owned(),
        share => format!(
            "Smooth: RMSE of the {:.1} % smooth pixels, where the reference's is {:.1e}.",
            100.0 * share,
            reference.noise_smooth
        ),
    };
    format!(
        "{width}x{height} pixels, filter {}, rays bounce {} times at most. The reference: {BLOCKS} blocks of {} samples a \
         pixel with seeds of their own, by the native backend in f64, the whole tree of rays, no adaptivity, added up in \
         f64. Its own RMSE, from the spread between the blocks, is {:.2e}. The RMSE of the table are without it (the root \
         of the difference of the squares); where less than that noise is left it is in brackets, and plots and slopes end \
         before it. The other figures are as measured. {smooth} {} relMSE is trimmed of the worst 0.1 %; FLIP and SSIM are \
         of sRGB. One sample without a lens goes through the pixel's middle. Hierarchies were built before: {}.",
        job.filter.name(),
        job.k_max,
        reference.spp,
        reference.noise,
        smooth::DEFINITION,
        subject.build_seconds()
    )
}

fn plots(reference: &Reference, measured: &Measured) -> Vec<Plot> {
    let plot = |title: &str, x: &str, of: fn(&Curve) -> Vec<(f64, f64)>, noise: f64| Plot {
        title: title.into(),
        x: x.into(),
        y: "RMSE".into(),
        lines: measured.curves.iter().map(|c| line(c, of(c))).filter(|l| !l.points.is_empty()).collect(),
        floor: Some(("the reference's noise".into(), noise)).filter(|f| f.1 > 0.0),
    };
    let mut all = vec![
        plot("error over time", "seconds", by_seconds, reference.noise),
        plot("error over samples", "samples a pixel", by_samples, reference.noise),
        plot("smooth pixels", "samples a pixel", smooth_by_samples, reference.noise_smooth),
    ];
    all.retain(|plot| !plot.lines.is_empty());
    all
}

/// With its slope in the legend.
fn line(curve: &Curve, points: Vec<(f64, f64)>) -> Line {
    let slope = fit::slope_of_last(&points, LAST).map_or(String::new(), |s| format!("  {}", signed(s)));
    Line { name: format!("{}{slope}", curve.candidate.name), points }
}

fn slopes(subject: &Subject, measured: &Measured) -> Section {
    let mut table =
        Table::new(&["candidate", "by samples", "from 16 samples", "by seconds", "smooth, by samples", "points"]);
    let mut data = Vec::new();
    for curve in &measured.curves {
        let all = by_samples(curve);
        let later: Vec<_> = all.iter().copied().filter(|p| p.0 >= FROM).collect();
        let found = [
            fit::slope_of_last(&all, LAST),
            fit::slope(&later),
            fit::slope_of_last(&by_seconds(curve), LAST),
            fit::slope_of_last(&smooth_by_samples(curve), LAST),
        ];
        let ends = |n: usize| all.get(n).map_or("-".into(), |p| samples(p.0));
        let over = format!("{} … {}", ends(all.len().saturating_sub(LAST)), ends(all.len().wrapping_sub(1)));
        let words = found.map(|s| s.map_or("-".into(), signed));
        table.rows.push([vec![curve.candidate.name.to_owned()], words.to_vec(), vec![over]].concat());
        data.push(json!({
            "scene": subject.name, "candidate": curve.candidate.name, "slope_samples": found[0],
            "slope_samples_from_16": found[1], "slope_seconds": found[2], "slope_smooth": found[3],
        }));
    }
    Section {
        name: format!("slope_{}", subject.name),
        title: format!("{}: how fast the error falls", subject.name),
        about: format!(
            "Slopes of log RMSE, fitted by least squares over the last {LAST} points that are more than the reference's \
             noise. Independent random numbers give -0.5, at edges and on smooth \
             pixels alike; good points about -0.66 or better at edges, and -1 to -1.5 on smooth pixels."
        ),
        repeat: String::new(),
        table,
        data: Value::Array(data),
        plots: vec![],
        pictures: vec![],
    }
}

fn reached(subject: &Subject, measured: &Measured) -> Section {
    let baseline = &measured.curves[BASELINE];
    let mut table = Table::new(&["candidate", "RMSE", "samples", "seconds", "fewer samples", "less time"]);
    let mut data = Vec::new();
    for (curve, level) in LEVELS.iter().flat_map(|&level| measured.curves.iter().map(move |c| (c, level))) {
        let [spp, seconds] = [by_samples, by_seconds].map(|by| fit::reaches(&by(curve), level));
        let fewer = Factor::of(spp, &by_samples(baseline), level);
        let less = Factor::of(seconds, &by_seconds(baseline), level);
        table.rows.push(vec![
            curve.candidate.name.into(),
            format!("{level:.0e}"),
            spp.map_or("not reached".into(), samples),
            seconds.map_or("not reached".into(), |s| format!("{s:.2e}")),
            Factor::text(fewer),
            Factor::text(less),
        ]);
        data.push(json!({
            "scene": subject.name, "candidate": curve.candidate.name, "rmse": level, "spp": spp, "seconds": seconds,
            "fewer_samples": fewer.map(|f| f.times), "fewer_samples_at_least": fewer.map(|f| f.at_least),
            "less_time": less.map(|f| f.times), "less_time_at_least": less.map(|f| f.at_least),
        }));
    }
    Section {
        name: format!("reached_{}", subject.name),
        title: format!("{}: what it takes to get there", subject.name),
        about: format!(
            "Samples a pixel and seconds at which the RMSE is first down to a level, between two points as the line in the \
             plot has it, and how many times fewer and less that is than for {}; at least so many where that does not get \
             there. Samples of who is adaptive are the mean, with those that only estimate the error.",
            baseline.candidate.name
        ),
        repeat: String::new(),
        table,
        data: Value::Array(data),
        plots: vec![],
        pictures: vec![],
    }
}

/// How many times less somebody takes than the baseline.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Factor {
    times: f64,
    /// The baseline does not get there: it is known only what it takes without getting there.
    at_least: bool,
}

impl Factor {
    fn of(own: Option<f64>, baseline: &[(f64, f64)], level: f64) -> Option<Self> {
        let (base, at_least) = match fit::reaches(baseline, level) {
            Some(base) => (base, false),
            None => (baseline.last()?.0, true),
        };
        Some(Self { times: base / own?, at_least })
    }

    fn text(of: Option<Self>) -> String {
        of.map_or("-".into(), |f| format!("{}{:.2}x", if f.at_least { "> " } else { "" }, f.times))
    }
}

/// The reference, and what is shown of the first two candidates with its differences, all on one scale.
fn pictures(reference: &Reference, measured: &Measured) -> Vec<Thumbnail> {
    let of = &reference.picture;
    let (width, height) = (of.width, of.height);
    let film = Film { width, height, color: of.pixels.clone(), aovs: vec![], finished: of.pixels.len() };
    let difference = |film: &Film| {
        let largest = |(a, b): (&[f32; 3], &[f32; 3])| (0..3).map(|k| (a[k] - b[k]).abs()).fold(0.0, f32::max);
        film.color.iter().zip(&of.pixels).map(largest).collect::<Vec<f32>>()
    };
    let differences: Vec<Vec<f32>> = measured.shown.iter().map(|s| difference(&s.film)).collect();
    let mut sorted: Vec<f32> = differences.concat();
    sorted.sort_by(f32::total_cmp);
    let brightest = sorted.get(sorted.len() * 99 / 100).map_or(0.0, |&d| f64::from(d));
    let mut all = vec![Thumbnail::new("the reference".into(), &[&film])];
    for (shown, values) in measured.shown.iter().zip(differences) {
        let map = Map { width, height, values, brightest };
        let caption = format!(
            "{}, {} samples a pixel; its largest difference in a channel: black 0, light yellow {brightest:.1e} and more",
            shown.name, shown.spp
        );
        all.push(Thumbnail::new(caption, &[&shown.film, &map.coloured()]));
    }
    all
}

/// JSON has no NaN and no infinity.
pub fn finite(x: f64) -> Value {
    if x.is_finite() { json!(x) } else { Value::Null }
}

fn samples(n: f64) -> String {
    if n < 10.0 && n.fract() != 0.0 { format!("{n:.1}") } else { format!("{n:.0}") }
}

/// With a sign, for slopes.
fn signed(x: f64) -> String {
    format!("{x:+.2}")
}

#[cfg(test)]
mod tests {
    use super::super::candidates;
    use super::*;

    #[test]
    fn what_is_lost_in_the_noise_and_all_after_it_is_not_fitted() {
        let point = |spp: f64, is_lost| Point {
            spp,
            target: None,
            seconds: 1e-3 * spp,
            rmse_measured: 1.0 / spp,
            rmse: 1.0 / spp,
            is_lost,
            rmse_smooth: f64::NAN,
            smooth_is_lost: false,
            relmse: 0.0,
            relmse_trimmed: 0.0,
            smape: 0.0,
            max: 0.0,
            beyond_1_255: 0.0,
            flip: 0.0,
            ssim: f64::NAN,
        };
        let points = [(1.0, false), (4.0, false), (16.0, true), (64.0, false)].map(|(spp, lost)| point(spp, lost));
        let candidate = candidates::all(&Options::quick(vec![])).swap_remove(0);
        let curve = Curve { candidate, points: points.to_vec() };
        assert_eq!(by_samples(&curve), [(1.0, 1.0), (4.0, 0.25)]);
        assert_eq!(by_seconds(&curve), [(1e-3, 1.0), (4e-3, 0.25)]);
        assert_eq!(smooth_by_samples(&curve), [], "there are no smooth pixels");
        assert!(line(&curve, by_samples(&curve)).name.ends_with("  -1.00"));
        assert_eq!(row("a", &points[2])[3..5], ["(6.25e-2)".to_owned(), "-".to_owned()]);
        assert!((points[0].efficiency() - 1e3).abs() < 1e-9);
    }

    #[test]
    fn factors_are_bounds_where_the_baseline_does_not_get_there() {
        let baseline = [(1.0, 1.0), (100.0, 0.1)];
        let text = |own, level| Factor::text(Factor::of(own, &baseline, level));
        assert_eq!(text(Some(10.0), 0.1), "10.00x");
        assert_eq!(text(Some(50.0), 0.05), "> 2.00x");
        assert_eq!(text(None, 0.1), "-");
        assert_eq!(Factor::of(Some(1.0), &[], 0.1), None);
    }
}
