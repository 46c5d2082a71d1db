//! dualframe
fn main() {}
