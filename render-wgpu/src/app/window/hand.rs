//! The mouse as a hand: it looks around, and grabs and pulls objects.

use std::sync::mpsc::{Receiver, TryRecvError, channel};

use dualframe_render_wgpu::pick::{Pick, Picked};
use dualframe_render_wgpu::renderer::Painter;
use dualframe_sim::mailbox::Mailbox;
use dualframe_sim::message::Message;
use glam::{Vec2, Vec3};
use winit::event::MouseButton;

/// How far the camera goes round for a mouse that crosses the window's height, in radians.
const TURN: f32 = 3.5;
/// The factor of the distance for one line of the wheel; usually 0.9.
const ZOOM: f32 = 0.9;
/// The stiffness of the hand's pull, in newtons per metre; usually 150, about what keeps a particle at
/// the mouse without tearing at it.
const PULL: f32 = 150.0;

/// What the left button's press came to.
enum Grip {
    Nothing,
    /// The device is asked what is under the mouse.
    Asked(Receiver<Option<Picked>>),
    /// An object, and where it was last pulled to.
    Object(Picked, Option<Vec3>),
    /// There was no object: dragging looks around.
    Air,
}

/// The mouse as a hand.
pub(super) struct Hand(Grip);

impl Hand {
    pub(super) fn new() -> Self {
        Self(Grip::Nothing)
    }

    /// The left button went down at `point`, from (−1, −1) at the lower left to (1, 1).
    pub(super) fn press(&mut self, painter: &Painter, point: Vec2) {
        let (answer, answered) = channel();
        // With the queue full of work nothing is grabbed this time.
        let asked = painter.auxiliary().submit(Box::new(Pick { point, answer }));
        self.0 = if asked.is_ok() { Grip::Asked(answered) } else { Grip::Air };
    }

    /// The left button went up.
    pub(super) fn release(&mut self, mailbox: &Mailbox) {
        if let Grip::Object(picked, _) = std::mem::replace(&mut self.0, Grip::Nothing) {
            mailbox.post(picked.object, Message::Release);
        }
    }

    /// The mouse moved by so much of the window's height, downwards positive.
    pub(super) fn drag(&mut self, painter: &mut Painter, button: MouseButton, by: Vec2) {
        let camera = &mut painter.camera;
        match (button, &self.0) {
            (MouseButton::Left, Grip::Air) | (MouseButton::Right, _) => {
                camera.orbit(-TURN * by.x, TURN * by.y);
            }
            (MouseButton::Middle, _) => camera.pan(Vec2::new(by.x, -by.y)),
            _ => {}
        }
    }

    /// The wheel turned by so many lines.
    pub(super) fn wheel(&mut self, painter: &mut Painter, lines: f32) {
        painter.camera.zoom(ZOOM.powf(lines));
    }

    /// Hears what is under the mouse, and pulls at what is held towards `point`.
    pub(super) fn hold(&mut self, painter: &Painter, mailbox: &Mailbox, point: Vec2, aspect: f32) {
        if let Grip::Asked(answered) = &self.0 {
            self.0 = match answered.try_recv() {
                Ok(Some(picked)) => Grip::Object(picked, None),
                Ok(None) | Err(TryRecvError::Disconnected) => Grip::Air,
                Err(TryRecvError::Empty) => return,
            };
        }
        if let Grip::Object(Picked { object, node, place }, pulled) = &mut self.0 {
            let target = painter.camera.unproject(point, aspect, *place);
            if pulled.replace(target) != Some(target) {
                let (node, target) = (*node, target.to_array());
                mailbox.post(*object, Message::Pull { node, target, stiffness: PULL });
            }
        }
    }
}
