//! Waves of rays: a segment of camera rays, their shadow rays, and whatever they send on,
//! without recursion.

use super::aim::{self, Asked, Rules, Shine};
use super::block::{Block, F32, Hits, Path, lanes};
use super::enclosures::Enclosures;
use super::facets::Facets;
use super::gathered::{Gathered, Tally};
use super::job::Job;
use super::known::Known;
use super::lights;
use super::media::{Media, Medium};
use super::paint::Palette;
use super::paths::{OfSamples, Paths};
use super::shade::{Branch, Onwards};
use super::shadows::{How, Shadows, take};
use super::shapes::ShapeHits;
use super::surface::SurfacePoint;
use super::tile::Segment;
use super::{Common, Render};
use crate::backend::Backend;
use crate::film::Aov;
use crate::geom::{Coherence, INVALID_ID, LANES, PacketBatch, Ray, RayHitPacket, RayPacket};
use crate::scene::{Material, Object, Reflect, Scene, Skip};
use glam::DVec3;

/// Most secondary rays worked on at once; the rest waits, newest first, so that memory is
/// bounded by depth and not by the number of branches.
const MOST_AT_ONCE: usize = 1 << 14;

/// Once so many wait, only a packet's worth is worked on at once: each bounce then leaves at
/// most that many more waiting, however deep the recursion may go.
const MANY_WAITING: usize = 1 << 19;

/// A secondary ray that waits for its turn.
#[derive(Clone, Copy, Debug)]
struct Waiting {
    path: Path,
    ray: Ray,
    /// Object and primitive that the ray is inside of and can only hit, if that is known.
    inside: Option<[u32; 2]>,
    /// Whether it goes to the inner side of a surface.
    inwards: bool,
}

/// The integrator of one thread: its scene, and buffers that are refilled and never freed.
///
/// `SECONDARY` is whether anything mirrors or refracts; without, that stage is not compiled in.
pub struct Waves<'a, B, const SECONDARY: bool> {
    scene: &'a Scene,
    backend: &'a B,
    job: &'a Job,
    known: &'a Known,
    /// Where highlights are seen from at every depth; `None`: from where each ray came.
    seen_from: Option<DVec3>,
    clip: Option<(f64, f64)>,
    palette: Palette,
    /// Of each material: whether it sends rays on.
    branching: Vec<bool>,
    /// Of each object: whether it is a set of shapes.
    is_shapes: Vec<bool>,
    /// Whether there are both shapes and meshes.
    is_mixed: bool,
    absorbs: bool,
    /// Absent where there are no meshes, and while in use.
    facets: Option<Box<Facets<'a>>>,
    /// Likewise for shapes.
    shape_hits: Option<Box<ShapeHits>>,
    blocks: Vec<Block>,
    /// Blocks in use.
    used: usize,
    shadows: Shadows,
    /// Whether the rays at hand have bounced.
    bounced: bool,
    /// What the light at hand would add to each block.
    shines: Vec<Shine>,
    /// The lanes of each block that ask about a light with a size, and how many of their rays got through.
    wanted: Vec<u32>,
    visible: Vec<F32>,
    media: Media,
    onwards: Onwards,
    waiting: Vec<Waiting>,
    /// What the current segment gathers.
    pub gathered: Gathered,
    /// What was sent since the start.
    pub tally: Tally,
}

impl<'a, B: Backend, const SECONDARY: bool> Waves<'a, B, SECONDARY> {
    /// An integrator with empty buffers.
    pub fn new(render: &'a Render<'a, B, SECONDARY>, common: &'a Common) -> Self {
        let Render { scene, camera, backend, job, needs, .. } = *render;
        let skips = job.skips;
        let always = !skips.has(Skip::Aovs);
        let cost = always || job.aovs.contains(&Aov::Cost);
        let seen = always || job.aovs.iter().any(|&a| !matches!(a, Aov::Cost | Aov::Samples));
        let is_shapes: Vec<bool> = scene.objects.iter().map(|o| matches!(o, Object::Shapes(_))).collect();
        let both = !skips.has(Skip::Geometry);
        let (meshes, shapes) = (both || is_shapes.contains(&false), both || is_shapes.contains(&true));
        let facets = || {
            let facets = Facets::new(scene);
            Box::new(if skips.has(Skip::Normals) { facets } else { facets.always_smooth() })
        };
        let ask_fresnel = !skips.has(Skip::Fresnel);
        let branches = |m: &Material| needs.may_branch(m) || (ask_fresnel && m.reflect == Reflect::Fresnel);
        Self {
            scene,
            backend,
            job,
            known: &common.known,
            seen_from: scene.course_rules.then_some(camera.eye),
            clip: camera.clip,
            palette: Palette::of(scene),
            branching: scene.materials.iter().map(branches).collect(),
            absorbs: needs.absorption,
            facets: meshes.then(facets),
            shape_hits: shapes.then(Box::default),
            is_mixed: meshes && shapes,
            is_shapes,
            blocks: Vec::new(),
            used: 0,
            bounced: false,
            shadows: Shadows::new(How { nearest: !skips.has(Skip::AnyHit), all: !skips.has(Skip::ShadowRays) }),
            shines: Vec::new(),
            wanted: Vec::new(),
            visible: Vec::new(),
            media: Media::new(),
            onwards: Onwards::default(),
            waiting: Vec::new(),
            gathered: Gathered { cost: cost.then(Vec::new), seen: seen.then(Vec::new), ..Gathered::default() },
            tally: Tally::default(),
        }
    }

    /// Traces the camera rays of `segment`, one per sample, to the end of every branch. `batch`
    /// holds their answers afterwards; what they gathered is in `gathered`.
    pub fn trace(&mut self, batch: &mut PacketBatch<RayHitPacket>, segment: &Segment<'_>, coherence: Coherence) {
        let samples = batch.len();
        self.gathered.color.clear();
        self.gathered.color.resize(samples, [0.0; 3]);
        if SECONDARY {
            self.gathered.cut.clear();
            self.gathered.cut.resize(samples, [0.0; 2]);
            self.media.forget();
        }
        if let Some(cost) = &mut self.gathered.cost {
            cost.clear();
            cost.resize(samples, 1);
        }
        self.tally.rays.camera += samples as u64;
        match &self.known.reach {
            Some(reach) => self.tally.packets_outside += reach.intersect_many(self.backend, batch, coherence),
            None => self.backend.intersect_many(batch, coherence),
        }
        if let Some(range) = self.clip {
            batch.packets_mut().for_each(|(packet, live)| clip(packet, live, range));
        }
        self.collect(batch, &OfSamples);
        if let Some(seen) = &mut self.gathered.seen {
            seen.clear();
            self.tally.work.hits_kept += self.blocks[..self.used].iter().map(|b| b.len as u64).sum::<u64>();
            for block in &self.blocks[..self.used] {
                seen.extend((0..block.len).map(|lane| (block.slot[lane], SurfacePoint::of_lane(block, lane))));
            }
        }
        self.shade(segment);
        if SECONDARY {
            self.bounced = true;
            self.secondary_waves(segment);
            self.bounced = false;
        }
    }

    fn secondary_waves(&mut self, segment: &Segment<'_>) {
        let mut batch = PacketBatch::<RayHitPacket>::default();
        let (mut paths, mut answered) = (Vec::new(), Vec::new());
        while !self.waiting.is_empty() {
            let at_once = if self.waiting.len() < MANY_WAITING { MOST_AT_ONCE } else { LANES };
            let newest = self.waiting.len().saturating_sub(at_once);
            batch.clear();
            paths.clear();
            answered.clear();
            // Those that go inwards side by side: a block inside of closed shapes needs no light.
            for inwards in [true, false] {
                for w in self.waiting[newest..].iter().filter(|w| w.inwards == inwards) {
                    let exit =
                        w.inside.and_then(|id| Some((batch.len(), id, Enclosures::exit(self.scene, id, &w.ray)?)));
                    // A ray that ends before it starts asks the backend nothing.
                    batch.push(&exit.map_or(w.ray, |_| Ray { t_far: f32::NEG_INFINITY, ..w.ray }));
                    paths.push(w.path);
                    answered.extend(exit);
                }
            }
            self.waiting.truncate(newest);
            self.backend.intersect_many(&mut batch, Coherence::Incoherent);
            self.tally.inside += answered.len() as u64;
            for &(ray, id, t) in &answered {
                batch.answer(ray, id, t);
            }
            self.collect(&batch, &paths);
            self.shade(segment);
        }
    }

    /// Misses take the background, hits fill blocks.
    fn collect(&mut self, batch: &PacketBatch<RayHitPacket>, paths: &impl Paths) {
        self.used = 0;
        self.tally.work.hits_sorted += if self.is_mixed { batch.len() as u64 } else { 0 };
        self.misses(batch, paths);
        if let Some(mut hits) = self.facets.take() {
            let before = hits.smooth_blocks;
            self.fill_blocks(&mut *hits, batch, false, paths);
            self.tally.work.smooth_blocks += hits.smooth_blocks - before;
            self.facets = Some(hits);
        }
        if let Some(mut hits) = self.shape_hits.take() {
            self.fill_blocks(&mut *hits, batch, true, paths);
            self.shape_hits = Some(hits);
        }
    }

    fn misses(&mut self, batch: &PacketBatch<RayHitPacket>, paths: &impl Paths) {
        for (k, packet) in batch.packets().iter().enumerate() {
            if all_hit(packet) {
                continue;
            }
            let live = (batch.len() - k * LANES).min(LANES);
            for i in (0..live).filter(|&i| packet.hit.geom_id[i] == INVALID_ID) {
                let path = paths.one(k * LANES + i);
                let weight = if self.absorbs {
                    self.media.absorbed(&self.scene.materials, &path, f64::INFINITY)
                } else {
                    path.weight
                };
                self.gathered.add_one(path.slot, weight * self.scene.background);
            }
        }
    }

    /// Fills blocks with the hits of shapes, or those of meshes.
    fn fill_blocks<H: Hits>(
        &mut self,
        hits: &mut H,
        batch: &PacketBatch<RayHitPacket>,
        shapes: bool,
        paths: &impl Paths,
    ) {
        // Nothing to sort out, nothing to work out: whole packets can go over.
        let as_they_are = !self.is_mixed && !self.absorbs;
        let mut lane = 0;
        for (k, packet) in batch.packets().iter().enumerate() {
            let live = (batch.len() - k * LANES).min(LANES);
            if lane == 0 && live == LANES && as_they_are && all_hit(packet) {
                hits.set_all(packet);
                let block = self.next_block();
                paths.sixteen(k * LANES, block);
                for i in 0..LANES {
                    block.id[i] = [packet.hit.geom_id[i], packet.hit.prim_id[i]];
                }
                self.finish(hits, LANES);
                continue;
            }
            for i in 0..live {
                let geom = packet.hit.geom_id[i];
                if geom == INVALID_ID || (self.is_mixed && self.is_shapes[geom as usize] != shapes) {
                    continue;
                }
                let mut path = paths.one(k * LANES + i);
                if self.absorbs {
                    path.weight = self.media.absorbed(&self.scene.materials, &path, distance(packet, i));
                }
                hits.set(lane, packet, i);
                let block = self.next_block();
                block.set(lane, &path);
                block.id[lane] = [geom, packet.hit.prim_id[i]];
                lane += 1;
                if lane == LANES {
                    self.finish(hits, lane);
                    lane = 0;
                }
            }
        }
        if lane > 0 {
            self.finish(hits, lane);
        }
    }

    /// The block that is being filled.
    #[inline]
    fn next_block(&mut self) -> &mut Block {
        if self.used == self.blocks.len() {
            self.blocks.push(Block::EMPTY);
        }
        &mut self.blocks[self.used]
    }

    /// Makes `len` collected hits into a block in use.
    fn finish(&mut self, hits: &mut impl Hits, len: usize) {
        hits.finish(len, self.scene, &self.palette, &mut self.blocks[self.used]);
        self.used += 1;
    }

    fn shade(&mut self, segment: &Segment<'_>) {
        for index in 0..self.known.lights.len() {
            if self.known.lights[index].radius > 0.0 {
                self.soft_light(index, segment);
            } else {
                self.light(index);
            }
        }
        if SECONDARY && !self.known.radiance.is_proved() {
            self.note_brightest();
        }
        for block in &self.blocks[..self.used] {
            self.gathered.add(block);
        }
        if SECONDARY {
            self.branch();
        }
    }

    fn note_brightest(&mut self) {
        for block in &self.blocks[..self.used] {
            let brightest = block.color.iter().flat_map(|c| &c[..block.len]).copied().fold(0.0, f32::max);
            if brightest.is_finite() {
                self.tally.brightest = self.tally.brightest.max(brightest);
            }
        }
    }

    /// Adds one light to all blocks: its shadow rays go out as one batch.
    fn light(&mut self, index: usize) {
        let (light, rules) = (self.known.lights[index], self.rules(index));
        self.shadows.start(self.used, self.bounced);
        self.shines.resize(self.used.max(self.shines.len()), Shine::NONE);
        for i in 0..self.used {
            let (block, shine) = (&self.blocks[i], &mut self.shines[i]);
            let (asked, sent) = self.shadows.push(i, block.len, |packet| {
                let asked = aim::at_center(block, &light, self.seen_from, rules, packet, shine);
                (asked, asked.sent)
            });
            self.note(i, asked, 1);
            self.sent(i, sent);
        }
        self.trace_shadows();
        let lit = self.shines.iter().zip(self.shadows.visible());
        for (block, (shine, visible)) in self.blocks.iter_mut().zip(lit) {
            take(block, shine, visible, 1.0);
        }
    }

    /// Adds one light that has a size: a batch for each of its samples, and the share of them
    /// that got through.
    fn soft_light(&mut self, index: usize, segment: &Segment<'_>) {
        let (light, rules) = (self.known.lights[index], self.rules(index));
        let (rounds, all) = (self.job.light_samples.max(1), !self.job.skips.has(Skip::ShadowRays));
        let mut to_center = RayPacket::EMPTY;
        self.wanted.clear();
        self.shines.resize(self.used.max(self.shines.len()), Shine::NONE);
        for i in 0..self.used {
            let (block, shine) = (&self.blocks[i], &mut self.shines[i]);
            let asked = aim::at_center(block, &light, self.seen_from, rules, &mut to_center, shine);
            self.note(i, asked, u64::from(rounds));
            self.wanted.push(asked.sent);
        }
        self.visible.clear();
        self.visible.resize(self.used, [0.0; LANES]);
        for round in 0..rounds {
            self.shadows.start(self.used, self.bounced);
            for i in 0..self.used {
                let (wanted, block) = (self.wanted[i], &self.blocks[i]);
                if wanted == 0 && !all {
                    continue;
                }
                let points = lights::points_on(block, &light, |lane| {
                    let (samples, sample) = segment.samples_of(block.slot[lane]);
                    let number = sample.wrapping_mul(rounds).wrapping_add(round);
                    samples.on_light(number, index as u32, block.branch[lane])
                });
                let ((), sent) =
                    self.shadows.push(i, block.len, |packet| ((), aim::at_points(block, &points, wanted, packet)));
                self.sent(i, sent);
            }
            self.trace_shadows();
            for (sum, through) in self.visible.iter_mut().zip(self.shadows.visible()) {
                for lane in 0..LANES {
                    sum[lane] += through[lane];
                }
            }
        }
        let lit = self.shines.iter().zip(&self.visible);
        for (block, (shine, visible)) in self.blocks.iter_mut().zip(lit) {
            take(block, shine, visible, 1.0 / rounds as f32);
        }
    }

    fn trace_shadows(&mut self) {
        self.shadows.trace(self.backend);
        self.tally.work.nearest_occluders += std::mem::take(&mut self.shadows.nearest);
    }

    fn rules(&self, light: usize) -> Rules {
        let cut = SECONDARY && self.job.skips.has(Skip::FaintLights);
        Rules {
            faint: if cut { Rules::FAINT_SHARE * self.job.min_weight } else { 0.0 },
            outside: self.known.enclosures.is_outside(light),
            power: !self.job.skips.has(Skip::Powf),
        }
    }

    /// Counts the shadow rays that block `index` did not need, in each of `rounds`, and bounds what was left out.
    fn note(&mut self, index: usize, asked: Asked, rounds: u64) {
        if !asked.dark {
            self.tally.dull += u64::from(!asked.power);
            self.tally.work.highlights += u64::from(asked.power);
        }
        if self.job.skips.has(Skip::ShadowRays) {
            let count = |lanes: u32| rounds * u64::from(lanes.count_ones());
            self.tally.facing_away += count(asked.facing_away);
            self.tally.enclosed += count(asked.enclosed);
            self.tally.faint += count(asked.faint);
        }
        let (block, shine) = (&self.blocks[index], &self.shines[index]);
        for lane in lanes(asked.faint) {
            let most = Block::vec3(&block.weight, lane) * Block::vec3(&shine.add, lane);
            self.gathered.cut[block.slot[lane] as usize][0] += f64::from(most.max_element());
        }
    }

    /// Counts shadow rays of block `index`.
    fn sent(&mut self, index: usize, sent: u32) {
        self.tally.rays.shadow += u64::from(sent.count_ones());
        if let Some(cost) = &mut self.gathered.cost {
            lanes(sent).for_each(|lane| cost[self.blocks[index].slot[lane] as usize] += 1);
        }
    }

    /// Sends on the mirrored and refracted branches of all blocks.
    fn branch(&mut self) {
        let blocks = std::mem::take(&mut self.blocks);
        for block in &blocks[..self.used] {
            self.tally.work.hits_asked_on += block.len as u64;
            let mut sending = 0;
            for lane in (0..block.len).filter(|&lane| self.branching[block.material[lane] as usize]) {
                if block.depth[lane] < self.job.k_max {
                    sending |= 1 << lane;
                    continue;
                }
                let material = &self.scene.materials[block.material[lane] as usize];
                let most = Block::vec3(&block.weight, lane).max_element() * material.passed_on();
                self.gathered.leave_out(block.slot[lane], most, self.known.radiance.beyond());
            }
            if sending != 0 {
                self.branch_block(block, sending);
            }
        }
        self.blocks = blocks;
    }

    fn branch_block(&mut self, block: &Block, branching: u32) {
        self.onwards.find(self.scene, &self.known.contacts, &mut self.media, block, branching);
        for lane in lanes(branching) {
            let path = block.path(lane);
            let sent = self.onwards.lane(self.scene, block, lane);
            if let Some(branch) = sent.reflected.and_then(|b| self.worth_sending(&path, b)) {
                self.tally.rays.reflected += 1;
                self.send(branch, &path, block.id[lane], 0, path.medium);
            }
            if let Some(branch) = sent.refracted.and_then(|b| self.worth_sending(&path, b)) {
                self.tally.rays.refracted += 1;
                self.send(branch, &path, block.id[lane], 1, sent.behind);
            }
        }
    }

    /// The branch with its weight in the sample, or `None`, accounted for, if it is cut.
    fn worth_sending(&mut self, path: &Path, branch: Branch) -> Option<Branch> {
        let weight = path.weight * branch.weight;
        let most = weight.max_element();
        if most >= self.job.min_weight && most > 0.0 {
            return Some(Branch { weight, ..branch });
        }
        self.tally.below_cut += 1;
        self.gathered.leave_out(path.slot, most, self.known.radiance.within(self.job.k_max - path.depth - 1));
        None
    }

    fn send(&mut self, branch: Branch, path: &Path, from: [u32; 2], kind: u32, medium: Medium) {
        if let Some(cost) = &mut self.gathered.cost {
            cost[path.slot as usize] += 1;
        }
        let ray = Ray::new(branch.o, branch.d);
        let path = Path {
            slot: path.slot,
            depth: path.depth + 1,
            weight: branch.weight,
            branch: path.branch.bounced(kind),
            medium,
        };
        let inside = (branch.inwards && self.known.enclosures.is_solitary(from)).then_some(from);
        self.waiting.push(Waiting { path, ray, inside, inwards: branch.inwards });
    }
}

/// Whether all lanes of a packet hold a hit; those without a ray may hold an old one.
#[inline]
fn all_hit(packet: &RayHitPacket) -> bool {
    packet.hit.geom_id.iter().fold(true, |all, &geom| all & (geom != INVALID_ID))
}

/// Length of ray `lane` up to its hit.
fn distance(packet: &RayHitPacket, lane: usize) -> f64 {
    let ray = packet.ray.get(lane);
    ray.d.as_dvec3().length() * f64::from(ray.t_far)
}

/// Makes hits outside of the range misses.
fn clip(packet: &mut RayHitPacket, live: usize, (near, far): (f64, f64)) {
    for lane in 0..live {
        if packet.hit.geom_id[lane] != INVALID_ID && !(near..=far).contains(&distance(packet, lane)) {
            packet.hit.geom_id[lane] = INVALID_ID;
        }
    }
}
