//! Messages whose fields, units and frames need not be said.

use crate::declaration::{ChannelMap, Entry, Format, Frame};
use crate::error::{LogError, Spot};
use crate::log::Log;
use crate::name::Name;
use crate::quantity::Quantity;

/// Fields in which a type of message holds a quantity. In `fields`, `*` stands for x, y, z (and w) in turn, and
/// `#` for the indices from 0 on.
struct Known {
    kind: &'static str,
    quantity: Quantity,
    fields: &'static str,
    unit: &'static str,
    frame: Frame,
}

const fn ours(kind: &'static str, quantity: Quantity, fields: &'static str, unit: &'static str) -> Known {
    Known { kind, quantity, fields, unit, frame: Frame::FluEnu }
}

/// Types of PX4 and ArduPilot.
const fn forward_right_down(
    kind: &'static str,
    quantity: Quantity,
    fields: &'static str,
    unit: &'static str,
) -> Known {
    Known { kind, quantity, fields, unit, frame: Frame::FrdNed }
}

/// Fields of a type of message that say if it holds a quantity.
struct Validity {
    kind: &'static str,
    quantity: Quantity,
    /// Their names, divided by blanks.
    fields: &'static str,
    /// True if a field with this number means that the message does not hold the quantity.
    is_absent: fn(f64) -> bool,
}

const fn covariance(quantity: Quantity, fields: &'static str) -> Validity {
    Validity { kind: "sensor_msgs/msg/Imu", quantity, fields, is_absent: |first| first == -1.0 }
}

const fn flags(kind: &'static str, quantity: Quantity, fields: &'static str) -> Validity {
    Validity { kind, quantity, fields, is_absent: |flag| flag == 0.0 }
}

/// By the comments of `sensor_msgs/Imu` and `vehicle_local_position`. Other ROS messages have no such rule.
const VALIDITIES: &[Validity] = &[
    covariance(Quantity::Attitude, "orientation_covariance[0]"),
    covariance(Quantity::AngularVelocity, "angular_velocity_covariance[0]"),
    covariance(Quantity::SpecificForce, "linear_acceleration_covariance[0]"),
    flags("vehicle_local_position", Quantity::Position, "xy_valid z_valid"),
    flags("vehicle_local_position", Quantity::Velocity, "v_xy_valid v_z_valid"),
];

/// In the order of preference where no channel is declared: sensors come before the truth of a simulation.
const KNOWN: &[Known] = &[
    ours("hummingbus_msgs/msg/MotorCommand", Quantity::Command, "command[#]", "count"),
    ours("hummingbus_msgs/msg/RotorSpeeds", Quantity::RotorSpeed, "rotor_speed[#]", "rad/s"),
    ours("hummingbus_msgs/msg/Imu", Quantity::SpecificForce, "specific_force.*", "m/s^2"),
    ours("hummingbus_msgs/msg/Imu", Quantity::AngularVelocity, "angular_velocity.*", "rad/s"),
    ours("hummingbus_msgs/msg/Mocap", Quantity::Position, "position.*", "m"),
    ours("hummingbus_msgs/msg/Mocap", Quantity::Attitude, "attitude.*", "1"),
    ours("hummingbus_msgs/msg/Battery", Quantity::BatteryVoltage, "voltage", "V"),
    ours("hummingbus_msgs/msg/MeasuredState", Quantity::Position, "position.*", "m"),
    ours("hummingbus_msgs/msg/MeasuredState", Quantity::Velocity, "velocity.*", "m/s"),
    ours("hummingbus_msgs/msg/MeasuredState", Quantity::Attitude, "attitude.*", "1"),
    ours("hummingbus_msgs/msg/MeasuredState", Quantity::AngularVelocity, "angular_velocity.*", "rad/s"),
    ours("geometry_msgs/msg/PoseStamped", Quantity::Position, "pose.position.*", "m"),
    ours("geometry_msgs/msg/PoseStamped", Quantity::Attitude, "pose.orientation.*", "1"),
    ours("geometry_msgs/msg/PoseWithCovarianceStamped", Quantity::Position, "pose.pose.position.*", "m"),
    ours("geometry_msgs/msg/PoseWithCovarianceStamped", Quantity::Attitude, "pose.pose.orientation.*", "1"),
    ours("geometry_msgs/msg/TransformStamped", Quantity::Position, "transform.translation.*", "m"),
    ours("geometry_msgs/msg/TransformStamped", Quantity::Attitude, "transform.rotation.*", "1"),
    ours("geometry_msgs/msg/TwistStamped", Quantity::Velocity, "twist.linear.*", "m/s"),
    // The linear part of an odometry's twist is in the body, so that it is no velocity in the world.
    ours("nav_msgs/msg/Odometry", Quantity::Position, "pose.pose.position.*", "m"),
    ours("nav_msgs/msg/Odometry", Quantity::Attitude, "pose.pose.orientation.*", "1"),
    ours("sensor_msgs/msg/Imu", Quantity::SpecificForce, "linear_acceleration.*", "m/s^2"),
    ours("sensor_msgs/msg/Imu", Quantity::AngularVelocity, "angular_velocity.*", "rad/s"),
    ours("sensor_msgs/msg/Imu", Quantity::Attitude, "orientation.*", "1"),
    ours("nav_msgs/msg/Odometry", Quantity::AngularVelocity, "twist.twist.angular.*", "rad/s"),
    ours("geometry_msgs/msg/TwistStamped", Quantity::AngularVelocity, "twist.angular.*", "rad/s"),
    ours("sensor_msgs/msg/BatteryState", Quantity::BatteryVoltage, "voltage", "V"),
    ours("hummingbus_msgs/msg/PlantState", Quantity::RotorSpeed, "rotor_speed[#]", "rad/s"),
    ours("hummingbus_msgs/msg/PlantState", Quantity::Position, "position.*", "m"),
    ours("hummingbus_msgs/msg/PlantState", Quantity::Velocity, "velocity.*", "m/s"),
    ours("hummingbus_msgs/msg/PlantState", Quantity::Attitude, "attitude.*", "1"),
    ours("hummingbus_msgs/msg/PlantState", Quantity::AngularVelocity, "angular_velocity.*", "rad/s"),
    ours("hummingbus_msgs/msg/PlantState", Quantity::SpecificForce, "specific_force.*", "m/s^2"),
    forward_right_down("vehicle_attitude", Quantity::Attitude, "q[1] q[2] q[3] q[0]", "1"),
    forward_right_down("vehicle_local_position", Quantity::Position, "x y z", "m"),
    forward_right_down("vehicle_local_position", Quantity::Velocity, "vx vy vz", "m/s"),
    forward_right_down("sensor_combined", Quantity::AngularVelocity, "gyro_rad[#]", "rad/s"),
    forward_right_down("sensor_combined", Quantity::SpecificForce, "accelerometer_m_s2[#]", "m/s^2"),
    forward_right_down("vehicle_angular_velocity", Quantity::AngularVelocity, "xyz[#]", "rad/s"),
    forward_right_down("vehicle_acceleration", Quantity::SpecificForce, "xyz[#]", "m/s^2"),
    forward_right_down("battery_status", Quantity::BatteryVoltage, "voltage_v", "V"),
    forward_right_down("ATT", Quantity::Attitude, "Roll Pitch Yaw", "deg"),
    forward_right_down("XKF1", Quantity::Position, "PN PE PD", "m"),
    forward_right_down("XKF1", Quantity::Velocity, "VN VE VD", "m/s"),
    forward_right_down("IMU", Quantity::AngularVelocity, "GyrX GyrY GyrZ", "rad/s"),
    forward_right_down("IMU", Quantity::SpecificForce, "AccX AccY AccZ", "m/s^2"),
    forward_right_down("BAT", Quantity::BatteryVoltage, "Volt", "V"),
];

impl Known {
    /// The entry that reads it from `topic`, of a vehicle with so many `rotors`.
    fn entry(&self, topic: &str, rotors: usize) -> Entry {
        let axes = ["x", "y", "z", "w"];
        let name = |index: usize| {
            let axis = axes.get(index).copied().unwrap_or_default();
            self.fields.replace('*', axis).replace('#', &index.to_string()).as_str().into()
        };
        let names: Vec<Name> = if self.fields.contains(['*', '#']) {
            (0..self.quantity.size().unwrap_or(rotors)).map(name).collect()
        } else {
            self.fields.split(' ').map(Name::from).collect()
        };
        let is_euler = self.quantity == Quantity::Attitude && names.len() == 3;
        let (columns, euler) = if is_euler { (None, Some(names)) } else { (Some(names), None) };
        Entry {
            columns,
            euler,
            topic: Some(topic.to_owned()),
            unit: Some(self.unit.to_owned()),
            frame: Some(self.frame),
            ..Entry::default()
        }
    }
}

/// Samples of a quantity that messages do not hold, although they have its fields.
pub struct Absent {
    /// For each message of the topic, true if it does not hold the quantity.
    pub messages: Vec<bool>,
    /// The fields that say so.
    pub fields: &'static str,
}

/// The messages of the topic of `entry` that say that they do not hold the quantity; `None` if its type cannot say so, or other
/// fields are declared than those of the type.
pub fn absent(log: &dyn Log, quantity: Quantity, entry: &Entry) -> Option<Absent> {
    let topic = entry.topic.as_deref()?;
    let (_, kind) = log.topics().into_iter().find(|(name, _)| name == topic)?;
    let validity =
        VALIDITIES.iter().find(|validity| validity.kind == kind && validity.quantity == quantity)?;
    // Of these quantities none has a number for each rotor.
    let known = KNOWN.iter().find(|known| known.kind == kind && known.quantity == quantity)?.entry(topic, 0);
    let plain = |name: &Name| name.plain.clone();
    let declared: Vec<String> = entry.columns.iter().flatten().map(plain).collect();
    if !known.columns.iter().flatten().any(|name| declared.contains(&name.plain)) {
        return None;
    }
    let fields: Vec<String> = validity.fields.split(' ').map(str::to_owned).collect();
    // Older logs lack them.
    let rows = log.samples(Some(topic), &fields).ok()?.rows;
    let messages = rows.iter().map(|row| row.iter().any(|number| (validity.is_absent)(*number))).collect();
    Some(Absent { messages, fields: validity.fields })
}

/// `entry` completed by the facts of a known type of message, of a vehicle with so many `rotors`.
///
/// # Errors
/// If the entry names a topic alone and its type is not known to hold the quantity.
pub fn complete(log: &dyn Log, quantity: Quantity, entry: &Entry, rotors: usize) -> Result<Entry, LogError> {
    let named = entry.names().next().is_some();
    let (false, Some(topic)) = (named, entry.topic.as_deref()) else { return Ok(entry.clone()) };
    let topics = log.topics();
    let Some((_, kind)) = topics.iter().find(|(name, _)| name == topic) else {
        return Err(LogError::missing("topic", topic, topics.iter().map(|(name, _)| name), "`topic`"));
    };
    let known = KNOWN.iter().find(|known| known.kind == kind && known.quantity == quantity);
    let known = known.ok_or_else(|| {
        let found = format!("the type {kind}");
        LogError::unexpected(Spot::Key("topic"), "a type known to hold it", found, "add `fields` and `unit`")
    })?;
    let default = known.entry(topic, rotors);
    Ok(Entry {
        unit: entry.unit.clone().or(default.unit),
        frame: entry.frame.or(default.frame),
        columns: default.columns,
        euler: default.euler,
        ..entry.clone()
    })
}

/// The channels of a log for which the flights file declares none: for each quantity the preferred type that
/// exactly one topic has. The notes name the channels that were taken, and those that were not clear.
pub fn defaults(log: &dyn Log, format: Format, rotors: usize) -> (ChannelMap, Vec<String>) {
    let (mut channels, mut notes) = (ChannelMap::new(), Vec::new());
    if !matches!(format, Format::Mcap | Format::Ulog | Format::Dataflash) {
        return (channels, notes);
    }
    let topics = log.topics();
    for quantity in Quantity::CHANNELS {
        for known in KNOWN.iter().filter(|known| known.quantity == quantity) {
            let of_kind: Vec<_> =
                topics.iter().filter(|(_, kind)| kind == known.kind).map(|(name, _)| name.as_str()).collect();
            match of_kind[..] {
                [] => continue,
                [topic] if holds_nothing(log, quantity, &known.entry(topic, rotors)) => {
                    notes.push(format!(
                        "{quantity}: not taken from {topic}, whose messages say that they hold no value"
                    ));
                    continue;
                }
                [topic] => {
                    notes.push(format!("{quantity}: taken from {topic}, as no channel is declared"));
                    channels.insert(quantity, toml::Spanned::new(0..0, known.entry(topic, rotors)));
                }
                _ => notes.push(format!(
                    "{quantity}: not read, as more than one topic has it ({}); name one in `channels`",
                    of_kind.join(", ")
                )),
            }
            break;
        }
    }
    (channels, notes)
}

/// True if no message of the topic holds the quantity.
fn holds_nothing(log: &dyn Log, quantity: Quantity, entry: &Entry) -> bool {
    absent(log, quantity, entry).is_some_and(|absent| !absent.messages.contains(&false))
}
