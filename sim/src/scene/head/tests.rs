//! The synthetic head, as a whole.
