//! Parameters and files that firmwares have in common.

use bus::context::NodeContext;
use bus::{FileKind, FileRole};
use controllers::airframe::ControlledVehicle;
use diagnostics::parameter::refuse;
use diagnostics::{Diagnostic, ParameterError};
use std::path::Path;
use std::time::Duration;
use vehicles::{Rotor, Vehicle};

/// Programs of firmwares, for parameters that name one.
pub const FIRMWARE: FileKind = FileKind::of(FileRole::Program);

/// First channel of a switch; those before are the sticks.
const FIRST_SWITCH: usize = 5;
/// Longest rest before tick 0, s.
pub const REST_MAX_S: f64 = 3600.0;
/// First bytes of a program for 64-bit Linux on a little-endian processor.
const ELF_64: &[u8] = b"\x7fELF\x02\x01";
/// Longest host time that an answer may take, s.
pub const REPLY_TIMEOUT_MAX_S: f64 = 3600.0;

/// Host time that an answer may take, unless a manifest says otherwise, s.
#[must_use]
pub fn reply_timeout_s() -> f64 {
    5.0
}

/// The bytes of the file at `path`, which `key` names.
///
/// # Errors
/// It cannot be read.
pub fn file(context: &NodeContext<'_>, key: &'static str, path: &Path) -> Result<Vec<u8>, ParameterError> {
    let bytes = context
        .files
        .bytes(path)
        .map_err(|error| ParameterError::conflict(key, format!("cannot read {}: {error}", path.display())))
        .map_err(|error| error.advised(Diagnostic::CHECK_PATH))?;
    Ok(bytes.to_vec())
}

/// The 64-bit Linux program at `path`; `expected` says which, and where a build puts it.
///
/// # Errors
/// It cannot be read, or is no such program.
pub fn program(context: &NodeContext<'_>, path: &Path, expected: &str) -> Result<Vec<u8>, ParameterError> {
    let program = file(context, "firmware", path)?;
    refuse(!program.starts_with(ELF_64), "firmware", || {
        format!("{}: expected a 64-bit Linux program (ELF): {expected}", path.display())
    })?;
    Ok(program)
}

/// The program at `path`, into which a library can be preloaded; `expected` as for [`program`].
///
/// # Errors
/// It cannot be read, or is no such program.
pub fn preloadable(
    context: &NodeContext<'_>,
    path: &Path,
    expected: &str,
) -> Result<Vec<u8>, ParameterError> {
    let program = program(context, path, expected)?;
    refuse(!has_interpreter(&program), "firmware", || {
        format!(
            "{}: it is linked statically, so that its clock stays the host's: no two runs would agree, and a run that waits for its \
             answers would stall; build it with shared libraries",
            path.display()
        )
    })?;
    Ok(program)
}

/// Refuses a program in which the text `mark` does not occur; `reason` says why it is needed.
///
/// # Errors
/// The text does not occur.
pub fn require_text(program: &[u8], path: &Path, mark: &str, reason: &str) -> Result<(), ParameterError> {
    let has_text = program.windows(mark.len()).any(|window| window == mark.as_bytes());
    refuse(!has_text, "firmware", || {
        format!("{}: {reason}: the text `{mark}` does not occur in it", path.display())
    })
    .map_err(|error| error.advised("build the firmware as docs/firmware.md says, and name that program"))
}

/// True for an ELF program with a program header that names the dynamic linker.
fn has_interpreter(program: &[u8]) -> bool {
    /// Type of that header (`PT_INTERP`).
    const INTERPRETER: u32 = 3;
    let number = |at: usize, size: usize| -> Option<u64> {
        let bytes = program.get(at..at.checked_add(size)?)?;
        Some(bytes.iter().rev().fold(0, |number, byte| (number << 8) | u64::from(*byte)))
    };
    let headers = || {
        let (first, size, count) = (number(32, 8)?, number(54, 2)?, number(56, 2)?);
        let at = |index: u64| usize::try_from(first.checked_add(size * index)?).ok();
        Some((0..count).any(|index| at(index).and_then(|at| number(at, 4)) == Some(INTERPRETER.into())))
    };
    headers() == Some(true)
}

/// The text of the configuration at `path`; empty without one.
///
/// # Errors
/// It cannot be read.
pub fn configuration(context: &NodeContext<'_>, path: Option<&Path>) -> Result<String, ParameterError> {
    let bytes = path.map(|path| file(context, "configuration", path)).transpose()?;
    Ok(bytes.map_or(String::new(), |bytes| String::from_utf8_lossy(&bytes).into_owned()))
}

/// The vehicle at `path`, by the same checks as those of controllers. Warns of rotors that have failed: no firmware is told.
///
/// # Errors
/// It is refused, or its rotors cannot hover.
pub fn vehicle(context: &NodeContext<'_>, path: &Path) -> Result<Vehicle, ParameterError> {
    let vehicle = ControlledVehicle::load(&context.files, path)?.vehicle;
    for (at, _) in vehicle.rotors.iter().enumerate().filter(|(_, rotor)| rotor.has_failed) {
        let Rotor { name, .. } = &vehicle.rotors[at];
        let odd = format!("has a rotor \"{name}\" that has failed, and the firmware counts on each");
        warn_of_vehicle(context, &vehicle, &odd, &format!("rotors.{at}."));
    }
    Ok(vehicle)
}

/// Warns of something odd about `vehicle`, with the first number in its file whose key begins with `key`.
pub fn warn_of_vehicle(context: &NodeContext<'_>, vehicle: &Vehicle, odd: &str, key: &str) {
    let number = vehicle.provenance.iter().find(|number| number.key.starts_with(key));
    let place = number.map_or(String::new(), |it| format!("; look at {}:{}: `{}`", it.file, it.line, it.key));
    context.warn("vehicle", format!("`vehicle` \"{}\" {odd}{place}", vehicle.name));
}

/// The refusal of a vehicle.
#[must_use]
pub fn refused_vehicle(vehicle: &Vehicle, reason: &str) -> ParameterError {
    ParameterError::conflict("vehicle", format!("{}: {reason}", vehicle.name))
}

/// Checks that the arming switch is one of the switches among `channels`.
///
/// # Errors
/// It is a stick, or there is no such channel.
pub fn check_arming(channel: Option<usize>, channels: usize) -> Result<(), ParameterError> {
    let Some(channel) = channel else { return Ok(()) };
    refuse(!(FIRST_SWITCH..=channels).contains(&channel), "armed_by_channel", || {
        format!(
            "`armed_by_channel` is {channel}, expected {FIRST_SWITCH} to {channels}: the first four are the sticks"
        )
    })
}

/// Checks the rest before tick 0, of whose last `armed_s` the arming switch is on: a firmware arms when it sees the switch move.
///
/// # Errors
/// It is too short for the switch to be seen off.
pub fn check_rest(rest_s: f64, armed_s: f64, armed_by_channel: Option<usize>) -> Result<(), ParameterError> {
    refuse(armed_by_channel.is_some() && rest_s <= armed_s, "rest_s", || {
        format!(
            "`rest_s` is {rest_s} s, expected more than {armed_s} s with `armed_by_channel`: the switch moves {armed_s} s before tick \
             0, and a firmware arms when it sees it move"
        )
    })
}

/// Time that an answer may take, of a number of seconds within its range.
#[must_use]
pub fn reply_timeout(seconds: f64) -> Duration {
    // No socket waits for less than a microsecond.
    Duration::from_secs_f64(seconds.max(1e-3))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Any bytes are answered.
    #[test]
    fn what_is_cut_is_no_program() {
        let program = std::fs::read("/proc/self/exe").unwrap();
        assert!(has_interpreter(&program), "this test is linked with shared libraries");
        for length in [0, 3, 6, 40, 64, 100] {
            assert!(!has_interpreter(&program[..length]), "{length}");
        }
    }
}
