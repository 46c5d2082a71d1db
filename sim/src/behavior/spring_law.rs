//! What a single spring does, in any lanes: those of a body's nodes or those of several bodies.
//!
//! The way from one end of a spring to the other is minus the way back, bit by bit, and either law pulls
//! the same however a spring is looked at. So a force subtracted at one end is the very force that the
//! other end would have added.

use crate::simd::Arithmetic;

/// The least squared length of a spring, m², which keeps a spring without length from dividing by 0.
/// It is far below the rounding error of any other.
pub(super) const LEAST_SQUARE: f32 = 1e-30;

/// How a spring pulls its first end, in newtons per metre of the way to its second end.
pub(super) trait Law<A: Arithmetic>: Copy {
    /// Whether the relative velocity matters; looking it up costs as much as the rest.
    const NEEDS_VELOCITY: bool;

    /// The pull over the way (m) to the second end, which moves with the relative velocity (m/s).
    fn pull(
        self,
        isa: A,
        way: [A::Vector; 3],
        relative: [A::Vector; 3],
        rest: A::Vector,
    ) -> A::Vector;
}

/// Hooke's law: k (1 − r/l).
#[derive(Clone, Copy)]
pub(super) struct Elastic<V> {
    pub(super) stiffness: V,
    pub(super) one: V,
}

impl<A: Arithmetic> Law<A> for Elastic<A::Vector> {
    const NEEDS_VELOCITY: bool = false;

    #[inline(always)]
    fn pull(
        self,
        isa: A,
        way: [A::Vector; 3],
        _relative: [A::Vector; 3],
        rest: A::Vector,
    ) -> A::Vector {
        let length = isa.sqrt(square(isa, way));
        isa.mul(self.stiffness, isa.sub(self.one, isa.div(rest, length)))
    }
}

/// A dashpot along the spring: c (w·d)/l².
#[derive(Clone, Copy)]
pub(super) struct Dashpot<V> {
    pub(super) damping: V,
}

impl<A: Arithmetic> Law<A> for Dashpot<A::Vector> {
    const NEEDS_VELOCITY: bool = true;

    #[inline(always)]
    fn pull(
        self,
        isa: A,
        way: [A::Vector; 3],
        relative: [A::Vector; 3],
        _rest: A::Vector,
    ) -> A::Vector {
        isa.div(isa.mul(self.damping, dot(isa, way, relative)), square(isa, way))
    }
}

#[inline(always)]
fn dot<A: Arithmetic>(isa: A, a: [A::Vector; 3], b: [A::Vector; 3]) -> A::Vector {
    let in_plane = isa.add(isa.mul(a[0], b[0]), isa.mul(a[1], b[1]));
    isa.add(in_plane, isa.mul(a[2], b[2]))
}

/// The squared length, and a bit more.
#[inline(always)]
fn square<A: Arithmetic>(isa: A, [x, y, z]: [A::Vector; 3]) -> A::Vector {
    let in_plane = isa.add(isa.mul(x, x), isa.mul(y, y));
    // The bit to one part: two short chains of additions instead of a long one.
    isa.add(in_plane, isa.add(isa.mul(z, z), isa.splat(LEAST_SQUARE)))
}

// By components, not by `map`: what the library does not inline is compiled for the baseline.

#[inline(always)]
pub(super) fn plus<A: Arithmetic>(isa: A, a: [A::Vector; 3], b: [A::Vector; 3]) -> [A::Vector; 3] {
    [isa.add(a[0], b[0]), isa.add(a[1], b[1]), isa.add(a[2], b[2])]
}

#[inline(always)]
pub(super) fn minus<A: Arithmetic>(isa: A, a: [A::Vector; 3], b: [A::Vector; 3]) -> [A::Vector; 3] {
    [isa.sub(a[0], b[0]), isa.sub(a[1], b[1]), isa.sub(a[2], b[2])]
}

#[inline(always)]
pub(super) fn times<A: Arithmetic>(isa: A, a: [A::Vector; 3], factor: A::Vector) -> [A::Vector; 3] {
    [isa.mul(a[0], factor), isa.mul(a[1], factor), isa.mul(a[2], factor)]
}

#[inline(always)]
pub(super) fn load<A: Arithmetic>(isa: A, lanes: &[A::Lanes; 3]) -> [A::Vector; 3] {
    [isa.load(&lanes[0]), isa.load(&lanes[1]), isa.load(&lanes[2])]
}

#[inline(always)]
pub(super) fn store<A: Arithmetic>(isa: A, vectors: [A::Vector; 3], lanes: &mut [A::Lanes; 3]) {
    let ([x, y, z], [to_x, to_y, to_z]) = (vectors, lanes);
    isa.store(x, to_x);
    isa.store(y, to_y);
    isa.store(z, to_z);
}

#[inline(always)]
pub(super) fn splat<A: Arithmetic>(isa: A, vector: [f32; 3]) -> [A::Vector; 3] {
    [isa.splat(vector[0]), isa.splat(vector[1]), isa.splat(vector[2])]
}
