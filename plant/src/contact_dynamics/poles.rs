//! The fastest pole of damped and driven joints, which the step of the integration has to follow.
//!
//! Springs of stiffnesses K and dampers D act along rows. The rates of the rows answer to forces by A = J W Jᵀ. They obey s² +
//! A D s + A K = 0. For an eigenvector this is a quadratic equation. Its damping is at most λ(A D) and its stiffness at most
//! λ(A K). So no pole is faster than the larger of λ(A D) and √λ(A K). The sums of rows of √D A √D and √K A √K bound these
//! (Gershgorin).

use super::joints::Line;
use nalgebra::{Matrix6, Vector6};

/// A spring and a damper along a row of a joint.
#[derive(Debug, Clone, Copy)]
pub(super) struct Spring {
    /// Number of the joint.
    pub joint: usize,
    pub line: Line,
    /// N/m or N m/rad.
    pub stiffness: f64,
    /// N s/m or N m s/rad.
    pub damping: f64,
}

/// The joint with the fastest pole, and a bound of the rate of that, 1/s. The bodies yield by these `mobilities`, and
/// nothing else holds them. The bound is exact of a spring whose bodies no other one acts on.
pub(super) fn fastest(springs: &[Spring], mobilities: &[Matrix6<f64>]) -> Option<(usize, f64)> {
    let answer =
        |spring: &Spring| [0, 1].map(|at| mobilities[spring.line.ends[at]] * spring.line.jacobian[at]);
    let answers: Vec<[Vector6<f64>; 2]> = springs.iter().map(answer).collect();
    let poles = springs
        .iter()
        .enumerate()
        .map(|(number, spring)| (spring.joint, pole_per_s(number, springs, &answers)));
    poles.max_by(|(_, one), (_, other)| one.total_cmp(other))
}

/// A bound of the poles that the spring `number` has a part in.
fn pole_per_s(number: usize, springs: &[Spring], answers: &[[Vector6<f64>; 2]]) -> f64 {
    let spring = &springs[number];
    let alone = coupling(&spring.line, spring, &answers[number]);
    let (mut damping, mut stiffness, mut is_alone) = (spring.damping * alone, spring.stiffness * alone, true);
    for (other, answer) in
        springs.iter().zip(answers).enumerate().filter(|(place, _)| *place != number).map(|it| it.1)
    {
        let shared = coupling(&spring.line, other, answer).abs();
        is_alone &= shared == 0.0;
        damping += (spring.damping * other.damping).sqrt() * shared;
        stiffness += (spring.stiffness * other.stiffness).sqrt() * shared;
    }
    if is_alone { of_one_per_s(damping, stiffness) } else { damping.max(stiffness.sqrt()) }
}

/// Change of the rate of `line` by a force of 1 along the row of `other`, whose ends are changed by `answer`.
fn coupling(line: &Line, other: &Spring, answer: &[Vector6<f64>; 2]) -> f64 {
    let mut sum = 0.0;
    for (end, jacobian) in line.ends.iter().zip(&line.jacobian) {
        for (other_end, answer) in other.line.ends.iter().zip(answer) {
            if end == other_end {
                sum += jacobian.dot(answer);
            }
        }
    }
    sum
}

/// The larger root of s² + `damping` s + `stiffness`, by its absolute value, 1/s; both are by the mobility: 1/s and 1/s².
fn of_one_per_s(damping: f64, stiffness: f64) -> f64 {
    let half = damping / 2.0;
    match half * half - stiffness {
        beyond if beyond >= 0.0 => half + beyond.sqrt(),
        _ => stiffness.sqrt(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    /// A row of the sliding of the body `child` against the body `parent`.
    fn spring(joint: usize, ends: [usize; 2], stiffness: f64, damping: f64) -> Spring {
        let along = Vector6::new(1.0, 0.0, 0.0, 0.0, 0.0, 0.0);
        let line = Line { ends, jacobian: [-along, along], bias: 0.0, off: 0.0 };
        Spring { joint, line, stiffness, damping }
    }

    /// The world and bodies of these masses.
    fn mobilities(masses_kg: &[f64]) -> Vec<Matrix6<f64>> {
        let of = |mass_kg: &f64| {
            Matrix6::from_diagonal(&Vector3::repeat(mass_kg.recip()).push(0.0).push(0.0).push(0.0))
        };
        std::iter::once(Matrix6::zeros()).chain(masses_kg.iter().map(of)).collect()
    }

    #[test]
    fn the_pole_of_one_is_the_larger_root() {
        let pole =
            |stiffness, damping| fastest(&[spring(7, [0, 1], stiffness, damping)], &mobilities(&[2.0]));
        assert_eq!(pole(0.0, 4.0), Some((7, 2.0)));
        assert_eq!(pole(8.0, 0.0), Some((7, 2.0)));
        // s^2 + 3 s + 2.
        assert_eq!(pole(4.0, 6.0), Some((7, 2.0)));
        assert_eq!(fastest(&[], &mobilities(&[])), None);
    }

    #[test]
    fn those_on_one_body_add_up_and_those_apart_do_not() {
        let dampers = [spring(0, [0, 1], 0.0, 4.0), spring(1, [0, 1], 0.0, 4.0), spring(2, [0, 2], 0.0, 5.0)];
        assert_eq!(fastest(&dampers, &mobilities(&[1.0, 1.0])).unwrap().1, 8.0);
        assert_eq!(fastest(&dampers[1..], &mobilities(&[1.0, 1.0])), Some((2, 5.0)));
        // A chain of two equal masses on equal springs: w^2 = (3 + sqrt 5) / 2 k / m, bounded by 3 k / m.
        let chain = [spring(0, [0, 1], 1.0, 0.0), spring(1, [1, 2], 1.0, 0.0)];
        let (joint, bound) = fastest(&chain, &mobilities(&[1.0, 1.0])).unwrap();
        assert!(joint == 1 && (bound - 3.0_f64.sqrt()).abs() < 1e-12, "{bound}");
        assert!(bound * bound > (3.0 + 5.0_f64.sqrt()) / 2.0);
    }
}
