//! Triangles of a file: Wavefront OBJ, STL and binary glTF.
//!
//! OBJ and STL state neither their unit nor the axis that is up: their numbers are taken as they are, and the
//! scene file's `scale` is the length of one of them. glTF is in metres with y up, and x to the left of a
//! viewer along z (glTF 2.0 specification, section 3.4): it is turned so that z is up and x is kept.

use crate::triangles::Triangles;
use crate::{glb, obj, stl};
use std::path::Path;

/// Formats of mesh files, by the end of their names.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Format {
    Obj,
    Stl,
    Glb,
}

impl Format {
    /// The format of the file at `path`.
    pub(crate) fn of(path: &Path) -> Option<Self> {
        let end = path.extension()?.to_str()?.to_ascii_lowercase();
        match &*end {
            "obj" => Some(Self::Obj),
            "stl" => Some(Self::Stl),
            "glb" => Some(Self::Glb),
            _ => None,
        }
    }

    /// The triangles that `bytes` hold.
    ///
    /// # Errors
    /// In words: the fault of the bytes.
    pub(crate) fn read(self, bytes: &[u8]) -> Result<Triangles, String> {
        let triangles = match self {
            Self::Obj => obj::read(bytes),
            Self::Stl => stl::read(bytes),
            Self::Glb => glb::read(bytes),
        }?;
        triangles.checked()
    }
}
