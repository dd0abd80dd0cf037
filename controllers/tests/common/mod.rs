//! A closed loop around a law that follows a reference. The vehicle is the Hummingbird with drag that the law
//! does not know. The estimate has the noise of motion capture at 100 Hz and of the IMU's gyroscope.
#![allow(dead_code, reason = "each test file uses a part")]
#![allow(non_snake_case, reason = "a trailing _W or _B names the frame a vector is written in")]

use component::messages::{AttitudeEstimate, Reference, SetPoint, StateEstimate};
use component::random::{Stream, stream};
use component::{InputMemory, InputMessages};
use controllers::airframe::ControlledVehicle;
use controllers::allocation::RotorWrench;
use controllers::bumpless::BumplessTransfer;
use controllers::control::MotionEstimate;
use controllers::controller_state::ControllerState;
use controllers::law::Law;
use controllers::trajectory::{Start, Trajectory};
use diagnostics::ParameterError;
use nalgebra::{UnitQuaternion, Vector3};
use plant::{NewtonEuler, RigidBody, State};
use sensors::noise::WhiteNoise;
use vehicles::Vehicle;

pub const PERIOD_S: f64 = 1e-3;

pub fn vehicle() -> Vehicle {
    Vehicle::parse(vehicles::reference::HUMMINGBIRD, "hummingbird.toml").unwrap()
}

/// The Hummingbird as the laws know it.
pub fn believed() -> ControlledVehicle {
    ControlledVehicle::new(vehicle()).unwrap()
}

/// A trajectory from 1 m above the origin; `segments` is a list in TOML.
pub fn trajectory(segments: &str) -> Trajectory {
    try_trajectory(segments).unwrap()
}

pub fn try_trajectory(segments: &str) -> Result<Trajectory, ParameterError> {
    let table: toml::Table = toml::from_str(&format!("segments = [{segments}]")).unwrap();
    let entries = serde_json::to_value(&table["segments"]).unwrap();
    Trajectory::read(entries.as_array().unwrap(), Start { position_W_m: Vector3::z(), yaw_rad: 0.0 })
}

/// Staying 1 m above the origin with this yaw.
pub fn trajectory_from(yaw_rad: f64) -> Trajectory {
    Trajectory::read(&[], Start { position_W_m: Vector3::z(), yaw_rad }).unwrap()
}

/// Vehicle that the law flies, and its air.
#[derive(Clone)]
pub struct Craft {
    pub vehicle: Vehicle,
    /// Drag of the rotors along body x and y, for each unit of speed and mass.
    pub rotor_drag_1_s: f64,
    /// Drag of the frame against the velocity, for each unit of speed squared and mass.
    pub parasitic_drag_1_m: f64,
    /// Seed of the noise; none without noise.
    pub seed: Option<u64>,
}

impl Craft {
    /// As the file says, in still air without drag, measured exactly.
    pub fn ideal() -> Self {
        Self { vehicle: vehicle(), rotor_drag_1_s: 0.0, parasitic_drag_1_m: 0.0, seed: None }
    }

    /// With drag and noise. Rotor drag: 8.06e-5 N for each m/s and rad/s of a rotor (RotorS, hummingbird.xacro), four
    /// rotors at 411 rad/s, 0.48 kg: 0.28 1/s. Frame: c_d·A = 0.01 m² (a guess) at 1.2 kg/m³: 0.0125 1/m.
    pub fn dragged(seed: u64) -> Self {
        Self { rotor_drag_1_s: 0.28, parasitic_drag_1_m: 0.0125, seed: Some(seed), ..Self::ideal() }
    }

    fn drag_W_m_s2(&self, body: &RigidBody) -> Vector3<f64> {
        let velocity_B = body.attitude_WB.inverse() * body.velocity_W_m_s;
        let level_B = Vector3::new(velocity_B.x, velocity_B.y, 0.0);
        let frame_W = body.velocity_W_m_s * (body.velocity_W_m_s.norm() * self.parasitic_drag_1_m);
        -(body.attitude_WB * level_B) * self.rotor_drag_1_s - frame_W
    }
}

/// Noise of an estimate: standard deviations 1 mm, 2 cm/s and 3 mrad, renewed at 100 Hz; the gyroscope's own at each tick.
pub struct Noise {
    random: Stream,
    position_W_m: Vector3<f64>,
    velocity_W_m_s: Vector3<f64>,
    turn_B_rad: Vector3<f64>,
}

impl Noise {
    fn new(seed: u64) -> Self {
        let zero = Vector3::zeros();
        Self { random: stream(seed, "estimate"), position_W_m: zero, velocity_W_m_s: zero, turn_B_rad: zero }
    }

    fn estimate(&mut self, tick: u64, body: &RigidBody) -> MotionEstimate {
        let mut draw = |sigma: f64| WhiteNoise::new(sigma, 1.0).sample(&mut self.random);
        let gyroscope = draw(5.4e-3);
        if tick.is_multiple_of(10) {
            (self.position_W_m, self.velocity_W_m_s, self.turn_B_rad) = (draw(1e-3), draw(2e-2), draw(3e-3));
        }
        MotionEstimate {
            position_W_m: body.position_W_m + self.position_W_m,
            velocity_W_m_s: body.velocity_W_m_s + self.velocity_W_m_s,
            attitude_WB: body.attitude_WB * UnitQuaternion::from_scaled_axis(self.turn_B_rad),
            angular_velocity_B_rad_s: body.angular_velocity_B_rad_s + gyroscope,
        }
    }
}

fn exact(body: &RigidBody) -> MotionEstimate {
    MotionEstimate {
        position_W_m: body.position_W_m,
        velocity_W_m_s: body.velocity_W_m_s,
        attitude_WB: body.attitude_WB,
        angular_velocity_B_rad_s: body.angular_velocity_B_rad_s,
    }
}

/// A vehicle in flight, and the state of its controller.
pub struct Loop {
    craft: Craft,
    plant: NewtonEuler,
    believed: ControlledVehicle,
    noise: Option<Noise>,
    pub state: State,
    pub law_state: ControllerState,
    pub tick: u64,
    pub set_point: SetPoint,
    /// The last demand.
    pub demand: RotorWrench,
    /// True if the last demand was beyond the rotors.
    pub saturated: bool,
}

impl Loop {
    pub fn new(craft: Craft) -> Self {
        let plant = NewtonEuler::new(craft.vehicle.clone(), 1);
        let state = plant.start(RigidBody::level_at(Vector3::z()), plant.vehicle().hover_command());
        let noise = craft.seed.map(Noise::new);
        let set_point = SetPoint { altitude: 1.0, ..SetPoint::default() };
        let (believed, law_state, demand) = (believed(), ControllerState::default(), RotorWrench::default());
        Self { craft, plant, believed, noise, state, law_state, tick: 0, set_point, demand, saturated: false }
    }

    /// One tick under `law`: as the node runs it. Gives the true distance from the trajectory.
    pub fn step<L: Law>(&mut self, law: &L, trajectory: &Trajectory) -> f64 {
        let point = trajectory.at(self.tick as f64 * PERIOD_S);
        let off_m = (self.state.body.position_W_m - point.path_W[0]).norm();
        let motion = match &mut self.noise {
            Some(noise) => noise.estimate(self.tick, &self.state.body),
            None => exact(&self.state.body),
        };
        let messages = InputMessages::default()
            .with(&self.set_point)
            .with(&StateEstimate::from(&motion))
            .with(&AttitudeEstimate::from(&motion))
            .with(&Reference::from(&point));
        let mut memory = InputMemory::default();
        let inputs: L::Inputs<'_> = messages.read(&mut memory);
        let transfer = BumplessTransfer::to::<L>(&self.believed.vehicle, PERIOD_S);
        self.demand = transfer.step(law, &mut self.law_state, &inputs, None).wrench;
        let allocated = self.believed.allocation.allocate(&self.demand);
        self.saturated = allocated.is_saturated();
        let counts = allocated.speeds_rad_s.map(|speed| self.believed.vehicle.command.command(speed));
        self.plant.step(&mut self.state, &counts, PERIOD_S);
        self.state.body.velocity_W_m_s += self.craft.drag_W_m_s2(&self.state.body) * PERIOD_S;
        self.tick += 1;
        off_m
    }

    /// Flies until `until_s`; gives the root mean square and the greatest distance from the trajectory since `from_s`.
    pub fn fly<L: Law>(&mut self, law: &L, trajectory: &Trajectory, from_s: f64, until_s: f64) -> (f64, f64) {
        let (mut squares, mut greatest_m, mut count) = (0.0, 0.0_f64, 0.0);
        while (self.tick as f64) * PERIOD_S < until_s {
            let off_m = self.step(law, trajectory);
            if self.tick as f64 * PERIOD_S > from_s {
                (squares, greatest_m, count) = (squares + off_m * off_m, greatest_m.max(off_m), count + 1.0);
            }
        }
        ((squares / count).sqrt(), greatest_m)
    }
}
