//! The components that a manifest may name.

use bus::component::{Role, Transfer};
use bus::parameters::Parameter;
use bus::schema::Schema;
use bus::{BusError, FileKind, FileRole, Registration};
use std::collections::BTreeMap;

/// The components that a manifest may name: the caller that checks or launches a manifest states them.
///
/// ```
/// use bus::{BusError, Registration};
/// use runtime::registry::Registry;
/// const COMPONENTS: Registry = Registry::new(&[Registration::of::<recorder::node::Recorder>()]);
/// assert_eq!(COMPONENTS.names(), "recorder");
/// assert!(COMPONENTS.find("recorder").is_some() && COMPONENTS.find("imu").is_none());
/// ```
#[derive(Clone, Copy, Debug, Default)]
pub struct Registry {
    components: &'static [Registration],
    programs: &'static [NodeProgram],
    effects: Option<fn() -> Vec<&'static str>>,
}

/// A kind that is a program of its own instead of a component: its ports are those that the manifest gives it, and its process
/// holds nothing else.
///
/// ```
/// use runtime::registry::{NodeProgram, Registry};
/// const ECHO: NodeProgram = NodeProgram {
///     name: "echo",
///     summary: "sends what it reads",
///     parameters: &[],
///     run: |_| Ok(()),
/// };
/// const KINDS: Registry = Registry::new(&[]).with_programs(&[ECHO]);
/// assert_eq!((KINDS.names().as_str(), KINDS.program("echo").is_some()), ("echo", true));
/// ```
#[derive(Clone, Copy, Debug)]
pub struct NodeProgram {
    /// Name in manifests.
    pub name: &'static str,
    /// Purpose, in one line.
    pub summary: &'static str,
    /// Its parameters.
    pub parameters: &'static [Parameter],
    /// Joins the run that started this process and takes part in it; is given the components, whose messages it may exchange.
    pub run: fn(&'static [Registration]) -> Result<(), BusError>,
}

impl Registry {
    /// A registry of `components`, in the order in which messages list them.
    #[must_use]
    pub const fn new(components: &'static [Registration]) -> Self {
        Self { components, programs: &[], effects: None }
    }

    /// This registry with `programs`.
    #[must_use]
    pub const fn with_programs(self, programs: &'static [NodeProgram]) -> Self {
        Self { programs, ..self }
    }

    /// This registry with the names of the effects that vehicle and scene files may list, for messages.
    #[must_use]
    pub const fn with_effects(self, effects: fn() -> Vec<&'static str>) -> Self {
        Self { effects: Some(effects), ..self }
    }

    /// Names of the effects that vehicle and scene files may list; empty if the caller stated none.
    #[must_use]
    pub fn effects(&self) -> Vec<&'static str> {
        self.effects.map(|names| names()).unwrap_or_default()
    }

    /// The programs.
    #[must_use]
    pub const fn programs(&self) -> &'static [NodeProgram] {
        self.programs
    }

    /// The program named `name`.
    #[must_use]
    pub fn program(&self, name: &str) -> Option<&'static NodeProgram> {
        self.programs.iter().find(|program| program.name == name)
    }

    /// The components, as a node of a run receives them.
    #[must_use]
    pub const fn components(&self) -> &'static [Registration] {
        self.components
    }

    /// Iterates over the components.
    pub fn iter(&self) -> impl Iterator<Item = &'static Registration> {
        self.components.iter()
    }

    /// The component named `name`.
    #[must_use]
    pub fn find(&self, name: &str) -> Option<&'static Registration> {
        self.iter().find(|component| component.name == name)
    }

    /// Kind of the file whose path a process states at `key`, as its `component` declares it. If the process is a command, or its component
    /// does not declare the kind, the first component that declares it counts.
    ///
    /// ```
    /// use bus::Registration;
    /// use runtime::registry::Registry;
    /// const COMPONENTS: Registry = Registry::new(&[Registration::of::<plant::node::Plant>()]);
    /// assert!(COMPONENTS.file(None, "scene").is_some() && COMPONENTS.file(None, "data").is_none());
    /// ```
    #[must_use]
    pub fn file(&self, component: Option<&Registration>, key: &str) -> Option<FileKind> {
        let declared = component.and_then(|component| component.file(key));
        declared.or_else(|| self.iter().find_map(|component| component.file(key)))
    }

    /// Role of the file whose path a process states at `key`, as the first component that declares it has it.
    #[must_use]
    pub fn file_role(&self, key: &str) -> Option<FileRole> {
        self.file(None, key).map(|kind| kind.role)
    }

    /// True if a component declares the file whose path a process states at `key` as TOML, in which `--set` changes values.
    pub(crate) fn has_toml_at(&self, key: &str) -> bool {
        self.iter().filter_map(|component| component.file(key)).any(|file| file.role.is_toml())
    }

    /// The names of all kinds that a manifest can use, for messages.
    #[must_use]
    pub fn names(&self) -> String {
        self.kinds().collect::<Vec<_>>().join(", ")
    }

    /// The names of all kinds that a manifest can use.
    pub fn kinds(&self) -> impl Iterator<Item = &'static str> {
        let programs = self.programs.iter().map(|program| program.name);
        let usable = self.iter().filter(|component| component.role != Role::Judge);
        usable.map(|component| component.name).chain(programs)
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
            Transfer::Nothing
            | Transfer::Bytes(_)
            | Transfer::Growing(_)
            | Transfer::File
            | Transfer::External(_) => None,
        };
        let by_name: BTreeMap<_, _> = self.iter().filter_map(state).collect();
        by_name.into_values().collect()
    }

    /// The message whose type is called `type_name`.
    #[must_use]
    pub fn message(&self, type_name: &str) -> Option<&'static Schema> {
        bus::message_of(self.components, type_name)
    }
}
