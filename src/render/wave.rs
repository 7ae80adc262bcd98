//! Waves of rays: a segment of camera rays, their shadow rays, and whatever they send on,
//! without recursion.

use super::block::{Block, Facets, Paint, Path};
use super::certificate::Radiance;
use super::job::{Job, RayCounts};
use super::lights;
use super::shade::{self, Branch};
use super::surface::SurfacePoint;
use crate::backend::Backend;
use crate::film::Aov;
use crate::geom::{Coherence, INVALID_ID, LANES, PacketBatch, Ray, RayHitPacket, RayPacket};
use crate::scene::{Light, Needs, Scene};
use glam::{DVec3, Vec3};

/// Most secondary rays worked on at once; the rest waits, newest first, so that memory is
/// bounded by depth and not by the number of branches.
const MOST_AT_ONCE: usize = 1 << 14;

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
    /// The hits of the camera rays with their samples, in order; kept only if somebody asked.
    pub seen: Option<Vec<(u32, SurfacePoint)>>,
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
    radiance: &'a Radiance,
    /// The lights that can change anything.
    lights: Vec<Light>,
    /// Of each material.
    paints: Vec<Paint>,
    /// Of each material: whether it sends rays on.
    branching: Vec<bool>,
    facets: Box<Facets>,
    blocks: Vec<Block>,
    /// Blocks in use.
    used: usize,
    shadows: PacketBatch<RayPacket>,
    /// The block of each shadow packet.
    shadowed: Vec<u32>,
    waiting: Vec<Waiting>,
    /// What the current segment gathers.
    pub gathered: Gathered,
    /// What was sent since the start.
    pub tally: Tally,
}

impl<'a, B: Backend, const SECONDARY: bool> Waves<'a, B, SECONDARY> {
    /// An integrator with empty buffers.
    pub fn new(scene: &'a Scene, backend: &'a B, job: &'a Job, needs: &Needs, radiance: &'a Radiance) -> Self {
        let cost = job.aovs.contains(&Aov::Cost).then(Vec::new);
        let seen = job.aovs.iter().any(|&a| a != Aov::Cost).then(Vec::new);
        let lights = scene.lights.iter().filter(|l| needs.shadow_rays && l.color != Vec3::ZERO);
        Self {
            scene,
            backend,
            job,
            radiance,
            lights: lights.copied().collect(),
            paints: scene.materials.iter().map(|m| Paint::new(m, scene.ambient)).collect(),
            branching: scene.materials.iter().map(|m| m.reflects() || m.refracts()).collect(),
            facets: Box::new(Facets::EMPTY),
            blocks: Vec::new(),
            used: 0,
            shadows: PacketBatch::default(),
            shadowed: Vec::new(),
            waiting: Vec::new(),
            gathered: Gathered { cost, seen, ..Gathered::default() },
            tally: Tally::default(),
        }
    }

    /// Traces camera rays, one per sample, to the end of every branch. `batch` holds their
    /// answers afterwards; what they gathered is in `gathered`.
    pub fn trace(&mut self, batch: &mut PacketBatch<RayHitPacket>, coherence: Coherence) {
        let samples = batch.len();
        self.gathered.color.clear();
        self.gathered.color.resize(samples, DVec3::ZERO);
        if SECONDARY {
            self.gathered.cut.clear();
            self.gathered.cut.resize(samples, 0.0);
        }
        if let Some(cost) = &mut self.gathered.cost {
            cost.clear();
            cost.resize(samples, 1);
        }
        self.tally.rays.camera += samples as u64;
        self.backend.intersect_many(batch, coherence);
        self.collect(batch, |i| Path::of_sample(i as u32));
        if let Some(seen) = &mut self.gathered.seen {
            seen.clear();
            for block in &self.blocks[..self.used] {
                seen.extend((0..block.len).map(|lane| (block.slot[lane], SurfacePoint::of_lane(block, lane))));
            }
        }
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

    /// Misses take the background, hits fill blocks.
    fn collect(&mut self, batch: &PacketBatch<RayHitPacket>, path: impl Fn(usize) -> Path) {
        self.used = 0;
        let mut lane = 0;
        for (k, packet) in batch.packets().iter().enumerate() {
            let live = (batch.len() - k * LANES).min(LANES);
            for i in 0..live {
                let path = path(k * LANES + i);
                if packet.hit.geom_id[i] == INVALID_ID {
                    self.gathered.color[path.slot as usize] += (path.weight * self.scene.background).as_dvec3();
                    continue;
                }
                if self.used == self.blocks.len() {
                    self.blocks.push(Block::EMPTY);
                }
                self.facets.set(lane, packet, i);
                self.blocks[self.used].set(lane, &path);
                lane += 1;
                if lane == LANES {
                    self.finish_block(lane);
                    lane = 0;
                }
            }
        }
        if lane > 0 {
            self.finish_block(lane);
        }
    }

    fn finish_block(&mut self, len: usize) {
        self.blocks[self.used].finish(self.scene, &mut self.facets, len, &self.paints);
        self.used += 1;
    }

    fn shade(&mut self) {
        for index in 0..self.lights.len() {
            self.light(index);
        }
        for block in &self.blocks[..self.used] {
            for lane in 0..block.len {
                let add = Block::vec3(&block.weight, lane) * Block::vec3(&block.color, lane);
                self.gathered.color[block.slot[lane] as usize] += add.as_dvec3();
            }
        }
        if SECONDARY {
            self.branch();
        }
    }

    /// Adds one light to all blocks: its shadow rays go out as one batch.
    fn light(&mut self, index: usize) {
        let light = self.lights[index];
        self.shadows.clear();
        self.shadowed.clear();
        for (i, block) in self.blocks[..self.used].iter().enumerate() {
            let packet = self.shadows.push_packet();
            let (sent, facing_away) = lights::aim(block, &light, packet);
            self.tally.facing_away += u64::from(facing_away);
            self.tally.rays.shadow += u64::from(sent);
            if sent == 0 {
                self.shadows.pop_packet();
                continue;
            }
            self.shadowed.push(i as u32);
            if let Some(cost) = &mut self.gathered.cost {
                let lanes = (0..block.len).filter(|&lane| packet.t_far[lane] > 0.0);
                lanes.for_each(|lane| cost[block.slot[lane] as usize] += 1);
            }
        }
        self.backend.occluded_many(&mut self.shadows, Coherence::Coherent);
        for (packet, &i) in self.shadows.packets().iter().zip(&self.shadowed) {
            lights::add(&mut self.blocks[i as usize], &light, packet);
        }
    }

    /// Sends on the mirrored and refracted branches of all blocks.
    fn branch(&mut self) {
        let blocks = std::mem::take(&mut self.blocks);
        for block in &blocks[..self.used] {
            for lane in 0..block.len {
                if !self.branching[block.material[lane] as usize] {
                    continue;
                }
                let weight = Block::vec3(&block.weight, lane);
                let path = Path { slot: block.slot[lane], depth: block.depth[lane], weight };
                let material = &self.scene.materials[block.material[lane] as usize];
                if path.depth >= self.job.k_max {
                    let most = weight.max_element() * material.passed_on();
                    self.gathered.cut[path.slot as usize] += f64::from(most) * f64::from(self.radiance.beyond());
                    continue;
                }
                let point = SurfacePoint::of_lane(block, lane);
                let d = -point.to_eye.as_dvec3().normalize();
                let (reflected, refracted) = shade::branches(material, &point, d);
                if let Some(b) = reflected.and_then(|b| self.worth_sending(&path, &b)) {
                    self.tally.rays.reflected += 1;
                    self.send(b, &path, &point);
                }
                if let Some(b) = refracted.and_then(|b| self.worth_sending(&path, &b)) {
                    self.tally.rays.refracted += 1;
                    self.send(b, &path, &point);
                }
            }
        }
        self.blocks = blocks;
    }

    /// The branch with its weight in the sample, or `None`, accounted for, if it is cut.
    fn worth_sending(&mut self, path: &Path, branch: &Branch) -> Option<Branch> {
        let weight = path.weight * branch.weight;
        let most = weight.max_element();
        if most >= self.job.min_weight && most > 0.0 {
            return Some(Branch { weight, ..*branch });
        }
        self.tally.below_cut += 1;
        let brings = self.radiance.within(self.job.k_max - path.depth - 1);
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
