//! The functions of FMI 2.0 for co-simulation (FMI 2.0.4, section 2.1 and 4.2).
#![allow(non_snake_case, reason = "the names are the standard's")]

use crate::handle::{self, ERROR, Log, OK, on, places, refused, text, values};
use fmu::Number;
use percent_encoding::percent_decode;
use std::ffi::{OsStr, c_char, c_int, c_void};
use std::os::unix::ffi::OsStrExt as _;
use std::path::Path;
use std::ptr::null_mut;

/// `fmi2CoSimulation`.
const CO_SIMULATION: c_int = 1;

/// The beginning of `fmi2CallbackFunctions`.
#[repr(C)]
pub struct Callbacks {
    log: Option<unsafe extern "C" fn(*mut c_void, *const c_char, c_int, *const c_char, *const c_char, ...)>,
    allocate: *const c_void,
    free: *const c_void,
    step_finished: *const c_void,
    environment: *mut c_void,
}

#[unsafe(no_mangle)]
extern "C" fn fmi2GetTypesPlatform() -> *const c_char {
    c"default".as_ptr()
}

#[unsafe(no_mangle)]
extern "C" fn fmi2GetVersion() -> *const c_char {
    c"2.0".as_ptr()
}

#[unsafe(no_mangle)]
extern "C" fn fmi2SetDebugLogging(_: *mut c_void, _: c_int, _: usize, _: *const *const c_char) -> c_int {
    OK
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2Instantiate(
    name: *const c_char,
    kind: c_int,
    token: *const c_char,
    resources: *const c_char,
    callbacks: *const Callbacks,
    _visible: c_int,
    _logging: c_int,
) -> *mut c_void {
    if kind != CO_SIMULATION {
        return null_mut();
    }
    // SAFETY: the importer's promise.
    let (name, token, uri, callbacks) =
        unsafe { (text(name), text(token), text(resources), callbacks.as_ref()) };
    let log = callbacks.and_then(|callbacks| Some(Log::Two(callbacks.log?, callbacks.environment)));
    let uri = uri.to_bytes();
    let path: Vec<u8> = percent_decode(path_of(uri)).collect();
    handle::instantiate(name, token, Path::new(OsStr::from_bytes(&path)), log)
}

/// The path of a URI: of file:///x, file://localhost/x, and file:/x as some tools write it.
fn path_of(uri: &[u8]) -> &[u8] {
    match uri.strip_prefix(b"file://") {
        Some(rest) => &rest[rest.iter().position(|byte| *byte == b'/').unwrap_or(0)..],
        None => uri.strip_prefix(b"file:").unwrap_or(uri),
    }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2FreeInstance(instance: *mut c_void) {
    // SAFETY: the importer's promise.
    unsafe { handle::free(instance) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2SetupExperiment(
    instance: *mut c_void,
    _has_tolerance: c_int,
    _tolerance: f64,
    start_s: f64,
    _has_stop: c_int,
    _stop_s: f64,
) -> c_int {
    let check = |is_zero: bool| {
        if is_zero { Ok(()) } else { Err(format!("the simulation starts at 0 s, not at {start_s} s")) }
    };
    // SAFETY: the importer's promise.
    unsafe { on(instance, |_| check(start_s == 0.0)) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2EnterInitializationMode(instance: *mut c_void) -> c_int {
    // SAFETY: the importer's promise.
    unsafe { on(instance, |_| Ok(())) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2ExitInitializationMode(instance: *mut c_void) -> c_int {
    // SAFETY: the importer's promise.
    unsafe { on(instance, |simulation| simulation.initialize()) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2Terminate(instance: *mut c_void) -> c_int {
    // SAFETY: the importer's promise.
    unsafe {
        on(instance, |simulation| {
            simulation.end("it was terminated");
            Ok(())
        })
    }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2Reset(instance: *mut c_void) -> c_int {
    // SAFETY: the importer's promise.
    unsafe { on(instance, |simulation| simulation.reset()) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2DoStep(
    instance: *mut c_void,
    time_s: f64,
    period_s: f64,
    _is_final: c_int,
) -> c_int {
    // SAFETY: the importer's promise.
    unsafe { on(instance, |simulation| simulation.step(time_s, period_s)) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2GetReal(
    instance: *mut c_void,
    references: *const u32,
    count: usize,
    first: *mut f64,
) -> c_int {
    // SAFETY: the importer's promise.
    let (references, places) = unsafe { (values(references, count), places(first, count)) };
    let get = |simulation: &mut crate::simulation::Simulation| {
        for (reference, place) in references.iter().zip(places) {
            *place = simulation.get(*reference)?.float();
        }
        Ok(())
    };
    // SAFETY: as before.
    unsafe { on(instance, get) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2SetReal(
    instance: *mut c_void,
    references: *const u32,
    count: usize,
    first: *const f64,
) -> c_int {
    // SAFETY: the importer's promise.
    let (references, numbers) = unsafe { (values(references, count), values(first, count)) };
    let mut pairs = references.iter().zip(numbers);
    // SAFETY: as before.
    unsafe {
        on(instance, |simulation| {
            pairs.try_for_each(|(reference, number)| simulation.set(*reference, Number::Float(*number)))
        })
    }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2GetInteger(
    instance: *mut c_void,
    references: *const u32,
    count: usize,
    first: *mut c_int,
) -> c_int {
    // SAFETY: the importer's promise.
    let (references, places) = unsafe { (values(references, count), places(first, count)) };
    let get = |simulation: &mut crate::simulation::Simulation| {
        for (reference, place) in references.iter().zip(places) {
            let number = simulation.get(*reference)?;
            *place = number.integer().ok_or_else(|| format!("{number} is no integer of 32 bits"))?;
        }
        Ok(())
    };
    // SAFETY: as before.
    unsafe { on(instance, get) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2SetInteger(
    instance: *mut c_void,
    references: *const u32,
    count: usize,
    first: *const c_int,
) -> c_int {
    // SAFETY: the importer's promise.
    let (references, numbers) = unsafe { (values(references, count), values(first, count)) };
    let mut pairs = references.iter().zip(numbers);
    let set = |simulation: &mut crate::simulation::Simulation| {
        pairs
            .try_for_each(|(reference, number)| simulation.set(*reference, Number::Integer((*number).into())))
    };
    // SAFETY: as before.
    unsafe { on(instance, set) }
}

refused! {
    fmi2GetBoolean fmi2GetString fmi2SetBoolean fmi2SetString
    fmi2GetFMUstate fmi2SetFMUstate fmi2FreeFMUstate
    fmi2SerializedFMUstateSize fmi2SerializeFMUstate fmi2DeSerializeFMUstate
    fmi2GetDirectionalDerivative fmi2SetRealInputDerivatives fmi2GetRealOutputDerivatives
    fmi2GetStatus fmi2GetRealStatus fmi2GetIntegerStatus fmi2GetBooleanStatus fmi2GetStringStatus
}

#[unsafe(no_mangle)]
extern "C" fn fmi2CancelStep(_: *mut c_void) -> c_int {
    // No step is ever under way.
    ERROR
}

#[cfg(test)]
mod tests {
    use super::path_of;

    #[test]
    fn a_uri_of_a_file_with_and_without_an_authority_is_a_path() {
        for uri in ["file:///a/b%20c", "file://localhost/a/b%20c", "file:/a/b%20c", "/a/b%20c"] {
            assert_eq!(path_of(uri.as_bytes()), b"/a/b%20c", "{uri}");
        }
    }
}
