//! Shapes that Embree cannot build by itself: written in Rust, called back during traversal.

use super::fault::Fault;
use crate::geom::{Bounds, Ray};
use embree4_sys as sys;
use glam::Vec3;
use std::sync::Arc;

/// A set of primitives of one kind. `prim` is always below [`len`](Self::len) as it was when the set was added.
///
/// Everything is called from many threads at once. A panic is kept and raised again by
/// [`SceneBuilder::commit`](super::SceneBuilder::commit) or [`Scene::resume_panics`](super::Scene::resume_panics).
pub trait PrimSet: Send + Sync + 'static {
    /// Number of primitives.
    fn len(&self) -> u32;

    /// Whether there is none.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// A box around primitive `prim`; it is rounded outwards on the way to Embree. A primitive whose box is empty
    /// or has a NaN is never hit.
    fn bounds(&self, prim: u32) -> Bounds;

    /// Nearest hit of `prim` inside the ray's interval; one outside of it is dropped.
    ///
    /// The direction may be a power of two times the one that was asked for, and `t` counts in units of it.
    fn hit(&self, prim: u32, ray: &Ray) -> Option<PrimHit>;

    /// [`hit`](Self::hit) for `N` rays at once; `N` is 1, 4, 8 or 16. `active` is 0 for lanes that hold no ray
    /// (but any numbers), and what is answered for them is dropped. All lanes of `hits` are misses at first.
    ///
    /// Worth writing out as plain loops over the lanes, which the compiler turns into vector code: for 16 coherent
    /// rays that made spheres five times as fast among a thousand of them, and 2.6 times among 100,000.
    #[inline]
    fn hit_lanes<const N: usize>(&self, prim: u32, rays: &RayLanes<N>, active: &[i32; N], hits: &mut PrimHits<N>) {
        for (lane, _) in active.iter().enumerate().filter(|(_, a)| **a != 0) {
            if let Some(hit) = self.hit(prim, &rays.get(lane)) {
                hits.set(lane, &hit);
            }
        }
    }
}

/// Where a ray meets a primitive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PrimHit {
    /// Ray parameter.
    pub t: f32,
    /// First surface parameter; what it means is the shape's own business.
    pub u: f32,
    /// Second surface parameter.
    pub v: f32,
    /// Geometric normal, outwards, of any length.
    pub ng: Vec3,
}

/// [`PrimHit`] of `N` rays.
#[derive(Clone, Debug)]
pub struct PrimHits<const N: usize> {
    /// Ray parameter; infinity for a miss.
    pub t: [f32; N],
    /// First surface parameter.
    pub u: [f32; N],
    /// Second surface parameter.
    pub v: [f32; N],
    /// Geometric normal, x.
    pub ng_x: [f32; N],
    /// Geometric normal, y.
    pub ng_y: [f32; N],
    /// Geometric normal, z.
    pub ng_z: [f32; N],
}

impl<const N: usize> PrimHits<N> {
    /// No lane hits.
    pub const MISS: Self =
        Self { t: [f32::INFINITY; N], u: [0.0; N], v: [0.0; N], ng_x: [0.0; N], ng_y: [0.0; N], ng_z: [0.0; N] };

    /// Puts `hit` into `lane`.
    #[inline]
    pub fn set(&mut self, lane: usize, hit: &PrimHit) {
        self.t[lane] = hit.t;
        self.u[lane] = hit.u;
        self.v[lane] = hit.v;
        self.ng_x[lane] = hit.ng.x;
        self.ng_y[lane] = hit.ng.y;
        self.ng_z[lane] = hit.ng.z;
    }
}

/// The rays of one callback, as Embree has them in memory: those of one packet, or some of them in another order.
/// What tells them apart is their `id`.
#[repr(C)]
#[derive(Clone, Debug)]
#[expect(missing_docs, reason = "the components of a ray, one array each, as in `RayPacket`")]
pub struct RayLanes<const N: usize> {
    pub o_x: [f32; N],
    pub o_y: [f32; N],
    pub o_z: [f32; N],
    pub t_near: [f32; N],
    pub d_x: [f32; N],
    pub d_y: [f32; N],
    pub d_z: [f32; N],
    pub time: [f32; N],
    /// Nearest hit so far.
    pub t_far: [f32; N],
    pub mask: [u32; N],
    pub id: [u32; N],
    pub flags: [u32; N],
}

impl<const N: usize> RayLanes<N> {
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
}

/// Places in Embree's packets, in units of `N` words: the rays' `tfar`, and the hits, which follow the rays.
const T_FAR: usize = 8;
const HIT: usize = 12;

const _: () = {
    use std::mem::{offset_of, size_of};
    assert!(size_of::<RayLanes<1>>() == size_of::<sys::RTCRay>());
    assert!(size_of::<RayLanes<16>>() == size_of::<sys::RTCRay16>());
    assert!(offset_of!(RayLanes<16>, t_far) == offset_of!(sys::RTCRay16, tfar));
    assert!(offset_of!(sys::RTCRay16, tfar) == T_FAR * 64 && offset_of!(sys::RTCRay, tfar) == T_FAR * 4);
    assert!(offset_of!(sys::RTCRayHit16, hit) == HIT * 64 && offset_of!(sys::RTCRayHit, hit) == HIT * 4);
    assert!(offset_of!(sys::RTCHit16, instPrimID) == 8 * 64 && offset_of!(sys::RTCHit, instPrimID) == 8 * 4);
};

/// What the user pointer of a geometry points at.
pub(super) struct UserSet<S> {
    pub prims: Arc<S>,
    pub fault: Arc<Fault>,
}

/// Writes the box of one primitive. Called on Embree's threads while it builds.
pub(super) unsafe extern "C" fn bounds<S: PrimSet>(args: *const sys::RTCBoundsFunctionArguments) {
    // SAFETY: Embree passes arguments that are valid for this call.
    let args = unsafe { &*args };
    // SAFETY: the `UserSet<S>` given with this callback, kept by the scene until after its release. A shared
    // reference, never `ptr::read`: that would drop the set a second time.
    let set = unsafe { &*args.geometryUserPtr.cast::<UserSet<S>>() };
    let [lo, hi] = set.fault.guard(NOTHING, || outward(set.prims.bounds(args.primID)));
    let bounds = sys::RTCBounds {
        lower_x: lo[0],
        lower_y: lo[1],
        lower_z: lo[2],
        align0: 0.0,
        upper_x: hi[0],
        upper_y: hi[1],
        upper_z: hi[2],
        align1: 0.0,
    };
    // SAFETY: `bounds_o` is a place for one box, this call's alone.
    unsafe { args.bounds_o.write(bounds) };
}

/// Keeps the nearest hits of the rays of a packet with one primitive.
pub(super) unsafe extern "C" fn intersect<S: PrimSet>(args: *const sys::RTCIntersectFunctionNArguments) {
    // SAFETY: Embree passes arguments that are valid for this call.
    let args = unsafe { &*args };
    // SAFETY: as in `bounds`.
    let set = unsafe { &*args.geometryUserPtr.cast::<UserSet<S>>() };
    // SAFETY: Embree always passes a context.
    let context = unsafe { &*args.context };
    let call = Call { set, prim: args.primID, valid: args.valid, words: args.rayhit.cast() };
    let ids = [args.primID, args.geomID, context.instID[0], context.instPrimID[0]];
    match args.N {
        // SAFETY: `valid` has `N` entries and `rayhit` the `N` rays and hits of the callback.
        1 => unsafe { call.intersect::<1>(ids) },
        // SAFETY: as above.
        4 => unsafe { call.intersect::<4>(ids) },
        // SAFETY: as above.
        8 => unsafe { call.intersect::<8>(ids) },
        // SAFETY: as above.
        16 => unsafe { call.intersect::<16>(ids) },
        n => set.fault.raise(Box::new(format!("Embree called back with {n} rays, a number it is not known for"))),
    }
}

/// Marks the rays of a packet that one primitive is in the way of.
pub(super) unsafe extern "C" fn occluded<S: PrimSet>(args: *const sys::RTCOccludedFunctionNArguments) {
    // SAFETY: Embree passes arguments that are valid for this call.
    let args = unsafe { &*args };
    // SAFETY: as in `bounds`.
    let set = unsafe { &*args.geometryUserPtr.cast::<UserSet<S>>() };
    let call = Call { set, prim: args.primID, valid: args.valid, words: args.ray.cast() };
    match args.N {
        // SAFETY: `valid` has `N` entries and `ray` the `N` rays of the callback.
        1 => unsafe { call.occluded::<1>() },
        // SAFETY: as above.
        4 => unsafe { call.occluded::<4>() },
        // SAFETY: as above.
        8 => unsafe { call.occluded::<8>() },
        // SAFETY: as above.
        16 => unsafe { call.occluded::<16>() },
        n => set.fault.raise(Box::new(format!("Embree called back with {n} rays, a number it is not known for"))),
    }
}

/// One callback. Word `i` of field `k` of a packet of `N` sits at `k * N + i`.
struct Call<'a, S> {
    set: &'a UserSet<S>,
    prim: u32,
    valid: *const i32,
    words: *mut u32,
}

impl<S: PrimSet> Call<'_, S> {
    /// # Safety
    /// `valid` must have `N` entries, and `words` the rays and hits of a packet of `N`.
    #[inline]
    unsafe fn intersect<const N: usize>(&self, ids: [u32; 4]) {
        let keep = |lane: usize, hits: &PrimHits<N>| {
            let floats = [hits.ng_x[lane], hits.ng_y[lane], hits.ng_z[lane], hits.u[lane], hits.v[lane]];
            // SAFETY: a lane of `N`, in the ray's part.
            unsafe { self.write::<N>(T_FAR, lane, hits.t[lane].to_bits()) };
            for (field, word) in floats.map(f32::to_bits).into_iter().chain(ids).enumerate() {
                // SAFETY: a lane of `N`; the hit's part has these nine fields.
                unsafe { self.write::<N>(HIT + field, lane, word) };
            }
        };
        // SAFETY: the caller's promise.
        unsafe { self.each_hit(keep) };
    }

    /// # Safety
    /// `valid` must have `N` entries, and `words` the rays of a packet of `N`.
    #[inline]
    unsafe fn occluded<const N: usize>(&self) {
        let keep = |lane: usize, _: &PrimHits<N>| {
            // SAFETY: a lane of `N`, in the ray's part.
            unsafe { self.write::<N>(T_FAR, lane, f32::NEG_INFINITY.to_bits()) };
        };
        // SAFETY: the caller's promise.
        unsafe { self.each_hit(keep) };
    }

    /// Calls `keep` for each active lane that the primitive is hit by inside its interval.
    ///
    /// # Safety
    /// `valid` must have `N` entries, and `words` the rays of a packet of `N`.
    #[inline]
    unsafe fn each_hit<const N: usize>(&self, keep: impl Fn(usize, &PrimHits<N>)) {
        // All of it inside the guard: handed out of it, the hits would go through memory even when there is none.
        self.set.fault.guard((), || {
            // SAFETY: the caller's promise.
            let active = unsafe { &*self.valid.cast::<[i32; N]>() };
            // SAFETY: as above; `RayLanes` are words laid out as C's, and every bit pattern is one. The last use is
            // ahead of the first `keep`, which writes there.
            let rays = unsafe { &*self.words.cast::<RayLanes<N>>() };
            let mut hits = PrimHits::MISS;
            self.set.prims.hit_lanes(self.prim, rays, active, &mut hits);
            let mut found = [false; N];
            let mut any = false;
            for lane in 0..N {
                let t = hits.t[lane];
                // A NaN fails.
                found[lane] = (active[lane] != 0) & (t > rays.t_near[lane]) & (t < rays.t_far[lane]);
                any |= found[lane];
            }
            if any {
                (0..N).filter(|&lane| found[lane]).for_each(|lane| keep(lane, &hits));
            }
        });
    }

    /// # Safety
    /// The packet must have `field`, and `lane < N`.
    #[inline]
    unsafe fn write<const N: usize>(&self, field: usize, lane: usize, word: u32) {
        // SAFETY: the caller's promise.
        let place = unsafe { self.words.add(field * N + lane) };
        // SAFETY: inside the packet, which is this call's alone.
        unsafe { place.write(word) };
    }
}

/// Lower above upper: Embree ignores the primitive.
const NOTHING: [[f32; 3]; 2] = [[f32::INFINITY; 3], [f32::NEG_INFINITY; 3]];

/// Embree drops what goes beyond 1.844e18, without a word.
const LARGEST: f64 = 1.8e18;

/// `bounds` as Embree gets them: rounded outwards, two ulps more for the f32 arithmetic of its box test, and never
/// flat, which a ray in the plane of the box would miss.
fn outward(bounds: Bounds) -> [[f32; 3]; 2] {
    let (lo, hi) = (bounds.lo, bounds.hi);
    if !lo.cmple(hi).all() {
        return NOTHING;
    }
    let (lo, hi) =
        (lo.to_array().map(|x| x.clamp(-LARGEST, LARGEST)), hi.to_array().map(|x| x.clamp(-LARGEST, LARGEST)));
    let extent = (0..3).map(|k| hi[k] - lo[k]).fold(0.0, f64::max);
    // Half of the least thickness, 2^-22 of the longest edge.
    let floor = f64::from(f32::EPSILON) * extent;
    let out = |k: usize| {
        let middle = 0.5 * (lo[k] + hi[k]);
        let (lo, hi) = (down(lo[k].min(middle - floor)), up(hi[k].max(middle + floor)));
        (lo.next_down().next_down(), hi.next_up().next_up())
    };
    let [(lx, hx), (ly, hy), (lz, hz)] = [out(0), out(1), out(2)];
    [[lx, ly, lz], [hx, hy, hz]]
}

/// Greatest f32 that is not above `x`.
fn down(x: f64) -> f32 {
    let nearest = x as f32;
    if f64::from(nearest) > x { nearest.next_down() } else { nearest }
}

/// Least f32 that is not below `x`.
fn up(x: f64) -> f32 {
    -down(-x)
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    #[test]
    fn boxes_are_rounded_outwards_and_two_ulps_more() {
        for x in [1.0 + 1e-12, 1.0 - 1e-12, 0.1, 1e-30, 123_456.789, 1.7e18] {
            let b = Bounds { lo: DVec3::splat(-x), hi: DVec3::splat(x) };
            let [lo, hi] = outward(b);
            for k in 0..3 {
                let inner = hi[k].next_down().next_down();
                assert!(f64::from(inner) >= x && f64::from(inner.next_down()) < x, "{x}: {}", hi[k]);
                assert_eq!(lo[k], -hi[k], "{x}");
            }
        }
    }

    #[test]
    fn boxes_are_never_flat() {
        let flat = Bounds { lo: DVec3::new(-1.0, 0.0, 5.0), hi: DVec3::new(1.0, 0.0, 5.0) };
        let [lo, hi] = outward(flat);
        for k in 0..3 {
            assert!(f64::from(hi[k]) - f64::from(lo[k]) >= 2.0 * 2f64.powi(-22), "axis {k}: {} to {}", lo[k], hi[k]);
        }
        let [lo, hi] = outward(Bounds { lo: DVec3::ZERO, hi: DVec3::ZERO });
        assert!(lo[0] < 0.0 && hi[0] > 0.0, "not even a point is");
    }

    #[test]
    fn a_box_that_is_none_is_ignored_and_an_endless_one_is_cut() {
        let unit = Bounds { lo: DVec3::ZERO, hi: DVec3::ONE };
        for bounds in [
            Bounds::EMPTY,
            Bounds { lo: DVec3::new(0.0, f64::NAN, 0.0), ..unit },
            Bounds { hi: DVec3::new(1.0, 1.0, f64::NAN), ..unit },
            Bounds { hi: DVec3::new(1.0, -1.0, 1.0), ..unit },
        ] {
            assert_eq!(outward(bounds), NOTHING, "{bounds:?}");
        }
        let [lo, hi] = outward(Bounds { lo: DVec3::NEG_INFINITY, hi: DVec3::splat(1e300) });
        assert!(lo[0] > -1.844e18 && lo[0] < -1.79e18 && hi[2] < 1.844e18 && hi[2] > 1.79e18);
    }
}
