//! Which shadow rays a light needs: none where it could add nothing, or is known to be hidden.

use super::block::{Block, F32, F64};
use super::lights;
use crate::geom::{LANES, RayPacket};
use crate::scene::Light;
use crate::simd::{self, Kernel};
use glam::DVec3;

/// End of a shadow ray that was sent at a light: just short of it.
pub const BEFORE_THE_LIGHT: f32 = 1.0 - 4.0 * 0.5 * f32::EPSILON;

/// What a light would add to the lanes of a block if nothing were in the way, before the weight.
#[repr(align(64))]
#[derive(Clone, Debug)]
pub struct Shine {
    /// Linear RGB.
    pub add: [F32; 3],
}

impl Shine {
    /// Nothing.
    pub const NONE: Self = Self { add: [[0.0; LANES]; 3] };
}

/// When a shadow ray may be left out.
#[derive(Clone, Copy, Debug, Default)]
pub struct Rules {
    /// After a bounce, a light is left out where it would add less than this to the sample. 0 leaves none out.
    pub faint: f32,
    /// Whether the light stands outside of every closed shape, so that from the inside of one it is hidden.
    pub outside: bool,
    /// Whether highlights are computed even where there are none.
    pub power: bool,
}

impl Rules {
    /// Share of the weight cut below which a light is faint. What branches bring mostly makes up for a good part of
    /// what the cut allows, a light is known to add all of it: at 1/16 a light left out at the default cut is less than a
    /// fifth of a step of an 8-bit image in the dark.
    pub const FAINT_SHARE: f32 = 1.0 / 16.0;
}

/// Lanes of a block, one bit each.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Asked {
    /// Those that need a ray.
    pub sent: u32,
    /// No ray: the surface faces away.
    pub facing_away: u32,
    /// No ray: the light is outside of the closed shape that the point is on the inner side of.
    pub enclosed: u32,
    /// No ray: the light would add less than [`Rules::faint`].
    pub faint: u32,
    /// Whether highlights were computed.
    pub power: bool,
    /// Whether nothing was, as no lane can see the light.
    pub dark: bool,
}

/// Shadow rays from a block to the middle of a light, and what the light would add: `t_far` is minus
/// infinity in the lanes that need none. Highlights are seen from a point, or else from where each ray came.
pub fn at_center(
    block: &Block,
    light: &Light,
    seen_from: Option<DVec3>,
    rules: Rules,
    packet: &mut RayPacket,
    shine: &mut Shine,
) -> Asked {
    let view = &lights::view(block, seen_from);
    let power = rules.power || lights::shines(block);
    let asked = match (power, light.falloff.is_some()) {
        (false, false) => simd::run(AtCenter::<false, false> { block, light, view, rules, packet, shine }),
        (false, true) => simd::run(AtCenter::<false, true> { block, light, view, rules, packet, shine }),
        (true, false) => simd::run(AtCenter::<true, false> { block, light, view, rules, packet, shine }),
        (true, true) => simd::run(AtCenter::<true, true> { block, light, view, rules, packet, shine }),
    };
    Asked { power, ..asked }
}

/// Shadow rays from the lanes `wanted` of a block to one point each, where that is not behind the
/// surface. Tells which those are.
pub fn at_points(block: &Block, points: &[F64; 3], wanted: u32, packet: &mut RayPacket) -> u32 {
    simd::run(AtPoints { block, points, wanted, packet })
}

struct AtCenter<'a, const SPECULAR: bool, const FALLOFF: bool> {
    block: &'a Block,
    light: &'a Light,
    view: &'a [F32; 3],
    rules: Rules,
    packet: &'a mut RayPacket,
    shine: &'a mut Shine,
}

impl<const SPECULAR: bool, const FALLOFF: bool> Kernel for AtCenter<'_, SPECULAR, FALLOFF> {
    type Output = Asked;

    #[inline(always)]
    fn run(self) -> Asked {
        let (b, l) = (self.block, self.light.position.to_array());
        let mut asked = Asked::default();
        let mut candidate = [false; LANES];
        for (i, candidate) in candidate.iter_mut().enumerate() {
            let to_light = [0, 1, 2].map(|k| l[k] - b.p[k][i]);
            let answers = [0, 1, 2].map(|k| b.diffuse[k][i] + b.specular[k][i]);
            let live = (i < b.len) & (answers[0] + answers[1] + answers[2] > 0.0);
            let hidden = self.rules.outside & b.enclosed[i];
            // Dark for the facet is dark, whatever an interpolated normal says.
            let lit = (along(&b.ng, i, to_light) > 0.0) & (along(&b.ns, i, to_light) > 0.0);
            *candidate = live & !hidden & lit;
            asked.enclosed |= u32::from(live & hidden) << i;
            asked.facing_away |= u32::from(live & !hidden & !lit) << i;
        }
        if !candidate.iter().fold(false, |any, &one| any | one) {
            self.packet.t_far = [f32::NEG_INFINITY; LANES];
            return Asked { dark: true, ..asked };
        }
        // Loops, for the calls that `map` makes are no vector code.
        let mut d = [[0f32; LANES]; 3];
        for (k, d) in d.iter_mut().enumerate() {
            for (i, d) in d.iter_mut().enumerate() {
                *d = from_front(b, i, k, l[k]);
            }
        }
        let add = lights::answers::<SPECULAR, FALLOFF>(b, self.light, &d, self.view);
        let mut t_far = [f32::NEG_INFINITY; LANES];
        for i in 0..LANES {
            let some = (add[0][i] != 0.0) | (add[1][i] != 0.0) | (add[2][i] != 0.0);
            let most = (b.weight[0][i] * add[0][i]).max(b.weight[1][i] * add[1][i]).max(b.weight[2][i] * add[2][i]);
            let faint = (b.depth[i] > 0) & (most < self.rules.faint);
            let send = candidate[i] & some & !faint;
            t_far[i] = if send { BEFORE_THE_LIGHT } else { f32::NEG_INFINITY };
            asked.sent |= u32::from(send) << i;
            asked.faint |= u32::from(candidate[i] & some & faint) << i;
        }
        self.shine.add = add;
        fill(self.packet, b, d, t_far);
        asked
    }
}

struct AtPoints<'a> {
    block: &'a Block,
    points: &'a [F64; 3],
    wanted: u32,
    packet: &'a mut RayPacket,
}

impl Kernel for AtPoints<'_> {
    type Output = u32;

    #[inline(always)]
    fn run(self) -> u32 {
        let b = self.block;
        let (mut d, mut t_far) = ([[0f32; LANES]; 3], [0f32; LANES]);
        let mut sent = 0;
        for i in 0..LANES {
            let end = [0, 1, 2].map(|k| self.points[k][i]);
            let above = along(&b.ng, i, [0, 1, 2].map(|k| end[k] - b.p[k][i])) > 0.0;
            let send = (self.wanted >> i & 1 != 0) & above;
            t_far[i] = if send { BEFORE_THE_LIGHT } else { f32::NEG_INFINITY };
            sent |= u32::from(send) << i;
            for k in 0..3 {
                d[k][i] = from_front(b, i, k, end[k]);
            }
        }
        fill(self.packet, b, d, t_far);
        sent
    }
}

#[inline(always)]
fn along(n: &[F64; 3], i: usize, to: [f64; 3]) -> f64 {
    n[0][i] * to[0] + n[1][i] * to[1] + n[2][i] * to[2]
}

/// Component `k` of the way from where the shadow rays of lane `i` start to `end`; no subnormal.
#[inline(always)]
fn from_front(b: &Block, i: usize, k: usize, end: f64) -> f32 {
    let to = (end - f64::from(b.front[k][i])) as f32;
    if to.abs() < f32::MIN_POSITIVE { 0.0 } else { to }
}

#[inline(always)]
fn fill(p: &mut RayPacket, b: &Block, d: [F32; 3], t_far: F32) {
    [p.o_x, p.o_y, p.o_z] = b.front;
    [p.d_x, p.d_y, p.d_z] = d;
    p.t_near = [0.0; LANES];
    p.t_far = t_far;
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    const ALL: Rules = Rules { faint: 0.0, outside: true, power: false };

    /// A point at the origin that faces +y, in lane 0.
    fn block() -> Block {
        let mut b = Block::EMPTY;
        b.len = 1;
        (b.ng[1], b.ns[1], b.to_eye[1]) = ([1.0; LANES], [1.0; LANES], [1.0; LANES]);
        b.diffuse = [[0.5; LANES], [0.25; LANES], [0.0; LANES]];
        b.weight = [[1.0; LANES]; 3];
        b
    }

    fn asked(b: &Block, at: DVec3, rules: Rules) -> (Asked, RayPacket, Shine) {
        let (mut packet, mut shine) = (RayPacket::EMPTY, Shine::NONE);
        let light = Light::constant(at, Vec3::new(1.0, 2.0, 3.0));
        (at_center(b, &light, None, rules, &mut packet, &mut shine), packet, shine)
    }

    #[test]
    fn only_lanes_that_a_light_can_change_send_a_ray() {
        let mut b = block();
        let (sent, packet, shine) = asked(&b, DVec3::Y, ALL);
        assert_eq!(sent, Asked { sent: 1, ..Asked::default() });
        assert_eq!(packet.t_far[0], BEFORE_THE_LIGHT);
        assert!(packet.t_far[1..].iter().all(|&t| t == f32::NEG_INFINITY), "only one lane is in use");
        assert_eq!(Block::vec3(&shine.add, 0), Vec3::new(0.5, 0.5, 0.0));
        let (away, packet, _) = asked(&b, DVec3::NEG_Y, ALL);
        assert_eq!(away, Asked { facing_away: 1, dark: true, ..Asked::default() });
        assert!(packet.t_far.iter().all(|&t| t == f32::NEG_INFINITY));
        b.ns[1] = [-1.0; LANES];
        assert_eq!(asked(&b, DVec3::Y, ALL).0.facing_away, 1, "either normal may say that it is dark");
        b.diffuse = [[0.0; LANES]; 3];
        assert_eq!(asked(&b, DVec3::NEG_Y, ALL).0, Asked { dark: true, ..Asked::default() }, "no light can change it");
    }

    #[test]
    fn a_highlight_too_narrow_to_be_seen_needs_no_ray() {
        let mut b = block();
        (b.diffuse, b.specular, b.shininess) = ([[0.0; LANES]; 3], [[1.0; LANES]; 3], [1000.0; LANES]);
        assert_eq!(asked(&b, DVec3::new(1.0, 0.2, 0.0), ALL).0.sent, 0, "less than any float above 0");
        assert_eq!(asked(&b, DVec3::new(0.01, 1.0, 0.0), ALL).0.sent, 1);
    }

    #[test]
    fn from_inside_a_closed_shape_lights_outside_are_hidden() {
        let mut b = block();
        b.enclosed = [true; LANES];
        assert_eq!(asked(&b, DVec3::Y, ALL).0, Asked { enclosed: 1, dark: true, ..Asked::default() });
        assert_eq!(asked(&b, DVec3::Y, Rules { outside: false, ..ALL }).0.sent, 1);
    }

    #[test]
    fn faint_lights_are_cut_only_after_a_bounce() {
        let mut b = block();
        b.weight = [[0.01; LANES]; 3];
        let cut = Rules { faint: 0.01, ..ALL };
        assert_eq!(asked(&b, DVec3::Y, cut).0.sent, 1);
        b.depth = [1; LANES];
        assert_eq!(asked(&b, DVec3::Y, cut).0, Asked { faint: 1, ..Asked::default() });
        assert_eq!(asked(&b, DVec3::Y, Rules { faint: 0.005, ..ALL }).0.sent, 1, "it adds 0.005");
    }
}
