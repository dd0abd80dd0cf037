//! A course of manoeuvres: its segments, its manifest, and its set points for a pilot.

use super::family::Space;
use anyhow::Result;
use controllers::trajectory::{Start, Trajectory};
use hummingbus::vehicles::Vehicle;
use identify::proposal::Limits;
use runtime::manifest::ManifestBuilder;
use std::fmt::Write as _;
use std::path::Path;
use toml::{Table, toml};

/// Hover before the first manoeuvre, s: motors and controller settle, and the comparison begins behind it.
pub const BEFORE_S: f64 = 1.0;
/// Hover behind each manoeuvre, s.
const BEHIND_S: f64 = 0.5;
/// Time between two rows of the set points, s.
const ROW_S: f64 = 0.02;
/// Ticks a second.
const RATE_HZ: i64 = 1000;

/// Manoeuvres one after another.
#[derive(Clone, Debug)]
pub struct Course {
    start_m: [f64; 3],
    segments: Vec<Table>,
    trajectory: Trajectory,
    /// Begin and end of each manoeuvre, s.
    pub parts_s: Vec<(f64, f64)>,
}

impl Course {
    /// The course of these manoeuvres, each given by its segments.
    ///
    /// # Errors
    /// If a segment cannot be flown.
    pub fn of<'s>(space: &Space, manoeuvres: impl IntoIterator<Item = &'s Vec<Table>>) -> Result<Self> {
        let hover = |duration_s: f64| toml! { kind = "hover" duration_s = duration_s };
        let mut segments = vec![hover(BEFORE_S)];
        let mut ends = Vec::new();
        for manoeuvre in manoeuvres {
            segments.extend(manoeuvre.iter().cloned());
            ends.push(segments.len());
            segments.push(hover(BEHIND_S));
        }
        let entries = segments.iter().map(serde_json::to_value).collect::<Result<Vec<_>, _>>()?;
        let start = Start { position_W_m: space.home_m.into(), yaw_rad: 0.0 };
        let until_s = |count: usize| Trajectory::read(&entries[..count], start).map(|it| it.duration_s());
        let mut parts_s = Vec::new();
        let mut from_s = BEFORE_S;
        for end in ends {
            let to_s = until_s(end)?;
            parts_s.push((from_s, to_s));
            from_s = to_s + BEHIND_S;
        }
        let trajectory = Trajectory::read(&entries, start)?;
        Ok(Self { start_m: space.home_m, segments, trajectory, parts_s })
    }

    /// Its length, in s.
    pub fn duration_s(&self) -> f64 {
        self.trajectory.duration_s()
    }

    /// The manifest that flies it with the vehicle file `vehicle`, seen by motion capture, an inertial unit and sensors of the
    /// rotors' speeds; its controller takes the vehicle file `known`.
    pub fn manifest(&self, vehicle: &str, known: &str, facts: &Vehicle) -> ManifestBuilder {
        let start = || self.start_m.to_vec();
        let command = vec![facts.hover_command(); facts.rotors.len()];
        ManifestBuilder::new()
            .set("run.rate_hz", RATE_HZ)
            .set("run.duration_s", (self.duration_s() * 1e3).ceil() * 1e-3)
            .set("run.seed", 1)
            .set("process.plant.kind", "plant")
            .set("process.plant.vehicle", vehicle)
            .set("process.plant.parameters.initial_position_m", start())
            .set("process.plant.inputs.command.topic", "/controller/command")
            .set("process.plant.inputs.command.delay_ticks", 1)
            .set("process.plant.inputs.command.initial.command", command)
            .set("process.imu.kind", "imu")
            .set("process.imu.inputs.state", "/plant/state")
            .set("process.mocap.kind", "mocap")
            .set("process.mocap.period_ticks", 5)
            .set("process.mocap.inputs.state", "/plant/state")
            .set("process.mocap.parameters.rate_hz", 200.0)
            .set("process.mocap.parameters.delay_ms", 0.0)
            .set("process.rpm.kind", "rpm")
            .set("process.rpm.period_ticks", 5)
            .set("process.rpm.inputs.state", "/plant/state")
            .set("process.ekf.kind", "ekf")
            .set("process.ekf.inputs.imu", "/imu/imu")
            .set("process.ekf.inputs.mocap", "/mocap/mocap")
            .set("process.ekf.parameters.initial_position_m", start())
            .set("process.trajectory.kind", "trajectory")
            .set("process.trajectory.parameters.initial_position_m", start())
            .set(
                "process.trajectory.parameters.segments",
                toml::Value::Array(self.segments.iter().cloned().map(toml::Value::Table).collect()),
            )
            .set("process.controller.kind", "geometric")
            .set("process.controller.vehicle", known)
            .set("process.controller.inputs.reference", "/trajectory/reference")
            .set("process.controller.inputs.estimate", "/ekf/estimate")
            .set("process.recorder.kind", "recorder")
    }

    /// The set points as CSV, for a pilot's own autopilot.
    pub fn set_points(&self) -> String {
        let mut text = SET_POINTS_START.to_owned();
        let mut row = 0;
        while f64::from(row) * ROW_S <= self.duration_s() {
            let at_s = f64::from(row) * ROW_S;
            let point = self.trajectory.at(at_s);
            let [p, v] = [point.path_W[0], point.path_W[1]];
            let yaw_deg = point.yaw_rad.to_degrees();
            // Writing to a text does not fail.
            let _ = writeln!(
                text,
                "{at_s:.2},{:.4},{:.4},{:.4},{:.4},{:.4},{:.4},{yaw_deg:.2}",
                p.x, p.y, p.z, v.x, v.y, v.z
            );
            row += 1;
        }
        text
    }
}

/// Head of the set points.
pub const SET_POINTS_START: &str = "time_s,x_m,y_m,z_m,vx_m_s,vy_m_s,vz_m_s,yaw_deg\n";

/// Conditions that hold `manifest` to `limits`.
pub fn within(manifest: ManifestBuilder, limits: &Limits) -> ManifestBuilder {
    let axes = ["position.x", "position.y", "position.z"].into_iter().zip(limits.room_m);
    let manifest = axes.fold(manifest, |manifest, (field, [min, max])| {
        let name = format!("{field} stays in the room");
        manifest.add("pass", toml! {
            name = name topic = "/plant/state" field = field unit = "m" statistic = "every" min = min max = max
        })
    });
    // Neither roll nor pitch is greater than the tilt.
    let tilt_deg = limits.tilt_max_deg;
    let manifest = ["attitude.roll", "attitude.pitch"].into_iter().fold(manifest, |manifest, field| {
        let (name, min) = (format!("{field} stays within the limit of the tilt"), -tilt_deg);
        manifest.add("pass", toml! {
            name = name topic = "/plant/state" field = field unit = "deg" statistic = "every" min = min max = tilt_deg
        })
    });
    let most = limits.speed_max_m_s;
    manifest.add("pass", toml! {
        name = "the speed stays within its limit" topic = "/plant/state" field = "velocity" unit = "m/s" statistic = "max"
        max = most
    })
}

/// The manifest's text with `head` as its comment.
pub fn commented(head: &str, manifest: &ManifestBuilder) -> String {
    let comment: String = head.lines().map(|line| format!("# {line}").trim_end().to_owned() + "\n").collect();
    format!("{comment}\n{manifest}")
}

/// The path as a manifest names it.
pub fn named(path: &Path) -> Result<String> {
    let path = std::path::absolute(path)?;
    let text = path.to_str().ok_or_else(|| {
        anyhow::anyhow!("the path {} is not UTF-8: move the file into a folder whose name is", path.display())
    })?;
    Ok(text.to_owned())
}
