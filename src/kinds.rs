//! The components that this package brings.

use bus::Registration;
use runtime::registry::Registry;

/// Every component that this package brings, in alphabetical order.
pub const COMPONENTS: Registry = Registry::new(&[
    Registration::of_kind(&sensors::attitude::KIND),
    Registration::of_kind(&sensors::barometer::KIND),
    Registration::of_kind(&sensors::battery::KIND),
    Registration::of_kind(&controllers::cascade::KIND),
    Registration::of_kind(&sensors::clearance::KIND),
    Registration::of_kind(&sensors::ekf::KIND),
    Registration::of_kind(&controllers::geometric::KIND),
    Registration::of::<sensors::gps::GpsReceiver>(),
    Registration::of_kind(&sensors::imu::KIND),
    Registration::of_kind(&controllers::lqr::KIND),
    Registration::of_kind(&sensors::magnetometer::KIND),
    Registration::of_kind(&sensors::mocap::KIND),
    Registration::of_kind(&controllers::pid::KIND),
    Registration::of::<controllers::pilot::Pilot>(),
    Registration::of::<plant::node::Plant>(),
    Registration::of_kind(&controllers::player::KIND),
    Registration::of_kind(&sensors::range::KIND),
    Registration::of_kind(&sensors::range_inertial::KIND),
    Registration::of::<recorder::node::Recorder>(),
    Registration::of_kind(&sensors::rpm::KIND),
    Registration::of::<plant::traffic::Traffic>(),
    Registration::of_kind(&controllers::trajectory_node::KIND),
    Registration::of_kind(&controllers::velocity::KIND),
    Registration::of_kind(&controllers::wall_follow::KIND),
    Registration::of_kind(&controllers::wall_stop::KIND),
]);
