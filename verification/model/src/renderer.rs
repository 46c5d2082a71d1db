//! The renderer that is left to all workers (`core/PROTOCOL.md` §2, "The shared renderer").

use crate::config::Bug;
use crate::state::{At, Because};
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
            (true, false) => At::PuttingBack(Because::NothingSeen),
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
            At::GoingOn => self.goes_to(At::PuttingBack(Because::NothingLeft)),
            At::PuttingBack(because) => {
                self.state.tokens += 1;
                self.worker().holds = false;
                self.goes_to(match because {
                    Because::Leaves => At::Leaving { gone: true },
                    _ => At::LookingAgain(because),
                });
            }
            At::LookingAgain(because) => self.look_again(because),
            at => unreachable!("nobody shares at {at:?}"),
        }
    }

    fn look_again(&mut self, because: Because) {
        let looks = !self.config.has(Bug::NotLookedAgain);
        let sees = looks && self.state.rendering_is_visible();
        if sees && because == Because::NothingSeen {
            self.goes_to(At::Taking);
        } else if sees && self.config.sleep {
            self.worker().queued += 1;
            self.goes_to(At::Calling);
        } else {
            self.goes_to(At::GoingOn);
        }
    }
}
