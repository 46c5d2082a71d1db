//! Interactive, physically based virtual environments: objects, their interactions and their
//! behaviour, and the executors that advance them frame by frame.
//!
//! An environment is a list of [`object::Object`]s and a table of [`interaction::Rules`]. Its frames
//! have four stages: broad phase, interaction, update and render. The stages themselves are
//! [`stages::Stages`], work on [`block::Block`]s of objects, and are the same for every executor; so
//! are the results, bit for bit, whatever the executor, the number of threads and the blocking.

#![forbid(unsafe_code)]

pub mod behavior;
pub mod block;
pub mod blocking;
pub mod executor;
pub mod geometry;
pub mod interaction;
pub mod manager;
pub mod message;
pub mod object;
pub mod pool;
pub mod render;
pub mod scene;
pub mod stages;
pub mod state;
