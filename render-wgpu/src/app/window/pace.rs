//! Which frames are shown, and when the next one is due.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use dualframe_render_wgpu::gpu::Gpu;
use wgpu::PollType;

/// Pictures per second where the display does not say how many it shows.
const USUAL_REFRESH: f64 = 60.0;
/// How far simulated time may be behind the clock before it is no longer made up for.
const MOST_LATE: Duration = Duration::from_millis(250);

/// Which frames are shown, and when the next one is due.
///
/// A display shows fewer frames than are computed, and an adapter may draw fewer still: while it draws one picture the
/// objects of the next are taken, and no more. An adapter in software draws on the cores that compute: there the next
/// picture waits until the last one is drawn, and then for as long again as that kept the cores from the objects, which
/// are so left half of them. Whether it is drawn is asked, not waited for; only to acquire a texture for a picture and
/// to present it whoever renders may have to wait, for the display or the device.
pub(super) struct Pace {
    is_software: bool,
    between_shown: Duration,
    next_shown: Instant,
    /// When the last picture was begun, of which it is not known that it is drawn; later by what was slept since, when
    /// nobody wanted the cores.
    begun: Option<Instant>,
    /// Pictures that were submitted and are not drawn, as the device says.
    under_way: Arc<AtomicUsize>,
    due: Instant,
    time_step: Duration,
}

impl Pace {
    /// For a display of so many pictures per second, and frames that are so far apart.
    pub(super) fn new(refresh: Option<f64>, time_step: Duration, is_software: bool) -> Self {
        let now = Instant::now();
        Self {
            is_software,
            between_shown: Duration::from_secs_f64(1.0 / refresh.unwrap_or(USUAL_REFRESH)),
            next_shown: now,
            begun: None,
            under_way: Arc::default(),
            due: now,
            time_step,
        }
    }

    /// Whether the frame that begins now is to be shown.
    pub(super) fn shows(&mut self, gpu: &Gpu) -> bool {
        // A failure is noted, and ends the pictures.
        let _ = gpu.poll(PollType::Poll);
        self.shows_at(Instant::now())
    }

    fn shows_at(&mut self, now: Instant) -> bool {
        // Relaxed: nothing else goes by it.
        let under_way = self.under_way.load(Ordering::Relaxed);
        if under_way > usize::from(!self.is_software) {
            return false;
        }
        if self.is_software
            && let Some(begun) = self.begun.take()
        {
            self.next_shown = self.next_shown.max(now + (now - begun));
        }
        now + self.time_step / 2 >= self.next_shown
    }

    /// A picture was submitted that was begun then: presenting may wait for the device, whatever the
    /// mode.
    pub(super) fn shown(&mut self, gpu: &Gpu, begun: Instant) {
        self.submitted(begun);
        let under_way = Arc::clone(&self.under_way);
        gpu.queue.on_submitted_work_done(move || {
            under_way.fetch_sub(1, Ordering::Relaxed);
        });
    }

    fn submitted(&mut self, begun: Instant) {
        self.under_way.fetch_add(1, Ordering::Relaxed);
        self.begun = Some(begun);
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
        std::thread::sleep(self.left_at(Instant::now(), is_real_time));
    }

    /// How long it is until the next frame is due, which is slept.
    fn left_at(&mut self, now: Instant, is_real_time: bool) -> Duration {
        self.due += self.time_step;
        if !is_real_time || now > self.due + MOST_LATE {
            self.due = now;
        }
        let left = self.due.saturating_duration_since(now);
        self.begun = self.begun.map(|begun| begun + left);
        left
    }

    /// Time stood still: what was missed is not made up for.
    pub(super) fn interrupt(&mut self) {
        self.due = Instant::now();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FRAMES: usize = 300;
    const TIME_STEP: Duration = Duration::from_nanos(1_000_000_000 / 60);

    /// How many of the frames are shown that are computed in so many milliseconds each, by a device that draws a
    /// picture in so many.
    fn shown(is_software: bool, computing: u64, drawing: u64, is_real_time: bool) -> usize {
        let mut pace = Pace::new(None, TIME_STEP, is_software);
        let [computing, drawing] = [computing, drawing].map(Duration::from_millis);
        let (mut now, mut is_shown, mut count) = (pace.due, true, 0);
        let mut drawn = Vec::new();
        for _ in 0..FRAMES {
            now += computing;
            if is_shown {
                count += 1;
                let begun = drawn.last().map_or(now, |&before: &Instant| before.max(now));
                drawn.push(begun + drawing);
                pace.submitted(now);
            }
            now += pace.left_at(now, is_real_time);
            drawn.retain(|&then| then > now);
            pace.under_way.store(drawn.len(), Ordering::Relaxed);
            is_shown = pace.shows_at(now);
        }
        count
    }

    #[test]
    fn every_frame_is_shown_that_display_and_device_can_show() {
        assert_eq!(shown(false, 2, 2, true), FRAMES, "in real time");
        assert_eq!(shown(false, 50, 2, true), FRAMES, "slower than real time");
        assert_eq!(shown(false, 50, 40, true), FRAMES, "by a slow device");
        let display = shown(false, 4, 1, false);
        assert!((65..=80).contains(&display), "{display}: 60 of 250 a second");
    }

    #[test]
    fn a_device_is_no_more_than_a_picture_behind() {
        let slow = shown(false, 10, 100, true);
        assert!((40..=55).contains(&slow), "{slow}: 10 of 60 a second");
    }

    #[test]
    fn software_leaves_half_of_the_cores_to_the_objects() {
        let busy = shown(true, 20, 200, false);
        assert!((13..=16).contains(&busy), "{busy}: one in 400 ms");
        // What it draws while nobody wants the cores is nobody's loss.
        assert_eq!(shown(true, 2, 10, true), FRAMES);
        let slow = shown(true, 2, 30, true);
        assert_eq!(slow, FRAMES / 2, "as soon as it is drawn");
    }
}
