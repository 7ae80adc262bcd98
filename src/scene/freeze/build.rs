//! Puts the scene together.

use super::mesh::MeshFile;
use super::palette::{self, Palette};
use super::place;
use super::placed::{Placed, shape_to_world};
use super::plan::Plan;
use super::shapes::{Class, OneShape, Sets};
use crate::math::Frame;
use crate::scene::desc::{Falloff, LightDesc, ObjectDesc, SceneDesc};
use crate::scene::format::Mistakes;
use crate::scene::{Error, Light, Material, MeshPaint, Object};
use glam::{DAffine3, Vec3};

/// The materials of the scene.
pub struct Materials {
    pub all: Vec<Material>,
    /// Where those of each mesh file begin.
    pub firsts: Vec<u32>,
}

impl Materials {
    /// Those in use, then those of each mesh file. `numbers` has the number of each slot's image.
    pub fn of(
        desc: &SceneDesc,
        palette: &Palette,
        plan: &Plan,
        meshes: &[MeshFile],
        numbers: &[Option<u32>],
        frame: &Frame,
    ) -> Self {
        let unit = frame.world_per_local();
        let named = palette.entries.iter().zip(&plan.slots).map(|(entry, slot)| match entry {
            Some(i) => palette::material(&desc.materials[*i], slot.and_then(|slot| numbers[slot]), unit),
            None => Material::default(),
        });
        let mut all: Vec<Material> = named.collect();
        let firsts = meshes.iter().map(|mesh| {
            let first = all.len() as u32;
            all.extend(mesh.materials(numbers));
            first
        });
        let firsts = firsts.collect();
        if all.is_empty() {
            all.push(Material::default());
        }
        Self { all, firsts }
    }
}

/// The light in scene space. One that gives none is dropped, unless it is to be kept.
pub fn light(desc: &LightDesc, frame: &Frame, keep: bool) -> Option<Light> {
    let color = palette::rgb(desc.color.into());
    let unit = frame.world_per_local();
    let falloff = (unit * unit).clamp(f64::MIN_POSITIVE, f64::MAX);
    (color != Vec3::ZERO || keep).then(|| Light {
        position: frame.to_local(desc.position),
        color,
        radius: desc.radius * frame.local_per_world(),
        falloff: (desc.falloff == Falloff::InverseSquare).then_some(falloff),
    })
}

/// Puts the objects together.
pub struct Builder<'a> {
    pub palette: Palette,
    pub plan: Plan,
    pub placed: Placed,
    /// Where the materials of each mesh file begin.
    pub firsts: Vec<u32>,
    pub mistakes: &'a Mistakes,
}

/// An object of the scene in the order of first use.
enum Slot {
    Mesh(Object),
    Set(Class),
}

impl Builder<'_> {
    /// Meshes each by itself, shapes in one set for each class, in the order of first use.
    pub fn objects(&self, objects: &[ObjectDesc], files: Vec<MeshFile>) -> Result<Vec<Object>, Error> {
        let (mut slots, mut sets) = (Vec::new(), Sets::default());
        let mut meshes = self.meshes(files).into_iter();
        let mut seen = Vec::new();
        for (object, &material) in objects.iter().zip(&self.palette.of_object) {
            let Ok(Some(shape)) = OneShape::of(&object.shape) else {
                slots.extend(meshes.next().map(Slot::Mesh));
                continue;
            };
            let to_scene = place::to_scene(&self.placed.frame, &shape_to_world(object, &shape));
            match sets.add(shape, &to_scene, material) {
                Ok(class) if seen.contains(&class) => {}
                Ok(class) => {
                    seen.push(class);
                    slots.push(Slot::Set(class));
                }
                Err(e) => self.mistakes.add(object.place, format!("object `{}`: {e}", object.name)),
            }
        }
        self.mistakes.check()?;
        let object = |slot| match slot {
            Slot::Mesh(object) => object,
            Slot::Set(class) => Object::Shapes(sets.take(class)),
        };
        Ok(slots.into_iter().map(object).collect())
    }

    /// The objects that are meshes, in their order.
    fn meshes(&self, files: Vec<MeshFile>) -> Vec<Object> {
        let mut shown_by = vec![Vec::new(); files.len()];
        for (number, of) in self.plan.uses.iter().enumerate() {
            shown_by[of.source].push(number);
        }
        let mut meshes: Vec<Option<Object>> = vec![None; self.plan.uses.len()];
        for (file, numbers) in files.into_iter().zip(shown_by) {
            if let [number] = numbers[..] {
                let smooth = self.plan.uses[number].smooth;
                let mesh = file.into_mesh(&self.to_scene(number), smooth, self.paint(number));
                meshes[number] = Some(Object::Mesh(mesh));
                continue;
            }
            let shared = file.into_shared(numbers.iter().map(|&number| self.plan.uses[number].smooth));
            for number in numbers {
                let smooth = self.plan.uses[number].smooth;
                meshes[number] = Some(shared.instance(self.to_scene(number), smooth, self.paint(number)));
            }
        }
        meshes.into_iter().flatten().collect()
    }

    fn to_scene(&self, number: usize) -> DAffine3 {
        place::to_scene(&self.placed.frame, &self.placed.meshes[number])
    }

    fn paint(&self, number: usize) -> MeshPaint {
        let of = self.plan.uses[number];
        match of.material {
            Palette::OWN => MeshPaint::PerFace(self.firsts[of.source]),
            material => MeshPaint::One(material),
        }
    }
}
