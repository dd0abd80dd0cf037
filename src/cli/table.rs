//! What makes commands of a table.

/// Makes the commands of a table: their names and help, what they take, and the function that does it; it returns false
/// for exit code 1.
macro_rules! commands {
    ($($(#[$help:meta])* $name:ident($arguments:ty) => $function:path;)*) => {
        #[derive(Subcommand)]
        enum Command {
            $($(#[$help])* $name($arguments),)*
        }

        impl Command {
            fn run(&self) -> Result<bool> {
                match self {
                    $(Self::$name(arguments) => $function(arguments),)*
                }
            }
        }
    };
}

pub(super) use commands;
