//! Auxiliary images made visible, for formats that hold colours only.
//!
//! | image | 8-bit | Radiance HDR |
//! |---|---|---|
//! | depth | nearest white to farthest dark grey, black where nothing was hit; or [`Display::depth_range`] | distance, 0 where nothing was hit |
//! | normal | `0.5 + 0.5 n`; mid-grey where nothing was hit | the same |
//! | albedo | sRGB | linear |
//! | id | a colour for each pair of object and primitive, black where nothing was hit | the same |
//! | hits | 0 black, 1 white | share |
//! | cost | 0 black, dearest pixel white | rays |
//! | samples | 0 black, most white | samples |
//!
//! Only albedo is bent by the sRGB curve; elsewhere equal steps of the value are equal steps of the byte.

use crate::film::tone::{Range, srgb_bytes};
use crate::film::{Aov, AovImage, Display, Tonemap};

/// The grey of the farthest hit: darker than any nearer one, and not the black of a miss.
const FARTHEST: f32 = 32.0;

/// As 8-bit RGB.
pub fn bytes(aov: &AovImage, display: &Display) -> Vec<[u8; 3]> {
    let values = &aov.data;
    match (aov.kind, display.depth_range) {
        (Aov::Depth, Some(range)) if display.tonemap == Tonemap::Stretch => stretched_depth(values, range),
        _ => plain_bytes(aov),
    }
}

fn plain_bytes(aov: &AovImage) -> Vec<[u8; 3]> {
    let values = &aov.data;
    match aov.kind {
        Aov::Depth => depth(values),
        Aov::Normal => triples(values).iter().map(|n| n.map(|c| step(0.5 + 0.5 * c))).collect(),
        Aov::Albedo => srgb_bytes(triples(values)),
        Aov::Id => pairs(values).iter().map(|&pair| id_colour(pair)).collect(),
        Aov::Hits => values.iter().map(|&h| [step(h); 3]).collect(),
        Aov::Cost | Aov::Samples => {
            let most = values.iter().copied().fold(0.0, f32::max).max(f32::MIN_POSITIVE);
            values.iter().map(|&c| [step(c / most); 3]).collect()
        }
    }
}

/// As non-negative finite RGB.
pub fn linear(aov: &AovImage) -> Vec<[f32; 3]> {
    let values = &aov.data;
    match aov.kind {
        Aov::Depth => values.iter().map(|&d| [if d.is_finite() { d } else { 0.0 }; 3]).collect(),
        Aov::Normal => triples(values).iter().map(|n| n.map(|c| 0.5 + 0.5 * c)).collect(),
        Aov::Albedo => triples(values).to_vec(),
        Aov::Id => pairs(values).iter().map(|&pair| id_colour(pair).map(|b| f32::from(b) / 255.0)).collect(),
        Aov::Hits | Aov::Cost | Aov::Samples => values.iter().map(|&v| [v; 3]).collect(),
    }
}

fn triples(values: &[f32]) -> &[[f32; 3]] {
    values.as_chunks().0
}

fn pairs(values: &[f32]) -> &[[f32; 2]] {
    values.as_chunks().0
}

fn depth(values: &[f32]) -> Vec<[u8; 3]> {
    let hits = values.iter().copied().filter(|d| d.is_finite());
    let (near, far) = hits.fold((f32::INFINITY, f32::NEG_INFINITY), |(lo, hi), d| (lo.min(d), hi.max(d)));
    // In f64, where neither the difference of two floats overflows nor a tiny one vanishes.
    let range = f64::from(far) - f64::from(near);
    let grey = |d: f32| {
        if !d.is_finite() {
            return 0;
        }
        let share = if range > 0.0 { (f64::from(d) - f64::from(near)) / range } else { 0.0 };
        (255.0 - f64::from(255.0 - FARTHEST) * share).round_ties_even() as u8
    };
    values.iter().map(|&d| [grey(d); 3]).collect()
}

/// Each depth as its share of the way from `near` to `far`, 0 for a miss, all of them stretched.
fn stretched_depth(values: &[f32], (near, far): (f64, f64)) -> Vec<[u8; 3]> {
    let share = |d: f32| if d.is_finite() { (f64::from(d) - near) / (far - near) } else { 0.0 };
    let range = values.iter().fold(Range::EMPTY, |r, &d| r.with(share(d)));
    values.iter().map(|&d| [range.byte(share(d)); 3]).collect()
}

/// 0..=1 to 0..=255; `as` saturates and takes NaN to 0.
fn step(share: f32) -> u8 {
    (255.0 * share).round_ties_even() as u8
}

/// A colour that tells neighbours apart: the three bytes of a hash, none darker than 64.
fn id_colour([object, prim]: [f32; 2]) -> [u8; 3] {
    let (object, prim) = (object.to_bits(), prim.to_bits());
    if object == 0 && prim == 0 {
        return [0; 3];
    }
    let hash = mix(mix(object) ^ prim);
    [0, 8, 16].map(|shift| 64 + ((hash >> shift & 0xff) * 191 / 255) as u8)
}

/// The 32-bit finaliser of MurmurHash3: every bit in changes every bit out half of the time.
fn mix(mut x: u32) -> u32 {
    x = (x ^ (x >> 16)).wrapping_mul(0x85eb_ca6b);
    x = (x ^ (x >> 13)).wrapping_mul(0xc2b2_ae35);
    x ^ (x >> 16)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(kind: Aov, data: &[f32]) -> AovImage {
        AovImage { kind, data: data.to_vec() }
    }

    fn bytes(aov: &AovImage) -> Vec<[u8; 3]> {
        super::bytes(aov, &Display::default())
    }

    #[test]
    fn depth_of_a_stretched_picture_grows_from_the_near_plane() {
        let stretched = |tonemap, depth_range, data: &[f32]| {
            super::bytes(&image(Aov::Depth, data), &Display { tonemap, exposure: 0.0, depth_range })
        };
        let range = Some((1.0, 101.0));
        let stretch = |data: &[f32]| stretched(Tonemap::Stretch, range, data);
        let miss = f32::INFINITY;
        // Shares 0, 0.01, 0.02 and 0.04 of the way; the farthest hit is white.
        assert_eq!(stretch(&[miss, 2.0, 3.0, 5.0]), [[0; 3], [63; 3], [127; 3], [255; 3]]);
        assert_eq!(stretch(&[2.0, 3.0, 5.0]), [[0; 3], [85; 3], [255; 3]], "nothing was missed: the nearest is black");
        assert_eq!(stretch(&[miss, 3.0]), [[0; 3], [255; 3]]);
        for constant in [miss, 3.0] {
            assert_eq!(stretch(&[constant; 2]), [[0; 3]; 2]);
        }
        let usual = bytes(&image(Aov::Depth, &[2.0, 3.0]));
        assert_eq!(stretched(Tonemap::Stretch, None, &[2.0, 3.0]), usual, "no planes to measure between");
        assert_eq!(stretched(Tonemap::None, range, &[2.0, 3.0]), usual, "another curve");
    }

    #[test]
    fn depth_runs_from_white_to_dark_grey_and_a_miss_is_black() {
        let shown = bytes(&image(Aov::Depth, &[2.0, 3.0, 4.0, f32::INFINITY]));
        assert_eq!(shown, [[255; 3], [144; 3], [32; 3], [0; 3]]);
        assert_eq!(bytes(&image(Aov::Depth, &[7.0, 7.0])), [[255; 3]; 2], "one depth everywhere");
        assert_eq!(bytes(&image(Aov::Depth, &[f32::INFINITY; 2])), [[0; 3]; 2], "nothing hit");
        let extreme = bytes(&image(Aov::Depth, &[f32::MIN_POSITIVE, f32::MAX]));
        assert_eq!(extreme, [[255; 3], [32; 3]]);
    }

    #[test]
    fn the_other_kinds() {
        assert_eq!(bytes(&image(Aov::Normal, &[-1.0, 0.0, 1.0])), [[0, 128, 255]]);
        assert_eq!(bytes(&image(Aov::Hits, &[0.0, 0.5, 1.0])), [[0; 3], [128; 3], [255; 3]]);
        assert_eq!(bytes(&image(Aov::Cost, &[0.0, 2.0, 4.0])), [[0; 3], [128; 3], [255; 3]]);
        assert_eq!(bytes(&image(Aov::Cost, &[0.0, 0.0])), [[0; 3]; 2]);
        assert_eq!(bytes(&image(Aov::Albedo, &[0.0, 0.214_041_14, 1.0])), [[0, 128, 255]]);
    }

    #[test]
    fn ids_that_differ_have_colours_that_differ() {
        assert_eq!(bytes(&image(Aov::Id, &[0.0, 0.0])), [[0; 3]]);
        let pairs: Vec<f32> = (0..64).flat_map(|i| [1 + i / 8, 1 + i % 8]).map(f32::from_bits).collect();
        let mut colours = bytes(&image(Aov::Id, &pairs));
        assert!(colours.iter().flatten().all(|&b| b >= 64));
        colours.sort_unstable();
        colours.dedup();
        assert_eq!(colours.len(), 64);
    }

    #[test]
    fn what_goes_to_hdr_is_finite_and_not_negative() {
        for kind in Aov::ALL {
            let data = match kind {
                Aov::Depth => vec![0.5, f32::INFINITY],
                Aov::Normal => vec![-1.0, 0.0, 1.0],
                Aov::Albedo => vec![0.0, 0.5, 1.0],
                Aov::Id => vec![f32::from_bits(3), f32::from_bits(u32::MAX)],
                Aov::Hits | Aov::Cost | Aov::Samples => vec![0.0, 1.0],
            };
            let shown = linear(&AovImage { kind, data });
            assert!(shown.as_flattened().iter().all(|v| v.is_finite() && *v >= 0.0), "{}", kind.name());
        }
    }
}
