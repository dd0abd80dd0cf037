//! Instances of FMI 2.0.

use crate::description::Description;
use crate::functions::{Component, StateFunctions, Status, check, functions, has_failed, is_broken, load};
use crate::instance::{Instance, c_text};
use crate::said::{LOG_MESSAGE_2, LogMessage2, failed};
use crate::values::Values;
use libloading::Library;
use percent_encoding::{AsciiSet, NON_ALPHANUMERIC, utf8_percent_encode};
use std::cell::Cell;
use std::ffi::{CStr, c_char, c_int, c_void};
use std::mem::ManuallyDrop;
use std::path::Path;
use std::ptr::{from_ref, null_mut};

/// `fmi2CoSimulation`.
const CO_SIMULATION: c_int = 1;
/// Characters that a URI of a file has as they are.
const PLAIN: &AsciiSet = &NON_ALPHANUMERIC.remove(b'/').remove(b'-').remove(b'_').remove(b'.').remove(b'~');
const STATE_FUNCTIONS: [&str; 6] = [
    "fmi2GetFMUstate",
    "fmi2SetFMUstate",
    "fmi2FreeFMUstate",
    "fmi2SerializedFMUstateSize",
    "fmi2SerializeFMUstate",
    "fmi2DeSerializeFMUstate",
];

/// `fmi2CallbackFunctions`.
#[repr(C)]
pub struct Callbacks {
    log: LogMessage2,
    allocate: unsafe extern "C" fn(usize, usize) -> *mut c_void,
    free: unsafe extern "C" fn(*mut c_void),
    step_finished: Option<unsafe extern "C" fn(*mut c_void, Status)>,
    environment: *mut c_void,
}

functions! {
    /// Functions of FMI 2.0 that are called here.
    Functions {
        fmi2Instantiate: fn(
            *const c_char, c_int, *const c_char, *const c_char, *const Callbacks, c_int, c_int
        ) -> Component;
        fmi2FreeInstance: fn(Component);
        fmi2SetupExperiment: fn(Component, c_int, f64, f64, c_int, f64) -> Status;
        fmi2EnterInitializationMode: fn(Component) -> Status;
        fmi2ExitInitializationMode: fn(Component) -> Status;
        fmi2Terminate: fn(Component) -> Status;
        fmi2DoStep: fn(Component, f64, f64, c_int) -> Status;
        fmi2GetReal: fn(Component, *const u32, usize, *mut f64) -> Status;
        fmi2SetReal: fn(Component, *const u32, usize, *const f64) -> Status;
        fmi2GetInteger: fn(Component, *const u32, usize, *mut c_int) -> Status;
        fmi2SetInteger: fn(Component, *const u32, usize, *const c_int) -> Status;
        fmi2GetBoolean: fn(Component, *const u32, usize, *mut c_int) -> Status;
        fmi2SetBoolean: fn(Component, *const u32, usize, *const c_int) -> Status;
        fmi2SetString: fn(Component, *const u32, usize, *const *const c_char) -> Status;
    }
}

/// An instance.
pub struct Fmi2 {
    functions: Functions,
    states: Option<StateFunctions>,
    component: Component,
    is_initialized: Cell<bool>,
    /// The FMU keeps a pointer to them.
    _callbacks: Box<Callbacks>,
    /// Never unloaded: few libraries bear that, and the process ends with the run.
    _library: ManuallyDrop<Library>,
}

impl Fmi2 {
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
        let callbacks = Box::new(Callbacks {
            log: LOG_MESSAGE_2,
            allocate: libc::calloc,
            free: libc::free,
            step_finished: None,
            environment: null_mut(),
        });
        let uri = format!("file://{}", utf8_percent_encode(&resources.to_string_lossy(), PLAIN));
        let (name, token, uri) = (c_text(name)?, c_text(&description.token)?, c_text(&uri)?);
        // SAFETY: the texts live as long as the call, the callbacks as long as the instance.
        let component = unsafe {
            (functions.fmi2Instantiate)(
                name.as_ptr(),
                CO_SIMULATION,
                token.as_ptr(),
                uri.as_ptr(),
                from_ref(&*callbacks),
                0,
                // Messages on: those that are no warnings are dropped by the callback.
                1,
            )
        };
        if component.is_null() {
            return Err(failed("fmi2Instantiate", "no instance"));
        }
        let is_initialized = Cell::new(false);
        Ok(Self {
            functions,
            states,
            component,
            is_initialized,
            _callbacks: callbacks,
            _library: ManuallyDrop::new(library),
        })
    }
}

impl Drop for Fmi2 {
    fn drop(&mut self) {
        if is_broken() {
            return;
        }
        // SAFETY: the instance is alive, and is not used after this.
        unsafe {
            if self.is_initialized.get() && !has_failed() {
                (self.functions.fmi2Terminate)(self.component);
            }
            (self.functions.fmi2FreeInstance)(self.component);
        }
    }
}

impl Instance for Fmi2 {
    fn set(&self, references: &[u32], values: &Values) -> Result<(), String> {
        let (library, component) = (&self.functions, self.component);
        let (first, count) = (references.as_ptr(), references.len());
        // SAFETY: there are as many values as references: arrays are FMI 3.0's.
        unsafe {
            match values {
                Values::Float64(values) => {
                    check("fmi2SetReal", (library.fmi2SetReal)(component, first, count, values.as_ptr()))
                }
                Values::Int32(values) => check(
                    "fmi2SetInteger",
                    (library.fmi2SetInteger)(component, first, count, values.as_ptr()),
                ),
                Values::Boolean32(values) => check(
                    "fmi2SetBoolean",
                    (library.fmi2SetBoolean)(component, first, count, values.as_ptr()),
                ),
                other => Err(format!("FMI 2.0 has no {}", other.name())),
            }
        }
    }

    fn set_text(&self, reference: u32, text: &CStr) -> Result<(), String> {
        // SAFETY: one text for one reference.
        let status = unsafe { (self.functions.fmi2SetString)(self.component, &reference, 1, &text.as_ptr()) };
        check("fmi2SetString", status)
    }

    fn get(&self, references: &[u32], values: &mut Values) -> Result<(), String> {
        let (library, component) = (&self.functions, self.component);
        let (first, count) = (references.as_ptr(), references.len());
        // SAFETY: as in `set`.
        unsafe {
            match values {
                Values::Float64(values) => {
                    check("fmi2GetReal", (library.fmi2GetReal)(component, first, count, values.as_mut_ptr()))
                }
                Values::Int32(values) => check(
                    "fmi2GetInteger",
                    (library.fmi2GetInteger)(component, first, count, values.as_mut_ptr()),
                ),
                Values::Boolean32(values) => check(
                    "fmi2GetBoolean",
                    (library.fmi2GetBoolean)(component, first, count, values.as_mut_ptr()),
                ),
                other => Err(format!("FMI 2.0 has no {}", other.name())),
            }
        }
    }

    fn initialize(&self) -> Result<(), String> {
        let (library, component) = (&self.functions, self.component);
        // SAFETY: the instance is alive.
        unsafe {
            check("fmi2SetupExperiment", (library.fmi2SetupExperiment)(component, 0, 0.0, 0.0, 0, 0.0))?;
            check("fmi2EnterInitializationMode", (library.fmi2EnterInitializationMode)(component))?;
            check("fmi2ExitInitializationMode", (library.fmi2ExitInitializationMode)(component))?;
        }
        self.is_initialized.set(true);
        Ok(())
    }

    fn step(&self, time_s: f64, period_s: f64) -> Result<(), String> {
        // A state from before this point may be restored: a replay does so.
        // SAFETY: the instance is alive.
        check("fmi2DoStep", unsafe { (self.functions.fmi2DoStep)(self.component, time_s, period_s, 0) })
    }

    fn states(&self) -> Option<(&StateFunctions, Component)> {
        self.states.as_ref().map(|states| (states, self.component))
    }
}
