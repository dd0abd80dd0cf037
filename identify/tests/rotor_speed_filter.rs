//! Logged rotor speeds that went through a low pass: the filter is named, and no inertia or motor.
use crate::simulated;
use crate::skipped::first;
use flights::{Channel, FlightSet};
use identify::report::Report;
use identify::run::identify;
use identify::steps::ROTOR_SPEED_FILTER;
use identify::{SensorErrors, SpeedFilter};
use rayon::prelude::*;
use simulated::cases::Case;

const DURATION_S: f64 = 8.0;
/// Time constant of the filter.
const LAG_S: f64 = 0.03;

/// Flights of a vehicle as it is declared, with filtered rotor speeds.
fn filtered(seed: u64, has_commands: bool) -> FlightSet {
    let mut case = Case::null(seed, DURATION_S);
    case.plan.sensors.pose_ticks = 10;
    case.plan.sensors.has_rotor_speeds = true;
    let mut set = case.flights();
    let rotor_speed = SpeedFilter { lag_s: LAG_S, late_s: 0.0 };
    let sensors = SensorErrors { rotor_speed, ..SensorErrors::default() };
    for flight in &mut set.flights {
        *flight = sensors.put_on(flight);
        if !has_commands {
            flight.command = Channel::default();
        }
    }
    set
}

fn report(seed: u64, has_commands: bool) -> Report {
    identify(&filtered(seed, has_commands), &mut |_| ()).unwrap().report
}

#[test]
fn a_filter_of_rotor_speeds_is_named_beside_commands() {
    for report in
        first(1, "seeds", 2_700..2_704_u64).into_par_iter().map(|seed| report(seed, true)).collect::<Vec<_>>()
    {
        assert_eq!(report.verdict, [ROTOR_SPEED_FILTER.name], "{report}");
        let lag = report.effects[ROTOR_SPEED_FILTER.name].parameters["lag"];
        assert!((lag.value / LAG_S - 1.0).abs() < 0.15, "{report}");
    }
}

/// Speeds alone drive the model, and their clock was removed before: the inertia would have to change with the band.
#[test]
fn a_filter_of_rotor_speeds_is_no_inertia() {
    for report in first(1, "seeds", 2_750..2_754_u64)
        .into_par_iter()
        .map(|seed| report(seed, false))
        .collect::<Vec<_>>()
    {
        assert!(report.verdict.contains(&ROTOR_SPEED_FILTER.name), "{report}");
        assert!(!report.verdict.contains(&"inertia-error"), "{report}");
        let lag = report.effects[ROTOR_SPEED_FILTER.name].parameters["lag"];
        assert!((lag.value / LAG_S - 1.0).abs() < 0.3, "{report}");
    }
}
