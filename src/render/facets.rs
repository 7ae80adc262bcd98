//! Hits of triangles: from what a backend reports to points in f64.

#![expect(clippy::needless_range_loop, reason = "an index runs over many arrays at once")]

use super::block::{Block, F32, F64, Hits, V, fronts, get, put, wide};
use super::paint::Palette;
use crate::geom::{LANES, RayHitPacket, TriangleMesh};
use crate::scene::obj::CornerData;
use crate::scene::{Instance, Mesh, MeshPaint, Object, Scene};
use crate::simd::{self, Kernel};
use glam::{DVec3, Vec2, Vec3};

/// What hits of triangles are computed from.
#[repr(align(64))]
#[derive(Debug)]
pub struct Facets<'a> {
    o: [F32; 3],
    d: [F32; 3],
    reported: [F32; 2],
    corners: [[F32; 3]; 3],
    normals: [[F32; 3]; 3],
    smooth: [bool; LANES],
    /// Added to the size of the triangle where offsets are made: what the transform of an
    /// instance rounds.
    rounding: F32,
    /// Weights of the corners, of the finished points.
    weights: [F64; 3],
    geom: [u32; LANES],
    prim: [u32; LANES],
    /// Of each object; `None` for shapes.
    meshes: Vec<Option<Buffers<'a>>>,
    /// Blocks whose normals were interpolated.
    pub smooth_blocks: u64,
    /// Go through the normals of corners even where no lane has any.
    always_smooth: bool,
    /// Whether the lanes to be finished have none to go through.
    flat: bool,
}

/// Where everything about the triangles of an object is: nothing has to be followed for it.
#[derive(Clone, Copy, Debug)]
struct Buffers<'a> {
    triangles: &'a TriangleMesh,
    normals: Option<(&'a [[u32; 3]], &'a CornerData)>,
    materials: Option<&'a [u32]>,
    /// Material that those are counted from.
    first_material: u32,
    mesh: &'a Mesh,
    placed: Option<&'a Instance>,
}

impl<'a> Buffers<'a> {
    fn of(object: &'a Object) -> Option<Self> {
        let mesh = object.mesh()?;
        let data = &*mesh.data;
        let (first_material, materials) = match mesh.paint {
            MeshPaint::One(material) => (material, None),
            MeshPaint::PerFace(first) => (first, data.face_materials.as_deref()),
        };
        Some(Self {
            triangles: &data.triangles,
            normals: data.normals.as_ref().map(|n| (n.indices.as_deref().unwrap_or(data.triangles.faces()), n)),
            materials,
            first_material,
            mesh,
            placed: if let Object::Instance(instance) = object { Some(instance) } else { None },
        })
    }
}

#[inline]
fn set(to: &mut [F32; 3], lane: usize, v: Vec3) {
    to[0][lane] = v.x;
    to[1][lane] = v.y;
    to[2][lane] = v.z;
}

impl<'a> Facets<'a> {
    /// For hits of the meshes of `scene`.
    #[must_use]
    pub fn new(scene: &'a Scene) -> Self {
        Self::over(scene.objects.iter().map(Buffers::of).collect())
    }

    /// A good hit in every lane: lanes that no hit fills give numbers all the same, and a
    /// packet with a NaN in it is slow to trace.
    fn over(meshes: Vec<Option<Buffers<'a>>>) -> Self {
        Self {
            o: [[0.25; LANES], [0.25; LANES], [1.0; LANES]],
            d: [[0.0; LANES], [0.0; LANES], [-1.0; LANES]],
            reported: [[0.25; LANES]; 2],
            corners: [
                [[0.0; LANES]; 3],
                [[1.0; LANES], [0.0; LANES], [0.0; LANES]],
                [[0.0; LANES], [1.0; LANES], [0.0; LANES]],
            ],
            normals: [[[0.0; LANES]; 3]; 3],
            smooth: [false; LANES],
            rounding: [0.0; LANES],
            weights: [[0.0; LANES]; 3],
            geom: [0; LANES],
            prim: [0; LANES],
            meshes,
            smooth_blocks: 0,
            always_smooth: false,
            flat: true,
        }
    }

    /// The same without the short way for facets that are flat.
    #[must_use]
    pub fn always_smooth(self) -> Self {
        Self { always_smooth: true, ..self }
    }

    /// Looks up what belongs to the hits of the first `len` lanes: first where everything
    /// is, then everything, so that the memory has many questions to work on at a time.
    fn gather(&mut self, block: &mut Block, palette: &Palette) {
        if self.is_one_triangle(block.len) {
            self.gather_one(block);
        } else {
            self.gather_many(block);
        }
        block.paint_all(palette);
    }

    /// Whether all lanes hit the same triangle, as those of neighbours mostly do where triangles are large.
    fn is_one_triangle(&self, len: usize) -> bool {
        let differ = |ids: &[u32; LANES]| ids.iter().fold(0, |bits, id| bits | (id ^ ids[0]));
        len == LANES && differ(&self.prim) | differ(&self.geom) == 0
    }

    /// Looks it up in the first lane, and copies that to the others.
    fn gather_one(&mut self, block: &mut Block) {
        let (at, prim) = (*self.buffers(0), self.prim[0] as usize);
        if at.placed.is_some() || at.mesh.mirrored {
            return self.gather_many(block);
        }
        block.material = [at.first_material + at.materials.map_or(0, |m| m[prim]); LANES];
        let all = |to: &mut [F32; 3], v: Vec3| *to = v.to_array().map(|x| [x; LANES]);
        for (to, i) in self.corners.iter_mut().zip(at.triangles.faces()[prim]) {
            all(to, at.triangles.point(i));
        }
        let normals = at.normals.and_then(|(indices, values)| values.three(indices[prim]));
        self.smooth = [normals.is_some(); LANES];
        for (to, n) in self.normals.iter_mut().zip(normals.into_iter().flatten()) {
            all(to, n.into());
        }
    }

    fn gather_many(&mut self, block: &mut Block) {
        let mut faces = [[0; 3]; LANES];
        let mut normals = [[0; 3]; LANES];
        for lane in 0..block.len {
            let (at, prim) = (self.buffers(lane), self.prim[lane] as usize);
            faces[lane] = at.triangles.faces()[prim];
            block.material[lane] = at.first_material + at.materials.map_or(0, |m| m[prim]);
            if let Some((indices, _)) = at.normals {
                normals[lane] = indices[prim];
            }
        }
        for lane in 0..block.len {
            let at = *self.buffers(lane);
            for (to, i) in self.corners.iter_mut().zip(faces[lane]) {
                set(to, lane, at.triangles.point(i));
            }
            let normals = at.normals.and_then(|(_, values)| values.three(normals[lane]));
            self.smooth[lane] = normals.is_some();
            if let Some(normals) = normals {
                for (to, n) in self.normals.iter_mut().zip(normals) {
                    set(to, lane, n.into());
                }
            }
            if let Some(instance) = at.placed {
                self.place(lane, instance);
            }
            if at.mesh.mirrored {
                self.rewind(lane);
            }
        }
    }

    #[inline]
    fn buffers(&self, lane: usize) -> &Buffers<'a> {
        self.meshes[self.geom[lane] as usize].as_ref().expect("hits of shapes are collected apart")
    }

    /// Moves corners and normals of an instance to scene space.
    #[cold]
    fn place(&mut self, lane: usize, instance: &Instance) {
        for corner in &mut self.corners {
            let p = instance.to_scene.transform_point3(DVec3::from_array(wide(corner, lane)));
            set(corner, lane, p.as_vec3());
        }
        self.rounding[lane] = instance.rounding(Block::vec3(&self.corners[0], lane));
        for normal in &mut self.normals {
            let n = instance.normal_to_scene * DVec3::from_array(wide(normal, lane));
            set(normal, lane, n.normalize_or_zero().as_vec3());
        }
    }

    /// Lets corners two and three change places, where the placement mirrors space: the winding
    /// again tells the outside.
    #[cold]
    fn rewind(&mut self, lane: usize) {
        for of in [&mut self.corners, &mut self.normals] {
            let [_, second, third] = of;
            second.iter_mut().zip(third).for_each(|(a, b)| std::mem::swap(&mut a[lane], &mut b[lane]));
        }
        let [u, v] = &mut self.reported;
        std::mem::swap(&mut u[lane], &mut v[lane]);
    }

    fn uv(&self, lane: usize) -> Option<Vec2> {
        let mesh = self.buffers(lane).mesh;
        let [a, b, c] = mesh.data.uvs_of(self.prim[lane])?;
        let [b, c] = if mesh.mirrored { [c, b] } else { [b, c] };
        let [wa, wb, wc] = [0, 1, 2].map(|corner| self.weights[corner][lane] as f32);
        Some(a * wa + b * wb + c * wc)
    }
}

impl Hits for Facets<'_> {
    #[inline]
    fn set(&mut self, lane: usize, packet: &RayHitPacket, from: usize) {
        let ray = &packet.ray;
        for (to, of) in self.o.iter_mut().zip([&ray.o_x, &ray.o_y, &ray.o_z]) {
            to[lane] = of[from];
        }
        for (to, of) in self.d.iter_mut().zip([&ray.d_x, &ray.d_y, &ray.d_z]) {
            to[lane] = of[from];
        }
        self.reported[0][lane] = packet.hit.u[from];
        self.reported[1][lane] = packet.hit.v[from];
        self.rounding[lane] = 0.0;
        self.geom[lane] = packet.hit.geom_id[from];
        self.prim[lane] = packet.hit.prim_id[from];
    }

    #[inline]
    fn set_all(&mut self, packet: &RayHitPacket) {
        let RayHitPacket { ray, hit } = packet;
        self.o = [ray.o_x, ray.o_y, ray.o_z];
        self.d = [ray.d_x, ray.d_y, ray.d_z];
        self.reported = [hit.u, hit.v];
        self.rounding = [0.0; LANES];
        self.geom = hit.geom_id;
        self.prim = hit.prim_id;
    }

    fn finish(&mut self, len: usize, scene: &Scene, palette: &Palette, block: &mut Block) {
        block.len = len;
        block.enclosed = [false; LANES];
        self.gather(block, palette);
        self.flat = !self.smooth.contains(&true) && !self.always_smooth;
        self.smooth_blocks += u64::from(!self.flat);
        simd::run(Finish { facets: self, block });
        palette.add_texels(scene, block, |_, lane| self.uv(lane));
    }
}

struct Finish<'a, 'scene> {
    facets: &'a mut Facets<'scene>,
    block: &'a mut Block,
}

impl Kernel for Finish<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { facets, block } = self;
        let (mut weights, mut lifted) = ([[0.0; LANES]; 3], [[0.0; LANES]; 3]);
        refine(facets, block, &mut weights);
        shading_normals(facets, block, &weights, &mut lifted);
        fronts(&lifted, block);
        facets.weights = weights;
    }
}

#[inline(always)]
fn dot(a: V, b: V) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline(always)]
fn sub(a: V, b: V) -> V {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

#[inline(always)]
fn scale(a: V, s: f64) -> V {
    [a[0] * s, a[1] * s, a[2] * s]
}

#[inline(always)]
fn cross(a: V, b: V) -> V {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// The steps of [`geom::triangle::refine`](crate::geom::triangle::refine) for all lanes, and the
/// facet's normal turned to the ray.
#[inline(always)]
fn refine(f: &Facets<'_>, out: &mut Block, weights: &mut [F64; 3]) {
    for i in 0..LANES {
        let (o, d) = (wide(&f.o, i), wide(&f.d, i));
        let p0 = wide(&f.corners[0], i);
        let e1 = sub(wide(&f.corners[1], i), p0);
        let e2 = sub(wide(&f.corners[2], i), p0);
        let ng = cross(e1, e2);
        let q = cross(sub(o, p0), d);
        let along = dot(d, ng);
        let inv = -1.0 / along;
        let (u, v) = (dot(e2, q) * inv, -dot(e1, q) * inv);
        // Seen exactly edge-on there is nothing better than what was reported.
        let good = u.is_finite() & v.is_finite();
        let u = if good { u } else { f64::from(f.reported[0][i]) };
        let v = if good { v } else { f64::from(f.reported[1][i]) };
        // The backend has decided that it is a hit: rounding never makes it a miss.
        let (u, v) = (u.clamp(0.0, 1.0), v.clamp(0.0, 1.0));
        let shrink = 1.0 / (u + v).max(1.0);
        let (u, v) = (u * shrink, v * shrink);
        let p = [0, 1, 2].map(|k| p0[k] + u * e1[k] + v * e2[k]);
        out.entering[i] = along < 0.0;
        let side = if along < 0.0 { 1.0 } else { -1.0 };
        let unit = scale(ng, side / dot(ng, ng).sqrt());
        put(&mut out.p, i, p);
        put(&mut out.ng, i, unit);
        weights[0][i] = 1.0 - u - v;
        weights[1][i] = u;
        weights[2][i] = v;
        let e3 = sub(wide(&f.corners[2], i), wide(&f.corners[1], i));
        let size = |e: V| e[0].abs() + e[1].abs() + e[2].abs();
        out.extent[i] = size(e1).max(size(e2)).max(size(e3)) + f64::from(f.rounding[i]);
        let d = [f.d[0][i], f.d[1][i], f.d[2][i]];
        let back = -1.0 / (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt();
        for k in 0..3 {
            out.to_eye[k][i] = d[k] * back;
        }
    }
}

/// The shading normal from the corners where they have one, and the point from which the
/// surface that those normals pretend would cast its shadows: the facet's own, lifted onto
/// the corners' tangent planes where those lie outside.
///
/// Source of the lift: J. Hanika, "Hacking the Shadow Terminator", Ray Tracing Gems II, ch. 4.
#[inline(always)]
fn shading_normals(f: &Facets<'_>, out: &mut Block, weights: &[F64; 3], lifted: &mut [F64; 3]) {
    if f.flat {
        out.ns = out.ng;
        *lifted = out.p;
        return;
    }
    for i in 0..LANES {
        let (p, ng) = (get(&out.p, i), get(&out.ng, i));
        let side = if out.entering[i] { 1.0 } else { -1.0 };
        let mut sum = [0.0; 3];
        let mut lift = [0.0; 3];
        for c in 0..3 {
            let n = scale(wide(&f.normals[c], i), side);
            let weight = weights[c][i];
            let below = dot(sub(p, wide(&f.corners[c], i)), n).min(0.0);
            for k in 0..3 {
                sum[k] += weight * n[k];
                lift[k] += weight * below * n[k];
            }
        }
        let length = dot(sum, sum).sqrt();
        // Normals that cancel say nothing.
        let usable = f.smooth[i] & (length > 1e-6);
        let facing = dot(sum, ng) >= 0.0;
        let inv = if facing { 1.0 / length } else { -1.0 / length };
        let lifts = usable & facing;
        for k in 0..3 {
            out.ns[k][i] = if usable { sum[k] * inv } else { ng[k] };
            lifted[k][i] = if lifts { p[k] - lift[k] } else { p[k] };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::{Ray, offset_origin, triangle};
    use proptest::prelude::*;

    fn vec(scale: f32) -> impl Strategy<Value = Vec3> {
        [-1f32..1.0, -1f32..1.0, -1f32..1.0].prop_map(move |v| Vec3::from(v) * scale)
    }

    proptest! {
        /// The lanes give the very numbers of the plain formulas.
        #[test]
        fn lanes_are_the_scalar_formulas(
            corners in [vec(1.0), vec(1.0), vec(1.0)], inside in (0.01f32..0.5, 0.01f32..0.5), o in vec(5.0), far in 0.5f32..4.0,
        ) {
            let at = corners[0] + (corners[1] - corners[0]) * inside.0 + (corners[2] - corners[0]) * inside.1;
            let ray = Ray::new(o, (at - o) * far);
            prop_assume!((corners[1] - corners[0]).cross(corners[2] - corners[0]).length() > 1e-3);
            let mut facets = Facets::over(Vec::new());
            for lane in 0..LANES {
                for k in 0..3 {
                    facets.o[k][lane] = ray.o[k];
                    facets.d[k][lane] = ray.d[k];
                    for c in 0..3 {
                        facets.corners[c][k][lane] = corners[c][k];
                    }
                }
            }
            let want = triangle::refine(ray.o, ray.d, corners, (0.3, 0.3));
            let side = if want.ng.dot(ray.d.as_dvec3()) < 0.0 { 1.0 } else { -1.0 };
            for level in simd::Level::ALL {
                let mut block = Block::EMPTY;
                simd::run_at(level, Finish { facets: &mut facets, block: &mut block });
                for lane in [0, 7, 15] {
                    prop_assert_eq!(Block::dvec3(&block.p, lane), want.p);
                    prop_assert_eq!(block.extent[lane], want.extent);
                    prop_assert_eq!(block.entering[lane], side > 0.0);
                    let ng = Block::dvec3(&block.ng, lane);
                    prop_assert!((ng - want.ng.normalize() * side).length() < 1e-15);
                    prop_assert_eq!(block.ns, block.ng);
                    prop_assert_eq!(Block::vec3(&block.front, lane), offset_origin(want.p, ng, want.extent));
                }
            }
        }
    }
}
