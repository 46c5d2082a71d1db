//! The core's queue, inbox and latest-value cell, as shipped and as compiled under loom: programs of
//! threads that use them and record what they saw.

use super::history::{Log, record};
use super::specs::{CellOp, Fifo, Letters, MailOp, QueueOp, Register};

/// What a thread does with a clock, and what it recorded.
pub(crate) type Program<S> = Box<dyn FnOnce(&dyn Fn() -> u32) -> Log<S> + Send>;

/// A step of a queue's user.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Do {
    Push(u32),
    Pop,
    /// Pops, and pushes what it popped.
    Pass,
}

macro_rules! subjects {
    ($module:ident, $core:ident) => {
        pub(crate) mod $module {
            use super::*;
            use crate::models::{lend, lend_slice};
            use $core::frame::Frame;
            use $core::inbox::{From, Inbox, LetterSlot, Post};
            use $core::latest::Latest;
            use $core::ring::{IndexRing, QueueSlot, slots_for};

            /// One ring for `indices`; those below `inside` are in it. A program for each list of steps.
            pub(crate) fn queue(
                indices: usize,
                inside: u32,
                threads: impl IntoIterator<Item = Vec<Do>>,
            ) -> Vec<Program<Fifo>> {
                let slots = lend_slice(slots_for(indices), |_| QueueSlot::new());
                let ring: &'static IndexRing<'static> = lend(IndexRing::new(slots).unwrap());
                (0..inside).for_each(|index| ring.push(index).unwrap());
                let program = |steps: Vec<Do>| -> Program<Fifo> {
                    Box::new(move |clock| {
                        let mut log = Log::<Fifo>::new();
                        let push = |log: &mut _, index| {
                            record::<Fifo>(log, clock, QueueOp::Push(index), || {
                                ring.push(index).unwrap();
                                None
                            });
                        };
                        for step in steps {
                            if let Do::Push(index) = step {
                                push(&mut log, index);
                                continue;
                            }
                            let popped =
                                *record::<Fifo>(&mut log, clock, QueueOp::Pop, || ring.pop());
                            if let (Do::Pass, Some(index)) = (step, popped) {
                                push(&mut log, index);
                            }
                        }
                        log
                    })
                };
                threads.into_iter().map(program).collect()
            }

            /// One inbox with room for `letters`. A program for each list of operations.
            pub(crate) fn inbox(
                letters: usize,
                threads: impl IntoIterator<Item = Vec<MailOp>>,
            ) -> Vec<Program<Letters>> {
                let slots = lend_slice(letters, |_| LetterSlot::new());
                let queue = lend_slice(slots_for(letters), |_| QueueSlot::new());
                let post: &'static Post<'static, [u32; 2]> = lend(Post::new(slots, queue).unwrap());
                // SAFETY: there is no other pool.
                let inbox: &'static Inbox = lend(unsafe { Inbox::new() });
                let run = |op| match op {
                    MailOp::Post(rank, frame) => {
                        let from = From { sender: rank[0], sequence: rank[1] };
                        post.post(inbox, Frame(frame), from, rank).expect("room for all letters");
                        Vec::new()
                    }
                    MailOp::Collect(frame) => {
                        let ranked = |(from, rank): (From, [u32; 2])| {
                            assert_eq!(
                                [from.sender, from.sequence],
                                rank,
                                "the letter's own message"
                            );
                            rank
                        };
                        post.collect(inbox, Frame(frame)).map(ranked).collect()
                    }
                };
                let program = |ops: Vec<MailOp>| -> Program<Letters> {
                    Box::new(move |clock| {
                        let mut log = Log::<Letters>::new();
                        for op in ops {
                            record::<Letters>(&mut log, clock, op, || run(op));
                        }
                        log
                    })
                };
                threads.into_iter().map(program).collect()
            }

            /// One cell; the first program publishes 1, 2, ... so many, each other one reads so often.
            pub(crate) fn latest(publications: u32, reads: &[u32]) -> Vec<Program<Register>> {
                let (mut writer, readers) = lend(Latest::<u32, 4>::new(0)).split();
                let write: Program<Register> = Box::new(move |clock| {
                    let mut log = Log::<Register>::new();
                    for value in 1..=publications {
                        record::<Register>(&mut log, clock, CellOp::Publish(value), || {
                            writer.publish(value);
                            None
                        });
                    }
                    log
                });
                let read = |&reads: &u32| -> Program<Register> {
                    let mut reader = readers.reader().expect("room for the reader");
                    Box::new(move |clock| {
                        let mut log = Log::<Register>::new();
                        for _ in 0..reads {
                            record::<Register>(&mut log, clock, CellOp::Read, || {
                                Some(reader.read())
                            });
                        }
                        log
                    })
                };
                [write].into_iter().chain(reads.iter().map(read)).collect()
            }
        }
    };
}

subjects!(shipped, dualframe_core);
subjects!(modelled, dualframe_core_model);
