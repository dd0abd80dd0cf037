//! Oddities of a vehicle that may fly all the same: `check` warns of them, with the lines of the file.

use crate::airframe::Airframe;
use crate::airworthy::places;
use crate::arms::{longest_arm, longest_arm_m};
use crate::effects::{Effect, Quantity};
use component::context::NodeContext;
use diagnostics::digits;
use vehicles::{MotorModel, Rotor, Vehicle};

/// Arms above this are odd: the largest multirotors that carry people have 4 to 5 m (Volocopter 2X: 9.15 m across its
/// rotors). Tuned.
const ARM_MAX_M: f64 = 10.0;
/// Rotors nearer to each other than this part of the longest arm are in one place; coaxial ones have a gap. Tuned, no source.
const APART_MIN: f64 = 1e-3;
/// A radius of gyration above this multiple of the longest arm is odd: all parts lie within the arms. Tuned, no
/// source; shipped vehicles have 0.2 to 0.8.
const GYRATION_MAX: f64 = 1.5;
/// One below this multiple is odd: motors are at the ends of the arms. Tuned, no source.
const GYRATION_MIN: f64 = 0.03;
/// Motors with a slower pole are odd: those of multirotors take 0.01 to 0.3 s. Tuned, no source.
const SLOW_MAX_S: f64 = 0.3;

/// An axis that is farther from body z is odd, degrees. Tuned, no source: fully actuated hexacopters tilt their rotors by 20
/// to 30 deg (Rajappa et al., ICRA 2015), tilting ones by more.
const LEAN_MAX_DEG: f64 = 75.0;

/// Warns of everything odd about the vehicle of `airframe` and its effects.
pub(crate) fn tell(airframe: &Airframe, run: &NodeContext<'_>) {
    let vehicle = airframe.vehicle();
    let odd = [
        arms(vehicle),
        one_place(vehicle),
        one_way(vehicle),
        leaning(vehicle),
        inertia(vehicle),
        slow_motors(vehicle),
        unfelt_wind(airframe.effects()),
    ];
    for what in odd.into_iter().flatten() {
        run.warn("vehicle", format!("`vehicle` \"{}\" {what}", vehicle.name));
    }
}

fn arms(vehicle: &Vehicle) -> Option<String> {
    let arm_m = longest_arm_m(vehicle);
    let message = || {
        let number = longest_arm(vehicle);
        let name = vehicle.rotors.get(number).map_or("", |rotor| rotor.name.as_str());
        format!(
            "has arms of {} m, expected at most {ARM_MAX_M} m, longer than those of any multirotor; the longest is that of rotor \
             {number}, \"{name}\"; look at {}",
            digits(arm_m),
            lines(vehicle, &[&format!("rotors.{number}.position")])
        )
    };
    (arm_m > ARM_MAX_M).then(message)
}

fn one_place(vehicle: &Vehicle) -> Option<String> {
    let (rotors, near_m) = (&vehicle.rotors, APART_MIN * longest_arm_m(vehicle));
    let is_one = |a: usize, b: usize| (rotors[a].position_m - rotors[b].position_m).norm() <= near_m;
    let mut pairs = (0..rotors.len()).flat_map(|b| (0..b).map(move |a| (a, b)));
    let (a, b) = pairs.find(|(a, b)| is_one(*a, *b))?;
    let keys = [a, b].map(|rotor| format!("rotors.{rotor}.position"));
    let places = lines(vehicle, &keys.each_ref().map(String::as_str));
    let [a, b] = [a, b].map(|rotor| &rotors[rotor].name);
    Some(format!(
        "has its rotors \"{a}\" and \"{b}\" in one place, expected each in a place of its own; look at {places}"
    ))
}

fn one_way(vehicle: &Vehicle) -> Option<String> {
    let is_one_way = vehicle.rotors.windows(2).all(|pair| pair[0].spin.total_cmp(&pair[1].spin).is_eq());
    let message = || {
        format!(
            "has {} rotors that all turn one way, expected both senses of rotation: their drag turns the vehicle about z; look \
             at {}",
            vehicle.rotors.len(),
            lines(vehicle, &["rotors.0.spin"])
        )
    };
    (is_one_way && vehicle.rotors.len() > 1).then(message)
}

fn leaning(vehicle: &Vehicle) -> Option<String> {
    let lean_deg = |rotor: &Rotor| libm::acos(rotor.axis.z.clamp(-1.0, 1.0)).to_degrees();
    let at = vehicle.rotors.iter().position(|rotor| lean_deg(rotor) > LEAN_MAX_DEG)?;
    let rotor = &vehicle.rotors[at];
    Some(format!(
        "has a rotor \"{}\" whose axis is {:.1} degrees from body z, expected at most {LEAN_MAX_DEG}: it lifts little or \
         nothing; look at {}",
        rotor.name,
        lean_deg(rotor),
        lines(vehicle, &[&format!("rotors.{at}.axis")])
    ))
}

/// Compares the radii of gyration, sqrt(J / m), with the arms.
fn inertia(vehicle: &Vehicle) -> Option<String> {
    let arm_m = longest_arm_m(vehicle);
    let (names, moments) = (["xx", "yy", "zz"], vehicle.inertia_kg_m2.diagonal());
    let is_odd = |axis: &usize| {
        let radius_m = (moments[*axis] / vehicle.mass_kg).sqrt();
        arm_m > 0.0 && !(GYRATION_MIN * arm_m..=GYRATION_MAX * arm_m).contains(&radius_m)
    };
    let axis = (0..3).find(is_odd)?;
    let key = format!("body.inertia_{}", names[axis]);
    let [least, most] = [GYRATION_MIN, GYRATION_MAX].map(|part| vehicle.mass_kg * (part * arm_m).powi(2));
    Some(format!(
        "has a moment of inertia of {:.4e} kg*m^2 at {:.4} kg and arms of {arm_m:.4} m, expected {least:.1e} to {most:.1e} kg*m^2; \
         look at {}",
        moments[axis],
        vehicle.mass_kg,
        lines(vehicle, &[&key, "body.mass"])
    ))
}

fn slow_motors(vehicle: &Vehicle) -> Option<String> {
    let (slowest_s, keys) = match vehicle.motor {
        MotorModel::FirstOrder { time_constant_s } => (time_constant_s, ["motor.time_constant"; 2]),
        MotorModel::SecondOrder { natural_frequency_rad_s, damping_ratio } => {
            let less = (damping_ratio * damping_ratio - 1.0).max(0.0).sqrt();
            let pole_rad_s = natural_frequency_rad_s * (damping_ratio - less);
            (pole_rad_s.recip(), ["motor.natural_frequency", "motor.damping_ratio"])
        }
    };
    let message = || {
        format!(
            "has motors that take {slowest_s:.4} s to follow, expected at most {SLOW_MAX_S} s: no law holds an attitude with them; \
             look at {}",
            lines(vehicle, &keys)
        )
    };
    (slowest_s > SLOW_MAX_S).then(message)
}

/// Finds wind that no effect feels: the vehicle flies as in still air.
fn unfelt_wind(effects: &[Effect]) -> Option<String> {
    let is_calm = |effect: &Effect| effect.values.iter().all(|value| *value == 0.0);
    let wind = effects.iter().find(|effect| effect.kind.moves_air && !is_calm(effect))?.kind.name;
    let feels = |effect: &Effect| !effect.kind.moves_air && effect.kind.needs.contains(&Quantity::Airspeed);
    let message = || {
        format!(
            "flies in moving air (`{wind}`) that none of its effects feels, expected one that does: it flies as in still air; add \
             `rotor-drag` or `parasitic-drag`"
        )
    };
    (!effects.iter().any(feels)).then(message)
}

/// The lines of the file in which the numbers `keys` are.
fn lines(vehicle: &Vehicle, keys: &[&str]) -> String {
    let stated = vehicle.provenance.iter().filter(|number| keys.contains(&number.key.as_str()));
    places(&stated.collect::<Vec<_>>())
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    fn load(file: &str) -> Vehicle {
        Vehicle::load(format!("{}/../vehicles/{file}", env!("CARGO_MANIFEST_DIR")).as_ref()).unwrap()
    }

    fn told(vehicle: &Vehicle) -> Vec<String> {
        let run = NodeContext::new("plant", &[]);
        tell(&Airframe::new(vehicle.clone()), &run);
        run.into_warnings().into_iter().map(|warning| warning.message).collect()
    }

    #[test]
    fn shipped_vehicles_are_not_odd() {
        for file in ["hummingbird.toml", "crazyflie-2.1.toml", "dji-f550.toml", "tarot-t18.toml"] {
            assert_eq!(told(&load(file)), [""; 0], "{file}");
        }
    }

    /// Vehicles of four and of six rotors.
    #[test]
    fn what_is_odd_is_told_with_its_line() {
        type Change = fn(&mut Vehicle);
        let cases: [(Change, &[&str]); 8] = [
            (
                |it| {
                    let arm_m = it.rotors[0].position_m.norm();
                    it.rotors.iter_mut().for_each(|rotor| rotor.position_m *= 88.0 / arm_m);
                },
                &["arms of 88 m", ".position`"],
            ),
            (
                |it| it.rotors[2].position_m = it.rotors[0].position_m,
                &["in one place", "`rotors.0.position`", "`rotors.2.position`"],
            ),
            (|it| it.rotors.iter_mut().for_each(|rotor| rotor.spin = 1.0), &["all turn one way"]),
            (
                |it| {
                    let about_x_kg_m2 = it.inertia_kg_m2[(0, 0)];
                    it.inertia_kg_m2 *= 2.0 / about_x_kg_m2;
                    it.mass_kg = 0.5;
                },
                &["inertia of 2.0000e0 kg*m^2 at 0.5000 kg", "`body.inertia_xx`", "`body.mass`"],
            ),
            (|it| it.rotors[1].axis = Vector3::x(), &["whose axis is 90.0 degrees from body z"]),
            (|it| it.inertia_kg_m2 *= 1e-4, &["has a moment of inertia of", "`body.inertia_xx`"]),
            (
                |it| it.motor = MotorModel::FirstOrder { time_constant_s: 25.0 },
                &["motors that take 25.0000 s"],
            ),
            (
                |it| it.motor = MotorModel::SecondOrder { natural_frequency_rad_s: 0.04, damping_ratio: 1.0 },
                &["motors that take 25.0000 s"],
            ),
        ];
        for (file, (change, expected)) in
            ["hummingbird.toml", "dji-f550.toml"].into_iter().flat_map(|file| cases.map(|case| (file, case)))
        {
            let mut vehicle = load(file);
            change(&mut vehicle);
            let messages = told(&vehicle);
            let of = messages.iter().find(|message| message.contains(expected[0]));
            let message = of.unwrap_or_else(|| panic!("{file}: {expected:?} in {messages:?}"));
            assert!(expected.iter().all(|word| message.contains(word)), "{file}: {message}");
        }
    }

    #[test]
    fn odd_rotors_and_motors_are_told_by_name_and_key() {
        let told_of = |change: fn(&mut Vehicle)| {
            let mut vehicle = load("hummingbird.toml");
            change(&mut vehicle);
            told(&vehicle).concat()
        };
        let said = told_of(|it| it.rotors[2].position_m = it.rotors[0].position_m);
        assert!(said.contains("\"front\" and \"rear\" in one place"), "{said}");
        let said = told_of(|it| it.rotors[1].axis = Vector3::x());
        assert!(said.contains("\"right\" whose axis"), "{said}");
        let said = told_of(|it| {
            it.motor = MotorModel::SecondOrder { natural_frequency_rad_s: 0.04, damping_ratio: 1.0 };
        });
        assert!(said.contains("`motor.natural_frequency`"), "{said}");
    }

    #[test]
    fn wind_needs_an_effect_that_feels_it() {
        let told = |names: &[&str]| {
            let effects = names.iter().map(|name| crate::effects::find(name).unwrap().nominal()).collect();
            let run = NodeContext::new("plant", &[]);
            tell(&Airframe::with_effects(load("hummingbird.toml"), effects), &run);
            run.into_warnings().into_iter().map(|warning| warning.message).collect::<Vec<_>>()
        };
        for wind in ["wind", "turbulence"] {
            let [message] = &told(&[wind])[..] else { panic!("{wind}: one warning") };
            assert!(message.contains(&format!("`{wind}`")) && message.contains("`rotor-drag`"), "{message}");
            for felt in ["rotor-drag", "parasitic-drag", "blade-flapping", "translational-lift"] {
                assert_eq!(told(&[wind, felt]), [""; 0], "{wind} and {felt}");
            }
        }
        assert_eq!(told(&["mass-error"]), [""; 0]);
    }

    #[test]
    fn rotors_above_each_other_are_in_two_places() {
        let mut vehicle = load("hummingbird.toml");
        let above = vehicle.rotors.clone().into_iter().map(|rotor| vehicles::Rotor {
            position_m: rotor.position_m + 0.03 * Vector3::z(),
            spin: -rotor.spin,
            ..rotor
        });
        vehicle.rotors.extend(above.collect::<Vec<_>>());
        assert_eq!(told(&vehicle), [""; 0]);
    }
}
