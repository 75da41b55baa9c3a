//! The command `skillet`.

use std::process::ExitCode;

fn main() -> ExitCode {
    skillet::main()
}
