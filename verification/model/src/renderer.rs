//! The renderer that is left to all workers (`core/PROTOCOL.md` §2, "The shared renderer").

use crate::config::Bug;
use crate::state::At;
use crate::step::Step;

impl Step<'_> {
    /// Takes the shared renderer, unless another worker has it.
    pub(crate) fn take_renderer(&mut self) {
        if self.state.tokens > 0 {
            self.state.tokens -= 1;
            self.worker().holds = true;
        }
    }

    /// Has looked for renderings between two steps.
    pub(crate) fn turn(&mut self) {
        let holds = self.worker().holds;
        self.goes_to(if holds { At::PuttingBack { gone: false } } else { At::Taking });
    }

    pub(crate) fn go_sharing(&mut self) {
        match self.at() {
            At::Taking => {
                self.take_renderer();
                self.goes_to(At::GoingOn);
            }
            At::PuttingBack { gone } => {
                self.state.tokens += 1;
                self.worker().holds = false;
                self.goes_to(if gone { At::Leaving { gone } } else { At::LookingAgain });
            }
            At::LookingAgain => {
                let looks = !self.config.has(Bug::NotLookedAgain);
                let sees = looks && self.state.rendering_is_visible() && self.state.tokens > 0;
                self.goes_to(if sees { At::Taking } else { At::GoingOn });
            }
            at => unreachable!("nobody shares at {at:?}"),
        }
    }
}
