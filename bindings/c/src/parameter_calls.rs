//! Calls by which a program reads its parameters.

use crate::guard::{misuse, mutable, noted, status, text};
use crate::node::HbNode;
use crate::parameters::{Parameters, numbers};
use bus::BusError;
use bus::dynamic::DynamicNode;
use std::ffi::c_char;
use std::path::Path;

/// True if the manifest gives the parameter `key`, such as `gains.altitude`.
///
/// # Safety
/// `node` came from `hb_node_join` and was not freed; `key` is a text.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hb_node_has_parameter(node: *mut HbNode, key: *const c_char) -> bool {
    let has = || {
        // SAFETY: the caller's promise.
        let (node, key) = unsafe { (mutable(node, "node")?, text(key, "key")?) };
        Ok(node.parameters.read(key).is_some())
    };
    noted(has, false)
}

/// Copies the `count` numbers of the parameter `key`, a number or an array of numbers, to `values`.
///
/// # Safety
/// As `hb_node_has_parameter`; `values` has room for `count` numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hb_node_numbers(
    node: *mut HbNode,
    key: *const c_char,
    values: *mut f64,
    count: usize,
) -> i32 {
    // SAFETY: the caller's promise.
    unsafe {
        of_parameter(node, key, |parameters, key| {
            let value = parameters.required(key)?;
            if values.is_null() {
                return Err("the argument `values` is a null pointer".to_owned());
            }
            let found = numbers(value).filter(|numbers| numbers.len() == count);
            let expected =
                if count == 1 { "a number".to_owned() } else { format!("an array of {count} numbers") };
            let found = found.ok_or_else(|| format!("parameters.{key} is {value}, expected {expected}"))?;
            std::ptr::copy_nonoverlapping(found.as_ptr(), values, count);
            Ok(())
        })
    }
}

/// Sets `*value` to the text of the parameter `key`, valid as long as the node lives.
///
/// # Safety
/// As `hb_node_has_parameter`; `value` is a place.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hb_node_text(
    node: *mut HbNode,
    key: *const c_char,
    value: *mut *const c_char,
) -> i32 {
    // SAFETY: the caller's promise.
    unsafe {
        of_parameter(node, key, |parameters, key| {
            let text = required_text(parameters, key)?;
            *mutable(value, "value")? = parameters.keep(&text);
            Ok(())
        })
    }
}

/// Sets `*json` to all parameters as JSON, valid as long as the node lives. All of them count as read.
///
/// # Safety
/// As `hb_node_text`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hb_node_parameters_json(node: *mut HbNode, json: *mut *const c_char) -> i32 {
    // SAFETY: the caller's promise.
    unsafe {
        of_parameter(node, c"".as_ptr(), |parameters, _| {
            let text = parameters.all().to_string();
            *mutable(json, "json")? = parameters.keep(&text);
            Ok(())
        })
    }
}

/// Sets `*contents` to the text of the file that the parameter `key` names, with the bytes that it had when the run began:
/// a file that the manifest names for the node. It is valid as long as the node lives.
///
/// # Safety
/// As `hb_node_text`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hb_node_file(
    node: *mut HbNode,
    key: *const c_char,
    contents: *mut *const c_char,
) -> i32 {
    status(|| {
        // SAFETY: the caller's promise.
        let (node, key) = unsafe { (mutable(node, "node"), text(key, "key")) };
        let node = node.map_err(misuse)?;
        let key = key.map_err(|reason| node.error(reason))?;
        let path = required_text(&mut node.parameters, key).map_err(|reason| node.error(reason))?;
        let files = node.known().map(DynamicNode::files);
        let files = files.ok_or_else(|| node.error("it runs already: files are read before"))?;
        let text = files
            .text(Path::new(&path))
            .map_err(|reason| node.error(format!("parameters.{key}: {reason}")))?;
        if text.contains('\0') {
            return Err(node.error(format!(
                "parameters.{key}: the file {path} holds a NUL, with which a text ends in C"
            )));
        }
        // SAFETY: the caller's promise.
        *unsafe { mutable(contents, "contents") }.map_err(misuse)? = node.parameters.keep(&text);
        Ok(())
    })
}

/// The text of the parameter `key`, which C can be given.
fn required_text(parameters: &mut Parameters, key: &str) -> Result<String, String> {
    let found = parameters.required(key)?;
    match found.as_str() {
        Some(text) if text.contains('\0') => {
            Err(format!("parameters.{key} holds a NUL, with which a text ends in C"))
        }
        Some(text) => Ok(text.to_owned()),
        None => Err(format!("parameters.{key} is {found}, expected a text")),
    }
}

/// # Safety
/// As `hb_node_has_parameter`.
unsafe fn of_parameter(
    node: *mut HbNode,
    key: *const c_char,
    read: impl FnOnce(&mut Parameters, &str) -> Result<(), String>,
) -> i32 {
    status(|| {
        // SAFETY: the caller's promise.
        let (node, key) = unsafe { (mutable(node, "node"), text(key, "key")) };
        let node = node.map_err(misuse)?;
        let done: Result<(), BusError> =
            key.and_then(|key| read(&mut node.parameters, key)).map_err(|reason| node.error(reason));
        done
    })
}
