//! Attitudes as rotation matrices, body to world, row by row.

use nalgebra::{Matrix3, Rotation3, UnitQuaternion};

use crate::error::{LogError, Spot};
use crate::flight::median;
use crate::frame::to_wxyz;
use crate::number_rows::NumberRows;

/// Greatest element of R^T R - I of a rotation matrix that was rounded.
const TOLERANCE: f64 = 0.05;

/// Refuses samples of which most are not rotation matrices.
pub fn check(rows: &NumberRows) -> Result<(), LogError> {
    let read: Vec<Matrix3<f64>> =
        rows.iter().filter_map(matrix).filter(|matrix| matrix.iter().all(|part| part.is_finite())).collect();
    let wrong = read.iter().filter(|matrix| !is_rotation(matrix)).count();
    if 2 * wrong <= read.len() {
        return Ok(());
    }
    let determinant = median(read.iter().map(Matrix3::determinant)).unwrap_or(f64::NAN);
    let norm =
        median(read.iter().flat_map(|matrix| matrix.row_iter().map(|row| row.norm()).collect::<Vec<_>>()));
    let found = format!(
        "a median determinant of {determinant:.3} and rows of length {:.3}",
        norm.unwrap_or(f64::NAN)
    );
    let expected = "rotation matrices: rows of length 1, determinant 1";
    let advice = "name the nine columns row by row; a determinant of -1 means a left-handed frame, in which an axis is negated";
    Err(LogError::unexpected(Spot::Key("matrix"), expected, found, advice))
}

/// The quaternion w, x, y, z of a rotation matrix; NaN of another.
pub fn quaternion(row: &[f64]) -> [f64; 4] {
    match matrix(row).filter(is_rotation) {
        Some(matrix) => {
            let rotation = Rotation3::from_matrix_unchecked(matrix);
            to_wxyz(UnitQuaternion::from_rotation_matrix(&rotation).into_inner())
        }
        None => [f64::NAN; 4],
    }
}

fn matrix(row: &[f64]) -> Option<Matrix3<f64>> {
    (row.len() == 9).then(|| Matrix3::from_row_slice(row))
}

fn is_rotation(matrix: &Matrix3<f64>) -> bool {
    let off = (matrix.transpose() * matrix - Matrix3::identity()).abs().max();
    off <= TOLERANCE && matrix.determinant() > 0.0
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of<const N: usize>(matrices: [Vec<f64>; N]) -> NumberRows {
        let mut rows = NumberRows::of_width(9);
        matrices.into_iter().for_each(|row| rows.push(row));
        rows
    }

    #[test]
    fn rotation_matrices_become_quaternions() {
        for angles in [[0.0, 0.0, 0.0], [0.3, -0.2, 3.0], [3.1, 0.1, -1.0]] {
            let q = UnitQuaternion::from_euler_angles(angles[0], angles[1], angles[2]);
            let rows: Vec<f64> = q.to_rotation_matrix().matrix().transpose().iter().copied().collect();
            let [w, x, y, z] = quaternion(&rows);
            let read = UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(w, x, y, z));
            assert!(read.angle_to(&q) < 1e-7, "{angles:?}");
            assert!(check(&of([rows.clone(), rows, vec![f64::NAN; 9]])).is_ok());
        }
    }

    #[test]
    fn other_matrices_are_refused_with_what_they_are() {
        let cases = [
            (vec![1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, -1.0], "determinant of -1.000"),
            (vec![57.3, 0.0, 0.0, 0.0, 57.3, 0.0, 0.0, 0.0, 57.3], "length 57.300"),
            (vec![0.0; 9], "length 0.000"),
        ];
        for (row, part) in cases {
            let error = check(&of([row.clone(), row.clone()])).unwrap_err().to_string();
            assert!(
                error.contains("`matrix`") && error.contains(part) && error.contains("row by row"),
                "{error}"
            );
            assert!(quaternion(&row)[0].is_nan());
        }
    }
}
