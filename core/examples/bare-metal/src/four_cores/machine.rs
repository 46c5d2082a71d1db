//! The machine: start-up, interrupts, timers, a serial line, and its end. QEMU's `virt`, from its
//! memory map: a CLINT (timers and interrupts between cores), a 16550 UART, and a test device.

use core::arch::{asm, global_asm};
use core::fmt::{Display, Write};

/// Cores at work.
pub(super) const CORES: usize = 4;

/// A word for each core: what is not 0 interrupts it.
const SOFTWARE: *mut u32 = 0x0200_0000 as *mut u32;
/// A double word for each core: the time at which its timer interrupts it.
const TIMER: *mut u64 = 0x0200_4000 as *mut u64;
/// The time, counted at 10 MHz.
const TIME: *const u64 = 0x0200_bff8 as *const u64;
/// Transmit and status registers of the serial line.
const SERIAL: *mut u8 = 0x1000_0000 as *mut u8;
const SERIAL_STATUS: *const u8 = 0x1000_0005 as *const u8;
/// Writing to it ends QEMU.
const TEST: *mut u32 = 0x0010_0000 as *mut u32;

/// Between two interrupts by a core's timer: half a millisecond.
const TICK: u64 = 5_000;

// All cores start here. Core 0 clears .bss; the others wait for its first interrupt between cores
// before they touch any memory but their stacks. Floating point is switched on (mstatus.FS); both
// kinds of interrupt are let through (mie) but not taken yet (mstatus.MIE).
//
// The trap keeps what a called function need not: it may have interrupted anything.
global_asm!(
    ".section .init",
    ".global _start",
    "_start:",
    "csrr a0, mhartid",
    "li t0, {cores}",
    "bgeu a0, t0, 4f",
    "la sp, _stacks",
    "addi t0, a0, 1",
    "slli t0, t0, 16",
    "add sp, sp, t0",
    "la t0, trap",
    "csrw mtvec, t0",
    "li t0, 0x2000",
    "csrs mstatus, t0",
    "csrwi fcsr, 0",
    "li t0, 0x88",
    "csrw mie, t0",
    "bnez a0, 2f",
    "la t0, _bss",
    "la t1, _bss_end",
    "1: bgeu t0, t1, 3f",
    "sd zero, 0(t0)",
    "addi t0, t0, 8",
    "j 1b",
    "2: wfi",
    "csrr t0, mip",
    "andi t0, t0, 8",
    "beqz t0, 2b",
    "3: call {begin}",
    "4: wfi",
    "j 4b",
    ".balign 4",
    "trap:",
    "addi sp, sp, -288",
    ".irp n, 0,1,2,3,4,5,6,7",
    "fsd ft\\n, (\\n * 8)(sp)",
    "fsd fa\\n, (64 + \\n * 8)(sp)",
    "sd a\\n, (128 + \\n * 8)(sp)",
    ".endr",
    ".irp n, 0,1,2,3,4,5,6",
    "sd t\\n, (192 + \\n * 8)(sp)",
    ".endr",
    "sd ra, 248(sp)",
    ".irp n, 8,9,10,11",
    "fsd ft\\n, (192 + \\n * 8)(sp)",
    ".endr",
    "call {interrupt}",
    ".irp n, 0,1,2,3,4,5,6,7",
    "fld ft\\n, (\\n * 8)(sp)",
    "fld fa\\n, (64 + \\n * 8)(sp)",
    "ld a\\n, (128 + \\n * 8)(sp)",
    ".endr",
    ".irp n, 0,1,2,3,4,5,6",
    "ld t\\n, (192 + \\n * 8)(sp)",
    ".endr",
    "ld ra, 248(sp)",
    ".irp n, 8,9,10,11",
    "fld ft\\n, (192 + \\n * 8)(sp)",
    ".endr",
    "addi sp, sp, 288",
    "mret",
    cores = const CORES,
    begin = sym begin,
    interrupt = sym interrupt,
);

extern "C" fn begin() -> ! {
    set_interrupts(true);
    if core_number() == 0 { super::first() } else { super::other() }
}

/// Why a core was interrupted.
pub(super) enum Cause {
    /// Another core wants it to look again.
    OtherCore,
    /// Its timer.
    Timer,
}

extern "C" fn interrupt() {
    let cause: usize;
    // SAFETY: reads a register.
    unsafe { asm!("csrr {}, mcause", out(reg) cause, options(nomem, nostack)) };
    match cause ^ 1 << (usize::BITS - 1) {
        3 => {
            // SAFETY: this core's own word.
            unsafe { SOFTWARE.add(core_number()).write_volatile(0) };
            // Acknowledged before this core looks at what the sender did before it.
            fence();
            super::interrupted(Cause::OtherCore);
        }
        7 => super::interrupted(Cause::Timer),
        _ => exit("a trap that is no interrupt", false),
    }
}

/// Orders memory and devices: all before, then all after.
fn fence() {
    // SAFETY: a fence does nothing else.
    unsafe { asm!("fence iorw, iorw", options(nostack)) };
}

fn set_interrupts(taken: bool) {
    const MIE: usize = 8;
    // SAFETY: the handler leaves everything as it finds it but for the letters that it posts.
    unsafe {
        if taken {
            asm!("csrs mstatus, {}", in(reg) MIE, options(nostack));
        } else {
            asm!("csrc mstatus, {}", in(reg) MIE, options(nostack));
        }
    }
}

/// The number of the core that asks.
pub(super) fn core_number() -> usize {
    let number: usize;
    // SAFETY: reads a register.
    unsafe { asm!("csrr {}, mhartid", out(reg) number, options(nomem, nostack, pure)) };
    number
}

/// Sleeps until an interrupt has been taken, unless `look` says that there is no need. See
/// [`super`] for why none is missed.
pub(super) fn sleep_unless(look: &dyn Fn() -> bool) {
    set_interrupts(false);
    if !look() {
        // SAFETY: ends when an interrupt is pending.
        unsafe { asm!("wfi", options(nostack)) };
    }
    set_interrupts(true);
}

/// Sleeps, from one interrupt to the next, until `look` says so.
pub(super) fn sleep_until(look: &dyn Fn() -> bool) {
    while !look() {
        sleep_unless(look);
    }
}

/// Sleeps, and does nothing but take interrupts.
pub(super) fn sleep_for_ever() -> ! {
    loop {
        sleep_unless(&|| false);
    }
}

/// Interrupts every other core.
pub(super) fn interrupt_others() {
    // Whoever is interrupted finds what was written before.
    fence();
    for other in (0..CORES).filter(|&other| other != core_number()) {
        // SAFETY: that core's word.
        unsafe { SOFTWARE.add(other).write_volatile(1) };
    }
}

/// Lets this core's timer interrupt it once, a tick from now.
pub(super) fn start_timer() {
    // SAFETY: reads the clock and sets this core's own timer.
    unsafe { TIMER.add(core_number()).write_volatile(TIME.read_volatile() + TICK) };
}

/// Keeps this core's timer from interrupting it.
pub(super) fn stop_timer() {
    // SAFETY: sets this core's own timer.
    unsafe { TIMER.add(core_number()).write_volatile(u64::MAX) };
}

struct Console;

impl Write for Console {
    fn write_str(&mut self, text: &str) -> core::fmt::Result {
        const READY: u8 = 1 << 5;
        for byte in text.bytes() {
            // SAFETY: waits for the serial line and gives it a byte.
            unsafe {
                while SERIAL_STATUS.read_volatile() & READY == 0 {}
                SERIAL.write_volatile(byte);
            }
        }
        Ok(())
    }
}

/// Prints `last` and ends the run.
pub(super) fn exit(last: impl Display, success: bool) -> ! {
    const PASS: u32 = 0x5555;
    const FAIL: u32 = 0x1_3333;
    let _ = writeln!(Console, "{last}");
    // SAFETY: ends QEMU.
    unsafe { TEST.write_volatile(if success { PASS } else { FAIL }) };
    sleep_for_ever()
}
