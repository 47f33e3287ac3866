//! Rigid motions that nothing resists of a component that touches a solid: along a floor without friction two translations
//! and a turn.

use nalgebra::{Matrix6, Vector6};

use super::level::{FaceKind, Level};
use super::rigid::{Component, Piece};
use crate::velocity::FaceFields;

/// Resistance to a motion, ÷ its mass, up to which there is none: what it would take in a substep.
const LEAST_RESISTANCE: f64 = 1e-6;

/// What the square of the net outflow of a cell counts as, beside viscous resistance: an outflow of 1e-5 of the velocity is
/// rounding of open shares.
const OF_OUTFLOW: f64 = 1e4;

/// No component, in the table of faces.
const NONE: u32 = u32::MAX;

/// How solids, and liquid without viscosity, are in the way of the six motions of each component: the sum over cells of the products of the net outflows
/// that the motions have. `open`: the open share of each low face.
pub(super) fn obstruction(level: &Level, open: &FaceFields<f32>, components: &[Component]) -> Vec<Matrix6<f64>> {
    let len = level.rows().len();
    let mut sums = vec![Matrix6::zeros(); components.len()];
    let mut owners: FaceFields<u32> = std::array::from_fn(|_| vec![NONE; len]);
    for (number, component) in (0..).zip(components) {
        for piece in &component.pieces {
            owners[piece.axis][piece.at..][..piece.len].fill(number);
        }
    }
    for run in level.stencil.runs() {
        for n in 0..run.len as usize {
            let (at, _, above) = run.neighbours(n);
            let cell = [run.cell[0] + n as i32, run.cell[1], run.cell[2]];
            let shares = [0, 1, 2].map(|axis| [open[axis][at], open[axis][above[axis]]]);
            // Through a whole cell of one component as much flows in as out.
            if !level.liquid[at] || (level.normal[at] > 0.0 && shares == [[1.0; 2]; 3]) {
                continue;
            }
            // A cell without viscosity may be between several.
            let mut outflows = [(NONE, Vector6::zeros()); 6];
            for axis in 0..3 {
                for (side, face) in [at, above[axis]].into_iter().enumerate() {
                    let home = level.images.home(face);
                    let owner = owners[axis][home];
                    if owner == NONE || level.kinds[axis][home] != FaceKind::Free {
                        continue;
                    }
                    let mut beside = cell;
                    beside[axis] += side as i32;
                    let piece = Piece { axis, at: face, len: 1, cell: beside };
                    let motions = Vector6::from(piece.motions(0, components[owner as usize].about));
                    let share = f64::from(shares[axis][side]);
                    let place = outflows.iter_mut().find(|(other, _)| *other == owner || *other == NONE);
                    if let Some((other, outflow)) = place {
                        *other = owner;
                        *outflow += motions * if side == 0 { -share } else { share };
                    }
                }
            }
            for (owner, outflow) in outflows.iter().filter(|(owner, _)| *owner != NONE) {
                sums[*owner as usize] += outflow * outflow.transpose();
            }
        }
    }
    sums
}

/// From the momentum of a component in its six motions to the motions that carry it, among those that nothing resists:
/// R·(Rᵀ·mass·R)⁻¹·Rᵀ, where R spans these. None where it is empty, and in the air, where it is everything: no weight presses
/// there, and a body that spins would drift by the error of the masses' centre more than by that of the pressure.
pub(super) fn unresisted(
    mass: &Matrix6<f64>,
    resistance: &Matrix6<f64>,
    obstruction: &Matrix6<f64>,
) -> Option<Matrix6<f64>> {
    let (values, vectors) = eigen(resistance + obstruction * OF_OUTFLOW);
    // Of a translation.
    let least = LEAST_RESISTANCE * mass[(0, 0)].max(mass[(1, 1)]).max(mass[(2, 2)]);
    let mut free = Matrix6::zeros();
    let mut others = Matrix6::identity();
    for motion in (0..6).filter(|motion| values[*motion] <= least) {
        free.set_column(motion, &vectors.column(motion));
        others[(motion, motion)] = 0.0;
    }
    if free == Matrix6::zeros() || others == Matrix6::zeros() {
        return None;
    }
    // A single face, or a thread of them, has fewer than six motions.
    let rounding = Matrix6::identity() * (mass.trace() * 1e-12);
    let inverse = (free.transpose() * mass * free + others + rounding).try_inverse()?;
    Some(free * inverse * free.transpose())
}

/// Sweeps over all pairs: they converge quadratically.
const SWEEPS: usize = 12;

/// The eigenvalues of a symmetric matrix, and its eigenvectors as columns (Jacobi's method).
fn eigen(mut matrix: Matrix6<f64>) -> ([f64; 6], Matrix6<f64>) {
    let mut vectors = Matrix6::identity();
    for _ in 0..SWEEPS {
        for p in 0..6 {
            for q in p + 1..6 {
                let off = matrix[(p, q)];
                if off == 0.0 {
                    continue;
                }
                let half = 0.5 * (matrix[(q, q)] - matrix[(p, p)]) / off;
                let tangent = 1.0_f64.copysign(half) / (half.abs() + (half * half + 1.0).sqrt());
                let cosine = 1.0 / (tangent * tangent + 1.0).sqrt();
                let sine = tangent * cosine;
                let mut turn = Matrix6::identity();
                (turn[(p, p)], turn[(q, q)], turn[(p, q)], turn[(q, p)]) = (cosine, cosine, sine, -sine);
                matrix = turn.transpose() * matrix * turn;
                (matrix[(p, q)], matrix[(q, p)]) = (0.0, 0.0);
                vectors *= turn;
            }
        }
    }
    (std::array::from_fn(|n| matrix[(n, n)]), vectors)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn eigenvectors_rebuild_a_matrix_of_any_scale() {
        let noise = Matrix6::from_fn(|a, b| ((7 * a + 3 * b * b + a * b) % 11) as f64 - 5.0);
        for scale in [1.0, 1e6] {
            let mut matrix = noise * noise.transpose();
            for n in 0..6 {
                matrix.row_mut(n).scale_mut(if n % 2 == 0 { scale } else { 1.0 });
                matrix.column_mut(n).scale_mut(if n % 2 == 0 { scale } else { 1.0 });
            }
            let (values, vectors) = eigen(matrix);
            let rebuilt = vectors * Matrix6::from_diagonal(&Vector6::from(values)) * vectors.transpose();
            assert!((rebuilt - matrix).amax() < 1e-13 * matrix.amax(), "{rebuilt} {matrix}");
            assert!((vectors.transpose() * vectors - Matrix6::identity()).amax() < 1e-14);
        }
    }

    #[test]
    fn a_motion_with_resistance_is_not_unresisted() {
        let mass = Matrix6::identity() * 100.0;
        let held = Matrix6::from_diagonal(&Vector6::new(0.0, 1e9, 0.0, 1e9, 0.0, 1e9));
        let free = unresisted(&mass, &held, &Matrix6::zeros()).unwrap();
        for motion in 0..6 {
            let expected = if motion % 2 == 0 { 0.01 } else { 0.0 };
            assert!((free[(motion, motion)] - expected).abs() < 1e-12, "{free}");
        }
        assert!(unresisted(&mass, &mass, &Matrix6::zeros()).is_none());
        assert!(unresisted(&mass, &Matrix6::zeros(), &mass).is_none());
    }
}
