//! Symmetric 3×3 matrices by their principal directions.

use glam::{DMat3, DVec3};

/// Sweeps over the three off-diagonal elements. Usually 8: convergence is quadratic, and 3×3 matrices
/// in double precision are diagonal after 4 to 6.
const SWEEPS: usize = 8;

/// The eigenvalues and, as columns, the unit eigenvectors of a symmetric matrix, in no particular order.
///
/// Jacobi's method, cyclic by rows (Golub & Van Loan, "Matrix Computations", §8.5). A closed form, as
/// parry's, is faster, but loses the eigenvectors where the two smallest eigenvalues are equal: a
/// tool in a groove has just such a stiffness. It takes square roots only, so the bits are the same
/// everywhere.
pub(super) fn principal(symmetric: DMat3) -> (DVec3, DMat3) {
    let (mut matrix, mut vectors) = (symmetric, DMat3::IDENTITY);
    for _ in 0..SWEEPS {
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            let Some(rotation) = annihilating(&matrix, p, q) else { continue };
            matrix = rotation.transpose() * matrix * rotation;
            vectors *= rotation;
        }
    }
    (DVec3::new(matrix.x_axis.x, matrix.y_axis.y, matrix.z_axis.z), vectors)
}

/// The rotation in the plane of axes p and q that makes the element there zero; none if it is.
fn annihilating(matrix: &DMat3, p: usize, q: usize) -> Option<DMat3> {
    let off = matrix.col(q)[p];
    if off == 0.0 {
        return None;
    }
    let tau = (matrix.col(q)[q] - matrix.col(p)[p]) / (2.0 * off);
    let t = tau.signum() / (tau.abs() + (1.0 + tau * tau).sqrt());
    let c = 1.0 / (1.0 + t * t).sqrt();
    let mut rotation = DMat3::IDENTITY;
    rotation.col_mut(p)[p] = c;
    rotation.col_mut(q)[q] = c;
    rotation.col_mut(q)[p] = t * c;
    rotation.col_mut(p)[q] = -t * c;
    Some(rotation)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Σ λ v vᵀ.
    fn composed(values: DVec3, vectors: DMat3) -> DMat3 {
        vectors * DMat3::from_diagonal(values) * vectors.transpose()
    }

    #[test]
    fn any_multiplicity() {
        let turned = DMat3::from_axis_angle(DVec3::new(1.0, -2.0, 0.5).normalize(), 0.7);
        let spectra = [
            [0.0, 0.0, 0.0],
            [-2_000.0, 0.0, 0.0],
            [-2_000.0, -2_000.0, 0.0],
            [-2_000.0, -2_000.0, -2_000.0],
            [-2_000.0, 1e-9, 300.0],
            [5.0, 5.0 + 1e-12, -1.0],
        ];
        for spectrum in spectra {
            let matrix = composed(spectrum.into(), turned);
            let matrix = (matrix + matrix.transpose()) * 0.5;
            let (values, vectors) = principal(matrix);
            let mut found = values.to_array();
            let mut expected = spectrum;
            found.sort_by(f64::total_cmp);
            expected.sort_by(f64::total_cmp);
            for (found, expected) in found.iter().zip(expected) {
                assert!((found - expected).abs() < 1e-9, "{found} for {expected}");
            }
            assert!((vectors.transpose() * vectors).abs_diff_eq(DMat3::IDENTITY, 1e-12));
            assert!(composed(values, vectors).abs_diff_eq(matrix, 1e-9));
        }
    }
}
