//! Sixteen rays side by side, in the memory layout that Embree's packet calls take,
//! so that the wrapper hands them over without a copy.

use super::{Hit, INVALID_ID, Ray};
use glam::Vec3;

/// Rays in one packet of a [`PacketBatch`].
pub const LANES: usize = 16;

/// Whether neighbouring lanes of a packet go roughly the same way.
///
/// Embree traverses coherent packets together, which is three times as fast for camera
/// rays and half as fast for rays that in truth diverge.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Coherence {
    /// Neighbours start and point alike: camera rays, shadow rays to one small light.
    Coherent,
    /// Anything else.
    Incoherent,
}

/// `N` rays as a structure of arrays. Lane `i` of every field is ray `i`.
///
/// The fields up to `flags` are those of Embree's `RTCRayN`, in its order.
#[repr(C, align(64))]
#[derive(Clone, Debug)]
#[expect(missing_docs, reason = "the components of a ray, one array each")]
pub struct RayPacket<const N: usize = LANES> {
    pub o_x: [f32; N],
    pub o_y: [f32; N],
    pub o_z: [f32; N],
    pub t_near: [f32; N],
    pub d_x: [f32; N],
    pub d_y: [f32; N],
    pub d_z: [f32; N],
    pub time: [f32; N],
    /// End of each interval. A nearest-hit query leaves the hit's `t` here, an any-hit
    /// query minus infinity where something is in the way.
    pub t_far: [f32; N],
    pub mask: [u32; N],
    pub id: [u32; N],
    pub flags: [u32; N],
}

/// Answers of `N` rays; the fields of Embree's `RTCHitN`, in its order.
#[repr(C, align(64))]
#[derive(Clone, Debug)]
#[expect(missing_docs, reason = "the components of a hit, one array each")]
pub struct HitLanes<const N: usize = LANES> {
    pub ng_x: [f32; N],
    pub ng_y: [f32; N],
    pub ng_z: [f32; N],
    pub u: [f32; N],
    pub v: [f32; N],
    pub prim_id: [u32; N],
    pub geom_id: [u32; N],
    pub inst_id: [u32; N],
    pub inst_prim_id: [u32; N],
}

/// `N` rays with room for their answers; Embree's `RTCRayHitN`.
#[repr(C, align(64))]
#[derive(Clone, Debug)]
pub struct RayHitPacket<const N: usize = LANES> {
    /// The questions.
    pub ray: RayPacket<N>,
    /// The answers.
    pub hit: HitLanes<N>,
}

impl<const N: usize> RayPacket<N> {
    /// A packet whose lanes all hold a harmless ray (from 0 along x, empty interval).
    pub const EMPTY: Self = Self {
        o_x: [0.0; N],
        o_y: [0.0; N],
        o_z: [0.0; N],
        t_near: [0.0; N],
        d_x: [1.0; N],
        d_y: [0.0; N],
        d_z: [0.0; N],
        time: [0.0; N],
        t_far: [f32::NEG_INFINITY; N],
        mask: [u32::MAX; N],
        id: [0; N],
        flags: [0; N],
    };

    /// Puts `ray` into `lane`.
    #[inline]
    pub fn set(&mut self, lane: usize, ray: &Ray) {
        self.o_x[lane] = ray.o.x;
        self.o_y[lane] = ray.o.y;
        self.o_z[lane] = ray.o.z;
        self.t_near[lane] = ray.t_near;
        self.d_x[lane] = ray.d.x;
        self.d_y[lane] = ray.d.y;
        self.d_z[lane] = ray.d.z;
        self.t_far[lane] = ray.t_far;
    }

    /// The ray of `lane`.
    #[inline]
    #[must_use]
    pub fn get(&self, lane: usize) -> Ray {
        Ray {
            o: Vec3::new(self.o_x[lane], self.o_y[lane], self.o_z[lane]),
            d: Vec3::new(self.d_x[lane], self.d_y[lane], self.d_z[lane]),
            t_near: self.t_near[lane],
            t_far: self.t_far[lane],
        }
    }

    /// After an any-hit query: whether something is in the way of `lane`.
    #[inline]
    #[must_use]
    pub fn is_occluded(&self, lane: usize) -> bool {
        self.t_far[lane] == f32::NEG_INFINITY
    }
}

impl<const N: usize> RayHitPacket<N> {
    /// Harmless rays without answers.
    pub const EMPTY: Self = Self {
        ray: RayPacket::EMPTY,
        hit: HitLanes {
            ng_x: [0.0; N],
            ng_y: [0.0; N],
            ng_z: [0.0; N],
            u: [0.0; N],
            v: [0.0; N],
            prim_id: [INVALID_ID; N],
            geom_id: [INVALID_ID; N],
            inst_id: [INVALID_ID; N],
            inst_prim_id: [INVALID_ID; N],
        },
    };

    /// The answer of `lane`, `None` for a miss.
    #[inline]
    #[must_use]
    pub fn hit(&self, lane: usize) -> Option<Hit> {
        (self.hit.geom_id[lane] != INVALID_ID).then(|| Hit {
            t: self.ray.t_far[lane],
            u: self.hit.u[lane],
            v: self.hit.v[lane],
            ng: Vec3::new(self.hit.ng_x[lane], self.hit.ng_y[lane], self.hit.ng_z[lane]),
            prim_id: self.hit.prim_id[lane],
            geom_id: self.hit.geom_id[lane],
        })
    }

    /// Writes `hit` into `lane`, as a backend that is not Embree does.
    #[inline]
    pub fn set_hit(&mut self, lane: usize, hit: Option<&Hit>) {
        let Some(hit) = hit else {
            self.hit.geom_id[lane] = INVALID_ID;
            return;
        };
        self.ray.t_far[lane] = hit.t;
        self.hit.u[lane] = hit.u;
        self.hit.v[lane] = hit.v;
        self.hit.ng_x[lane] = hit.ng.x;
        self.hit.ng_y[lane] = hit.ng.y;
        self.hit.ng_z[lane] = hit.ng.z;
        self.hit.prim_id[lane] = hit.prim_id;
        self.hit.geom_id[lane] = hit.geom_id;
    }
}

impl PacketBatch<RayHitPacket> {
    /// Writes the answer of ray `ray`: object and primitive, and where along the ray.
    #[inline]
    pub fn answer(&mut self, ray: usize, [geom_id, prim_id]: [u32; 2], t: f32) {
        let (packet, lane) = (&mut self.packets[ray / LANES], ray % LANES);
        packet.ray.t_far[lane] = t;
        packet.hit.geom_id[lane] = geom_id;
        packet.hit.prim_id[lane] = prim_id;
    }
}

/// What a [`PacketBatch`] is made of.
pub trait RayQueue: Clone {
    /// A packet without rays.
    const EMPTY: Self;
    /// The rays of the packet.
    fn rays(&mut self) -> &mut RayPacket;
}

impl RayQueue for RayPacket {
    const EMPTY: Self = RayPacket::EMPTY;
    fn rays(&mut self) -> &mut RayPacket {
        self
    }
}

impl RayQueue for RayHitPacket {
    const EMPTY: Self = RayHitPacket::EMPTY;
    fn rays(&mut self) -> &mut RayPacket {
        &mut self.ray
    }
}

/// Any number of rays, packed densely: ray `i` is lane `i % LANES` of packet `i / LANES`,
/// and only the last packet may be partly filled. Kept and refilled, never reallocated.
#[derive(Debug)]
pub struct PacketBatch<P> {
    packets: Vec<P>,
    len: usize,
}

impl<P: RayQueue> Clone for PacketBatch<P> {
    fn clone(&self) -> Self {
        Self { packets: self.packets().to_vec(), len: self.len }
    }

    /// Copies the packets in use into memory that `self` already has.
    fn clone_from(&mut self, from: &Self) {
        self.resize(from.len);
        let used = from.packets().len();
        self.packets[..used].clone_from_slice(from.packets());
    }
}

impl<P: RayQueue> Default for PacketBatch<P> {
    fn default() -> Self {
        Self { packets: Vec::new(), len: 0 }
    }
}

impl<P: RayQueue> PacketBatch<P> {
    /// Rays in the batch.
    #[must_use]
    pub fn len(&self) -> usize {
        self.len
    }

    /// Whether no ray is in it.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Makes room for exactly `len` rays whose lanes the caller fills.
    pub fn resize(&mut self, len: usize) {
        let packets = len.div_ceil(LANES);
        if self.packets.len() < packets {
            self.packets.resize(packets, P::EMPTY);
        }
        self.len = len;
    }

    /// Forgets all rays, keeps the memory.
    pub fn clear(&mut self) {
        self.len = 0;
    }

    /// Appends one ray.
    #[inline]
    pub fn push(&mut self, ray: &Ray) {
        let (packet, lane) = (self.len / LANES, self.len % LANES);
        if packet == self.packets.len() {
            self.packets.push(P::EMPTY);
        }
        self.packets[packet].rays().set(lane, ray);
        self.len += 1;
    }

    /// Appends a whole packet for the caller to fill. A lane that asks nothing has a `t_far`
    /// of minus infinity, and keeps it.
    ///
    /// # Panics
    /// If the last packet is not full.
    #[inline]
    pub fn push_packet(&mut self) -> &mut P {
        assert_eq!(self.len % LANES, 0, "a packet cannot follow a partly filled one");
        let packet = self.len / LANES;
        if packet == self.packets.len() {
            self.packets.push(P::EMPTY);
        }
        self.len += LANES;
        &mut self.packets[packet]
    }

    /// Takes back the last packet.
    pub fn pop_packet(&mut self) {
        self.len = self.len.saturating_sub(1) / LANES * LANES;
    }

    /// The packets in use.
    #[must_use]
    pub fn packets(&self) -> &[P] {
        &self.packets[..self.len.div_ceil(LANES)]
    }

    /// Each packet in use with the number of its lanes that hold a ray (the first ones).
    pub fn packets_mut(&mut self) -> impl Iterator<Item = (&mut P, usize)> {
        let len = self.len;
        self.packets[..len.div_ceil(LANES)].iter_mut().enumerate().map(move |(i, p)| (p, (len - i * LANES).min(LANES)))
    }
}
