//! Parts of a wrench, by their names.

/// A part of a wrench.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Part {
    /// Thrust along body z.
    Thrust,
    /// Torque about body x.
    Roll,
    /// Torque about body y.
    Pitch,
    /// Torque about body z.
    Yaw,
}

impl std::fmt::Display for Part {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Thrust => "thrust",
            Self::Roll => "roll",
            Self::Pitch => "pitch",
            Self::Yaw => "yaw",
        })
    }
}

impl Part {
    /// The numbers of rotors that turn each way, where the part follows from them.
    pub(crate) fn turning(self, [counter_clockwise, clockwise]: [usize; 2]) -> String {
        match self {
            Self::Yaw => format!(" ({counter_clockwise} turn counter-clockwise, {clockwise} clockwise)"),
            Self::Thrust | Self::Roll | Self::Pitch => String::new(),
        }
    }
}
