//! Promises of every effect of the catalogue.
#![allow(non_snake_case, reason = "a trailing _W or _B names the frame a vector is written in")]

use crate::common;
use crate::skipped::drawn;
use common::{TICK_S, crazyflie, hummingbird};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use plant::effects::FlightCondition;
use plant::effects::{Action, CATALOGUE, Effect, EffectKind, Values, find};
use plant::saved::{Reader, Saved, Writer};
use plant::{Airframe, AirframeState, NewtonEuler, RigidBody, RotorState, State, Wrench};
use proptest::prelude::*;
use std::collections::BTreeSet;
use vehicles::Vehicle;

/// The names that files and identifications use; they are part of the file format.
const NAMES: &[&str] = &[
    "rotor-drag",
    "parasitic-drag",
    "translational-lift",
    "blade-flapping",
    "velocity-torque",
    "rate-damping",
    "ground-effect",
    "ground-turbulence",
    "wind",
    "turbulence",
    "command-delay",
    "motor-lag",
    "command-slope",
    "battery-sag",
    "weak-rotor",
    "thrust-scale",
    "mass-error",
    "com-offset",
    "inertia-error",
    "torque-scale",
    "gyroscopic-torque",
    "rig-pendulum",
    "bearing-friction",
    "gimbal-friction",
];

/// Those that know neither where up is nor where the ground is, so that the laboratory may be turned at will.
const FREE_OF_THE_VERTICAL: [&str; 9] = [
    "rotor-drag",
    "parasitic-drag",
    "translational-lift",
    "blade-flapping",
    "velocity-torque",
    "rate-damping",
    "weak-rotor",
    "bearing-friction",
    "gimbal-friction",
];

#[test]
fn the_catalogue_has_the_names_that_files_use() {
    let known: Vec<_> = CATALOGUE.iter().map(|kind| kind.name).collect();
    assert_eq!(known, NAMES, "a new effect stands in the list of this test too");
    let unique: BTreeSet<_> = known.iter().collect();
    assert_eq!(unique.len(), known.len(), "two effects of one name: {known:?}");
    assert!(CATALOGUE.iter().all(|kind| find(kind.name) == Some(*kind)));
    assert!(find("no-such-effect").is_none());
}

#[test]
fn the_page_of_effects_is_the_catalogues() {
    let page = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/effects.md")).unwrap();
    let hint = "write it anew: hummingbus effects --markdown >docs/effects.md";
    assert!(page == plant::effects::page::markdown(), "{hint}");
}

#[test]
fn every_specification_is_whole() {
    for spec in CATALOGUE.iter().flat_map(|kind| kind.parameters) {
        assert!(spec.min < spec.max && (spec.min..=spec.max).contains(&spec.nominal), "{spec:?}");
        assert!(spec.neutral.is_none_or(|neutral| (spec.min..=spec.max).contains(&neutral)), "{spec:?}");
        assert_eq!(spec.dimension.units[0].1, 1.0, "{spec:?}: its first unit has to be that of the SI");
        assert!(!spec.meaning.is_empty() && !spec.nominal_source.is_empty(), "{spec:?}");
    }
    for kind in CATALOGUE {
        assert!(!kind.parameters.is_empty() && !kind.actions.is_empty(), "{}", kind.name);
        let texts = [kind.summary, kind.equation, kind.source, kind.validity];
        assert!(texts.iter().all(|text| !text.is_empty()), "{}", kind.name);
    }
}

/// Sum of the model without an effect and of what it adds: the model with it.
#[test]
fn an_effect_that_only_adds_adds_the_difference_of_the_models() {
    let vehicle = hummingbird();
    let body = RigidBody {
        velocity_W_m_s: Vector3::new(3.0, -2.0, 1.0),
        attitude_WB: UnitQuaternion::from_euler_angles(0.3, -0.2, 1.0),
        angular_velocity_B_rad_s: Vector3::new(0.5, -0.7, 0.9),
        // So near the ground that its effect acts.
        ..RigidBody::level_at(Vector3::z() * 0.2)
    };
    let rotors = plant::PerRotor::from([400.0, 450.0, 420.0, 380.0]).map(RotorState::steady);
    let state = State { body, rotors };
    let plain = NewtonEuler::new(vehicle.clone(), 1);
    let adding: Vec<Effect> =
        CATALOGUE.iter().filter(|kind| kind.only_adds()).map(|kind| kind.nominal()).collect();
    assert!(adding.len() > 6, "{adding:?}");
    for effect in adding {
        let with = NewtonEuler::flying(Airframe::with_effects(vehicle.clone(), vec![effect]), 1);
        let expected = with.accelerations(&state).less(&plain.accelerations(&state));
        let condition = FlightCondition::new(&vehicle, &state, &Vector3::zeros());
        let apart = plain.accelerations_added(&effect, &condition).less(&expected);
        let name = effect.kind.name;
        assert!(apart.specific_force_B_m_s2.norm() < 1e-12, "{name}: {apart:?}");
        assert!(apart.angular_acceleration_B_rad_s2.norm() < 1e-11, "{name}: {apart:?}");
        let acts = expected.specific_force_B_m_s2.norm() + expected.angular_acceleration_B_rad_s2.norm();
        assert!(acts > 1e-4, "{name} does nothing here");
    }
}

/// A flight with the effects it is given, tick by tick.
struct Flight {
    model: NewtonEuler,
    effects: AirframeState,
    state: State,
}

impl Flight {
    fn new(vehicle: Vehicle, effects: &[Effect], state: State) -> Self {
        let model = NewtonEuler::flying(Airframe::with_effects(vehicle, effects.to_vec()), 1);
        let carried = model.airframe().initial_state(5, "plant", TICK_S);
        Self { model, effects: carried, state }
    }

    fn tick(&mut self, commands: &[f64]) {
        let actuation = self.model.airframe().begin_tick(&mut self.effects, &self.state, commands, TICK_S);
        self.model.advance(&mut self.state, actuation, TICK_S);
    }

    /// Commands that swing about hover, each with a rhythm of its own.
    fn swing(&mut self, ticks: std::ops::Range<u32>) {
        let hover = hummingbird().hover_command();
        for tick in ticks {
            let part = |period: u32| f64::from(tick % period) / f64::from(period) - 0.5;
            self.tick(&[part(40), part(31), part(27), part(15)].map(|part| hover * (1.0 + 0.3 * part)));
        }
    }
}

/// Low, tilted, turning, moving, the rotors unequal: where every effect has something to act on.
fn lively() -> State {
    let mut body = RigidBody::level_at(Vector3::new(0.5, -0.3, 0.3));
    body.velocity_W_m_s = Vector3::new(2.0, -1.5, 0.7);
    body.attitude_WB = UnitQuaternion::new_normalize(Quaternion::new(0.95, 0.15, -0.2, 0.1));
    body.angular_velocity_B_rad_s = Vector3::new(0.8, -0.6, 0.9);
    State { body, rotors: [380.0, 410.0, 430.0, 400.0].map(RotorState::steady).into() }
}

fn end(effects: &[Effect]) -> State {
    let mut flight = Flight::new(hummingbird(), effects, lively());
    flight.swing(0..300);
    flight.state
}

/// An effect, and behind it those that feel the air and push sideways at the hubs.
fn with_drag(effect: Option<Effect>) -> Vec<Effect> {
    let drag = ["rotor-drag", "parasitic-drag"].map(|name| find(name).unwrap().nominal());
    let is_other = |drag: &Effect| effect.is_none_or(|effect| effect.kind.name != drag.kind.name);
    effect.into_iter().chain(drag.into_iter().filter(is_other)).collect()
}

#[test]
fn with_neutral_parameters_an_effect_does_nothing_to_the_last_bit() {
    let (declared, with_drag_alone) = (end(&[]), end(&with_drag(None)));
    for kind in CATALOGUE {
        assert_eq!(end(&[kind.neutral()]), declared, "{}", kind.name);
        if !["rotor-drag", "parasitic-drag"].contains(&kind.name) {
            assert_eq!(end(&with_drag(Some(kind.neutral()))), with_drag_alone, "{}", kind.name);
        }
    }
}

#[test]
fn every_parameter_of_every_effect_matters() {
    for kind in CATALOGUE {
        let nominal = end(&with_drag(Some(kind.nominal())));
        for (i, spec) in kind.parameters_for(&hummingbird()).iter().enumerate() {
            let mut changed = kind.nominal();
            changed.values[i] = 0.5 * (spec.nominal + spec.max);
            assert!(end(&with_drag(Some(changed))) != nominal, "{}.{} does nothing", kind.name, spec.name);
        }
    }
}

/// Each loss weakens the rotor of its number alone, also of twelve.
#[test]
fn each_of_twelve_rotors_has_a_loss_of_its_own() {
    let rotors = [(); 3].iter().flat_map(|()| hummingbird().rotors).collect();
    let vehicle = Vehicle { rotors, ..hummingbird() };
    let state = State { rotors: [RotorState::steady(400.0); 12].into(), ..lively() };
    let kind = find("weak-rotor").unwrap();
    assert_eq!(kind.parameters_for(&vehicle).len(), 12);
    let thrusts = |effect: Effect| {
        let mut flight = Flight::new(vehicle.clone(), &[effect], state);
        flight.tick(&[76.5; 12]);
        flight.state.body.angular_velocity_B_rad_s
    };
    let sound = thrusts(kind.neutral());
    for rotor in 0..12 {
        let mut weak = kind.neutral();
        weak.values[rotor] = 0.5;
        let turn = thrusts(weak) - sound;
        // Less thrust at the arm: the vehicle begins to turn towards the weak rotor.
        let arm = vehicle.rotors[rotor].position_m;
        let towards = Vector3::z().cross(&arm);
        assert!(turn.xy().dot(&towards.xy()) > 0.0, "rotor {}: {turn:?} {arm:?}", rotor + 1);
    }
}

#[test]
fn effects_of_the_same_flight_are_the_same_and_another_seed_is_another_gust() {
    let all: Vec<Effect> = CATALOGUE.iter().map(|kind| kind.nominal()).collect();
    assert_eq!(end(&all), end(&all));
    let mut flight = Flight::new(hummingbird(), &all, lively());
    flight.effects = flight.model.airframe().initial_state(6, "plant", TICK_S);
    flight.swing(0..300);
    assert!(flight.state != end(&all));
}

#[test]
fn a_state_of_effects_written_down_and_read_back_goes_on_to_the_same_bits() {
    let all: Vec<Effect> = CATALOGUE.iter().map(|kind| kind.nominal()).collect();
    let mut flight = Flight::new(hummingbird(), &all, lively());
    flight.swing(0..123);
    let mut written = vec![0; flight.effects.size()];
    flight.effects.save(&mut Writer::new(&mut written));
    let mut restored = Flight::new(hummingbird(), &all, flight.state);
    restored.effects.load(&mut Reader::new(&written)).unwrap();
    assert_eq!(restored.effects, flight.effects);
    flight.swing(123..600);
    restored.swing(123..600);
    assert_eq!(restored.state, flight.state);
    assert_eq!(restored.effects, flight.effects);
}

#[test]
fn a_delayed_flight_is_the_flight_of_the_delayed_commands() {
    let delay = find("command-delay").unwrap().with(|_| 0.030);
    let (mut delayed, mut plain) =
        (Flight::new(hummingbird(), &[delay], lively()), Flight::new(hummingbird(), &[], lively()));
    let commands = |tick: u32| [70.0, 75.0, 80.0, 85.0].map(|count| count + f64::from(tick * 7 % 11));
    for tick in 0..200 {
        delayed.tick(&commands(tick));
        plain.tick(&commands(tick.saturating_sub(30)));
        assert_eq!(delayed.state, plain.state, "tick {tick}");
    }
}

fn vector(range: f64) -> impl Strategy<Value = Vector3<f64>> {
    prop::array::uniform3(-range..range).prop_map(Vector3::from)
}

fn attitude() -> impl Strategy<Value = UnitQuaternion<f64>> {
    let length = |numbers: &[f64; 4]| numbers.iter().map(|x| x * x).sum::<f64>();
    let numbers =
        prop::array::uniform4(-1.0..1.0).prop_filter("a direction", move |numbers| length(numbers) > 0.01);
    numbers.prop_map(|[w, x, y, z]| UnitQuaternion::new_normalize(Quaternion::new(w, x, y, z)))
}

prop_compose! {
    fn state()(
        position_W_m in vector(50.0),
        velocity_W_m_s in vector(20.0),
        attitude_WB in attitude(),
        angular_velocity_B_rad_s in vector(15.0),
        speeds in prop::array::uniform4(-50.0..1500.0),
    ) -> State {
        let body = RigidBody { position_W_m, velocity_W_m_s, attitude_WB, angular_velocity_B_rad_s };
        State { body, rotors: speeds.map(RotorState::steady).into() }
    }
}

/// The effect with every parameter at a share (0...1) of the way between its bounds.
fn between_bounds(kind: &'static EffectKind, shares: &[f64]) -> Effect {
    let mut effect = kind.neutral();
    for ((value, spec), share) in effect.values.iter_mut().zip(kind.parameters).zip(shares) {
        *value = spec.min + share * (spec.max - spec.min);
    }
    effect
}

/// Parameters of any effect within its bounds, the bounds themselves as likely as what is between.
fn shares() -> impl Strategy<Value = Vec<f64>> {
    prop::collection::vec(prop_oneof![Just(0.0), Just(1.0), 0.0..1.0], 6)
}

fn wrench(effect: &Effect, situation: &FlightCondition) -> Wrench {
    let mut sum = Wrench::default();
    for action in effect.kind.actions {
        if let Action::Wrench(wrench) = action {
            sum += wrench(&effect.values, situation);
        }
    }
    sum
}

/// Force, torque and changes of thrust.
fn answer(effect: &Effect, situation: &FlightCondition) -> Vec<f64> {
    let wrench = wrench(effect, situation);
    let mut numbers: Vec<f64> = wrench.force_B_N.iter().chain(wrench.torque_B_N_m.iter()).copied().collect();
    for action in effect.kind.actions {
        if let Action::Thrust(thrust) = action {
            numbers.extend((0..4).map(|rotor| thrust(&effect.values, situation, rotor)));
        }
    }
    numbers
}

/// The same situation in a laboratory that is turned and set up elsewhere.
fn turned(state: &State, turn: &UnitQuaternion<f64>, shift_W_m: Vector3<f64>) -> State {
    let body = RigidBody {
        position_W_m: turn * state.body.position_W_m + shift_W_m,
        velocity_W_m_s: turn * state.body.velocity_W_m_s,
        attitude_WB: turn * state.body.attitude_WB,
        ..state.body
    };
    State { body, ..*state }
}

fn require_same(
    effect: &Effect,
    one: &FlightCondition,
    other: &FlightCondition,
) -> Result<(), TestCaseError> {
    for (one, other) in answer(effect, one).into_iter().zip(answer(effect, other)) {
        let slack = 1e-9 * (1.0 + one.abs());
        prop_assert!((one - other).abs() < slack, "{}: {one} and {other}", effect.kind.name);
    }
    Ok(())
}

fn power_W(wrench: &Wrench, situation: &FlightCondition) -> f64 {
    wrench.force_B_N.dot(&situation.airspeed_B_m_s)
        + wrench.torque_B_N_m.dot(&situation.angular_velocity_B_rad_s)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: drawn(120, 300), failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn whatever_its_parameters_an_effect_is_finite(
        shares in shares(),
        state in state(),
        air_W_m_s in vector(30.0),
        commands in prop::array::uniform4(-10.0..250.0),
    ) {
        for (kind, vehicle) in CATALOGUE.iter().flat_map(|kind| [(kind, hummingbird()), (kind, crazyflie())]) {
            let effect = between_bounds(kind, &shares);
            let answer = answer(&effect, &FlightCondition::new(&vehicle, &state, &air_W_m_s));
            prop_assert!(answer.iter().all(|number| number.is_finite()), "{}: {answer:?}", kind.name);
            let airframe = Airframe::with_effects(vehicle, vec![effect]);
            let mut carried = airframe.initial_state(1, "plant", TICK_S);
            for _ in 0..5 {
                let actuation = airframe.begin_tick(&mut carried, &state, &commands, TICK_S);
                prop_assert!(actuation.targets_rad_s.iter().all(|target| target.is_finite()), "{}", kind.name);
                prop_assert!(actuation.thrust_deviation.iter().all(|part| part.is_finite()), "{}", kind.name);
                prop_assert!(actuation.air_velocity_W_m_s.iter().all(|speed| speed.is_finite()), "{}", kind.name);
            }
        }
    }

    #[test]
    fn all_effects_together_fly_on_finitely(shares in shares()) {
        let effects: Vec<Effect> = CATALOGUE.iter().map(|kind| between_bounds(kind, &shares)).collect();
        // Deviations of a single moment of inertia are refused where files are read.
        let effects = effects.into_iter().filter(|effect| effect.kind.name != "inertia-error").collect::<Vec<_>>();
        let mut flight = Flight::new(hummingbird(), &effects, lively());
        flight.swing(0..100);
        prop_assert!(flight.state.body.position_W_m.iter().all(|x| x.is_finite()), "{:?}", flight.state);
        prop_assert!(flight.state.rotors.iter().all(|rotor| rotor.speed_rad_s.is_finite()));
    }

    #[test]
    fn a_laboratory_turned_about_the_vertical_changes_nothing(
        shares in shares(),
        state in state(),
        air_W_m_s in vector(10.0),
        yaw in -3.0..3.0,
        shift in vector(20.0),
    ) {
        let vehicle = hummingbird();
        let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), yaw);
        let state_turned = turned(&state, &turn, Vector3::new(shift.x, shift.y, 0.0));
        for kind in CATALOGUE {
            let effect = between_bounds(kind, &shares);
            let one = FlightCondition::new(&vehicle, &state, &air_W_m_s);
            require_same(&effect, &one, &FlightCondition::new(&vehicle, &state_turned, &(turn * air_W_m_s)))?;
        }
    }

    #[test]
    fn effects_free_of_the_vertical_stand_any_turn(
        shares in shares(),
        state in state(),
        air_W_m_s in vector(10.0),
        turn in attitude(),
        shift in vector(20.0),
    ) {
        let vehicle = hummingbird();
        let state_turned = turned(&state, &turn, shift);
        for name in FREE_OF_THE_VERTICAL {
            let effect = between_bounds(find(name).unwrap(), &shares);
            let one = FlightCondition::new(&vehicle, &state, &air_W_m_s);
            require_same(&effect, &one, &FlightCondition::new(&vehicle, &state_turned, &(turn * air_W_m_s)))?;
        }
    }

    #[test]
    fn drag_and_friction_take_energy_and_never_give_any(
        shares in shares(),
        state in state(),
        air_W_m_s in vector(10.0),
    ) {
        let vehicle = hummingbird();
        let situation = FlightCondition::new(&vehicle, &state, &air_W_m_s);
        for name in ["rotor-drag", "parasitic-drag", "rate-damping", "bearing-friction", "gimbal-friction"] {
            let wrench = wrench(&between_bounds(find(name).unwrap(), &shares), &situation);
            prop_assert!(power_W(&wrench, &situation) <= 0.0, "{name}");
        }
        // The hub's torque of a flapping rotor may work on a turning body; its force may not.
        let still = FlightCondition { angular_velocity_B_rad_s: Vector3::zeros(), ..situation };
        let flapping = wrench(&between_bounds(find("blade-flapping").unwrap(), &shares), &still);
        prop_assert!(power_W(&flapping, &still) <= 0.0);
    }

    #[test]
    fn ground_effect_falls_with_height_and_is_gone_far_above(
        shares in shares(),
        low_m in 0.0..5.0,
        step_m in 0.01..5.0,
    ) {
        let vehicle = hummingbird();
        let effect = between_bounds(find("ground-effect").unwrap(), &shares);
        let at = |height_m: f64| {
            let body = RigidBody::level_at(Vector3::z() * height_m);
            let state = State { body, rotors: [RotorState::steady(400.0); 4].into() };
            answer(&effect, &FlightCondition::new(&vehicle, &state, &Vector3::zeros()))[6]
        };
        let (low, high, far) = (at(low_m), at(low_m + step_m), at(1000.0));
        prop_assert!(low >= high && high >= far && far >= 0.0, "{low} {high} {far}");
        prop_assert!(far < 1e-6, "{far} N a kilometre up");
    }
}

/// Draws of an effect's own numbers while the vehicle stands still at a height.
fn lags(name: &str, values: Values, height_m: f64, dt_s: f64, ticks: usize) -> Vec<plant::Actuation> {
    let effect = Effect { kind: find(name).unwrap(), values };
    let airframe = Airframe::with_effects(hummingbird(), vec![effect]);
    let mut carried = airframe.initial_state(3, "plant", dt_s);
    let body = RigidBody::level_at(Vector3::z() * height_m);
    let state = State { body, rotors: [RotorState::steady(400.0); 4].into() };
    (0..ticks).map(|_| *airframe.begin_tick(&mut carried, &state, &[76.5; 4], dt_s)).collect()
}

/// Standard deviation, and the autocorrelation after `lag` samples.
fn spread(samples: &[f64], lag: usize) -> (f64, f64) {
    let mean_square = samples.iter().map(|x| x * x).sum::<f64>() / samples.len() as f64;
    let pairs = samples.iter().zip(&samples[lag..]).map(|(a, b)| a * b).sum::<f64>();
    (mean_square.sqrt(), pairs / (samples.len() - lag) as f64 / mean_square)
}

#[test]
fn turbulence_has_the_strength_and_length_of_the_specification() {
    // At 30.48 m, 100 feet, in a wind of 10 m/s: the bounds are six standard deviations of the estimates.
    let (dt_s, ticks) = (0.1, 400_000);
    let actuations = lags("turbulence", common::values([10.0]), 30.48, dt_s, ticks);
    let shape: f64 = 0.177 + 0.0823;
    for (axis, sigma_m_s, length_m) in [
        (0, 1.0 / libm::pow(shape, 0.4), 30.48 / libm::pow(shape, 1.2)),
        (1, 1.0 / libm::pow(shape, 0.4), 30.48 / libm::pow(shape, 1.2)),
        (2, 1.0, 30.48),
    ] {
        let samples: Vec<f64> =
            actuations.iter().map(|actuation| actuation.air_velocity_W_m_s[axis]).collect();
        let time_s = length_m / 10.0;
        let (sigma, correlation) = spread(&samples, (time_s / dt_s) as usize);
        let draws = ticks as f64 * dt_s / (2.0 * time_s);
        assert!(
            (sigma / sigma_m_s - 1.0).abs() < 6.0 / (2.0 * draws).sqrt(),
            "axis {axis}: {sigma} {sigma_m_s}"
        );
        assert!((correlation - libm::exp(-1.0)).abs() < 6.0 / draws.sqrt(), "axis {axis}: {correlation}");
    }
}

#[test]
fn turbulence_near_the_ground_fades_with_height_and_differs_between_rotors() {
    let values = common::values([0.1, 0.3, 0.05]);
    let sigma = |height_m: f64| {
        let actuations = lags("ground-turbulence", values, height_m, TICK_S, 200_000);
        spread(&actuations.iter().map(|actuation| actuation.thrust_deviation[0]).collect::<Vec<_>>(), 50)
    };
    let ((ground, correlation), (above, _)) = (sigma(0.0), sigma(0.6));
    assert!(
        (ground - 0.1).abs() < 0.01 && (correlation - libm::exp(-1.0)).abs() < 0.1,
        "{ground} {correlation}"
    );
    assert!((above / ground - libm::exp(-2.0)).abs() < 1e-9, "the same draws, weaker: {above} {ground}");
    let actuations = lags("ground-turbulence", values, 0.0, TICK_S, 200_000);
    let product = |a: usize, b: usize| {
        actuations
            .iter()
            .map(|actuation| actuation.thrust_deviation[a] * actuation.thrust_deviation[b])
            .sum::<f64>()
            / 200_000.0
    };
    assert!(product(0, 1).abs() < 0.1 * product(0, 0) && product(2, 3).abs() < 0.1 * product(0, 0));
}
