//! An optional hook around every work unit, for stage times (Table 1), timelines and traces.

use crate::frame::Frame;
use crate::unit::Work;

/// Watches one worker. The default does nothing and costs nothing. A frame's last rendering includes its swap, and so what
/// the host waits for in that; calls for sleepers come after a work unit's end, but for those ahead of a swap.
pub trait Probe {
    /// The worker turns to `work`, which belongs to `frame`.
    #[inline]
    fn begin(&mut self, _work: Work, _frame: Frame) {}

    /// The worker is done with `work`, its outputs passed on. Not told where a callback panicked.
    #[inline]
    fn end(&mut self, _work: Work, _frame: Frame) {}
}

/// Watches nothing.
#[derive(Clone, Copy, Debug, Default)]
pub struct NoProbe;

impl Probe for NoProbe {}

impl<P: Probe> Probe for &mut P {
    #[inline]
    fn begin(&mut self, work: Work, frame: Frame) {
        (**self).begin(work, frame);
    }

    #[inline]
    fn end(&mut self, work: Work, frame: Frame) {
        (**self).end(work, frame);
    }
}
