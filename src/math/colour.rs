//! Linear light to 8-bit sRGB, exactly and quickly.
//!
//! The curve is the piecewise one of IEC 61966-2-1: `12.92 x` up to 0.0031308 and
//! `1.055 x^(1/2.4) - 0.055` above. A pixel's byte is `255 srgb(x)`, rounded half to even.

use super::pow01;
use std::sync::LazyLock;

/// The sRGB curve on `[0, 1]`; what is outside is clamped, NaN is 0.
#[must_use]
pub fn srgb(linear: f64) -> f64 {
    if linear.is_nan() || linear <= 0.0 {
        0.0
    } else if linear <= 0.003_130_8 {
        12.92 * linear
    } else if linear < 1.0 {
        1.055 * linear.powf(1.0 / 2.4) - 0.055
    } else {
        1.0
    }
}

/// The inverse of [`srgb`] on `[0, 1]`.
#[must_use]
pub fn linear(srgb: f64) -> f64 {
    if srgb <= 0.040_45 { srgb / 12.92 } else { ((srgb + 0.055) / 1.055).powf(2.4) }
}

/// [`srgb`] of numbers in `[0, 1]`, within 1e-13, in a loop that compiles to vector code.
#[inline(always)]
pub fn srgb_of_all(values: &mut [f64]) {
    for v in values {
        let curved = 1.055 * pow01(*v, 1.0 / 2.4) - 0.055;
        *v = if *v <= 0.003_130_8 { 12.92 * *v } else { curved };
    }
}

/// [`linear`] of numbers in `[0, 1]`, within 1e-12, in a loop that compiles to vector code.
#[inline(always)]
pub fn linear_of_all(values: &mut [f64]) {
    for v in values {
        let curved = pow01((*v + 0.055) / 1.055, 2.4);
        *v = if *v <= 0.040_45 { *v / 12.92 } else { curved };
    }
}

/// Linear light of every sRGB byte.
#[must_use]
pub fn linear_of_srgb8() -> &'static [f32; 256] {
    static TABLE: LazyLock<[f32; 256]> = LazyLock::new(|| std::array::from_fn(|i| linear(i as f64 / 255.0) as f32));
    &TABLE
}

/// The byte by the formula: slow, and what [`Srgb8`] is tested against.
#[must_use]
pub fn srgb8_by_formula(linear: f32) -> u8 {
    // 0..=255 after the clamp, so nothing is lost.
    (255.0 * srgb(f64::from(linear))).round_ties_even() as u8
}

/// Bits of the mantissa that choose a bucket: with 7, no bucket holds two steps of the curve
/// (they are closest near 0.5, 0.0060 apart, where a bucket is 0.0039 wide).
const MANTISSA_BITS: u32 = 7;
const SHIFT: u32 = 23 - MANTISSA_BITS;
/// 2^-13 is below the first step (0.000152): what is smaller is black.
const LEAST_BITS: u32 = (127 - 13) << 23;
const ONE_BITS: u32 = 127 << 23;
const BUCKETS: usize = ((ONE_BITS - LEAST_BITS) >> SHIFT) as usize;

/// [`srgb8_by_formula`] by table: one look-up and one comparison, same answer for every `f32`.
#[derive(Clone, Debug)]
pub struct Srgb8 {
    /// Byte at the low end of each bucket.
    start: [u8; BUCKETS],
    /// `step[k]`: least input whose byte is `k + 1`; the last is infinity.
    step: [f32; 256],
}

impl Srgb8 {
    /// The table, made at the first call.
    #[must_use]
    pub fn table() -> &'static Self {
        static TABLE: LazyLock<Srgb8> = LazyLock::new(Srgb8::new);
        &TABLE
    }

    fn new() -> Self {
        let step = std::array::from_fn(|k| if k < 255 { least_input_of(k as u8 + 1) } else { f32::INFINITY });
        let start = std::array::from_fn(|i| srgb8_by_formula(f32::from_bits(LEAST_BITS + ((i as u32) << SHIFT))));
        Self { start, step }
    }

    /// The byte of one channel.
    #[inline]
    #[must_use]
    pub fn byte(&self, linear: f32) -> u8 {
        if linear >= 1.0 {
            255
        } else if linear >= f32::from_bits(LEAST_BITS) {
            let low = self.start[((linear.to_bits() - LEAST_BITS) >> SHIFT) as usize];
            low + u8::from(linear >= self.step[usize::from(low)])
        } else {
            // Negative and NaN too: they compare false with everything above.
            0
        }
    }

    /// The bytes of one pixel.
    #[inline]
    #[must_use]
    pub fn rgb(&self, linear: [f32; 3]) -> [u8; 3] {
        linear.map(|c| self.byte(c))
    }
}

/// Least `f32` that the formula turns into at least `byte` (1..=255).
fn least_input_of(byte: u8) -> f32 {
    let level = (f64::from(byte) - 0.5) / 255.0;
    let mut x = linear(level) as f32;
    while srgb8_by_formula(x) < byte {
        x = x.next_up();
    }
    while srgb8_by_formula(x.next_down()) >= byte {
        x = x.next_down();
    }
    x
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_step_of_the_curve_is_where_the_formula_has_it() {
        let table = Srgb8::table();
        for byte in 1..=255u8 {
            let mut x = least_input_of(byte);
            assert_eq!(srgb8_by_formula(x), byte, "at the step to {byte}");
            assert_eq!(srgb8_by_formula(x.next_down()), byte - 1, "just below the step to {byte}");
            for _ in 0..4 {
                x = x.next_down();
            }
            for _ in 0..9 {
                assert_eq!(table.byte(x), srgb8_by_formula(x), "{x:e}");
                x = x.next_up();
            }
        }
    }

    #[test]
    fn table_and_formula_agree_over_all_magnitudes() {
        let table = Srgb8::table();
        // A prime stride through all bit patterns, signs, infinities and NaN included.
        for bits in (0..=u32::MAX).step_by(65_537) {
            let x = f32::from_bits(bits);
            assert_eq!(table.byte(x), srgb8_by_formula(x), "{x:e}");
        }
    }

    #[test]
    fn both_ends_and_what_is_no_colour() {
        let cases = [
            ("zero", 0.0, 0),
            ("minus zero", -0.0, 0),
            ("negative", -1.0, 0),
            ("smallest", f32::from_bits(1), 0),
            ("least of the table", f32::from_bits(LEAST_BITS), 0),
            ("middle grey", 0.214_041_14, 128),
            ("just below one", 1.0f32.next_down(), 255),
            ("one", 1.0, 255),
            ("bright", 7.0, 255),
            ("infinity", f32::INFINITY, 255),
            ("minus infinity", f32::NEG_INFINITY, 0),
            ("NaN", f32::NAN, 0),
            ("minus NaN", -f32::NAN, 0),
        ];
        for (name, x, want) in cases {
            assert_eq!(Srgb8::table().byte(x), want, "{name}");
        }
    }

    #[test]
    fn loops_give_what_the_formulas_give() {
        let shares: Vec<f64> = (0..=10_000).map(|i| f64::from(i) / 10_000.0).collect();
        let (mut curved, mut straight) = (shares.clone(), shares.clone());
        srgb_of_all(&mut curved);
        linear_of_all(&mut straight);
        for (i, &x) in shares.iter().enumerate() {
            assert!((curved[i] - srgb(x)).abs() < 1e-13, "{x}");
            assert!((straight[i] - linear(x)).abs() < 1e-12, "{x}");
        }
    }

    #[test]
    fn no_bucket_holds_two_steps() {
        let table = Srgb8::table();
        for i in 0..BUCKETS - 1 {
            assert!(table.start[i + 1] - table.start[i] <= 1, "bucket {i}");
        }
    }

    #[test]
    fn bytes_survive_the_way_back() {
        for byte in 0..=255u8 {
            let linear = linear_of_srgb8()[usize::from(byte)];
            assert_eq!(Srgb8::table().byte(linear), byte);
            assert!((srgb(f64::from(linear)) - f64::from(byte) / 255.0).abs() < 1e-7);
        }
    }
}
