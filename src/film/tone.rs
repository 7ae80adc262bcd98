//! From linear light to the 8-bit values of a picture.

use crate::math::colour::Srgb8;
use glam::Vec3;
use rayon::prelude::*;

/// How 8-bit formats show light; formats of linear floats do not ask.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Display {
    /// The curve.
    pub tonemap: Tonemap,
    /// Light is multiplied by two to this power first.
    pub exposure: f32,
    /// For [`Tonemap::Stretch`]: nearest and farthest distance that the camera shows, in world
    /// units. A depth is then shown as its share of the way between them, stretched as the colours
    /// are; a miss has share 0. `None`: as with every other curve.
    pub depth_range: Option<(f64, f64)>,
}

/// Curves from linear light to 8 bits.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Tonemap {
    /// sRGB; what is brighter than 1 is cut off.
    #[default]
    None,
    /// Luminance `L` becomes `L / (1 + L)`, then sRGB.
    ///
    /// Source: E. Reinhard et al., "Photographic Tone Reproduction for Digital Images",
    /// SIGGRAPH 2002, equation 3.
    Reinhard,
    /// A film-like curve on each channel, then sRGB.
    ///
    /// Source: K. Narkowicz, "ACES Filmic Tone Mapping Curve", 2015.
    Aces,
    /// The least value of all channels of the image becomes 0, the greatest 255, what is between
    /// in proportion and truncated; no sRGB. So the course's program writes its pictures.
    Stretch,
}

impl Tonemap {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::None, Self::Reinhard, Self::Aces, Self::Stretch];

    /// The name on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Reinhard => "reinhard",
            Self::Aces => "aces",
            Self::Stretch => "stretch",
        }
    }
}

/// Pixels that one task converts: enough to be worth a task, few enough to share out.
const CHUNK: usize = 1 << 14;

impl Display {
    /// The bytes of an image.
    pub(super) fn bytes(&self, color: &[[f32; 3]]) -> Vec<[u8; 3]> {
        let light = self.exposure.exp2();
        match self.tonemap {
            Tonemap::None if self.exposure == 0.0 => srgb_bytes(color),
            Tonemap::None => curved(color, |c| c * light),
            Tonemap::Reinhard => curved(color, |c| reinhard(c * light)),
            Tonemap::Aces => curved(color, |c| aces(c * light)),
            Tonemap::Stretch => {
                let range = Range::of(color.as_flattened());
                color.par_iter().with_min_len(CHUNK).map(|c| c.map(|v| range.byte(f64::from(v)))).collect()
            }
        }
    }
}

/// By the sRGB curve alone.
pub fn srgb_bytes(color: &[[f32; 3]]) -> Vec<[u8; 3]> {
    let table = Srgb8::table();
    color.par_iter().with_min_len(CHUNK).map(|&c| table.rgb(c)).collect()
}

fn curved(color: &[[f32; 3]], curve: impl Fn(Vec3) -> Vec3 + Sync) -> Vec<[u8; 3]> {
    let table = Srgb8::table();
    color.par_iter().with_min_len(CHUNK).map(|&c| table.rgb(curve(Vec3::from(c)).to_array())).collect()
}

/// Least and greatest of many values.
#[derive(Clone, Copy, Debug)]
pub struct Range {
    min: f64,
    max: f64,
}

impl Range {
    /// Of none.
    pub const EMPTY: Self = Self { min: f64::INFINITY, max: f64::NEG_INFINITY };

    fn of(values: &[f32]) -> Self {
        let part = |values: &[f32]| values.iter().fold(Self::EMPTY, |r, &v| r.with(f64::from(v)));
        values.par_chunks(3 * CHUNK).map(part).reduce(|| Self::EMPTY, |a, b| a.with(b.min).with(b.max))
    }

    /// The same and one value more.
    pub fn with(self, value: f64) -> Self {
        Self { min: self.min.min(value), max: self.max.max(value) }
    }

    /// 0 for the least, 255 for the greatest, truncated between; 0 where all are the same.
    pub fn byte(self, value: f64) -> u8 {
        let width = self.max - self.min;
        if width > 0.0 { (255.0 * ((value - self.min) / width)) as u8 } else { 0 }
    }
}

/// On the luminance of ITU-R BT.709, so that hues stay.
fn reinhard(c: Vec3) -> Vec3 {
    let luminance = c.dot(Vec3::new(0.2126, 0.7152, 0.0722)).max(0.0);
    c / (1.0 + luminance)
}

/// What is so bright that its square overflows is white.
fn aces(c: Vec3) -> Vec3 {
    let x = c.clamp(Vec3::ZERO, Vec3::splat(1e9));
    x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::colour::srgb8_by_formula;

    fn shown(tonemap: Tonemap, exposure: f32, color: &[[f32; 3]]) -> Vec<[u8; 3]> {
        Display { tonemap, exposure, depth_range: None }.bytes(color)
    }

    #[test]
    fn each_curve_by_its_formula() {
        let srgb = |c: [f64; 3]| c.map(|v| srgb8_by_formula(v as f32));
        let cases = [
            (Tonemap::None, 0.0, [0.25, 0.5, 7.0], [0.25, 0.5, 1.0]),
            (Tonemap::None, 1.0, [0.25, 0.5, 7.0], [0.5, 1.0, 1.0]),
            (Tonemap::None, -2.0, [0.25, 0.5, 3.0], [0.0625, 0.125, 0.75]),
            // What a filter with negative lobes leaves beside a bright edge is black.
            (Tonemap::None, 0.0, [-0.04, 1.04, -1e-9], [0.0, 1.0, 0.0]),
            (Tonemap::None, 1.0, [-0.04, 1.04, -1e-9], [0.0, 1.0, 0.0]),
            (Tonemap::Reinhard, 0.0, [-0.04, -0.04, -0.04], [0.0; 3]),
            (Tonemap::Aces, 0.0, [-0.04, -0.04, -0.04], [0.0; 3]),
            (Tonemap::Reinhard, 0.0, [1.0, 1.0, 1.0], [0.5, 0.5, 0.5]),
            (Tonemap::Reinhard, 1.0, [1.5, 1.5, 1.5], [0.75, 0.75, 0.75]),
            // Luminance 0.2126 * 2: all channels are divided alike.
            (Tonemap::Reinhard, 0.0, [2.0, 0.0, 0.0], [2.0 / 1.4252, 0.0, 0.0]),
            (Tonemap::Aces, 0.0, [0.0, 1.0, 1e30], [0.0, 2.54 / 3.16, 2.51 / 2.43]),
            (Tonemap::Aces, -1.0, [2.0, 1.0, -3.0], [2.54 / 3.16, (0.5 * 1.285) / (0.5 * 1.805 + 0.14), 0.0]),
        ];
        for (tonemap, exposure, light, want) in cases {
            assert_eq!(shown(tonemap, exposure, &[light]), [srgb(want)], "{tonemap:?} {exposure} {light:?}");
        }
    }

    #[test]
    fn a_stretched_image_runs_from_0_to_255_over_all_channels_and_is_truncated() {
        // Range 2 to 6: steps of 4/255.
        let step = 4.0 / 255.0;
        let color = [[2.0, 6.0, 4.0], [2.0 + 0.999 * step, 2.0 + 1.001 * step, 2.0 + 254.999 * step]];
        assert_eq!(shown(Tonemap::Stretch, 0.0, &color), [[0, 255, 127], [0, 1, 254]]);
        assert_eq!(shown(Tonemap::Stretch, 0.0, &[[-1.0, 0.0, 1.0]]), [[0, 127, 255]]);
    }

    #[test]
    fn a_constant_image_has_no_range_to_stretch() {
        for value in [0.0, 0.5, f32::MAX] {
            assert_eq!(shown(Tonemap::Stretch, 0.0, &[[value; 3]; 2]), [[0; 3]; 2], "{value}");
        }
        assert!(shown(Tonemap::Stretch, 0.0, &[]).is_empty());
    }

    #[test]
    fn a_range_that_overflows_f32_is_one() {
        assert_eq!(shown(Tonemap::Stretch, 0.0, &[[f32::MIN, 0.0, f32::MAX]]), [[0, 127, 255]]);
        assert_eq!(shown(Tonemap::Stretch, 0.0, &[[0.0, f32::from_bits(1), f32::from_bits(2)]]), [[0, 127, 255]]);
    }

    #[test]
    fn names_differ() {
        for (i, a) in Tonemap::ALL.iter().enumerate() {
            assert!(Tonemap::ALL[..i].iter().all(|b| a.name() != b.name()));
        }
    }
}
