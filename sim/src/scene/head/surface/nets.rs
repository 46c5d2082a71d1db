//! The surface of a field.

use fast_surface_nets::ndshape::{RuntimeShape, Shape};
use fast_surface_nets::{SurfaceNetsBuffer, surface_nets};
use glam::Vec3;

use super::Surface;
use super::manifold::fill;
use crate::geometry::Bounds;

/// Room around the bounds, in grid steps, so that the surface closes within the grid.
const MARGIN: f32 = 2.0;

/// The largest part of the surface where `field` is 0, within `bounds`: closed, and with the side where
/// the field is positive as its outside.
///
/// The field is looked at on a grid of `spacing` metres, and the surface has edges of about 0.9 of that:
/// there is nothing to decimate.
pub(in crate::scene::head) fn extract(
    bounds: &Bounds,
    spacing: f32,
    field: impl Fn(Vec3) -> f32,
) -> Surface {
    let corner = bounds.min - Vec3::splat(MARGIN * spacing);
    let sides = (bounds.max - bounds.min) / spacing + Vec3::splat(2.0 * MARGIN + 1.0);
    let dims = sides.ceil().to_array().map(|side| (side as u32).max(2));
    let shape = RuntimeShape::<u32, 3>::new(dims);
    let place = |point: [f32; 3]| corner + Vec3::from(point) * spacing;
    let mut values: Vec<f32> = (0..shape.size())
        .map(|number| {
            let point = shape.delinearize(number);
            let at_side = (0..3).any(|axis| point[axis] == 0 || point[axis] == dims[axis] - 1);
            let value = field(place(point.map(|index| index as f32)));
            if at_side { value.max(spacing) } else { value }
        })
        .collect();
    fill(&mut values, dims.map(|side| side as usize), spacing);
    let mut buffer = SurfaceNetsBuffer::default();
    surface_nets(&values, &shape, [0; 3], dims.map(|side| side - 1), &mut buffer);
    let positions: Vec<Vec3> = buffer.positions.iter().map(|&point| place(point)).collect();
    let (quads, _) = buffer.indices.as_chunks::<6>();
    let triangles = quads.iter().flat_map(|&quad| split(&positions, quad)).collect();
    Surface { positions, triangles }.largest_part()
}

/// The two triangles of a quad, given as two triangles: split along its shorter diagonal. The crate also
/// does so, but compares lengths whose last bits depend on the machine's vector unit.
fn split(positions: &[Vec3], [a, b, c, d, e, f]: [u32; 6]) -> [[u32; 3]; 2] {
    let second = [d, e, f];
    // The first triangle with the corner first that the second one does not have.
    let first = [[a, b, c], [b, c, a], [c, a, b]];
    let alone = first.into_iter().find(|[corner, ..]| !second.contains(corner));
    let [p, q, s] = alone.unwrap_or([a, b, c]);
    let across = second.into_iter().find(|corner| ![p, q, s].contains(corner));
    let r = across.unwrap_or(d);
    let length = |a: u32, b: u32| (positions[a as usize] - positions[b as usize]).length();
    let [one, two] = [length(p, r), length(q, s)];
    if one < two || one == two && p.min(r) < q.min(s) {
        [[p, q, r], [p, r, s]]
    } else {
        [[p, q, s], [q, r, s]]
    }
}
