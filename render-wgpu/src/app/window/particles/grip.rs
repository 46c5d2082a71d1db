//! The mouse as a hand that grabs particles and pulls at them.

use std::sync::mpsc::{Receiver, TryRecvError, channel};

use dualframe_render_wgpu::pick::{Pick, Picked};
use dualframe_sim::message::Message;
use egui::Ui;
use glam::Vec3;

use super::physics::Physics;
use crate::app::window::controls::Controls;
use crate::app::window::hand::{Aim, Hand};

/// The stiffness of the hand's pull, in newtons per metre; usually 150, about what keeps a particle at
/// the mouse without tearing at it.
const PULL: f32 = 150.0;

/// What the left button's press came to.
enum Held {
    Nothing,
    /// The device is asked what is under the mouse.
    Asked(Receiver<Option<Picked>>),
    /// An object, and where it was last pulled to.
    Object(Picked, Option<Vec3>),
    /// There was no object: dragging looks around.
    Air,
}

/// The mouse as a hand, and what the person has set.
pub(in crate::app) struct Grip {
    held: Held,
    pub(super) physics: Physics,
}

impl Grip {
    pub(super) fn new(physics: Physics) -> Self {
        Self { held: Held::Nothing, physics }
    }
}

impl Hand for Grip {
    const HELP: &'static str = "drag: pull or look round";

    fn forget(&mut self) {
        self.held = Held::Nothing;
    }

    fn press(&mut self, aim: &Aim<'_>) {
        // The release of what was held may have gone elsewhere.
        self.release(aim);
        let (answer, answered) = channel();
        let asked = Pick::new(aim.point, answer);
        // With the queue full of work nothing is grabbed this time.
        let asked = aim.painter.auxiliary().submit(Box::new(asked));
        self.held = if asked.is_ok() { Held::Asked(answered) } else { Held::Air };
    }

    fn release(&mut self, aim: &Aim<'_>) {
        if let Held::Object(picked, _) = std::mem::replace(&mut self.held, Held::Nothing) {
            aim.mailbox.post(picked.object, Message::Release);
        }
    }

    fn is_busy(&self) -> bool {
        matches!(self.held, Held::Asked(_) | Held::Object(..))
    }

    fn follow(&mut self, aim: &Aim<'_>, has_time_passed: bool) {
        if let Held::Asked(answered) = &self.held {
            self.held = match answered.try_recv() {
                Ok(Some(picked)) => Held::Object(picked, None),
                Ok(None) | Err(TryRecvError::Disconnected) => Held::Air,
                Err(TryRecvError::Empty) => return,
            };
        }
        if let Held::Object(Picked { object, node, place }, pulled) = &mut self.held
            && has_time_passed
        {
            let target = aim.at_depth_of(*place);
            if pulled.replace(target) != Some(target) {
                let (node, target) = (*node, target.to_array());
                aim.mailbox.post(*object, Message::Pull { node, target, stiffness: PULL });
            }
        }
    }

    fn panel(&mut self, ui: &mut Ui, controls: &mut Controls) {
        self.physics.show(ui, controls);
    }
}
