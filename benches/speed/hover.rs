//! Ticks per second of the hover manifest by host and in a campaign, against a bare loop of the same components.

use crate::report::{Result, Spread, fly_manifest, number, run_manifest};
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

/// Turns of the campaign.
const CAMPAIGNS: usize = 5;
/// Flights of the campaign: its start of some tenths of a second must count little.
const FLIGHTS: u32 = 200;
/// Simulated seconds of a flight, as `hover.toml` states them.
const FLIGHT_S: f64 = 12.0;
/// Workers of the campaign, a core each.
const WORKERS: usize = 2;
/// Bare loops on each core beside a campaign.
const BARE_LOOPS: usize = 10;

/// Prints the tick rates, and the ratio of each to the bare loop's.
pub fn report() -> Result<()> {
    report_hosts()?;
    report_campaign()
}

/// Prints the tick rate of a campaign on each core, and its ratio to that of bare loops on the same cores at once.
fn report_campaign() -> Result<()> {
    println!(
        "\n{FLIGHTS} hovers of {FLIGHT_S} s, start and report of the campaign included, {CAMPAIGNS} runs by turns, kticks/s on each of \
         {WORKERS} cores"
    );
    let (mut bare, mut rates, mut ratios) = (Vec::new(), Vec::new(), Vec::new());
    for _ in 0..CAMPAIGNS {
        let alone = bare_ticks_per_s_on_each_core()? * 1e-3;
        let rate = campaign_ticks_per_s()? * 1e-3 / WORKERS as f64;
        bare.push(alone);
        rates.push(rate);
        ratios.push(rate / alone);
    }
    println!("  {:34} {}", "bare loop, on both cores at once", Spread::of(bare));
    let what = "campaign, two workers, a core each";
    println!("  {what:34} {}   to the bare loop {}", Spread::of(rates), Spread::of(ratios));
    Ok(())
}

/// Mean rate of bare loops that run on as many threads at once as a campaign has workers.
fn bare_ticks_per_s_on_each_core() -> Result<f64> {
    // Errors that may leave their thread are texts.
    let mean = || {
        let rates: std::result::Result<Vec<f64>, String> =
            (0..BARE_LOOPS).map(|_| bare_ticks_per_s().map_err(|error| error.to_string())).collect();
        rates.map(|rates| rates.iter().sum::<f64>() / BARE_LOOPS as f64)
    };
    std::thread::scope(|scope| {
        let threads: Vec<_> = (0..WORKERS).map(|_| scope.spawn(mean)).collect();
        let mut sum = 0.0;
        for thread in threads {
            sum += thread.join().map_err(|_| "a bare loop panicked")??;
        }
        Ok(sum / WORKERS as f64)
    })
}

/// Ticks a second of host time of a campaign of plain hovers, from the start of the program to its end.
fn campaign_ticks_per_s() -> Result<f64> {
    let folder = tempfile::tempdir()?;
    let (file, out) = (folder.path().join("hovers.toml"), folder.path().join("out"));
    let text = format!(
        "manifest = {:?}\nflights = {FLIGHTS}\nset = [\"run.duration_s={FLIGHT_S:?}\"]\n",
        manifest()
    );
    std::fs::write(&file, text)?;
    let (out, workers) = (out.to_string_lossy(), WORKERS.to_string());
    let start = Instant::now();
    let report = fly_manifest("campaign", &file, &["--out", &*out, "--workers", &workers])?;
    let host_s = start.elapsed().as_secs_f64();
    if number(&report, "passed")? < f64::from(FLIGHTS) {
        return Err("a hover of the campaign did not pass".into());
    }
    Ok(f64::from(FLIGHTS) * FLIGHT_S * 1000.0 / host_s)
}

/// Prints the tick rates of the hosts of the nodes, and the ratio of each to the bare loop's.
fn report_hosts() -> Result<()> {
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
        let inputs =
            plant::node::Inputs { command: &self.command, measured: None, battery: None, traffic: None };
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
