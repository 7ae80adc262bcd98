//! One light over a block of hits: what it adds where it is visible.

#![expect(clippy::needless_range_loop, reason = "an index runs over many arrays at once")]

use super::block::{Block, F32, F64};
use crate::geom::{LANES, RayPacket};
use crate::math::{concentric_disc, pow01};
use crate::scene::Light;
use glam::DVec3;

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

/// Unit vectors from the points of a block to where highlights are seen from.
#[inline]
#[must_use]
pub fn view(block: &Block, seen_from: Option<DVec3>) -> [F32; 3] {
    seen_from.map_or(block.to_eye, |eye| towards(block, eye))
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

/// Blinn-Phong: diffuse N·L, specular (N·H)^shininess with H halfway between light and eye. Linear RGB of the
/// whole light; `to_light` are vectors to its middle, `view` is unit. To be inlined into a
/// [`Kernel`](crate::simd::Kernel).
///
/// Source: J. F. Blinn, "Models of Light Reflection for Computer Synthesized Pictures",
/// SIGGRAPH 1977.
#[inline(always)]
pub fn answers<const SPECULAR: bool, const FALLOFF: bool>(
    b: &Block,
    light: &Light,
    to_light: &[F32; 3],
    view: &[F32; 3],
) -> [F32; 3] {
    let falloff = light.falloff.map_or(0.0, |f| f as f32);
    let (mut diffuse, mut specular) = ([0f32; LANES], [0f32; LANES]);
    let mut strength = [0f32; LANES];
    let mut cos_h = [0f64; LANES];
    for i in 0..LANES {
        let d = [to_light[0][i], to_light[1][i], to_light[2][i]];
        let square = (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).max(f32::MIN_POSITIVE);
        let inv = 1.0 / square.sqrt();
        let n = [b.ns[0][i] as f32, b.ns[1][i] as f32, b.ns[2][i] as f32];
        // At the very place of a light that weakens from there, as good as infinite is enough.
        strength[i] = if FALLOFF { 1.0 / (falloff * square).max(f32::MIN_POSITIVE) } else { 1.0 };
        diffuse[i] = strength[i] * ((n[0] * d[0] + n[1] * d[1] + n[2] * d[2]) * inv).max(0.0);
        if SPECULAR {
            let h = [0, 1, 2].map(|k| d[k] * inv + view[k][i]);
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
    let mut add = [[0f32; LANES]; 3];
    for k in 0..3 {
        let color = light.color[k];
        for i in 0..LANES {
            add[k][i] = color * (b.diffuse[k][i] * diffuse[i] + b.specular[k][i] * specular[i]);
        }
    }
    add
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
    use super::super::aim;
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

    /// As a wave has it.
    fn shine(b: &Block, light: &Light, seen_from: Option<DVec3>) -> Vec3 {
        let mut shine = aim::Shine::NONE;
        aim::at_center(b, light, seen_from, aim::Rules::default(), &mut RayPacket::EMPTY.clone(), &mut shine);
        Block::vec3(&shine.add, 0)
    }

    #[test]
    fn blinn_phong_by_hand() {
        let mut b = block();
        let light = light(DVec3::new(6.0, 8.0, 0.0));
        let dull = shine(&b, &light, None);
        assert!((dull - Vec3::new(0.4, 0.4, 0.0)).length() < 1e-6);
        b.specular = [[0.5; LANES]; 3];
        b.shininess = [2.0; LANES];
        // h halves the angle between light and +y: cos 2a = 0.8, (cos a)^2 = 0.9.
        let want = Vec3::new(0.4, 0.4, 0.0) + light.color * 0.45;
        assert!((shine(&b, &light, None) - want).length() < 1e-6);
        // Seen from where the mirrored light goes, h is the normal.
        let want = Vec3::new(0.4, 0.4, 0.0) + light.color * 0.5;
        assert!((shine(&b, &light, Some(DVec3::new(-3.0, 4.0, 0.0))) - want).length() < 1e-6);
    }

    #[test]
    fn light_weakens_with_the_square_of_the_distance() {
        let b = block();
        let constant = light(DVec3::new(0.0, 4.0, 0.0));
        let full = shine(&b, &constant, None);
        let weak = shine(&b, &Light { falloff: Some(1.0), ..constant }, None);
        assert!((weak * 16.0 - full).length() < 1e-6);
        let in_larger_units = shine(&b, &Light { falloff: Some(4.0), ..constant }, None);
        assert!((in_larger_units * 64.0 - full).length() < 1e-6);
        let at_the_point = shine(&b, &Light { falloff: Some(1.0), ..light(DVec3::ZERO) }, None);
        assert_eq!(at_the_point, Vec3::ZERO);
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
            assert_eq!(
                (aim::at_points(&b, &points, 1, &mut packet), aim::at_points(&b, &points, 0, &mut packet)),
                (1, 0)
            );
        }
    }
}
