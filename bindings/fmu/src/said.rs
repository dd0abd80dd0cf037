//! Messages of the FMU: warnings and errors go to the process's output, and the last one explains what fails.

use std::ffi::{CStr, c_char, c_int, c_void};
use std::io::Write as _;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};

/// `fmi2OK` and `fmi3OK`.
const OK: c_int = 0;

/// The last warning or error since a function succeeded.
static LAST: Mutex<String> = Mutex::new(String::new());
/// True if there is one.
static HAS_LAST: AtomicBool = AtomicBool::new(false);

unsafe extern "C" {
    /// The callback for messages of FMI 2.0, in `logger.c`.
    fn hummingbus_fmu_log(
        environment: *mut c_void,
        instance: *const c_char,
        status: c_int,
        category: *const c_char,
        message: *const c_char,
        ...
    );
}

/// Type of the callback for messages of FMI 2.0.
pub type LogMessage2 =
    unsafe extern "C" fn(*mut c_void, *const c_char, c_int, *const c_char, *const c_char, ...);

/// The callback for messages of FMI 2.0.
pub const LOG_MESSAGE_2: LogMessage2 = hummingbus_fmu_log;

/// Takes a message of `logger.c`.
///
/// # Safety
/// `message` is a text.
#[unsafe(no_mangle)]
unsafe extern "C" fn hummingbus_fmu_note(status: c_int, message: *const c_char) {
    // SAFETY: the caller's promise.
    unsafe { note(status, message) };
}

/// The callback for messages of FMI 3.0.
///
/// # Safety
/// The texts are null or end with a NUL.
pub unsafe extern "C" fn log_message_3(
    _environment: *mut c_void,
    status: c_int,
    _category: *const c_char,
    message: *const c_char,
) {
    // SAFETY: the caller's promise.
    unsafe { note(status, message) };
}

/// Keeps a warning or an error, and prints it.
///
/// # Safety
/// `message` is null or a text.
unsafe fn note(status: c_int, message: *const c_char) {
    if status == OK || message.is_null() {
        return;
    }
    // SAFETY: the caller's promise.
    let message = unsafe { CStr::from_ptr(message) }.to_string_lossy();
    let message = message.trim_end();
    // Nobody may read it.
    let _ = writeln!(std::io::stderr(), "the FMU says: {message}");
    if let Ok(mut last) = LAST.lock() {
        message.clone_into(&mut last);
        HAS_LAST.store(true, Ordering::Relaxed);
    }
}

/// Forgets the last message: it explains nothing that comes later.
pub fn forget_last() {
    if HAS_LAST.swap(false, Ordering::Relaxed)
        && let Ok(mut last) = LAST.lock()
    {
        last.clear();
    }
}

/// The function `called`, which returned `status`, in words, with the last message.
pub fn failed(called: &str, status: &str) -> String {
    let last = LAST.lock().map(|last| last.clone()).unwrap_or_default();
    if last.is_empty() {
        format!("{called} returned {status}")
    } else {
        format!("{called} returned {status}: {last}")
    }
}
