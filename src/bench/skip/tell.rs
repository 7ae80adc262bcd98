//! What was measured, as a report.

use super::{Found, Options, Proof};
use crate::bench::bars::{Bar, Bars};
use crate::bench::report::{Machine, Report, Section, Table};
use crate::scene::Skip;
use serde_json::{Value, json};

/// All of it.
pub fn report(found: &[Found], options: &Options) -> Report {
    let about = "Each picture is rendered with everything left out that its scene does not need, and again with one of these \
                 skips switched off (tison render --no-skip NAME), in turn. The two are compared number by number.";
    Report {
        title: format!("tison: what is left out, {}", options.backend.name()),
        about: about.into(),
        machine: Machine::this(),
        sections: vec![section(found, options)],
    }
}

fn section(found: &[Found], options: &Options) -> Section {
    let mut table = Table::new(&["skip", "scene", "left out", "s with", "s without", "without / with", "proof"]);
    table.rows = found.iter().map(row).collect();
    table.bars = Some(bars(found));
    Section {
        name: "skips".into(),
        title: "With and without".into(),
        about: format!(
            "Seconds to read, build and render, medians of {} rounds in turn; the ratio is the median of the pairs' and \
             says how much longer it takes without the skip. Where nothing is left out no time is taken.",
            options.rounds.max(1)
        ),
        repeat: repeat(options),
        table,
        data: Value::Array(found.iter().map(data).collect()),
        plots: vec![],
        pictures: vec![],
    }
}

fn row(f: &Found) -> Vec<String> {
    let (count, what) = f.left_out;
    let left_out = if count == 0 { "nothing".into() } else { format!("{count} {what}") };
    let cell = |of: fn(&super::Seconds) -> String| f.seconds.as_ref().map_or("-".into(), of);
    vec![
        f.skip.name().into(),
        f.scene.clone(),
        left_out,
        cell(|s| format!("{:.4}", s.with)),
        cell(|s| format!("{:.4}", s.without)),
        cell(|s| format!("{:.3}", s.ratio)),
        f.proof.to_string(),
    ]
}

fn data(f: &Found) -> Value {
    let (kind, difference, bound) = match f.proof {
        Proof::SameBytes => ("same bytes", Some(0.0), None),
        Proof::Ties(_) => ("ties", None, None),
        Proof::Within { difference, bound } => ("bounded", Some(difference), Some(bound)),
        Proof::Broken { difference, .. } => ("broken", Some(difference), None),
    };
    json!({
        "skip": f.skip.name(), "why": f.skip.why(), "scene": f.scene, "left_out": f.left_out.0, "of": f.left_out.1,
        "seconds_with": f.seconds.map(|s| s.with), "seconds_without": f.seconds.map(|s| s.without),
        "ratio": f.seconds.map(|s| s.ratio), "proof": kind, "difference": difference, "bound": bound,
    })
}

fn bars(found: &[Found]) -> Bars {
    let bar = |f: &Found| {
        let ratio = f.seconds?.ratio;
        Some(Bar { name: format!("{}: {}", f.skip.name(), f.scene), value: ratio, label: format!("{ratio:.3}") })
    };
    Bars {
        title: "Time without the skip over time with it".into(),
        from: 1.0,
        bars: found.iter().filter_map(bar).collect(),
    }
}

/// The command line of a run.
fn repeat(options: &Options) -> String {
    let only: Vec<&str> = options.skips.iter().map(|skip| skip.name()).collect();
    let only = if options.skips == Skip::ALL { String::new() } else { format!(" --only {}", only.join(",")) };
    let files: String = options.files.iter().map(|f| format!(" {}", f.display())).collect();
    format!("tison bench skip --backend {} --rounds {}{only}{files}", options.backend.name(), options.rounds)
}

#[cfg(test)]
mod tests {
    use super::super::{Scale, Seconds};
    use super::*;
    use crate::backend::BackendKind;

    #[test]
    fn a_report_tells_each_skip_and_its_proof() {
        let options = Options {
            files: vec!["a.toml".into()],
            skips: vec![Skip::Lens, Skip::WeightCut],
            backend: BackendKind::Native,
            rounds: 3,
            scale: Scale::Small,
        };
        let scene = String::from("a.toml");
        let seconds = Some(Seconds { with: 1.0, without: 1.5, ratio: 1.5 });
        let proof = Proof::Within { difference: 1e-3, bound: 2e-3 };
        let found = [
            Found {
                skip: Skip::Lens,
                scene: scene.clone(),
                left_out: (0, "points"),
                proof: Proof::SameBytes,
                seconds: None,
            },
            Found { skip: Skip::WeightCut, scene, left_out: (7, "branches"), proof, seconds },
        ];
        let report = report(&found, &options);
        let text = report.text();
        for part in ["nothing", "same bytes", "7 branches", "1.500", "differs by 1.00e-3, bound 2.00e-3"] {
            assert!(text.contains(part), "{part} in\n{text}");
        }
        assert!(text.contains("repeat: tison bench skip --backend native --rounds 3 --only lens,weight-cut a.toml"));
        let html = report.html();
        assert!(html.contains("<rect") && html.contains("weight-cut: a.toml"), "{html}");
        let data = &report.json()["sections"]["skips"]["data"];
        assert_eq!((&data[1]["proof"], &data[1]["bound"]), (&"bounded".into(), &2e-3.into()));
        assert!(data[0]["ratio"].is_null());
        assert!(report.csv().contains("skips,"));
    }
}
