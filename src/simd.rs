//! Runs a loop with the widest vectors that the processor has.
//!
//! One portable binary holds each kernel three times (x86-64 baseline, AVX2, AVX-512) and
//! picks at run time. The copies answer bit for bit alike: Rust never fuses a product and
//! a sum by itself, and the kernels do not ask for it.

/// Code worth compiling once per [`Level`].
pub trait Kernel {
    /// What it computes.
    type Output;

    /// Computes it. Mark the implementation and all it calls `#[inline(always)]`: only what is
    /// inlined is compiled anew for each level.
    fn run(self) -> Self::Output;
}

/// Instructions that a kernel may use.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Level {
    /// What every processor of the target has.
    Baseline,
    /// 256-bit vectors.
    Avx2,
    /// 512-bit vectors and masks.
    Avx512,
}

impl Level {
    /// All of them, best first.
    pub const ALL: [Self; 3] = [Self::Avx512, Self::Avx2, Self::Baseline];

    /// Whether this processor has it.
    #[inline]
    #[must_use]
    pub fn is_available(self) -> bool {
        match self {
            Self::Baseline => true,
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => is_x86_feature_detected!("avx2"),
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => {
                is_x86_feature_detected!("avx512f")
                    && is_x86_feature_detected!("avx512dq")
                    && is_x86_feature_detected!("avx512vl")
            }
            #[cfg(not(target_arch = "x86_64"))]
            _ => false,
        }
    }
}

/// Runs `kernel` with the best instructions of this processor.
#[inline]
pub fn run<K: Kernel>(kernel: K) -> K::Output {
    run_at(Level::Avx512, kernel)
}

/// Runs `kernel` with the best instructions of this processor up to `limit`.
#[inline]
pub fn run_at<K: Kernel>(limit: Level, kernel: K) -> K::Output {
    #[cfg(target_arch = "x86_64")]
    {
        if limit == Level::Avx512 && Level::Avx512.is_available() {
            // SAFETY: the processor has the features that the function is compiled for.
            return unsafe { run_avx512(kernel) };
        }
        if limit != Level::Baseline && Level::Avx2.is_available() {
            // SAFETY: as above.
            return unsafe { run_avx2(kernel) };
        }
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = limit;
    kernel.run()
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn run_avx2<K: Kernel>(kernel: K) -> K::Output {
    kernel.run()
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512dq,avx512vl")]
fn run_avx512<K: Kernel>(kernel: K) -> K::Output {
    kernel.run()
}
