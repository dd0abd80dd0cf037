//! Errors of the bus, in words for the person who launched the run.

use diagnostics::{ComponentFailure, ParameterError};
use std::io::{self, ErrorKind};
use std::path::PathBuf;
use thiserror::Error;

/// An error of the bus; its text names the node, the topic and the remedy.
///
/// ```
/// // The error of a node that nobody launched says what to do.
/// let error = component::BusError::NotInARun { variable: "HUMMINGBUS_RUN" };
/// assert!(error.to_string().contains("hummingbus run MANIFEST"));
/// ```
#[derive(Error)]
pub enum BusError {
    /// The process was not started by a launcher.
    #[error(
        "this process is a node of a run and was started without one: {variable} is not set. \
         Name it as a `command` in a manifest and start it with `hummingbus run MANIFEST`"
    )]
    NotInARun {
        /// The environment variable that is missing.
        variable: &'static str,
    },
    /// Another process has this process's place in the run.
    #[error(
        "the run has a process `{name}` already, and a second one is refused: a process joins a run only when \
         its launcher starts it"
    )]
    Claimed {
        /// The node, or `clock`.
        name: String,
    },
    /// A file of the run could not be read or written.
    #[error("cannot {action} {path}: {source}")]
    File {
        /// Action that failed.
        action: &'static str,
        /// Path of the file.
        path: PathBuf,
        /// Cause.
        source: std::io::Error,
    },
    /// There is no room for the memory that a run maps.
    #[error(
        "no room for {what}: it takes {needed} bytes, and {} has {free} bytes free; make room there, or give it more \
         (`mount -o remount,size=SIZE {}`, `docker run --shm-size`)", folder.display(), folder.display()
    )]
    NoRoom {
        /// Purpose of the memory.
        what: String,
        /// Bytes needed.
        needed: u64,
        /// Folder of the memory.
        folder: PathBuf,
        /// Bytes free.
        free: u64,
    },
    /// Files may not become as large as the run needs them.
    #[error(
        "a shared-memory file of the run takes {needed} bytes, and the limit on the size of files is {limit} \
         bytes; raise it (`ulimit -f`)"
    )]
    FileLimit {
        /// The largest file.
        needed: u64,
        /// The limit.
        limit: u64,
    },
    /// A file of the run does not hold the expected content.
    #[error(
        "{path} is not readable as {expected}: {found}. Was it written by another version of hummingbus?"
    )]
    Content {
        /// Path of the file.
        path: PathBuf,
        /// Expected content.
        expected: &'static str,
        /// Its fault.
        found: String,
    },
    /// A checkpoint does not fit a node.
    #[error("node `{node}` cannot go on from the checkpoint: {reason}")]
    Checkpoint {
        /// The node.
        node: String,
        /// The part that does not fit.
        reason: String,
    },
    /// The plan has no node of this name.
    #[error("the run has no node named `{node}`; it has {known}")]
    UnknownNode {
        /// The name requested.
        node: String,
        /// The names there are.
        known: String,
    },
    /// No node sends a topic of this name.
    #[error("no node of the run sends {topic}; it has {known}")]
    UnknownTopic {
        /// The name requested.
        topic: String,
        /// The names there are.
        known: String,
    },
    /// A node declares a port that the manifest does not wire.
    #[error(
        "node `{node}` declares the {direction} `{port}`, which the manifest does not {verb}; it has {known}"
    )]
    UnwiredPort {
        /// The node.
        node: String,
        /// `input` or `output`.
        direction: &'static str,
        /// The port.
        port: String,
        /// `wire` or `name`.
        verb: &'static str,
        /// The ports the manifest has for this node.
        known: String,
    },
    /// The manifest wires a port that the node never declared.
    #[error("the manifest gives node `{node}` the {direction} `{port}`, which the node does not declare")]
    UndeclaredPort {
        /// The node.
        node: String,
        /// `input` or `output`.
        direction: &'static str,
        /// The port.
        port: String,
    },
    /// A node declares a port a second time.
    #[error(
        "node `{node}` declares its {direction} `{port}` twice, as {first} and as {second}; declare it once, and \
         use that handle in both places"
    )]
    DeclaredTwice {
        /// The node.
        node: String,
        /// `input` or `output`.
        direction: &'static str,
        /// The port.
        port: String,
        /// The message type of the first declaration.
        first: &'static str,
        /// The message type of the second declaration.
        second: &'static str,
    },
    /// Publisher and subscriber disagree on the bytes.
    #[error(
        "layout mismatch on topic {topic}: node `{node}` reads its port `{port}` as\n{expected}\n\
         and node `{sender}` sends its port `{sender_port}` as\n{found}\n{advice}"
    )]
    LayoutMismatch {
        /// The topic.
        topic: String,
        /// The node that joined.
        node: String,
        /// Its port.
        port: String,
        /// The layout the node was built with.
        expected: String,
        /// The node that sends the topic.
        sender: String,
        /// Its port.
        sender_port: String,
        /// The layout the sender announced.
        found: String,
        /// The side to rebuild.
        advice: String,
    },
    /// A backup sends other bytes than the process it would succeed.
    #[error(
        "layout mismatch on topic {topic}: the backup of node `{node}` sends\n{found}\nbut the topic carries\n\
         {expected}\nBuild the program of the backup anew with the message that the topic carries"
    )]
    BackupLayout {
        /// The node.
        node: String,
        /// The topic.
        topic: String,
        /// The layout the topic carries.
        expected: String,
        /// The layout the backup was built with.
        found: String,
    },
    /// The type the manifest states for an output is not the type the node publishes.
    #[error(
        "node `{node}` publishes {found} on its output `{port}`, topic {topic}; the manifest states {expected}"
    )]
    TypeMismatch {
        /// The node.
        node: String,
        /// Its port.
        port: String,
        /// The topic.
        topic: String,
        /// The type that the manifest states.
        expected: String,
        /// The type that the node publishes.
        found: String,
    },
    /// The initial value of a delayed input does not fit its message.
    #[error("node `{node}`, input `{port}`: the initial value does not fit {type_name}: {reason}")]
    InitialValue {
        /// The node.
        node: String,
        /// The input.
        port: String,
        /// The message type.
        type_name: &'static str,
        /// Fault of the value.
        reason: String,
    },
    /// The manifest's parameters do not fit the node.
    #[error("node `{node}`: {reason}")]
    Parameters {
        /// The node.
        node: String,
        /// Key, expected value and found value.
        reason: String,
    },
    /// The program of a node is at fault outside its steps: it uses the library wrongly, its component could not end, or a
    /// state that it states cannot be read.
    #[error("{}{reason}", of_node(node))]
    Program {
        /// The node; empty if it is not known.
        node: String,
        /// Its fault.
        reason: String,
    },
    /// The transport refused something.
    #[error("node `{node}`: {action} failed: {reason}")]
    Transport {
        /// The node.
        node: String,
        /// Action that failed.
        action: String,
        /// iceoryx2's answer.
        reason: String,
    },
    /// A sample is missing: a bug of the bus or a rogue publisher.
    #[error(
        "node `{node}`, topic {topic}, tick {tick}: sample {found} arrived where {expected} was due; \
         a sample was lost or another process publishes on the topic"
    )]
    Gap {
        /// The reader.
        node: String,
        /// The topic.
        topic: String,
        /// The reader's tick.
        tick: u32,
        /// The sequence number that was due.
        expected: u64,
        /// The sequence number that came.
        found: String,
    },
    /// A node computed a tick and left a due output unwritten.
    #[error(
        "node `{node}` computed tick {tick} without writing its output `{port}`, which is due at this tick"
    )]
    UnwrittenOutput {
        /// The node.
        node: String,
        /// The output.
        port: String,
        /// The tick.
        tick: u32,
    },
    /// A node wrote a sample with a number that is not finite.
    #[error(
        "node `{node}` failed at tick {tick} (t = {time_s:.3} s): its output {output} holds {field} = {value}, \
         expected a finite number; the sample was not sent. What the node read last, and its own numbers \
         (gains, vehicle, parameters), are where to look"
    )]
    NotFinite {
        /// The node.
        node: String,
        /// Its output, and the topic.
        output: String,
        /// The field, with its place in an array.
        field: String,
        /// Its value: NaN, inf or -inf.
        value: f64,
        /// The tick.
        tick: u32,
        /// Simulation time in seconds.
        time_s: f64,
    },
    /// A node wrote a sequence whose count does not fit its values.
    #[error(
        "node `{node}` failed at tick {tick} (t = {time_s:.3} s): its output {output} says that {field} has {found} \
         values, expected at most {most}, and zeros behind them; the sample was not sent. Make the values with \
         `Bounded`, which keeps both"
    )]
    Count {
        /// The node.
        node: String,
        /// Its output, and the topic.
        output: String,
        /// The field.
        field: String,
        /// Its count.
        found: usize,
        /// Values for which there is room.
        most: usize,
        /// The tick.
        tick: u32,
        /// Simulation time in seconds.
        time_s: f64,
    },
    /// The node's own computation failed.
    #[error("node `{node}` failed at tick {tick} (t = {time_s:.3} s): {reason}")]
    Step {
        /// The node.
        node: String,
        /// The tick.
        tick: u32,
        /// Simulation time in seconds.
        time_s: f64,
        /// The node's own words.
        reason: String,
    },
    /// The system does not allow a setting of the manifest.
    #[error("cannot {action}: {source}; {advice}")]
    Denied {
        /// Action that failed.
        action: &'static str,
        /// The system's answer.
        source: std::io::Error,
        /// Missing right, and advice for getting it.
        advice: &'static str,
    },
    /// The launcher ended the run early.
    #[error("the run was aborted")]
    Aborted,
}

/// Beginning of the text of an error of `node`; empty if its name is.
fn of_node(node: &str) -> String {
    if node.is_empty() { String::new() } else { format!("node `{node}`: ") }
}

/// Side that is at fault.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Side {
    /// A manifest, a parameter or a file.
    Input,
    /// A component, or the program that has it.
    Component,
    /// The operating system.
    System,
    /// None of them: a request cannot be met, or the cause is not known.
    Other,
}

/// At most one of [`BusError::is_input`], [`BusError::is_component`] and [`BusError::is_system`] is true. The conversion to
/// [`diagnostics::Error`] keeps them.
impl BusError {
    /// True if something that people wrote is at fault: a manifest, a parameter or a file.
    #[must_use]
    pub fn is_input(&self) -> bool {
        self.side() == Side::Input
    }

    /// True if a component is at fault: its step failed, or its program does not fit those of the others.
    #[must_use]
    pub fn is_component(&self) -> bool {
        self.side() == Side::Component
    }

    /// True if the operating system or the transport refused a request: a file, memory or a right.
    ///
    /// ```
    /// let error = component::BusError::FileLimit { needed: 1 << 20, limit: 1 << 10 };
    /// assert!(error.is_system() && !error.is_input() && !error.is_component());
    /// ```
    #[must_use]
    pub fn is_system(&self) -> bool {
        self.side() == Side::System
    }

    // Without a wildcard: whoever adds a variant states its side.
    fn side(&self) -> Side {
        match self {
            Self::Checkpoint { .. }
            | Self::UnwiredPort { .. }
            | Self::UndeclaredPort { .. }
            | Self::TypeMismatch { .. }
            | Self::InitialValue { .. }
            | Self::Parameters { .. } => Side::Input,
            Self::DeclaredTwice { .. }
            | Self::LayoutMismatch { .. }
            | Self::BackupLayout { .. }
            | Self::Program { .. }
            | Self::UnwrittenOutput { .. }
            | Self::NotFinite { .. }
            | Self::Count { .. }
            | Self::Step { .. } => Side::Component,
            Self::File { .. }
            | Self::NoRoom { .. }
            | Self::FileLimit { .. }
            | Self::Transport { .. }
            | Self::Denied { .. } => Side::System,
            // The processes of a run write its files: who has damaged one is not known.
            Self::Content { .. }
            | Self::NotInARun { .. }
            | Self::Claimed { .. }
            | Self::UnknownNode { .. }
            | Self::UnknownTopic { .. }
            | Self::Gap { .. }
            | Self::Aborted => Side::Other,
        }
    }

    /// Kind of a refusal that has no `io::Error` as its source.
    fn refusal(&self) -> Option<ErrorKind> {
        match self {
            Self::NoRoom { .. } => Some(ErrorKind::StorageFull),
            Self::FileLimit { .. } => Some(ErrorKind::FileTooLarge),
            Self::Transport { .. } => Some(ErrorKind::Other),
            _ => None,
        }
    }

    /// Name of the node that the error is about, if it is about one.
    #[must_use]
    pub fn node(&self) -> Option<&str> {
        match self {
            Self::Checkpoint { node, .. }
            | Self::UnwiredPort { node, .. }
            | Self::UndeclaredPort { node, .. }
            | Self::DeclaredTwice { node, .. }
            | Self::LayoutMismatch { node, .. }
            | Self::BackupLayout { node, .. }
            | Self::TypeMismatch { node, .. }
            | Self::InitialValue { node, .. }
            | Self::Parameters { node, .. }
            | Self::Program { node, .. }
            | Self::Transport { node, .. }
            | Self::Gap { node, .. }
            | Self::UnwrittenOutput { node, .. }
            | Self::NotFinite { node, .. }
            | Self::Count { node, .. }
            | Self::Step { node, .. } => Some(node.as_str()).filter(|node| !node.is_empty()),
            Self::NotInARun { .. }
            | Self::Claimed { .. }
            | Self::File { .. }
            | Self::NoRoom { .. }
            | Self::FileLimit { .. }
            | Self::Content { .. }
            | Self::UnknownNode { .. }
            | Self::UnknownTopic { .. }
            | Self::Denied { .. }
            | Self::Aborted => None,
        }
    }
}

/// A failed step is the failure of its component; a refusal of the system is one of the system.
///
/// ```
/// let reason = "the gyroscope is stuck".to_owned();
/// let error = component::BusError::Step { node: "imu".to_owned(), tick: 7, time_s: 0.07, reason };
/// let error = diagnostics::Error::from(error);
/// assert!(error.is_component() && error.process() == Some("imu"));
/// ```
impl From<BusError> for diagnostics::Error {
    fn from(error: BusError) -> Self {
        let node = error.node().map(str::to_owned);
        match error.side() {
            Side::Input => ParameterError::conflict("", error).into(),
            Side::Component => ComponentFailure::new(node.as_deref(), error).into(),
            Side::System | Side::Other => match error.refusal() {
                Some(kind) => io::Error::new(kind, error).into(),
                None => Self::new(error),
            },
        }
    }
}

/// As `Display`: a node's `fn main() -> Result<(), BusError>` prints this, and people read it.
impl std::fmt::Debug for BusError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{self}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Errors with a manifest, a parameter or a file at fault.
    fn of_input() -> Vec<BusError> {
        let (node, port, reason) = ("imu".to_owned(), "rates".to_owned(), "it is too short".to_owned());
        let known = String::new();
        vec![
            BusError::Checkpoint { node: node.clone(), reason: reason.clone() },
            BusError::UnwiredPort {
                node: node.clone(),
                direction: "input",
                port: port.clone(),
                verb: "wire",
                known,
            },
            BusError::UndeclaredPort { node: node.clone(), direction: "input", port: port.clone() },
            BusError::TypeMismatch {
                node: node.clone(),
                port: port.clone(),
                topic: "/imu/rates".to_owned(),
                expected: "a".to_owned(),
                found: "b".to_owned(),
            },
            BusError::InitialValue { node: node.clone(), port, type_name: "a", reason: reason.clone() },
            BusError::Parameters { node, reason },
        ]
    }

    /// Errors with a component at fault.
    fn of_component() -> Vec<BusError> {
        let (node, port, topic) = ("imu".to_owned(), "rates".to_owned(), "/imu/rates".to_owned());
        let (expected, found) = ("float64 x".to_owned(), "float32 x".to_owned());
        let (output, field, tick, time_s) = (topic.clone(), "x".to_owned(), 7, 0.07);
        vec![
            BusError::DeclaredTwice {
                node: node.clone(),
                direction: "input",
                port: port.clone(),
                first: "a",
                second: "b",
            },
            BusError::LayoutMismatch {
                topic: topic.clone(),
                node: node.clone(),
                port: port.clone(),
                expected: expected.clone(),
                sender: "plant".to_owned(),
                sender_port: "state".to_owned(),
                found: found.clone(),
                advice: "Rebuild it".to_owned(),
            },
            BusError::BackupLayout { node: node.clone(), topic, expected, found },
            BusError::Program { node: node.clone(), reason: "it runs already".to_owned() },
            BusError::UnwrittenOutput { node: node.clone(), port, tick },
            BusError::NotFinite {
                node: node.clone(),
                output: output.clone(),
                field: field.clone(),
                value: f64::NAN,
                tick,
                time_s,
            },
            BusError::Count { node: node.clone(), output, field, found: 3, most: 2, tick, time_s },
            BusError::Step { node, tick, time_s, reason: "the gyroscope is stuck".to_owned() },
        ]
    }

    /// Errors of the operating system or the transport.
    fn of_system() -> Vec<BusError> {
        let source = || io::Error::from(ErrorKind::PermissionDenied);
        let (node, reason) = ("imu".to_owned(), "ServiceCouldNotBeCreated".to_owned());
        vec![
            BusError::File { action: "open", path: "plan.json".into(), source: source() },
            BusError::NoRoom { what: "samples".to_owned(), needed: 2, folder: "/dev/shm".into(), free: 1 },
            BusError::FileLimit { needed: 2, limit: 1 },
            BusError::Transport { node, action: "opening topic /imu/rates".to_owned(), reason },
            BusError::Denied { action: "pin to core 7", source: source(), advice: "allow it" },
        ]
    }

    /// Errors that blame no side.
    fn of_none() -> Vec<BusError> {
        let (name, known) = ("imu".to_owned(), "plant".to_owned());
        vec![
            BusError::Content {
                path: "plan.json".into(),
                expected: "a plan",
                found: "half of one".to_owned(),
            },
            BusError::NotInARun { variable: "HUMMINGBUS_RUN" },
            BusError::Claimed { name: name.clone() },
            BusError::UnknownNode { node: name.clone(), known: known.clone() },
            BusError::UnknownTopic { topic: "/imu/rates".to_owned(), known },
            BusError::Gap {
                node: name,
                topic: "/imu/rates".to_owned(),
                tick: 7,
                expected: 6,
                found: "8".to_owned(),
            },
            BusError::Aborted,
        ]
    }

    #[test]
    fn a_program_whose_node_is_not_known_has_no_name_in_its_error() {
        let reason = "the argument `node` is a null pointer".to_owned();
        let error = BusError::Program { node: String::new(), reason: reason.clone() };
        assert_eq!((error.to_string(), error.node()), (reason, None));
        let error = diagnostics::Error::from(error);
        assert!(error.is_component() && error.process().is_none());
    }

    #[test]
    fn every_error_has_its_side_and_keeps_it_when_it_is_converted() {
        let all = [
            (of_input(), [true, false, false]),
            (of_component(), [false, true, false]),
            (of_system(), [false, false, true]),
            (of_none(), [false; 3]),
        ];
        assert_eq!(all.iter().map(|(errors, _)| errors.len()).sum::<usize>(), 26, "each variant once");
        for (errors, sides) in all {
            for error in errors {
                let (text, node) = (error.to_string(), error.node().map(str::to_owned));
                assert_eq!([error.is_input(), error.is_component(), error.is_system()], sides, "{text}");
                let error = diagnostics::Error::from(error);
                assert_eq!([error.is_input(), error.is_component(), error.is_system()], sides, "{text}");
                assert_eq!(error.with_causes(), text);
                assert_eq!(error.process().map(str::to_owned), node.filter(|_| error.is_component()));
            }
        }
    }
}
