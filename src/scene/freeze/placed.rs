//! The scene's frame, and where things stand in the world.

use super::mesh::MeshFile;
use super::place;
use super::plan::Use;
use super::shapes::OneShape;
use crate::geom::{self, Bounds, ShapeError};
use crate::math::Frame;
use crate::scene::Error;
use crate::scene::desc::{ObjectDesc, SceneDesc};
use crate::scene::format::Mistakes;
use glam::{DAffine3, DVec3};

/// Where the meshes stand, and a frame for all there is.
pub struct Placed {
    pub frame: Frame,
    /// From its file's stored coordinates to the world, for each object that is a mesh.
    pub meshes: Vec<DAffine3>,
}

impl Placed {
    /// Places the objects of `desc`; `uses` and `files` are its meshes. What cannot be placed is a mistake.
    pub fn of(desc: &SceneDesc, uses: &[Use], files: &[MeshFile], mistakes: &Mistakes) -> Result<Self, Error> {
        /// Things that the frame is chosen by; there may be millions.
        const ENOUGH: usize = 1 << 14;
        let step = desc.objects.len().div_ceil(ENOUGH).max(1);
        let (mut things, mut all, mut meshes) = (Vec::new(), Bounds::EMPTY, Vec::with_capacity(uses.len()));
        for (i, object) in desc.objects.iter().enumerate() {
            let found = match OneShape::of(&object.shape) {
                Ok(Some(shape)) => Ok(place_shape(object, &shape)),
                Ok(None) => place_mesh(object, &files[uses[meshes.len()].source], &mut meshes),
                Err(e) => Err(e),
            };
            match found {
                Ok((bounds, middle)) if bounds.lo.is_finite() && bounds.hi.is_finite() => {
                    all = all.union(bounds);
                    if i % step == 0 {
                        things.push(thing(bounds, middle));
                    }
                }
                Ok(_) => {
                    mistakes.add(object.place, format!("object `{}` reaches further than numbers do", object.name))
                }
                Err(e) => mistakes.add(object.place, format!("object `{}`: {e}", object.name)),
            }
        }
        mistakes.check()?;
        Ok(Self { frame: Frame::around(&things, (all.lo, all.hi)), meshes })
    }
}

/// Box and middle of a shape in the world.
fn place_shape(object: &ObjectDesc, shape: &OneShape) -> (Bounds, DVec3) {
    let bounds = shape.bounds(&shape_to_world(object, shape));
    (bounds, bounds.center())
}

/// From a shape's own space to the world.
pub fn shape_to_world(object: &ObjectDesc, shape: &OneShape) -> DAffine3 {
    place::to_world(&object.transform, DAffine3::IDENTITY, |so_far| shape.bounds(so_far))
}

/// The same of a mesh, whose middle is that of its frame: few of its corners are far from there.
fn place_mesh(object: &ObjectDesc, file: &MeshFile, meshes: &mut Vec<DAffine3>) -> Result<(Bounds, DVec3), ShapeError> {
    let from_file = place::from_file(&file.frame);
    let to_world = place::to_world(&object.transform, from_file, |so_far| file.bounds_under(so_far));
    meshes.push(to_world);
    geom::invert(&to_world)?;
    Ok((file.rough_bounds_under(&to_world), to_world.translation))
}

/// The middle of something, kept inside its box, and how far it reaches from there.
fn thing(bounds: Bounds, middle: DVec3) -> (DVec3, f64) {
    let middle = middle.clamp(bounds.lo, bounds.hi);
    let half = (bounds.hi - middle).max(middle - bounds.lo).max_element();
    (middle, half.max(f64::MIN_POSITIVE))
}
