//! Colours and numbers as people read them.

use std::io::IsTerminal;
use std::time::Duration;
use tison::scene::format::Look;

/// Colours where they are welcome: on a terminal that is not dumb and without `NO_COLOR`.
#[derive(Clone, Copy, Debug)]
pub struct Style {
    colour: bool,
}

impl Style {
    /// For what goes to stderr.
    pub fn of_stderr() -> Self {
        let unwelcome = std::env::var_os("NO_COLOR").is_some_and(|v| !v.is_empty())
            || std::env::var_os("TERM").is_some_and(|t| t == "dumb");
        Self { colour: std::io::stderr().is_terminal() && !unwelcome }
    }

    /// The same for messages that the library makes.
    pub fn look(self) -> Look {
        if self.colour { Look::Coloured } else { Look::Plain }
    }

    /// Bold red.
    pub fn error(self, text: &str) -> String {
        self.paint("1;31", text)
    }

    /// Bold yellow.
    pub fn warning(self, text: &str) -> String {
        self.paint("1;33", text)
    }

    /// Bold blue, for line numbers and carets.
    pub fn margin(self, text: &str) -> String {
        self.paint("1;34", text)
    }

    fn paint(self, code: &str, text: &str) -> String {
        if self.colour { format!("\x1b[{code}m{text}\x1b[0m") } else { text.to_owned() }
    }
}

/// `1,234,567`.
pub fn grouped(n: u64) -> String {
    let digits = n.to_string();
    let mut out = String::with_capacity(digits.len() * 4 / 3);
    for (i, c) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            out.push(',');
        }
        out.push(c);
    }
    out
}

/// `1 light`, `2,000 lights`.
pub fn counted(n: u64, what: &str) -> String {
    let plural = match what.strip_suffix("ex") {
        Some(stem) if n != 1 => format!("{stem}ices"),
        _ if n != 1 => format!("{what}s"),
        _ => what.to_owned(),
    };
    format!("{} {plural}", grouped(n))
}

/// `1.5 MB`: decimal, as disks and file managers count.
pub fn bytes(n: u64) -> String {
    const UNITS: [&str; 6] = ["B", "kB", "MB", "GB", "TB", "PB"];
    let mut value = n as f64;
    let mut unit = 0;
    while value >= 999.95 && unit + 1 < UNITS.len() {
        value /= 1000.0;
        unit += 1;
    }
    if unit == 0 { format!("{n} B") } else { format!("{value:.1} {}", UNITS[unit]) }
}

/// Six digits: `0.001234`, `12.3457`, `1.23457e-5`; `infinite`; `none` for NaN.
pub fn figure(v: f64) -> String {
    const DIGITS: i32 = 6;
    if v.is_nan() {
        return "none".into();
    }
    if v.is_infinite() {
        return if v > 0.0 { "infinite".into() } else { "-infinite".into() };
    }
    let exponent = if v == 0.0 { 0 } else { v.abs().log10().floor() as i32 };
    let trimmed =
        |s: &str| if s.contains('.') { s.trim_end_matches('0').trim_end_matches('.').to_owned() } else { s.into() };
    if (-4..DIGITS).contains(&exponent) {
        return trimmed(&format!("{v:.*}", (DIGITS - 1 - exponent) as usize));
    }
    let text = format!("{v:.*e}", (DIGITS - 1) as usize);
    let (mantissa, exponent) = text.split_once('e').expect("it is written with one");
    format!("{}e{exponent}", trimmed(mantissa))
}

/// `0.123 s`, `12.3 s`, `4:05`, `2:03:04`.
pub fn seconds(s: f64) -> String {
    if s < 10.0 {
        format!("{s:.3} s")
    } else if s < 60.0 {
        format!("{s:.1} s")
    } else {
        clock(Duration::from_secs_f64(s))
    }
}

/// `0:07`, `4:05`, `2:03:04`.
pub fn clock(d: Duration) -> String {
    let s = d.as_secs_f64().round() as u64;
    let (h, m, s) = (s / 3600, s / 60 % 60, s % 60);
    if h > 0 { format!("{h}:{m:02}:{s:02}") } else { format!("{m}:{s:02}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_read_well() {
        assert_eq!(grouped(0), "0");
        assert_eq!(grouped(999), "999");
        assert_eq!(grouped(1000), "1,000");
        assert_eq!(grouped(1_234_567), "1,234,567");
        assert_eq!(counted(1, "vertex"), "1 vertex");
        assert_eq!(counted(2, "vertex"), "2 vertices");
        assert_eq!(counted(0, "light"), "0 lights");
        assert_eq!(bytes(999), "999 B");
        assert_eq!(bytes(1000), "1.0 kB");
        assert_eq!(bytes(999_999), "1.0 MB");
        assert_eq!(bytes(240_000_000_000), "240.0 GB");
        assert_eq!(seconds(0.1234), "0.123 s");
        assert_eq!(seconds(245.0), "4:05");
        assert_eq!(clock(Duration::from_secs(7384)), "2:03:04");
        assert_eq!(clock(Duration::from_millis(59_600)), "1:00");
    }

    #[test]
    fn figures_have_six_digits() {
        let cases = [
            (0.0, "0"),
            (1.0, "1"),
            (-2.5, "-2.5"),
            (12.345678, "12.3457"),
            (0.00123456789, "0.00123457"),
            (99999.96, "100000"),
            (123456.7, "123457"),
            (1234567.0, "1.23457e6"),
            (1.5e-5, "1.5e-5"),
            (100.0, "100"),
            (f64::INFINITY, "infinite"),
            (f64::NAN, "none"),
        ];
        for (v, want) in cases {
            assert_eq!(figure(v), want);
        }
    }

    #[test]
    fn no_terminal_no_colour() {
        assert_eq!(Style { colour: false }.error("error"), "error");
        assert_eq!(Style { colour: true }.error("error"), "\x1b[1;31merror\x1b[0m");
    }
}
