//! Messages by type, from which the inputs of any component are read without the names of its ports.

use crate::message::{BODY_START, Message, view_mut};
use crate::messages::{Orientation, Quaternion};
use crate::ports::{InputPorts, InputSamples, Inputs, PortSpec};
use crate::sample_memory::{SampleMemory, empty_sample};
use crate::schema::{Kind, Schema};

/// Types of attitudes, with the parts x, y, z, w.
const ATTITUDES: [&str; 2] = [Quaternion::SCHEMA.type_name, Orientation::SCHEMA.type_name];

/// Messages, at most one of each type, for callers that step components without knowing their ports.
///
/// ```
/// use component::messages::{Gps, Imu, SetPoint};
/// use component::{InputMemory, InputMessages, InputPorts};
///
/// #[derive(InputPorts)]
/// struct Measurements<'a> {
///     set_point: &'a SetPoint,
///     imu: &'a Imu,
///     gps: Option<&'a Gps>,
/// }
/// let messages = InputMessages::default().with(&SetPoint { altitude: 1.5, ..Default::default() });
/// let mut memory = InputMemory::default();
/// let inputs: Measurements<'_> = messages.read(&mut memory);
/// assert_eq!(inputs.set_point.altitude, 1.5);
/// assert_eq!(inputs.imu.specific_force.z, 0.0, "no message, but the port must be wired");
/// assert!(inputs.gps.is_none(), "no message, and the port may be left out");
/// ```
#[derive(Debug, Default)]
pub struct InputMessages {
    /// Type names and samples.
    samples: Vec<(&'static str, Box<[u64]>)>,
}

/// Memory of the inputs that [`InputMessages::read`] returns.
#[derive(Debug, Default)]
pub struct InputMemory(SampleMemory);

impl InputMessages {
    /// The messages and `message`, which replaces one of the same type.
    #[must_use]
    pub fn with<T: Message>(mut self, message: &T) -> Self {
        let mut words = empty_sample(T::SCHEMA.size);
        *view_mut(&mut words) = *message;
        self.samples.retain(|(type_name, _)| *type_name != T::SCHEMA.type_name);
        self.samples.push((T::SCHEMA.type_name, words));
        self
    }

    /// Reads inputs: each port has the message of its type. Without such a message a port that must be wired has zeros
    /// and level attitudes, and one that may be left out has `None`.
    #[must_use]
    pub fn read<'a, I: InputPorts<'a>>(&self, memory: &'a mut InputMemory) -> I {
        let ports: &[PortSpec] = if let Inputs::Ports(ports) = I::DECLARED { ports } else { &[] };
        memory.0 = SampleMemory::given(ports.iter().map(|port| self.sample(port)).collect());
        I::read(InputSamples(&memory.0))
    }

    fn sample(&self, port: &PortSpec) -> Option<Box<[u64]>> {
        let given = self.samples.iter().find(|(type_name, _)| *type_name == port.schema.type_name);
        let neutral = || port.required.then(|| neutral_sample(port.schema));
        given.map(|(_, words)| words.clone()).or_else(neutral)
    }
}

/// A sample of zeros, but for its attitudes, which are level: a quaternion of zeros is not an attitude.
fn neutral_sample(schema: &Schema) -> Box<[u64]> {
    let mut words = empty_sample(schema.size);
    let bytes: &mut [u8] = bytemuck::cast_slice_mut(&mut words);
    level_message(schema, &mut bytes[BODY_START..]);
    words
}

/// Makes the attitudes in a message of zeros level.
fn level_message(schema: &Schema, bytes: &mut [u8]) {
    if ATTITUDES.contains(&schema.type_name) {
        bytes[..size_of::<Quaternion>()].copy_from_slice(bytemuck::bytes_of(&Quaternion::default()));
        return;
    }
    schema.fields.iter().for_each(|field| level_value(&field.kind, &mut bytes[field.offset..]));
}

fn level_value(kind: &Kind, bytes: &mut [u8]) {
    match kind {
        Kind::Message(schema) => level_message(schema, bytes),
        Kind::Array(element, length) => {
            let size = element.size();
            (0..*length).for_each(|index| level_value(element, &mut bytes[index * size..]));
        }
        Kind::Primitive(_) | Kind::Sequence(..) | Kind::Text | Kind::NamedNumbers(..) => {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::messages::{Imu, PlantState, Pose, SetPoint};

    #[derive(component::InputPorts)]
    struct Two<'a> {
        first: &'a SetPoint,
        second: Option<&'a SetPoint>,
        imu: Option<&'a Imu>,
    }

    #[derive(component::InputPorts)]
    struct One<'a> {
        imu: &'a Imu,
    }

    #[test]
    fn all_ports_of_a_type_have_its_last_message() {
        let of = |altitude| SetPoint { altitude, ..SetPoint::default() };
        let messages = InputMessages::default().with(&of(1.0)).with(&of(2.0));
        let mut memory = InputMemory::default();
        let inputs: Two<'_> = messages.read(&mut memory);
        assert_eq!(inputs.first.altitude, 2.0);
        assert_eq!(inputs.second.map(|set_point| set_point.altitude), Some(2.0));
        assert!(inputs.imu.is_none());
    }

    #[derive(component::InputPorts)]
    struct Attitudes<'a> {
        state: &'a PlantState,
        pose: &'a Pose,
    }

    #[test]
    fn a_port_without_a_message_has_level_attitudes() {
        let mut memory = InputMemory::default();
        let Attitudes { state, pose } = InputMessages::default().read(&mut memory);
        assert_eq!(state.attitude, Quaternion::default());
        assert_eq!([state.position.x, state.angular_velocity.z], [0.0; 2]);
        let Orientation { x, y, z, w } = pose.orientation;
        assert_eq!([x, y, z, w], [0.0, 0.0, 0.0, 1.0]);
    }

    #[test]
    fn a_memory_serves_other_inputs_again() {
        let imu = Imu { angular_velocity: [0.1, 0.2, 0.3].into(), ..Imu::default() };
        let messages = InputMessages::default().with(&imu);
        let mut memory = InputMemory::default();
        let inputs: One<'_> = messages.read(&mut memory);
        assert_eq!(inputs.imu.angular_velocity, imu.angular_velocity);
        let inputs: Two<'_> = messages.read(&mut memory);
        assert!(inputs.imu.is_some() && inputs.second.is_none());
        assert_eq!(inputs.first.altitude, 0.0, "a port that must be wired");
    }
}
