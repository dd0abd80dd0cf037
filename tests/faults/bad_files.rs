//! Corrupted manifests and truncated recordings: a clear error, never a crash.

use crate::flight::{Reference, manifest};
use crate::skipped::{cases, first};
use crate::support::Place;
use rand_core::Rng;

/// Seed of the corruptions.
const SEED: u64 = 1;

#[test]
fn a_corrupted_manifest_is_refused_with_its_place_or_still_means_something() {
    let place = Place::new();
    let text = manifest().into_bytes();
    let mut random = bus::random::stream(SEED, "corrupted manifest");
    let mut refused = 0;
    let rounds = first(40, "corruptions", 0..120);
    let count = rounds.len();
    for round in rounds {
        let mut corrupted = text.clone();
        let at = random.next_u32() as usize % corrupted.len();
        match round % 3 {
            0 => corrupted[at] = random.next_u32().to_le_bytes()[0],
            1 => corrupted.truncate(at),
            _ => drop(corrupted.drain(at..(at + 20).min(text.len()))),
        }
        let path = place.write("corrupted.toml", &corrupted);
        let ended = place.call(&["check", &path]);
        match ended.code {
            Some(0) => {}
            Some(2) => {
                refused += 1;
                ended.says(&["error: ", &path]);
                assert!(!ended.error.contains("panicked"), "seed {SEED}, round {round}: {ended}");
            }
            _ => panic!("seed {SEED}, round {round}: {ended}"),
        }
    }
    assert!(2 * refused > count, "only {refused} of {count} were refused");
}

#[test]
fn a_truncated_recording_reads_up_to_its_last_whole_chunk() {
    let (place, reference) = (Place::new(), Reference::fly());
    let bytes = reference.bytes();
    let mut ends = Vec::new();
    let parts = cases("lengths", 1..24, |part| part % 3 == 0);
    let count = parts.len();
    for part in parts {
        let cut = place.write("cut.mcap", &bytes[..bytes.len() * part / 24]);
        let diff = place.call(&["diff", &cut, &reference.path()]).with_code(1);
        diff.prints(&[&cut]);
        diff.says(&[&cut, "was cut off, its writer did not finish it"]);
        let cat = place.call(&["cat", &cut, "--topic", "/plant/state"]);
        let Some((_, tick)) = diff.error.trim().split_once("what is whole of it ends after tick ") else {
            diff.prints(&["is a prefix of", "it ends before the first message"]);
            continue;
        };
        if tick == "3999" {
            diff.prints(&["all messages are the same", "was cut off behind its last message"]);
        } else {
            diff.prints(&["is a prefix of", &format!("it ends after tick {tick}\n")]);
        }
        ends.push(tick.parse::<u32>().unwrap());
        assert_eq!(cat.code, Some(1), "{}", cat.error);
        cat.says(&[&format!("what is whole of it ends after tick {tick}")]);
        assert!(cat.output.lines().last().unwrap().contains(&format!("\"tick\":{tick},")));
    }
    assert!(ends.is_sorted() && 2 * ends.len() > count, "{ends:?} of {count}");
}

#[test]
fn a_recording_in_the_place_of_a_manifest_is_refused() {
    let (place, reference) = (Place::new(), Reference::fly());
    let bytes = reference.bytes();
    for path in [place.write("whole.mcap", &bytes), place.write("cut.mcap", &bytes[..bytes.len() / 2])] {
        place.call(&["run", &path]).with_code(2).says(&["error: ", &path]);
    }
}
