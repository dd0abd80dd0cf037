//! A faulty manifest is repaired, so that the rest of it can be read and checked: one look shows all faults.
//!
//! A repair leaves a gap, and a fault that follows from a gap is never told. For this the part around a gap is left out of all
//! further checks: a process, a group, a condition, or everything that depends on the rate and the length of the run.

use super::content::Content;
use super::{judging, sources::Sources, tree};
use diagnostics::{Diagnostic, Misread, read_tree};
use std::collections::BTreeSet;
use std::ops::Range;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// Keys of `[run]` on which all times depend.
const TIMES: [&str; 2] = ["rate_hz", "duration_s"];
/// Length of a run whose length cannot be read, s.
const DURATION_S: &str = "1.0";
/// Rate of a run whose rate cannot be read, as where the manifest has none.
const RATE_HZ: u32 = 1000;

/// The lists of tables, each with an entry that can be read in place of one that cannot.
const LISTS: &[(&str, &str)] = &[
    ("pass", CONDITION),
    ("measure", CONDITION),
    ("compare", "{ simulated = '', measured = '', window_s = 1.0 }"),
    ("checkpoint", "{ at_tick = 1 }"),
    ("swap", "{ process = '', with = {} }"),
    ("shadow", "{ process = '', with = {} }"),
];
const CONDITION: &str = "{ name = '', topic = '', field = '', unit = '1', statistic = 'max' }";

/// Faults of a manifest that was repaired, and its gaps.
#[derive(Clone, Debug, Default)]
pub struct Repairs {
    /// The faults; `None` if the manifest was read as it is.
    pub faults: Option<Diagnostic>,
    /// Processes with a gap.
    pub processes: BTreeSet<String>,
    /// True if the rate or the length of the run is not known.
    pub is_timeless: bool,
}

impl Repairs {
    /// The faults of the manifest with `fault`; without it, if it may follow from a gap.
    pub fn explain(&self, fault: Diagnostic) -> Diagnostic {
        match &self.faults {
            Some(faults) if !self.processes.is_empty() => faults.clone(),
            faults => fault.and(faults.clone()),
        }
    }
}

/// Content of the whole `tree`, repaired, with its faults.
///
/// # Errors
/// The faults, if the tree cannot be repaired.
pub fn readable(sources: &Sources, tree: DeTable<'_>) -> Result<(Content, Repairs), Diagnostic> {
    let mut bench = Bench {
        sources,
        whole: Spanned::new(0..0, DeValue::Table(tree)),
        repairs: Repairs::default(),
        touched: BTreeSet::new(),
        gaps: BTreeSet::new(),
        told: Vec::new(),
        faults: Vec::new(),
    };
    let mut last = None;
    let mut content: Content = loop {
        let misread = match read_tree(&bench.whole) {
            Ok(content) => break content,
            Err(misread) => misread,
        };
        // What is misread again at the same place is not to be repaired.
        let at = Some((misread.error.key().to_owned(), misread.span()));
        if at == last || !bench.mend(&misread) {
            bench.tell(&misread);
            return Err(in_order(bench.faults).unwrap_or_else(|| sources.refused(misread)));
        }
        last = at;
    };
    bench.leave_out(&mut content);
    let mut repairs = bench.repairs;
    repairs.faults = in_order(bench.faults);
    match judging::complete(&mut content, sources) {
        Ok(()) => Ok((content, repairs)),
        Err(fault) => Err(fault.and(repairs.faults)),
    }
}

/// The faults as one, in the order of their lines, if there are any.
fn in_order(faults: Vec<Diagnostic>) -> Option<Diagnostic> {
    Diagnostic::gather(faults.into_iter().map(Err::<(), _>)).err()
}

/// A part of a manifest that is left out of further checks if it has a gap.
enum Part<'k> {
    /// `[run]`, and the key in it.
    Run(&'k str),
    /// A process: its name, and the key in it. Names may have dots.
    Process(&'k str),
    /// A group: its name, and the key in it.
    Group(&'k str),
    /// An entry of one of the [`LISTS`].
    Entry(&'static str, usize),
}

impl<'k> Part<'k> {
    /// The part that holds the dotted `key`; `None` if all of the manifest does.
    fn of(key: &'k str) -> Option<Self> {
        let (first, rest) = key.split_once('.')?;
        let second = rest.split('.').next().unwrap_or(rest);
        match first {
            "run" => Some(Self::Run(rest)),
            "process" => Some(Self::Process(rest)),
            "group" => Some(Self::Group(rest)),
            _ => {
                let &(list, _) = LISTS.iter().find(|(list, _)| *list == first)?;
                Some(Self::Entry(list, second.parse().ok()?))
            }
        }
    }
}

/// The tree on its way to one that can be read.
struct Bench<'s, 't> {
    sources: &'s Sources,
    whole: Spanned<DeValue<'t>>,
    repairs: Repairs,
    /// Processes from which something was removed: a key may be missing for that reason.
    touched: BTreeSet<String>,
    /// Entries of lists with a gap.
    gaps: BTreeSet<(&'static str, usize)>,
    /// Places of faults that are told: copies of a table in a set or a backup have the same.
    told: Vec<Range<usize>>,
    faults: Vec<Diagnostic>,
}

impl<'t> Bench<'_, 't> {
    /// Repairs the tree where it was `misread`; false if it cannot.
    fn mend(&mut self, misread: &Misread) -> bool {
        match Part::of(misread.error.key()) {
            None => self.mend_top(misread),
            Some(Part::Run(key)) => self.mend_run(misread, key),
            Some(Part::Process(key)) => {
                self.name_in("process", key).is_some_and(|name| self.mend_process(misread, &name))
            }
            Some(Part::Group(key)) => {
                self.name_in("group", key).is_some_and(|name| self.mend_group(misread, &name))
            }
            Some(Part::Entry(list, index)) => self.mend_entry(misread, list, index),
        }
    }

    /// The longest name of an entry of `table` with which the dotted `key` begins.
    fn name_in(&mut self, table: &str, key: &str) -> Option<String> {
        let DeValue::Table(entries) = self.at(&[table])?.get_ref() else { return None };
        let begins = |name: &&str| {
            key.strip_prefix(*name).is_some_and(|rest| rest.is_empty() || rest.starts_with('.'))
        };
        let names = entries.keys().map(|name| name.get_ref().as_ref());
        names.filter(begins).max_by_key(|name| name.len()).map(str::to_owned)
    }

    fn tell(&mut self, misread: &Misread) {
        let span = misread.span();
        if span.is_empty() || !self.told.contains(&span) {
            self.faults.push(self.sources.refused(misread.clone()));
            self.told.push(span);
        }
    }

    /// An unknown key beside `[run]` is removed, or merged with the key that it is a typo of. A table that is no typo may hold
    /// processes: without them nothing can be checked.
    fn mend_top(&mut self, misread: &Misread) -> bool {
        let DeValue::Table(root) = self.whole.get_mut() else { return false };
        if !misread.is_unknown_key() {
            return false;
        }
        let Some(value) = root.remove(misread.error.key()) else { return false };
        let meant = misread.error.typo();
        if meant.is_none() && value.get_ref().is_table() {
            return false;
        }
        if let Some(meant) = meant {
            if !root.contains_key(meant) {
                root.insert(Spanned::new(misread.span(), meant.to_owned().into()), value);
            } else if let (Some(table), DeValue::Table(more)) =
                (tree::table_mut(root, meant), value.into_inner())
            {
                add_absent(table, more);
            }
        }
        self.tell(misread);
        true
    }

    fn mend_run(&mut self, misread: &Misread, key: &str) -> bool {
        let name = if misread.is_unknown_key() { key } else { key.split('.').next().unwrap_or(key) };
        let is_follow_up =
            misread.is_missing() && (self.repairs.is_timeless || self.is_in_another_table(name));
        if !is_follow_up {
            self.tell(misread);
        }
        let DeValue::Table(root) = self.whole.get_mut() else { return false };
        let Some(run) = tree::table_mut(root, "run") else { return false };
        if misread.is_missing() && TIMES.contains(&name) {
            self.repairs.is_timeless = true;
            let value = tree::parse_value(DURATION_S, misread.span().start);
            let key = Spanned::new(misread.span(), name.to_owned().into());
            return value.is_some_and(|value| run.insert(key, value).is_none());
        }
        let Some(value) = run.remove(name) else { return false };
        match misread.error.typo() {
            Some(typo) if !run.contains_key(typo) => {
                run.insert(Spanned::new(misread.span(), typo.to_owned().into()), value);
            }
            _ => {
                let meant = misread.error.meant().unwrap_or_default();
                self.repairs.is_timeless |= TIMES.contains(&name) || TIMES.contains(&meant);
            }
        }
        true
    }

    /// True if a table beside `[run]` has the key `name`, such as one with a typo in its own name.
    fn is_in_another_table(&self, name: &str) -> bool {
        let DeValue::Table(root) = self.whole.get_ref() else { return false };
        let has = |table: &DeValue<'_>| matches!(table, DeValue::Table(table) if table.contains_key(name));
        root.iter().any(|(key, table)| key.get_ref() != "run" && has(table.get_ref()))
    }

    fn mend_process(&mut self, misread: &Misread, name: &str) -> bool {
        let is_follow_up = misread.is_missing() && self.touched.contains(name);
        if !is_follow_up {
            self.tell(misread);
        }
        let Some(process) = self.at(&["process", name]) else { return false };
        let gap = patch(process.get_mut(), misread);
        if gap == Gap::Whole {
            *process.get_mut() = DeValue::Table(DeTable::new());
        }
        if gap != Gap::None {
            self.touched.insert(name.to_owned());
            self.repairs.processes.insert(name.to_owned());
        }
        true
    }

    /// A group with a fault is left out. `run.compose` may name it.
    fn mend_group(&mut self, misread: &Misread, name: &str) -> bool {
        let DeValue::Table(root) = self.whole.get_mut() else { return false };
        let removed = tree::table_mut(root, "group").and_then(|groups| groups.remove(name));
        if let Some(run) = tree::table_mut(root, "run") {
            run.remove("compose");
        }
        self.tell(misread);
        removed.is_some()
    }

    fn mend_entry(&mut self, misread: &Misread, list: &'static str, index: usize) -> bool {
        let is_follow_up = misread.is_missing() && self.gaps.contains(&(list, index));
        if !is_follow_up {
            self.tell(misread);
        }
        let Some(&(_, other)) = LISTS.iter().find(|(name, _)| *name == list) else { return false };
        let Some(entry) = self.at(&[list, &index.to_string()]) else { return false };
        let gap = if misread.is_missing() { Gap::Whole } else { patch(entry.get_mut(), misread) };
        if gap == Gap::Whole {
            let Some(other) = tree::parse_value(other, 0) else { return false };
            *entry.get_mut() = other.into_inner();
        }
        if gap != Gap::None {
            self.gaps.insert((list, index));
        }
        true
    }

    /// The value at `path`.
    fn at(&mut self, path: &[&str]) -> Option<&mut Spanned<DeValue<'t>>> {
        path.iter().try_fold(&mut self.whole, |value, name| match value.get_mut() {
            DeValue::Table(table) => table.get_mut(*name),
            DeValue::Array(array) => array.get_mut(name.parse::<usize>().ok()?),
            _ => None,
        })
    }

    /// Removes the entries with a gap, and states what is not known of the times.
    fn leave_out(&self, content: &mut Content) {
        self.keep_whole("pass", &mut content.pass);
        self.keep_whole("measure", &mut content.measure);
        self.keep_whole("compare", &mut content.compare);
        self.keep_whole("checkpoint", &mut content.checkpoint);
        self.keep_whole("swap", &mut content.swap);
        self.keep_whole("shadow", &mut content.shadow);
        if self.repairs.is_timeless {
            *content.run.rate_hz.get_mut() = RATE_HZ;
            *content.run.duration_s.get_mut() = 1.0;
        }
    }

    fn keep_whole<T>(&self, list: &'static str, entries: &mut Vec<T>) {
        let mut number = 0..;
        entries.retain(|_| number.next().is_none_or(|index| !self.gaps.contains(&(list, index))));
    }
}

/// Part of a table that a repair has removed.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Gap {
    /// None: a value has moved to the key that was meant.
    None,
    /// A key, or an entry of a list.
    Part,
    /// The table itself cannot be read.
    Whole,
}

/// Removes from `value` what was `misread`.
fn patch(value: &mut DeValue<'_>, misread: &Misread) -> Gap {
    if !misread.is_unknown_key() {
        return if tree::remove(value, &misread.span()) { Gap::Part } else { Gap::Whole };
    }
    match tree::repair(value, &misread.span(), misread.error.typo()) {
        Some(true) => Gap::None,
        Some(false) => Gap::Part,
        None => Gap::Whole,
    }
}

/// Adds the entries of `more` to `table` that it does not have.
fn add_absent<'t>(table: &mut DeTable<'t>, more: DeTable<'t>) {
    for (key, value) in more {
        if !table.contains_key(key.get_ref().as_ref()) {
            table.insert(key, value);
        }
    }
}
