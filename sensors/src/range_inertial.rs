//! The range-inertial node: velocity, height and walls from range finders, an IMU and an attitude.
#![allow(non_snake_case, reason = "a trailing _W or _B names the frame a vector is written in")]

pub mod axis;
pub mod filter;
pub mod params;

use crate::imu_model::ImuReading;
use crate::wire::{attitude as rotation, vector, vector_message};
use bus::kind::{Inputs, NodeKind, PortSpec};
use bus::messages::{AttitudeEstimate, Imu, Ranges, StateEstimate, WallEstimate};
use bus::{BusError, Message, Node};
use filter::{RangeInertial, RangeInertialState};
use params::RangeInertialParams;

/// The range-inertial estimator, for manifests.
pub const KIND: NodeKind = NodeKind {
    name: "range-inertial",
    summary: "velocity, height and distances to walls from range finders, IMU and attitude",
    inputs: Inputs::Ports(&[
        PortSpec::required("ranges", Ranges::SCHEMA),
        PortSpec::required("imu", Imu::SCHEMA),
        PortSpec::required("attitude", AttitudeEstimate::SCHEMA),
    ]),
    outputs: &[
        PortSpec::required("walls", WallEstimate::SCHEMA),
        PortSpec::required("estimate", StateEstimate::SCHEMA),
    ],
    check: |parameters, run| {
        let params: RangeInertialParams = diagnostics::read(parameters)?;
        RangeInertial::new(params, run.period_s()).map(|_| ())
    },
    run,
};

fn run() -> Result<(), BusError> {
    let mut node = Node::join()?;
    let ranges = node.input::<Ranges>("ranges")?;
    let imu = node.input::<Imu>("imu")?;
    let attitude = node.input::<AttitudeEstimate>("attitude")?;
    let walls = node.output::<WallEstimate>("walls")?;
    let estimate = node.output::<StateEstimate>("estimate")?;
    let filter = RangeInertial::new(node.parameters()?, node.period_s()).map_err(|e| node.error(e))?;
    node.run_with_state(filter.initial_state(), |tick, state| {
        let attitude = *tick.get(attitude);
        let inputs = filter::Inputs {
            now_ns: tick.time_ns(),
            imu: reading(tick.get(imu)),
            attitude_WB: rotation(attitude.attitude),
            ranges: tick.get(ranges),
        };
        filter.step(state, &inputs);
        tick.write(walls, wall_estimate(&filter, state, attitude.yaw, tick.time_ns()))?;
        tick.write(estimate, state_estimate(&filter, state, &attitude))
    })
}

fn reading(imu: &Imu) -> ImuReading {
    ImuReading {
        specific_force_B_m_s2: vector(imu.specific_force),
        angular_velocity_B_rad_s: vector(imu.angular_velocity),
    }
}

fn wall_estimate(
    filter: &RangeInertial,
    state: &RangeInertialState,
    yaw_rad: f64,
    now_ns: u64,
) -> WallEstimate {
    let walls = filter.walls(state, yaw_rad, now_ns);
    WallEstimate {
        distance: walls.map(|wall| wall.distance_m),
        in_sight: walls.map(|wall| u32::from(wall.is_in_sight)),
        velocity: state.velocity_heading_m_s(yaw_rad),
        height: state.height_m(),
        climb_rate: state.velocity_W_m_s().z,
        ..Default::default()
    }
}

fn state_estimate(
    filter: &RangeInertial,
    state: &RangeInertialState,
    attitude: &AttitudeEstimate,
) -> StateEstimate {
    StateEstimate {
        position: vector_message(state.position_W_m()),
        velocity: vector_message(state.velocity_W_m_s()),
        attitude: attitude.attitude,
        angular_velocity: attitude.angular_velocity,
        position_sigma: vector_message(state.position_sigma_W_m()),
        velocity_sigma: vector_message(state.velocity_sigma_W_m_s()),
        attitude_sigma: [filter.attitude_sigma_rad(); 3].into(),
        ..Default::default()
    }
}

#[cfg(test)]
mod tests {
    use super::KIND;
    use bus::context::NodeContext;
    use serde_json::json;

    #[test]
    fn impossible_parameters_are_named() {
        for (parameters, key) in [
            (json!({ "range_sigma_m": 0.0 }), "`range_sigma_m`"),
            (json!({ "half_angle_deg": 90.0 }), "`half_angle_deg`"),
            (json!({ "initial_height_m": -1.0 }), "`initial_height_m`"),
            (json!({ "dead_zone_m": 0.2 }), "`dead_zone_m`"),
        ] {
            let error = (KIND.check)(&parameters, &NodeContext::new("node", &[])).unwrap_err().to_string();
            assert!(error.contains(key), "{error}");
        }
        assert_eq!((KIND.check)(&json!({}), &NodeContext::new("node", &[])), Ok(()));
    }
}
