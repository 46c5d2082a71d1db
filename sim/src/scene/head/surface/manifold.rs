//! Signs on a grid whose surface has no edges of more than two faces and no pinched corners.

/// How deep a corner that is filled lies below the surface, as a part of the grid's spacing.
const FILL: f32 = 0.1;

/// Lowers values of a grid until its surface is a manifold.
///
/// A surface net has one corner for each cube that holds positive and negative values. It is pinched
/// where a cube's negative corners, or its positive ones, are not connected along its edges, as they never are
/// where a face's are not: there, one positive corner after the other, the least first, becomes negative.
pub(super) fn fill(values: &mut [f32], dims: [usize; 3], spacing: f32) {
    let [wide, high, deep] = dims;
    let ambiguous: Vec<bool> = (0..=255).map(is_ambiguous).collect();
    loop {
        let mut settled = true;
        for cube in 0..(wide - 1) * (high - 1) * (deep - 1) {
            let (x, rest) = (cube % (wide - 1), cube / (wide - 1));
            let (y, z) = (rest % (high - 1), rest / (high - 1));
            let corner = |corner: usize| {
                let [dx, dy, dz] = [corner & 1, corner >> 1 & 1, corner >> 2 & 1];
                ((z + dz) * high + y + dy) * wide + x + dx
            };
            loop {
                let negative =
                    |bits: u8, at: usize| bits | u8::from(values[corner(at)] < 0.0) << at;
                if !ambiguous[usize::from((0..8).fold(0, negative))] {
                    break;
                }
                let positive = (0..8).map(corner).filter(|&at| values[at] >= 0.0);
                let least = positive.reduce(|a, b| if values[b] < values[a] { b } else { a });
                let Some(least) = least else { break };
                values[least] = -FILL * spacing;
                settled = false;
            }
        }
        if settled {
            return;
        }
    }
}

/// Whether a cube whose negative corners are these bits has a pinched surface.
fn is_ambiguous(negative: u8) -> bool {
    !is_connected(negative) || !is_connected(!negative)
}

/// Whether a cube's corners are connected along its edges.
fn is_connected(corners: u8) -> bool {
    let mut reached = corners & corners.wrapping_neg();
    for _ in 0..8 {
        let before = reached;
        for corner in (0..8).filter(|corner| before >> corner & 1 == 1) {
            let beside = (0..3).fold(0, |bits, axis| bits | 1 << (corner ^ (1 << axis)));
            reached |= beside & corners;
        }
    }
    reached == corners
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_ambiguous() {
        for (negative, expected) in [
            (0b0000_0000, false),
            (0b0000_0001, false),
            (0b0000_0011, false),
            // Two corners across a face, and across the cube.
            (0b0000_1001, true),
            (0b1000_0001, true),
            // All but them.
            (0b1111_0110, true),
            (0b0111_1110, true),
            // Three corners around one, and half a cube.
            (0b0001_0111, false),
            (0b0000_1111, false),
        ] {
            assert_eq!(is_ambiguous(negative), expected, "{negative:#b}");
        }
    }

    #[test]
    fn filling_settles() {
        let mut state = 1_u64;
        let mut values: Vec<f32> = (0..1_000)
            .map(|_| {
                state = crate::mix::mix(state + 1);
                (state >> 40) as f32 / (1 << 23) as f32 - 0.6
            })
            .collect();
        fill(&mut values, [10; 3], 1.0);
        let at = |x: usize, y: usize, z: usize| values[(z * 10 + y) * 10 + x] < 0.0;
        for cube in 0..729 {
            let (x, y, z) = (cube % 9, cube / 9 % 9, cube / 81);
            let negative = (0..8).fold(0, |bits, c: usize| {
                bits | u8::from(at(x + (c & 1), y + (c >> 1 & 1), z + (c >> 2 & 1))) << c
            });
            assert!(!is_ambiguous(negative));
        }
    }
}
