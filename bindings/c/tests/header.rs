//! The header that C programs include is that of the code.

use std::path::Path;

/// Set to write the header instead of comparing it.
const WRITE: &str = "HUMMINGBUS_WRITE";

#[test]
fn the_header_is_that_of_the_code() {
    let crate_folder = Path::new(env!("CARGO_MANIFEST_DIR"));
    let config = cbindgen::Config::from_file(crate_folder.join("cbindgen.toml")).unwrap();
    let bindings = cbindgen::generate_with_config(crate_folder, config).unwrap();
    let mut made = Vec::new();
    bindings.write(&mut made);
    let path = crate_folder.join("include/hummingbus/hummingbus.h");
    if std::env::var_os(WRITE).is_some() {
        std::fs::write(&path, &made).unwrap();
    }
    let found = std::fs::read_to_string(&path).unwrap_or_default();
    assert_eq!(found, String::from_utf8(made).unwrap(), "{WRITE}=1 writes {}", path.display());
}
