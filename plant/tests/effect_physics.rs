//! Effects against closed forms.
#![allow(non_snake_case, reason = "a trailing _W or _B names the frame a vector is written in, N the newton")]

use crate::common;
use common::{TICK_S, free_body, hummingbird};
use nalgebra::{UnitQuaternion, Vector3};
use plant::effects::{Effect, find};
use plant::{Accelerations, Airframe, AirframeState, NewtonEuler, RigidBody, State};
use vehicles::{MotorModel, Vehicle};

fn effect(name: &str, values: &[f64]) -> Effect {
    let mut effect = find(name).unwrap().neutral();
    effect.values[..values.len()].copy_from_slice(values);
    effect
}

struct Flight {
    model: NewtonEuler,
    effects: AirframeState,
    state: State,
}

impl Flight {
    /// At rest 10 m up, the rotors turning as the command asks of the declared vehicle.
    fn new(vehicle: Vehicle, effects: Vec<Effect>, command: f64) -> Self {
        let state =
            NewtonEuler::new(vehicle.clone(), 1).start(RigidBody::level_at(Vector3::z() * 10.0), command);
        let model = NewtonEuler::flying(Airframe::with_effects(vehicle, effects), 1);
        let carried = model.airframe().initial_state(1, "plant", TICK_S);
        Self { model, effects: carried, state }
    }

    fn hovering(effects: Vec<Effect>) -> Self {
        let vehicle = hummingbird();
        let hover = vehicle.hover_command();
        Self::new(vehicle, effects, hover)
    }

    fn fly(&mut self, command: f64, ticks: usize) {
        for _ in 0..ticks {
            let actuation =
                self.model.airframe().begin_tick(&mut self.effects, &self.state, &[command; 4], TICK_S);
            self.model.advance(&mut self.state, actuation, TICK_S);
        }
    }

    /// Returns its accelerations now, once a tick has begun.
    fn accelerations(&mut self) -> Accelerations {
        let hover = hummingbird().hover_command();
        let actuation = self.model.airframe().begin_tick(&mut self.effects, &self.state, &[hover; 4], TICK_S);
        self.model.accelerations_under(actuation, &self.state)
    }
}

#[test]
fn parasitic_drag_limits_the_fall_to_the_terminal_velocity() {
    let mut flight = Flight::new(free_body(), vec![effect("parasitic-drag", &[0.0, 0.02])], 1.0);
    let terminal_m_s = (0.480_f64 * 9.81 / 0.02).sqrt();
    flight.fly(1.0, 2_000);
    // v = v_t tanh(g t / v_t), from rest.
    let exact_m_s = terminal_m_s * libm::tanh(9.81 * 2.0 / terminal_m_s);
    assert!((flight.state.body.velocity_W_m_s.z + exact_m_s).abs() < 1e-9);
}

#[test]
fn rotor_drag_pushes_back_with_c_w_v_and_the_wind_pushes_too() {
    let drag = effect("rotor-drag", &[8e-5]);
    let mut flight = Flight::hovering(vec![drag]);
    flight.state.body.velocity_W_m_s = Vector3::new(2.0, -1.0, 5.0);
    let speed_rad_s = flight.state.rotors[0].speed_rad_s;
    let force_N = flight.accelerations().specific_force_B_m_s2 * 0.480;
    let expected_N = Vector3::new(-2.0, 1.0, 0.0) * (4.0 * 8e-5 * speed_rad_s);
    assert!((force_N.xy() - expected_N.xy()).norm() < 1e-12);
    // Standing in the opposite wind is the same.
    let mut still = Flight::hovering(vec![effect("wind", &[-2.0, 1.0, -5.0]), drag]);
    assert!((still.accelerations().specific_force_B_m_s2 * 0.480 - force_N).norm() < 1e-12);
}

#[test]
fn a_yawing_vehicle_is_braked_at_its_hubs() {
    let mut flight = Flight::hovering(vec![effect("rotor-drag", &[8e-5])]);
    flight.state.body.angular_velocity_B_rad_s.z = 3.0;
    let brake_N_m = 4.0 * 8e-5 * flight.state.rotors[0].speed_rad_s * 0.17 * 0.17 * 3.0;
    assert!((flight.accelerations().angular_acceleration_B_rad_s2.z + brake_N_m / 8.1e-3).abs() < 1e-9);
}

#[test]
fn climbing_costs_thrust_and_flying_sideways_gains_some() {
    let lift_N = |velocity_W_m_s: Vector3<f64>| {
        let mut flight = Flight::hovering(vec![effect("translational-lift", &[2e-4, 3e-3])]);
        flight.state.body.velocity_W_m_s = velocity_W_m_s;
        flight.accelerations().specific_force_B_m_s2.z * 0.480
    };
    let (weight_N, speed_rad_s) = (0.480 * 9.81, hummingbird().hover_speed_rad_s());
    assert!((lift_N(Vector3::z()) - (weight_N - 4.0 * 2e-4 * speed_rad_s)).abs() < 1e-9);
    assert!((lift_N(Vector3::new(3.0, 0.0, 0.0)) - (weight_N + 4.0 * 3e-3 * 9.0)).abs() < 1e-9);
}

#[test]
fn flapping_pushes_back_and_turns_the_nose_up() {
    let mut flight = Flight::hovering(vec![effect("blade-flapping", &[5e-3, 0.2])]);
    flight.state.body.velocity_W_m_s = Vector3::x() * 2.0;
    let motion = flight.accelerations();
    assert!((motion.specific_force_B_m_s2.x + 9.81 * 0.01).abs() < 1e-9, "thrust tilted back by 0.01 rad");
    assert!((motion.angular_acceleration_B_rad_s2.y + 4.0 * 0.2 * 0.01 / 5.6e-3).abs() < 1e-9, "nose up");
    assert!(motion.angular_acceleration_B_rad_s2.xz().norm() < 1e-9);
}

#[test]
fn a_velocity_torque_turns_the_vehicle_away_from_its_motion_through_the_air() {
    let mut flight = Flight::hovering(vec![effect("velocity-torque", &[3e-3, 4e-3])]);
    flight.state.body.velocity_W_m_s = Vector3::new(2.0, 1.0, 3.0);
    let motion = flight.accelerations();
    let expected = Vector3::new(3e-3, -4e-3 * 2.0, 0.0) / 5.6e-3;
    assert!((motion.angular_acceleration_B_rad_s2 - expected).norm() < 1e-9, "{motion:?}");
    assert!((motion.specific_force_B_m_s2 - Vector3::z() * 9.81).norm() < 1e-9, "a torque alone: {motion:?}");
    let headwind = effect("wind", &[-2.0, -1.0, 0.0]);
    let still = Flight::hovering(vec![headwind, effect("velocity-torque", &[3e-3, 4e-3])]).accelerations();
    assert!((still.angular_acceleration_B_rad_s2 - expected).norm() < 1e-9, "as in a wind: {still:?}");
}

#[test]
fn under_rate_damping_each_rate_fades_with_its_own_time_constant() {
    for axis in 0..3 {
        let inertia_kg_m2 = free_body().inertia_kg_m2[(axis, axis)];
        let mut values = [0.0; 3];
        values[axis] = 2.0 * inertia_kg_m2;
        let mut flight = Flight::new(free_body(), vec![effect("rate-damping", &values)], 1.0);
        flight.state.body.angular_velocity_B_rad_s[axis] = 2.0;
        flight.fly(1.0, 1_000);
        let left_rad_s = flight.state.body.angular_velocity_B_rad_s;
        let expected_rad_s = Vector3::ith(axis, 2.0 * libm::exp(-2.0));
        assert!((left_rad_s - expected_rad_s).norm() < 1e-9, "axis {axis}: {left_rad_s}");
    }
}

#[test]
fn a_radius_above_the_ground_thrust_is_a_fifteenth_more() {
    let mut flight = Flight::hovering(vec![effect("ground-effect", &[1.0, 0.1016])]);
    flight.state.body.position_W_m.z = 0.1016;
    assert!((flight.accelerations().specific_force_B_m_s2.z / 9.81 - 16.0 / 15.0).abs() < 1e-9);
    // The lower side of a tilted vehicle is lifted more: it is levelled.
    flight.state.body.attitude_WB = UnitQuaternion::from_euler_angles(0.1, 0.0, 0.0);
    assert!(flight.accelerations().angular_acceleration_B_rad_s2.x < -0.1);
}

#[test]
fn a_heavy_vehicle_sinks_and_a_strong_one_climbs() {
    let z_m_s2 = |name: &str, error: f64| {
        Flight::hovering(vec![effect(name, &[error])]).accelerations().specific_force_B_m_s2.z
    };
    assert!((z_m_s2("mass-error", 0.1) - 9.81 / 1.1).abs() < 1e-9);
    assert!((z_m_s2("thrust-scale", 0.1) - 9.81 * 1.1).abs() < 1e-9);
}

#[test]
fn thrust_behind_the_centre_of_mass_lowers_the_nose_and_a_weak_rotor_drops() {
    let acceleration =
        |effect: Effect| Flight::hovering(vec![effect]).accelerations().angular_acceleration_B_rad_s2;
    let weight_N = 0.480 * 9.81;
    let ahead = acceleration(effect("com-offset", &[0.01, 0.0, 0.0]));
    assert!((ahead - Vector3::y() * (weight_N * 0.01 / 5.6e-3)).norm() < 1e-9, "{ahead}");
    // The second rotor is the right one: without half of it, the left side goes up no more, the right side down.
    let weak = acceleration(effect("weak-rotor", &[0.0, 0.5, 0.0, 0.0]));
    assert!((weak - Vector3::x() * (weight_N / 8.0 * 0.17 / 5.6e-3)).norm() < 1e-9, "{weak}");
}

#[test]
fn inertia_and_gyroscopic_torque_scale() {
    let mut flight = Flight::hovering(vec![
        effect("inertia-error", &[0.25, 0.0, 0.0]),
        effect("gyroscopic-torque", &[-1.0]),
    ]);
    let vehicle = flight.model.vehicle();
    assert!((vehicle.inertia_kg_m2[(0, 0)] - 7e-3).abs() < 1e-15 && vehicle.inertia_kg_m2[(1, 1)] == 5.6e-3);
    // With two of the four rotors off, their angular momentum does not cancel.
    flight.state.rotors[0].speed_rad_s = 0.0;
    flight.state.rotors[2].speed_rad_s = 0.0;
    flight.state.body.angular_velocity_B_rad_s = Vector3::x();
    assert_eq!(flight.accelerations().angular_acceleration_B_rad_s2.y, 0.0);
}

#[test]
fn a_torque_coefficient_scales_the_yaw_and_nothing_else() {
    let accelerations = |error: f64| {
        let mut flight = Flight::hovering(vec![effect("torque-scale", &[error])]);
        // The two that are left turn one way.
        flight.state.rotors[0].speed_rad_s = 0.0;
        flight.state.rotors[2].speed_rad_s = 0.0;
        flight.accelerations()
    };
    let (declared, more) = (accelerations(0.0), accelerations(0.5));
    let yaw_rad_s2 = |found: &Accelerations| found.angular_acceleration_B_rad_s2.z;
    assert!(yaw_rad_s2(&declared).abs() > 0.1, "{declared:?}");
    assert!((yaw_rad_s2(&more) - 1.5 * yaw_rad_s2(&declared)).abs() < 1e-12, "{declared:?} {more:?}");
    assert_eq!(more.specific_force_B_m_s2, declared.specific_force_B_m_s2);
    assert_eq!(more.angular_acceleration_B_rad_s2.xy(), declared.angular_acceleration_B_rad_s2.xy());
}

#[test]
fn a_slower_motor_is_the_same_motor_in_slower_time() {
    let flown = Flight::hovering(vec![effect("motor-lag", &[1.0, -0.5])]);
    let MotorModel::SecondOrder { natural_frequency_rad_s, damping_ratio } = flown.model.vehicle().motor
    else {
        panic!("the Hummingbird's motor is of second order")
    };
    let MotorModel::SecondOrder { natural_frequency_rad_s: declared_rad_s, damping_ratio: declared } =
        hummingbird().motor
    else {
        panic!("the Hummingbird's motor is of second order")
    };
    assert_eq!((natural_frequency_rad_s, damping_ratio), (declared_rad_s / 2.0, declared / 2.0));
}

#[test]
fn a_steeper_command_map_keeps_hover_and_doubles_what_a_change_of_the_command_makes() {
    let declared = hummingbird();
    let steeper = Flight::hovering(vec![effect("command-slope", &[1.0])]);
    let vehicle = steeper.model.vehicle();
    let (hover, hover_rad_s) = (declared.hover_command(), declared.hover_speed_rad_s());
    for counts in [-40.0, -10.0, 0.0, 10.0, 40.0] {
        let speed = |vehicle: &Vehicle| vehicle.commanded_speed_rad_s(0, hover + counts) - hover_rad_s;
        assert!((speed(vehicle) - 2.0 * speed(&declared)).abs() < 1e-9, "{counts}");
    }
    assert_eq!(vehicle.commanded_speed_rad_s(0, declared.command.min), 0.0, "the line goes on to standstill");
}

#[test]
fn a_loaded_battery_sags_and_empties_as_ohm_and_coulomb_say() {
    // R, D, q_0, U_0, C, eta.
    let mut flight = Flight::hovering(vec![effect("battery-sag", &[0.05, 2.0, 0.1, 12.6, 7560.0, 0.7])]);
    let battery = flight.model.airframe().battery(&flight.effects, &flight.state).unwrap();
    let speed_rad_s = flight.state.rotors[0].speed_rad_s;
    let power_W = 4.0 * flight.model.vehicle().torque_coefficient * speed_rad_s.powi(3) / 0.7;
    assert!((battery.voltage_V * battery.current_A - power_W).abs() < 1e-9);
    assert!((battery.voltage_V - (12.6 - 2.0 * 0.1 - 0.05 * battery.current_A)).abs() < 1e-9);
    assert_eq!(battery.charge, 0.9);
    let hover = hummingbird().hover_command();
    flight.fly(hover, 1);
    let target_rad_s = speed_rad_s * battery.voltage_V / 12.6;
    assert!((flight.effects.actuation.targets_rad_s[0] - target_rad_s).abs() < 1e-9);
    let after = flight.model.airframe().battery(&flight.effects, &flight.state).unwrap();
    assert!((battery.charge - after.charge - battery.current_A * TICK_S / 7560.0).abs() < 1e-12);
}

#[test]
fn a_battery_that_cannot_give_the_power_gives_what_it_can() {
    let flight = Flight::hovering(vec![effect("battery-sag", &[1.0, 0.0, 0.0, 12.6, 7560.0, 0.7])]);
    let battery = flight.model.airframe().battery(&flight.effects, &flight.state).unwrap();
    assert_eq!((battery.voltage_V, battery.current_A), (6.3, 6.3));
    assert!(Flight::hovering(Vec::new()).model.airframe().battery(&flight.effects, &flight.state).is_none());
}

/// The speed follows the measured voltage by its power, and not that of the model.
#[test]
fn a_measured_voltage_takes_the_place_of_the_models() {
    let declared = hummingbird();
    let (hover, hover_rad_s) = (declared.hover_command(), declared.hover_speed_rad_s());
    // R, D, q_0, U_0, C, eta, p.
    let targets = |exponent: f64, measured_V: Option<f64>| {
        let sagging = effect("battery-sag", &[0.05, 2.0, 0.9, 12.6, 7560.0, 0.7, exponent]);
        let mut flight = Flight::hovering(vec![sagging]);
        flight.effects.measured_voltage_V = measured_V;
        flight.fly(hover, 1);
        let battery = flight.model.airframe().battery(&flight.effects, &flight.state).unwrap();
        (flight.effects.actuation.targets_rad_s[0], battery.voltage_V)
    };
    for (exponent, factor) in [(0.0, 1.0), (0.5, 0.5_f64.sqrt()), (1.0, 0.5), (2.0, 0.25)] {
        let (target_rad_s, voltage_V) = targets(exponent, Some(6.3));
        assert!((target_rad_s - factor * hover_rad_s).abs() < 1e-9, "{exponent}: {target_rad_s}");
        assert_eq!(voltage_V, 6.3);
    }
    let (modelled_rad_s, voltage_V) = targets(2.0, None);
    assert!((10.0..11.0).contains(&voltage_V), "{voltage_V}");
    let factor = modelled_rad_s / hover_rad_s;
    assert!((factor.sqrt() - voltage_V / 12.6).abs() < 1e-3, "{factor}");
}

#[test]
fn the_full_battery_has_as_many_cells_as_its_greatest_voltage_takes() {
    let law = find("battery-sag").unwrap().voltage_law.unwrap();
    let parameters = find("battery-sag").unwrap().parameters;
    assert_eq!(
        (parameters[law.exponent].name, parameters[law.nominal].name),
        ("exponent", "nominal_voltage")
    );
    for (greatest_V, full_V) in
        [(3.6, 4.2), (4.25, 4.2), (8.3, 8.4), (11.1, 12.6), (12.6, 12.6), (16.2, 16.8)]
    {
        assert!(((law.full_V)(greatest_V) - full_V).abs() < 1e-9, "{greatest_V}");
    }
}

#[test]
fn a_vehicle_hung_below_its_bearing_swings_with_the_pendulums_period() {
    let (moment_kg_m, added_kg_m2) = (0.02, 1e-3);
    let mut flight = Flight::new(free_body(), vec![effect("rig-pendulum", &[moment_kg_m, added_kg_m2])], 1.0);
    let angle_rad = 0.01;
    flight.state.body.attitude_WB = UnitQuaternion::from_euler_angles(angle_rad, 0.0, 0.0);
    let frequency_rad_s = (9.81 * moment_kg_m / (5.6e-3 + added_kg_m2)).sqrt();
    for tick in 1..=2_000 {
        flight.fly(1.0, 1);
        let exact_rad = angle_rad * libm::cos(frequency_rad_s * f64::from(tick) * TICK_S);
        let roll_rad = flight.state.body.attitude_WB.euler_angles().0;
        // A swing of 0.01 rad lasts (0.01)^2 / 16 longer than a small one.
        assert!((roll_rad - exact_rad).abs() < 1e-5, "{roll_rad} {exact_rad}");
    }
}

#[test]
fn dry_friction_stops_a_rotation_and_viscous_friction_lets_it_fade() {
    let rate_after = |coulomb: f64, viscous: f64, ticks: usize| {
        let mut flight = Flight::new(free_body(), vec![effect("bearing-friction", &[coulomb, viscous])], 1.0);
        flight.state.body.angular_velocity_B_rad_s.z = 2.0;
        flight.fly(1.0, ticks);
        flight.state.body.angular_velocity_B_rad_s.z
    };
    assert!((rate_after(0.0, 0.0081, 1_000) - 2.0 * libm::exp(-1.0)).abs() < 1e-9);
    // c / J = 1 rad/s^2: half the way after a second, and standing after 2.5 of them.
    assert!((rate_after(0.0081, 0.0, 1_000) - 1.0).abs() < 2e-3);
    assert!(rate_after(0.0081, 0.0, 2_500).abs() < 1e-3);
}

/// Friction about one axis: in a ball joint its share of the rate, in a gimbal the whole.
#[test]
fn a_gimbal_rubs_about_each_axis_by_itself_and_a_ball_joint_against_the_vector() {
    let torque = |effect: Effect| {
        let mut flight = Flight::new(free_body(), vec![effect], 1.0);
        flight.state.body.angular_velocity_B_rad_s = Vector3::new(3.0, -4.0, 0.0);
        let turning = flight.accelerations().angular_acceleration_B_rad_s2;
        free_body().inertia_kg_m2 * turning
    };
    let free = torque(effect("bearing-friction", &[0.0, 0.0]));
    let ball = torque(effect("bearing-friction", &[0.01, 0.0])) - free;
    assert!((ball - Vector3::new(-0.006, 0.008, 0.0)).norm() < 1e-5, "{ball}");
    let gimbal = torque(effect("gimbal-friction", &[0.01, 0.02, 0.03])) - free;
    assert!((gimbal - Vector3::new(-0.01, 0.02, 0.0)).norm() < 1e-5, "{gimbal}");
    let viscous = torque(effect("gimbal-friction", &[0.0, 0.0, 0.0, 0.001, 0.002, 0.003])) - free;
    assert!((viscous - Vector3::new(-0.003, 0.008, 0.0)).norm() < 1e-9, "{viscous}");
}
