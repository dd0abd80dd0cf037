//! Control allocation: a wrench to the speeds of four rotors, and what is given up at their limits.
//!
//! A rotor at r = (x, y) from the centre of mass turning at ω makes the thrust c_T·ω² along body z. Its
//! torque on the body is r × thrust, that is (y, −x)·c_T·ω² about x and y, and against its own sense of
//! turning, −spin·c_Q·ω² about z. This is eq. 3.7 of the thesis with the moment arm (not the distance
//! between the axes), and with signs that follow from the axes rather than from a rotor numbering.

use nalgebra::{Matrix4, Vector3, Vector4};
use vehicles::Vehicle;

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
        "the four rotors cannot make thrust and three torques independently: their positions, spins or \
         coefficients make the effectiveness matrix singular"
    )]
    Singular,
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
    /// Thrust and torques (rows) from squared speeds (columns).
    effectiveness: Matrix4<f64>,
    /// Squared speeds (rows) from thrust and torques (columns).
    inverse: Matrix4<f64>,
    square_min_rad2_s2: f64,
    square_max_rad2_s2: f64,
}

/// The speeds for a wrench, and how much of it they make.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Allocated {
    /// Rotor speeds within their limits, rad/s.
    pub speeds_rad_s: [f64; 4],
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
        let inverse = effectiveness.try_inverse().ok_or(AllocationError::Singular)?;
        // Overflow in the inverse, and rotors without thrust, would pass as numbers that are not finite.
        if !inverse.iter().all(|element| element.is_finite()) {
            return Err(AllocationError::Singular);
        }
        let (square_min_rad2_s2, square_max_rad2_s2) = (min_rad_s * min_rad_s, max_rad_s * max_rad_s);
        Ok(Self { effectiveness, inverse, square_min_rad2_s2, square_max_rad2_s2 })
    }

    /// The least and greatest thrust (N) to demand if the fraction `reserve` (0 to ½) of the range from
    /// all rotors slowest to all fastest is kept free at either end for roll and pitch.
    #[must_use]
    pub fn thrust_range_N(&self, reserve: f64) -> (f64, f64) {
        let thrust_for_one: f64 = self.effectiveness.row(0).sum();
        let min_N = thrust_for_one * self.square_min_rad2_s2;
        let max_N = thrust_for_one * self.square_max_rad2_s2;
        let kept_N = reserve.clamp(0.0, 0.5) * (max_N - min_N);
        (min_N + kept_N, max_N - kept_N)
    }

    /// The wrench that the rotors make at `speeds_rad_s`.
    #[must_use]
    pub fn wrench(&self, speeds_rad_s: &[f64; 4]) -> RotorWrench {
        let squares = Vector4::from(*speeds_rad_s).map(|speed| speed * speed);
        let wrench = self.effectiveness * squares;
        RotorWrench { thrust_N: wrench[0], torque_B_N_m: Vector3::new(wrench[1], wrench[2], wrench[3]) }
    }

    /// The speeds that make `demand`, or as much of it as the rotors can: yaw torque is given up first,
    /// then roll and pitch torque together, keeping their direction, and thrust only when thrust alone
    /// is beyond the rotors: then each rotor is cut to its limit.
    #[must_use]
    pub fn allocate(&self, demand: &RotorWrench) -> Allocated {
        let torque = &demand.torque_B_N_m;
        let for_thrust = self.inverse.column(0) * demand.thrust_N;
        let for_roll_pitch = self.inverse.column(1) * torque.x + self.inverse.column(2) * torque.y;
        let for_yaw = self.inverse.column(3) * torque.z;

        let thrust_squares = for_thrust.map(|square| self.clamp(square));
        let roll_pitch_part = self.part_that_fits(&thrust_squares, &for_roll_pitch);
        let attitude_squares = thrust_squares + roll_pitch_part * for_roll_pitch;
        let yaw_part = self.part_that_fits(&attitude_squares, &for_yaw);
        let squares = attitude_squares + yaw_part * for_yaw;

        let speeds_rad_s = squares.map(|square| self.clamp(square).sqrt()).into();
        let wrench = self.wrench(&speeds_rad_s);
        // Rounding aside, clamping changed nothing if and only if the rotors can make the thrust.
        let is_thrust_made = thrust_squares == for_thrust;
        let thrust_error_N = if is_thrust_made { 0.0 } else { wrench.thrust_N - demand.thrust_N };
        Allocated { speeds_rad_s, wrench, thrust_error_N, roll_pitch_part, yaw_part }
    }

    /// The greatest part, 0 to 1, of `addition` that keeps every rotor within its limits when it is added
    /// to `base`, which is within them.
    fn part_that_fits(&self, base: &Vector4<f64>, addition: &Vector4<f64>) -> f64 {
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

fn effectiveness(vehicle: &Vehicle) -> Matrix4<f64> {
    let (c_t, c_q) = (vehicle.thrust_coefficient, vehicle.torque_coefficient);
    Matrix4::from_columns(&vehicle.rotors.each_ref().map(|rotor| {
        let position_B_m = rotor.position_m;
        Vector4::new(c_t, position_B_m.y * c_t, -position_B_m.x * c_t, -rotor.spin * c_q)
    }))
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
        let speeds = |x, y, z| allocation().allocate(&wrench(4.7, x, y, z)).speeds_rad_s;
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

    #[test]
    fn rotors_in_a_line_or_without_a_range_are_refused() {
        let mut line = hummingbird();
        for (rotor, x) in line.rotors.iter_mut().zip([1.0, 1.0, -1.0, -1.0]) {
            rotor.position_m = Vector3::x() * x;
        }
        assert_eq!(Allocation::new(&line), Err(AllocationError::Singular));
        let mut empty = hummingbird();
        (empty.command.speed_at_min_rad_s, empty.command.speed_at_max_rad_s) = (900.0, 900.0);
        assert!(matches!(Allocation::new(&empty), Err(AllocationError::SpeedRange { .. })));
    }
}
