//! What the main thread draws with: the window, its events and the pace.

use std::panic;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use dualframe_render_wgpu::camera::Camera;
use dualframe_render_wgpu::error::{GraphicsError, words_of};
use dualframe_render_wgpu::gpu::Gpu;
use dualframe_render_wgpu::look::{Look, Quality};
use dualframe_render_wgpu::picture::{Picture, read_texture};
use dualframe_render_wgpu::renderer::Painter;
use dualframe_sim::mailbox::Mailbox;
use dualframe_sim::object::Object;
use dualframe_sim::render::Renderer;
use dualframe_sim::timeline::Timeline;
use glam::Vec2;
use send_wrapper::SendWrapper;
use wgpu::{
    CommandBuffer, Extent3d, Instance, InstanceDescriptor, Texture, TextureDescriptor,
    TextureDimension, TextureUsages,
};
use winit::event::MouseButton;
use winit::event_loop::EventLoop;
use winit::platform::pump_events::{EventLoopExtPumpEvents, PumpStatus};
use winit::window::Window;

use super::controls::Controls;
use super::hand::{Aim, Hand};
use super::input::{Gesture, Input};
use super::overlay::Overlay;
use super::pace::Pace;
use super::paint::OverlayPainter;
use super::stats::{self, Stats};
use super::surface::{self, Screen};

/// How far the camera goes round for a mouse that crosses the window's height, in radians.
const TURN: f32 = 3.5;
/// The factor of the distance for one line of the wheel; usually 0.9.
const ZOOM: f32 = 0.9;

/// The window as a renderer.
pub(in crate::app) struct View<H> {
    /// Of the thread that opened the window, which alone may use it.
    event_loop: SendWrapper<EventLoop<()>>,
    input: Input,
    window: Arc<Window>,
    instance: Instance,
    screen: Screen,
    pub(super) painter: Painter,
    overlay_painter: OverlayPainter,
    overlay: Overlay,
    pub(super) hand: H,
    home: Camera,
    pub(super) controls: Controls,
    pub(super) stats: Arc<Mutex<Stats>>,
    pub(super) timeline: Arc<Timeline>,
    pub(super) mailbox: Mailbox,
    /// Whether the frame being drawn is shown. Displays show fewer frames than are computed.
    is_shown: bool,
    pace: Pace,
    is_display_gone: bool,
    failure: Option<GraphicsError>,
}

/// What a window shows.
pub(super) struct Shown<H> {
    /// In pixels.
    pub(super) size: (u32, u32),
    pub(super) time_step: Duration,
    pub(super) timeline: Arc<Timeline>,
    pub(super) hand: H,
}

/// Connects to the display. Winit panics where one of the libraries is missing that it loads only now,
/// which is to be told like all else.
fn event_loop() -> Result<EventLoop<()>, GraphicsError> {
    let hook = panic::take_hook();
    panic::set_hook(Box::new(|_| {}));
    let made = panic::catch_unwind(EventLoop::new);
    panic::set_hook(hook);
    match made {
        Ok(made) => made.map_err(|_| GraphicsError::NoDisplay),
        Err(panic) => {
            let reason = words_of(&*panic).unwrap_or("the display refused");
            Err(GraphicsError::Surface { reason: reason.trim_end_matches('.').to_owned() })
        }
    }
}

impl<H: Hand> View<H> {
    /// Opens a window.
    ///
    /// # Errors
    /// No display, no window, no adapter that can draw to it.
    pub(super) fn open(
        shown: Shown<H>,
        (look, home): (Look, Camera),
        adapter: Option<&str>,
        controls: Controls,
    ) -> Result<Self, GraphicsError> {
        let refused = |reason: String| GraphicsError::Surface { reason };
        let mut event_loop = event_loop()?;
        let mut input = Input::new(shown.size);
        event_loop.pump_app_events(Some(Duration::from_millis(100)), &mut input);
        let window = match (input.window.clone(), input.failure.take()) {
            (Some(window), _) => window,
            (None, reason) => return Err(refused(reason.unwrap_or("it did not open".to_owned()))),
        };
        let display = Box::new(event_loop.owned_display_handle());
        let instance = Instance::new(InstanceDescriptor::new_with_display_handle_from_env(display));
        let surface = surface::create(&instance, &window)?;
        let gpu = Gpu::for_surface(&instance, &surface, adapter)?;
        let screen = Screen::new(&gpu, surface, Arc::clone(&window), input.size)?;
        let overlay_painter = OverlayPainter::new(&gpu, screen.format());
        input.egui = Some(overlay_painter.input(&gpu, &window));
        // What an adapter can draw often enough.
        let quality = if gpu.is_software() { Quality::Fast } else { Quality::Fine };
        let mut painter = Painter::new(gpu, look, quality, screen.format(), screen.size())?;
        painter.camera = home;
        let refresh =
            window.current_monitor().and_then(|monitor| monitor.refresh_rate_millihertz());
        let refresh = refresh.map(|rate| f64::from(rate.max(1_000)) * 1e-3);
        let pace = Pace::new(refresh, shown.time_step, painter.gpu().is_software());
        Ok(Self {
            event_loop: SendWrapper::new(event_loop),
            input,
            window,
            instance,
            screen,
            home,
            painter,
            overlay_painter,
            overlay: Overlay::new(),
            hand: shown.hand,
            controls,
            stats: Arc::new(Mutex::new(Stats::new())),
            timeline: shown.timeline,
            mailbox: Mailbox::new(),
            is_shown: true,
            pace,
            is_display_gone: false,
            failure: None,
        })
    }

    /// Whether the person has closed it.
    pub(super) fn is_closed(&self) -> bool {
        self.input.is_closing
    }

    /// Why nothing is drawn any more, if so.
    pub(super) fn failure(&self) -> Option<GraphicsError> {
        self.failure.clone().or_else(|| self.painter.failure())
    }

    /// Goes where nothing is drawn any more: frames that are still to come run without it, and without what the person
    /// held.
    pub(super) fn leave(&mut self) {
        self.act(Gesture::Release);
        self.hand.leave();
        self.controls.is_paused = false;
        self.window.set_visible(false);
    }

    /// Another environment is shown. One in the same place is seen as it was.
    pub(super) fn turn_to(&mut self, (look, home): (Look, Camera), mailbox: Mailbox) {
        if look.focus != self.painter.look.focus {
            self.painter.look = look;
            (self.painter.camera, self.home) = (home, home);
        }
        self.mailbox = mailbox;
        self.hand.forget();
    }

    /// Does what the person did, after waiting for it for up to `timeout`.
    pub(super) fn attend(&mut self, timeout: Duration) {
        if self.is_display_gone {
            return;
        }
        let pumped = self.event_loop.pump_app_events(Some(timeout), &mut self.input);
        if let PumpStatus::Exit(_) = pumped {
            // Nobody here ends the loop: it does so itself when there is no display any more.
            self.is_display_gone = true;
            let reason = "the display is gone".to_owned();
            self.failure.get_or_insert(GraphicsError::Surface { reason });
        }
        if let Some(reason) = self.input.failure.take() {
            self.failure.get_or_insert(GraphicsError::Surface { reason });
        }
        if self.failure().is_some() {
            // It may still be closed, where a display lets no window go.
            self.input.gestures.clear();
            return;
        }
        let mut gestures = std::mem::take(&mut self.input.gestures);
        for gesture in gestures.drain(..) {
            self.act(gesture);
        }
        // The list keeps its memory.
        self.input.gestures = gestures;
        if self.screen.follow(self.painter.gpu(), self.input.size) {
            let (width, height) = self.screen.size();
            if let Err(error) = self.painter.resize(width, height) {
                self.failure = Some(error);
            }
        }
        self.painter.look.coloring = self.controls.coloring;
    }

    fn act(&mut self, gesture: Gesture) {
        let Self { hand, painter, controls, input, .. } = self;
        let camera = &mut painter.camera;
        match gesture {
            Gesture::Press(cursor) => {
                let (hand, aim) = self.aimed(cursor);
                hand.press(&aim);
            }
            Gesture::Release => {
                let cursor = input.cursor;
                let (hand, aim) = self.aimed(cursor);
                hand.release(&aim);
            }
            Gesture::Drag(MouseButton::Left, _) if hand.is_busy() => {}
            Gesture::Drag(button, by) => {
                let by = by / painter.size().1 as f32;
                match button {
                    MouseButton::Left | MouseButton::Right => {
                        painter.camera.orbit(-TURN * by.x, TURN * by.y);
                    }
                    MouseButton::Middle => {
                        let aspect = painter.aspect();
                        painter.camera.pan(Vec2::new(by.x, -by.y), aspect);
                    }
                    _ => {}
                }
            }
            Gesture::Wheel(lines) if hand.is_busy() => hand.wheel(lines),
            Gesture::Wheel(lines) => camera.zoom(ZOOM.powf(lines)),
            Gesture::Pause => controls.is_paused = !controls.is_paused,
            Gesture::Step => controls.steps += u64::from(controls.is_paused),
            Gesture::ResetCamera => *camera = self.home,
            Gesture::Overlay => controls.is_shown = !controls.is_shown,
            Gesture::Key(key) => hand.key(key),
        }
    }

    /// The hand follows the mouse.
    pub(super) fn follow(&mut self, has_time_passed: bool) {
        let (hand, aim) = self.aimed(self.input.cursor);
        hand.follow(&aim, has_time_passed);
    }

    /// The hand, and what it aims at with the mouse at a pixel of the window.
    fn aimed(&mut self, cursor: Vec2) -> (&mut H, Aim<'_>) {
        let Self { hand, painter, mailbox, .. } = self;
        let (width, height) = painter.size();
        let share = cursor / Vec2::new(width as f32, height as f32);
        let point = Vec2::new(2.0 * share.x - 1.0, 1.0 - 2.0 * share.y);
        (hand, Aim { painter, mailbox, point })
    }

    /// Whether there is anything to be seen.
    fn is_visible(&self) -> bool {
        let size = self.input.size;
        size.width > 0 && size.height > 0 && self.window.is_minimized() != Some(true)
    }

    /// The objects that come next are shown.
    pub(super) fn show_next(&mut self) {
        self.is_shown = true;
    }

    /// Time stood still: what was missed is not made up for.
    pub(super) fn interrupt(&mut self) {
        self.pace.interrupt();
        stats::lock(&self.stats).interrupt();
    }

    /// Draws what was taken, and the overlay, and presents both.
    fn present(&mut self) -> Result<(), GraphicsError> {
        let begun = Instant::now();
        let texture = match self.is_visible() {
            true => self.screen.next(self.painter.gpu(), &self.instance)?,
            false => None,
        };
        let Some(texture) = texture else {
            self.painter.discard();
            self.pace.missed(begun);
            return Ok(());
        };
        let commands = self.encode(&texture.texture);
        let gpu = self.painter.gpu();
        gpu.queue.submit(commands);
        self.window.pre_present_notify();
        gpu.queue.present(texture);
        self.pace.shown(gpu, begun);
        Ok(())
    }

    /// Encodes how what was taken, and the overlay, is drawn to a texture of the window's format and size.
    fn encode(&mut self, texture: &Texture) -> Vec<CommandBuffer> {
        let picture = texture.create_view(&Default::default());
        let mut encoder = self.painter.gpu().device.create_command_encoder(&Default::default());
        self.painter.paint(&mut encoder, &picture);
        let Self {
            painter, overlay_painter, overlay, input, controls, hand, stats, timeline, ..
        } = self;
        let camera = painter.camera;
        let mut commands = match &mut input.egui {
            Some(egui) => overlay_painter.paint(
                painter.gpu(),
                (&self.window, egui),
                (&mut encoder, texture),
                |ui| overlay.show(ui, (controls, hand), &camera, &stats::lock(stats), timeline),
            ),
            None => Vec::new(),
        };
        commands.push(encoder.finish());
        commands
    }

    /// What the window shows of what was taken.
    pub(super) fn picture(&mut self) -> Result<Picture, GraphicsError> {
        let (width, height) = self.painter.size();
        let texture = self.painter.gpu().device.create_texture(&TextureDescriptor {
            label: Some("picture of the window"),
            size: Extent3d { width, height, depth_or_array_layers: 1 },
            mip_level_count: 1,
            sample_count: 1,
            dimension: TextureDimension::D2,
            format: self.screen.format(),
            usage: TextureUsages::RENDER_ATTACHMENT | TextureUsages::COPY_SRC,
            view_formats: &[],
        });
        let commands = self.encode(&texture);
        self.painter.gpu().queue.submit(commands);
        read_texture(self.painter.gpu(), &texture)
    }

    /// Draws what was taken.
    pub(super) fn redraw(&mut self) {
        if let Err(error) = self.present() {
            self.failure = Some(error);
        }
    }
}

impl<H: Hand> Renderer for View<H> {
    fn draw(&mut self, object: &Object) {
        self.hand.see(object);
        if self.is_shown {
            self.painter.add(object);
        }
    }

    fn swap(&mut self, _frame: u64) {
        if self.is_shown {
            self.redraw();
        }
        self.is_shown = false;
        self.attend(Duration::ZERO);
        if self.failure().is_some() {
            return;
        }
        self.follow(true);
        self.pace.keep(self.controls.is_real_time);
        // What is taken is drawn: else it would be there still when a last picture is taken.
        self.is_shown = !self.is_closed()
            && self.pace.shows(self.painter.gpu())
            && self.failure().is_none()
            && self.is_visible();
    }

    fn is_bound(&self) -> bool {
        true
    }
}
