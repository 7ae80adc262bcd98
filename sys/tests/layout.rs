//! Asks a C compiler and rustc the same questions and compares the answers.

use core::mem::{MaybeUninit, align_of, offset_of, size_of};
use embree4_sys as sys;

/// `Type { field, … }`: size and alignment of the type, offset of each field.
macro_rules! same_layout {
    ($($ty:ident { $($field:ident),* })+) => {$(
        same_layout!(@ask $ty, size_of::<sys::$ty>(), "embree4_size_", stringify!($ty));
        same_layout!(@ask $ty, align_of::<sys::$ty>(), "embree4_align_", stringify!($ty));
        $(same_layout!(@ask $ty, offset_of!(sys::$ty, $field), "embree4_offset_", stringify!($ty), "_", stringify!($field));)*
    )+};
    (@ask $ty:ident, $rust:expr, $($name:expr),+) => {{
        unsafe extern "C" {
            #[link_name = concat!($($name),+)]
            safe fn in_c() -> usize;
        }
        assert_eq!($rust, in_c(), concat!($($name),+));
    }};
}

#[test]
fn rust_and_c_agree_on_rays_and_hits_of_every_width() {
    macro_rules! rays {
        ($($ty:ident)+) => { same_layout!($($ty {
            org_x, org_y, org_z, tnear, dir_x, dir_y, dir_z, time, tfar, mask, id, flags
        })+) };
    }
    macro_rules! hits {
        ($($ty:ident)+) => { same_layout!($($ty { Ng_x, Ng_y, Ng_z, u, v, primID, geomID, instID, instPrimID })+) };
    }
    rays!(RTCRay RTCRay4 RTCRay8 RTCRay16);
    hits!(RTCHit RTCHit4 RTCHit8 RTCHit16);
    same_layout!(
        RTCRayHit { ray, hit }
        RTCRayHit4 { ray, hit }
        RTCRayHit8 { ray, hit }
        RTCRayHit16 { ray, hit }
    );
}

#[test]
fn rust_and_c_agree_on_arguments_and_contexts() {
    same_layout!(
        RTCBounds { lower_x, lower_y, lower_z, upper_x, upper_y, upper_z }
        RTCLinearBounds { bounds0, bounds1 }
        RTCRayQueryContext { instID, instPrimID }
        RTCPointQueryContext { }
        RTCIntersectArguments { flags, feature_mask, context, filter, intersect }
        RTCOccludedArguments { flags, feature_mask, context, filter, occluded }
        RTCBoundsFunctionArguments { geometryUserPtr, primID, bounds_o }
        RTCIntersectFunctionNArguments { valid, geometryUserPtr, primID, context, rayhit, N, geomID }
        RTCOccludedFunctionNArguments { valid, geometryUserPtr, primID, context, ray, N, geomID }
        RTCFilterFunctionNArguments { valid, N }
    );
}

#[test]
fn the_shim_gives_the_inline_functions_a_symbol() {
    let mut context = MaybeUninit::<sys::RTCRayQueryContext>::uninit();
    // SAFETY: the function fills the context it is given.
    unsafe { sys::rtcInitRayQueryContext(context.as_mut_ptr()) };
    // SAFETY: filled by the call above.
    let context = unsafe { context.assume_init() };
    assert_eq!(context.instID[0], sys::RTC_INVALID_GEOMETRY_ID);

    let mut args = MaybeUninit::<sys::RTCIntersectArguments>::uninit();
    // SAFETY: the function fills the arguments it is given.
    unsafe { sys::rtcInitIntersectArguments(args.as_mut_ptr()) };
    // SAFETY: filled by the call above.
    let args = unsafe { args.assume_init() };
    assert_eq!(args.flags, sys::RTCRayQueryFlags::RTC_RAY_QUERY_FLAG_INCOHERENT);
    assert_eq!(args.feature_mask, sys::RTCFeatureFlags::RTC_FEATURE_FLAG_ALL);
    assert!(args.context.is_null() && args.filter.is_none() && args.intersect.is_none());
}

#[test]
fn header_compiler_and_loaded_library_are_of_one_release() {
    unsafe extern "C" {
        safe fn embree4_header_version() -> core::ffi::c_uint;
    }
    assert_eq!(embree4_header_version(), sys::RTC_VERSION);
    // SAFETY: a null configuration asks for the defaults.
    let device = unsafe { sys::rtcNewDevice(core::ptr::null()) };
    assert!(!device.is_null());
    // SAFETY: the device is live.
    let found = unsafe { sys::rtcGetDeviceProperty(device, sys::RTCDeviceProperty::RTC_DEVICE_PROPERTY_VERSION) };
    // SAFETY: gives back the one reference; not used after.
    unsafe { sys::rtcReleaseDevice(device) };
    assert_eq!(found, sys::RTC_VERSION as isize);
}
