//! The components that this package brings.

use bus::kind::NodeKind;
use runtime::registry::Registry;

/// Every component that this package brings, in alphabetical order.
pub const COMPONENTS: Registry = Registry::new(&[
    &sensors::attitude::KIND,
    &sensors::barometer::KIND,
    &sensors::battery::KIND,
    &controllers::cascade::KIND,
    &sensors::clearance::KIND,
    &sensors::ekf::KIND,
    &controllers::geometric::KIND,
    &NodeKind::of::<sensors::gps::GpsReceiver>(),
    &sensors::imu::KIND,
    &controllers::lqr::KIND,
    &sensors::magnetometer::KIND,
    &sensors::mocap::KIND,
    &controllers::pid::KIND,
    &NodeKind::of::<controllers::pilot::Pilot>(),
    &NodeKind::of::<plant::node::Plant>(),
    &controllers::player::KIND,
    &sensors::range::KIND,
    &sensors::range_inertial::KIND,
    &NodeKind::of::<recorder::node::Recorder>(),
    &sensors::rpm::KIND,
    &NodeKind::of::<plant::traffic::Traffic>(),
    &controllers::trajectory::KIND,
    &controllers::velocity::KIND,
    &controllers::wall_follow::KIND,
    &controllers::wall_stop::KIND,
]);
