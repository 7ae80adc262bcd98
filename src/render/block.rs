//! Sixteen surface points side by side, ready to be shaded.
//!
//! Loops over the lanes have no branch and no call, so that they compile to vector code.

use super::facets::Facets;
use super::media::Medium;
use super::paint::{Paint, Palette};
use super::shapes::ShapeHits;
use crate::geom::{Hit, LANES, Ray, RayHitPacket};
use crate::math::Branch;
use crate::scene::{Object, Scene};
use crate::simd::Kernel;
use glam::{DVec3, Vec3};

/// One number per lane.
pub type F32 = [f32; LANES];
/// One number per lane.
pub type F64 = [f64; LANES];

/// Half an f32 ulp of 1.
pub const EPS: f64 = 0.5 * f32::EPSILON as f64;

/// The lanes whose bits are set.
pub fn lanes(mut bits: u32) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let lane = bits.trailing_zeros();
        bits &= bits.wrapping_sub(1);
        (lane < u32::BITS).then_some(lane as usize)
    })
}

/// Where a ray's colour goes and how much of it.
#[derive(Clone, Copy, Debug)]
pub struct Path {
    /// Sample that the colour belongs to.
    pub slot: u32,
    /// Bounces so far.
    pub depth: u32,
    /// Share of the ray's colour that arrives in the sample.
    pub weight: Vec3,
    /// Which of the sample's paths it is.
    pub branch: Branch,
    /// What the ray travels in.
    pub medium: Medium,
}

impl Path {
    /// The path of a camera ray.
    #[must_use]
    pub fn of_sample(slot: u32) -> Self {
        Self { slot, depth: 0, weight: Vec3::ONE, branch: Branch::CAMERA, medium: Medium::OUTSIDE }
    }
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
    /// Which of the sample's paths.
    pub branch: [Branch; LANES],
    /// What the ray travelled in.
    pub medium: [Medium; LANES],
    /// Object and primitive.
    pub id: [[u32; 2]; LANES],
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
    /// Whether the ray met the outer side.
    pub entering: [bool; LANES],
    /// Whether the point is on the inner side of a shape that is convex and encloses a space.
    pub enclosed: [bool; LANES],
    /// What the point shows by itself, and after the lights what they add; before the weight.
    pub color: [F32; 3],
}

impl Block {
    /// A block without hits.
    pub const EMPTY: Self = Self {
        len: 0,
        slot: [0; LANES],
        depth: [0; LANES],
        branch: [Branch::CAMERA; LANES],
        medium: [Medium::OUTSIDE; LANES],
        id: [[0; 2]; LANES],
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
        enclosed: [false; LANES],
        color: [[0.0; LANES]; 3],
    };

    /// Notes where the colour of `lane` goes.
    #[inline]
    pub fn set(&mut self, lane: usize, path: &Path) {
        self.slot[lane] = path.slot;
        self.depth[lane] = path.depth;
        self.branch[lane] = path.branch;
        self.medium[lane] = path.medium;
        for axis in 0..3 {
            self.weight[axis][lane] = path.weight[axis];
        }
    }

    /// Notes that the colours of its lanes go to samples in a row, the first of them `first`, seen by camera rays.
    #[inline]
    pub fn set_samples(&mut self, first: u32) {
        let path = Path::of_sample(first);
        self.slot = std::array::from_fn(|lane| first + lane as u32);
        self.depth = [path.depth; LANES];
        self.branch = [path.branch; LANES];
        self.medium = [path.medium; LANES];
        self.weight = path.weight.to_array().map(|weight| [weight; LANES]);
    }

    /// The path that `lane` is on.
    #[inline]
    #[must_use]
    pub fn path(&self, lane: usize) -> Path {
        Path {
            slot: self.slot[lane],
            depth: self.depth[lane],
            weight: Self::vec3(&self.weight, lane),
            branch: self.branch[lane],
            medium: self.medium[lane],
        }
    }

    /// Gives `lane` the colours of a material.
    #[inline]
    fn paint(&mut self, lane: usize, paint: &Paint) {
        self.shininess[lane] = paint.shininess;
        for axis in 0..3 {
            self.diffuse[axis][lane] = paint.diffuse[axis];
            self.specular[axis][lane] = paint.specular[axis];
            self.color[axis][lane] = paint.own[axis];
        }
    }

    /// Gives all lanes in use the colours of their materials.
    pub fn paint_all(&mut self, palette: &Palette) {
        let first = self.material[0];
        if self.material[..self.len].iter().all(|&m| m == first) {
            // Neighbours mostly show one material.
            let paint = palette.get(first);
            self.shininess = [paint.shininess; LANES];
            for axis in 0..3 {
                self.diffuse[axis] = [paint.diffuse[axis]; LANES];
                self.specular[axis] = [paint.specular[axis]; LANES];
                self.color[axis] = [paint.own[axis]; LANES];
            }
            return;
        }
        for lane in 0..self.len {
            self.paint(lane, palette.get(self.material[lane]));
        }
    }

    /// One hit by itself, in lane 0.
    #[must_use]
    pub fn single(scene: &Scene, ray: &Ray, hit: &Hit, path: &Path) -> Self {
        let mut block = Self::EMPTY;
        let mut packet = RayHitPacket::EMPTY;
        packet.ray.set(0, ray);
        packet.set_hit(0, Some(hit));
        block.set(0, path);
        block.id[0] = [hit.geom_id, hit.prim_id];
        let palette = Palette::of(scene);
        match &scene.objects[hit.geom_id as usize] {
            Object::Shapes(_) => Self::finish_one(ShapeHits::default(), scene, &packet, &mut block, &palette),
            _ => Self::finish_one(Facets::new(scene), scene, &packet, &mut block, &palette),
        }
        block
    }

    fn finish_one(mut hits: impl Hits, scene: &Scene, packet: &RayHitPacket, block: &mut Self, palette: &Palette) {
        hits.set(0, packet, 0);
        hits.finish(1, scene, palette, block);
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

/// Hits of one kind, collected until a block is full.
pub trait Hits {
    /// Takes over ray and hit `from` of `packet`.
    fn set(&mut self, lane: usize, packet: &RayHitPacket, from: usize);

    /// Takes over all rays and hits of `packet`.
    fn set_all(&mut self, packet: &RayHitPacket);

    /// Makes the first `len` of them into the points of `block`, and gives them their colours.
    fn finish(&mut self, len: usize, scene: &Scene, palette: &Palette, block: &mut Block);
}

/// Points on their way into a block.
#[repr(align(64))]
pub struct Points {
    /// The points.
    pub p: [F64; 3],
    /// Unit geometric normals on the ray's side.
    pub ng: [F64; 3],
    /// Unit shading normals on the same side.
    pub ns: [F64; 3],
    /// The points that shadow rays are to start from.
    pub lifted: [F64; 3],
    /// See [`Block::extent`].
    pub extent: F64,
    /// See [`Block::to_eye`].
    pub to_eye: [F32; 3],
    /// 1 for a hit from outside, -1 from inside.
    pub side: F64,
}

impl Points {
    /// Numbers that do no harm.
    pub const EMPTY: Self = Self {
        p: [[0.0; LANES]; 3],
        ng: [[0.0; LANES]; 3],
        ns: [[0.0; LANES]; 3],
        lifted: [[0.0; LANES]; 3],
        extent: [0.0; LANES],
        to_eye: [[0.0; LANES]; 3],
        side: [0.0; LANES],
    };
}

/// Three numbers of one lane.
pub type V = [f64; 3];

/// A vector of `lane`, widened.
#[inline(always)]
pub fn wide(of: &[F32; 3], lane: usize) -> V {
    [f64::from(of[0][lane]), f64::from(of[1][lane]), f64::from(of[2][lane])]
}

/// A vector of `lane`.
#[inline(always)]
pub fn get(of: &[F64; 3], lane: usize) -> V {
    [of[0][lane], of[1][lane], of[2][lane]]
}

/// Sets a vector of `lane`.
#[inline(always)]
pub fn put(to: &mut [F64; 3], lane: usize, v: V) {
    to[0][lane] = v[0];
    to[1][lane] = v[1];
    to[2][lane] = v[2];
}

/// Puts finished points into a block.
pub struct Leave<'a> {
    /// The points.
    pub points: &'a Points,
    /// Where they go.
    pub block: &'a mut Block,
}

impl Kernel for Leave<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        leave(self.points, self.block);
    }
}

/// Everything into the block.
#[inline(always)]
fn leave(r: &Points, b: &mut Block) {
    b.p = r.p;
    b.ng = r.ng;
    b.ns = r.ns;
    b.extent = r.extent;
    b.to_eye = r.to_eye;
    for i in 0..LANES {
        b.entering[i] = r.side[i] > 0.0;
    }
    fronts(&r.lifted, b);
}

/// Origins of the rays that leave on the ray's side, from the `lifted` points of a block: those of
/// [`geom::offset_origin`](crate::geom::offset_origin), for all lanes.
#[inline(always)]
pub fn fronts(lifted: &[F64; 3], b: &mut Block) {
    for i in 0..LANES {
        let (p, ng) = (get(lifted, i), get(&b.ng, i));
        let delta = 4.0 * EPS * (p[0].abs().max(p[1].abs()).max(p[2].abs()) + b.extent[i]);
        for k in 0..3 {
            b.front[k][i] = round_away(p[k] + delta * ng[k], ng[k]);
        }
    }
}

/// `x` in f32, rounded towards the sign of `side`.
#[inline(always)]
pub fn round_away(x: f64, side: f64) -> f32 {
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

    #[test]
    fn rounding_leaves_no_point_on_the_wrong_side() {
        for x in [0.0, -0.0, 1e-46, -1e-46, 1.0 + 1e-12, 1.0 - 1e-12, -3.3, 0.1, 1e-30, -1e30] {
            assert!(f64::from(round_away(x, 1.0)) >= x && f64::from(round_away(x, -1.0)) <= x, "{x:e}");
            assert_eq!(round_away(x, 0.0), x as f32);
        }
    }
}
