//! What can go wrong with a graphics adapter.

use std::any::Any;

use thiserror::Error;

/// Why there is no picture, or no further one.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum GraphicsError {
    /// The machine has no adapter that could draw.
    #[error(
        "no graphics adapter was found; on Debian and Ubuntu the package mesa-vulkan-drivers brings \
         one in software"
    )]
    NoAdapter,
    /// No adapter has the name asked for.
    #[error("no graphics adapter is called {name:?}; there are: {there}")]
    NoSuchAdapter {
        /// The name asked for.
        name: String,
        /// The adapters there are.
        there: String,
    },
    /// The adapter lacks something that the renderer needs.
    #[error("the graphics adapter {adapter} lacks {lacking}")]
    Unfit {
        /// The adapter.
        adapter: String,
        /// What it lacks.
        lacking: String,
    },
    /// The adapter gave no device.
    #[error("the graphics adapter {adapter} cannot be used: {reason}")]
    NoDevice {
        /// The adapter.
        adapter: String,
        /// What its driver says.
        reason: String,
    },
    /// The picture is larger than the adapter can draw.
    #[error(
        "a picture of {width} by {height} pixels was asked for; there can be 1 to {most} each way"
    )]
    Size {
        /// Its width, in pixels.
        width: u32,
        /// Its height, in pixels.
        height: u32,
        /// The greatest width and height.
        most: u32,
    },
    /// The objects of a frame are more than the adapter's buffers hold.
    #[error("a frame of {needed} bytes was to be drawn; the adapter allows {most}")]
    Frame {
        /// What the frame needs, in bytes.
        needed: u64,
        /// What a buffer may have, in bytes.
        most: u64,
    },
    /// A volume is larger than the adapter can hold.
    #[error("a volume of {dims:?} voxels was to be drawn; the adapter allows {most} a side")]
    Volume {
        /// Its voxels along each axis.
        dims: [u32; 3],
        /// The most voxels along an axis.
        most: u32,
    },
    /// The device failed while it was drawing.
    #[error("the graphics device failed: {reason}")]
    Lost {
        /// What its driver says.
        reason: String,
    },
    /// There is no display, or it cannot be reached.
    #[error("there is no display")]
    NoDisplay,
    /// The window's surface cannot be drawn to.
    #[error("the window cannot be drawn to: {reason}")]
    Surface {
        /// What its driver says.
        reason: String,
    },
}

/// What a panic says, if it says anything: drivers and their wrappers panic where they should fail.
#[must_use]
pub fn words_of(panic: &(dyn Any + Send)) -> Option<&str> {
    let owned = panic.downcast_ref::<String>().map(String::as_str);
    owned.or_else(|| panic.downcast_ref().copied())
}
