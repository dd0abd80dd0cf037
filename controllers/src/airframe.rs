//! The vehicle as its controllers know it: its file, the allocation to its rotors, and the models for the loops.

use crate::allocation::{Allocation, AllocationError, THRUST_RESERVE};
use crate::wrench_part::Part;
use diagnostics::{Diagnostic, ParameterError, Place};
use inputs::InputFiles;
use nalgebra::Vector3;
use std::path::Path;
use vehicles::{Rotor, Vehicle};

/// A vehicle, and how its rotors are reached.
///
/// ```
/// use controllers::airframe::ControlledVehicle;
///
/// let vehicle = vehicles::Vehicle::parse(vehicles::reference::HUMMINGBIRD, "hummingbird.toml").unwrap();
/// let model = ControlledVehicle::new(vehicle).unwrap().hover_model();
/// let weight_N = model.mass_kg * model.gravity_m_s2;
/// assert!(model.thrust_min_N < weight_N && weight_N < model.thrust_max_N, "it hovers amid its range");
/// ```
#[derive(Debug, Clone)]
pub struct ControlledVehicle {
    /// The vehicle.
    pub vehicle: Vehicle,
    /// The allocation to its rotors.
    pub allocation: Allocation,
}

impl ControlledVehicle {
    /// The vehicle of the file at `path` among `files`.
    ///
    /// # Errors
    /// The file is refused, or its rotors cannot be allocated to.
    pub fn load(files: &InputFiles, path: &Path) -> Result<Self, ParameterError> {
        let vehicle = Vehicle::load_from(files, path);
        let vehicle = vehicle.map_err(|error| error.named_by("vehicle"))?;
        Allocation::new(&vehicle)
            .map_err(|error| at_its_line(files, path, &vehicle, &error).named_by("vehicle"))
            .map(|allocation| Self { vehicle, allocation })
    }

    /// `vehicle` with its allocation.
    ///
    /// # Errors
    /// Its rotors cannot be allocated to.
    pub fn new(vehicle: Vehicle) -> Result<Self, AllocationError> {
        let allocation = Allocation::new(&vehicle)?;
        Ok(Self { vehicle, allocation })
    }

    /// Returns its model for the loops about hover. Products of inertia are left to the loops.
    #[must_use]
    pub fn hover_model(&self) -> HoverModel {
        let (thrust_min_N, thrust_max_N) = self.allocation.thrust_range_N(THRUST_RESERVE);
        HoverModel {
            mass_kg: self.vehicle.mass_kg,
            inertia_B_kg_m2: self.vehicle.inertia_kg_m2.diagonal(),
            gravity_m_s2: self.vehicle.gravity_m_s2,
            thrust_min_N,
            thrust_max_N,
        }
    }
}

/// The part of a vehicle that the loops about hover have to know.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HoverModel {
    /// Mass, kg.
    pub mass_kg: f64,
    /// Moments of inertia about body x, y and z, kg·m².
    pub inertia_B_kg_m2: Vector3<f64>,
    /// Gravity, m/s².
    pub gravity_m_s2: f64,
    /// The least thrust to demand, N; see [`Allocation::thrust_range_N`].
    pub thrust_min_N: f64,
    /// The greatest thrust to demand, N.
    pub thrust_max_N: f64,
}

/// An arm is too long if it is longer than this multiple of all others: a slip in its unit is 10 at least. Tuned, no source.
const ARM_RATIO_MAX: f64 = 5.0;
/// Units of lengths that are smaller than the metre, and their lengths in m.
const SMALLER: [(&str, f64); 2] = [("cm", 1e-2), ("mm", 1e-3)];

/// A rotor that is much farther from the centre of mass than all others.
struct FarRotor {
    number: usize,
    /// Both distances, in words.
    message: String,
    /// The unit in which its number would fit the others; empty without one.
    help: String,
}

impl FarRotor {
    fn of(vehicle: &Vehicle) -> Option<Self> {
        let arm_m = |rotor: &Rotor| rotor.position_m.norm();
        let far = |a: &(usize, &Rotor), b: &(usize, &Rotor)| arm_m(a.1).total_cmp(&arm_m(b.1));
        let (number, rotor) = vehicle.rotors.iter().enumerate().max_by(far)?;
        let others = vehicle.rotors.iter().enumerate().filter(|(other, _)| *other != number);
        let next_m = others.map(|(_, other)| arm_m(other)).fold(0.0, f64::max);
        let far_m = arm_m(rotor);
        if next_m == 0.0 || far_m <= ARM_RATIO_MAX * next_m {
            return None;
        }
        let near = next_m / ARM_RATIO_MAX..=next_m * ARM_RATIO_MAX;
        let fits = SMALLER.into_iter().find(|(_, length_m)| near.contains(&(far_m * length_m)));
        let message = format!(
            "`rotors.{number}.position` of \"{}\" is {far_m:.3} m from the centre of mass, and the other rotors at most {next_m:.3} m",
            rotor.name
        );
        let help = |(unit, _): (&str, f64)| {
            format!("is its unit right? With unit = \"{unit}\" it would fit the others")
        };
        Some(Self { number, message, help: fits.map_or(String::new(), help) })
    }
}

/// The key of the number that `error` is about.
fn key_of(vehicle: &Vehicle, error: &AllocationError) -> String {
    match error {
        AllocationError::Singular { part: Part::Thrust, .. } => "rotor.thrust_coefficient".to_owned(),
        AllocationError::Unheld { part: Part::Yaw, spins: [counter_clockwise, clockwise], .. } => {
            // One of those of which there are more turns the wrong way.
            let most = if counter_clockwise > clockwise { 1.0 } else { -1.0 };
            let is_most = |rotor: &Rotor| !rotor.has_failed && rotor.spin * most > 0.0;
            format!("rotors.{}.spin", vehicle.rotors.iter().position(is_most).unwrap_or_default())
        }
        AllocationError::Singular { part: Part::Yaw, .. } => "rotors.0.spin".to_owned(),
        AllocationError::Singular { .. }
        | AllocationError::Unheld { .. }
        | AllocationError::Unbalanced { .. } => "rotors.0.position".to_owned(),
        AllocationError::SpeedRange { .. } => "command.speed_at_min".to_owned(),
    }
}

/// Advice on an error: what to change in the vehicle file.
fn advice(error: &AllocationError) -> &'static str {
    match error {
        AllocationError::Singular { part: Part::Thrust, .. } => {
            "give `rotor` its `thrust_coefficient`, and `rotors` an `axis` that points upwards"
        }
        AllocationError::Singular { working: ..=3, .. } => "fly with four or more working rotors",
        AllocationError::Singular { part: Part::Yaw, .. } => {
            "let half of the rotors turn the other way: `spin`"
        }
        AllocationError::Singular { .. } => "move the rotors out of the line: `position`",
        AllocationError::Unbalanced { .. } => "move the rotors or the centre of mass: `position`",
        AllocationError::Unheld { .. } => {
            "change the rotors or the range of `command`, or place the rotors so that others take over from one that has failed"
        }
        AllocationError::SpeedRange { .. } => "state the smaller speed as `speed_at_min`",
    }
}

/// The fault at the number of the vehicle file at `path`, or of its base, that it is about.
fn at_its_line(files: &InputFiles, path: &Path, vehicle: &Vehicle, error: &AllocationError) -> Diagnostic {
    let far = FarRotor::of(vehicle).filter(|_| matches!(error, AllocationError::Unbalanced { .. }));
    let (key, message, help) = match far {
        Some(FarRotor { number, message, help }) => {
            (format!("rotors.{number}.position"), format!("{message}: {error}"), help)
        }
        None => (key_of(vehicle, error), error.to_string(), advice(error).to_owned()),
    };
    let message = ParameterError::conflict(key.as_str(), message);
    let place = vehicle.provenance.iter().rev().find(|number| number.key == key).and_then(|number| {
        let text = files.text(Path::new(&number.file)).ok()?;
        let line = text.lines().nth(number.line.checked_sub(1)?)?;
        let start = line.as_ptr() as usize - text.as_ptr() as usize;
        Some(Place::of(&number.file, &text, &(start..start + line.len())))
    });
    let fault = match place {
        Some(place) => Diagnostic::at(place, message),
        None => Diagnostic::in_file(path.display().to_string(), message),
    };
    fault.help(help)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::allocation::RotorWrench;

    fn craft(name: &str) -> ControlledVehicle {
        let path = format!("{}/../vehicles/{name}.toml", env!("CARGO_MANIFEST_DIR"));
        ControlledVehicle::load(&InputFiles::default(), path.as_ref()).unwrap()
    }

    fn refused(from: &str, to: &str) -> String {
        let text = vehicles::reference::HUMMINGBIRD.replacen(from, to, 1);
        let vehicle = Vehicle::parse(&text, "bird.toml").unwrap();
        let error = Allocation::new(&vehicle).unwrap_err();
        let fault = at_its_line(&InputFiles::default(), "bird.toml".as_ref(), &vehicle, &error);
        format!("{} {fault}", fault.key())
    }

    #[test]
    fn an_arm_in_the_wrong_unit_is_told_before_its_torque() {
        let told = refused("[0.17, 0, 0]", "[17, 0, 0]");
        assert!(told.starts_with("rotors.0.position "), "{told}");
        for part in ["\"front\" is 17.000 m", "at most 0.170 m: its 4 working rotors", "unit = \"cm\""] {
            assert!(told.contains(part), "{told}");
        }
    }

    #[test]
    fn a_wrong_sense_of_rotation_is_told_at_a_spin() {
        let told = refused("\"counter-clockwise\"", "\"clockwise\"");
        assert!(told.starts_with("rotors.0.spin "), "{told}");
        assert!(told.contains("(1 turn counter-clockwise, 3 clockwise)"), "{told}");
    }

    #[test]
    fn shipped_vehicles_keep_a_twentieth_of_their_thrust_range_at_either_end() {
        for name in [
            "hummingbird",
            "crazyflie-2.1",
            "crazyflie-2.1-brushless",
            "dji-f550",
            "tarot-t18",
            "neuralfly-quadrotor",
            "neurobem-quadrotor",
        ] {
            let craft = craft(name);
            let (least_N, most_N) = craft.allocation.thrust_range_N(0.0);
            let (kept_N, model) = (THRUST_RESERVE * (most_N - least_N), craft.hover_model());
            let range_N = (model.thrust_min_N, model.thrust_max_N);
            assert_eq!(range_N, (least_N + kept_N, most_N - kept_N), "{name}");
        }
    }

    #[test]
    fn vehicles_that_lift_many_times_their_weight_can_sink() {
        let (least_N, most_N) = craft("hummingbird").allocation.thrust_range_N(0.0);
        let lifting = |multiple: f64| {
            let mut vehicle = craft("hummingbird").vehicle;
            vehicle.mass_kg = most_N / multiple / vehicle.gravity_m_s2;
            ControlledVehicle::new(vehicle).unwrap().hover_model()
        };
        for multiple in [11.5, 17.0, 23.0, 40.0] {
            let (model, weight_N) = (lifting(multiple), most_N / multiple);
            let expected_N = least_N + 0.3 * (weight_N - least_N);
            assert!((model.thrust_min_N - expected_N).abs() < 1e-9, "{multiple}: {model:?}");
        }
        // It climbs with all rotors at their slowest, which only a rig allows: the range is that of any other vehicle.
        let kept_N = THRUST_RESERVE * (most_N - least_N);
        assert_eq!(lifting(100.0).thrust_min_N, least_N + kept_N);
    }

    /// The Hummingbird with a fifth rotor at its centre of mass, which pushes along `axis`.
    fn with_a_fifth(axis: Vector3<f64>) -> ControlledVehicle {
        let mut vehicle = craft("hummingbird").vehicle;
        let fifth = Rotor { position_m: Vector3::zeros(), axis, ..vehicle.rotors[0].clone() };
        vehicle.rotors.push(fifth);
        ControlledVehicle::new(vehicle).unwrap()
    }

    #[test]
    fn rotors_that_push_sideways_or_downwards_are_allocated_to() {
        for axis in [Vector3::x(), -Vector3::z()] {
            let allocation = with_a_fifth(axis).allocation;
            let demand = RotorWrench { thrust_N: 4.7, torque_B_N_m: Vector3::new(0.02, -0.02, 0.005) };
            let made = allocation.allocate(&demand).wrench;
            assert!((made.thrust_N - 4.7).abs() < 0.02, "{axis}: {made:?}");
            assert!((made.torque_B_N_m - demand.torque_B_N_m).norm() < 2e-3, "{axis}: {made:?}");
        }
        let (least_N, most_N) = with_a_fifth(-Vector3::z()).allocation.thrust_range_N(0.0);
        let (four_least_N, four_most_N) = craft("hummingbird").allocation.thrust_range_N(0.0);
        let [one_least_N, one_most_N] = [four_least_N, four_most_N].map(|thrust_N| thrust_N / 4.0);
        assert!((least_N - four_least_N + one_most_N).abs() < 1e-9, "{least_N}");
        assert!((most_N - four_most_N + one_least_N).abs() < 1e-9, "{most_N}");
    }

    #[test]
    fn rotors_of_which_none_push_upwards_are_refused() {
        for axis in [Vector3::x(), -Vector3::z()] {
            let mut vehicle = craft("hummingbird").vehicle;
            vehicle.rotors.iter_mut().for_each(|rotor| rotor.axis = axis);
            let message = ControlledVehicle::new(vehicle).unwrap_err().to_string();
            assert!(
                message.contains("thrust is not controllable") && message.contains("push upwards"),
                "{message}"
            );
        }
    }
}
