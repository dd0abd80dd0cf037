//! Input files: each is read once, and every reader gets the bytes of that one reading.
//!
//! A run is made by many processes, some of which start late: a restart, a standby, a swap. A fit reads its vehicle file
//! when it begins and when it writes the new one. If each of them opened the file, an edit in between would mix two files
//! without a word. So [`InputFiles`] reads a file when it is first asked for, keeps its bytes, and gives these to everyone.
//! The launcher writes them into the run directory under their SHA-256; processes read them from there.
//!
//! | room | content |
//! |---|---|
//! | `files` | [`InputFiles`]: the files of a run or a fit |
//! | `kind` | [`FileKind`]: what is known of the files that a parameter names |
//! | `content` | bytes with their SHA-256 |
//! | `store` | files in a folder, named by their SHA-256 |
//! | `near` | the file that was probably meant |
//! | `read` | plain reading from the disk, with a limit |
//! | `tidy` | paths without detours |
//! | [`variables`] | variables of the environment within paths |
//!
//! ```
//! let folder = tempfile::tempdir()?;
//! let path = folder.path().join("gains.toml");
//! std::fs::write(&path, "gain = 1")?;
//! let files = inputs::InputFiles::default();
//! assert_eq!(files.text(&path)?, "gain = 1");
//!
//! std::fs::write(&path, "gain = 2")?;
//! assert_eq!(files.text(&path)?, "gain = 1", "the file was read before");
//! # Ok::<(), std::io::Error>(())
//! ```
#![forbid(unsafe_code)]

mod content;
mod files;
mod kind;
mod near;
mod read;
mod store;
mod tidy;
pub mod variables;

pub use content::{sha256, sha256_of};
pub use files::{InputFile, InputFiles};
pub use kind::{FileKind, FileRole};
pub use read::{TEXT_BYTES_MAX, open, read_bytes};
pub use tidy::tidy;
