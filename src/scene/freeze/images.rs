//! The images of a scene: each file once for each way of looking it up, read by all threads.

use crate::scene::texture::{self, Encoding, Texture};
use crate::scene::{Error, LoadOptions};
use rayon::prelude::*;
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering::Relaxed;
use std::time::{Duration, Instant};

/// Images that are wanted, read or not yet.
#[derive(Debug)]
pub struct Images {
    /// What the whole numbers of every image mean.
    encoding: Encoding,
    slots: Vec<Slot>,
    known: HashMap<(PathBuf, bool), usize>,
    /// Time spent on reading.
    spent: Duration,
}

#[derive(Debug)]
struct Slot {
    path: PathBuf,
    nearest: bool,
    /// What came of reading it.
    read: Option<Result<Texture, String>>,
}

impl Images {
    pub fn new(encoding: Encoding) -> Self {
        Self { encoding, slots: Vec::new(), known: HashMap::new(), spent: Duration::ZERO }
    }

    /// The slot of the image in the file `path`, a path without links.
    pub fn want(&mut self, path: &Path, nearest: bool) -> usize {
        let next = self.slots.len();
        let slot = *self.known.entry((path.to_owned(), nearest)).or_insert(next);
        if slot == next {
            self.slots.push(Slot { path: path.to_owned(), nearest, read: None });
        }
        slot
    }

    /// Reads what has not been read.
    pub fn read(&mut self, options: &LoadOptions<'_>) -> Result<(), Error> {
        let (start, encoding) = (Instant::now(), self.encoding);
        let read = self.slots.par_iter_mut().filter(|slot| slot.read.is_none()).try_for_each(|slot| {
            if options.cancel.load(Relaxed) {
                return Err(Error::Cancelled);
            }
            let bytes = texture::decoded_bytes(&slot.path).unwrap_or(0);
            options.free_memory.check(&slot.path, || "the image".into(), bytes)?;
            slot.read = Some(texture::read(&slot.path, encoding, slot.nearest));
            Ok(())
        });
        self.spent += start.elapsed();
        read
    }

    /// The file of a slot and why it cannot be used, if so.
    pub fn fault(&self, slot: usize) -> Option<(&Path, &str)> {
        let slot = &self.slots[slot];
        match &slot.read {
            Some(Err(why)) => Some((&slot.path, why)),
            _ => None,
        }
    }

    /// The files of all slots.
    pub fn files(&self) -> impl Iterator<Item = &Path> {
        self.slots.iter().map(|slot| &*slot.path)
    }

    /// Number of slots.
    pub fn len(&self) -> usize {
        self.slots.len()
    }

    /// The images that could be read, the number of each slot's one among them, and the seconds it took.
    pub fn finish(self) -> (Vec<Texture>, Vec<Option<u32>>, f64) {
        let mut textures = Vec::new();
        let numbers = self.slots.into_iter().map(|slot| {
            let texture = slot.read?.ok()?;
            textures.push(texture);
            Some(textures.len() as u32 - 1)
        });
        let numbers = numbers.collect();
        (textures, numbers, self.spent.as_secs_f64())
    }
}
