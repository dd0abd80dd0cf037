//! The headers of `bindings/c` are what the program prints.

use crate::build::succeed;
use crate::support::{HUMMINGBUS, repository};
use std::fs;
use std::process::Command;

#[test]
fn the_headers_are_what_the_program_prints() {
    for (option, file) in [("--c", "messages.h"), ("--cpp", "messages.hpp")] {
        let mut command = Command::new(HUMMINGBUS);
        command.args(["schema", option]);
        let (printed, path) =
            (succeed(command), repository(&format!("bindings/c/include/hummingbus/{file}")));
        assert!(
            fs::read_to_string(&path).unwrap() == printed,
            "hummingbus schema {option} >{path} writes it"
        );
    }
}
