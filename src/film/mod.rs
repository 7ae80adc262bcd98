//! Finished pixels, the files they go to, and pictures read back from files. Knows `math` and nothing else.

mod aov;
mod format;
mod read;
mod save;
mod tone;
mod write;

use rayon::prelude::*;
use tison_pages::zeroes;

pub use aov::{Aov, AovImage};
pub use format::Format;
pub(crate) use read::Decoder;
pub use read::{Encoding, Picture, ReadError, read};
pub use save::{SaveError, Sink, abandon, check_target, is_special_file, save};
pub use tone::{Display, Tonemap};
pub use write::{Notes, encode, files, save_all};

/// A rendered image: linear colour and whatever else was asked for, row by row from the top.
#[derive(Clone, Debug)]
pub struct Film {
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
    /// Linear RGB, mean of the samples of each pixel; finite. A filter with negative lobes makes some a little negative.
    pub color: Vec<[f32; 3]>,
    /// Auxiliary images, in the order asked for.
    pub aovs: Vec<AovImage>,
    /// Pixels that were finished: less than `width * height` after an interruption; the
    /// others are black.
    pub finished: usize,
}

/// Pixels in a page of memory.
const PAGE: usize = 4096 / size_of::<[f32; 3]>();

impl Film {
    /// A black image with room for `aovs`.
    #[must_use]
    pub fn new(width: u32, height: u32, aovs: &[Aov]) -> Self {
        let pixels = width as usize * height as usize;
        // Each page touched on all threads: the first touch of fresh memory is most of the cost.
        let mut color = zeroes::<[f32; 3]>(pixels);
        color
            .par_chunks_mut(1 << 14)
            .for_each(|part| part.iter_mut().step_by(PAGE).for_each(|pixel| *pixel = [0.0; 3]));
        Self { width, height, color, aovs: aovs.iter().map(|&kind| AovImage::new(kind, pixels)).collect(), finished: 0 }
    }

    /// Bytes a film of this size takes, for refusing one before it is made.
    #[must_use]
    pub fn bytes(width: u64, height: u64, aovs: &[Aov]) -> u64 {
        let floats: u64 = 3 + aovs.iter().map(|a| a.channels() as u64).sum::<u64>();
        width.saturating_mul(height).saturating_mul(4 * floats)
    }

    /// Whether every pixel was finished.
    #[must_use]
    pub fn is_complete(&self) -> bool {
        self.finished == self.color.len()
    }
}
