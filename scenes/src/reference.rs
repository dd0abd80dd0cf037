//! The scene files that this crate brings, as text: for examples and tests, which then need no file.
//!
//! ```
//! let scene = scenes::Scene::parse(scenes::reference::ROOM, "room.toml")?;
//! assert_eq!(scene.boxes.len(), 4);
//! # Ok::<(), diagnostics::Diagnostic>(())
//! ```

/// Nothing but the ground, with its contact.
pub const GROUND: &str = include_str!("../ground.toml");
/// Four walls and the ground.
pub const ROOM: &str = include_str!("../room.toml");
/// A vehicle on a rig that holds its position.
pub const RIG_FIXED: &str = include_str!("../rig-fixed.toml");
/// A vehicle on a rig that slides.
pub const RIG_SLIDING: &str = include_str!("../rig-sliding.toml");
/// A turntable, a sliding gate and an arm of the vehicle that motors drive.
pub const DRIVEN_JOINTS: &str = include_str!("../driven-joints.toml");
/// A load that hangs from the vehicle by a rope.
pub const SLUNG_LOAD: &str = include_str!("../slung-load.toml");
