//! The renderer that is left to all workers (`core/PROTOCOL.md` §2, "The shared renderer").

use crate::config::Bug;
use crate::state::At;
use crate::step::Step;
use crate::work::Work;

impl Step<'_> {
    /// Takes the shared renderer, unless another worker has it.
    pub(crate) fn take_renderer(&mut self) {
        if self.state.tokens > 0 {
            self.state.tokens -= 1;
            self.worker().holds = true;
        }
    }

    /// Looks for renderings between two steps.
    pub(crate) fn turn(&mut self) {
        let me = &self.state.workers[self.number];
        let renders = self.state.work(me, true).any(Work::is_rendering);
        self.goes_to(match (me.holds, renders) {
            (true, false) => At::PuttingBack { gone: false },
            (false, true) => At::Taking,
            _ => At::GoingOn,
        });
    }

    pub(crate) fn go_sharing(&mut self) {
        match self.at() {
            At::Taking => {
                self.take_renderer();
                self.goes_to(At::GoingOn);
            }
            At::GoingOn => self.goes_to(At::PuttingBack { gone: false }),
            At::PuttingBack { gone } => {
                self.state.tokens += 1;
                self.worker().holds = false;
                self.goes_to(if gone { At::Leaving { gone } } else { At::LookingAgain });
            }
            At::LookingAgain => {
                let looks = !self.config.has(Bug::NotLookedAgain);
                let sees = looks && self.state.rendering_is_visible();
                self.goes_to(if sees { At::Taking } else { At::GoingOn });
            }
            at => unreachable!("nobody shares at {at:?}"),
        }
    }
}
