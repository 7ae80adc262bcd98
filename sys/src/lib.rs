//! Raw bindings to the Embree 4 that is installed on this machine. Nothing in here is safe; the safe wrapper is
//! `tison::embree`.
//!
//! * Made from the *installed* headers at build time. A copy of the headers would go out of step with the library:
//!   `RTCRayHit` has 80 bytes in 4.2 and 96 from 4.3 on, and a library that writes the longer one into the shorter
//!   overwrites what lies behind it.
//! * Needs Embree 4.3 or later and libclang, and a C compiler for the functions that the header defines inline;
//!   `sys/setup.sh` installs all three. Embree is looked for in `EMBREE_DIR` (a prefix with `include/embree4` and
//!   `lib`), then by pkg-config, then where compilers look.
//! * Enums are newtypes and flags are bit fields, never Rust `enum`s: C may hand over a value the header does not list.
//! * No struct has a `Default`: an all-zero [`RTCHit`] claims a hit on geometry 0.
//! * The inline `rtcInit*` functions are bound; `rtcInterpolate0/1/2`, `rtcDefaultBuildArguments` and those for
//!   quaternions are not.
//! * Dependents get `DEP_EMBREE4_VERSION` (of the header, as `4.3.3`) and, when Embree is not where the linker looks,
//!   `DEP_EMBREE4_LIB_DIR`.
//!
//! `cargo test -p embree4-sys` asks a C compiler and rustc for the layout of every struct that crosses.
#![no_std]
#![allow(non_camel_case_types, non_snake_case, non_upper_case_globals)]

include!(concat!(env!("OUT_DIR"), "/bindings.rs"));

/// "No geometry": what `geomID` holds after a miss. In the header it is a cast, which bindgen cannot evaluate.
pub const RTC_INVALID_GEOMETRY_ID: core::ffi::c_uint = core::ffi::c_uint::MAX;
