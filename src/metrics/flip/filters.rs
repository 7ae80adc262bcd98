//! The filters, each the product of a row and a column.

use std::f64::consts::PI;

/// Every filter has `2 radius + 1` taps.
#[derive(Clone, Debug)]
pub struct Filters {
    /// Pixels that a filter reaches to each side.
    pub radius: usize,
    /// Contrast sensitivity to light and dark.
    pub achromatic: Vec<f64>,
    /// To red and green.
    pub red_green: Vec<f64>,
    /// To blue and yellow: two filters and the share of each.
    pub blue_yellow: [(f64, Vec<f64>); 2],
    /// The Gaussian across the direction of a feature.
    pub smooth: Vec<f64>,
    /// Its first derivative finds edges.
    pub slope: Vec<f64>,
    /// Its second derivative finds points and lines.
    pub bend: Vec<f64>,
}

/// Contrast sensitivities are sums of `a sqrt(π/b) exp(-π² x² / b)`, x in degrees.
const ACHROMATIC: f64 = 0.0047;
const RED_GREEN: f64 = 0.0053;
const BLUE_YELLOW: [(f64, f64); 2] = [(34.1, 0.04), (13.5, 0.025)];
/// Width in degrees of what counts as a feature.
const FEATURE: f64 = 0.082;

impl Filters {
    /// For so many pixels to a degree.
    pub fn new(pixels_per_degree: f64) -> Self {
        let sigma = 0.5 * FEATURE * pixels_per_degree;
        // Three standard deviations of the widest; the others reach zero in it.
        let widest = 3.0 * (BLUE_YELLOW[0].1 / (2.0 * PI * PI)).sqrt() * pixels_per_degree;
        let colours = widest.ceil();
        let features = (3.0 * sigma).ceil();
        let radius = colours.max(features) as usize;
        let taps = |reach: f64, weight: &dyn Fn(f64) -> f64| -> Vec<f64> {
            let at = |i: usize| i as f64 - radius as f64;
            (0..=2 * radius).map(|i| if at(i).abs() <= reach { weight(at(i)) } else { 0.0 }).collect()
        };
        let blur = |b: f64| taps(colours, &|x| (-(PI * x / pixels_per_degree).powi(2) / b).exp());
        let gauss = |x: f64| (-0.5 * (x / sigma).powi(2)).exp();
        Self {
            radius,
            achromatic: to_one(blur(ACHROMATIC)),
            red_green: to_one(blur(RED_GREEN)),
            blue_yellow: blue_yellow(blur),
            smooth: to_one(taps(features, &gauss)),
            slope: signs_to_one(taps(features, &|x| -x * gauss(x))),
            bend: signs_to_one(taps(features, &|x| ((x / sigma).powi(2) - 1.0) * gauss(x))),
        }
    }
}

/// Both parts together sum to 1.
fn blue_yellow(blur: impl Fn(f64) -> Vec<f64>) -> [(f64, Vec<f64>); 2] {
    let parts = BLUE_YELLOW.map(|(a, b)| {
        let taps = blur(b);
        let sum: f64 = taps.iter().sum();
        (a * (PI / b).sqrt() * sum * sum, to_one(taps))
    });
    let sum = parts[0].0 + parts[1].0;
    parts.map(|(weight, taps)| (weight / sum, taps))
}

fn to_one(taps: Vec<f64>) -> Vec<f64> {
    let sum: f64 = taps.iter().sum();
    taps.into_iter().map(|t| t / sum).collect()
}

/// Positive taps sum to 1, negative ones to -1.
fn signs_to_one(taps: Vec<f64>) -> Vec<f64> {
    let of_sign = |sign: f64| taps.iter().map(|t| (t * sign).max(0.0)).sum::<f64>();
    let (above, below) = (of_sign(1.0), of_sign(-1.0));
    taps.iter().map(|t| if *t < 0.0 { t / below } else { t / above }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_each_sums_to() {
        for ppd in [1.0, 5.0, 20.0, 67.0, 300.0] {
            let f = Filters::new(ppd);
            let sum = |taps: &[f64]| {
                assert_eq!(taps.len(), 2 * f.radius + 1);
                taps.iter().sum::<f64>()
            };
            let [near, far] = &f.blue_yellow;
            for taps in [&f.achromatic, &f.red_green, &near.1, &far.1, &f.smooth] {
                assert!((sum(taps) - 1.0).abs() < 1e-12, "{ppd}");
            }
            assert!((near.0 + far.0 - 1.0).abs() < 1e-12, "{ppd}");
            for taps in [&f.slope, &f.bend] {
                assert!(sum(taps).abs() < 1e-12, "{ppd}");
                assert!((taps.iter().map(|t| t.abs()).sum::<f64>() - 2.0).abs() < 1e-12, "{ppd}");
            }
        }
        assert_eq!(Filters::new(67.0).radius, 10);
    }
}
