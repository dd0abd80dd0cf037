//! Parameters that identification may change: those of all candidate effects, in one list.
//!
//! Effects of the plant's catalogue and those of sensors carry their bounds and neutral values with them. Stochastic
//! effects are not candidates, since no fit can follow their course: the residual that they cause is reported as
//! unexplained.

use crate::data::logged_voltage::LoggedVoltage;
use crate::data::sensing::SensorErrors;
use crate::model::flight_wind::FLIGHT_WIND;
use crate::model::sensor_effects::{
    ACCELEROMETER_BIAS, ATTITUDE_BIAS, GYROSCOPE_BIAS, IMU_DELAY, POSE_DELAY, SENSOR_EFFECTS,
};
use plant::effects::{CATALOGUE, Effect, EffectKind, ParameterSpec, Randomness, Values, WIND};
use vehicles::Vehicle;

/// One number that may be fitted.
#[derive(Debug, Clone)]
pub struct Parameter {
    /// The effect.
    pub kind: &'static EffectKind,
    /// Its place among the effect's parameters.
    pub index: usize,
    /// The value of the baseline model.
    pub baseline: f64,
    /// Size of a plausible change from the neutral value.
    pub scale: f64,
    /// A change that is small and yet well above rounding.
    pub step: f64,
    /// The greatest value of a fit: that of its specification, or the greatest plausible one for a vehicle of this size.
    pub max: f64,
    /// Number of the fit flight whose wind deviates by it; `None` if it acts on all flights.
    pub flight: Option<usize>,
}

/// Parameters of all candidates, and the values of the plant's effects that are not fitted.
#[derive(Debug, Clone)]
pub struct Parameters {
    /// The parameters.
    pub all: Vec<Parameter>,
    /// The plant's effects as the baseline has them: one for each effect of the catalogue.
    baseline: Vec<Effect>,
    /// Effects that the baseline vehicle has.
    declared: Vec<&'static EffectKind>,
}

impl Parameters {
    /// The parameters of all candidates for `vehicle`, which has the effects `declared`. Parameters without a neutral
    /// value are not fitted: they are those of `declared`, or fit the vehicle's size.
    pub fn of(vehicle: &Vehicle, declared: &[Effect]) -> Self {
        Self::of_flights(vehicle, declared, &LoggedVoltage::default())
    }

    /// The same for flights that have logged these voltages of the battery.
    pub fn of_flights(vehicle: &Vehicle, declared: &[Effect], voltage: &LoggedVoltage) -> Self {
        let as_declared = |kind: &&'static EffectKind| {
            let effect = declared.iter().find(|effect| effect.kind == *kind).copied();
            effect.unwrap_or_else(|| voltage.undeclared(kind.neutral_for(vehicle)))
        };
        let baseline: Vec<Effect> = CATALOGUE.iter().map(as_declared).collect();
        let of_sensors = SENSOR_EFFECTS.map(EffectKind::neutral);
        let candidates = baseline.iter().chain(&of_sensors);
        let all = candidates
            .filter(|effect| effect.kind.randomness == Randomness::Deterministic)
            .flat_map(|effect| of_effect(effect, vehicle))
            .filter(|parameter| voltage.determines(parameter.kind, parameter.index))
            .collect();
        Self { all, baseline, declared: declared.iter().map(|effect| effect.kind).collect() }
    }

    /// Adds the deviations of the winds of so many flights. That of the first follows from the others.
    pub fn add_winds(&mut self, vehicle: &Vehicle, flights: usize) {
        let of_flight = |flight: usize| {
            let deviation = of_effect(&FLIGHT_WIND.neutral(), vehicle).into_iter();
            deviation.map(move |entry| Parameter { flight: Some(flight), ..entry })
        };
        self.all.extend((1..flights).flat_map(of_flight));
    }

    /// The places of the wind that all flights share, by axis.
    pub fn wind(&self) -> Vec<usize> {
        (0..self.all.len()).filter(|at| *self.all[*at].kind == WIND).collect()
    }

    /// The places of the level part of that wind: x and y.
    pub fn level_wind(&self) -> [usize; 2] {
        let wind = self.wind();
        [wind[0], wind[1]]
    }

    /// The parameter at `at` as it acts on the fit flight of this number: the place of the one that is moved by it, and the factor between both;
    /// `None` if it does not act there.
    pub fn acting(&self, at: usize, flight: Option<usize>) -> Option<(usize, f64)> {
        let entry = &self.all[at];
        let Some(of) = entry.flight else { return Some((at, 1.0)) };
        let wind = self.wind()[entry.index];
        match flight {
            Some(0) => Some((wind, -1.0)),
            Some(flight) if flight == of => Some((wind, 1.0)),
            _ => None,
        }
    }

    /// The values of the baseline model.
    pub fn baseline(&self) -> Vec<f64> {
        self.all.iter().map(|parameter| parameter.baseline).collect()
    }

    /// The candidate effects that act on all flights, in the order of the catalogue, those of sensors last.
    pub fn effects(&self) -> Vec<&'static EffectKind> {
        let of_all = self.all.iter().filter(|parameter| parameter.flight.is_none());
        let mut kinds: Vec<&'static EffectKind> = of_all.map(|parameter| parameter.kind).collect();
        kinds.dedup();
        kinds
    }

    /// The numbers of the parameters of `effect`, by its name.
    pub fn of_name(&self, effect: &str) -> Vec<usize> {
        (0..self.all.len()).filter(|i| self.all[*i].kind.name == effect).collect()
    }

    /// The values that the fitted parameters of `kind` have among `values`.
    pub fn values_of(&self, kind: &EffectKind, values: &[f64]) -> Values {
        let mut of_kind = Values::default();
        let pairs = self.all.iter().zip(values).filter(|(parameter, _)| parameter.kind == kind);
        pairs.for_each(|(parameter, value)| of_kind[parameter.index] = *value);
        of_kind
    }

    /// The plant's effects under `values`, in the order of the catalogue: those that were declared and those whose
    /// values are not the baseline's.
    pub fn effects_under(&self, values: &[f64]) -> Vec<Effect> {
        let mut effects = self.baseline.clone();
        let mut is_in: Vec<bool> =
            effects.iter().map(|effect| self.declared.contains(&effect.kind)).collect();
        for (parameter, value) in self.all.iter().zip(values) {
            if let Some(at) = effects.iter().position(|effect| effect.kind == parameter.kind) {
                effects[at].values[parameter.index] = *value;
                #[allow(clippy::float_cmp, reason = "an untouched value is the baseline's, bit for bit")]
                let is_changed = *value != parameter.baseline;
                is_in[at] |= is_changed;
            }
        }
        effects.into_iter().zip(is_in).filter(|(_, is_in)| *is_in).map(|(effect, _)| effect).collect()
    }

    /// The plant's effects under `values` as they act on the fit flight of this number, in its own wind.
    pub fn effects_of(&self, flight: Option<usize>, values: &[f64]) -> Vec<Effect> {
        let mut acting = values.to_vec();
        let deviations = self.all.iter().zip(values).enumerate();
        for (at, (_, value)) in deviations.filter(|(_, (entry, _))| entry.flight.is_some()) {
            if let Some((wind, factor)) = self.acting(at, flight) {
                acting[wind] += factor * value;
            }
        }
        self.effects_under(&acting)
    }

    /// The plant's effect `kind` under `values`.
    ///
    /// # Panics
    /// If it is not in the catalogue.
    pub fn effect_under(&self, kind: &EffectKind, values: &[f64]) -> Effect {
        let baseline = self.baseline.iter().find(|effect| effect.kind == kind);
        let mut effect = *baseline.expect("an effect of the catalogue");
        for (parameter, value) in self.all.iter().zip(values).filter(|(parameter, _)| parameter.kind == kind)
        {
            effect.values[parameter.index] = *value;
        }
        effect
    }
}

impl Parameter {
    /// Returns its specification, with unit and bounds.
    pub fn spec(&self) -> &'static ParameterSpec {
        &self.kind.parameters[self.index]
    }

    /// Its place in the guesses of its effect.
    pub fn guess(&self) -> usize {
        self.kind.parameters[..self.index].iter().filter(|spec| spec.neutral.is_some()).count()
    }

    /// The value within its bounds that is nearest to `wanted`.
    pub fn bounded(&self, wanted: f64) -> f64 {
        wanted.clamp(self.spec().min, self.max)
    }

    /// The bound that `value` has reached, within [`AT_BOUND`]; `None` between the bounds, at a bound that the truth may be, and at one that is
    /// the baseline.
    pub fn reached(&self, value: f64) -> Option<f64> {
        let spec = self.spec();
        let reach = self.reach();
        let is_reached = |bound: &f64| {
            let is_declared = (self.baseline - bound).abs() <= reach;
            (value - bound).abs() <= reach && !is_declared && !may_be_true(spec, *bound)
        };
        [spec.min, self.max].into_iter().find(is_reached)
    }

    /// Distance from a bound within which an estimate has reached it.
    pub fn reach(&self) -> f64 {
        AT_BOUND * self.scale
    }

    /// The limit of its meaning on that side of the baseline on which `value` is; `None` where that bound is a state of a vehicle: no effect, or a
    /// whole share.
    pub fn limit_ahead(&self, value: f64) -> Option<f64> {
        let limit = if value < self.baseline { self.spec().min } else { self.max };
        (!is_state(self.spec(), limit)).then_some(limit)
    }

    /// True if `value` is a bound other than the baseline.
    #[allow(clippy::float_cmp, reason = "values that stop at a bound are the bound")]
    pub fn stops_at(&self, value: f64) -> bool {
        value != self.baseline && (value == self.spec().min || value == self.max)
    }
}

/// A value has reached a bound within this part of a plausible change: a fit may end a small step before the bound.
const AT_BOUND: f64 = 0.01;

/// True for bounds that the truth may be: states of a vehicle, and a quantity that the vehicle does not have (an error of -1). The other
/// bounds are limits of what is plausible.
#[allow(clippy::float_cmp, reason = "bounds are constants")]
fn may_be_true(spec: &ParameterSpec, bound: f64) -> bool {
    is_state(spec, bound) || (spec.unit() == "1" && bound == -1.0)
}

/// True for bounds that are states of a vehicle: no effect, and a whole share.
#[allow(clippy::float_cmp, reason = "bounds are constants")]
fn is_state(spec: &ParameterSpec, bound: f64) -> bool {
    let is_whole_share = spec.unit() == "1" && spec.min == 0.0 && bound == 1.0;
    spec.neutral == Some(bound) || is_whole_share
}

/// The grid cannot see less.
const DELAY_STEP_S: f64 = 0.002;

fn of_effect(effect: &Effect, vehicle: &Vehicle) -> Vec<Parameter> {
    let kind = effect.kind;
    let of_spec = |(index, spec): (usize, &ParameterSpec)| {
        let reach = (spec.nominal - spec.neutral?).abs();
        let scale = if reach == 0.0 { 1.0 } else { reach };
        let step = if kind.is_delay { DELAY_STEP_S } else { scale / 50.0 };
        let baseline = effect.values[index];
        // A file may declare more than is plausible.
        let max = kind.most(spec, vehicle).max(baseline);
        Some(Parameter { kind, index, baseline, scale, step, max, flight: None })
    };
    kind.parameters_for(vehicle).iter().enumerate().filter_map(of_spec).collect()
}

impl SensorErrors {
    /// The errors of the sensors under `values` of the `parameters`.
    pub fn of(parameters: &Parameters, values: &[f64]) -> Self {
        let [pose_delay_s, ..] = parameters.values_of(&POSE_DELAY, values);
        let [inertial_delay_s, ..] = parameters.values_of(&IMU_DELAY, values);
        let [a_x, a_y, a_z, ..] = parameters.values_of(&ACCELEROMETER_BIAS, values);
        let [w_x, w_y, w_z, ..] = parameters.values_of(&GYROSCOPE_BIAS, values);
        let [turn_x, turn_y, ..] = parameters.values_of(&ATTITUDE_BIAS, values);
        Self {
            pose_delay_s,
            inertial_delay_s,
            accelerometer_bias_m_s2: [a_x, a_y, a_z],
            gyroscope_bias_rad_s: [w_x, w_y, w_z],
            attitude_bias_rad: [turn_x, turn_y],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_flights::hummingbird;

    /// The parameter `name` of `effect` of the Hummingbird.
    fn parameter(effect: &str, name: &str) -> Parameter {
        let all = Parameters::of(&hummingbird(), &[]).all;
        let found = all.into_iter().find(|entry| entry.kind.name == effect && entry.spec().name == name);
        found.expect("a parameter of this name")
    }

    #[test]
    fn a_plausible_limit_is_reached_at_it_and_just_before_it() {
        let attitude = parameter("sensor-bias", "attitude_y");
        let [min, max] = [attitude.spec().min, attitude.spec().max];
        assert_eq!([min, min + 1e-4, max].map(|value| attitude.reached(value)), [min, min, max].map(Some));
        assert_eq!([0.9 * min, 0.0, 0.9 * max].map(|value| attitude.reached(value)), [None; 3]);
        assert_eq!(parameter("parasitic-drag", "coefficient_z").reached(0.1), Some(0.1));
        assert_eq!(parameter("mass-error", "error").reached(1.0), Some(1.0));
    }

    /// The area that drags grows with the square of the arms.
    #[test]
    fn the_limit_of_drag_grows_with_the_vehicle() {
        let mut large = hummingbird();
        large.rotors.iter_mut().for_each(|rotor| rotor.position_m *= 2.0);
        let of_large = Parameters::of(&large, &[]).all;
        let drag = of_large.iter().find(|entry| entry.kind.name == "parasitic-drag").expect("a drag");
        assert_eq!((drag.bounded(0.3), drag.bounded(0.5), drag.reached(0.4)), (0.3, 0.4, Some(0.4)));
    }

    #[test]
    fn bounds_that_the_truth_may_be_are_not_reached() {
        let is_reached =
            |effect: &str, name: &str, bound: f64| parameter(effect, name).reached(bound).is_some();
        assert!(!is_reached("gyroscopic-torque", "scale_error", -1.0), "rotors without angular momentum");
        assert!(is_reached("gyroscopic-torque", "scale_error", 4.0));
        assert!(!is_reached("battery-sag", "discharged", 1.0), "an empty battery");
        assert!(is_reached("battery-sag", "internal_resistance", 1.0));
        assert!(!is_reached("rotor-drag", "coefficient", 0.0), "no drag");
        let declared = Parameter { baseline: 8e-5, ..parameter("rotor-drag", "coefficient") };
        assert_eq!(declared.reached(0.0), None, "no drag, where one is declared");
        let declared = Parameter { baseline: 1e-3, ..declared };
        assert_eq!(declared.reached(1e-3), None, "the declared value");
        let drag = plant::effects::find("parasitic-drag").expect("an effect").with(|_| 0.3);
        let declared = Parameters::of(&hummingbird(), &[drag]).all;
        let drag = declared.iter().find(|entry| entry.kind == drag.kind).expect("a drag");
        assert_eq!(drag.bounded(0.4), 0.3, "declared beyond what is plausible");
    }
}
