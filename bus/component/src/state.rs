//! The state of a component: everything that changes from tick to tick, and its bytes.

use crate::message::Message;
use crate::schema::Schema;

/// Transfer of a component's state to the process that takes its place.
#[derive(Clone, Copy, Debug)]
pub enum Transfer {
    /// The state is one message, copied bit for bit.
    Message(&'static Schema),
    /// The component has no state.
    Nothing,
    /// The state is transferred as bytes. Their number depends on the component's parameters; the text names their type.
    Bytes(&'static str),
    /// The state is transferred as bytes whose number grows with the run: a checkpoint holds them, and no other process
    /// takes the component's place in flight. The text names their type.
    Growing(&'static str),
    /// The state is a file that is being written. No other process can continue it.
    File,
    /// The state is in another program, which does not export it. Another process can take the component's place and
    /// goes on from its last outputs; a checkpoint cannot hold it. The text names the program.
    External(&'static str),
}

/// The state of a component: everything that changes from tick to tick.
///
/// A [`Message`] is a state by itself, and so is `()`. A type with other contents, for example vectors whose length
/// follows from the parameters, writes its own bytes. Buffers that every step overwrites may be part of it; they need
/// not be saved.
///
/// ```
/// use component::{State, StateError, Transfer};
///
/// /// The samples of a moving average. Its length is a parameter.
/// struct Window(Vec<f64>);
///
/// impl State for Window {
///     const TRANSFER: Transfer = Transfer::Bytes("Window");
///
///     fn size(&self) -> usize {
///         8 * self.0.len()
///     }
///
///     fn save(&self, bytes: &mut [u8]) {
///         for (place, sample) in bytes.chunks_exact_mut(8).zip(&self.0) {
///             place.copy_from_slice(&sample.to_le_bytes());
///         }
///     }
///
///     fn load(&mut self, bytes: &[u8]) -> Result<(), StateError> {
///         StateError::check_size("Window", self.size(), bytes)?;
///         for (sample, place) in self.0.iter_mut().zip(bytes.chunks_exact(8)) {
///             *sample = f64::from_le_bytes(place.try_into().unwrap_or_default());
///         }
///         Ok(())
///     }
/// }
///
/// let (first, mut second) = (Window(vec![1.0, 2.0]), Window(vec![0.0; 2]));
/// let mut bytes = vec![0; first.size()];
/// first.save(&mut bytes);
/// second.load(&bytes)?;
/// assert_eq!(second.0, [1.0, 2.0]);
/// assert!(Window(vec![0.0; 3]).load(&bytes).is_err());
/// # Ok::<(), StateError>(())
/// ```
pub trait State: Send + Sized + 'static {
    /// Transfer of the state to the process that takes the component's place.
    const TRANSFER: Transfer;

    /// Number that differs between two configurations of which one cannot continue from the state of the other, although both
    /// have as many bytes: a successor with another number is given no state.
    fn configuration(&self) -> u64 {
        0
    }

    /// Number of bytes that [`State::save`] writes: constant for one component made from the same parameters, unless the
    /// state is [growing](Transfer::Growing).
    fn size(&self) -> usize;

    /// Writes the state into `bytes`, which are [`State::size`] bytes, and leaves none of them as it was. Does not allocate.
    fn save(&self, bytes: &mut [u8]);

    /// Continues from `bytes` that [`State::save`] wrote for a component made from the same parameters. Does not allocate.
    ///
    /// # Errors
    /// The bytes do not fit this state.
    fn load(&mut self, bytes: &[u8]) -> Result<(), StateError>;

    /// Continues from `bytes` that [`State::save`] wrote for the same component with other parameters, by which its
    /// state has another layout: a fork from a checkpoint goes on so. False if it cannot, as by default.
    ///
    /// # Errors
    /// The bytes do not fit these parameters.
    fn adopt(&mut self, _bytes: &[u8]) -> Result<bool, StateError> {
        Ok(false)
    }
}

/// Reason why a component cannot continue from the bytes of a state.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum StateError {
    /// Their number is wrong.
    #[error(
        "a state of type {type_name} has {found} bytes, expected {expected}: it is of a component with other parameters"
    )]
    Size {
        /// Type of the state.
        type_name: &'static str,
        /// Size of the state that was to be loaded.
        expected: usize,
        /// Number of bytes given.
        found: usize,
    },
    /// Their contents are wrong.
    #[error("the state of type {type_name} cannot be loaded: {reason}")]
    Contents {
        /// Type of the state.
        type_name: &'static str,
        /// The part that does not fit, and what was expected.
        reason: String,
    },
    /// The state is a file.
    #[error("the state is a file that another process writes; it cannot be loaded")]
    File,
}

impl StateError {
    /// Refuses `bytes` that are not `expected` in number.
    ///
    /// # Errors
    /// Both numbers.
    pub fn check_size(type_name: &'static str, expected: usize, bytes: &[u8]) -> Result<(), Self> {
        let found = bytes.len();
        if found == expected { Ok(()) } else { Err(Self::Size { type_name, expected, found }) }
    }
}

impl<M: Message> State for M {
    const TRANSFER: Transfer = Transfer::Message(M::SCHEMA);

    fn size(&self) -> usize {
        size_of::<M>()
    }

    fn save(&self, bytes: &mut [u8]) {
        bytes.copy_from_slice(bytemuck::bytes_of(self));
    }

    fn load(&mut self, bytes: &[u8]) -> Result<(), StateError> {
        StateError::check_size(M::SCHEMA.type_name, size_of::<M>(), bytes)?;
        bytemuck::bytes_of_mut(self).copy_from_slice(bytes);
        Ok(())
    }
}

impl State for () {
    const TRANSFER: Transfer = Transfer::Nothing;

    fn size(&self) -> usize {
        0
    }

    fn save(&self, _: &mut [u8]) {}

    fn load(&mut self, bytes: &[u8]) -> Result<(), StateError> {
        StateError::check_size("()", 0, bytes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::messages::SetPoint;

    #[test]
    fn a_message_is_a_state_and_refuses_another_size() {
        let mut state = SetPoint { altitude: 1.5, ..Default::default() };
        let mut bytes = vec![0; state.size()];
        state.save(&mut bytes);
        state.altitude = 2.0;
        state.load(&bytes).unwrap();
        assert_eq!(state.altitude, 1.5);
        let error = state.load(&bytes[1..]).unwrap_err().to_string();
        assert!(error.contains("SetPoint has 39 bytes, expected 40"), "{error}");
        assert!(matches!(SetPoint::TRANSFER, Transfer::Message(schema) if schema.size == bytes.len()));
    }

    #[test]
    fn no_state_has_no_bytes() {
        assert!(matches!(<()>::TRANSFER, Transfer::Nothing));
        assert_eq!((().size(), ().load(&[])), (0, Ok(())));
        assert!(().load(&[0]).is_err());
        assert_eq!(().adopt(&[0]), Ok(false));
    }
}
