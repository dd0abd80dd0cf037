//! Recordings that are written, not flown: vehicles that go round a square, with what was asked of them.

use bus::Message;
use bus::announcement::Announcement;
use bus::messages::{PlantState, Quaternion, Reference, SetPoint, Vector3};
use recorder::writer::{ChannelId, RecordingWriter};
use std::f64::consts::TAU;
use std::path::Path;

/// Time between two samples.
pub const TICK_NS: u64 = 10_000_000;
/// Samples of a topic.
pub const TICKS: u32 = 6000;
/// Time of a lap, in seconds.
const LAP_S: f64 = 20.0;
/// The tick at which the first vehicle is, for one sample, elsewhere.
pub const SPIKE_TICK: u32 = 2222;
/// The height at which it then is, in metres.
pub const SPIKE_M: f64 = 2.75;

/// Writes a recording of these vehicles, `""` for one without a name, with `scene` attached.
pub fn record(path: &Path, vehicles: &[&str], scene: Option<&str>) {
    let mut writer = RecordingWriter::create(path).unwrap();
    let channels: Vec<[ChannelId; 3]> =
        vehicles.iter().map(|vehicle| channels(&mut writer, vehicle)).collect();
    for tick in 0..TICKS {
        for (index, [state, reference, set_point]) in channels.iter().enumerate() {
            let (flown, asked) = sample(tick, index);
            let altitude = SetPoint { altitude: asked.position.z, ..SetPoint::default() };
            write(&mut writer, *state, tick, &flown);
            write(&mut writer, *reference, tick, &asked);
            write(&mut writer, *set_point, tick, &altitude);
        }
        writer.end_tick().unwrap();
    }
    if let Some(scene) = scene {
        // As the launcher attaches it: behind a manifest and a vehicle, which are no scenes.
        writer.attach("laps.toml", b"[run]\nduration_s = 60.0\n").unwrap();
        writer.attach("hummingbird.toml", vehicles::reference::HUMMINGBIRD.as_bytes()).unwrap();
        writer.attach("room.toml", scene.as_bytes()).unwrap();
    }
    writer.finish().unwrap();
}

fn channels(writer: &mut RecordingWriter, vehicle: &str) -> [ChannelId; 3] {
    let topic =
        |name: &str| if vehicle.is_empty() { format!("/{name}") } else { format!("/{vehicle}/{name}") };
    let mut add = |name, schema| writer.add_channel(&topic(name), &Announcement::of(schema)).unwrap();
    [
        add("plant/state", PlantState::SCHEMA),
        add("planner/reference", Reference::SCHEMA),
        add("pilot/set_point", SetPoint::SCHEMA),
    ]
}

fn write<T: Message>(writer: &mut RecordingWriter, channel: ChannelId, tick: u32, message: &T) {
    let cdr = [&[0, 1, 0, 0], bytemuck::bytes_of(message)].concat();
    writer.write(channel, tick, u64::from(tick) * TICK_NS, &cdr).unwrap();
}

/// Returns the state of the vehicle with this number and its reference: a lap at 3 m from the walls of the room, nose
/// ahead, so that its yaw goes round with it.
fn sample(tick: u32, vehicle: usize) -> (PlantState, Reference) {
    let time_s = f64::from(tick) * TICK_NS as f64 * 1e-9;
    let turn = TAU * (time_s / LAP_S + vehicle as f64 / 4.0);
    let (sin, cos) = libm::sincos(turn);
    let on_square = 2.0 / sin.abs().max(cos.abs());
    let altitude = if time_s < 2.0 { 1.0 } else { 1.5 };
    let asked = Vector3 { x: on_square * cos, y: on_square * sin, z: altitude };
    let sways = 1.0 + 0.05 * libm::sin(5.0 * turn);
    let z = if tick == SPIKE_TICK && vehicle == 0 { SPIKE_M } else { altitude - 0.5 * libm::exp(-time_s) };
    let half_yaw = turn / 2.0;
    let flown = PlantState {
        position: Vector3 { x: asked.x * sways, y: asked.y * sways, z },
        attitude: Quaternion { x: 0.0, y: 0.0, z: libm::sin(half_yaw), w: libm::cos(half_yaw) },
        angular_velocity: Vector3 { x: 0.0, y: 0.0, z: TAU / LAP_S },
        rotor_speed: [400.0, 401.0, 402.0, 403.0].into(),
        ..PlantState::default()
    };
    (flown, Reference { position: asked, ..Reference::default() })
}
