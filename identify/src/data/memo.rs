//! Residuals and derivatives of a flight that were computed lately. A fit, its covariance, the screen of candidates, and the folds of a
//! cross-validation ask for the same ones at the same values.

use crate::data::clock::Lateness;
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};
use vehicles::ROTORS_MAX;

/// Numbers that are kept for one flight at most: 32 MB.
const NUMBERS_MAX: usize = 4_000_000;

/// Values of a [`Recent`]: those at a point, and at a step to both sides of it by each of two delays.
const RECENT: usize = 5;

/// Rows of one flight, and a derivative by one parameter.
pub type Rows = Arc<Vec<f64>>;

/// Arguments of the rows of a flight: the values of all parameters, the clocks, and the rotors that are believed.
#[derive(Debug, Clone, PartialEq)]
pub struct Key {
    /// Values of all parameters.
    pub values: Vec<f64>,
    /// Lateness of pose and rotor speeds.
    pub late: Lateness,
    /// Rotors whose measured speed is not believed.
    pub distrusted: [bool; ROTORS_MAX],
}

/// Values of a costly function at the arguments that were used last: those of a fit's point and of steps to both sides of it.
#[derive(Debug)]
pub struct Recent<K, V> {
    entries: Mutex<Vec<(K, Arc<V>)>>,
}

impl<K, V> Default for Recent<K, V> {
    fn default() -> Self {
        Self { entries: Mutex::new(Vec::new()) }
    }
}

impl<K: PartialEq, V> Recent<K, V> {
    /// The value at `key`, made by `make` where it is not known.
    pub fn at(&self, key: K, make: impl FnOnce() -> V) -> Arc<V> {
        let find = |entries: &mut Vec<(K, Arc<V>)>| {
            let at = entries.iter().position(|entry| entry.0 == key)?;
            entries[at..].rotate_left(1);
            entries.last().map(|entry| entry.1.clone())
        };
        let lock = || self.entries.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(known) = find(&mut lock()) {
            return known;
        }
        // Made without the lock, so that others can go on.
        let made = Arc::new(make());
        let mut entries = lock();
        if let Some(known) = find(&mut entries) {
            return known;
        }
        entries.push((key, made.clone()));
        if entries.len() > RECENT {
            entries.remove(0);
        }
        made
    }
}

#[derive(Debug)]
struct Entry {
    key: Key,
    residual: Rows,
    columns: BTreeMap<usize, Rows>,
}

/// The memory of one flight: the entries that were used last, the latest at the end.
#[derive(Debug, Default)]
pub struct Memo {
    entries: Mutex<Vec<Entry>>,
}

impl Memo {
    /// The residual at `key` and its derivatives by `parameters`, those that are known.
    pub fn known(&self, key: &Key, parameters: &[usize]) -> Option<(Rows, Vec<Option<Rows>>)> {
        let mut entries = self.entries.lock().unwrap_or_else(PoisonError::into_inner);
        let at = entries.iter().position(|entry| entry.key == *key)?;
        entries[at..].rotate_left(1);
        let entry = entries.last()?;
        let columns = parameters.iter().map(|parameter| entry.columns.get(parameter).cloned()).collect();
        Some((entry.residual.clone(), columns))
    }

    /// Keeps what was computed, and drops what was not used for longest.
    pub fn keep(&self, key: Key, residual: &Rows, columns: impl Iterator<Item = (usize, Rows)>) {
        let mut entries = self.entries.lock().unwrap_or_else(PoisonError::into_inner);
        let at = entries.iter().position(|entry| entry.key == key);
        let mut entry = match at {
            Some(at) => entries.remove(at),
            None => Entry { key, residual: residual.clone(), columns: BTreeMap::new() },
        };
        entry.columns.extend(columns);
        entries.push(entry);
        let numbers = |entry: &Entry| entry.residual.len() * (1 + entry.columns.len());
        while entries.iter().map(numbers).sum::<usize>() > NUMBERS_MAX {
            entries.remove(0);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn key(value: f64) -> Key {
        Key { values: vec![value], late: Lateness::default(), distrusted: [false; ROTORS_MAX] }
    }

    #[test]
    fn what_was_kept_is_known_and_the_rest_is_not() {
        let memo = Memo::default();
        assert!(memo.known(&key(1.0), &[0]).is_none());
        let (residual, column) = (Arc::new(vec![1.0, 2.0]), Arc::new(vec![3.0, 4.0]));
        memo.keep(key(1.0), &residual, [(7, column.clone())].into_iter());
        assert_eq!(
            memo.known(&key(1.0), &[7, 8]),
            Some((residual.clone(), vec![Some(column.clone()), None]))
        );
        assert!(memo.known(&key(2.0), &[7]).is_none());
        memo.keep(key(1.0), &residual, [(8, residual.clone())].into_iter());
        assert_eq!(memo.known(&key(1.0), &[7, 8]).unwrap().1, [Some(column), Some(residual)]);
    }

    #[test]
    fn a_value_is_made_once_as_long_as_it_is_recent() {
        let (recent, made) = (Recent::default(), std::cell::Cell::new(0));
        let square = |x: i32| {
            *recent.at(x, || {
                made.set(made.get() + 1);
                x * x
            })
        };
        assert_eq!([1, 2, 3, 4, 5, 1, 2, 1].map(square), [1, 4, 9, 16, 25, 1, 4, 1]);
        assert_eq!(made.get(), 5);
        // All but 3 were used later than it.
        assert_eq!(([6, 4, 5, 2, 1, 6].map(square), made.get()), ([36, 16, 25, 4, 1, 36], 6));
        assert_eq!((square(3), made.get()), (9, 7));
    }

    #[test]
    fn what_was_not_used_for_longest_goes_first() {
        let memo = Memo::default();
        let rows: Rows = Arc::new(vec![0.0; NUMBERS_MAX / 3]);
        for value in [1.0, 2.0, 3.0] {
            memo.keep(key(value), &rows, std::iter::empty());
        }
        assert!(memo.known(&key(1.0), &[]).is_some());
        memo.keep(key(4.0), &rows, std::iter::empty());
        let is_known = [1.0, 2.0, 3.0, 4.0].map(|value| memo.known(&key(value), &[]).is_some());
        assert_eq!(is_known, [true, false, true, true]);
    }
}
