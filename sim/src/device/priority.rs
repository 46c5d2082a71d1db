//! Whether the haptic loop runs before everything else.

use std::fmt;

use thread_priority::{Error, ThreadPriority, ThreadPriorityValue};

/// The priority among real-time threads, of 0 to 99. Usually 50: above what asks for no more than to be
/// real-time, below the kernel's own threads.
const PRIORITY: u8 = 50;

/// How a thread is scheduled.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Priority {
    /// Before all threads that are not real-time (`SCHED_FIFO`; on Windows the highest priority).
    RealTime,
    /// Like any other: ticks will be late when the cores are busy.
    Ordinary {
        /// Why it was refused.
        reason: String,
    },
}

impl fmt::Display for Priority {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::RealTime => f.write_str("real-time priority"),
            Self::Ordinary { reason } => write!(f, "no real-time priority: {reason}"),
        }
    }
}

impl Priority {
    /// Asks for real-time priority for the calling thread, and says what came of it.
    #[must_use]
    pub fn raise() -> Self {
        let value = ThreadPriorityValue::try_from(PRIORITY);
        let value = value.map_err(|_| Error::Priority("out of range"));
        match value.map(ThreadPriority::Crossplatform).and_then(raise) {
            Ok(true) => Self::RealTime,
            Ok(false) => Self::Ordinary { reason: "the system let it pass without effect".into() },
            Err(error) => Self::Ordinary { reason: reason(&error) },
        }
    }
}

fn reason(error: &Error) -> String {
    match error {
        Error::OS(code) => std::io::Error::from_raw_os_error(*code).to_string(),
        other => other.to_string(),
    }
}

/// Whether the calling thread has the priority, which some systems only pretend to give.
#[cfg(unix)]
fn raise(priority: ThreadPriority) -> Result<bool, Error> {
    use thread_priority::{
        RealtimeThreadSchedulePolicy, ThreadSchedulePolicy, set_thread_priority_and_policy,
        thread_native_id, thread_schedule_policy,
    };
    let policy = ThreadSchedulePolicy::Realtime(RealtimeThreadSchedulePolicy::Fifo);
    set_thread_priority_and_policy(thread_native_id(), priority, policy)?;
    Ok(thread_schedule_policy()? == policy)
}

#[cfg(not(unix))]
fn raise(_priority: ThreadPriority) -> Result<bool, Error> {
    thread_priority::set_current_thread_priority(ThreadPriority::Max).map(|()| true)
}
