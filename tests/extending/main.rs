//! The walk-throughs of docs/extending.md: its files are compiled as they stand there, put into tables, and used.
//!
//! A file of a walk-through names its neighbours as it does in its folder. The names `component` and `crate::…` lead to this
//! crate, which passes on what the crates have, and the new file beside it.
#![allow(non_snake_case, reason = "as in the crates whose files these are: _B names a frame, _N the newton")]

// The new message stands among the messages of `component`, so `component` is this crate with the messages and one more.
extern crate component as real_component;
extern crate self as component;
#[macro_use]
extern crate plant;

pub use plant::rotor;
pub use real_component::*;
pub mod messages {
    //! The messages, and that of the walk-through.
    mod climb;
    pub use climb::Climb;
    pub use real_component::messages::*;
}

pub use controllers::{airframe, allocation, control, law, law_inputs};

mod effects {
    pub mod kind {
        pub use plant::effects::{Action, EffectKind, Quantity, Values};
    }
    pub mod condition {
        pub use plant::effects::FlightCondition;
    }
    pub mod catalogue {
        pub mod yaw_damping;
    }
}

mod cli {
    #[path = "../../../src/cli/files.rs"]
    #[allow(dead_code, reason = "a command uses some of it")]
    pub mod files;
    #[path = "../../../src/cli/kind.rs"]
    #[allow(dead_code, reason = "a command uses some of it")]
    pub mod kind;
    #[path = "../../../src/cli/output.rs"]
    #[allow(dead_code, reason = "a command uses some of it")]
    pub mod output;
    #[path = "../../../src/cli/table.rs"]
    mod table;
    pub mod topics;

    use anyhow::Result;
    use clap::{Parser, Subcommand};
    use table::commands;

    #[derive(Parser)]
    pub struct Cli {
        #[command(subcommand)]
        command: Command,
    }

    commands! {
        /// Print the topics of a recording.
        #[command(after_help = "Example: hummingbus topics hover.mcap")]
        Topics(topics::TopicsArguments) => topics::topics;
    }

    impl Cli {
        pub fn run(&self) -> Result<bool> {
            self.command.run()
        }
    }
}

mod level;
mod variometer;
mod walkthroughs;

use controllers::controller::Controller;
use runtime::graph::Graph;
use runtime::manifest::Manifest;
use runtime::registry::Registry;
use std::path::Path;

/// The table of components with the rows of the walk-throughs, and what a run with them needs.
const COMPONENTS: Registry = Registry::new(&[
    Registration::of::<variometer::Variometer>(),
    Registration::of::<Controller<level::LevelLaw>>(),
    Registration::of::<controllers::pilot::Pilot>(),
    Registration::of::<plant::node::Plant>(),
    Registration::of::<recorder::node::Recorder>(),
]);

fn checked(text: &str) -> Result<Graph, String> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("manifests/walkthrough.toml");
    let manifest = Manifest::parse(text.to_owned(), &path, &[], COMPONENTS);
    Graph::build(&manifest.map_err(|problem| problem.to_string())?).map_err(|problem| problem.to_string())
}

#[test]
fn the_sensor_is_known_to_manifests_with_its_ports_message_and_parameters() {
    let manifest = |parameters: &str| {
        format!(
            "[run]\nduration_s = 1.0\n\
             [process.plant]\nkind = \"plant\"\nvehicle = \"../vehicles/hummingbird.toml\"\n\
             parameters = {{ initial_position_m = [0.0, 0.0, 1.0] }}\n\
             inputs.command = {{ topic = \"/pilot/command\", delay_ticks = 1, initial = {{ command = [76.5, 76.5, 76.5, 76.5] }} }}\n\
             [process.pilot]\ncommand = [\"/bin/true\"]\n\
             outputs.command = {{ type = \"hummingbus_msgs/msg/MotorCommand\" }}\n\
             [process.variometer]\nkind = \"variometer\"\ninputs.state = \"/plant/state\"\n\
             parameters = {{ {parameters} }}\n"
        )
    };
    let graph = checked(&manifest("lag_s = 0.2")).unwrap();
    let topic = graph.plan.topics.iter().find(|topic| topic.name == "/variometer/climb").unwrap();
    assert_eq!(topic.type_name, "hummingbus_msgs/msg/Climb");
    assert!(COMPONENTS.messages().iter().any(|schema| schema.type_name == topic.type_name));
    let problem = checked(&manifest("lag_s = 0.0")).unwrap_err();
    assert!(problem.contains("`lag_s` must be a finite number above 0, found 0"), "{problem}");
}

#[test]
fn the_sensor_steps_without_processes_and_goes_on_from_its_state() {
    let rising = messages::PlantState { velocity: [0.0, 0.0, 2.0].into(), ..Default::default() };
    let parameters = serde_json::json!({ "lag_s": 0.1, "noise_m_s": 0.01 });
    let make = || Harness::<variometer::Variometer>::from_json(&parameters).unwrap();
    Harness::require_transfer(make, |_| variometer::Inputs { state: &rising });
    let mut sensor = make();
    let mut last = 0.0;
    for _ in 0..1000 {
        last = sensor.step(variometer::Inputs { state: &rising }).unwrap().climb.rate;
    }
    assert!((last - 2.0).abs() < 0.1, "ten time constants later it reads {last} m/s");
}

#[test]
fn the_law_is_rehearsed_and_carries_the_weight_at_its_set_point() {
    let registration = COMPONENTS.find("level").unwrap();
    let vehicle = concat!(env!("CARGO_MANIFEST_DIR"), "/vehicles/hummingbird.toml");
    let check = |bandwidth_rad_s: f64| {
        let parameters = serde_json::json!({ "vehicle": vehicle, "bandwidth_rad_s": bandwidth_rad_s });
        registration.check(&parameters, &context::NodeContext::new("level", &["set_point", "estimate"]))
    };
    check(10.0).unwrap();
    assert!(check(2000.0).unwrap_err().to_string().contains("grows from step to step"));
    let parameters = serde_json::json!({ "vehicle": vehicle, "bandwidth_rad_s": 5.0 });
    let mut level = Harness::<Controller<level::LevelLaw>>::from_json(&parameters).unwrap();
    let (set_point, estimate) = (messages::SetPoint::default(), messages::StateEstimate::default());
    let inputs = law_inputs::SetPointInputs { set_point: &set_point, estimate: &estimate, attitude: None };
    let thrust_newton = level.step(inputs).unwrap().status.unwrap().thrust;
    assert!((thrust_newton - 0.48 * 9.81).abs() < 1e-6, "{thrust_newton} N");
}

#[test]
fn the_effect_is_nothing_with_its_neutral_values_and_brakes_with_others() {
    use plant::effects::{Action, FlightCondition};
    let effect = &effects::catalogue::yaw_damping::EFFECT;
    let vehicle = vehicles::Vehicle::load(Path::new("vehicles/hummingbird.toml")).unwrap();
    let mut state = plant::NewtonEuler::new(vehicle.clone(), 1)
        .start(plant::RigidBody::level_at(nalgebra::Vector3::z()), 76.5);
    state.body.angular_velocity_B_rad_s.z = 2.0;
    let condition = FlightCondition::new(&vehicle, &state, &nalgebra::Vector3::zeros());
    let [Action::Wrench(wrench)] = effect.actions else { panic!("{:?}", effect.actions) };
    assert_eq!(wrench(&effect.neutral().values, &condition).torque_B_N_m.norm(), 0.0);
    assert_eq!(wrench(&effect.nominal().values, &condition).torque_B_N_m.z, -2e-4);
}

#[test]
fn the_command_has_help_and_says_what_is_wrong_with_a_file() {
    use clap::{CommandFactory, Parser};
    let mut parser = cli::Cli::command();
    let help = parser.find_subcommand_mut("topics").unwrap().render_help().to_string();
    assert!(help.contains("Print the topics of a recording"), "{help}");
    let error = cli::Cli::parse_from(["hummingbus", "topics", "none.mcap"]).run().unwrap_err();
    assert!(error.to_string().contains("none.mcap"), "{error}");
}
