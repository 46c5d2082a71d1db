//! The `dualframe` program from outside.
#![forbid(unsafe_code)]

mod command;
mod craniotomy;
mod outputs;
mod replay;
mod report;
mod window;
mod without_graphics;
