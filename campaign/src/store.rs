//! The output folder of a campaign: a lock, the plan, and a line for each flight as it ends.
//!
//! A campaign that was interrupted goes on in the same folder: flights that have a row are not flown again.

use crate::declaration::Campaign;
use crate::plan::Plan;
use crate::row::Row;
use anyhow::{Context, Result, bail};
use inputs::sha256;
use runtime::output_file;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fs::{File, OpenOptions, TryLockError};
use std::io::{BufRead as _, BufReader, Read as _, Seek as _, Write as _};
use std::os::unix::fs::OpenOptionsExt as _;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// The plan.
pub const PLAN: &str = "plan.csv";
/// The rows flown so far, in the order in which they ended.
const ROWS: &str = "rows.jsonl";
/// The lock, which holds the digest of the plan as it was drawn.
const LOCK: &str = "lock";
/// Start of the name of the folder in which workers write while they fly.
const WORK: &str = ".workers-";

/// The output folder, locked.
#[derive(Debug)]
pub struct Store {
    folder: PathBuf,
    rows: File,
    _lock: Lock,
    work: TempDir,
}

/// The lock of a folder, held by this process alone. The kernel gives it back when the process dies.
#[derive(Debug)]
struct Lock(File);

impl Lock {
    fn of(folder: &Path) -> Result<Self> {
        let path = folder.join(LOCK);
        let file = opened(&path, OpenOptions::new().create(true).truncate(false).read(true).write(true))?;
        match file.try_lock() {
            Ok(()) => Ok(Self(file)),
            Err(TryLockError::WouldBlock) => {
                bail!(
                    "another campaign is writing to {}; wait for it, or choose another --out",
                    folder.display()
                )
            }
            Err(TryLockError::Error(error)) => Err(error).context(format!("cannot lock {}", path.display())),
        }
    }
}

impl Drop for Lock {
    fn drop(&mut self) {
        // Closing is not enough: a process that another thread is starting holds a copy until it executes its program.
        let _ = self.0.unlock();
    }
}

/// First line of the rows: what they were flown of.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
pub struct Header {
    /// Build of hummingbus.
    pub build: String,
    /// Digest of the inputs ([`crate::base::Base::fingerprint`]).
    pub fingerprint: String,
    /// Names of the figures.
    pub figures: Vec<String>,
    /// Names of the verdicts.
    pub verdicts: Vec<String>,
}

impl Header {
    /// Refuses rows whose first line `found` says that they are of other inputs, or of a build that is not among `builds`.
    fn require_same(&self, found: &str, builds: Builds) -> Result<()> {
        let found: serde_json::Value =
            serde_json::from_str(found).context("not the rows of a campaign; choose another --out")?;
        // Rows of version 0.1.0 had a version without its commit.
        let build = found["build"].as_str().or(found["version"].as_str());
        let build = build.context("not the rows of a campaign; choose another --out")?;
        if build != self.build && builds == Builds::Same {
            bail!(
                "its flights were flown by hummingbus {build}, this is hummingbus {}: rows of two builds are not mixed; go on \
                 with that build, choose another --out, or remove the file to fly all flights again",
                self.build
            );
        }
        let same_build = |found: Self| Self { build: self.build.clone(), ..found };
        if serde_json::from_value::<Self>(found).ok().map(same_build).as_ref() != Some(self) {
            bail!(
                "its flights were flown with other inputs: the manifest, a file that it reads, a value of `set` or the checkpoint has \
                 changed since; choose another --out, or remove the file to fly all flights again"
            );
        }
        Ok(())
    }
}

/// Builds of hummingbus whose rows are taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Builds {
    /// This one: more rows are added.
    Same,
    /// Any: none is added, so that a failure can be flown again by a program that was mended.
    Any,
}

impl Store {
    /// Opens or makes `folder` for `campaign`: its plan, which is written if it is not there, and the rows flown so far.
    ///
    /// # Errors
    /// If another campaign uses the folder, it holds something else, or its flights were flown with other
    /// inputs. If a link on the way to it is not to be trusted.
    pub fn open(
        folder: &Path,
        campaign: &Campaign,
        header: &Header,
        builds: Builds,
    ) -> Result<(Self, Plan, BTreeMap<u64, Row>)> {
        // Without links: no later change of one leads elsewhere.
        let folder = &*output_file::make_folder(folder)?;
        require_own(folder)?;
        let mut lock = Lock::of(folder)?;
        remove_left_work(folder)?;
        if !has_rows(&folder.join(ROWS))? {
            // Nothing was flown: a refused campaign file that is corrected begins anew.
            forget(folder, &mut lock.0)?;
        }
        let plan = plan(folder, campaign, &mut lock.0)?;
        let path = folder.join(ROWS);
        let (mut flown, whole) =
            if path.exists() { read(&path, (header, builds))? } else { (BTreeMap::new(), 0) };
        // The plan may have been edited since, and what the host ended is flown again.
        flown.retain(|flight, row| !row.is_of_host && plan.flights.get(*flight as usize) == Some(&row.drawn));
        let mut rows = opened(&path, OpenOptions::new().create(true).append(true))?;
        // A line that was cut off is written again.
        rows.set_len(whole)?;
        if whole == 0 {
            writeln!(rows, "{}", serde_json::to_string(header)?)?;
        }
        let work = tempfile::Builder::new().prefix(WORK).tempdir_in(folder);
        let work = work.with_context(|| format!("cannot make a folder in {}", folder.display()))?;
        Ok((Self { folder: folder.to_owned(), rows, _lock: lock, work }, plan, flown))
    }

    /// Folder in which workers write while they fly; it goes with this value.
    ///
    /// # Errors
    /// If the working directory is gone.
    pub fn work_folder(&self) -> Result<PathBuf> {
        Ok(std::path::absolute(self.work.path())?)
    }

    /// Writes the file `name` whole, or not at all: beside its place first, then in its place.
    ///
    /// # Errors
    /// If the folder cannot be written to.
    pub fn write(&self, name: &str, write: impl FnOnce(&mut File) -> Result<()>) -> Result<()> {
        put(&self.folder, name, write)
    }

    /// Adds a row.
    ///
    /// # Errors
    /// If the folder cannot be written to, for example because the disk is full.
    pub fn add(&mut self, row: &Row) -> Result<()> {
        let line = format!("{}\n", serde_json::to_string(row)?);
        let failed = || format!("cannot write {}", self.folder.join(ROWS).display());
        let whole = self.rows.metadata().with_context(failed)?.len();
        let written = self.rows.write_all(line.as_bytes());
        if written.is_err() {
            // The next row must not stand behind a part of this one.
            let _ = self.rows.set_len(whole);
        }
        written.with_context(failed)
    }
}

/// Refuses a folder with other files: those of a campaign might take their place.
fn require_own(folder: &Path) -> Result<()> {
    let is_of_campaign = [PLAN, ROWS, LOCK].iter().any(|name| folder.join(name).exists());
    let is_empty = std::fs::read_dir(folder).is_ok_and(|mut entries| entries.next().is_none());
    if is_of_campaign || is_empty {
        return Ok(());
    }
    bail!("{} is not empty, and holds no campaign; choose another --out", folder.display())
}

/// True if a flight has a row.
fn has_rows(path: &Path) -> Result<bool> {
    if !path.exists() {
        return Ok(false);
    }
    let file = File::open(path).with_context(|| format!("cannot read {}", path.display()))?;
    Ok(BufReader::new(file).lines().nth(1).is_some())
}

/// Removes an unedited plan, as it was drawn, and the head of rows that were never flown.
fn forget(folder: &Path, lock: &mut File) -> Result<()> {
    let mut drawn = String::new();
    lock.rewind()?;
    lock.read_to_string(&mut drawn)?;
    lock.rewind()?;
    let is_drawn = |text: Vec<u8>| sha256(&text) == drawn;
    for (name, is_removed) in [(PLAN, std::fs::read(folder.join(PLAN)).is_ok_and(is_drawn)), (ROWS, true)] {
        let path = folder.join(name);
        if is_removed && path.exists() {
            std::fs::remove_file(&path).with_context(|| format!("cannot remove {}", path.display()))?;
        }
    }
    Ok(())
}

/// Removes the folders of workers of a campaign that was killed.
fn remove_left_work(folder: &Path) -> Result<()> {
    for entry in std::fs::read_dir(folder)?.flatten() {
        if entry.file_name().to_string_lossy().starts_with(WORK) {
            let path = entry.path();
            std::fs::remove_dir_all(&path).with_context(|| format!("cannot remove {}", path.display()))?;
        }
    }
    Ok(())
}

/// Opens a file of the folder; a link in its place is not followed.
fn opened(path: &Path, options: &mut OpenOptions) -> Result<File> {
    let no_follow = rustix::fs::OFlags::NOFOLLOW.bits() as i32;
    let file = options.custom_flags(no_follow).open(path);
    file.with_context(|| format!("cannot open {}", path.display()))
}

/// Writes the file `name` in `folder` beside its place first; a link in its place is replaced.
fn put(folder: &Path, name: &str, write: impl FnOnce(&mut File) -> Result<()>) -> Result<()> {
    let path = folder.join(name);
    let failed = || format!("cannot write {}", path.display());
    // Readable as the umask says, as other files of the user.
    let permissions = std::os::unix::fs::PermissionsExt::from_mode(0o666);
    let draft = tempfile::Builder::new().prefix(".draft-").permissions(permissions).tempfile_in(folder);
    let mut draft = draft.with_context(failed)?;
    write(draft.as_file_mut()).with_context(failed)?;
    draft.persist(&path).map(drop).with_context(failed)
}

/// The plan in the folder, drawn and written where there is none.
fn plan(folder: &Path, campaign: &Campaign, lock: &mut File) -> Result<Plan> {
    let (path, drawn) = (folder.join(PLAN), Plan::of(campaign));
    let text = drawn.to_csv(campaign)?;
    let digest = sha256(&text);
    if !path.exists() {
        put(folder, PLAN, |file| Ok(file.write_all(&text)?))?;
        lock.set_len(0)?;
        lock.rewind()?;
        lock.write_all(digest.as_bytes())?;
        return Ok(drawn);
    }
    let mut before = String::new();
    lock.read_to_string(&mut before)?;
    if before != digest {
        bail!(
            "{}: it was drawn of a campaign file with other flights, seed, sampling or [[vary]]; choose another --out, or remove \
             the plan to have it drawn again",
            path.display()
        );
    }
    let text = std::fs::read_to_string(&path).with_context(|| format!("cannot read {}", path.display()))?;
    Plan::parse(&path, &text, campaign)
}

/// The rows in the file at `path`, and the length of its whole lines.
fn read(path: &Path, (header, builds): (&Header, Builds)) -> Result<(BTreeMap<u64, Row>, u64)> {
    let shown = path.display();
    let mut reader = BufReader::new(File::open(path).with_context(|| format!("cannot read {shown}"))?);
    let (mut rows, mut whole, mut line, mut number) = (BTreeMap::new(), 0_u64, String::new(), 1);
    while reader.read_line(&mut line).with_context(|| format!("cannot read {shown}"))? > 0
        && line.ends_with('\n')
    {
        if whole == 0 {
            header.require_same(&line, builds).with_context(|| format!("cannot go on with {shown}"))?;
        } else {
            let row: Row = serde_json::from_str(&line).with_context(|| {
                format!("{shown}:{number}: expected a row as JSON; remove the line to fly its flight again")
            })?;
            rows.insert(row.flight, row);
        }
        number += 1;
        whole += line.len() as u64;
        line.clear();
    }
    Ok((rows, whole))
}

#[cfg(test)]
mod tests {
    use super::{Builds, Header, Store};
    use crate::declaration::Campaign;
    use crate::row::Row;
    use std::io::Write as _;

    fn header(build: &str, fingerprint: &str) -> Header {
        let (build, fingerprint) = (build.to_owned(), fingerprint.to_owned());
        Header { build, fingerprint, figures: vec!["f".to_owned()], verdicts: Vec::new() }
    }

    #[test]
    fn a_folder_goes_on_where_it_was_cut_off_and_refuses_others() {
        let text = "manifest = \"a.toml\"\nflights = 3\n[[vary]]\nkey = \"x\"\nvalues = [1]";
        let campaign = Campaign::parse("c.toml".as_ref(), text).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let open = |fingerprint: &str| {
            Store::open(folder.path(), &campaign, &header("1", fingerprint), Builds::Same)
        };
        let (mut store, plan, flown) = open("a").unwrap();
        assert!(flown.is_empty() && plan.flights.len() == 3);
        let row = |flight: u64, drawn: f64| Row {
            flight,
            drawn: vec![drawn],
            figures: vec![Some(0.1), None],
            ..Row::default()
        };
        store.add(&row(1, 1.0)).unwrap();
        // Another attempt may end otherwise.
        store.add(&Row { is_of_host: true, ..row(2, 1.0) }).unwrap();
        // Of a plan that was edited since.
        store.add(&row(0, 7.0)).unwrap();
        let error = open("a").unwrap_err().to_string();
        assert!(error.contains("another campaign is writing"), "{error}");
        write!(store.rows, "{{\"flight\": 2, \"pas").unwrap();
        drop(store);

        let (store, _, flown) = open("a").unwrap();
        assert_eq!(flown.into_values().collect::<Vec<_>>(), [row(1, 1.0)]);
        drop(store);
        let error = format!("{:#}", open("b").unwrap_err());
        assert!(error.contains("flown with other inputs"), "{error}");
        let error = format!(
            "{:#}",
            Store::open(folder.path(), &campaign, &header("2", "a"), Builds::Same).unwrap_err()
        );
        assert!(error.contains("flown by hummingbus 1, this is hummingbus 2"), "{error}");
        let more = Campaign { flights: 4, ..campaign.clone() };
        // Rows were flown: the plan of another campaign file is not drawn over them.
        Store::open(folder.path(), &campaign, &header("2", "a"), Builds::Any).unwrap();
        let error =
            Store::open(folder.path(), &more, &header("1", "a"), Builds::Same).unwrap_err().to_string();
        assert!(error.contains("drawn of a campaign file with other flights"), "{error}");
    }

    #[test]
    fn a_campaign_that_flew_nothing_begins_anew_but_an_edited_plan_stays() {
        let text = "manifest = \"a.toml\"\nflights = 3\n[[vary]]\nkey = \"x\"\nvalues = [1]";
        let campaign = Campaign::parse("c.toml".as_ref(), text).unwrap();
        let more = Campaign { flights: 4, ..campaign.clone() };
        let folder = tempfile::tempdir().unwrap();
        let open = |campaign, fingerprint| {
            Store::open(folder.path(), campaign, &header("1", fingerprint), Builds::Same)
        };
        open(&campaign, "a").unwrap();
        assert_eq!(open(&more, "b").unwrap().1.flights.len(), 4);
        let path = folder.path().join(super::PLAN);
        let edited = std::fs::read_to_string(&path).unwrap().replace("0,1", "0,2");
        std::fs::write(&path, &edited).unwrap();
        assert_eq!(open(&more, "c").unwrap().1.flights[0], [2.0]);
        let error = open(&campaign, "c").unwrap_err().to_string();
        assert!(error.contains("drawn of a campaign file with other flights"), "{error}");
    }

    #[test]
    fn a_folder_with_other_files_is_left_alone() {
        let text = "manifest = \"a.toml\"\nflights = 3\n[[vary]]\nkey = \"x\"\nvalues = [1]";
        let campaign = Campaign::parse("c.toml".as_ref(), text).unwrap();
        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir(folder.path().join("workers")).unwrap();
        let error =
            Store::open(folder.path(), &campaign, &header("1", "a"), Builds::Same).unwrap_err().to_string();
        assert!(error.contains("is not empty, and holds no campaign"), "{error}");
    }
}
