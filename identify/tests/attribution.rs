//! Flights with an effect that nobody declared: it is named, and nothing else is.
mod simulated;

use flights::{Flight, Role};
use identify::candidate::candidates;
use identify::fit::Bench;
use identify::model::Model;
use identify::parameter::Parameters;
use identify::prepared::Prepared;
use identify::select::{Selection, select};
use plant::effects::Effect;
use simulated::{Plan, effect, fly, vehicle_file};
use vehicles::Vehicle;

fn selected(vehicle: &Vehicle, declared: &[Effect], flights: &[Flight]) -> (Selection, Parameters) {
    let parameters = Parameters::of(vehicle, declared, &[]);
    let model = Model { vehicle: vehicle.clone(), parameters: parameters.clone() };
    let is_flying = |_: &[f64; 4]| true;
    let prepared = |role: Role| -> Vec<Prepared> {
        let of_role = flights.iter().filter(|flight| flight.role == role);
        of_role.map(|flight| Prepared::new(flight, None, is_flying).expect("enough data")).collect()
    };
    let mut bench =
        Bench { model, fit: prepared(Role::Fit), test: prepared(Role::Test), weights: Default::default(), block_s: 1.0, has_own_trims: false };
    let all: Vec<&Prepared> = bench.fit.iter().chain(&bench.test).collect();
    let (open, _) = candidates(&bench.model.parameters, &all);
    (select(&mut bench, &open, &mut |_| ()), parameters)
}

fn flights(vehicle: &Vehicle, plan: &Plan) -> Vec<Flight> {
    let with = |seed, role| fly(vehicle, &Plan { seed, ..plan.clone() }, role);
    vec![with(plan.seed, Role::Fit), with(plan.seed + 1000, Role::Test)]
}

#[test]
fn explore() {
    let vehicle = Vehicle::load(&vehicle_file("hummingbird.toml")).unwrap();
    let cases: Vec<(&str, Vec<Effect>)> = vec![
        ("null", vec![]),
        ("mass", vec![effect("mass-error", &[("error", 0.05)])]),
        ("drag", vec![effect("rotor-drag", &[("coefficient", 8e-5)])]),
        ("parasitic", vec![effect("parasitic-drag", &[("coefficient_xy", 0.01), ("coefficient_z", 0.01)])]),
        ("delay", vec![effect("command-delay", &[("delay", 0.02)])]),
        ("lag", vec![effect("motor-lag", &[("slowness", 0.3)])]),
        ("weak", vec![effect("weak-rotor", &[("loss_2", 0.1)])]),
        ("com", vec![effect("com-offset", &[("x", 0.005), ("y", -0.003)])]),
        ("inertia", vec![effect("inertia-error", &[("error_xx", 0.1), ("error_yy", 0.2)])]),
        ("sag", vec![effect("battery-sag", &[("internal_resistance", 0.06), ("discharge_drop", 2.1), ("discharged", 0.2)])]),
        ("lift", vec![effect("translational-lift", &[("climb_coefficient", 2e-4), ("translational_coefficient", 0.003)])]),
        ("flap", vec![effect("blade-flapping", &[("tilt_per_speed", 0.005), ("hub_stiffness", 0.2)])]),
        ("gyro", vec![effect("gyroscopic-torque", &[("scale_error", 0.5)])]),
        ("scale", vec![effect("thrust-scale", &[("error", -0.05)])]),
    ];
    for (name, truth) in cases {
        let start = std::time::Instant::now();
        let plan = Plan::of(truth, 1);
        let flown = flights(&vehicle, &plan);
        let flown_s = start.elapsed().as_secs_f64();
        let (selection, parameters) = selected(&vehicle, &[], &flown);
        println!("== {name}: {flown_s:.2} s + {:.2} s, {:.4} -> {:.4}", start.elapsed().as_secs_f64() - flown_s,
            selection.before.test_sum(), selection.after.test_sum());
        for candidate in &selection.accepted {
            for at in &candidate.which {
                let own = &parameters.all[*at];
                println!("   {} {} = {:.5} +- {:.5}", own.effect, own.name, selection.after.values[*at],
                    selection.after.deviation(*at).unwrap() * 1.96);
            }
        }
        for (number, round) in selection.rounds.iter().enumerate() {
            let mut judged: Vec<_> = round.judged.iter().collect();
            judged.sort_by(|a, b| b.gain.total_cmp(&a.gain));
            for judged in judged.iter().take(4) {
                println!("   [{number}] {} gain {:.4} c {:.4} p {:.1} {}", judged.candidate.effect, judged.gain, judged.gain_chance,
                    judged.parameter_t, judged.is_accepted);
            }
        }
    }
}
