//! The numbers of a vehicle file: those of the model, and the reference vehicle's where the model has none.

use diagnostics::Diagnostic;

use super::model::Motor;
use super::notes;
use super::parts::{GRAVITY_M_S2, Parts};
use super::rotors::Rotor;
use super::text::{Origin, Text, digits, listed, plain, quoted};
use crate::bounds;
use crate::vehicle::MotorModel;

/// Relative difference that the numbers of the rotors may have, against the largest: a vehicle file has one for all.
const ALIKE: f64 = 1e-3;

impl Parts<'_> {
    /// The vehicle file, and notes on the model.
    ///
    /// # Errors
    /// If the rotors differ from each other.
    pub fn write(&self, file: &str) -> Result<(Text, Vec<String>), Diagnostic> {
        let mut text = Text::new(file, &self.model.name);
        self.write_body(&mut text);
        let thrust = self.write_rotor(&mut text)?;
        self.write_motor(&mut text)?;
        let speed_max = self.write_command(&mut text, thrust)?;
        self.write_rotors(&mut text);
        Ok((text, notes::of(self, thrust, speed_max)))
    }

    fn write_body(&self, text: &mut Text) {
        let body = &self.body;
        let origin = Origin::Model(listed(&body.links));
        text.table("[body]", "body");
        text.number("mass", &digits(body.mass_kg, body.mass_kg), "kg", &origin);
        let (tensor, scale) = (&body.inertia_kg_m2, body.inertia_kg_m2.amax());
        let entries = ["xx", "yy", "zz", "xy", "xz", "yz"];
        for (name, at) in entries.iter().zip([(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)]) {
            let value = digits(tensor[at], scale);
            text.number(&format!("inertia_{name}"), &value, "kg*m^2", &origin);
        }
        let gravity = digits(GRAVITY_M_S2, 1.0);
        text.number("gravity", &gravity, "m/s^2", &Origin::Chosen("standard gravity".to_owned()));
    }

    /// Writes `[rotor]` and returns the thrust coefficient, in N/(rad/s)^2.
    fn write_rotor(&self, text: &mut Text) -> Result<f64, Diagnostic> {
        let (reference, masses, arms) = (&self.reference, self.mass_ratio(), self.arm_ratio());
        let thrust = self.common("motorConstant", |motor| motor.thrust_coefficient)?;
        let moment_m = self.common("momentConstant", |motor| motor.moment_m)?;
        let inertia = self.alike("moment of inertia", &self.each(|rotor| rotor.inertia_kg_m2()))?;
        text.table("[rotor]", "rotor");
        let coefficient = thrust.unwrap_or(reference.thrust_coefficient * self.share_ratio());
        let origin = thrust
            .map_or(assumed("the Hummingbird's, scaled with the weight that a rotor carries"), |_| {
                Origin::Model("motorConstant".to_owned())
            });
        text.number("thrust_coefficient", &digits(coefficient, coefficient), "N/(rad/s)^2", &origin);
        let reference_m = reference.torque_coefficient / reference.thrust_coefficient * arms;
        let torque = coefficient * moment_m.unwrap_or(reference_m);
        let origin = moment_m
            .map_or(assumed("the Hummingbird's ratio to the thrust, scaled with the arm"), |_| {
                Origin::Model("momentConstant times the thrust coefficient".to_owned())
            });
        text.number("torque_coefficient", &digits(torque, torque), "N*m/(rad/s)^2", &origin);
        let axial = inertia.unwrap_or(reference.rotor_inertia_kg_m2 * masses * arms * arms);
        let slowdown = self.slowdown()?;
        let names: Vec<String> = self.rotors.iter().map(|rotor| rotor.link.name.clone()).collect();
        let origin = inertia.map_or(assumed("the Hummingbird's, scaled with mass and arm"), |_| {
            Origin::Model(listed(&names) + &slowdown)
        });
        text.number("inertia", &digits(axial, axial), "kg*m^2", &origin);
        Ok(coefficient)
    }

    /// Words on the factor by which the simulator's joints are slower than the rotors; none if they are not.
    fn slowdown(&self) -> Result<String, Diagnostic> {
        let slowdown = self.common("rotorVelocitySlowdownSim", |motor| Some(motor.slowdown()))?;
        let is_stated =
            self.rotors.iter().any(|rotor| rotor.motor.is_some_and(|motor| motor.slowdown.is_some()));
        let default = if is_stated { "" } else { " (the plugins' default)" };
        Ok(slowdown.filter(|by| *by != 1.0).map_or(String::new(), |by| {
            format!(
                ", divided by rotorVelocitySlowdownSim = {by}{default}: the simulator turns the links that much slower"
            )
        }))
    }

    fn write_motor(&self, text: &mut Text) -> Result<(), Diagnostic> {
        let up = self.common("timeConstantUp", |motor| motor.lag_up_s)?;
        let down = self.common("timeConstantDown", |motor| motor.lag_down_s)?;
        text.table("[motor]", "motor");
        if let Some(lag) = up.or(down) {
            let key = if up.is_some() { "timeConstantUp" } else { "timeConstantDown" };
            let other = down
                .filter(|down| *down != lag)
                .map_or(String::new(), |down| format!("; timeConstantDown is {} s", digits(down, down)));
            text.line("model = \"first-order\"", &Origin::Model("plugins of the motors".to_owned()));
            text.number("time_constant", &digits(lag, lag), "s", &Origin::Model(format!("{key}{other}")));
            return Ok(());
        }
        let origin = assumed("the Hummingbird's");
        match self.reference.motor {
            MotorModel::SecondOrder { natural_frequency_rad_s, damping_ratio } => {
                text.line("model = \"second-order\"", &origin);
                text.number("natural_frequency", &format!("{natural_frequency_rad_s:?}"), "rad/s", &origin);
                text.number("damping_ratio", &format!("{damping_ratio:?}"), "1", &origin);
            }
            MotorModel::FirstOrder { time_constant_s } => {
                text.line("model = \"first-order\"", &origin);
                text.number("time_constant", &format!("{time_constant_s:?}"), "s", &origin);
            }
        }
        Ok(())
    }

    /// Writes `[command]` and returns the largest speed in rad/s.
    fn write_command(&self, text: &mut Text, thrust: f64) -> Result<f64, Diagnostic> {
        let given = self.common("maxRotVelocity", |motor| motor.speed_max_rad_s)?;
        text.table("[command]", "command");
        let map = &self.reference.command;
        let (range, speeds, of_range, of_min, of_max) = match given {
            Some(max) => {
                let range = assumed("0 to 1, over the speeds below");
                let of_max = Origin::Model("maxRotVelocity".to_owned());
                ([0.0, 1.0], [0.0, max], range, assumed("a motor that can stop"), of_max)
            }
            None => {
                let hover = (self.share_ratio() * self.reference.thrust_coefficient / thrust).sqrt();
                let why = "the Hummingbird's, scaled with the speed in hover";
                let speeds = [map.speed_at_min_rad_s * hover, map.speed_at_max_rad_s * hover];
                ([map.min, map.max], speeds, assumed("the Hummingbird's"), assumed(why), assumed(why))
            }
        };
        self.require_speed(speeds[1])?;
        text.number("min", &digits(range[0], 1.0), "1", &of_range);
        text.number("max", &digits(range[1], 1.0), "1", &of_range);
        text.number("speed_at_min", &digits(speeds[0], 1.0), "rad/s", &of_min);
        text.number("speed_at_max", &digits(speeds[1], 1.0), "rad/s", &of_max);
        Ok(speeds[1])
    }

    /// Refuses a thrust with which the rotors have to turn faster than any does.
    fn require_speed(&self, speed_rad_s: f64) -> Result<(), Diagnostic> {
        let Err(error) = bounds::ROTOR_SPEED.check("largest speed of the rotors", speed_rad_s) else {
            return Ok(());
        };
        let motor = self.rotors.iter().find_map(|rotor| rotor.motor);
        let at = motor.map_or(0..0, |motor| motor.at.clone());
        let help = "it follows from the mass and <motorConstant>, in N/(rad/s)^2: correct them, or add <maxRotVelocity>";
        Err(self.model.source.fault(at, error).help(help))
    }

    fn write_rotors(&self, text: &mut Text) {
        for rotor in &self.rotors {
            let (joint, link) = (plain(&rotor.joint.name), plain(&rotor.link.name));
            text.table("[[rotors]]", &format!("rotors {link}"));
            text.line(&format!("name = {}", quoted(&link)), &Origin::Model(format!("joint {joint}")));
            let scale = rotor.position_m.amax().max(self.arm_m());
            let entries: Vec<_> = rotor.position_m.iter().map(|entry| digits(*entry, scale)).collect();
            let origin = Origin::Model(format!("joint {joint}, from the centre of mass"));
            text.number("position", &format!("[{}]", entries.join(", ")), "m", &origin);
            match rotor.motor.and_then(|motor| motor.spin) {
                Some(spin) => text.spin(spin, &Origin::Model(format!("turningDirection of {joint}"))),
                None => text.spin(
                    assumed_spin(rotor.rank),
                    &assumed("the Hummingbird's, alternating clockwise from the nose"),
                ),
            }
        }
    }

    fn mass_ratio(&self) -> f64 {
        self.body.mass_kg / self.reference.mass_kg
    }

    fn weight_ratio(&self) -> f64 {
        self.mass_ratio() * GRAVITY_M_S2 / self.reference.gravity_m_s2
    }

    /// Ratio of the weight that each rotor carries.
    fn share_ratio(&self) -> f64 {
        self.weight_ratio() * (self.reference.rotors.len() as f64 / self.rotors.len() as f64)
    }

    fn arm_ratio(&self) -> f64 {
        let reference = self.reference.rotors.iter().map(|rotor| rotor.position_m.xy().norm()).sum::<f64>();
        self.reference.rotors.len() as f64 * self.arm_m() / reference
    }

    /// Mean distance of the rotors from the z axis through the centre of mass.
    fn arm_m(&self) -> f64 {
        let sum: f64 = self.rotors.iter().map(|rotor| rotor.position_m.xy().norm()).sum();
        sum / self.rotors.len() as f64
    }

    fn each(&self, of: impl Fn(&Rotor) -> Option<f64>) -> Vec<Option<f64>> {
        self.rotors.iter().map(of).collect()
    }

    /// A number of the motors' plugins, which is the same for all; none if no plugin has it.
    fn common(&self, key: &str, of: impl Fn(&Motor) -> Option<f64>) -> Result<Option<f64>, Diagnostic> {
        self.alike(key, &self.each(|rotor| rotor.motor.and_then(&of)))
    }

    fn alike(&self, key: &str, each: &[Option<f64>]) -> Result<Option<f64>, Diagnostic> {
        let first = each.first().copied().flatten();
        let is_alike = |value: &Option<f64>| match (value, first) {
            (Some(value), Some(first)) => (value - first).abs() <= ALIKE * value.abs().max(first.abs()),
            (None, None) => true,
            _ => false,
        };
        let Some(other) = each.iter().position(|value| !is_alike(value)) else { return Ok(first) };
        let told = |value: Option<f64>| value.map_or("none".to_owned(), |value| value.to_string());
        let names = [&self.rotors[0], &self.rotors[other]].map(|rotor| plain(&rotor.joint.name));
        let message = format!(
            "{key}: expected the same for all rotors, found {} for `{}` and {} for `{}`",
            told(first),
            names[0],
            told(each[other]),
            names[1]
        );
        let at =
            self.rotors[other].motor.map_or(self.rotors[other].joint.at.clone(), |motor| motor.at.clone());
        Err(self
            .model
            .source
            .fault(at, message)
            .help("a vehicle file has one number for all rotors: make them equal"))
    }
}

/// The Hummingbird's sense of rotation of a rotor by its rank clockwise from the nose: clockwise in front.
fn assumed_spin(rank: usize) -> f64 {
    if rank.is_multiple_of(2) { -1.0 } else { 1.0 }
}

fn assumed(why: &str) -> Origin {
    Origin::Assumed(why.to_owned())
}
