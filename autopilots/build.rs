//! Compiles the libraries that are preloaded into Betaflight's and PX4's SITL.

use std::env;
use std::path::Path;

/// Sources, and the names of the libraries.
const LIBRARIES: [(&str, &str); 2] =
    [("src/betaflight/lockstep.c", "lockstep.so"), ("src/px4/lockstep.c", "px4_lockstep.so")];

fn main() {
    let folder = env::var_os("OUT_DIR").expect("cargo sets it");
    for (source, name) in LIBRARIES {
        println!("cargo::rerun-if-changed={source}");
        let library = Path::new(&folder).join(name);
        let compiler = cc::Build::new().opt_level(2).warnings(true).pic(true).get_compiler();
        let mut command = compiler.to_command();
        command.args(["-shared", source, "-ldl", "-lpthread", "-o"]).arg(library);
        let status = command.status().expect("the C compiler starts");
        assert!(status.success(), "{source} cannot be compiled: {command:?} ended with {status}");
    }
}
