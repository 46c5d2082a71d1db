//! Medical images: what is read is what was written, and files of every kind of fault are refused.
#![cfg(feature = "image")]
#![forbid(unsafe_code)]

mod faults;
mod files;
mod round_trips;
mod saves;
