//! Ticks per second of the hover manifest, against the same computation in one process without the bus.

use crate::report::{Result, Spread, number, run_manifest};
use std::path::Path;
use std::time::Instant;

const REPETITIONS: usize = 7;
const SECONDS: f64 = 60.0;

/// Prints the tick rates and their ratio.
pub fn report() -> Result<()> {
    println!("\nhover.toml with recorder, free-running, {SECONDS} s simulated, {REPETITIONS} runs by turns");
    let manifest = Path::new(env!("CARGO_MANIFEST_DIR")).join("manifests/hover.toml");
    let folder = tempfile::tempdir()?;
    let recording = folder.path().join("hover.mcap");
    let duration = format!("run.duration_s={SECONDS}");
    let arguments = ["--record", &recording.to_string_lossy(), "--set", &duration];
    let (mut bus, mut floor, mut ratio) = (Vec::new(), Vec::new(), Vec::new());
    for _ in 0..REPETITIONS {
        let rate = number(&run_manifest(&manifest, &arguments)?, "ticks_per_s")? * 1e-3;
        let alone = in_process_ticks_per_s()? * 1e-3;
        bus.push(rate);
        floor.push(alone);
        ratio.push(alone / rate);
    }
    println!("  eight processes, kticks/s   {}", Spread::of(bus));
    println!("  one process, kticks/s       {}", Spread::of(floor));
    println!("  one process / bus           {}", Spread::of(ratio));
    Ok(())
}

/// The same plant, IMU, filter, controller and pilot called one after the other, nothing recorded; the pose of motion
/// capture is the true one.
fn in_process_ticks_per_s() -> Result<f64> {
    let mut chain = chain::Chain::new()?;
    let ticks = (SECONDS * 1000.0) as u64;
    let start = Instant::now();
    for tick in 0..ticks {
        chain.step(tick);
    }
    let rate = ticks as f64 / start.elapsed().as_secs_f64();
    // The result is used, so that the computation cannot be optimised away.
    if (chain.altitude_m() - 1.5).abs() < 0.05 { Ok(rate) } else { Err("the chain did not fly".into()) }
}

mod chain {
    //! The hover scenario as one loop.
    use crate::report::Result;
    use controllers::airframe::ControlledVehicle;
    use controllers::allocation::Allocation;
    use controllers::control::{HoverMotion, Integrals};
    use controllers::pid::PidLaw;
    use controllers::pid_gains::PidGains;
    use controllers::set_points::{Schedule, SetPoint, SetPointEntry};
    use nalgebra::{Quaternion, UnitQuaternion, Vector3};
    use plant::{NewtonEuler, PerRotor, RigidBody, State};
    use sensors::ekf::filter::{Ekf, EkfState};
    use sensors::ekf::history::{Measurement, Newest, Reading, Source};
    use sensors::ekf::params::EkfParams;
    use sensors::imu_model::{ImuModel, ImuModelState, ImuParams, ImuReading};
    use std::path::Path;
    use vehicles::Vehicle;

    const DT_S: f64 = 1e-3;

    pub struct Chain {
        plant: NewtonEuler,
        state: State,
        imu: ImuModel,
        imu_state: ImuModelState,
        filter: Ekf,
        filter_state: Box<EkfState>,
        newest: Newest,
        law: PidLaw,
        integrals: Integrals,
        allocation: Allocation,
        schedule: Schedule,
        command: PerRotor<f64>,
    }

    impl Chain {
        pub fn new() -> Result<Self> {
            let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("vehicles/hummingbird.toml");
            let vehicle = Vehicle::load(&path)?;
            let craft = ControlledVehicle::new(vehicle.clone())?;
            let law = PidLaw { gains: PidGains::default(), vehicle: craft.hover_model(), period_s: DT_S };
            let imu = ImuModel::new(ImuParams::default(), 1.0 / DT_S)?;
            let initial = SetPoint { altitude_m: 1.0, ..SetPoint::default() };
            let step = SetPointEntry {
                kind: "step".into(),
                channel: "altitude".into(),
                at_s: 2.0,
                unit: "m".into(),
                to: Some(1.5),
                over_s: None,
                amplitude: None,
                duration_s: None,
            };
            let hover = vehicle.hover_command();
            let plant = NewtonEuler::new(vehicle, 1);
            let state = plant.start(RigidBody::level_at(Vector3::new(0.0, 0.0, 1.0)), hover);
            let params = EkfParams { initial_position_m: Some([0.0, 0.0, 1.0]), ..EkfParams::default() };
            let filter = Ekf::with_period(params, DT_S)?;
            Ok(Self {
                state,
                filter_state: Box::new(filter.initial_state()),
                filter,
                newest: [None; 4],
                plant,
                imu_state: imu.initial_state(1, "imu"),
                imu,
                law,
                integrals: Integrals::default(),
                allocation: craft.allocation,
                schedule: Schedule::new(&[step], &initial, 1000)?,
                command: [hover; 4].into(),
            })
        }

        pub fn step(&mut self, tick: u64) {
            if tick > 0 {
                self.plant.step(&mut self.state, &self.command, DT_S);
            }
            let truth = ImuReading {
                specific_force_B_m_s2: self.plant.accelerations(&self.state).specific_force_B_m_s2,
                angular_velocity_B_rad_s: self.state.body.angular_velocity_B_rad_s,
            };
            let reading = self.imu.read(&mut self.imu_state, &truth);
            let measured = self.estimate(tick * 1_000_000, &reading);
            let wrench = self.law.wrench(&mut self.integrals, &self.schedule.at(tick), &measured);
            let speeds = self.allocation.allocate(&wrench).speeds_rad_s;
            self.command = speeds.map(|speed| self.plant.vehicle().command.command(speed));
        }

        fn estimate(&mut self, time_ns: u64, reading: &ImuReading) -> HoverMotion {
            if time_ns.is_multiple_of(10_000_000) {
                let body = &self.state.body;
                let pose: Vec<f64> =
                    body.position_W_m.iter().chain(body.attitude_WB.coords.iter()).copied().collect();
                self.newest[Source::Mocap.index()] =
                    Some(Some(Measurement::new(Source::Mocap, time_ns, &pose)));
            }
            let specific_force = <[f64; 3]>::from(reading.specific_force_B_m_s2).into();
            let angular_velocity = <[f64; 3]>::from(reading.angular_velocity_B_rad_s).into();
            let reading = Reading { time_ns, specific_force, angular_velocity };
            self.filter.update_to(&mut self.filter_state, &reading, &self.newest);
            let motion = self.filter_state.motion();
            let q = motion.attitude;
            let attitude = UnitQuaternion::new_normalize(Quaternion::new(q.w, q.x, q.y, q.z));
            let (roll_rad, pitch_rad, yaw_rad) = attitude.euler_angles();
            HoverMotion {
                altitude_m: motion.position.z,
                climb_rate_m_s: motion.velocity.z,
                roll_rad,
                pitch_rad,
                yaw_rad,
                angular_velocity_B_rad_s: <[f64; 3]>::from(reading.angular_velocity).into(),
            }
        }

        pub fn altitude_m(&self) -> f64 {
            self.state.body.position_W_m.z
        }
    }
}
