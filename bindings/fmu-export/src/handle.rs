//! Instances as pointers; errors and panics become a status and a message.

use crate::simulation::Simulation;
use std::ffi::{CStr, CString, c_char, c_int, c_void};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

/// The status of a call that was done.
pub const OK: c_int = 0;
/// The status of one that was not.
pub const ERROR: c_int = 3;

/// The importer's callback for messages.
pub enum Log {
    /// Callback of FMI 2.0: environment, instance, status, category, message.
    Two(
        unsafe extern "C" fn(*mut c_void, *const c_char, c_int, *const c_char, *const c_char, ...),
        *mut c_void,
    ),
    /// Callback of FMI 3.0: environment, status, category, message.
    Three(unsafe extern "C" fn(*mut c_void, c_int, *const c_char, *const c_char), *mut c_void),
}

/// An instance.
struct Handle {
    simulation: Simulation,
    name: CString,
    log: Option<Log>,
}

impl Log {
    fn error(&self, instance: &CStr, message: &str) {
        // A NUL ends it.
        let message = CString::new(message.split('\0').next().unwrap_or_default()).unwrap_or_default();
        let category = c"logStatusError".as_ptr();
        // SAFETY: the importer promised the functions for as long as the instance lives; the texts live as long as the call.
        unsafe {
            match self {
                // The message is not a format: it is the argument of one.
                Self::Two(log, environment) => {
                    log(*environment, instance.as_ptr(), ERROR, category, c"%s".as_ptr(), message.as_ptr());
                }
                Self::Three(log, environment) => log(*environment, ERROR, category, message.as_ptr()),
            }
        }
    }
}

/// A new instance of the simulation in `resources`; null, with a message, if there can be none.
pub fn instantiate(name: &CStr, token: &CStr, resources: &Path, log: Option<Log>) -> *mut c_void {
    match caught(|| Simulation::load(resources, &token.to_string_lossy())) {
        Ok(simulation) => Box::into_raw(Box::new(Handle { simulation, name: name.to_owned(), log })).cast(),
        Err(reason) => {
            if let Some(log) = log {
                log.error(name, &reason);
            }
            std::ptr::null_mut()
        }
    }
}

/// Frees an instance.
///
/// # Safety
/// `instance` is null, or came from [`instantiate`] and was not freed.
pub unsafe fn free(instance: *mut c_void) {
    if !instance.is_null() {
        // SAFETY: the caller's promise.
        let handle: Box<Handle> = unsafe { Box::from_raw(instance.cast()) };
        let _ = caught(|| {
            drop(handle);
            Ok(())
        });
    }
}

/// Calls `call` on the simulation of `instance`; its error goes to the importer's log.
///
/// # Safety
/// As [`free`]; no other call uses the instance meanwhile.
pub unsafe fn on(instance: *mut c_void, call: impl FnOnce(&mut Simulation) -> Result<(), String>) -> c_int {
    // SAFETY: the caller's promise.
    let Some(handle) = (unsafe { instance.cast::<Handle>().as_mut() }) else { return ERROR };
    let mut is_through = false;
    let called = caught(|| {
        let called = call(&mut handle.simulation);
        is_through = true;
        called
    });
    match called {
        Ok(()) => OK,
        Err(reason) => {
            if !is_through {
                handle.simulation.end(&reason);
            }
            if let Some(log) = &handle.log {
                log.error(&handle.name, &reason);
            }
            ERROR
        }
    }
}

/// Refuses a function of the standard that these FMUs do not have.
///
/// # Safety
/// As [`on`].
pub unsafe fn refuse(instance: *mut c_void, function: &str) -> c_int {
    // SAFETY: the caller's promise.
    unsafe { on(instance, |_| Err(format!("{function} is not offered by this FMU"))) }
}

fn caught<T>(call: impl FnOnce() -> Result<T, String>) -> Result<T, String> {
    catch_unwind(AssertUnwindSafe(call)).unwrap_or_else(|panic| {
        let text = panic.downcast_ref::<String>().map(String::as_str);
        let text = text.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or("without a message");
        Err(format!("hummingbus panicked: {text}"))
    })
}

/// The text at `text`; empty for null.
///
/// # Safety
/// `text` is null or a text that lives as long as the result is used.
pub unsafe fn text<'a>(text: *const c_char) -> &'a CStr {
    // SAFETY: the caller's promise.
    if text.is_null() { c"" } else { unsafe { CStr::from_ptr(text) } }
}

/// The `count` values at `first`.
///
/// # Safety
/// They are there as long as the result is used, and nothing writes to them.
pub unsafe fn values<'a, T>(first: *const T, count: usize) -> &'a [T] {
    // SAFETY: the caller's promise.
    if count == 0 { &[] } else { unsafe { std::slice::from_raw_parts(first, count) } }
}

/// The same, to be written.
///
/// # Safety
/// They are there as long as the result is used, and nothing else uses them.
pub unsafe fn places<'a, T>(first: *mut T, count: usize) -> &'a mut [T] {
    // SAFETY: the caller's promise.
    if count == 0 { &mut [] } else { unsafe { std::slice::from_raw_parts_mut(first, count) } }
}

/// Declares functions of the standard that are refused. They take the instance and ignore the arguments
/// behind it. In the C of both platforms the caller puts these in registers and on the stack, and removes
/// them.
macro_rules! refused {
    ($($function:ident)*) => {
        $(
            #[unsafe(no_mangle)]
            unsafe extern "C" fn $function(instance: *mut c_void) -> c_int {
                // SAFETY: the importer's promise.
                unsafe { crate::handle::refuse(instance, stringify!($function)) }
            }
        )*
    };
}
pub(crate) use refused;
