//! The paper's experiments (§7–§8): Eqs. 2–4, Figs. 11–17 and Table 1 on this machine.
//!
//! Whatever is compared runs interleaved in one process, in rounds whose order rotates, with a
//! [`calibrator`] beside each round. Rounds in a bad phase of the machine are marked and counted, never
//! dropped: results are given over all rounds and over the good ones.
//!
//! | paper | module |
//! |---|---|
//! | §7.2, Eqs. 2–4 | [`speedup`] |

pub mod calibrator;
pub mod error;
pub mod load;
pub mod machine;
pub mod race;
pub mod speedup;
pub mod statistics;
pub mod timing;
mod work;
