//! Why a response cannot be built.

use thiserror::Error;

/// Why a response cannot be built.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
#[error("{what} is {value}; it must be finite and not negative")]
pub struct ResponseError {
    /// The name of the value.
    pub what: &'static str,
    /// The value.
    pub value: f32,
}

pub(super) fn check(what: &'static str, value: f32) -> Result<(), ResponseError> {
    if value >= 0.0 && value.is_finite() { Ok(()) } else { Err(ResponseError { what, value }) }
}
