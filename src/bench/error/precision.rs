//! Numerical error against time: what single shapes are answered, and how long that takes.

use super::Progress;
use crate::backend;
use crate::bench::plot::{Line, Plot};
use crate::bench::report::{Section, Table};
use crate::bench::wrong::{self, Count, MARGIN, Setting, Shape};
use serde_json::{Value, json};

/// Distances of the eye, in sizes of the shape.
const DISTANCES: [f64; 4] = [1.5, 150.0, 1.5e4, 1.5e6];
/// Rays of each shape from each distance.
const RAYS: u64 = 20_000;
/// Rounds of timing.
const ROUNDS: usize = 21;
/// The work of one shape at one distance, in samples of a picture that take about as long.
const SAMPLES: u32 = 300_000;

/// The work of all of it, in samples.
pub fn samples() -> f64 {
    f64::from(SAMPLES) * (Shape::ALL.len() * DISTANCES.len()) as f64
}

/// What somebody did from one distance.
struct Found {
    who: &'static str,
    distance: f64,
    ns: f64,
    count: Count,
}

/// A section for each shape; those that were finished before it was stopped.
///
/// # Errors
/// If a backend cannot be built.
pub fn sections(progress: &Progress<'_>) -> Result<Vec<Section>, backend::Error> {
    let mut sections = Vec::new();
    for shape in Shape::ALL {
        let mut found = Vec::new();
        for distance in DISTANCES {
            if progress.watch.control.is_cancelled() {
                return Ok(sections);
            }
            progress.begin(1, SAMPLES);
            let setting = Setting { distance, ..Setting::PLAIN };
            let counts = wrong::wrong(shape, setting, RAYS)?;
            let times = wrong::times(shape, setting, ROUNDS)?;
            found.extend(counts.into_iter().zip(times).map(|((who, count), (_, ns))| Found {
                who,
                distance,
                ns,
                count,
            }));
        }
        sections.push(section(shape, &found));
    }
    Ok(sections)
}

fn section(shape: Shape, found: &[Found]) -> Section {
    let mut table =
        Table::new(&["who", "distance", "ns a ray", "missed", "made up", "worst error of t", "root mean square"]);
    let mut data = Vec::new();
    for f in found {
        let (c, name) = (&f.count, shape.name());
        table.rows.push(vec![
            f.who.into(),
            format!("{}", f.distance),
            format!("{:.1}", f.ns),
            c.missed.to_string(),
            c.made_up.to_string(),
            format!("{:.1e}", c.worst_t),
            format!("{:.1e}", c.rms_t()),
        ]);
        data.push(json!({
            "shape": name, "candidate": f.who, "distance": f.distance, "ns": f.ns, "rays": c.rays, "missed": c.missed,
            "made_up": c.made_up, "worst_t": super::tell::finite(c.worst_t), "rms_t": super::tell::finite(c.rms_t()),
        }));
    }
    let plot = |y: &str, of: fn(&Count) -> f64| {
        let mut lines: Vec<Line> = Vec::new();
        for f in found {
            let point = (f.ns, of(&f.count));
            match lines.iter_mut().find(|l| l.name == f.who) {
                Some(line) => line.points.push(point),
                None => lines.push(Line { name: f.who.into(), points: vec![point] }),
            }
        }
        Plot { title: format!("{}: {y}", shape.name()), x: "ns a ray".into(), y: y.into(), lines, floor: None }
    };
    Section {
        name: format!("precision_{}", shape.name()),
        title: format!("Precision: {}", shape.name()),
        about: format!(
            "Relative errors of t, and hits missed and made up, among {RAYS} rays without those that a relative change \
             below {MARGIN:e} would decide otherwise, against numbers of 32 digits; and nanoseconds of one ray after the \
             other on one thread, medians of {ROUNDS} rounds in turn, about half of the rays hits. A line has the eye at {} \
             sizes from the shape. Native and Embree go through a hierarchy of one primitive; + refine is what the renderer \
             uses.",
            DISTANCES.map(|d| d.to_string()).join(", ")
        ),
        repeat: "tison bench error --only precision".into(),
        table,
        data: Value::Array(data),
        plots: vec![plot("worst relative error of t", |c| c.worst_t), plot("share of wrong answers", Count::share)],
        pictures: vec![],
    }
}
