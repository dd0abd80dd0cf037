//! Names the shared library as programs load it, wherever Cargo puts it.

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    // Programs that link it ask for this name.
    println!("cargo:rustc-cdylib-link-arg=-Wl,-soname,libhummingbus.so");
}
