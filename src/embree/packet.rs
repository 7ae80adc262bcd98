//! Our packets are Embree's, field by field, so that they go over without a copy.

use crate::geom::{HitLanes, RayHitPacket, RayPacket};
use embree4_sys as sys;
use std::mem::{align_of, offset_of, size_of};

/// Which lanes of a packet hold a ray: -1 for those that do, 0 for the others.
#[repr(C, align(64))]
#[derive(Debug)]
pub struct Valid<const N: usize>([i32; N]);

impl<const N: usize> Valid<N> {
    pub(super) const ALL: Self = Self([-1; N]);

    /// The first `live` lanes.
    #[inline]
    pub(super) fn first(live: usize) -> Self {
        Self(std::array::from_fn(|lane| if lane < live { -1 } else { 0 }))
    }
}

mod sealed {
    use super::{RayHitPacket, RayPacket, Valid, sys};

    /// The C calls for packets of `N` rays.
    pub trait Calls<const N: usize> {
        /// # Safety
        /// `scene` must be a committed scene, and `args` filled.
        unsafe fn intersect(
            valid: &Valid<N>,
            scene: sys::RTCScene,
            packet: &mut RayHitPacket<N>,
            args: &mut sys::RTCIntersectArguments,
        );

        /// # Safety
        /// As for `intersect`.
        unsafe fn occluded(
            valid: &Valid<N>,
            scene: sys::RTCScene,
            packet: &mut RayPacket<N>,
            args: &mut sys::RTCOccludedArguments,
        );
    }
}

pub(super) use sealed::Calls;

/// Packets of the widths that Embree has calls for: 4, 8 and 16. Cannot be implemented for others.
pub trait Width<const N: usize>: sealed::Calls<N> {}

/// Fails to compile unless the fields of ours sit where those of C's do.
macro_rules! same_places {
    ($ours:ty, $theirs:ty, $($our_field:ident = $their_field:ident),+) => {
        $(assert!(offset_of!($ours, $our_field) == offset_of!($theirs, $their_field)));+
    };
}

macro_rules! width {
    ($n:literal, $ray:ident, $hit:ident, $ray_hit:ident, $intersect:ident, $occluded:ident) => {
        const _: () = {
            same_places!(
                RayPacket<$n>,
                sys::$ray,
                o_x = org_x,
                o_y = org_y,
                o_z = org_z,
                t_near = tnear,
                d_x = dir_x,
                d_y = dir_y,
                d_z = dir_z,
                time = time,
                t_far = tfar,
                mask = mask,
                id = id,
                flags = flags
            );
            same_places!(
                HitLanes<$n>,
                sys::$hit,
                ng_x = Ng_x,
                ng_y = Ng_y,
                ng_z = Ng_z,
                u = u,
                v = v,
                prim_id = primID,
                geom_id = geomID,
                inst_id = instID,
                inst_prim_id = instPrimID
            );
            same_places!(RayHitPacket<$n>, sys::$ray_hit, ray = ray, hit = hit);
            assert!(size_of::<RayPacket<$n>>() >= size_of::<sys::$ray>());
            assert!(size_of::<RayHitPacket<$n>>() >= size_of::<sys::$ray_hit>());
            assert!(align_of::<RayPacket<$n>>() >= align_of::<sys::$ray>());
            assert!(align_of::<RayHitPacket<$n>>() >= align_of::<sys::$ray_hit>());
            assert!(align_of::<Valid<$n>>() >= align_of::<sys::$ray>());
        };

        impl Width<$n> for RayPacket<$n> {}

        impl sealed::Calls<$n> for RayPacket<$n> {
            #[inline]
            unsafe fn intersect(
                valid: &Valid<$n>,
                scene: sys::RTCScene,
                packet: &mut RayHitPacket<$n>,
                args: &mut sys::RTCIntersectArguments,
            ) {
                let packet = (&raw mut *packet).cast::<sys::$ray_hit>();
                // SAFETY: the packet is ours alone, initialised, and laid out as C's, as asserted above; the mask has
                // its lanes and alignment; scene and arguments are the caller's promise.
                unsafe { sys::$intersect(valid.0.as_ptr(), scene, packet, args) };
            }

            #[inline]
            unsafe fn occluded(
                valid: &Valid<$n>,
                scene: sys::RTCScene,
                packet: &mut RayPacket<$n>,
                args: &mut sys::RTCOccludedArguments,
            ) {
                let packet = (&raw mut *packet).cast::<sys::$ray>();
                // SAFETY: as for `intersect`.
                unsafe { sys::$occluded(valid.0.as_ptr(), scene, packet, args) };
            }
        }
    };
}

width!(4, RTCRay4, RTCHit4, RTCRayHit4, rtcIntersect4, rtcOccluded4);
width!(8, RTCRay8, RTCHit8, RTCRayHit8, rtcIntersect8, rtcOccluded8);
width!(16, RTCRay16, RTCHit16, RTCRayHit16, rtcIntersect16, rtcOccluded16);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_lanes_are_valid() {
        assert_eq!(Valid::<4>::first(0).0, [0; 4]);
        assert_eq!(Valid::<4>::first(3).0, [-1, -1, -1, 0]);
        assert_eq!(Valid::<4>::first(4).0, Valid::<4>::ALL.0);
        assert_eq!(Valid::<4>::first(9).0, Valid::<4>::ALL.0);
    }
}
