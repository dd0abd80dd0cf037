//! The vehicle before the first tick, and the physics that moves it from there.

use crate::airframe_state::AirframeState;
use crate::backend::Backend;
use crate::contact_dynamics::Rapier;
use crate::free_flight::FreeFlight;
use crate::newton_euler::NewtonEuler;
use crate::state::RigidBody;
use scenes::Scene;

/// Everything that a plant consists of. It does not change during a run.
pub(crate) struct Origin {
    /// The equations of motion.
    pub model: NewtonEuler,
    /// The state of the effects.
    pub effects: AirframeState,
    /// The surroundings.
    pub scene: Scene,
    /// The vehicle's body.
    pub start: RigidBody,
    /// The backend.
    pub physics: Physics,
}

/// The backend that moves the vehicle.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Physics {
    /// `newton-euler`.
    Free,
    /// `rapier`; a faster impact is a crash.
    Rapier { crash_speed_m_s: f64 },
}

impl Origin {
    /// A flight that starts here.
    pub(crate) fn begin(&self) -> Box<dyn Backend> {
        match self.physics {
            Physics::Free => Box::new(FreeFlight::new(self.model.clone(), self.start, self.effects.clone())),
            Physics::Rapier { crash_speed_m_s } => Box::new(self.begin_in_scene(crash_speed_m_s)),
        }
    }

    /// The same with `rapier`.
    pub(crate) fn begin_in_scene(&self, crash_speed_m_s: f64) -> Rapier {
        let (model, effects) = (self.model.clone(), self.effects.clone());
        Rapier::new(model, effects, &self.scene, &self.start, crash_speed_m_s)
    }
}
