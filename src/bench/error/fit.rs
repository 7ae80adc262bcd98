//! Slopes on logarithmic axes, and where a curve crosses a level.

/// The least-squares slope of `log y` over `log x`; nothing for fewer than two points with different `x`.
pub fn slope(points: &[(f64, f64)]) -> Option<f64> {
    let logs: Vec<(f64, f64)> = points.iter().map(|p| (p.0.ln(), p.1.ln())).collect();
    let n = logs.len() as f64;
    let mean = |f: fn(&(f64, f64)) -> f64| logs.iter().map(f).sum::<f64>() / n;
    let (x, y) = (mean(|p| p.0), mean(|p| p.1));
    let spread: f64 = logs.iter().map(|p| (p.0 - x).powi(2)).sum();
    let slope = logs.iter().map(|p| (p.0 - x) * (p.1 - y)).sum::<f64>() / spread;
    (logs.len() > 1 && slope.is_finite()).then_some(slope)
}

/// The same of the last `count` points.
pub fn slope_of_last(points: &[(f64, f64)], count: usize) -> Option<f64> {
    slope(&points[points.len().saturating_sub(count)..])
}

/// The `x` at which falling values first reach `level`: between two points as the line that joins them on logarithmic
/// axes has it; the first point's if that is there already. Nothing if none gets so far.
pub fn reaches(points: &[(f64, f64)], level: f64) -> Option<f64> {
    let first = points.iter().position(|p| p.1 <= level)?;
    let (x1, y1) = points[first];
    let Some(&(x0, y0)) = first.checked_sub(1).map(|before| &points[before]) else { return Some(x1) };
    let share = (y0 / level).ln() / (y0 / y1).ln();
    // From a value to nothing at all there is no line.
    Some(if y1 > 0.0 { x0 * (x1 / x0).powf(share) } else { x1 })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slopes_of_powers_are_their_exponents() {
        let power = |k: f64| (0..7).map(|i| 4f64.powi(i)).map(|x| (x, 3.0 * x.powf(k))).collect::<Vec<_>>();
        for k in [-0.5, -0.66, -1.5, 0.0] {
            assert!((slope(&power(k)).expect("many points") - k).abs() < 1e-12);
        }
        let mut bent = power(-0.5);
        bent[0].1 = 100.0;
        assert!((slope_of_last(&bent, 4).expect("many points") + 0.5).abs() < 1e-12);
        assert!((slope(&bent).expect("many points") + 0.5).abs() > 0.1);
        assert_eq!(slope(&[]), None);
        assert_eq!(slope(&[(1.0, 1.0)]), None);
        assert_eq!(slope(&[(1.0, 1.0), (1.0, 2.0)]), None, "one place");
        assert!((slope_of_last(&power(-1.0)[..2], 4).expect("two points") + 1.0).abs() < 1e-12);
    }

    #[test]
    fn levels_are_found_between_points() {
        let points = [(1.0, 1.0), (100.0, 0.01), (400.0, 0.0025)];
        let at = |level| reaches(&points, level).expect("it gets there");
        assert!((at(0.1) - 10.0).abs() < 1e-9);
        assert!((at(0.005) - 200.0).abs() < 1e-9);
        assert_eq!(at(2.0), 1.0, "the first is good enough");
        assert!((at(0.0025) - 400.0).abs() < 1e-9);
        assert_eq!(reaches(&points, 0.002), None);
        assert_eq!(reaches(&[(1.0, 1.0), (4.0, 0.0)], 0.5), Some(4.0));
        assert_eq!(reaches(&[], 0.5), None);
    }
}
