//! A test that hangs would hang the suite and name nobody. This aborts the process instead, and
//! says which case it was.

use std::collections::BTreeMap;
use std::io::Write;
use std::sync::{Mutex, Once};
use std::time::{Duration, Instant};

/// How long one case may take.
pub const DEADLINE: Duration = Duration::from_secs(30);

static RUNNING: Mutex<BTreeMap<u64, (Instant, String)>> = Mutex::new(BTreeMap::new());
static START: Once = Once::new();

/// While it lives, its case is being watched.
#[derive(Debug)]
pub struct Watch(u64);

/// Watches a case until the returned guard is dropped.
pub fn watch(case: String) -> Watch {
    START.call_once(|| drop(std::thread::spawn(look)));
    let mut running = RUNNING.lock().expect("no poison");
    let key = running.last_key_value().map_or(0, |(key, _)| key + 1);
    running.insert(key, (Instant::now(), case));
    Watch(key)
}

fn look() {
    loop {
        std::thread::sleep(Duration::from_millis(200));
        let running = RUNNING.lock().expect("no poison");
        if let Some((_, case)) = running.values().find(|(since, _)| since.elapsed() > DEADLINE) {
            // Not `eprintln`: a test harness would capture it, and then die with it.
            let _ = writeln!(std::io::stderr(), "no end after {DEADLINE:?}: {case}");
            std::process::abort();
        }
    }
}

impl Drop for Watch {
    fn drop(&mut self) {
        RUNNING.lock().expect("no poison").remove(&self.0);
    }
}
