//! A closed loop in one process: the Newton-Euler plant, measurements of it, and any controller.
//!
//! Attitude and rates come from a noisy IMU by the complementary filter. Range finders are modelled here, as the
//! estimators see them: level distances that are read ten times a second, noisy and in whole centimetres, with a
//! reach of 7.65 m; a velocity with an error that wanders; heights likewise.
#![allow(dead_code, reason = "each test uses a part of it")]
#![allow(non_snake_case, reason = "a trailing _W or _B names the frame a vector is written in")]

use component::messages::{
    AttitudeEstimate, Reference, SetPoint as SetPointMessage, StateEstimate, WallEstimate,
};
use component::{InputMemory, InputMessages};
use controllers::airframe::ControlledVehicle;
use controllers::bumpless::BumplessTransfer;
use controllers::control::{ControlOutput, MotionEstimate};
use controllers::controller_state::ControllerState;
use controllers::law::Law;
use controllers::set_points::SetPoint;
use nalgebra::Vector3;
use plant::{NewtonEuler, RigidBody, State};
use sensors::complementary::{Complementary, ComplementaryParams, ComplementaryState};
use sensors::imu_model::{ImuModel, ImuModelState, ImuParams, ImuReading};
use vehicles::Vehicle;

pub const PERIOD_S: f64 = 1e-3;
pub const PERIOD_NS: u64 = 1_000_000;

/// Reach of the MB1300 (thesis §5.5).
pub const REACH_M: f64 = 7.65;

pub fn vehicle() -> Vehicle {
    Vehicle::parse(vehicles::reference::HUMMINGBIRD, "hummingbird.toml").unwrap()
}

pub fn believed() -> ControlledVehicle {
    ControlledVehicle::new(vehicle()).unwrap()
}

/// Errors of the range finders' estimate.
#[derive(Clone, Copy)]
pub struct RangeErrors {
    /// Standard deviation of a distance.
    pub distance_m: f64,
    /// Standard deviation of the velocity's wandering error along an axis with a wall in sight.
    pub velocity_m_s: f64,
    /// The same with none in sight.
    pub blind_velocity_m_s: f64,
    /// Time constant of that wandering.
    pub wandering_s: f64,
}

/// Twice the error of the sensor's resolution, and the error of the velocity at 10 Hz.
pub const NOISY: RangeErrors =
    RangeErrors { distance_m: 0.01, velocity_m_s: 0.02, blind_velocity_m_s: 0.05, wandering_s: 2.0 };

/// Places of the walls: at +x, -x, +y, -y of the world's origin; none where infinite.
pub type Walls = [f64; 4];

/// The thesis's room.
pub const ROOM: Walls = [5.0, 5.0, 5.0, 5.0];

/// The sensors' side of a flight.
pub struct Senses {
    imu: ImuModel,
    imu_state: ImuModelState,
    filter: Complementary,
    filter_state: ComplementaryState,
    errors: RangeErrors,
    walls: Walls,
    random: component::random::Stream,
    velocity_error_m_s: [f64; 3],
    seen: WallEstimate,
    /// Objects that stand in the beams beside walls.
    pub others_W_m: Vec<Vector3<f64>>,
}

impl Senses {
    pub fn new(seed: u64, walls: Walls, errors: RangeErrors) -> Self {
        let imu = ImuModel::new(ImuParams::default(), 1.0 / PERIOD_S).unwrap();
        Self {
            imu_state: imu.initial_state(seed, "imu"),
            imu,
            filter: Complementary::with_period(ComplementaryParams::default(), PERIOD_S).unwrap(),
            filter_state: ComplementaryState::default(),
            errors,
            walls,
            random: component::random::stream(seed, "range"),
            velocity_error_m_s: [0.0; 3],
            seen: WallEstimate::default(),
            others_W_m: Vec::new(),
        }
    }

    fn normal(&mut self) -> f64 {
        component::random::normal(&mut self.random)
    }

    pub fn attitude(&mut self, plant: &NewtonEuler, state: &State) -> AttitudeEstimate {
        let truth = ImuReading {
            specific_force_B_m_s2: plant.accelerations(state).specific_force_B_m_s2,
            angular_velocity_B_rad_s: state.body.angular_velocity_B_rad_s,
        };
        let reading = self.imu.read(&mut self.imu_state, &truth);
        self.filter.update(&mut self.filter_state, &reading)
    }

    /// Returns the belief of the estimator of walls; the heading is the world's x.
    pub fn walls(&mut self, tick: u64, body: &RigidBody) -> WallEstimate {
        if tick.is_multiple_of(100) {
            self.measure(body);
        }
        for axis in 0..3 {
            let is_seen = axis == 2 || self.seen.in_sight[2 * axis] + self.seen.in_sight[2 * axis + 1] > 0;
            let sigma_m_s = if is_seen { self.errors.velocity_m_s } else { self.errors.blind_velocity_m_s };
            let kick = self.normal() * sigma_m_s * (2.0 * PERIOD_S / self.errors.wandering_s).sqrt();
            let error_m_s = &mut self.velocity_error_m_s[axis];
            *error_m_s += kick - *error_m_s * PERIOD_S / self.errors.wandering_s;
        }
        let velocity = body.velocity_W_m_s + Vector3::from(self.velocity_error_m_s);
        self.seen.velocity = [velocity.x, velocity.y];
        // The height is filtered with the climb, which the accelerometer tells well: no steps of a centimetre.
        self.seen.height = body.position_W_m.z + 0.3 * self.velocity_error_m_s[2];
        self.seen.climb_rate = velocity.z;
        self.seen
    }

    fn measure(&mut self, body: &RigidBody) {
        let at = body.position_W_m;
        let free = [self.walls[0] - at.x, self.walls[1] + at.x, self.walls[2] - at.y, self.walls[3] + at.y];
        for (beam, wall_m) in free.into_iter().enumerate() {
            let nearest_m = self.others_W_m.iter().filter_map(|other| in_beam_m(beam, &(other - at)));
            let truth_m = nearest_m.fold(wall_m, f64::min);
            let noisy_m = truth_m + self.normal() * self.errors.distance_m;
            let read_m = (noisy_m * 100.0).round() / 100.0;
            self.seen.in_sight[beam] = u32::from(read_m < REACH_M);
            self.seen.distance[beam] = read_m.min(REACH_M);
        }
    }
}

/// The distance of another vehicle in a beam of 15 degrees to either side.
fn in_beam_m(beam: usize, to: &Vector3<f64>) -> Option<f64> {
    let axis = [Vector3::x(), -Vector3::x(), Vector3::y(), -Vector3::y()][beam];
    let along_m = to.dot(&axis);
    let aside_m = (to - axis * along_m).norm() - 0.27;
    (along_m > 0.0 && aside_m < along_m * libm::tan(15.0_f64.to_radians()))
        .then_some((along_m - 0.27).max(0.0))
}

/// One vehicle in its loop, moved tick by tick.
pub struct Loop {
    pub plant: NewtonEuler,
    pub state: State,
    pub senses: Senses,
    pub law_state: ControllerState,
    /// Last output of the law.
    pub output: ControlOutput,
    pub believed: ControlledVehicle,
    pub set_point: SetPoint,
    pub reference: Reference,
    pub tick: u64,
}

impl Loop {
    pub fn new(start_W_m: Vector3<f64>, senses: Senses) -> Self {
        Self::of(vehicle(), start_W_m, senses)
    }

    /// `flown` by laws that believe in the Hummingbird's file.
    pub fn of(flown: Vehicle, start_W_m: Vector3<f64>, senses: Senses) -> Self {
        let plant = NewtonEuler::new(flown, 1);
        let state = plant.start(RigidBody::level_at(start_W_m), plant.vehicle().hover_command());
        let set_point = SetPoint { altitude_m: start_W_m.z, ..SetPoint::default() };
        Self {
            plant,
            state,
            senses,
            law_state: ControllerState::default(),
            output: ControlOutput::default(),
            believed: believed(),
            set_point,
            reference: Reference::default(),
            tick: 0,
        }
    }

    /// One tick under `law`. Order: state k, measurements k, law k, and its command acts until k + 1.
    pub fn step<L: Law>(&mut self, law: &L) -> ControlOutput {
        let attitude = self.senses.attitude(&self.plant, &self.state);
        let walls = self.senses.walls(self.tick, &self.state.body);
        let motion = MotionEstimate {
            position_W_m: self.state.body.position_W_m,
            velocity_W_m_s: self.state.body.velocity_W_m_s,
            attitude_WB: nalgebra::UnitQuaternion::from_euler_angles(
                attitude.roll,
                attitude.pitch,
                attitude.yaw,
            ),
            angular_velocity_B_rad_s: <[f64; 3]>::from(attitude.angular_velocity).into(),
        };
        let messages = InputMessages::default()
            .with(&SetPointMessage::from(&self.set_point))
            .with(&StateEstimate::from(&motion))
            .with(&AttitudeEstimate::from(&motion))
            .with(&self.reference)
            .with(&walls);
        let mut memory = InputMemory::default();
        let inputs: L::Inputs<'_> = messages.read(&mut memory);
        let transfer = BumplessTransfer::to::<L>(&self.believed.vehicle, PERIOD_S);
        let output = transfer.step(law, &mut self.law_state, &inputs, None);
        let speeds_rad_s = self.believed.allocation.allocate(&output.wrench).speeds_rad_s;
        let counts = speeds_rad_s.map(|speed| self.believed.vehicle.command.command(speed));
        self.plant.step(&mut self.state, &counts, PERIOD_S);
        self.tick += 1;
        self.output = output;
        output
    }

    pub fn position(&self) -> Vector3<f64> {
        self.state.body.position_W_m
    }

    pub fn time_s(&self) -> f64 {
        self.tick as f64 * PERIOD_S
    }
}
