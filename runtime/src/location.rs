//! The location that a path names: an opened folder and a name in it. Once it is found, no change of the path can
//! redirect it.
//!
//! A link of another user than root is followed only in a folder into which only this user and root may
//! write. This is stricter than a kernel with `fs.protected_symlinks`: that follows links of a folder's
//! owner, who may have planted them as well.

use anyhow::anyhow;
use rustix::fs::{AtFlags, CWD, FileType, Mode, OFlags, Stat};
use rustix::io::Errno;
use std::ffi::{OsStr, OsString};
use std::fs::File;
use std::io;
use std::os::fd::{AsRawFd as _, OwnedFd};
use std::os::unix::ffi::OsStringExt as _;
use std::path::{Component, Path, PathBuf};
use std::sync::Arc;

/// Symbolic links that are followed, as many as the kernel follows.
const LINKS_MAX: usize = 40;
/// Number of the user root.
const ROOT: u32 = 0;
/// A folder that is opened to name files in it, not to list it.
const FOLDER: OFlags = OFlags::PATH.union(OFlags::DIRECTORY).union(OFlags::NOFOLLOW).union(OFlags::CLOEXEC);

/// Reason why a path names no location for a file.
#[derive(Debug, thiserror::Error)]
pub enum Unlocated {
    /// Its last part is not a name.
    #[error("it names a folder")]
    Folder,
    /// A folder on the way is missing, or is something else.
    #[error("there is no folder {}", .0.display())]
    NoFolder(PathBuf),
    /// A link that another user may have planted.
    #[error(
        "{} is a link of user {owner} in a folder that other users may write to, and is not followed; remove it, or name \
         another file", .link.display()
    )]
    Planted {
        /// The link.
        link: PathBuf,
        /// The number of the user that it belongs to.
        owner: u32,
    },
    /// Links that go round.
    #[error("more than {LINKS_MAX} symbolic links")]
    Links,
    /// The error of the system.
    #[error("{}: {cause}", .at.display())]
    System {
        /// The part of the path.
        at: PathBuf,
        /// Cause.
        cause: io::Error,
    },
}

impl Unlocated {
    /// This reason behind `text` in one message. A refusal of the system stays one.
    pub fn told(self, text: String) -> anyhow::Error {
        let kind = match &self {
            Self::NoFolder(_) => io::ErrorKind::NotFound,
            Self::System { cause, .. } => cause.kind(),
            Self::Folder | Self::Planted { .. } | Self::Links => return anyhow!("{text}: {self}"),
        };
        io::Error::new(kind, format!("{text}: {self}")).into()
    }
}

/// Makes the folder `path` and those above it where they are missing; returns its path without links.
pub fn make_folder(path: &Path) -> Result<PathBuf, Unlocated> {
    Walk::of(path, true)?.into_folder()
}

/// A name in an opened folder; there need not be a file of that name.
#[derive(Clone, Debug)]
pub struct Location {
    folder: Arc<OwnedFd>,
    name: OsString,
    /// The location as a path without links.
    pub path: PathBuf,
}

impl Location {
    /// The location that `path` names, all links followed.
    pub fn find(path: &Path) -> Result<Self, Unlocated> {
        Walk::of(path, false)?.location()
    }

    /// The location `name` in the same folder.
    pub fn sibling(&self, name: &OsStr) -> Self {
        Self { folder: self.folder.clone(), name: name.to_owned(), path: self.path.with_file_name(name) }
    }

    /// Opens the file; neither follows a link nor waits for the other end of a pipe. A new one has the mode that the
    /// user's umask leaves.
    pub fn open(&self, flags: OFlags) -> io::Result<File> {
        let flags = flags | OFlags::NOFOLLOW | OFlags::NONBLOCK | OFlags::NOCTTY | OFlags::CLOEXEC;
        let file = rustix::fs::openat(&self.folder, &self.name, flags, Mode::from_raw_mode(0o666))?;
        Ok(File::from(file))
    }

    /// The entry that lies there, no link followed; `None` for nothing.
    pub fn stat(&self) -> io::Result<Option<Stat>> {
        match rustix::fs::statat(&self.folder, &self.name, AtFlags::SYMLINK_NOFOLLOW) {
            Ok(found) => Ok(Some(found)),
            Err(Errno::NOENT) => Ok(None),
            Err(error) => Err(error.into()),
        }
    }

    /// The path by now: the folder may have been renamed, or moved.
    pub fn current_path(&self) -> PathBuf {
        let folder = std::fs::read_link(format!("/proc/self/fd/{}", self.folder.as_raw_fd()));
        folder.map_or_else(|_| self.path.clone(), |folder| folder.join(&self.name))
    }

    /// True if `file` lies there.
    pub fn holds(&self, file: &File) -> bool {
        let opened = rustix::fs::fstat(file);
        matches!((opened, self.stat()), (Ok(a), Ok(Some(b))) if (a.st_dev, a.st_ino) == (b.st_dev, b.st_ino))
    }

    /// Removes the file.
    pub fn remove(&self) -> io::Result<()> {
        Ok(rustix::fs::unlinkat(&self.folder, &self.name, AtFlags::empty())?)
    }

    /// Moves the file to `to`, replacing the file there.
    pub fn rename(&self, to: &Self) -> io::Result<()> {
        Ok(rustix::fs::renameat(&self.folder, &self.name, &to.folder, &to.name)?)
    }

    /// Gives the file the name `to` as well, where nothing has it.
    pub fn link(&self, to: &Self) -> io::Result<()> {
        Ok(rustix::fs::linkat(&self.folder, &self.name, &to.folder, &to.name, AtFlags::empty())?)
    }
}

/// A path on its way to the location that it names.
struct Walk {
    folder: OwnedFd,
    /// `folder` as a path without links.
    path: PathBuf,
    /// Parts that are still to come, the next one last.
    parts: Vec<OsString>,
    links: usize,
    makes_folders: bool,
}

impl Walk {
    fn of(path: &Path, makes_folders: bool) -> Result<Self, Unlocated> {
        let system = |cause| Unlocated::System { at: path.to_owned(), cause };
        let absolute = std::path::absolute(path).map_err(system)?;
        let folder =
            rustix::fs::openat(CWD, "/", FOLDER, Mode::empty()).map_err(|error| system(error.into()))?;
        let mut walk = Self { folder, path: "/".into(), parts: Vec::new(), links: 0, makes_folders };
        walk.push(&absolute);
        Ok(walk)
    }

    /// Puts the parts of `path` in front of those that are still to come.
    fn push(&mut self, path: &Path) {
        let parts = path.components().filter(|part| !matches!(part, Component::CurDir | Component::RootDir));
        self.parts.extend(parts.rev().map(|part| part.as_os_str().to_owned()));
    }

    fn location(mut self) -> Result<Location, Unlocated> {
        while let Some(name) = self.parts.pop() {
            if name == ".." {
                self.enter(&name)?;
            } else if !self.follow(&name)? {
                if self.parts.is_empty() {
                    let path = self.path.join(&name);
                    return Ok(Location { folder: Arc::new(self.folder), name, path });
                }
                self.enter(&name)?;
            }
        }
        Err(Unlocated::Folder)
    }

    /// The folder that the whole path names, as a path without links.
    fn into_folder(mut self) -> Result<PathBuf, Unlocated> {
        while let Some(name) = self.parts.pop() {
            if name == ".." || !self.follow(&name)? {
                self.enter(&name)?;
            }
        }
        Ok(self.path)
    }

    fn enter(&mut self, name: &OsStr) -> Result<(), Unlocated> {
        let mut opened = rustix::fs::openat(&self.folder, name, FOLDER, Mode::empty());
        if matches!(opened, Err(Errno::NOENT)) && self.makes_folders {
            match rustix::fs::mkdirat(&self.folder, name, Mode::from_raw_mode(0o777)) {
                Ok(()) | Err(Errno::EXIST) => {}
                Err(error) => return Err(self.refused(name, error)),
            }
            opened = rustix::fs::openat(&self.folder, name, FOLDER, Mode::empty());
        }
        self.folder = match opened {
            Ok(folder) => folder,
            Err(Errno::NOENT | Errno::NOTDIR) => return Err(Unlocated::NoFolder(self.path.join(name))),
            Err(error) => return Err(self.refused(name, error)),
        };
        if name == ".." {
            self.path.pop();
        } else {
            self.path.push(name);
        }
        Ok(())
    }

    /// Puts the target of the link `name` in front of the parts that are still to come; false if it is not a link.
    fn follow(&mut self, name: &OsStr) -> Result<bool, Unlocated> {
        let flags = OFlags::PATH | OFlags::NOFOLLOW | OFlags::CLOEXEC;
        let link = match rustix::fs::openat(&self.folder, name, flags, Mode::empty()) {
            Ok(link) => link,
            Err(Errno::NOENT) => return Ok(false),
            Err(error) => return Err(self.refused(name, error)),
        };
        // Owner and target of the same link, even if the name has another file by now.
        let found = rustix::fs::fstat(&link).map_err(|error| self.refused(name, error))?;
        if FileType::from_raw_mode(found.st_mode) != FileType::Symlink {
            return Ok(false);
        }
        let folder = rustix::fs::fstat(&self.folder).map_err(|error| self.refused(name, error))?;
        if !may_follow(&found, &folder) {
            return Err(Unlocated::Planted { link: self.path.join(name), owner: found.st_uid });
        }
        self.links += 1;
        if self.links > LINKS_MAX {
            return Err(Unlocated::Links);
        }
        let target =
            rustix::fs::readlinkat(&link, "", Vec::new()).map_err(|error| self.refused(name, error))?;
        let target = PathBuf::from(OsString::from_vec(target.into_bytes()));
        if target.is_absolute() {
            self.folder = rustix::fs::openat(CWD, "/", FOLDER, Mode::empty())
                .map_err(|error| self.refused(name, error))?;
            self.path = "/".into();
        }
        self.push(&target);
        Ok(true)
    }

    fn refused(&self, name: &OsStr, error: Errno) -> Unlocated {
        Unlocated::System { at: self.path.join(name), cause: error.into() }
    }
}

/// True if this user follows a link in a folder: neither its owner nor one who may write to the folder can have
/// planted it.
fn may_follow(link: &Stat, folder: &Stat) -> bool {
    let follower = rustix::process::geteuid().as_raw();
    let is_trusted = |owner: u32| owner == follower || owner == ROOT;
    let writers = Mode::from_raw_mode(folder.st_mode).intersection(Mode::WGRP | Mode::WOTH);
    is_trusted(link.st_uid) || (is_trusted(folder.st_uid) && writers.is_empty())
}

#[cfg(test)]
mod tests {
    use super::{Location, Unlocated, make_folder};
    use rustix::fs::OFlags;
    use std::io::{Read as _, Write as _};
    use std::os::unix::fs::{PermissionsExt as _, lchown, symlink};
    use std::path::Path;

    const STRANGER: u32 = 1234;

    fn set_mode(folder: &Path, mode: u32) {
        std::fs::set_permissions(folder, std::fs::Permissions::from_mode(mode)).unwrap();
    }

    #[test]
    fn all_spellings_of_a_file_are_one_path() {
        let folder = tempfile::tempdir().unwrap();
        let real = folder.path().canonicalize().unwrap();
        std::fs::create_dir_all(real.join("a/b")).unwrap();
        symlink("a/b", real.join("ab")).unwrap();
        symlink(real.join("a"), real.join("absolute")).unwrap();
        symlink("../../file", real.join("a/b/up")).unwrap();
        let found = |path: &str| Location::find(&real.join(path)).map(|location| location.path);
        for spelling in ["file", "./file", "a/../file", "ab/../../file", "ab/up", "absolute/b/up", "ab/./up"]
        {
            assert_eq!(found(spelling).unwrap(), real.join("file"), "{spelling}");
        }
        assert_eq!(
            found("no/file").unwrap_err().to_string(),
            format!("there is no folder {}/no", real.display())
        );
        assert!(
            matches!(found(".."), Err(Unlocated::Folder)) && matches!(found("/"), Err(Unlocated::Folder))
        );
        assert_eq!(make_folder(&real.join("ab/../new/folders")).unwrap(), real.join("a/new/folders"));
        assert!(real.join("a/new/folders").is_dir());
        assert_eq!(make_folder(&real.join("absolute/.")).unwrap(), real.join("a"));
        std::fs::write(real.join("plain"), "").unwrap();
        assert!(matches!(make_folder(&real.join("plain")), Err(Unlocated::NoFolder(_))));
    }

    #[test]
    fn a_location_stays_where_it_was_found() {
        let folder = tempfile::tempdir().unwrap();
        let [inner, moved, other] = ["inner", "moved", "other"].map(|name| folder.path().join(name));
        std::fs::create_dir(&inner).unwrap();
        std::fs::create_dir(&other).unwrap();
        let location = Location::find(&inner.join("file")).unwrap();
        std::fs::rename(&inner, &moved).unwrap();
        symlink(&other, &inner).unwrap();
        let flags = OFlags::RDWR | OFlags::CREATE | OFlags::EXCL;
        location.open(flags).unwrap().write_all(b"whole").unwrap();
        location.link(&location.sibling("second".as_ref())).unwrap();
        location.rename(&location.sibling("first".as_ref())).unwrap();
        assert!(location.stat().unwrap().is_none());
        let mut text = String::new();
        location.sibling("second".as_ref()).open(OFlags::RDONLY).unwrap().read_to_string(&mut text).unwrap();
        assert_eq!(text, "whole");
        assert_eq!(location.current_path(), moved.canonicalize().unwrap().join("file"));
        assert!(moved.join("first").exists() && std::fs::read_dir(&other).unwrap().next().is_none());
        symlink("first", moved.join("link")).unwrap();
        assert!(location.sibling("link".as_ref()).open(OFlags::RDWR).is_err(), "a link is not followed");
    }

    /// Only root can give a link to another user.
    #[test]
    fn a_link_of_another_user_is_not_followed_where_others_may_write() {
        let folder = tempfile::tempdir().unwrap();
        let [shared, mine] = ["shared", "mine"].map(|name| folder.path().join(name));
        std::fs::create_dir(&shared).unwrap();
        std::fs::create_dir(&mine).unwrap();
        symlink(&mine, shared.join("folder")).unwrap();
        symlink(mine.join("file"), shared.join("file")).unwrap();
        let found = |name: &str| Location::find(&shared.join(name));
        let to_stranger = |link: &str| lchown(shared.join(link), Some(STRANGER), Some(STRANGER));
        set_mode(&shared, 0o1777);
        assert!(found("folder/file").is_ok() && found("file").is_ok(), "one's own are followed");
        if to_stranger("folder").and_then(|()| to_stranger("file")).is_err() {
            crate::skipped::skip("only root can give a link to another user");
            return;
        }
        for (name, link) in [("folder/file", "folder"), ("file", "file")] {
            for mode in [0o1777, 0o777, 0o775] {
                set_mode(&shared, mode);
                let error = found(name).unwrap_err().to_string();
                let expected = format!("{} is a link of user {STRANGER} in", shared.join(link).display());
                assert!(error.starts_with(&expected), "{error}");
            }
            set_mode(&shared, 0o755);
            assert!(found(name).is_ok(), "nobody else can have planted it");
            // The folder's owner can plant links whatever the mode is.
            lchown(&shared, Some(STRANGER), Some(STRANGER)).unwrap();
            for mode in [0o1777, 0o755, 0o700] {
                set_mode(&shared, mode);
                assert!(matches!(found(name), Err(Unlocated::Planted { owner: STRANGER, .. })), "{mode:o}");
            }
            // A link of one's own is followed there, too.
            lchown(shared.join(link), Some(0), Some(0)).unwrap();
            assert!(found(name).is_ok());
            to_stranger(link).unwrap();
            lchown(&shared, Some(0), Some(0)).unwrap();
        }
    }
}
