"""The tool `skillet`, called with --json: what it can do, a script can."""

import json
import os
import shutil
import subprocess
from typing import Any, Optional


class ToolError(Exception):
    """A command of the tool failed; the text is its own. `exit_code` is 2, or 3 where there is no controller."""

    def __init__(self, message: str, exit_code: int):
        super().__init__(message)
        self.exit_code = exit_code


def find() -> str:
    """The executable: $SKILLET, else `skillet` on PATH."""
    given = os.environ.get("SKILLET")
    found = shutil.which(given or "skillet")
    if found is None:
        what = f"SKILLET is {given}, which is no executable" if given else "no `skillet` on PATH"
        raise ToolError(f"{what}: install the tool, or set SKILLET to it", 2)
    return found


def run(*arguments: str, timeout: Optional[float] = None) -> Any:
    """What a command prints as JSON. A negative verdict (exit code 1) is an answer, not an error."""
    try:
        done = subprocess.run([find(), *arguments], stdin=subprocess.DEVNULL, capture_output=True, text=True,
                              timeout=timeout)
    except subprocess.TimeoutExpired:
        raise ToolError(f"`skillet {' '.join(arguments)}` has not answered within {timeout:g} s", 2) from None
    return answer(done.stdout, done.stderr, done.returncode, arguments)


def answer(stdout: str, stderr: str, code: int, arguments: tuple[str, ...]) -> Any:
    try:
        value = json.loads(stdout)
    except ValueError:
        said = stderr.strip() or stdout.strip() or "it said nothing"
        raise ToolError(f"`skillet {' '.join(arguments)}` ended with {code}: {said}", code) from None
    if code > 1:
        error = value.get("error", {}) if isinstance(value, dict) else {}
        raise ToolError(error.get("message", f"`skillet {' '.join(arguments)}` ended with {code}"), code)
    return value
