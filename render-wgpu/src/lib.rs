//! The renderer of dualframe's virtual environments, on wgpu.
//!
//! It belongs to whoever holds the pipeline's one render token, and what runs under the token is only
//! what must be single: an object's positions are copied as they are ([`renderer::Painter::add`]), and a frame is
//! encoded and submitted in a handful of calls. Normals, colours and shadows are made on the device.
//!
//! | module | what it has |
//! |---|---|
//! | [`gpu`] | the device and how it is chosen |
//! | [`renderer`] | what draws, into any texture or offscreen |
//! | [`camera`], [`look`] | from where, and how |
//! | [`picture`] | finished pictures, PNG |
//! | [`auxiliary`], [`pick`] | GPU work besides drawing (§9); what is under a pixel |
//! | [`error`] | what can go wrong |
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
mod surface;
mod target;
mod volume;
