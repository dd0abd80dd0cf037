//! Ticks per second of the hover manifest by host, against a bare loop of the same components.

use crate::report::{Result, Spread, number, run_manifest};
use bus::Harness;
use bus::messages::{Mocap, MotorCommand, PlantState, SetPoint, StateEstimate};
use controllers::controller::Controller;
use controllers::law_inputs::SetPointInputs;
use controllers::pid::PidLaw;
use controllers::pilot::Pilot;
use hummingbus::{Graph, bus, controllers, plant, sensors};
use plant::node::Plant;
use sensors::ekf::EkfInputs;
use sensors::ekf::filter::Ekf;
use sensors::imu::ImuSensor;
use sensors::mocap::MocapParams;
use sensors::sensing::{Sensing, TruthInputs};
use std::path::{Path, PathBuf};
use std::time::Instant;

const REPETITIONS: usize = 7;
const SECONDS: f64 = 60.0;

/// Hosts of the nodes, and their recordings.
const HOSTS: [(&str, &[&str]); 5] = [
    ("a process each, recorded", &["--compose", "none"]),
    ("one group, recorded", &["--compose", "all"]),
    ("one group, not recorded", &["--compose", "all", "--record", "none"]),
    ("one thread, recorded", &["--in-process"]),
    ("one thread, not recorded", &["--in-process", "--record", "none"]),
];

/// Prints the tick rates, and the ratio of each to the bare loop's.
pub fn report() -> Result<()> {
    println!("\nhover.toml, free-running, {SECONDS} s simulated, {REPETITIONS} runs by turns, kticks/s");
    let manifest = manifest();
    let folder = tempfile::tempdir()?;
    let recording = folder.path().join("hover.mcap");
    let (recording, duration) = (recording.to_string_lossy(), format!("run.duration_s={SECONDS}"));
    let mut bare = Vec::new();
    let (mut rates, mut ratios) = (vec![Vec::new(); HOSTS.len()], vec![Vec::new(); HOSTS.len()]);
    for _ in 0..REPETITIONS {
        let alone = bare_ticks_per_s()? * 1e-3;
        bare.push(alone);
        for (host, (_, more)) in HOSTS.iter().enumerate() {
            let record = if more.contains(&"--record") { vec![] } else { vec!["--record", &*recording] };
            let arguments = [&["--set", &duration][..], &record, more].concat();
            let rate = number(&run_manifest(&manifest, &arguments)?, "ticks_per_s")? * 1e-3;
            rates[host].push(rate);
            ratios[host].push(rate / alone);
        }
    }
    println!("  {:26} {}", "bare loop", Spread::of(bare));
    for (((what, _), rates), ratios) in HOSTS.iter().zip(rates).zip(ratios) {
        println!("  {what:26} {}   to the bare loop {}", Spread::of(rates), Spread::of(ratios));
    }
    Ok(())
}

fn manifest() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("manifests/hover.toml")
}

/// The components of the manifest called one after the other: no samples are copied, checked or kept.
fn bare_ticks_per_s() -> Result<f64> {
    let mut chain = Chain::new()?;
    let ticks = (SECONDS * 1000.0) as u32;
    let start = Instant::now();
    for _ in 0..ticks {
        chain.step().map_err(|error| error.to_string())?;
    }
    let rate = f64::from(ticks) / start.elapsed().as_secs_f64();
    // The result is used, so that the computation cannot be optimised away.
    if (chain.state.position.z - 1.5).abs() < 0.05 { Ok(rate) } else { Err("the chain did not fly".into()) }
}

struct Chain {
    plant: Harness<Plant>,
    imu: Harness<ImuSensor>,
    mocap: Harness<Sensing<MocapParams>>,
    ekf: Harness<Ekf>,
    pilot: Harness<Pilot>,
    controller: Harness<Controller<PidLaw>>,
    command: MotorCommand,
    state: PlantState,
    pose: Mocap,
    set_point: SetPoint,
    estimate: StateEstimate,
}

impl Chain {
    fn new() -> Result<Self> {
        let graph = Graph::build(&hummingbus::load(manifest())?)?;
        Ok(Self {
            plant: harness(&graph, "plant")?,
            imu: harness(&graph, "imu")?,
            mocap: harness(&graph, "mocap")?,
            ekf: harness(&graph, "ekf")?,
            pilot: harness(&graph, "pilot")?,
            controller: harness(&graph, "controller")?,
            command: MotorCommand { command: [76.5; 4].into(), ..Default::default() },
            state: PlantState::default(),
            pose: Mocap::default(),
            set_point: SetPoint::default(),
            estimate: StateEstimate::default(),
        })
    }

    fn step(&mut self) -> std::result::Result<(), bus::component::StepError> {
        let inputs = plant::node::Inputs { command: &self.command, measured: None, traffic: None };
        self.state = self.plant.step(inputs)?.state;
        let imu = self.imu.step(TruthInputs { state: &self.state })?.imu;
        if self.mocap.tick < self.imu.tick {
            self.pose = self.mocap.step(TruthInputs { state: &self.state })?.mocap;
        }
        let mocap = Some(&self.pose);
        let inputs = EkfInputs { imu: &imu, gps: None, mocap, barometer: None, magnetometer: None };
        self.estimate = self.ekf.step(inputs)?.estimate;
        self.set_point = self.pilot.step(())?.set_point;
        let (set_point, estimate) = (&self.set_point, &self.estimate);
        self.command = self.controller.step(SetPointInputs { set_point, estimate, attitude: None })?.command;
        Ok(())
    }
}

/// The component of the node `name` as the manifest declares it.
fn harness<C: bus::Component>(graph: &Graph, name: &str) -> Result<Harness<C>> {
    let (plan, node) = (&graph.plan, &graph.plan.nodes[graph.plan.node_index(name)?]);
    let inputs: Vec<&str> = node.inputs.iter().map(|input| input.port.as_str()).collect();
    let context = bus::context::NodeContext::new(name, &inputs)
        .timed(plan.tick_ns, node.period_ticks, plan.duration_ticks)
        .seeded(plan.seed)
        .given(&graph.files);
    let parameters = diagnostics::read(&node.parameters)?;
    Ok(Harness::in_context(parameters, &context)?)
}
