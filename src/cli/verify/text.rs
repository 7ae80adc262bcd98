//! The table for people.

use super::super::style::{counted, grouped, seconds};
use super::Story;
use std::fmt::Write;
use tison::math::Frame;
use tison::verify::readers::Compared;
use tison::verify::{Case, Class, Group, Report, Tally};

pub fn of(story: &Story<'_>) -> String {
    let mut out = format!("{}\n", story.file.display());
    if let Some(report) = &story.backends {
        let (w, h) = story.size;
        let _ = writeln!(
            out,
            "  picture {w}x{h}, {} of each aimed kind, seed {}; {}",
            counted(story.aimed, "ray"),
            story.seed,
            seconds(story.seconds)
        );
        table(report, &mut out);
        cases(report, story, &mut out);
    }
    story.readers.iter().for_each(|compared| readers(compared, &mut out));
    let verdict = match (story.disagrees(), &story.backends) {
        (true, _) => "DISAGREE beyond rounding",
        (false, Some(_)) => "agree, but for what rounding decides",
        (false, None) => "agree",
    };
    let who = match (&story.backends, story.readers.is_empty()) {
        (Some(_), true) => "backends",
        (Some(_), false) => "backends and readers",
        (None, false) => "readers",
        (None, true) => {
            let _ = writeln!(out, "\nno OBJ file: there are no readers to compare");
            return out;
        }
    };
    let _ = writeln!(out, "\n{who} {verdict}");
    out
}

fn table(report: &Report, out: &mut String) {
    let classes = Class::ALL.map(Class::name);
    let _ = writeln!(
        out,
        "\n  {:16} {:>12} {:>12} {:>12} {}",
        "",
        "rays",
        "hits",
        "agreeing",
        classes.map(|c| format!("{c:>9}")).concat()
    );
    let mut row = |name: &str, t: &Tally| {
        let counts = t.classes.map(|n| format!("{:>9}", grouped(n))).concat();
        let [rays, hits, agreeing] = [t.rays, t.hits, t.agreeing()].map(grouped);
        let _ = writeln!(out, "  {name:16} {rays:>12} {hits:>12} {agreeing:>12} {counts}");
    };
    Group::ALL.into_iter().filter(|&g| report.of(g).rays > 0).for_each(|g| row(g.name(), report.of(g)));
    row("all", &report.total());
}

/// The worst of each class, each with the line that repeats it; all that are unexplained come first.
fn cases(report: &Report, story: &Story<'_>, out: &mut String) {
    /// Of a class that rounding explains.
    const FEW: usize = 2;
    for class in Class::ALL.into_iter().rev() {
        let worst = &report.worst[class as usize];
        let shown = if class.is_explained() { worst.len().min(FEW) } else { worst.len() };
        for case in &worst[..shown] {
            let _ = writeln!(out, "\n  {}", told(case, &story.frame, story.file.to_string_lossy().as_ref()));
        }
    }
}

fn told(case: &Case, frame: &Frame, file: &str) -> String {
    let [embree, native] = &case.answers;
    format!(
        "{}, {}: Embree says {embree}, native {native}\n    echo '{}' | tison probe {} --as-rendered --backend embree",
        case.class.name(),
        case.group.name(),
        case.probe_line(frame),
        quoted(file)
    )
}

/// As a shell takes it for one word.
fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "/._-+,=@:".contains(c);
    if !word.is_empty() && word.chars().all(plain) { word.into() } else { format!("'{}'", word.replace('\'', r"'\''")) }
}

fn readers(compared: &Compared, out: &mut String) {
    let _ = write!(out, "\n  readers   {}: ", compared.path.display());
    if let Some(why) = &compared.refused {
        let _ = writeln!(out, "tobj cannot read it ({why}); our own reader does");
        return;
    }
    let triangles = counted(compared.triangles as u64, "triangle");
    let made_up = match compared.made_up {
        0 => String::new(),
        n => format!("; {} without a value, for which tobj makes one up", counted(n, "corner")),
    };
    if compared.differences.is_empty() {
        let _ = writeln!(out, "{triangles}, all the same{made_up}");
        return;
    }
    let _ = writeln!(out, "{triangles}{made_up}");
    for d in &compared.differences {
        let line = d.line.map_or(String::new(), |line| format!(", first in line {line}"));
        let [own, tobj] = &d.read;
        let _ = writeln!(out, "    {} differ {}{line}: own {own}, tobj {tobj}", d.what, times(d.count));
    }
}

fn times(n: u64) -> String {
    if n == 1 { "once".into() } else { format!("{} times", grouped(n)) }
}
