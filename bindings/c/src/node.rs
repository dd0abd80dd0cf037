//! A node: it joins, declares its ports and its state, and runs.

use crate::guard::{self, c_text, misuse, mutable, status, text};
use crate::message::{HbMessage, described};
use crate::parameters::Parameters;
use crate::tick::{HbTick, Step};
use bus::BusError;
use bus::dynamic::DynamicNode;
use bus::schema::Schema;
use std::ffi::{CString, c_char, c_void};

/// A node of a run, before its first tick.
#[derive(Debug)]
pub struct HbNode {
    /// Taken when it runs.
    node: Option<DynamicNode>,
    name: CString,
    pub(crate) parameters: Parameters,
}

/// A step: computes one tick of the node, with `user` as `hb_node_run` was given it. Returns `HB_OK`, or what
/// `hb_tick_fail` returns, and lets no exception out.
pub type HbStep = Option<unsafe extern "C" fn(user: *mut c_void, tick: *mut HbTick) -> i32>;

impl HbNode {
    /// The node, if it does not run yet.
    fn declaring(&mut self) -> Result<&mut DynamicNode, BusError> {
        let name = self.name.to_string_lossy().into_owned();
        let reason = "it runs already: ports and state are declared before".to_owned();
        self.node.as_mut().ok_or(BusError::Program { node: name, reason })
    }

    /// The node itself, for what it knows.
    pub(crate) fn known(&self) -> Option<&DynamicNode> {
        self.node.as_ref()
    }

    /// An error of this node.
    pub(crate) fn error(&self, reason: impl ToString) -> BusError {
        BusError::Parameters { node: self.name.to_string_lossy().into_owned(), reason: reason.to_string() }
    }
}

/// Joins the run that started this process. `*node` is freed with `hb_node_free`.
///
/// # Safety
/// `node` points to a pointer.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hb_node_join(node: *mut *mut HbNode) -> i32 {
    status(|| {
        // SAFETY: the caller's promise.
        let place = unsafe { mutable(node, "node") }.map_err(misuse)?;
        let joined = DynamicNode::join()?;
        let (name, parameters) = (c_text(joined.name()), Parameters::of(joined.parameters()));
        *place = Box::into_raw(Box::new(HbNode { node: Some(joined), name, parameters }));
        Ok(())
    })
}

/// Frees a node; does nothing if `node` is null.
///
/// # Safety
/// `node` is null or came from `hb_node_join` and was not freed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hb_node_free(node: *mut HbNode) {
    if !node.is_null() {
        // SAFETY: the caller's promise.
        let node = unsafe { Box::from_raw(node) };
        let _ = guard::caught(|| drop(node));
    }
}

/// The node's name in the run, as long as the node lives.
///
/// # Safety
/// `node` came from `hb_node_join` and was not freed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hb_node_name(node: *const HbNode) -> *const c_char {
    // SAFETY: the caller's promise.
    unsafe { node.as_ref() }.map_or(std::ptr::null(), |node| node.name.as_ptr())
}

/// Simulated time between two steps of the node, in seconds; NaN once it runs.
///
/// # Safety
/// As `hb_node_name`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hb_node_period_s(node: *const HbNode) -> f64 {
    // SAFETY: the caller's promise.
    unsafe { node.as_ref() }.and_then(HbNode::known).map_or(f64::NAN, DynamicNode::period_s)
}

/// The seed of the run; 0 once the node runs.
///
/// # Safety
/// As `hb_node_name`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hb_node_seed(node: *const HbNode) -> u64 {
    // SAFETY: the caller's promise.
    unsafe { node.as_ref() }.and_then(HbNode::known).map_or(0, DynamicNode::seed)
}

/// True if the manifest wires an input `port`, or names an output of this name.
///
/// # Safety
/// `node` as for `hb_node_name`; `port` is a text.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hb_node_is_wired(node: *const HbNode, port: *const c_char) -> bool {
    // SAFETY: the caller's promise.
    let (node, port) = unsafe { (node.as_ref(), text(port, "port")) };
    let (Some(node), Ok(port)) = (node.and_then(HbNode::known), port) else { return false };
    node.wired_inputs().chain(node.named_outputs()).any(|(name, _)| name == port)
}

/// Declares the input `port`, whose messages are `message`. `*input` is its number for `hb_tick_input`.
///
/// # Safety
/// `node` as for `hb_node_name`; `port` is a text, `message` a description, `input` points to a number.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hb_node_input(
    node: *mut HbNode,
    port: *const c_char,
    message: *const HbMessage,
    input: *mut u32,
) -> i32 {
    // SAFETY: the caller's promise.
    unsafe { declare(node, port, message, input, DynamicNode::input) }
}

/// Declares the output `port`, whose messages are `message`. `*output` is its number for `hb_tick_output`.
///
/// # Safety
/// As `hb_node_input`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hb_node_output(
    node: *mut HbNode,
    port: *const c_char,
    message: *const HbMessage,
    output: *mut u32,
) -> i32 {
    // SAFETY: the caller's promise.
    unsafe { declare(node, port, message, output, DynamicNode::output) }
}

/// Declaration of a port by its name and schema, which returns its number.
type Declare = fn(&mut DynamicNode, &str, &'static Schema) -> Result<usize, BusError>;

/// # Safety
/// As `hb_node_input`.
unsafe fn declare(
    node: *mut HbNode,
    port: *const c_char,
    message: *const HbMessage,
    number: *mut u32,
    declare: Declare,
) -> i32 {
    status(|| {
        // SAFETY: the caller's promise.
        let (node, place) = unsafe { (mutable(node, "node"), mutable(number, "number of the port")) };
        let (node, place) = (node.map_err(misuse)?, place.map_err(misuse)?);
        // SAFETY: the caller's promise.
        let (port, message) = unsafe { (text(port, "port"), described(message)) };
        let schema = message.and_then(|message| message.declare()).map_err(|reason| node.error(reason))?;
        let port = port.map_err(|reason| node.error(reason))?;
        let declared = declare(node.declaring()?, port, schema)?;
        *place = u32::try_from(declared).map_err(|error| node.error(error))?;
        Ok(())
    })
}

/// Declares the state as one value of `message`. `*state` becomes its memory: zeros, aligned to eight bytes, as long as the
/// process lives. All that changes from tick to tick belongs there, since whoever takes the node's place goes on
/// from it, and since checkpoints hold it. The bus reads and writes it between steps.
///
/// # Safety
/// As `hb_node_input`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hb_node_state(
    node: *mut HbNode,
    message: *const HbMessage,
    state: *mut *mut c_void,
) -> i32 {
    status(|| {
        // SAFETY: the caller's promise.
        let (node, place) = unsafe { (mutable(node, "node"), mutable(state, "state")) };
        let (node, place) = (node.map_err(misuse)?, place.map_err(misuse)?);
        // SAFETY: the caller's promise.
        let message = unsafe { described(message) };
        let schema =
            message.and_then(|message| message.declare_state()).map_err(|reason| node.error(reason))?;
        *place = node.declaring()?.state(schema)?.cast();
        Ok(())
    })
}

/// Connects, then calls `step` at every due tick, until the run ends or another process has taken the node's place. A
/// parameter of the manifest that nothing has read is refused.
///
/// # Safety
/// `node` as for `hb_node_name`; `step` may be called with `user` as long as this runs.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hb_node_run(node: *mut HbNode, step: HbStep, user: *mut c_void) -> i32 {
    status(|| {
        // SAFETY: the caller's promise.
        let node = unsafe { mutable(node, "node") }.map_err(misuse)?;
        let step = step.ok_or_else(|| node.error("the argument `step` is a null pointer"))?;
        node.parameters.require_all_read().map_err(|reason| node.error(reason))?;
        node.declaring()?;
        let Some(running) = node.node.take() else { return Ok(()) };
        running.run(|tick| {
            let mut tick = Step::new(tick);
            // SAFETY: the caller's promise; the tick lives as long as the call.
            let status = unsafe { step(user, tick.handle()) };
            tick.end(status)
        })
    })
}
