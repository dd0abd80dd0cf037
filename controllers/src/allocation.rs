//! Control allocation: a wrench to the speeds of the rotors, and the parts of it that are given up at their limits.
//!
//! A rotor at r from the centre of mass with the axis a that turns at ω makes the thrust c_T·ω²·a. Its torque on the body is
//! r × a·c_T·ω², and against its own sense of turning −spin·c_Q·ω²·a. With axes along body z this is eq. 3.7
//! of the thesis, with two changes. The arm is the moment arm, not the distance between the axes. Signs
//! follow from the axes, not from a rotor numbering. Of the thrust, the part along body z counts.
//!
//! Four rotors have one set of squared speeds for each wrench: the effectiveness matrix B is inverted. More rotors have many
//! sets: the one with the least sum of squares is taken, Bᵀ(BBᵀ)⁻¹ (Moore-Penrose; Johansen and Fossen, Control allocation: a
//! survey, Automatica 49, 2013, section 2.2). If that is beyond the limits of a rotor, the torques are cut:
//! yaw first, then roll and pitch. The part that fits beside the thrust remains, or a share of the part that
//! fits in hover if that is more. Then the speeds within the limits make these torques, and come as near to
//! the thrust as that allows (`bounded`).

use crate::bounded::{BoundedLeastSquares, Parts};
use crate::wrench_part::Part;
use component::Bounded;
use component::messages::PerRotor;
use nalgebra::{Matrix4, Vector3, Vector4};
use std::cmp::Ordering;
use vehicles::{ROTORS_MAX, Vehicle};

/// The fraction of the thrust range to keep free at either end for roll and pitch, see
/// [`Allocation::thrust_range_N`]. Tuned, no source: it leaves 0.09 N·m on the Hummingbird.
pub(crate) const THRUST_RESERVE: f64 = 0.05;

/// The greatest part of the way from the least thrust to the weight to keep free at the lower end: strong vehicles, which
/// lift many times their weight, would otherwise have no thrust left to sink with. Tuned, no source: it leaves 0.7 of that way,
/// and begins to count where the range of the thrust is six times that way.
const RESERVE_OF_WEIGHT: f64 = 0.3;

/// The share of the torques that the rotors can make in hover for which thrust is given up: that of ArduPilot, the default of
/// ATC_THR_MIX_MAX. Laws whose demands are off by far would otherwise throw the vehicle about.
const TORQUE_SHARE: f64 = 0.5;

/// The upward part of a rotor's thrust below which it does not limit the torques of the others: the cosine of 75 deg. Tuned, no
/// source: it is at its slowest in hover, and would limit them to zero.
const LIFTING_MIN: f64 = 0.258_8;

/// The error of a part of a wrench, against its size over all rotors, that counts as none: rounding, and the part by which
/// lower priorities move a higher one.
const MISSED_MIN: f64 = 5e-4;
/// The torque that rotors must make both ways while they carry the weight, against that of all rotors together. Tuned, no
/// source: less does not control.
const HELD_MIN: f64 = 0.01;

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
        "its {working} working rotors of {rotors} cannot make thrust and three torques independently: {part} is not \
         controllable{}; expected four or more rotors that push and turn each in a way of its own",
        why(*part, (*rotors, *working), *is_one_way)
    )]
    Singular {
        /// Number of rotors.
        rotors: usize,
        /// Number of those that have not failed.
        working: usize,
        /// The part that follows from those before it.
        part: Part,
        /// True if all working rotors turn one way.
        is_one_way: bool,
    },
    /// Within their limits, no speeds of the rotors carry the weight without a torque.
    #[error(
        "its {working} working rotors of {rotors} cannot hover: wherever they carry the weight, a {part} torque remains unbalanced; \
         expected rotors on both sides of the centre of mass"
    )]
    Unbalanced {
        /// Number of rotors.
        rotors: usize,
        /// Number of those that have not failed.
        working: usize,
        /// The torque that remains.
        part: Part,
    },
    /// Within their limits, the rotors do not make a torque both ways while they carry the weight.
    #[error(
        "its {working} working rotors of {rotors} cannot hover: while they carry the weight, {part} is not controllable both ways \
         within the limits of their speeds{}",
        part.turning(*spins)
    )]
    Unheld {
        /// Number of rotors.
        rotors: usize,
        /// Number of those that have not failed.
        working: usize,
        /// The part that is not controllable.
        part: Part,
        /// Numbers of working rotors that turn counter-clockwise and clockwise.
        spins: [usize; 2],
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

/// The likely reason for a part that is not controllable.
fn why(part: Part, (rotors, working): (usize, usize), is_one_way: bool) -> &'static str {
    match part {
        Part::Yaw if working == 3 && rotors > 3 => " (with three rotors it turns about z)",
        Part::Yaw if working == 3 => {
            " (a tricopter needs a servo that tilts a rotor, which no vehicle file describes)"
        }
        Part::Yaw if is_one_way => " (all rotors turn one way, so that yaw follows from thrust)",
        Part::Yaw => "",
        Part::Roll | Part::Pitch if working == 1 => " (a single rotor makes no torque without thrust)",
        Part::Roll | Part::Pitch if working == 2 => " (two rotors are always in a line)",
        Part::Roll | Part::Pitch => " (are the rotors in a line?)",
        Part::Thrust => " (`rotor.thrust_coefficient` is 0, or no rotors push upwards)",
    }
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
    /// The same beyond the limits.
    bounded: BoundedLeastSquares,
    /// Squared speeds of hover: those of the weight, or of the part of it that the rotors lift with room for torques.
    hover: PerRotor,
    weight_N: f64,
    /// Thrust along body z that a squared speed of a rotor makes if it is to limit the torques, at least.
    lifting_min: f64,
    square_min_rad2_s2: f64,
    square_max_rad2_s2: f64,
}

/// The speeds for a wrench, and the part of it that they make.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Allocated {
    /// Rotor speeds within their limits, rad/s.
    pub speeds_rad_s: PerRotor,
    /// The wrench that these speeds make once the motors have reached them.
    pub wrench: RotorWrench,
    /// Thrust made less thrust demanded, N: zero unless the rotors cannot make the wrench; thrust is given up first.
    pub thrust_error_N: f64,
    /// The part of the demanded roll and pitch torque that is made, 0 to 1; it is given up last.
    pub roll_pitch_part: f64,
    /// The part of the demanded yaw torque that is made, 0 to 1.
    pub yaw_part: f64,
}

impl Allocated {
    /// True if any of the demand was given up.
    #[must_use]
    pub fn is_saturated(&self) -> bool {
        self.thrust_error_N != 0.0 || self.roll_pitch_part != 1.0 || self.yaw_part != 1.0
    }
}

impl Allocation {
    /// The allocation to the rotors of `vehicle`.
    ///
    /// # Errors
    /// The rotors do not make thrust and torques independently, cannot hover within their limits, or have no range of
    /// speeds. Whether they lift the weight is not looked at: on a rig they need not.
    pub fn new(vehicle: &Vehicle) -> Result<Self, AllocationError> {
        let (min_rad_s, max_rad_s) = (vehicle.command.speed_at_min_rad_s, vehicle.command.speed_at_max_rad_s);
        if !(0.0 <= min_rad_s && min_rad_s < max_rad_s && max_rad_s.is_finite()) {
            return Err(AllocationError::SpeedRange { min_rad_s, max_rad_s });
        }
        let (rotors, working) = (vehicle.rotors.len(), vehicle.working_rotors().count());
        let effectiveness = effectiveness(vehicle);
        let turn = |way: f64| vehicle.working_rotors().filter(|rotor| rotor.spin * way > 0.0).count();
        let (spins, is_one_way) = ([turn(1.0), turn(-1.0)], turn(1.0) * turn(-1.0) == 0);
        let singular = |part| AllocationError::Singular { rotors, working, part, is_one_way };
        dependent(&effectiveness).map_or(Ok(()), |part| Err(singular(part)))?;
        let inverse = inverse(&effectiveness).ok_or_else(|| singular(Part::Yaw))?;
        let (square_min_rad2_s2, square_max_rad2_s2) = (min_rad_s * min_rad_s, max_rad_s * max_rad_s);
        let at_full_speed = effectiveness.iter().map(|rotor| torques_first(rotor) * square_max_rad2_s2);
        let bounded = BoundedLeastSquares::new(at_full_speed, square_min_rad2_s2 / square_max_rad2_s2);
        let mut made = Self {
            effectiveness,
            inverse,
            bounded,
            hover: PerRotor::default(),
            weight_N: vehicle.mass_kg * vehicle.gravity_m_s2,
            lifting_min: LIFTING_MIN * vehicle.thrust_coefficient,
            square_min_rad2_s2,
            square_max_rad2_s2,
        };
        if made.thrust_range_N(0.0).1 <= 0.0 {
            return Err(singular(Part::Thrust));
        }
        let (min_N, max_N) = made.thrust_range_N(THRUST_RESERVE);
        let thrust_N = made.weight_N.clamp(min_N, max_N);
        made.hover = made.within_limits(&RotorWrench { thrust_N, ..RotorWrench::default() });
        made.unbalanced(thrust_N)
            .map_or(Ok(()), |part| Err(AllocationError::Unbalanced { rotors, working, part }))?;
        made.unheld().map_or(Ok(made), |part| Err(AllocationError::Unheld { rotors, working, part, spins }))
    }

    /// The least and greatest thrust (N) to demand if a part of the range is kept free at either end for roll
    /// and pitch. The part is the fraction `reserve` (0 to ½) of the range from all rotors slowest to all
    /// fastest. Rotors that push downwards count from fastest to slowest. At the lower end, the part kept
    /// free is bounded by the weight, so that strong vehicles can sink.
    #[must_use]
    pub fn thrust_range_N(&self, reserve: f64) -> (f64, f64) {
        let upwards: f64 = self.effectiveness.iter().map(|rotor| rotor[0].max(0.0)).sum();
        let downwards: f64 = self.effectiveness.iter().map(|rotor| rotor[0].min(0.0)).sum();
        let min_N = upwards * self.square_min_rad2_s2 + downwards * self.square_max_rad2_s2;
        let max_N = upwards * self.square_max_rad2_s2 + downwards * self.square_min_rad2_s2;
        let kept_N = reserve.clamp(0.0, 0.5) * (max_N - min_N);
        // On a rig, and without gravity, the weight may be less than the least thrust.
        let sinks_N = self.weight_N - min_N;
        let kept_below_N = if sinks_N > 0.0 { kept_N.min(RESERVE_OF_WEIGHT * sinks_N) } else { kept_N };
        (min_N + kept_below_N, max_N - kept_N)
    }

    /// The wrench that the rotors make at `speeds_rad_s`.
    #[must_use]
    pub fn wrench(&self, speeds_rad_s: &[f64]) -> RotorWrench {
        let rotors = self.effectiveness.iter().zip(speeds_rad_s);
        let wrench = rotors.map(|(rotor, speed)| rotor * (speed * speed)).reduce(|sum, rotor| sum + rotor);
        let wrench = wrench.unwrap_or_default();
        RotorWrench { thrust_N: wrench[0], torque_B_N_m: Vector3::new(wrench[1], wrench[2], wrench[3]) }
    }

    /// The speeds that make `demand`. Beyond the limits of the rotors, roll and pitch torque come first, and
    /// keep their direction. Yaw torque follows. Each reaches up to a share of the rotors' torque in hover.
    /// Thrust comes last: it moves towards hover, and not beyond.
    #[must_use]
    pub fn allocate(&self, demand: &RotorWrench) -> Allocated {
        let squares = self.squares(demand);
        if !self.are_within(&squares) {
            return self.nearest(demand);
        }
        let speeds_rad_s = squares.map(|square| self.clamp(square).sqrt());
        let wrench = self.wrench(&speeds_rad_s);
        Allocated { speeds_rad_s, wrench, thrust_error_N: 0.0, roll_pitch_part: 1.0, yaw_part: 1.0 }
    }

    /// Squared speeds that make `demand`, without regard to the limits.
    fn squares(&self, demand: &RotorWrench) -> PerRotor {
        let for_thrust = self.inverse[0].map(|square| square * demand.thrust_N);
        let for_attitude = each(&for_thrust, &self.for_roll_pitch(demand), |square, more| square + more);
        each(&for_attitude, &self.for_yaw(demand), |square, more| square + more)
    }

    fn for_roll_pitch(&self, demand: &RotorWrench) -> PerRotor {
        let ([_, roll, pitch, _], torque) = (&self.inverse, &demand.torque_B_N_m);
        each(roll, pitch, |roll, pitch| roll * torque.x + pitch * torque.y)
    }

    fn for_yaw(&self, demand: &RotorWrench) -> PerRotor {
        self.inverse[3].map(|square| square * demand.torque_B_N_m.z)
    }

    /// The wrench nearest to `demand` within the limits.
    fn nearest(&self, demand: &RotorWrench) -> Allocated {
        let squares = self.within_limits(&self.cut(demand));
        let speeds_rad_s = squares.map(|square| self.clamp(square).sqrt());
        let wrench = self.wrench(&speeds_rad_s);
        let (made, asked) = (torques_then_thrust(&wrench), torques_then_thrust(demand));
        let missed = (made - asked).component_div(self.bounded.sizes());
        let is_made = |missed: f64| missed.abs() <= MISSED_MIN;
        let part = |made: f64, asked: f64| if asked == 0.0 { 1.0 } else { (made / asked).clamp(0.0, 1.0) };
        let tilt_part = part(made.xy().dot(&asked.xy()), asked.xy().norm_squared());
        Allocated {
            speeds_rad_s,
            wrench,
            thrust_error_N: if is_made(missed[3]) { 0.0 } else { made[3] - asked[3] },
            roll_pitch_part: if is_made(missed.xy().norm()) { 1.0 } else { tilt_part },
            yaw_part: if is_made(missed[2]) { 1.0 } else { part(made[2], asked[2]) },
        }
    }

    /// `demand` with the torques cut to the larger of two: the part that fits beside its thrust, and a share of
    /// that in hover.
    fn cut(&self, demand: &RotorWrench) -> RotorWrench {
        let beside_thrust = self.inverse[0].map(|square| self.clamp(square * demand.thrust_N));
        let (kept, in_hover) = (self.fitting(&beside_thrust, demand), self.fitting(&self.hover, demand));
        let [tilting, turning] =
            [0, 1].map(|part| kept[part].max(TORQUE_SHARE * in_hover[part]).clamp(0.0, 1.0));
        let torque_B_N_m = demand.torque_B_N_m.component_mul(&Vector3::new(tilting, tilting, turning));
        RotorWrench { torque_B_N_m, ..*demand }
    }

    /// The parts of the roll and pitch torque together, and of the yaw torque, that fit beside the squared speeds `base`; above
    /// 1 where there is room for more.
    fn fitting(&self, base: &PerRotor, demand: &RotorWrench) -> [f64; 2] {
        let for_roll_pitch = self.for_roll_pitch(demand);
        let tilting = self.part_that_fits(base, &for_roll_pitch);
        let for_attitude = each(base, &for_roll_pitch, |square, more| square + tilting.min(1.0) * more);
        [tilting, self.part_that_fits(&for_attitude, &self.for_yaw(demand))]
    }

    /// The greatest multiple of `addition` that keeps every rotor that lifts within its limits when it is added to `base`, which
    /// is within them.
    fn part_that_fits(&self, base: &PerRotor, addition: &PerRotor) -> f64 {
        let rotors = base.iter().zip(addition).zip(&self.effectiveness);
        rotors.fold(f64::INFINITY, |part, ((&base, &addition), effect)| {
            let room =
                if addition > 0.0 { self.square_max_rad2_s2 - base } else { self.square_min_rad2_s2 - base };
            let is_free = addition == 0.0 || effect[0] < self.lifting_min;
            if is_free { part } else { part.min((room / addition).max(0.0)) }
        })
    }

    /// The squared speeds within the limits that come nearest to `demand`: to roll and pitch, then yaw, then thrust.
    fn within_limits(&self, demand: &RotorWrench) -> PerRotor {
        let squares = self.squares(demand);
        if self.are_within(&squares) {
            return squares;
        }
        let mut start = Parts::zeros();
        start.iter_mut().zip(&squares).for_each(|(part, square)| *part = square / self.square_max_rad2_s2);
        let parts = self.bounded.solve(&torques_then_thrust(demand), &start);
        PerRotor::from_fn(squares.len(), |rotor| parts[rotor] * self.square_max_rad2_s2)
    }

    /// The torque that the rotors make at equal speeds, if no speeds make the thrust `hover_N` without a torque: torques come first, so that
    /// the speeds of hover then make less.
    fn unbalanced(&self, hover_N: f64) -> Option<Part> {
        let missed_N = hover_N - self.wrench(&self.hover.map(f64::sqrt)).thrust_N;
        if missed_N.abs() < HELD_MIN * hover_N {
            return None;
        }
        let at_equal_speeds: Vector4<f64> = self.effectiveness.iter().map(torques_first).sum();
        let torques = at_equal_speeds.component_div(self.bounded.sizes());
        Some([Part::Roll, Part::Pitch, Part::Yaw][torques.xyz().iamax()])
    }

    /// The first torque that the rotors cannot make both ways in hover. Yaw is tried first: rotors have least of it.
    fn unheld(&self) -> Option<Part> {
        let axes = [(Part::Yaw, 2), (Part::Roll, 0), (Part::Pitch, 1)];
        let hover_N = self.wrench(&self.hover.map(f64::sqrt)).thrust_N;
        let is_held = |axis: usize, sign: f64| {
            let asked_N_m = sign * HELD_MIN * self.bounded.sizes()[axis];
            let torque_B_N_m = Vector3::from_fn(|row, _| if row == axis { asked_N_m } else { 0.0 });
            let made = self.allocate(&RotorWrench { thrust_N: hover_N, torque_B_N_m });
            let missed = (made.wrench.torque_B_N_m - torque_B_N_m).component_div(&self.bounded.sizes().xyz());
            missed.amax() < HELD_MIN / 2.0 && made.thrust_error_N.abs() < HELD_MIN * hover_N
        };
        axes.into_iter()
            .find(|(_, axis)| !(is_held(*axis, 1.0) && is_held(*axis, -1.0)))
            .map(|(part, _)| part)
    }

    fn are_within(&self, squares: &PerRotor) -> bool {
        let limits = self.square_min_rad2_s2..=self.square_max_rad2_s2;
        let of = squares.iter().zip(&self.effectiveness);
        // One that has failed has no effect, and turns as slowly as it can be told to.
        of.into_iter().all(|(square, effect)| limits.contains(square) || *effect == Vector4::zeros())
    }

    fn clamp(&self, square_rad2_s2: f64) -> f64 {
        square_rad2_s2.clamp(self.square_min_rad2_s2, self.square_max_rad2_s2)
    }
}

fn each(a: &PerRotor, b: &PerRotor, value: impl Fn(f64, f64) -> f64) -> PerRotor {
    a.iter().zip(b).map(|(a, b)| value(*a, *b)).collect()
}

fn torques_then_thrust(wrench: &RotorWrench) -> Vector4<f64> {
    let torque = &wrench.torque_B_N_m;
    Vector4::new(torque.x, torque.y, torque.z, wrench.thrust_N)
}

/// Torques about x, y and z, then thrust.
fn torques_first(effect: &Vector4<f64>) -> Vector4<f64> {
    Vector4::new(effect[1], effect[2], effect[3], effect[0])
}

/// Thrust and torques that a squared speed of each rotor makes. `torque_scale` is left out on purpose: it is what the physics
/// has and the controllers do not know, as nobody measures it on a vehicle.
fn effectiveness(vehicle: &Vehicle) -> Bounded<Vector4<f64>, ROTORS_MAX> {
    let (c_t, c_q) = (vehicle.thrust_coefficient, vehicle.torque_coefficient);
    let rotors = vehicle.rotors.iter().map(|rotor| {
        if rotor.has_failed {
            return Vector4::zeros();
        }
        let lever_B_m = rotor.position_m.cross(&rotor.axis);
        let torque_B = lever_B_m * c_t - rotor.axis * (rotor.spin * c_q);
        Vector4::new(c_t * rotor.axis.z, torque_B.x, torque_B.y, torque_B.z)
    });
    rotors.collect()
}

/// Remaining length of a row of length 1 below which the row counts as dependent on the others.
const INDEPENDENT_MIN: f64 = 1e-6;

/// The first of thrust, roll, pitch and yaw that follows from those before it at any speeds: its row of the
/// effectiveness matrix is a combination of theirs (Gram-Schmidt).
fn dependent(effectiveness: &[Vector4<f64>]) -> Option<Part> {
    let mut before: Bounded<[f64; ROTORS_MAX], 4> = Bounded::default();
    for (row, part) in [Part::Thrust, Part::Roll, Part::Pitch, Part::Yaw].into_iter().enumerate() {
        let effects: PerRotor = effectiveness.iter().map(|rotor| rotor[row]).collect();
        let size = norm(&effects);
        let mut left = effects.map(|effect| effect / size);
        // Twice, so that what rounding leaves of a dependent row is not taken for a row.
        for _ in 0..2 {
            for unit in &before {
                let along: f64 = left.iter().zip(unit).map(|(left, unit)| left * unit).sum();
                left.iter_mut().zip(unit).for_each(|(left, unit)| *left -= along * unit);
            }
        }
        let length = norm(&left);
        // A row of zeros makes it NaN.
        if length.partial_cmp(&INDEPENDENT_MIN) != Some(Ordering::Greater) {
            return Some(part);
        }
        let unit = std::array::from_fn(|rotor| left.get(rotor).map_or(0.0, |left| left / length));
        before = before.iter().copied().chain([unit]).collect();
    }
    None
}

fn norm(numbers: &[f64]) -> f64 {
    numbers.iter().map(|number| number * number).sum::<f64>().sqrt()
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

/// Rows of Bᵀ(BBᵀ)⁻¹. The rows of B, which have different units, are scaled to length 1 for the inversion.
fn pseudo_inverse(effectiveness: &[Vector4<f64>]) -> Option<Bounded<Vector4<f64>, ROTORS_MAX>> {
    let squares: Vector4<f64> = effectiveness.iter().map(|rotor| rotor.component_mul(rotor)).sum();
    let scale = squares.map(|square| square.sqrt().recip());
    let scaled: Bounded<Vector4<f64>, ROTORS_MAX> =
        effectiveness.iter().map(|rotor| rotor.component_mul(&scale)).collect();
    let product: Matrix4<f64> = scaled.iter().map(|rotor| rotor * rotor.transpose()).sum();
    let inverse = product.try_inverse()?;
    Some(scaled.map(|rotor| (inverse * rotor).component_mul(&scale)))
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

    #[track_caller]
    fn assert_near(found: f64, expected: f64, size: f64) {
        assert!((found - expected).abs() < 5e-4 * size, "found {found}, expected {expected}");
    }

    #[test]
    fn thrust_is_given_up_before_yaw_and_yaw_before_roll_and_pitch() {
        // 0.06 N*m of yaw are more than the rotors make at 2 N, and less than half of what they make in hover.
        let allocated = allocation().allocate(&wrench(2.0, 0.05, -0.02, 0.06));
        assert_eq!((allocated.roll_pitch_part, allocated.yaw_part), (1.0, 1.0));
        assert!(allocated.thrust_error_N > 0.2 && allocated.thrust_error_N < 2.7, "{allocated:?}");
        assert_near(allocated.wrench.torque_B_N_m.z, 0.06, 0.4);

        let allocated = allocation().allocate(&wrench(2.0, 0.15, -0.1, 5.0));
        assert!(allocated.yaw_part > 0.0 && allocated.yaw_part < 0.1, "{allocated:?}");
        assert_eq!(allocated.roll_pitch_part, 1.0);
        assert_near(allocated.wrench.torque_B_N_m.x, 0.15, 2.0);
        assert_near(allocated.wrench.torque_B_N_m.y, -0.1, 2.0);
    }

    /// More torque than there is in hover is cut to that: a law that asks for too much neither climbs nor falls.
    #[test]
    fn torques_beyond_those_of_hover_move_thrust_to_hover_and_no_further() {
        let hover_N = 0.48 * 9.81;
        for thrust_N in [1.0, hover_N, 15.0] {
            for torque in [[20.0, -10.0, 0.0], [-3.0, 0.0, 4.0], [0.0, 0.0, 9.0], [0.5, 0.5, -0.5]] {
                let made = allocation().allocate(&wrench(thrust_N, torque[0], torque[1], torque[2])).wrench;
                let (low, high) = (thrust_N.min(hover_N) - 0.01, thrust_N.max(hover_N) + 0.01);
                assert!((low..=high).contains(&made.thrust_N), "{thrust_N} {torque:?}: {made:?}");
                assert!(
                    made.torque_B_N_m.dot(&Vector3::from(torque)) > 0.0,
                    "{thrust_N} {torque:?}: {made:?}"
                );
            }
        }
    }

    #[test]
    fn thrust_makes_room_for_roll_and_pitch() {
        let (least_N, greatest_N) = allocation().thrust_range_N(0.0);
        let allocated = allocation().allocate(&wrench(2.0 * greatest_N, 0.1, 0.0, 0.0));
        assert_near(allocated.wrench.torque_B_N_m.x, 0.1, 2.0);
        assert_eq!((allocated.roll_pitch_part, allocated.yaw_part), (1.0, 1.0));
        assert!((allocated.thrust_error_N - allocated.wrench.thrust_N + 2.0 * greatest_N).abs() < 1e-9);
        // The rotor on the right is slower by what makes the torque, and front and rear by half of that, which the yaw needs.
        let slower_N = 0.1 / 0.17;
        assert_near(allocated.wrench.thrust_N, greatest_N - 2.0 * slower_N, 30.0);
        let at_rest = allocation().allocate(&wrench(0.0, 0.0, 0.0, 0.0));
        assert!(
            (at_rest.wrench.thrust_N - least_N).abs() < 1e-9
                && at_rest.thrust_error_N == at_rest.wrench.thrust_N
        );
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

    fn refused(vehicle: &Vehicle) -> (Option<Part>, String) {
        let error = Allocation::new(vehicle).unwrap_err();
        let part = match error {
            AllocationError::Singular { part, .. }
            | AllocationError::Unheld { part, .. }
            | AllocationError::Unbalanced { part, .. } => Some(part),
            AllocationError::SpeedRange { .. } => None,
        };
        (part, error.to_string())
    }

    #[test]
    fn rotors_that_cannot_hover_are_refused_with_what_is_not_controllable() {
        for (count, expected) in [(1, Part::Roll), (2, Part::Pitch), (3, Part::Yaw)] {
            let (part, message) = refused(&ring(count));
            assert_eq!(part, Some(expected), "{message}");
            assert!(message.contains(&format!("its {count} working rotors of {count} cannot")), "{message}");
        }
        assert!(refused(&ring(3)).1.contains("a tricopter needs a servo"));
        assert!(refused(&ring(1)).1.contains("a single rotor makes no torque"));
        let mut failed = hummingbird();
        failed.rotors[1].has_failed = true;
        assert!(
            refused(&failed).1.contains("3 working rotors of 4")
                && refused(&failed).1.contains("it turns about z")
        );
        let mut one_way = ring(6);
        one_way.rotors.iter_mut().for_each(|rotor| rotor.spin = 1.0);
        let (part, message) = refused(&one_way);
        assert!(part == Some(Part::Yaw) && message.contains("all rotors turn one way"), "{message}");
    }

    #[test]
    fn rotors_on_one_side_leave_a_torque() {
        let moved = |by_m: Vector3<f64>| {
            let mut vehicle = hummingbird();
            vehicle.rotors.iter_mut().for_each(|rotor| rotor.position_m += by_m);
            Allocation::new(&vehicle)
        };
        let refused = |by_m: Vector3<f64>| moved(by_m).unwrap_err();
        let unbalanced = |part| AllocationError::Unbalanced { rotors: 4, working: 4, part };
        assert_eq!(refused(Vector3::x() * 0.4), unbalanced(Part::Pitch));
        assert_eq!(refused(Vector3::y() * -0.4), unbalanced(Part::Roll));
        let message = refused(Vector3::x() * 0.4).to_string();
        assert!(message.contains("cannot hover") && message.contains("a pitch torque remains"), "{message}");
        assert!(moved(Vector3::x() * 0.02).is_ok(), "the rotors in front and behind balance");
    }

    #[test]
    fn rotors_in_a_line_or_without_a_range_are_refused() {
        let mut line = hummingbird();
        for (rotor, x) in line.rotors.iter_mut().zip([1.0, 1.0, -1.0, -1.0]) {
            rotor.position_m = Vector3::x() * x;
        }
        assert_eq!(refused(&line).0, Some(Part::Roll));
        let mut powerless = hummingbird();
        powerless.thrust_coefficient = 0.0;
        assert_eq!(refused(&powerless).0, Some(Part::Thrust));
        let mut empty = hummingbird();
        (empty.command.speed_at_min_rad_s, empty.command.speed_at_max_rad_s) = (900.0, 900.0);
        assert!(matches!(Allocation::new(&empty), Err(AllocationError::SpeedRange { .. })));
    }

    /// A hexacopter whose rotors turn in turns cannot lose one. With two neighbours turning alike it can lose
    /// most. Source: Du, Quan, Yang and Cai, Controllability analysis for multirotor helicopter rotor
    /// degradation and failure, JGCD 38(5), 2015.
    #[test]
    fn a_hexacopter_flies_on_without_a_rotor_or_is_refused_by_its_spins() {
        let turns_in_turns = |failed: usize| {
            let mut vehicle = ring(6);
            vehicle.rotors[failed].has_failed = true;
            vehicle
        };
        for failed in 0..6 {
            let (part, message) = refused(&turns_in_turns(failed));
            assert!(part == Some(Part::Yaw) && message.contains("its 5 working rotors of 6"), "{message}");
        }
        let flies_on = |failed: usize| {
            let mut vehicle = ring(6);
            let spins = [1.0, 1.0, -1.0, -1.0, 1.0, -1.0];
            vehicle.rotors.iter_mut().zip(spins).for_each(|(rotor, spin)| rotor.spin = spin);
            vehicle.rotors[failed].has_failed = true;
            Allocation::new(&vehicle).map(|allocation| {
                let demand = wrench(4.7, 0.05, -0.05, 0.005);
                let allocated = allocation.allocate(&demand);
                assert!(!allocated.is_saturated(), "{allocated:?}");
                assert_made(&allocated.wrench, &demand);
            })
        };
        let lost: Vec<bool> = (0..6).map(|failed| flies_on(failed).is_ok()).collect();
        assert_eq!(
            lost,
            [true, true, true, true, false, false],
            "PPNNPN flies on without one of its first four"
        );
    }

    #[test]
    fn tilted_rotors_make_their_wrench_and_more_yaw_than_upright_ones() {
        let upright = ring(6);
        let mut tilted = upright.clone();
        for (index, rotor) in tilted.rotors.iter_mut().enumerate() {
            // About the arm, so that the thrust turns the body as the drag does.
            let arm = rotor.position_m.normalize();
            let lean = if index.is_multiple_of(2) { -0.3 } else { 0.3 };
            rotor.axis = (Vector3::z() + arm.cross(&Vector3::z()) * -lean).normalize();
        }
        let most = |vehicle: &Vehicle| {
            let allocation = Allocation::new(vehicle).unwrap();
            let demand = wrench(4.7, 0.05, -0.1, 0.02);
            assert_made(&allocation.allocate(&demand).wrench, &demand);
            allocation.allocate(&wrench(4.7, 0.0, 0.0, 10.0)).wrench.torque_B_N_m.z
        };
        assert!(most(&tilted) > 3.0 * most(&upright), "{} {}", most(&tilted), most(&upright));
    }
}
