//! The craniotomy (§7.1.2): two tools, 27 soft structures and the skull.

mod score;
mod script;

pub use score::{Report, Score};
