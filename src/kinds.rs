//! The built-in kinds of node.

use bus::kind::NodeKind;

/// Every built-in kind, in alphabetical order.
pub const KINDS: [&NodeKind; 15] = [
    &sensors::attitude::KIND,
    &sensors::barometer::KIND,
    &sensors::battery::KIND,
    &sensors::ekf::KIND,
    &sensors::gps::KIND,
    &sensors::imu::KIND,
    &sensors::magnetometer::KIND,
    &sensors::mocap::KIND,
    &controllers::pid::KIND,
    &controllers::pilot::KIND,
    &plant::node::KIND,
    &controllers::player::KIND,
    &sensors::range::KIND,
    &sensors::range_inertial::KIND,
    &recorder::node::KIND,
];

/// The kind named `name`.
pub fn find(name: &str) -> Option<&'static NodeKind> {
    KINDS.into_iter().find(|kind| kind.name == name)
}

/// The names of all kinds, for messages.
pub fn names() -> String {
    KINDS.map(|kind| kind.name).join(", ")
}
