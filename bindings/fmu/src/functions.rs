//! Functions of an FMU's shared library. Their declarations are the standard's: FMI 2.0.4, `fmi2FunctionTypes.h`, and FMI
//! 3.0.1, `fmi3FunctionTypes.h`.

use crate::said::{failed, forget_last};
use libloading::Library;
use libloading::os::unix::{Library as UnixLibrary, RTLD_LOCAL, RTLD_NOW};
use std::ffi::{c_int, c_void};
use std::path::Path;
use std::ptr::null_mut;
use std::sync::atomic::{AtomicBool, Ordering};

/// Set when a function returned `fatal`: then the standard allows no further call, not even one that frees.
static IS_BROKEN: AtomicBool = AtomicBool::new(false);

/// Set when a function returned `error`: then an instance is not terminated, only freed.
static HAS_FAILED: AtomicBool = AtomicBool::new(false);

/// True if a function of the FMU has returned `error`.
pub fn has_failed() -> bool {
    HAS_FAILED.load(Ordering::Relaxed)
}

/// True if no function of the FMU may be called any more.
pub fn is_broken() -> bool {
    IS_BROKEN.load(Ordering::Relaxed)
}

/// Loads the library at `path`.
///
/// # Errors
/// It cannot be loaded, such as for a library that it needs itself.
pub fn load(path: &Path) -> Result<Library, String> {
    // All symbols now: one that is missing would end the process at its first call.
    // SAFETY: the FMU is the user's choice; what it does when it is loaded is up to it.
    let library = unsafe { UnixLibrary::open(Some(path), RTLD_NOW | RTLD_LOCAL) };
    library.map(Library::from).map_err(|error| {
        let error = error.to_string();
        // FMUs of Python's tools expect that whoever loads them has the interpreter.
        let help = if error.contains("undefined symbol: _Py") || error.contains("undefined symbol: Py") {
            "; it needs Python's library, which the manifest can load before it: environment = { LD_PRELOAD = \
             \"libpython3.11.so.1.0\" }, with the version of your python3"
        } else {
            ""
        };
        format!("cannot load the FMU's library {}: {error}{help}", path.display())
    })
}

/// The function `name`.
///
/// # Errors
/// There is none.
///
/// # Safety
/// `T` is its type, and it is not called when the library is gone.
pub unsafe fn function<T: Copy>(library: &Library, name: &str) -> Result<T, String> {
    // SAFETY: the caller's promise.
    let symbol = unsafe { library.get::<T>(name.as_bytes()) };
    symbol.map(|symbol| *symbol).map_err(|_| format!("the FMU's library has no function {name}"))
}

/// Declares functions by their names in the library.
macro_rules! functions {
    ($(#[$doc:meta])* $name:ident { $($function:ident: fn($($argument:ty),*) $(-> $result:ty)?;)* }) => {
        $(#[$doc])*
        #[allow(non_snake_case, reason = "the names are the standard's")]
        pub struct $name {
            $(pub $function: unsafe extern "C" fn($($argument),*) $(-> $result)?,)*
        }

        impl $name {
            /// Those of `library`.
            ///
            /// # Errors
            /// One is missing.
            pub fn of(library: &libloading::Library) -> Result<Self, String> {
                Ok(Self {
                    // SAFETY: the types are the standard's, and the library is kept beside them.
                    $($function: unsafe { crate::functions::function(library, stringify!($function))? },)*
                })
            }
        }
    };
}
pub(crate) use functions;

/// An instance of either version.
pub type Component = *mut c_void;
/// Status of either version.
pub type Status = c_int;
/// A state that the FMU keeps.
type State = *mut c_void;

/// Functions that save and restore a state: those of both versions differ in their names alone.
pub struct StateFunctions {
    /// Names, for messages.
    names: [&'static str; 6],
    get: unsafe extern "C" fn(Component, *mut State) -> Status,
    set: unsafe extern "C" fn(Component, State) -> Status,
    free: unsafe extern "C" fn(Component, *mut State) -> Status,
    size: unsafe extern "C" fn(Component, State, *mut usize) -> Status,
    serialize: unsafe extern "C" fn(Component, State, *mut u8, usize) -> Status,
    deserialize: unsafe extern "C" fn(Component, *const u8, usize, *mut State) -> Status,
}

impl StateFunctions {
    /// Those of `library`, called `names`: get, set, free, size, serialize, deserialize.
    ///
    /// # Errors
    /// One is missing.
    pub fn of(library: &Library, names: [&'static str; 6]) -> Result<Self, String> {
        // SAFETY: the types are the standard's, and the library is kept beside them.
        unsafe {
            Ok(Self {
                names,
                get: function(library, names[0])?,
                set: function(library, names[1])?,
                free: function(library, names[2])?,
                size: function(library, names[3])?,
                serialize: function(library, names[4])?,
                deserialize: function(library, names[5])?,
            })
        }
    }

    /// The state of `component` as bytes.
    ///
    /// # Errors
    /// The reason that the FMU states.
    ///
    /// # Safety
    /// `component` is an instance of the library.
    pub unsafe fn save(&self, component: Component) -> Result<Vec<u8>, String> {
        let mut state = null_mut();
        // SAFETY: the caller's promise; the FMU makes the state.
        self.check(0, unsafe { (self.get)(component, &mut state) })?;
        // SAFETY: the state is of this instance.
        let saved = unsafe { self.bytes(component, state) };
        // SAFETY: as before.
        unsafe { self.release(component, state) };
        saved
    }

    /// # Safety
    /// `state` is of `component`.
    unsafe fn bytes(&self, component: Component, state: State) -> Result<Vec<u8>, String> {
        let mut size = 0;
        // SAFETY: the caller's promise.
        self.check(3, unsafe { (self.size)(component, state, &mut size) })?;
        let mut bytes = vec![0; size];
        // SAFETY: there is room for `size` bytes.
        self.check(4, unsafe { (self.serialize)(component, state, bytes.as_mut_ptr(), size) })?;
        Ok(bytes)
    }

    /// Lets `component` go on from the bytes of a state.
    ///
    /// # Errors
    /// The reason that the FMU states.
    ///
    /// # Safety
    /// `component` is an instance of the library.
    pub unsafe fn restore(&self, component: Component, bytes: &[u8]) -> Result<(), String> {
        let mut state = null_mut();
        // SAFETY: the bytes are as many as is said.
        let status = unsafe { (self.deserialize)(component, bytes.as_ptr(), bytes.len(), &mut state) };
        self.check(5, status)?;
        // SAFETY: the state is of this instance.
        let restored = self.check(1, unsafe { (self.set)(component, state) });
        // SAFETY: as before.
        unsafe { self.release(component, state) };
        restored
    }

    /// # Safety
    /// `state` is of `component`, and is not used after this.
    unsafe fn release(&self, component: Component, mut state: State) {
        if !is_broken() {
            // SAFETY: the caller's promise.
            unsafe { (self.free)(component, &mut state) };
        }
    }

    fn check(&self, function: usize, status: Status) -> Result<(), String> {
        check(self.names[function], status)
    }
}

/// The `status` that the function `called` returned. Both versions have the same numbers.
///
/// # Errors
/// It is neither OK nor a warning, with what the FMU says.
pub fn check(called: &str, status: Status) -> Result<(), String> {
    match status {
        0 | 1 => {
            forget_last();
            Ok(())
        }
        2 => Err(failed(
            called,
            "the status `discard`: it did not compute (in PythonFMU do_step returns True if it did)",
        )),
        3 => {
            HAS_FAILED.store(true, Ordering::Relaxed);
            Err(failed(called, "the status `error`"))
        }
        4 => {
            IS_BROKEN.store(true, Ordering::Relaxed);
            Err(failed(called, "the status `fatal`"))
        }
        5 => Err(failed(called, "the status `pending`, which is not waited for")),
        other => Err(failed(called, &format!("the unknown status {other}"))),
    }
}
