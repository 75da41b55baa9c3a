//! What the terminal behind an output can do.

use std::io::IsTerminal;

/// It understands escape sequences: a terminal, and none that calls itself dumb or nothing at all.
pub fn can_draw(output: &impl IsTerminal) -> bool {
    let is_known = std::env::var_os("TERM").is_some_and(|term| !term.is_empty() && term != "dumb");
    output.is_terminal() && is_known
}

/// It may get colours, see <https://no-color.org>.
pub fn has_color(output: &impl IsTerminal) -> bool {
    let is_unwanted = std::env::var_os("NO_COLOR").is_some_and(|value| !value.is_empty());
    can_draw(output) && !is_unwanted
}
