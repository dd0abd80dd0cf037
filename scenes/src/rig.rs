//! A test rig: the vehicle hangs from a ball joint that limits its tilt, and that may slide up and down.
#![allow(non_snake_case, reason = "a trailing _W or _B names the frame a vector is written in, N the newton")]

use diagnostics::parameter::Bounds;
use diagnostics::unit::{ANGLE, FORCE, LENGTH, LINEAR_DAMPING, MASS, ROTARY_DAMPING, TORQUE};
use diagnostics::{Diagnostic, Faults};
use nalgebra::Vector3;
use vehicles::reader::Section;

/// The rod-end bearing of thesis section 5.2, and the tube that it hangs on.
///
/// ```
/// let scene = scenes::Scene::parse(scenes::reference::RIG_FIXED, "rig-fixed.toml")?;
/// assert_eq!(scene.rig.unwrap().heave_m, 0.0);
/// # Ok::<(), diagnostics::Diagnostic>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rig {
    /// Centre of the bearing at the lower end of its travel.
    pub bearing_W_m: Vector3<f64>,
    /// Centre of the bearing seen from the vehicle's centre of mass.
    pub mount_B_m: Vector3<f64>,
    /// The most that body z leans away from world z, in whichever direction.
    pub tilt_max_rad: f64,
    /// Travel of the bearing upwards; 0 where it does not heave.
    pub heave_m: f64,
    /// Travel of the bearing from its line along either horizontal axis of the world; 0 where it does not move so.
    pub sway_m: f64,
    /// Mass that travels with the bearing, beside the vehicle.
    pub moving_mass_kg: f64,
    /// Torque of the bearing's dry friction, against any rotation.
    pub bearing_friction_N_m: f64,
    /// Torque of its viscous friction per angular velocity.
    pub bearing_damping_N_m_s: f64,
    /// Force of the tube's dry friction.
    pub slide_friction_N: f64,
    /// Force of its viscous friction per speed.
    pub slide_damping_N_s_m: f64,
}

/// Places of the things of a scene.
pub(crate) const PLACE: Bounds = Bounds {
    min: -1e6,
    max: 1e6,
    unit: "m",
    why: "beyond 1000 km the ground is not flat, and contacts of a double lose their micrometres",
};

/// Place of the vehicle's mount, seen from its centre of mass.
const MOUNT: Bounds = Bounds {
    min: -100.0,
    max: 100.0,
    unit: "m",
    why: "the longest helicopter measures 40 m over its rotors",
};

/// A mass that hangs in a bearing.
const MOVING_MASS: Bounds = Bounds {
    min: 1e-6,
    max: 1e6,
    unit: "kg",
    why: "the lightest that flies weighs 80 mg, the heaviest with rotors 56 t",
};

/// Heave, friction and damping, each in its unit of the SI.
const AMOUNT: Bounds = Bounds {
    min: 0.0,
    max: 1e6,
    unit: "",
    why: "no test rig travels so far or rubs so hard: the weight of 56 t, the heaviest with rotors, is 5.5e5 N",
};

/// Reads the table `[rig]`; see `scenes/rig-sliding.toml`.
pub(crate) fn parse(section: &Section) -> Result<Rig, Diagnostic> {
    let mut faults = Faults::default();
    let tilt_max = || {
        let tilt = section.quantity("tilt_max", ANGLE)?;
        let holds = tilt.si > 0.0 && tilt.si < std::f64::consts::PI;
        tilt.require(holds, "an angle above 0 and below 180 deg")
    };
    let bearing_W_m = faults.keep(section.vector("bearing", LENGTH, &PLACE));
    let mount_B_m = faults.keep(section.vector("mount", LENGTH, &MOUNT));
    let tilt_max = faults.keep(tilt_max());
    let moving_mass_kg = faults.keep(section.bounded("moving_mass", MASS, &MOVING_MASS));
    let mut amount = |name, dimension| faults.keep(section.bounded(name, dimension, &AMOUNT));
    let heave_m = amount("heave", LENGTH);
    let sway_m = if section.has("sway") { amount("sway", LENGTH) } else { Some(0.0) };
    let bearing_friction_N_m = amount("bearing_friction", TORQUE);
    let bearing_damping_N_m_s = amount("bearing_damping", ROTARY_DAMPING);
    let slide_friction_N = amount("slide_friction", FORCE);
    let slide_damping_N_s_m = amount("slide_damping", LINEAR_DAMPING);
    faults.keep(section.finish());
    let rig = (|| {
        Some(Rig {
            bearing_W_m: bearing_W_m?.into(),
            mount_B_m: mount_B_m?.into(),
            tilt_max_rad: tilt_max?.si,
            heave_m: heave_m?,
            sway_m: sway_m?,
            moving_mass_kg: moving_mass_kg?,
            bearing_friction_N_m: bearing_friction_N_m?,
            bearing_damping_N_m_s: bearing_damping_N_m_s?,
            slide_friction_N: slide_friction_N?,
            slide_damping_N_s_m: slide_damping_N_s_m?,
        })
    })();
    faults.finish(rig)
}
