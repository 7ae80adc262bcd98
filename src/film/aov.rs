//! Auxiliary images ("arbitrary output variables"): what else a hit knows.

/// What an auxiliary image shows of the first hit of a pixel's samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Aov {
    /// Mean distance from the ray's start in world units over the samples that hit;
    /// infinity where none did.
    Depth,
    /// Mean unit shading normal in world axes, facing the camera; zero where nothing was hit.
    Normal,
    /// Mean diffuse colour, linear RGB.
    Albedo,
    /// Object and primitive of the first sample, each plus one; zero where it hit nothing.
    /// Whole numbers, kept as the bits of the floats.
    Id,
    /// Share of the samples that hit something, 0 to 1.
    Hits,
    /// Rays traced for the pixel, of all kinds.
    Cost,
    /// Samples taken of the pixel.
    Samples,
}

impl Aov {
    /// All of them.
    pub const ALL: [Self; 7] =
        [Self::Depth, Self::Normal, Self::Albedo, Self::Id, Self::Hits, Self::Cost, Self::Samples];

    /// The name on the command line and in file names.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Depth => "depth",
            Self::Normal => "normal",
            Self::Albedo => "albedo",
            Self::Id => "id",
            Self::Hits => "hits",
            Self::Cost => "cost",
            Self::Samples => "samples",
        }
    }

    /// Floats per pixel.
    #[must_use]
    pub fn channels(self) -> usize {
        match self {
            Self::Depth | Self::Hits | Self::Cost | Self::Samples => 1,
            Self::Id => 2,
            Self::Normal | Self::Albedo => 3,
        }
    }
}

/// One auxiliary image, row by row from the top, `kind.channels()` floats a pixel.
#[derive(Clone, Debug)]
pub struct AovImage {
    /// What it shows.
    pub kind: Aov,
    /// The values.
    pub data: Vec<f32>,
}

impl AovImage {
    /// As if nothing were hit: what a pixel keeps that is never rendered.
    #[must_use]
    pub fn new(kind: Aov, pixels: usize) -> Self {
        let nothing = if kind == Aov::Depth { f32::INFINITY } else { 0.0 };
        Self { kind, data: vec![nothing; pixels * kind.channels()] }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pixel_that_is_never_rendered_is_a_miss() {
        assert_eq!(AovImage::new(Aov::Depth, 2).data, [f32::INFINITY; 2]);
        assert_eq!(AovImage::new(Aov::Normal, 1).data, [0.0; 3]);
        assert_eq!(AovImage::new(Aov::Id, 1).data, [0.0; 2]);
    }
}
