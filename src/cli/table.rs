//! Macro that makes the commands of a table.

/// Makes the commands of a table: names, help texts, arguments, and the function of each; the function returns false
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
