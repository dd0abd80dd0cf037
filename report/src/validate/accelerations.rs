//! Predicted accelerations of flights, for programs.

use super::labels::labels;
use anyhow::Context;
use diagnostics::Error;
use flights::FlightSet;
use identify::accelerations::accelerations;
use plant::Airframe;
use serde_json::{Map, Value, json};
use std::path::Path;
use vehicles::Vehicle;

/// Accelerations that each of `vehicles`, with the effects of its file, predicts at the samples of the
/// `flights`. Each flight has its role. Under `vehicles` it has the times in s, the specific forces in m/s²
/// and the angular accelerations in rad/s². Both are in the axes of the body.
///
/// # Errors
/// A vehicle file that cannot be read, a flight without an attitude, a flight with neither rotor speeds nor commands.
///
/// ```no_run
/// let set = flights::FlightSet::load("flights/neurobem.toml".as_ref())?;
/// let json = report::validate::predicted_accelerations(&[set.vehicle.as_ref()], &set)?;
/// println!("{}", json["flights"]["up to 6.5 m/s"]["vehicles"]["neurobem-quadrotor"]["specific_force_m_s2"][0]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn predicted_accelerations(vehicles: &[&Path], flights: &FlightSet) -> Result<Value, Error> {
    let mut of_flights = Map::new();
    for flight in &flights.flights {
        let mut of_vehicles = Map::new();
        for (vehicle, name) in vehicles.iter().zip(labels(vehicles)) {
            let airframe = Airframe::from_files(Vehicle::load_from(&flights.files, vehicle)?, &[])?;
            let predicted = accelerations(flight, &airframe)
                .map_err(anyhow::Error::msg)
                .with_context(|| format!("the flight `{}` cannot be predicted", flight.name))?;
            let columns = json!({
                "time_s": predicted.time_s,
                "specific_force_m_s2": predicted.specific_force_B_m_s2,
                "angular_acceleration_rad_s2": predicted.angular_acceleration_B_rad_s2,
            });
            of_vehicles.insert(name, columns);
        }
        let of_flight = json!({ "role": flight.role, "vehicles": of_vehicles });
        of_flights.insert(flight.name.clone(), of_flight);
    }
    Ok(json!({ "flights": of_flights }))
}
