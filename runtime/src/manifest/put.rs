//! Values put into the text of a TOML file, whose comments stay.

use toml_edit::{Item, Table};

/// Puts `value` at `keys` of `item`; missing tables on the way are made. `None` if the place is below a value or behind the
/// end of a list.
pub fn put(item: &mut Item, keys: &[String], mut value: toml_edit::Value) -> Option<()> {
    let (last, path) = keys.split_last()?;
    let inside = keys.iter().skip(1).zip(path).try_fold(item, |item, (next, key)| {
        // A missing value on the way is a table; a missing list has no elements.
        let empty = || if next.parse::<usize>().is_ok() { Item::None } else { Item::Table(Table::new()) };
        slot(item, key, empty).filter(|found| !found.is_none())
    })?;
    if let Some(array) = inside.as_array_mut() {
        let index = last.parse().ok()?;
        array.get(index)?;
        array.replace(index, value);
        return Some(());
    }
    let table = inside.as_table_like_mut()?;
    if let Some(old) = table.get(last).and_then(Item::as_value) {
        // With it stays the comment behind it.
        *value.decor_mut() = old.decor().clone();
    }
    table.insert(last, Item::Value(value));
    Some(())
}

/// The item at `key` of a list or a table; `empty` where the table has nothing there.
fn slot<'i>(inside: &'i mut Item, key: &str, empty: impl FnOnce() -> Item) -> Option<&'i mut Item> {
    if inside.is_array() || inside.is_array_of_tables() {
        return inside.get_mut(key.parse::<usize>().ok()?);
    }
    Some(inside.as_table_like_mut()?.entry(key).or_insert_with(empty))
}
