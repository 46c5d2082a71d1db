//! Why an object is out of the environment.

use thiserror::Error;

/// What ended an object's part in the environment.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq, Hash)]
pub enum FaultKind {
    /// One of its callbacks, or a callback of an interaction it took part in, panicked. A fault in an
    /// interaction cannot be laid at one door: both objects of the pair go.
    #[error("a callback panicked")]
    Panicked,
    /// Its state was no longer finite after an update.
    #[error("its state was not finite")]
    NonFinite,
    /// Its update took longer than the budget for one callback.
    #[error("its update was over budget")]
    OverBudget,
    /// No fault: a message told it to leave.
    #[error("it was told to leave")]
    Removed,
}

/// An object's exclusion: from the frame after `frame` on it takes part in no stage, as if it had
/// never been there.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq, Hash)]
#[error("{kind} in frame {frame}")]
pub struct Fault {
    /// What happened.
    pub kind: FaultKind,
    /// The frame in whose update it happened or was noticed.
    pub frame: u64,
}
