//! A power that compiles to vector code in a loop over lanes.

/// `x^y` for `x` in `[0, 1]` and `y >= 0`; `0^0 = 1`, as `powf` has it.
///
/// * error: at most `3e-14 + 4e-13 y` relative, and 0 where the result is below 1e-300;
///   for a Blinn-Phong exponent of 1000 that is a hundredth of an f32 ulp
/// * range: anything else gives an unspecified number
///
/// `log2` by the series of `atanh` around 1 (R. Brent, P. Zimmermann, "Modern Computer
/// Arithmetic", section 4.4) over `[1/√2, √2]`, `exp2` by its Taylor series over `[-1/2, 1/2]`;
/// no branch, no call, no table.
#[inline(always)]
#[must_use]
pub fn pow01(x: f64, y: f64) -> f64 {
    // Also keeps 0 * log2(0) from being NaN.
    let log = log2(x.max(f64::MIN_POSITIVE));
    exp2((y * log).max(-1022.0)) * if x <= 0.0 && y > 0.0 { 0.0 } else { 1.0 }
}

/// Binary logarithm of a normal positive number, within 3e-13.
#[inline(always)]
fn log2(x: f64) -> f64 {
    // The exponent of x * √2 is that of the power of two nearest to x.
    let shifted = (x * std::f64::consts::SQRT_2).to_bits() >> 52;
    let m = f64::from_bits(x.to_bits().wrapping_sub(shifted << 52).wrapping_add(1023 << 52));
    // An integer below 2^52 put into the mantissa of 2^52.
    let e = f64::from_bits(shifted | TWO_52.to_bits()) - (TWO_52 + 1023.0);
    let z = (m - 1.0) / (m + 1.0);
    let s = z * z;
    let series = 1.0
        + s * (1.0 / 3.0
            + s * (1.0 / 5.0 + s * (1.0 / 7.0 + s * (1.0 / 9.0 + s * (1.0 / 11.0 + s * (1.0 / 13.0 + s / 15.0))))));
    e + z * series * (2.0 * std::f64::consts::LOG2_E)
}

/// `2^y` for `y` in `[-1022, 0]`, within 2e-14 relative.
#[inline(always)]
fn exp2(y: f64) -> f64 {
    // Adding 1.5 * 2^52 rounds to an integer and leaves it in the low bits.
    let shifted = y + 1.5 * TWO_52;
    let n = shifted - 1.5 * TWO_52;
    let f = (y - n) * std::f64::consts::LN_2;
    let power = f64::from_bits(shifted.to_bits().wrapping_add(1023) << 52);
    let tail = f * (1.0 / 362_880.0 + f * (1.0 / 3_628_800.0 + f / 39_916_800.0));
    let tail = f * (1.0 / 720.0 + f * (1.0 / 5040.0 + f * (1.0 / 40_320.0 + tail)));
    power * (1.0 + f * (1.0 + f * (0.5 + f * (1.0 / 6.0 + f * (1.0 / 24.0 + f * (1.0 / 120.0 + tail))))))
}

const TWO_52: f64 = 4_503_599_627_370_496.0;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn close_to_the_library_s_power() {
        let mut worst = 0f64;
        for i in 0..=20_000 {
            let x = f64::from(i) / 20_000.0;
            for x in [x, 1.0 - (1.0 - x) * 1e-4, x * 1e-10] {
                for y in [0.0, 1e-3, 0.5, 1.0, 2.0, 10.0, 77.7, 1000.0, 1e6] {
                    let (got, want) = (pow01(x, y), x.powf(y));
                    if want < 1e-300 {
                        assert!(got < 1e-299, "{x}^{y} = {got:e}");
                        continue;
                    }
                    let error = (got / want - 1.0).abs();
                    assert!(error <= 3e-14 + 4e-13 * y, "{x}^{y} = {got:e}, off by {error:e}");
                    worst = worst.max(error / (1.0 + y));
                }
            }
        }
        assert!(worst > 0.0);
    }

    #[test]
    fn edges() {
        assert_eq!(pow01(0.0, 0.0), 1.0);
        assert_eq!(pow01(0.0, 5.0), 0.0);
        assert_eq!(pow01(0.0, 1e-3), 0.0);
        assert_eq!(pow01(1.0, 1e6), 1.0);
        assert_eq!(pow01(0.3, 0.0), 1.0);
        assert!((pow01(0.5, 3.0) - 0.125).abs() < 1e-14);
    }
}
