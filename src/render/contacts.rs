//! Solids that bend light and touch: a ray crosses the boundaries of both at once.
//!
//! Where two solids share a face, only one of the two boundaries is reported, and the ray goes on beyond
//! both. So at a hit of one, the points just before and just behind the boundary tell which of its
//! neighbours the ray leaves or enters there too. Analytic solids only: whether a point lies inside
//! a mesh is not known; let meshes overlap a little, or leave a gap.

use crate::geom::{Bounds, ShapeSet};
use crate::scene::{AnyShapes, Object, Scene};
use crate::with_shapes;
use glam::DVec3;
use std::collections::HashMap;

/// Object and primitive.
pub type Id = [u32; 2];

/// Which solids may touch which.
#[derive(Debug, Default)]
pub struct Contacts {
    neighbours: HashMap<Id, Vec<Id>>,
}

/// More solids than this are not looked at: looking takes the square of what overlaps along one axis.
const MOST_SOLIDS: usize = 50_000;

/// How much wider than its box a solid is looked for, of its size and its distance from the
/// origin: more than a ray is moved off a surface.
const REACH: f64 = 1e-6;

impl Contacts {
    /// Those of `scene`: pairs of refracting solids whose boxes meet.
    #[must_use]
    pub fn of(scene: &Scene) -> Self {
        let mut boxes = solids(scene);
        let mut contacts = Self::default();
        if boxes.len() > MOST_SOLIDS {
            return contacts;
        }
        boxes.sort_by(|a, b| a.1.lo.x.total_cmp(&b.1.lo.x));
        for (i, (id, own)) in boxes.iter().enumerate() {
            let from_here = boxes[i + 1..].iter().take_while(|(_, other)| other.lo.x <= own.hi.x);
            for (other, theirs) in from_here.filter(|(_, other)| own.meets(other)).map(|(id, b)| (*id, b)) {
                debug_assert!(!theirs.is_empty());
                contacts.neighbours.entry(*id).or_default().push(other);
                contacts.neighbours.entry(other).or_default().push(*id);
            }
        }
        contacts
    }

    /// Materials of the neighbours of `id` that a ray leaves, and of those it enters, on the way between the
    /// points before and behind the boundary that `both_sides` tells.
    #[inline]
    #[must_use]
    pub fn crossed(&self, scene: &Scene, id: Id, both_sides: impl Fn() -> (DVec3, DVec3)) -> Option<Crossed> {
        if self.neighbours.is_empty() {
            return None;
        }
        let neighbours = self.neighbours.get(&id)?;
        let (before, behind) = both_sides();
        let mut crossed = Crossed::default();
        for &[geom, prim] in neighbours {
            let Object::Shapes(shapes) = &scene.objects[geom as usize] else { continue };
            let inside = |p: DVec3| with_shapes!(&shapes.set, set => set.contains(prim, p));
            let material = shapes.materials[prim as usize];
            match (inside(before), inside(behind)) {
                (true, false) => crossed.left.push(material),
                (false, true) => crossed.entered.push(material),
                _ => {}
            }
        }
        (crossed != Crossed::default()).then_some(crossed)
    }
}

/// What a ray crosses beside the boundary that it met.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Crossed {
    /// Materials of the solids left.
    pub left: Vec<u32>,
    /// Materials of the solids entered.
    pub entered: Vec<u32>,
}

/// The solids that bend light, with their boxes a little wider.
fn solids(scene: &Scene) -> Vec<(Id, Bounds)> {
    let bends = |material: u32| {
        let m = &scene.materials[material as usize];
        m.refracts() && m.ior != 1.0
    };
    let mut found = Vec::new();
    for (geom, object) in (0..).zip(&scene.objects) {
        let Object::Shapes(shapes) = object else { continue };
        if matches!(shapes.set, AnyShapes::Quads(_)) {
            continue;
        }
        let of_shape = |prim: u32| with_shapes!(&shapes.set, set => set.bounds(prim));
        let bending = (0..shapes.set.len()).filter(|&prim| bends(shapes.materials[prim as usize]));
        found.extend(bending.map(|prim| ([geom, prim], wider(of_shape(prim)))));
        if found.len() > MOST_SOLIDS {
            break;
        }
    }
    found
}

fn wider(b: Bounds) -> Bounds {
    let by = REACH * (b.size() + b.lo.abs().max(b.hi.abs())).max_element();
    Bounds { lo: b.lo - by, hi: b.hi + by }
}
