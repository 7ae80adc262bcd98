//! Plots as SVG that stands inside of a page: text and axes take the page's colour, lines are readable on light and
//! dark.

use std::fmt::Write;

/// Values over values, both axes logarithmic.
#[derive(Clone, Debug)]
pub struct Plot {
    /// Above it.
    pub title: String,
    /// What goes to the right, with its unit.
    pub x: String,
    /// What goes up, with its unit.
    pub y: String,
    /// What is drawn.
    pub lines: Vec<Line>,
    /// Name and height of a dashed line, under which values mean little.
    pub floor: Option<(String, f64)>,
}

/// Points joined by a line.
#[derive(Clone, Debug)]
pub struct Line {
    /// In the legend.
    pub name: String,
    /// `x` above 0. A `y` of 0 is drawn at the bottom, under the decades; what is not finite is left out.
    pub points: Vec<(f64, f64)>,
}

/// Of a letter in the legend, about.
const LETTER: f64 = 6.4;
/// From the plot to the legend's words.
const LEGEND: f64 = 30.0;
const LEFT: f64 = 62.0;
const RIGHT: f64 = 400.0;
const TOP: f64 = 34.0;
const BOTTOM: f64 = 258.0;
const HEIGHT: f64 = 304.0;
/// Red, blue, green, orange, violet, grey, turquoise, brown: as dark as they are light.
const COLOURS: [&str; 8] = ["#d1495b", "#3d8fd1", "#3a9d5d", "#d98a1f", "#9673c9", "#858585", "#2ba3a0", "#a9744f"];
/// Labels along an axis, at most.
const LABELS: i32 = 8;

/// An axis in decades.
struct Decades {
    first: i32,
    last: i32,
    /// Whether there is a place for zero under the first.
    zero: bool,
    from: f64,
    to: f64,
}

impl Decades {
    fn of(values: impl Iterator<Item = f64> + Clone, from: f64, to: f64) -> Self {
        let logs = values.clone().filter(|&v| v > 0.0).map(f64::log10);
        let (least, most) = (logs.clone().fold(f64::INFINITY, f64::min), logs.fold(f64::NEG_INFINITY, f64::max));
        let (least, most) = if least <= most { (least, most) } else { (0.0, 1.0) };
        let first = (least + 1e-9).floor() as i32;
        let last = ((most - 1e-9).ceil() as i32).max(first + 1);
        Self { first, last, zero: values.into_iter().any(|v| v <= 0.0), from, to }
    }

    /// Where `value` is.
    fn at(&self, value: f64) -> f64 {
        let bottom = f64::from(self.first) - if self.zero { 0.6 } else { 0.0 };
        let log = if value > 0.0 { value.log10() } else { bottom };
        self.from + (self.to - self.from) * (log - bottom) / (f64::from(self.last) - bottom)
    }

    /// Values that get a line and a label.
    fn ticks(&self) -> impl Iterator<Item = (f64, String)> {
        let many = self.last - self.first;
        let step = [1, 2, 5, 10, 20, 50].into_iter().find(|step| many / step < LABELS).unwrap_or(100);
        let decades = (self.first..=self.last).filter(move |k| k % step == 0).map(|k| (10f64.powi(k), label(k)));
        self.zero.then(|| (0.0, "0".to_owned())).into_iter().chain(decades)
    }
}

fn label(decade: i32) -> String {
    match decade {
        -2..=3 => format!("{}", 10f64.powi(decade)),
        _ => format!("1e{decade}"),
    }
}

/// Text that may stand in SVG and HTML.
#[must_use]
pub fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

impl Plot {
    /// An `svg` element.
    #[must_use]
    pub fn svg(&self) -> String {
        let finite = || self.lines.iter().flat_map(|l| &l.points).filter(|p| p.0.is_finite() && p.1.is_finite());
        let x = Decades::of(finite().map(|p| p.0), LEFT, RIGHT);
        let floor = self.floor.iter().map(|f| f.1).filter(|f| f.is_finite());
        let y = Decades::of(finite().map(|p| p.1).chain(floor), BOTTOM, TOP);
        let width = self.width();
        let mut out = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {HEIGHT}\" width=\"{width}\" \
             height=\"{HEIGHT}\" role=\"img\" font-family=\"sans-serif\" font-size=\"12\" fill=\"currentColor\">\n"
        );
        self.write(&mut out, &x, &y).expect("a string takes everything");
        out += "</svg>\n";
        out
    }

    /// So wide that the legend fits.
    fn width(&self) -> f64 {
        let names = self.lines.iter().map(|l| &l.name).chain(self.floor.iter().map(|f| &f.0));
        let longest = names.map(|name| name.chars().count()).max().unwrap_or(0);
        RIGHT + LEGEND + 10.0 + (LETTER * longest as f64).ceil()
    }

    fn write(&self, out: &mut String, x: &Decades, y: &Decades) -> std::fmt::Result {
        let middle = 0.5 * (LEFT + RIGHT);
        writeln!(
            out,
            "<text x=\"{middle}\" y=\"18\" text-anchor=\"middle\" font-weight=\"bold\">{}</text>",
            escaped(&self.title)
        )?;
        for (value, label) in x.ticks() {
            let at = x.at(value);
            rule(out, (at, TOP), (at, BOTTOM))?;
            writeln!(out, "<text x=\"{at:.1}\" y=\"{}\" text-anchor=\"middle\">{label}</text>", BOTTOM + 16.0)?;
        }
        for (value, label) in y.ticks() {
            let at = y.at(value);
            rule(out, (LEFT, at), (RIGHT, at))?;
            writeln!(out, "<text x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">{label}</text>", LEFT - 6.0, at + 4.0)?;
        }
        let (x_label, y_label) = (escaped(&self.x), escaped(&self.y));
        writeln!(out, "<text x=\"{middle}\" y=\"{}\" text-anchor=\"middle\">{x_label}</text>", HEIGHT - 10.0)?;
        let up = 0.5 * (TOP + BOTTOM);
        writeln!(out, "<text transform=\"translate(14 {up}) rotate(-90)\" text-anchor=\"middle\">{y_label}</text>")?;
        for (i, line) in self.lines.iter().enumerate() {
            let colour = COLOURS[i % COLOURS.len()];
            // Lines that lie on each other show as rings.
            let radius = 3.0 + 1.2 * (self.lines.len() - 1 - i).min(5) as f64;
            line.write(out, (x, y), colour, radius)?;
            let legend = TOP + 10.0 + 20.0 * i as f64;
            mark(out, (RIGHT + 16.0, legend), colour, radius)?;
            writeln!(out, "<text x=\"{}\" y=\"{:.1}\">{}</text>", RIGHT + LEGEND, legend + 4.0, escaped(&line.name))?;
        }
        self.write_floor(out, y)
    }

    /// The dashed line, and its place at the end of the legend.
    fn write_floor(&self, out: &mut String, y: &Decades) -> std::fmt::Result {
        let Some((name, value)) = self.floor.as_ref().filter(|f| f.1.is_finite()) else { return Ok(()) };
        let dashed = |out: &mut String, from: f64, to: f64, at: f64| {
            writeln!(
                out,
                "<line x1=\"{from}\" y1=\"{at:.1}\" x2=\"{to}\" y2=\"{at:.1}\" stroke=\"currentColor\" \
                 stroke-width=\"1.5\" stroke-dasharray=\"6 4\"/>"
            )
        };
        let legend = TOP + 10.0 + 20.0 * self.lines.len() as f64;
        dashed(out, LEFT, RIGHT, y.at(*value))?;
        dashed(out, RIGHT + 6.0, RIGHT + 26.0, legend)?;
        writeln!(out, "<text x=\"{}\" y=\"{:.1}\">{}</text>", RIGHT + LEGEND, legend + 4.0, escaped(name))
    }
}

impl Line {
    fn write(&self, out: &mut String, (x, y): (&Decades, &Decades), colour: &str, radius: f64) -> std::fmt::Result {
        let points = self.points.iter().filter(|p| p.0.is_finite() && p.1.is_finite());
        let places: Vec<_> = points.map(|&(a, b)| (x.at(a), y.at(b))).collect();
        let joined: Vec<String> = places.iter().map(|(x, y)| format!("{x:.1},{y:.1}")).collect();
        let joined = joined.join(" ");
        writeln!(out, "<polyline points=\"{joined}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"2\"/>")?;
        places.iter().try_for_each(|&at| mark(out, at, colour, radius))
    }
}

fn rule(out: &mut String, a: (f64, f64), b: (f64, f64)) -> std::fmt::Result {
    writeln!(
        out,
        "<line x1=\"{:.1}\" y1=\"{:.1}\" x2=\"{:.1}\" y2=\"{:.1}\" stroke=\"currentColor\" stroke-opacity=\"0.18\"/>",
        a.0, a.1, b.0, b.1
    )
}

fn mark(out: &mut String, (x, y): (f64, f64), colour: &str, radius: f64) -> std::fmt::Result {
    writeln!(out, "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{radius:.1}\" fill=\"{colour}\"/>")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_where_their_decades_are() {
        let axis = Decades::of([1.5, 150.0, 15_000.0].into_iter(), 0.0, 100.0);
        assert_eq!((axis.first, axis.last, axis.zero), (0, 5, false));
        assert_eq!([1.0, 1e5].map(|v| axis.at(v)), [0.0, 100.0]);
        assert!((axis.at(1e2) - 40.0).abs() < 1e-9);
        let axis = Decades::of([0.0, 1e-3].into_iter(), 0.0, 100.0);
        assert_eq!((axis.first, axis.last, axis.zero), (-3, -2, true));
        assert_eq!(axis.at(0.0), 0.0);
        assert!(axis.at(1e-3) > 10.0);
        assert_eq!(axis.ticks().next(), Some((0.0, "0".into())));
        // Nothing but zeros, and nothing.
        assert!(Decades::of([0.0].into_iter(), 0.0, 1.0).at(0.0).is_finite());
        assert!(Decades::of([].into_iter(), 0.0, 1.0).at(1.0).is_finite());
    }

    #[test]
    fn a_plot_has_all_it_was_given() {
        let plot = Plot {
            title: "a < b".into(),
            x: "rays".into(),
            y: "ns & more".into(),
            lines: vec![
                Line { name: "one".into(), points: vec![(1.0, 2.0), (10.0, f64::NAN), (100.0, 0.0)] },
                Line { name: "two".into(), points: vec![] },
            ],
            floor: Some(("noise".into(), 1e-3)),
        };
        let svg = plot.svg();
        for part in
            ["a &lt; b", "rays", "ns &amp; more", "one", "two", "polyline", "currentColor", "stroke-dasharray", "noise"]
        {
            assert!(svg.contains(part), "{part} is not in {svg}");
        }
        assert!(!svg.contains("NaN"));
        assert_eq!(svg.matches("<circle").count(), 4, "two points and two lines in the legend");
    }
}
