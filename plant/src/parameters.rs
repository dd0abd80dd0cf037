//! Parameters of a plant in manifests, and the backend that follows from them.

use crate::airframe::Airframe;
use crate::airworthy;
use crate::beyond;
use crate::contact_dynamics::{Misfit, Rapier};
use crate::effects::{self, Quantity};
use crate::newton_euler::NewtonEuler;
use crate::odd;
use crate::origin::{Origin, Physics};
use crate::state::RigidBody;
use component::context::NodeContext;
use diagnostics::parameter::{ParameterError, finite, positive, refuse, within};
use diagnostics::{Diagnostic, nine_decimals};
use inputs::InputFiles;
use nalgebra::{UnitQuaternion, Vector3};
use scenes::{Mesh, Scene};
use serde::Deserialize;
use std::path::{Path, PathBuf};
use vehicles::{EffectEntry, Vehicle};

/// Parameters of the plant.
#[derive(Debug, component::Parameters)]
pub struct Parameters {
    /// Vehicle file, relative to the manifest.
    #[parameter(file = vehicles::FILE)]
    vehicle: PathBuf,
    /// Scene file, relative to the manifest.
    #[parameter(shown = "nothing but the ground", file = scenes::FILE)]
    scene: Option<PathBuf>,
    /// Physics that moves the vehicle: free flight, without ground or contacts, or the same forces in a scene.
    #[parameter(default = BackendName::default(), shown = "newton-euler", range = "`newton-euler`, `rapier`")]
    backend: BackendName,
    /// Centre of mass at tick 0, in the world.
    #[parameter(default = [0.0; 3], check = finite, initial)]
    initial_position_m: [f64; 3],
    /// Its velocity, in the world.
    #[parameter(default = [0.0; 3], check = finite, initial)]
    initial_velocity_m_s: [f64; 3],
    /// Heading at tick 0, counter-clockwise from the world's x.
    #[parameter(default = 0.0, check = finite, initial)]
    initial_yaw_deg: f64,
    /// Integration steps per tick.
    ///
    /// 2 keep chirps of 100 degrees of tilt within 1e-6 m over 10 s at 1 kHz.
    #[parameter(default = 2, check = within(1.0..=SUBSTEPS_MAX, "1 to 1000"))]
    pub(crate) substeps: u32,
    /// With the input `measured`: time between two settings to the measured state.
    #[parameter(shown = "required with `measured`", check = positive)]
    window_s: Option<f64>,
    /// With `rapier`: an impact that is faster is a crash.
    #[parameter(shown = "1.0", check = positive)]
    crash_speed_m_s: Option<f64>,
}

/// The backends by name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum BackendName {
    #[default]
    NewtonEuler,
    Rapier,
}

/// Greatest speed of an impact that a Hummingbird survives: tuned, no source.
const CRASH_SPEED_M_S: f64 = 1.0;

/// More steps than these gain nothing at 1 kHz, and would look like a run that hangs: tuned, no source.
const SUBSTEPS_MAX: f64 = 1000.0;

/// Refuses an initial command that does not have one number for each rotor.
fn refuse_initial(vehicle: &Vehicle, run: &NodeContext<'_>) -> Result<(), ParameterError> {
    let command = run.messages.iter().find(|input| input.port == "command");
    let count = vehicle.rotors.len();
    let wrong = command.and_then(|input| input.initial_count("command")).filter(|found| *found != count);
    wrong.map_or(Ok(()), |found| {
        refuse(true, "inputs.command", || unequal(vehicle, "the initial value of its input", found))
    })?;
    tell_initial(vehicle, &command.map_or(Vec::new(), |input| input.initial_numbers("command")), run);
    Ok(())
}

/// Warns of an initial command beyond the range of the vehicle's motors, which hold it at the end of the range.
fn tell_initial(vehicle: &Vehicle, commands: &[f64], run: &NodeContext<'_>) {
    let map = &vehicle.command;
    let is_within =
        |command: f64| (map.min..=map.max).contains(&command) || (map.zero_is_off && command == 0.0);
    let Some(rotor) = commands.iter().position(|command| !is_within(*command)) else { return };
    let (command, end) = (commands[rotor], if commands[rotor] < map.min { map.min } else { map.max });
    run.warn(
        "inputs.command",
        format!(
            "the initial value of its input `command` has {command} for rotor {rotor}, counted from 0, expected {} to {}, the \
             range of `vehicle` \"{}\" (`command.min`, `command.max`); the motor takes it as {end}; state an `initial` within the range",
            map.min, map.max, vehicle.name
        ),
    );
}

/// The words on a command of `holder` that has `found` numbers.
pub(crate) fn unequal(vehicle: &Vehicle, holder: &str, found: usize) -> String {
    format!(
        "{holder} `command` has {found} motor commands, expected {}, one for each rotor of `vehicle` \"{}\"; give plant \
         and controller the same vehicle file, and the input's `initial` a number for each rotor",
        vehicle.rotors.len(),
        vehicle.name
    )
}

impl Parameters {
    /// Refuses ports that do not go with the scene's free bodies.
    fn refuse_ports(&self, scene: &Scene, run: &NodeContext<'_>) -> Result<(), ParameterError> {
        let has_bodies = scene.bodies().next().is_some();
        refuse(has_bodies && run.has("traffic"), "scene", || {
            format!(
                "`scene` \"{}\" holds free bodies, and the input `traffic` tells of other vehicles: each plant moves \
                 bodies of its own, so they would be somewhere else for every vehicle; leave `traffic` out, or take their \
                 `mass` away",
                scene.name
            )
        })?;
        refuse(!has_bodies && run.has("bodies"), "scene", || {
            format!(
                "the output `bodies` needs a scene in which something has a `mass`; \"{}\" has none",
                scene.name
            )
        })
    }

    /// Refuses invalid parameters.
    fn check(&self, run: &NodeContext<'_>) -> Result<(), ParameterError> {
        let flies_freely = self.backend == BackendName::NewtonEuler;
        let (is_measured, has_window) = (run.has("measured"), self.window_s.is_some());
        let conflicts = [
            (
                flies_freely && self.crash_speed_m_s.is_some(),
                "crash_speed_m_s",
                "`crash_speed_m_s` needs `backend` = \"rapier\": free flight touches nothing",
            ),
            (
                flies_freely && run.has("traffic"),
                "backend",
                "the input `traffic` needs `backend` = \"rapier\": free flight meets nobody",
            ),
            (
                flies_freely && run.has("contact"),
                "backend",
                "the output `contact` needs `backend` = \"rapier\": free flight touches nothing, and would report a \
                 flight through a wall as one without contact",
            ),
            (is_measured && !has_window, "window_s", "the input `measured` needs the parameter `window_s`"),
            (!is_measured && has_window, "window_s", "the parameter `window_s` needs the input `measured`"),
        ];
        let conflicts =
            conflicts.into_iter().map(|(is_wrong, key, message)| refuse(is_wrong, key, || message));
        // A plant that ran less often would apply a command before it was computed.
        let ticks = run.period_ticks;
        let period = refuse(ticks != 1, "period_ticks", || {
            format!("`period_ticks` is {ticks}, expected 1: a plant runs at every tick; leave it out")
        });
        ParameterError::gather(conflicts.chain([period])).map(drop)
    }

    /// Ticks of `tick_s` between two settings to the measured state; longer than any run without.
    pub(crate) fn window_ticks(&self, tick_s: f64) -> Result<u32, ParameterError> {
        let Some(window_s) = self.window_s else { return Ok(u32::MAX) };
        let ticks = (window_s / tick_s).round();
        let is_whole =
            (window_s / tick_s - ticks).abs() < 1e-6 && (1.0..=f64::from(u32::MAX)).contains(&ticks);
        refuse(!is_whole, "window_s", || {
            format!(
                "`window_s` is {window_s} s, which is not a whole number of ticks of {} s, at least one",
                nine_decimals(tick_s)
            )
        })?;
        Ok(ticks as u32)
    }

    /// The vehicle as it is at tick 0, and the backend that flies it; the effects draw their random numbers by the run's
    /// seed and the node's name.
    ///
    /// # Errors
    /// The invalid parameters and files; without those, the reasons why the vehicle cannot fly.
    pub(crate) fn origin(&self, run: &NodeContext<'_>) -> Result<Origin, ParameterError> {
        let ((), (airframe, scene)) = ParameterError::both(self.check(run), self.airframe(&run.files))?;
        let ports = self.refuse_ports(&scene, run);
        let initial = refuse_initial(airframe.vehicle(), run);
        // Before the backend, which a vehicle that is none might not survive.
        airworthy::tell_unsourced(airframe.vehicle(), run);
        odd::tell(&airframe, run);
        scene.meshes.iter().filter_map(Mesh::doubt).for_each(|doubt| run.warn("scene", doubt));
        beyond::tell(airframe.vehicle(), airframe.effects(), &self.start(), run);
        let inertia = airworthy::check_rotor_inertia(airframe.vehicle());
        let dt_s = run.tick_s() / f64::from(self.substeps);
        let steps = airworthy::check_steps(airframe.vehicle(), dt_s, run);
        let is_lifted = scene.rig.is_none() && self.window_s.is_none();
        let lift = if is_lifted { airworthy::check_lift(airframe.vehicle(), run) } else { Ok(()) };
        ParameterError::gather([ports, initial, inertia, steps, lift])?;
        let effects = airframe.initial_state(run.seed, run.name, run.tick_s());
        let model = NewtonEuler::flying(airframe, self.substeps);
        let origin = Origin { model, effects, scene, start: self.start(), physics: self.physics() };
        self.check_scene(&origin, dt_s)?;
        Ok(origin)
    }

    fn physics(&self) -> Physics {
        match self.backend {
            BackendName::NewtonEuler => Physics::Free,
            BackendName::Rapier => {
                Physics::Rapier { crash_speed_m_s: self.crash_speed_m_s.unwrap_or(CRASH_SPEED_M_S) }
            }
        }
    }

    /// Refuses a scene in which the backend cannot fly, or the vehicle cannot start.
    fn check_scene(&self, origin: &Origin, dt_s: f64) -> Result<(), ParameterError> {
        let scene = &origin.scene;
        if let Physics::Rapier { crash_speed_m_s } = origin.physics {
            let mut rapier = origin.begin_in_scene(crash_speed_m_s);
            self.refuse_below_ground(scene)?;
            self.refuse_inside(&rapier, scene)?;
            return self.refuse_bodies(&mut rapier, scene, dt_s);
        }
        let ground = if self.scene.is_some() { self.refuse_below_ground(scene) } else { Ok(()) };
        let has_bodies = scene.bodies().next().is_some() || !scene.joints.is_empty();
        let bodies = refuse(has_bodies, "scene", || {
            let name = &scene.name;
            format!(
                "`scene` \"{name}\" holds free bodies or joints, which need `backend` = \"rapier\": newton-euler moves the vehicle \
                 alone"
            )
        });
        let rig = refuse(scene.rig.is_some(), "scene", || {
            let name = &scene.name;
            format!(
                "`scene` \"{name}\" holds a rig, which needs `backend` = \"rapier\": newton-euler flies freely"
            )
        });
        ParameterError::gather([ground, bodies, rig]).map(drop)
    }

    /// The vehicle as it flies, and the scene around it.
    fn airframe(&self, files: &InputFiles) -> Result<(Airframe, Scene), ParameterError> {
        let vehicle = Vehicle::load_from(files, &self.vehicle);
        let vehicle = vehicle.map_err(|error| with_effects(error, files, &self.vehicle).named_by("vehicle"));
        let load = |path| {
            let scene = Scene::load_from(files, path);
            scene.map_err(|error| with_effects(error, files, path).named_by("scene"))
        };
        let scene = self.scene.as_deref().map_or_else(|| Ok(Scene::default()), load);
        let (vehicle, scene) = ParameterError::both(vehicle, scene)?;
        let rig = refuse_double_rig(&vehicle, &scene);
        let airframe = Airframe::from_files(vehicle, &scene.effects);
        let airframe = airframe.map_err(|error| error.named_by("vehicle"));
        ParameterError::both(airframe, rig).map(|(airframe, ())| (airframe, scene))
    }

    /// Refuses a start below the ground, unless a measured flight gives the start or a rig holds the vehicle.
    fn refuse_below_ground(&self, scene: &Scene) -> Result<(), ParameterError> {
        let is_below = self.initial_position_m[2] < 0.0;
        let is_free = self.window_s.is_none() && scene.rig.is_none();
        refuse(is_below && is_free, "initial_position_m", || {
            format!(
                "`initial_position_m` is {:?}, which is below the ground at z = 0; start at z = 0 or above",
                self.initial_position_m
            )
        })
    }

    /// Refuses a start inside a box or a mesh, unless a measured flight gives the start.
    fn refuse_inside(&self, rapier: &Rapier, scene: &Scene) -> Result<(), ParameterError> {
        let Some(name) = rapier.thing_around().and_then(|number| scene.name_of(number)) else {
            return Ok(());
        };
        refuse(self.window_s.is_none(), "initial_position_m", || {
            format!(
                "`initial_position_m` is {:?}, where the vehicle is partly inside of \"{name}\" in the scene; \
                 move it out",
                self.initial_position_m
            )
        })
    }

    /// Refuses free bodies that start inside of something, and joints that do not fit. If a measured flight gives the
    /// vehicle's start, overlaps with the vehicle and ropes that are too short are not refused.
    fn refuse_bodies(&self, rapier: &mut Rapier, scene: &Scene, dt_s: f64) -> Result<(), ParameterError> {
        let name = |object: u32| match object {
            0 => "the vehicle".to_owned(),
            1 => "the ground".to_owned(),
            _ => format!("\"{}\"", scene.name_of(object as usize - 2).unwrap_or_default()),
        };
        let is_measured = self.window_s.is_some();
        let overlap = rapier.overlap().filter(|both| !is_measured || !both.contains(&0));
        refuse(overlap.is_some(), "scene", || {
            let [first, second] = overlap.unwrap_or_default().map(name);
            format!(
                "`scene` \"{}\" starts with {second} partly inside of {first}, with the vehicle at {:?}; move one of them \
                 (what hangs from the vehicle is placed as seen from it)",
                scene.name, self.initial_position_m
            )
        })?;
        let joint = |number: usize| scene.joints.get(number).map_or("", |joint| &joint.name);
        let is_driven = |number: usize| scene.joints.get(number).is_some_and(|joint| joint.drive.is_some());
        let what = match rapier.misfit() {
            Some(Misfit::Overstretched { joint: number, over_m }) if !is_measured => format!(
                "starts with the ends of \"{}\" {over_m:.4} m farther apart than its `length`, with the vehicle at {:?}; \
                 move an end, or give it more",
                joint(number),
                self.initial_position_m
            ),
            Some(Misfit::Parting { joint: number, rate }) => format!(
                "starts with velocities that tear at \"{}\", by {rate:.4} m/s or rad/s; give its child the `velocity` and the \
                 `angular_velocity` of one motion that the joint allows",
                joint(number)
            ),
            // The pole times the step, as of a motor.
            Some(Misfit::Fast { joint: number, per_s })
                if is_driven(number) && per_s * dt_s > airworthy::POLE_STEPS_MAX =>
            {
                format!(
                    "has a `drive` of \"{}\" whose fastest pole, {per_s:.4} 1/s with the inertia of what it moves, times a step of \
                 {dt_s} s is {:.4}, expected at most {}; lower its `stiffness` or `damping`, or raise `substeps`",
                    joint(number),
                    per_s * dt_s,
                    airworthy::POLE_STEPS_MAX
                )
            }
            Some(Misfit::Fast { joint: number, per_s }) if per_s * dt_s > airworthy::POLE_STEPS_MAX => {
                format!(
                    "has a `damping` of \"{}\" that stops what it moves within {:.1e} s, which a step of {dt_s} s cannot follow; \
                 give it less, at most {:.3} of that, or raise `substeps`",
                    joint(number),
                    per_s.recip(),
                    airworthy::POLE_STEPS_MAX / (per_s * dt_s)
                )
            }
            _ => return Ok(()),
        };
        Err(ParameterError::conflict("scene", format!("`scene` \"{}\" {what}", scene.name)))
    }

    fn start(&self) -> RigidBody {
        let (velocity_W_m_s, yaw_rad) = (self.initial_velocity_m_s.into(), self.initial_yaw_deg.to_radians());
        let attitude_WB = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), yaw_rad);
        RigidBody { velocity_W_m_s, attitude_WB, ..RigidBody::level_at(self.initial_position_m.into()) }
    }
}

/// The faults of the file at `path`, with those of its effects in the catalogue, which the reader of the file does not have.
fn with_effects(fault: Diagnostic, files: &InputFiles, path: &Path) -> Diagnostic {
    let text = files.text(path).unwrap_or_default();
    let entries = vehicles::effects::entries(&text, &path.display().to_string());
    let checked = effects::entry::resolve(&entries).map(drop);
    Diagnostic::gather([Err(fault.clone()), checked]).err().unwrap_or(fault)
}

/// Refuses effects that model the joints of a rig, if the scene has one.
fn refuse_double_rig(vehicle: &Vehicle, scene: &Scene) -> Result<(), ParameterError> {
    let is_rig_effect = |entry: &&EffectEntry| {
        effects::find(&entry.name).is_some_and(|kind| kind.needs.contains(&Quantity::Rig))
    };
    let mut effects = vehicle.effects.iter().chain(&scene.effects);
    let Some(effect) = effects.find(is_rig_effect) else { return Ok(()) };
    refuse(scene.rig.is_some(), "scene", || {
        format!(
            "`scene` \"{}\" holds a rig, whose joints have what the effect \"{}\" stands for: it would count twice; \
             leave the effect out",
            scene.name, effect.name
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn repository(file: &str) -> String {
        format!("{}/../{file}", env!("CARGO_MANIFEST_DIR"))
    }

    #[test]
    fn effects_that_a_rig_has_by_its_joints_are_refused_with_it() {
        let entry = |name| EffectEntry { name, ..effect_entry() };
        for name in ["rig-pendulum", "bearing-friction", "gimbal-friction"] {
            let mut scene = Scene::load(repository("scenes/rig-fixed.toml").as_ref()).unwrap();
            let mut vehicle = Vehicle::load(repository("vehicles/hummingbird.toml").as_ref()).unwrap();
            assert_eq!(refuse_double_rig(&vehicle, &scene), Ok(()));
            vehicle.effects.push(entry(name.to_owned()));
            let error = refuse_double_rig(&vehicle, &scene).unwrap_err().to_string();
            assert!(error.contains("`scene`") && error.contains(name), "{error}");
            scene.effects.append(&mut vehicle.effects);
            assert!(refuse_double_rig(&vehicle, &scene).is_err());
            scene.rig = None;
            assert_eq!(refuse_double_rig(&vehicle, &scene), Ok(()));
        }
    }

    #[test]
    fn a_drive_that_a_step_cannot_follow_is_refused_and_more_substeps_help() {
        let tried = |[from, to]: [&str; 2], dt_s: f64| {
            let text = scenes::reference::DRIVEN_JOINTS;
            assert!(text.contains(from), "{from}");
            let scene = Scene::parse(&text.replacen(from, to, 1), "driven-joints.toml").unwrap();
            let vehicle = Vehicle::load(repository("vehicles/hummingbird.toml").as_ref()).unwrap();
            let airframe = Airframe::new(vehicle);
            let effects = airframe.initial_state(1, "plant", dt_s);
            let start = RigidBody::level_at(Vector3::z());
            let mut rapier = Rapier::new(NewtonEuler::flying(airframe, 1), effects, &scene, &start, 1.0);
            let parameters = serde_json::json!({ "vehicle": "", "initial_position_m": [0.0, 0.0, 1.0] });
            let parameters: Parameters = serde_json::from_value(parameters).unwrap();
            parameters.refuse_bodies(&mut rapier, &scene, dt_s).map_err(|error| error.to_string())
        };
        // 0.18 kg m2 by 1000 N m s/rad, and 20 kg by 4e8 N/m and the dampers: 5556 1/s and 4472 1/s.
        for (changed, told) in [
            (["value = 1.8,", "value = 1000,"], ["\"spindle\"", "5555.5556 1/s"]),
            (["value = 2000,", "value = 4e8,"], ["\"rail\"", "4472.1360 1/s"]),
        ] {
            let error = tried(changed, 1e-3).unwrap_err();
            assert!(error.contains("`substeps`") && told.iter().all(|word| error.contains(word)), "{error}");
            assert_eq!(tried(changed, 4e-4), Ok(()));
        }
        assert_eq!(tried(["value = 1.8,", "value = 1.9,"], 1e-3), Ok(()));
    }

    /// Any effect, from a file.
    fn effect_entry() -> EffectEntry {
        Scene::load(repository("scenes/ground-disturbed.toml").as_ref()).unwrap().effects.remove(0)
    }
}
