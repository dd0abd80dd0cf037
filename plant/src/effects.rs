//! The effects: named pieces of physics beyond the declared vehicle, for simulating and for identifying.
//!
//! An effect is a set of pure functions of its parameters and the situation of the vehicle. The plant sums the
//! effects that the vehicle file and the scene file list, in that order; an identification evaluates the same
//! functions on measured states and fits their parameters.
//!
//! | room | what it holds |
//! |---|---|
//! | [`situation`] | what the functions of effects are functions of |
//! | [`entry`] | what files list, checked against the catalogue |
//! | [`page`] | the catalogue as a page of documentation |
//! | `drag` | rotor drag, parasitic drag |
//! | `inflow` | translational lift, blade flapping |
//! | `ground` | ground effect, turbulence near the ground |
//! | `air` | wind, turbulence |
//! | `actuation` | command delay, motor lag, weak rotors, thrust |
//! | [`battery`] | voltage that sags |
//! | `mass` | mass, centre of mass, inertia |
//! | `rig` | what a test rig adds |

mod actuation;
mod air;
pub mod battery;
mod drag;
pub mod entry;
mod ground;
mod inflow;
mod mass;
pub mod page;
mod rig;
pub mod situation;

use crate::airframe::Drive;
use crate::memory::Remembered;
use crate::rotor::Wrench;
use diagnostics::unit::Dimension;
use situation::Situation;
use vehicles::Vehicle;

/// The most parameters that an effect has.
pub const PARAMETERS_MAX: usize = 6;

/// The parameters of an effect in SI, in the order of its specification; zeros behind the last one.
pub type Values = [f64; PARAMETERS_MAX];

/// An effect as the catalogue knows it.
#[derive(Debug)]
pub struct EffectKind {
    /// What files call it.
    pub name: &'static str,
    /// What it does, in one line.
    pub summary: &'static str,
    /// Its equation, in the symbols of its parameters.
    pub equation: &'static str,
    /// Where the equation is from.
    pub source: &'static str,
    /// Where it holds, and what it leaves out.
    pub validity: &'static str,
    /// Its parameters.
    pub parameters: &'static [ParameterSpec],
    /// What it acts on.
    pub actions: &'static [Action],
}

/// One parameter of an effect.
#[derive(Debug)]
pub struct ParameterSpec {
    /// What files call it.
    pub name: &'static str,
    /// What it means, with its symbol.
    pub meaning: &'static str,
    /// Its units; bounds and values are in the first, which is that of the SI.
    pub dimension: Dimension,
    /// The least that it may be.
    pub lower: f64,
    /// The most that it may be.
    pub upper: f64,
    /// The value that it has where a file leaves it out. With all of these the effect is nothing. `None` where
    /// none is more natural than another: a file has to give it, and the effect is nothing whatever it is.
    pub neutral: Option<f64>,
    /// A plausible value.
    pub typical: f64,
    /// Where the plausible value is from.
    pub typical_source: &'static str,
}

/// What an effect acts on. All but the state of [`Action::Tick`] are pure functions.
#[derive(Debug, Clone, Copy)]
pub enum Action {
    /// Changes what the vehicle is, once, before it flies.
    Vehicle(fn(&Values, &mut Vehicle)),
    /// Delays the motor commands by so many seconds.
    Delay(fn(&Values) -> f64),
    /// Advances what the effect remembers by a tick, and changes what acts over the tick.
    Tick(fn(&Values, &mut Advance)),
    /// Adds so many newtons to the thrust of a rotor.
    Thrust(fn(&Values, &Situation, usize) -> f64),
    /// Adds a force and a torque.
    Wrench(fn(&Values, &Situation) -> Wrench),
}

/// What an effect sees and changes when a tick begins.
#[derive(Debug)]
pub struct Advance<'a> {
    /// The vehicle at the beginning of the tick, in the air as the effects before this one moved it.
    pub situation: Situation<'a>,
    /// What acts over the tick.
    pub drive: &'a mut Drive,
    /// What the effect carries from tick to tick.
    pub remembered: &'a mut Remembered,
    /// Length of the tick.
    pub dt_s: f64,
}

/// An effect with its parameters.
#[derive(Debug, Clone, Copy)]
pub struct Effect {
    /// Which.
    pub kind: &'static EffectKind,
    /// Its parameters in SI.
    pub values: Values,
}

/// All effects.
pub static CATALOGUE: [&EffectKind; 19] = [
    &drag::ROTOR_DRAG,
    &drag::PARASITIC_DRAG,
    &inflow::TRANSLATIONAL_LIFT,
    &inflow::BLADE_FLAPPING,
    &ground::GROUND_EFFECT,
    &ground::GROUND_TURBULENCE,
    &air::WIND,
    &air::TURBULENCE,
    &actuation::COMMAND_DELAY,
    &actuation::MOTOR_LAG,
    &battery::BATTERY_SAG,
    &actuation::WEAK_ROTOR,
    &actuation::THRUST_SCALE,
    &mass::MASS_ERROR,
    &mass::COM_OFFSET,
    &mass::INERTIA_ERROR,
    &mass::GYROSCOPIC_TORQUE,
    &rig::RIG_PENDULUM,
    &rig::BEARING_FRICTION,
];

/// The effect that files call `name`.
#[must_use]
pub fn find(name: &str) -> Option<&'static EffectKind> {
    CATALOGUE.into_iter().find(|kind| kind.name == name)
}

impl EffectKind {
    /// The effect with neutral parameters, and plausible ones where none is neutral: it does nothing.
    #[must_use]
    pub fn neutral(&'static self) -> Effect {
        self.with(|spec| spec.neutral.unwrap_or(spec.typical))
    }

    /// The effect with plausible parameters.
    #[must_use]
    pub fn typical(&'static self) -> Effect {
        self.with(|spec| spec.typical)
    }

    /// The effect with a value for each of its parameters.
    #[must_use]
    pub fn with(&'static self, value: impl Fn(&ParameterSpec) -> f64) -> Effect {
        let values = std::array::from_fn(|i| self.parameters.get(i).map_or(0.0, &value));
        Effect { kind: self, values }
    }
}
