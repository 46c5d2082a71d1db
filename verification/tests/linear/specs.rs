//! What each object does when it is used by one thread alone.

use super::history::{Log, Object};
use stateright::semantics::SequentialSpec;
use std::collections::VecDeque;

/// A queue of indices, each with the time at which it was pushed.
#[derive(Clone, Debug, Default)]
pub(crate) struct Fifo(VecDeque<(u32, u32)>);

impl Fifo {
    /// A queue that holds `indices` from the start.
    pub(crate) fn of(indices: std::ops::Range<u32>) -> Self {
        Self(indices.map(|index| (index, u32::MAX)).collect())
    }
}

#[derive(Clone, Debug)]
pub(crate) enum QueueOp {
    /// An index.
    Push(u32),
    /// The same, and when.
    PushAt(u32, u32),
    Pop,
    /// A pop that found the queue empty, and the times of the pushes that were under way meanwhile.
    /// `IndexRing::pop` may miss those, and no others: even one that was done before another pop
    /// that was done before this one.
    VainPop(Vec<u32>),
}

impl SequentialSpec for Fifo {
    type Op = QueueOp;
    /// What was popped.
    type Ret = Option<u32>;

    fn invoke(&mut self, op: &QueueOp) -> Option<u32> {
        match op {
            QueueOp::Push(index) => self.invoke(&QueueOp::PushAt(*index, 0)),
            QueueOp::PushAt(index, time) => {
                self.0.push_back((*index, *time));
                None
            }
            QueueOp::Pop => self.0.pop_front().map(|(index, _)| index),
            QueueOp::VainPop(meanwhile) => {
                let seen = self.0.iter().find(|(_, time)| !meanwhile.contains(time));
                seen.map(|(index, _)| *index)
            }
        }
    }
}

impl Object for Fifo {
    fn annotate(logs: &mut [Log<Self>]) {
        let pushes: Vec<_> = logs
            .iter_mut()
            .flatten()
            .filter_map(|(invoked, op, returned, _)| {
                let QueueOp::Push(index) = *op else { return None };
                *op = QueueOp::PushAt(index, *invoked);
                Some((*invoked, *returned))
            })
            .collect();
        for (invoked, op, returned, result) in logs.iter_mut().flatten() {
            if matches!((&op, result), (QueueOp::Pop, None)) {
                let meanwhile =
                    pushes.iter().filter(|push| push.0 < *returned && *invoked < push.1);
                *op = QueueOp::VainPop(meanwhile.map(|push| push.0).collect());
            }
        }
    }
}

/// An inbox: letters by (sender, sequence), and the frame that each was posted in.
#[derive(Clone, Debug, Default)]
pub(crate) struct Letters(Vec<([u32; 2], u32)>);

#[derive(Clone, Copy, Debug)]
pub(crate) enum MailOp {
    /// A letter, in this frame.
    Post([u32; 2], u32),
    /// All that was posted before this frame.
    Collect(u32),
}

impl SequentialSpec for Letters {
    type Op = MailOp;
    /// What was collected.
    type Ret = Vec<[u32; 2]>;

    fn invoke(&mut self, op: &MailOp) -> Vec<[u32; 2]> {
        match *op {
            MailOp::Post(rank, frame) => {
                self.0.push((rank, frame));
                Vec::new()
            }
            MailOp::Collect(frame) => {
                let due = self.0.extract_if(.., |letter| letter.1 < frame);
                let mut due: Vec<_> = due.map(|letter| letter.0).collect();
                due.sort_unstable();
                due
            }
        }
    }
}

/// A latest-value cell.
#[derive(Clone, Debug, Default)]
pub(crate) struct Register(u32);

#[derive(Clone, Copy, Debug)]
pub(crate) enum CellOp {
    Publish(u32),
    Read,
}

impl SequentialSpec for Register {
    type Op = CellOp;
    /// What was read.
    type Ret = Option<u32>;

    fn invoke(&mut self, op: &CellOp) -> Option<u32> {
        match *op {
            CellOp::Publish(value) => {
                self.0 = value;
                None
            }
            CellOp::Read => Some(self.0),
        }
    }
}

impl Object for Letters {}
impl Object for Register {}
