//! The attitude node: the complementary filter over an IMU's readings.
#![allow(non_snake_case, reason = "a trailing _B names the frame a vector is written in")]

use crate::complementary::{Complementary, ComplementaryParams, ComplementaryState};
use crate::imu_model::ImuReading;
use bus::kind::{Inputs, NodeKind, PortSpec};
use bus::messages::{AttitudeEstimate, Imu, Quaternion, Vector3};
use bus::{BusError, Message, Node};

/// The attitude estimator, for manifests.
pub const KIND: NodeKind = NodeKind {
    name: "attitude",
    summary: "complementary filter: roll, pitch and yaw from an IMU",
    inputs: Inputs::Ports(&[PortSpec::required("imu", Imu::SCHEMA)]),
    outputs: &[PortSpec::required("estimate", AttitudeEstimate::SCHEMA)],
    check: |parameters, run| {
        let params: ComplementaryParams = diagnostics::read(parameters)?;
        Complementary::new(params, run.period_s()).map(|_| ())
    },
    run,
};

/// What the filter remembers, as it is handed over.
#[derive(Clone, Copy, Message)]
#[repr(C)]
#[message(type_name = "hummingbus_msgs/msg/ComplementaryState")]
struct Memory {
    /// The estimated attitude, body to world.
    #[field(frame = "world")]
    attitude: Quaternion,
    /// The last sample's angular rate; not a number before the first.
    #[field(unit = "rad/s", frame = "body")]
    last_angular_velocity: Vector3,
}

impl From<&ComplementaryState> for Memory {
    fn from(state: &ComplementaryState) -> Self {
        let [x, y, z, w] = state.attitude_WB.coords.into();
        let rate_B_rad_s = state.last_angular_velocity_B_rad_s;
        let last = rate_B_rad_s.map_or([f64::NAN; 3], <[f64; 3]>::from);
        Self { attitude: Quaternion { x, y, z, w }, last_angular_velocity: last.into() }
    }
}

impl From<&Memory> for ComplementaryState {
    fn from(memory: &Memory) -> Self {
        let Quaternion { x, y, z, w } = memory.attitude;
        let last = nalgebra::Vector3::from(<[f64; 3]>::from(memory.last_angular_velocity));
        Self {
            // It was a unit quaternion: normalising it again would change its last bits.
            attitude_WB: nalgebra::UnitQuaternion::new_unchecked(nalgebra::Quaternion::new(w, x, y, z)),
            last_angular_velocity_B_rad_s: (!last.x.is_nan()).then_some(last),
        }
    }
}

fn run() -> Result<(), BusError> {
    let mut node = Node::join()?;
    let imu = node.input::<Imu>("imu")?;
    let output = node.output::<AttitudeEstimate>("estimate")?;
    let filter =
        Complementary::new(node.parameters()?, node.period_s()).map_err(|error| node.error(error))?;
    node.run_with_state(Memory::from(&ComplementaryState::default()), |tick, memory| {
        let imu = tick.get(imu);
        let reading = ImuReading {
            specific_force_B_m_s2: <[f64; 3]>::from(imu.specific_force).into(),
            angular_velocity_B_rad_s: <[f64; 3]>::from(imu.angular_velocity).into(),
        };
        let mut state = ComplementaryState::from(&*memory);
        let estimate = filter.step(&mut state, &reading);
        *memory = Memory::from(&state);
        let [x, y, z, w] = estimate.attitude_WB.coords.into();
        tick.write(
            output,
            AttitudeEstimate {
                attitude: Quaternion { x, y, z, w },
                roll: estimate.roll_rad,
                pitch: estimate.pitch_rad,
                yaw: estimate.yaw_rad,
                angular_velocity: Vector3::from(<[f64; 3]>::from(estimate.angular_velocity_B_rad_s)),
                ..Default::default()
            },
        )
    })
}
