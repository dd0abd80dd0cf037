//! The vehicle files that this crate brings, as text: for examples and tests, which then need no file.
//!
//! ```
//! let vehicle = vehicles::Vehicle::parse(vehicles::reference::HUMMINGBIRD, "hummingbird.toml")?;
//! assert_eq!(vehicle.mass_kg, 0.480);
//! # Ok::<(), diagnostics::Diagnostic>(())
//! ```

/// The AscTec Hummingbird of the thesis.
pub const HUMMINGBIRD: &str = include_str!("../hummingbird.toml");
/// The Bitcraze Crazyflie 2.1.
pub const CRAZYFLIE: &str = include_str!("../crazyflie-2.1.toml");
