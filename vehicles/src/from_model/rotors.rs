//! Rotors among the joints of a model, in the order of the commands.

use diagnostics::{Diagnostic, ParameterError};
use nalgebra::{Point3, Vector3};

use super::body::turned;
use super::model::{Freedom, Joint, Link, Model, Motor};
use super::text::plain;
use crate::bounds;
use crate::vehicle::ROTORS_MAX;

/// Words by which rotors are known, the surest first.
const WORDS: [&str; 3] = ["rotor", "prop", "motor"];
/// Least number of joints with one word that are all rotors of a vehicle.
const WHOLE_MIN: usize = 3;
/// Largest sine of the angle between a rotor's axis and the body's z axis.
const TILT_MAX: f64 = 0.02;
/// Share of its distance by which a rotor may stand to the left of the nose and still count as in front: rounding.
const FRONT_SLACK: f64 = 1e-6;

/// A rotor of the model.
pub struct Rotor<'m> {
    /// Its joint.
    pub joint: &'m Joint,
    /// Its link.
    pub link: &'m Link,
    /// Its plugin.
    pub motor: Option<&'m Motor>,
    /// Hub, from the centre of mass.
    pub position_m: Vector3<f64>,
    /// Rank clockwise from the nose, seen from above, from 0 on.
    pub rank: usize,
}

impl Rotor<'_> {
    /// Moment of inertia about the axis, in kg m^2, through the link's own centre of mass; none without mass. The axis of a
    /// fixed joint is z of the body: formats state none. A joint that the simulator turns more slowly than the rotor has a
    /// link with as much more inertia, which is divided out.
    pub fn inertia_kg_m2(&self) -> Option<f64> {
        let inertial = self.link.inertial.as_ref().filter(|inertial| inertial.mass_kg > 0.0)?;
        let stated = Some(self.joint.axis).filter(|_| self.joint.freedom != Freedom::Fixed);
        let axis = stated.and_then(|axis| axis.try_normalize(0.0)).unwrap_or_else(Vector3::z);
        Some(axis.dot(&(turned(self.link, inertial) * axis)) / self.motor.map_or(1.0, Motor::slowdown))
    }
}

/// Finds the rotors: joints that plugins name, else joints that turn and are named so, else fixed ones that are. The order
/// is that of the plugins' numbers, else clockwise from the nose, seen from above.
///
/// # Errors
/// If there are none or more than 12, one is tilted or pushes downwards, or the plugins' numbers or directions are not complete.
pub fn find<'m>(model: &'m Model, centre: &Point3<f64>) -> Result<Vec<Rotor<'m>>, Diagnostic> {
    let joints = if model.motors.is_empty() { by_name(model) } else { by_motor(model)? };
    require_count(model, &joints)?;
    let mut rotors = Vec::new();
    for (joint, motor) in joints {
        let Some(link) = model.links.iter().find(|link| link.name == joint.child) else { continue };
        match joint.freedom {
            Freedom::Fixed => {}
            Freedom::Turns => require_upright(model, joint)?,
            Freedom::Other => return Err(cannot_turn(model, joint)),
        }
        if motor.is_some() {
            require_upward(model, joint, link)?;
        }
        let rotor = Rotor { joint, link, motor, position_m: hub(joint, link) - centre, rank: 0 };
        require_bounds(model, &rotor)?;
        rotors.push(rotor);
    }
    require_directions(model, &rotors)?;
    sort(model, &mut rotors)?;
    Ok(rotors)
}

/// Place of the rotor of a joint. Fixed joints may all be at the origin, and only their links' centres of mass apart.
fn hub(joint: &Joint, link: &Link) -> Point3<f64> {
    match &link.inertial {
        Some(inertial) if joint.freedom == Freedom::Fixed => link.pose * inertial.pose * Point3::origin(),
        _ => joint.point,
    }
}

fn by_motor<'m>(model: &'m Model) -> Result<Vec<(&'m Joint, Option<&'m Motor>)>, Diagnostic> {
    let of = |motor: &'m Motor| {
        let is_it = |joint: &&Joint| match (&motor.joint, &motor.link) {
            (Some(name), _) => joint.name == *name,
            (None, Some(name)) => joint.child == *name,
            (None, None) => false,
        };
        let name = motor.joint.as_deref().or(motor.link.as_deref()).unwrap_or("none");
        let missing = || {
            let message = format!("plugin of a motor: expected the joint or link of a rotor, found `{name}`");
            model.source.fault(motor.at.clone(), message).help("correct <jointName> or <linkName>")
        };
        Ok((model.joints.iter().find(is_it).ok_or_else(missing)?, Some(motor)))
    };
    model.motors.iter().map(of).collect()
}

fn by_name<'m>(model: &'m Model) -> Vec<(&'m Joint, Option<&'m Motor>)> {
    let named = |joint: &Joint, words: &[&str]| {
        let names = [joint.name.to_lowercase(), joint.child.to_lowercase()];
        words.iter().any(|word| names.iter().any(|name| name.contains(word)))
    };
    let of = |freedom: Freedom, words: &[&str]| -> Vec<_> {
        let is_one = |joint: &&Joint| joint.freedom == freedom && named(joint, words);
        model.joints.iter().filter(is_one).map(|joint| (joint, None)).collect()
    };
    let tries = [Freedom::Turns, Freedom::Fixed].map(|freedom| {
        let any = of(freedom, &WORDS);
        // Where a word names a whole vehicle, what has another word only is a cover or a mount.
        let of_word = WORDS.iter().map(|word| of(freedom, std::slice::from_ref(word)));
        of_word.into_iter().find(|found| found.len() >= WHOLE_MIN).unwrap_or(any)
    });
    // Joints that turn are the rotors, whatever else there is.
    tries.into_iter().find(|found| !found.is_empty()).unwrap_or_default()
}

fn require_count(model: &Model, joints: &[(&Joint, Option<&Motor>)]) -> Result<(), Diagnostic> {
    if joints.is_empty() {
        let error = model.source.whole(format!("expected 1 to {ROTORS_MAX} rotors, found none"));
        let help =
            "rotors are links of joints whose names have `rotor`, `prop` or `motor` in them: rename them";
        return Err(error.help(help));
    }
    let mut names: Vec<&str> = joints.iter().map(|(joint, _)| joint.name.as_str()).collect();
    names.sort_unstable();
    let is_twice = names.windows(2).find(|two| two[0] == two[1]).map(|two| two[0]);
    if let Some(name) = is_twice {
        let error = model.source.whole(format!("expected one motor for each rotor, found two for `{name}`"));
        return Err(error.help("remove one of the plugins"));
    }
    if joints.len() > ROTORS_MAX {
        let (count, shown) = (names.len(), names[..8].join(", "));
        let message = format!("expected 1 to {ROTORS_MAX} rotors, found {count}: {shown}, ...");
        let help = "rotors are links of joints whose names have `rotor`, `prop` or `motor` in them: rename the others";
        return Err(model.source.whole(message).help(help));
    }
    Ok(())
}

/// The error for a rotor on a joint that moves without turning.
fn cannot_turn(model: &Model, joint: &Joint) -> Diagnostic {
    let name = plain(&joint.name);
    let message =
        format!("rotor `{name}`: expected a revolute, continuous or fixed joint, found another type");
    model
        .source
        .fault(joint.at.clone(), message)
        .help("correct the joint's type, or the joint that the plugin names")
}

fn require_upright(model: &Model, joint: &Joint) -> Result<(), Diagnostic> {
    let axis = joint.axis.try_normalize(0.0).unwrap_or_else(Vector3::zeros);
    if axis.z.abs() > 0.5 && axis.xy().norm() <= TILT_MAX {
        return Ok(());
    }
    let (name, axis) = (&joint.name, joint.axis);
    let message = format!(
        "rotor `{name}`: expected an axis along z of the body, found [{:.4}, {:.4}, {:.4}]",
        axis.x, axis.y, axis.z
    );
    let help = "only models with upright rotors are converted: give a vehicle file `rotors.axis` by hand; of a model whose z is not up, \
                turn its root link";
    Err(model.source.fault(joint.at.clone(), message).help(help))
}

/// Refuses a rotor that is farther from the centre of mass, or heavier, than any that flies.
fn require_bounds(model: &Model, rotor: &Rotor) -> Result<(), Diagnostic> {
    let key = |what: &str| format!("{what} of rotor {}", plain(&rotor.link.name));
    for entry in rotor.position_m.iter() {
        bounds::HUB
            .check(&key("distance from the centre of mass"), *entry)
            .map_err(|error| model.source.fault(rotor.joint.at.clone(), error))?;
    }
    let inertial = rotor.inertia_kg_m2().zip(rotor.link.inertial.as_ref());
    inertial.map_or(Ok(()), |(inertia, inertial)| {
        bounds::ROTOR_INERTIA
            .check(&key("moment of inertia"), inertia)
            .map_err(|error| model.source.fault(inertial.at.clone(), error))
    })
}

/// Refuses a plugin whose link does not point upwards: Gazebo pushes along z of the link, not along the joint's axis.
fn require_upward(model: &Model, joint: &Joint, link: &Link) -> Result<(), Diagnostic> {
    let up = link.pose * Vector3::z();
    if up.z > 0.5 && up.xy().norm() <= TILT_MAX {
        return Ok(());
    }
    let message = format!(
        "rotor `{}`: expected a link whose z points upwards, found [{:.4}, {:.4}, {:.4}]",
        plain(&joint.name),
        up.x,
        up.y,
        up.z
    );
    let help = "the plugin pushes along z of the link: turn the link; only models with rotors that push upwards are converted";
    Err(model.source.fault(link.at.clone(), message).help(help))
}

/// Refuses directions of rotation that only some plugins state.
fn require_directions(model: &Model, rotors: &[Rotor]) -> Result<(), Diagnostic> {
    let is_stated = |rotor: &&Rotor| rotor.motor.is_some_and(|motor| motor.spin.is_some());
    let with = rotors.iter().find(is_stated);
    let without = rotors.iter().find(|rotor| !is_stated(rotor));
    match (with, without.and_then(|rotor| Some((rotor, rotor.motor?)))) {
        (Some(with), Some((without, motor))) => {
            let found = format!("none for `{}`", plain(&without.joint.name));
            let expected = format!("a direction, as for `{}`", plain(&with.joint.name));
            let error = ParameterError::value("turningDirection", expected, found);
            Err(model.source.fault(motor.at.clone(), error).help("add <turningDirection> to this plugin"))
        }
        _ => Ok(()),
    }
}

/// Ranks the rotors clockwise from the nose, and orders them by their commands' numbers where there are some.
fn sort(model: &Model, rotors: &mut [Rotor]) -> Result<(), Diagnostic> {
    rotors.sort_by(|a, b| clockwise(&a.position_m).total_cmp(&clockwise(&b.position_m)));
    rotors.iter_mut().enumerate().for_each(|(rank, rotor)| rotor.rank = rank);
    require_numbers(model, rotors)?;
    rotors.sort_by(|a, b| number(a).unwrap_or(0.0).total_cmp(&number(b).unwrap_or(0.0)));
    Ok(())
}

fn number(rotor: &Rotor) -> Option<f64> {
    rotor.motor?.number
}

/// Refuses numbers of commands that stand twice, or that only some plugins have.
fn require_numbers(model: &Model, rotors: &[Rotor]) -> Result<(), Diagnostic> {
    let mut seen: Vec<&Rotor> = Vec::new();
    let is_any = rotors.iter().any(|rotor| number(rotor).is_some());
    // Plugins in the order of the file: the second of two equal ones is the place.
    let mut plugins: Vec<_> = rotors.iter().filter_map(|rotor| Some((rotor, rotor.motor?))).collect();
    plugins.sort_by_key(|(_, motor)| motor.at.start);
    for (rotor, motor) in plugins {
        let name = plain(&rotor.joint.name);
        let fault = |expected: String, found: String| {
            let error = ParameterError::value("motorNumber", expected, found);
            model
                .source
                .fault(motor.at.clone(), error)
                .help("give each plugin of a motor a number of its own, or none of them a number")
        };
        let Some(index) = motor.number else {
            if is_any {
                let expected = "a number in all plugins of motors or in none".to_owned();
                return Err(fault(expected, format!("none for `{name}`")));
            }
            continue;
        };
        if let Some(other) = seen.iter().find(|other| number(other) == Some(index)) {
            let other = plain(&other.joint.name);
            let found = format!("{index} for `{other}` and `{name}`");
            return Err(fault("a number of its own for each rotor".to_owned(), found));
        }
        seen.push(rotor);
    }
    Ok(())
}

/// A number that grows with the angle of a place from the nose, clockwise seen from above: 0 in front, 2 in the rear.
fn clockwise(place: &Vector3<f64>) -> f64 {
    let size = place.x.abs() + place.y.abs();
    let forward = if size > 0.0 { place.x / size } else { 1.0 };
    if place.y <= FRONT_SLACK * size { 1.0 - forward } else { 3.0 + forward }
}
