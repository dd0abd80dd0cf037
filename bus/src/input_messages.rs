//! Messages by type, from which the inputs of any component are read without the names of its ports.

use crate::message::{Message, view_mut};
use crate::ports::{InputPorts, InputSamples, Inputs, PortSpec};
use crate::sample_memory::{SampleMemory, empty_sample};

/// Messages, at most one of each type, for callers that step components without knowing their ports.
///
/// ```
/// use bus::messages::{Gps, Imu, SetPoint};
/// use bus::{InputMemory, InputMessages, InputPorts};
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

    /// Reads inputs: each port has the message of its type. Without such a message a port that must be wired has zeros,
    /// and one that may be left out has `None`.
    #[must_use]
    pub fn read<'a, I: InputPorts<'a>>(&self, memory: &'a mut InputMemory) -> I {
        let ports: &[PortSpec] = if let Inputs::Ports(ports) = I::DECLARED { ports } else { &[] };
        memory.0 = SampleMemory::given(ports.iter().map(|port| self.sample(port)).collect());
        I::read(InputSamples(&memory.0))
    }

    fn sample(&self, port: &PortSpec) -> Option<Box<[u64]>> {
        let given = self.samples.iter().find(|(type_name, _)| *type_name == port.schema.type_name);
        let zeros = || port.required.then(|| empty_sample(port.schema.size));
        given.map(|(_, words)| words.clone()).or_else(zeros)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::messages::{Imu, SetPoint};

    #[derive(bus::InputPorts)]
    struct Two<'a> {
        first: &'a SetPoint,
        second: Option<&'a SetPoint>,
        imu: Option<&'a Imu>,
    }

    #[derive(bus::InputPorts)]
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
