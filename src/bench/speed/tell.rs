//! What was measured, as tables and plots.

use super::{Found, Kind, Options, What};
use crate::bench::plot::{Line, Plot};
use crate::bench::report::{Machine, Report, Section, Table};
use serde_json::{Value, json};

/// The three that answer, as columns and lines.
const NAMES: [&str; 3] = ["native", "Embree", "bare Embree"];

/// All sections.
pub(super) fn report(found: &[Found], threads: &[usize], options: &Options) -> Report {
    let about = "The same rays through the native tracer, through Embree as tison asks it, and through a bare loop over \
                 Embree's own calls, in turn in one process. Single rays are asked for one by one, packets hold sixteen \
                 neighbours. The bare loop asks tison's own Embree hierarchy; among spheres it asks one of Embree's own \
                 sphere primitive, which decides in f32. 'Whole render' is a picture of 1024x1024 pixels with two lights and \
                 no bounces, shading and all; its bare loop replays the very packets of that render.";
    let mut sections: Vec<Section> = threads.iter().map(|&n| by_threads(found, n, options)).collect();
    sections.extend((threads.len() > 1).then(|| speed_up(found, threads, options)));
    let mut ends = vec![threads[0], threads[threads.len() - 1]];
    ends.dedup();
    sections.extend(ends.into_iter().filter_map(|n| constant_cost(found, n, options)));
    Report {
        title: "tison: native, Embree, bare Embree".into(),
        about: about.into(),
        machine: Machine::this(),
        sections,
    }
}

impl What {
    fn name(self) -> &'static str {
        match self {
            Self::Load => "load",
            Self::Build => "build",
            Self::Rays(name) => name,
            Self::Render => "whole render",
        }
    }

    fn unit(self) -> &'static str {
        match self {
            Self::Load | Self::Build => "s",
            Self::Rays(_) | Self::Render => "Mrays/s",
        }
    }

    fn is_rate(self) -> bool {
        matches!(self, Self::Rays(_) | Self::Render)
    }
}

impl Found {
    fn json(&self) -> Value {
        let [native, embree, bare] = self.values;
        json!({
            "scene": self.scene, "primitives": self.primitives, "threads": self.threads,
            "what": self.what.name(), "unit": self.what.unit(),
            "native": native, "embree": embree, "bare": bare,
            "ratio": self.native_to_embree, "ratio_to_bare": self.embree_to_bare,
        })
    }

    /// Nanoseconds of one thread that tison adds to a ray of the bare loop.
    fn added(&self) -> Option<f64> {
        let [_, embree, bare] = self.values;
        Some(1e3 * self.threads as f64 * (1.0 / embree? - 1.0 / bare?))
    }
}

/// All about a number of threads.
fn by_threads(found: &[Found], threads: usize, options: &Options) -> Section {
    let here: Vec<&Found> = found.iter().filter(|f| f.threads == threads).collect();
    let mut table = Table::new(&["scene", "what", NAMES[0], NAMES[1], NAMES[2], "native / Embree", "Embree / bare"]);
    for f in &here {
        let value = |v: Option<f64>| match (v, f.what.is_rate()) {
            (None, _) => "-".into(),
            (Some(v), true) => format!("{v:.2}"),
            (Some(v), false) => format!("{v:.4}"),
        };
        let ratio = |r: Option<f64>| r.map_or_else(|| "-".into(), |r| format!("{r:.2}"));
        let what = if f.what.is_rate() { f.what.name().into() } else { format!("{}, seconds", f.what.name()) };
        let mut row = vec![f.scene.clone(), what];
        row.extend(f.values.map(value));
        row.extend([f.native_to_embree, f.embree_to_bare].map(ratio));
        table.rows.push(row);
    }
    Section {
        name: name_of(threads),
        title: title_of(threads),
        about: format!(
            "Mrays/s, more is better, and seconds to read a file (by tison, whoever traces: under 'native') and to build the \
             hierarchy, less is better; medians of {} rounds in turn, of fewer where five seconds were over. Ratios are medians of the rounds' ratios.",
            options.rounds.max(1)
        ),
        repeat: repeat(options),
        data: here.iter().map(|f| f.json()).collect(),
        plots: over_sizes(&here),
        table,
        pictures: vec![],
    }
}

/// In JSON and CSV.
fn name_of(threads: usize) -> String {
    match threads {
        1 => "one_thread".into(),
        n if n == Machine::this().threads => "all_threads".into(),
        n => format!("threads_{n}"),
    }
}

fn title_of(threads: usize) -> String {
    if threads == 1 { "One thread".into() } else { format!("{threads} threads") }
}

/// Each kind of rays over the number of primitives, meshes and spheres apart; and the times to read and build.
fn over_sizes(here: &[&Found]) -> Vec<Plot> {
    let mut plots = Vec::new();
    for (kind, things) in [(Kind::Triangles, "triangles"), (Kind::Spheres, "spheres")] {
        let of_kind: Vec<&Found> = here.iter().copied().filter(|f| f.kind == kind).collect();
        for what in kinds(&of_kind) {
            let lines = (0..NAMES.len()).map(|i| {
                let same = of_kind.iter().filter(|f| f.what == what);
                let points = same.filter_map(|f| Some((f.primitives as f64, f.values[i]?))).collect();
                Line { name: if what == What::Load { "tison" } else { NAMES[i] }.into(), points }
            });
            let title = format!("{}, {things}", what.name());
            plots.push(plot(title, things, what.unit(), lines.collect()));
        }
    }
    plots.retain(|p| p.lines.iter().any(|l| l.points.len() > 1));
    plots
}

/// Rates over the number of threads.
fn speed_up(found: &[Found], threads: &[usize], options: &Options) -> Section {
    let mut table = Table::new(&["scene", "what", "threads", NAMES[0], NAMES[1], NAMES[2]]);
    let (mut data, mut plots) = (Vec::new(), Vec::new());
    let base: Vec<&Found> = found.iter().filter(|f| f.threads == threads[0]).collect();
    for first in &base {
        let same = |f: &&Found| f.scene == first.scene && f.what == first.what;
        let others = found.iter().filter(same);
        let gain = |f: &Found, i: usize| {
            let (now, then) = (f.values[i]?, first.values[i]?);
            Some(if f.what.is_rate() { now / then } else { then / now })
        };
        let rows: Vec<(usize, [Option<f64>; 3])> = others.map(|f| (f.threads, [0, 1, 2].map(|i| gain(f, i)))).collect();
        for &(n, gains) in rows.iter().filter(|r| r.0 != threads[0]) {
            let text = |g: Option<f64>| g.map_or_else(|| "-".into(), |g| format!("{g:.2}"));
            let mut row = vec![first.scene.clone(), first.what.name().into(), n.to_string()];
            row.extend(gains.map(text));
            table.rows.push(row);
            data.push(json!({
                "scene": first.scene, "primitives": first.primitives, "threads": n, "what": first.what.name(),
                "unit": "speed-up", "native": gains[0], "embree": gains[1], "bare": gains[2],
            }));
        }
        if is_largest(first, &base) {
            let lines = (0..NAMES.len()).map(|i| Line {
                name: NAMES[i].into(),
                points: rows.iter().filter_map(|(n, gains)| Some((*n as f64, gains[i]?))).collect(),
            });
            let title = format!("{}, {}", first.what.name(), first.scene);
            plots.push(plot(title, "threads", "speed-up", lines.collect()));
        }
    }
    Section {
        name: "speed_up".into(),
        title: "Over threads".into(),
        about: format!(
            "How many times as fast as by {} it goes; the plots are of the largest mesh and of the most spheres.",
            if threads[0] == 1 { "one thread".into() } else { format!("{} threads", threads[0]) }
        ),
        repeat: repeat(options),
        table,
        data: Value::Array(data),
        plots,
        pictures: vec![],
    }
}

/// Whether no generated scene of its kind has more, and it is about rays.
fn is_largest(one: &Found, all: &[&Found]) -> bool {
    let larger = |f: &&&Found| f.kind == one.kind && f.primitives > one.primitives;
    one.kind != Kind::File && one.what.is_rate() && !all.iter().any(|f| larger(&f))
}

/// The ratios to the bare loop at each size, side by side, and how far they are apart; nothing without a bare loop.
fn constant_cost(found: &[Found], threads: usize, options: &Options) -> Option<Section> {
    let here: Vec<&Found> =
        found.iter().filter(|f| f.threads == threads && f.what.is_rate() && f.embree_to_bare.is_some()).collect();
    let kinds = kinds(&here);
    if kinds.is_empty() {
        return None;
    }
    let mut columns = vec!["scene"];
    columns.extend(kinds.iter().map(|what| what.name()));
    columns.push("added to a ray, ns");
    let mut table = Table::new(&columns);
    let (mut scenes, mut plots): (Vec<&str>, _) = (Vec::new(), Vec::new());
    for f in &here {
        if !scenes.contains(&f.scene.as_str()) {
            scenes.push(&f.scene);
        }
    }
    let at = |scene: &str, what: What| here.iter().copied().find(|f| f.scene == scene && f.what == what);
    for &scene in &scenes {
        let ratio =
            |what| at(scene, what).and_then(|f| f.embree_to_bare).map_or_else(|| "-".into(), |r| format!("{r:.2}"));
        let added = at(scene, What::Render).and_then(Found::added).map_or_else(|| "-".into(), |ns| format!("{ns:.0}"));
        let ratios = kinds.iter().map(|&what| ratio(what));
        table.rows.push(std::iter::once(scene.to_owned()).chain(ratios).chain([added]).collect());
    }
    let mut data: Vec<Value> = here
        .iter()
        .map(|f| {
            json!({
                "scene": f.scene, "primitives": f.primitives, "threads": threads, "what": f.what.name(),
                "ratio_to_bare": f.embree_to_bare, "added_ns": f.added(),
            })
        })
        .collect();
    for (kind, things) in [(Kind::Triangles, "triangles"), (Kind::Spheres, "spheres")] {
        let of = |what: What, value: fn(&Found) -> Option<f64>| -> Vec<(f64, f64)> {
            let same = here.iter().filter(|f| f.kind == kind && f.what == what);
            same.filter_map(|f| Some((f.primitives as f64, value(f)?))).collect()
        };
        let spreads: Vec<Option<f64>> = kinds.iter().map(|&what| spread(&of(what, |f| f.embree_to_bare))).collect();
        if spreads.iter().all(Option::is_none) {
            continue;
        }
        let text = |s: &Option<f64>| s.map_or_else(|| "-".into(), |s| format!("{s:.2}"));
        let added = text(&spread(&of(What::Render, Found::added)));
        let name = format!("spread over {things}");
        table.rows.push(std::iter::once(name.clone()).chain(spreads.iter().map(text)).chain([added]).collect());
        data.extend(
            kinds.iter().zip(&spreads).map(
                |(what, spread)| json!({ "scene": name, "threads": threads, "what": what.name(), "spread": spread }),
            ),
        );
        let lines = kinds.iter().map(|&w| Line { name: w.name().into(), points: of(w, |f| f.embree_to_bare) });
        plots.push(plot(format!("Embree / bare Embree, {things}"), things, "ratio", lines.collect()));
    }
    Some(Section {
        name: format!("constant_cost_{}", name_of(threads)),
        title: format!("What tison adds to a bare loop, {}", title_of(threads).to_lowercase()),
        about: "Rates through tison over those of the bare loop, and the time that a whole render adds to each of its rays, \
                in nanoseconds of one thread (less than nothing: tison's own shapes are faster than Embree's). The cost is \
                constant if the ratios do not fall and the time does not grow with the size of the scene: 'spread' is the \
                largest over the smallest of a column, and 1 would be perfect. A hierarchy that no longer fits into the \
                caches makes the bare loop slower and the ratios better, as the same time is added to more."
            .into(),
        repeat: repeat(options),
        table,
        data: Value::Array(data),
        plots,
        pictures: vec![],
    })
}

/// The largest over the smallest, if there are several and all are above zero.
fn spread(points: &[(f64, f64)]) -> Option<f64> {
    let (least, most) = points.iter().fold((f64::INFINITY, 0.0), |(a, b): (f64, f64), p| (a.min(p.1), b.max(p.1)));
    (points.len() > 1 && least > 0.0).then(|| most / least)
}

/// What was measured of these, each once.
fn kinds(of: &[&Found]) -> Vec<What> {
    let mut kinds = Vec::new();
    for f in of {
        if !kinds.contains(&f.what) {
            kinds.push(f.what);
        }
    }
    kinds
}

fn plot(title: String, x: &str, y: &str, mut lines: Vec<Line>) -> Plot {
    lines.retain(|l| !l.points.is_empty());
    Plot { title, x: x.into(), y: y.into(), lines, floor: None }
}

/// The command line of a run.
fn repeat(options: &Options) -> String {
    fn list<T: ToString>(of: &[T]) -> String {
        if of.is_empty() { "0".into() } else { of.iter().map(T::to_string).collect::<Vec<_>>().join(",") }
    }
    let files: String = options.files.iter().map(|f| format!(" {}", f.display())).collect();
    let threads =
        if options.threads.is_empty() { String::new() } else { format!(" --threads {}", list(&options.threads)) };
    format!(
        "tison bench speed --triangles {} --spheres {}{threads} --rounds {}{files}",
        list(&options.triangles),
        list(&options.spheres),
        options.rounds
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(kind: Kind, primitives: usize, threads: usize, what: What, values: [f64; 3]) -> Found {
        let [native, embree, bare] = values;
        Found {
            scene: format!("{primitives} things"),
            kind,
            primitives,
            threads,
            what,
            values: values.map(Some),
            native_to_embree: Some(native / embree),
            embree_to_bare: Some(embree / bare),
        }
    }

    fn told() -> Report {
        let mut all = Vec::new();
        for (threads, times) in [(1, 1.0), (2, 1.6)] {
            for (size, rate) in [(10, 8.0), (1000, 4.0)] {
                all.push(found(Kind::Triangles, size, threads, What::Build, [2.0 / times, 1.0 / times, 1.0]));
                all.push(found(Kind::Triangles, size, threads, What::Render, [1.0, rate * times, 10.0 * times]));
            }
        }
        let options =
            Options { triangles: vec![10, 1000], spheres: vec![], files: vec![], threads: vec![1, 2], rounds: 3 };
        report(&all, &[1, 2], &options)
    }

    #[test]
    fn there_is_a_section_for_each_number_of_threads_and_others_about_all() {
        let report = told();
        let names: Vec<&str> = report.sections.iter().map(|s| &*s.name).collect();
        assert_eq!(
            (names.len(), names[0], names[2], names[3]),
            (5, "one_thread", "speed_up", "constant_cost_one_thread")
        );
        assert!(names[4].starts_with("constant_cost_") && names[4] != names[3]);
        assert_eq!(report.sections[0].plots.len(), 2, "building, and the render");
        assert!(report.sections[3].repeat.ends_with("--triangles 10,1000 --spheres 0 --threads 1,2 --rounds 3"));
    }

    #[test]
    fn speed_ups_are_above_one_for_times_and_rates() {
        let report = told();
        let rows = report.sections[2].data.as_array().expect("a list");
        assert_eq!(rows.len(), 4);
        for row in rows {
            let gain = row["embree"].as_f64().expect("a number");
            assert!((gain - 1.6).abs() < 1e-9, "{row}");
        }
        assert_eq!(report.sections[2].plots.len(), 1, "rays of the larger one");
    }

    #[test]
    fn the_spread_is_the_largest_over_the_smallest() {
        let report = told();
        let rows = &report.sections[4].table.rows;
        assert_eq!(rows[0], ["10 things", "0.80", "31"].map(String::from));
        assert_eq!(rows[1], ["1000 things", "0.40", "188"].map(String::from));
        assert_eq!(rows[2], ["spread over triangles", "2.00", "6.00"].map(String::from));
        assert_eq!(spread(&[(1.0, 3.0)]), None);
        assert_eq!(spread(&[(1.0, 3.0), (2.0, -1.0)]), None);
    }
}
