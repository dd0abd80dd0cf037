//! The built-in kinds of node.

use bus::kind::NodeKind;

/// Every built-in kind, in alphabetical order.
pub const KINDS: &[&NodeKind] = &[
    &sensors::attitude::KIND,
    &sensors::barometer::KIND,
    &sensors::battery::KIND,
    &controllers::cascade::KIND,
    &sensors::clearance::KIND,
    &sensors::ekf::KIND,
    &controllers::geometric::KIND,
    &sensors::gps::KIND,
    &sensors::imu::KIND,
    &controllers::lqr::KIND,
    &sensors::magnetometer::KIND,
    &sensors::mocap::KIND,
    &controllers::pid::KIND,
    &controllers::pilot::KIND,
    &plant::node::KIND,
    &controllers::player::KIND,
    &sensors::range::KIND,
    &sensors::range_inertial::KIND,
    &recorder::node::KIND,
    &sensors::rpm::KIND,
    &plant::traffic::KIND,
    &controllers::trajectory::KIND,
    &controllers::velocity::KIND,
    &controllers::wall_follow::KIND,
    &controllers::wall_stop::KIND,
];

/// The kind named `name`.
pub fn find(name: &str) -> Option<&'static NodeKind> {
    KINDS.iter().copied().find(|kind| kind.name == name)
}

/// The names of all kinds, for messages.
pub fn names() -> String {
    KINDS.iter().map(|kind| kind.name).collect::<Vec<_>>().join(", ")
}
