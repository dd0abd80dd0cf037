//! Least squares within bounds: the squared speeds that come nearest to a demand beyond the rotors' limits.
//!
//! Minimises |W (B x − d)|² + ε² |x|² over least ≤ x ≤ 1. x are the squared speeds as parts of the greatest.
//! The rows of B and d are roll, pitch, yaw and thrust, each divided by its size. The weights W make the
//! priorities: a part of higher priority may cost any amount of the lower ones. Solved by an active set: the
//! rotors at a bound are held there while the others solve the unbounded problem. A rotor is released where
//! that brings the demand nearer. Sources: Härkegård, Efficient active set algorithms for solving constrained
//! least squares problems in aircraft control allocation, CDC 2002; Smeur, de Wagter and Höppener,
//! Prioritized control allocation for quadrotors subject to saturation, IMAV 2017.

use nalgebra::{SMatrix, SVector, Vector4};
use vehicles::ROTORS_MAX;

/// Weights of roll, pitch, yaw and thrust. Tuned, no source: a part of lower priority moves a higher one by
/// 1e-4 of its own error.
const WEIGHTS: [f64; 4] = [1.0, 1.0, 1e-2, 1e-4];
/// Weight of the least sum of squares, below all others.
const SMALL: f64 = 1e-6;
/// Roll and pitch demands are cut to this multiple of their size: beyond it rounding would hide the lower priorities.
const TILT_MAX: f64 = 100.0;
/// Yaw and thrust demands are cut to this multiple of theirs: a dozen rotors reach the square root of 12, and
/// larger errors would move the higher priorities.
const DEMAND_MAX: f64 = 4.0;
/// Slopes below this are rounding.
const SLOPE_MIN: f64 = 1e-12;
/// Each step holds or releases a rotor: a dozen rotors need about a dozen.
const STEPS_MAX: usize = 4 * ROTORS_MAX;

/// A part of the squared speed for each rotor, 0 to 1; 0 behind the last one.
pub(crate) type Parts = SVector<f64, ROTORS_MAX>;

/// [`BoundedLeastSquares::step`] with matrices for the first `$count` rotors: nalgebra's factorisations are not generic over a
/// size that is known when compiled.
macro_rules! step_of {
    ($count:expr, $this:ident, $missing:ident, $parts:ident, $held:ident) => {{
        let mut rows = SMatrix::<f64, { 4 + $count }, $count>::zeros();
        let mut right = SVector::<f64, { 4 + $count }>::zeros();
        right.fixed_rows_mut::<4>(0).copy_from(&$missing);
        for rotor in 0..$count {
            rows[(4 + rotor, rotor)] = SMALL;
            if !$held[rotor] {
                rows.fixed_view_mut::<4, 1>(0, rotor).copy_from(&$this.effects.column(rotor));
                right[4 + rotor] = -SMALL * $parts[rotor];
            }
        }
        let factors = rows.qr();
        factors.q_tr_mul(&mut right);
        let mut solution = right.fixed_rows::<$count>(0).into_owned();
        // Each column has a row of its own: the triangle has no zero on its diagonal.
        factors.r().solve_upper_triangular_mut(&mut solution);
        let mut step = Parts::zeros();
        // What is held stays at its bound to the last bit.
        (0..$count).filter(|rotor| !$held[*rotor]).for_each(|rotor| step[rotor] = solution[rotor]);
        step
    }};
}

/// The rotors' effects, and their least part.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct BoundedLeastSquares {
    /// Weighted effect of each rotor at its greatest speed on roll, pitch, yaw and thrust; columns of zeros are held.
    effects: SMatrix<f64, 4, ROTORS_MAX>,
    /// Sizes of roll, pitch, yaw (N·m) and thrust (N).
    sizes: Vector4<f64>,
    /// The least squared speed as a part of the greatest.
    least: f64,
    /// Number of the rotors.
    count: usize,
}

impl BoundedLeastSquares {
    /// `effects` are the torques about x, y, z (N·m) and the thrust (N) that each rotor makes at its greatest speed.
    pub fn new(effects: impl Iterator<Item = Vector4<f64>>, least: f64) -> Self {
        let mut all = SMatrix::<f64, 4, ROTORS_MAX>::zeros();
        let mut count = 0;
        for (mut column, effect) in all.column_iter_mut().zip(effects) {
            column.copy_from(&effect);
            count += 1;
        }
        let size = |row: usize| all.row(row).norm();
        // Roll and pitch have one unit, so that the torque that is missed is the shortest vector.
        let tilt = size(0).max(size(1));
        let sizes = Vector4::new(tilt, tilt, size(2), size(3));
        for (row, mut effects) in all.row_iter_mut().enumerate() {
            effects *= WEIGHTS[row] / sizes[row];
        }
        Self { effects: all, sizes, least, count }
    }

    /// Sizes of roll, pitch, yaw (N·m) and thrust (N): the root of the sum of squares over the rotors at full speed.
    pub fn sizes(&self) -> &Vector4<f64> {
        &self.sizes
    }

    /// The parts that come nearest to `demand` (roll, pitch, yaw in N·m, thrust in N), looked for from `start` on.
    pub fn solve(&self, demand: &Vector4<f64>, start: &Parts) -> Parts {
        let demand = self.weighted(demand);
        let mut parts = start.map(|part| part.clamp(self.least, 1.0));
        let mut is_held = self.effects.column_iter().map(|effect| effect.iter().all(|part| *part == 0.0));
        let mut held = [(); ROTORS_MAX].map(|()| is_held.next().unwrap_or(true));
        let unused = held;
        let mut released = None;
        for _ in 0..STEPS_MAX {
            let step = self.step(&demand, &parts, &held);
            let (share, blocking) = self.share(&parts, &step, &held);
            parts = (parts + step * share).map(|part| part.clamp(self.least, 1.0));
            match blocking {
                // What was just released is pushed back: rounding.
                Some(rotor) if share == 0.0 && released == Some(rotor) => break,
                Some(rotor) => {
                    held[rotor] = true;
                    parts[rotor] = if step[rotor] > 0.0 { 1.0 } else { self.least };
                }
                None => {
                    released = self.releasable(&demand, &parts, &held, &unused);
                    let Some(rotor) = released else { break };
                    held[rotor] = false;
                }
            }
        }
        parts
    }

    /// The demand in the weighted rows, of a size that leaves the priorities apart.
    fn weighted(&self, demand: &Vector4<f64>) -> Vector4<f64> {
        let scaled = demand.component_div(&self.sizes);
        let tilt = scaled.xy().norm();
        let cut = if tilt > TILT_MAX { TILT_MAX / tilt } else { 1.0 };
        let limit = |part: f64| part.clamp(-DEMAND_MAX, DEMAND_MAX);
        Vector4::new(scaled[0] * cut, scaled[1] * cut, limit(scaled[2]), limit(scaled[3]))
            .component_mul(&Vector4::from(WEIGHTS))
    }

    /// The change of the rotors that are not held that solves the problem without bounds. The rows have falling weights, in
    /// which Householder's factorisation is stable (Björck, Numerical methods for least squares problems, 1996, section 4.4).
    fn step(&self, demand: &Vector4<f64>, parts: &Parts, held: &[bool; ROTORS_MAX]) -> Parts {
        let missing = demand - self.effects * parts;
        // The factorisation is most of the cost: that of four rotors has a sixteenth of the operations of that of twelve.
        match self.count {
            0..=4 => step_of!(4, self, missing, parts, held),
            5 | 6 => step_of!(6, self, missing, parts, held),
            7 | 8 => step_of!(8, self, missing, parts, held),
            _ => step_of!(ROTORS_MAX, self, missing, parts, held),
        }
    }

    /// The part of `step` up to the first bound, and the rotor that meets it.
    fn share(&self, parts: &Parts, step: &Parts, held: &[bool; ROTORS_MAX]) -> (f64, Option<usize>) {
        let moving = (0..ROTORS_MAX).filter(|rotor| !held[*rotor] && step[*rotor] != 0.0);
        moving.fold((1.0, None), |(share, blocking), rotor| {
            let bound = if step[rotor] > 0.0 { 1.0 } else { self.least };
            let to_bound = ((bound - parts[rotor]) / step[rotor]).max(0.0);
            if to_bound < share { (to_bound, Some(rotor)) } else { (share, blocking) }
        })
    }

    /// The held rotor whose release brings the demand nearest, if any does.
    fn releasable(
        &self,
        demand: &Vector4<f64>,
        parts: &Parts,
        held: &[bool; ROTORS_MAX],
        unused: &[bool; ROTORS_MAX],
    ) -> Option<usize> {
        let missing = demand - self.effects * parts;
        let gain = |rotor: usize| {
            let upwards = self.effects.column(rotor).dot(&missing) - SMALL * SMALL * parts[rotor];
            if parts[rotor] >= 1.0 { -upwards } else { upwards }
        };
        let held = (0..ROTORS_MAX).filter(|rotor| held[*rotor] && !unused[*rotor]);
        let gains = held.map(|rotor| (rotor, gain(rotor))).filter(|(_, gain)| *gain > SLOPE_MIN);
        gains.max_by(|a, b| a.1.total_cmp(&b.1)).map(|(rotor, _)| rotor)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rotors on a circle, turning in turns one way and the other: torques about x, y, z and thrust at full speed.
    fn ring(count: usize) -> Vec<Vector4<f64>> {
        let effect = |index: usize| {
            let (sine, cosine) = libm::sincos(std::f64::consts::TAU * index as f64 / count as f64);
            let spin = if index.is_multiple_of(2) { 0.02 } else { -0.02 };
            Vector4::new(0.3 * sine, -0.3 * cosine, spin, 1.0)
        };
        (0..count).map(effect).collect()
    }

    fn made(effects: &[Vector4<f64>], parts: &Parts) -> Vector4<f64> {
        effects.iter().zip(parts.iter()).map(|(effect, part)| effect * *part).sum()
    }

    /// The optimum of a convex problem with bounds: no rotor can move alone, nor any two together, to a smaller sum. The sums
    /// are taken part by part in the order of the priorities, so that the test does not depend on the weights
    /// themselves.
    #[test]
    fn no_rotor_and_no_two_rotors_can_bring_a_demand_nearer() {
        let mut random = 1_u64;
        let mut uniform = || {
            random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (random >> 11) as f64 / (1_u64 << 53) as f64
        };
        for count in [4, 5, 6, 8, 12] {
            let effects = ring(count);
            let problem = BoundedLeastSquares::new(effects.iter().copied(), 0.02);
            for _ in 0..200 {
                let demand = Vector4::new(
                    uniform() - 0.5,
                    uniform() - 0.5,
                    0.4 * (uniform() - 0.5),
                    count as f64 * (1.5 * uniform() - 0.2),
                );
                let parts = problem.solve(&demand, &Parts::repeat(0.5));
                assert!(parts.iter().take(count).all(|part| (0.02..=1.0).contains(part)), "{parts}");
                let sizes = problem.sizes();
                let missing = |parts: &Parts| (demand - made(&effects, parts)).component_div(sizes);
                let costs = |parts: &Parts| {
                    let missing = missing(parts);
                    [missing.xy().norm_squared(), missing[2] * missing[2], missing[3] * missing[3]]
                };
                let best = costs(&parts);
                for (first, second) in (0..count).flat_map(|a| (0..count).map(move |b| (a, b))) {
                    for (by_first, by_second) in
                        [(1e-3, 0.0), (-1e-3, 0.0), (1e-3, -1e-3), (1e-3, 1e-3), (-1e-3, -1e-3)]
                    {
                        let mut moved = parts;
                        moved[first] = (moved[first] + by_first).clamp(0.02, 1.0);
                        moved[second] = (moved[second] + by_second).clamp(0.02, 1.0);
                        let moved = costs(&moved);
                        let weighted = |costs: [f64; 3]| costs[0] + 1e-4 * costs[1] + 1e-8 * costs[2];
                        assert!(
                            weighted(moved) > weighted(best) - 1e-11,
                            "{count}: {demand} {parts} {first} {second}"
                        );
                    }
                }
            }
        }
    }

    #[test]
    fn roll_and_pitch_come_before_yaw_and_yaw_before_thrust() {
        for count in [4, 6, 8] {
            let effects = ring(count);
            let problem = BoundedLeastSquares::new(effects.iter().copied(), 0.02);
            let whole = count as f64;
            let parts = |demand| made(&effects, &problem.solve(&demand, &Parts::repeat(0.5)));
            // Full thrust is asked for: roll and pitch are made, and thrust is what lacks.
            let found = parts(Vector4::new(0.1, -0.05, 0.0, whole));
            assert!((found[0] - 0.1).abs() < 1e-4 && (found[1] + 0.05).abs() < 1e-4, "{found}");
            assert!(found[3] < whole && found[2].abs() < 1e-4, "{found}");
            // More yaw than there is at this thrust: thrust gives way.
            let yaw = 0.02 * 0.4 * whole;
            let found = parts(Vector4::new(0.0, 0.0, yaw, 0.1 * whole));
            assert!((found[2] - yaw).abs() < 1e-4 && found[3] > 0.1 * whole, "{found}");
            // More of all than there is: roll and pitch are as if alone.
            let alone = parts(Vector4::new(9.0, -6.0, 0.0, 0.5 * whole));
            let found = parts(Vector4::new(9.0, -6.0, 5.0, 0.5 * whole));
            assert!((found.xy() - alone.xy()).norm() < 1e-2 * alone.xy().norm(), "{found} {alone}");
        }
    }

    #[test]
    fn a_demand_of_any_size_ends_within_the_bounds() {
        let effects = ring(6);
        let problem = BoundedLeastSquares::new(effects.iter().copied(), 0.02);
        for size in [0.0, 1e-9, 1.0, 1e6, 1e300] {
            for signs in 0..16_u32 {
                let sign = |bit: u32| if signs >> bit & 1 == 0 { size } else { -size };
                let demand = Vector4::new(sign(0), sign(1), sign(2), sign(3));
                let parts = problem.solve(&demand, &Parts::zeros());
                assert!(parts.iter().take(6).all(|part| (0.02..=1.0).contains(part)), "{demand} {parts}");
            }
        }
    }
}
