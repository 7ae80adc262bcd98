//! What there is to hit: meshes, placed copies of meshes, and sets of analytic shapes.

use super::Buffers;
use super::obj::CornerData;
use crate::geom::normal_matrix;
use crate::geom::{Affine, Bounds, Cube, Cylinder, ExactTriangle, Plain, Quad, ShapeSet, Sphere, TriangleMesh};
use glam::{DAffine3, DMat3, Vec2, Vec3};
use std::sync::Arc;

/// One geometry of every backend; its place in [`Scene::objects`](super::Scene::objects) is the `geom_id`.
#[derive(Clone, Debug)]
pub enum Object {
    /// A mesh whose corners are in scene space.
    Mesh(Mesh),
    /// A mesh in a space of its own, placed by a transform. Copies share its buffers and its hierarchy.
    Instance(Instance),
    /// Analytic shapes of one class, in scene space.
    Shapes(Shapes),
}

/// A mesh and what its surface is made of.
#[derive(Clone, Debug)]
pub struct Mesh {
    /// Triangles and what is known at their corners.
    pub data: Arc<MeshData>,
    /// Where its materials are.
    pub paint: MeshPaint,
    /// Its placement mirrors space: the winding's outside is the inside.
    pub mirrored: bool,
}

/// Triangles and what is known at their corners, shared by all that show them.
#[derive(Debug)]
pub struct MeshData {
    /// The triangles.
    pub triangles: Arc<TriangleMesh>,
    /// Normals at the corners; absent where the mesh is flat.
    pub normals: Option<CornerData>,
    /// Texture coordinates at the corners, v downwards as [`Texture::sample`](super::Texture::sample)
    /// takes it; absent where nothing samples them.
    pub uvs: Option<CornerData>,
    /// Material of each triangle, counted within the mesh's file; absent where one serves all.
    pub face_materials: Option<Vec<u32>>,
}

/// The materials of a mesh, as indices into [`Scene::materials`](super::Scene::materials).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MeshPaint {
    /// One for every triangle.
    One(u32),
    /// Those of its own file, which begin here.
    PerFace(u32),
}

/// A placed copy of a mesh.
#[derive(Clone, Debug)]
pub struct Instance {
    /// The mesh, in its own space.
    pub mesh: Mesh,
    /// From the mesh's space to scene space; can be undone.
    pub to_scene: DAffine3,
    /// What takes normals to scene space, up to their length.
    pub normal_to_scene: DMat3,
    /// How much of a coordinate's rounding one axis hands on to the others, there and back: 1
    /// for scales along the axes, at most 3 for turns, more where the two are mixed.
    spread: f64,
}

/// Shapes of one class and their materials.
#[derive(Clone, Debug)]
pub struct Shapes {
    /// The shapes.
    pub set: AnyShapes,
    /// Material of each shape.
    pub materials: Vec<u32>,
}

/// A set of shapes of one class. The plain ones need no transform of their own. No scene file makes the triangles.
#[derive(Clone, Debug)]
#[expect(missing_docs, reason = "the classes")]
pub enum AnyShapes {
    Spheres(Arc<Plain<Sphere>>),
    Cubes(Arc<Plain<Cube>>),
    PlacedSpheres(Arc<Affine<Sphere>>),
    PlacedCubes(Arc<Affine<Cube>>),
    Cylinders(Arc<Affine<Cylinder>>),
    Quads(Arc<Affine<Quad>>),
    Triangles(Arc<Plain<ExactTriangle>>),
}

/// Runs `$body` with `$set` bound to the [`Arc`] of whichever set it is.
#[macro_export]
#[doc(hidden)]
macro_rules! with_shapes {
    ($any:expr, $set:ident => $body:expr) => {
        match $any {
            $crate::scene::AnyShapes::Spheres($set) => $body,
            $crate::scene::AnyShapes::Cubes($set) => $body,
            $crate::scene::AnyShapes::PlacedSpheres($set) => $body,
            $crate::scene::AnyShapes::PlacedCubes($set) => $body,
            $crate::scene::AnyShapes::Cylinders($set) => $body,
            $crate::scene::AnyShapes::Quads($set) => $body,
            $crate::scene::AnyShapes::Triangles($set) => $body,
        }
    };
}

impl Object {
    /// The mesh, placed or not.
    #[inline]
    #[must_use]
    pub fn mesh(&self) -> Option<&Mesh> {
        match self {
            Self::Mesh(mesh) => Some(mesh),
            Self::Instance(instance) => Some(&instance.mesh),
            Self::Shapes(_) => None,
        }
    }

    /// Index of the material of primitive `prim`.
    #[inline]
    #[must_use]
    pub fn material(&self, prim: u32) -> u32 {
        match self {
            Self::Mesh(mesh) => mesh.material(prim),
            Self::Instance(instance) => instance.mesh.material(prim),
            Self::Shapes(shapes) => shapes.materials[prim as usize],
        }
    }

    /// Box around all of it that can be hit, in scene space.
    #[must_use]
    pub fn bounds(&self) -> Bounds {
        match self {
            Self::Mesh(mesh) => mesh.data.triangles.bounds(),
            Self::Instance(instance) => instance.bounds(),
            Self::Shapes(shapes) => {
                with_shapes!(&shapes.set, set => {
                    (0..set.len()).map(|i| set.bounds(i)).fold(Bounds::EMPTY, Bounds::union)
                })
            }
        }
    }
}

impl Mesh {
    /// Triangles and nothing else, of material 0.
    #[must_use]
    pub fn bare(triangles: impl Into<Arc<TriangleMesh>>) -> Self {
        let data = MeshData { triangles: triangles.into(), normals: None, uvs: None, face_materials: None };
        Self { data: Arc::new(data), paint: MeshPaint::One(0), mirrored: false }
    }

    /// Index of the material of triangle `prim`.
    #[inline]
    #[must_use]
    pub fn material(&self, prim: u32) -> u32 {
        match self.paint {
            MeshPaint::One(material) => material,
            MeshPaint::PerFace(first) => first + self.data.face_materials.as_ref().map_or(0, |m| m[prim as usize]),
        }
    }
}

impl MeshData {
    /// The texture coordinates at the corners of triangle `prim`; `None` unless there are all three.
    #[inline]
    #[must_use]
    pub fn uvs_of(&self, prim: u32) -> Option<[Vec2; 3]> {
        let uvs = self.uvs.as_ref()?;
        Some(uvs.three(uvs.of(self.triangles.faces(), prim as usize))?.map(Vec2::from_array))
    }

    /// Bytes of all buffers.
    #[must_use]
    pub fn buffers(&self) -> Buffers {
        let indices = size_of_val(self.triangles.faces());
        Buffers {
            positions: self.triangles.bytes() - indices,
            indices,
            normals: self.normals.as_ref().map_or(0, CornerData::bytes),
            uvs: self.uvs.as_ref().map_or(0, CornerData::bytes),
            face_materials: self.face_materials.as_ref().map_or(0, |m| size_of_val(&m[..])),
            ..Buffers::default()
        }
    }
}

impl Instance {
    /// `mesh` placed by `to_scene`, which can be undone.
    #[must_use]
    pub fn new(mesh: Mesh, to_scene: DAffine3) -> Self {
        let m = to_scene.matrix3;
        let inverse = m.inverse();
        let size = |m: DMat3| DMat3::from_cols(m.x_axis.abs(), m.y_axis.abs(), m.z_axis.abs());
        let rows = (size(m) * size(inverse)).transpose();
        let spread =
            [rows.x_axis, rows.y_axis, rows.z_axis].map(|row| row.element_sum()).into_iter().fold(1.0, f64::max);
        Self { mesh, to_scene, normal_to_scene: normal_matrix(&m), spread }
    }

    /// What to add to a triangle's size where a ray is kept off it (see
    /// [`geom::offset_origin`](crate::geom::offset_origin)): a backend that moves the ray into
    /// the mesh's space in f32 rounds each coordinate once more, by half an ulp of a sum of terms as
    /// large as the point and the translation.
    #[must_use]
    pub fn rounding(&self, corner: Vec3) -> f32 {
        let reach = f64::from(corner.abs().max_element()) + self.to_scene.translation.abs().max_element();
        (2.0 * self.spread * reach) as f32
    }

    /// Box around the placed box of the mesh.
    #[must_use]
    pub fn bounds(&self) -> Bounds {
        self.mesh.data.triangles.bounds().under(&self.to_scene)
    }
}

impl Shapes {
    /// The shapes of `set`, of material 0.
    #[must_use]
    pub fn bare(set: AnyShapes) -> Self {
        Self { materials: vec![0; set.len() as usize], set }
    }
}

impl AnyShapes {
    /// Number of shapes.
    #[must_use]
    pub fn len(&self) -> u32 {
        with_shapes!(self, set => set.len())
    }

    /// Whether there is none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Whether all of them are convex and enclose a space.
    #[must_use]
    pub fn are_closed(&self) -> bool {
        match self {
            Self::Spheres(_) | Self::PlacedSpheres(_) | Self::Cubes(_) | Self::PlacedCubes(_) => true,
            // Open ones are among them.
            Self::Cylinders(_) | Self::Quads(_) | Self::Triangles(_) => false,
        }
    }
}
