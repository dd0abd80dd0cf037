//! Prints docs/effects.md.

fn main() {
    print!("{}", plant::effects::page::markdown());
}
