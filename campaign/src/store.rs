//! The output folder of a campaign: a lock, the plan, and a line for each flight as it ends.
//!
//! A campaign that was interrupted goes on in the same folder: flights that have a row are not flown again.

use crate::declaration::Campaign;
use crate::plan::Plan;
use crate::row::Row;
use anyhow::{Context, Result, bail};
use inputs::InputFiles;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fs::{File, OpenOptions, TryLockError};
use std::io::{BufRead as _, BufReader, Write as _};
use std::path::{Path, PathBuf};

/// The plan.
pub const PLAN: &str = "plan.csv";
/// The rows flown so far, in the order in which they ended.
const ROWS: &str = "rows.jsonl";
const LOCK: &str = "lock";
/// Folder in which workers write while they fly.
const WORK: &str = "workers";

/// The output folder, locked.
#[derive(Debug)]
pub struct Store {
    folder: PathBuf,
    rows: File,
    /// Held open: the lock goes with the process.
    _lock: File,
}

/// First line of the rows: what they were flown of.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
struct Header {
    version: String,
    fingerprint: String,
    figures: Vec<String>,
}

impl Store {
    /// Opens or makes `folder` for `campaign`: its plan, which is written if it is not there, and the rows flown so far.
    ///
    /// # Errors
    /// If another campaign uses the folder, holds something else, or was flown of other inputs.
    pub fn open(
        folder: &Path,
        campaign: &Campaign,
        fingerprint: &str,
        figures: &[String],
    ) -> Result<(Self, Plan, BTreeMap<u64, Row>)> {
        let shown = folder.display();
        std::fs::create_dir_all(folder).with_context(|| format!("cannot make the folder {shown}"))?;
        let lock = locked(folder)?;
        let plan = plan(folder, campaign)?;
        let header =
            Header { version: version(), fingerprint: fingerprint.to_owned(), figures: figures.to_owned() };
        let path = folder.join(ROWS);
        let (mut flown, whole) = if path.exists() { read(&path, &header)? } else { (BTreeMap::new(), 0) };
        // The plan may have been edited since.
        flown.retain(|flight, row| plan.flights.get(*flight as usize) == Some(&row.drawn));
        let file = OpenOptions::new().create(true).append(true).open(&path);
        let mut rows = file.with_context(|| format!("cannot write {}", path.display()))?;
        // A line that was cut off is written again.
        rows.set_len(whole)?;
        if whole == 0 {
            writeln!(rows, "{}", serde_json::to_string(&header)?)?;
        }
        Ok((Self { folder: folder.to_owned(), rows, _lock: lock }, plan, flown))
    }

    /// Makes the folder in which workers write while they fly, empty.
    ///
    /// # Errors
    /// If it cannot be made.
    pub fn make_work_folder(&self) -> Result<PathBuf> {
        let folder = std::path::absolute(self.folder.join(WORK))?;
        // One of a campaign that was killed.
        self.remove_work_folder()?;
        std::fs::create_dir(&folder)
            .with_context(|| format!("cannot make the folder {}", folder.display()))?;
        Ok(folder)
    }

    /// Removes that folder.
    ///
    /// # Errors
    /// If it cannot be removed.
    pub fn remove_work_folder(&self) -> Result<()> {
        let folder = self.folder.join(WORK);
        match std::fs::remove_dir_all(&folder) {
            Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
                Err(error).context(format!("cannot remove {}", folder.display()))
            }
            _ => Ok(()),
        }
    }

    /// Adds a row.
    ///
    /// # Errors
    /// If the folder cannot be written to, for example because the disk is full.
    pub fn add(&mut self, row: &Row) -> Result<()> {
        let line = format!("{}\n", serde_json::to_string(row)?);
        let written = self.rows.write_all(line.as_bytes());
        written.with_context(|| format!("cannot write {}", self.folder.join(ROWS).display()))
    }
}

fn version() -> String {
    env!("CARGO_PKG_VERSION").to_owned()
}

fn locked(folder: &Path) -> Result<File> {
    let path = folder.join(LOCK);
    let file = OpenOptions::new().create(true).truncate(false).write(true).open(&path);
    let file = file.with_context(|| format!("cannot open {}", path.display()))?;
    match file.try_lock() {
        Ok(()) => Ok(file),
        Err(TryLockError::WouldBlock) => {
            bail!("another campaign is writing to {}; wait for it, or choose another --out", folder.display())
        }
        Err(TryLockError::Error(error)) => Err(error).context(format!("cannot lock {}", path.display())),
    }
}

/// The plan in the folder, drawn and written where there is none.
fn plan(folder: &Path, campaign: &Campaign) -> Result<Plan> {
    let path = folder.join(PLAN);
    if path.exists() {
        let text =
            InputFiles::default().text(&path).with_context(|| format!("cannot read {}", path.display()))?;
        return Plan::parse(&path, &text, campaign);
    }
    let plan = Plan::of(campaign);
    let draft = folder.join(format!("{PLAN}.draft"));
    std::fs::write(&draft, plan.to_csv()?).with_context(|| format!("cannot write {}", draft.display()))?;
    std::fs::rename(&draft, &path).with_context(|| format!("cannot write {}", path.display()))?;
    Ok(plan)
}

/// The rows in the file at `path`, and the length of its whole lines.
fn read(path: &Path, header: &Header) -> Result<(BTreeMap<u64, Row>, u64)> {
    let shown = path.display();
    let mut reader = BufReader::new(File::open(path).with_context(|| format!("cannot read {shown}"))?);
    let (mut rows, mut whole, mut line) = (BTreeMap::new(), 0_u64, String::new());
    while reader.read_line(&mut line).with_context(|| format!("cannot read {shown}"))? > 0
        && line.ends_with('\n')
    {
        if whole == 0 {
            let found: Header = serde_json::from_str(&line)
                .with_context(|| format!("{shown}: not the rows of a campaign; choose another --out"))?;
            if found != *header {
                bail!(
                    "{shown}: its flights were flown of other inputs or by another version; choose another --out, or \
                     remove the file to fly them again"
                );
            }
        } else {
            let row: Row = serde_json::from_str(&line).with_context(|| format!("{shown}: a damaged row"))?;
            rows.insert(row.flight, row);
        }
        whole += line.len() as u64;
        line.clear();
    }
    Ok((rows, whole))
}

#[cfg(test)]
mod tests {
    use super::Store;
    use crate::declaration::Campaign;
    use crate::row::Row;
    use std::io::Write as _;

    #[test]
    fn a_folder_goes_on_where_it_was_cut_off_and_refuses_others() {
        let text = "manifest = \"a.toml\"\nflights = 3\n[[vary]]\nkey = \"x\"\nvalues = [1]";
        let campaign = Campaign::parse("c.toml".as_ref(), text).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let open = |fingerprint: &str| Store::open(folder.path(), &campaign, fingerprint, &["f".to_owned()]);
        let (mut store, plan, flown) = open("a").unwrap();
        assert!(flown.is_empty() && plan.flights.len() == 3);
        let row = |flight: u64, drawn: f64| Row {
            flight,
            drawn: vec![drawn],
            figures: vec![Some(0.1), None],
            ..Row::default()
        };
        store.add(&row(1, 1.0)).unwrap();
        // Of a plan that was edited since.
        store.add(&row(0, 7.0)).unwrap();
        let error = open("a").unwrap_err().to_string();
        assert!(error.contains("another campaign is writing"), "{error}");
        write!(store.rows, "{{\"flight\": 2, \"pas").unwrap();
        drop(store);

        let (store, _, flown) = open("a").unwrap();
        assert_eq!(flown.into_values().collect::<Vec<_>>(), [row(1, 1.0)]);
        drop(store);
        let error = open("b").unwrap_err().to_string();
        assert!(error.contains("flown of other inputs"), "{error}");
    }
}
