//! The parameters that the manifest gives a node, by their keys.

use crate::guard::c_text;
use serde_json::Value;
use std::collections::BTreeSet;
use std::ffi::{CString, c_char};

/// The parameters of a node, and what it has read of them.
#[derive(Debug)]
pub(crate) struct Parameters {
    value: Value,
    /// Keys that were asked for.
    read: BTreeSet<String>,
    /// Texts that the program was given.
    texts: Vec<CString>,
}

impl Parameters {
    /// None of them read.
    pub fn of(value: &Value) -> Self {
        Self { value: value.clone(), read: BTreeSet::new(), texts: Vec::new() }
    }

    /// The parameter `key`, whose parts are joined by dots.
    pub fn read(&mut self, key: &str) -> Option<&Value> {
        self.read.insert(key.to_owned());
        key.split('.').try_fold(&self.value, |value, part| value.get(part))
    }

    /// The same where it must be there.
    pub fn required(&mut self, key: &str) -> Result<&Value, String> {
        let known = self.known();
        self.read(key).ok_or_else(|| format!("parameters.{key} is missing; the manifest gives {known}"))
    }

    /// Its keys, in words.
    fn known(&self) -> String {
        let keys: Vec<_> =
            self.value.as_object().into_iter().flatten().map(|(key, _)| format!("`{key}`")).collect();
        if keys.is_empty() { "none".to_owned() } else { keys.join(", ") }
    }

    /// Returns all parameters, which then count as read.
    pub fn all(&mut self) -> &Value {
        self.read.extend(self.value.as_object().into_iter().flatten().map(|(key, _)| key.clone()));
        &self.value
    }

    /// Refuses a parameter that nothing has read: a misspelt key of the manifest.
    pub fn require_all_read(&self) -> Result<(), String> {
        let Some(key) = self.unread(&self.value, "") else { return Ok(()) };
        let read: Vec<_> = self.read.iter().map(|key| format!("`{key}`")).collect();
        let read = if read.is_empty() { "none".to_owned() } else { read.join(", ") };
        Err(format!("parameters.{key} is not read; the program reads {read}"))
    }

    /// The first key of `table`, which stands at `prefix`, that was not asked for, nor a table that holds it.
    fn unread(&self, table: &Value, prefix: &str) -> Option<String> {
        table.as_object()?.iter().find_map(|(key, value)| {
            let whole = if prefix.is_empty() { key.clone() } else { format!("{prefix}.{key}") };
            match value {
                _ if self.read.contains(&whole) => None,
                Value::Object(_) => self.unread(value, &whole),
                _ => Some(whole),
            }
        })
    }

    /// `text` for the program, as long as the node lives.
    pub fn keep(&mut self, text: &str) -> *const c_char {
        self.texts.push(c_text(text));
        self.texts.last().map_or(std::ptr::null(), |text| text.as_ptr())
    }
}

/// The numbers of `value`: itself, or those of an array.
pub(crate) fn numbers(value: &Value) -> Option<Vec<f64>> {
    match value {
        Value::Number(number) => Some(vec![number.as_f64()?]),
        Value::Array(values) => values.iter().map(Value::as_f64).collect(),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::Parameters;
    use serde_json::json;

    #[test]
    fn a_parameter_that_is_not_read_is_refused_with_those_that_are() {
        let mut parameters =
            Parameters::of(&json!({ "gains": { "tilt": [1.0, 2.0], "yaw": 1.0 }, "masss": 0.5 }));
        assert!(parameters.require_all_read().unwrap_err().ends_with("the program reads none"));
        assert_eq!(super::numbers(parameters.read("gains.tilt").unwrap()), Some(vec![1.0, 2.0]));
        assert!(parameters.read("mass").is_none());
        let reason = parameters.require_all_read().unwrap_err();
        assert_eq!(reason, "parameters.gains.yaw is not read; the program reads `gains.tilt`, `mass`");
        assert!(parameters.read("gains").is_some(), "a whole table");
        let reason = parameters.require_all_read().unwrap_err();
        assert_eq!(reason, "parameters.masss is not read; the program reads `gains`, `gains.tilt`, `mass`");
        parameters.all();
        assert_eq!(parameters.require_all_read(), Ok(()));
    }
}
