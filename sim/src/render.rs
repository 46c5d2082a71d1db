//! The render stage's device side.

use crate::geometry::Geometry;
use crate::object::Object;

/// A graphics device. One thread has it at a time: it need not be shareable between threads, but may go from one to
/// the other, to where objects were updated. Such a thread may be one of a rayon pool whose others are all at work:
/// what is called here, or told of frames, must not wait for rayon.
pub trait Renderer: Send {
    /// Draws one object of the current frame in the way its [`Drawing`] says. Objects come in no
    /// particular order.
    ///
    /// [`Drawing`]: crate::object::Drawing
    fn draw(&mut self, object: &Object);

    /// Ends the frame: everything of `frame` is drawn.
    fn swap(&mut self, frame: u64);

    /// Whether it has to stay with the thread that lets the environment run, as the event loop of a window has to on
    /// some systems. Usually not: objects may then be drawn by threads that updated them, in whose caches they are.
    fn is_bound(&self) -> bool {
        false
    }
}

/// A renderer without a device: it reads what a real one would upload and keeps a checksum of it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct NullRenderer {
    checksum: u64,
    draws: u64,
    swaps: u64,
}

impl NullRenderer {
    /// A renderer that has drawn nothing.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// A checksum over everything drawn so far, the same for any order within a frame.
    #[must_use]
    pub fn checksum(&self) -> u64 {
        self.checksum
    }

    /// The number of objects drawn so far.
    #[must_use]
    pub fn draws(&self) -> u64 {
        self.draws
    }

    /// The number of frames swapped so far.
    #[must_use]
    pub fn swaps(&self) -> u64 {
        self.swaps
    }
}

/// An odd number without pattern in its bits (2⁶⁴ over the golden ratio), to spread sums.
const SPREAD: u64 = 0x9e37_79b9_7f4a_7c15;

impl Renderer for NullRenderer {
    fn draw(&mut self, object: &Object) {
        let sum = match &object.geometry {
            Geometry::Mesh(mesh) => mesh.positions.as_slices().map(bit_sum),
            Geometry::Rigid(rigid) => rigid.pose.translation.to_array().map(f32::to_bits),
            Geometry::Volume(volume) => {
                let [x, y, z] = volume.pose.translation.to_array().map(f32::to_bits);
                let digest = volume.digest();
                [x ^ digest as u32, y ^ (digest >> 32) as u32, z]
            }
        };
        let [x, y, z] = sum.map(u64::from);
        let mixed = x ^ y.rotate_left(21) ^ z.rotate_left(42) ^ u64::from(object.id().0);
        self.checksum = self.checksum.wrapping_add(mixed.wrapping_mul(SPREAD));
        self.draws += 1;
    }

    fn swap(&mut self, frame: u64) {
        self.checksum = (self.checksum ^ frame).wrapping_mul(SPREAD);
        self.swaps += 1;
    }
}

fn bit_sum(values: &[f32]) -> u32 {
    values.iter().fold(0, |sum, value| sum.wrapping_add(value.to_bits()))
}
