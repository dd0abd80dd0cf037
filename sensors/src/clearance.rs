//! The clearance node: true distance of a vehicle from the things of the scene. It is not a sensor: a judge reads it,
//! and plots; controllers have no port for it.

use crate::cone::{caster, check_bodies, check_told};
use crate::wire::body_poses;
use component::context::{NodeContext, StepContext};
use component::messages::{BodyStates, Clearance, PlantState, Vector3 as VectorMessage};
use component::{Component, Info, InputPorts, Message, OutputPorts, StepError};
use diagnostics::parameter::{ParameterError, not_negative};
use nalgebra::Vector3;
use scenes::{BodyPose, RayCaster};
use std::f64::consts::{PI, TAU};
use std::path::PathBuf;

/// Distance within which walls are searched, m.
const REACH_M: f64 = 1000.0;

/// Nearer to the world's origin than this no laps are counted, m.
const MIDDLE_M: f64 = 0.5;

/// Parameters of the clearance node.
#[derive(Debug, Clone, PartialEq, component::Parameters)]
#[parameters(default)]
pub struct Parameters {
    /// Scene file, relative to the manifest.
    #[parameter(shown = "required", file = scenes::FILE)]
    pub scene: Option<PathBuf>,
    /// Distance from the wall that is to be kept.
    #[parameter(default = 3.0, check = not_negative)]
    pub keep_m: f64,
    /// Along a side, the wall ahead and the wall behind are at least this much farther than `keep_m`.
    #[parameter(default = 0.75, check = not_negative)]
    pub corner_m: f64,
}

/// State of the component.
#[derive(Debug, Clone, Copy, Default, Message)]
#[repr(C)]
#[message(type_name = "hummingbus_msgs/msg/ClearanceState")]
pub struct ClearanceState {
    /// Bearing of the vehicle from the world's origin at the last tick; not a number before the first.
    #[field(unit = "rad", frame = "world")]
    bearing: f64,
    /// Turns flown clockwise.
    #[field(unit = "1")]
    laps: f64,
}

/// Inputs of the component.
#[derive(Debug, InputPorts)]
pub struct Inputs<'a> {
    /// The truth.
    pub state: &'a PlantState,
    /// Poses of the scene's free bodies; for a scene that has some.
    pub bodies: Option<&'a BodyStates>,
}

/// Outputs of the component.
#[derive(Debug, OutputPorts)]
pub struct Outputs {
    /// The distances.
    pub clearance: Clearance,
}

/// The component `clearance`.
///
/// ```
/// use component::messages::PlantState;
/// use sensors::clearance::{ClearanceJudge, Inputs};
///
/// let scene = concat!(env!("CARGO_MANIFEST_DIR"), "/../scenes/room.toml");
/// let parameters = serde_json::json!({ "scene": scene });
/// let mut judge = component::Harness::<ClearanceJudge>::from_json(&parameters).unwrap();
/// let state = PlantState { position: [0.0, 0.0, 1.0].into(), ..Default::default() };
/// let clearance = judge.step(Inputs { state: &state, bodies: None }).unwrap().clearance;
/// assert!(clearance.nearest > 0.0 && clearance.nearest <= clearance.wall[0], "{clearance:?}");
/// ```
#[derive(Debug)]
pub struct ClearanceJudge {
    caster: RayCaster,
    keep_m: f64,
    corner_m: f64,
}

impl Component for ClearanceJudge {
    const INFO: Info = Info::new("clearance", "true distances to the scene, for judging and plots");
    type Parameters = Parameters;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = ClearanceState;

    fn new(parameters: Parameters, context: &NodeContext<'_>) -> Result<Self, ParameterError> {
        let Parameters { scene, keep_m, corner_m } = parameters;
        let caster = caster(&context.files, scene.as_deref())?;
        check_bodies(&caster, context)?;
        Ok(Self { caster, keep_m, corner_m })
    }

    fn initial(&self) -> ClearanceState {
        ClearanceState { bearing: f64::NAN, laps: 0.0 }
    }

    fn step(
        &self,
        _: &StepContext<'_>,
        inputs: Inputs<'_>,
        state: &mut ClearanceState,
    ) -> Result<Outputs, StepError> {
        check_told(&self.caster, inputs.bodies)?;
        let (poses, count) = body_poses(inputs.bodies);
        Ok(Outputs { clearance: self.clearance(state, &inputs.state.position, &poses[..count]) })
    }
}

impl ClearanceJudge {
    fn clearance(
        &self,
        state: &mut ClearanceState,
        position: &VectorMessage,
        bodies: &[BodyPose],
    ) -> Clearance {
        let position_W_m = Vector3::new(position.x, position.y, position.z);
        let along = [Vector3::x(), -Vector3::x(), Vector3::y(), -Vector3::y()];
        let distance_m = |along_W| self.caster.distance_among_m(bodies, &position_W_m, &along_W, REACH_M);
        let wall = along.map(|along_W| distance_m(along_W).unwrap_or(REACH_M));
        let (x_m, y_m) = (wall[0].min(wall[1]), wall[2].min(wall[3]));
        count_laps(state, &position_W_m);
        Clearance {
            nearest: self.caster.clearance_among_m(bodies, &position_W_m).min(REACH_M),
            wall,
            side_error: x_m.min(y_m) - self.keep_m,
            laps: state.laps,
            corner: u32::from(x_m.max(y_m) < self.keep_m + self.corner_m),
            ..Default::default()
        }
    }
}

/// Adds the turn since the last tick, less than half of one.
fn count_laps(state: &mut ClearanceState, position_W_m: &Vector3<f64>) {
    if libm::hypot(position_W_m.x, position_W_m.y) < MIDDLE_M {
        // There a bearing jumps with every millimetre.
        state.bearing = f64::NAN;
        return;
    }
    let bearing_rad = libm::atan2(position_W_m.y, position_W_m.x);
    if !state.bearing.is_nan() {
        let turn_rad = (bearing_rad - state.bearing + PI).rem_euclid(TAU) - PI;
        state.laps -= turn_rad / TAU;
    }
    state.bearing = bearing_rad;
}

#[cfg(test)]
mod tests {
    use super::*;
    use scenes::Scene;

    fn judge() -> ClearanceJudge {
        let scene = Scene::parse(scenes::reference::ROOM, "room.toml").unwrap();
        ClearanceJudge { caster: RayCaster::new(&scene), keep_m: 3.0, corner_m: 0.75 }
    }

    fn at(x: f64, y: f64) -> Clearance {
        let mut state = ClearanceState { bearing: f64::NAN, laps: 0.0 };
        judge().clearance(&mut state, &VectorMessage { x, y, z: 1.0 }, &[])
    }

    #[test]
    fn a_side_and_a_corner_are_told_apart() {
        let side = at(2.1, 0.5);
        assert_eq!((side.corner, side.wall[0]), (0, 2.9));
        assert!((side.side_error + 0.1).abs() < 1e-12 && (side.nearest - 2.9).abs() < 1e-12);
        assert_eq!(at(2.0, 1.5).corner, 1);
        assert_eq!(at(2.0, -1.2).corner, 0);
    }

    #[test]
    fn two_rounds_clockwise_are_two_laps() {
        let mut state = ClearanceState { bearing: f64::NAN, laps: 0.0 };
        for step in 0..=2000 {
            let angle_rad = -TAU * f64::from(step) / 1000.0;
            let position =
                VectorMessage { x: 2.0 * libm::cos(angle_rad), y: 2.0 * libm::sin(angle_rad), z: 1.0 };
            judge().clearance(&mut state, &position, &[]);
        }
        assert!((state.laps - 2.0).abs() < 1e-9, "{}", state.laps);
    }
}
