//! What was measured, as text, JSON and a page with plots.

use super::bars::Bars;
use super::plot::{Plot, escaped};
use crate::film::{self, Display, Film, Format, Notes};
use base64::prelude::{BASE64_STANDARD, Engine};
use serde_json::{Value, json};
use std::fmt::Write;
use std::io::Cursor;

/// All that one run measured.
#[derive(Clone, Debug)]
pub struct Report {
    /// Of the measurement.
    pub title: String,
    /// What it is about.
    pub about: String,
    /// Where it was measured.
    pub machine: Machine,
    /// Its parts.
    pub sections: Vec<Section>,
}

/// One table and its plots.
#[derive(Clone, Debug)]
pub struct Section {
    /// Name in JSON and CSV; every section has another.
    pub name: String,
    /// Above the table.
    pub title: String,
    /// What the columns mean.
    pub about: String,
    /// The command that measures it again.
    pub repeat: String,
    /// What people read.
    pub table: Table,
    /// What programs read: a list of objects without lists in them.
    pub data: Value,
    /// What both look at.
    pub plots: Vec<Plot>,
    /// Pictures of what was measured.
    pub pictures: Vec<Thumbnail>,
}

/// Small pictures that the page shows enlarged, side by side.
#[derive(Clone, Debug)]
pub struct Thumbnail {
    /// Below them.
    pub caption: String,
    /// Width and height in pixels, and a PNG file.
    pngs: Vec<((u32, u32), Vec<u8>)>,
}

impl Thumbnail {
    /// `films` as the sRGB pictures that tison writes of them.
    #[must_use]
    pub fn new(caption: String, films: &[&Film]) -> Self {
        let png = |film: &&Film| {
            let mut out = Cursor::new(Vec::new());
            film::encode(film, Format::Png, &Display::default(), &Notes::default(), &mut out)
                .expect("memory takes everything, and a PNG every size");
            ((film.width, film.height), out.into_inner())
        };
        Self { caption, pngs: films.iter().map(png).collect() }
    }

    fn html(&self) -> String {
        let image = |((width, height), png): &((u32, u32), Vec<u8>)| {
            // Pixels stay squares, so that each can be told from its neighbours.
            let zoom = (WIDE / width).max(1);
            let data = BASE64_STANDARD.encode(png);
            let (width, height) = (width * zoom, height * zoom);
            format!("<img alt=\"\" width=\"{width}\" height=\"{height}\" src=\"data:image/png;base64,{data}\">")
        };
        let images: String = self.pngs.iter().map(image).collect();
        format!("<figure>{images}<figcaption>{}</figcaption></figure>\n", escaped(&self.caption))
    }
}

/// CSS pixels that an enlarged picture is wide, at most.
const WIDE: u32 = 288;

/// Words in rows.
#[derive(Clone, Debug, Default)]
pub struct Table {
    /// Above the columns.
    pub columns: Vec<String>,
    /// As many words each.
    pub rows: Vec<Vec<String>>,
    /// What of it a page shows as bars.
    pub bars: Option<Bars>,
}

/// Where a measurement was made.
#[derive(Clone, Debug)]
pub struct Machine {
    /// Model of the processor, if the system tells.
    pub processor: Option<String>,
    /// Threads that there are.
    pub threads: usize,
    /// Release of Embree and width of its packets, if it is compiled in.
    pub embree: Option<String>,
}

impl Machine {
    /// This one.
    #[must_use]
    pub fn this() -> Self {
        let model = |text: String| {
            Some(text.lines().find_map(|l| l.strip_prefix("model name"))?.split_once(':')?.1.trim().to_owned())
        };
        Self {
            processor: std::fs::read_to_string("/proc/cpuinfo").ok().and_then(model),
            threads: std::thread::available_parallelism().map_or(1, usize::from),
            embree: embree(),
        }
    }

    fn text(&self) -> String {
        let processor = self.processor.as_deref().unwrap_or("a processor without a name");
        let embree = self.embree.as_deref().unwrap_or("no Embree");
        format!("tison {}, {embree}, {} threads, {processor}", env!("CARGO_PKG_VERSION"), self.threads)
    }
}

#[cfg(feature = "embree")]
fn embree() -> Option<String> {
    let device = crate::embree::Device::new(&crate::embree::DeviceConfig::default()).ok()?;
    Some(format!("Embree {} in packets of {}", device.version(), device.packet_width()))
}

#[cfg(not(feature = "embree"))]
fn embree() -> Option<String> {
    None
}

impl Table {
    /// A table with these columns and no rows.
    #[must_use]
    pub fn new(columns: &[&str]) -> Self {
        Self { columns: columns.iter().map(|&c| c.to_owned()).collect(), ..Self::default() }
    }

    /// Words to the left in the first column, to the right in the others.
    #[must_use]
    pub fn text(&self) -> String {
        let wide = |column: usize| {
            let cells = self.rows.iter().filter_map(|r| r.get(column));
            cells.chain(self.columns.get(column)).map(|cell| cell.chars().count()).max().unwrap_or(0)
        };
        let widths: Vec<usize> = (0..self.columns.len()).map(wide).collect();
        let mut out = String::new();
        for row in std::iter::once(&self.columns).chain(&self.rows) {
            let mut line = String::new();
            for (i, (cell, &width)) in row.iter().zip(&widths).enumerate() {
                if i == 0 {
                    line += &format!("{cell:width$}");
                } else {
                    line += &format!("  {cell:>width$}");
                }
            }
            out += line.trim_end();
            out.push('\n');
        }
        out
    }

    fn html(&self) -> String {
        let row = |cells: &[String], tag: &str| {
            let cells: String = cells.iter().map(|c| format!("<{tag}>{}</{tag}>", escaped(c))).collect();
            format!("<tr>{cells}</tr>\n")
        };
        let rows: String = self.rows.iter().map(|r| row(r, "td")).collect();
        let head = row(&self.columns, "th");
        let bars = self.bars.as_ref().map_or(String::new(), Bars::svg);
        format!("{bars}<div class=\"table\"><table>\n<thead>{head}</thead>\n<tbody>\n{rows}</tbody>\n</table></div>\n")
    }
}

impl Report {
    /// For a terminal.
    #[must_use]
    pub fn text(&self) -> String {
        let mut out = format!("{}\n{}\n", self.title, self.machine.text());
        for s in &self.sections {
            write!(out, "\n{}\n{}\n\n{}\nrepeat: {}\n", s.title, s.about, s.table.text(), s.repeat)
                .expect("a string takes everything");
        }
        out
    }

    /// For programs: what is in `data` of each section, by its name.
    #[must_use]
    pub fn json(&self) -> Value {
        let sections: serde_json::Map<_, _> = self
            .sections
            .iter()
            .map(|s| (s.name.clone(), json!({ "title": s.title, "repeat": s.repeat, "data": s.data })))
            .collect();
        json!({
            "tison": env!("CARGO_PKG_VERSION"),
            "title": self.title,
            "processor": self.machine.processor,
            "threads": self.machine.threads,
            "embree": self.machine.embree,
            "sections": sections,
        })
    }

    /// For spreadsheets: a row for each object in `data` of each section, with the section's name before it and a column
    /// for each key that any of them has. What an object has not is empty.
    #[must_use]
    pub fn csv(&self) -> String {
        let mut rows: Vec<(&str, &serde_json::Map<_, _>)> = Vec::new();
        for section in &self.sections {
            let objects = section.data.as_array().into_iter().flatten().filter_map(Value::as_object);
            rows.extend(objects.map(|object| (section.name.as_str(), object)));
        }
        let mut keys: Vec<&str> = Vec::new();
        for key in rows.iter().flat_map(|(_, object)| object.keys()) {
            if !keys.contains(&key.as_str()) {
                keys.push(key);
            }
        }
        let cell = |value: Option<&Value>| match value {
            None | Some(Value::Null) => String::new(),
            Some(Value::String(text)) => text.clone(),
            Some(other) => other.to_string(),
        };
        let mut out = csv::Writer::from_writer(Vec::new());
        let header = std::iter::once("section").chain(keys.iter().copied());
        out.write_record(header).expect("memory takes everything");
        for (name, object) in &rows {
            let cells = keys.iter().map(|&key| cell(object.get(key)));
            out.write_record(std::iter::once((*name).to_owned()).chain(cells)).expect("rows are of one length");
        }
        let bytes = out.into_inner().expect("memory takes everything");
        String::from_utf8(bytes).expect("made of strings")
    }

    /// A page that needs nothing beside it.
    #[must_use]
    pub fn html(&self) -> String {
        let title = escaped(&self.title);
        let mut out = format!("{HEAD}<title>{title}</title>\n</head>\n<body>\n<h1>{title}</h1>\n");
        out += &format!("<p>{}</p>\n<p>{}</p>\n", escaped(&self.about), escaped(&self.machine.text()));
        for s in &self.sections {
            out += &format!("<h2>{}</h2>\n<p>{}</p>\n", escaped(&s.title), escaped(&s.about));
            if !s.plots.is_empty() {
                let plots: String = s.plots.iter().map(Plot::svg).collect();
                out += &format!("<div class=\"plots\">\n{plots}</div>\n");
            }
            if !s.pictures.is_empty() {
                let pictures: String = s.pictures.iter().map(Thumbnail::html).collect();
                out += &format!("<div class=\"pictures\">\n{pictures}</div>\n");
            }
            out += &format!("{}<p>Repeat: <code>{}</code></p>\n", s.table.html(), escaped(&s.repeat));
        }
        out + "</body>\n</html>\n"
    }
}

const HEAD: &str = "<!DOCTYPE html>
<html lang=\"en\">
<head>
<meta charset=\"utf-8\">
<meta name=\"viewport\" content=\"width=device-width\">
<style>
:root { color-scheme: light dark; }
body { font: 15px/1.5 sans-serif; margin: 2em auto; max-width: 1240px; padding: 0 1em; color: #222; background: #fff; }
table { border-collapse: collapse; font-size: 13px; font-variant-numeric: tabular-nums; }
th, td { padding: 2px 10px; text-align: right; border-bottom: 1px solid #8884; white-space: nowrap; }
th:first-child, td:first-child { text-align: left; }
.plots { display: grid; grid-template-columns: repeat(auto-fill, minmax(min(100%, 540px), 1fr)); gap: 8px; }
.plots svg { width: 100%; height: auto; }
.pictures { display: flex; flex-wrap: wrap; gap: 12px; margin: 1em 0; }
.pictures img { image-rendering: pixelated; margin-right: 4px; }
figure { margin: 0; width: min-content; white-space: nowrap; }
figcaption { font-size: 13px; white-space: normal; }
.table { overflow-x: auto; }
@media (prefers-color-scheme: dark) { body { color: #ddd; background: #181818; } }
</style>
";

#[cfg(test)]
mod tests {
    use super::*;

    fn report() -> Report {
        let mut table = Table::new(&["shape", "ns"]);
        table.rows.push(vec!["cube <1>".into(), "12.5".into()]);
        let section = Section {
            name: "cost".into(),
            title: "Cost".into(),
            about: "of a test".into(),
            repeat: "tison bench stability --only cost".into(),
            table,
            data: json!([{ "shape": "cube", "ns": 12.5 }]),
            plots: vec![Plot { title: "p".into(), x: "x".into(), y: "y".into(), lines: vec![], floor: None }],
            pictures: vec![Thumbnail::new("a & b".into(), &[&Film::new(4, 2, &[])])],
        };
        let machine = Machine { processor: None, threads: 2, embree: None };
        Report { title: "All".into(), about: "it".into(), machine, sections: vec![section] }
    }

    #[test]
    fn text_is_lined_up() {
        let text = report().text();
        assert!(text.contains("shape       ns\ncube <1>  12.5\n"), "{text}");
        assert!(text.contains("repeat: tison bench stability --only cost"), "{text}");
    }

    #[test]
    fn json_and_page_have_everything() {
        let json = report().json();
        assert_eq!(json["sections"]["cost"]["data"][0]["ns"], 12.5);
        assert!(json["embree"].is_null());
        let html = report().html();
        assert!(html.contains("<td>cube &lt;1&gt;</td>") && html.contains("<svg") && html.ends_with("</html>\n"));
        assert!(html.contains("width=\"288\" height=\"144\" src=\"data:image/png;base64,iVBOR"), "{html}");
        assert!(html.contains("<figcaption>a &amp; b</figcaption>"), "{html}");
        assert!(
            !html.contains("http://") || html.matches("http://").count() == html.matches("http://www.w3.org").count()
        );
    }

    #[test]
    fn csv_has_a_row_for_each_object_and_a_column_for_each_key() {
        let mut report = report();
        let other = Section {
            name: "more, \"quoted\"".into(),
            data: json!([{ "a": null, "shape": "x,y" }, { "a": true, "ns": 1e-9 }]),
            ..report.sections[0].clone()
        };
        report.sections.push(other);
        let want = "section,ns,shape,a\ncost,12.5,cube,\n\"more, \"\"quoted\"\"\",,\"x,y\",\n\
                    \"more, \"\"quoted\"\"\",1e-9,,true\n";
        assert_eq!(report.csv(), want);
    }
}
