//! Values of flags. Each error says what was expected, with an example.

use glam::DVec3;
use std::str::FromStr;
use std::time::Duration;

/// `WxH`, each at least 1. Wider than any image can be: the limits are checked by the plan,
/// which can say more about them.
pub fn size(s: &str) -> Result<(u64, u64), String> {
    let expected = || "expected WIDTHxHEIGHT in pixels, like 1280x720".to_owned();
    let (w, h) = s.split_once(['x', 'X']).ok_or_else(expected)?;
    let number = |n: &str| n.trim().parse::<u64>().map_err(|_| expected());
    match (number(w)?, number(h)?) {
        (0, _) | (_, 0) => Err("an image has at least 1x1 pixels".into()),
        size => Ok(size),
    }
}

/// `50%` or `0.5`.
pub fn scale(s: &str) -> Result<f64, String> {
    let (number, unit) = s.strip_suffix('%').map_or((s, 1.0), |n| (n, 0.01));
    let scale = finite(number.trim())? * unit;
    if scale > 0.0 && scale <= 100.0 { Ok(scale) } else { Err("expected more than 0% and at most 10000%".into()) }
}

/// A part of the image as typed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Region {
    /// Left, top, right, bottom in pixels; right and bottom are not part of it.
    Pixels([u64; 4]),
    /// The same as shares of the width and height.
    Shares([f64; 4]),
}

/// `x0,y0,x1,y1` in pixels, or from 0 to 1 if any of them has a dot.
pub fn region(s: &str) -> Result<Region, String> {
    let expected =
        "expected x0,y0,x1,y1 in pixels, like 100,50,300,200, or in shares with a dot, like 0.25,0.0,0.75,1.0";
    let region = if s.contains('.') {
        let shares: [f64; 4] = list(s).ok_or(expected)?;
        if !shares.iter().all(|v| (0.0..=1.0).contains(v)) {
            return Err("shares lie between 0 and 1; leave out the dots for pixels".into());
        }
        Region::Shares(shares)
    } else {
        Region::Pixels(list(s).ok_or(expected)?)
    };
    let ordered = match region {
        Region::Pixels([x0, y0, x1, y1]) => x0 < x1 && y0 < y1,
        Region::Shares([x0, y0, x1, y1]) => x0 < x1 && y0 < y1,
    };
    if ordered { Ok(region) } else { Err("nothing is inside: x0 must be less than x1 and y0 less than y1".into()) }
}

/// `x,y` in pixels.
pub fn pixel(s: &str) -> Result<(u64, u64), String> {
    let [x, y] = list(s).ok_or("expected x,y in pixels from the top left, like 640,360")?;
    Ok((x, y))
}

/// `x,y,z`, finite.
pub fn vector(s: &str) -> Result<DVec3, String> {
    let v: [f64; 3] = list(s).ok_or("expected x,y,z, like 0,1.5,-4")?;
    if v.iter().all(|c| c.is_finite()) { Ok(v.into()) } else { Err("expected finite numbers".into()) }
}

/// A vector that points somewhere.
pub fn direction(s: &str) -> Result<DVec3, String> {
    let v = vector(s)?;
    if v == DVec3::ZERO { Err("0,0,0 is no direction".into()) } else { Ok(v) }
}

/// Degrees, more than 0 and less than 180.
pub fn fov(s: &str) -> Result<f64, String> {
    let v = finite(s)?;
    if v > 0.0 && v < 180.0 { Ok(v) } else { Err("expected degrees between 0 and 180".into()) }
}

/// Degrees from 0 to 180.
pub fn angle(s: &str) -> Result<f64, String> {
    let v = finite(s)?;
    if (0.0..=180.0).contains(&v) { Ok(v) } else { Err("expected degrees from 0 to 180".into()) }
}

/// More than 0.
pub fn length(s: &str) -> Result<f64, String> {
    let v = finite(s)?;
    if v > 0.0 { Ok(v) } else { Err("expected a length greater than 0".into()) }
}

/// 0 or more.
pub fn radius(s: &str) -> Result<f64, String> {
    let v = finite(s)?;
    if v >= 0.0 { Ok(v) } else { Err("expected a radius of 0 or more".into()) }
}

/// 0 to 1.
pub fn weight(s: &str) -> Result<f32, String> {
    let v = finite(s)?;
    if (0.0..=1.0).contains(&v) { Ok(v as f32) } else { Err("expected a weight from 0 to 1".into()) }
}

/// Powers of two that floats can hold, with room to multiply.
pub fn exposure(s: &str) -> Result<f32, String> {
    let v = finite(s)?;
    if v.abs() <= 64.0 { Ok(v as f32) } else { Err("expected an exposure from -64 to 64".into()) }
}

/// 0 or more.
pub fn bound(s: &str) -> Result<f64, String> {
    let v = finite(s)?;
    if v >= 0.0 { Ok(v) } else { Err("expected 0 or more".into()) }
}

/// More than 0, less than 1.
pub fn share(s: &str) -> Result<f64, String> {
    let v = finite(s)?;
    if v > 0.0 && v < 1.0 { Ok(v) } else { Err("expected a share between 0 and 1, like 0.01".into()) }
}

/// More than 0.
pub fn error(s: &str) -> Result<f64, String> {
    let v = finite(s)?;
    if v > 0.0 { Ok(v) } else { Err("expected an error greater than 0, like 0.003".into()) }
}

/// More than 0, up to a year.
pub fn seconds(s: &str) -> Result<Duration, String> {
    const YEAR: f64 = 365.0 * 86_400.0;
    let v = finite(s)?;
    if v > 0.0 && v <= YEAR {
        Ok(Duration::from_secs_f64(v))
    } else {
        Err("expected seconds, more than 0 and at most a year".into())
    }
}

/// Pixels to a degree of the eye's field.
pub fn pixels_per_degree(s: &str) -> Result<f64, String> {
    let v = finite(s)?;
    if (1.0..=1000.0).contains(&v) { Ok(v) } else { Err("expected 1 to 1000 pixels per degree".into()) }
}

/// Bytes: `512M`, `1.5GiB`, `800MB`, or a plain number. K, M, G and T stand for powers of 1024 unless a B follows.
pub fn memory(s: &str) -> Result<u64, String> {
    const EXPECTED: &str = "expected a size like 512M, 1.5GiB, 800MB, or a number of bytes";
    let end = s.find(|c: char| c.is_ascii_alphabetic()).unwrap_or(s.len());
    let (number, unit) = (s[..end].trim(), s[end..].to_ascii_lowercase());
    let (prefix, base) = match unit.strip_suffix("ib") {
        Some(prefix) if !prefix.is_empty() => (prefix, 1024_u64),
        _ => match unit.strip_suffix('b') {
            Some(prefix) => (prefix, 1000),
            None => (&*unit, 1024),
        },
    };
    let power = match prefix {
        "" => 0,
        "k" => 1,
        "m" => 2,
        "g" => 3,
        "t" => 4,
        _ => return Err(EXPECTED.into()),
    };
    let digits = |c: char| c.is_ascii_digit() || (power > 0 && c == '.');
    let value = if number.chars().all(digits) { number.parse::<f64>().ok() } else { None };
    let bytes = value.ok_or(EXPECTED)? * base.pow(power) as f64;
    if (1.0..1e18).contains(&bytes) {
        Ok(bytes as u64)
    } else {
        Err("expected at least one byte and less than 10^18".into())
    }
}

/// `path.to.key=value`; the scene file's reader says whether there is such a key.
pub fn define(s: &str) -> Result<String, String> {
    match s.split_once('=') {
        Some((key, _)) if !key.trim().is_empty() => Ok(s.to_owned()),
        _ => Err("expected path.to.key=value, like render.samples=4".into()),
    }
}

fn finite(s: &str) -> Result<f64, String> {
    match s.parse::<f64>() {
        Ok(v) if v.is_finite() => Ok(v),
        Ok(_) => Err("expected a finite number".into()),
        Err(_) => Err("expected a number".into()),
    }
}

/// Exactly `N` values with commas between.
fn list<T: FromStr, const N: usize>(s: &str) -> Option<[T; N]> {
    let values: Option<Vec<T>> = s.split(',').map(|v| v.trim().parse().ok()).collect();
    values?.try_into().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes() {
        let cases = [
            ("1280x720", Some((1280, 720))),
            ("1X1", Some((1, 1))),
            ("100000x100000", Some((100_000, 100_000))),
            ("0x0", None),
            ("0x720", None),
            ("1280x0", None),
            ("1280", None),
            ("x", None),
            ("-5x5", None),
            ("1.5x2", None),
            ("1x2x3", None),
            ("99999999999999999999x1", None),
            ("", None),
        ];
        for (s, want) in cases {
            assert_eq!(size(s).ok(), want, "{s:?}");
        }
    }

    #[test]
    fn scales() {
        let cases =
            [("50%", Some(0.5)), ("0.5", Some(0.5)), ("200%", Some(2.0)), ("0%", None), ("-1", None), ("nan", None)];
        for (s, want) in cases {
            assert_eq!(scale(s).ok(), want, "{s:?}");
        }
        assert!(scale("101").is_err() && scale("inf%").is_err() && scale("%").is_err());
    }

    #[test]
    fn memory_sizes() {
        let cases = [
            ("512M", Some(512 << 20)),
            ("2G", Some(2 << 30)),
            ("1.5GiB", Some(3 << 29)),
            ("1.5 gib", Some(3 << 29)),
            ("800MB", Some(800_000_000)),
            ("64k", Some(64 << 10)),
            ("3kB", Some(3000)),
            ("1T", Some(1 << 40)),
            ("123456789", Some(123_456_789)),
            ("100B", Some(100)),
            ("0", None),
            ("", None),
            ("M", None),
            ("1.5", None),
            ("-1M", None),
            ("1e3M", None),
            ("nan", None),
            ("inf", None),
            ("5 bananas", None),
            ("5iB", None),
            ("1..5G", None),
            ("99999999T", None),
            ("1MiBi", None),
        ];
        for (s, want) in cases {
            assert_eq!(memory(s).ok(), want, "{s:?}");
        }
        assert!(memory("much").unwrap_err().contains("512M"));
    }

    #[test]
    fn regions() {
        let cases = [
            ("0,0,10,20", Some(Region::Pixels([0, 0, 10, 20]))),
            ("0.25,0,0.75,1", Some(Region::Shares([0.25, 0.0, 0.75, 1.0]))),
            ("10,0,10,20", None),
            ("10,0,5,20", None),
            ("0.5,0.5,0.5,1.0", None),
            ("0.0,0.0,2.0,1.0", None),
            ("nan.,0,1,1", None),
            ("-1,0,5,5", None),
            ("1,2,3", None),
            ("1,2,3,4,5", None),
            ("a,b,c,d", None),
        ];
        for (s, want) in cases {
            assert_eq!(region(s).ok(), want, "{s:?}");
        }
    }

    #[test]
    fn vectors() {
        assert_eq!(vector("-1,2,-3e2"), Ok(DVec3::new(-1.0, 2.0, -300.0)));
        assert_eq!(vector(" 1 , 2 , 3 "), Ok(DVec3::new(1.0, 2.0, 3.0)));
        for s in ["1,2", "1,2,3,4", "inf,0,0", "nan,0,0", "1e400,0,0", "", "1;2;3", "1,,3"] {
            assert!(vector(s).is_err(), "{s:?}");
        }
        assert!(direction("0,-0,0").is_err());
        assert!(direction("0,0,1e-300").is_ok());
    }

    #[test]
    fn ranges() {
        assert!(fov("0").is_err() && fov("180").is_err() && fov("179.9").is_ok());
        assert!(angle("0").is_ok() && angle("180").is_ok() && angle("-1").is_err());
        assert!(length("0").is_err() && length("1e-9").is_ok() && length("inf").is_err());
        assert!(radius("0").is_ok() && radius("-0.1").is_err());
        assert_eq!(weight("0.0009765625"), Ok(1.0 / 1024.0));
        assert!(weight("1.1").is_err() && weight("nan").is_err());
        assert_eq!(exposure("-1.5"), Ok(-1.5));
        assert!(exposure("64").is_ok() && exposure("65").is_err() && exposure("nan").is_err());
        assert!(bound("0").is_ok() && bound("-1").is_err() && bound("nan").is_err() && bound("inf").is_err());
        assert!(share("0.01").is_ok() && share("0").is_err() && share("1").is_err() && share("nan").is_err());
        assert!(error("3e-3").is_ok() && error("0").is_err() && error("-1").is_err() && error("inf").is_err());
        assert_eq!(seconds("2.5"), Ok(Duration::from_millis(2500)));
        assert!(seconds("0").is_err() && seconds("-1").is_err() && seconds("1e30").is_err() && seconds("nan").is_err());
        assert!(pixels_per_degree("67").is_ok() && pixels_per_degree("0.9").is_err());
        assert!(define("a.b=1").is_ok() && define("a.b=").is_ok());
        assert!(define("a.b").is_err() && define("=1").is_err() && define("").is_err());
        assert_eq!(pixel("3,4"), Ok((3, 4)));
        assert!(pixel("3").is_err() && pixel("-1,0").is_err());
    }
}
