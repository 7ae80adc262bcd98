//! Which files a scene needs and what of each.

use super::assets::{Assets, Finder};
use super::mesh::Wanted;
use super::palette::{self, Palette};
use crate::scene::desc::{MaterialDesc, SceneDesc, ShapeDesc};
use crate::scene::obj::Uv;
use crate::scene::{Skip, Unused};
use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};

/// A mesh file that objects show.
#[derive(Debug)]
pub struct Source {
    pub path: PathBuf,
    pub wanted: Wanted,
}

/// How an object shows a mesh file.
#[derive(Clone, Copy, Debug)]
pub struct Use {
    /// Index into [`Plan::sources`].
    pub source: usize,
    /// Crease angle of the normals, where the file has none.
    pub smooth: Option<f64>,
    /// Number of its material in the scene, or [`Palette::OWN`].
    pub material: u32,
}

/// What has to be read.
#[derive(Debug, Default)]
pub struct Plan {
    /// The slot of the image of each material in use.
    pub slots: Vec<Option<usize>>,
    pub sources: Vec<Source>,
    /// For each object that is a mesh, in their order.
    pub uses: Vec<Use>,
}

impl Plan {
    /// What the materials in use and the objects of `desc` need. What is not found is told by `finder`.
    pub fn of(
        desc: &SceneDesc,
        palette: &Palette,
        v_down: bool,
        assets: &mut Assets<'_>,
        finder: &mut Finder<'_>,
    ) -> Self {
        let mut plan = Self { slots: plan_images(desc, palette, assets, finder), ..Self::default() };
        if !assets.options.skips.has(Skip::UnusedAssets) {
            // After the others: their numbers stay.
            for texture in desc.materials.iter().filter_map(|m| m.texture.as_ref()) {
                let found = finder.find_quietly(&texture.path);
                found.map(|path| assets.images.want(&path, texture.nearest));
            }
        }
        let mut known: HashMap<PathBuf, usize> = HashMap::new();
        for (object, &material) in desc.objects.iter().zip(&palette.of_object) {
            let ShapeDesc::Mesh { path, smooth, place } = &object.shape else { continue };
            let Some(path) = finder.find(path, *place) else { continue };
            let next = plan.sources.len();
            let source = *known.entry(path).or_insert_with_key(|path| {
                let wanted = Wanted { uv: Uv::Never, materials: false, v_down };
                plan.sources.push(Source { path: path.clone(), wanted });
                next
            });
            let Source { wanted, .. } = &mut plan.sources[source];
            wanted.materials |= material == Palette::OWN;
            wanted.uv = wanted.uv.max(match plan.slots.get(material as usize) {
                _ if material == Palette::OWN => Uv::IfTextured,
                Some(Some(_)) => Uv::Always,
                _ => Uv::Never,
            });
            plan.uses.push(Use { source, smooth: assets.options.smooth.or(*smooth), material });
        }
        plan
    }
}

fn plan_images(
    desc: &SceneDesc,
    palette: &Palette,
    assets: &mut Assets<'_>,
    finder: &mut Finder<'_>,
) -> Vec<Option<usize>> {
    let mut slot = |m: &MaterialDesc| {
        let texture = m.texture.as_ref().filter(|_| palette::samples(m))?;
        Some(assets.images.want(&finder.find(&texture.path, texture.place)?, texture.nearest))
    };
    palette.entries.iter().map(|entry| slot(&desc.materials[(*entry)?])).collect()
}

/// Materials that no object has, images that nothing samples, lights that give none.
pub fn unused(desc: &SceneDesc, palette: &Palette) -> Unused {
    let used = || palette.entries.iter().flatten().map(|&i| &desc.materials[i]);
    let image = |m: &MaterialDesc| m.texture.as_ref().map(|t| t.path.clone());
    let sampled: HashSet<PathBuf> = used().filter(|m| palette::samples(m)).filter_map(image).collect();
    let named: HashSet<&Path> = desc.materials.iter().filter_map(|m| Some(&*m.texture.as_ref()?.path)).collect();
    Unused {
        materials: desc.materials.len() - used().count(),
        textures: named.iter().filter(|p| !sampled.contains(**p)).count(),
        lights: desc.lights.iter().filter(|l| l.color == [0.0; 3]).count(),
    }
}
