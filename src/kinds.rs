//! The components that this package brings.

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
]);
