//! What two hands do in an operation, frame by frame.

use glam::{Quat, Vec3};

use crate::behavior::Instrument;
use crate::device::DeviceSample;
use crate::device::motion::{Keyframe, Motion};
use crate::mailbox::Mailbox;
use crate::message::Message;
use crate::object::ObjectId;

/// Frames between a frame's swap and the one in which what is posted then is processed; see [`Mailbox`].
const AHEAD: u64 = 2;

/// One movement of a hand.
#[derive(Clone, Debug)]
pub(super) struct Stroke {
    /// What the hand holds.
    pub(super) instrument: Instrument,
    /// From the tip along the handle, of unit length.
    pub(super) axis: Vec3,
    /// Where the tip goes, in metres; a straight line between two points.
    pub(super) path: Vec<Vec3>,
    /// How fast, in metres per second.
    pub(super) speed: f32,
    /// Whether the instrument's button is pressed.
    pub(super) pressed: bool,
}

/// What a hand says in one frame.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Cue {
    sample: DeviceSample,
    instrument: Instrument,
}

/// What two hands do, frame by frame.
#[derive(Clone, Debug)]
pub(super) struct Script {
    tools: [ObjectId; 2],
    hands: [Vec<Cue>; 2],
    time_step: f32,
}

impl Script {
    /// Two hands that rest.
    pub(super) fn new(tools: [ObjectId; 2], time_step: f32) -> Self {
        Self { tools, hands: [Vec::new(), Vec::new()], time_step }
    }

    /// The number of frames until both hands are done.
    pub(super) fn frames(&self) -> u64 {
        self.hands.iter().map(Vec::len).max().unwrap_or(0) as u64
    }

    /// A hand goes on with a stroke.
    pub(super) fn stroke(&mut self, hand: usize, stroke: &Stroke) {
        let &Stroke { instrument, axis, speed, pressed, .. } = stroke;
        let (orientation, buttons) = (upright_to(axis), u32::from(pressed));
        let cue =
            |position| Cue { sample: DeviceSample { position, orientation, buttons }, instrument };
        let step = speed * self.time_step;
        self.hands[hand].extend(even_steps(&stroke.path, step).map(cue));
    }

    /// A hand stays as it is for so many frames.
    pub(super) fn wait(&mut self, hand: usize, frames: usize) {
        if let Some(&last) = self.hands[hand].last() {
            self.hands[hand].extend(std::iter::repeat_n(last, frames));
        }
    }

    /// Both hands wait for the slower one.
    pub(super) fn meet(&mut self) {
        let longest = self.hands.iter().map(Vec::len).max().unwrap_or(0);
        for hand in 0..2 {
            self.wait(hand, longest - self.hands[hand].len());
        }
    }

    /// What a hand does, frame by frame, on a haptic loop's clock that begins with the first frame; none for
    /// a hand that does nothing.
    pub(super) fn motion(&self, hand: usize) -> Option<Motion> {
        let keyframe = |(frame, cue): (usize, &Cue)| Keyframe {
            time: frame as f64 * f64::from(self.time_step),
            sample: cue.sample,
        };
        Motion::new(self.hands.get(hand)?.iter().enumerate().map(keyframe)).ok()
    }

    /// Posts what the hands do in the frame two after `swapped`. A tool switch is told when it happens. Of a
    /// hand that is `led` by a device nothing else is told.
    pub(super) fn post(&self, swapped: u64, led: [bool; 2], mailbox: &Mailbox) {
        let frame = (swapped + AHEAD) as usize;
        for ((tool, cues), led) in self.tools.into_iter().zip(&self.hands).zip(led) {
            let Some(cue) = cues.get(frame) else { continue };
            let before = frame.checked_sub(1).and_then(|before| cues.get(before));
            // Nothing is posted for the first frames: their cues are told with the first that is.
            let is_first = frame as u64 == AHEAD;
            if is_first || before.is_none_or(|before| before.instrument != cue.instrument) {
                mailbox.post(tool, Message::TakeUp(cue.instrument));
            }
            if !led && (is_first || before != Some(cue)) {
                mailbox.post(tool, Message::Device(cue.sample));
            }
        }
    }
}

/// Points at even distances along a path, its last point included.
fn even_steps(path: &[Vec3], step: f32) -> impl Iterator<Item = Vec3> + '_ {
    let pieces = path.windows(2).flat_map(move |ends| {
        let (from, to) = (ends[0], ends[1]);
        let way = to - from;
        let steps = (way.length() / step).ceil().max(1.0) as u32;
        (1..=steps).map(move |number| from + way * (number as f32 / steps as f32))
    });
    path.first().copied().into_iter().chain(pieces)
}

/// The turn that takes +z, along which a tool's handle lies, to `axis`, of unit length: the shortest.
fn upright_to(axis: Vec3) -> Quat {
    // Component by component: the quaternion type's own sums differ between vector units.
    let [x, y, w] = [-axis.y, axis.x, 1.0 + axis.z];
    let length = (x * x + y * y + w * w).sqrt();
    if length < 1e-3 {
        return Quat::from_xyzw(1.0, 0.0, 0.0, 0.0);
    }
    Quat::from_xyzw(x / length, y / length, 0.0, w / length)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stroke(path: &[Vec3], instrument: Instrument) -> Stroke {
        Stroke { instrument, axis: Vec3::Z, path: path.to_vec(), speed: 0.06, pressed: true }
    }

    #[test]
    fn steps_are_even_and_end_at_the_end() {
        let path = [Vec3::ZERO, Vec3::X * 0.01, Vec3::new(0.01, 0.0015, 0.0)];
        let points: Vec<_> = even_steps(&path, 0.001).collect();
        assert_eq!(points.len(), 1 + 10 + 2);
        assert_eq!(points.last(), path.last());
        assert!(points.windows(2).all(|pair| pair[0].distance(pair[1]) < 0.001_001));
        assert_eq!(even_steps(&[], 0.1).count(), 0);
        assert_eq!(even_steps(&[Vec3::X], 0.1).count(), 1);
    }

    #[test]
    fn handles_point_along_the_axis() {
        for axis in [Vec3::Z, Vec3::X, Vec3::NEG_Y, Vec3::new(0.6, 0.0, -0.8), Vec3::NEG_Z] {
            let handle = upright_to(axis) * Vec3::Z;
            assert!(handle.distance(axis) < 1e-6, "{axis} became {handle}");
        }
    }

    #[test]
    fn a_switch_is_told_once_and_rest_is_not_told() {
        let mut script = Script::new([ObjectId(0), ObjectId(1)], 1.0 / 60.0);
        script.stroke(0, &stroke(&[Vec3::ZERO, Vec3::X * 0.004], Instrument::Scalpel));
        script.wait(0, 3);
        script.stroke(0, &stroke(&[Vec3::X * 0.004, Vec3::ZERO], Instrument::Burr));
        script.stroke(1, &stroke(&[Vec3::Y], Instrument::Hook));
        script.meet();
        let mut told = Vec::new();
        for swapped in 0..script.frames() {
            let mailbox = Mailbox::new();
            script.post(swapped, [false; 2], &mailbox);
            mailbox.take(swapped + AHEAD, |to: ObjectId, message| {
                let switch = matches!(message, Message::TakeUp(_));
                told.push((swapped + AHEAD, to.0, switch));
            });
        }
        let switches: Vec<_> =
            told.iter().filter(|told| told.2).map(|told| (told.0, told.1)).collect();
        assert_eq!(switches, [(2, 0), (2, 1), (8, 0)]);
        let places: Vec<_> =
            told.iter().filter(|told| !told.2).map(|told| (told.0, told.1)).collect();
        // 5 points, rest until the switch, then 5 again.
        assert_eq!(
            places,
            [(2, 0), (2, 1), (3, 0), (4, 0), (8, 0), (9, 0), (10, 0), (11, 0), (12, 0)]
        );
    }
}
