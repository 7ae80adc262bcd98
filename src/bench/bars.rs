//! Bars as SVG that stands inside of a page: lengths from one value in both directions, a name before each, a word behind.

use super::plot::escaped;
use std::fmt::Write;

/// Values side by side.
#[derive(Clone, Debug)]
pub struct Bars {
    /// Above them.
    pub title: String,
    /// Where the bars begin: what says nothing.
    pub from: f64,
    /// What is drawn, from above.
    pub bars: Vec<Bar>,
}

/// One of them.
#[derive(Clone, Debug)]
pub struct Bar {
    /// Before it.
    pub name: String,
    /// Where it ends.
    pub value: f64,
    /// Behind it.
    pub label: String,
}

/// Of a letter, about.
const LETTER: f64 = 6.6;
const TOP: f64 = 34.0;
const STEP: f64 = 20.0;
const THICK: f64 = 13.0;
/// From the least value to the largest.
const WIDTH: f64 = 420.0;
/// Above and below where bars begin: green and red, as dark as they are light.
const COLOURS: [&str; 2] = ["#3a9d5d", "#d1495b"];

impl Bars {
    /// An `svg` element.
    #[must_use]
    pub fn svg(&self) -> String {
        let wide = |of: fn(&Bar) -> &str| self.bars.iter().map(|b| of(b).chars().count()).max().unwrap_or(0) as f64;
        let left = LETTER * wide(|b| &b.name) + 16.0;
        let width = left + WIDTH + LETTER * wide(|b| &b.label) + 20.0;
        let height = TOP + STEP * self.bars.len() as f64 + 10.0;
        let mut out = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width:.0} {height}\" width=\"{width:.0}\" \
             height=\"{height}\" role=\"img\" font-family=\"sans-serif\" font-size=\"12\" fill=\"currentColor\">\n"
        );
        self.write(&mut out, left).expect("a string takes everything");
        out += "</svg>\n";
        out
    }

    fn write(&self, out: &mut String, left: f64) -> std::fmt::Result {
        let finite = || self.bars.iter().map(|b| b.value).filter(|v| v.is_finite()).chain([self.from]);
        let (least, most) = (finite().fold(f64::INFINITY, f64::min), finite().fold(f64::NEG_INFINITY, f64::max));
        let scale = if most > least { WIDTH / (most - least) } else { 0.0 };
        let at = |value: f64| left + (value - least) * scale;
        writeln!(out, "<text x=\"{left:.1}\" y=\"18\" font-weight=\"bold\">{}</text>", escaped(&self.title))?;
        for (i, bar) in self.bars.iter().enumerate() {
            let top = TOP + STEP * i as f64;
            let base = top + 0.8 * THICK;
            let value = if bar.value.is_finite() { bar.value } else { self.from };
            let (from, to) = (at(self.from.min(value)), at(self.from.max(value)));
            writeln!(
                out,
                "<text x=\"{:.1}\" y=\"{base:.1}\" text-anchor=\"end\">{}</text>",
                left - 8.0,
                escaped(&bar.name)
            )?;
            writeln!(
                out,
                "<rect x=\"{from:.1}\" y=\"{top:.1}\" width=\"{:.1}\" height=\"{THICK}\" fill=\"{}\"/>",
                (to - from).max(1.0),
                COLOURS[usize::from(value < self.from)]
            )?;
            writeln!(out, "<text x=\"{:.1}\" y=\"{base:.1}\">{}</text>", to + 6.0, escaped(&bar.label))?;
        }
        let (x, bottom) = (at(self.from), TOP + STEP * self.bars.len() as f64);
        writeln!(
            out,
            "<line x1=\"{x:.1}\" y1=\"{:.1}\" x2=\"{x:.1}\" y2=\"{bottom:.1}\" stroke=\"currentColor\"/>",
            TOP - 4.0
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bar(name: &str, value: f64) -> Bar {
        Bar { name: name.into(), value, label: format!("{value:.2}") }
    }

    /// Left ends and widths of the bars.
    fn rects(svg: &str) -> Vec<(f64, f64)> {
        let number = |line: &str, key: &str| {
            let rest = line.split_once(&format!(" {key}=\"")).expect("it has one").1;
            rest.split_once('"').expect("it ends").0.parse().expect("a number")
        };
        svg.lines().filter(|l| l.starts_with("<rect")).map(|l| (number(l, "x"), number(l, "width"))).collect()
    }

    #[test]
    fn bars_go_both_ways_from_where_they_begin() {
        let bars =
            Bars { title: "a < b".into(), from: 1.0, bars: vec![bar("x", 3.0), bar("y & z", 0.5), bar("w", 1.0)] };
        let svg = bars.svg();
        let rects = rects(&svg);
        assert!((rects[0].1 - 0.8 * WIDTH).abs() < 0.1 && (rects[1].1 - 0.2 * WIDTH).abs() < 0.1, "{rects:?}");
        assert!((rects[1].0 + rects[1].1 - rects[0].0).abs() < 0.2, "both begin at one line");
        assert!(rects[2].1 <= 1.0);
        for part in ["a &lt; b", "y &amp; z", "3.00", COLOURS[0], COLOURS[1]] {
            assert!(svg.contains(part), "{part} is not in {svg}");
        }
    }

    #[test]
    fn nothing_and_what_is_not_finite_are_drawn_without_harm() {
        for bars in
            [vec![], vec![bar("x", f64::NAN)], vec![bar("x", 1.0)], vec![bar("x", f64::INFINITY), bar("y", 2.0)]]
        {
            let svg = Bars { title: String::new(), from: 1.0, bars }.svg();
            let rects = rects(&svg);
            assert!(rects.iter().all(|r| r.0.is_finite() && r.1.is_finite()), "{svg}");
        }
    }
}
