//! The files that a scene names: found, and what came of reading them.

use super::images::Images;
use crate::scene::desc::Place;
use crate::scene::format::{AssetError, Mistakes, resolve_asset};
use crate::scene::texture::Encoding;
use crate::scene::{Error, LoadOptions, Unused, Warning};
use std::collections::HashMap;
use std::path::{Path, PathBuf};

/// Told bytes done and bytes in all.
pub type Progress<'a> = Option<&'a (dyn Fn(u64, u64) + Sync)>;

/// What was read beside the scene file, and how.
#[derive(Debug)]
pub struct Assets<'a> {
    pub options: &'a LoadOptions<'a>,
    pub images: Images,
    pub warnings: Vec<Warning>,
    pub unused: Unused,
    /// Mesh files that were read.
    pub meshes: Vec<PathBuf>,
}

impl<'a> Assets<'a> {
    pub fn new(options: &'a LoadOptions<'a>, encoding: Encoding) -> Self {
        Self {
            options,
            images: Images::new(encoding),
            warnings: Vec::new(),
            unused: Unused::default(),
            meshes: Vec::new(),
        }
    }

    /// All files so far, after those in `before`.
    pub fn files(&self, mut before: Vec<PathBuf>) -> Vec<PathBuf> {
        before.extend(self.meshes.iter().cloned());
        before.extend(self.images.files().map(Path::to_owned));
        before
    }

    /// Reads the images that meshes named since there were `before`. One that cannot be used is a warning.
    pub fn read_images_of_meshes(&mut self, before: usize) -> Result<(), Error> {
        self.images.read(self.options)?;
        for slot in before..self.images.len() {
            if let Some((path, why)) = self.images.fault(slot) {
                self.warnings.push(Warning::about(path, format!("the image {why}; Kd is used alone")));
            }
        }
        Ok(())
    }
}

/// Finds files that a scene names, each once.
pub struct Finder<'a> {
    /// The scene file.
    scene: &'a Path,
    allow: &'a [PathBuf],
    mistakes: &'a Mistakes,
    known: HashMap<PathBuf, Option<PathBuf>>,
}

impl<'a> Finder<'a> {
    pub fn new(scene: &'a Path, allow: &'a [PathBuf], mistakes: &'a Mistakes) -> Self {
        Self { scene, allow, mistakes, known: HashMap::new() }
    }

    /// The file that `written` means, links resolved. If there is none, that is a mistake at the first
    /// `place` that names it.
    pub fn find(&mut self, written: &Path, place: Place) -> Option<PathBuf> {
        if let Some(known) = self.known.get(written) {
            return known.clone();
        }
        let found = resolve_asset(self.scene, written, self.allow);
        let path = found.map_err(|e| self.tell(&e, place)).ok();
        self.known.insert(written.to_owned(), path.clone());
        path
    }

    /// The file that `written` means, if there is one.
    pub fn find_quietly(&self, written: &Path) -> Option<PathBuf> {
        resolve_asset(self.scene, written, self.allow).ok()
    }

    fn tell(&self, e: &AssetError, place: Place) {
        match e {
            AssetError::NotFound { written, tried } => {
                let folder = tried.first().and_then(|path| path.parent());
                let there = folder.map(|f| files_in(f, written)).unwrap_or_default();
                self.mistakes.add_name(place, e.to_string(), &written.to_string_lossy(), &there);
            }
            AssetError::Read { source, .. } => self.mistakes.add(place, format!("{e}: {source}")),
            e => self.mistakes.add(place, e.to_string()),
        }
    }
}

/// The files in a folder with the extension of `written`, in the way that is written. Not all, where there are
/// very many.
fn files_in(folder: &Path, written: &Path) -> Vec<String> {
    const MOST: usize = 1000;
    let Ok(entries) = std::fs::read_dir(folder) else { return Vec::new() };
    let names = entries.take(MOST).filter_map(|entry| Some(PathBuf::from(entry.ok()?.file_name())));
    let alike = names.filter(|name| name.extension() == written.extension());
    let mut alike: Vec<_> = alike.map(|name| written.with_file_name(name).to_string_lossy().into_owned()).collect();
    alike.sort();
    alike
}
