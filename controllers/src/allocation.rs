//! Control allocation: a wrench to the speeds of the rotors, and what is given up at their limits.
//!
//! A rotor at r = (x, y) from the centre of mass turning at ω makes the thrust c_T·ω² along body z. Its
//! torque on the body is r × thrust, that is (y, −x)·c_T·ω² about x and y, and against its own sense of
//! turning, −spin·c_Q·ω² about z. This is eq. 3.7 of the thesis with the moment arm (not the distance
//! between the axes), and with signs that follow from the axes rather than from a rotor numbering.
//!
//! Four rotors have one set of squared speeds for each wrench: the effectiveness matrix B is inverted. More rotors have many
//! sets: the one with the least sum of squares is taken, Bᵀ(BBᵀ)⁻¹ (Moore-Penrose; Johansen and Fossen, Control allocation: a
//! survey, Automatica 49, 2013, section 2.2).

use bus::Bounded;
use bus::messages::PerRotor;
use nalgebra::{Matrix4, Vector3, Vector4};
use std::cmp::Ordering;
use vehicles::{ROTORS_MAX, Vehicle};

/// The fraction of the thrust range to keep free at either end for roll and pitch, see
/// [`Allocation::thrust_range_N`]. Tuned, no source: it leaves 0.09 N·m on the Hummingbird.
pub(crate) const THRUST_RESERVE: f64 = 0.05;

/// A thrust along body z and a torque about the centre of mass in body axes.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct RotorWrench {
    /// Total thrust along body z, N.
    pub thrust_N: f64,
    /// Torque in body axes, N·m.
    pub torque_B_N_m: Vector3<f64>,
}

/// A set of rotors that cannot be allocated to.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum AllocationError {
    /// The rotors do not make thrust and the three torques independently.
    #[error(
        "its {rotors} rotors cannot make thrust and three torques independently, expected four or more rotors that can: \
         their positions, spins or coefficients make the effectiveness matrix singular; correct `rotors` and `rotor` of \
         the vehicle file"
    )]
    Singular {
        /// Number of rotors.
        rotors: usize,
    },
    /// The range of speeds is empty or not finite.
    #[error("rotor speeds must satisfy 0 <= min < max, found min {min_rad_s} and max {max_rad_s} rad/s")]
    SpeedRange {
        /// The least speed given, rad/s.
        min_rad_s: f64,
        /// The greatest speed given, rad/s.
        max_rad_s: f64,
    },
}

/// The inverse of the rotors' effectiveness, and their limits.
///
/// ```
/// use controllers::airframe::ControlledVehicle;
/// use controllers::allocation::RotorWrench;
/// use nalgebra::Vector3;
///
/// let vehicle = concat!(env!("CARGO_MANIFEST_DIR"), "/../vehicles/hummingbird.toml");
/// let allocation = ControlledVehicle::load(&inputs::InputFiles::default(), vehicle.as_ref()).unwrap().allocation;
/// let asked = RotorWrench { thrust_N: 4.7, torque_B_N_m: Vector3::new(0.02, 0.0, 0.0) };
/// let allocated = allocation.allocate(&asked);
/// assert!((allocated.wrench.torque_B_N_m.x - 0.02).abs() < 1e-9 && !allocated.is_saturated());
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Allocation {
    /// Thrust and torques that a squared speed of each rotor makes.
    effectiveness: Bounded<Vector4<f64>, ROTORS_MAX>,
    /// Squared speeds of the rotors for thrust and for the torques about x, y and z.
    inverse: [PerRotor; 4],
    square_min_rad2_s2: f64,
    square_max_rad2_s2: f64,
}

/// The speeds for a wrench, and how much of it they make.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Allocated {
    /// Rotor speeds within their limits, rad/s.
    pub speeds_rad_s: PerRotor,
    /// The wrench that these speeds make once the motors have reached them.
    pub wrench: RotorWrench,
    /// Thrust made less thrust demanded, N: zero unless the rotors cannot make that much or that little.
    pub thrust_error_N: f64,
    /// The part of the demanded roll and pitch torque that is made, 0 to 1.
    pub roll_pitch_part: f64,
    /// The part of the demanded yaw torque that is made, 0 to 1; yaw is given up first.
    pub yaw_part: f64,
}

impl Allocated {
    /// Whether any of the demand was given up.
    #[must_use]
    pub fn is_saturated(&self) -> bool {
        self.thrust_error_N != 0.0 || self.roll_pitch_part != 1.0 || self.yaw_part != 1.0
    }
}

impl Allocation {
    /// The allocation to the rotors of `vehicle`.
    ///
    /// # Errors
    /// The effectiveness matrix is singular or the range of speeds is empty.
    pub fn new(vehicle: &Vehicle) -> Result<Self, AllocationError> {
        let (min_rad_s, max_rad_s) = (vehicle.command.speed_at_min_rad_s, vehicle.command.speed_at_max_rad_s);
        if !(0.0 <= min_rad_s && min_rad_s < max_rad_s && max_rad_s.is_finite()) {
            return Err(AllocationError::SpeedRange { min_rad_s, max_rad_s });
        }
        let effectiveness = effectiveness(vehicle);
        let inverse = inverse(&effectiveness);
        let inverse = inverse.ok_or(AllocationError::Singular { rotors: effectiveness.len() })?;
        let (square_min_rad2_s2, square_max_rad2_s2) = (min_rad_s * min_rad_s, max_rad_s * max_rad_s);
        Ok(Self { effectiveness, inverse, square_min_rad2_s2, square_max_rad2_s2 })
    }

    /// The least and greatest thrust (N) to demand if the fraction `reserve` (0 to ½) of the range from
    /// all rotors slowest to all fastest is kept free at either end for roll and pitch.
    #[must_use]
    pub fn thrust_range_N(&self, reserve: f64) -> (f64, f64) {
        let thrust_for_one: f64 = self.effectiveness.iter().map(|rotor| rotor[0]).sum();
        let min_N = thrust_for_one * self.square_min_rad2_s2;
        let max_N = thrust_for_one * self.square_max_rad2_s2;
        let kept_N = reserve.clamp(0.0, 0.5) * (max_N - min_N);
        (min_N + kept_N, max_N - kept_N)
    }

    /// The wrench that the rotors make at `speeds_rad_s`.
    #[must_use]
    pub fn wrench(&self, speeds_rad_s: &[f64]) -> RotorWrench {
        let rotors = self.effectiveness.iter().zip(speeds_rad_s);
        let wrench = rotors.map(|(rotor, speed)| rotor * (speed * speed)).reduce(|sum, rotor| sum + rotor);
        let wrench = wrench.unwrap_or_default();
        RotorWrench { thrust_N: wrench[0], torque_B_N_m: Vector3::new(wrench[1], wrench[2], wrench[3]) }
    }

    /// The speeds that make `demand`, or as much of it as the rotors can: yaw torque is given up first,
    /// then roll and pitch torque together, keeping their direction, and thrust only when thrust alone
    /// is beyond the rotors: then each rotor is cut to its limit.
    #[must_use]
    pub fn allocate(&self, demand: &RotorWrench) -> Allocated {
        let torque = &demand.torque_B_N_m;
        let [thrust, roll, pitch, yaw] = &self.inverse;
        let for_thrust = thrust.map(|square| square * demand.thrust_N);
        let for_roll_pitch = each(roll, pitch, |roll, pitch| roll * torque.x + pitch * torque.y);
        let for_yaw = yaw.map(|square| square * torque.z);

        let thrust_squares = for_thrust.map(|square| self.clamp(square));
        let roll_pitch_part = self.part_that_fits(&thrust_squares, &for_roll_pitch);
        let attitude_squares =
            each(&thrust_squares, &for_roll_pitch, |square, more| square + roll_pitch_part * more);
        let yaw_part = self.part_that_fits(&attitude_squares, &for_yaw);
        let squares = each(&attitude_squares, &for_yaw, |square, more| square + yaw_part * more);

        let speeds_rad_s = squares.map(|square| self.clamp(square).sqrt());
        let wrench = self.wrench(&speeds_rad_s);
        // Rounding aside, clamping changed nothing if and only if the rotors can make the thrust.
        let is_thrust_made = thrust_squares == for_thrust;
        let thrust_error_N = if is_thrust_made { 0.0 } else { wrench.thrust_N - demand.thrust_N };
        Allocated { speeds_rad_s, wrench, thrust_error_N, roll_pitch_part, yaw_part }
    }

    /// The greatest part, 0 to 1, of `addition` that keeps every rotor within its limits when it is added
    /// to `base`, which is within them.
    fn part_that_fits(&self, base: &PerRotor, addition: &PerRotor) -> f64 {
        base.iter().zip(addition).fold(1.0_f64, |part, (&base, &addition)| {
            let room =
                if addition > 0.0 { self.square_max_rad2_s2 - base } else { self.square_min_rad2_s2 - base };
            if addition == 0.0 { part } else { part.min((room / addition).max(0.0)) }
        })
    }

    fn clamp(&self, square_rad2_s2: f64) -> f64 {
        square_rad2_s2.clamp(self.square_min_rad2_s2, self.square_max_rad2_s2)
    }
}

fn each(a: &PerRotor, b: &PerRotor, value: impl Fn(f64, f64) -> f64) -> PerRotor {
    a.iter().zip(b).map(|(a, b)| value(*a, *b)).collect()
}

fn effectiveness(vehicle: &Vehicle) -> Bounded<Vector4<f64>, ROTORS_MAX> {
    let (c_t, c_q) = (vehicle.thrust_coefficient, vehicle.torque_coefficient);
    let rotors = vehicle.rotors.iter().map(|rotor| {
        let position_B_m = rotor.position_m;
        Vector4::new(c_t, position_B_m.y * c_t, -position_B_m.x * c_t, -rotor.spin * c_q)
    });
    rotors.collect()
}

/// Squared speeds for a unit of each part of a wrench; `None` if the rotors cannot make all of them.
fn inverse(effectiveness: &[Vector4<f64>]) -> Option<[PerRotor; 4]> {
    let rows = match effectiveness {
        [a, b, c, d] => rows(&Matrix4::from_columns(&[*a, *b, *c, *d]).try_inverse()?),
        _ => pseudo_inverse(effectiveness)?,
    };
    // Overflow in the inverse, and rotors without thrust, would pass as numbers that are not finite.
    let is_finite = rows.iter().all(|row| row.iter().all(|square| square.is_finite()));
    is_finite.then(|| std::array::from_fn(|part| rows.map(|row| row[part])))
}

/// Rows of the inverse of four rotors.
fn rows(inverse: &Matrix4<f64>) -> Bounded<Vector4<f64>, ROTORS_MAX> {
    Bounded::from_fn(4, |rotor| inverse.row(rotor).transpose())
}

/// Determinant below which the normalised rows of the effectiveness matrix count as dependent: that of orthogonal rows is
/// 1, rounding of dependent ones leaves about 1e-16.
const DETERMINANT_MIN: f64 = 1e-12;

/// Rows of Bᵀ(BBᵀ)⁻¹. The rows of B, which have different units, are scaled to length 1 for the inversion.
fn pseudo_inverse(effectiveness: &[Vector4<f64>]) -> Option<Bounded<Vector4<f64>, ROTORS_MAX>> {
    let squares: Vector4<f64> = effectiveness.iter().map(|rotor| rotor.component_mul(rotor)).sum();
    let scale = squares.map(|square| square.sqrt().recip());
    let scaled = effectiveness.iter().map(|rotor| rotor.component_mul(&scale));
    let product: Matrix4<f64> = scaled.clone().map(|rotor| rotor * rotor.transpose()).sum();
    // A row of zeros, whose scale is not finite, makes it NaN.
    let is_independent = product.determinant().partial_cmp(&DETERMINANT_MIN) == Some(Ordering::Greater);
    let inverse = product.try_inverse().filter(|_| is_independent)?;
    Some(scaled.map(|rotor| (inverse * rotor).component_mul(&scale)).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    const RPM: f64 = std::f64::consts::TAU / 60.0;

    /// Front, right, rear, left; front and rear clockwise (thesis §2.1, §4.2, §5.3).
    fn hummingbird() -> Vehicle {
        Vehicle::parse(vehicles::reference::HUMMINGBIRD, "hummingbird.toml").unwrap()
    }

    fn allocation() -> Allocation {
        Allocation::new(&hummingbird()).unwrap()
    }

    fn wrench(thrust_N: f64, x: f64, y: f64, z: f64) -> RotorWrench {
        RotorWrench { thrust_N, torque_B_N_m: Vector3::new(x, y, z) }
    }

    #[track_caller]
    fn assert_made(found: &RotorWrench, expected: &RotorWrench) {
        assert!((found.thrust_N - expected.thrust_N).abs() < 1e-9, "{found:?}");
        assert!((found.torque_B_N_m - expected.torque_B_N_m).norm() < 1e-9, "{found:?}");
    }

    #[test]
    fn hover_is_3930_rpm_on_every_rotor() {
        let allocated = allocation().allocate(&wrench(0.48 * 9.81, 0.0, 0.0, 0.0));
        assert!(allocated.speeds_rad_s.iter().all(|speed| (speed / RPM - 3930.0).abs() < 2.0));
    }

    #[test]
    fn a_wrench_within_the_limits_is_made_whole() {
        for demand in [wrench(4.7, 0.1, -0.2, 0.02), wrench(8.0, -0.3, 0.0, -0.05)] {
            let allocated = allocation().allocate(&demand);
            assert_made(&allocated.wrench, &demand);
            assert!(!allocated.is_saturated());
        }
    }

    #[test]
    fn each_torque_speeds_up_the_rotors_that_make_it() {
        let speeds = |x, y, z| {
            let speeds_rad_s = allocation().allocate(&wrench(4.7, x, y, z)).speeds_rad_s;
            <[f64; 4]>::try_from(&*speeds_rad_s).unwrap()
        };
        let [front, right, rear, left] = speeds(0.1, 0.0, 0.0);
        assert!(left > right && (front - rear).abs() < 1e-9, "right side down");
        let [front, right, rear, left] = speeds(0.0, 0.1, 0.0);
        assert!(rear > front && (left - right).abs() < 1e-9, "nose down");
        let [front, right, rear, left] = speeds(0.0, 0.0, 0.02);
        assert!(front > left && rear > right, "the clockwise pair turns the body counter-clockwise");
    }

    #[test]
    fn yaw_is_given_up_before_roll_and_pitch() {
        let allocated = allocation().allocate(&wrench(4.7, 0.2, -0.1, 0.5));
        assert!(allocated.yaw_part > 0.0 && allocated.yaw_part < 1.0);
        assert_eq!((allocated.thrust_error_N, allocated.roll_pitch_part), (0.0, 1.0));
        assert_made(&allocated.wrench, &wrench(4.7, 0.2, -0.1, 0.5 * allocated.yaw_part));
    }

    #[test]
    fn roll_and_pitch_are_scaled_together_before_thrust() {
        let allocated = allocation().allocate(&wrench(4.7, 2.0, -1.0, 0.0));
        let part = allocated.roll_pitch_part;
        assert!(part > 0.1 && part < 1.0);
        assert_made(&allocated.wrench, &wrench(4.7, 2.0 * part, -part, 0.0));
    }

    #[test]
    fn thrust_is_given_up_only_beyond_the_rotors() {
        let (least_N, greatest_N) = allocation().thrust_range_N(0.0);
        let allocated = allocation().allocate(&wrench(2.0 * greatest_N, 0.1, 0.0, 0.0));
        assert!((allocated.wrench.thrust_N - greatest_N).abs() < 1e-9);
        assert!((allocated.thrust_error_N + greatest_N).abs() < 1e-9);
        assert_eq!(allocated.roll_pitch_part, 0.0);
        assert!((allocation().allocate(&wrench(0.0, 0.0, 0.0, 0.0)).wrench.thrust_N - least_N).abs() < 1e-9);
    }

    #[test]
    fn speeds_stay_within_their_limits_whatever_is_asked() {
        let command = hummingbird().command;
        let (min_rad_s, max_rad_s) = (command.speed_at_min_rad_s, command.speed_at_max_rad_s);
        let within = |speed: &f64| *speed >= min_rad_s - 1e-9 && *speed <= max_rad_s + 1e-9;
        let values = [-30.0, -0.3, 0.0, 0.05, 7.0, 40.0];
        for case in 0..values.len().pow(4) {
            let pick = |digit: u32| values[case / values.len().pow(digit) % values.len()];
            let allocated = allocation().allocate(&wrench(pick(0), pick(1), pick(2), pick(3)));
            assert!(allocated.speeds_rad_s.iter().all(within), "{allocated:?}");
            let parts = [allocated.roll_pitch_part, allocated.yaw_part];
            assert!(parts.iter().all(|part| (0.0..=1.0).contains(part)), "{allocated:?}");
        }
    }

    #[test]
    fn the_reserve_leaves_torque_at_either_end() {
        let allocation = allocation();
        let (min_N, max_N) = allocation.thrust_range_N(0.05);
        for thrust_N in [min_N, max_N] {
            assert!(allocation.allocate(&wrench(thrust_N, 0.05, 0.05, 0.0)).roll_pitch_part > 0.9);
        }
    }

    /// `count` of the Hummingbird's rotors on a circle, turning in turns one way and the other.
    fn ring(count: usize) -> Vehicle {
        let vehicle = hummingbird();
        let rotor = |index: usize| {
            let (sine, cosine) = libm::sincos(std::f64::consts::TAU * index as f64 / count as f64);
            let spin = if index.is_multiple_of(2) { 1.0 } else { -1.0 };
            let position_m = Vector3::new(0.3 * cosine, 0.3 * sine, 0.0);
            vehicles::Rotor { position_m, spin, ..vehicle.rotors[0].clone() }
        };
        Vehicle { rotors: (0..count).map(rotor).collect(), ..vehicle.clone() }
    }

    #[test]
    fn more_than_four_rotors_share_a_wrench_with_the_least_sum_of_squares() {
        for count in [5, 6, 8, 12] {
            let vehicle = ring(count);
            let allocation = Allocation::new(&vehicle).unwrap();
            let demand = wrench(4.7, 0.1, -0.2, 0.02);
            let allocated = allocation.allocate(&demand);
            assert!(
                allocated.speeds_rad_s.len() == count && !allocated.is_saturated(),
                "{count}: {allocated:?}"
            );
            assert_made(&allocated.wrench, &demand);
            if count.is_multiple_of(2) {
                let hover = allocation.allocate(&wrench(0.48 * 9.81, 0.0, 0.0, 0.0)).speeds_rad_s;
                assert!(
                    hover.iter().all(|speed| (speed - vehicle.hover_speed_rad_s()).abs() < 1e-9),
                    "{hover:?}"
                );
            }
            // The least sum of squares is a combination of the rows of the effectiveness matrix.
            let rotors = allocation.effectiveness;
            let product: Matrix4<f64> = rotors.iter().map(|rotor| rotor * rotor.transpose()).sum();
            let row = product.try_inverse().unwrap() * Vector4::new(4.7, 0.1, -0.2, 0.02);
            let pairs = rotors.iter().zip(&allocated.speeds_rad_s);
            assert!(
                pairs
                    .into_iter()
                    .all(|(rotor, speed)| (rotor.dot(&row) / (speed * speed) - 1.0).abs() < 1e-6)
            );
        }
    }

    #[test]
    fn the_pseudo_inverse_of_four_rotors_is_their_inverse() {
        let effectiveness = effectiveness(&hummingbird());
        let (rows, exact) = (pseudo_inverse(&effectiveness).unwrap(), inverse(&effectiveness).unwrap());
        for (rotor, row) in rows.iter().enumerate() {
            for part in 0..4 {
                assert!(
                    (row[part] / exact[part][rotor] - 1.0).abs() < 1e-9 || exact[part][rotor].abs() < 1e-6
                );
            }
        }
    }

    #[test]
    fn rotors_that_cannot_hover_are_refused_by_their_number() {
        for count in 1..=3 {
            let error = Allocation::new(&ring(count)).unwrap_err();
            assert!(error.to_string().contains(&format!("its {count} rotors cannot make")), "{error}");
        }
        let mut one_way = ring(6);
        one_way.rotors.iter_mut().for_each(|rotor| rotor.spin = 1.0);
        assert_eq!(Allocation::new(&one_way), Err(AllocationError::Singular { rotors: 6 }));
    }

    #[test]
    fn rotors_in_a_line_or_without_a_range_are_refused() {
        let mut line = hummingbird();
        for (rotor, x) in line.rotors.iter_mut().zip([1.0, 1.0, -1.0, -1.0]) {
            rotor.position_m = Vector3::x() * x;
        }
        assert_eq!(Allocation::new(&line), Err(AllocationError::Singular { rotors: 4 }));
        let mut empty = hummingbird();
        (empty.command.speed_at_min_rad_s, empty.command.speed_at_max_rad_s) = (900.0, 900.0);
        assert!(matches!(Allocation::new(&empty), Err(AllocationError::SpeedRange { .. })));
    }
}
