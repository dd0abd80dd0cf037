//! Flights beyond the envelope in which a vehicle's model was validated: `check` warns of what it can know before a flight.

use crate::effects::{Effect, WIND};
use crate::state::RigidBody;
use component::context::NodeContext;
use nalgebra::Vector3;
use vehicles::Vehicle;

/// Warns of a start, or a steady wind, beyond the envelope of `vehicle`, which has these effects.
pub(crate) fn tell(vehicle: &Vehicle, effects: &[Effect], start: &RigidBody, run: &NodeContext<'_>) {
    let Some(envelope) = vehicle.envelope else { return };
    let wind_m_s = steady_wind_m_s(effects);
    let found = [
        (
            "initial_velocity_m_s",
            "initial speed",
            start.velocity_W_m_s.norm(),
            "m/s",
            (None, envelope.speed_max_m_s),
        ),
        (
            "initial_position_m",
            "initial height",
            start.position_W_m.z,
            "m",
            (envelope.height_min_m, envelope.height_max_m),
        ),
        ("vehicle", "steady wind", wind_m_s, "m/s", (None, envelope.speed_max_m_s)),
    ];
    for (key, what, value, unit, (low, high)) in found {
        if low.is_some_and(|low| value < low) || high.is_some_and(|high| value > high) {
            let low = low.map_or(String::new(), |low| format!("from {low:.3} "));
            let high = high.map_or(String::new(), |high| format!("up to {high:.3} {unit}"));
            run.warn(
                key,
                format!(
                    "`vehicle` \"{}\": the {what} of {value:.3} {unit} is beyond the envelope in which its model was validated, \
                     {low}{high} (`[envelope]` of its file)",
                    vehicle.name
                ),
            );
        }
    }
}

/// Speed of the steady wind among `effects`.
fn steady_wind_m_s(effects: &[Effect]) -> f64 {
    let winds = effects.iter().filter(|effect| *effect.kind == WIND);
    winds.map(|wind| Vector3::from_column_slice(&wind.values[..3])).sum::<Vector3<f64>>().norm()
}

#[cfg(test)]
mod tests {
    use super::*;
    use vehicles::Envelope;

    #[test]
    fn a_start_beyond_the_envelope_is_told() {
        let text = vehicles::reference::HUMMINGBIRD;
        let mut vehicle = Vehicle::parse(text, "hummingbird.toml").unwrap();
        let start = RigidBody {
            velocity_W_m_s: Vector3::new(3.0, 0.0, 0.0),
            ..RigidBody::level_at(Vector3::new(0.0, 0.0, 5.0))
        };
        let wind = [crate::effects::find("wind").unwrap().nominal()];
        let told = |vehicle: &Vehicle| {
            let run = NodeContext::new("plant", &[]);
            tell(vehicle, &wind, &start, &run);
            run.into_warnings().into_iter().map(|warning| warning.message).collect::<Vec<_>>()
        };
        assert_eq!(told(&vehicle), [""; 0], "nothing is known");
        vehicle.envelope = Some(Envelope {
            speed_max_m_s: Some(2.0),
            height_min_m: Some(0.5),
            height_max_m: Some(4.0),
            ..Envelope::default()
        });
        let messages = told(&vehicle);
        assert_eq!(messages.len(), 3, "{messages:?}");
        assert!(
            messages[0].contains("initial speed of 3.000 m/s") && messages[0].contains("up to 2.000 m/s"),
            "{messages:?}"
        );
        assert!(
            messages[1].contains("initial height of 5.000 m")
                && messages[1].contains("from 0.500 up to 4.000 m"),
            "{messages:?}"
        );
        assert!(messages[2].contains("steady wind of 3.1"), "{messages:?}");
        vehicle.envelope =
            Some(Envelope { speed_max_m_s: Some(4.0), height_max_m: Some(6.0), ..Envelope::default() });
        assert_eq!(told(&vehicle), [""; 0]);
    }
}
