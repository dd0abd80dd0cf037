//! Role of a process in its run.

/// Role of a process.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// The clock service.
    Clock,
    /// A process of a node.
    Node {
        /// Index in the plan.
        node: usize,
        /// Number of the process among those of this node.
        generation: u32,
    },
    /// A process that takes no part in the ticks.
    Sidecar {
        /// Its number among the sidecars of the run.
        index: usize,
        /// Counts the processes of this sidecar.
        generation: u32,
    },
}

impl Role {
    /// Counts the processes of this role; the first is 0.
    pub fn generation(self) -> u32 {
        match self {
            Self::Clock => 0,
            Self::Node { generation, .. } | Self::Sidecar { generation, .. } => generation,
        }
    }
}
