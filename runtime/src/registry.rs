//! The components that a manifest may name.

use bus::Registration;
use bus::component::Transfer;
use bus::schema::Schema;
use std::collections::BTreeMap;

/// The components that a manifest may name: whoever checks or launches one says which there are.
///
/// ```
/// use bus::Registration;
/// use runtime::registry::Registry;
/// const COMPONENTS: Registry = Registry::new(&[Registration::of::<recorder::node::Recorder>()]);
/// assert_eq!(COMPONENTS.names(), "recorder");
/// assert!(COMPONENTS.find("recorder").is_some() && COMPONENTS.find("imu").is_none());
/// ```
#[derive(Clone, Copy, Debug, Default)]
pub struct Registry(&'static [Registration]);

impl Registry {
    /// A registry of `components`, in the order in which messages list them.
    #[must_use]
    pub const fn new(components: &'static [Registration]) -> Self {
        Self(components)
    }

    /// All components, as a node of a run is given them.
    #[must_use]
    pub const fn components(&self) -> &'static [Registration] {
        self.0
    }

    /// All components.
    pub fn iter(&self) -> impl Iterator<Item = &'static Registration> {
        self.0.iter()
    }

    /// The component named `name`.
    #[must_use]
    pub fn find(&self, name: &str) -> Option<&'static Registration> {
        self.iter().find(|component| component.name == name)
    }

    /// The names of all components, for messages.
    #[must_use]
    pub fn names(&self) -> String {
        self.iter().map(|component| component.name).collect::<Vec<_>>().join(", ")
    }

    /// Every message that a port of a component carries, in the order of their type names.
    #[must_use]
    pub fn messages(&self) -> Vec<&'static Schema> {
        let by_name: BTreeMap<_, _> =
            self.iter().flat_map(Registration::messages).map(|schema| (schema.type_name, schema)).collect();
        by_name.into_values().collect()
    }

    /// Every state of a component that is a message, in the order of their type names.
    #[must_use]
    pub fn states(&self) -> Vec<&'static Schema> {
        let state = |component: &Registration| match component.transfer {
            Transfer::Message(schema) => Some((schema.type_name, schema)),
            Transfer::Nothing | Transfer::Bytes(_) | Transfer::Growing(_) | Transfer::File => None,
        };
        let by_name: BTreeMap<_, _> = self.iter().filter_map(state).collect();
        by_name.into_values().collect()
    }

    /// The message whose type is called `type_name`.
    #[must_use]
    pub fn message(&self, type_name: &str) -> Option<&'static Schema> {
        bus::message_of(self.0, type_name)
    }
}
