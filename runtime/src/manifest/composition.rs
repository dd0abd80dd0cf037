//! Composition: which nodes share a process.

use diagnostics::ParameterError;
use serde::{Deserialize, Deserializer, de};
use std::fmt;
use toml::Spanned;

/// `[group.NAME]`: nodes that share a process.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GroupSetting {
    /// Names of the processes that become members.
    pub processes: Spanned<Vec<Spanned<String>>>,
    /// Core of the group's process.
    pub cpu: Option<Spanned<usize>>,
}

/// Composition of a run, instead of the manifest's `[group]` tables.
///
/// ```
/// use runtime::manifest::Composition;
/// assert_eq!("all".parse::<Composition>()?, Composition::All);
/// let groups = "plant+imu,ekf+controller".parse::<Composition>()?;
/// assert_eq!(groups.to_string(), "plant+imu,ekf+controller");
/// # Ok::<(), diagnostics::ParameterError>(())
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Composition {
    /// Each node has a process of its own.
    None,
    /// Every node shares one process, except the recorder and nodes that need a process of their own.
    All,
    /// The nodes of each vehicle share a process: those with the same text in front of the `/` of their names.
    Vehicles,
    /// Each of these is a group: the name of a `[group]` table, or names of nodes.
    Groups(Vec<Vec<String>>),
}

impl std::str::FromStr for Composition {
    type Err = ParameterError;

    fn from_str(text: &str) -> Result<Self, ParameterError> {
        match text {
            "none" => return Ok(Self::None),
            "all" => return Ok(Self::All),
            "vehicles" => return Ok(Self::Vehicles),
            _ => {}
        }
        let groups: Vec<Vec<String>> = text
            .split(',')
            .map(|group| group.split('+').map(|name| name.trim().to_owned()).collect())
            .collect();
        if groups.iter().flatten().any(String::is_empty) {
            return Err(format!(
                "`{text}` is not a composition: expected none, all, vehicles, or groups with commas between them; each is \
                 the name of a [group] table, or names of processes with + between them, such as plant+imu,ekf+controller"
            )
            .into());
        }
        Ok(Self::Groups(groups))
    }
}

impl fmt::Display for Composition {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::None => f.write_str("none"),
            Self::All => f.write_str("all"),
            Self::Vehicles => f.write_str("vehicles"),
            Self::Groups(groups) => {
                let groups: Vec<String> = groups.iter().map(|names| names.join("+")).collect();
                f.write_str(&groups.join(","))
            }
        }
    }
}

impl<'de> Deserialize<'de> for Composition {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        String::deserialize(deserializer)?.parse().map_err(de::Error::custom)
    }
}

#[cfg(test)]
mod tests {
    use super::Composition;

    #[test]
    fn an_empty_name_is_refused_with_an_example() {
        for text in ["", "a+", "a,,b", "+"] {
            let refused = text.parse::<Composition>().unwrap_err().to_string();
            assert!(refused.contains("such as plant+imu"), "{text}: {refused}");
        }
    }
}
