//! The effects that a vehicle or scene file lists, as they are written: names, numbers with their units, places.
//!
//! The kinds of effects, their parameters and units are the business of the plant's catalogue
//! (`plant::effects`): here any name will do.

use crate::provenance::Stated;
use crate::reader::{Document, Section};
use diagnostics::{Diagnostic, Faults, Place};

/// One `[[effects]]` table.
///
/// ```
/// use vehicles::reader::{Document, Section};
///
/// let doc = Document::new("a.toml", "[[effects]]\nname = 'wind'");
/// let tree = doc.tree()?;
/// let read = vehicles::effects::read(&Section::new(&doc, String::new(), 0..0, tree.get_ref()))?;
/// assert_eq!((read[0].name.as_str(), read[0].key.as_str()), ("wind", "effects.0"));
/// # Ok::<(), diagnostics::Diagnostic>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct EffectEntry {
    /// Name of the effect.
    pub name: String,
    /// The dotted key of the table, such as `effects.0`.
    pub key: String,
    /// Place of the table.
    pub place: Place,
    /// Place of its name.
    pub name_place: Place,
    /// Its parameters, by name.
    pub parameters: Vec<Stated>,
}

/// The `[[effects]]` of a file, in its order; none where it has none.
///
/// # Errors
/// A table without a name, or with a key that is not a number with unit, source and uncertainty.
pub fn read(root: &Section) -> Result<Vec<EffectEntry>, Diagnostic> {
    Diagnostic::gather(root.sections_if_any("effects")?.iter().map(one_effect))
}

/// The effects in the `text` of a file of which other tables may be faulty; effects with faults of their own are left out.
#[must_use]
pub fn entries(text: &str, file_name: &str) -> Vec<EffectEntry> {
    let doc = Document::new(file_name, text);
    let Ok(tree) = doc.tree() else { return Vec::new() };
    let root = Section::new(&doc, String::new(), 0..0, tree.get_ref());
    let sections = root.sections_if_any("effects").unwrap_or_default();
    sections.iter().filter_map(|section| one_effect(section).ok()).collect()
}

fn one_effect(section: &Section) -> Result<EffectEntry, Diagnostic> {
    let mut faults = Faults::default();
    let spelt = section.require_spelt("name");
    // A misspelt name is no parameter.
    let misspelt = spelt.as_ref().err().map(|fault| fault.key().to_owned());
    let name = faults.keep(spelt.and_then(|()| section.text("name")));
    let is_parameter = |key: &&str| *key != "name" && misspelt.as_ref() != Some(&section.key(key));
    let parameters = section.keys().filter(is_parameter).map(|key| section.stated(key));
    let parameters = faults.keep(Diagnostic::gather(parameters));
    let entry = name.zip(parameters).map(|(name, parameters)| EffectEntry {
        name: name.to_owned(),
        key: section.path.clone(),
        place: section.doc.place(&section.at),
        name_place: section.doc.place(&section.at_of("name")),
        parameters,
    });
    faults.finish(entry)
}
