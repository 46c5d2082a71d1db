//! What the person at the window does.

use std::sync::Arc;

use egui::{Context, Order, Pos2};
use egui_winit::State;
use glam::Vec2;
use winit::application::ApplicationHandler;
use winit::dpi::PhysicalSize;
use winit::event::{ElementState, KeyEvent, MouseButton, MouseScrollDelta, WindowEvent};
use winit::event_loop::ActiveEventLoop;
use winit::keyboard::{Key, NamedKey};
use winit::window::{Window, WindowId};

/// Lines of a wheel that one pixel of a touch pad stands for.
const LINES_PER_PIXEL: f64 = 0.02;

/// Something done with mouse or keyboard outside the overlay.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Gesture {
    /// The left button went down here, in pixels from the upper left. The mouse may be elsewhere by now.
    Press(Vec2),
    /// The left button went up.
    Release,
    /// The mouse moved by so many pixels with this button down; downwards is positive.
    Drag(MouseButton, Vec2),
    /// The wheel turned by so many lines; away from the person is positive.
    Wheel(f32),
    /// Pause, or go on.
    Pause,
    /// Compute one frame.
    Step,
    /// Look from where one looked at the beginning.
    ResetCamera,
    /// Show the overlay, or hide it.
    Overlay,
    /// Another key that is a character, as if without shift.
    Key(char),
}

/// The window and what has come from it.
pub(super) struct Input {
    /// The size wanted, then that of the window, in pixels. It is told, not asked for: a display may be slow to
    /// answer.
    pub(super) size: PhysicalSize<u32>,
    pub(super) window: Option<Arc<Window>>,
    pub(super) egui: Option<State>,
    /// Why there is no window.
    pub(super) failure: Option<String>,
    pub(super) is_closing: bool,
    /// What was done and not yet looked at.
    pub(super) gestures: Vec<Gesture>,
    /// Where the mouse is, in pixels from the upper left.
    pub(super) cursor: Vec2,
    /// The buttons that are down, the last one last.
    held: Vec<MouseButton>,
}

impl Input {
    pub(super) fn new((width, height): (u32, u32)) -> Self {
        Self {
            size: PhysicalSize::new(width, height),
            window: None,
            egui: None,
            failure: None,
            is_closing: false,
            gestures: Vec::new(),
            cursor: Vec2::ZERO,
            held: Vec::new(),
        }
    }

    fn press(&mut self, state: ElementState, button: MouseButton) {
        let is_down = state == ElementState::Pressed;
        self.held.retain(|&held| held != button);
        self.held.extend(is_down.then_some(button));
        if button == MouseButton::Left {
            self.gestures.push(if is_down {
                Gesture::Press(self.cursor)
            } else {
                Gesture::Release
            });
        }
    }

    fn key(&mut self, event: &KeyEvent) {
        let key = event.logical_key.as_ref();
        let is_step = matches!(key, Key::Character("n" | "N"));
        // A key that is held steps on, and does nothing else again.
        if event.state != ElementState::Pressed || (event.repeat && !is_step) {
            return;
        }
        self.gestures.extend(match key {
            Key::Named(NamedKey::Space) => Some(Gesture::Pause),
            Key::Named(NamedKey::Home) => Some(Gesture::ResetCamera),
            Key::Character(_) if is_step => Some(Gesture::Step),
            Key::Character("h" | "H") => Some(Gesture::Overlay),
            Key::Character(text) => {
                text.chars().next().map(|key| Gesture::Key(key.to_ascii_lowercase()))
            }
            _ => None,
        });
    }
}

/// Whether what the mouse does here, in pixels, is done in the overlay. What that itself says is of where the mouse
/// was in the last picture, which may be a second old.
fn is_overlays(overlay: &Context, cursor: Vec2) -> bool {
    let place = Pos2::from(cursor.to_array()) / overlay.pixels_per_point();
    let layer = overlay.layer_id_at(place);
    overlay.egui_is_using_pointer() || layer.is_some_and(|layer| layer.order != Order::Background)
}

impl ApplicationHandler for Input {
    fn resumed(&mut self, event_loop: &ActiveEventLoop) {
        if self.window.is_some() {
            return;
        }
        let attributes =
            Window::default_attributes().with_title("dualframe").with_inner_size(self.size);
        match event_loop.create_window(attributes) {
            Ok(window) => {
                self.size = window.inner_size();
                self.window = Some(Arc::new(window));
            }
            Err(error) => self.failure = Some(error.to_string()),
        }
    }

    fn window_event(&mut self, _: &ActiveEventLoop, _: WindowId, event: WindowEvent) {
        let Some(window) = &self.window else { return };
        let cursor = self.cursor;
        let is_taken = self.egui.as_mut().is_some_and(|egui| {
            let response = egui.on_window_event(window, &event);
            match event {
                WindowEvent::MouseInput { .. } | WindowEvent::MouseWheel { .. } => {
                    is_overlays(egui.egui_ctx(), cursor)
                }
                _ => response.consumed,
            }
        });
        match event {
            WindowEvent::CloseRequested => self.is_closing = true,
            WindowEvent::Destroyed => self.failure = Some("the window was destroyed".to_owned()),
            WindowEvent::Resized(size) => self.size = size,
            // A button may go up where this window does not hear of it.
            WindowEvent::Focused(false) => {
                self.held.clear();
                self.gestures.push(Gesture::Release);
            }
            WindowEvent::CursorMoved { position, .. } => {
                let cursor = Vec2::new(position.x as f32, position.y as f32);
                let moved = cursor - std::mem::replace(&mut self.cursor, cursor);
                // What began outside the overlay stays outside it.
                let held = self.held.last();
                self.gestures.extend(held.map(|&button| Gesture::Drag(button, moved)));
            }
            WindowEvent::MouseInput { state, button, .. }
                if !is_taken || state == ElementState::Released =>
            {
                self.press(state, button);
            }
            WindowEvent::MouseWheel { delta, .. } if !is_taken => {
                self.gestures.push(Gesture::Wheel(match delta {
                    MouseScrollDelta::LineDelta(_, lines) => lines,
                    MouseScrollDelta::PixelDelta(by) => (by.y * LINES_PER_PIXEL) as f32,
                }));
            }
            // A key that was down before the window had the keyboard was struck elsewhere.
            WindowEvent::KeyboardInput { event, is_synthetic: false, .. } if !is_taken => {
                self.key(&event);
            }
            _ => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_button_that_is_still_down_drags_on() {
        let mut input = Input::new((640, 360));
        let mut press = |is_down: bool, button| {
            input.press(
                if is_down { ElementState::Pressed } else { ElementState::Released },
                button,
            );
            input.held.last().copied()
        };
        assert_eq!(press(true, MouseButton::Right), Some(MouseButton::Right));
        assert_eq!(press(true, MouseButton::Left), Some(MouseButton::Left));
        assert_eq!(press(false, MouseButton::Left), Some(MouseButton::Right));
        assert_eq!(press(true, MouseButton::Right), Some(MouseButton::Right), "unheard of before");
        assert_eq!(press(false, MouseButton::Right), None);
        assert_eq!(input.gestures, [Gesture::Press(Vec2::ZERO), Gesture::Release]);
    }
}
