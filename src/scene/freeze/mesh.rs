//! Mesh files, and the objects that show them.

use super::assets::{Assets, Progress};
use super::mtl;
use crate::geom::{self, TriangleMesh};
use crate::math::Frame;
use crate::scene::obj::{self, CornerData, MtlMaterial, Uv};
use crate::scene::{Error, Instance, Material, Mesh, MeshData, MeshPaint, Object, Skip, Warning, read_mesh, smooth};
use glam::{DAffine3, DMat3, Vec3};
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::sync::Arc;

/// A mesh as its file has it.
#[derive(Debug)]
pub struct MeshFile {
    /// Where the stored points lie in the file's coordinates.
    pub frame: Frame,
    triangles: TriangleMesh,
    normals: Option<CornerData>,
    uvs: Option<CornerData>,
    face_materials: Option<Vec<u32>>,
    /// Its own materials and the slots of their images.
    materials: Vec<(MtlMaterial, Option<usize>)>,
}

/// What of a mesh file is wanted.
#[derive(Clone, Copy, Debug)]
pub struct Wanted {
    /// Texture coordinates.
    pub uv: Uv,
    /// Its own materials.
    pub materials: bool,
    /// The file counts v downwards, as images do.
    pub v_down: bool,
}

impl MeshFile {
    /// Reads the file at `path`; bytes done and in all go to `progress`.
    pub fn read(path: &Path, wanted: Wanted, assets: &mut Assets<'_>, progress: Progress<'_>) -> Result<Self, Error> {
        let read = obj::ReadOptions {
            reader: assets.options.reader,
            normals: true,
            uv: if assets.options.exact || !assets.options.skips.has(Skip::Uv) { Uv::Always } else { wanted.uv },
            materials: wanted.materials,
            rests: assets.options.exact,
            allow: &assets.options.allow,
            cancel: assets.options.cancel,
            free_memory: assets.options.free_memory,
            progress,
        };
        let file = read_mesh(path, &read)?;
        assets.meshes.push(path.to_owned());
        assets.warnings.extend(file.warnings);
        assets.unused.materials += file.counts.unused_materials as usize;
        assets.unused.textures += file.counts.unused_images as usize;
        let mut triangles = TriangleMesh::new(file.points, file.faces);
        if let Some(rests) = file.rests {
            triangles = triangles.with_rests(rests);
        }
        if triangles.bounds().is_empty() {
            return Err(Error::NothingToHit { path: path.to_owned(), faces: triangles.face_count() });
        }
        let slots = file.materials.iter().map(|m| m.map_kd.as_deref().map(|path| assets.images.want(path, false)));
        let slots: Vec<_> = slots.collect();
        let sampled = wanted.uv == Uv::Always || slots.iter().any(Option::is_some);
        let mut uvs = file.uvs;
        match &mut uvs {
            Some(uvs) if !wanted.v_down => turn_v(uvs),
            None if sampled => {
                let what = "it has no texture coordinates: the images of its materials are not shown";
                assets.warnings.push(Warning::about(path, what.into()));
            }
            _ => {}
        }
        Ok(Self {
            frame: file.frame,
            triangles,
            normals: file.normals,
            uvs,
            face_materials: file.face_materials,
            materials: file.materials.into_iter().zip(slots).collect(),
        })
    }

    /// Box around all that can be hit where `to` takes it.
    pub fn bounds_under(&self, to: &DAffine3) -> geom::Bounds {
        self.triangles.bounds_under(to)
    }

    /// Box around the box of all that can be hit, where `to` takes that.
    pub fn rough_bounds_under(&self, to: &DAffine3) -> geom::Bounds {
        self.triangles.bounds().under(to)
    }

    /// Whether it has normals of its own.
    pub fn has_normals(&self) -> bool {
        self.normals.is_some()
    }

    /// Its materials; `textures` has the number of each slot's image, if that could be read.
    pub fn materials(&self, textures: &[Option<u32>]) -> impl Iterator<Item = Material> {
        self.materials.iter().map(|(m, slot)| mtl::material(m, slot.and_then(|slot| textures[slot])))
    }

    /// The only object that shows it: its corners are taken to scene space.
    pub fn into_mesh(self, to_scene: &DAffine3, smooth: Option<f64>, paint: MeshPaint) -> Mesh {
        let mut normals = self.normals.or_else(|| smooth.map(|angle| smooth::crease_normals(&self.triangles, angle)));
        let mut triangles = self.triangles;
        if *to_scene != DAffine3::IDENTITY {
            triangles = triangles.moved(to_scene);
            if let Some(normals) = &mut normals {
                move_normals(normals, &geom::normal_matrix(&to_scene.matrix3));
            }
        }
        let data =
            MeshData { triangles: Arc::new(triangles), normals, uvs: self.uvs, face_materials: self.face_materials };
        Mesh { data: Arc::new(data), paint, mirrored: geom::mirrors(&to_scene.matrix3) }
    }

    /// For objects that share it: its data, with normals computed for each crease angle in `smooth` if
    /// it has none.
    pub fn into_shared(mut self, smooth: impl IntoIterator<Item = Option<f64>>) -> Shared {
        let own_normals = self.normals.is_some();
        let keys: BTreeSet<_> = smooth.into_iter().map(|angle| key(own_normals, angle)).collect();
        let (mut left, triangles) = (keys.len(), Arc::new(self.triangles));
        let kinds = keys.into_iter().map(|key| {
            left -= 1;
            // The last one need not copy.
            fn one<T: Clone>(of: &mut Option<T>, last: bool) -> Option<T> {
                if last { of.take() } else { of.clone() }
            }
            let computed = || key.map(|angle| smooth::crease_normals(&triangles, f64::from_bits(angle)));
            let data = MeshData {
                triangles: Arc::clone(&triangles),
                normals: one(&mut self.normals, left == 0).or_else(computed),
                uvs: one(&mut self.uvs, left == 0),
                face_materials: one(&mut self.face_materials, left == 0),
            };
            (key, Arc::new(data))
        });
        Shared { kinds: kinds.collect(), own_normals }
    }
}

/// Bits of the crease angle of computed normals.
type Key = Option<u64>;

fn key(own_normals: bool, smooth: Option<f64>) -> Key {
    if own_normals { None } else { smooth.map(f64::to_bits) }
}

/// A mesh that several objects show.
#[derive(Debug)]
pub struct Shared {
    kinds: BTreeMap<Key, Arc<MeshData>>,
    own_normals: bool,
}

impl Shared {
    /// One of those objects.
    pub fn instance(&self, to_scene: DAffine3, smooth: Option<f64>, paint: MeshPaint) -> Object {
        let data = &self.kinds[&key(self.own_normals, smooth)];
        let mirrored = geom::mirrors(&to_scene.matrix3);
        let mesh = Mesh { data: Arc::clone(data), paint, mirrored };
        Object::Instance(Instance::new(mesh, to_scene))
    }
}

/// Values or triangles in one unit of work.
const CHUNK: usize = 1 << 14;

/// From v upwards, as files have it, to v downwards, as images are stored.
fn turn_v(uvs: &mut CornerData) {
    uvs.values.par_chunks_mut(2 * CHUNK).for_each(|chunk| {
        for uv in chunk.chunks_exact_mut(2) {
            uv[1] = 1.0 - uv[1];
        }
    });
}

/// Takes normals where `matrix` does; those of length zero stay.
fn move_normals(normals: &mut CornerData, matrix: &DMat3) {
    normals.values.par_chunks_mut(3 * CHUNK).for_each(|chunk| {
        for n in chunk.chunks_exact_mut(3) {
            let moved = (*matrix * Vec3::from_slice(n).as_dvec3()).normalize_or_zero();
            n.copy_from_slice(&moved.as_vec3().to_array());
        }
    });
}
