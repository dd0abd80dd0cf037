//! Variables of the environment within the paths of files.

/// A path whose variables cannot be replaced.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum VariableError {
    /// A variable without its closing bracket.
    #[error("`{0}`, which has `${{` without `}}`")]
    Open(String),
    /// A variable that is not set and has no default.
    #[error("`{text}`, whose environment variable {name} is not set")]
    Unset {
        /// The path as it is written.
        text: String,
        /// The variable.
        name: String,
    },
}

/// Replaces `${NAME}` and `${NAME:-default}` in `text` by the values of `variable`.
///
/// ```
/// let text = inputs::variables::expand("${LOGS:-../logs}/a.csv", |_| None)?;
/// assert_eq!(text, "../logs/a.csv");
/// # Ok::<(), inputs::variables::VariableError>(())
/// ```
///
/// # Errors
/// A variable that is not set and has no default, or one without its closing bracket.
pub fn expand(text: &str, variable: impl Fn(&str) -> Option<String>) -> Result<String, VariableError> {
    let mut expanded = String::new();
    let mut rest = text;
    while let Some((before, after)) = rest.split_once("${") {
        let (inside, after) = after.split_once('}').ok_or_else(|| VariableError::Open(text.to_owned()))?;
        let (name, default) = inside.split_once(":-").map_or((inside, None), |(name, d)| (name, Some(d)));
        let value = variable(name).or(default.map(str::to_owned));
        expanded += before;
        expanded +=
            &value.ok_or_else(|| VariableError::Unset { text: text.to_owned(), name: name.to_owned() })?;
        rest = after;
    }
    Ok(expanded + rest)
}

#[cfg(test)]
mod tests {
    use super::expand;

    #[test]
    fn variables_are_expanded_with_defaults() {
        let variable = |name: &str| (name == "DATA").then(|| "/data".to_owned());
        assert_eq!(expand("${DATA:-../x}/a.csv", variable).unwrap(), "/data/a.csv");
        assert_eq!(expand("${NONE:-../x}/a.csv", variable).unwrap(), "../x/a.csv");
        assert!(expand("${NONE}/a.csv", variable).unwrap_err().to_string().contains("NONE is not set"));
        assert!(expand("${NONE", variable).unwrap_err().to_string().contains("without"));
    }
}
