//! Bags of ROS 2 as robots write them: arrays that are empty at first, and messages of two clocks.

use crate::lz4;
use crate::support;
use std::collections::BTreeMap;

use flights::{Flight, FlightsError};
use mcap::Compression;
use support::Place;

const MOTORS: (&str, &str) = ("a_msgs/msg/Motors", "float64[] data\n");
const IMU: (&str, &str) = (
    "sensor_msgs/msg/Imu",
    "std_msgs/Header header\ngeometry_msgs/Quaternion orientation\nfloat64[9] orientation_covariance\n\
     geometry_msgs/Vector3 angular_velocity\nfloat64[9] angular_velocity_covariance\n\
     geometry_msgs/Vector3 linear_acceleration\nfloat64[9] linear_acceleration_covariance\n\
     ==========\nMSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n\
     ==========\nMSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n\
     ==========\nMSG: geometry_msgs/Quaternion\nfloat64 x\nfloat64 y\nfloat64 z\nfloat64 w\n\
     ==========\nMSG: geometry_msgs/Vector3\nfloat64 x\nfloat64 y\nfloat64 z\n",
);
const CHANNELS: &str = r#"
command = { topic = "/motors", fields = ["data"], unit = "count" }
angular_velocity = { topic = "/imu" }
specific_force = { topic = "/imu" }
"#;

/// A flight of 4 s at 100 Hz.
struct Bag {
    compression: Option<Compression>,
    /// Length of the array of commands in the message k.
    commands: fn(u32) -> u32,
    /// Time between the stamps and the log's time, in s, and whether message k of the sensor has a stamp.
    stamps_s: f64,
    is_stamped: fn(u32) -> bool,
    /// First numbers of the covariances of orientation, angular velocity and acceleration.
    covariances: fn(u32) -> [f64; 3],
}

impl Default for Bag {
    fn default() -> Self {
        Self {
            compression: None,
            commands: |_| 4,
            stamps_s: 0.002,
            is_stamped: |_| true,
            covariances: |_| [0.0; 3],
        }
    }
}

impl Bag {
    fn bytes(&self) -> Vec<u8> {
        let mut file = std::io::Cursor::new(Vec::new());
        let mut writer = mcap::WriteOptions::new().compression(self.compression).create(&mut file).unwrap();
        let mut channel = |topic: &str, (kind, text): (&str, &str)| {
            let schema = writer.add_schema(kind, "ros2msg", text.as_bytes()).unwrap();
            writer.add_channel(schema, topic, "cdr", &BTreeMap::new()).unwrap()
        };
        let (motors, imu) = (channel("/motors", MOTORS), channel("/imu", IMU));
        for k in 0..400 {
            let ns = 5_000_000_000 + 10_000_000 * u64::from(k);
            let mut send = |channel_id: u16, body: &[u8]| {
                let header =
                    mcap::records::MessageHeader { channel_id, sequence: k, log_time: ns, publish_time: ns };
                writer.write_to_known_channel(&header, &[&[0, 1, 0, 0], body].concat()).unwrap();
            };
            let length = (self.commands)(k);
            let mut body = [length.to_le_bytes(), [0; 4]].concat();
            (0..length).for_each(|motor| body.extend((100.0 + f64::from(motor)).to_le_bytes()));
            send(motors, &body[..if length == 0 { 4 } else { body.len() }]);
            send(imu, &self.imu(k, ns));
        }
        writer.finish().unwrap();
        drop(writer);
        file.into_inner()
    }

    fn imu(&self, k: u32, ns: u64) -> Vec<u8> {
        let stamp_s = ns as f64 * 1e-9 - self.stamps_s;
        let stamp = if (self.is_stamped)(k) {
            [stamp_s.floor() as u32, ((stamp_s - stamp_s.floor()) * 1e9) as u32]
        } else {
            [0, 0]
        };
        // The frame's name is empty: its end alone, and three bytes of padding.
        let mut body: Vec<u8> = [stamp[0], stamp[1], 1, 0].into_iter().flat_map(u32::to_le_bytes).collect();
        let t = 0.01 * f64::from(k);
        let angle = 0.1 * libm::sin(2.0 * t);
        let [orientation, rate, acceleration] = (self.covariances)(k);
        let numbers = [0.0, 0.0, libm::sin(angle / 2.0), libm::cos(angle / 2.0)]
            .into_iter()
            .chain([orientation])
            .chain([0.0; 8])
            .chain([0.0, 0.0, 0.2 * libm::cos(2.0 * t)])
            .chain([rate])
            .chain([0.0; 8])
            .chain([0.001 * t, 0.0, 9.81])
            .chain([acceleration])
            .chain([0.0; 8]);
        numbers.for_each(|number: f64| body.extend(number.to_le_bytes()));
        body
    }

    fn read(&self, channels: &str, keys: &str) -> Result<Flight, FlightsError> {
        let place = Place::new();
        place.write("log.mcap", &self.bytes());
        place.load("log.mcap", channels, keys)
    }

    fn refused(&self, channels: &str, keys: &str) -> String {
        self.read(channels, keys).unwrap_err().to_string()
    }
}

#[test]
fn a_bag_is_read_with_arrays_of_one_length() {
    let flight = Bag::default().read(CHANNELS, "").unwrap_or_else(|error| panic!("{error}"));
    assert_eq!((flight.command.time_s.len(), flight.angular_velocity.time_s.len()), (400, 400));
    assert_eq!(flight.command.values[7][..4], [100.0, 101.0, 102.0, 103.0]);
}

#[test]
fn arrays_that_are_empty_or_short_are_left_out_and_counted() {
    let lengths: [fn(u32) -> u32; 4] = [
        |k| if k < 30 { 0 } else { 4 },
        |k| if k >= 370 { 0 } else { 4 },
        |k| if k < 30 { 2 } else { 4 },
        |k| if (100..130).contains(&k) { 0 } else { 6 },
    ];
    for commands in lengths {
        let flight = Bag { commands, ..Bag::default() }.read(CHANNELS, "").unwrap();
        assert_eq!(flight.command.time_s.len(), 370);
        let said = flight.notes.iter().any(|note| note.contains("command: 30 of 400 samples"));
        assert!(said, "{:?}", flight.notes);
    }
}

#[test]
fn a_field_that_no_message_has_is_refused() {
    let short = Bag { commands: |k| k.min(3), ..Bag::default() };
    let message = short.refused(CHANNELS, "");
    assert!(message.contains("no field `data[3]`; it has data[0], data[1], data[2]"), "{message}");
    let message = Bag::default().refused(&CHANNELS.replace("\"data\"", "\"date\""), "");
    assert!(message.contains("no field `date[0]`") && message.contains("data[3]"), "{message}");
    let message = Bag { commands: |_| 0, ..Bag::default() }.refused(CHANNELS, "");
    assert!(message.contains("no field `data[0]`"), "{message}");
}

#[test]
fn two_clocks_are_named_and_a_key_chooses() {
    // Stamps of a simulation that began 1000 s later, commands without stamps.
    let bag = Bag { stamps_s: -1000.0, ..Bag::default() };
    assert!(Bag { stamps_s: 0.3, ..Bag::default() }.read(CHANNELS, "").is_ok());
    let message = bag.refused(CHANNELS, "");
    for part in
        ["one clock", "1000.000 s apart", "`/imu`", "`/motors`, which has no stamps", "`time = \"log\"`"]
    {
        assert!(message.contains(part), "`{part}` is not in: {message}");
    }
    let flight = bag.read(CHANNELS, "time = \"log\"").unwrap();
    assert_eq!(flight.command.time_s, flight.angular_velocity.time_s);
    let message = bag.refused(CHANNELS, "time = \"stamp\"");
    assert!(message.contains("topic `/motors`") && message.contains("`time = \"log\"`"), "{message}");
    // The topics with stamps alone have one clock.
    let sensors = CHANNELS.replace("command", "# command");
    assert!(bag.read(&sensors, "").is_ok());
    assert!(bag.read(&sensors, "time = \"stamp\"").is_ok());
}

#[test]
fn stamps_that_some_messages_lack_are_two_clocks_too() {
    let bag = Bag { stamps_s: -1000.0, is_stamped: |k| k % 4 > 0, ..Bag::default() };
    let sensors = CHANNELS.replace("command", "# command");
    let message = bag.refused(&sensors, "");
    assert!(message.contains("1000.000 s apart"), "{message}");
    let flight = bag.read(&sensors, "time = \"stamp\"").unwrap();
    assert_eq!(flight.angular_velocity.time_s.len(), 300, "{:?}", flight.notes);
    assert_eq!(bag.read(&sensors, "time = \"log\"").unwrap().angular_velocity.time_s.len(), 400);
}

#[test]
fn a_clock_is_chosen_of_an_mcap_file_alone() {
    let place = Place::new();
    place.write("log.ulg", &support::ulog(20));
    let channels = "specific_force = { topic = \"sensor_combined\" }";
    let message = place.load("log.ulg", channels, "time = \"log\"").unwrap_err().to_string();
    assert!(message.contains("`time`") && message.contains("MCAP"), "{message}");
}

#[test]
fn chunks_compressed_by_lz4_are_read() {
    let place = Place::new();
    let plain = Bag::default().bytes();
    let packed = lz4::chunks(&plain, |records| records);
    assert!(packed.len() < plain.len());
    place.write("log.mcap", &packed);
    let flight = place.load("log.mcap", CHANNELS, "").unwrap_or_else(|error| panic!("{error}"));
    let whole = Bag::default().read(CHANNELS, "").unwrap();
    assert_eq!((flight.command, flight.angular_velocity), (whole.command, whole.angular_velocity));
    // Content that is damaged, and a chunk that unpacks to less than its header says.
    let mut damaged = packed.clone();
    let middle = packed.len() / 2;
    damaged[middle] ^= 0x55;
    place.write("log.mcap", &damaged);
    assert!(place.load("log.mcap", CHANNELS, "").map(|flight| flight.notes).is_err());
    place.write("log.mcap", &lz4::chunks(&plain, |records| records[..100].to_vec()));
    let message = place.load("log.mcap", CHANNELS, "").unwrap_err().to_string();
    assert!(message.contains("and unpacks to 100"), "{message}");
}

const POSE: &str = r#"
attitude = { topic = "/imu" }
angular_velocity = { topic = "/imu" }
specific_force = { topic = "/imu" }
"#;

#[test]
fn an_imu_without_an_attitude_has_none() {
    assert_eq!(Bag::default().read(POSE, "").unwrap().attitude.time_s.len(), 400);
    let none = Bag { covariances: |_| [-1.0, 0.0, 0.0], ..Bag::default() };
    let message = none.refused(POSE, "");
    for part in ["`attitude`", "`orientation_covariance[0]`", "none of 400", "name another topic"] {
        assert!(message.contains(part), "`{part}` is not in: {message}");
    }
    // The same fields, named.
    let fields = r#"attitude = { topic = "/imu", fields = ["orientation.x", "orientation.y", "orientation.z", "orientation.w"] }"#;
    assert!(none.refused(fields, "").contains("orientation_covariance"));
    // Nothing is declared: the rest is taken.
    let flight = none.read("", "").unwrap();
    assert_eq!((flight.attitude.time_s.len(), flight.angular_velocity.time_s.len()), (0, 400));
    assert!(
        flight.notes.iter().any(|note| note.contains("attitude: not taken from /imu")),
        "{:?}",
        flight.notes
    );
}

#[test]
fn messages_that_lack_a_quantity_are_left_out_and_counted() {
    type Covariances = fn(u32) -> [f64; 3];
    let cases: [(Covariances, &str); 3] = [
        (|k| [if k < 50 { -1.0 } else { 0.0 }, 0.0, 0.0], "attitude: 50 of 400"),
        (|k| [0.0, if k < 50 { -1.0 } else { 0.1 }, 0.0], "angular_velocity: 50 of 400"),
        (|k| [0.0, 0.0, if k < 50 { -1.0 } else { 0.0 }], "specific_force: 50 of 400"),
    ];
    for (covariances, said) in cases {
        let flight = Bag { covariances, ..Bag::default() }.read(POSE, "").unwrap();
        assert!(flight.notes.iter().any(|note| note.contains(said)), "{said}: {:?}", flight.notes);
    }
}
