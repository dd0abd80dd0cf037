//! Errors of sensors, as effects beside the plant's: they change the logs of a flight, not its motion.

use diagnostics::unit::{ACCELERATION, ANGLE, SPEED, TIME};
use plant::effect_parameters;
use plant::effects::{COMMAND_DELAY, Confounder, EffectKind, Quantity, Stage};

/// The delay of sensors, as an effect.
pub const SENSOR_DELAY: &str = "sensor-delay";
/// The bias of sensors, as an effect.
pub const SENSOR_BIAS: &str = "sensor-bias";

/// Effects of sensors, each a part that makes sense alone; several share a name.
pub static SENSOR_EFFECTS: [&EffectKind; 5] =
    [&POSE_DELAY, &IMU_DELAY, &ACCELEROMETER_BIAS, &GYROSCOPE_BIAS, &ATTITUDE_BIAS];

const DELAY: EffectKind = EffectKind {
    name: SENSOR_DELAY,
    summary: "samples are stamped later than they were taken",
    equation: "y(t) = y_true(t - d)",
    source: "own (a definition)",
    validity: "the same for all samples of a sensor",
    stage: Stage::Sampling,
    is_delay: true,
    is_linear: false,
    guesses: &[&[-0.1], &[-0.05], &[-0.02], &[0.01], &[0.03], &[0.06], &[0.1], &[0.15], &[0.2]],
    confounded_with: &[Confounder {
        effect: &COMMAND_DELAY,
        experiment: "log rotor speeds on the sensors' clock: they follow a delayed command, not a delayed sensor",
    }],
    ..EffectKind::PLAIN
};

const BIAS: EffectKind = EffectKind {
    name: SENSOR_BIAS,
    summary: "a sensor reads something where there is nothing",
    equation: "y = y_true + b; of the attitude, a rotation of the sensor in its mount",
    source: "own (a definition)",
    validity: "constant over all flights",
    ..EffectKind::PLAIN
};

/// Position, velocity and attitude are late.
pub static POSE_DELAY: EffectKind =
    EffectKind { parameters: PoseDelay::SPECS, needs: &[Quantity::TwoClocks, Quantity::Pose], ..DELAY };
/// Gyroscope and accelerometer are late.
pub static IMU_DELAY: EffectKind = EffectKind {
    parameters: ImuDelay::SPECS,
    needs: &[Quantity::TwoClocks, Quantity::InertialUnit],
    ..DELAY
};
/// The accelerometer's bias.
pub static ACCELEROMETER_BIAS: EffectKind =
    EffectKind { parameters: Accelerometer::SPECS, needs: &[Quantity::SpecificForce], ..BIAS };
/// The gyroscope's bias.
pub static GYROSCOPE_BIAS: EffectKind =
    EffectKind { parameters: Gyroscope::SPECS, needs: &[Quantity::TwoRotations], ..BIAS };
/// Rotation of the attitude's sensor in its mount.
pub static ATTITUDE_BIAS: EffectKind =
    EffectKind { parameters: Attitude::SPECS, needs: &[Quantity::TwoDirections], ..BIAS };

effect_parameters! {
    struct PoseDelay {
        /// d of position, velocity and attitude
        pose: TIME, min: -0.5, max: 0.5, neutral: Some(0.0), nominal: 0.1, source: "tuned, no source";
    }
}

effect_parameters! {
    struct ImuDelay {
        /// d of gyroscope and accelerometer
        imu: TIME, min: -0.5, max: 0.5, neutral: Some(0.0), nominal: 0.1, source: "tuned, no source";
    }
}

effect_parameters! {
    struct Accelerometer {
        /// b_x in the body
        accelerometer_x: ACCELERATION, min: -5.0, max: 5.0, neutral: Some(0.0), nominal: 0.5,
            source: "tuned, no source";
        /// b_y in the body
        accelerometer_y: ACCELERATION, min: -5.0, max: 5.0, neutral: Some(0.0), nominal: 0.5,
            source: "tuned, no source";
        /// b_z in the body
        accelerometer_z: ACCELERATION, min: -5.0, max: 5.0, neutral: Some(0.0), nominal: 0.5,
            source: "tuned, no source";
    }
}

effect_parameters! {
    struct Gyroscope {
        /// b_x in the body
        gyroscope_x: SPEED, min: -1.0, max: 1.0, neutral: Some(0.0), nominal: 0.05, source: "tuned, no source";
        /// b_y in the body
        gyroscope_y: SPEED, min: -1.0, max: 1.0, neutral: Some(0.0), nominal: 0.05, source: "tuned, no source";
        /// b_z in the body
        gyroscope_z: SPEED, min: -1.0, max: 1.0, neutral: Some(0.0), nominal: 0.05, source: "tuned, no source";
    }
}

/// Greatest rotation of the attitude's sensor in its mount: 3 degrees; tuned, no source. Larger estimates stood for a wind or another force.
const MOUNT_MAX_RAD: f64 = 0.0524;

effect_parameters! {
    struct Attitude {
        /// rotation about x of the body
        attitude_x: ANGLE, min: -MOUNT_MAX_RAD, max: MOUNT_MAX_RAD, neutral: Some(0.0), nominal: 0.02, source: "tuned, no source";
        /// rotation about y of the body
        attitude_y: ANGLE, min: -MOUNT_MAX_RAD, max: MOUNT_MAX_RAD, neutral: Some(0.0), nominal: 0.02, source: "tuned, no source";
    }
}
