//! Links that another user has planted in a folder that others may write to are not followed, whoever writes.

use crate::nodes::{manifest, sender};
use crate::skipped::skip;
use crate::support::{Place, repository};
use std::fs::{self, Permissions};
use std::os::unix::fs::{PermissionsExt, lchown, symlink};

const NOBODY: u32 = 65534;

#[test]
fn what_a_planted_link_names_is_never_written_to() {
    let place = Place::new();
    let short = place.write("short.toml", manifest(50, &[sender("source", 1, "")]));
    let hover = repository("manifests/hover.toml");
    let vehicle = repository("vehicles/hummingbird.toml");
    let campaign = repository("manifests/campaigns/hover-robustness.toml");
    // Files of this user that each command would replace, and a folder.
    let mine = |name: &str| place.path(&format!("mine/{name}"));
    fs::create_dir_all(mine("folder")).unwrap();
    let (set, record) = ("run.duration_s=0.05", place.path("own.mcap"));
    place.call(&["run", &hover, "--set", set, "--record", &mine("a.mcap")]).flown();
    place.call(&["plot", &mine("a.mcap"), "--out", &mine("a.html")]).with_code(0);
    place.call(&["plot", &mine("a.mcap"), "--out", &mine("a.svg")]).with_code(0);
    place.call(&["urdf", &vehicle, "--out", &mine("a.urdf")]).with_code(0);
    place.call(&["man", &mine("")]).with_code(0);
    fs::write(mine("a.log"), "").unwrap();
    fs::write(mine("a.trace.json"), "").unwrap();
    let table = ["export", &mine("a.mcap"), "--topic", "/plant/state", "--csv", "--out"];
    place.call(&[&table[..], &[mine("").as_str()]].concat()).with_code(0);
    fs::copy(mine("a.mcap"), mine("b.partial.mcap")).unwrap();
    // As /tmp.
    let shared = |name: &str| place.path(&format!("shared/{name}"));
    fs::create_dir(shared("")).unwrap();
    fs::set_permissions(shared(""), Permissions::from_mode(0o1777)).unwrap();
    let files = ["a.mcap", "a.html", "a.svg", "a.urdf", "a.log", "a.trace.json", "b.partial.mcap"];
    let names = [&files[..], &["hummingbus.1", "plant.state.csv", "folder"]].concat();
    for name in &names {
        symlink(mine(name), shared(name)).unwrap();
        if lchown(shared(name), Some(NOBODY), Some(NOBODY)).is_err() {
            skip("only root can give a link to another user");
            return;
        }
    }
    let before: Vec<_> = names.iter().map(|name| fs::read(mine(name)).ok()).collect();

    let log = format!("process.source.log={}", shared("a.log"));
    let (here, inside) = (shared(""), shared("folder/new"));
    let calls: &[&[&str]] = &[
        &["run", &short, "--record", &shared("a.mcap")],
        &["run", &short, "--record", &shared("b.mcap")],
        &["run", &short, "--record", &shared("folder/new.mcap")],
        &["run", &short, "--record", &record, "--set", &log],
        &["plot", &mine("a.mcap"), "--out", &shared("a.html")],
        &["plot", &mine("a.mcap"), "--out", &shared("a.svg")],
        &["urdf", &vehicle, "--out", &shared("a.urdf")],
        &["profile", &hover, "--set", set, "--record", &record, "--trace", &shared("a.trace.json")],
        &["profile", &hover, "--set", set, "--record", &record, "--html", &shared("a.html")],
        &["man", &shared("")],
        &["man", &shared("folder")],
        &["campaign", &campaign, "--plan-only", "--out", &shared("folder")],
        &[&table[..], &[here.as_str()]].concat(),
        &[&table[..], &[inside.as_str()]].concat(),
        &["new", &shared("folder/drone")],
    ];
    for args in calls {
        let ended = place.call(args).with_code(2);
        ended.says(&[
            &shared(""),
            "is a link of user 65534",
            "is not followed; remove it, or name another file",
        ]);
    }

    let after: Vec<_> = names.iter().map(|name| fs::read(mine(name)).ok()).collect();
    assert_eq!(fs::read_dir(shared("")).unwrap().count(), names.len(), "a file was made beside the links");
    assert!(before == after, "a file behind a link was written to");
    assert_eq!(fs::read_dir(mine("folder")).unwrap().count(), 0, "a file was made behind a link");
    // A folder of the link's owner, closed to all others.
    fs::create_dir(place.path("theirs")).unwrap();
    let theirs = place.path("theirs/a.mcap");
    symlink(mine("a.mcap"), &theirs).unwrap();
    for path in [&theirs, &place.path("theirs")] {
        lchown(path, Some(NOBODY), Some(NOBODY)).unwrap();
    }
    let said = format!("{theirs} is a link of user 65534 in a folder that other users may write to");
    place.call(&["run", &short, "--record", &theirs]).with_code(2).says(&[&said]);
    assert_eq!(fs::read(mine("a.mcap")).ok(), before[0], "a file behind a link was written to");
    // One's own link leads where it leads.
    fs::remove_file(shared("a.html")).unwrap();
    symlink(mine("a.html"), shared("a.html")).unwrap();
    place.call(&["plot", &mine("a.mcap"), "--out", &shared("a.html")]).with_code(0);
    assert!(fs::symlink_metadata(shared("a.html")).unwrap().is_symlink());
}
