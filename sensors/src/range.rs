//! The range node: five ultrasonic range finders along the body's +x, −x, +y, −y and −z axes.
//!
//! The beams tilt with the body. Each reads the nearest object in its cone (`crate::cone`): the ground,
//! the things of the scene and, with the input `traffic`, the other vehicles. Reading = distance + bias + white
//! noise, in steps of the part's resolution; each beam has its own noise and is lost on its own.
//! `crate::channel` gives the times, delays and losses of measurements.
//!
//! The beams fire together and do not hear each other. An echo comes back from every surface in the cone at any
//! angle of incidence; a real beam that grazes a smooth floor or wall hears none.

use crate::channel::{Chance, ChannelState, Remembered};
use crate::cone::{Cone, caster, check_bodies, check_told};
use crate::frame::{body_frame_of, frame};
use crate::sensing::Sensor;
use crate::steps::in_steps;
use crate::wire::{attitude, body_poses, vector};
use component::context::NodeContext;
use component::messages::{BodyStates, FrameName, LaserScan, PlantState, Ranges, StandardRange, Traffic};
use component::random::normal;
use component::{Info, InputPorts, OutputPorts, StepError};
use diagnostics::parameter::{ParameterError, finite, not_negative, positive, require, within};
use inputs::InputFiles;
use nalgebra::{UnitQuaternion, Vector3};
use scenes::RayCaster;
use std::path::PathBuf;

const BEAMS: usize = 5;

/// Outputs of the beams, in the order of `Ranges`.
const BEAM_OUTPUTS: [&str; BEAMS] = ["front", "back", "left", "right", "down"];

/// The beams of a `sensor_msgs/LaserScan`, counter-clockwise from −y on.
const SCANNED: [usize; LaserScan::RAYS] = [3, 0, 2, 1];

/// Reading of a beam without a measurement in standard messages, in reaches: readers discard what is beyond the reach. The
/// infinity of REP 117 would end the run. Tuned, no source.
const NOTHING_REACHES: f64 = 2.0;

/// A vehicle of the traffic that is nearer than this is the sensors' own: positions of one tick differ by less.
const SELF_MAX_M: f64 = 0.01;

timed_parameters! {
    /// Parameters of the range finders; the defaults are five MaxBotix XL-MaxSonar-AE0 (MB1300).
    ///
    /// *Reach, resolution, nearest reading and rate* are the data sheet's (PD11840): 7.65 m, 1 cm, 20 cm, which it
    /// reads from anything nearer too, and 10 Hz. *Delay*: sound takes 45 ms to the end of the reach and back, and
    /// the serial output another 5 ms. *Noise*: the data sheet has no figure but the resolution; 1 cm is tuned, no
    /// source. *Half angle*: it draws the beam as a shape that changes with target and distance; 5° is tuned, no
    /// source. The vehicle's radius is that of the Hummingbird: half of the 0.34 m between rotor axes (thesis,
    /// Table 2.1) and the radius of its 8 inch propellers (thesis, §2.1).
    ///
    /// ```
    /// use component::messages::PlantState;
    /// use sensors::range::{RangeFinders, RangeInputs, RangeParams};
    /// use sensors::sensing::Sensing;
    ///
    /// let scene = concat!(env!("CARGO_MANIFEST_DIR"), "/../scenes/room.toml");
    /// let parameters = RangeParams { scene: Some(scene.into()), delay_ms: 0.0, ..RangeParams::default() };
    /// let mut range = component::Harness::<Sensing<RangeFinders>>::new(parameters).unwrap();
    /// let state = PlantState { position: [0.0, 0.0, 1.5].into(), ..Default::default() };
    /// let ranges = range.step(RangeInputs { state: &state, traffic: None, bodies: None }).unwrap().ranges;
    /// assert!((ranges.distance[4] - 1.5).abs() < 0.1, "the last beam looks down: {ranges:?}");
    /// ```
    pub struct RangeParams timed { rate_hz: 10.0, delay_ms: 50.0 } {
        /// Scene file, relative to the manifest.
        #[parameter(shown = "required", file = scenes::FILE)]
        pub scene: Option<PathBuf>,
        /// Standard deviation of a reading.
        #[parameter(default = 0.01, check = not_negative)]
        pub noise_m: f64,
        /// Constant error of each beam.
        #[parameter(default = [0.0; BEAMS], check = finite)]
        pub bias_m: [f64; BEAMS],
        /// Readings are multiples of this; 0 for any reading.
        #[parameter(default = 0.01, check = not_negative)]
        pub resolution_m: f64,
        /// Nothing beyond this is met.
        #[parameter(default = 7.65, check = positive)]
        pub reach_m: f64,
        /// Reading of anything nearer than this.
        #[parameter(default = 0.20)]
        pub nearest_m: f64,
        /// Half angle of the beams' cones.
        #[parameter(default = 5.0, check = within(0.0..90.0, "zero or more and below 90"))]
        pub half_angle_deg: f64,
        /// Radius of the spheres that other vehicles are.
        #[parameter(default = 0.27, check = positive)]
        pub vehicle_radius_m: f64,
        /// Index of this vehicle in the traffic, from 0.
        #[parameter(rename = "self", shown = "that of the vehicle nearer than 1 cm")]
        pub self_index: Option<u32>,
    }
}

/// The five range finders in their scene, with everything that does not change during a run.
#[derive(Debug, Clone)]
pub struct RangeFinders {
    params: RangeParams,
    cones: [Cone; BEAMS],
    scene: RayCaster,
    /// Frames of the beams, of those whose names are not too long.
    frames: [Option<FrameName>; BEAMS],
    /// Frame of the body, unless its name is too long.
    body: Option<FrameName>,
}

impl RangeFinders {
    /// The reading of a beam in `ranges` as a standard message.
    fn standard(&self, beam: usize, ranges: &Ranges) -> Option<StandardRange> {
        let frame = self.frames[beam]?;
        let RangeParams { noise_m, reach_m, nearest_m, half_angle_deg, .. } = self.params;
        let range_m = self.standard_m(beam, ranges);
        let field_of_view_rad = 2.0 * half_angle_deg.to_radians();
        let numbers = [field_of_view_rad, nearest_m, reach_m, range_m, noise_m * noise_m];
        Some(StandardRange::new(&frame, StandardRange::ULTRASOUND, numbers.map(|number| number as f32)))
    }

    /// The readings of the level beams in `ranges` as a scan.
    fn scan(&self, ranges: &Ranges) -> Option<LaserScan> {
        let RangeParams { rate_hz, reach_m, nearest_m, .. } = self.params;
        let bounds_m = [nearest_m, reach_m].map(|bound_m| bound_m as f32);
        let ranges_m = SCANNED.map(|beam| self.standard_m(beam, ranges) as f32);
        Some(LaserScan::new(&self.body?, (1.0 / rate_hz) as f32, bounds_m, ranges_m))
    }

    /// The reading of a beam in `ranges` in a standard message.
    fn standard_m(&self, beam: usize, ranges: &Ranges) -> f64 {
        match ranges.valid[beam] {
            0 => NOTHING_REACHES * self.params.reach_m,
            _ => ranges.distance[beam],
        }
    }

    /// Returns the distance to the first object that each beam meets within its reach, m.
    fn distances_m(&self, inputs: &RangeInputs<'_>) -> [Option<f64>; BEAMS] {
        let (truth, traffic) = (inputs.state, inputs.traffic);
        let (poses, count) = body_poses(inputs.bodies);
        let (position_W_m, attitude_WB) = (vector(truth.position), attitude(truth.attitude));
        let reach_m = self.params.reach_m;
        self.cones.each_ref().map(|cone| {
            let scene_m =
                cone.scene_distance_m((&self.scene, &poses[..count]), &position_W_m, &attitude_WB, reach_m);
            let balls_m = self.scene.balls(&poses[..count]).filter_map(|(centre_W_m, radius_m)| {
                let centre_B_m = attitude_WB.inverse_transform_vector(&(centre_W_m - position_W_m));
                cone.sphere_distance_m(&centre_B_m, radius_m)
            });
            let vehicles_m = self.others(traffic, position_W_m, attitude_WB);
            let vehicles_m = vehicles_m
                .filter_map(|centre_B_m| cone.sphere_distance_m(&centre_B_m, self.params.vehicle_radius_m));
            vehicles_m
                .chain(balls_m)
                .filter(|distance_m| *distance_m <= reach_m)
                .chain(scene_m)
                .reduce(f64::min)
        })
    }

    /// Iterates over the positions of the other vehicles, seen from this one, in its own axes.
    fn others(
        &self,
        traffic: Option<&Traffic>,
        position_W_m: Vector3<f64>,
        attitude_WB: UnitQuaternion<f64>,
    ) -> impl Iterator<Item = Vector3<f64>> {
        let self_index = self.params.self_index;
        let positions = traffic.into_iter().flat_map(|traffic| {
            let count = (traffic.count as usize).min(traffic.position.len());
            traffic.position[..count].iter().zip(0..)
        });
        let from_here = positions.map(move |(other, index)| (vector(*other) - position_W_m, index));
        let others = from_here.filter(move |(away_W_m, index)| match self_index {
            Some(self_index) => *index != self_index,
            None => away_W_m.norm() >= SELF_MAX_M,
        });
        others.map(move |(away_W_m, _)| attitude_WB.inverse_transform_vector(&away_W_m))
    }

    /// The reading of a beam whose nearest thing is at `distance_m`, if it meets one.
    fn reading_m(&self, beam: usize, distance_m: Option<f64>, noise: f64) -> Option<f64> {
        let RangeParams { noise_m, bias_m, resolution_m, reach_m, nearest_m, .. } = self.params;
        let read_m = distance_m? + bias_m[beam] + noise_m * noise;
        Some(in_steps(read_m, resolution_m).clamp(nearest_m, reach_m))
    }
}

/// State of the sensor.
#[derive(Debug, Clone, Copy, Default, component::Message)]
#[repr(C)]
#[message(type_name = "hummingbus_msgs/msg/RangeState", role = "state")]
pub struct RangeState {
    /// Measurements that are under way.
    channel: ChannelState,
}

impl Remembered for RangeState {
    type Measurement = Ranges;

    fn channel(&mut self) -> &mut ChannelState {
        &mut self.channel
    }
}

/// Outputs of the sensor. The messages of single beams have a frame for each beam, `NODE/OUTPUT`, whose x axis is the beam. The scan
/// is in the frame of the body.
#[derive(Debug, OutputPorts)]
pub struct Outputs {
    /// The measurement that arrived last.
    pub ranges: Ranges,
    /// The beam along +x as `sensor_msgs/Range`.
    pub front: Option<StandardRange>,
    /// The beam along −x as `sensor_msgs/Range`.
    pub back: Option<StandardRange>,
    /// The beam along +y as `sensor_msgs/Range`.
    pub left: Option<StandardRange>,
    /// The beam along −y as `sensor_msgs/Range`.
    pub right: Option<StandardRange>,
    /// The beam along −z as `sensor_msgs/Range`.
    pub down: Option<StandardRange>,
    /// The beams along −y, +x, +y and −x as `sensor_msgs/LaserScan`.
    pub scan: Option<LaserScan>,
}

impl From<Ranges> for Outputs {
    fn from(ranges: Ranges) -> Self {
        Self { ranges, front: None, back: None, left: None, right: None, down: None, scan: None }
    }
}

/// Inputs of the range finders.
#[derive(Debug, InputPorts)]
pub struct RangeInputs<'a> {
    /// The truth.
    pub state: &'a PlantState,
    /// Positions of all vehicles of the run.
    pub traffic: Option<&'a Traffic>,
    /// Poses of the scene's free bodies; for a scene that has some.
    pub bodies: Option<&'a BodyStates>,
}

impl Sensor for RangeFinders {
    const INFO: Info = Info::new("range", "five ultrasonic range finders in the scene of a scene file");
    type Parameters = RangeParams;
    type Inputs<'a> = RangeInputs<'a>;
    type Outputs = Outputs;
    type State = RangeState;

    fn made_of(params: RangeParams, files: &InputFiles) -> Result<Self, ParameterError> {
        let nearest_is_good = (0.0..params.reach_m).contains(&params.nearest_m);
        let nearest =
            require("nearest_m", params.nearest_m, nearest_is_good, "zero or more and below `reach_m`");
        let (scene, ()) = ParameterError::both(caster(files, params.scene.as_deref()), nearest)?;
        let (x, y, z) = (Vector3::x_axis(), Vector3::y_axis(), Vector3::z_axis());
        let half_angle_rad = params.half_angle_deg.to_radians();
        let cones = [x, -x, y, -y, -z].map(|axis_B| Cone::new(axis_B, half_angle_rad));
        Ok(Self { params, cones, scene, frames: [None; BEAMS], body: None })
    }

    fn in_run(mut self, run: &NodeContext<'_>) -> Result<Self, ParameterError> {
        check_bodies(&self.scene, run)?;
        for (place, output) in self.frames.iter_mut().zip(BEAM_OUTPUTS) {
            *place = frame(run, output, &format!("{}/{output}", run.name))?;
        }
        self.body = frame(run, "scan", &body_frame_of(run.name))?;
        Ok(self)
    }

    fn outputs(&self, ranges: Ranges) -> Outputs {
        let [front, back, left, right, down] = std::array::from_fn(|beam| self.standard(beam, &ranges));
        Outputs { front, back, left, right, down, scan: self.scan(&ranges), ranges }
    }

    fn check_inputs(&self, inputs: &RangeInputs<'_>) -> Result<(), StepError> {
        check_told(&self.scene, inputs.bodies)
    }

    /// Until the first measurement arrives, nothing is met.
    fn first(&self) -> Ranges {
        Ranges { distance: [self.params.reach_m; BEAMS], ..Default::default() }
    }

    /// The noise is drawn whether or not a beam meets anything, so that the reading of one of them does not
    /// reshuffle the others' noise.
    fn measure(
        &self,
        _: &mut RangeState,
        last: &Ranges,
        chance: &mut Chance<'_>,
        inputs: RangeInputs<'_>,
    ) -> Option<Ranges> {
        let mut ranges = *last;
        for (beam, distance_m) in self.distances_m(&inputs).into_iter().enumerate() {
            let noise = normal(chance.noise());
            let read_m = self.reading_m(beam, distance_m, noise);
            let is_lost = chance.is_lost(beam as u32);
            ranges.valid[beam] = u32::from(read_m.is_some() && !is_lost);
            if !is_lost {
                ranges.distance[beam] = read_m.unwrap_or(self.params.reach_m);
            }
        }
        Some(ranges)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sensing::Sensing;
    use crate::testing::{TICK_NS, harness, refusal, require_normal};
    use crate::wire::attitude_message;
    use component::Harness;

    const ROOM: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../scenes/room.toml");

    fn in_room(params: RangeParams) -> RangeParams {
        RangeParams { scene: Some(ROOM.into()), ..params }
    }

    /// Thin beams that read what they meet, at once.
    fn perfect() -> RangeParams {
        let (noise_m, resolution_m, half_angle_deg, delay_ms) = (0.0, 0.0, 0.0, 0.0);
        RangeParams { noise_m, resolution_m, half_angle_deg, delay_ms, ..RangeParams::default() }
    }

    fn at(position_W_m: [f64; 3], roll_deg: f64, pitch_deg: f64, yaw_deg: f64) -> PlantState {
        let [roll, pitch, yaw] = [roll_deg, pitch_deg, yaw_deg].map(f64::to_radians);
        let attitude = attitude_message(UnitQuaternion::from_euler_angles(roll, pitch, yaw));
        PlantState { position: position_W_m.into(), attitude, ..Default::default() }
    }

    fn read(params: RangeParams, truth: &PlantState, traffic: Option<&Traffic>) -> Ranges {
        samples(params, truth, traffic, 1)[0]
    }

    /// The samples of `count` measurements.
    fn samples(
        params: RangeParams,
        truth: &PlantState,
        traffic: Option<&Traffic>,
        count: u64,
    ) -> Vec<Ranges> {
        let mut finders = harness::<RangeFinders>(in_room(params), 100);
        (0..count)
            .map(|_| finders.step(RangeInputs { state: truth, traffic, bodies: None }).unwrap().ranges)
            .collect()
    }

    #[test]
    fn a_free_body_is_met_where_the_input_tells_it_is_and_needs_that_input() {
        let scene = concat!(env!("CARGO_MANIFEST_DIR"), "/../scenes/slung-load.toml");
        let params = RangeParams { scene: Some(scene.into()), ..perfect() };
        let checked = |ports: &[&str]| {
            let context = component::context::NodeContext::new("range", ports);
            Harness::<Sensing<RangeFinders>>::in_context(params.clone(), &context).map(|_| ())
        };
        let error = checked(&["state"]).unwrap_err().to_string();
        assert!(error.contains("`bodies`"), "{error}");
        let mut finders = Harness::<Sensing<RangeFinders>>::in_context(
            params.clone(),
            &component::context::NodeContext::new("range", &["state", "bodies"]),
        )
        .unwrap();
        // The load, 3 cm in radius, hangs 0.8 m below, and is 2 m ahead later.
        let state = at([0.0, 0.0, 2.0], 0.0, 0.0, 0.0);
        let mut bodies = BodyStates { count: 1, ..Default::default() };
        let inputs = RangeInputs { state: &state, traffic: None, bodies: Some(&bodies) };
        let error = finders.step(inputs).unwrap_err().to_string();
        assert!(error.contains("the plant's scene"), "{error}");
        bodies.object[0] = 2;
        let mut read = |position: [f64; 3]| {
            bodies.position[0] = position.into();
            let read = |_| {
                let inputs = RangeInputs { state: &state, traffic: None, bodies: Some(&bodies) };
                finders.step(inputs).unwrap().ranges.distance
            };
            (0..200).map(read).last().unwrap()
        };
        assert!((read([0.0, 0.0, 1.2])[4] - 0.77).abs() < 1e-9);
        let cone = Cone::new(Vector3::x_axis(), 5.0_f64.to_radians());
        let aside_B_m = Vector3::new(3.0, 3.0 * libm::tan(2.0_f64.to_radians()), 0.05);
        let ball_m = cone.sphere_distance_m(&aside_B_m, 0.02);
        assert!(ball_m.is_some_and(|found_m| (found_m - aside_B_m.norm() + 0.02).abs() < 1e-9), "{ball_m:?}");
        let ahead = read([2.0, 0.0, 2.0]);
        assert!((ahead[0] - 1.97).abs() < 1e-9 && (ahead[4] - 2.0).abs() < 1e-9, "{ahead:?}");
    }

    #[track_caller]
    fn assert_near(found: [f64; BEAMS], expected: [f64; BEAMS]) {
        for (found_m, expected_m) in found.into_iter().zip(expected) {
            assert!((found_m - expected_m).abs() < 1e-9, "found {found:?}, expected {expected:?}");
        }
    }

    #[test]
    fn level_beams_read_the_four_walls_and_the_floor() {
        let ranges = read(perfect(), &at([1.0, 2.0, 1.5], 0.0, 0.0, 0.0), None);
        assert_near(ranges.distance, [4.0, 6.0, 3.0, 7.0, 1.5]);
        assert_eq!(ranges.valid, [1; BEAMS]);
    }

    #[test]
    fn each_beam_has_a_standard_message_in_its_own_frame() {
        let params = RangeParams { noise_m: 0.5, half_angle_deg: 4.0, bias_m: [0.0; BEAMS], ..perfect() };
        // Ahead, nothing is within reach.
        let truth = at([-4.0, 2.0, 1.5], 0.0, 0.0, 0.0);
        let mut finders = harness::<RangeFinders>(in_room(params), 100);
        let inputs = RangeInputs { state: &truth, traffic: None, bodies: None };
        let Outputs { ranges, front, back, left, right, down, scan } = finders.step(inputs).unwrap();
        let beams = [front, back, left, right, down].map(Option::unwrap);
        for (beam, message) in beams.iter().enumerate() {
            let frame = format!("range/{}\0", BEAM_OUTPUTS[beam]);
            let bytes = bytemuck::bytes_of(message);
            assert!(bytes.windows(frame.len()).any(|bytes| bytes == frame.as_bytes()), "{message:?}");
            let range_m = if beam == 0 { 15.3 } else { ranges.distance[beam] };
            let expected = [8.0_f64.to_radians(), 0.2, 7.65, range_m, 0.25];
            assert_eq!(message.numbers(), expected.map(|number| number as f32));
        }
        assert_eq!(ranges.valid, [0, 1, 1, 1, 1]);
        // From the right on, counter-clockwise.
        let scan = scan.unwrap();
        assert!(bytemuck::bytes_of(&scan).windows(8).any(|bytes| bytes == b"hb_body\0"), "{scan:?}");
        let [_, back_m, left_m, right_m, _] = ranges.distance;
        assert_eq!(scan.ranges(), [right_m, 15.3, left_m, back_m].map(|range_m| range_m as f32));
    }

    #[test]
    fn the_beams_turn_with_the_yaw() {
        let ranges = read(perfect(), &at([1.0, 2.0, 1.5], 0.0, 0.0, 90.0), None);
        // Forward is +y, left is −x.
        assert_near(ranges.distance, [3.0, 7.0, 6.0, 4.0, 1.5]);
    }

    #[test]
    fn the_beams_tilt_with_the_body() {
        // Nose down by 30°: ahead is the floor, behind goes up to the wall below its 3 m, down tilts backward.
        let ranges = read(perfect(), &at([-3.0, 0.0, 1.5], 0.0, 30.0, 0.0), None);
        let cos = libm::cos(30.0_f64.to_radians());
        assert_near(ranges.distance, [3.0, 2.0 / cos, 5.0, 5.0, 1.5 / cos]);
        // Left side up by 20°: the right beam meets the floor.
        let ranges = read(perfect(), &at([0.0, -4.0, 0.3], 20.0, 0.0, 0.0), None);
        let (sin, cos) = libm::sincos(20.0_f64.to_radians());
        assert!((ranges.distance[3] - 0.3 / sin).abs() < 1e-9, "{ranges:?}");
        assert!((ranges.distance[4] - 0.3 / cos).abs() < 1e-9, "{ranges:?}");
    }

    #[test]
    fn what_is_out_of_reach_is_not_met_and_reads_the_reach() {
        let ranges = read(perfect(), &at([-4.0, 0.0, 2.9], 0.0, -20.0, 0.0), None);
        assert_eq!((ranges.valid[0], ranges.distance[0]), (0, 7.65));
        assert_eq!(ranges.valid[1], 1);
    }

    #[test]
    fn what_is_too_near_reads_the_nearest() {
        let ranges = read(perfect(), &at([4.9, 0.0, 1.5], 0.0, 0.0, 0.0), None);
        assert_eq!((ranges.valid[0], ranges.distance[0]), (1, 0.20));
    }

    #[test]
    fn readings_are_multiples_of_the_resolution() {
        let params = RangeParams { delay_ms: 0.0, ..RangeParams::default() };
        for ranges in samples(params, &at([1.003, 2.0, 1.5], 0.0, 0.0, 0.0), None, 200) {
            for distance_m in ranges.distance {
                let steps = distance_m / 0.01;
                assert!((steps - steps.round()).abs() < 1e-6, "{distance_m}");
            }
        }
    }

    #[test]
    fn each_beam_has_noise_of_its_own_and_its_bias() {
        let bias_m = [0.1, -0.1, 0.0, 0.2, 0.05];
        let params = RangeParams { noise_m: 0.02, bias_m, ..perfect() };
        let samples = samples(params, &at([1.0, 2.0, 1.5], 0.0, 0.0, 0.0), None, 10_000);
        let truth_m = [4.0, 6.0, 3.0, 7.0, 1.5];
        let errors = |beam: usize| {
            let expected_m = truth_m[beam] + bias_m[beam];
            samples.iter().map(move |ranges| (ranges.distance[beam] - expected_m) / 0.02)
        };
        for beam in 0..BEAMS {
            require_normal(errors(beam), 0.0, 1.0);
            let next = errors((beam + 1) % BEAMS);
            let shared = errors(beam).zip(next).map(|(a, b)| a * b).sum::<f64>() / 1e4;
            assert!(shared.abs() < 0.06, "beams {beam} and the next share their noise: {shared}");
        }
    }

    #[test]
    fn a_beam_is_lost_on_its_own_and_keeps_what_it_read_last() {
        let params = RangeParams { dropout: 0.25, ..perfect() };
        let samples = samples(params, &at([1.0, 2.0, 1.5], 0.0, 0.0, 0.0), None, 4000);
        for beam in 0..BEAMS {
            let lost = samples.iter().filter(|ranges| ranges.valid[beam] == 0).count() as f64 / 4000.0;
            assert!((lost - 0.25).abs() < 6.0 * (0.25 * 0.75 / 4000.0_f64).sqrt(), "{lost}");
        }
        let both = samples.iter().filter(|ranges| ranges.valid[..2] == [0, 0]).count() as f64 / 4000.0;
        assert!((both - 0.0625).abs() < 0.023, "{both}");
        assert!(samples.iter().skip(50).all(|ranges| ranges.distance[0] == 4.0));
        assert!(samples.iter().enumerate().all(|(n, ranges)| ranges.measured_ns == n as u64 * 100 * TICK_NS));
    }

    fn traffic(positions: &[[f64; 3]]) -> Traffic {
        let mut traffic = Traffic { count: positions.len() as u32, ..Default::default() };
        for (place, position) in traffic.position.iter_mut().zip(positions) {
            *place = (*position).into();
        }
        traffic
    }

    #[test]
    fn other_vehicles_are_met_as_spheres_and_the_own_one_is_not() {
        let truth = at([1.0, 2.0, 1.5], 0.0, 0.0, 0.0);
        // This one, one ahead, and one on the left but beyond the wall.
        let traffic = traffic(&[[1.0, 2.001, 1.5], [3.0, 2.0, 1.5], [1.0, 6.0, 1.5]]);
        let ranges = read(perfect(), &truth, Some(&traffic));
        assert_near(ranges.distance, [2.0 - 0.27, 6.0, 3.0, 7.0, 1.5]);
    }

    #[test]
    fn the_own_one_can_be_named() {
        let truth = at([1.0, 2.0, 1.5], 0.0, 0.0, 0.0);
        let traffic = traffic(&[[3.0, 2.0, 1.5], [1.0, 2.4, 1.5]]);
        let params = RangeParams { self_index: Some(0), ..perfect() };
        let ranges = read(params, &truth, Some(&traffic));
        // The vehicle ahead is this one as it was; the other is nearer than the sensors read.
        assert_near(ranges.distance, [4.0, 6.0, 0.20, 7.0, 1.5]);
    }

    #[test]
    fn a_vehicle_is_met_in_the_axes_of_a_turned_body() {
        let truth = at([0.0, 0.0, 1.5], 0.0, 0.0, 45.0);
        let ranges = read(perfect(), &truth, Some(&traffic(&[[1.5, 1.5, 1.5]])));
        let ahead_m = 1.5 * 2.0_f64.sqrt() - 0.27;
        assert!((ranges.distance[0] - ahead_m).abs() < 1e-9, "{ranges:?}");
    }

    #[test]
    fn a_count_of_vehicles_that_no_message_holds_is_cut() {
        let traffic = Traffic { count: u32::MAX, ..Default::default() };
        let ranges = read(perfect(), &at([1.0, 2.0, 1.5], 0.0, 0.0, 0.0), Some(&traffic));
        assert!(ranges.distance.iter().all(|distance_m| distance_m.is_finite()));
    }

    #[test]
    fn a_state_that_is_transferred_goes_on_byte_for_byte() {
        let params = || in_room(RangeParams { dropout: 0.2, delay_ms: 130.0, ..RangeParams::default() });
        let truth = |tick| at([1.0, f64::from(tick) * 1e-3, 1.5], 3.0, 4.0, f64::from(tick) * 0.1);
        let truths: Vec<_> = (0..2000).map(truth).collect();
        let inputs = |tick| RangeInputs { state: &truths[tick as usize], traffic: None, bodies: None };
        Harness::require_transfer(|| harness::<RangeFinders>(params(), 1), inputs);
    }

    #[test]
    fn impossible_parameters_are_named() {
        let refused = |key: &str, value: f64| {
            let mut parameters = serde_json::json!({ "scene": ROOM });
            parameters[key] = value.into();
            refusal::<RangeFinders>(&parameters)
        };
        let bad = [("nearest_m", 8.0), ("half_angle_deg", 90.0), ("reach_m", 0.0), ("noise_m", -1.0)];
        for (key, value) in bad.into_iter().chain([("vehicle_radius_m", 0.0), ("dropout", 1.5)]) {
            let reason = refused(key, value);
            assert!(reason.contains(&format!("`{key}`")), "{reason}");
        }
        let reason = refusal::<RangeFinders>(&serde_json::json!({}));
        assert!(reason.starts_with("missing key `scene`"), "{reason}");
        let reason = refusal::<RangeFinders>(&serde_json::json!({ "scene": "none.toml" }));
        assert!(reason.contains("none.toml"), "{reason}");
        Harness::<Sensing<RangeFinders>>::from_json(&serde_json::json!({ "scene": ROOM })).unwrap();
    }
}
