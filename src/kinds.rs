//! The built-in kinds of node.

use bus::kind::NodeKind;

/// Every built-in kind, in alphabetical order.
pub const KINDS: [&NodeKind; 8] = [
    &sensors::attitude::KIND,
    &sensors::imu::KIND,
    &controllers::pid::KIND,
    &controllers::pilot::KIND,
    &plant::node::KIND,
    &controllers::player::KIND,
    &recorder::node::KIND,
    &plant::traffic::KIND,
];

/// The kind named `name`.
pub fn find(name: &str) -> Option<&'static NodeKind> {
    KINDS.into_iter().find(|kind| kind.name == name)
}

/// The names of all kinds, for messages.
pub fn names() -> String {
    KINDS.map(|kind| kind.name).join(", ")
}
