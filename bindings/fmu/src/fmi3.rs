//! Instances of FMI 3.0.

use crate::description::Description;
use crate::functions::{Component, StateFunctions, Status, check, functions, has_failed, is_broken, load};
use crate::instance::{Instance, c_text};
use crate::said::{failed, log_message_3};
use crate::values::Values;
use libloading::Library;
use std::cell::Cell;
use std::ffi::{CStr, c_char, c_int, c_void};
use std::mem::ManuallyDrop;
use std::path::Path;
use std::ptr::{null, null_mut};

const STATE_FUNCTIONS: [&str; 6] = [
    "fmi3GetFMUState",
    "fmi3SetFMUState",
    "fmi3FreeFMUState",
    "fmi3SerializedFMUStateSize",
    "fmi3SerializeFMUState",
    "fmi3DeserializeFMUState",
];

/// `fmi3LogMessageCallback`.
type LogMessage = unsafe extern "C" fn(*mut c_void, c_int, *const c_char, *const c_char);

functions! {
    /// Functions of FMI 3.0 that are called here.
    Functions {
        fmi3InstantiateCoSimulation: fn(
            *const c_char, *const c_char, *const c_char, bool, bool, bool, bool, *const u32, usize, *mut c_void,
            LogMessage, *const c_void
        ) -> Component;
        fmi3FreeInstance: fn(Component);
        fmi3EnterInitializationMode: fn(Component, bool, f64, f64, bool, f64) -> Status;
        fmi3ExitInitializationMode: fn(Component) -> Status;
        fmi3Terminate: fn(Component) -> Status;
        fmi3DoStep: fn(Component, f64, f64, bool, *mut u8, *mut u8, *mut u8, *mut f64) -> Status;
        fmi3GetFloat64: fn(Component, *const u32, usize, *mut f64, usize) -> Status;
        fmi3SetFloat64: fn(Component, *const u32, usize, *const f64, usize) -> Status;
        fmi3GetFloat32: fn(Component, *const u32, usize, *mut f32, usize) -> Status;
        fmi3SetFloat32: fn(Component, *const u32, usize, *const f32, usize) -> Status;
        fmi3GetInt64: fn(Component, *const u32, usize, *mut i64, usize) -> Status;
        fmi3SetInt64: fn(Component, *const u32, usize, *const i64, usize) -> Status;
        fmi3GetInt32: fn(Component, *const u32, usize, *mut i32, usize) -> Status;
        fmi3SetInt32: fn(Component, *const u32, usize, *const i32, usize) -> Status;
        fmi3GetInt16: fn(Component, *const u32, usize, *mut i16, usize) -> Status;
        fmi3SetInt16: fn(Component, *const u32, usize, *const i16, usize) -> Status;
        fmi3GetInt8: fn(Component, *const u32, usize, *mut i8, usize) -> Status;
        fmi3SetInt8: fn(Component, *const u32, usize, *const i8, usize) -> Status;
        fmi3GetUInt64: fn(Component, *const u32, usize, *mut u64, usize) -> Status;
        fmi3SetUInt64: fn(Component, *const u32, usize, *const u64, usize) -> Status;
        fmi3GetUInt32: fn(Component, *const u32, usize, *mut u32, usize) -> Status;
        fmi3SetUInt32: fn(Component, *const u32, usize, *const u32, usize) -> Status;
        fmi3GetUInt16: fn(Component, *const u32, usize, *mut u16, usize) -> Status;
        fmi3SetUInt16: fn(Component, *const u32, usize, *const u16, usize) -> Status;
        fmi3GetUInt8: fn(Component, *const u32, usize, *mut u8, usize) -> Status;
        fmi3SetUInt8: fn(Component, *const u32, usize, *const u8, usize) -> Status;
        fmi3GetBoolean: fn(Component, *const u32, usize, *mut u8, usize) -> Status;
        fmi3SetBoolean: fn(Component, *const u32, usize, *const u8, usize) -> Status;
        fmi3SetString: fn(Component, *const u32, usize, *const *const c_char, usize) -> Status;
    }
}

/// An instance.
pub struct Fmi3 {
    functions: Functions,
    states: Option<StateFunctions>,
    component: Component,
    is_initialized: Cell<bool>,
    /// Never unloaded: few libraries bear that, and the process ends with the run.
    _library: ManuallyDrop<Library>,
}

impl Fmi3 {
    /// Loads the library at `path` and makes an instance called `name`.
    ///
    /// # Errors
    /// It cannot be loaded, lacks a function, or refuses.
    pub fn instantiate(
        path: &Path,
        resources: &Path,
        description: &Description,
        name: &str,
    ) -> Result<Self, String> {
        let library = load(path)?;
        let functions = Functions::of(&library)?;
        let states =
            description.saves_state.then(|| StateFunctions::of(&library, STATE_FUNCTIONS)).transpose()?;
        // With the separator at its end, as the standard asks; null where there are none.
        let path = resources.is_dir().then(|| c_text(&format!("{}/", resources.display()))).transpose()?;
        let resources = path.as_ref().map_or(null(), |path| path.as_ptr());
        let (name, token) = (c_text(name)?, c_text(&description.token)?);
        // SAFETY: the texts live as long as the call.
        let component = unsafe {
            (functions.fmi3InstantiateCoSimulation)(
                name.as_ptr(),
                token.as_ptr(),
                resources,
                false,
                // Messages on: those that are no warnings are dropped by the callback.
                true,
                false,
                false,
                null(),
                0,
                null_mut(),
                log_message_3,
                null(),
            )
        };
        if component.is_null() {
            return Err(failed("fmi3InstantiateCoSimulation", "no instance"));
        }
        Ok(Self {
            functions,
            states,
            component,
            is_initialized: Cell::new(false),
            _library: ManuallyDrop::new(library),
        })
    }
}

impl Drop for Fmi3 {
    fn drop(&mut self) {
        if is_broken() {
            return;
        }
        // SAFETY: the instance is alive, and is not used after this.
        unsafe {
            if self.is_initialized.get() && !has_failed() {
                (self.functions.fmi3Terminate)(self.component);
            }
            (self.functions.fmi3FreeInstance)(self.component);
        }
    }
}

/// Calls the function of the values' type on all of them.
macro_rules! call {
    ($self:ident, $references:ident, $values:ident, $pointer:ident, $($variant:ident $function:ident)*) => {
        match $values {
            $(Values::$variant(values) => {
                let (first, count) = ($references.as_ptr(), $references.len());
                // SAFETY: there are as many values as the references have elements.
                let status = unsafe {
                    ($self.functions.$function)($self.component, first, count, values.$pointer(), values.len())
                };
                check(stringify!($function), status)
            })*
            Values::Boolean32(_) => Err("FMI 3.0 has no booleans of 32 bits".to_owned()),
        }
    };
}

impl Instance for Fmi3 {
    fn set(&self, references: &[u32], values: &Values) -> Result<(), String> {
        call!(
            self, references, values, as_ptr,
            Float64 fmi3SetFloat64 Float32 fmi3SetFloat32 Int64 fmi3SetInt64 Int32 fmi3SetInt32 Int16 fmi3SetInt16
            Int8 fmi3SetInt8 UInt64 fmi3SetUInt64 UInt32 fmi3SetUInt32 UInt16 fmi3SetUInt16 UInt8 fmi3SetUInt8
            Boolean fmi3SetBoolean
        )
    }

    fn set_text(&self, reference: u32, text: &CStr) -> Result<(), String> {
        let (library, pointer) = (&self.functions, text.as_ptr());
        // SAFETY: one text for one reference.
        check("fmi3SetString", unsafe { (library.fmi3SetString)(self.component, &reference, 1, &pointer, 1) })
    }

    fn get(&self, references: &[u32], values: &mut Values) -> Result<(), String> {
        call!(
            self, references, values, as_mut_ptr,
            Float64 fmi3GetFloat64 Float32 fmi3GetFloat32 Int64 fmi3GetInt64 Int32 fmi3GetInt32 Int16 fmi3GetInt16
            Int8 fmi3GetInt8 UInt64 fmi3GetUInt64 UInt32 fmi3GetUInt32 UInt16 fmi3GetUInt16 UInt8 fmi3GetUInt8
            Boolean fmi3GetBoolean
        )
    }

    fn initialize(&self) -> Result<(), String> {
        let (library, component) = (&self.functions, self.component);
        // SAFETY: the instance is alive.
        unsafe {
            let entered = (library.fmi3EnterInitializationMode)(component, false, 0.0, 0.0, false, 0.0);
            check("fmi3EnterInitializationMode", entered)?;
            check("fmi3ExitInitializationMode", (library.fmi3ExitInitializationMode)(component))?;
        }
        self.is_initialized.set(true);
        Ok(())
    }

    fn step(&self, time_s: f64, period_s: f64) -> Result<(), String> {
        let (mut event, mut is_ended, mut is_early, mut reached_s) = (0, 0, 0, 0.0);
        // A state from before this point may be restored: a replay does so.
        // SAFETY: the places live as long as the call.
        let status = unsafe {
            (self.functions.fmi3DoStep)(
                self.component,
                time_s,
                period_s,
                false,
                &mut event,
                &mut is_ended,
                &mut is_early,
                &mut reached_s,
            )
        };
        check("fmi3DoStep", status)?;
        let asked = [
            (is_ended, "terminateSimulation: the FMU ends the simulation"),
            (is_early, "earlyReturn, which was not allowed"),
            (event, "eventHandlingNeeded, and events are not handled here"),
        ];
        match asked.iter().find(|(flag, _)| *flag != 0) {
            Some((_, what)) => Err(failed("fmi3DoStep", what)),
            None => Ok(()),
        }
    }

    fn states(&self) -> Option<(&StateFunctions, Component)> {
        self.states.as_ref().map(|states| (states, self.component))
    }
}
