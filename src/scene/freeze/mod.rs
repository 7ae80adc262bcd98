//! From the description of a scene to the scene itself.
//!
//! Everything is placed in f64. A mesh that one object shows is taken to scene space; one that
//! several show is stored once in a space of its own, and each shows it through a transform. What
//! no object needs is not read.

mod assets;
mod build;
mod images;
mod mesh;
mod mtl;
mod palette;
mod place;
mod placed;
mod plan;
mod shapes;
mod single;

pub use assets::Assets;
pub use mesh::{MeshFile, Wanted};
pub use shapes::OneShape;

use super::desc::SceneDesc;
use super::format::{self, Format, Mistakes};
use super::texture::Encoding;
use super::{Error, LoadOptions, Loaded, Scene, Skip};
use assets::{Finder, Progress};
use build::{Builder, Materials};
use glam::Vec3;
use palette::Palette;
use placed::Placed;
use plan::{Plan, Source};
use std::path::Path;

/// Reads the scene file at `path` and all that it needs.
pub fn load(path: &Path, options: &LoadOptions<'_>) -> Result<Loaded, Error> {
    let length = std::fs::metadata(path).map_or(0, |meta| meta.len());
    options.free_memory.check(path, || "the text".into(), length)?;
    let text = std::fs::read(path).map_err(|source| Error::Read { path: path.to_owned(), source })?;
    load_text(path, text, options)
}

/// The same with `text` for the content of the file.
pub fn load_text(path: &Path, text: Vec<u8>, options: &LoadOptions<'_>) -> Result<Loaded, Error> {
    let needed = format::memory_needed(Format::of(path), &text);
    options.free_memory.check(path, || "a scene of this length".into(), needed)?;
    let read = format::ReadOptions { overrides: options.overrides.clone(), allow: options.allow.clone() };
    let (desc, diagnostics, mistakes) = format::parse_keeping(path, &text, &read).map_err(Error::Scene)?;
    drop(text);
    let course = desc.render.course_rules || Format::of(path) == Some(Format::Ray);
    let mut assets = Assets::new(options, if course { Encoding::Linear } else { Encoding::Srgb });
    let palette = Palette::of(&desc);
    assets.unused = plan::unused(&desc, &palette);

    let mut finder = Finder::new(path, &options.allow, &mistakes);
    let plan = Plan::of(&desc, &palette, course, &mut assets, &mut finder);
    mistakes.check()?;
    read_images(&desc, &palette, &plan, &mut assets, &mistakes)?;
    let named = assets.images.len();
    let meshes = read_meshes(&plan.sources, &mut assets)?;
    assets.read_images_of_meshes(named)?;

    let files = assets.files(desc.files.clone());
    let placed = Placed::of(&desc, &plan.uses, &meshes, &mistakes)?;
    let Assets { images, warnings, unused, .. } = assets;
    let (textures, numbers, texture_seconds) = images.finish();
    let frame = placed.frame;
    let materials = Materials::of(&desc, &palette, &plan, &meshes, &numbers, &frame);
    let SceneDesc { render, cameras, lights, objects, .. } = desc;
    let keep_dark = !options.skips.has(Skip::DarkLights);
    let mut lights: Vec<_> = lights.iter().filter_map(|l| build::light(l, &frame, keep_dark)).collect();
    // The dark ones come last: samples at the others go by their numbers.
    lights.sort_by_key(|l| l.color == Vec3::ZERO);
    let builder = Builder { palette, plan, placed, firsts: materials.firsts, mistakes: &mistakes };
    let scene = Scene {
        frame,
        objects: builder.objects(&objects, meshes)?,
        materials: materials.all,
        textures,
        lights,
        ambient: palette::rgb(render.ambient.unwrap_or_default().into()),
        background: palette::rgb(render.background.unwrap_or_default().into()),
        course_rules: render.course_rules,
    };
    Ok(Loaded { scene, render, cameras, diagnostics, warnings, unused, files, texture_seconds })
}

/// Reads the images of the materials in use.
fn read_images(
    desc: &SceneDesc,
    palette: &Palette,
    plan: &Plan,
    assets: &mut Assets<'_>,
    mistakes: &Mistakes,
) -> Result<(), Error> {
    assets.images.read(assets.options)?;
    let textures = palette.entries.iter().map(|entry| desc.materials[(*entry)?].texture.as_ref());
    let mut told = vec![false; assets.images.len()];
    for (texture, slot) in textures.zip(&plan.slots) {
        let (Some(texture), Some(slot)) = (texture, *slot) else { continue };
        if let Some((path, why)) = assets.images.fault(slot)
            && !std::mem::replace(&mut told[slot], true)
        {
            mistakes.add(texture.place, format!("the image {} {why}", path.display()));
        }
    }
    mistakes.check()
}

/// Reads the mesh files one after the other: the reader keeps all threads busy.
fn read_meshes(sources: &[Source], assets: &mut Assets<'_>) -> Result<Vec<MeshFile>, Error> {
    // Each file is gone over twice.
    let sizes = sources.iter().map(|s| std::fs::metadata(&s.path).map_or(0, |meta| 2 * meta.len()));
    let sizes: Vec<u64> = sizes.collect();
    let (mut before, total) = (0, sizes.iter().sum());
    let read = |(source, size): (&Source, u64)| {
        let tell = assets.options.progress;
        // What a compressed file holds is larger than the file.
        let of_all = |done: u64, all: u64| {
            if let Some(tell) = tell {
                let done = (done as f64 / all.max(1) as f64 * size as f64) as u64;
                tell((before + done).min(total), total);
            }
        };
        let progress: Progress<'_> = if tell.is_some() { Some(&of_all) } else { None };
        let mesh = MeshFile::read(&source.path, source.wanted, assets, progress);
        before += size;
        mesh
    };
    sources.iter().zip(sizes).map(read).collect()
}
