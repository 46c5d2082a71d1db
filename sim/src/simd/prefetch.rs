//! Asking for what is soon read, so that it comes from memory while something else is computed.

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

        let start = std::ptr::from_ref(value).cast::<i8>();
        for offset in (0..size_of_val(value).min(MOST)).step_by(LINE) {
            let line = start.wrapping_add(offset);
            // SAFETY: a hint reads nothing, and no address is a wrong one.
            unsafe { _mm_prefetch::<_MM_HINT_T0>(line) };
        }
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = value;
}
