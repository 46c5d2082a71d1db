//! Cutting a triangle surface exactly along the path of a blade.
//!
//! A blade is a segment, from its tip to its heel. From one frame to the next it sweeps a quadrilateral,
//! and the cut is where that crosses the surface as it lies now. The blade's path is followed from
//! triangle to triangle ([`walk`]). Everything is made of two elementary changes of the surface
//! ([`surface`]): a new node on an edge, which divides the one or two triangles there in two, and a new
//! node in a triangle, which divides it in three. So the known cases come about by themselves: a path
//! across two edges of a triangle leaves three triangles, one from a node to an edge two, one from node
//! to node none but an edge that is cut; and whatever is cut, triangles keep their orientation, no edge
//! ever has more than two, and the rest areas add up to what they were.
//!
//! A crossing near an end of its edge is moved to that end, so that there are no slivers: within
//! [`SNAP`] of the edge's length, or [`BORDER_SNAP`] at a border, and wherever a new edge would be
//! shorter than the surface allows.
//!
//! Then the sides of the cut are parted ([`separate`]): a node has as many copies as its fan of triangles
//! has components when edges that are cut no longer join them. No plane says which side is which, so
//! cuts may cross, end on each other, or close.
//!
//! **The tip.** A cut begins where the blade was when it first moved within the surface, and ends at the
//! last edge that it crossed: the front, a node that both sides share. The next frame goes on from there.
//! So a cut lags behind the blade by less than a triangle, but its nodes on edges are exactly where the
//! blade crossed them. A blade that leaves the surface leaves the front behind for good; one that leaves
//! it over its border, or an earlier cut, cuts to that border, and from there on where it comes to
//! the surface again.
//!
//! New nodes lie on the rest shape where they lie in the deformed one, by the same shares of the nodes
//! around: the rest shape is never replaced by the deformed one. Node numbers keep their meaning; new
//! nodes come after them.

mod contact;
mod separate;
mod surface;
mod walk;

#[cfg(test)]
mod tests;

use glam::Vec3;

use super::Bounds;

pub(crate) use surface::{Birth, CutSurface, Node as CutNode};

/// How near an end of an edge, as a share of its length, a crossing is moved to that end; usually 0.1.
const SNAP: f64 = 0.1;
/// Likewise for an edge at the border; usually 0.25.
const BORDER_SNAP: f64 = 0.25;

/// The cutting edge of a blade at one moment: a segment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Blade {
    /// The end that goes into the tissue, in metres.
    pub tip: Vec3,
    /// The end at the handle, in metres.
    pub heel: Vec3,
}

impl Blade {
    /// Whether both ends are finite.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        self.tip.is_finite() && self.heel.is_finite()
    }

    /// The point at a share of the way from the tip to the heel.
    pub(crate) fn at(&self, share: f64) -> glam::DVec3 {
        let [tip, heel] = [self.tip.as_dvec3(), self.heel.as_dvec3()];
        tip + (heel - tip) * share
    }
}

/// What a blade did in a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Sweep {
    pub(crate) before: Blade,
    pub(crate) now: Blade,
}

impl Sweep {
    /// The box around all that the blade has passed.
    pub(crate) fn bounds(&self) -> Bounds {
        Bounds::around(
            [self.before, self.now].into_iter().flat_map(|blade| [blade.tip, blade.heel]),
        )
    }
}
