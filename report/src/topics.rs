//! Names of topics and of message types.

/// The last part of the name of a message type of ours; empty for the types of others, which may be called the same.
///
/// ```
/// assert_eq!(report::topics::short_name("hummingbus_msgs/msg/PlantState"), "PlantState");
/// assert_eq!(report::topics::short_name("sensor_msgs/msg/Imu"), "");
/// ```
#[must_use]
pub fn short_name(type_name: &str) -> &str {
    type_name.strip_prefix("hummingbus_msgs/msg/").unwrap_or_default()
}

/// The vehicle of a topic, which stands in front of the process; empty if the run has one vehicle without a name.
///
/// ```
/// assert_eq!(report::topics::vehicle("/h1/plant/state"), "h1");
/// assert_eq!(report::topics::vehicle("/plant/state"), "");
/// ```
#[must_use]
pub fn vehicle(topic: &str) -> &str {
    let mut parts = topic.trim_start_matches('/').rsplitn(3, '/');
    parts.nth(2).unwrap_or_default()
}

/// True for topics of shadows, which were computed and not flown.
#[must_use]
pub fn is_of_shadow(topic: &str) -> bool {
    beside_shadow(topic).is_some()
}

/// The flown topic beside the topic of a shadow; `None` for a topic that is not of a shadow.
///
/// ```
/// assert_eq!(report::topics::beside_shadow("/shadow/h1/controller/command"), Some("/h1/controller/command"));
/// assert_eq!(report::topics::beside_shadow("/controller/command"), None);
/// ```
#[must_use]
pub fn beside_shadow(topic: &str) -> Option<&str> {
    topic.strip_prefix("/shadow").filter(|flown| flown.starts_with('/'))
}
