//! State as bytes: fields of fixed width in a fixed order, written and read without allocation.

use component::random::Stream;
use nalgebra::{Quaternion, UnitQuaternion, Vector3};

/// A part of a state that is written as bytes and read back.
///
/// ```
/// use plant::saved::{Reader, Saved, Writer};
///
/// let (part, mut other) = ([1.5, -2.0], [0.0; 2]);
/// let mut bytes = vec![0; part.size()];
/// part.save(&mut Writer::new(&mut bytes));
/// other.load(&mut Reader::new(&bytes))?;
/// assert_eq!(other, part);
/// assert!(other.load(&mut Reader::new(&bytes[1..])).is_err());
/// # Ok::<(), plant::saved::Unfit>(())
/// ```
pub trait Saved {
    /// Number of bytes that [`Saved::save`] writes; it does not change.
    fn size(&self) -> usize;

    /// Writes all of it.
    fn save(&self, to: &mut Writer<'_>);

    /// Reads all of it.
    ///
    /// # Errors
    /// The bytes do not fit.
    fn load(&mut self, from: &mut Reader<'_>) -> Result<(), Unfit>;

    /// Reads all of what the same part of a vehicle with other effects has written. A part that does not depend on effects
    /// reads it as its own.
    ///
    /// # Errors
    /// The bytes do not fit.
    fn adopt(&mut self, from: &mut Reader<'_>) -> Result<(), Unfit> {
        self.load(from)
    }
}

/// Reason why bytes do not fit a state.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum Unfit {
    /// There are not enough of them.
    #[error("the bytes end early")]
    Short,
    /// A value is outside its range.
    #[error("{0}")]
    Value(&'static str),
}

/// Bytes that are written from the first to the last.
#[derive(Debug)]
pub struct Writer<'a>(&'a mut [u8]);

impl<'a> Writer<'a> {
    /// Writes to `bytes`.
    pub fn new(bytes: &'a mut [u8]) -> Self {
        Self(bytes)
    }

    fn next(&mut self, count: usize) -> &'a mut [u8] {
        let bytes = std::mem::take(&mut self.0);
        assert!(count <= bytes.len(), "a state is written to as many bytes as it says that it has");
        let (next, rest) = bytes.split_at_mut(count);
        self.0 = rest;
        next
    }

    fn put(&mut self, bytes: &[u8]) {
        self.next(bytes.len()).copy_from_slice(bytes);
    }
}

/// Bytes that are read from the first to the last.
#[derive(Debug)]
pub struct Reader<'a>(&'a [u8]);

impl<'a> Reader<'a> {
    /// Reads `bytes`.
    #[must_use]
    pub fn new(bytes: &'a [u8]) -> Self {
        Self(bytes)
    }

    fn take<const N: usize>(&mut self) -> Result<[u8; N], Unfit> {
        let (next, rest) = self.0.split_first_chunk().ok_or(Unfit::Short)?;
        self.0 = rest;
        Ok(*next)
    }

    /// True if no bytes are left.
    pub(crate) fn is_at_end(&self) -> bool {
        self.0.is_empty()
    }

    /// Leaves out `count` bytes.
    pub(crate) fn skip(&mut self, count: usize) -> Result<(), Unfit> {
        self.0 = self.0.get(count..).ok_or(Unfit::Short)?;
        Ok(())
    }
}

macro_rules! numbers {
    ($($number:ty),*) => {$(
        impl Saved for $number {
            fn size(&self) -> usize {
                size_of::<Self>()
            }

            fn save(&self, to: &mut Writer<'_>) {
                to.put(&self.to_le_bytes());
            }

            fn load(&mut self, from: &mut Reader<'_>) -> Result<(), Unfit> {
                *self = Self::from_le_bytes(from.take()?);
                Ok(())
            }
        }
    )*};
}

numbers!(f64, u8, u32, u64, u128);

/// Implements [`Saved`] for a struct by its fields.
macro_rules! saved_fields {
    ($name:ty { $($field:ident),+ $(,)? }) => {
        impl $crate::saved::Saved for $name {
            fn size(&self) -> usize {
                0 $(+ $crate::saved::Saved::size(&self.$field))+
            }

            fn save(&self, to: &mut $crate::saved::Writer<'_>) {
                $($crate::saved::Saved::save(&self.$field, to);)+
            }

            fn load(&mut self, from: &mut $crate::saved::Reader<'_>) -> Result<(), $crate::saved::Unfit> {
                $($crate::saved::Saved::load(&mut self.$field, from)?;)+
                Ok(())
            }
        }
    };
}
pub(crate) use saved_fields;

impl Saved for bool {
    fn size(&self) -> usize {
        1
    }

    fn save(&self, to: &mut Writer<'_>) {
        u8::from(*self).save(to);
    }

    fn load(&mut self, from: &mut Reader<'_>) -> Result<(), Unfit> {
        *self = match from.take()? {
            [0] => false,
            [1] => true,
            _ => return Err(Unfit::Value("a flag is neither 0 nor 1")),
        };
        Ok(())
    }
}

impl<T: Saved, const N: usize> Saved for [T; N] {
    fn size(&self) -> usize {
        self.iter().map(T::size).sum()
    }

    fn save(&self, to: &mut Writer<'_>) {
        self.iter().for_each(|item| item.save(to));
    }

    fn load(&mut self, from: &mut Reader<'_>) -> Result<(), Unfit> {
        self.iter_mut().try_for_each(|item| item.load(from))
    }
}

/// The values that there are: their count follows from the configuration.
impl<T: Saved, const N: usize> Saved for component::Bounded<T, N> {
    fn size(&self) -> usize {
        self.iter().map(T::size).sum()
    }

    fn save(&self, to: &mut Writer<'_>) {
        self.iter().for_each(|item| item.save(to));
    }

    fn load(&mut self, from: &mut Reader<'_>) -> Result<(), Unfit> {
        self.iter_mut().try_for_each(|item| item.load(from))
    }
}

/// A vector whose length follows from the configuration.
impl<T: Saved> Saved for Vec<T> {
    fn size(&self) -> usize {
        self.iter().map(T::size).sum()
    }

    fn save(&self, to: &mut Writer<'_>) {
        self.iter().for_each(|item| item.save(to));
    }

    fn load(&mut self, from: &mut Reader<'_>) -> Result<(), Unfit> {
        self.iter_mut().try_for_each(|item| item.load(from))
    }
}

impl Saved for Vector3<f64> {
    fn size(&self) -> usize {
        3 * size_of::<f64>()
    }

    fn save(&self, to: &mut Writer<'_>) {
        self.iter().for_each(|number| number.save(to));
    }

    fn load(&mut self, from: &mut Reader<'_>) -> Result<(), Unfit> {
        self.iter_mut().try_for_each(|number| number.load(from))
    }
}

impl Saved for UnitQuaternion<f64> {
    fn size(&self) -> usize {
        4 * size_of::<f64>()
    }

    fn save(&self, to: &mut Writer<'_>) {
        self.coords.iter().for_each(|number| number.save(to));
    }

    fn load(&mut self, from: &mut Reader<'_>) -> Result<(), Unfit> {
        let mut coords = self.coords;
        coords.iter_mut().try_for_each(|number| number.load(from))?;
        *self = Self::new_unchecked(Quaternion::from(coords));
        Ok(())
    }
}

/// Bytes of the place in a random stream.
pub(crate) const STREAM_BYTES: usize = size_of::<u64>() + size_of::<u128>();

/// Place in a random stream: its number and its position. The key stays: it follows from the run's seed and the node's name,
/// and a run that goes on with another seed has other noise from there on.
impl Saved for Stream {
    fn size(&self) -> usize {
        STREAM_BYTES
    }

    fn save(&self, to: &mut Writer<'_>) {
        self.get_stream().save(to);
        self.get_word_pos().save(to);
    }

    fn load(&mut self, from: &mut Reader<'_>) -> Result<(), Unfit> {
        let (mut number, mut position) = (0_u64, 0_u128);
        number.load(from)?;
        position.load(from)?;
        if self.get_stream() != number {
            self.set_stream(number);
        }
        // If it is there already, its block need not be computed again.
        if self.get_word_pos() != position {
            self.set_word_pos(position);
        }
        Ok(())
    }
}

/// Items of a number that changes, up to a most that follows from the configuration.
#[derive(Debug, Clone)]
pub(crate) struct Bounded<T> {
    items: Vec<T>,
    most: usize,
}

impl<T: Copy + Default> Bounded<T> {
    /// No items so far, and at most `most` of them.
    pub(crate) fn new(most: usize) -> Self {
        Self { items: Vec::with_capacity(most), most }
    }

    pub(crate) fn as_slice(&self) -> &[T] {
        &self.items
    }

    pub(crate) fn iter_mut(&mut self) -> impl Iterator<Item = &mut T> {
        self.items.iter_mut()
    }

    /// Adds an item, unless there are as many as there may be.
    pub(crate) fn push(&mut self, item: T) {
        if self.items.len() < self.most {
            self.items.push(item);
        }
    }

    /// Adds as many of `items` as there may be.
    pub(crate) fn extend(&mut self, items: impl Iterator<Item = T>) {
        let left = self.most - self.items.len();
        self.items.extend(items.take(left));
    }

    pub(crate) fn retain(&mut self, keep: impl FnMut(&T) -> bool) {
        self.items.retain(keep);
    }

    pub(crate) fn clear(&mut self) {
        self.items.clear();
    }
}

impl<T: Saved + Copy + Default> Saved for Bounded<T> {
    fn size(&self) -> usize {
        size_of::<u64>() + self.most * T::default().size()
    }

    fn save(&self, to: &mut Writer<'_>) {
        (self.items.len() as u64).save(to);
        self.items.save(to);
        // Free places are zeros, so that equal states are equal bytes.
        to.next((self.most - self.items.len()) * T::default().size()).fill(0);
    }

    fn load(&mut self, from: &mut Reader<'_>) -> Result<(), Unfit> {
        let mut count = 0_u64;
        count.load(from)?;
        let count = usize::try_from(count).ok().filter(|count| *count <= self.most);
        let count = count.ok_or(Unfit::Value("it has more items than fit"))?;
        self.items.clear();
        for _ in 0..count {
            let mut item = T::default();
            item.load(from)?;
            self.items.push(item);
        }
        from.skip((self.most - count) * T::default().size())
    }
}

/// `hash` with a `name`.
fn hashed(hash: u64, name: &str) -> u64 {
    // No name has the byte 255, so that no two names are taken for one.
    component::random::fnv1a(&[255], component::random::fnv1a(name.as_bytes(), hash))
}

/// Hash of a configuration: it is saved, and the state of another configuration is refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Fingerprint(u64);

impl Fingerprint {
    /// The fingerprint of parts with these `names`.
    pub(crate) fn of<'n>(names: impl Iterator<Item = &'n str>) -> Self {
        Self(names.fold(component::random::FNV_OFFSET, hashed))
    }

    /// The same, and those of parts with these `names`.
    pub(crate) fn and<'n>(self, names: impl Iterator<Item = &'n str>) -> Self {
        Self(names.fold(self.0, hashed))
    }

    /// The same, and these `numbers`.
    pub(crate) fn with(self, numbers: impl Iterator<Item = f64>) -> Self {
        let hash = |hash, number: f64| component::random::fnv1a(&number.to_bits().to_le_bytes(), hash);
        Self(numbers.fold(self.0, hash))
    }

    /// The hash.
    pub(crate) fn number(self) -> u64 {
        self.0
    }
}

impl Saved for Fingerprint {
    fn size(&self) -> usize {
        self.0.size()
    }

    fn save(&self, to: &mut Writer<'_>) {
        self.0.save(to);
    }

    fn load(&mut self, from: &mut Reader<'_>) -> Result<(), Unfit> {
        let mut found = 0_u64;
        found.load(from)?;
        if found == self.0 {
            Ok(())
        } else {
            Err(Unfit::Value("it is of another backend, another scene or other effects"))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use component::random::{normal, stream};

    fn saved(part: &impl Saved) -> Vec<u8> {
        let mut bytes = vec![0xaa; part.size()];
        part.save(&mut Writer::new(&mut bytes));
        bytes
    }

    #[test]
    fn a_stream_continues_in_one_of_its_key_and_another_key_stays() {
        let [mut first, mut second, mut other] = [1, 1, 2].map(|seed| stream(seed, "plant"));
        first.set_stream(3);
        assert!((0..17).all(|_| normal(&mut first).is_finite()));
        for loaded in [&mut second, &mut other] {
            loaded.load(&mut Reader::new(&saved(&first))).unwrap();
            assert_eq!(loaded.get_word_pos(), first.get_word_pos());
        }
        let drawn = normal(&mut first);
        assert_eq!(normal(&mut second), drawn);
        assert_ne!(normal(&mut other), drawn);
    }

    #[test]
    fn bounded_items_keep_their_size_and_refuse_more_than_they_hold() {
        let mut few = Bounded::new(3);
        let empty = saved(&few);
        few.extend([1.5, 2.5].into_iter());
        assert_eq!(saved(&few).len(), empty.len());
        let mut other = Bounded::new(3);
        other.extend([9.0; 5].into_iter());
        other.push(9.0);
        assert_eq!(other.as_slice(), [9.0; 3]);
        other.load(&mut Reader::new(&saved(&few))).unwrap();
        assert_eq!(other.as_slice(), [1.5, 2.5]);
        let mut more = saved(&few);
        more[0] = 4;
        let error = other.load(&mut Reader::new(&more)).unwrap_err();
        assert_eq!(error, Unfit::Value("it has more items than fit"));
        assert_eq!(other.load(&mut Reader::new(&saved(&few)[..20])), Err(Unfit::Short));
    }

    #[test]
    fn a_flag_and_a_fingerprint_refuse_what_they_are_not() {
        assert!(false.load(&mut Reader::new(&[2])).is_err());
        let print = |number: f64| Fingerprint::of(["rapier"].into_iter()).with([1.0, number].into_iter());
        assert_eq!(print(2.0).load(&mut Reader::new(&saved(&print(2.0)))), Ok(()));
        assert!(print(2.0).load(&mut Reader::new(&saved(&print(2.5)))).is_err());
    }
}
