//! Sessions that are recorded, and replayed: the same bits in every way of running, and never another
//! session from a spoilt file.
#![forbid(unsafe_code)]

mod files;
mod session;
mod tissue;
mod ways;
