//! One step of a node.

use crate::guard::{HB_FAILED, HB_OK, caught, noted};
use bus::dynamic::DynamicTick;
use std::ffi::{CStr, c_char, c_void};
use std::ptr::{null, null_mut};

/// One step of a node, valid until the step returns.
#[derive(Debug)]
pub struct HbTick {
    _private: (),
}

/// Target of an [`HbTick`].
pub(crate) struct Step<'a, 's, 't> {
    tick: &'a mut DynamicTick<'s, 't>,
    /// The first thing that went wrong.
    error: Option<String>,
}

impl<'a, 's, 't> Step<'a, 's, 't> {
    pub fn new(tick: &'a mut DynamicTick<'s, 't>) -> Self {
        Self { tick, error: None }
    }

    /// The handle that the program is given.
    pub fn handle(&mut self) -> *mut HbTick {
        std::ptr::from_mut(self).cast()
    }

    /// Outcome of the step that returned `status`.
    pub fn end(self, status: i32) -> Result<(), String> {
        match (self.error, status) {
            (Some(reason), _) => Err(reason),
            (None, HB_OK) => Ok(()),
            (None, status) => Err(format!("its step returned {status} without a reason (hb_tick_fail)")),
        }
    }

    fn fail(&mut self, reason: String) {
        self.error.get_or_insert(reason);
    }
}

/// The step behind `tick`.
///
/// # Safety
/// `tick` is null or what a step was given, and the step has not returned.
unsafe fn step<'a>(tick: *mut HbTick) -> Result<&'a mut Step<'a, 'a, 'a>, String> {
    // SAFETY: the caller's promise.
    unsafe { tick.cast::<Step<'a, 'a, 'a>>().as_mut() }
        .ok_or_else(|| "the argument `tick` is a null pointer".to_owned())
}

/// The tick's number.
///
/// # Safety
/// `tick` is what the step was given.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hb_tick_number(tick: *mut HbTick) -> u32 {
    // SAFETY: the caller's promise.
    noted(|| Ok(unsafe { step(tick) }?.tick.number()), 0)
}

/// Simulation time in nanoseconds.
///
/// # Safety
/// As `hb_tick_number`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hb_tick_time_ns(tick: *mut HbTick) -> u64 {
    // SAFETY: the caller's promise.
    noted(|| Ok(unsafe { step(tick) }?.tick.time_ns()), 0)
}

/// The newest message of input `input` that this tick may see: memory of its sender, shared, not to be written, aligned to
/// eight bytes, valid until the step returns. Null if `hb_node_input` has given no such number; the step has failed then.
///
/// # Safety
/// As `hb_tick_number`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hb_tick_input(tick: *mut HbTick, input: u32) -> *const c_void {
    // SAFETY: the caller's promise.
    unsafe { in_step(tick, null(), |step| Ok(step.tick.input(input as usize)?.as_ptr().cast())) }
}

/// Memory of the message of output `output`: shared, zeros until the step writes them, aligned to eight bytes, valid until the
/// step returns. Null if the step sends none, and if `hb_node_output` has given no such number; the step has failed then. The
/// bus fills in the stamp, and sends the message when the step has returned.
///
/// # Safety
/// As `hb_tick_number`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hb_tick_output(tick: *mut HbTick, output: u32) -> *mut c_void {
    let memory = |step: &mut Step<'_, '_, '_>| {
        let message = step.tick.output(output as usize)?;
        Ok(message.map_or(null_mut(), |bytes| bytes.as_mut_ptr().cast()))
    };
    // SAFETY: the caller's promise.
    unsafe { in_step(tick, null_mut(), memory) }
}

/// The last message on output `output` of the process whose place this one takes: to go on from without a jump.
/// Given at the tick of the take-over, and only if no state was handed over. Null at every other tick.
///
/// # Safety
/// As `hb_tick_number`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hb_tick_predecessor(tick: *mut HbTick, output: u32) -> *const c_void {
    let sent = |step: &mut Step<'_, '_, '_>| {
        Ok(step.tick.predecessor(output as usize)?.map_or(null(), |bytes| bytes.as_ptr().cast()))
    };
    // SAFETY: the caller's promise.
    unsafe { in_step(tick, null(), sent) }
}

/// Ends the run with `reason` when the step returns. Returns `HB_FAILED`, so that a step can return it.
///
/// # Safety
/// As `hb_tick_number`; `reason` is a text.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hb_tick_fail(tick: *mut HbTick, reason: *const c_char) -> i32 {
    let fail = || {
        // SAFETY: the caller's promise.
        let step = unsafe { step(tick) }?;
        // SAFETY: the caller's promise.
        let reason =
            (!reason.is_null()).then(|| unsafe { CStr::from_ptr(reason) }.to_string_lossy().into_owned());
        step.fail(reason.unwrap_or_else(|| "the step failed without a reason".to_owned()));
        Ok(HB_FAILED)
    };
    noted(fail, HB_FAILED)
}

/// Calls `call`; its error fails the step.
///
/// # Safety
/// As `hb_tick_number`.
unsafe fn in_step<T: Copy>(
    tick: *mut HbTick,
    otherwise: T,
    call: impl FnOnce(&mut Step<'_, '_, '_>) -> Result<T, String>,
) -> T {
    let in_step = || {
        // SAFETY: the caller's promise.
        let step = unsafe { step(tick) }?;
        let called = caught(|| call(step)).and_then(|called| called);
        called.inspect_err(|reason| step.fail(reason.clone()))
    };
    noted(in_step, otherwise)
}
