//! Friction and restitution of things.

/// Friction and restitution of a surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Surface {
    /// Coulomb's coefficient of friction: the force along the surface is at most this times that across.
    pub friction: f64,
    /// Newton's coefficient of restitution: the fraction of the speed of approach that a bounce leaves.
    pub restitution: f64,
}

impl Default for Surface {
    /// Surface of a scene that states none: tuned, no source.
    fn default() -> Self {
        Self { friction: 0.5, restitution: 0.2 }
    }
}
