//! The host: the VE serially, without the pipeline, and by 1, 2 and 4 threads of it, with letters
//! from threads in the place of interrupt handlers.

use std::process::{ExitCode, exit};
use std::sync::{Condvar, Mutex, PoisonError};
use std::thread;
use std::time::Duration;

use dualframe_core::inbox::From as Sender;
use dualframe_core::pipeline::{Config, Pipeline};
use dualframe_core::unit::UnitId;
use dualframe_core::wait::{Bell, Epoch, Waiting};

use crate::mail::{LETTERS, Outbox, SENDERS, letter};
use crate::run::{Report, Tables, work};
use crate::ve::{DISCS, Disc, FRAMES, Fault, Picture};

/// Between two looks of a thread that plays an interrupt handler.
const TICK: Duration = Duration::from_micros(100);

pub(crate) fn main() -> ExitCode {
    match all() {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(fault) => failed(fault),
    }
}

/// Says what went wrong and ends the program: other threads would wait for one that fails.
fn failed(fault: Fault) -> ! {
    eprintln!("{fault}");
    exit(1)
}

/// Prints what each run came to; `true` if all are sound and end in the same hash.
fn all() -> Result<bool, Fault> {
    let serial = serial()?;
    println!("serially: hash {:016x}", serial.hash.0);
    let mut good = true;
    for threads in [1, 2, 4] {
        let (picture, steps) = by_threads(threads)?;
        let report = Report { picture, steps: &steps };
        println!("by {threads} threads:\n{report}");
        good &= report.is_sound() && picture.hash == serial.hash;
    }
    Ok(good)
}

/// One thread, stage after stage; every letter in the frame after the one in which it is due.
fn serial() -> Result<Picture, Fault> {
    let mut discs: [Disc; DISCS] = std::array::from_fn(Disc::start);
    let mut picture = Picture::EMPTY;
    let mut letters =
        (0..LETTERS as u32).map(|number| (number % SENDERS as u32, number / SENDERS as u32));
    for _ in 0..FRAMES {
        let before = discs;
        for (index, disc) in discs.iter_mut().enumerate() {
            disc.advance((0..DISCS).filter(|&other| other != index).filter_map(|other| {
                let (low, high) = (&before[index.min(other)], &before[index.max(other)]);
                let sign = if index < other { 1.0 } else { -1.0 };
                low.push(high).map(|push| push.map(|axis| sign * axis))
            }));
        }
        for (sender, sequence) in letters.by_ref().take(2 * SENDERS) {
            let (UnitId(to), reading) = letter(sender, sequence);
            discs[to as usize].read(UnitId(to), Sender { sender, sequence }, reading)?;
        }
        discs.iter().enumerate().for_each(|(index, disc)| picture.draw(index, disc));
        picture.show();
    }
    Ok(picture)
}

/// The picture, and the steps of each thread.
fn by_threads(threads: usize) -> Result<(Picture, Vec<u32>), Fault> {
    let mut tables = Box::new(Tables::new());
    let mut pipeline = Pipeline::new(tables.lend(), Config::default(), Doze::default())?;
    pipeline.run(FRAMES)?;
    let (pipeline, outbox) = (&pipeline, &Outbox::new());
    let token = pipeline.token(Picture::EMPTY).map_err(|(_, full)| full)?;
    let nap = |_: &dyn Fn() -> bool| thread::sleep(TICK);
    let work = |token| work(pipeline, token, outbox, nap).unwrap_or_else(|fault| failed(fault));
    let (worked, picture) = thread::scope(|scope| {
        for sender in 0..SENDERS {
            scope.spawn(move || {
                while !outbox.is_done() {
                    outbox.post_due(sender, pipeline);
                    thread::sleep(TICK);
                }
            });
        }
        let others: Vec<_> = (1..threads).map(|_| scope.spawn(|| work(None).0)).collect();
        let (steps, picture) = work(Some(token));
        let others = others.into_iter().map(|other| other.join().unwrap_or(0));
        (std::iter::once(steps).chain(others).collect(), picture)
    });
    Ok((picture.unwrap_or(Picture::EMPTY), worked))
}

/// Sleeps on a condition variable.
#[derive(Default)]
struct Doze {
    lock: Mutex<()>,
    rung: Condvar,
}

impl Waiting for Doze {
    fn sleep(&self, bell: &Bell, seen: Epoch) {
        let mut lock = self.lock.lock().unwrap_or_else(PoisonError::into_inner);
        while !bell.rung_since(seen) {
            lock = self.rung.wait(lock).unwrap_or_else(PoisonError::into_inner);
        }
    }

    fn wake(&self, _: &Bell, _: u32) {
        // Whoever looked before the ring is asleep once the lock is to be had.
        drop(self.lock.lock().unwrap_or_else(PoisonError::into_inner));
        self.rung.notify_all();
    }
}
