//! Rates at which flights were logged, so that a simulated flight is seen through the same logger.

use crate::data::prepared::Prepared;
use flights::{Channel, Flight};

/// Median period of each channel in s; `None` where a channel was not logged.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct LogRates {
    /// Motor commands; `None` also where the log writes each change.
    pub command_s: Option<f64>,
    /// True if motor commands were logged.
    pub has_commands: bool,
    /// Speeds of the rotors.
    pub rotor_speed_s: Option<f64>,
    /// Position.
    pub position_s: Option<f64>,
    /// Velocity.
    pub velocity_s: Option<f64>,
    /// Attitude.
    pub attitude_s: Option<f64>,
    /// Gyroscope.
    pub angular_velocity_s: Option<f64>,
    /// Accelerometer.
    pub specific_force_s: Option<f64>,
    /// Number of rotors.
    pub rotors: usize,
}

impl LogRates {
    /// The rates of the first of `flights`.
    pub(crate) fn of(flights: &[Prepared]) -> Self {
        flights.first().map_or_else(Self::default, |prepared| Self::of_flight(&prepared.flight))
    }

    fn of_flight(flight: &Flight) -> Self {
        Self {
            command_s: flight.command.period_s().filter(|_| !flight.commands_on_change),
            has_commands: !flight.command.is_empty(),
            rotor_speed_s: flight.rotor_speed.period_s(),
            position_s: flight.position.period_s(),
            velocity_s: flight.velocity.period_s(),
            attitude_s: flight.attitude.period_s(),
            angular_velocity_s: flight.angular_velocity.period_s(),
            specific_force_s: flight.specific_force.period_s(),
            rotors: flight.rotors,
        }
    }

    /// The samples of `flight`, which has one of every channel at each tick of `tick_s`, that this logger would have kept.
    ///
    /// ```
    /// use flights::{Channel, Flight, Role};
    /// use identify::LogRates;
    ///
    /// let mut flight = Flight::new("simulated", "", Role::Fit);
    /// let time_s = (0..10).map(|tick| f64::from(tick) * 0.001).collect();
    /// flight.position = Channel { time_s, values: vec![[0.0; 3]; 10] };
    /// let rates = LogRates { position_s: Some(0.005), ..LogRates::default() };
    /// assert_eq!(rates.logged(flight, 0.001).position.time_s, [0.0, 0.005]);
    /// ```
    #[must_use]
    pub fn logged(&self, mut flight: Flight, tick_s: f64) -> Flight {
        let command_s = if self.has_commands { Some(self.command_s.unwrap_or(tick_s)) } else { None };
        thin(&mut flight.command, command_s, tick_s);
        thin(&mut flight.rotor_speed, self.rotor_speed_s, tick_s);
        thin(&mut flight.position, self.position_s, tick_s);
        thin(&mut flight.velocity, self.velocity_s, tick_s);
        thin(&mut flight.attitude, self.attitude_s, tick_s);
        thin(&mut flight.angular_velocity, self.angular_velocity_s, tick_s);
        thin(&mut flight.specific_force, self.specific_force_s, tick_s);
        flight
    }
}

/// Leaves every sample of a period; none if there is no period.
fn thin<const N: usize>(channel: &mut Channel<N>, period_s: Option<f64>, tick_s: f64) {
    let Some(period_s) = period_s else {
        *channel = Channel::default();
        return;
    };
    let step = ((period_s / tick_s).round() as usize).max(1);
    channel.time_s = channel.time_s.iter().copied().step_by(step).collect();
    channel.values = channel.values.iter().copied().step_by(step).collect();
}
