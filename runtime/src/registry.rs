//! The components that a manifest may name.

use bus::kind::NodeKind;

/// The components that a manifest may name: whoever checks or launches one says which there are.
#[derive(Clone, Copy, Debug, Default)]
pub struct Registry(&'static [&'static NodeKind]);

impl Registry {
    /// A registry of `components`, in the order in which messages list them.
    #[must_use]
    pub const fn new(components: &'static [&'static NodeKind]) -> Self {
        Self(components)
    }

    /// All components.
    pub fn iter(&self) -> impl Iterator<Item = &'static NodeKind> {
        self.0.iter().copied()
    }

    /// The component named `name`.
    #[must_use]
    pub fn find(&self, name: &str) -> Option<&'static NodeKind> {
        self.iter().find(|component| component.name == name)
    }

    /// The names of all components, for messages.
    #[must_use]
    pub fn names(&self) -> String {
        self.iter().map(|component| component.name).collect::<Vec<_>>().join(", ")
    }
}
