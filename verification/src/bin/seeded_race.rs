//! A data race on purpose: a hand-over whose flag is stored and loaded Relaxed. A sanitizer that says
//! nothing of it would say nothing of the core either; it must report this program.

use std::cell::UnsafeCell;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

struct HandOver {
    /// Somebody waits for the value.
    awaited: AtomicBool,
    ready: AtomicBool,
    value: UnsafeCell<u64>,
}

// SAFETY: there is none: this is the bug.
unsafe impl Sync for HandOver {}

fn wait_for(flag: &AtomicBool) {
    while !flag.load(Relaxed) {
        std::thread::yield_now();
    }
}

fn main() {
    let [awaited, ready] = [(); 2].map(|()| AtomicBool::new(false));
    let shared = HandOver { awaited, ready, value: UnsafeCell::new(0) };
    std::thread::scope(|scope| {
        let shared = &shared;
        scope.spawn(move || {
            wait_for(&shared.awaited);
            // SAFETY: nobody reads before the flag is set; but the flag does not order this.
            unsafe { *shared.value.get() = 7 };
            shared.ready.store(true, Relaxed);
        });
        scope.spawn(move || {
            shared.awaited.store(true, Relaxed);
            wait_for(&shared.ready);
            // SAFETY: as above.
            println!("read {}", unsafe { *shared.value.get() });
        });
    });
}
