//! File formats, chosen by extension.

use std::path::Path;

/// A file format for images.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Format {
    /// 8-bit sRGB, lossless.
    Png,
    /// 32-bit linear floats, lossless; auxiliary images are channels of the same file.
    Exr,
    /// Radiance: linear, three 8-bit mantissas with one exponent.
    Hdr,
    /// Portable float map: 32-bit linear floats, not compressed.
    Pfm,
    /// Portable pixmap: 8-bit sRGB, not compressed.
    Ppm,
    /// 8-bit sRGB, lossy at quality 95.
    Jpeg,
    /// 8-bit sRGB, not compressed.
    Bmp,
}

impl Format {
    /// The extensions that [`Format::of`] knows, for messages.
    pub const EXTENSIONS: &str = "png, exr, hdr, pfm, ppm, jpg, bmp";

    /// The format that the extension of `path` stands for, in either case.
    #[must_use]
    pub fn of(path: &Path) -> Option<Self> {
        let extension = path.extension()?.to_str()?.to_ascii_lowercase();
        Some(match extension.as_str() {
            "png" => Self::Png,
            "exr" => Self::Exr,
            "hdr" => Self::Hdr,
            "pfm" => Self::Pfm,
            "ppm" => Self::Ppm,
            "jpg" | "jpeg" => Self::Jpeg,
            "bmp" => Self::Bmp,
            _ => return None,
        })
    }

    /// Whether it holds light as linear floats, so that no [`Display`](super::Display) matters.
    #[must_use]
    pub fn is_linear(self) -> bool {
        matches!(self, Self::Exr | Self::Hdr | Self::Pfm)
    }

    /// Whether auxiliary images are part of the same file.
    #[must_use]
    pub fn holds_aovs(self) -> bool {
        self == Self::Exr
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_extension_it_names_is_one_it_knows() {
        for extension in Format::EXTENSIONS.split(", ") {
            assert!(Format::of(Path::new(&format!("a.{extension}"))).is_some(), "{extension}");
            assert!(Format::of(Path::new(&format!("a.{}", extension.to_uppercase()))).is_some(), "{extension}");
        }
        for name in ["a", "a.", ".png", "a.tiff", "a.png.bak", "png"] {
            assert_eq!(Format::of(Path::new(name)), None, "{name}");
        }
    }
}
