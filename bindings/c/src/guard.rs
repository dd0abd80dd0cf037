//! The border to C: statuses, the text of the last error, and panics that stay on this side.

use bus::BusError;
use std::cell::RefCell;
use std::ffi::{CStr, CString, c_char};
use std::panic::{AssertUnwindSafe, catch_unwind};

/// Success.
pub const HB_OK: i32 = 0;
/// Failure; `hb_last_error` returns the reason.
pub const HB_FAILED: i32 = 1;
/// The launcher aborted the run. The program exits without a message.
pub const HB_ABORTED: i32 = 2;

thread_local! {
    static LAST_ERROR: RefCell<CString> = RefCell::default();
}

/// Reason of the last call on this thread that failed: UTF-8, valid until the next call that fails. Empty if none has.
#[unsafe(no_mangle)]
pub extern "C" fn hb_last_error() -> *const c_char {
    LAST_ERROR.with_borrow(|error| error.as_ptr())
}

/// Notes `reason` as the last error.
pub(crate) fn note(reason: impl ToString) {
    LAST_ERROR.set(c_text(&reason.to_string()));
}

/// `text` as C has it, without NULs in it.
pub(crate) fn c_text(text: &str) -> CString {
    CString::new(text.replace('\0', "?")).unwrap_or_default()
}

/// Status of `call`, whose error becomes the last one. A panic is an error, too.
pub(crate) fn status(call: impl FnOnce() -> Result<(), BusError>) -> i32 {
    match caught(call) {
        Ok(Ok(())) => HB_OK,
        Ok(Err(BusError::Aborted)) => {
            note(BusError::Aborted);
            HB_ABORTED
        }
        Ok(Err(error)) => {
            note(error);
            HB_FAILED
        }
        Err(panic) => {
            note(panic);
            HB_FAILED
        }
    }
}

/// Result of `call`, or the text of its panic.
pub(crate) fn caught<R>(call: impl FnOnce() -> R) -> Result<R, String> {
    // What the call has borrowed is not used again after a panic: the node is refused from then on.
    catch_unwind(AssertUnwindSafe(call)).map_err(|panic| {
        let text = panic.downcast_ref::<&str>().map(ToString::to_string);
        let text = text.or_else(|| panic.downcast_ref::<String>().cloned());
        format!("hummingbus has a defect: {}", text.unwrap_or_else(|| "a panic without words".to_owned()))
    })
}

/// The text at `text`.
///
/// # Errors
/// It is null, or not UTF-8.
///
/// # Safety
/// `text` is null or a C string that lives as long as the result.
pub(crate) unsafe fn text<'a>(text: *const c_char, name: &str) -> Result<&'a str, String> {
    if text.is_null() {
        return Err(format!("the argument `{name}` is a null pointer, expected a text"));
    }
    // SAFETY: the caller's promise is passed on.
    let text = unsafe { CStr::from_ptr(text) };
    text.to_str().map_err(|error| format!("the argument `{name}` is not UTF-8: {error}"))
}

/// The value at `pointer`.
///
/// # Errors
/// It is null.
///
/// # Safety
/// `pointer` is null or points to a value that lives as long as the result and that nobody else uses meanwhile.
pub(crate) unsafe fn mutable<'a, T>(pointer: *mut T, name: &str) -> Result<&'a mut T, String> {
    // SAFETY: the caller's promise is passed on.
    unsafe { pointer.as_mut() }.ok_or_else(|| format!("the argument `{name}` is a null pointer"))
}

/// An error without a node.
pub(crate) fn misuse(reason: String) -> BusError {
    BusError::Program { node: std::env::var(bus::NODE_VARIABLE).unwrap_or_default(), reason }
}

/// Notes what `call` objects to, and returns `otherwise` then.
pub(crate) fn noted<T>(call: impl FnOnce() -> Result<T, String>, otherwise: T) -> T {
    match caught(call) {
        Ok(Ok(value)) => value,
        Ok(Err(reason)) | Err(reason) => {
            note(reason);
            otherwise
        }
    }
}
