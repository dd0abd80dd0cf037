//! The headers of `bindings/c` are what the program prints.

use crate::build::{built, succeed};
use crate::support::{HUMMINGBUS, Place, repository};
use hummingbus::COMPONENTS;
use std::fmt::Write as _;
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

/// A language, the end of its headers' names, and the expression of a message's table by its type.
type Language<'a> = (&'a str, &'a str, &'a dyn Fn(&str) -> String);

/// Every table of both headers describes the message that Rust has: arrays, arrays of arrays, sequences, nested messages.
#[test]
fn every_message_of_the_headers_has_the_layout_of_rust() {
    let schemas: Vec<_> = COMPONENTS
        .messages()
        .into_iter()
        .chain(COMPONENTS.states())
        .filter(|schema| !schema.has_text())
        .collect();
    assert!(schemas.len() > 30, "{}", schemas.len());
    let expected = schemas.iter().fold(String::new(), |mut text, schema| {
        let _ = writeln!(text, "{} {:016x}", schema.type_name, schema.layout_hash());
        text
    });
    let header = fs::read_to_string(repository("bindings/c/include/hummingbus/messages.h")).unwrap();
    let in_c = |type_name: &str| {
        let line = header.lines().find(|line| line.contains(&format!(" = {{ \"{type_name}\"")));
        let line = line.unwrap_or_else(|| panic!("no table of {type_name}"));
        format!("&{}", line.split_whitespace().nth(3).unwrap())
    };
    let in_cpp = |type_name: &str| {
        format!(
            "&hummingbus::Message<hummingbus::msgs::{}>::description()",
            type_name.rsplit('/').next().unwrap()
        )
    };
    let languages: [Language<'_>; 2] = [("c", "h", &in_c), ("cpp", "hpp", &in_cpp)];
    for (language, end, name) in languages {
        let place = Place::new();
        let mut source = format!(
            "#include <hummingbus/hummingbus.h>\n#include <hummingbus/messages.{end}>\n#include <inttypes.h>\n\
             #include <stdio.h>\nint main(void) {{\n"
        );
        for schema in &schemas {
            let message = name(schema.type_name);
            let _ = writeln!(
                source,
                "  printf(\"%s %016\" PRIx64 \"\\n\", ({message})->type_name, hb_message_layout_hash({message}));"
            );
        }
        source += "  return 0;\n}\n";
        let (source, program) = (place.write(&format!("layouts.{language}"), source), place.path("layouts"));
        let mut compiler = Command::new(if language == "c" { "cc" } else { "c++" });
        compiler.args([
            if language == "c" { "-std=c11" } else { "-std=c++17" },
            "-Wall",
            "-Werror",
            "-o",
            &program,
            &source,
        ]);
        let (prefix, library) = (&built().prefix, crate::cpp::library_folder());
        compiler.arg(format!("-I{}/include", prefix.display())).arg(format!("-L{library}"));
        compiler.arg(format!("-Wl,-rpath,{library}")).arg("-lhummingbus");
        succeed(compiler);
        assert_eq!(succeed(Command::new(&program)), expected, "{language}");
    }
}
