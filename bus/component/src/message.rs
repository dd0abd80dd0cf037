//! The `Message` trait and the layout of a message in a shared-memory sample.
//!
//! A sample is a slice of 64-bit words: one word whose last four bytes are the CDR encapsulation
//! header `00 01 00 00` (little-endian XCDR1), then the message. A recorder therefore writes the
//! sample's bytes from [`CDR_START`] on, untouched, as a ROS 2 message.

use crate::schema::Schema;

/// A fixed-layout message; implement it with `#[derive(component::Message)]`.
///
/// ```
/// use component::messages::Time;
///
/// /// Voltage of a battery.
/// #[derive(Clone, Copy, component::Message)]
/// #[repr(C)]
/// #[message(type_name = "my_msgs/msg/Battery")]
/// struct Battery {
///     stamp: Time,
///     /// Voltage at the terminals.
///     #[field(unit = "V")]
///     voltage: f64,
/// }
/// assert!(<Battery as component::Message>::SCHEMA.ros2_definition().contains("float64 voltage  # [V]"));
/// ```
///
/// Implicit padding does not compile:
/// ```compile_fail,E0080
/// # use component::messages::Time;
/// #[derive(Clone, Copy, component::Message)]
/// #[repr(C)]
/// #[message(type_name = "my_msgs/msg/Padded")]
/// struct Padded {
///     flag: u32,
///     count: u64,
/// }
/// ```
///
/// Nor does a number without a unit:
/// ```compile_fail
/// #[derive(Clone, Copy, component::Message)]
/// #[repr(C)]
/// #[message(type_name = "my_msgs/msg/Unitless")]
/// struct Unitless {
///     voltage: f64,
/// }
/// ```
///
/// A [`Bounded`](crate::Bounded), a sequence of numbers, is the last field:
/// ```compile_fail,E0080
/// #[derive(Clone, Copy, component::Message)]
/// #[repr(C)]
/// #[message(type_name = "my_msgs/msg/Cells")]
/// struct Cells {
///     #[field(unit = "V")]
///     voltage: component::Bounded<f64, 12>,
///     flags: u64,
/// }
/// ```
pub trait Message: bytemuck::Pod + Send {
    /// Type name, fields, units and frames.
    const SCHEMA: &'static Schema;
}

/// Offset of the CDR encapsulation header in a sample's bytes.
pub const CDR_START: usize = 4;
/// Offset of the message in a sample's bytes.
pub const BODY_START: usize = 8;

/// The first word of every sample: four reserved bytes, then `00 01 00 00`.
#[doc(hidden)]
pub const ENCAPSULATION_WORD: u64 = u64::from_le_bytes([0, 0, 0, 0, 0, 1, 0, 0]);

/// Words in a sample whose message has `size` bytes.
#[doc(hidden)]
#[must_use]
pub const fn sample_words(size: usize) -> usize {
    1 + size.div_ceil(8)
}

/// The message in a sample.
///
/// # Panics
/// If the sample is shorter than the message; joining a run checks both sides' layouts.
#[doc(hidden)]
#[must_use]
pub fn view<T: Message>(words: &[u64]) -> &T {
    bytemuck::from_bytes(&bytemuck::cast_slice(&words[1..])[..T::SCHEMA.size])
}

/// As [`view`], for writing.
#[doc(hidden)]
pub fn view_mut<T: Message>(words: &mut [u64]) -> &mut T {
    bytemuck::from_bytes_mut(&mut bytemuck::cast_slice_mut(&mut words[1..])[..T::SCHEMA.size])
}

/// The bytes that a recording holds: the encapsulation header and a message of `size` bytes.
#[doc(hidden)]
#[must_use]
pub fn cdr_bytes(words: &[u64], size: usize) -> &[u8] {
    &bytemuck::cast_slice(words)[CDR_START..BODY_START + size]
}

/// The bytes of a message of `size` bytes alone.
#[doc(hidden)]
#[must_use]
pub fn message_bytes(words: &[u64], size: usize) -> &[u8] {
    &bytemuck::cast_slice(words)[BODY_START..BODY_START + size]
}
