//! One light over a block of hits: its shadow rays, and what it adds where they get through.

#![expect(clippy::needless_range_loop, reason = "an index runs over many arrays at once")]

use super::block::{Block, F32};
use crate::geom::{LANES, RayPacket};
use crate::math::pow01;
use crate::scene::Light;
use crate::simd::{self, Kernel};

/// End of a shadow ray that was sent at a light: just short of it.
const BEFORE_THE_LIGHT: f32 = 1.0 - 4.0 * 0.5 * f32::EPSILON;

/// Shadow rays of a block: `t_far` is minus infinity in the lanes that need none. Tells how
/// many do, and how many were left out because the surface faces away.
pub fn aim(block: &Block, light: &Light, packet: &mut RayPacket) -> (u32, u32) {
    simd::run(Aim { block, light, packet })
}

/// Adds the light to the lanes of `block` whose shadow rays got through.
pub fn add(block: &mut Block, light: &Light, packet: &RayPacket) {
    // Nothing shines here: no power to take.
    if block.specular.iter().flatten().all(|&s| s == 0.0) {
        simd::run(Add::<false> { block, light, packet });
    } else {
        simd::run(Add::<true> { block, light, packet });
    }
}

struct Aim<'a> {
    block: &'a Block,
    light: &'a Light,
    packet: &'a mut RayPacket,
}

impl Kernel for Aim<'_> {
    type Output = (u32, u32);

    #[inline(always)]
    fn run(self) -> (u32, u32) {
        let (b, l) = (self.block, self.light.position.to_array());
        let (mut d, mut t_far) = ([[0f32; LANES]; 3], [0f32; LANES]);
        let (mut sent, mut away) = (0, 0);
        for i in 0..LANES {
            let to_light = [0, 1, 2].map(|k| l[k] - b.p[k][i]);
            let along = |n: &[[f64; LANES]; 3]| n[0][i] * to_light[0] + n[1][i] * to_light[1] + n[2][i] * to_light[2];
            let answers = [0, 1, 2].map(|k| b.diffuse[k][i] + b.specular[k][i]);
            let live = (i < b.len) & (answers[0] + answers[1] + answers[2] > 0.0);
            // Dark for the facet is dark, whatever an interpolated normal says.
            let lit = (along(&b.ng) > 0.0) & (along(&b.ns) > 0.0);
            t_far[i] = if live & lit { BEFORE_THE_LIGHT } else { f32::NEG_INFINITY };
            sent += u32::from(live & lit);
            away += u32::from(live & !lit);
            for k in 0..3 {
                let to = (l[k] - f64::from(b.front[k][i])) as f32;
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
struct Add<'a, const SPECULAR: bool> {
    block: &'a mut Block,
    light: &'a Light,
    packet: &'a RayPacket,
}

impl<const SPECULAR: bool> Kernel for Add<'_, SPECULAR> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let (b, p) = (self.block, self.packet);
        let (mut diffuse, mut specular) = ([0f32; LANES], [0f32; LANES]);
        let mut visible = [0f32; LANES];
        let mut cos_h = [0f64; LANES];
        for i in 0..LANES {
            let d = [p.d_x[i], p.d_y[i], p.d_z[i]];
            let inv = 1.0 / (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt();
            let n = [b.ns[0][i] as f32, b.ns[1][i] as f32, b.ns[2][i] as f32];
            visible[i] = if p.t_far[i] != f32::NEG_INFINITY { 1.0 } else { 0.0 };
            diffuse[i] = visible[i] * ((n[0] * d[0] + n[1] * d[1] + n[2] * d[2]) * inv).max(0.0);
            if SPECULAR {
                let h = [0, 1, 2].map(|k| d[k] * inv + b.to_eye[k][i]);
                let inv = 1.0 / (h[0] * h[0] + h[1] * h[1] + h[2] * h[2]).sqrt().max(1e-15);
                cos_h[i] = f64::from(((n[0] * h[0] + n[1] * h[1] + n[2] * h[2]) * inv).clamp(0.0, 1.0));
            }
        }
        if SPECULAR {
            let power: [f64; LANES] = powers(&cos_h, &b.shininess);
            for i in 0..LANES {
                specular[i] = visible[i] * power[i] as f32;
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

    #[test]
    fn blinn_phong_by_hand() {
        let (mut b, mut packet) = (block(), RayPacket::EMPTY);
        let light = light(DVec3::new(6.0, 8.0, 0.0));
        assert_eq!(aim(&b, &light, &mut packet), (1, 0));
        let dull = {
            let mut b = b.clone();
            add(&mut b, &light, &packet);
            Block::vec3(&b.color, 0)
        };
        assert!((dull - Vec3::new(0.4, 0.4, 0.0)).length() < 1e-6);
        b.specular = [[0.5; LANES]; 3];
        b.shininess = [2.0; LANES];
        add(&mut b, &light, &packet);
        // h halves the angle between light and +y: cos 2a = 0.8, (cos a)^2 = 0.9.
        let want = Vec3::new(0.4, 0.4, 0.0) + light.color * 0.45;
        assert!((Block::vec3(&b.color, 0) - want).length() < 1e-6);
    }

    #[test]
    fn lanes_that_need_no_ray_send_none_and_stay_dark() {
        let (mut b, mut packet) = (block(), RayPacket::EMPTY);
        assert_eq!(aim(&b, &light(DVec3::NEG_Y), &mut packet), (0, 1));
        assert!(packet.t_far.iter().all(|&t| t == f32::NEG_INFINITY));
        add(&mut b, &light(DVec3::NEG_Y), &packet);
        assert_eq!(Block::vec3(&b.color, 0), Vec3::ZERO);
        b.ns[1] = [-1.0; LANES];
        assert_eq!(aim(&b, &light(DVec3::Y), &mut packet), (0, 1), "either normal may say that it is dark");
        b.diffuse = [[0.0; LANES]; 3];
        assert_eq!(aim(&b, &light(DVec3::NEG_Y), &mut packet), (0, 0), "no light can change it");
        assert_eq!(aim(&block(), &light(DVec3::Y), &mut packet), (1, 0));
        assert_eq!(packet.t_far[0], BEFORE_THE_LIGHT);
        assert!(packet.t_far[1..].iter().all(|&t| t == f32::NEG_INFINITY), "only one lane is in use");
    }
}
