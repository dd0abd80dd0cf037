//! Heights and attitudes of the vehicles of a live run: from the samples that its recorder copies for watchers. While none come, as in a
//! run that was paused before, they are those at the end of the recording.

use crate::top::view::VehicleRow;
use bus::Message as _;
use bus::messages::PlantState;
use bus::plan::Plan;
use bus::watch::{WatchFiles, WatchReader};
use recorder::fields::TopicFields;
use recorder::index::Index;
use recorder::reader::Recording;
use recorder::series::value;
use runtime::run_dir::{LiveRun, find_live};
use std::path::{Path, PathBuf};

/// Fields of a state that are shown.
const FIELDS: [&str; 5] = ["position.z", "velocity", "attitude.roll", "attitude.pitch", "attitude.yaw"];

/// The vehicles of a run, by their states.
pub struct Vehicles {
    files: WatchFiles,
    samples: Option<WatchReader>,
    states: Vec<State>,
    /// The recording, until it is read.
    recording: Option<PathBuf>,
    tick_ns: u64,
    /// True from the second look on: by then the samples of a run that goes on have come.
    has_looked: bool,
}

/// Newest state on a topic.
struct State {
    topic: String,
    vehicle: String,
    /// Simulation time of the newest sample and the sample itself; empty before the first.
    time_ns: u64,
    cdr: Vec<u8>,
    fields: Option<TopicFields>,
    /// Time and values at the end of the recording, where no sample has come.
    recorded: Option<(u64, [f64; 5])>,
}

impl Vehicles {
    /// The vehicles of `plan`; none if the run has no recorder, whose samples are shown.
    pub fn of(run: &LiveRun, plan: &Plan) -> Self {
        let files = WatchFiles::of(&run.entry.run_dir, &plan.run_id);
        let recorder = plan.nodes.iter().find(|node| node.parameters.get("watch").is_some());
        let recording = recorder.and_then(|node| node.parameters.get("path")?.as_str().map(PathBuf::from));
        let is_recorded = recorder.is_some();
        let topics =
            plan.topics.iter().filter(|topic| is_recorded && topic.type_name == PlantState::SCHEMA.type_name);
        let states = topics.map(|topic| State::of(&topic.name)).collect();
        let tick_ns = plan.tick_ns;
        let mut vehicles = Self { files, samples: None, states, recording, tick_ns, has_looked: false };
        vehicles.watch(run);
        vehicles
    }

    /// Makes the ring of samples. Without room for it, or with a run that has just ended, the rows stay empty.
    fn watch(&mut self, run: &LiveRun) {
        if self.states.is_empty() {
            return;
        }
        self.samples = self.files.watch().ok();
        if find_live(Some(&run.entry.run_id)).is_err() {
            self.files.remove();
        }
    }

    /// Reads the samples that have come; returns a row for each vehicle.
    pub fn look(&mut self) -> Vec<VehicleRow> {
        let Self { samples, states, .. } = self;
        if let Some(samples) = samples {
            samples.read(|sample| {
                if let Some(state) = states.iter_mut().find(|state| state.topic == sample.topic) {
                    state.time_ns = sample.time_ns;
                    state.cdr.clear();
                    state.cdr.extend_from_slice(sample.cdr);
                }
            });
        }
        let is_still = std::mem::replace(&mut self.has_looked, true)
            && self.states.iter().all(|state| state.cdr.is_empty());
        if is_still && let Some(path) = self.recording.take() {
            self.read_recorded(&path);
        }
        self.states.iter_mut().map(|state| state.row(&self.files)).collect()
    }

    /// Reads the states at the end of the recording as far as it is written; without one the rows stay empty.
    fn read_recorded(&mut self, path: &Path) {
        let Ok(recording) = Recording::salvage(path) else { return };
        let Ok(index) = Index::of(&recording) else { return };
        for state in &mut self.states {
            state.recorded = state.newest_in(&recording, &index, self.tick_ns);
        }
    }
}

impl State {
    fn of(topic: &str) -> Self {
        // A state is sent by a plant: `/h1/plant/state` is that of the vehicle `h1`.
        let plant = topic.trim_start_matches('/').trim_end_matches("/state");
        let vehicle = plant.strip_suffix("/plant").unwrap_or(plant).to_owned();
        Self { topic: topic.to_owned(), vehicle, time_ns: 0, cdr: Vec::new(), fields: None, recorded: None }
    }

    /// Time and values of the newest sample in `recording`.
    fn newest_in(&self, recording: &Recording, index: &Index, tick_ns: u64) -> Option<(u64, [f64; 5])> {
        let block = index.before(&self.topic, index.len())?;
        let records = index.messages(recording, block).filter_map(Result::ok);
        let newest = records.filter(|record| record.topic == self.topic).last()?;
        let leaves = recording.decode(&newest).ok()?;
        let number = |field: &str| value(&leaves, field).map(|(number, _)| number);
        let squares = ["velocity.x", "velocity.y", "velocity.z"].map(|field| number(field).map(|it| it * it));
        let speed_m_s = squares.into_iter().sum::<Option<f64>>()?.sqrt();
        let [roll, pitch, yaw] = ["attitude.roll", "attitude.pitch", "attitude.yaw"].map(number);
        let angles = [roll?, pitch?, yaw?].map(f64::to_degrees);
        let values = [number("position.z")?, speed_m_s, angles[0], angles[1], angles[2]];
        Some((u64::from(newest.tick) * tick_ns, values))
    }

    fn row(&mut self, files: &WatchFiles) -> VehicleRow {
        let live = self.values(files).map(|values| (self.time_ns, values));
        let newest = live.or(self.recorded);
        let values = newest.map(|(_, values)| values);
        let [height_m, speed_m_s, roll_deg, pitch_deg, yaw_deg] =
            values.map_or([None; 5], |values| values.map(Some));
        let time_s = newest.map(|(time_ns, _)| time_ns as f64 * 1e-9);
        VehicleRow { name: self.vehicle.clone(), time_s, height_m, speed_m_s, roll_deg, pitch_deg, yaw_deg }
    }

    /// Height, speed, roll, pitch and yaw in m, m/s and degrees.
    fn values(&mut self, files: &WatchFiles) -> Option<[f64; 5]> {
        if self.cdr.is_empty() {
            return None;
        }
        if self.fields.is_none() {
            let announced = files.topics().ok()?.into_iter().find(|(topic, _)| *topic == self.topic)?.1;
            let mut fields = TopicFields::announced(&self.topic, &announced).ok()?;
            FIELDS.iter().for_each(|field| {
                fields.add(field);
            });
            self.fields = Some(fields);
        }
        let fields = self.fields.as_mut()?;
        fields.read(&self.cdr).ok()?;
        let values = |field: usize| fields.values(field);
        let speed_m_s = values(1).iter().map(|value| value * value).sum::<f64>().sqrt();
        let angle_deg = |field: usize| values(field).first().map(|angle_rad| angle_rad.to_degrees());
        Some([*values(0).first()?, speed_m_s, angle_deg(2)?, angle_deg(3)?, angle_deg(4)?])
    }
}
