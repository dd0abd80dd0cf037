//! Heights and attitudes of the vehicles of a live run: from the samples that its recorder copies for watchers.

use crate::top::view::VehicleRow;
use bus::Message as _;
use bus::messages::PlantState;
use bus::plan::Plan;
use bus::watch::{WatchFiles, WatchReader};
use recorder::fields::TopicFields;
use runtime::run_dir::{LiveRun, find_live};

/// Fields of a state that are shown.
const FIELDS: [&str; 5] = ["position.z", "velocity", "attitude.roll", "attitude.pitch", "attitude.yaw"];

/// The vehicles of a run, by their states.
pub struct Vehicles {
    files: WatchFiles,
    samples: Option<WatchReader>,
    states: Vec<State>,
}

/// Newest state on a topic.
struct State {
    topic: String,
    vehicle: String,
    /// Simulation time of the newest sample and the sample itself; empty before the first.
    time_ns: u64,
    cdr: Vec<u8>,
    fields: Option<TopicFields>,
}

impl Vehicles {
    /// The vehicles of `plan`; none if the run has no recorder, whose samples are shown.
    pub fn of(run: &LiveRun, plan: &Plan) -> Self {
        let files = WatchFiles::of(&run.entry.run_dir, &plan.run_id);
        let is_recorded = plan.nodes.iter().any(|node| node.parameters.get("watch").is_some());
        let topics =
            plan.topics.iter().filter(|topic| is_recorded && topic.type_name == PlantState::SCHEMA.type_name);
        let states = topics.map(|topic| State::of(&topic.name)).collect();
        let mut vehicles = Self { files, samples: None, states };
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
        let Self { files, samples, states } = self;
        if let Some(samples) = samples {
            samples.read(|sample| {
                if let Some(state) = states.iter_mut().find(|state| state.topic == sample.topic) {
                    state.time_ns = sample.time_ns;
                    state.cdr.clear();
                    state.cdr.extend_from_slice(sample.cdr);
                }
            });
        }
        states.iter_mut().map(|state| state.row(files)).collect()
    }
}

impl State {
    fn of(topic: &str) -> Self {
        // A state is sent by a plant: `/h1/plant/state` is that of the vehicle `h1`.
        let plant = topic.trim_start_matches('/').trim_end_matches("/state");
        let vehicle = plant.strip_suffix("/plant").unwrap_or(plant).to_owned();
        Self { topic: topic.to_owned(), vehicle, time_ns: 0, cdr: Vec::new(), fields: None }
    }

    fn row(&mut self, files: &WatchFiles) -> VehicleRow {
        let values = self.values(files);
        let [height_m, speed_m_s, roll_deg, pitch_deg, yaw_deg] =
            values.map_or([None; 5], |values| values.map(Some));
        let time_s = values.map(|_| self.time_ns as f64 * 1e-9);
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
