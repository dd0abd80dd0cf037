//! Made-up motions and logs.

pub mod made;

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use component::Message;
use component::messages::{Imu, MotorCommand, Time};
use flights::{Flight, FlightSet, FlightsError};
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};
use tempfile::TempDir;

/// A folder for logs and their flights file.
pub struct Place(TempDir);

impl Place {
    pub fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    pub fn write(&self, name: &str, bytes: &[u8]) {
        std::fs::write(self.path(name), bytes).unwrap();
    }

    /// Reads the log `file` with `channels` of the whole file, and `extra` in the flight's table.
    pub fn load(&self, file: &str, channels: &str, extra: &str) -> Result<Flight, FlightsError> {
        let vehicle = Path::new(env!("CARGO_MANIFEST_DIR")).join("../vehicles/hummingbird.toml");
        let text = format!(
            "vehicle = \"{}\"\n[channels]{channels}\n[[flight]]\nname = \"made up\"\nfile = \"{file}\"\n\
             role = \"fit\"\n{extra}\n",
            vehicle.display(),
            channels = if channels.starts_with('\n') { channels.to_owned() } else { format!("\n{channels}") },
        );
        self.write("flights.toml", text.as_bytes());
        FlightSet::load(&self.path("flights.toml")).map(|mut set| set.flights.remove(0))
    }
}

/// A flight of 10 s at 100 Hz whose channels agree; the units of the logged channels can be wrong.
pub struct Motion {
    pub rate_unit: f64,
    pub force_unit: f64,
    pub length_unit: f64,
    pub command_unit: f64,
    pub angle_unit: f64,
    pub time_unit: f64,
    pub frd_ned: bool,
}

impl Default for Motion {
    fn default() -> Self {
        Self {
            rate_unit: 1.0,
            force_unit: 1.0,
            length_unit: 1.0,
            command_unit: 1.0,
            angle_unit: 1.0,
            time_unit: 1.0,
            frd_ned: false,
        }
    }
}

impl Motion {
    fn position(time: f64) -> Vector3<f64> {
        Vector3::new(1.4 * libm::sin(1.4 * time), libm::cos(2.0 * time), 1.0 + 0.2 * libm::sin(time))
    }

    fn velocity(time: f64) -> Vector3<f64> {
        Vector3::new(1.96 * libm::cos(1.4 * time), -2.0 * libm::sin(2.0 * time), 0.2 * libm::cos(time))
    }

    /// Returns the specific force in the world that the thrust has to make.
    fn force(time: f64) -> Vector3<f64> {
        Vector3::new(
            -2.744 * libm::sin(1.4 * time),
            -4.0 * libm::cos(2.0 * time),
            9.81 - 0.2 * libm::sin(time),
        )
    }

    /// Leaning into the force, with some yaw.
    fn attitude(time: f64) -> UnitQuaternion<f64> {
        let leaning = UnitQuaternion::rotation_between(&Vector3::z(), &Self::force(time)).unwrap();
        leaning * UnitQuaternion::from_euler_angles(0.0, 0.0, 0.2 * libm::sin(time))
    }

    fn rate(time: f64) -> Vector3<f64> {
        let step = 1e-5;
        (Self::attitude(time - step).inverse() * Self::attitude(time + step)).scaled_axis() / (2.0 * step)
    }

    /// The flight as a CSV file.
    pub fn csv(&self) -> String {
        let mut text =
            "t,m1,m2,m3,m4,px,py,pz,vx,vy,vz,qx,qy,qz,qw,wx,wy,wz,fx,fy,fz,v,roll,pitch,yaw,ax,ay,az,sz\n"
                .to_owned();
        for k in 0..=1000 {
            let time = 0.01 * f64::from(k);
            let numbers: Vec<String> = self.row(time).iter().map(f64::to_string).collect();
            writeln!(text, "{:.2},{}", self.time_unit * time, numbers.join(",")).unwrap();
        }
        text
    }

    fn row(&self, time: f64) -> Vec<f64> {
        let (mut p, mut v) = (Self::position(time), Self::velocity(time));
        let (mut q, mut w) = (Self::attitude(time), Self::rate(time));
        let mut f = q.inverse() * Self::force(time);
        let mut s = Self::force(time);
        if self.frd_ned {
            let ned_enu = Matrix3::new(0.0, 1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, -1.0);
            let frd_flu = Matrix3::from_diagonal(&Vector3::new(1.0, -1.0, -1.0));
            (p, v, w, f, s) = (ned_enu * p, ned_enu * v, frd_flu * w, frd_flu * f, ned_enu * s);
            let turned = ned_enu * q.to_rotation_matrix().matrix() * frd_flu.transpose();
            q = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(turned));
        }
        let (roll, pitch, yaw) = q.euler_angles();
        let [roll, pitch, yaw] = [roll, pitch, yaw].map(|angle| angle * self.angle_unit);
        let (p, v) = (p * self.length_unit, v);
        let (w, f) = (w * self.rate_unit, f * self.force_unit);
        // Without gravity, which is along z.
        let a = Vector3::new(s.x, s.y, s.z - 9.81 * s.z.signum()) * self.force_unit;
        let s = s * self.force_unit;
        let command = [100.0, 101.0, 102.0, 103.0].map(|command| command * self.command_unit);
        [
            &command[..],
            p.as_slice(),
            v.as_slice(),
            q.coords.as_slice(),
            w.as_slice(),
            f.as_slice(),
            &[11.1 - 0.01 * time, roll, pitch, yaw, a.x, a.y, a.z, s.z],
        ]
        .concat()
    }
}

/// CRC-32 as in zip, bit by bit.
pub fn crc32(bytes: &[u8]) -> u32 {
    let mut crc = u32::MAX;
    for byte in bytes {
        crc ^= u32::from(*byte);
        for _ in 0..8 {
            crc = if crc & 1 == 1 { (crc >> 1) ^ 0xEDB8_8320 } else { crc >> 1 };
        }
    }
    !crc
}

/// A Crazyflie log of `count` records at 100 Hz.
pub fn crazyflie_log(count: u32) -> Vec<u8> {
    let variables = [
        "motor.m1(I)",
        "motor.m2(H)",
        "motor.m3(i)",
        "motor.m4(B)",
        "acc.x(f)",
        "acc.y(f)",
        "acc.z(d)",
        "pm.vbatMV(h)",
    ];
    let mut bytes = vec![0xBC, 2, 0, 1, 0, 0xFF, 0xFF];
    bytes.extend(b"fixedFrequency\0");
    bytes.extend(u16::try_from(variables.len()).unwrap().to_le_bytes());
    for variable in variables {
        bytes.extend(variable.as_bytes());
        bytes.push(0);
    }
    for k in 0..count {
        bytes.extend([0xFF, 0xFF]);
        bytes.extend((5_000_000 + 10_000 * u64::from(k)).to_le_bytes());
        bytes.extend(10_u32.to_le_bytes());
        bytes.extend(20_u16.to_le_bytes());
        bytes.extend(30_i32.to_le_bytes());
        bytes.push(40);
        bytes.extend((0.001 * k as f32).to_le_bytes());
        bytes.extend(0_f32.to_le_bytes());
        bytes.extend(1_f64.to_le_bytes());
        bytes.extend(3700_i16.to_le_bytes());
    }
    let crc = crc32(&bytes);
    bytes.extend(crc.to_le_bytes());
    bytes
}

/// A message of a ULog.
pub fn ulog_message(kind: u8, content: &[u8]) -> Vec<u8> {
    let mut bytes = u16::try_from(content.len()).unwrap().to_le_bytes().to_vec();
    bytes.push(kind);
    bytes.extend(content);
    bytes
}

/// A ULog of `count` samples at 100 Hz.
pub fn ulog(count: u32) -> Vec<u8> {
    ulog_of(0..count)
}

/// The samples of a range of it.
pub fn ulog_of(samples: std::ops::Range<u32>) -> Vec<u8> {
    let mut bytes = b"ULog\x01\x12\x35\x01".to_vec();
    bytes.extend(0_u64.to_le_bytes());
    bytes.extend(ulog_message(
        b'F',
        b"sensor_combined:uint64_t timestamp;float[3] gyro_rad;float[3] accelerometer_m_s2;",
    ));
    bytes.extend(ulog_message(b'F', b"cell:float volts;uint8_t[4] _padding0;"));
    bytes.extend(ulog_message(b'F', b"battery:uint64_t timestamp;cell[2] cell;"));
    bytes.extend(ulog_message(b'A', b"\0\x01\0sensor_combined"));
    bytes.extend(ulog_message(b'A', b"\0\x02\0battery"));
    for k in samples {
        let stamp = (1_000_000 + 10_000 * u64::from(k)).to_le_bytes();
        let floats = |floats: &[f32]| floats.iter().flat_map(|f| f.to_le_bytes()).collect::<Vec<u8>>();
        // Down is positive, and an accelerometer reads -g then.
        let sensors = floats(&[0.0, 0.0, 0.001 * k as f32, 0.0, 0.001 * k as f32, -9.8]);
        bytes.extend(ulog_message(b'D', &[&[1, 0][..], &stamp, &sensors].concat()));
        let cells = [floats(&[3.5]), vec![0; 4], floats(&[4.0 - 1e-4 * k as f32]), vec![0; 4]].concat();
        bytes.extend(ulog_message(b'D', &[&[2, 0][..], &stamp, &cells].concat()));
    }
    bytes
}

/// The start of `sensor_msgs/msg/BatteryState`, with constants and short names, which our own definitions do
/// not have.
const BATTERY_STATE: &str = "\
# A constant:
uint8 POWER_SUPPLY_STATUS_UNKNOWN = 0
uint8 POWER_SUPPLY_STATUS_CHARGING=1
Header header
float32 voltage  # Voltage in Volts
string<=16 location \"here\"
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
";

/// An MCAP file of `count` samples at 100 Hz: commands and inertial sensors of ours, a battery of ROS 2.
pub fn recording(path: &Path, count: u32) {
    std::fs::write(path, bag(count, Some(mcap::Compression::Zstd))).unwrap();
}

/// The same, its chunks compressed or not.
pub fn bag(count: u32, compression: Option<mcap::Compression>) -> Vec<u8> {
    bag_of(0..count, compression)
}

/// The samples of a range of it.
pub fn bag_of(samples: std::ops::Range<u32>, compression: Option<mcap::Compression>) -> Vec<u8> {
    let mut file = std::io::Cursor::new(Vec::new());
    let mut writer = mcap::WriteOptions::new().compression(compression).create(&mut file).unwrap();
    let mut channel = |topic: &str, kind: &str, definition: &str| {
        let schema = writer.add_schema(kind, "ros2msg", definition.as_bytes()).unwrap();
        writer.add_channel(schema, topic, "cdr", &BTreeMap::new()).unwrap()
    };
    let command =
        channel("/control/command", MotorCommand::SCHEMA.type_name, &MotorCommand::SCHEMA.ros2_definition());
    let imu = channel("/imu/imu", Imu::SCHEMA.type_name, &Imu::SCHEMA.ros2_definition());
    let battery = channel("/battery", "sensor_msgs/msg/BatteryState", BATTERY_STATE);
    for k in samples {
        let ns = 10_000_000 * u64::from(k + 1);
        let mut send = |channel_id: u16, body: &[u8]| {
            let header =
                mcap::records::MessageHeader { channel_id, sequence: k, log_time: ns, publish_time: ns };
            writer.write_to_known_channel(&header, &[&[0, 1, 0, 0], body].concat()).unwrap();
        };
        let stamp = Time::from_ns(ns);
        let motors = MotorCommand { stamp, command: [100.0, 101.0, 102.0, 103.0].into() };
        send(command, bytemuck::bytes_of(&motors));
        let noise = 0.001 * f64::from(k % 7);
        let sensors = Imu {
            stamp,
            specific_force: [noise, 0.0, 9.81].into(),
            angular_velocity: [0.0, noise, 0.001 * f64::from(k)].into(),
        };
        send(imu, bytemuck::bytes_of(&sensors));
        let late = Time::from_ns(ns + 100_000_000);
        let mut body =
            [late.sec.to_le_bytes(), late.nanosec.to_le_bytes(), 4_u32.to_le_bytes(), *b"map\0"].concat();
        body.extend(15.5_f32.to_le_bytes());
        body.extend(1_u32.to_le_bytes());
        body.push(0);
        send(battery, &body);
    }
    writer.finish().unwrap();
    drop(writer);
    file.into_inner()
}
