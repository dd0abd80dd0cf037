//! Names the shared library as programs load it, wherever Cargo puts it.

use std::env::var;

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    // Tables of messages and run directories change with minor versions: a program loads the one that it was linked with.
    let [major, minor] =
        ["CARGO_PKG_VERSION_MAJOR", "CARGO_PKG_VERSION_MINOR"].map(|part| var(part).unwrap_or_default());
    println!("cargo:rustc-cdylib-link-arg=-Wl,-soname,libhummingbus.so.{major}.{minor}");
}
