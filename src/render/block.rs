//! Sixteen hits side by side: from what a backend reports to points that can be shaded.
//!
//! Loops over the lanes have no branch and no call, so that they compile to vector code.

#![expect(clippy::needless_range_loop, reason = "an index runs over many arrays at once")]

use crate::geom::{Hit, LANES, Ray, RayHitPacket};
use crate::scene::{Material, Scene};
use crate::simd::{self, Kernel};
use glam::{DVec3, Vec3};

/// One number per lane.
pub type F32 = [f32; LANES];
/// One number per lane.
pub type F64 = [f64; LANES];

/// Half an f32 ulp of 1.
const EPS: f64 = 0.5 * f32::EPSILON as f64;

/// Where a ray's colour goes and how much of it.
#[derive(Clone, Copy, Debug)]
pub struct Path {
    /// Sample that the colour belongs to.
    pub slot: u32,
    /// Bounces so far.
    pub depth: u32,
    /// Share of the ray's colour that arrives in the sample.
    pub weight: Vec3,
}

impl Path {
    /// The path of a camera ray.
    #[must_use]
    pub fn of_sample(slot: u32) -> Self {
        Self { slot, depth: 0, weight: Vec3::ONE }
    }
}

/// What lights ask of a material, in one place.
#[derive(Clone, Copy, Debug)]
pub struct Paint {
    /// Emission, and the answer to the ambient light.
    own: Vec3,
    diffuse: Vec3,
    specular: Vec3,
    shininess: f32,
}

impl Paint {
    /// `material` in ambient light.
    #[must_use]
    pub fn new(material: &Material, ambient: Vec3) -> Self {
        Self {
            own: material.emission + material.ambient * ambient,
            diffuse: material.diffuse,
            specular: material.specular,
            shininess: material.shininess,
        }
    }
}

/// What a hit of a triangle is computed from.
#[repr(align(64))]
#[derive(Debug)]
pub struct Facets {
    o: [F32; 3],
    d: [F32; 3],
    reported: [F32; 2],
    corners: [[F32; 3]; 3],
    normals: [[F32; 3]; 3],
    smooth: [bool; LANES],
    geom: [u32; LANES],
    prim: [u32; LANES],
}

/// Hits made into surface points, in scene space; f64 where a decision hangs on it. Lanes
/// from `len` on hold nothing of use.
#[repr(align(64))]
#[derive(Clone, Debug)]
pub struct Block {
    /// Lanes in use.
    pub len: usize,
    /// Sample that each lane's colour belongs to.
    pub slot: [u32; LANES],
    /// Bounces so far.
    pub depth: [u32; LANES],
    /// Index of the material.
    pub material: [u32; LANES],
    /// Share of the colour that arrives in the sample.
    pub weight: [F32; 3],
    /// Diffuse weight of the material.
    pub diffuse: [F32; 3],
    /// Specular weight of the material.
    pub specular: [F32; 3],
    /// Exponent of the material's highlight.
    pub shininess: F32,
    /// The point.
    pub p: [F64; 3],
    /// Unit geometric normal, turned to the side the ray came from.
    pub ng: [F64; 3],
    /// Unit shading normal on the same side.
    pub ns: [F64; 3],
    /// Size of the primitive, for offsets.
    pub extent: F64,
    /// Unit vector back along the ray.
    pub to_eye: [F32; 3],
    /// Where shadow rays start: off the surface, and where it only pretends to be smooth,
    /// lifted out of the facet's own shadow.
    pub front: [F32; 3],
    /// Whether the ray met the side that the winding calls outer.
    pub entering: [bool; LANES],
    /// What the point shows by itself, and after the lights what they add; before the weight.
    pub color: [F32; 3],
}

impl Facets {
    /// A good hit in every lane: lanes that no hit fills give numbers all the same, and a
    /// packet with a NaN in it is slow to trace.
    pub const EMPTY: Self = Self {
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
        geom: [0; LANES],
        prim: [0; LANES],
    };

    /// Takes over ray and hit `from` of `packet`.
    #[inline]
    pub fn set(&mut self, lane: usize, packet: &RayHitPacket, from: usize) {
        let ray = &packet.ray;
        for (to, of) in self.o.iter_mut().zip([&ray.o_x, &ray.o_y, &ray.o_z]) {
            to[lane] = of[from];
        }
        for (to, of) in self.d.iter_mut().zip([&ray.d_x, &ray.d_y, &ray.d_z]) {
            to[lane] = of[from];
        }
        self.reported[0][lane] = packet.hit.u[from];
        self.reported[1][lane] = packet.hit.v[from];
        self.geom[lane] = packet.hit.geom_id[from];
        self.prim[lane] = packet.hit.prim_id[from];
    }

    /// Looks up what belongs to the hits of the first `len` lanes: first where everything
    /// is, then everything, so that the memory has many questions to work on at a time.
    fn gather(&mut self, scene: &Scene, block: &mut Block, paints: &[Paint]) {
        let mut faces = [[0; 3]; LANES];
        let mut normals = [None; LANES];
        for lane in 0..block.len {
            let mesh = scene.objects[self.geom[lane] as usize].mesh().expect("a triangle was hit");
            let (data, prim) = (&*mesh.data, self.prim[lane]);
            faces[lane] = data.triangles.faces()[prim as usize];
            block.material[lane] = mesh.material(prim);
            normals[lane] = data.normals.as_ref().map(|n| n.of(data.triangles.faces(), prim as usize));
        }
        let put = |to: &mut [F32; 3], lane: usize, v: Vec3| {
            to[0][lane] = v.x;
            to[1][lane] = v.y;
            to[2][lane] = v.z;
        };
        for lane in 0..block.len {
            let mesh = scene.objects[self.geom[lane] as usize].mesh().expect("a triangle was hit");
            for (to, i) in self.corners.iter_mut().zip(faces[lane]) {
                put(to, lane, mesh.data.triangles.point(i));
            }
            let normals = normals[lane].and_then(|at| mesh.data.normals_at(at));
            self.smooth[lane] = normals.is_some();
            for (to, n) in self.normals.iter_mut().zip(normals.unwrap_or_default()) {
                put(to, lane, n);
            }
            block.paint(lane, &paints[block.material[lane] as usize]);
        }
    }
}

impl Block {
    /// A block without hits.
    pub const EMPTY: Self = Self {
        len: 0,
        slot: [0; LANES],
        depth: [0; LANES],
        material: [0; LANES],
        weight: [[0.0; LANES]; 3],
        diffuse: [[0.0; LANES]; 3],
        specular: [[0.0; LANES]; 3],
        shininess: [0.0; LANES],
        p: [[0.0; LANES]; 3],
        ng: [[0.0; LANES]; 3],
        ns: [[0.0; LANES]; 3],
        extent: [0.0; LANES],
        to_eye: [[0.0; LANES]; 3],
        front: [[0.0; LANES]; 3],
        entering: [false; LANES],
        color: [[0.0; LANES]; 3],
    };

    /// Notes where the colour of `lane` goes.
    #[inline]
    pub fn set(&mut self, lane: usize, path: &Path) {
        self.slot[lane] = path.slot;
        self.depth[lane] = path.depth;
        for axis in 0..3 {
            self.weight[axis][lane] = path.weight[axis];
        }
    }

    #[inline]
    fn paint(&mut self, lane: usize, paint: &Paint) {
        self.shininess[lane] = paint.shininess;
        for axis in 0..3 {
            self.diffuse[axis][lane] = paint.diffuse[axis];
            self.specular[axis][lane] = paint.specular[axis];
            self.color[axis][lane] = paint.own[axis];
        }
    }

    /// Makes the hits in the first `len` lanes of `facets` into points.
    pub fn finish(&mut self, scene: &Scene, facets: &mut Facets, len: usize, paints: &[Paint]) {
        self.len = len;
        facets.gather(scene, self, paints);
        simd::run(Finish { facets, block: self });
    }

    /// One hit by itself, in lane 0.
    #[must_use]
    pub fn single(scene: &Scene, ray: &Ray, hit: &Hit) -> Self {
        let (mut facets, mut block) = (Facets::EMPTY, Self::EMPTY);
        let mut packet = RayHitPacket::EMPTY;
        packet.ray.set(0, ray);
        packet.set_hit(0, Some(hit));
        facets.set(0, &packet, 0);
        block.set(0, &Path::of_sample(0));
        let paints: Vec<Paint> = scene.materials.iter().map(|m| Paint::new(m, scene.ambient)).collect();
        block.finish(scene, &mut facets, 1, &paints);
        block
    }

    /// A vector of `lane`.
    #[inline]
    #[must_use]
    pub fn vec3(of: &[F32; 3], lane: usize) -> Vec3 {
        Vec3::new(of[0][lane], of[1][lane], of[2][lane])
    }

    /// A vector of `lane`.
    #[inline]
    #[must_use]
    pub fn dvec3(of: &[F64; 3], lane: usize) -> DVec3 {
        DVec3::new(of[0][lane], of[1][lane], of[2][lane])
    }
}

struct Finish<'a> {
    facets: &'a Facets,
    block: &'a mut Block,
}

impl Kernel for Finish<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let (f, b) = (self.facets, self.block);
        let mut refined = Refined::EMPTY;
        refine(f, &mut refined);
        shading_normals(f, &mut refined);
        leave(&refined, b);
    }
}

/// Between the steps.
#[repr(align(64))]
struct Refined {
    weights: [F64; 3],
    p: [F64; 3],
    ng: [F64; 3],
    ns: [F64; 3],
    lifted: [F64; 3],
    extent: F64,
    to_eye: [F32; 3],
    /// 1 for a hit from outside, -1 from inside.
    side: F64,
}

impl Refined {
    const EMPTY: Self = Self {
        weights: [[0.0; LANES]; 3],
        p: [[0.0; LANES]; 3],
        ng: [[0.0; LANES]; 3],
        ns: [[0.0; LANES]; 3],
        lifted: [[0.0; LANES]; 3],
        extent: [0.0; LANES],
        to_eye: [[0.0; LANES]; 3],
        side: [0.0; LANES],
    };
}

type V = [f64; 3];

#[inline(always)]
fn wide(of: &[F32; 3], lane: usize) -> V {
    [f64::from(of[0][lane]), f64::from(of[1][lane]), f64::from(of[2][lane])]
}

#[inline(always)]
fn get(of: &[F64; 3], lane: usize) -> V {
    [of[0][lane], of[1][lane], of[2][lane]]
}

#[inline(always)]
fn put(to: &mut [F64; 3], lane: usize, v: V) {
    to[0][lane] = v[0];
    to[1][lane] = v[1];
    to[2][lane] = v[2];
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
fn refine(f: &Facets, out: &mut Refined) {
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
        let side = if along < 0.0 { 1.0 } else { -1.0 };
        out.side[i] = side;
        let unit = scale(ng, side / dot(ng, ng).sqrt());
        put(&mut out.p, i, p);
        put(&mut out.ng, i, unit);
        out.weights[0][i] = 1.0 - u - v;
        out.weights[1][i] = u;
        out.weights[2][i] = v;
        let e3 = sub(wide(&f.corners[2], i), wide(&f.corners[1], i));
        let size = |e: V| e[0].abs() + e[1].abs() + e[2].abs();
        out.extent[i] = size(e1).max(size(e2)).max(size(e3));
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
fn shading_normals(f: &Facets, out: &mut Refined) {
    if !f.smooth.contains(&true) {
        out.ns = out.ng;
        out.lifted = out.p;
        return;
    }
    for i in 0..LANES {
        let (p, ng) = (get(&out.p, i), get(&out.ng, i));
        let mut sum = [0.0; 3];
        let mut lift = [0.0; 3];
        for c in 0..3 {
            let n = scale(wide(&f.normals[c], i), out.side[i]);
            let weight = out.weights[c][i];
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
            out.lifted[k][i] = if lifts { p[k] - lift[k] } else { p[k] };
        }
    }
}

/// Origins of the rays that leave on the ray's side ([`geom::offset_origin`](crate::geom::offset_origin)
/// for all lanes), and everything into the block.
#[inline(always)]
fn leave(r: &Refined, b: &mut Block) {
    for i in 0..LANES {
        let (p, ng) = (get(&r.lifted, i), get(&r.ng, i));
        let delta = 4.0 * EPS * (p[0].abs().max(p[1].abs()).max(p[2].abs()) + r.extent[i]);
        for k in 0..3 {
            b.front[k][i] = round_away(p[k] + delta * ng[k], ng[k]);
        }
        b.entering[i] = r.side[i] > 0.0;
    }
    b.p = r.p;
    b.ng = r.ng;
    b.ns = r.ns;
    b.extent = r.extent;
    b.to_eye = r.to_eye;
}

/// `x` in f32, rounded towards the sign of `side`.
#[inline(always)]
fn round_away(x: f64, side: f64) -> f32 {
    let nearest = x as f32;
    let wide = f64::from(nearest);
    let bits = nearest.to_bits();
    let away_from_zero = f32::from_bits(bits.wrapping_add(1));
    let towards_zero = f32::from_bits(bits.wrapping_sub(1));
    let negative = nearest < 0.0;
    let up = if negative { towards_zero } else { away_from_zero };
    let down = if negative { away_from_zero } else { towards_zero };
    // Zero is neither: its neighbours are the smallest numbers.
    let tiny = f32::from_bits(1);
    let up = if nearest == 0.0 { tiny } else { up };
    let down = if nearest == 0.0 { -tiny } else { down };
    let low = (side > 0.0) & (wide < x);
    let high = (side < 0.0) & (wide > x);
    if low {
        up
    } else if high {
        down
    } else {
        nearest
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::{offset_origin, triangle};
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
            let mut facets = Facets::EMPTY;
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
                simd::run_at(level, Finish { facets: &facets, block: &mut block });
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

    #[test]
    fn rounding_leaves_no_point_on_the_wrong_side() {
        for x in [0.0, -0.0, 1e-46, -1e-46, 1.0 + 1e-12, 1.0 - 1e-12, -3.3, 0.1, 1e-30, -1e30] {
            assert!(f64::from(round_away(x, 1.0)) >= x && f64::from(round_away(x, -1.0)) <= x, "{x:e}");
            assert_eq!(round_away(x, 0.0), x as f32);
        }
    }
}
