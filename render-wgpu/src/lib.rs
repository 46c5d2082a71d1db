//! The renderer of dualframe's virtual environments.
//!
//! The wgpu renderer is still to come. Until then this package holds the `dualframe` program,
//! which runs environments without a picture.
#![forbid(unsafe_code)]
