//! What a person at the window does to the environment.

use dualframe_render_wgpu::camera::Camera;
use dualframe_render_wgpu::renderer::Painter;
use dualframe_sim::mailbox::Mailbox;
use dualframe_sim::object::Object;
use egui::{Color32, Painter as Painter2d, Stroke, Ui, vec2};
use glam::{Vec2, Vec3, Vec4Swizzles};

use super::controls::Controls;

/// The width of a line over the picture, in points.
const LINE: f32 = 1.5;

/// Where the mouse points.
pub(in crate::app) struct Aim<'a> {
    pub(super) painter: &'a Painter,
    pub(super) mailbox: &'a Mailbox,
    /// From (−1, −1) at the lower left of the window to (1, 1).
    pub(super) point: Vec2,
}

impl Aim<'_> {
    /// The place under the mouse at the depth of `anchor`.
    pub(super) fn at_depth_of(&self, anchor: Vec3) -> Vec3 {
        self.painter.camera.unproject(self.point, self.painter.aspect(), anchor)
    }

    /// From where one looks, and the direction of what is under the mouse, of unit length.
    pub(super) fn ray(&self) -> (Vec3, Vec3) {
        let camera = &self.painter.camera;
        (camera.eye(), camera.direction(self.point, self.painter.aspect()))
    }
}

/// Lines over the picture.
pub(in crate::app) struct Marks<'a> {
    painter: Painter2d,
    camera: &'a Camera,
}

impl<'a> Marks<'a> {
    /// Over the whole picture, which was taken by a camera.
    pub(super) fn new(painter: Painter2d, camera: &'a Camera) -> Self {
        Self { painter, camera }
    }

    /// Draws a line along places on a surface, each with its outward normal, as far as they face the
    /// person.
    pub(super) fn line(&self, places: impl Iterator<Item = (Vec3, Vec3)>, color: Color32) {
        let area = self.painter.clip_rect();
        let projection = self.camera.view_projection(area.aspect_ratio());
        let mut before = None;
        for (place, normal) in places {
            // What is behind the eye would be mirrored.
            let projected = projection * place.extend(1.0);
            let is_seen = normal.dot(self.camera.eye() - place) > 0.0 && projected.w > 0.0;
            let seen = is_seen.then(|| {
                let share = 0.5 * projected.xy() / projected.w + 0.5;
                area.lerp_inside(vec2(share.x, 1.0 - share.y))
            });
            if let (Some(from), Some(to)) = (before, seen) {
                self.painter.line_segment([from, to], Stroke::new(LINE, color));
            }
            before = seen;
        }
    }
}

/// What a person does to the environment: with the mouse and keys, and with a part of the overlay of its
/// own. Messages to objects are posted to the mailbox that it aims with.
pub(in crate::app) trait Hand: Send {
    /// How the mouse and the keys are used, in a line or two of the overlay.
    const HELP: &'static str;

    /// Another environment is shown.
    fn forget(&mut self);

    /// Nobody is at the window any more, and the button is up; frames go on. By default there is nothing more to let go
    /// of.
    fn leave(&mut self) {
        self.forget();
    }

    /// The left button went down.
    fn press(&mut self, aim: &Aim<'_>);

    /// The left button went up.
    fn release(&mut self, aim: &Aim<'_>);

    /// Whether dragging with the left button, and the wheel, are for what the hand holds, and not for the
    /// camera.
    fn is_busy(&self) -> bool;

    /// The wheel turned by so many lines while the hand was busy; away from the person is positive.
    fn wheel(&mut self, lines: f32) {
        let _ = lines;
    }

    /// A key was struck that nothing else knows.
    fn key(&mut self, key: char) {
        let _ = key;
    }

    /// The hand is shown every object of every frame.
    fn see(&mut self, object: &Object) {
        let _ = object;
    }

    /// All objects of a frame were shown, and the mouse is here now. Where no time has passed since the last frame a
    /// hand gets nowhere.
    fn follow(&mut self, aim: &Aim<'_>, has_time_passed: bool);

    /// Marks in the picture what the person should see.
    fn mark(&self, marks: &Marks<'_>) {
        let _ = marks;
    }

    /// Lays out its part of the overlay.
    fn panel(&mut self, ui: &mut Ui, controls: &mut Controls);
}
