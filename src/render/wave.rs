//! Waves of rays: a segment of camera rays, their shadow rays, and whatever they send on,
//! without recursion.

use super::certificate::Radiance;
use super::job::{Job, RayCounts};
use super::shade::{self, Branch};
use super::surface::SurfacePoint;
use crate::backend::Backend;
use crate::geom::{Coherence, LANES, PacketBatch, Ray, RayHitPacket, RayPacket};
use crate::scene::{Needs, Scene};
use glam::{DVec3, Vec3};

/// Most secondary rays worked on at once; the rest waits, newest first, so that memory is
/// bounded by depth and not by the number of branches.
const MOST_AT_ONCE: usize = 1 << 14;

/// End of a shadow ray that was sent at a light: just short of it.
pub const BEFORE_THE_LIGHT: f32 = 1.0 - 4.0 * 0.5 * f32::EPSILON;

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

/// A secondary ray that waits for its turn.
#[derive(Clone, Copy, Debug)]
struct Waiting {
    path: Path,
    ray: Ray,
}

/// What the rays of a segment gather, one entry per sample.
#[derive(Debug, Default)]
pub struct Gathered {
    /// Linear RGB.
    pub color: Vec<DVec3>,
    /// Bound on what was left out by the weight cut and `k_max`, linear.
    pub cut: Vec<f64>,
    /// Rays sent for it, of all kinds; kept only if somebody asked.
    pub cost: Option<Vec<u32>>,
}

/// What was sent and what was left out.
#[derive(Clone, Copy, Debug, Default)]
pub struct Tally {
    /// Rays sent.
    pub rays: RayCounts,
    /// Shadow rays that a surface facing away from its light made needless.
    pub facing_away: u64,
    /// Branches below the weight cut.
    pub below_cut: u64,
}

/// The integrator of one thread: its scene, and buffers that are refilled and never freed.
///
/// `SECONDARY` is whether anything mirrors or refracts; without, that stage is not compiled in.
pub struct Waves<'a, B, const SECONDARY: bool> {
    scene: &'a Scene,
    backend: &'a B,
    job: &'a Job,
    needs: Needs,
    radiance: &'a Radiance,
    points: Vec<(Path, SurfacePoint)>,
    shadows: PacketBatch<RayPacket>,
    shadowed: Vec<u32>,
    waiting: Vec<Waiting>,
    /// What the current segment gathers.
    pub gathered: Gathered,
    /// What was sent since the start.
    pub tally: Tally,
}

impl<'a, B: Backend, const SECONDARY: bool> Waves<'a, B, SECONDARY> {
    /// An integrator with empty buffers.
    pub fn new(scene: &'a Scene, backend: &'a B, job: &'a Job, needs: Needs, radiance: &'a Radiance) -> Self {
        let cost = job.aovs.contains(&crate::film::Aov::Cost).then(Vec::new);
        Self {
            scene,
            backend,
            job,
            needs,
            radiance,
            points: Vec::new(),
            shadows: PacketBatch::default(),
            shadowed: Vec::new(),
            waiting: Vec::new(),
            gathered: Gathered { cost, ..Gathered::default() },
            tally: Tally::default(),
        }
    }

    /// Traces camera rays, one per sample, to the end of every branch. `batch` holds their
    /// answers afterwards; what they gathered is in `gathered`.
    pub fn trace(&mut self, batch: &mut PacketBatch<RayHitPacket>, coherence: Coherence) {
        let samples = batch.len();
        self.gathered.color.clear();
        self.gathered.color.resize(samples, DVec3::ZERO);
        self.gathered.cut.clear();
        self.gathered.cut.resize(samples, 0.0);
        if let Some(cost) = &mut self.gathered.cost {
            cost.clear();
            cost.resize(samples, 1);
        }
        self.tally.rays.camera += samples as u64;
        self.backend.intersect_many(batch, coherence);
        self.collect(batch, |i| Path { slot: i as u32, depth: 0, weight: Vec3::ONE });
        self.shade();
        if SECONDARY {
            self.secondary_waves();
        }
    }

    fn secondary_waves(&mut self) {
        let mut batch = PacketBatch::<RayHitPacket>::default();
        let mut paths = Vec::new();
        while !self.waiting.is_empty() {
            let newest = self.waiting.len().saturating_sub(MOST_AT_ONCE);
            batch.clear();
            paths.clear();
            for w in self.waiting.drain(newest..) {
                batch.push(&w.ray);
                paths.push(w.path);
            }
            self.backend.intersect_many(&mut batch, Coherence::Incoherent);
            self.collect(&batch, |i| paths[i]);
            self.shade();
        }
    }

    /// Misses take the background, hits become surface points.
    fn collect(&mut self, batch: &PacketBatch<RayHitPacket>, path: impl Fn(usize) -> Path) {
        self.points.clear();
        for (k, packet) in batch.packets().iter().enumerate() {
            let live = (batch.len() - k * LANES).min(LANES);
            for lane in 0..live {
                let path = path(k * LANES + lane);
                let Some(hit) = packet.hit(lane) else {
                    self.gathered.color[path.slot as usize] += (path.weight * self.scene.background).as_dvec3();
                    continue;
                };
                let ray = packet.ray.get(lane);
                self.points.push((path, SurfacePoint::new(self.scene, ray.o, ray.d, &hit)));
            }
        }
    }

    fn shade(&mut self) {
        for (path, point) in &self.points {
            let m = &self.scene.materials[point.material as usize];
            let own = m.emission + m.ambient * self.scene.ambient;
            self.gathered.color[path.slot as usize] += (path.weight * own).as_dvec3();
        }
        if self.needs.shadow_rays {
            for light in 0..self.scene.lights.len() {
                self.light(light);
            }
        }
        if SECONDARY {
            self.branch();
        }
    }

    /// Adds one light to all points: its shadow rays go out as one batch.
    fn light(&mut self, index: usize) {
        let light = self.scene.lights[index];
        if light.color == Vec3::ZERO {
            return;
        }
        self.shadows.clear();
        self.shadowed.clear();
        for (i, (_, point)) in self.points.iter().enumerate() {
            if !self.scene.materials[point.material as usize].is_lit() {
                continue;
            }
            let l = light.position - point.p;
            // Dark for the facet is dark, whatever an interpolated normal says.
            if point.ng.dot(l) <= 0.0 || point.ns.dot(l) <= 0.0 {
                self.tally.facing_away += 1;
                continue;
            }
            let d = (light.position - point.front.as_dvec3()).as_vec3();
            self.shadows.push(&Ray::segment(point.front, d, BEFORE_THE_LIGHT));
            self.shadowed.push(i as u32);
        }
        self.tally.rays.shadow += self.shadows.len() as u64;
        if let Some(cost) = &mut self.gathered.cost {
            self.shadowed.iter().for_each(|&i| cost[self.points[i as usize].0.slot as usize] += 1);
        }
        self.backend.occluded_many(&mut self.shadows, Coherence::Coherent);
        for (packet, indices) in self.shadows.packets().iter().zip(self.shadowed.chunks(LANES)) {
            for (lane, &i) in indices.iter().enumerate() {
                if packet.is_occluded(lane) {
                    continue;
                }
                let (path, point) = &self.points[i as usize];
                let m = &self.scene.materials[point.material as usize];
                let l = Vec3::new(packet.d_x[lane], packet.d_y[lane], packet.d_z[lane]).normalize();
                let add = path.weight * light.color * shade::lit(m, point, l);
                self.gathered.color[path.slot as usize] += add.as_dvec3();
            }
        }
    }

    /// Sends on the mirrored and refracted branches of all points.
    fn branch(&mut self) {
        let points = std::mem::take(&mut self.points);
        for (path, point) in &points {
            let m = &self.scene.materials[point.material as usize];
            if !(m.reflects() || m.refracts()) {
                continue;
            }
            let d = -point.to_eye.as_dvec3().normalize();
            let (reflected, refracted) = shade::branches(m, point, d);
            if let Some(b) = reflected.and_then(|b| self.worth_sending(path, &b)) {
                self.tally.rays.reflected += 1;
                self.send(b, path, point);
            }
            if let Some(b) = refracted.and_then(|b| self.worth_sending(path, &b)) {
                self.tally.rays.refracted += 1;
                self.send(b, path, point);
            }
        }
        self.points = points;
    }

    /// The branch with its weight in the sample, or `None`, accounted for, if it is cut.
    fn worth_sending(&mut self, path: &Path, branch: &Branch) -> Option<Branch> {
        let weight = path.weight * branch.weight;
        let most = weight.max_element();
        let too_deep = path.depth >= self.job.k_max;
        if !too_deep && most >= self.job.min_weight && most > 0.0 {
            return Some(Branch { weight, ..*branch });
        }
        self.tally.below_cut += u64::from(!too_deep);
        let brings =
            if too_deep { self.radiance.beyond() } else { self.radiance.within(self.job.k_max - path.depth - 1) };
        self.gathered.cut[path.slot as usize] += f64::from(most) * f64::from(brings);
        None
    }

    fn send(&mut self, branch: Branch, path: &Path, point: &SurfacePoint) {
        if let Some(cost) = &mut self.gathered.cost {
            cost[path.slot as usize] += 1;
        }
        let ray = Ray::new(point.origin_towards(branch.d), branch.d.as_vec3());
        let path = Path { slot: path.slot, depth: path.depth + 1, weight: branch.weight };
        self.waiting.push(Waiting { path, ray });
    }
}
