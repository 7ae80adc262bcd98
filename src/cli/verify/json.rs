//! The same for programs. Others read these keys: add, never rename.

use super::Story;
use serde_json::{Map, Value, json};
use tison::math::Frame;
use tison::verify::readers::Compared;
use tison::verify::{Answer, Case, Class, Group, Report, Tally};

pub fn of(story: &Story<'_>) -> Value {
    json!({
        "tison": env!("CARGO_PKG_VERSION"),
        "file": story.file.to_string_lossy(),
        "agree": !story.disagrees(),
        "seed": story.seed,
        "size": story.size,
        "aimed": story.aimed,
        "seconds": story.seconds,
        "backends": story.backends.as_ref().map(|report| backends(report, &story.frame)),
        "readers": story.readers.iter().map(readers).collect::<Vec<_>>(),
    })
}

fn backends(report: &Report, frame: &Frame) -> Value {
    let groups: Map<String, Value> =
        Group::ALL.into_iter().map(|g| (g.name().to_owned(), tally(report.of(g)))).collect();
    let worst: Map<String, Value> = Class::ALL
        .into_iter()
        .map(|c| {
            let cases = report.worst[c as usize].iter().map(|case| case_json(case, frame));
            (c.name().to_owned(), cases.collect())
        })
        .collect();
    json!({ "groups": groups, "all": tally(&report.total()), "unexplained": report.unexplained(), "worst": worst })
}

fn tally(t: &Tally) -> Value {
    let mut counts = Map::new();
    for (name, n) in [("rays", t.rays), ("hits", t.hits), ("agreeing", t.agreeing())] {
        counts.insert(name.into(), n.into());
    }
    counts.extend(Class::ALL.into_iter().map(|c| (c.name().to_owned(), t.of(c).into())));
    counts.into()
}

fn case_json(case: &Case, frame: &Frame) -> Value {
    let answer = |a: &Answer| match a {
        Answer::Nothing => Value::Null,
        Answer::Occluded => json!("occluded"),
        Answer::Hit(h) => json!({ "object": h.geom_id, "prim": h.prim_id, "t": h.t }),
    };
    let [embree, native] = &case.answers;
    json!({
        "group": case.group.name(),
        "embree": answer(embree),
        "native": answer(native),
        "severity": case.severity,
        "probe": case.probe_line(frame),
    })
}

fn readers(c: &Compared) -> Value {
    let differences = c.differences.iter().map(|d| {
        let [own, tobj] = &d.read;
        json!({ "what": d.what, "count": d.count, "line": d.line, "own": own, "tobj": tobj })
    });
    json!({
        "file": c.path.to_string_lossy(),
        "triangles": c.triangles,
        "made_up": c.made_up,
        "refused": c.refused,
        "differences": differences.collect::<Vec<_>>(),
    })
}
