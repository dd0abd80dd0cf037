//! The discrete algebraic Riccati equation, and the gain of the linear-quadratic regulator.
//!
//! X = AᵀXA − AᵀXB·(R + BᵀXB)⁻¹·BᵀXA + Q is solved by the structure-preserving doubling algorithm of E. K.-W. Chu,
//! H.-Y. Fan and W.-W. Lin, "A structure-preserving doubling algorithm for continuous-time algebraic Riccati equations",
//! Linear Algebra and its Applications 396 (2005), section 2. It starts with G = B·R⁻¹·Bᵀ and H = Q. With
//! W = I + G·H it repeats A ← A·W⁻¹·A, G ← G + A·W⁻¹·G·Aᵀ, H ← H + Aᵀ·H·W⁻¹·A. All right-hand sides are of
//! the step before. H tends to X quadratically if the system can be stabilised and every state that does not
//! fade is weighed.
//!
//! The sizes are in the types. Products of matrices whose sizes are found at run time are computed with the
//! processor's own instructions. They differ in the last digits from one processor to another.

use nalgebra::{Const, DimMin, SMatrix, ToTypenum};

/// Doublings: after n the algorithm has looked 2^n steps ahead.
const DOUBLINGS_MAX: usize = 40;
/// Relative change of the solution by a doubling below which it has converged.
const CHANGE_MAX: f64 = 1e-14;
/// The equation must hold to this, relatively.
const RESIDUAL_MAX: f64 = 1e-9;

/// A regulator of N states and M inputs, from the solution of the equation.
#[derive(Debug, Clone, PartialEq)]
pub struct Regulator<const N: usize, const M: usize> {
    /// X: the cost that a state x has still to come is xᵀXx.
    pub cost: SMatrix<f64, N, N>,
    /// K: the best input is −Kx.
    pub gain: SMatrix<f64, M, N>,
}

/// The regulator of x ← A·x + B·u with the cost Σ xᵀQx + uᵀRu; `None` where the equation has no solution that
/// stabilises the system, or none that can be computed.
pub fn regulator<const N: usize, const M: usize>(
    A: &SMatrix<f64, N, N>,
    B: &SMatrix<f64, N, M>,
    Q: &SMatrix<f64, N, N>,
    R: &SMatrix<f64, M, M>,
) -> Option<Regulator<N, M>>
where
    Const<N>: DimMin<Const<N>, Output = Const<N>> + ToTypenum,
    Const<M>: DimMin<Const<M>, Output = Const<M>> + ToTypenum,
{
    let cost = doubled(A, B, Q, R)?;
    let weighed = R + B.transpose() * cost * B;
    let gain = weighed.lu().solve(&(B.transpose() * cost * A))?;
    let off = relative_residual(A, B, Q, &cost, &gain);
    let holds = off < RESIDUAL_MAX && is_stable(&(A - B * gain));
    holds.then_some(Regulator { cost, gain })
}

fn doubled<const N: usize, const M: usize>(
    A: &SMatrix<f64, N, N>,
    B: &SMatrix<f64, N, M>,
    Q: &SMatrix<f64, N, N>,
    R: &SMatrix<f64, M, M>,
) -> Option<SMatrix<f64, N, N>>
where
    Const<N>: DimMin<Const<N>, Output = Const<N>> + ToTypenum,
{
    let mut G = B * R.cholesky()?.solve(&B.transpose());
    let (mut A, mut H) = (*A, *Q);
    for _ in 0..DOUBLINGS_MAX {
        let W = (SMatrix::identity() + G * H).lu();
        let ahead = W.solve(&A)?;
        let reach = W.solve(&G)?;
        let added = A.transpose() * H * ahead;
        G += A * reach * A.transpose();
        A *= ahead;
        H += added;
        // Rounding would let the symmetry go.
        H = (H + H.transpose()) * 0.5;
        if !H.iter().all(|element| element.is_finite()) {
            return None;
        }
        if added.amax() < CHANGE_MAX * H.amax() {
            return Some(H);
        }
    }
    None
}

/// Residual of the equation, against the size of its solution.
fn relative_residual<const N: usize, const M: usize>(
    A: &SMatrix<f64, N, N>,
    B: &SMatrix<f64, N, M>,
    Q: &SMatrix<f64, N, N>,
    cost: &SMatrix<f64, N, N>,
    gain: &SMatrix<f64, M, N>,
) -> f64 {
    let next = A.transpose() * cost * (A - B * gain) + Q;
    (next - cost).norm() / cost.norm()
}

/// True if x ← M·x fades: M^(2^n) vanishes.
fn is_stable<const N: usize>(step: &SMatrix<f64, N, N>) -> bool {
    let mut power = *step;
    for _ in 0..DOUBLINGS_MAX {
        power *= power;
        if power.amax() < 0.5 / N as f64 {
            return true;
        }
    }
    false
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix1, Matrix2, Vector2};

    /// scipy.linalg.solve_discrete_are([[1, .1], [0, 1]], [[.005], [.1]], diag([1, .5]), [[.2]]), SciPy 1.17.
    #[test]
    fn a_double_integrator_has_the_cost_that_scipy_finds() {
        let (A, B) = (Matrix2::new(1.0, 0.1, 0.0, 1.0), Vector2::new(0.005, 0.1));
        let (Q, R) = (Matrix2::new(1.0, 0.0, 0.0, 0.5), Matrix1::new(0.2));
        let found = regulator(&A, &B, &Q, &R).unwrap().cost;
        let expected = Matrix2::new(12.33096751, 4.48608961, 4.48608961, 5.55747804);
        assert!((found - expected).amax() < 5e-9);
    }

    /// a·x with b = q = r = 1 has x² − a²·x − 1 = 0.
    #[test]
    fn a_single_state_has_the_closed_solution() {
        for a in [0.0, 0.5, 1.0, 2.0_f64] {
            let (A, one) = (Matrix1::new(a), Matrix1::new(1.0));
            let found = regulator(&A, &one, &one, &one).unwrap().cost[0];
            let expected = (a * a + (a.powi(4) + 4.0).sqrt()) / 2.0;
            assert!((found - expected).abs() < 1e-12, "{a}");
        }
    }

    #[test]
    fn a_system_that_cannot_be_stabilised_has_no_regulator() {
        let (A, B) = (Matrix2::new(1.1, 0.0, 0.0, 0.9), Vector2::new(0.0, 1.0));
        assert_eq!(regulator(&A, &B, &Matrix2::identity(), &Matrix1::new(1.0)), None);
    }
}
