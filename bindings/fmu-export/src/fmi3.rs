//! The functions of FMI 3.0 for co-simulation (FMI 3.0.1, section 2.2 and 4.2).
#![allow(non_snake_case, reason = "the names are the standard's")]

use crate::handle::{self, Log, OK, on, places, refused, text, values};
use crate::simulation::Simulation;
use fmu::Number;
use std::ffi::{OsStr, c_char, c_int, c_void};
use std::os::unix::ffi::OsStrExt as _;
use std::path::Path;
use std::ptr::null_mut;

#[unsafe(no_mangle)]
extern "C" fn fmi3GetVersion() -> *const c_char {
    c"3.0".as_ptr()
}

#[unsafe(no_mangle)]
extern "C" fn fmi3SetDebugLogging(_: *mut c_void, _: bool, _: usize, _: *const *const c_char) -> c_int {
    OK
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3InstantiateCoSimulation(
    name: *const c_char,
    token: *const c_char,
    resources: *const c_char,
    _visible: bool,
    _logging: bool,
    _events: bool,
    _early_return: bool,
    _required: *const u32,
    _required_count: usize,
    environment: *mut c_void,
    log: Option<unsafe extern "C" fn(*mut c_void, c_int, *const c_char, *const c_char)>,
    _update: *const c_void,
) -> *mut c_void {
    // SAFETY: the importer's promise.
    let (name, token, resources) = unsafe { (text(name), text(token), text(resources)) };
    let log = log.map(|log| Log::Three(log, environment));
    handle::instantiate(name, token, Path::new(OsStr::from_bytes(resources.to_bytes())), log)
}

#[unsafe(no_mangle)]
extern "C" fn fmi3InstantiateModelExchange() -> *mut c_void {
    null_mut()
}

#[unsafe(no_mangle)]
extern "C" fn fmi3InstantiateScheduledExecution() -> *mut c_void {
    null_mut()
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3FreeInstance(instance: *mut c_void) {
    // SAFETY: the importer's promise.
    unsafe { handle::free(instance) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3EnterInitializationMode(
    instance: *mut c_void,
    _has_tolerance: bool,
    _tolerance: f64,
    start_s: f64,
    _has_stop: bool,
    _stop_s: f64,
) -> c_int {
    let check = |is_zero: bool| {
        if is_zero { Ok(()) } else { Err(format!("the simulation starts at 0 s, not at {start_s} s")) }
    };
    // SAFETY: the importer's promise.
    unsafe { on(instance, |_| check(start_s == 0.0)) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3ExitInitializationMode(instance: *mut c_void) -> c_int {
    // SAFETY: the importer's promise.
    unsafe { on(instance, Simulation::initialize) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3Terminate(instance: *mut c_void) -> c_int {
    // SAFETY: the importer's promise.
    unsafe {
        on(instance, |simulation| {
            simulation.end("it was terminated");
            Ok(())
        })
    }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3Reset(instance: *mut c_void) -> c_int {
    // SAFETY: the importer's promise.
    unsafe { on(instance, Simulation::reset) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3DoStep(
    instance: *mut c_void,
    time_s: f64,
    period_s: f64,
    _is_final: bool,
    event: *mut bool,
    is_ended: *mut bool,
    is_early: *mut bool,
    reached_s: *mut f64,
) -> c_int {
    let step = |simulation: &mut Simulation| {
        simulation.step(time_s, period_s)?;
        // SAFETY: the importer's promise: each is null or a place.
        unsafe {
            for place in [event, is_ended, is_early] {
                if let Some(place) = place.as_mut() {
                    *place = false;
                }
            }
            if let Some(place) = reached_s.as_mut() {
                *place = simulation.time_s();
            }
        }
        Ok(())
    };
    // SAFETY: the importer's promise.
    unsafe { on(instance, step) }
}

/// Refuses a number of values that is not that of the references: no variable is an array.
fn require_scalars(references: usize, values: usize) -> Result<(), String> {
    let differ =
        || Err(format!("there are {references} references and {values} values; no variable is an array"));
    if references == values { Ok(()) } else { differ() }
}

/// The functions that read and write variables of one type.
macro_rules! variables {
    ($($type:ty: $get:ident $read:expr, $set:ident $write:expr;)*) => {
        $(
            #[unsafe(no_mangle)]
            unsafe extern "C" fn $get(
                instance: *mut c_void,
                references: *const u32,
                count: usize,
                first: *mut $type,
                length: usize,
            ) -> c_int {
                // SAFETY: the importer's promise.
                let (references, places) = unsafe { (values(references, count), places(first, length)) };
                let get = |simulation: &mut Simulation| {
                    require_scalars(count, length)?;
                    for (reference, place) in references.iter().zip(places) {
                        let number = simulation.get(*reference)?;
                        let read: Option<$type> = $read(number);
                        *place = read.ok_or_else(|| format!("{number} is no {}", stringify!($type)))?;
                    }
                    Ok(())
                };
                // SAFETY: as before.
                unsafe { on(instance, get) }
            }

            #[unsafe(no_mangle)]
            unsafe extern "C" fn $set(
                instance: *mut c_void,
                references: *const u32,
                count: usize,
                first: *const $type,
                length: usize,
            ) -> c_int {
                // SAFETY: the importer's promise.
                let (references, numbers) = unsafe { (values(references, count), values(first, length)) };
                let set = |simulation: &mut Simulation| {
                    require_scalars(count, length)?;
                    let mut pairs = references.iter().zip(numbers);
                    pairs.try_for_each(|(reference, number)| simulation.set(*reference, $write(*number)))
                };
                // SAFETY: as before.
                unsafe { on(instance, set) }
            }
        )*
    };
}

variables! {
    f64: fmi3GetFloat64 |number: Number| Some(number.float()), fmi3SetFloat64 Number::Float;
    i32: fmi3GetInt32 |number: Number| number.integer(), fmi3SetInt32 |number: i32| Number::Integer(number.into());
}

refused! {
    fmi3GetFloat32 fmi3GetInt8 fmi3GetUInt8 fmi3GetInt16 fmi3GetUInt16 fmi3GetUInt32 fmi3GetInt64 fmi3GetUInt64
    fmi3GetBoolean fmi3GetString fmi3GetBinary fmi3GetClock
    fmi3SetFloat32 fmi3SetInt8 fmi3SetUInt8 fmi3SetInt16 fmi3SetUInt16 fmi3SetUInt32 fmi3SetInt64 fmi3SetUInt64
    fmi3SetBoolean fmi3SetString fmi3SetBinary fmi3SetClock
    fmi3GetNumberOfVariableDependencies fmi3GetVariableDependencies
    fmi3GetFMUState fmi3SetFMUState fmi3FreeFMUState
    fmi3SerializedFMUStateSize fmi3SerializeFMUState fmi3DeserializeFMUState
    fmi3GetDirectionalDerivative fmi3GetAdjointDerivative
    fmi3EnterConfigurationMode fmi3ExitConfigurationMode fmi3EnterEventMode fmi3EnterStepMode
    fmi3GetIntervalDecimal fmi3GetIntervalFraction fmi3GetShiftDecimal fmi3GetShiftFraction
    fmi3SetIntervalDecimal fmi3SetIntervalFraction fmi3SetShiftDecimal fmi3SetShiftFraction
    fmi3EvaluateDiscreteStates fmi3UpdateDiscreteStates fmi3GetOutputDerivatives fmi3ActivateModelPartition
    fmi3EnterContinuousTimeMode fmi3CompletedIntegratorStep fmi3SetTime fmi3SetContinuousStates
    fmi3GetContinuousStateDerivatives fmi3GetEventIndicators fmi3GetContinuousStates
    fmi3GetNominalsOfContinuousStates fmi3GetNumberOfEventIndicators fmi3GetNumberOfContinuousStates
}
