//! The facts of an effect: its physics, its parameters, and how it can be seen in measured flights.

use super::condition::FlightCondition;
use crate::actuation::{Actuation, Battery};
use crate::airframe_state::EffectState;
use crate::rotor::Wrench;
use diagnostics::unit::Dimension;
use vehicles::{ROTORS_MAX, Vehicle};

/// The most parameters that an effect has.
pub const PARAMETERS_MAX: usize = ROTORS_MAX;

/// The parameters of an effect in SI, in the order of its specification; zeros behind the last one. Effects read them
/// by name, see [`effect_parameters!`](crate::effect_parameters).
pub type Values = [f64; PARAMETERS_MAX];

/// An effect as the catalogue knows it. It is the same as another only if it is the very same static.
#[derive(Debug)]
pub struct EffectKind {
    /// Its name in files.
    pub name: &'static str,
    /// Its summary, in one line.
    pub summary: &'static str,
    /// Its equation, in the symbols of its parameters.
    pub equation: &'static str,
    /// Source of the equation.
    pub source: &'static str,
    /// Its range of validity, and what it leaves out.
    pub validity: &'static str,
    /// Its parameters.
    pub parameters: &'static [ParameterSpec],
    /// Its actions on the simulation.
    pub actions: &'static [Action],
    /// Quantities that have to be measured for it to show.
    pub needs: &'static [Quantity],
    /// First stage that has to be computed anew when one of its parameters changes.
    pub stage: Stage,
    /// Its use of random numbers, which no fit could follow.
    pub randomness: Randomness,
    /// Parts of it that make sense alone.
    pub fit_as: FitAs,
    /// True if it shows in the mean forces and torques of a flight, and can be told there from all other effects.
    pub steady_state: bool,
    /// True if it turns the vehicle steadily, so that it can explain a trim.
    pub turns_steadily: bool,
    /// True if its parameters shift a signal in time: then the flight's grid limits how small a value can be seen.
    pub is_delay: bool,
    /// True if it changes how the rotors follow their commands.
    pub changes_drive: bool,
    /// True if equations linearised about the neutral values predict what it can explain.
    pub is_linear: bool,
    /// Initial guesses of a fit, each a value for each parameter that has a neutral one. If there are none, it starts at the
    /// neutral values.
    pub guesses: &'static [&'static [f64]],
    /// Fits nominal values, which are a Hummingbird's, to a vehicle of another size.
    pub scale_to: Option<fn(&Vehicle, &mut Values)>,
    /// Greatest plausible value of each parameter for a vehicle, where that depends on its size. A fit goes no further; a file may state
    /// more, up to the bound.
    pub plausible_max: Option<fn(&Vehicle) -> f64>,
    /// Law by which the rotors follow the voltage of the battery, where that is measured.
    pub voltage_law: Option<VoltageLaw>,
    /// Effects that look like it, and how to tell them apart. Each pair stands with one of the two.
    pub confounded_with: &'static [Confounder],
    /// Requirement on the vehicle that it acts on, if it has one.
    pub require: Option<Requirement>,
    /// True if it moves the air, which takes an effect that feels the air to be seen.
    pub moves_air: bool,
    /// True if its parameters are one for each rotor: those behind the vehicle's last rotor have to be neutral.
    pub is_per_rotor: bool,
}

/// Law by which the rotors follow a measured voltage of the battery, by parameters of its effect.
#[derive(Debug, Clone, Copy)]
pub struct VoltageLaw {
    /// Place of the exponent among the parameters. At 0 a measured voltage changes nothing.
    pub exponent: usize,
    /// Place of the voltage at which the declared command map holds.
    pub nominal: usize,
    /// The full voltage of a battery whose greatest measured voltage is the argument. It counts where no file declares one.
    pub full_V: fn(f64) -> f64,
}

/// A condition on the vehicle that an effect acts on; the error describes it in words.
pub type Requirement = fn(&Vehicle) -> Result<(), &'static str>;

/// One parameter of an effect.
#[derive(Debug)]
pub struct ParameterSpec {
    /// Its name in files.
    pub name: &'static str,
    /// Its meaning, with its symbol.
    pub meaning: &'static str,
    /// Its units; bounds and values are in the first, which is that of the SI.
    pub dimension: Dimension,
    /// The least that it may be.
    pub min: f64,
    /// The most that it may be.
    pub max: f64,
    /// The value that it has where a file leaves it out. With all of these the effect does nothing. `None`
    /// where no value is neutral: a file has to give it, and at any value the effect does nothing if the others
    /// are neutral.
    pub neutral: Option<f64>,
    /// A plausible value.
    pub nominal: f64,
    /// Source of the plausible value.
    pub nominal_source: &'static str,
}

/// Action of an effect. All but the state of [`Action::Tick`] are pure functions.
#[derive(Debug, Clone, Copy)]
pub enum Action {
    /// Changes the vehicle, once, before it flies.
    Vehicle(fn(&Values, &mut Vehicle)),
    /// Delays the motor commands by so many seconds.
    Delay(fn(&Values) -> f64),
    /// Advances the effect's state by a tick, and changes the actuation over the tick.
    Tick(fn(&Values, &mut Advance)),
    /// Adds so many newtons to the thrust of a rotor.
    Thrust(fn(&Values, &FlightCondition, usize) -> f64),
    /// Adds a force and a torque.
    Wrench(fn(&Values, &FlightCondition) -> Wrench),
    /// Returns the state of the battery under these speeds of the rotors.
    Battery(fn(&Values, &EffectState, &Vehicle, &[f64]) -> Battery),
}

/// Arguments of an effect's function when a tick begins.
#[derive(Debug)]
pub struct Advance<'a> {
    /// The vehicle at the beginning of the tick, in the air as the effects before this one moved it.
    pub condition: FlightCondition<'a>,
    /// Actuation over the tick.
    pub actuation: &'a mut Actuation,
    /// State that the effect carries from tick to tick.
    pub state: &'a mut EffectState,
    /// Voltage at the terminals of the battery, if it is measured.
    pub measured_voltage_V: Option<f64>,
    /// Length of the tick.
    pub dt_s: f64,
}

/// Quantity that a flight must have measured for an effect to show.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quantity {
    /// Forces: by position, velocity or specific force.
    Force,
    /// Torques: by attitude or angular velocity.
    Torque,
    /// The velocity through the air, in the body.
    Airspeed,
    /// The height above the ground.
    Height,
    /// The attitude.
    Attitude,
    /// The motor commands.
    Command,
    /// A rig that holds the vehicle. The joints of a scene's rig have by themselves what such an effect models.
    Rig,
    /// Two clocks that can be held against each other.
    TwoClocks,
    /// Reading of the accelerometer.
    SpecificForce,
    /// The same rotation by gyroscope and by attitude.
    TwoRotations,
    /// The direction of forces according to the attitude, and a measured one.
    TwoDirections,
    /// An inertial unit.
    InertialUnit,
    /// A pose.
    Pose,
    /// The speeds of the rotors.
    RotorSpeed,
    /// A rig that is declared or that the attitude shows, or else the speeds of the rotors.
    KnownRig,
}

/// Stage that has to be computed anew when a parameter changes; the later stages follow from the earlier ones.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stage {
    /// Times at which samples were taken.
    Sampling,
    /// Response of the rotors to the commands.
    Rotors,
    /// Forces, torques, and the sensors' readings of them.
    Body,
}

/// Use of random numbers by an effect.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Randomness {
    /// A function of parameters and flight.
    Deterministic,
    /// It draws from a stream of its own: no fit can follow it, and its residual is unexplained.
    Stochastic,
}

/// Parts of an effect that are candidates by themselves.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FitAs {
    /// Its parameters together, as one candidate.
    Whole,
    /// Each of its parameters, as a candidate.
    EachParameter,
}

/// An effect that looks like another on some flights.
#[derive(Debug)]
pub struct Confounder {
    /// The other effect.
    pub effect: &'static EffectKind,
    /// The experiment that distinguishes the two.
    pub experiment: &'static str,
}

/// An effect with its parameters.
///
/// ```
/// use plant::effects::find;
///
/// let wind = find("wind").unwrap();
/// let breeze = wind.with(|parameter| if parameter.name == "x" { 3.0 } else { 0.0 });
/// assert_eq!((breeze.kind.name, breeze.values[0], wind.parameters[0].unit()), ("wind", 3.0, "m/s"));
/// ```
#[derive(Debug, Clone, Copy)]
pub struct Effect {
    /// Its kind.
    pub kind: &'static EffectKind,
    /// Its parameters in SI.
    pub values: Values,
}

impl Effect {
    /// The force and the torque that it adds under `condition`; nothing of what else it may change.
    pub(crate) fn added_wrench(&self, condition: &FlightCondition<'_>) -> Wrench {
        let mut sum = Wrench::default();
        for action in self.kind.actions {
            match action {
                Action::Wrench(wrench) => sum += wrench(&self.values, condition),
                Action::Thrust(added_N) => {
                    for (at, rotor) in condition.vehicle.rotors.iter().enumerate() {
                        let force_B_N = rotor.axis * added_N(&self.values, condition, at);
                        sum += Wrench::at(&rotor.position_m, force_B_N);
                    }
                }
                Action::Vehicle(_) | Action::Delay(_) | Action::Tick(_) | Action::Battery(_) => {}
            }
        }
        sum
    }
}

impl Quantity {
    /// Describes the channels that it is measured by, and their purpose.
    #[must_use]
    pub fn describe(self) -> &'static str {
        match self {
            Self::Force => "position, velocity or specific force: something that shows forces",
            Self::Torque => "attitude or angular velocity: something that shows torques",
            Self::Airspeed => "position or velocity, together with attitude: the velocity through the air",
            Self::Height => "position: the height above the ground",
            Self::Attitude => "attitude",
            Self::Command => "motor commands",
            Self::Rig => "a rig: these flights move freely",
            Self::TwoClocks => "gyroscope and attitude, or else commands, to be late against",
            Self::SpecificForce => "specific force, for the accelerometer's",
            Self::TwoRotations => "attitude and angular velocity, for the gyroscope's",
            Self::TwoDirections => "attitude with position, velocity or specific force, for the attitude's",
            Self::InertialUnit => "an inertial unit, for its own",
            Self::Pose => "attitude or position, for the pose's",
            Self::RotorSpeed => {
                "rotor speeds: torques that follow from commands alone are late by unknown times, which passes for a damping"
            }
            Self::KnownRig => {
                "`rig = true` or rotor speeds, where no attitude shows the rig: torques that follow from commands alone are late by \
                 unknown times, which passes for a friction"
            }
        }
    }
}

impl PartialEq for EffectKind {
    fn eq(&self, other: &Self) -> bool {
        std::ptr::eq(self, other)
    }
}

impl EffectKind {
    /// Defaults of an effect, to be completed by texts, parameters, actions and needs: a deterministic, near linear
    /// effect on forces and torques that is fitted as a whole.
    pub const PLAIN: Self = Self {
        name: "",
        summary: "",
        equation: "",
        source: "",
        validity: "",
        parameters: &[],
        actions: &[],
        needs: &[],
        stage: Stage::Body,
        randomness: Randomness::Deterministic,
        fit_as: FitAs::Whole,
        steady_state: false,
        turns_steadily: false,
        is_delay: false,
        changes_drive: false,
        is_linear: true,
        guesses: &[],
        scale_to: None,
        plausible_max: None,
        voltage_law: None,
        confounded_with: &[],
        require: None,
        moves_air: false,
        is_per_rotor: false,
    };

    /// The effect with neutral parameters, and nominal ones where none is neutral: it does nothing.
    #[must_use]
    pub fn neutral(&'static self) -> Effect {
        self.with(|spec| spec.neutral.unwrap_or(spec.nominal))
    }

    /// True if it adds forces and torques, which are functions of the flight condition alone, and changes nothing else.
    ///
    /// ```
    /// use plant::effects::find;
    ///
    /// assert!(find("rotor-drag").unwrap().only_adds());
    /// assert!(!find("mass-error").unwrap().only_adds(), "it changes the vehicle");
    /// assert!(!find("wind").unwrap().only_adds(), "it moves the air");
    /// ```
    #[must_use]
    pub fn only_adds(&self) -> bool {
        let adds = |action: &Action| matches!(action, Action::Thrust(_) | Action::Wrench(_));
        !self.actions.is_empty() && self.actions.iter().all(adds)
    }

    /// The parameters that mean something for `vehicle`: of those that are one for each rotor, as many as it has.
    #[must_use]
    pub fn parameters_for(&self, vehicle: &Vehicle) -> &'static [ParameterSpec] {
        let count = if self.is_per_rotor { vehicle.rotors.len() } else { self.parameters.len() };
        &self.parameters[..count.min(self.parameters.len())]
    }

    /// The greatest value that a fit may give a parameter for `vehicle`: the plausible one within the bound.
    ///
    /// ```
    /// use plant::effects::find;
    /// use vehicles::{Vehicle, reference::HUMMINGBIRD};
    ///
    /// let drag = find("parasitic-drag").unwrap();
    /// let mut vehicle = Vehicle::parse(HUMMINGBIRD, "hummingbird.toml")?;
    /// assert_eq!(drag.most(&drag.parameters[0], &vehicle), 0.1);
    /// vehicle.rotors.iter_mut().for_each(|rotor| rotor.position_m *= 2.0);
    /// assert_eq!(drag.most(&drag.parameters[0], &vehicle), 0.4, "four times the area");
    /// # Ok::<(), diagnostics::Diagnostic>(())
    /// ```
    #[must_use]
    pub fn most(&self, spec: &ParameterSpec, vehicle: &Vehicle) -> f64 {
        self.plausible_max.map_or(spec.max, |plausible_max| plausible_max(vehicle).min(spec.max))
    }

    /// The effect with neutral parameters, and those that fit `vehicle` where none is neutral.
    #[must_use]
    pub fn neutral_for(&'static self, vehicle: &Vehicle) -> Effect {
        let mut effect = self.neutral();
        if let Some(scale_to) = self.scale_to {
            scale_to(vehicle, &mut effect.values);
        }
        effect
    }

    /// The effect with nominal parameters.
    #[must_use]
    pub fn nominal(&'static self) -> Effect {
        self.with(|spec| spec.nominal)
    }

    /// The experiment that distinguishes it from `other`, if the two look alike.
    #[must_use]
    pub fn experiment_against(&self, other: &Self) -> Option<&'static str> {
        let found = |one: &Self, other: &Self| {
            one.confounded_with.iter().find(|pair| pair.effect == other).map(|pair| pair.experiment)
        };
        found(self, other).or_else(|| found(other, self))
    }

    /// The effect with a value for each of its parameters.
    #[must_use]
    pub fn with(&'static self, value: impl Fn(&ParameterSpec) -> f64) -> Effect {
        let values = std::array::from_fn(|i| self.parameters.get(i).map_or(0.0, &value));
        Effect { kind: self, values }
    }
}

impl ParameterSpec {
    /// The unit of the SI that bounds and values are in.
    #[must_use]
    pub fn unit(&self) -> &'static str {
        self.dimension.units.first().map_or("1", |(unit, _)| unit)
    }
}
