//! The countdown: one last arriver, who sees everything the others did.

use super::{Guarded, Model, Role, check, lend, lend_slice, together};
use dualframe_core_model::countdown::Countdown;
use loom::sync::atomic::{AtomicU32, Ordering};

pub(crate) const ALL: &[Model] = &[
    ("countdown::last_sees_all", last_sees_all::<Countdown>),
    ("countdown::armed_again", armed_again::<Countdown>),
];

/// What the models ask of a countdown.
pub(crate) trait Counts: Sync + 'static {
    /// Ends at the `arrivals`-th arrival.
    fn make(arrivals: u32) -> Self;
    /// Whether this was the last.
    fn arrive(&self) -> bool;
    /// Starts again.
    fn arm(&self, arrivals: u32);
}

impl Counts for Countdown {
    fn make(arrivals: u32) -> Self {
        Self::new(arrivals)
    }
    fn arrive(&self) -> bool {
        Countdown::arrive(self)
    }
    fn arm(&self, arrivals: u32) {
        Countdown::arm(self, arrivals);
    }
}

/// Three arrivers: exactly one is last, any may be, and it reads what all wrote.
pub(crate) fn last_sees_all<C: Counts>() {
    check("countdown::last_sees_all", None, 3, [0, 1, 2], |order| {
        let countdown = &*lend(C::make(3));
        let done: &[Guarded<u32>] = lend_slice(3, |_| Guarded::new(0));
        let role = |who: usize| -> Role<bool> {
            Box::new(move || {
                done[who].set(1);
                let last = countdown.arrive();
                if last {
                    assert_eq!(done.iter().map(Guarded::get).sum::<u32>(), 3);
                }
                last
            })
        };
        let last = together(order, vec![role(0), role(1), role(2)]);
        assert_eq!(last.iter().filter(|&&last| last).count(), 1, "one last arriver");
        last.iter().position(|&last| last).unwrap()
    });
}

/// The last arriver arms the countdown again and opens the next round, which ends once more.
pub(crate) fn armed_again<C: Counts>() {
    let expected = [[0, 0], [0, 1], [1, 0], [1, 1]];
    check("countdown::armed_again", Some(3), 2, expected, |order| {
        let countdown = &*lend(C::make(2));
        let work: &[Guarded<u32>] = lend_slice(2, |_| Guarded::new(0));
        let round = &*lend(AtomicU32::new(0));
        let role = |who: usize| -> Role<[bool; 2]> {
            Box::new(move || {
                [0, 1].map(|this| {
                    while round.load(Ordering::Acquire) < this {
                        loom::hint::spin_loop();
                    }
                    work[who].set(work[who].get() + 1);
                    let last = countdown.arrive();
                    if last {
                        assert_eq!([work[0].get(), work[1].get()], [this + 1; 2]);
                        countdown.arm(2);
                        round.store(this + 1, Ordering::Release);
                    }
                    last
                })
            })
        };
        let last = together(order, vec![role(0), role(1)]);
        [0, 1].map(|round| {
            assert_ne!(last[0][round], last[1][round], "one last arriver");
            usize::from(last[1][round])
        })
    });
}
