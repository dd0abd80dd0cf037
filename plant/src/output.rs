//! What a plant publishes.

use crate::backend::Backend;
use crate::parameters::BackendName;
use bus::messages::{
    Battery, BodyTransform, Contact, Orientation, PlantState, Point, Pose, PoseStamped, Quaternion,
};
use bus::{BusError, Node, Output, Tick};
use nalgebra::{UnitQuaternion, Vector3};

/// Nominal voltage of the Hummingbird's battery, three lithium-polymer cells of 3.7 V: what is published until
/// a vehicle file describes its battery.
const NOMINAL_VOLTAGE_V: f64 = 11.1;

/// The outputs of a plant; those behind an option exist where the manifest names them.
pub(crate) struct Outputs {
    state: Output<PlantState>,
    pose: Option<Output<PoseStamped>>,
    tf: Option<Output<BodyTransform>>,
    contact: Option<Output<Contact>>,
    battery: Option<Output<Battery>>,
}

impl Outputs {
    pub(crate) fn declare(node: &mut Node, backend: BackendName) -> Result<Self, BusError> {
        let outputs = Self {
            state: node.output("state")?,
            pose: node.optional_output("pose")?,
            tf: node.optional_output("tf")?,
            contact: node.optional_output("contact")?,
            battery: node.optional_output("battery")?,
        };
        if outputs.contact.is_some() && backend == BackendName::NewtonEuler {
            return Err(node.error(
                "the output `contact` needs `backend` = \"rapier\": free flight touches nothing, and would \
                 report a flight through a wall as one without contact",
            ));
        }
        Ok(outputs)
    }

    pub(crate) fn publish(&self, tick: &mut Tick<'_>, backend: &dyn Backend) -> Result<(), BusError> {
        tick.write(self.state, state(backend))?;
        let body = &backend.state().body;
        let (position, orientation) = (point(&body.position_W_m), orientation(&body.attitude_WB));
        if let Some(pose) = self.pose {
            let message = PoseStamped { pose: Pose { position, orientation }, ..Default::default() };
            tick.write(pose, message)?;
        }
        if let Some(tf) = self.tf {
            tick.write(tf, BodyTransform::new(position, orientation))?;
        }
        if let Some(output) = self.contact {
            tick.write(output, contact(backend))?;
        }
        if let Some(battery) = self.battery {
            tick.write(battery, battery_message(backend, tick.time_ns()))?;
        }
        Ok(())
    }
}

fn state(backend: &dyn Backend) -> PlantState {
    let state = backend.state();
    let [x, y, z, w] = state.body.attitude_WB.coords.into();
    PlantState {
        position: vector(&state.body.position_W_m),
        velocity: vector(&state.body.velocity_W_m_s),
        attitude: Quaternion { x, y, z, w },
        angular_velocity: vector(&state.body.angular_velocity_B_rad_s),
        specific_force: vector(&backend.motion().specific_force_B_m_s2),
        rotor_speed: state.rotors.map(|rotor| rotor.speed_rad_s),
        ..Default::default()
    }
}

fn battery_message(backend: &dyn Backend, measured_ns: u64) -> Battery {
    let nominal = Battery { voltage: NOMINAL_VOLTAGE_V, charge: 1.0, ..Default::default() };
    let truth = backend.battery().map_or(nominal, |battery| Battery {
        voltage: battery.voltage_V,
        current: battery.current_A,
        charge: battery.charge,
        ..Default::default()
    });
    Battery { measured_ns, valid: 1, ..truth }
}

fn contact(backend: &dyn Backend) -> Contact {
    let report = backend.contact();
    Contact {
        force: vector(&report.force_W_N),
        impact_speed: report.impact_speed_m_s,
        count: report.count,
        object: report.object,
        began: report.began,
        crashed: report.crashed.into(),
        ..Default::default()
    }
}

fn vector(v: &Vector3<f64>) -> bus::messages::Vector3 {
    <[f64; 3]>::from(*v).into()
}

fn point(v: &Vector3<f64>) -> Point {
    Point { x: v.x, y: v.y, z: v.z }
}

fn orientation(attitude: &UnitQuaternion<f64>) -> Orientation {
    let [x, y, z, w] = attitude.coords.into();
    Orientation { x, y, z, w }
}
