//! An instance of an FMU, behind one interface for both versions of the standard.

use crate::functions::{Component, StateFunctions};
use crate::values::Values;
use std::ffi::{CStr, CString};

/// An instance of an FMU. Its functions return the reason in words if they fail.
pub trait Instance {
    /// Sets variables.
    ///
    /// # Errors
    /// The reason that the FMU states.
    fn set(&self, references: &[u32], values: &Values) -> Result<(), String>;

    /// Sets a variable of text.
    ///
    /// # Errors
    /// The reason that the FMU states.
    fn set_text(&self, reference: u32, text: &CStr) -> Result<(), String>;

    /// Reads variables.
    ///
    /// # Errors
    /// The reason that the FMU states.
    fn get(&self, references: &[u32], values: &mut Values) -> Result<(), String>;

    /// Computes the initial values, from time 0 on.
    ///
    /// # Errors
    /// The reason that the FMU states.
    fn initialize(&self) -> Result<(), String>;

    /// Steps over `period_s` seconds from `time_s` on.
    ///
    /// # Errors
    /// The reason that the FMU states.
    fn step(&self, time_s: f64, period_s: f64) -> Result<(), String>;

    /// Functions that save its state, if it says that it can.
    fn states(&self) -> Option<(&StateFunctions, Component)>;

    /// Its state as bytes.
    ///
    /// # Errors
    /// The reason that the FMU states.
    fn save(&self) -> Result<Vec<u8>, String> {
        let (states, component) = self.states().ok_or("it has no functions for its state")?;
        // SAFETY: the component is that of this instance.
        unsafe { states.save(component) }
    }

    /// Goes on from the bytes of a state.
    ///
    /// # Errors
    /// The reason that the FMU states.
    fn restore(&self, state: &[u8]) -> Result<(), String> {
        let (states, component) = self.states().ok_or("it has no functions for its state")?;
        // SAFETY: the component is that of this instance.
        unsafe { states.restore(component, state) }
    }
}

/// `text` for C.
///
/// # Errors
/// It holds a NUL.
pub fn c_text(text: &str) -> Result<CString, String> {
    CString::new(text).map_err(|_| format!("`{}` holds a NUL", text.escape_default()))
}
