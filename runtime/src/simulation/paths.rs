//! Runs that write to one path: the run that begins, writes, ends or dies next is drawn from a seed; the files are
//! real ones.

use super::sim::Draw;
use crate::claimed_file::{LogClaim, Partial};
use recorder::writer::START;
use std::collections::BTreeSet;
use std::fs;
use std::io::Write as _;
use std::path::Path;

const SEEDS: u64 = 100;
const STEPS: u32 = 40;

/// A run that has claimed its recording and its log.
struct Run {
    recording: Partial,
    log: LogClaim,
    /// Content that it has written.
    content: Option<Vec<u8>>,
}

fn begin(path: &Path, log: &Path) -> Option<Run> {
    let recording = Partial::claim(path).unwrap();
    let log = LogClaim::claim(log).unwrap();
    assert_eq!(recording.is_some(), log.is_some(), "a run has one of its two files");
    let mut log = log?;
    log.begin().unwrap();
    Some(Run { recording: recording?, log, content: None })
}

/// Flies runs to one path, and checks the recordings in the end.
fn live(seed: u64) {
    let folder = tempfile::tempdir().unwrap();
    let (path, log) = (folder.path().join("a.mcap"), folder.path().join("a.log"));
    let mut draw = Draw::new(seed);
    let mut flying: Option<Run> = None;
    let mut left = BTreeSet::new();
    let mut finished = None;
    for step in 0..STEPS {
        match (draw.below(4), flying.take()) {
            (0 | 1, None) => flying = Some(begin(&path, &log).expect("nobody else writes there")),
            (_, None) => {}
            (0, Some(run)) => {
                assert!(begin(&path, &log).is_none(), "seed {seed}, step {step}: two write to one path");
                assert!(run.recording.is_there(), "seed {seed}, step {step}: the first has lost its file");
                flying = Some(run);
            }
            (1, Some(mut run)) => {
                let mut chunk = if run.content.is_none() { START.to_vec() } else { Vec::new() };
                chunk.extend([step.to_le_bytes().as_slice(), &seed.to_le_bytes()].concat());
                (&run.recording.file).write_all(&chunk).unwrap();
                run.content.get_or_insert_default().extend(chunk);
                flying = Some(run);
            }
            (2, Some(run)) if run.content.is_some() => {
                run.recording.finish().unwrap();
                finished = run.content;
            }
            // It dies: its locks go with it, and its file stays.
            (_, Some(Run { recording, log, content })) => {
                drop((recording, log));
                left.extend(content);
            }
        }
    }
    left.extend(flying.and_then(|run| run.content));
    let found = fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().path());
    let recordings = found.filter(|file| file.extension().is_some_and(|extension| extension == "mcap"));
    let mut kept: BTreeSet<Vec<u8>> = recordings.map(|file| fs::read(file).unwrap()).collect();
    assert_eq!(fs::read(&path).ok(), finished, "seed {seed}");
    if let Some(finished) = finished {
        assert!(kept.remove(&finished));
    }
    assert_eq!(kept, left, "seed {seed}: what a run wrote is lost, or is not whole");
}

#[test]
fn of_runs_to_one_path_one_writes_and_nothing_of_the_others_is_lost() {
    (0..SEEDS).for_each(live);
}
