//! A handle of the library.

use super::Error;
use super::error::name;
use embree4_sys as sys;
use std::cell::RefCell;
use std::ffi::{CStr, CString, c_char, c_void};
use std::fmt;
use std::ptr::{self, NonNull};
use std::sync::Arc;
use std::sync::atomic::{AtomicI64, Ordering::Relaxed};

/// How a [`Device`] is to work. The default is all processors, no limit, and the best instruction set.
#[derive(Clone, Debug, Default)]
pub struct DeviceConfig<'a> {
    /// Threads that build; 0 means one per processor. Rays are answered on the caller's own threads.
    pub threads: usize,
    /// Bytes that Embree may hold, all scenes of the device together; `None` means no limit.
    /// Meshes are ours and shared, so they do not count.
    pub memory_limit: Option<u64>,
    /// Highest instruction set to use: `sse2`, `sse4.2`, `avx`, `avx2` or `avx512`.
    pub isa: Option<&'a str>,
}

/// A live Embree device; clones share it.
///
/// Scenes hold a clone, so that the device and what its callbacks write to outlive every scene, in whatever order
/// they are dropped.
#[derive(Clone)]
pub struct Device(Arc<Owner>);

struct Owner {
    raw: NonNull<sys::RTCDeviceTy>,
    memory: Arc<Memory>,
    version: u32,
    width: usize,
}

// SAFETY: Embree's calls on a device are thread-safe, `raw` is never handed out, and what the callbacks write is
// atomic or belongs to one thread.
unsafe impl Send for Owner {}
// SAFETY: as above; nothing of ours changes behind a shared reference but atomics.
unsafe impl Sync for Owner {}

/// What the memory monitor counts, in bytes, called from several threads at once.
struct Memory {
    limit: i64,
    live: AtomicI64,
    peak: AtomicI64,
    /// Bytes that would have been held at the last refusal; 0 when there was none since it was last asked for.
    refused: AtomicI64,
}

thread_local! {
    /// First message since the last [`Device::check`] of this thread. Embree reports an error on the thread whose
    /// call failed, so threads that build on one device cannot take each other's.
    static MESSAGE: RefCell<Option<String>> = const { RefCell::new(None) };
}

impl Device {
    /// Opens the library.
    ///
    /// # Errors
    /// [`Error::Version`] when the loaded library is not of the release of the headers, [`Error::Isa`] for a name
    /// that is none, [`Error::Call`] when Embree does not start, for instance because the processor lacks the
    /// instruction set.
    pub fn new(config: &DeviceConfig) -> Result<Self, Error> {
        let text = config_text(config)?;
        // SAFETY: `text` ends in NUL and outlives the call.
        let raw = unsafe { sys::rtcNewDevice(text.as_ptr()) };
        let raw = NonNull::new(raw).ok_or_else(not_opened)?;
        let limit = config.memory_limit.and_then(|bytes| i64::try_from(bytes).ok()).unwrap_or(i64::MAX);
        let memory = Memory { limit, live: 0.into(), peak: 0.into(), refused: 0.into() };
        let mut owner = Owner { raw, memory: Arc::new(memory), version: 0, width: 1 };

        owner.version = owner.property(sys::RTCDeviceProperty::RTC_DEVICE_PROPERTY_VERSION) as u32;
        if owner.version / 100 != sys::RTC_VERSION / 100 {
            return Err(Error::Version { built: release(sys::RTC_VERSION), found: release(owner.version) });
        }
        let native = [
            (16, sys::RTCDeviceProperty::RTC_DEVICE_PROPERTY_NATIVE_RAY16_SUPPORTED),
            (8, sys::RTCDeviceProperty::RTC_DEVICE_PROPERTY_NATIVE_RAY8_SUPPORTED),
            (4, sys::RTCDeviceProperty::RTC_DEVICE_PROPERTY_NATIVE_RAY4_SUPPORTED),
        ];
        owner.width = native.into_iter().find(|&(_, has)| owner.property(has) != 0).map_or(1, |(width, _)| width);

        // SAFETY: the device is live; the callback needs no data.
        unsafe { sys::rtcSetDeviceErrorFunction(raw.as_ptr(), Some(on_error), ptr::null_mut()) };
        let memory = Arc::as_ptr(&owner.memory).cast_mut().cast::<c_void>();
        // SAFETY: `memory` lives as long as `owner`, which unhooks the callback before it goes.
        unsafe { sys::rtcSetDeviceMemoryMonitorFunction(raw.as_ptr(), Some(on_memory), memory) };
        Ok(Self(Arc::new(owner)))
    }

    /// Release of the loaded library, for instance `4.3.3`.
    #[must_use]
    pub fn version(&self) -> String {
        release(self.0.version)
    }

    /// Widest packet that this processor traces as one: 16, 8, 4, or 1 when it has none.
    #[must_use]
    pub fn packet_width(&self) -> usize {
        self.0.width
    }

    /// Bytes that Embree holds now.
    #[must_use]
    pub fn memory_live(&self) -> u64 {
        self.0.memory.live.load(Relaxed).max(0) as u64
    }

    /// Most bytes that Embree ever held at once.
    #[must_use]
    pub fn memory_peak(&self) -> u64 {
        self.0.memory.peak.load(Relaxed).max(0) as u64
    }

    /// Whether both are clones of one.
    pub(super) fn is_same(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
    }

    pub(super) fn raw(&self) -> sys::RTCDevice {
        self.0.raw.as_ptr()
    }

    /// `Ok` unless a call of this thread failed since the last check.
    pub(super) fn check(&self, doing: &'static str) -> Result<(), Error> {
        // SAFETY: the device is live.
        let code = unsafe { sys::rtcGetDeviceError(self.raw()) };
        let message = MESSAGE.take();
        match code {
            sys::RTCError::RTC_ERROR_NONE => Ok(()),
            sys::RTCError::RTC_ERROR_OUT_OF_MEMORY => Err(match self.0.memory.refused.swap(0, Relaxed) {
                0 => Error::OutOfMemory { held: self.memory_live() },
                needed => Error::OverBudget { needed: needed as u64, limit: self.0.memory.limit as u64 },
            }),
            _ => Err(Error::Call { doing, code: name(code), message: message.unwrap_or_default() }),
        }
    }
}

impl fmt::Debug for Device {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.debug_struct("Device")
            .field("version", &self.version())
            .field("packet_width", &self.packet_width())
            .field("memory_live", &self.memory_live())
            .finish_non_exhaustive()
    }
}

impl Owner {
    fn property(&self, property: sys::RTCDeviceProperty) -> isize {
        // SAFETY: the device is live.
        unsafe { sys::rtcGetDeviceProperty(self.raw.as_ptr(), property) }
    }
}

impl Drop for Owner {
    fn drop(&mut self) {
        // SAFETY: the device is live, and no build is running: each scene holds a clone of us.
        unsafe { sys::rtcSetDeviceErrorFunction(self.raw.as_ptr(), None, ptr::null_mut()) };
        // SAFETY: as above.
        unsafe { sys::rtcSetDeviceMemoryMonitorFunction(self.raw.as_ptr(), None, ptr::null_mut()) };
        // SAFETY: gives back the one reference that `rtcNewDevice` gave us.
        unsafe { sys::rtcReleaseDevice(self.raw.as_ptr()) };
    }
}

/// Embree's own form of the configuration.
fn config_text(config: &DeviceConfig) -> Result<CString, Error> {
    let mut text = String::new();
    if config.threads > 0 {
        text += &format!("threads={}", config.threads);
    }
    if let Some(isa) = config.isa {
        // Embree takes an unknown name for the lowest instruction set, without a word.
        if !["sse2", "sse4.2", "avx", "avx2", "avx512"].contains(&isa) {
            return Err(Error::Isa { isa: isa.to_owned() });
        }
        let comma = if text.is_empty() { "" } else { "," };
        text += &format!("{comma}isa={isa}");
    }
    Ok(CString::new(text).expect("digits and names from a list hold no NUL"))
}

fn not_opened() -> Error {
    // SAFETY: a null device asks for the error of this thread's failed `rtcNewDevice`.
    let code = unsafe { sys::rtcGetDeviceError(ptr::null_mut()) };
    // SAFETY: takes nothing; the answer is null or a string that lives until this thread's next call.
    let message = unsafe { sys::embree4_new_device_error() };
    // SAFETY: as above.
    Error::Call { doing: "open a device", code: name(code), message: unsafe { owned(message) } }
}

fn release(version: u32) -> String {
    format!("{}.{}.{}", version / 10000, version / 100 % 100, version % 100)
}

/// # Safety
/// `text` must be null or a C string.
unsafe fn owned(text: *const c_char) -> String {
    if text.is_null() {
        return String::new();
    }
    // SAFETY: the caller's promise.
    unsafe { CStr::from_ptr(text) }.to_string_lossy().into_owned()
}

/// Keeps the first message; later ones are its echoes. Must not panic.
unsafe extern "C" fn on_error(_user: *mut c_void, _code: sys::RTCError, text: *const c_char) {
    // SAFETY: Embree passes a C string or null, valid for this call.
    let text = unsafe { owned(text) };
    // Neither access can fail: a thread that is ending calls no builder, and `check` holds no borrow.
    let _ = MESSAGE.try_with(|slot| slot.try_borrow_mut().map(|mut slot| slot.get_or_insert(text).len()));
}

/// Counts; `false` to what is not yet allocated stops the build.
unsafe extern "C" fn on_memory(user: *mut c_void, bytes: isize, allocated: bool) -> bool {
    // SAFETY: the `Memory` given with this callback, alive until the device is released.
    let memory = unsafe { &*user.cast::<Memory>() };
    let bytes = bytes as i64;
    let now = memory.live.fetch_add(bytes, Relaxed) + bytes;
    if bytes <= 0 || allocated || now <= memory.limit {
        memory.peak.fetch_max(now, Relaxed);
        return true;
    }
    // Embree never calls back for memory that it did not get: undo our own count.
    memory.live.fetch_sub(bytes, Relaxed);
    memory.refused.store(now, Relaxed);
    false
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn configurations_in_embrees_own_form() {
        let text = |threads, isa| config_text(&DeviceConfig { threads, isa, ..Default::default() });
        assert_eq!(text(0, None).unwrap().as_c_str(), c"");
        assert_eq!(text(2, None).unwrap().as_c_str(), c"threads=2");
        assert_eq!(text(0, Some("avx2")).unwrap().as_c_str(), c"isa=avx2");
        assert_eq!(text(3, Some("sse4.2")).unwrap().as_c_str(), c"threads=3,isa=sse4.2");
        for isa in ["", "avx3", "avx2,threads=9", "sse2\0"] {
            assert!(matches!(text(1, Some(isa)), Err(Error::Isa { .. })), "{isa:?}");
        }
    }

    #[test]
    fn releases_are_written_as_people_do() {
        assert_eq!(release(40303), "4.3.3");
        assert_eq!(release(41012), "4.10.12");
    }

    #[test]
    fn a_refused_allocation_is_remembered_and_not_counted() {
        let memory = Memory { limit: 100, live: 0.into(), peak: 0.into(), refused: 0.into() };
        let user = (&raw const memory).cast_mut().cast::<c_void>();
        let ask = |bytes, allocated| {
            // SAFETY: `user` is a live `Memory`.
            unsafe { on_memory(user, bytes, allocated) }
        };
        let state = || [&memory.live, &memory.peak, &memory.refused].map(|n| n.load(Relaxed));
        assert!(ask(80, false));
        assert!(!ask(30, false));
        assert_eq!(state(), [80, 80, 110]);
        assert!(ask(-50, true));
        assert!(ask(70, false));
        assert_eq!(state(), [100, 100, 110]);
        assert!(ask(5, true), "what is allocated already is counted, whatever the limit");
        assert_eq!(state(), [105, 105, 110]);
    }
}
