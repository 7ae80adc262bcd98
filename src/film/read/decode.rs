//! Image files of common kinds, within limits.

use image::{DynamicImage, ImageDecoder, ImageError, ImageReader, Limits};
use std::io::{BufRead, Seek};

/// Most pixels to a side.
const LARGEST_SIDE: u32 = 65_536;

/// Decodes what the crate `image` knows.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Decoder {
    /// Kinds of images that the caller takes, for messages.
    pub kinds: &'static str,
    /// Most bytes that decoding may take.
    pub most_memory: u64,
}

impl Decoder {
    /// The image, of whatever kind its first bytes say.
    ///
    /// # Errors
    /// What is wrong with it, in words that go on after its name.
    pub fn decode(&self, from: impl BufRead + Seek) -> Result<DynamicImage, String> {
        let reader = ImageReader::new(from).with_guessed_format();
        let mut reader = reader.map_err(|e| format!("cannot be read: {e}"))?;
        if reader.format().is_none() {
            return Err(format!("is no {} image", self.kinds));
        }
        let mut limits = Limits::no_limits();
        limits.max_alloc = Some(self.most_memory);
        reader.limits(limits.clone());
        let mut decoder = reader.into_decoder().map_err(|e| self.why(&e))?;
        let (size, bytes) = (decoder.dimensions(), decoder.total_bytes());
        self.check_size(size, bytes)?;
        limits.reserve(bytes).and_then(|()| decoder.set_limits(limits)).map_err(|e| self.why(&e))?;
        DynamicImage::from_decoder(decoder).map_err(|e| self.why(&e))
    }

    /// Bytes of all pixels, as the head of the file has it.
    pub fn decoded_bytes(&self, from: impl BufRead + Seek) -> Option<u64> {
        let mut reader = ImageReader::new(from).with_guessed_format().ok()?;
        let mut limits = Limits::no_limits();
        limits.max_alloc = Some(self.most_memory);
        reader.limits(limits);
        Some(reader.into_decoder().ok()?.total_bytes())
    }

    /// Refuses a side or a whole that is too large; `bytes` is what all pixels take.
    pub fn check_size(&self, (width, height): (u32, u32), bytes: u64) -> Result<(), String> {
        if width == 0 || height == 0 {
            return Err("has no pixels".into());
        }
        if width.max(height) > LARGEST_SIDE {
            return Err(format!("has {width}x{height} pixels, but a side may have at most {LARGEST_SIDE}"));
        }
        if bytes > self.most_memory {
            let (mib, most) = (bytes >> 20, self.most_memory >> 20);
            return Err(format!(
                "has {width}x{height} pixels and would take {mib} MiB to decode, but at most {most} are given: make it smaller"
            ));
        }
        Ok(())
    }

    fn why(&self, e: &ImageError) -> String {
        match e {
            ImageError::Limits(_) => {
                format!("takes more than {} MiB to decode: make it smaller", self.most_memory >> 20)
            }
            ImageError::Unsupported(_) => format!("is no {} image that can be decoded", self.kinds),
            e => format!("cannot be decoded: {e}"),
        }
    }
}
