//! The branches that go on from hits.

#![expect(clippy::needless_range_loop, reason = "an index runs over many arrays at once")]

use super::block::{Block, EPS, F32, F64, get, put, round_away};
use super::contacts::Contacts;
use super::media::{Media, Medium};
use super::optics;
use super::surface::SurfacePoint;
use crate::geom::LANES;
use crate::scene::{Material, Object, Reflect, Scene};
use crate::simd::{self, Kernel};
use glam::{DVec3, Vec3};

/// A ray that goes on from a hit.
#[derive(Clone, Copy, Debug)]
pub struct Branch {
    /// Where it starts.
    pub o: Vec3,
    /// Unit direction.
    pub d: Vec3,
    /// Share of what it brings that the hit passes on.
    pub weight: Vec3,
    /// Whether it goes to the inner side of the surface.
    pub inwards: bool,
}

/// What goes on from a hit.
#[derive(Clone, Copy, Debug)]
pub struct Onward {
    /// The mirrored branch, in the medium that the ray came through.
    pub reflected: Option<Branch>,
    /// The branch that passes.
    pub refracted: Option<Branch>,
    /// What that one travels in.
    pub behind: Medium,
}

/// The branches of a block of hits.
#[derive(Debug)]
pub struct Onwards {
    /// Index of refraction before the surface over that behind it.
    eta: F64,
    /// What is behind the surface.
    behind: [Medium; LANES],
    /// Whether nothing is to be seen of the surface.
    hidden: [bool; LANES],
    turns: Turns,
}

impl Default for Onwards {
    fn default() -> Self {
        let behind = [Medium::OUTSIDE; LANES];
        Self { eta: [1.0; LANES], behind, hidden: [false; LANES], turns: Turns::default() }
    }
}

impl Onwards {
    /// Finds those of the lanes that are `branching`, one bit each.
    pub fn find(&mut self, scene: &Scene, contacts: &Contacts, media: &mut Media, block: &Block, branching: u32) {
        for lane in (0..LANES).filter(|lane| branching >> lane & 1 != 0) {
            self.cross(scene, contacts, media, block, lane);
        }
        let (eta, turns) = (&self.eta, &mut self.turns);
        if scene.course_rules {
            simd::run(Turn::<true> { block, eta, turns });
        } else {
            simd::run(Turn::<false> { block, eta, turns });
        }
    }

    /// What is on the two sides of the surface at `lane`.
    fn cross(&mut self, scene: &Scene, contacts: &Contacts, media: &mut Media, block: &Block, lane: usize) {
        let (id, medium) = (block.id[lane], block.medium[lane]);
        let material = &scene.materials[block.material[lane] as usize];
        (self.eta[lane], self.behind[lane], self.hidden[lane]) = (1.0, medium, false);
        if scene.course_rules {
            self.eta[lane] = 1.0 / material.ior;
            return;
        }
        if !is_dense(material) {
            return;
        }
        // What neither bends nor absorbs fills no space: a sheet with holes, say. A ball or box of
        // it is a bubble in what the ray is in.
        let bubble = medium != Medium::OUTSIDE && is_closed(scene, id);
        if material.ior != 1.0 || material.absorption != Vec3::ZERO || bubble {
            let also = contacts.crossed(scene, id, || SurfacePoint::of_lane(block, lane).both_sides());
            let (index, entering) = (block.material[lane], block.entering[lane]);
            let crossing = media.cross(&scene.materials, medium, index, entering, also.as_ref());
            (self.eta[lane], self.behind[lane], self.hidden[lane]) = (crossing.eta, crossing.behind, crossing.hidden);
        }
    }

    /// The branches of a lane whose material is branching.
    ///
    /// Under total internal reflection what would have been refracted is mirrored.
    #[must_use]
    pub fn lane(&self, scene: &Scene, block: &Block, lane: usize) -> Onward {
        let (turns, behind) = (&self.turns, self.behind[lane]);
        let material = &scene.materials[block.material[lane] as usize];
        let entering = block.entering[lane];
        let mirrored = |weight| Branch {
            o: Block::vec3(&turns.mirrored_from, lane),
            d: Block::dvec3(&turns.mirrored, lane).as_vec3(),
            weight,
            inwards: turns.mirrored_rises[lane] != entering,
        };
        let passed = |weight| Branch {
            o: Block::vec3(&turns.passed_from, lane),
            d: Block::dvec3(&turns.passed, lane).as_vec3(),
            weight,
            inwards: turns.passed_rises[lane] != entering,
        };
        if self.hidden[lane] {
            // Index 1 on both sides: straight on.
            return Onward { reflected: None, refracted: Some(passed(Vec3::ONE)), behind };
        }
        let (cos_i, passes) = (turns.cos_i[lane], turns.passes[lane] && is_dense(material));
        let (mut reflect, refract) = match material.reflect {
            Reflect::Constant(weight) => (weight, material.refract),
            Reflect::Metal(color) => (color + (Vec3::ONE - color) * optics::schlick(cos_i) as f32, material.refract),
            // The equations say the same, but for 0 / 0 where the ray grazes.
            Reflect::Fresnel if self.eta[lane] == 1.0 => (Vec3::ZERO, material.refract),
            Reflect::Fresnel => {
                let f = if passes { optics::reflectance(cos_i, turns.cos_t[lane], self.eta[lane]) as f32 } else { 1.0 };
                (Vec3::splat(f), material.refract * (1.0 - f))
            }
        };
        if !passes && material.reflect != Reflect::Fresnel {
            reflect += refract;
        }
        Onward {
            reflected: (reflect != Vec3::ZERO).then(|| mirrored(reflect)),
            refracted: (passes && refract != Vec3::ZERO).then(|| passed(refract)),
            behind,
        }
    }
}

/// Whether light that meets it may pass.
fn is_dense(material: &Material) -> bool {
    material.refracts() || material.reflect == Reflect::Fresnel
}

/// Whether the surface is known to enclose a space.
fn is_closed(scene: &Scene, [object, _]: [u32; 2]) -> bool {
    matches!(&scene.objects[object as usize], Object::Shapes(shapes) if shapes.set.are_closed())
}

/// The directions that rays of a block are turned to, in whatever they may be asked about.
#[repr(align(64))]
#[derive(Debug, Default)]
struct Turns {
    mirrored: [F64; 3],
    passed: [F64; 3],
    mirrored_from: [F32; 3],
    passed_from: [F32; 3],
    /// Whether they go to the side that the geometric normal points to.
    mirrored_rises: [bool; LANES],
    passed_rises: [bool; LANES],
    /// Whether there is a refracted ray: not under total internal reflection.
    passes: [bool; LANES],
    cos_i: F64,
    cos_t: F64,
}

struct Turn<'a, const COURSE: bool> {
    block: &'a Block,
    eta: &'a F64,
    turns: &'a mut Turns,
}

impl<const COURSE: bool> Kernel for Turn<'_, COURSE> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        turn::<COURSE>(self.block, self.eta, self.turns);
    }
}

/// Three loops, for one of all this is not made into vector code.
#[inline(always)]
fn turn<const COURSE: bool>(b: &Block, eta: &F64, out: &mut Turns) {
    for i in 0..LANES {
        let (d, ng, n) = facing(b, i);
        let mirrored = above(optics::reflect(d, n), ng, d);
        out.cos_i[i] = -n.dot(d);
        put(&mut out.mirrored, i, mirrored.to_array());
    }
    for i in 0..LANES {
        let (d, ng, n) = facing(b, i);
        let bent = optics::refract::<COURSE>(d, n, eta[i]);
        let passed = below(bent.direction, ng, d);
        out.passes[i] = bent.passes;
        out.cos_t[i] = bent.cos_t;
        put(&mut out.passed, i, passed.to_array());
    }
    start(b, &out.mirrored, &mut out.mirrored_from, &mut out.mirrored_rises);
    start(b, &out.passed, &mut out.passed_from, &mut out.passed_rises);
}

/// Unit direction of the ray, geometric normal, and the normal that turns the ray.
#[inline(always)]
fn facing(b: &Block, i: usize) -> (DVec3, DVec3, DVec3) {
    let to_eye = DVec3::new(b.to_eye[0][i].into(), b.to_eye[1][i].into(), b.to_eye[2][i].into());
    let d = -optics::unit(to_eye);
    let (ng, ns) = (DVec3::from_array(get(&b.ng, i)), DVec3::from_array(get(&b.ns, i)));
    // A smooth normal may face away from the ray although the facet does not.
    (d, ng, select(ns.dot(d) < 0.0, ns, ng))
}

/// Origins of rays along `w`, and whether they go to the side that the geometric normal points to.
#[inline(always)]
fn start(b: &Block, w: &[F64; 3], from: &mut [F32; 3], rises: &mut [bool; LANES]) {
    for i in 0..LANES {
        let (p, ng) = (DVec3::from_array(get(&b.p, i)), DVec3::from_array(get(&b.ng, i)));
        let rise = DVec3::from_array(get(w, i)).dot(ng) >= 0.0;
        let o = origin(p, if rise { 1.0 } else { -1.0 } * ng, b.extent[i]);
        rises[i] = rise;
        for k in 0..3 {
            from[k][i] = o[k];
        }
    }
}

/// [`geom::offset_origin`](crate::geom::offset_origin) without a branch.
#[inline(always)]
fn origin(p: DVec3, side: DVec3, extent: f64) -> [f32; 3] {
    let delta = 4.0 * EPS * (p.x.abs().max(p.y.abs()).max(p.z.abs()) + extent);
    let q = p + delta * side;
    [round_away(q.x, side.x), round_away(q.y, side.y), round_away(q.z, side.z)]
}

#[inline(always)]
fn select(first: bool, a: DVec3, b: DVec3) -> DVec3 {
    let pick = |a: f64, b: f64| if first { a } else { b };
    DVec3::new(pick(a.x, b.x), pick(a.y, b.y), pick(a.z, b.z))
}

/// Least part along the facet's normal of a ray that leaves it.
const LEAST_RISE: f64 = 1e-3;

/// A mirrored direction that an interpolated normal sent below the facet, lifted to just above.
#[inline(always)]
fn above(r: DVec3, ng: DVec3, d: DVec3) -> DVec3 {
    let rise = r.dot(ng);
    // At grazing incidence the true mirrored ray leaves flatter than the limit.
    let least = LEAST_RISE.min(-d.dot(ng));
    select(rise >= least, r, optics::unit(r + ng * (least - rise)))
}

/// A refracted direction that an interpolated normal kept above the facet, pushed to just below.
#[inline(always)]
fn below(t: DVec3, ng: DVec3, d: DVec3) -> DVec3 {
    let fall = -t.dot(ng);
    let least = LEAST_RISE.min(-d.dot(ng));
    select(fall >= least, t, optics::unit(t - ng * (least - fall)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::offset_origin;

    /// The branches of a hit at the origin, of a facet that faces +y, which is the outer side if `entering`.
    fn branches(material: Material, ns: DVec3, d: DVec3, entering: bool) -> (Option<Branch>, Option<Branch>) {
        let scene = Scene { materials: vec![material], ..Scene::of(Vec::new()) };
        let mut block = Block::EMPTY;
        (block.len, block.ng[1][0], block.entering[0], block.extent[0]) = (1, 1.0, entering, 1.0);
        put(&mut block.ns, 0, ns.to_array());
        for k in 0..3 {
            block.to_eye[k][0] = -d[k] as f32;
        }
        let mut onwards = Onwards::default();
        onwards.find(&scene, &Contacts::default(), &mut Media::new(), &block, 1);
        let onward = onwards.lane(&scene, &block, 0);
        (onward.reflected, onward.refracted)
    }

    fn glass(reflect: Reflect) -> Material {
        Material { reflect, refract: Vec3::splat(0.9), ior: 1.5, ..Material::default() }
    }

    #[test]
    fn total_reflection_adds_the_mirrored_ray() {
        let flat = DVec3::new(0.8, -0.6, 0.0);
        let (r, t) = branches(glass(Reflect::Constant(Vec3::splat(0.1))), DVec3::Y, flat, false);
        assert!(t.is_none());
        assert!((r.expect("mirrored").weight - Vec3::ONE).length() < 1e-6);
        let (r, t) = branches(glass(Reflect::Fresnel), DVec3::Y, flat, false);
        let r = r.expect("mirrored");
        assert!(t.is_none() && r.weight == Vec3::ONE && r.inwards, "it stays inside");
    }

    #[test]
    fn fresnel_shares_add_up() {
        let clear = Material { refract: Vec3::ONE, ..glass(Reflect::Fresnel) };
        for (x, y) in [(0.0, 1.0), (0.6, 0.8), (0.96, 0.28)] {
            let (r, t) = branches(clear.clone(), DVec3::Y, DVec3::new(x, -y, 0.0), true);
            let (r, t) = (r.expect("mirrored"), t.expect("refracted"));
            assert!((r.weight + t.weight - Vec3::ONE).length() < 1e-6);
            assert!((r.d - DVec3::new(x, y, 0.0).as_vec3()).length() < 1e-7);
            assert!((f64::from(t.d.x) - x / 1.5).abs() < 1e-7 && t.d.y < 0.0);
            assert!(t.inwards && !r.inwards);
        }
    }

    #[test]
    fn equal_indices_mirror_nothing_at_any_angle() {
        let same = Material { ior: 1.0, ..glass(Reflect::Fresnel) };
        for (x, y) in [(0.0, 1.0), (0.8, 0.6), (1.0, 0.0)] {
            let (r, t) = branches(same.clone(), DVec3::Y, DVec3::new(x, -y, 0.0), true);
            assert!(r.is_none() && t.expect("it passes").weight == same.refract, "{x} {y}");
        }
    }

    #[test]
    fn a_tilted_shading_normal_sends_no_ray_through_the_facet() {
        let d = DVec3::new(-0.9, -0.1, 0.0).normalize();
        let (r, t) = branches(glass(Reflect::Constant(Vec3::ONE)), DVec3::new(0.6, 0.8, 0.0), d, true);
        assert!(r.expect("mirrored").d.y > 0.0 && t.expect("refracted").d.y < 0.0);
    }

    #[test]
    fn rays_start_where_a_single_one_would() {
        for (p, side) in [(DVec3::new(0.3, 0.7, -0.2), DVec3::Y), (DVec3::splat(1e6), DVec3::NEG_ONE.normalize())] {
            assert_eq!(Vec3::from_array(origin(p, side, 0.5)), offset_origin(p, side, 0.5));
        }
    }
}
