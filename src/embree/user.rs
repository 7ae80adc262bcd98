//! Shapes that Embree cannot build by itself: written in Rust, called back during traversal.

use super::fault::Fault;
use crate::geom::{Bounds, Lanes, ShapeSet};
use crate::simd::{self, Kernel};
use embree4_sys as sys;
use std::any::Any;
use std::mem::MaybeUninit;
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

    /// Parameters of the nearest points of `prim` in the open intervals of `N` rays; infinity in the lanes that
    /// miss, `None` when all do. `N` is 1, 4, 8 or 16.
    ///
    /// Some lanes may hold no ray but any numbers; what is answered for them is dropped. Directions may be a power
    /// of two times the ones that were asked for, and parameters count in units of them.
    ///
    /// Called from a [`Kernel`]: marked `#[inline(always)]` and written as plain loops over the lanes it becomes the
    /// widest vector code that the processor has.
    fn hit_lanes<const N: usize>(&self, prim: u32, rays: &Lanes<'_, f32, N>) -> Option<[f64; N]>;
}

impl<S: ShapeSet + 'static> PrimSet for S {
    fn len(&self) -> u32 {
        ShapeSet::len(self)
    }

    fn bounds(&self, prim: u32) -> Bounds {
        ShapeSet::bounds(self, prim)
    }

    #[inline(always)]
    fn hit_lanes<const N: usize>(&self, prim: u32, rays: &Lanes<'_, f32, N>) -> Option<[f64; N]> {
        self.hit_lanes_here(prim, rays)
    }
}

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
    // SAFETY: Embree's arguments, as above.
    unsafe { write_box(args, set.fault.guard(NOTHING, || outward(set.prims.bounds(args.primID)))) };
}

/// Answers with a box, lower and upper corner.
///
/// # Safety
/// `args` must be those of a bounds callback that has not answered yet.
pub(super) unsafe fn write_box(args: &sys::RTCBoundsFunctionArguments, [lo, hi]: [[f32; 3]; 2]) {
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
    // SAFETY: `bounds_o` is a place for one box, the callback's alone.
    unsafe { args.bounds_o.write(bounds) };
}

/// Keeps the nearest hits of the rays of a packet with one primitive.
pub(super) unsafe extern "C" fn intersect<S: PrimSet>(args: *const sys::RTCIntersectFunctionNArguments) {
    // SAFETY: Embree passes arguments that are valid for this call.
    let args = unsafe { &*args };
    // SAFETY: as in `bounds`.
    let set = unsafe { &*args.geometryUserPtr.cast::<UserSet<S>>() };
    match args.N {
        // SAFETY: `valid` has `N` entries and `rayhit` the `N` rays and hits of the callback.
        1 => unsafe { nearest::<S, 1>(set, args) },
        // SAFETY: as above.
        4 => unsafe { nearest::<S, 4>(set, args) },
        // SAFETY: as above.
        8 => unsafe { nearest::<S, 8>(set, args) },
        // SAFETY: as above.
        16 => unsafe { nearest::<S, 16>(set, args) },
        n => set.fault.raise(unknown_width(n)),
    }
}

/// Marks the rays of a packet that one primitive is in the way of.
pub(super) unsafe extern "C" fn occluded<S: PrimSet>(args: *const sys::RTCOccludedFunctionNArguments) {
    // SAFETY: Embree passes arguments that are valid for this call.
    let args = unsafe { &*args };
    // SAFETY: as in `bounds`.
    let set = unsafe { &*args.geometryUserPtr.cast::<UserSet<S>>() };
    match args.N {
        // SAFETY: `valid` has `N` entries and `ray` the `N` rays of the callback.
        1 => unsafe { any::<S, 1>(set, args) },
        // SAFETY: as above.
        4 => unsafe { any::<S, 4>(set, args) },
        // SAFETY: as above.
        8 => unsafe { any::<S, 8>(set, args) },
        // SAFETY: as above.
        16 => unsafe { any::<S, 16>(set, args) },
        n => set.fault.raise(unknown_width(n)),
    }
}

#[cold]
pub(super) fn unknown_width(n: u32) -> Box<dyn Any + Send> {
    Box::new(format!("Embree called back with {n} rays, a number it is not known for"))
}

/// # Safety
/// `valid` must have `N` entries, and `rayhit` the rays and hits of a packet of `N`.
#[inline]
unsafe fn nearest<S: PrimSet, const N: usize>(set: &UserSet<S>, args: &sys::RTCIntersectFunctionNArguments) {
    // SAFETY: Embree always passes a context.
    let context = unsafe { &*args.context };
    let ids = [args.primID, args.geomID, context.instID[0], context.instPrimID[0]];
    // SAFETY: the caller's promise; Embree leaves the packet to this call.
    let packet = unsafe { Packet::<N, WITH_HITS>::new(args.valid, args.rayhit.cast()) };
    set.fault.guard((), || run::<N>(Nearest { prims: &*set.prims, ids, packet }));
}

/// # Safety
/// `valid` must have `N` entries, and `ray` the rays of a packet of `N`.
#[inline]
unsafe fn any<S: PrimSet, const N: usize>(set: &UserSet<S>, args: &sys::RTCOccludedFunctionNArguments) {
    // SAFETY: the caller's promise; Embree leaves the packet to this call.
    let packet = unsafe { Packet::<N, RAYS_ONLY>::new(args.valid, args.ray.cast()) };
    set.fault.guard((), || run::<N>(InTheWay { prims: &*set.prims, prim: args.primID, packet }));
}

/// A single ray gains nothing from wide vectors.
#[inline(always)]
fn run<const N: usize>(kernel: impl Kernel<Output = ()>) {
    if N == 1 { kernel.run() } else { simd::run(kernel) }
}

/// All of a callback is one kernel: handed out of it, the hits would go through memory.
struct Nearest<'a, S, const N: usize> {
    prims: &'a S,
    /// Of the primitive, the geometry, the instance, and the primitive of the instance.
    ids: [u32; 4],
    packet: Packet<N, WITH_HITS>,
}

impl<S: PrimSet, const N: usize> Kernel for Nearest<'_, S, N> {
    type Output = ();

    #[inline(always)]
    fn run(mut self) {
        let Some(t) = self.prims.hit_lanes(self.ids[0], &self.packet.rays()) else { return };
        let Some(found) = self.packet.found(&t) else { return };
        self.packet.put(T_FAR, &found, |lane| (t[lane] as f32).to_bits());
        for field in SURFACE..IDS {
            self.packet.put(field, &found, |_| 0);
        }
        for (i, id) in self.ids.into_iter().enumerate() {
            self.packet.put(IDS + i, &found, |_| id);
        }
    }
}

struct InTheWay<'a, S, const N: usize> {
    prims: &'a S,
    prim: u32,
    packet: Packet<N, RAYS_ONLY>,
}

impl<S: PrimSet, const N: usize> Kernel for InTheWay<'_, S, N> {
    type Output = ();

    #[inline(always)]
    fn run(mut self) {
        let Some(t) = self.prims.hit_lanes(self.prim, &self.packet.rays()) else { return };
        let Some(found) = self.packet.found(&t) else { return };
        self.packet.put(T_FAR, &found, |_| f32::NEG_INFINITY.to_bits());
    }
}

/// Fields of a ray: origin, direction, and the interval.
const ORIGIN: usize = 0;
const T_NEAR: usize = 3;
const DIRECTION: usize = 4;
pub(super) const T_FAR: usize = 8;
/// Fields of a hit, which follow those of the rays: normal, u and v, then the ids.
const SURFACE: usize = 12;
const IDS: usize = 17;

/// Numbers of fields.
const RAYS_ONLY: usize = SURFACE;
pub(super) const WITH_HITS: usize = IDS + 4;

const _: () = {
    use std::mem::{offset_of, size_of};
    use sys::{RTCRay, RTCRay16, RTCRayHit, RTCRayHit16};
    assert!(offset_of!(RTCRayHit, ray.org_x) == 4 * ORIGIN && offset_of!(RTCRayHit16, ray.org_x) == 64 * ORIGIN);
    assert!(offset_of!(RTCRayHit, ray.tnear) == 4 * T_NEAR && offset_of!(RTCRayHit16, ray.tnear) == 64 * T_NEAR);
    assert!(offset_of!(RTCRayHit, ray.dir_x) == 4 * DIRECTION && offset_of!(RTCRayHit16, ray.dir_x) == 64 * DIRECTION);
    assert!(offset_of!(RTCRayHit, ray.tfar) == 4 * T_FAR && offset_of!(RTCRayHit16, ray.tfar) == 64 * T_FAR);
    assert!(offset_of!(RTCRayHit, hit.Ng_x) == 4 * SURFACE && offset_of!(RTCRayHit16, hit.Ng_x) == 64 * SURFACE);
    assert!(offset_of!(RTCRayHit, hit.primID) == 4 * IDS && offset_of!(RTCRayHit16, hit.primID) == 64 * IDS);
    assert!(offset_of!(RTCRayHit16, hit.instPrimID) == 64 * (WITH_HITS - 1));
    assert!(size_of::<RTCRay>() == 4 * RAYS_ONLY && size_of::<RTCRay16>() == 64 * RAYS_ONLY);
};

/// Embree's memory of the rays of one callback, those of one packet or some of them in another order: `FIELDS` of
/// `N` words, lane after lane.
pub(super) struct Packet<const N: usize, const FIELDS: usize> {
    valid: *const i32,
    words: *mut u32,
}

impl<const N: usize, const FIELDS: usize> Packet<N, FIELDS> {
    /// # Safety
    /// While the packet is in use, `valid` must be `N` numbers, and `words` `FIELDS * N` words that nobody else uses,
    /// those of the rays initialised.
    #[inline(always)]
    pub(super) unsafe fn new(valid: *const i32, words: *mut u32) -> Self {
        Self { valid, words }
    }

    #[inline(always)]
    pub(super) fn floats(&self, field: usize) -> &[f32; N] {
        assert!(field < RAYS_ONLY && RAYS_ONLY <= FIELDS);
        // SAFETY: the field is inside the packet.
        let first = unsafe { self.words.add(field * N) };
        // SAFETY: as above, and initialised: any word is a float. Writing takes `&mut self`.
        unsafe { &*first.cast() }
    }

    #[inline(always)]
    fn rays(&self) -> Lanes<'_, f32, N> {
        let axes = |field| [self.floats(field), self.floats(field + 1), self.floats(field + 2)];
        Lanes { o: axes(ORIGIN), d: axes(DIRECTION), t_near: self.floats(T_NEAR), t_far: self.floats(T_FAR) }
    }

    /// The active lanes in which `t` is below infinity, if there are any. A NaN is not.
    #[inline(always)]
    pub(super) fn found(&self, t: &[f64; N]) -> Option<[bool; N]> {
        // SAFETY: the promise of `new`.
        let valid = unsafe { &*self.valid.cast::<[i32; N]>() };
        let mut found = [false; N];
        let mut any = false;
        for lane in 0..N {
            found[lane] = (valid[lane] != 0) & (t[lane] < f64::INFINITY);
            any |= found[lane];
        }
        any.then_some(found)
    }

    /// Puts `word` into the lanes that `found` something. The others get what they have, be it uninitialised: such a
    /// blend of whole fields is a few vector instructions, where a branch per lane cost a fifth of the callback.
    #[inline(always)]
    fn put(&mut self, field: usize, found: &[bool; N], word: impl Fn(usize) -> u32) {
        assert!(field < FIELDS);
        // SAFETY: the field is inside the packet.
        let first = unsafe { self.words.add(field * N) };
        // SAFETY: as above, and nobody else uses it.
        let lanes = unsafe { &mut *first.cast::<[MaybeUninit<u32>; N]>() };
        let (old, new): ([_; N], [_; N]) = (*lanes, std::array::from_fn(word));
        for lane in 0..N {
            lanes[lane] = if found[lane] { MaybeUninit::new(new[lane]) } else { old[lane] };
        }
    }
}

impl Packet<1, WITH_HITS> {
    /// Puts a hit without normal, u and v where `found` says so.
    pub(super) fn put_hit(&mut self, t: f32, ids: [u32; 4], found: &[bool; 1]) {
        self.put(T_FAR, found, |_| t.to_bits());
        for field in SURFACE..IDS {
            self.put(field, found, |_| 0);
        }
        for (i, id) in ids.into_iter().enumerate() {
            self.put(IDS + i, found, |_| id);
        }
    }
}

/// Lower above upper: Embree ignores the primitive.
pub(super) const NOTHING: [[f32; 3]; 2] = [[f32::INFINITY; 3], [f32::NEG_INFINITY; 3]];

/// Embree drops what goes beyond 1.844e18, without a word.
const LARGEST: f64 = 1.8e18;

/// `bounds` as Embree gets them: rounded outwards, two ulps more for the f32 arithmetic of its box test, and never
/// flat, which a ray in the plane of the box would miss.
pub(super) fn outward(bounds: Bounds) -> [[f32; 3]; 2] {
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
