//! Hidden truths of vehicles on a rig, and their judgement.

use super::bearing::{Bearing, Friction};
use flights::Channel;
use identify::Ratios;
use identify::report::Report;
use identify::run::{identify, problem};
use vehicles::Vehicle;

/// Length of each flight.
pub const DURATION_S: f64 = 20.0;

/// A hidden truth, the effects that it stands for, and its flights.
pub type Truth = (&'static str, &'static [&'static str], fn(Bearing) -> Bearing);

const GIMBAL: Friction = Friction::Gimbal([0.004, 0.006, 0.003], [0.0; 3]);
const BALL: Friction = Friction::Ball(0.005, 0.0);

/// Friction beside which the pilot's kicks are small: the bearing sticks for much of the flight.
pub const STICKING: &str = "the same, half the kicks";

/// All truths.
pub const TRUTHS: [Truth; 12] =
    [
        ("nothing", &[], |plain| plain),
        ("dry friction 4, 6, 3 mN m about x, y, z", &["gimbal-friction"], |plain| Bearing {
            friction: GIMBAL,
            ..plain
        }),
        (STICKING, &["gimbal-friction"], |plain| Bearing { friction: GIMBAL, kicks: 0.5, ..plain }),
        ("dry friction 1, 0, 0 mN m", &["gimbal-friction"], |plain| Bearing {
            friction: Friction::Gimbal([0.001, 0.0, 0.0], [0.0; 3]),
            ..plain
        }),
        ("dry and viscous friction about each axis", &["gimbal-friction"], |plain| Bearing {
            friction: Friction::Gimbal([0.003, 0.005, 0.002], [0.001, 0.0005, 0.002]),
            ..plain
        }),
        ("dry friction 5 mN m against the vector", &["bearing-friction"], |plain| Bearing {
            friction: BALL,
            ..plain
        }),
        ("thrust 5 % weaker", &["thrust-scale"], |plain| Bearing { thrust: 0.95, ..plain }),
        ("inertia 10 % larger", &["inertia-error"], |plain| Bearing { inertia: [1.1; 3], ..plain }),
        ("inertia about x and y 10 % larger", &["inertia-error"], |plain| Bearing {
            inertia: [1.1, 1.1, 1.0],
            ..plain
        }),
        ("static moment 10 g m", &["rig-pendulum"], |plain| Bearing { static_moment_kg_m: 0.01, ..plain }),
        ("static moment 10 g m, thrust 5 % weaker", &["rig-pendulum", "thrust-scale"], |plain| Bearing {
            static_moment_kg_m: 0.01,
            thrust: 0.95,
            ..plain
        }),
        ("thrust 5 % weaker, dry friction 4, 6, 3 mN m", &["thrust-scale", "gimbal-friction"], |plain| {
            Bearing { thrust: 0.95, friction: GIMBAL, ..plain }
        }),
    ];

/// Channels of a log, and the vehicle with them.
pub type Logged = (&'static str, fn(Rig) -> Rig);

/// A vehicle on its bearing, and the channels that are not logged.
#[derive(Debug, Clone, Copy)]
pub struct Rig {
    pub bearing: Bearing,
    /// True if only the attitude shows the rotation.
    pub is_without_gyroscope: bool,
}

/// Logs in which ratios are looked for.
pub const LOGS: [Logged; 3] = [
    ("gyroscope", |rig| rig),
    ("gyroscope, rotor speeds", |mut rig| {
        rig.bearing.sensors.has_rotor_speeds = true;
        rig
    }),
    ("attitude alone", |rig| Rig { is_without_gyroscope: true, ..rig }),
];

/// The true ratios of a vehicle on its bearing, as multiples of the declared: thrust by inertia about x and y, drag torque by inertia about z.
pub fn true_ratios(bearing: &Bearing) -> [f64; 3] {
    let [x, y, z] = bearing.inertia;
    [bearing.thrust / x, bearing.thrust / y, 1.0 / z]
}

/// Errors of the ratios by axis, as a part of the truth, with half of their intervals, where these effects are known to act.
pub fn errors_of_ratios(rig: &Rig, effects: &[&str]) -> [(f64, f64); 3] {
    let mut set = rig.bearing.flights("hummingbird.toml");
    if rig.is_without_gyroscope {
        set.flights.iter_mut().for_each(|flight| flight.angular_velocity = Channel::default());
    }
    let vehicle = Vehicle::load(&set.vehicle).expect("a vehicle file");
    let (mut problem, _) = problem(&vehicle, &[], &set).expect("flights to identify on");
    let of_effect = |name: &&str| problem.model.parameters.of_name(name);
    let free: Vec<usize> = effects.iter().flat_map(of_effect).collect();
    let mut fitted = problem.fitted(&problem.model.parameters.baseline(), &[]);
    for _ in 0..3 {
        problem.weigh(&fitted, &[]);
        fitted = problem.fitted(&fitted.values, &free);
    }
    let found = Ratios::of(&problem, &fitted).expect("rotation alone");
    let truth = true_ratios(&rig.bearing);
    std::array::from_fn(|axis| {
        let ratio = found.of_axes[axis];
        (ratio.value / truth[axis] - 1.0, 0.5 * (ratio.high - ratio.low) / truth[axis])
    })
}

/// Judgement of a report on a hidden truth.
#[derive(Debug, PartialEq, Eq)]
pub enum Judgement {
    /// The true effects are named, and no other.
    Right,
    /// An effect is named in the place of a true one that it is said to be confused with.
    Confounded,
    /// A true effect is neither named nor confused with a named one.
    Missed,
    /// An effect is named that is neither true nor confused with a true one that is not named.
    False,
}

pub fn report(bearing: &Bearing) -> Report {
    identify(&bearing.flights("hummingbird.toml"), &mut |_| ()).expect("flights to identify on").report
}

pub fn judged(truth: &[&str], report: &Report) -> Judgement {
    let missed: Vec<&&str> = truth.iter().filter(|name| !report.verdict.contains(*name)).collect();
    let rivals = |name: &str| report.effects[name].confused_with.clone();
    let is_rival = |name: &str| rivals(name).iter().any(|rival| missed.contains(&rival));
    let is_false = |name: &&&str| !truth.contains(*name) && !is_rival(name);
    if report.verdict.iter().any(|name| is_false(&name)) {
        return Judgement::False;
    }
    let is_told = |name: &&&str| report.verdict.iter().any(|named| rivals(named).contains(*name));
    match missed {
        missed if missed.is_empty() => Judgement::Right,
        missed if missed.iter().all(is_told) => Judgement::Confounded,
        _ => Judgement::Missed,
    }
}
