//! The components that this package brings.

use bus::Registration;
use controllers::controller::Controller;
use plant::effects::CATALOGUE;
use runtime::registry::{NodeProgram, Registry};
use sensors::sensing::Sensing;

/// Every component that this package brings, in alphabetical order.
///
/// ```
/// let imu = hummingbus::COMPONENTS.find("imu").unwrap();
/// assert_eq!(imu.outputs[0].schema.type_name, "hummingbus_msgs/msg/Imu");
/// assert!(imu.has_parameter("gyroscope_range_rad_s"));
/// ```
pub const COMPONENTS: Registry = Registry::new(&[
    Registration::of::<autopilots::ArduPilot>(),
    Registration::of::<sensors::complementary::Complementary>(),
    Registration::of::<Sensing<sensors::barometer::BarometerParams>>(),
    Registration::of::<Sensing<sensors::battery::BatteryParams>>(),
    Registration::of::<autopilots::Betaflight>(),
    Registration::of::<Controller<controllers::cascade::CascadeLaw>>(),
    Registration::of::<sensors::clearance::ClearanceJudge>(),
    Registration::of::<sensors::ekf::filter::Ekf>(),
    Registration::of::<Controller<controllers::geometric::GeometricLaw>>(),
    Registration::of::<Sensing<sensors::gps::GpsParams>>(),
    Registration::of::<sensors::ideal::Ideal>(),
    Registration::of::<sensors::imu::ImuSensor>(),
    Registration::of::<report::judge::node::Judge>(),
    Registration::of::<sensors::link::Link>(),
    Registration::of::<Controller<controllers::lqr::LqrLaw>>(),
    Registration::of::<Sensing<sensors::magnetometer::MagnetometerParams>>(),
    Registration::of::<Sensing<sensors::mocap::MocapParams>>(),
    Registration::of::<crate::operator::Operator>(),
    Registration::of::<Controller<controllers::pid::PidLaw>>(),
    Registration::of::<controllers::pilot::Pilot>(),
    Registration::of::<plant::node::Plant>(),
    Registration::of::<controllers::player::Player>(),
    Registration::of::<controllers::position_hold::PositionHold>(),
    Registration::of::<plant::propeller_stand::PropellerStand>(),
    Registration::of::<autopilots::Px4>(),
    Registration::of::<Sensing<sensors::range::RangeFinders>>(),
    Registration::of::<sensors::range_inertial::filter::RangeInertial>(),
    Registration::of::<recorder::node::Recorder>(),
    Registration::of::<controllers::rc::Rc>(),
    Registration::of::<controllers::remote_control::RemoteControl>(),
    Registration::of::<Sensing<sensors::rpm::RpmParams>>(),
    Registration::of::<plant::traffic::Traffic>(),
    Registration::of::<controllers::trajectory_node::TrajectoryNode>(),
    Registration::of::<Controller<controllers::velocity::VelocityLaw>>(),
    Registration::of::<Controller<controllers::wall_follow::WallFollowLaw>>(),
    Registration::of::<Controller<controllers::wall_follow_thesis::WallFollowThesisLaw>>(),
    Registration::of::<Controller<controllers::wall_stop::WallStopLaw>>(),
    Registration::of::<Controller<controllers::wall_stop_thesis::WallStopThesisLaw>>(),
])
.with_programs(&[NodeProgram {
    name: "fmu",
    summary: "an FMU for co-simulation, of FMI 2.0 or 3.0",
    parameters: fmu::PARAMETERS,
    run: fmu::run,
}])
.with_effects(effects);

/// Names of the effects that the plant knows.
pub(crate) fn effects() -> Vec<&'static str> {
    CATALOGUE.iter().map(|kind| kind.name).collect()
}

#[cfg(test)]
mod tests {
    use super::COMPONENTS;
    use bus::FileRole;
    use bus::component::Transfer;

    /// A checkpoint of a run refuses other values of them.
    #[test]
    fn parameters_that_count_at_the_start_alone_are_declared() {
        for component in COMPONENTS.iter() {
            // The place of the estimate's origin is added in every step.
            let counts_later = |name: &str| name == "initial_level_position_m";
            let is_stateless = matches!(component.transfer, Transfer::Nothing);
            let names = component.parameters.iter().map(|parameter| parameter.name);
            let named = names.filter(|name| name.contains("initial") && !counts_later(name));
            for name in named.filter(|_| !is_stateless) {
                assert!(component.is_initial(name), "{}: {name}", component.name);
            }
        }
    }

    /// A launcher reads there which further files a run needs, and which of them `--set` changes.
    #[test]
    fn parameters_that_name_files_declare_the_kind_of_the_file() {
        let roles = [
            ("vehicle", FileRole::Model),
            ("scene", FileRole::Model),
            ("gains", FileRole::Settings),
            ("firmware", FileRole::Program),
            ("data", FileRole::Data),
        ];
        for component in COMPONENTS.iter() {
            for (name, role) in roles {
                let declared = component.file(name).map(|kind| kind.role);
                let expected = component.has_parameter(name).then_some(role);
                assert_eq!(declared, expected, "{}: {name}", component.name);
            }
        }
    }
}
