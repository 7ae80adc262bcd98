//! What can go wrong before the first ray. Queries do not fail.

use embree4_sys::RTCError;

/// Why Embree gave no device or no scene.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The build would take more memory than [`DeviceConfig::memory_limit`](super::DeviceConfig::memory_limit) allows.
    #[error(
        "Embree needs at least {needed} bytes, but may use only {limit}: \
             raise the memory limit, or build compact or in lower quality"
    )]
    OverBudget {
        /// Bytes that would have been held at once when the limit stopped the build; it may need more.
        needed: u64,
        /// Bytes allowed.
        limit: u64,
    },
    /// The system has no memory left.
    #[error("no memory left for Embree, which holds {held} bytes: build compact or in lower quality")]
    OutOfMemory {
        /// Bytes that Embree holds.
        held: u64,
    },
    /// The progress callback said stop.
    #[error("the build was cancelled")]
    Cancelled,
    /// The library that was loaded is not the one this program was built for.
    #[error(
        "built against Embree {built}, but the library loaded at run time is {found}: \
             rebuild, or run with --backend native"
    )]
    Version {
        /// Release of the headers.
        built: String,
        /// Release of the library.
        found: String,
    },
    /// A name in the [`DeviceConfig`](super::DeviceConfig) that no instruction set has.
    #[error("'{isa}' is no instruction set: Embree has sse2, sse4.2, avx, avx2 and avx512")]
    Isa {
        /// As given.
        isa: String,
    },
    /// More items than 32-bit ids can name.
    #[error("{count} {what} are more than one geometry can have (4294967294): split them up")]
    TooMany {
        /// Of what.
        what: &'static str,
        /// How many there are.
        count: usize,
    },
    /// A transform that single precision cannot undo.
    #[error(
        "the transform of an instance cannot be undone in single precision, in which Embree works: give every axis \
         a direction of its own and a scale between 1e-12 and 1e12"
    )]
    Transform,
    /// What was to be placed is not a scene of one mesh.
    #[error("a scene that is placed in another must hold one mesh and nothing else")]
    NotOneMesh,
    /// What was to be placed belongs to another device.
    #[error("a scene can only be placed in another of the same device: build both on one")]
    OtherDevice,
    /// Embree refused a call.
    #[error("Embree could not {doing}: {code}{}{message}", if message.is_empty() { "" } else { ": " })]
    Call {
        /// What was tried, as a verb and its object.
        doing: &'static str,
        /// Kind of the refusal.
        code: &'static str,
        /// Embree's own words; may be empty.
        message: String,
    },
}

/// In words what `rtcGetErrorString`, which came with Embree 4.3.3 only, would say.
pub(super) fn name(code: RTCError) -> &'static str {
    match code {
        RTCError::RTC_ERROR_INVALID_ARGUMENT => "invalid argument",
        RTCError::RTC_ERROR_INVALID_OPERATION => "invalid operation",
        RTCError::RTC_ERROR_OUT_OF_MEMORY => "out of memory",
        RTCError::RTC_ERROR_UNSUPPORTED_CPU => "the processor is not supported",
        RTCError::RTC_ERROR_CANCELLED => "cancelled",
        _ => "unknown error",
    }
}
