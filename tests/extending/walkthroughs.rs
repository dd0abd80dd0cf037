//! docs/extending.md: its diffs fit the tree, and their new files are those that are compiled here.

use std::collections::BTreeMap;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

fn root() -> PathBuf {
    env!("CARGO_MANIFEST_DIR").into()
}

/// A file of a diff: the heading above, its path, whether it is new, and its hunks' lines with their marks.
struct Change {
    heading: String,
    path: String,
    is_new: bool,
    hunks: Vec<Vec<String>>,
}

/// The changes in the ```diff blocks of `text`.
fn changes(text: &str) -> Vec<Change> {
    let mut changes: Vec<Change> = Vec::new();
    let (mut in_block, mut is_new, mut heading) = (false, false, "");
    for line in text.lines() {
        match line {
            "```diff" => in_block = true,
            "```" => in_block = false,
            _ if !in_block => heading = line.strip_prefix("## ").unwrap_or(heading),
            "--- /dev/null" => is_new = true,
            _ if line.starts_with("--- a/") => is_new = false,
            _ if line.starts_with("+++ b/") => {
                let (heading, path) = (heading.to_owned(), line[6..].to_owned());
                changes.push(Change { heading, path, is_new, hunks: Vec::new() });
            }
            _ if line.starts_with("@@") => changes.last_mut().unwrap().hunks.push(Vec::new()),
            _ => changes.last_mut().unwrap().hunks.last_mut().unwrap().push(line.to_owned()),
        }
    }
    changes
}

/// The lines of a hunk that are there before it, or after it.
fn side(hunk: &[String], mark: char) -> String {
    let of_side = hunk.iter().filter(|line| line.starts_with([' ', mark]) || line.is_empty());
    of_side.map(|line| format!("{}\n", line.get(1..).unwrap_or_default())).collect()
}

/// Returns the compiled file with the name of a walk-through's file, from this folder or one below.
fn compiled(path: &str) -> Option<String> {
    let name = Path::new(path).file_name()?;
    let folders = ["", "messages", "effects/catalogue", "cli"];
    let files = folders.map(|folder| root().join("tests/extending").join(folder).join(name));
    files.iter().find_map(|file| std::fs::read_to_string(file).ok())
}

#[test]
fn every_diff_of_the_page_fits_the_tree_and_every_new_file_is_compiled_as_it_stands() {
    let page = std::fs::read_to_string(root().join("docs/extending.md")).unwrap();
    let changes = changes(&page);
    assert_eq!(
        changes.iter().filter(|change| change.is_new).count(),
        5,
        "a sensor, a law, an effect, a message, a command"
    );
    for Change { path, is_new, hunks, .. } in &changes {
        if *is_new {
            assert!(!root().join(path).exists(), "{path} is in the tree already");
            assert_eq!(compiled(path).as_deref(), Some(&*side(&hunks[0], '+')), "{path}");
            continue;
        }
        let text = std::fs::read_to_string(root().join(path)).unwrap();
        for hunk in hunks {
            let before = side(hunk, '-');
            assert_eq!(text.matches(&before).count(), 1, "{path} has not once:\n{before}");
            assert!(hunk.iter().any(|line| line.starts_with('+')), "{path}: a hunk adds nothing");
        }
    }
}

/// Lines of a new file, number of other files, and lines that those get, for each heading with a diff.
fn costs(changes: &[Change]) -> BTreeMap<String, [usize; 3]> {
    let mut costs = BTreeMap::<String, [usize; 3]>::new();
    for Change { heading, is_new, hunks, .. } in changes {
        let [new_lines, others, lines_there] = costs.entry(heading.to_lowercase()).or_default();
        let lines = hunks.iter().flatten().filter(|line| line.starts_with('+')).count();
        *(if *is_new { new_lines } else { lines_there }) += lines;
        *others += usize::from(!is_new);
    }
    costs
}

#[test]
fn the_page_states_the_files_and_lines_of_each_addition() {
    let page = std::fs::read_to_string(root().join("docs/extending.md")).unwrap();
    let rows = page.lines().filter_map(|line| line.strip_prefix("| [")?.split_once("](#"));
    let stated: BTreeMap<String, [usize; 3]> = rows
        .map(|(addition, rest)| {
            let numbers = rest.split(" | ").skip(1).map(|cell| cell.trim_end_matches(" |").parse().unwrap());
            (addition.to_owned(), numbers.collect::<Vec<usize>>().try_into().unwrap())
        })
        .collect();
    assert_eq!(stated, costs(&changes(&page)));
}

/// As a reader would: one after another, so that no two are about the same lines.
#[test]
fn git_applies_every_diff_of_the_page() {
    let page = std::fs::read_to_string(root().join("docs/extending.md")).unwrap();
    let diffs: String =
        page.split("```diff\n").skip(1).map(|rest| rest.split("```").next().unwrap()).collect();
    let mut git = Command::new("git")
        .args(["apply", "--check", "-"])
        .current_dir(root())
        .stdin(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    git.stdin.take().unwrap().write_all(diffs.as_bytes()).unwrap();
    let ended = git.wait_with_output().unwrap();
    assert!(ended.status.success(), "{}", String::from_utf8_lossy(&ended.stderr));
}
