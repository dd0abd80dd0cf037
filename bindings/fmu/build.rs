//! Compiles the callback that FMUs of FMI 2.0 log through: it takes any number of arguments, which only C can.

fn main() {
    println!("cargo::rerun-if-changed=src/logger.c");
    cc::Build::new().file("src/logger.c").warnings(true).compile("hummingbus_fmu_logger");
}
