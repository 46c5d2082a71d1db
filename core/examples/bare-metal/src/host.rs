//! The host: the VE serially, without the pipeline, and by 1, 2 and 4 threads of it, with letters
//! from threads in the place of interrupt handlers.

use std::process::ExitCode;
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
        Ok(hash) => {
            println!("hash {hash:016x}");
            ExitCode::SUCCESS
        }
        Err(message) => {
            eprintln!("{message}");
            ExitCode::FAILURE
        }
    }
}

/// The hash that all runs end in.
fn all() -> Result<u64, String> {
    let expected = serial().map_err(|fault| format!("serially: {fault}"))?.hash;
    for threads in [1, 2, 4] {
        let (picture, steps) = by_threads(threads).map_err(|error| format!("{threads} threads: {error}"))?;
        let report = Report { picture, steps: &steps };
        if !report.is_sound() || picture.hash != expected {
            return Err(format!("not the serial run's {:016x}:\n{report}", expected.0));
        }
    }
    Ok(expected.0)
}

/// One thread, stage after stage; every letter in the frame after the one in which it is due.
fn serial() -> Result<Picture, Fault> {
    let mut discs: [Disc; DISCS] = std::array::from_fn(Disc::start);
    let mut picture = Picture::EMPTY;
    let mut letters = (0..LETTERS as u32).map(|number| (number % SENDERS as u32, number / SENDERS as u32));
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

fn by_threads(threads: usize) -> Result<(Picture, Vec<u32>), String> {
    let mut tables = Box::new(Tables::new());
    let config = Config::default();
    let mut pipeline =
        Pipeline::new(tables.lend(), config, Doze::default()).map_err(|error| error.to_string())?;
    pipeline.run(FRAMES).map_err(|error| error.to_string())?;
    let (pipeline, outbox) = (&pipeline, &Outbox::new());
    let mut token = Some(pipeline.token(Picture::EMPTY).map_err(|(_, full)| full.to_string())?);
    thread::scope(|scope| {
        for sender in 0..SENDERS {
            scope.spawn(move || {
                while !outbox.is_done() && !pipeline.finished() {
                    outbox.post_due(sender, pipeline);
                    thread::sleep(TICK);
                }
            });
        }
        let nap = |_: &dyn Fn() -> bool| thread::sleep(TICK);
        let workers: Vec<_> = (0..threads)
            .map(|_| (scope, token.take()))
            .map(|(scope, token)| scope.spawn(move || work(pipeline, token, outbox, nap)))
            .collect();
        let mut picture = Picture::EMPTY;
        let mut steps = Vec::new();
        for worker in workers {
            let outcome = worker.join().map_err(|_| "a thread panicked".to_owned())?;
            let (worked, rendered) = outcome.map_err(|fault| fault.to_string())?;
            steps.push(worked);
            picture = rendered.unwrap_or(picture);
        }
        Ok((picture, steps))
    })
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
