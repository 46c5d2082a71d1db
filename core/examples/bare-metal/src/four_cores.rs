//! Four RISC-V cores of QEMU's `virt` machine, without anything below. Each core's timer interrupts it
//! wherever it is, inside the pipeline's own queues too, and its handler posts letters; idle
//! cores sleep in WFI and are woken by interrupts from the others.
//!
//! # Why no wake-up is lost
//!
//! WFI ends when an interrupt is pending, whether or not interrupts may be taken. A core that is
//! about to sleep (`sleep_unless`) first forbids them, then looks at the bell, then executes WFI:
//! what comes after the look stays pending, and WFI ends at once. What came before the look was
//! taken, and acknowledged, before it; whoever sent it had moved the bell's epoch first. Both sides
//! fence between memory and the interrupt controller (`wake`, `interrupt`), so that the look sees
//! that epoch. Interrupts from several cores may merge into one; every sleeper that it reaches looks again.
//!
//! When all letters are posted the timers are off: from then on only another core ends a sleep, and
//! a lost wake-up would hang the run.

mod machine;

use core::mem::MaybeUninit;
use core::sync::atomic::{AtomicPtr, AtomicU32, Ordering};

use dualframe_core::pipeline::{Config, Pipeline};
use dualframe_core::storage::Static;
use dualframe_core::token::Token;
use dualframe_core::wait::{Bell, Epoch, Waiting};

use self::machine::{CORES, Cause, core_number, exit};
use crate::mail::Outbox;
use crate::run::{Report, Tables, work};
use crate::ve::{FRAMES, Picture, Room};

type Shared = Pipeline<'static, Room, Interrupts>;

static TABLES: Static<Tables> = Static::new(Tables::new());
static PIPELINE: Static<MaybeUninit<Shared>> = Static::new(MaybeUninit::uninit());
/// The pipeline, once it runs; null before.
static RUNNING: AtomicPtr<Shared> = AtomicPtr::new(core::ptr::null_mut());
static OUTBOX: Outbox = Outbox::new();
/// Steps of each core, once it is done; then counted in `DONE`.
static STEPS: [AtomicU32; CORES] = [const { AtomicU32::new(0) }; CORES];
static DONE: AtomicU32 = AtomicU32::new(0);

/// Sleeps in WFI, wakes by interrupts between cores.
struct Interrupts;

impl Waiting for Interrupts {
    fn sleep(&self, bell: &Bell, seen: Epoch) {
        while !bell.rung_since(seen) {
            machine::sleep_unless(&|| bell.rung_since(seen));
        }
    }

    /// Wakes every other core: who sleeps is not known, and who listens to the other bell looks and
    /// sleeps on.
    fn wake(&self, _: &Bell, _: u32) {
        machine::interrupt_others();
    }
}

/// The pipeline, if it runs.
fn running() -> Option<&'static Shared> {
    // Acquire: pairs with the Release in `first`.
    let pipeline = RUNNING.load(Ordering::Acquire);
    // SAFETY: `first` stores a reference that is never used exclusively again.
    unsafe { pipeline.as_ref() }
}

/// Core 0: builds the pipeline, calls the others, renders.
fn first() -> ! {
    let Some((tables, place)) = TABLES.take().zip(PIPELINE.take()) else {
        exit("memory was taken already", false);
    };
    let pipeline = match Pipeline::new(tables.lend(), Config::default(), Interrupts) {
        Ok(pipeline) => place.write(pipeline),
        Err(error) => exit(error, false),
    };
    if let Err(error) = pipeline.run(FRAMES) {
        exit(error, false);
    }
    let pipeline = &*pipeline;
    // Release: whoever finds the pipeline finds it built.
    RUNNING.store(core::ptr::from_ref(pipeline).cast_mut(), Ordering::Release);
    machine::interrupt_others();
    let Ok(token) = pipeline.token(Picture::EMPTY) else { exit("no token", false) };
    let picture = take_part(pipeline, Some(token));
    // Acquire: pairs with the Release in `take_part`.
    machine::sleep_until(&|| DONE.load(Ordering::Acquire) == CORES as u32);
    let steps = STEPS.each_ref().map(|steps| steps.load(Ordering::Relaxed));
    let report = Report { picture: picture.unwrap_or(Picture::EMPTY), steps: &steps };
    exit(&report, report.is_sound())
}

/// Every other core: waits to be called, then works.
fn other() -> ! {
    machine::sleep_until(&|| running().is_some());
    if let Some(pipeline) = running() {
        take_part(pipeline, None);
    }
    machine::sleep_until(&|| false);
    unreachable!("a condition that never holds")
}

/// What every core does until all frames are swapped.
fn take_part(pipeline: &Shared, token: Option<Token<'_, Picture>>) -> Option<Picture> {
    machine::start_timer();
    match work(pipeline, token, &OUTBOX, machine::sleep_unless) {
        Ok((steps, picture)) => {
            STEPS[core_number()].store(steps, Ordering::Relaxed);
            // Release: publishes the steps to core 0.
            DONE.fetch_add(1, Ordering::Release);
            machine::interrupt_others();
            picture
        }
        Err(fault) => exit(fault, false),
    }
}

/// What an interrupt does on the core that takes it.
fn interrupted(cause: Cause) {
    match cause {
        // It has ended a sleep, if there was one.
        Cause::OtherCore => {}
        Cause::Timer => {
            if let Some(pipeline) = running() {
                OUTBOX.post_due(core_number(), pipeline);
            }
            if OUTBOX.is_done() {
                machine::stop_timer();
            } else {
                machine::start_timer();
            }
        }
    }
}

/// Prints what it is given and ends the run.
#[panic_handler]
fn panic(info: &core::panic::PanicInfo<'_>) -> ! {
    exit(info, false)
}
