//! The arrival set: each pair meets exactly once, at its second arriver, who may read the first.

use super::{Guarded, Model, Role, check, lend, lend_slice, together};
use dualframe_core_model::arrivals::Arrivals;
use dualframe_core_model::countdown::Countdown;
use dualframe_core_model::frame::Frame;
use dualframe_core_model::ring::QueueSlot;
use loom::sync::atomic::{AtomicU32, Ordering};

pub(crate) const ALL: &[Model] = &[
    ("arrivals::pairs_meet_once", pairs_meet_once::<Real>),
    ("arrivals::next_frame", next_frame::<Real>),
];

/// What the models ask of an arrival set.
pub(crate) trait Meets: 'static {
    /// Nobody has arrived of `units`.
    fn make(units: usize) -> Self;
    /// Arrives in a frame and lists the earlier arrivals.
    fn arrive(&self, unit: u32, frame: u32) -> Vec<u32>;
}

/// The core's.
pub(crate) struct Real(Arrivals<'static>);

impl Meets for Real {
    fn make(units: usize) -> Self {
        Self(Arrivals::new(lend_slice(units, |_| QueueSlot::new())))
    }
    fn arrive(&self, unit: u32, frame: u32) -> Vec<u32> {
        let mut met = Vec::new();
        self.0.arrive(unit, Frame(frame), |earlier| met.push(earlier));
        met
    }
}

/// Three units in three threads. The outcome is the order of arrival.
pub(crate) fn pairs_meet_once<M: Meets>() {
    let expected = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];
    check("arrivals::pairs_meet_once", None, 3, expected, |order| {
        let set = &*lend(M::make(3));
        let objects: &[Guarded<u32>] = lend_slice(3, |_| Guarded::new(0));
        let role = |unit: u32| -> Role<Vec<u32>> {
            Box::new(move || {
                // The update of the frame before.
                objects[unit as usize].set(10 + unit);
                let met = set.arrive(unit, 0);
                met.iter().for_each(|&met| assert_eq!(objects[met as usize].get(), 10 + met));
                met
            })
        };
        let met = together(order, vec![role(0), role(1), role(2)]);
        let mut pairs: Vec<_> = (0..3)
            .flat_map(|a| met[a as usize].iter().map(move |&b| (a.min(b), a.max(b))))
            .collect();
        pairs.sort_unstable();
        assert_eq!(pairs, [(0, 1), (0, 2), (1, 2)], "each pair meets once");
        let mut arrived = [0, 1, 2];
        arrived.sort_unstable_by_key(|&unit| met[unit].len());
        arrived
    });
}

/// Two units, two frames: the same cells serve again.
pub(crate) fn next_frame<M: Meets>() {
    check("arrivals::next_frame", None, 2, [[0, 0], [0, 1], [1, 0], [1, 1]], |order| {
        let set = &*lend(M::make(2));
        let gate = &*lend(Countdown::new(2));
        let open = &*lend(AtomicU32::new(0));
        let objects: &[Guarded<u32>] = lend_slice(2, |_| Guarded::new(0));
        let role = |unit: u32| -> Role<[usize; 2]> {
            Box::new(move || {
                [0, 1].map(|frame| {
                    objects[unit as usize].set(frame);
                    let met = set.arrive(unit, frame);
                    met.iter().for_each(|&met| assert_eq!(objects[met as usize].get(), frame));
                    if gate.arrive() {
                        gate.arm(2);
                        open.store(frame + 1, Ordering::Release);
                    }
                    while open.load(Ordering::Acquire) <= frame {
                        loom::hint::spin_loop();
                    }
                    met.len()
                })
            })
        };
        let met = together(order, vec![role(0), role(1)]);
        [0, 1].map(|frame| {
            assert_eq!(met[0][frame] + met[1][frame], 1, "the pair meets once a frame");
            met[1][frame]
        })
    });
}
