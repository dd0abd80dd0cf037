//! Compiles the library that is preloaded into Betaflight's SITL.

use std::env;
use std::path::Path;

const SOURCE: &str = "src/betaflight/lockstep.c";

fn main() {
    println!("cargo::rerun-if-changed={SOURCE}");
    let library = Path::new(&env::var_os("OUT_DIR").expect("cargo sets it")).join("lockstep.so");
    let compiler = cc::Build::new().opt_level(2).warnings(true).pic(true).get_compiler();
    let mut command = compiler.to_command();
    command.args(["-shared", SOURCE, "-ldl", "-lpthread", "-o"]).arg(library);
    let status = command.status().expect("the C compiler starts");
    assert!(status.success(), "{SOURCE} cannot be compiled: {command:?} ended with {status}");
}
