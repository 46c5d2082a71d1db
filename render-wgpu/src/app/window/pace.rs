//! Which frames are shown, and when the next one is due.

use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use dualframe_render_wgpu::gpu::Gpu;
use wgpu::PollType;

/// Pictures per second where the display does not say how many it shows.
const USUAL_REFRESH: f64 = 60.0;
/// How far simulated time may be behind the clock before it is no longer made up for.
const MOST_LATE: Duration = Duration::from_millis(250);

/// Which frames are shown, and when the next one is due.
///
/// A display shows fewer frames than are computed, and an adapter may draw fewer still: the next picture
/// waits until the last one is drawn, and then for as long again as that took, so that an adapter in software
/// leaves half of the cores to the objects. Whether it is drawn is asked, not waited for; only to acquire a texture
/// for a picture and to present it whoever renders may have to wait, for the display or the device.
pub(super) struct Pace {
    between_shown: Duration,
    next_shown: Instant,
    /// When the picture under way was begun.
    begun: Option<Instant>,
    /// When it was drawn, as the device says.
    drawn: Arc<Mutex<Option<Instant>>>,
    due: Instant,
    time_step: Duration,
}

impl Pace {
    /// For a display of so many pictures per second, and frames that are so far apart.
    pub(super) fn new(refresh: Option<f64>, time_step: Duration) -> Self {
        let now = Instant::now();
        Self {
            between_shown: Duration::from_secs_f64(1.0 / refresh.unwrap_or(USUAL_REFRESH)),
            next_shown: now,
            begun: None,
            drawn: Arc::default(),
            due: now,
            time_step,
        }
    }

    /// Whether the frame that begins now is to be shown.
    pub(super) fn shows(&mut self, gpu: &Gpu) -> bool {
        if let Some(begun) = self.begun {
            // A failure is noted, and ends the pictures.
            let _ = gpu.poll(PollType::Poll);
            let Some(drawn) = self.drawn.lock().unwrap_or_else(PoisonError::into_inner).take()
            else {
                return false;
            };
            self.begun = None;
            self.next_shown = self.next_shown.max(drawn + (drawn - begun));
        }
        Instant::now() + self.time_step / 2 >= self.next_shown
    }

    /// A picture was submitted that was begun then: presenting may wait for the device, whatever the
    /// mode.
    pub(super) fn shown(&mut self, gpu: &Gpu, begun: Instant) {
        self.begun = Some(begun);
        let drawn = Arc::clone(&self.drawn);
        gpu.queue.on_submitted_work_done(move || {
            *drawn.lock().unwrap_or_else(PoisonError::into_inner) = Some(Instant::now());
        });
        // Regular, unless pictures are late anyway.
        self.next_shown = (self.next_shown + self.between_shown).max(begun);
    }

    /// There was no texture for a picture that was begun then: the next is asked for when another would be due,
    /// and not before as long again as the answer took.
    pub(super) fn missed(&mut self, begun: Instant) {
        let now = Instant::now();
        self.next_shown = now + (now - begun).max(self.between_shown);
    }

    /// Waits until the next frame is due, if it is to be no faster than the real world.
    pub(super) fn keep(&mut self, is_real_time: bool) {
        let now = Instant::now();
        self.due += self.time_step;
        if !is_real_time || now > self.due + MOST_LATE {
            self.due = now;
        } else if self.due > now {
            std::thread::sleep(self.due - now);
        }
    }

    /// Time stood still: what was missed is not made up for.
    pub(super) fn interrupt(&mut self) {
        self.due = Instant::now();
    }
}
