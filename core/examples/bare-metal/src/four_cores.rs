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
//! a core that nobody wakes would hang the run. (A run seldom meets the gap between look and WFI: the
//! argument above is what says that it is closed.)

mod machine;

use core::sync::atomic::{AtomicU32, Ordering};

use dualframe_core::wait::{Bell, Epoch, Waiting};

use self::machine::{CORES, Cause, core_number, exit, interrupt_others, sleep_unless, sleep_until};
use crate::bare::{Place, is_good};
use crate::mail::Outbox;
use crate::run::{Report, work};
use crate::ve::{Fault, Picture};

static PLACE: Place<Interrupts> = Place::new();
static OUTBOX: Outbox = Outbox::new();
/// Steps of each core, once it is done; then counted in `DONE`.
static STEPS: [AtomicU32; CORES] = [const { AtomicU32::new(0) }; CORES];
static DONE: AtomicU32 = AtomicU32::new(0);
/// Cores that are ready to work.
static READY: AtomicU32 = AtomicU32::new(0);

/// Sleeps in WFI, wakes by interrupts between cores.
struct Interrupts;

impl Waiting for Interrupts {
    fn sleep(&self, bell: &Bell, seen: Epoch) {
        sleep_until(&|| bell.rung_since(seen));
    }

    /// Wakes every other core: who sleeps is not known, and who listens to the other bell looks and
    /// sleeps on.
    fn wake(&self, _: &Bell, _: u32) {
        interrupt_others();
    }
}

/// Core 0: builds the pipeline, calls the others, renders, reports.
fn first() -> ! {
    match lead() {
        Ok(picture) => {
            let steps = STEPS.each_ref().map(|steps| steps.load(Ordering::Relaxed));
            let report = Report { picture, steps: &steps };
            exit(&report, is_good(&report))
        }
        Err(fault) => exit(fault, false),
    }
}

fn lead() -> Result<Picture, Fault> {
    let pipeline = PLACE.start(Interrupts)?;
    interrupt_others();
    // Relaxed: nothing but the number is read.
    sleep_until(&|| READY.load(Ordering::Relaxed) == CORES as u32 - 1);
    let token = pipeline.token(Picture::EMPTY).map_err(|(_, full)| full)?;
    machine::start_timer();
    let (steps, picture) = work(pipeline, Some(token), &OUTBOX, sleep_unless)?;
    done(steps);
    // Acquire: pairs with the Release in `done`.
    sleep_until(&|| DONE.load(Ordering::Acquire) == CORES as u32);
    Ok(picture.unwrap_or(Picture::EMPTY))
}

/// Every other core: waits to be called, works.
fn other() -> ! {
    sleep_until(&|| PLACE.running().is_some());
    // Relaxed: as in `lead`.
    READY.fetch_add(1, Ordering::Relaxed);
    interrupt_others();
    machine::start_timer();
    match PLACE.running().map(|pipeline| work(pipeline, None, &OUTBOX, sleep_unless)) {
        Some(Err(fault)) => exit(fault, false),
        Some(Ok((steps, _))) => done(steps),
        None => {}
    }
    machine::sleep_for_ever()
}

/// Says that this core has left.
fn done(steps: u32) {
    STEPS[core_number()].store(steps, Ordering::Relaxed);
    // Release: publishes the steps to core 0.
    DONE.fetch_add(1, Ordering::Release);
    interrupt_others();
}

/// What an interrupt does on the core that takes it.
fn interrupted(cause: Cause) {
    match cause {
        // It has ended a sleep, if there was one.
        Cause::OtherCore => {}
        Cause::Timer => {
            if let Some(pipeline) = PLACE.running() {
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

#[panic_handler]
fn panic(info: &core::panic::PanicInfo<'_>) -> ! {
    exit(info, false)
}
