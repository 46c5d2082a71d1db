//! Scenery.

use super::{Behavior, Input};
use crate::geometry::Geometry;

/// The behaviour of what never changes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Fixed;

impl Behavior for Fixed {
    fn update(&mut self, _geometry: &mut Geometry, _input: &mut Input<'_>) {}

    fn is_fixed(&self) -> bool {
        true
    }
}
