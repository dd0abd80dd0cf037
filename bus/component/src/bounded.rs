//! Numbers of which a message holds as many as there are, up to a fixed number: a bounded sequence of ROS 2.

use crate::schema::{FieldType, Kind};
use std::fmt;
use std::ops::{Deref, DerefMut};

/// Up to `N` values: their count, and room for all. The values behind the count are defaults (zeros).
///
/// It dereferences to the slice of the values that count. As the last field of a message it is the bounded sequence
/// `float64[<=N]` of ROS 2: a recording holds the message up to the last value that counts.
///
/// ```
/// use component::Bounded;
///
/// let mut speeds = Bounded::<f64, 12>::from([400.0, 410.0, 420.0, 430.0]);
/// speeds[3] = 440.0;
/// assert_eq!(speeds, [400.0, 410.0, 420.0, 440.0]);
/// assert_eq!(speeds.iter().copied().fold(0.0, f64::max), 440.0);
/// assert_eq!(speeds.map(|speed| speed > 405.0), [false, true, true, true]);
/// assert!(Bounded::<f64, 2>::of(&[1.0, 2.0, 3.0]).is_none());
/// ```
///
/// More values than there is room for do not compile:
/// ```compile_fail,E0080
/// let _ = component::Bounded::<f64, 2>::from([1.0, 2.0, 3.0]);
/// ```
#[derive(Clone, Copy)]
#[repr(C)]
pub struct Bounded<T, const N: usize> {
    count: u32,
    /// Zero. CDR aligns values of 8 bytes to 8 bytes, and so does memory.
    pad: u32,
    values: [T; N],
}

impl<T: Copy + Default, const N: usize> Bounded<T, N> {
    /// `count` values, each made from its index; at most `N`.
    #[must_use]
    #[inline]
    pub fn from_fn(count: usize, mut value: impl FnMut(usize) -> T) -> Self {
        let mut all = Self::default();
        let used = all.values.iter_mut().take(count);
        all.count = used.enumerate().map(|(index, place)| *place = value(index)).count() as u32;
        all
    }

    /// `count` times the same value; at most `N` times.
    #[must_use]
    #[inline]
    pub fn filled(count: usize, value: T) -> Self {
        Self::from_fn(count, |_| value)
    }

    /// The sequence of `values`; `None` if they are more than `N`.
    #[must_use]
    pub fn of(values: &[T]) -> Option<Self> {
        (values.len() <= N).then(|| Self::from_fn(values.len(), |index| values[index]))
    }

    /// Becomes the sequence of the first `N` of `values`, in place.
    #[inline]
    pub fn assign(&mut self, values: impl IntoIterator<Item = T>) {
        let before = self.len();
        let pairs = self.values.iter_mut().zip(values);
        let count = pairs.map(|(place, value)| *place = value).count();
        self.values[count.min(before)..before].fill(T::default());
        self.count = count as u32;
    }

    /// The sequence of the values that `value` makes of these.
    #[must_use]
    #[inline]
    pub fn map<U: Copy + Default>(&self, mut value: impl FnMut(T) -> U) -> Bounded<U, N> {
        Bounded::from_fn(self.len(), |index| value(self[index]))
    }
}

impl<T: Copy + Default, const N: usize> Default for Bounded<T, N> {
    fn default() -> Self {
        Self { count: 0, pad: 0, values: [T::default(); N] }
    }
}

impl<T, const N: usize> Deref for Bounded<T, N> {
    type Target = [T];

    fn deref(&self) -> &[T] {
        &self.values[..(self.count as usize).min(N)]
    }
}

impl<T, const N: usize> DerefMut for Bounded<T, N> {
    fn deref_mut(&mut self) -> &mut [T] {
        &mut self.values[..(self.count as usize).min(N)]
    }
}

impl<T: Copy + Default, const M: usize, const N: usize> From<[T; M]> for Bounded<T, N> {
    fn from(values: [T; M]) -> Self {
        const { assert!(M <= N, "more values than there is room for") };
        Self::from_fn(M, |index| values[index])
    }
}

/// The first `N` of the iterator's values.
impl<T: Copy + Default, const N: usize> FromIterator<T> for Bounded<T, N> {
    #[inline]
    fn from_iter<I: IntoIterator<Item = T>>(values: I) -> Self {
        let mut all = Self::default();
        all.assign(values);
        all
    }
}

impl<T, const N: usize> IntoIterator for Bounded<T, N> {
    type Item = T;
    type IntoIter = std::iter::Take<std::array::IntoIter<T, N>>;

    fn into_iter(self) -> Self::IntoIter {
        self.values.into_iter().take(self.count as usize)
    }
}

impl<'a, T, const N: usize> IntoIterator for &'a Bounded<T, N> {
    type Item = &'a T;
    type IntoIter = std::slice::Iter<'a, T>;

    fn into_iter(self) -> Self::IntoIter {
        self.iter()
    }
}

impl<'a, T, const N: usize> IntoIterator for &'a mut Bounded<T, N> {
    type Item = &'a mut T;
    type IntoIter = std::slice::IterMut<'a, T>;

    fn into_iter(self) -> Self::IntoIter {
        self.iter_mut()
    }
}

impl<T: PartialEq, const N: usize> PartialEq for Bounded<T, N> {
    fn eq(&self, other: &Self) -> bool {
        **self == **other
    }
}

impl<T: PartialEq, const M: usize, const N: usize> PartialEq<[T; M]> for Bounded<T, N> {
    fn eq(&self, other: &[T; M]) -> bool {
        **self == *other
    }
}

impl<T: fmt::Debug, const N: usize> fmt::Debug for Bounded<T, N> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        (**self).fmt(f)
    }
}

macro_rules! sequences {
    ($($number:ty),*) => { $(
        // SAFETY: a count, its padding and numbers of 8 bytes, all of which may be zero.
        unsafe impl<const N: usize> bytemuck::Zeroable for Bounded<$number, N> {}
        // SAFETY: two words of 4 bytes stand in front of numbers of 8 bytes, so that `repr(C)` adds no padding; every
        // bit pattern is a value: a count beyond `N` counts as `N`.
        unsafe impl<const N: usize> bytemuck::Pod for Bounded<$number, N> {}
        impl<const N: usize> FieldType for Bounded<$number, N> {
            const KIND: Kind = Kind::Sequence(&<$number as FieldType>::KIND, N);
        }
    )* };
}
sequences!(f64, i64, u64);

#[cfg(test)]
mod tests {
    use super::Bounded;

    #[test]
    fn values_behind_the_count_are_zero() {
        let mut words = [u64::MAX; 5];
        *bytemuck::from_bytes_mut(bytemuck::bytes_of_mut(&mut words)) = Bounded::<u64, 4>::from([7, 8]);
        assert_eq!(words, [2, 7, 8, 0, 0]);
    }

    #[test]
    fn values_that_no_longer_count_are_zero() {
        let mut some = Bounded::<u64, 4>::from([7, 8, 9]);
        some.assign([1]);
        assert_eq!((bytemuck::cast_ref::<_, [u64; 5]>(&some), some.len()), (&[1, 1, 0, 0, 0], 1));
        some.assign(2..9);
        assert_eq!(some, [2, 3, 4, 5]);
    }

    #[test]
    fn a_count_beyond_the_room_counts_as_the_room() {
        let words = [9_u64, 1, 2];
        let bounded: &Bounded<u64, 2> = bytemuck::from_bytes(bytemuck::bytes_of(&words));
        assert_eq!((bounded.len(), *bounded), (2, [1, 2].into()));
        assert_eq!(bounded.into_iter().count(), 2);
    }

    #[test]
    fn iterators_are_cut_at_the_room() {
        let counted: Bounded<u64, 3> = (5..100).collect();
        assert_eq!(counted, [5, 6, 7]);
        assert_eq!(Bounded::<u64, 3>::from_fn(100, |index| index as u64), [0, 1, 2]);
        assert_eq!(Bounded::<u64, 3>::of(&[4, 4]), Some(Bounded::filled(2, 4)));
    }
}
