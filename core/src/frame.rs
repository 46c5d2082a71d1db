//! Frame tags and the window of two frames in flight (§5.5).

use crate::countdown::Countdown;
use crate::sync::{Atomic, CachePadded, seeded, site};

/// A frame's number. It wraps after 2^32 frames; only equality, parity and the distance of
/// neighbouring frames are ever used, so that wrapping is harmless.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Frame(pub u32);

impl Frame {
    /// The frame after this one.
    #[inline]
    pub fn next(self) -> Self {
        Self(self.0.wrapping_add(1))
    }

    /// The frame before this one.
    #[inline]
    pub fn previous(self) -> Self {
        Self(self.0.wrapping_sub(1))
    }

    /// Which of the two frames in flight this is: 0 or 1.
    #[inline]
    pub fn parity(self) -> usize {
        (self.0 & 1) as usize
    }

    /// Whether this frame comes before `other`, at a distance below 2^31.
    #[inline]
    pub fn is_before(self, other: Self) -> bool {
        self != other && other.0.wrapping_sub(self.0) < 1 << 31
    }
}

/// When a unit enters its next frame: how far two consecutive frames overlap.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Entry {
    /// As soon as it is updated: its rendering overlaps with the next frame's detection, since
    /// both only read it. Two frames in flight; units that are done with the second may be tested and interact
    /// for a third before the first is swapped, but no update of that comes before.
    #[default]
    AfterUpdate,
    /// When it is rendered, as in the paper (Fig. 6). Two frames in flight.
    AfterRender,
    /// When its whole frame is swapped. One frame in flight.
    AfterSwap,
}

/// How far frames have come.
#[derive(Debug)]
pub(crate) struct Window {
    /// Units not yet rendered in the frame on display.
    pub(crate) renders: CachePadded<Countdown>,
    /// The frame being rendered: every frame before it is swapped.
    display: CachePadded<Atomic>,
    /// The last frame that was opened, for the stamps of letters from outside.
    open: CachePadded<Atomic>,
    /// The first frame that is not to be entered, if there is one. Written only by `&mut` access.
    pub(crate) limit: Option<Frame>,
    units: u32,
}

impl Window {
    /// At rest before `first`.
    pub(crate) fn new(units: u32, first: Frame) -> Self {
        Self {
            renders: CachePadded::new(Countdown::new(units)),
            display: CachePadded::new(Atomic::new(first.0)),
            open: CachePadded::new(Atomic::new(first.previous().0)),
            limit: Some(first),
            units,
        }
    }

    /// Whether `frame` is the first that is not to be entered.
    #[inline]
    pub(crate) fn is_limit(&self, frame: Frame) -> bool {
        self.limit == Some(frame)
    }

    /// The frame that may be rendered now.
    #[inline]
    pub(crate) fn display(&self) -> Frame {
        Frame(self.display.load(site::DISPLAY_LOAD))
    }

    /// After the swap of `frame`: renderers turn to the next one.
    pub(crate) fn swapped(&self, frame: Frame) {
        self.renders.arm(self.units);
        self.display.store(frame.next().0, site::DISPLAY_ADVANCE);
        if seeded!(RendersArmedLate) {
            self.renders.arm(self.units);
        }
    }

    /// `frame` has been gathered.
    pub(crate) fn opened(&self, frame: Frame) {
        self.open.store(frame.0, site::FRAME_OPEN_SET);
    }

    /// The last frame opened.
    pub(crate) fn open(&self) -> Frame {
        Frame(self.open.load(site::FRAME_OPEN_LOOK))
    }
}

#[cfg(all(test, not(loom)))]
mod tests {
    use super::*;

    #[test]
    fn numbers_wrap() {
        let last = Frame(u32::MAX);
        assert_eq!((last.next(), Frame(0).previous()), (Frame(0), last));
        assert_eq!([last, last.next(), Frame(7)].map(Frame::parity), [1, 0, 1]);
        for frame in [Frame(0), Frame(7), last] {
            let farthest = Frame(frame.0.wrapping_add((1 << 31) - 1));
            assert!(!frame.is_before(frame));
            for later in [frame.next(), farthest] {
                assert!(frame.is_before(later) && !later.is_before(frame));
            }
            assert!(!frame.is_before(farthest.next()), "too far to tell");
        }
    }
}
