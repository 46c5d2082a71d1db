//! What a program without start files and without any library has to bring.

use core::alloc::{GlobalAlloc, Layout};
use core::arch::global_asm;
use core::panic::PanicInfo;

// The kernel enters with the arguments on the stack, aligned to 16 bytes; `call` keeps what the ABI
// wants. The four functions are those that compiled code may call on any target.
global_asm!(
    ".global _start",
    "_start: call {main}",
    "mov edi, eax",
    "mov eax, 60",
    "syscall",
    ".global memcpy",
    "memcpy: mov rax, rdi",
    "mov rcx, rdx",
    "rep movsb",
    "ret",
    ".global memset",
    "memset: mov r8, rdi",
    "mov eax, esi",
    "mov rcx, rdx",
    "rep stosb",
    "mov rax, r8",
    "ret",
    main = sym main,
);

/// The exit status: 0 if all went as it should.
extern "C" fn main() -> i32 {
    i32::from(!crate::all())
}

unsafe extern "C" {
    /// Defined nowhere: what can panic does not link.
    fn dualframe_can_panic() -> !;
    /// Defined nowhere: what can allocate does not link.
    fn dualframe_can_allocate() -> *mut u8;
}

#[panic_handler]
fn panic(_: &PanicInfo<'_>) -> ! {
    // SAFETY: never linked.
    unsafe { dualframe_can_panic() }
}

struct Nothing;

#[global_allocator]
static NOTHING: Nothing = Nothing;

// SAFETY: never linked.
unsafe impl GlobalAlloc for Nothing {
    unsafe fn alloc(&self, _: Layout) -> *mut u8 {
        // SAFETY: never linked.
        unsafe { dualframe_can_allocate() }
    }

    unsafe fn dealloc(&self, _: *mut u8, _: Layout) {
        // SAFETY: never linked.
        unsafe { dualframe_can_allocate() };
    }
}
