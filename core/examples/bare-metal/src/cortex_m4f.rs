//! One Cortex-M4F of QEMU's `mps2-an386` machine. The one core is the pipeline's one worker; SysTick
//! interrupts it wherever it is, inside the pipeline's own queues too, and posts letters for
//! all senders in turn. A lock there would never be released: the core has none.

use core::fmt::{Display, Write};
use core::mem::MaybeUninit;
use core::sync::atomic::{AtomicPtr, Ordering};

use cortex_m::peripheral::Peripherals;
use cortex_m::peripheral::syst::SystClkSource;
use cortex_m_rt::{entry, exception};
use cortex_m_semihosting::{debug, hio};
use dualframe_core::pipeline::{Config, Pipeline};
use dualframe_core::storage::Static;

use crate::mail::{Outbox, SENDERS};
use crate::run::{Report, Tables, work};
use crate::ve::{FRAMES, Picture, Room};

/// Clock cycles between two interrupts: half a millisecond at 25 MHz.
const TICK: u32 = 12_500;

static TABLES: Static<Tables> = Static::new(Tables::new());
static PIPELINE: Static<MaybeUninit<Pipeline<'static, Room>>> = Static::new(MaybeUninit::uninit());
/// The pipeline, once it runs; null before.
static RUNNING: AtomicPtr<Pipeline<'static, Room>> = AtomicPtr::new(core::ptr::null_mut());
static OUTBOX: Outbox = Outbox::new();

#[entry]
fn start() -> ! {
    match run() {
        Ok(picture) => {
            let (picture, steps) = picture;
            let report = Report { picture, steps: &[steps] };
            exit(&report, report.is_sound())
        }
        Err(message) => exit(message, false),
    }
}

fn run() -> Result<(Picture, u32), &'static str> {
    let (tables, place) = TABLES.take().zip(PIPELINE.take()).ok_or("memory was taken already")?;
    // One worker with the token sees all work, so that it never waits but for letters.
    let pipeline = Pipeline::new(tables.lend(), Config::default(), dualframe_core::wait::Spin);
    let pipeline = place.write(pipeline.map_err(|_| "memory that does not fit")?);
    pipeline.run(FRAMES).map_err(|_| "frames that still run")?;
    let pipeline = &*pipeline;
    // Release: whoever finds the pipeline finds it built.
    RUNNING.store(core::ptr::from_ref(pipeline).cast_mut(), Ordering::Release);
    let mut timer = Peripherals::take().ok_or("peripherals were taken already")?.SYST;
    timer.set_clock_source(SystClkSource::Core);
    timer.set_reload(TICK - 1);
    timer.clear_current();
    timer.enable_counter();
    timer.enable_interrupt();
    let token = pipeline.token(Picture::EMPTY).map_err(|_| "no token")?;
    let (steps, picture) =
        work(pipeline, Some(token), &OUTBOX, sleep_unless).unwrap_or_else(|fault| exit(fault, false));
    Ok((picture.ok_or("no picture")?, steps))
}

/// Sleeps until an interrupt, unless `look` says that there is no need. One that comes between the
/// look and WFI stays pending, and ends WFI at once.
fn sleep_unless(look: &dyn Fn() -> bool) {
    cortex_m::interrupt::free(|_| {
        if !look() {
            cortex_m::asm::wfi();
        }
    });
}

#[exception]
fn SysTick() {
    // Acquire: pairs with the Release in `run`.
    let pipeline = RUNNING.load(Ordering::Acquire);
    // SAFETY: `run` stores a reference that is never used exclusively again.
    if let Some(pipeline) = unsafe { pipeline.as_ref() } {
        (0..SENDERS).for_each(|sender| OUTBOX.post_due(sender, pipeline));
    }
}

/// Prints `last` and ends the run.
fn exit(last: impl Display, success: bool) -> ! {
    if let Ok(mut console) = hio::hstdout() {
        let _ = writeln!(console, "{last}");
    }
    debug::exit(if success { debug::EXIT_SUCCESS } else { debug::EXIT_FAILURE });
    loop {
        cortex_m::asm::wfi();
    }
}

#[panic_handler]
fn panic(info: &core::panic::PanicInfo<'_>) -> ! {
    exit(info, false)
}
