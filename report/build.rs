//! Compresses the scripts of the pages, which would take 3 MB of the program.

use flate2::{Compression, write::ZlibEncoder};
use std::io::Write;
use std::path::Path;
use std::{env, fs, io};

/// Bundles of plotly.js.
const SCRIPTS: [&str; 2] = ["plotly-basic.min.js", "plotly-gl3d.min.js"];

fn main() -> io::Result<()> {
    let folder = env::var_os("OUT_DIR").expect("cargo sets it");
    for name in SCRIPTS {
        let source = Path::new("src/page").join(name);
        println!("cargo::rerun-if-changed={}", source.display());
        let mut packed = ZlibEncoder::new(Vec::new(), Compression::best());
        packed.write_all(&fs::read(source)?)?;
        fs::write(Path::new(&folder).join(name).with_extension("zlib"), packed.finish()?)?;
    }
    Ok(())
}
