//! The frame a mesh is stored in: near its own origin, of size about one.

use glam::DVec3;

/// Where stored coordinates lie in the world: `world = origin + stored * 2^exponent`.
///
/// Subtracting an origin in f64 before rounding to f32 keeps map coordinates exact, and a
/// power of two changes no bit of a mantissa.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// Point that is stored as zero, world units.
    pub origin: DVec3,
    /// Power of two of one stored unit, in world units; within `-1000..=1000`.
    pub exponent: i32,
}

impl Default for Frame {
    fn default() -> Self {
        Self::IDENTITY
    }
}

impl Frame {
    /// Stored coordinates are world coordinates.
    pub const IDENTITY: Self = Self { origin: DVec3::ZERO, exponent: 0 };

    /// World length of one stored unit, `2^exponent`.
    #[must_use]
    pub fn world_per_local(&self) -> f64 {
        power_of_two(self.exponent)
    }

    /// `1 / world_per_local()`, exactly.
    #[must_use]
    pub fn local_per_world(&self) -> f64 {
        power_of_two(-self.exponent)
    }

    /// World point to stored point, not yet rounded to f32. Only the subtraction rounds.
    #[inline]
    #[must_use]
    pub fn to_local(&self, world: DVec3) -> DVec3 {
        (world - self.origin) * self.local_per_world()
    }

    /// Stored point to world point. Only the addition rounds.
    #[inline]
    #[must_use]
    pub fn to_world(&self, local: DVec3) -> DVec3 {
        self.origin + local * self.world_per_local()
    }

    /// A frame for points of which `sample` is typical: the sample ends up within `[-1, 1]`,
    /// but for points a thousand times as far away as most.
    ///
    /// The origin is the middle of the box that holds the inner 7/8 of the sample, axis by
    /// axis, so that a few stray points do not move it away from where the detail is. It
    /// is a multiple of a power of two near 1/16 of that box, so that subtracting it from
    /// a coordinate written with a few digits is exact. All coordinates must be finite and
    /// below 1e300. An empty sample gives [`IDENTITY`](Self::IDENTITY).
    #[must_use]
    pub fn fit(sample: &[DVec3]) -> Self {
        if sample.is_empty() {
            return Self::IDENTITY;
        }
        let trim = if sample.len() < 3 { 0 } else { (sample.len() / 16).max(1) };
        let (lo, hi) = quantile_box(sample, trim);
        let (middle, mut spread) = (0.5 * lo + 0.5 * hi, (hi - lo).max_element());
        if spread == 0.0 {
            let (lo, hi) = quantile_box(sample, 0);
            spread = (hi - lo).max_element();
        }
        // All points in one place leave nothing to measure by: keep 20 bits of the place.
        let step = match floor_log2(spread) {
            Some(k) => k - 4,
            None => floor_log2(middle.abs().max_element()).map_or(0, |k| k - 20),
        };
        let (grid, inverse) = (power_of_two(step), power_of_two(-step));
        let origin = DVec3::from_array(middle.to_array().map(|x| {
            let snapped = (x * inverse).round() * grid;
            if snapped.is_finite() { snapped } else { x }
        }));
        let reach = sample.iter().fold(0.0, |m: f64, &p| m.max((p - origin).abs().max_element()));
        let typical = if spread > 0.0 { reach.min(1024.0 * spread) } else { reach };
        Self { origin, exponent: 0 }.rescaled(typical)
    }

    /// A frame for things of different sizes, each given by its middle and half its size (above 0),
    /// that together fill the box from `lo` to `hi`.
    ///
    /// The origin is where the sum of all distances to the middles, each in sizes of its thing, is
    /// least, axis by axis: a coordinate of a thing then keeps the most digits of its size,
    /// and neither a floor nor a sky moves the origin away from what stands on it. Everything ends up within
    /// `[-1, 1]`, but for what is a thousand times as far away as things are on average, weighed
    /// likewise. No things give [`IDENTITY`](Self::IDENTITY).
    #[must_use]
    pub fn around(things: &[(DVec3, f64)], (lo, hi): (DVec3, DVec3)) -> Self {
        /// Far things shrink the others at most so much: f32 has room for more.
        const SHRINK: f64 = 1.0 / (1 << 30) as f64;
        let Some(least) = things.iter().map(|t| t.1).reduce(f64::min) else { return Self::IDENTITY };
        let weights: Vec<f64> = things.iter().map(|t| least / t.1).collect();
        let origin = DVec3::from_array([0, 1, 2].map(|axis| weighted_median(things, &weights, axis)));
        let distance = |t: &(DVec3, f64)| (t.0 - origin).abs().max_element() + t.1;
        let sum: f64 = things.iter().zip(&weights).map(|(t, w)| w * distance(t)).sum();
        let reach = (lo - origin).abs().max((hi - origin).abs()).max_element();
        let typical = reach.min(1024.0 * sum / weights.iter().sum::<f64>());
        Self { origin, exponent: 0 }.rescaled(typical.max(SHRINK * reach))
    }

    /// The same origin, and the exponent that brings a stored length of `reach` to
    /// `[0.5, 1)`. Keeps the frame as it is when `reach` is zero or not finite.
    #[must_use]
    pub fn rescaled(&self, reach: f64) -> Self {
        let by = floor_log2(reach).map_or(0, |k| k + 1);
        Self { origin: self.origin, exponent: (self.exponent + by).clamp(-EXTREME, EXTREME) }
    }
}

/// Largest exponent either way: leaves `2^x` and `2^-x` normal numbers with room to spare.
const EXTREME: i32 = 1000;

/// `2^k`, `k` clamped to the exponents of normal numbers.
fn power_of_two(k: i32) -> f64 {
    let biased = (k.clamp(-1022, 1023) + 1023) as u64;
    f64::from_bits(biased << 52)
}

/// `floor(log2 |x|)`; -1023 for subnormal `x`, nothing for zero, NaN and infinity.
fn floor_log2(x: f64) -> Option<i32> {
    (x != 0.0 && x.is_finite()).then(|| ((x.to_bits() >> 52) & 0x7ff) as i32 - 1023)
}

/// Box of `points` without the `trim` least and greatest coordinates of each axis.
fn quantile_box(points: &[DVec3], trim: usize) -> (DVec3, DVec3) {
    let (mut lo, mut hi) = (DVec3::ZERO, DVec3::ZERO);
    for axis in 0..3 {
        let mut x: Vec<f64> = points.iter().map(|p| p[axis]).collect();
        lo[axis] = *x.select_nth_unstable_by(trim, f64::total_cmp).1;
        let last = x.len() - 1 - trim;
        hi[axis] = *x.select_nth_unstable_by(last, f64::total_cmp).1;
    }
    (lo, hi)
}

/// The coordinate with half of the weight on either side; in the middle where two serve.
fn weighted_median(things: &[(DVec3, f64)], weights: &[f64], axis: usize) -> f64 {
    let mut order: Vec<(f64, f64)> = things.iter().zip(weights).map(|(t, &w)| (t.0[axis], w)).collect();
    order.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
    let half = 0.5 * order.iter().map(|o| o.1).sum::<f64>();
    let mut below = 0.0;
    let mut sums = order.iter().map(|&(x, w)| {
        below += w;
        (x, below)
    });
    let last = order.last().map_or(0.0, |o| o.0);
    let (low, sum) = sums.find(|&(_, sum)| sum >= half).unwrap_or((last, f64::INFINITY));
    let high = if sum > half { low } else { sums.next().map_or(last, |(x, _)| x) };
    0.5 * low + 0.5 * high
}

#[cfg(test)]
mod tests {
    use super::*;

    fn around(things: &[(DVec3, f64)]) -> Frame {
        let lo = things.iter().fold(DVec3::INFINITY, |lo, t| lo.min(t.0 - t.1));
        let hi = things.iter().fold(DVec3::NEG_INFINITY, |hi, t| hi.max(t.0 + t.1));
        Frame::around(things, (lo, hi))
    }

    #[test]
    fn small_things_hold_the_origin() {
        let at = DVec3::new(500_000.3, 4_649_776.2, 112.9);
        let ball = (at, 1.0);
        assert_eq!(around(&[ball]), Frame { origin: at, exponent: 1 });
        // A floor that lies to one side, and a sky around it all.
        let (floor, sky) = ((at + DVec3::new(5e4, -1.0, 5e4), 5e4), (DVec3::ZERO, 1e9));
        for things in [vec![ball, floor], vec![floor, ball, sky]] {
            let frame = around(&things);
            assert_eq!(frame.origin, at);
            assert!((8..=16).contains(&frame.exponent), "{}", frame.exponent);
        }
        let pair = around(&[(DVec3::X, 1.0), (3.0 * DVec3::X, 1.0)]);
        assert_eq!(pair, Frame { origin: 2.0 * DVec3::X, exponent: 2 });
    }

    #[test]
    fn any_size_is_brought_to_about_one() {
        for size in [1e-300, 1e-30, 1.0, 1e30, 1e299] {
            let things: Vec<_> = grid(DVec3::splat(size), size).into_iter().map(|p| (p, 0.05 * size)).collect();
            let frame = around(&things);
            let reach = things.iter().map(|t| frame.to_local(t.0).abs().max_element()).fold(0.0, f64::max);
            assert!((0.25..=1.0).contains(&reach), "size {size:e}: {reach}");
        }
        // The smallest of all does not decide alone.
        let frame = around(&[(DVec3::ZERO, 1e-200), (DVec3::ZERO, 1e100)]);
        assert!(frame.to_local(DVec3::splat(1e100)).x <= 2f64.powi(30));
        assert_eq!(Frame::around(&[], (DVec3::INFINITY, DVec3::NEG_INFINITY)), Frame::IDENTITY);
    }

    fn grid(at: DVec3, size: f64) -> Vec<DVec3> {
        (0..1000)
            .map(|i| at + size / 9.0 * DVec3::new((i % 10) as f64, (i / 10 % 10) as f64, (i / 100) as f64))
            .collect()
    }

    #[test]
    fn a_fitted_sample_has_size_about_one_at_any_scale_and_place() {
        for size in [1e-300, 1e-30, 1e-6, 1.0, 3.7, 1e6, 1e30, 1e299] {
            for offset in [0.0, 1.0, -1e6] {
                let points = grid(DVec3::new(offset, 0.5, -offset) * size, size);
                let frame = Frame::fit(&points);
                let reach = points.iter().map(|&p| frame.to_local(p).abs().max_element()).fold(0.0, f64::max);
                assert!((0.25..=1.0).contains(&reach), "size {size:e}, offset {offset}: {reach}");
                for p in points {
                    let back = frame.to_world(frame.to_local(p));
                    assert!((back - p).abs().max_element() <= 1e-9 * size, "{p} came back as {back}");
                }
            }
        }
    }

    #[test]
    fn the_origin_has_few_bits() {
        let frame = Frame::fit(&grid(DVec3::new(500_000.37, 4_649_776.22, 112.9), 1000.0));
        assert_eq!(frame.origin, frame.origin.map(|x| (x / 32.0).round() * 32.0));
        assert!((frame.origin - DVec3::new(500_500.37, 4_650_276.22, 612.9)).abs().max_element() <= 64.0);
    }

    #[test]
    fn stray_points_do_not_move_the_origin() {
        let mut points = grid(DVec3::splat(1e6), 1.0);
        points.extend([DVec3::ZERO, DVec3::splat(1e30)]);
        let frame = Frame::fit(&points);
        assert!((frame.origin - DVec3::splat(1e6 + 0.5)).abs().max_element() < 0.1, "{}", frame.origin);
        let detail = frame.to_local(DVec3::splat(1e6));
        assert!(detail.abs().max_element() > 1e-4, "{detail}");
    }

    #[test]
    fn points_in_one_place_and_no_points() {
        assert_eq!(Frame::fit(&[]), Frame::IDENTITY);
        assert_eq!(Frame::fit(&[DVec3::ZERO; 4]), Frame::IDENTITY);
        let p = DVec3::new(1e6 + 0.1, -2.5, 0.0);
        let frame = Frame::fit(&[p; 4]);
        assert!((frame.origin - p).abs().max_element() <= 1.0);
        assert!(frame.to_local(p).abs().max_element() <= 1.0);
    }

    #[test]
    fn rescaling_is_by_the_power_that_fits() {
        let f = Frame { origin: DVec3::X, exponent: 3 };
        assert_eq!(f.rescaled(1.0).exponent, 4);
        assert_eq!(f.rescaled(0.75).exponent, 3);
        assert_eq!(f.rescaled(0.25).exponent, 2);
        assert_eq!(f.rescaled(0.0), f);
        assert_eq!(f.rescaled(f64::INFINITY), f);
    }
}
