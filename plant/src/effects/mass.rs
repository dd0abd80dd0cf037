//! A body that is not as it was declared.
#![allow(non_snake_case, reason = "a trailing _B names the frame a vector is written in")]

use super::{Action, EffectKind, ParameterSpec, Values};
use diagnostics::unit::{LENGTH, RATIO};
use nalgebra::{Matrix3, Vector3};
use vehicles::Vehicle;

/// Another mass than the declared one.
pub static MASS_ERROR: EffectKind = EffectKind {
    name: "mass-error",
    summary: "the vehicle is heavier or lighter than declared",
    equation: "m (1 + e)",
    source: "own (a deviation of the declared mass)",
    validity: "controllers go on believing the vehicle file; inertia stays (see `inertia-error`)",
    parameters: &[ParameterSpec {
        name: "error",
        meaning: "e: relative deviation of the mass",
        dimension: RATIO,
        lower: -0.5,
        upper: 1.0,
        neutral: Some(0.0),
        typical: 0.05,
        typical_source: "tuned, no source",
    }],
    actions: &[Action::Vehicle(mass_error)],
};

const fn offset(name: &'static str, meaning: &'static str) -> ParameterSpec {
    ParameterSpec {
        name,
        meaning,
        dimension: LENGTH,
        lower: -0.1,
        upper: 0.1,
        neutral: Some(0.0),
        typical: 0.005,
        typical_source: "tuned, no source: a battery that is not strapped in the middle",
    }
}

/// A centre of mass that is not amid the rotors.
pub static COM_OFFSET: EffectKind = EffectKind {
    name: "com-offset",
    summary: "the centre of mass is not where it is declared, so that equal thrusts turn the vehicle",
    equation: "r_i - d for the hub of each rotor, d = (x, y, z)",
    source: "rigid-body mechanics: torques are taken about the centre of mass, which gravity acts on",
    validity: "offsets that are small against the arms: the inertia stays, of which m d^2 would have to be taken, and \
               the pose of the vehicle is that of the centre of mass, so that sensors move with it. z acts only where \
               something pushes in the plane of the rotors, such as rotor-drag",
    parameters: &[
        offset("x", "d_x: how far the centre of mass is in front of the declared one"),
        offset("y", "d_y: how far it is left of it"),
        offset("z", "d_z: how far it is above it"),
    ],
    actions: &[Action::Vehicle(com_offset)],
};

const fn moment(name: &'static str, meaning: &'static str) -> ParameterSpec {
    ParameterSpec {
        name,
        meaning,
        dimension: RATIO,
        lower: -0.5,
        upper: 1.0,
        neutral: Some(0.0),
        typical: 0.1,
        typical_source: "tuned, no source: published Hummingbirds differ by 50 %",
    }
}

/// Another inertia than the declared one.
pub static INERTIA_ERROR: EffectKind = EffectKind {
    name: "inertia-error",
    summary: "the moments of inertia are larger or smaller than declared",
    equation: "S J S with S = diag(sqrt(1 + e_xx), sqrt(1 + e_yy), sqrt(1 + e_zz)), so that J_xx (1 + e_xx)",
    source: "own (deviations of the declared tensor, which keep it positive definite)",
    validity: "a tensor of which one moment is larger than the sum of the other two is no rigid body's, and refused",
    parameters: &[
        moment("error_xx", "e_xx: relative deviation about body x"),
        moment("error_yy", "e_yy: relative deviation about body y"),
        moment("error_zz", "e_zz: relative deviation about body z"),
    ],
    actions: &[Action::Vehicle(inertia_error)],
};

/// Another angular momentum of the rotors than the declared one.
pub static GYROSCOPIC_TORQUE: EffectKind = EffectKind {
    name: "gyroscopic-torque",
    summary: "the rotors have more or less angular momentum than declared",
    equation: "J_r (1 + e) in -w x (h z) and -h' z with h = sum s_i J_r w_i, both of the declared model",
    source: "Euler's equation for body and rotors together; thesis eq. 3.11 is its first term",
    validity: "also scales the reaction to spinning up, which comes from the same angular momentum",
    parameters: &[ParameterSpec {
        name: "scale_error",
        meaning: "e: relative deviation of the rotors' moment of inertia; -1 takes both torques away",
        dimension: RATIO,
        lower: -1.0,
        upper: 4.0,
        neutral: Some(0.0),
        typical: 0.5,
        typical_source: "uncertainty of the Hummingbird's rotor inertia, vehicles/hummingbird.toml",
    }],
    actions: &[Action::Vehicle(gyroscopic_torque)],
};

fn mass_error(&[error, ..]: &Values, vehicle: &mut Vehicle) {
    vehicle.mass_kg *= 1.0 + error;
}

fn com_offset(&[x_m, y_m, z_m, ..]: &Values, vehicle: &mut Vehicle) {
    for rotor in &mut vehicle.rotors {
        rotor.position_m -= Vector3::new(x_m, y_m, z_m);
    }
}

fn inertia_error(&[xx, yy, zz, ..]: &Values, vehicle: &mut Vehicle) {
    let roots = Vector3::new(xx, yy, zz).map(|error| (1.0 + error).sqrt());
    let scale = Matrix3::from_diagonal(&roots);
    vehicle.inertia_kg_m2 = scale * vehicle.inertia_kg_m2 * scale;
}

fn gyroscopic_torque(&[error, ..]: &Values, vehicle: &mut Vehicle) {
    vehicle.rotor_inertia_kg_m2 *= 1.0 + error;
}
