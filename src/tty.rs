//! What the terminal behind an output can do.

use std::io::IsTerminal;

use clap::ColorChoice;
use rustix::event::{PollFd, PollFlags, Timespec, poll};

/// It understands escape sequences: a terminal, and none that calls itself dumb or nothing at all.
pub fn can_draw(output: &impl IsTerminal) -> bool {
    output.is_terminal() && is_known()
}

fn is_known() -> bool {
    std::env::var_os("TERM").is_some_and(|term| !term.is_empty() && term != "dumb")
}

/// It may get colours, see <https://no-color.org>.
pub fn has_color(output: &impl IsTerminal) -> bool {
    let is_unwanted = std::env::var_os("NO_COLOR").is_some_and(|value| !value.is_empty());
    can_draw(output) && !is_unwanted
}

/// For help and usage errors. The usual choice, but for terminals that are not known: it colours
/// them too where `CI` or `CLICOLOR` is set.
pub fn help_color() -> ColorChoice {
    if is_known() { ColorChoice::Auto } else { ColorChoice::Never }
}

/// The terminal behind standard input is gone: its window was closed, its connection cut.
pub fn is_gone() -> bool {
    let input = std::io::stdin();
    let mut input = [PollFd::new(&input, PollFlags::empty())];
    let at_once = Timespec { tv_sec: 0, tv_nsec: 0 };
    poll(&mut input, Some(&at_once)).is_ok()
        && input[0].revents().intersects(PollFlags::HUP | PollFlags::ERR | PollFlags::NVAL)
}
