//! One light over a block of hits: its shadow rays, and what it adds where they get through.

#![expect(clippy::needless_range_loop, reason = "an index runs over many arrays at once")]

use super::block::{Block, F32, F64};
use crate::geom::{LANES, RayPacket};
use crate::math::{concentric_disc, pow01};
use crate::scene::Light;
use crate::simd::{self, Kernel};
use glam::DVec3;

/// End of a shadow ray that was sent at a light: just short of it.
pub const BEFORE_THE_LIGHT: f32 = 1.0 - 4.0 * 0.5 * f32::EPSILON;

/// Points of a light that the lanes of a block look at.
#[derive(Clone, Copy, Debug)]
pub enum Target<'a> {
    /// Its middle.
    Center,
    /// One for each lane.
    Points(&'a [F64; 3]),
}

/// How shadow rays went, and where highlights are seen from.
#[derive(Clone, Copy, Debug)]
pub struct Lit<'a> {
    /// Unoccluded share of the light for each lane.
    pub visible: &'a F32,
    /// Vectors to the middle of the light, as the shadow rays have them.
    pub to_light: &'a [F32; 3],
    /// Highlights are seen from this point; `None`: from where the ray came.
    pub seen_from: Option<DVec3>,
}

/// Shadow rays of a block: `t_far` is minus infinity in the lanes that need none. Tells how
/// many do, and how many were left out because the surface faces away.
pub fn aim(block: &Block, light: &Light, target: Target<'_>, packet: &mut RayPacket) -> (u32, u32) {
    match target {
        Target::Center => simd::run(Aim::<false> { block, light, points: &[[0.0; LANES]; 3], packet }),
        Target::Points(points) => simd::run(Aim::<true> { block, light, points, packet }),
    }
}

/// 1 in the lanes whose rays got through, else 0.
#[inline]
#[must_use]
pub fn unoccluded(packet: &RayPacket) -> F32 {
    packet.t_far.map(|t| if t != f32::NEG_INFINITY { 1.0 } else { 0.0 })
}

/// Whether any lane of `block` has a highlight: if not, there is no power to take.
#[inline]
#[must_use]
pub fn shines(block: &Block) -> bool {
    block.specular.iter().flatten().any(|&s| s != 0.0)
}

/// Adds the light to the lanes of `block` as far as it is visible from there, highlights only if it `shines`.
pub fn add(block: &mut Block, light: &Light, lit: Lit<'_>, shines: bool) {
    let view = match lit.seen_from {
        None => block.to_eye,
        Some(eye) => towards(block, eye),
    };
    match (shines, light.falloff.is_some()) {
        (false, false) => simd::run(Add::<false, false> { block, light, lit, view: &view }),
        (false, true) => simd::run(Add::<false, true> { block, light, lit, view: &view }),
        (true, false) => simd::run(Add::<true, false> { block, light, lit, view: &view }),
        (true, true) => simd::run(Add::<true, true> { block, light, lit, view: &view }),
    }
}

/// Vectors from where shadow rays start to the middle of the light.
#[must_use]
pub fn to_center(block: &Block, light: &Light) -> [F32; 3] {
    let l = light.position.to_array();
    [0, 1, 2].map(|k| block.front[k].map(|from| (l[k] - f64::from(from)) as f32))
}

/// Unit vectors from the points of a block to one point.
fn towards(b: &Block, to: DVec3) -> [F32; 3] {
    let mut view = [[0.0; LANES]; 3];
    for i in 0..LANES {
        let v = (to - Block::dvec3(&b.p, i)).normalize_or_zero();
        (view[0][i], view[1][i], view[2][i]) = v.as_vec3().into();
    }
    view
}

struct Aim<'a, const POINTS: bool> {
    block: &'a Block,
    light: &'a Light,
    points: &'a [F64; 3],
    packet: &'a mut RayPacket,
}

impl<const POINTS: bool> Kernel for Aim<'_, POINTS> {
    type Output = (u32, u32);

    #[inline(always)]
    fn run(self) -> (u32, u32) {
        let (b, l) = (self.block, self.light.position.to_array());
        let (mut d, mut t_far) = ([[0f32; LANES]; 3], [0f32; LANES]);
        let (mut sent, mut away) = (0, 0);
        for i in 0..LANES {
            let to_light = [0, 1, 2].map(|k| l[k] - b.p[k][i]);
            let along = |n: &[[f64; LANES]; 3], to: [f64; 3]| n[0][i] * to[0] + n[1][i] * to[1] + n[2][i] * to[2];
            let answers = [0, 1, 2].map(|k| b.diffuse[k][i] + b.specular[k][i]);
            let live = (i < b.len) & (answers[0] + answers[1] + answers[2] > 0.0);
            // Dark for the facet is dark, whatever an interpolated normal says.
            let lit = (along(&b.ng, to_light) > 0.0) & (along(&b.ns, to_light) > 0.0);
            let end = if POINTS { [0, 1, 2].map(|k| self.points[k][i]) } else { l };
            let above = !POINTS || along(&b.ng, [0, 1, 2].map(|k| end[k] - b.p[k][i])) > 0.0;
            // All that makes a shadow ray needless comes together here.
            let asks = live & lit & above;
            t_far[i] = if asks { BEFORE_THE_LIGHT } else { f32::NEG_INFINITY };
            sent += u32::from(asks);
            away += u32::from(live & !lit);
            for k in 0..3 {
                let to = (end[k] - f64::from(b.front[k][i])) as f32;
                d[k][i] = if to.abs() < f32::MIN_POSITIVE { 0.0 } else { to };
            }
        }
        let p = self.packet;
        [p.o_x, p.o_y, p.o_z] = b.front;
        [p.d_x, p.d_y, p.d_z] = d;
        p.t_near = [0.0; LANES];
        p.t_far = t_far;
        (sent, away)
    }
}

/// Blinn-Phong: diffuse N·L, specular (N·H)^shininess with H halfway between light and eye.
///
/// Source: J. F. Blinn, "Models of Light Reflection for Computer Synthesized Pictures",
/// SIGGRAPH 1977.
struct Add<'a, const SPECULAR: bool, const FALLOFF: bool> {
    block: &'a mut Block,
    light: &'a Light,
    lit: Lit<'a>,
    view: &'a [F32; 3],
}

impl<const SPECULAR: bool, const FALLOFF: bool> Kernel for Add<'_, SPECULAR, FALLOFF> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let (b, to_light) = (self.block, self.lit.to_light);
        let falloff = self.light.falloff.map_or(0.0, |f| f as f32);
        let (mut diffuse, mut specular) = ([0f32; LANES], [0f32; LANES]);
        let mut strength = [0f32; LANES];
        let mut cos_h = [0f64; LANES];
        for i in 0..LANES {
            let d = [to_light[0][i], to_light[1][i], to_light[2][i]];
            let square = (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).max(f32::MIN_POSITIVE);
            let inv = 1.0 / square.sqrt();
            let n = [b.ns[0][i] as f32, b.ns[1][i] as f32, b.ns[2][i] as f32];
            // At the very place of a light that weakens from there, as good as infinite is enough.
            let arrives = if FALLOFF { 1.0 / (falloff * square).max(f32::MIN_POSITIVE) } else { 1.0 };
            strength[i] = self.lit.visible[i] * arrives;
            diffuse[i] = strength[i] * ((n[0] * d[0] + n[1] * d[1] + n[2] * d[2]) * inv).max(0.0);
            if SPECULAR {
                let h = [0, 1, 2].map(|k| d[k] * inv + self.view[k][i]);
                let inv = 1.0 / (h[0] * h[0] + h[1] * h[1] + h[2] * h[2]).sqrt().max(1e-15);
                cos_h[i] = f64::from(((n[0] * h[0] + n[1] * h[1] + n[2] * h[2]) * inv).clamp(0.0, 1.0));
            }
        }
        if SPECULAR {
            let power: [f64; LANES] = powers(&cos_h, &b.shininess);
            for i in 0..LANES {
                specular[i] = strength[i] * power[i] as f32;
            }
        }
        for k in 0..3 {
            let color = self.light.color[k];
            let add: F32 =
                std::array::from_fn(|i| color * (b.diffuse[k][i] * diffuse[i] + b.specular[k][i] * specular[i]));
            for i in 0..LANES {
                b.color[k][i] += add[i];
            }
        }
    }
}

/// Points on the disc that a light with a size shows to each point of a block, from points of
/// the unit square.
pub fn points_on(block: &Block, light: &Light, square: impl Fn(usize) -> [f64; 2]) -> [F64; 3] {
    let mut points = [[0.0; LANES]; 3];
    for i in 0..block.len {
        let to_light = (light.position - Block::dvec3(&block.p, i)).normalize_or(DVec3::Z);
        let (across, up) = to_light.any_orthonormal_pair();
        let [u, v] = square(i);
        let disc = light.radius * concentric_disc(u, v);
        let p = light.position + across * disc.x + up * disc.y;
        (points[0][i], points[1][i], points[2][i]) = p.into();
    }
    points
}

/// Of every lane, lit or not: a choice in between would keep the loop from being vector code.
#[inline(always)]
fn powers(cos: &[f64; LANES], shininess: &F32) -> [f64; LANES] {
    let mut power = [0.0; LANES];
    for i in 0..LANES {
        power[i] = pow01(cos[i], f64::from(shininess[i]));
    }
    power
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DVec3, Vec3};

    /// A point at the origin that faces +y and is seen from (0, 1, 0).
    fn block() -> Block {
        let mut b = Block::EMPTY;
        b.len = 1;
        (b.ng[1], b.ns[1], b.to_eye[1]) = ([1.0; LANES], [1.0; LANES], [1.0; LANES]);
        b.diffuse = [[0.5; LANES], [0.25; LANES], [0.0; LANES]];
        b
    }

    fn light(position: DVec3) -> Light {
        Light::constant(position, Vec3::new(1.0, 2.0, 3.0))
    }

    /// As a wave does it.
    fn shine(b: &mut Block, light: &Light, seen_from: Option<DVec3>) -> Vec3 {
        let mut packet = RayPacket::EMPTY;
        aim(b, light, Target::Center, &mut packet);
        let before = Block::vec3(&b.color, 0);
        let to_light = [packet.d_x, packet.d_y, packet.d_z];
        let shining = shines(b);
        add(b, light, Lit { visible: &unoccluded(&packet), to_light: &to_light, seen_from }, shining);
        Block::vec3(&b.color, 0) - before
    }

    #[test]
    fn blinn_phong_by_hand() {
        let mut b = block();
        let light = light(DVec3::new(6.0, 8.0, 0.0));
        let dull = shine(&mut b, &light, None);
        assert!((dull - Vec3::new(0.4, 0.4, 0.0)).length() < 1e-6);
        b.specular = [[0.5; LANES]; 3];
        b.shininess = [2.0; LANES];
        // h halves the angle between light and +y: cos 2a = 0.8, (cos a)^2 = 0.9.
        let want = Vec3::new(0.4, 0.4, 0.0) + light.color * 0.45;
        assert!((shine(&mut b, &light, None) - want).length() < 1e-6);
        // Seen from where the mirrored light goes, h is the normal.
        let want = Vec3::new(0.4, 0.4, 0.0) + light.color * 0.5;
        assert!((shine(&mut b, &light, Some(DVec3::new(-3.0, 4.0, 0.0))) - want).length() < 1e-6);
    }

    #[test]
    fn light_weakens_with_the_square_of_the_distance() {
        let mut b = block();
        let constant = light(DVec3::new(0.0, 4.0, 0.0));
        let full = shine(&mut b, &constant, None);
        let weak = shine(&mut b, &Light { falloff: Some(1.0), ..constant }, None);
        assert!((weak * 16.0 - full).length() < 1e-6);
        let in_larger_units = shine(&mut b, &Light { falloff: Some(4.0), ..constant }, None);
        assert!((in_larger_units * 64.0 - full).length() < 1e-6);
        let at_the_point = shine(&mut b, &Light { falloff: Some(1.0), ..light(DVec3::ZERO) }, None);
        assert_eq!(at_the_point, Vec3::ZERO);
    }

    #[test]
    fn lanes_that_need_no_ray_send_none_and_stay_dark() {
        let (mut b, mut packet) = (block(), RayPacket::EMPTY);
        let aim = |b: &Block, light: &Light, packet: &mut RayPacket| aim(b, light, Target::Center, packet);
        assert_eq!(aim(&b, &light(DVec3::NEG_Y), &mut packet), (0, 1));
        assert!(packet.t_far.iter().all(|&t| t == f32::NEG_INFINITY));
        assert_eq!(shine(&mut b, &light(DVec3::NEG_Y), None), Vec3::ZERO);
        b.ns[1] = [-1.0; LANES];
        assert_eq!(aim(&b, &light(DVec3::Y), &mut packet), (0, 1), "either normal may say that it is dark");
        b.diffuse = [[0.0; LANES]; 3];
        assert_eq!(aim(&b, &light(DVec3::NEG_Y), &mut packet), (0, 0), "no light can change it");
        assert_eq!(aim(&block(), &light(DVec3::Y), &mut packet), (1, 0));
        assert_eq!(packet.t_far[0], BEFORE_THE_LIGHT);
        assert!(packet.t_far[1..].iter().all(|&t| t == f32::NEG_INFINITY), "only one lane is in use");
    }

    #[test]
    fn points_of_a_light_lie_on_the_disc_that_it_shows() {
        let b = block();
        let light = Light { radius: 0.5, ..light(DVec3::new(0.0, 3.0, 4.0)) };
        for k in 0..100 {
            let square = [f64::from(k % 10) / 10.0, f64::from(k / 10) / 10.0];
            let points = points_on(&b, &light, |_| square);
            let p = Block::dvec3(&points, 0) - light.position;
            assert!(p.length() <= 0.5 + 1e-12 && p.dot(light.position).abs() < 1e-12, "{p}");
            let mut packet = RayPacket::EMPTY;
            assert_eq!(aim(&b, &light, Target::Points(&points), &mut packet), (1, 0));
        }
    }
}
