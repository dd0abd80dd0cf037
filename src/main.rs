//! The program `hummingbus`.
#![forbid(unsafe_code)]

fn main() -> std::process::ExitCode {
    hummingbus::cli::main()
}
