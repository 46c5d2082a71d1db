//! Asking for what is soon read or written, so that it comes from memory, or another core's cache, while something else
//! is computed.

use super::Simd;

/// The bytes of a cache line; usually 64.
#[cfg(target_arch = "x86_64")]
const LINE: usize = 64;
/// The most bytes that are asked for at once; usually 4,096: what follows longer lists' begin machines fetch by
/// themselves.
#[cfg(target_arch = "x86_64")]
const MOST: usize = 4_096;

/// Asks for a value that is soon read, or for its begin. Nothing happens on others than x86-64.
#[inline(always)]
pub(crate) fn prefetch<T: ?Sized>(value: &T) {
    #[cfg(target_arch = "x86_64")]
    {
        use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};

        // SAFETY: a hint reads nothing, and no address is a wrong one.
        for_each_line(value, |line| unsafe { _mm_prefetch::<_MM_HINT_T0>(line) });
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = value;
}

/// Asks for a value that is soon written, or for its begin: what another core has read since it was last written here is
/// then taken from it before, not while, it is written. Without AVX2 it is asked for as if to be read, for such a machine
/// may not know the instruction; of those with AVX2 Haswell ignores it.
#[inline(always)]
pub(crate) fn prefetch_to_write<T: ?Sized>(simd: Simd, value: &T) {
    #[cfg(target_arch = "x86_64")]
    if !matches!(simd.0, super::Kind::Scalar) {
        use std::arch::asm;

        // The intrinsic for it becomes that of a read where the compiler is not told of the instruction, and it can be
        // told by nightly compilers only.
        // SAFETY: as for a read; whoever has AVX2 decodes it.
        for_each_line(value, |line| unsafe {
            asm!("prefetchw [{}]", in(reg) line, options(nostack, preserves_flags, readonly));
        });
        return;
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = simd;
    prefetch(value);
}

#[cfg(target_arch = "x86_64")]
#[inline(always)]
fn for_each_line<T: ?Sized>(value: &T, ask: impl Fn(*const i8)) {
    let start = std::ptr::from_ref(value).cast::<i8>();
    for offset in (0..size_of_val(value).min(MOST)).step_by(LINE) {
        ask(start.wrapping_add(offset));
    }
}
