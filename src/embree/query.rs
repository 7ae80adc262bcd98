//! Rays against a scene: one, a packet, or a batch of packets. No call allocates, locks or fails.

use super::Scene;
use super::packet::{Calls, Valid, Width};
use super::rescale::{Rescaled, all_plain, is_plain};
use crate::geom::{Coherence, Hit, INVALID_ID, LANES, PacketBatch, Ray, RayHitPacket, RayPacket};
use embree4_sys as sys;
use glam::Vec3;
use std::mem::MaybeUninit;
use std::ptr;

/// From how many shapes and instances on an incoherent packet goes singly. Among ten spheres a packet is 3 to 13
/// times as fast as its rays one by one, among 100,000 half as fast. Rays that have bounced twice break even at 100 to 200,
/// those that have bounced once at 2000.
const MANY: u64 = 256;

/// How the packets of a batch go to Embree.
#[derive(Clone, Copy)]
enum Route {
    Whole,
    Eights,
    Fours,
    Singles,
}

impl Scene {
    /// Nearest hit inside the ray's interval. A direction of zero length or a number that is not finite is a miss.
    #[inline]
    #[must_use]
    pub fn intersect(&self, ray: &Ray) -> Option<Hit> {
        if is_plain(ray.o, ray.d) {
            return self.intersect_plain(ray);
        }
        let rescaled = Rescaled::new(ray)?;
        let hit = self.intersect_plain(&rescaled.ray)?;
        Some(Hit { t: rescaled.t(hit.t), ..hit })
    }

    /// Whether anything is inside the ray's interval.
    #[inline]
    #[must_use]
    pub fn occluded(&self, ray: &Ray) -> bool {
        if is_plain(ray.o, ray.d) {
            return self.occluded_plain(ray);
        }
        Rescaled::new(ray).is_some_and(|rescaled| self.occluded_plain(&rescaled.ray))
    }

    /// Nearest hits of the first `live` lanes. Their `t_far` and hit lanes take the answers, and a miss has
    /// [`INVALID_ID`] in `geom_id`; the hit lanes need not be reset before.
    ///
    /// Only rays that are [`Coherence::Coherent`] gain from a packet, and only when `N` is no more than
    /// [`Device::packet_width`](super::Device::packet_width); [`intersect_batch`](Self::intersect_batch) sees to that.
    #[inline]
    pub fn intersect_packet<const N: usize>(&self, packet: &mut RayHitPacket<N>, live: usize, coherence: Coherence)
    where
        RayPacket<N>: Width<N>,
    {
        self.intersect_lanes(packet, live, &mut intersect_args(coherence));
    }

    /// Whether anything is in the way of each of the first `live` lanes: their `t_far` becomes minus infinity then.
    #[inline]
    pub fn occluded_packet<const N: usize>(&self, packet: &mut RayPacket<N>, live: usize, coherence: Coherence)
    where
        RayPacket<N>: Width<N>,
    {
        self.occluded_lanes(packet, live, &mut occluded_args(coherence));
    }

    /// [`intersect_packet`](Self::intersect_packet) for each packet, in the widest form that the processor has.
    pub fn intersect_batch(&self, batch: &mut PacketBatch<RayHitPacket>, coherence: Coherence) {
        let mut args = intersect_args(coherence);
        let route = self.route(coherence);
        for (packet, live) in batch.packets_mut() {
            match route {
                Route::Whole => self.intersect_lanes(packet, live, &mut args),
                Route::Eights => self.intersect_split::<8>(packet, live, &mut args),
                Route::Fours => self.intersect_split::<4>(packet, live, &mut args),
                Route::Singles => self.intersect_singly(packet, live),
            }
        }
    }

    /// [`occluded_packet`](Self::occluded_packet) for each packet, in the widest form that the processor has.
    pub fn occluded_batch(&self, batch: &mut PacketBatch<RayPacket>, coherence: Coherence) {
        let mut args = occluded_args(coherence);
        let route = self.route(coherence);
        for (packet, live) in batch.packets_mut() {
            match route {
                Route::Whole => self.occluded_lanes(packet, live, &mut args),
                Route::Eights => self.occluded_split::<8>(packet, live, &mut args),
                Route::Fours => self.occluded_split::<4>(packet, live, &mut args),
                Route::Singles => self.occluded_singly(packet, live),
            }
        }
    }

    /// Embree splits incoherent packets over triangles by itself, but never those over shapes and instances.
    fn route(&self, coherence: Coherence) -> Route {
        match self.width {
            _ if self.contents.unsplit > MANY && coherence == Coherence::Incoherent => Route::Singles,
            16 => Route::Whole,
            8 => Route::Eights,
            4 => Route::Fours,
            _ => Route::Singles,
        }
    }

    #[inline]
    pub(super) fn intersect_plain(&self, ray: &Ray) -> Option<Hit> {
        let mut query = c_query(ray);
        // SAFETY: the scene is committed; `query` is ours alone, initialised, and aligned by its type; no arguments
        // mean the defaults, among them incoherent.
        unsafe { sys::rtcIntersect1(self.raw(), &mut query, ptr::null_mut()) };
        self.answer(&query)
    }

    /// What a query that Embree has answered says.
    #[inline]
    pub(super) fn answer(&self, query: &sys::RTCRayHit) -> Option<Hit> {
        let found = &query.hit;
        if found.geomID == INVALID_ID {
            return None;
        }
        let hit = Hit {
            t: query.ray.tfar,
            u: found.u,
            v: found.v,
            ng: Vec3::new(found.Ng_x, found.Ng_y, found.Ng_z),
            prim_id: found.primID,
            geom_id: found.geomID,
        };
        Some(if self.placed.is_empty() { hit } else { self.placed.resolve(hit, found.instID[0]) })
    }

    #[inline]
    fn occluded_plain(&self, ray: &Ray) -> bool {
        let mut query = c_ray(ray);
        // SAFETY: as for `intersect_plain`.
        unsafe { sys::rtcOccluded1(self.raw(), &mut query, ptr::null_mut()) };
        // Minus infinity where something is in the way; a ray with an empty interval may have that from the start.
        query.tfar < ray.t_far
    }

    #[inline]
    fn intersect_lanes<const N: usize>(
        &self,
        packet: &mut RayHitPacket<N>,
        live: usize,
        args: &mut sys::RTCIntersectArguments,
    ) where
        RayPacket<N>: Width<N>,
    {
        if !all_plain(&packet.ray) {
            return self.intersect_singly(packet, live);
        }
        packet.hit.geom_id = [INVALID_ID; N];
        with_valid(live, |valid| {
            // SAFETY: the scene is committed, and `args` were filled by Embree.
            unsafe { RayPacket::<N>::intersect(valid, self.raw(), packet, args) };
        });
        if !self.placed.is_empty() {
            self.placed.resolve_lanes(&mut packet.hit);
        }
    }

    #[inline]
    fn occluded_lanes<const N: usize>(
        &self,
        packet: &mut RayPacket<N>,
        live: usize,
        args: &mut sys::RTCOccludedArguments,
    ) where
        RayPacket<N>: Width<N>,
    {
        if !all_plain(packet) {
            return self.occluded_singly(packet, live);
        }
        with_valid(live, |valid| {
            // SAFETY: the scene is committed, and `args` were filled by Embree.
            unsafe { RayPacket::<N>::occluded(valid, self.raw(), packet, args) };
        });
    }

    fn intersect_split<const W: usize>(
        &self,
        packet: &mut RayHitPacket,
        live: usize,
        args: &mut sys::RTCIntersectArguments,
    ) where
        RayPacket<W>: Width<W>,
    {
        let mut part = RayHitPacket::<W>::EMPTY;
        for start in (0..live.min(LANES)).step_by(W) {
            let live = (live - start).min(W);
            part.ray = part_of(&packet.ray, start);
            self.intersect_lanes(&mut part, live, args);
            for lane in 0..live {
                packet.set_hit(start + lane, part.hit(lane).as_ref());
            }
        }
    }

    fn occluded_split<const W: usize>(&self, packet: &mut RayPacket, live: usize, args: &mut sys::RTCOccludedArguments)
    where
        RayPacket<W>: Width<W>,
    {
        for start in (0..live.min(LANES)).step_by(W) {
            let live = (live - start).min(W);
            let mut part = part_of::<W>(packet, start);
            self.occluded_lanes(&mut part, live, args);
            packet.t_far[start..start + live].copy_from_slice(&part.t_far[..live]);
        }
    }

    #[inline(never)]
    fn intersect_singly<const N: usize>(&self, packet: &mut RayHitPacket<N>, live: usize) {
        for lane in 0..live.min(N) {
            let ray = packet.ray.get(lane);
            // One that ends before it starts asks nothing.
            let hit = if ray.t_far < ray.t_near { None } else { self.intersect(&ray) };
            packet.set_hit(lane, hit.as_ref());
        }
    }

    #[inline(never)]
    fn occluded_singly<const N: usize>(&self, packet: &mut RayPacket<N>, live: usize) {
        for lane in 0..live.min(N) {
            if self.occluded(&packet.get(lane)) {
                packet.t_far[lane] = f32::NEG_INFINITY;
            }
        }
    }
}

/// Calls `f` with the mask of the first `live` lanes.
#[inline]
fn with_valid<const N: usize>(live: usize, f: impl FnOnce(&Valid<N>)) {
    if live >= N { f(&Valid::ALL) } else { f(&Valid::first(live)) }
}

/// `W` lanes from `start` on; what tells rays apart (mask, id, time, flags) comes along.
#[inline]
fn part_of<const W: usize>(rays: &RayPacket, start: usize) -> RayPacket<W> {
    fn take<T: Copy, const W: usize>(lanes: &[T; LANES], start: usize) -> [T; W] {
        std::array::from_fn(|lane| lanes[start + lane])
    }
    RayPacket {
        o_x: take(&rays.o_x, start),
        o_y: take(&rays.o_y, start),
        o_z: take(&rays.o_z, start),
        t_near: take(&rays.t_near, start),
        d_x: take(&rays.d_x, start),
        d_y: take(&rays.d_y, start),
        d_z: take(&rays.d_z, start),
        time: take(&rays.time, start),
        t_far: take(&rays.t_far, start),
        mask: take(&rays.mask, start),
        id: take(&rays.id, start),
        flags: take(&rays.flags, start),
    }
}

/// A question without an answer yet.
#[inline]
pub(super) fn c_query(ray: &Ray) -> sys::RTCRayHit {
    let hit = sys::RTCHit {
        Ng_x: 0.0,
        Ng_y: 0.0,
        Ng_z: 0.0,
        u: 0.0,
        v: 0.0,
        primID: INVALID_ID,
        geomID: INVALID_ID,
        instID: [INVALID_ID],
        instPrimID: [INVALID_ID],
    };
    sys::RTCRayHit { ray: c_ray(ray), hit }
}

#[inline]
fn c_ray(ray: &Ray) -> sys::RTCRay {
    sys::RTCRay {
        org_x: ray.o.x,
        org_y: ray.o.y,
        org_z: ray.o.z,
        tnear: ray.t_near,
        dir_x: ray.d.x,
        dir_y: ray.d.y,
        dir_z: ray.d.z,
        time: 0.0,
        tfar: ray.t_far,
        mask: u32::MAX,
        id: 0,
        flags: 0,
    }
}

#[inline]
fn query_flags(coherence: Coherence) -> sys::RTCRayQueryFlags {
    match coherence {
        Coherence::Coherent => sys::RTCRayQueryFlags::RTC_RAY_QUERY_FLAG_COHERENT,
        Coherence::Incoherent => sys::RTCRayQueryFlags::RTC_RAY_QUERY_FLAG_INCOHERENT,
    }
}

#[inline]
pub(super) fn intersect_args(coherence: Coherence) -> sys::RTCIntersectArguments {
    let mut args = MaybeUninit::uninit();
    // SAFETY: fills the arguments that it is given.
    unsafe { sys::rtcInitIntersectArguments(args.as_mut_ptr()) };
    // SAFETY: filled by the call above.
    let args = unsafe { args.assume_init() };
    sys::RTCIntersectArguments { flags: query_flags(coherence), ..args }
}

#[inline]
pub(super) fn occluded_args(coherence: Coherence) -> sys::RTCOccludedArguments {
    let mut args = MaybeUninit::uninit();
    // SAFETY: fills the arguments that it is given.
    unsafe { sys::rtcInitOccludedArguments(args.as_mut_ptr()) };
    // SAFETY: filled by the call above.
    let args = unsafe { args.assume_init() };
    sys::RTCOccludedArguments { flags: query_flags(coherence), ..args }
}
