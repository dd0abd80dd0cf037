//! Every component, flown once as a process and stepped on the recording of that flight in this one.

use crate::support::{Place, repository};
use bus::component::Role;
use bus::plan::Plan;
use bus::{NodeHarness, Registration};
use hummingbus::COMPONENTS;
use recorder::reader::Recording;
use runtime::graph::Graph;
use runtime::manifest::Manifest;
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;

const TICKS: u32 = 1000;
/// The tick at whose start another instance goes on from the state of the first.
const TRANSFER_TICK: u32 = 500;

/// Returns a manifest of all components: the hover that every sensor watches, with the other estimators and laws.
pub fn manifest(place: &Place) -> String {
    let (vehicle, room) = (repository("vehicles/hummingbird.toml"), repository("scenes/room.toml"));
    let (include, flight) = (repository("manifests/sensors.toml"), place.write("flight.csv", flight()));
    let law = |kind: &str, inputs: &str, parameters: &str| {
        format!(
            "[process.{kind}]\nkind = \"{kind}\"\nvehicle = {vehicle:?}\n\
             inputs = {{ {inputs} }}\noutputs.status = {{}}\nparameters = {{ {parameters} }}\n"
        )
    };
    let estimate = "estimate = \"/ekf/estimate\"";
    let reference = format!("reference = \"/trajectory/reference\", {estimate}");
    let walls = "walls = \"/odometry/walls\", attitude = \"/attitude/estimate\"";
    let mut text = format!(
        "include = [{include:?}]\n[run]\nduration_s = {}\n\
         [process.plant]\noutputs.pose = {{}}\noutputs.tf = {{}}\noutputs.odometry = {{}}\n\
         [process.imu]\noutputs.data_raw = {{}}\n\
         [process.range]\ninputs.traffic = \"/traffic/traffic\"\n\
         outputs = {{ front = {{}}, back = {{}}, left = {{}}, right = {{}}, down = {{}} }}\n\
         [process.link]\nkind = \"link\"\n\
         inputs.gps = {{ topic = \"/gps/gps\", delay_ticks = 1, initial = {{}} }}\n\
         inputs.state = {{ topic = \"/plant/state\", delay_ticks = 1, initial = {{}} }}\n\
         parameters = {{ loss = 0.2, jitter_ms = 5.0, queue_bytes = 512, streams.state.rate_hz = 25.0 }}\n\
         [process.traffic]\nkind = \"traffic\"\ninputs.one = \"/plant/state\"\n\
         [process.clearance]\nkind = \"clearance\"\nscene = {room:?}\ninputs.state = \"/plant/state\"\n\
         [process.hold]\nkind = \"position-hold\"\n\
         inputs = {{ set_point = \"/pilot/set_point\", {estimate} }}\n\
         [process.sticks]\nkind = \"remote-control\"\n\
         inputs = {{ set_point = \"/pilot/set_point\", {estimate} }}\n\
         parameters = {{ tilt_max_deg = 30, yaw_rate_max_deg_s = 90, hover_throttle = 0.38 }}\n\
         [process.receiver]\nkind = \"rc\"\n\
         parameters.script = [{{ channel = 3, at_s = 0.1, pulse_us = 1400, over_s = 0.2 }}]\n\
         [process.person]\nkind = \"operator\"\n\
         parameters = {{ initial_altitude_m = 1.0, altitudes_m = [0.3, 4.0], tilt_max_deg = 15.0, fallback = \"land\" }}\n\
         [process.ideal]\nkind = \"ideal\"\ninputs.state = \"/plant/state\"\n\
         [process.stand]\nkind = \"propeller-stand\"\nvehicle = {vehicle:?}\n\
         parameters.speeds = [{{ at_s = 0.1, to_rpm = 3900.0 }}]\n\
         [process.attitude]\nkind = \"attitude\"\ninputs.imu = \"/imu/imu\"\n\
         [process.odometry]\nkind = \"range-inertial\"\n\
         inputs = {{ ranges = \"/range/ranges\", imu = \"/imu/imu\", attitude = \"/attitude/estimate\", gps = \"/gps/gps\" }}\n\
         parameters = {{ initial_height_m = 1.0 }}\n\
         [process.trajectory]\nkind = \"trajectory\"\n\
         parameters = {{ initial_position_m = [0.0, 0.0, 1.0] }}\n\
         [process.player]\nkind = \"player\"\ndata = {flight:?}\n\
         parameters.columns.time = {{ columns = [\"t\"], unit = \"s\" }}\n\
         parameters.columns.command = {{ columns = [\"m\", \"m\", \"m\", \"m\"], unit = \"count\" }}\n\
         parameters.columns.position = {{ columns = [\"x\", \"x\", \"x\"], unit = \"m\" }}\n\
         parameters.columns.velocity = {{ columns = [\"v\", \"v\", \"v\"], unit = \"m/s\" }}\n\
         parameters.columns.attitude = {{ columns = [\"v\", \"v\", \"v\", \"w\"], unit = \"1\" }}\n\
         parameters.columns.angular_velocity = {{ columns = [\"v\", \"v\", \"v\"], unit = \"rad/s\" }}\n",
        f64::from(TICKS) * 1e-3
    );
    let set_point = format!("set_point = \"/pilot/set_point\", {estimate}");
    for (kind, inputs, parameters) in [
        ("cascade", set_point.as_str(), ""),
        ("lqr", &reference, ""),
        ("geometric", &reference, ""),
        ("velocity", estimate, "altitude_m = 1.2"),
        ("wall-stop", walls, "altitude_m = 1.2"),
        ("wall-follow", walls, "altitude_m = 1.2, mode = \"constant\""),
        ("wall-stop-thesis", walls, "altitude_m = 1.2"),
        ("wall-follow-thesis", walls, "altitude_m = 1.2, mode = \"varying\""),
    ] {
        text += &law(kind, inputs, parameters);
    }
    place.write("everything.toml", text)
}

/// A flight at constant velocity, a row every 10 ms.
fn flight() -> String {
    let mut text = "t,m,x,v,w\n".to_owned();
    for row in 0..200 {
        let _ = writeln!(text, "{},76.5,{},0.1,0.98", f64::from(row) * 0.01, f64::from(row) * 0.001);
    }
    text
}

/// The recorded samples of a run, by topic.
struct Recorded {
    topics: BTreeMap<String, Vec<(u32, Vec<u8>)>>,
    plan: Plan,
}

impl Recorded {
    fn open(path: &str, plan: Plan) -> Self {
        let recording = Recording::open(Path::new(path)).unwrap();
        let mut topics: BTreeMap<_, Vec<_>> = BTreeMap::new();
        for record in recording.messages().map(Result::unwrap) {
            topics.entry(record.topic).or_default().push((record.tick, record.cdr));
        }
        Self { topics, plan }
    }

    fn samples(&self, topic: usize) -> &[(u32, Vec<u8>)] {
        &self.topics[&self.plan.topics[topic].name]
    }

    /// The newest sample of `topic` up to `tick`.
    fn newest(&self, topic: usize, tick: u32) -> Option<&[u8]> {
        let samples = self.samples(topic);
        let next = samples.partition_point(|(sent, _)| *sent <= tick);
        Some(&samples[next.checked_sub(1)?].1)
    }

    /// Steps `node` at `tick`, and requires that it sends what was recorded.
    fn step(&self, harness: &mut NodeHarness, name: &str, tick: u32) {
        let sent = harness.step(tick, |topic, tick| self.newest(topic, tick));
        for (topic, cdr) in sent.unwrap_or_else(|error| panic!("{name} at tick {tick}: {error}")) {
            let samples = self.samples(topic);
            let place = samples.binary_search_by_key(&tick, |(sent, _)| *sent);
            let recorded = place.map(|place| &samples[place].1);
            assert_eq!(recorded, Ok(&cdr), "{name} at tick {tick}, {}", self.plan.topics[topic].name);
        }
    }
}

/// A node stepped from the first tick to the last, and another that goes on from its state amid the run.
fn require_same(recorded: &Recorded, component: &Registration, node: usize) {
    let make = || NodeHarness::new(component, COMPONENTS.components(), &recorded.plan, node).unwrap();
    let plan = &recorded.plan.nodes[node];
    let (mut first, mut second) = (make(), make());
    for tick in (0..TICKS).step_by(plan.period_ticks as usize) {
        recorded.step(&mut first, &plan.name, tick);
        if tick >= TRANSFER_TICK {
            recorded.step(&mut second, &plan.name, tick);
            assert!(first.state() == second.state(), "{}: another state after tick {tick}", plan.name);
        } else {
            second.restore(&first.state()).unwrap();
        }
    }
}

#[test]
fn every_component_steps_as_its_process_did_and_goes_on_from_a_state_byte_for_byte() {
    let place = Place::new();
    let (manifest, recording) = (manifest(&place), place.path("everything.mcap"));
    let graph = Graph::build(&Manifest::load(Path::new(&manifest), &[], COMPONENTS).unwrap()).unwrap();
    // Its conditions look behind the end of this shorter run.
    place.call(&["run", &manifest, "--record", &recording]).with_code(1);
    let components: Vec<_> = graph.components().collect();
    let recorded = Recorded::open(&recording, graph.plan);
    let mut stepped = Vec::new();
    for (node, component) in components.into_iter().enumerate() {
        let component = component.unwrap();
        if component.role == Role::Compute {
            require_same(&recorded, component, node);
        }
        stepped.push(component.name);
    }
    // Beside a recorder no judge flies. A firmware is a process of its own, which nobody can restore; `autopilots` flies it.
    let flies = |component: &&Registration| {
        component.role != Role::Judge && !["ardupilot", "betaflight", "px4"].contains(&component.name)
    };
    let missing = COMPONENTS.iter().filter(flies).find(|component| !stepped.contains(&component.name));
    assert!(missing.is_none(), "this run has no {missing:?}");
}
