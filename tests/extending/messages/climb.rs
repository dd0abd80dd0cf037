//! Rate at which a vehicle rises.

use super::Time;
use component::Message;

/// Reading of a variometer.
#[derive(Clone, Copy, Debug, Default, Message)]
#[repr(C)]
#[message(type_name = "hummingbus_msgs/msg/Climb")]
pub struct Climb {
    /// Simulation time.
    pub stamp: Time,
    /// Rate of climb.
    #[field(unit = "m/s", frame = "world")]
    pub rate: f64,
}
