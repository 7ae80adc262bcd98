//! Everything there is to hit, and whose it is.

use super::build::{Source, build, numbers, owner};
use super::bvh::{Apart, Bvh, Child};
use super::held::Held;
use super::placed::Placed;
use super::ray::Line;
use super::traverse::{Best, SMALL_STACK, STACK, Slot, Space, Waiting, Walk};
use super::{BuildError, BuildOptions};
use crate::geom::triangle::TriangleHit;
use crate::geom::{Hit, Hit64, Ray, ShapeSet};
use crate::scene::{AnyShapes, MeshData, Object};
use crate::with_shapes;
use core::fmt;
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use std::collections::HashMap;
use std::sync::Arc;

/// What an object is, beyond the boxes and triangles in the scene's hierarchy.
enum Thing {
    Mesh,
    Shapes(AnyShapes),
    Placed(Placed),
}

/// The hierarchy of the scene, and those of the meshes placed in it.
pub(super) struct World {
    bvh: Bvh,
    /// Number of the first thing of each object. Faces and shapes are counted through all
    /// objects; a placed mesh counts as one thing.
    first: Vec<u32>,
    things: Vec<Thing>,
    /// What is placed, each once.
    meshes: Vec<Bvh>,
    /// Most children that wait at once, in the scene and in a mesh.
    pub(super) stack_len: usize,
    pub(super) has_shapes: bool,
    /// Most bytes that the builds held at once.
    pub(super) peak_bytes: u64,
}

impl World {
    pub(super) fn build(objects: &[Object], options: &BuildOptions<'_>) -> Result<Self, BuildError> {
        let held = Held::new(options.memory_limit);
        let (meshes, which) = placed_meshes(objects);
        let meshes = meshes.into_par_iter().map(|data| {
            let source = [Source::Mesh(&data.triangles)];
            build(&source, &numbers(&source)?, options, &held)
        });
        let meshes: Vec<Bvh> = meshes.collect::<Result<_, _>>()?;
        let sources: Vec<_> = objects.iter().map(source).collect();
        let first = numbers(&sources)?;
        let bvh = build(&sources, &first, options, &held)?;
        let things = objects.iter().enumerate().map(|(object, o)| match o {
            Object::Mesh(_) => Ok(Thing::Mesh),
            Object::Shapes(shapes) => Ok(Thing::Shapes(shapes.set.clone())),
            Object::Instance(instance) => {
                let mesh = which[&Arc::as_ptr(&instance.mesh.data)];
                let placed = Placed::new(mesh, &instance.to_scene);
                placed.map(Thing::Placed).map_err(|source| BuildError::Transform { object, source })
            }
        });
        let things = things.collect::<Result<Vec<_>, _>>()?;
        let stack_len = bvh.stack_len() + meshes.iter().map(Bvh::stack_len).max().unwrap_or(0);
        let has_shapes = things.iter().any(|t| matches!(t, Thing::Shapes(_)));
        Ok(Self { bvh, first, things, meshes, stack_len, has_shapes, peak_bytes: held.peak() })
    }

    pub(super) fn bytes(&self) -> usize {
        let meshes: usize = self.meshes.iter().map(Bvh::bytes).sum();
        self.bvh.bytes() + meshes + size_of_val(&self.first[..]) + size_of_val(&self.things[..])
    }

    /// The nearest hit of `ray`; the lowest ids among equal `t`.
    pub(super) fn nearest(&self, ray: &Ray) -> Option<Hit> {
        let mut walk = Walk::new(ray)?;
        self.walk::<false>(&mut walk);
        walk.best().map(|best| self.hit(best))
    }

    /// Whether `ray` meets anything.
    pub(super) fn any(&self, ray: &Ray) -> bool {
        Walk::new(ray).is_some_and(|mut walk| self.walk::<true>(&mut walk))
    }

    #[inline]
    fn walk<const ANY: bool>(&self, walk: &mut Walk) -> bool {
        const NONE: Waiting = (0.0, Child::NONE);
        match self.stack_len {
            0 => false,
            1..=SMALL_STACK => walk.descend::<ANY, Self>(self, Child::ROOT, &mut [NONE; SMALL_STACK]),
            n if n <= STACK => walk.descend::<ANY, Self>(self, Child::ROOT, &mut [NONE; STACK]),
            _ => walk.descend::<ANY, Self>(self, Child::ROOT, &mut [NONE; 2 * STACK]),
        }
    }

    /// The shape in a leaf, if there is one in it.
    #[inline]
    pub(super) fn shape(&self, leaf: Child) -> Option<Shape<'_>> {
        let Apart { object, prim } = self.bvh.apart[self.bvh.apart_index(leaf)?];
        let Thing::Shapes(set) = &self.things[object as usize] else { return None };
        Some(Shape { set, prim, id: self.first[object as usize] + prim })
    }

    /// The best hit of a ray in f64 as it is reported.
    pub(super) fn hit_exact(&self, best: &Best) -> Hit64 {
        let (geom_id, prim_id) = owner(&self.first, best.id);
        let prim_id = match &self.things[geom_id as usize] {
            Thing::Mesh | Thing::Shapes(_) => prim_id,
            Thing::Placed(placed) => best.at.id(&self.meshes[placed.mesh as usize]),
        };
        let TriangleHit { t, u, v } = best.hit;
        Hit64 { t, u, v, prim_id, geom_id }
    }

    /// The best hit as it is reported.
    pub(super) fn hit(&self, best: &Best) -> Hit {
        let (geom_id, prim_id) = owner(&self.first, best.id);
        let (prim_id, ng) = match &self.things[geom_id as usize] {
            Thing::Mesh => (prim_id, to_f32(best.at.normal(&self.bvh))),
            Thing::Shapes(_) => (prim_id, Vec3::ZERO),
            Thing::Placed(placed) => {
                let mesh = &self.meshes[placed.mesh as usize];
                (best.at.id(mesh), to_f32(placed.normal(best.at.normal(mesh))))
            }
        };
        let TriangleHit { t, u, v } = best.hit;
        // A `t` beyond f32 is still a hit, and inside every interval without end.
        Hit { t: (t as f32).min(f32::MAX), u: u as f32, v: v as f32, ng, prim_id, geom_id }
    }
}

/// A shape of the scene.
pub(super) struct Shape<'a> {
    pub(super) set: &'a AnyShapes,
    /// Its number in the set.
    pub(super) prim: u32,
    /// Its number in the scene.
    id: u32,
}

impl Shape<'_> {
    /// A hit at `t`; the rest is for who refines it.
    pub(super) fn hit(&self, t: f64) -> Best {
        Best { hit: TriangleHit { t, u: 0.0, v: 0.0 }, id: self.id, at: Slot::NONE }
    }
}

impl Space for World {
    const PLACED: bool = false;

    #[inline]
    fn bvh(&self) -> &Bvh {
        &self.bvh
    }

    fn apart<const ANY: bool>(&self, walk: &mut Walk, index: usize, stack: &mut [Waiting]) -> bool {
        let Apart { object, prim } = self.bvh.apart[index];
        let id = self.first[object as usize] + prim;
        match &self.things[object as usize] {
            Thing::Mesh => false,
            Thing::Shapes(set) => {
                let Line { o, d, t_near, t_far } = walk.line;
                let t = with_shapes!(set, set => set.hit(prim, o, d, t_near, t_far));
                t.is_some_and(|t| walk.offer(Shape { set, prim, id }.hit(t)))
            }
            Thing::Placed(placed) => {
                let mesh = &self.meshes[placed.mesh as usize];
                let Some(mut local) = placed.local(walk) else { return false };
                local.descend::<ANY, Bvh>(mesh, Child::ROOT, stack);
                local.best().is_some_and(|&best| walk.offer(Best { id, ..best }))
            }
        }
    }
}

fn source(object: &Object) -> Source<'_> {
    match object {
        Object::Mesh(mesh) => Source::Mesh(&mesh.data.triangles),
        Object::Shapes(shapes) => Source::Shapes(&shapes.set),
        Object::Instance(instance) => Source::Whole(instance.bounds()),
    }
}

/// The meshes that are placed, each once, and where in this list each is.
fn placed_meshes(objects: &[Object]) -> (Vec<&MeshData>, HashMap<*const MeshData, u32>) {
    let (mut meshes, mut which) = (Vec::new(), HashMap::new());
    for object in objects {
        if let Object::Instance(instance) = object {
            let data = &instance.mesh.data;
            which.entry(Arc::as_ptr(data)).or_insert_with(|| {
                meshes.push(&**data);
                meshes.len() as u32 - 1
            });
        }
    }
    (meshes, which)
}

/// A normal in f32; where its length does not fit it is made about 1.
fn to_f32(ng: DVec3) -> Vec3 {
    let largest = ng.abs().max_element();
    if (1e-30..1e30).contains(&largest) { ng.as_vec3() } else { (ng / largest).as_vec3() }
}

impl fmt::Debug for World {
    /// Counts: the hierarchies themselves would fill many screens.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("World")
            .field("objects", &self.things.len())
            .field("placed meshes", &self.meshes.len())
            .field("nodes", &self.bvh.nodes.len())
            .field("leaves", &(self.bvh.blocks.len() + self.bvh.apart.len()))
            .field("depth", &self.bvh.depth)
            .finish()
    }
}
