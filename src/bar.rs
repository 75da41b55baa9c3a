//! Progress bars on standard error, if it is a terminal. They never block.

use std::io;
use std::sync::{Mutex, MutexGuard, PoisonError};

use indicatif::{ProgressBar, ProgressDrawTarget, TermLike};

use crate::{stderr, tty};

/// Where the terminal does not say how wide it is.
const WIDTH: u16 = 80;

/// A progress bar of `len` steps, or a spinner without a length.
pub fn bar(len: Option<u64>) -> ProgressBar {
    let target = match tty::can_draw(&io::stderr()) {
        true => ProgressDrawTarget::term_like(Box::new(Terminal::default())),
        false => ProgressDrawTarget::hidden(),
    };
    ProgressBar::with_draw_target(len, target)
}

/// A frame of the picture, until it is shown as a whole.
#[derive(Debug, Default)]
struct Terminal(Mutex<String>);

impl Terminal {
    fn frame(&self) -> MutexGuard<'_, String> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn add(&self, text: &str) -> io::Result<()> {
        self.frame().push_str(text);
        Ok(())
    }

    /// Moves the cursor; a zero would still move it by one.
    fn step(&self, n: usize, direction: char) -> io::Result<()> {
        if n > 0 { self.add(&format!("\x1b[{n}{direction}")) } else { Ok(()) }
    }
}

impl TermLike for Terminal {
    fn width(&self) -> u16 {
        let size = rustix::termios::tcgetwinsize(io::stderr());
        size.ok().map(|size| size.ws_col).filter(|width| *width > 0).unwrap_or(WIDTH)
    }

    fn move_cursor_up(&self, n: usize) -> io::Result<()> {
        self.step(n, 'A')
    }

    fn move_cursor_down(&self, n: usize) -> io::Result<()> {
        self.step(n, 'B')
    }

    fn move_cursor_right(&self, n: usize) -> io::Result<()> {
        self.step(n, 'C')
    }

    fn move_cursor_left(&self, n: usize) -> io::Result<()> {
        self.step(n, 'D')
    }

    fn write_line(&self, text: &str) -> io::Result<()> {
        self.add(&format!("{text}\n"))
    }

    fn write_str(&self, text: &str) -> io::Result<()> {
        self.add(text)
    }

    fn clear_line(&self) -> io::Result<()> {
        self.add("\r\x1b[2K")
    }

    fn flush(&self) -> io::Result<()> {
        stderr::sink().push(std::mem::take(&mut *self.frame()).into_bytes());
        Ok(())
    }
}
