//! Cholesky's factorisation of symmetric matrices whose size is known at run time, in memory that the caller keeps.

/// The Cholesky factor L of a matrix of `count` rows, in the place of its lower triangle. `pivot` takes the
/// remainder of a row's diagonal, and the diagonal itself, to the square of the factor's.
pub(super) fn factorise(matrix: &mut [f64], count: usize, pivot: impl Fn(f64, f64) -> f64) {
    for row in 0..count {
        let diagonal = matrix[row * count + row];
        for column in 0..=row {
            let known: f64 =
                (0..column).map(|at| matrix[row * count + at] * matrix[column * count + at]).sum();
            let left = matrix[row * count + column] - known;
            matrix[row * count + column] = match column == row {
                false => left / matrix[column * count + column],
                true => pivot(left, diagonal).sqrt(),
            };
        }
    }
}

/// Solves L Lᵀ x = b; `solution` is b before.
pub(super) fn substitute(factor: &[f64], solution: &mut [f64]) {
    let count = solution.len();
    for row in 0..count {
        let known: f64 = (0..row).map(|at| factor[row * count + at] * solution[at]).sum();
        solution[row] = (solution[row] - known) / factor[row * count + row];
    }
    for row in (0..count).rev() {
        let known: f64 = (row + 1..count).map(|at| factor[at * count + row] * solution[at]).sum();
        solution[row] = (solution[row] - known) / factor[row * count + row];
    }
}
