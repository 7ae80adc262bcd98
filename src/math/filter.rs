//! Pixel filters by importance: samples are placed as densely as the filter weighs, so that each pixel keeps its own
//! samples and all weigh alike, but for a sign.
//!
//! Source: M. Ernst, M. Stamminger, G. Greiner, "Filter Importance Sampling", IEEE Symposium on Interactive Ray Tracing,
//! 2006.

use std::f64::consts::PI;
use std::sync::LazyLock;

/// How much what lies off the centre of a pixel counts in it: the product of a function of the distance across and
/// the same function of the distance down, in pixels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Filter {
    /// All alike out to 0.5, the whole pixel.
    #[default]
    Box,
    /// Falling in a straight line to 0 at 1.
    Tent,
    /// A sum of four cosines, bell-shaped, out to 1.5; smooth edges without ringing.
    ///
    /// Source: F. J. Harris, "On the Use of Windows for Harmonic Analysis with the Discrete Fourier Transform",
    /// Proc. IEEE 66(1), 1978: the minimum four-term window.
    BlackmanHarris,
    /// Cubic pieces out to 2, negative from 8/7 on: sharper edges with a slight ringing. One sample in 16 counts
    /// negative, which makes it the noisiest.
    ///
    /// Source: D. P. Mitchell, A. N. Netravali, "Reconstruction Filters in Computer Graphics", SIGGRAPH 1988; B = C = 1/3.
    Mitchell,
}

impl Filter {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Box, Self::Tent, Self::BlackmanHarris, Self::Mitchell];

    /// The name in scene files and on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Box => "box",
            Self::Tent => "tent",
            Self::BlackmanHarris => "blackman-harris",
            Self::Mitchell => "mitchell",
        }
    }

    /// Farthest that a sample is from the centre, across or down, in pixels.
    #[must_use]
    pub fn radius(self) -> f64 {
        match self {
            Self::Box => 0.5,
            Self::Tent => 1.0,
            Self::BlackmanHarris => 1.5,
            Self::Mitchell => 2.0,
        }
    }

    /// Where `u` in `[0, 1)` is from the centre, across or down, in pixels: uniform numbers become offsets distributed as
    /// the filter's absolute value. Rises with `u`, so that what was stratified stays so.
    ///
    /// Within 3e-5 pixels of the exact inverse.
    #[inline]
    #[must_use]
    pub fn offset(self, u: f64) -> f64 {
        let signed = 2.0 * u - 1.0;
        let away = match self {
            Self::Box => return 0.5 * signed,
            Self::Tent => 1.0 - (1.0 - signed.abs()).sqrt(),
            Self::BlackmanHarris => BLACKMAN_HARRIS.at(signed.abs()),
            Self::Mitchell => MITCHELL.at(signed.abs()),
        };
        away.copysign(signed)
    }

    /// [`offset`](Self::offset) for many numbers at once: the same bits. Plain loops, to be inlined into code for wide
    /// vectors.
    #[inline(always)]
    #[must_use]
    pub fn offsets<const N: usize>(self, u: &[f64; N]) -> [f64; N] {
        let mut signed = [0.0; N];
        for i in 0..N {
            signed[i] = 2.0 * u[i] - 1.0;
        }
        let away = match self {
            Self::Box | Self::Tent => return u.map(|u| self.offset(u)),
            Self::BlackmanHarris => BLACKMAN_HARRIS.at_each(&signed.map(f64::abs)),
            Self::Mitchell => MITCHELL.at_each(&signed.map(f64::abs)),
        };
        let mut offsets = [0.0; N];
        for i in 0..N {
            offsets[i] = away[i].copysign(signed[i]);
        }
        offsets
    }

    /// Whether [`weight`](Self::weight) is not always 1.
    #[must_use]
    pub fn has_negative_lobes(self) -> bool {
        self == Self::Mitchell
    }

    /// What a sample at these offsets counts: the sign of the filter there, times the integral of its absolute value over
    /// its integral. The mean of weights tends to 1; their deviation from it is 0.56 for Mitchell.
    #[must_use]
    pub fn weight(self, across: f64, down: f64) -> f64 {
        if !self.has_negative_lobes() {
            return 1.0;
        }
        let negative = |x: f64| x.abs() > MITCHELL_ZERO;
        if negative(across) == negative(down) { MITCHELL_WEIGHT } else { -MITCHELL_WEIGHT }
    }
}

static BLACKMAN_HARRIS: LazyLock<Inverse> = LazyLock::new(|| Inverse::new(blackman_harris_within, &[0.0, 1.5]));
static MITCHELL: LazyLock<Inverse> = LazyLock::new(|| Inverse::new(mitchell_within, &[0.0, MITCHELL_ZERO, 2.0]));

/// Share of the filter within `x` of the centre, `x` from 0 to 1.5.
fn blackman_harris_within(x: f64) -> f64 {
    const TERMS: [f64; 4] = [0.358_75, 0.488_29, 0.141_28, 0.011_68];
    let turn = PI * x / 1.5;
    let wave = |k: usize| TERMS[k] / (k as f64 * PI) * (k as f64 * turn).sin();
    (TERMS[0] * x / 1.5 + wave(1) + wave(2) + wave(3)) / TERMS[0]
}

/// Where the filter turns negative: (8 - 7x)(x - 2)^2 / 18 is its outer piece.
const MITCHELL_ZERO: f64 = 8.0 / 7.0;

/// Integral of each negative lobe; that of the whole is 1.
const MITCHELL_LOBE: f64 = 6.0 / 343.0;

/// Integral of the absolute value, for both axes together.
const MITCHELL_WEIGHT: f64 = (1.0 + 4.0 * MITCHELL_LOBE) * (1.0 + 4.0 * MITCHELL_LOBE);

/// Share of the absolute value of the filter within `x` of the centre, `x` from 0 to 2.
fn mitchell_within(x: f64) -> f64 {
    // Integrals from 0 to x of the inner piece, from x to 2 of the outer one.
    let inner = |x: f64| x * ((1.75 * x - 4.0) * x * x + 16.0 / 3.0) / 6.0;
    let outer = |t: f64| t * t * t * (1.75 * t - 2.0) / 18.0;
    let integral = if x <= 1.0 {
        inner(x)
    } else if x <= MITCHELL_ZERO {
        0.5 - outer(2.0 - x)
    } else {
        0.5 + 2.0 * MITCHELL_LOBE + outer(2.0 - x)
    };
    integral / (0.5 + 2.0 * MITCHELL_LOBE)
}

/// The inverse of a rising function on `[0, 1]`, as straight pieces.
#[derive(Debug)]
struct Inverse {
    /// Ends of the pieces: values of the function, arguments. The last one fills what is left.
    values: [f64; NODES],
    arguments: [f64; NODES],
    /// The last node whose value is not above each of so many equal steps from 0 to 1.
    guide: [u32; GUIDES],
    /// Start of the last piece.
    last: u32,
}

/// Largest error of a straight piece where it is looked at, its middle.
const TOLERANCE: f64 = 2e-5;
/// Room for nodes, of which Mitchell's filter has 576.
const NODES: usize = 1024;
/// Steps from 0 to 1: more than there are nodes.
const GUIDES: usize = 1024;

impl Inverse {
    /// Of `share`, which rises from 0 at the first of `ends` to 1 at the last, and is smooth between them.
    fn new(share: fn(f64) -> f64, ends: &[f64]) -> Self {
        let mut nodes = vec![[0.0, ends[0]]];
        for pair in ends.windows(2) {
            Self::refine(share, [pair[0], pair[1]], &mut nodes);
        }
        assert!(nodes.len() <= NODES, "the filters are known, and so is the number of their nodes");
        let step = |k: usize| k as f64 / GUIDES as f64;
        let at = |i: usize| nodes[i.min(nodes.len() - 1)];
        Self {
            values: std::array::from_fn(|i| at(i)[0]),
            arguments: std::array::from_fn(|i| at(i)[1]),
            guide: std::array::from_fn(|k| nodes.partition_point(|n| n[0] <= step(k)) as u32 - 1),
            last: nodes.len() as u32 - 2,
        }
    }

    /// Adds the pieces from `from` to `to` and their ends.
    fn refine(share: fn(f64) -> f64, [from, to]: [f64; 2], nodes: &mut Vec<[f64; 2]>) {
        let middle = 0.5 * (from + to);
        let [low, value, high] = [from, middle, to].map(share);
        let straight = from + (to - from) * (value - low) / (high - low);
        if (straight - middle).abs() <= TOLERANCE && to - from < 0.1 {
            nodes.push([high, to]);
        } else {
            Self::refine(share, [from, middle], nodes);
            Self::refine(share, [middle, to], nodes);
        }
    }

    /// The argument that has this value, which is from 0 to 1.
    #[inline]
    fn at(&self, value: f64) -> f64 {
        let mut piece = self.first(value);
        while self.goes_on(piece, value) {
            piece += 1;
        }
        self.within(piece, value)
    }

    /// [`at`](Self::at) for many.
    #[inline(always)]
    fn at_each<const N: usize>(&self, values: &[f64; N]) -> [f64; N] {
        let mut pieces = [0u32; N];
        let mut more = false;
        for i in 0..N {
            let first = self.first(values[i]);
            // Most steps hold no node, or one.
            let piece = first + u32::from(self.goes_on(first, values[i]));
            more |= self.goes_on(piece, values[i]);
            pieces[i] = piece;
        }
        while more {
            more = false;
            for i in 0..N {
                pieces[i] += u32::from(self.goes_on(pieces[i], values[i]));
                more |= self.goes_on(pieces[i], values[i]);
            }
        }
        let mut arguments = [0.0; N];
        for i in 0..N {
            arguments[i] = self.within(pieces[i], values[i]);
        }
        arguments
    }

    #[inline(always)]
    fn first(&self, value: f64) -> u32 {
        self.guide[((value * GUIDES as f64) as u32 as usize).min(GUIDES - 1)]
    }

    /// Whether the value is beyond the piece.
    #[inline(always)]
    fn goes_on(&self, piece: u32, value: f64) -> bool {
        (piece < self.last) & (self.values[(piece as usize + 1) % NODES] <= value)
    }

    #[inline(always)]
    fn within(&self, piece: u32, value: f64) -> f64 {
        let (from, to) = (piece as usize % NODES, (piece as usize + 1) % NODES);
        let (low, high) = (self.values[from], self.values[to]);
        let (start, end) = (self.arguments[from], self.arguments[to]);
        start + (end - start) * ((value - low) / (high - low)).min(1.0)
    }
}

#[cfg(test)]
mod tests;
