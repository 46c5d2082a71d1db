//! One Cortex-M4F of QEMU's `mps2-an386` machine. The one core is the pipeline's one worker; SysTick
//! interrupts it wherever it is, inside the pipeline's own queues too, and posts letters for
//! all senders in turn. A lock there would never be released; the core has none.

use core::fmt::{Display, Write};

use cortex_m::peripheral::SYST;
use cortex_m::peripheral::syst::SystClkSource;
use cortex_m_rt::{entry, exception};
use cortex_m_semihosting::{debug, hio};
use dualframe_core::wait::Spin;

use crate::bare::{Place, is_good};
use crate::mail::{Outbox, SENDERS};
use crate::run::{Report, work};
use crate::ve::{Fault, Picture};

/// Clock cycles between two interrupts: half a millisecond at 25 MHz.
const TICK: u32 = 12_500;

/// One worker that holds the token sees all work: it never waits for another.
static PLACE: Place<Spin> = Place::new();
static OUTBOX: Outbox = Outbox::new();

#[entry]
fn start() -> ! {
    match run() {
        Ok((steps, picture)) => {
            let report = Report { picture, steps: &[steps] };
            exit(&report, is_good(&report))
        }
        Err(fault) => exit(fault, false),
    }
}

fn run() -> Result<(u32, Picture), Fault> {
    let pipeline = PLACE.start(Spin)?;
    let token = pipeline.token(Picture::EMPTY).map_err(|(_, full)| full)?;
    let mut timer = cortex_m::Peripherals::take().ok_or(Fault::Started)?.SYST;
    start_timer(&mut timer);
    let (steps, picture) = work(pipeline, Some(token), &OUTBOX, sleep_unless)?;
    Ok((steps, picture.unwrap_or(Picture::EMPTY)))
}

fn start_timer(timer: &mut SYST) {
    timer.set_clock_source(SystClkSource::Core);
    timer.set_reload(TICK - 1);
    timer.clear_current();
    timer.enable_interrupt();
    timer.enable_counter();
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
    if let Some(pipeline) = PLACE.running() {
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
