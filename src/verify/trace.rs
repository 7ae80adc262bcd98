//! Sends rays through both backends and tallies the answers.

use super::aim::Aim;
use super::judge::{Judge, Verdict};
use super::report::{Answer, Case, Group, Report};
use crate::backend::Backend;
use crate::geom::{Coherence, Hit, LANES, PacketBatch, Ray, RayHitPacket, RayPacket};
use crate::math::Random;
use crate::math::concentric_disc;
use crate::render::{SurfacePoint, Surfaces, optics};
use crate::scene::{Camera, Light, Scene};
use glam::{DVec2, DVec3};

/// Index of refraction of what refracted rays enter.
const INDEX: f64 = 1.5;
/// End of a ray that was sent at a light: just short of it, as a render sends it.
const BEFORE_THE_LIGHT: f32 = 1.0 - 2.0 * f32::EPSILON;

/// One thread's part of the work.
#[derive(Debug)]
pub(super) struct Tracer<'a, A, B> {
    judge: Judge<'a, A, B>,
    seed: u32,
    /// One for each backend.
    surfaces: [Surfaces<'a>; 2],
    pub(super) report: Report,
}

/// A ray, and what it is called.
#[derive(Clone, Copy, Debug)]
struct Sent {
    ray: Ray,
    index: u64,
}

/// Pixels `x0 <= x < x1`, `y0 <= y < y1` of a picture that is `width` pixels wide.
#[derive(Clone, Copy, Debug)]
pub(super) struct Part {
    pub(super) x: [u32; 2],
    pub(super) y: [u32; 2],
    pub(super) width: u32,
}

impl<'a, A: Backend, B: Backend> Tracer<'a, A, B> {
    pub(super) fn new(scene: &'a Scene, first: &'a A, second: &'a B, seed: u32) -> Self {
        let surfaces = [Surfaces::new(scene), Surfaces::new(scene)];
        Self { judge: Judge { scene, first, second }, seed, surfaces, report: Report::default() }
    }

    /// Rays `from` to `to` of a group that is aimed.
    pub(super) fn aimed(&mut self, aim: &Aim<'_>, group: Group, from: u64, to: u64) {
        let rays = (from..to).filter_map(|index| {
            let ray = aim.ray(group, &mut Random::of(self.seed, group as u32, index))?;
            Some(Sent { ray, index })
        });
        let rays: Vec<Sent> = rays.collect();
        self.singly(group, &rays);
    }

    /// A part of the picture: its camera rays, singly and in packets, and the rays that leave from what they hit.
    pub(super) fn picture(&mut self, camera: &Camera, part: Part) {
        let rays = self.camera_rays(camera, part);
        self.in_packets(&rays);
        let points = self.singly(Group::Camera, &rays);
        for (number, light) in self.judge.scene.lights.clone().iter().enumerate() {
            self.shadow(light, number as u64, &points);
        }
        for group in [Group::Mirrored, Group::Refracted, Group::Diffuse] {
            let rays = points.iter().filter_map(|(point, index)| {
                let ray = bounced(group, point, &mut Random::of(self.seed, group as u32, *index))?;
                Some(Sent { ray, index: *index })
            });
            let rays: Vec<Sent> = rays.collect();
            self.singly(group, &rays);
        }
    }

    /// One through a random point of each pixel, squares of four by four in a row.
    fn camera_rays(&self, camera: &Camera, part: Part) -> Vec<Sent> {
        const SIDE: u32 = 4;
        let mut rays = Vec::new();
        for y0 in (part.y[0]..part.y[1]).step_by(SIDE as usize) {
            for x0 in (part.x[0]..part.x[1]).step_by(SIDE as usize) {
                for y in y0..(y0 + SIDE).min(part.y[1]) {
                    for x in x0..(x0 + SIDE).min(part.x[1]) {
                        let index = u64::from(y) * u64::from(part.width) + u64::from(x);
                        let mut random = Random::of(self.seed, Group::Camera as u32, index);
                        let at = [x, y].map(|pixel| f64::from(pixel) + random.unit());
                        let lens = match camera.lens {
                            Some(_) => concentric_disc(random.unit(), random.unit()),
                            None => DVec2::ZERO,
                        };
                        let (o, d) = camera.ray(at[0], at[1], lens);
                        rays.push(Sent { ray: Ray::new(o.as_vec3(), d.as_vec3()), index });
                    }
                }
            }
        }
        rays
    }

    /// Nearest hits ray by ray, and whether anything is in the way of each. Returns the second backend's points.
    fn singly(&mut self, group: Group, rays: &[Sent]) -> Vec<(SurfacePoint, u64)> {
        let mut found = Vec::new();
        let (mut a, mut b) = (RayHitPacket::EMPTY, RayHitPacket::EMPTY);
        for rays in rays.chunks(LANES) {
            for (lane, sent) in rays.iter().enumerate() {
                a.ray.set(lane, &sent.ray);
                b.ray.set(lane, &sent.ray);
                a.set_hit(lane, self.judge.first.intersect(&sent.ray).as_ref());
                b.set_hit(lane, self.judge.second.intersect(&sent.ray).as_ref());
            }
            self.compare(group, rays, &a, &b, Some(&mut found), true);
        }
        found
    }

    /// Camera rays as a render sends them.
    fn in_packets(&mut self, rays: &[Sent]) {
        let mut a = PacketBatch::<RayHitPacket>::default();
        rays.iter().for_each(|sent| a.push(&sent.ray));
        let mut b = a.clone();
        self.judge.first.intersect_many(&mut a, Coherence::Coherent);
        self.judge.second.intersect_many(&mut b, Coherence::Coherent);
        for (i, rays) in rays.chunks(LANES).enumerate() {
            self.compare(Group::CameraPackets, rays, &a.packets()[i], &b.packets()[i], None, false);
        }
    }

    /// Compares the answers of a packet; with `any` asks too whether anything is in the way.
    fn compare(
        &mut self,
        group: Group,
        rays: &[Sent],
        a: &RayHitPacket,
        b: &RayHitPacket,
        mut found: Option<&mut Vec<(SurfacePoint, u64)>>,
        any: bool,
    ) {
        let live = rays.len();
        let known = |packet: &RayHitPacket| {
            let (scene, mut packet) = (self.judge.scene, packet.clone());
            (0..live).for_each(|lane| forget_unknown(scene, &mut packet, lane));
            packet
        };
        let (of_a, of_b) = (known(a), known(b));
        let points = [self.surfaces[0].of(&of_a, live), self.surfaces[1].of(&of_b, live)];
        for (lane, sent) in rays.iter().enumerate() {
            let (hit_a, hit_b) = (a.hit(lane), b.hit(lane));
            let tally = self.report.tally(group);
            tally.rays += 1;
            tally.hits += u64::from(hit_b.is_some());
            let made = [points[0][lane].as_ref(), points[1][lane].as_ref()];
            let verdict = self.judge.nearest(&sent.ray, hit_a, hit_b, made);
            if let Some(verdict) = verdict {
                let answer = |hit: Option<Hit>| hit.map_or(Answer::Nothing, Answer::Hit);
                self.note(group, sent, verdict, [answer(hit_a), answer(hit_b)]);
            } else if any {
                let way = (self.judge.first.occluded(&sent.ray), self.judge.second.occluded(&sent.ray));
                self.compare_any(group, sent, way);
            }
            if let (Some(found), Some(point)) = (&mut found, points[1][lane]) {
                found.push((point, sent.index));
            }
        }
    }

    fn compare_any(&mut self, group: Group, sent: &Sent, (a, b): (bool, bool)) {
        if let Some(verdict) = self.judge.any(&sent.ray, a, b) {
            let answer = |any: bool| if any { Answer::Occluded } else { Answer::Nothing };
            self.note(group, sent, verdict, [answer(a), answer(b)]);
        }
    }

    /// Whether anything is in the way of light number `number`, in packets as a render asks.
    fn shadow(&mut self, light: &Light, number: u64, points: &[(SurfacePoint, u64)]) {
        let mut a = PacketBatch::<RayPacket>::default();
        let mut sent = Vec::new();
        for (point, index) in points {
            let mut random = Random::of(self.seed, 64 + number as u32, *index);
            let at = light.position + light.radius * random.direction();
            if point.ng.dot(at - point.p) > 0.0 {
                let o = point.origin_towards(point.ng);
                let ray = Ray::segment(o, (at - o.as_dvec3()).as_vec3(), BEFORE_THE_LIGHT);
                a.push(&ray);
                sent.push(Sent { ray, index: (number << 40) | index });
            }
        }
        let mut b = a.clone();
        self.judge.first.occluded_many(&mut a, Coherence::Coherent);
        self.judge.second.occluded_many(&mut b, Coherence::Coherent);
        for (i, sent) in sent.iter().enumerate() {
            let of = |batch: &PacketBatch<RayPacket>| batch.packets()[i / LANES].is_occluded(i % LANES);
            let way = (of(&a), of(&b));
            let tally = self.report.tally(Group::Shadow);
            tally.rays += 1;
            tally.hits += u64::from(way.1);
            self.compare_any(Group::Shadow, sent, way);
        }
    }

    fn note(&mut self, group: Group, sent: &Sent, verdict: Verdict, answers: [Answer; 2]) {
        let Verdict { class, severity } = verdict;
        self.report.note(Case { group, class, ray: sent.ray, answers, severity, index: sent.index });
    }
}

/// Takes a hit of something that the scene does not have out of `packet`: no point can be made of it.
fn forget_unknown(scene: &Scene, packet: &mut RayHitPacket, lane: usize) {
    let known = packet.hit(lane).is_none_or(|hit| super::facts::has(scene, hit.geom_id, hit.prim_id));
    if !known {
        packet.set_hit(lane, None);
    }
}

/// A ray that leaves `point` as the group has it; none where it is reflected totally.
fn bounced(group: Group, point: &SurfacePoint, random: &mut Random) -> Option<Ray> {
    let d = -point.to_eye.as_dvec3().try_normalize()?;
    let w = match group {
        Group::Mirrored => optics::reflect(d, point.ns),
        Group::Refracted => {
            let eta = if point.entering { 1.0 / INDEX } else { INDEX };
            let bent = optics::refract::<false>(d, point.ns, eta);
            bent.passes.then_some(bent.direction)?
        }
        _ => {
            let disc = concentric_disc(random.unit(), random.unit());
            let (x, y) = point.ng.any_orthonormal_pair();
            let up = (1.0 - disc.length_squared()).max(0.0).sqrt();
            x * disc.x + y * disc.y + point.ng * up
        }
    };
    let w: DVec3 = w.try_normalize()?;
    Some(Ray::new(point.origin_towards(w), w.as_vec3()))
}
