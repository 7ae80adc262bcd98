//! Which triangles, shapes and edges there are to aim at.

use crate::geom::{BAD_FACE, TriangleMesh};
use crate::math::Random;
use crate::scene::{Object, Scene};
use rayon::prelude::*;
use std::collections::HashMap;
use std::sync::Arc;

/// An edge and the one or two faces that have it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Outline {
    pub(super) edge: [u32; 2],
    pub(super) face: u32,
    pub(super) other: Option<u32>,
}

/// Primitives of all objects.
#[derive(Debug)]
pub(super) struct Targets<'a> {
    scene: &'a Scene,
    /// Primitives up to and with each object.
    up_to: Vec<usize>,
    /// Edges of each object that is a mesh; those of the same mesh are shared.
    outlines: Vec<Option<Arc<Vec<Outline>>>>,
}

/// Faces of a mesh whose edges are found; of larger ones a window.
const MOST_FACES: usize = 1 << 21;

impl<'a> Targets<'a> {
    pub(super) fn of(scene: &'a Scene, seed: u32) -> Self {
        let mut sum = 0;
        let count = |object: &Object| match object {
            Object::Shapes(shapes) => shapes.set.len() as usize,
            Object::Mesh(mesh) => mesh.data.triangles.face_count(),
            Object::Instance(instance) => instance.mesh.data.triangles.face_count(),
        };
        let up_to = scene.objects.iter().map(|object| {
            sum += count(object);
            sum
        });
        let up_to = up_to.collect();
        let mut known = HashMap::new();
        let outlines = scene.objects.iter().map(|object| {
            let triangles = &object.mesh()?.data.triangles;
            let of = known.entry(Arc::as_ptr(triangles)).or_insert_with(|| Arc::new(outlines(triangles, seed)));
            Some(Arc::clone(of))
        });
        let outlines = outlines.collect();
        Self { scene, up_to, outlines }
    }

    /// Object and primitive: half of the time every object is as likely as any other, else every primitive.
    pub(super) fn pick(&self, random: &mut Random) -> Option<(u32, u32)> {
        const TRIES: usize = 16;
        let total = *self.up_to.last().filter(|&&total| total > 0)?;
        (0..TRIES).find_map(|_| {
            let geom = if random.flip() {
                random.below(self.up_to.len())
            } else {
                let prim = random.below(total);
                self.up_to.partition_point(|&end| end <= prim)
            };
            let count = self.up_to[geom] - if geom == 0 { 0 } else { self.up_to[geom - 1] };
            if count == 0 {
                return None;
            }
            let prim = random.below(count) as u32;
            let mesh = self.scene.objects[geom].mesh();
            let good = mesh.is_none_or(|m| m.data.triangles.faces()[prim as usize] != BAD_FACE);
            good.then_some((geom as u32, prim))
        })
    }

    /// An edge of the mesh of object `geom`.
    pub(super) fn outline(&self, geom: u32, random: &mut Random) -> Option<Outline> {
        let all = self.outlines[geom as usize].as_ref().filter(|all| !all.is_empty())?;
        Some(all[random.below(all.len())])
    }
}

/// The edges of a mesh, in order of their corners.
fn outlines(mesh: &TriangleMesh, seed: u32) -> Vec<Outline> {
    let window = mesh.face_count().min(MOST_FACES);
    let first = Random::of(seed, u32::MAX, 0).below(mesh.face_count() - window + 1);
    let faces = &mesh.faces()[first..first + window];
    let sides = |(i, face): (usize, &[u32; 3])| {
        let [a, b, c] = *face;
        let sides = if *face == BAD_FACE { [None; 3] } else { [(a, b), (b, c), (c, a)].map(Some) };
        let number = (first + i) as u32;
        sides.into_iter().flatten().map(move |(a, b)| ([a.min(b), a.max(b)], number)).collect::<Vec<_>>()
    };
    let mut sides: Vec<([u32; 2], u32)> = faces.par_iter().enumerate().flat_map_iter(sides).collect();
    sides.par_sort_unstable();
    let of_edge =
        |same: &[([u32; 2], u32)]| Outline { edge: same[0].0, face: same[0].1, other: same.get(1).map(|side| side.1) };
    sides.chunk_by(|a, b| a.0 == b.0).map(of_edge).collect()
}
