//! The renderer of dualframe's virtual environments, on wgpu.
//!
//! One thread has it at a time, and what it does is only what must be single: an object's positions are copied as
//! they are ([`renderer::Painter::add`]), and a frame is encoded and submitted in a handful of calls. Normals,
//! colours and shadows are made on the device. Everything is drawn opaque: the fourth number of an object's
//! [colour](dualframe_sim::object::VisualProperties::color) is not looked at.
//!
//! | module | what it has |
//! |---|---|
//! | [`gpu`] | the device and how it is chosen |
//! | [`renderer`] | what draws, into any texture or offscreen |
//! | [`camera`], [`look`] | from where, and how |
//! | [`picture`] | finished pictures, PNG |
//! | [`auxiliary`], [`pick`] | GPU work besides drawing (§9); what is under a pixel |
//! | [`springs`] | mass–spring bodies whose springs the device integrates |
//! | [`error`] | what can go wrong |
//!
//! `examples/own_picture.rs` draws a scene of one's own.
//!
//! The `dualframe` program is in this package too, behind the feature `app`, which is on by default.
#![forbid(unsafe_code)]

pub mod auxiliary;
pub mod camera;
pub mod error;
mod globals;
pub mod gpu;
pub mod look;
pub mod pick;
pub mod picture;
pub mod renderer;
mod room;
pub mod springs;
mod surface;
mod target;
mod volume;

/// Whose devices, textures and encoders the renderer works with, in the version that it is built with.
pub use wgpu;
