//! What manifests say of a plant, and the backend that follows.
#![allow(non_snake_case, reason = "a trailing _W names the frame a vector is written in")]

use crate::airframe::Airframe;
use crate::backend::Backend;
use crate::free_flight::FreeFlight;
use crate::newton_euler::NewtonEuler;
use crate::rapier::Rapier;
use crate::state::RigidBody;
use bus::kind::read_parameters;
use nalgebra::{UnitQuaternion, Vector3};
use scenes::Scene;
use serde::Deserialize;
use std::path::PathBuf;
use vehicles::Vehicle;

/// Parameters of the plant.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Parameters {
    /// Vehicle file.
    vehicle: PathBuf,
    /// Scene file; nothing but the ground where it is left out.
    scene: Option<PathBuf>,
    /// What moves the vehicle.
    #[serde(default)]
    pub(crate) backend: BackendName,
    /// Position of the centre of mass at tick 0, in the world.
    #[serde(default)]
    initial_position_m: [f64; 3],
    /// Velocity of the centre of mass at tick 0, in the world.
    #[serde(default)]
    initial_velocity_m_s: [f64; 3],
    /// Heading at tick 0, counter-clockwise from the world's x.
    #[serde(default)]
    initial_yaw_deg: f64,
    /// Integration steps per tick.
    #[serde(default = "one")]
    substeps: u32,
    /// With a `measured` input: time between two settings to the measured state.
    pub(crate) window_s: Option<f64>,
    /// With `rapier`: an impact that is faster is a crash.
    crash_speed_m_s: Option<f64>,
}

/// The backends by name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum BackendName {
    #[default]
    NewtonEuler,
    Rapier,
}

/// What a Hummingbird bears, as far as anybody knows: tuned, no source.
const CRASH_SPEED_M_S: f64 = 1.0;

fn one() -> u32 {
    1
}

/// Refuses what cannot be meant; the words are the wired inputs.
pub(crate) fn check(parameters: &serde_json::Value, inputs: &[&str]) -> Result<(), String> {
    let parameters: Parameters = read_parameters(parameters)?;
    parameters.check_numbers()?;
    parameters.check_inputs(inputs)?;
    // Any stream and tick serve here.
    parameters.backend(0, "", 1e-3).map(|_| ())
}

impl Parameters {
    fn check_numbers(&self) -> Result<(), String> {
        self.check_start()?;
        if self.substeps == 0 {
            return Err("`substeps` is 0, expected at least 1".to_owned());
        }
        if self.window_s.is_some_and(|window_s| !is_positive(window_s)) {
            return Err("`window_s` must be a positive number of seconds".to_owned());
        }
        match self.crash_speed_m_s {
            Some(_) if self.backend == BackendName::NewtonEuler => {
                Err("`crash_speed_m_s` needs `backend` = \"rapier\": free flight touches nothing".to_owned())
            }
            Some(speed_m_s) if !is_positive(speed_m_s) => {
                Err("`crash_speed_m_s` must be a positive number of m/s".to_owned())
            }
            _ => Ok(()),
        }
    }

    fn check_start(&self) -> Result<(), String> {
        let finite = |key: &str, numbers: &[f64]| match numbers.iter().find(|number| !number.is_finite()) {
            Some(number) => Err(format!("`{key}` holds {number}, expected finite numbers")),
            None => Ok(()),
        };
        finite("initial_position_m", &self.initial_position_m)?;
        finite("initial_velocity_m_s", &self.initial_velocity_m_s)?;
        finite("initial_yaw_deg", &[self.initial_yaw_deg])
    }

    fn check_inputs(&self, inputs: &[&str]) -> Result<(), String> {
        if inputs.contains(&"traffic") && self.backend == BackendName::NewtonEuler {
            return Err(
                "the input `traffic` needs `backend` = \"rapier\": free flight meets nobody".to_owned()
            );
        }
        match (inputs.contains(&"measured"), self.window_s) {
            (true, None) => Err("the input `measured` needs the parameter `window_s`".to_owned()),
            (false, Some(_)) => Err("the parameter `window_s` needs the input `measured`".to_owned()),
            _ => Ok(()),
        }
    }

    /// The backend that flies the vehicle, as it is at tick 0, in ticks of `dt_s`; the effects of `node` draw their
    /// random numbers by the run's `seed`.
    pub(crate) fn backend(&self, seed: u64, node: &str, dt_s: f64) -> Result<Box<dyn Backend>, String> {
        let vehicle = Vehicle::load(&self.vehicle).map_err(|error| error.to_string())?;
        let scene = self.scene.as_deref().map(Scene::load).transpose().map_err(|error| error.to_string())?;
        let scene = scene.unwrap_or_default();
        let airframe = Airframe::from_files(vehicle, &scene.effects).map_err(|error| error.to_string())?;
        let memory = airframe.memory(seed, node, dt_s);
        let model = NewtonEuler::flying(airframe, self.substeps);
        match self.backend {
            BackendName::NewtonEuler if scene.rig.is_some() => Err(format!(
                "`scene` \"{}\" holds a rig, which needs `backend` = \"rapier\": newton-euler flies freely",
                scene.name
            )),
            BackendName::NewtonEuler => Ok(Box::new(FreeFlight::new(model, self.start(), memory))),
            BackendName::Rapier => {
                let crash_speed_m_s = self.crash_speed_m_s.unwrap_or(CRASH_SPEED_M_S);
                Ok(Box::new(Rapier::new(model, memory, &scene, &self.start(), crash_speed_m_s)))
            }
        }
    }

    fn start(&self) -> RigidBody {
        RigidBody {
            velocity_W_m_s: self.initial_velocity_m_s.into(),
            attitude_WB: UnitQuaternion::from_axis_angle(
                &Vector3::z_axis(),
                self.initial_yaw_deg.to_radians(),
            ),
            ..RigidBody::level_at(self.initial_position_m.into())
        }
    }
}

fn is_positive(number: f64) -> bool {
    number > 0.0 && number.is_finite()
}
